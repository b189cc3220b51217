//! Entry of `NumPy` arrays in the table of formats, and their signature.

use crate::formats::reader::Format;

pub(in crate::formats) const NAME: &str = "npy";

pub(super) const ABOUT: Format = Format {
    name: NAME,
    description: "NumPy array (.npy) with a manifest of its axes",
    extensions: &["npy"],
    reads: true,
    writes: true,
};

/// First bytes of every `NumPy` array file.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";
