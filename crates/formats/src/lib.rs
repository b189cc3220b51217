//! Files of measurements: reading, projection onto tensor axes, compression, preview and export.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use wavelume_formats::pipeline::Request;
//! # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/illuminant_D65.csv");
//! let compressed = wavelume_formats::read(path)?.compress(&Request::er_l2(0.001))?;
//! println!("{} bytes, er(L2) {}", compressed.bytes.len(), compressed.report.errors.er_l2);
//! # Ok(())
//! # }
//! ```
//!
//! file → [`formats`] → [`projection`] → tensor → `wavelume_core` → [`preview`] and [`export`]. [`pipeline`] combines
//! these steps in one call.

mod appearance;
pub mod export;
pub mod formats;
mod notes;
pub mod pipeline;
pub mod preview;
pub mod projection;
mod reading;

pub use pipeline::{Outcome, Report, Request, Source};
#[doc(hidden)]
pub use reading::{MAX_FILE_BYTES, MAX_MANIFEST_BYTES, manifest_beside, read_stream_within, read_within};
pub use reading::{ReadError, read, read_bytes};

use wavelume_core::{compress, domain, evaluate, numeric};
