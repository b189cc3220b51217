//! Text of a client in logs and answers: on one line, without control characters, and bounded.

use crate::trust::without_secrets;

/// Returns `text` on one line, safe to display. Keys and tokens are left out but for their openings; control
/// characters, line separators and marks that change the direction of writing are escaped. Beyond `most` characters the
/// middle is left out.
pub(crate) fn shown(text: &str, most: usize) -> String {
    let text = &*without_secrets(text);
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
