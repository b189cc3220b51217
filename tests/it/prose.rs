//! Sentences that a reader meets without the code: comments, and the descriptions of the HTTP interface.

use super::layering::{folder, sources};
use std::fs;

/// Words that a comment or description must not open with: they refer to something that a reader has not seen.
const NO_OPENING: &[&str] = &["What", "Whether", "How", "Its", "Their", "Those", "Of", "So", "Where", "By", "The same"];
/// Columns within which comment lines wrap.
const COLUMNS: usize = 120;

fn opens_with(text: &str, word: &str) -> bool {
    let rest = text.strip_prefix(word);
    rest.is_some_and(|rest| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_'))
}

/// Returns the words that a comment on an item or a file opens with, if they are among [`NO_OPENING`].
fn wrong_opening(comment: &str) -> Option<&'static str> {
    NO_OPENING.iter().copied().find(|word| opens_with(comment, word))
}

#[test]
fn item_comments_open_with_a_noun_or_a_verb_and_wrap() {
    let mut wrong = Vec::new();
    for folder in ["crates", "src", "tests", "fuzz/src", "fuzz/fuzz_targets", "fuzz/examples"].map(folder) {
        for path in sources(&folder) {
            let text = fs::read_to_string(&path).unwrap();
            let mut is_first = true;
            for (line, number) in text.lines().zip(1..) {
                let comment = line.trim_start();
                let item = ["///", "//!"].into_iter().find_map(|mark| comment.strip_prefix(mark));
                if let Some(word) = item.filter(|_| is_first).and_then(|item| wrong_opening(item.trim_start())) {
                    wrong.push(format!("{}:{number}: a comment opens with `{word}`", path.display()));
                }
                if comment.starts_with("//") && line.chars().count() > COLUMNS {
                    wrong.push(format!("{}:{number}: a comment is longer than {COLUMNS} columns", path.display()));
                }
                is_first = item.is_none();
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Returns the descriptions and summaries of an OpenAPI document in YAML, each with its line: the first line of a text
/// of several lines. The answer of an error lists problem codes, each before its title; these are texts of their own.
fn descriptions(openapi: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut lines = openapi.lines().zip(1..).peekable();
    while let Some((line, number)) = lines.next() {
        let line = line.trim_start().trim_start_matches("- ");
        let stated = ["description: ", "summary: "].into_iter().find_map(|key| line.strip_prefix(key));
        let text = match stated {
            None => continue,
            Some("|-" | "|" | ">-" | ">") => lines.peek().map_or("", |(next, _)| next.trim_start()),
            Some(text) => text.trim_matches('\''),
        };
        found.push((number, text.to_owned()));
        found.extend(text.split("`: ").skip(1).map(|title| (number, title.to_owned())));
    }
    found
}

#[test]
fn descriptions_of_the_http_interface_open_with_a_noun_or_a_verb() {
    let found = descriptions(&fs::read_to_string(folder("openapi.yaml")).unwrap());
    assert!(found.len() > 500, "only {} descriptions were found", found.len());
    let wrong: Vec<_> = found
        .iter()
        .filter(|(_, text)| wrong_opening(text).is_some() || opens_with(text, "It"))
        .map(|(number, text)| format!("openapi.yaml:{number}: {text}"))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn wrong_openings_are_found() {
    assert_eq!(wrong_opening("Where it lies."), Some("Where"));
    assert_eq!(wrong_opening("The same, but larger."), Some("The same"));
    assert_eq!(wrong_opening("Offset of the sample."), None);
    assert_eq!(wrong_opening("Bytes of the file."), None);
    let openapi = "get:\n  summary: |-\n    How it is.\n    So.\n  responses:\n    '400':\n      \
                   description: '`a-b`: Its id; `c`: Where'\n  - description: Item of a list\n";
    let found = descriptions(openapi);
    let texts: Vec<_> = found.iter().map(|(number, text)| (*number, text.as_str())).collect();
    let answer = "`a-b`: Its id; `c`: Where";
    assert_eq!(texts, [(2, "How it is."), (7, answer), (7, "Its id; `c"), (7, "Where"), (8, "Item of a list")]);
}
