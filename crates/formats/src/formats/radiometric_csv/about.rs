//! Entry of radiometric-csv in the table of formats.

use crate::formats::reader::Format;

pub(super) const NAME: &str = "radiometric-csv";

pub(super) const ABOUT: Format = Format {
    name: NAME,
    description: "radiometric-csv: measurements as text that says what they are, long or wide (.csv)",
    extensions: &["csv"],
    reads: true,
    writes: false,
};
