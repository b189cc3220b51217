//! Fields of a manifest by their keys: texts, names of closed lists, and those that say nothing about the numbers.

use super::refusal::unfit;
use crate::domain::UnknownName;
use crate::formats::acquisition::{NoteKind, ParseReport};
use crate::formats::error::FormatError;
use crate::formats::instrument::{self, Instrument};
use crate::formats::text::snippet;
use serde_json::{Map, Value};
use std::str::FromStr;

/// The text under `key`, if there is one.
pub(super) fn text<'a>(fields: &'a Map<String, Value>, key: &str) -> Result<Option<&'a str>, FormatError> {
    match fields.get(key) {
        None | Some(Value::Null) => Ok(None),
        Some(Value::String(text)) => Ok(Some(text)),
        Some(other) => Err(unfit(format!("`{key}` is {}, expected text", snippet(&other.to_string())))),
    }
}

/// A name of a closed list; the refusal quotes no more than its beginning.
pub(super) fn named<T: FromStr<Err = UnknownName>>(name: &str) -> Result<T, FormatError> {
    name.parse()
        .map_err(|error: UnknownName| unfit(UnknownName { found: error.found.chars().take(40).collect(), ..error }))
}

/// Fields that say what the numbers are.
const FIELDS: [&str; 6] = ["axes", "quantity", "value_unit", "unit", "sampling", "cosine_included"];

/// The field that `key` is when one letter, its case or the marks between its words are put right.
///
/// Other keys are metadata: what was measured, and by whom.
fn misspelt(key: &str) -> Option<&'static str> {
    let plain =
        |text: &str| text.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect::<String>();
    let differs_once = |a: &str, b: &str| {
        let before = a.chars().zip(b.chars()).take_while(|(x, y)| x == y).count();
        let (a, b) = (a.chars().skip(before).collect::<Vec<_>>(), b.chars().skip(before).collect::<Vec<_>>());
        let after = a.iter().rev().zip(b.iter().rev()).take_while(|(x, y)| x == y).count();
        a.len().max(b.len()) - after <= 1
    };
    let key = plain(key);
    // Whatever else speaks of the cosine means this one.
    let cosine = key.contains("cosin").then_some("cosine_included");
    cosine.or_else(|| FIELDS.into_iter().chain(instrument::KEYS).find(|field| differs_once(&key, &plain(field))))
}

/// The angles of the instrument, where they are stated.
pub(super) fn instrument(fields: &Map<String, Value>) -> Result<Instrument, FormatError> {
    let [aperture, divergence] =
        instrument::KEYS.map(|key| match fields.get(key) {
            None | Some(Value::Null) => Ok(None),
            Some(value) => value.as_f64().and_then(instrument::checked).map(Some).ok_or_else(|| {
                unfit(format!("{key} {}, expected {}", snippet(&value.to_string()), instrument::EXPECTED))
            }),
        });
    Ok(Instrument::of([aperture?, divergence?]))
}

/// Keeps what does not matter here as metadata, and refuses what would change the meaning of the numbers.
pub(super) fn other_fields(fields: &Map<String, Value>, report: &mut ParseReport) -> Result<(), FormatError> {
    let is_known = |key: &str| FIELDS.contains(&key) || instrument::KEYS.contains(&key);
    for (key, value) in fields.iter().filter(|(key, _)| !is_known(key)) {
        if let Some(field) = misspelt(key) {
            return Err(unfit(format!("field {}, expected `{field}`", snippet(key))));
        }
        match (key.as_str(), value) {
            ("valid" | "sigma", _) => {
                report.note(NoteKind::Skipped, format!("`{key}` names another file, which is not opened"));
            }
            (_, Value::String(text)) => report.metadata.push((key.clone(), text.clone())),
            _ => report.metadata.push((key.clone(), value.to_string())),
        }
    }
    Ok(())
}
