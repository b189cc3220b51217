//! Entry of the ALTA library's format in the table of formats.

use crate::formats::reader::Format;

pub(super) const NAME: &str = "alta";

pub(super) const ABOUT: Format = Format {
    name: NAME,
    description: "ALTA: a BRDF as text, directions or half-angle coordinates and values in rows (.alta, .dat)",
    extensions: &["alta", "dat", "data"],
    reads: true,
    writes: false,
};
