//! Texts that a list is searched for. They are compared in Unicode's composed form (NFC), names and tags in lower case.

use unicode_normalization::UnicodeNormalization;

/// Number of characters from which on a text is found by the search index of SQLite and that of PostgreSQL, which both
/// hold the runs of three characters of each text.
const INDEXED: usize = 3;

/// Text to look for, in the composed form (NFC) and in the decomposed one (NFD). Rows of earlier programs have the form
/// in which the text was typed: macOS decomposes the names of files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Sought {
    pub(super) composed: String,
    /// The decomposed form, if it differs from the composed one.
    pub(super) decomposed: Option<String>,
}

/// Returns a text in the composed form (NFC), in which the catalog keeps names and tags.
pub(super) fn composed(text: &str) -> String {
    if text.is_ascii() { text.to_owned() } else { text.nfc().collect() }
}

/// Returns names and tags as the column `search` keeps them: one a line, composed, in lower case.
pub(super) fn folded<'a>(texts: impl IntoIterator<Item = &'a str>) -> String {
    composed(&composed(&texts.into_iter().collect::<Vec<_>>().join("\n")).to_lowercase())
}

impl Sought {
    /// Returns a text that is compared as a whole, such as a tag.
    pub(super) fn exactly(text: &str) -> Self {
        let composed = composed(text);
        let decomposed: String = composed.nfd().collect();
        Self { decomposed: (decomposed != composed).then_some(decomposed), composed }
    }

    /// Returns a text that may stand anywhere in the names and tags of a row.
    pub(super) fn within(text: &str) -> Self {
        Self::exactly(&folded([text]))
    }

    /// Returns true if the search index finds the text: each of its forms has three characters or more.
    pub(super) fn is_indexed(&self) -> bool {
        self.forms().all(|form| form.chars().nth(INDEXED - 1).is_some())
    }

    /// Returns the patterns with which SQL's `LIKE … ESCAPE '\'` finds both forms as substrings.
    pub(super) fn patterns(&self) -> (String, Option<String>) {
        (pattern(&self.composed), self.decomposed.as_deref().map(pattern))
    }

    /// Returns the condition of FTS5, SQLite's search index, that a column contains the text; empty if the index cannot
    /// tell. The text must be in lower case where the column is.
    pub(super) fn matching(&self, column: &str) -> Option<String> {
        let phrase = |form: &String| format!("\"{}\"", form.replace('"', "\"\""));
        let phrases: Vec<String> = self.forms().map(phrase).collect();
        self.is_indexed().then(|| format!("{column} : ({})", phrases.join(" OR ")))
    }

    fn forms(&self) -> impl Iterator<Item = &String> {
        [&self.composed].into_iter().chain(&self.decomposed)
    }
}

/// Returns the pattern with which SQL's `LIKE … ESCAPE '\'` finds `text` as a substring.
fn pattern(text: &str) -> String {
    let mut pattern = String::from("%");
    for c in text.chars() {
        if matches!(c, '%' | '_' | '\\') {
            pattern.push('\\');
        }
        pattern.push(c);
    }
    pattern.push('%');
    pattern
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_escape_what_like_would_take_for_wild() {
        assert_eq!(Sought::within("50%_A\\").patterns(), ("%50\\%\\_a\\\\%".to_owned(), None));
    }

    #[test]
    fn both_ways_to_write_a_letter_are_one_text() {
        let (composed, decomposed) = ("Dämmerung", "Da\u{308}mmerung");
        assert_eq!(super::composed(decomposed), composed);
        assert_eq!(Sought::exactly(decomposed), Sought::exactly(composed));
        let sought = Sought::within(decomposed);
        assert_eq!((&*sought.composed, sought.decomposed.as_deref()), ("dämmerung", Some("da\u{308}mmerung")));
        assert_eq!(sought.matching("search").unwrap(), "search : (\"dämmerung\" OR \"da\u{308}mmerung\")");
        assert_eq!(folded(["A\u{308}B", "İ"]), "äb\ni\u{307}");
        assert_eq!(Sought::within("say \"x\"").matching("search").unwrap(), "search : (\"say \"\"x\"\"\")");
        assert!(Sought::within("灯具").matching("search").is_none() && !Sought::within("dä").is_indexed());
    }
}
