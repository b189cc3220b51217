//! Sentences that a reader meets without the code: comments, and the descriptions of the HTTP interface.

use super::layering::folder;
use super::pages::files;
use std::ffi::OsStr;
use std::fs;
use std::path::Path;

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

/// Marks of comments in Rust, longest first.
const RUST: &[&str] = &["///", "//!", "//"];
/// Mark of comments in Python, shell and files of settings.
const HASH: &[&str] = &["#"];
/// Mark of comments in SQL.
const SQL: &[&str] = &["--"];
/// Mark at both ends of a docstring.
const DOCSTRING: &str = "\"\"\"";

/// Returns the marks of comments in a file, by its extension or else its first line; `None` for other files.
fn marks(path: &Path, text: &str) -> Option<&'static [&'static str]> {
    match path.extension().and_then(OsStr::to_str) {
        Some("rs") => Some(RUST),
        Some("py" | "sh" | "sbatch" | "service" | "toml" | "yaml" | "yml") => Some(HASH),
        Some("sql") => Some(SQL),
        None if text.starts_with("#!") => Some(HASH),
        _ => None,
    }
}

/// Returns the comments and docstrings of a file that open with a wrong word or do not wrap, each with its line.
fn faults(text: &str, marks: &[&'static str]) -> Vec<String> {
    let mut found = Vec::new();
    let mut before = None;
    let mut is_docstring = false;
    for (line, number) in text.lines().zip(1..) {
        let start = line.trim_start();
        let was_docstring = is_docstring;
        let docstring = start.strip_prefix(DOCSTRING).filter(|_| marks == HASH && !was_docstring);
        is_docstring ^= marks == HASH && line.matches(DOCSTRING).count() % 2 == 1;
        let mark = marks.iter().copied().find(|mark| !was_docstring && start.starts_with(*mark));
        let comment = mark.filter(|mark| before != Some(*mark)).map(|mark| &start[mark.len()..]);
        if let Some(word) = docstring.or(comment).and_then(|text| wrong_opening(text.trim_start())) {
            found.push(format!("{number}: a comment opens with `{word}`"));
        }
        let is_text = mark.is_some() || docstring.is_some() || was_docstring;
        if is_text && line.chars().count() > COLUMNS {
            found.push(format!("{number}: a comment is longer than {COLUMNS} columns"));
        }
        before = mark;
    }
    found
}

#[test]
fn comments_open_with_a_noun_or_a_verb_and_wrap() {
    let mut wrong = Vec::new();
    let mut count = 0;
    // A released migration never changes, not even its comments: databases know it by its bytes.
    for path in files().into_iter().filter(|path| !path.starts_with("migrations")) {
        let bytes = fs::read(folder("").join(&path)).unwrap();
        let Ok(text) = String::from_utf8(bytes) else { continue };
        if let Some(marks) = marks(&path, &text) {
            count += 1;
            wrong.extend(faults(&text, marks).into_iter().map(|fault| format!("{}:{fault}", path.display())));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(count > 900, "only {count} files were read");
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
fn wrong_comments_are_found() {
    let long = "x".repeat(COLUMNS);
    let rust = format!("//! Whether.\n// So.\n// How.\n/// Item.\n/// Where.\nlet x = 1; // Its\n// {long}\n");
    let found = faults(&rust, RUST);
    assert_eq!(found.len(), 3, "{found:?}");
    assert!(found[0].starts_with("1:") && found[1].starts_with("2:") && found[2].starts_with("7:"), "{found:?}");
    let python = format!("#!/bin/x\n\"\"\"How.\n# What\n{long}x\"\"\"\nx = 1\n# By\n\"\"\"Of.\"\"\"\n");
    let found = faults(&python, HASH);
    assert_eq!(found.len(), 4, "{found:?}");
    assert!(found[1].starts_with("4:") && found[3].starts_with("7:"), "{found:?}");
    assert_eq!(faults("-- The same\n-- as before", SQL).len(), 1);
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
