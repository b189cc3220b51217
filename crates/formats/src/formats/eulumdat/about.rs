//! Entry of EULUMDAT in the table of formats.

use crate::formats::reader::Format;

pub(super) const NAME: &str = "eulumdat";

pub(super) const ABOUT: Format =
    Format { name: NAME, description: "EULUMDAT luminaire (.ldt)", extensions: &["ldt"], reads: true, writes: true };
