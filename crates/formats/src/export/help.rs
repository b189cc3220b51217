//! Help texts of an export, made from the table of writers.

use super::writer::Writer;
use crate::domain::Declared;

/// Returns the help text of the option that chooses the export format: the name of each format with its description.
pub(super) fn of_formats<'a>(writers: impl Iterator<Item = &'a Writer>) -> String {
    let formats: Vec<String> = writers.map(|writer| format!("`{}` ({})", writer.name, writer.description)).collect();
    format!("Format to write: {}", one_of(&formats))
}

/// Returns the help text of an export option: the meanings of its value, each with the formats in which it applies,
/// then the text declared for the option.
pub(super) fn of_option<'a>(option: &Declared, writers: impl Iterator<Item = &'a Writer>) -> String {
    let mut meanings: Vec<(&str, Vec<&str>)> = Vec::new();
    for writer in writers {
        let Some((_, meaning)) = writer.options.iter().find(|(name, _)| *name == option.name) else { continue };
        match meanings.iter_mut().find(|(known, _)| known == meaning) {
            Some((_, names)) => names.push(writer.name),
            None => meanings.push((meaning, vec![writer.name])),
        }
    }
    let meanings: Vec<String> =
        meanings.into_iter().map(|(meaning, names)| format!("{meaning} ({})", names.join(", "))).collect();
    let (text, declared) = (one_of(&meanings), option.help.trim());
    let mut letters = text.chars();
    match letters.next() {
        Some(first) => format!("{}{}. {declared}", first.to_uppercase(), letters.as_str()),
        None => declared.to_owned(),
    }
}

/// Lists alternatives: `A, B or C`.
fn one_of(parts: &[String]) -> String {
    match parts {
        [] => String::new(),
        [one] => one.clone(),
        [some @ .., last] => format!("{} or {last}", some.join(", ")),
    }
}
