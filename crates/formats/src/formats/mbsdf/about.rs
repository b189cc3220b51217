//! Entry of MDL measured BSDFs in the table of formats.

use crate::formats::reader::Format;

pub(super) const NAME: &str = "mbsdf";

pub(super) const ABOUT: Format = Format {
    name: NAME,
    description: "NVIDIA MDL measured BSDF (.mbsdf)",
    extensions: &["mbsdf"],
    reads: true,
    writes: true,
};
