//! Entry of TM-33 in the table of formats.

use crate::formats::reader::Format;

pub(super) const NAME: &str = "tm-33";

pub(super) const ABOUT: Format = Format {
    name: NAME,
    description: "IES TM-33 luminaire, also as ATLA S001 and UNI 11733 (.xml, .iesxml)",
    extensions: &["xml", "iesxml", "tm33"],
    reads: true,
    writes: false,
};
