//! Entry of ASD's binary files in the table of formats.

use crate::formats::reader::Format;

pub(super) const NAME: &str = "asd";

pub(super) const ABOUT: Format = Format {
    name: NAME,
    description: "ASD field spectrometer, binary versions 1 to 8 (.asd)",
    extensions: &["asd"],
    reads: true,
    writes: false,
};
