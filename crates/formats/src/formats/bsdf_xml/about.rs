//! Entry of WINDOW BSDFs in the table of formats.

use crate::formats::reader::Format;

pub(super) const NAME: &str = "bsdf-xml";

pub(super) const ABOUT: Format = Format {
    name: NAME,
    description: "BSDF of WINDOW and Radiance: Klems matrices and tensor trees (XML)",
    extensions: &["xml"],
    reads: true,
    writes: false,
};

/// Name of the root element.
pub(super) const ROOT: &str = "WindowElement";
