//! Entry of spectral tables in the table of formats.

use crate::formats::reader::Format;

pub(super) const NAME: &str = "spectral-table";

pub(super) const ABOUT: Format = Format {
    name: NAME,
    description: "spectral table: wavelengths and columns of values as CSV, TSV or blank separated text (.csv, .spd, .txt)",
    extensions: &["csv", "tsv", "spd", "txt", "dat"],
    reads: true,
    writes: true,
};
