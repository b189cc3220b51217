//! Entry of Zemax BSDF files in the table of formats.

use crate::formats::reader::Format;

pub(super) const NAME: &str = "zemax-bsdf";

pub(super) const ABOUT: Format = Format {
    name: NAME,
    description: "Zemax tabular BSDF about the specular direction, text (.bsdf)",
    extensions: &["bsdf"],
    reads: true,
    writes: false,
};
