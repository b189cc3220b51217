//! Coefficients ⇄ bytes: the container, integer models, and the coders of coefficients, classes, corrections and exact samples.
//!
//! Everything here is integer arithmetic on bytes: the same input gives the same bytes, and any bytes give either the same
//! output or an error, on every machine.

mod axes;
mod bytes;
mod classes;
mod coefficients;
mod container;
mod details;
mod error;
mod exact;
mod model;
mod polynomial;
mod range;
mod steps;
mod symbols;
mod text;

pub use axes::{read_axes, write_axes};
pub use bytes::{Reader, Writer};
pub use classes::{Class, code_classes};
pub use coefficients::{NONE, Payload, Rows, code_coefficients, code_corrections};
pub use container::{Announced, Chunk, ChunkKind, Container, MAGIC, VERSION, write_container};
pub use details::{DetailCoder, Surroundings};
pub use error::CodecError;
pub use exact::code_exact;
pub use range::{BitCoder, Decoder, Encoder};
pub use steps::code_steps;
pub use text::{read_text, write_text};
