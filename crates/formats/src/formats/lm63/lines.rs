//! Lines of written LM-63 files: length limit, and lists of numbers broken into lines.

/// Upper bound on the characters of a line in a written LM-63 file. The standard of 1995 has this limit, that of 2002
/// does not.
pub(super) const LONGEST: usize = 132;

/// Writes a list of numbers, broken into lines of at most [`LONGEST`] characters.
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
