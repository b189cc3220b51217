//! Reproduces the tables of the paper this project grew from: our figures beside the printed ones.
//!
//! L. Claustres, M. Paulin, Y. Boucher, *A Wavelet-Based Framework for Acquired Radiometric Quantity Representation and
//! Accurate Physical Rendering*, The Visual Computer, 2006. Its goniometer data are not available; each table states
//! the data it uses instead.

mod data;
mod error;
mod goniometer;
mod render;
mod report;
mod table1;
mod table2;
mod table3;
mod table4;
mod table5;
mod table6;
mod table7;
mod tensors;

pub use error::PaperError;
pub use report::{Cell, Figures, Row, Table};

use wavelume_core::domain::Progress;
use wavelume_core::{compress, domain, transform};
use wavelume_formats::{formats, projection};

/// Numbers of the tables that can be reproduced, of the paper by Claustres, Paulin and Boucher (2006) on wavelet
/// compression.
pub const TABLES: [u8; 7] = [1, 2, 3, 4, 5, 6, 7];

/// Reproduces table `number` of the paper by Claustres, Paulin and Boucher (2006).
pub fn table(number: u8, progress: &dyn Progress) -> Result<Table, PaperError> {
    match number {
        1 => table1::make(progress),
        2 => table2::make(progress),
        3 => table3::make(progress),
        4 => table4::make(progress),
        5 => table5::make(progress),
        6 => table6::make(progress),
        7 => table7::make(progress),
        found => Err(PaperError::NoSuchTable { found }),
    }
}
