//! Head of a Zemax BSDF file: symmetry, channels, side of the surface and angles.

use super::words::Words;
use crate::domain::Quantity;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::text::{Source, listed};

/// Upper bound on the number of comment lines that are kept as metadata.
const MAX_COMMENTS: usize = 100;
/// Upper bound on the bytes of a comment that is kept.
const MAX_COMMENT: usize = 1024;

/// Symmetry of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Symmetry {
    /// Scatter azimuths beyond 180° mirror those below it, about the plane of incidence.
    Plane,
    /// No symmetry about the plane of incidence; the sample is not rotated.
    None,
    /// No symmetry, and rotations of the sample.
    Rotated,
}

impl Symmetry {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Plane => "PlaneSymmetrical",
            Self::None => "ASymmetrical",
            Self::Rotated => "ASymmetrical4D",
        }
    }
}

/// Head of a Zemax BSDF file. Angles are in degrees.
pub(super) struct Header {
    pub(super) symmetry: Symmetry,
    /// True if the file holds tristimulus values X, Y and Z.
    pub(super) is_xyz: bool,
    pub(super) quantity: Quantity,
    pub(super) rotations: Vec<f64>,
    pub(super) incidences: Vec<f64>,
    pub(super) azimuths: Vec<f64>,
    pub(super) radials: Vec<f64>,
}

/// Keywords with which a file begins after its comments.
const FIRST: [&str; 4] = ["Source", "Symmetry", "SpectralContent", "ScatterType"];

/// Returns true if the beginning of a file has the lists of angles of a Zemax BSDF file. Files of `LightTools` list no
/// angles of incidence there.
pub(super) fn is_header(head: &str) -> bool {
    let lines = || head.split(['\n', '\r']).map(str::trim_start);
    let begins = |line: &str, key: &str| line.get(..key.len()).is_some_and(|start| start.eq_ignore_ascii_case(key));
    // Most files of other formats are known by their first line.
    let first = lines().find(|line| !line.is_empty() && !line.starts_with('#'));
    first.is_some_and(|line| FIRST.iter().any(|key| begins(line, key)))
        && ["AngleOfIncidence", "ScatterAzimuth", "ScatterRadial", "SpectralContent"]
            .into_iter()
            .all(|key| lines().any(|line| begins(line, key)))
}

/// Reads the keywords of a file up to the first word of its data, which is not taken.
pub(super) fn read(words: &mut Words<'_>, source: &Source, report: &mut ParseReport) -> Result<Header, FormatError> {
    comments(source, report);
    let (mut symmetry, mut is_xyz, mut quantity) = (None, None, None);
    let mut lists: [Vec<f64>; 4] = Default::default();
    while let Some(key) = words.peek() {
        let lower = key.text.to_ascii_lowercase();
        if matches!(
            lower.as_str(),
            "monochrome" | "tristimulusx" | "tristimulusy" | "tristimulusz" | "databegin" | "tis"
        ) {
            break;
        }
        words.next();
        match lower.as_str() {
            "source" => {
                let token = words.word("the source of the data")?;
                report.metadata.push(("Source".to_owned(), token.text.chars().take(80).collect()));
            }
            "symmetry" => {
                let token = words.word("the symmetry")?;
                symmetry = Some(match token.text.to_ascii_lowercase().as_str() {
                    "planesymmetrical" => Symmetry::Plane,
                    "asymmetrical" => Symmetry::None,
                    "asymmetrical4d" => Symmetry::Rotated,
                    _ => {
                        let expected = "PlaneSymmetrical, ASymmetrical or ASymmetrical4D";
                        return Err(words.refused(FormatErrorKind::Unsupported, token, expected));
                    }
                });
            }
            "spectralcontent" => {
                let token = words.word("the spectral content")?;
                is_xyz = Some(match token.text.to_ascii_lowercase().as_str() {
                    "monochrome" => false,
                    "xyz" => true,
                    _ => return Err(words.refused(FormatErrorKind::Unsupported, token, "Monochrome or XYZ")),
                });
            }
            "scattertype" => {
                let token = words.word("the type of scattering")?;
                quantity = Some(match token.text.to_ascii_lowercase().as_str() {
                    "brdf" => Quantity::Brdf,
                    "btdf" => Quantity::Btdf,
                    _ => return Err(words.refused(FormatErrorKind::Unsupported, token, "BRDF or BTDF")),
                });
            }
            "samplerotation" => lists[0] = words.angles("SampleRotation", (-360.0, 360.0))?,
            "angleofincidence" => lists[1] = words.angles("AngleOfIncidence", (0.0, 90.0))?,
            "scatterazimuth" => lists[2] = words.angles("ScatterAzimuth", (-360.0, 360.0))?,
            "scatterradial" => lists[3] = words.angles("ScatterRadial", (0.0, 180.0))?,
            _ => {
                let expected = "a keyword of Zemax BSDF files, or Monochrome and DataBegin";
                return Err(words.refused(FormatErrorKind::Unsupported, key, expected));
            }
        }
    }
    let missing =
        |name: &str| source.malformed(source.text().len(), format!("no {name}, expected one before the data"));
    let symmetry = symmetry.ok_or_else(|| missing("Symmetry"))?;
    let is_xyz = is_xyz.ok_or_else(|| missing("SpectralContent"))?;
    let quantity = quantity.ok_or_else(|| missing("ScatterType"))?;
    let [mut rotations, incidences, azimuths, radials] = lists;
    for (name, list) in [("AngleOfIncidence", &incidences), ("ScatterAzimuth", &azimuths), ("ScatterRadial", &radials)]
    {
        if list.is_empty() {
            return Err(missing(name));
        }
        report.metadata.push((name.to_owned(), listed(list)));
    }
    if rotations.is_empty() {
        rotations.push(0.0);
    } else {
        report.metadata.push(("SampleRotation".to_owned(), listed(&rotations)));
    }
    if rotations.len() > 1 && symmetry != Symmetry::Rotated {
        let message = format!(
            "{} sample rotations of a file that is {}, expected ASymmetrical4D",
            rotations.len(),
            symmetry.name()
        );
        return Err(source.error(FormatErrorKind::Unsupported, 0, message));
    }
    Ok(Header { symmetry, is_xyz, quantity, rotations, incidences, azimuths, radials })
}

/// Keeps the comments of a file as metadata.
fn comments(source: &Source, report: &mut ParseReport) {
    let comments = source.lines().map(|line| line.text.trim()).filter_map(|line| line.strip_prefix('#'));
    let kept =
        comments.map(|text| text.trim_start_matches('#').trim()).filter(|text| text.chars().any(char::is_alphanumeric));
    let kept = kept.filter(|text| text.len() <= MAX_COMMENT).take(MAX_COMMENTS);
    report.metadata.extend(kept.map(|text| ("comment".to_owned(), text.to_owned())));
}
