//! The name of arrays in the table of formats, what they are, and how each begins.

use crate::formats::reader::Format;

pub(in crate::formats) const NAME: &str = "npy";

pub(super) const ABOUT: Format = Format {
    name: NAME,
    description: "NumPy array (.npy) with a manifest of its axes",
    extensions: &["npy"],
    reads: true,
    writes: true,
};

/// The first bytes of every array.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";
