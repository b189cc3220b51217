//! Job requests, in the names of the command line.

use super::text::{Text, check_text};
use crate::formats::{ArrayManifest, StatedQuantity};
use crate::paper::TABLES;
use crate::pipeline::{OptionError, Request};
use crate::store::Digest;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Job request; `kind` selects its type, `compress` if it is absent.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
#[serde(untagged)]
pub(crate) enum JobRequest {
    /// Make a material of a measurement.
    Compress(Box<CompressRequest>),
    /// Make the report on the paper's tables.
    Paper(PaperRequest),
}

/// The kinds of jobs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Kind {
    /// Compression of a measurement to a material.
    #[default]
    Compress,
    /// Recomputation of the tables of the paper.
    Paper,
}

/// Kind of a request to compress.
#[derive(ToSchema)]
#[serde(rename_all = "snake_case")]
#[allow(dead_code, reason = "describes one of the kinds")]
enum CompressKind {
    /// Compression of a measurement to a material.
    Compress,
}

/// Kind of a request for the paper's tables.
#[derive(ToSchema)]
#[serde(rename_all = "snake_case")]
#[allow(dead_code, reason = "describes one of the kinds")]
enum PaperKind {
    /// Recomputation of the tables of the paper.
    Paper,
}

/// Kind of any request, which decides on its other fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub(crate) struct KindOnly {
    /// Kind of the job. Default: `compress`.
    #[serde(default)]
    pub kind: Kind,
}

/// Compression request; everything but `measurement` and `target` has a default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct CompressRequest {
    /// `compress` (the default).
    #[serde(default)]
    #[schema(value_type = CompressKind, required = false)]
    pub kind: Kind,
    /// Id of the measurement.
    pub measurement: Digest,
    /// Axes of an array, in the form of its manifest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<ArrayManifest>)]
    pub axes: Option<serde_json::Value>,
    /// Quantity, if the file does not state it. `reflectance-factor` (BRF, HCRF) is divided by π to give a BRDF.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quantity: Option<StatedQuantity>,
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
    #[schema(value_type = Vec<Text>, max_items = 32, required = false)]
    pub tags: Vec<String>,
}

/// Request to recompute tables of the paper, beside the printed figures.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PaperRequest {
    /// Always `paper`.
    #[schema(value_type = PaperKind)]
    pub kind: Kind,
    /// Table numbers, 1 to 7, each once, in the desired order. Default: all tables.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Vec<u8>>, min_items = 1, max_items = 7)]
    pub tables: Option<Vec<i64>>,
}

/// Faults of a request that was read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum RequestError {
    /// Texts or numbers of tables that are not allowed.
    #[error("{0}")]
    Text(String),
    /// Option with a value that it does not accept.
    #[error(transparent)]
    Option(OptionError),
}

/// Upper bound on the tags of one material.
const MAX_TAGS: usize = 32;

impl JobRequest {
    /// Checks the request before any data is read.
    pub(crate) fn check(&self) -> Result<(), RequestError> {
        match self {
            Self::Compress(request) => {
                request.check().map_err(RequestError::Text)?;
                request.options.check().map_err(RequestError::Option)
            }
            Self::Paper(request) => request.numbers().map(|_| ()).map_err(RequestError::Text),
        }
    }

    /// Returns the measurement that the job reads, if any.
    pub(crate) fn measurement(&self) -> Option<Digest> {
        match self {
            Self::Compress(request) => Some(request.measurement),
            Self::Paper(_) => None,
        }
    }
}

impl PaperRequest {
    /// Returns the numbers of the tables. The error describes the fault in them.
    pub(crate) fn numbers(&self) -> Result<Vec<u8>, String> {
        let Some(wanted) = &self.tables else { return Ok(TABLES.to_vec()) };
        if wanted.is_empty() {
            return Err("tables: none, expected some of 1 to 7, or no `tables` for all".to_owned());
        }
        let mut numbers = Vec::new();
        for &wanted in wanted {
            let known = TABLES.into_iter().find(|&number| i64::from(number) == wanted);
            let number = known.ok_or_else(|| format!("tables: found {wanted}, expected 1 to 7"))?;
            if numbers.contains(&number) {
                return Err(format!("tables: {number} twice, expected each once"));
            }
            numbers.push(number);
        }
        Ok(numbers)
    }
}

impl CompressRequest {
    /// Checks the client's texts before any measurement is read. The error describes the fault.
    pub(crate) fn check(&self) -> Result<(), String> {
        for (what, text) in [("name", &self.name), ("licence", &self.licence)] {
            if let Some(text) = text {
                check_text(what, text)?;
            }
        }
        if self.tags.len() > MAX_TAGS {
            return Err(format!("{} tags, expected at most {MAX_TAGS}", self.tags.len()));
        }
        self.tags.iter().try_for_each(|tag| check_text("tag", tag))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(extra: &str) -> Result<CompressRequest, serde_json::Error> {
        let measurement = Digest::of(b"");
        serde_json::from_str(&format!("{{\"measurement\":\"{measurement}\",\"target\":{{\"er_l2\":0.01}}{extra}}}"))
    }

    #[test]
    fn defaults_are_those_of_the_command_line() {
        let request = parse("").unwrap();
        assert_eq!(request.options, Request::er_l2(0.01));
        let text = serde_json::to_string(&request).unwrap();
        assert_eq!(serde_json::from_str::<CompressRequest>(&text).unwrap(), request);
    }

    #[test]
    fn unknown_fields_are_named() {
        let error = parse(",\"polcy\":\"rd\"").unwrap_err().to_string();
        assert!(error.contains("unknown field `polcy`"), "{error}");
        assert!(parse(",\"policy\":\"best\"").unwrap_err().to_string().contains("expected one of rd, conventional"));
    }

    #[test]
    fn tables_are_all_or_those_asked_for() {
        let numbers = |extra: &str| {
            let text = format!("{{\"kind\":\"paper\"{extra}}}");
            serde_json::from_str::<PaperRequest>(&text).unwrap().numbers()
        };
        assert_eq!(numbers(""), Ok(TABLES.to_vec()));
        assert_eq!(numbers(",\"tables\":[3,1]"), Ok(vec![3, 1]));
        for (bad, reason) in
            [("", "none"), ("0", "found 0"), ("-1", "found -1"), ("1,300", "found 300"), ("2,2", "2 twice")]
        {
            let refusal = numbers(&format!(",\"tables\":[{bad}]")).unwrap_err();
            assert!(refusal.contains(reason), "{refusal}");
        }
    }

    #[test]
    fn words_have_limits() {
        assert!(parse(",\"name\":\"\"").unwrap().check().is_err());
        assert!(parse(",\"tags\":[\"a\\nb\"]").unwrap().check().is_err());
        assert!(parse(&format!(",\"tags\":[{}\"x\"]", "\"x\",".repeat(40))).unwrap().check().is_err());
        assert!(parse(",\"name\":\"Lampe Nr. 5\",\"tags\":[\"büro\"]").unwrap().check().is_ok());
    }
}
