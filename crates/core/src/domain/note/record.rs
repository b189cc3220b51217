//! A note as reports and JSON documents hold it.

use super::value::NoteValue;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One remark for the user on a measurement or file, as reports and JSON documents hold it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Note {
    /// Kind of the remark, such as a warning or an assumption.
    pub kind: NoteKind,
    /// Text of a remark on a measurement or file: a sentence for people.
    pub message: String,
    /// Stable name of the remark for programs, in kebab case; empty in remarks of earlier versions.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub code: String,
    /// Numbers and names that occur in the sentence of the remark, by field name. The name of a number ends with its
    /// unit, if it has one.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<String, NoteValue>,
}

/// Kind of a remark for the user.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum NoteKind {
    /// Remark that a value was assumed which the file does not state.
    Assumed,
    /// Remark that values were supplied which the file does not contain.
    Filled,
    /// Remark that a part of the file was not used.
    Skipped,
    /// Remark that something in the file or in its values may be wrong, and that the user should look at it.
    Warning,
    /// Remark that a check of the values against physics found, for example, an albedo above 1; the user should judge
    /// the result.
    Checked,
    /// Remark that the program chose axes, a resolution or a fit, with its reason.
    Chosen,
}

impl NoteKind {
    /// Returns the name that JSON uses for the kind of remark on a file, such as `warning`.
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
    /// Creates a remark from its sentence alone, without stable name and values.
    pub fn plain(kind: NoteKind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into(), code: String::new(), values: BTreeMap::new() }
    }

    /// Prefixes the sentence of this remark to the user by `name`, the name of the file that the remark is about.
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
