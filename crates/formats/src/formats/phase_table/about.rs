//! Entry of phase tables in the table of formats.

use crate::formats::reader::Format;

pub(super) const NAME: &str = "phase-table";

pub(super) const ABOUT: Format = Format {
    name: NAME,
    description: "phase function: angle or cosine and value, a list over the cosine, Legendre moments (.txt, .csv, .dat)",
    extensions: &["txt", "csv", "dat"],
    reads: true,
    writes: false,
};
