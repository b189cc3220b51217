//! Fields of a manifest: texts, names of closed lists, and metadata that do not affect the numbers.

use super::refusal::unfit;
use crate::domain::UnknownName;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::FormatError;
use crate::formats::instrument::{self, Instrument};
use crate::formats::text::snippet;
use crate::notes::TextNote;
use serde_json::{Map, Value};
use std::str::FromStr;

/// Returns the text of the field `key` in a JSON object; `None` if it is absent or null.
pub(super) fn text<'a>(fields: &'a Map<String, Value>, key: &str) -> Result<Option<&'a str>, FormatError> {
    match fields.get(key) {
        None | Some(Value::Null) => Ok(None),
        Some(Value::String(text)) => Ok(Some(text)),
        Some(other) => Err(unfit(format!("`{key}` is {}, expected text", snippet(&other.to_string())))),
    }
}

/// Parses a name that must be one of a fixed set; the error quotes only its first 40 characters.
pub(super) fn named<T: FromStr<Err = UnknownName>>(name: &str) -> Result<T, FormatError> {
    name.parse()
        .map_err(|error: UnknownName| unfit(UnknownName { found: error.found.chars().take(40).collect(), ..error }))
}

/// Fields of a manifest that define the meaning of the numbers.
const FIELDS: [&str; 6] = ["axes", "quantity", "value_unit", "unit", "sampling", "cosine_included"];

/// Returns the field of a manifest that `key` misspells: by one letter, by case, or by the marks between words.
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
    // Any other key that mentions the cosine is taken for this one.
    let cosine = key.contains("cosin").then_some("cosine_included");
    cosine.or_else(|| FIELDS.into_iter().chain(instrument::KEYS).find(|field| differs_once(&key, &plain(field))))
}

/// Returns the detector aperture and the source divergence that a manifest states, if any.
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

/// Keeps unknown fields of a manifest as metadata; refuses misspelt fields that would change the meaning of the
/// numbers.
pub(super) fn other_fields(fields: &Map<String, Value>, report: &mut ParseReport) -> Result<(), FormatError> {
    let is_known = |key: &str| FIELDS.contains(&key) || instrument::KEYS.contains(&key);
    for (key, value) in fields.iter().filter(|(key, _)| !is_known(key)) {
        if let Some(field) = misspelt(key) {
            return Err(unfit(format!("field {}, expected `{field}`", snippet(key))));
        }
        match (key.as_str(), value) {
            ("valid" | "sigma", _) => {
                report.note(TextNote::OtherFileNamed { key: key.clone() });
            }
            (_, Value::String(text)) => report.metadata.push((key.clone(), text.clone())),
            _ => report.metadata.push((key.clone(), value.to_string())),
        }
    }
    Ok(())
}
