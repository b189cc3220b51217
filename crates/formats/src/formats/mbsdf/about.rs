//! The name of measured BSDFs of MDL in the table of formats, and what they are.

use crate::formats::reader::Format;

pub(super) const NAME: &str = "mbsdf";

pub(super) const ABOUT: Format = Format {
    name: NAME,
    description: "NVIDIA MDL measured BSDF (.mbsdf)",
    extensions: &["mbsdf"],
    reads: true,
    writes: true,
};
