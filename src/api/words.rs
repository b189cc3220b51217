//! Text of a client in logs and answers: on one line, without control characters, and bounded.

use crate::trust::{holds_secret, without_secrets};

/// Number of times that a path is percent-decoded in search of a key. Raising it finds keys that were encoded more
/// often than once by mistake.
const DECODED: usize = 3;

/// Returns `text` on one line, safe to display. Keys and tokens are left out but for their openings; control
/// characters, line separators and marks that change the direction of writing are escaped. Beyond `most` characters the
/// middle is left out.
pub(crate) fn shown(text: &str, most: usize) -> String {
    let text = &*without_secrets(text);
    if text.len() <= most && text.bytes().all(|b| matches!(b, b' '..=b'~')) {
        return text.to_owned();
    }
    // One character has at most four bytes, so that short texts are not counted.
    if text.len() <= most || text.chars().count() <= most {
        return escaped(text.chars());
    }
    let tail = most / 3;
    let head = most - tail;
    let rest: Vec<char> = text.chars().rev().take(tail).collect();
    let mut out = escaped(text.chars().take(head));
    out.push_str(" … ");
    out.push_str(&escaped(rest.into_iter().rev()));
    out
}

/// Returns the path of a URL, safe to display like the result of [`shown`]. If its percent-encoding hides a key or a
/// token, the decoded path is shown without it.
pub(crate) fn shown_path(path: &str, most: usize) -> String {
    if !path.contains('%') {
        return shown(path, most);
    }
    let mut decoded = path.to_owned();
    for _ in 0..DECODED {
        if decoded.contains('%') {
            decoded = String::from_utf8_lossy(&percent_decoded(&decoded)).into_owned();
        }
    }
    shown(if holds_secret(&decoded) { &decoded } else { path }, most)
}

/// Percent-decodes text; malformed escape sequences stay unchanged.
pub(crate) fn percent_decoded(text: &str) -> Vec<u8> {
    let digit = |b: Option<&u8>| b.and_then(|&b| char::from(b).to_digit(16));
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&first, tail)) = rest.split_first() {
        let escape = (first == b'%').then(|| digit(tail.first()).zip(digit(tail.get(1)))).flatten();
        if let Some((high, low)) = escape {
            bytes.push((high * 16 + low) as u8);
            rest = &tail[2..];
        } else {
            bytes.push(first);
            rest = tail;
        }
    }
    bytes
}

/// Collects characters into a text in which those that disturb a line or a terminal are escaped.
fn escaped(text: impl Iterator<Item = char>) -> String {
    let mut out = String::with_capacity(text.size_hint().1.unwrap_or_default());
    for c in text {
        let turns = matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
        if c.is_control() || turns || matches!(c, '\u{2028}' | '\u{2029}') {
            out.extend(c.escape_default());
        } else {
            out.push(c);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trust::holds_secret;

    #[test]
    fn ordinary_words_stay_as_they_are() {
        assert_eq!(shown("θ = 30°, `größe`: \"x\"", 100), "θ = 30°, `größe`: \"x\"");
        assert_eq!(shown("", 3), "");
    }

    #[test]
    fn keys_and_tokens_are_left_out() {
        for (text, expected) in [
            ("/v1/x/wlm_0123456xyz_-06h9E_30ofMo/content", "/v1/x/wlm_…/content"),
            ("`wlm_a` and wlt_eyJ2.L5x_w%2D, wlm_", "`wlm_…` and wlt_…, wlm_…"),
            ("wlm_wlt_a wlx_b", "wlm_… wlx_b"),
        ] {
            assert_eq!(shown(text, 100), expected);
        }
        assert!(holds_secret("id-wlt_1") && !holds_secret("wlm-1"));
        for (path, expected) in [
            ("/v1/x/wlm%5F0123456xyz%5Fsecret/y", "/v1/x/wlm_…/y"),
            ("/%77lt_secret", "/wlt_…"),
            ("/%2577lm%25255fsecret", "/wlm_…"),
            ("/wlm_a/%77lm_secret", "/wlm_…/wlm_…"),
            ("/a%20b%zz", "/a%20b%zz"),
        ] {
            assert_eq!(shown_path(path, 100), expected);
        }
        let cut = shown(&format!("{}wlm_0123456xyz_secret", "x".repeat(95)), 100);
        assert!(!cut.contains("secret"), "{cut}");
    }

    #[test]
    fn lines_and_terminals_are_not_disturbed() {
        assert_eq!(shown("a\nb\t\u{1b}[31m\0\u{7f}\u{9b}", 100), "a\\nb\\t\\u{1b}[31m\\u{0}\\u{7f}\\u{9b}");
        assert_eq!(shown("x\u{202e}y\u{2028}", 100), "x\\u{202e}y\\u{2028}");
    }

    #[test]
    fn long_words_keep_their_ends() {
        let text = format!("unknown field `{}`, expected one of a, b", "x".repeat(30_000_000));
        let short = shown(&text, 90);
        assert!(short.chars().count() <= 93, "{}", short.len());
        assert!(short.starts_with("unknown field `xxx") && short.ends_with("expected one of a, b"), "{short}");
        assert_eq!(shown(&"ü".repeat(10), 10), "ü".repeat(10));
    }
}
