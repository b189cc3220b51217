//! What a client asks of a job, in the command line's names.

use crate::compress::{Policy, Target};
use crate::formats::StatedQuantity;
use crate::paper::TABLES;
use crate::pipeline::{Curve, Request};
use crate::projection::DirectionDomain;
use crate::store::Digest;
use serde::{Deserialize, Serialize};

/// What a client asks for.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub(crate) enum JobRequest {
    /// A material of a measurement.
    Compress(Box<CompressRequest>),
    /// The report on the paper's tables.
    Paper(PaperRequest),
}

/// The kinds of jobs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Kind {
    /// A measurement to a material.
    #[default]
    Compress,
    /// The tables of the paper.
    Paper,
}

/// The kind in any request: it decides what else may be said.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub(crate) struct KindOnly {
    /// `compress` if nothing is said.
    #[serde(default)]
    pub kind: Kind,
}

/// Compression request; everything but `measurement` and `target` has a default.
#[allow(clippy::struct_excessive_bools, reason = "each is an option of its own")]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CompressRequest {
    /// `compress`, also if nothing is said.
    #[serde(default)]
    pub kind: Kind,
    /// The id of the measurement.
    pub measurement: Digest,
    /// The promise.
    pub target: Target,
    /// The policy.
    #[serde(default)]
    pub policy: Policy,
    /// The spectral basis, or `auto`.
    #[serde(default = "auto")]
    pub basis: String,
    /// Relative floor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor: Option<f64>,
    /// The largest relative error of the light of any direction and wavelength.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub albedo_error: Option<f64>,
    /// Grid of the file or triangles; a level asks for triangles, too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub domain: Option<DirectionDomain>,
    /// The function between stated directions.
    #[serde(default, skip_serializing_if = "Curve::is_default")]
    pub interpolation: Curve,
    /// Replaces each value of a BRDF on its own grid with the mean of it and that of the exchanged pair of directions.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reciprocal: bool,
    /// Subdivision level of the incoming triangles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub incoming_level: Option<u8>,
    /// Subdivision level of the outgoing triangles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outgoing_level: Option<u8>,
    /// `START:STOP:STEP` in nm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wavelengths: Option<String>,
    /// The axes of an array, as its manifest would say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axes: Option<serde_json::Value>,
    /// The quantity, where the file does not say; `reflectance-factor` (BRF, HCRF) is divided by π: a BRDF.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quantity: Option<StatedQuantity>,
    /// Whether the file carries its provenance.
    #[serde(default = "yes")]
    pub metadata: bool,
    /// Whether one incoming direction is decoded without the others.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub random_access: bool,
    /// Refuses a material that adds too much to the noise of scattered samples or has another light than they, instead of warning
    /// of it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub strict: bool,
    /// What to call the material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Under which licence it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub licence: Option<String>,
    /// Tags to find it by.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tags: Vec<String>,
}

/// A wish for tables of the paper.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PaperRequest {
    /// `paper`.
    pub kind: Kind,
    /// Their numbers in the order wanted, each once; all tables if nothing is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tables: Option<Vec<i64>>,
}

/// Characters in a name, file name, licence or tag.
pub(crate) const MAX_TEXT: usize = 200;
/// Tags on one material.
const MAX_TAGS: usize = 32;

fn auto() -> String {
    "auto".to_owned()
}

fn yes() -> bool {
    true
}

impl JobRequest {
    /// What is wrong with it before anything is looked at.
    pub(crate) fn check(&self) -> Result<(), String> {
        match self {
            Self::Compress(request) => request.check(),
            Self::Paper(request) => request.numbers().map(|_| ()),
        }
    }

    /// The measurement that it reads.
    pub(crate) fn measurement(&self) -> Option<Digest> {
        match self {
            Self::Compress(request) => Some(request.measurement),
            Self::Paper(_) => None,
        }
    }
}

impl PaperRequest {
    /// The numbers of the tables, or what is wrong with them.
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
    /// What is wrong with it before any measurement is looked at.
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

    /// The scientific part.
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

/// Whether a user's own word may be kept.
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
