//! The longest lines for which bases and tables are made.

/// The longest line: the synthesis functions of all its coefficients are kept.
pub const MAX_LINE: usize = 4096;
/// The longest line whose Gram matrix is tabulated: n² numbers, 8 MiB at this length.
pub const MAX_GRAM: usize = 1024;
/// The longest line whose couplings are tabulated: n²/2 pairs, each with up to n numbers.
pub const MAX_COUPLED: usize = 512;
/// The most coupling coefficients that are tabulated (128 MiB). A basis whose functions all overlap reaches it at 322
/// samples.
pub const MAX_COUPLINGS: usize = 1 << 24;
