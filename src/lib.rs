//! wavelume: acquired radiometric measurements, compressed with generic wavelet transforms to a promised error.
//!
//! The science is in crates of its own, whose rooms are named here again: `wavelume_core` is what a renderer links,
//! `wavelume_formats` reads, projects and exports files, `wavelume_paper` makes the tables of the paper again.
//! The service stands on these: [`store`] (bytes under their digest) → [`catalog`] (what is known of them) → [`jobs`] →
//! [`api`] and [`cli`].

pub mod api;
pub mod catalog;
pub mod cli;
pub mod jobs;
pub mod store;

pub use wavelume_core::{algebra, codec, compress, domain, evaluate, transform};
pub use wavelume_formats::{export, formats, pipeline, preview, projection};
pub use wavelume_paper as paper;
