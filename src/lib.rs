//! wavelume: acquired radiometric measurements, compressed with generic wavelet transforms to a promised error.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use wavelume::{Direction, Request};
//! # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/data/virtual/plastic.json");
//! let request = Request { incoming_level: Some(1), outgoing_level: Some(2), ..Request::er_l2(0.01) };
//! let compressed = wavelume::read(path)?.compress(&request)?;
//! let material = wavelume::open_bytes(&compressed.bytes)?;
//! let bsdf = material.bsdf()?;
//! let wi = Direction::from_degrees(30.0, 0.0);
//! if let Some(sample) = bsdf.sample(wi, [0.3, 0.6]) {
//!     println!("f = {:?} 1/sr", bsdf.eval(wi, sample.wo));
//! }
//! # Ok(())
//! # }
//! ```
//!
//! The science is in separate crates, whose modules are exported here again: `wavelume_core` is what a renderer links,
//! `wavelume_formats` reads, projects and exports files, `wavelume_paper` makes the tables of the paper again.
//! The service stands on these: `trust` (tenants and keys) → `store` (bytes under their digest) → `catalog` (their
//! metadata in SQL) → `jobs` → [`api`] and `cli`.

pub mod api;
mod catalog;
#[doc(hidden)]
pub mod cli;
mod jobs;
#[doc(hidden)]
pub mod store;
mod trust;

use wavelume_core::numeric;

#[doc(hidden)]
pub use jobs::{Archive, CatalogError, Check, Database, Fault, FsckReport, Place, Site, SweepReport};
pub use wavelume_core::{algebra, compress, domain, evaluate, transform};
pub use wavelume_formats::{export, formats, pipeline, preview, projection};
pub use wavelume_paper as paper;

pub use wavelume_core::domain::Direction;
pub use wavelume_core::evaluate::{EvaluateError, Material};
pub use wavelume_core::roles::{Bsdf, BsdfAt, Emitter, EmitterAt, Phase, PhaseAt, RoleError, Sample, Spectrum};
pub use wavelume_core::{OpenError, open, open_bytes, roles};
pub use wavelume_formats::pipeline::{Outcome, PipelineError, Report, Request, Source};
pub use wavelume_formats::{ReadError, read, read_bytes};

/// Carries the README and `docs/library.md` as documentation, so that the blocks of Rust in both are compiled and run
/// as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
#[doc = include_str!("../docs/library.md")]
struct Pages;
