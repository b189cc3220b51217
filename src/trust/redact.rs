//! Removal of access keys and tokens from texts that are shown or logged.

use super::{key, token};
use std::borrow::Cow;

/// First characters of access keys and of tokens; both have the same length.
const OPENINGS: [&str; 2] = [key::PREFIX, token::PREFIX];

/// Returns true if `text` holds a key or a token, or something like one.
pub(crate) fn holds_secret(text: &str) -> bool {
    OPENINGS.iter().any(|opening| text.contains(opening))
}

/// Returns `text` with every key and token, and words that begin like one, shortened to their first characters:
/// `wlm_…`.
pub(crate) fn without_secrets(text: &str) -> Cow<'_, str> {
    if !holds_secret(text) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = OPENINGS.iter().filter_map(|opening| rest.find(opening)).min() {
        let (before, secret) = rest.split_at(at);
        let (opening, secret) = secret.split_at(OPENINGS[0].len());
        out.extend([before, opening, "…"]);
        // A percent sign, too: an encoded character may stand in the middle.
        rest = secret.trim_start_matches(|c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.' | '%'));
    }
    out.push_str(rest);
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_and_tokens_are_taken_out_of_a_message() {
        for (text, expected) in [
            ("found `wlm_0123456xyz_-06h9E`, expected x", "found `wlm_…`, expected x"),
            ("a wlt_ab.c-d b --wlm_x", "a wlt_… b --wlm_…"),
            ("no key at all", "no key at all"),
            ("wlm_éé", "wlm_…éé"),
            ("", ""),
        ] {
            assert_eq!(without_secrets(text), expected);
        }
    }
}
