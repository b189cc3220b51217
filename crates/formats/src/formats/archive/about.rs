//! Entry of zip archives in the table of formats.

use crate::formats::reader::Format;

pub(super) const NAME: &str = "zip";

pub(in crate::formats) const ABOUT: Format = Format {
    name: NAME,
    description: "zip archive of files of the other formats, one of which is chosen (.zip, .gldf, .npz)",
    extensions: &["zip", "gldf", "npz"],
    reads: true,
    writes: false,
};
