//! Entry of LM-63 in the table of formats.

use crate::formats::reader::Format;

pub(super) const NAME: &str = "lm-63";

pub(super) const ABOUT: Format =
    Format { name: NAME, description: "IES LM-63 luminaire (.ies)", extensions: &["ies"], reads: true, writes: true };
