//! Lines of LM-63 files that are written: how long they are, and lists of numbers broken into them.

/// Characters of a line at most; the standard of 1995 allows no more, that of 2002 does.
pub(super) const LONGEST: usize = 132;

/// A list, in lines that are not too long.
pub(super) fn list(text: &mut String, values: impl Iterator<Item = String>) {
    let mut line = 0;
    for shown in values {
        if line > 0 && line + 1 + shown.len() > LONGEST {
            text.push('\n');
            line = 0;
        }
        if line > 0 {
            text.push(' ');
            line += 1;
        }
        line += shown.len();
        text.push_str(&shown);
    }
    text.push('\n');
}
