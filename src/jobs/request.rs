//! Job requests, in the names of the command line.

use crate::compress::{Policy, Target};
use crate::formats::StatedQuantity;
use crate::paper::TABLES;
use crate::pipeline::{Curve, Request};
use crate::projection::DirectionDomain;
use crate::store::Digest;
use serde::{Deserialize, Serialize};

/// Job request of a client.
#[derive(Clone, Debug, PartialEq, Serialize)]
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

/// Kind of any request, which decides on its other fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub(crate) struct KindOnly {
    /// Kind of the job. Default: `compress`.
    #[serde(default)]
    pub kind: Kind,
}

/// Compression request; everything but `measurement` and `target` has a default.
#[allow(clippy::struct_excessive_bools, reason = "each is an option of its own")]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CompressRequest {
    /// `compress` (the default).
    #[serde(default)]
    pub kind: Kind,
    /// Id of the measurement.
    pub measurement: Digest,
    /// Error bound or size target.
    pub target: Target,
    /// Selection and coding of the coefficients.
    #[serde(default)]
    pub policy: Policy,
    /// Name of the spectral basis, or `auto`.
    #[serde(default = "auto")]
    pub basis: String,
    /// Relative floor, as a fraction of the maximum: smaller samples leave the relative errors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor: Option<f64>,
    /// Upper bound on the relative error of the light of any direction and wavelength.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub albedo_error: Option<f64>,
    /// Directions of the tensor: the grid of the file, or triangles; a subdivision level also asks for triangles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub domain: Option<DirectionDomain>,
    /// Function between stated directions.
    #[serde(default, skip_serializing_if = "Curve::is_default")]
    pub interpolation: Curve,
    /// True to replace each value of a BRDF on its own grid by its mean with the value of the exchanged pair of
    /// directions.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reciprocal: bool,
    /// Subdivision level of the triangles of incoming directions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub incoming_level: Option<u8>,
    /// Subdivision level of the triangles of outgoing directions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outgoing_level: Option<u8>,
    /// Wavelengths to resample to: `START:STOP:STEP` in nm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wavelengths: Option<String>,
    /// Axes of an array, in the form of its manifest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axes: Option<serde_json::Value>,
    /// Quantity, if the file does not state it. `reflectance-factor` (BRF, HCRF) is divided by π to give a BRDF.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quantity: Option<StatedQuantity>,
    /// True to write the provenance into the file.
    #[serde(default = "yes")]
    pub metadata: bool,
    /// True to make each incoming direction decodable without the others.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub random_access: bool,
    /// True to refuse, instead of to warn of, a material that adds too much to the noise of scattered samples or whose
    /// light differs from theirs.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub strict: bool,
    /// Name of the material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Licence of the material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub licence: Option<String>,
    /// Tags of the material.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tags: Vec<String>,
}

/// Request for tables of the paper.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PaperRequest {
    /// Always `paper`.
    pub kind: Kind,
    /// Table numbers in the desired order, each once. Default: all tables.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tables: Option<Vec<i64>>,
}

/// Upper bound in characters on a name, file name, licence or tag.
pub(crate) const MAX_TEXT: usize = 200;
/// Upper bound on the tags of one material.
const MAX_TAGS: usize = 32;

fn auto() -> String {
    "auto".to_owned()
}

fn yes() -> bool {
    true
}

impl JobRequest {
    /// Checks the request before any data is read. The error describes the fault.
    pub(crate) fn check(&self) -> Result<(), String> {
        match self {
            Self::Compress(request) => request.check(),
            Self::Paper(request) => request.numbers().map(|_| ()),
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

    /// Returns the request for the pipeline.
    pub(crate) fn pipeline(&self) -> Request {
        Request {
            target: self.target,
            policy: self.policy,
            basis: self.basis.clone(),
            floor: self.floor,
            albedo_error: self.albedo_error,
            domain: self.domain,
            reciprocal: self.reciprocal,
            incoming_level: self.incoming_level,
            outgoing_level: self.outgoing_level,
            wavelengths: self.wavelengths.clone(),
            metadata: self.metadata,
            random_access: self.random_access,
            interpolation: self.interpolation,
            strict: self.strict,
        }
    }
}

/// Checks a text that a user chose: 1 to [`MAX_TEXT`] characters, none of them a control character.
pub(crate) fn check_text(what: &str, text: &str) -> Result<(), String> {
    let length = text.chars().count();
    if length == 0 || length > MAX_TEXT {
        return Err(format!("a {what} of {length} characters, expected 1 to {MAX_TEXT}"));
    }
    if text.chars().any(char::is_control) {
        return Err(format!("a {what} with control characters"));
    }
    Ok(())
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
        assert_eq!(request.pipeline(), Request::to(Target::ErL2(0.01)));
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
