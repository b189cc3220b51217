//! Coding to and from bytes: the container, integer models, and the coders of coefficients, classes, corrections and
//! exact samples.
//!
//! All arithmetic gives identical results on every machine. Equal input gives equal bytes, and any bytes give either
//! the same output or an error.

mod axes;
mod bytes;
mod classes;
mod coefficients;
mod container;
mod details;
mod error;
mod exact;
mod grid_classes;
mod model;
mod polynomial;
mod provenance;
mod range;
mod residuals;
mod spacing;
mod steps;
mod symbols;
mod text;
mod wide_classes;

pub(crate) use axes::{read_axes, write_axes};
pub(crate) use bytes::{Reader, Writer};
pub(crate) use classes::{Class, code_classes};
pub(crate) use coefficients::{NONE, Payload, Rows, code_coefficients, code_corrections};
pub(crate) use container::{Announced, Chunk, ChunkKind, Container, MAGIC, write_chunk, write_container};
pub(crate) use details::{DetailCoder, Surroundings};
pub use error::CodecError;
pub(crate) use exact::code_exact;
pub(crate) use grid_classes::{ClassGrid, code_grid_classes};
pub(crate) use provenance::{read_provenance, write_provenance};
pub(crate) use range::{BitCoder, Decoder, Encoder};
pub(crate) use residuals::{DEPTHS, Expected, ResidualCoder, code_number};
pub(crate) use steps::{code_flags, code_steps};
pub(crate) use text::{TYPICAL, read_text, write_text};
pub(crate) use wide_classes::code_wide_classes;
