//! Entry of RGL materials in the table of formats.

use crate::formats::reader::Format;

pub(super) const NAME: &str = "rgl";

pub(super) const ABOUT: Format = Format {
    name: NAME,
    description: "RGL/EPFL measured material, a tensor file (.bsdf)",
    extensions: &["bsdf"],
    reads: true,
    writes: true,
};
