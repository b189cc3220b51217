//! Compression requests, in the names of the command line, and the faults of any request.

use super::options::LaterOptions;
use super::text::{MAX_TAGS, Tags, Text, check_text};
use crate::catalog::Priority;
use crate::pipeline::{OptionError, Request};
use crate::store::Digest;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Value of `kind` in a request for a compression job: always `compress`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum CompressKind {
    /// Compression of a measurement to a material.
    #[default]
    Compress,
}

/// Request to compress a measurement; every field except `measurement` has a default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct CompressRequest {
    /// Kind of the job: `compress`, the default.
    #[serde(default)]
    #[schema(required = false)]
    pub kind: CompressKind,
    /// Id of the measurement.
    pub measurement: Digest,
    /// Options for reading the measurement, which replace those that its upload stated.
    #[serde(flatten)]
    pub reading: LaterOptions,
    /// Options of the compression.
    #[serde(flatten)]
    pub options: Request,
    /// Name of the material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Text>)]
    pub name: Option<String>,
    /// Licence of the material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Text>)]
    pub licence: Option<String>,
    /// Tags of the material.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(value_type = Tags, required = false)]
    pub tags: Vec<String>,
    /// Priority of the job.
    #[serde(default, skip_serializing_if = "Priority::is_left_out")]
    #[schema(required = false)]
    pub priority: Priority,
}

/// Faults in the content of a well-formed job request: in its texts, table numbers or compression options.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum RequestError {
    /// A job request has an invalid text, such as the material's name, licence or tags, or an invalid number of a table
    /// of Claustres et al. (2006).
    #[error("the job request has an invalid value: {0}")]
    Text(String),
    /// An option of the compression with a value that it does not accept.
    #[error(transparent)]
    Option(OptionError),
}

impl CompressRequest {
    /// Checks the material's name, licence and tags that the client states, before the measurement is read. The error
    /// describes the fault.
    pub(super) fn check_texts(&self) -> Result<(), String> {
        check_names(self.name.as_ref(), self.licence.as_ref(), &self.tags)
    }
}

/// Checks the name, licence and tags that a client gives to a material. The error describes the fault.
pub(super) fn check_names(name: Option<&String>, licence: Option<&String>, tags: &[String]) -> Result<(), String> {
    for (what, text) in [("name", name), ("licence", licence)] {
        if let Some(text) = text {
            check_text(what, text)?;
        }
    }
    if tags.len() > MAX_TAGS {
        return Err(format!("{} tags, expected at most {MAX_TAGS}", tags.len()));
    }
    tags.iter().try_for_each(|tag| check_text("tag", tag))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn parse(extra: &str) -> Result<CompressRequest, serde_json::Error> {
        let measurement = Digest::of(b"");
        serde_json::from_str(&format!("{{\"measurement\":\"{measurement}\",\"target\":{{\"er_l2\":0.01}}{extra}}}"))
    }

    #[test]
    fn defaults_are_those_of_the_command_line() {
        let request = parse("").unwrap();
        assert_eq!(request.options, Request::er_l2(0.01));
        let measurement = json!({ "measurement": request.measurement });
        assert_eq!(serde_json::from_value::<CompressRequest>(measurement).unwrap(), request);
        let text = serde_json::to_string(&request).unwrap();
        assert_eq!(serde_json::from_str::<CompressRequest>(&text).unwrap(), request);
    }

    #[test]
    fn a_priority_is_no_part_of_the_request_that_is_kept() {
        let batch = parse(",\"priority\":1").unwrap();
        assert_eq!((batch.priority, parse("").unwrap().priority), (Priority::Batch, Priority::Usual));
        assert_eq!(serde_json::to_string(&batch).unwrap(), serde_json::to_string(&parse("").unwrap()).unwrap());
        let error = parse(",\"priority\":2").unwrap_err().to_string();
        assert!(error.contains("found 2, expected -1 (urgent), 0 (usual) or 1 (batch)"), "{error}");
    }

    #[test]
    fn unknown_fields_are_named() {
        let error = parse(",\"polcy\":\"rd\"").unwrap_err().to_string();
        assert!(error.contains("unknown field `polcy`"), "{error}");
        assert!(parse(",\"policy\":\"best\"").unwrap_err().to_string().contains("expected one of rd, conventional"));
    }

    #[test]
    fn words_have_limits() {
        assert!(parse(",\"name\":\"\"").unwrap().check_texts().is_err());
        assert!(parse(",\"tags\":[\"a\\nb\"]").unwrap().check_texts().is_err());
        assert!(parse(&format!(",\"tags\":[{}\"x\"]", "\"x\",".repeat(40))).unwrap().check_texts().is_err());
        assert!(parse(",\"name\":\"Lampe Nr. 5\",\"tags\":[\"büro\"]").unwrap().check_texts().is_ok());
    }
}
