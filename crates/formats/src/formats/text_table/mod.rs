//! Tables of numbers in a text: separator, decimal mark, quotes, names of columns, rows, and the text around them.
//!
//! A format finds the numbers with [`layout::find`], names the columns with [`header::of`], decides what each column
//! is, and reads the rows with [`rows::read`].

pub(super) mod cells;
pub(super) mod header;
pub(super) mod layout;
pub(super) mod lines;
pub(super) mod rows;
