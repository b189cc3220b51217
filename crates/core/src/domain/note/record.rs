//! A note as reports and JSON documents hold it.

use super::value::NoteValue;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One remark for the user, as reports and JSON documents hold it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Note {
    /// Kind of the remark.
    pub kind: NoteKind,
    /// A sentence for people.
    pub message: String,
    /// Stable name for programs, in kebab case; empty in notes of earlier versions.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub code: String,
    /// Numbers and names in the sentence. A name ends with the unit, if there is one.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<String, NoteValue>,
}

/// Subject of a remark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum NoteKind {
    /// A value that the file does not state was assumed.
    Assumed,
    /// Values that the file does not contain were supplied.
    Filled,
    /// A part of the file was not used.
    Skipped,
    /// A finding that the user should look at.
    Warning,
    /// A check of the values against physics, for the user to judge.
    Checked,
    /// A choice of axes, cells or fits, with its reason.
    Chosen,
}

impl NoteKind {
    /// Returns the name as in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Assumed => "assumed",
            Self::Filled => "filled",
            Self::Skipped => "skipped",
            Self::Warning => "warning",
            Self::Checked => "checked",
            Self::Chosen => "chosen",
        }
    }
}

impl Note {
    /// Creates a note of its sentence alone, without code and values.
    pub fn plain(kind: NoteKind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into(), code: String::new(), values: BTreeMap::new() }
    }

    /// Returns the note with its sentence prefixed by the name of the file that it is about.
    #[must_use]
    pub fn about(mut self, name: &str) -> Self {
        self.message = format!("{name}: {}", self.message);
        self
    }
}

impl std::fmt::Display for Note {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message)
    }
}
