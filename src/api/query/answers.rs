//! Answers of a batch as JSON, as lines, and as little-endian f32.

use super::super::schemas::Angles;
use super::media::Encoding;
use super::question::Question;
use crate::domain::Unit;
use crate::evaluate::{DirectionSample, Material};
use serde::{Serialize, Serializer};
use utoipa::ToSchema;

/// Answers of a batch of queries, one for each query, in the order of the queries.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Answers {
    /// Spectra or albedos, concatenated: `width` values (one for each wavelength) for each query.
    Rows { values: Vec<f32>, width: usize },
    /// Probability densities in sr⁻¹, one for each pair of directions.
    Densities(Vec<f64>),
    /// Randomly drawn directions, one for each query; `None` if nothing is emitted or reflected.
    Samples(Vec<Option<DirectionSample>>),
}

/// One spectrum of a material, as a JSON answer.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Spectrum)]
pub(super) struct SpectrumAnswer {
    /// Wavelengths of the values in nm; null for data without wavelengths.
    pub(super) wavelengths: Option<Vec<f64>>,
    /// Values of the spectrum, one for each wavelength; null if masked.
    #[schema(value_type = Vec<Option<f32>>)]
    pub(super) values: Vec<f32>,
    #[schema(value_type = Unit)]
    pub(super) unit: Unit,
    /// True if the incoming direction lies beyond the last measured polar angle; absent otherwise.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) extrapolated: bool,
}

/// Spectra of a material, one for each pair of directions, as a JSON answer.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Spectra)]
pub(super) struct EvaluateAnswer {
    /// Wavelengths of the values in nm; null for data without wavelengths.
    wavelengths: Option<Vec<f64>>,
    /// Values of the spectra, indexed `[pair of directions][wavelength]`; null where masked.
    #[schema(value_type = Vec<Vec<Option<f32>>>)]
    values: Rows,
    #[schema(value_type = Unit)]
    unit: Unit,
}

/// Integral over all outgoing directions under one incoming direction: ∫ f · |cos θo| dωo for a BRDF or BTDF, ∫ f dωo
/// otherwise.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Albedo)]
pub(super) struct AlbedoAnswer {
    /// Wavelengths of the values in nm; null for data without wavelengths.
    pub(super) wavelengths: Option<Vec<f64>>,
    /// Integral over all outgoing directions, one value for each wavelength, in the material's unit times sr; null if
    /// masked.
    #[schema(value_type = Vec<Option<f32>>)]
    pub(super) values: Vec<f32>,
}

/// Integrals over all outgoing directions, one for each incoming direction, as a JSON answer.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Albedos)]
pub(super) struct AlbedosAnswer {
    /// Wavelengths of the values in nm; null for data without wavelengths.
    wavelengths: Option<Vec<f64>>,
    /// Integrals over all outgoing directions, indexed `[incoming direction][wavelength]`, in the material's unit times
    /// sr; null where masked.
    #[schema(value_type = Vec<Vec<Option<f32>>>)]
    values: Rows,
}

/// Probability densities of drawing a direction, one for each pair of directions, as a JSON answer.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Densities)]
pub(super) struct PdfAnswer {
    /// Probability densities in sr⁻¹ with which each outgoing direction is drawn.
    pdf: Vec<f64>,
}

/// Randomly drawn outgoing directions, as parallel arrays of a JSON answer.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Samples)]
pub(super) struct SampleAnswer {
    /// Drawn directions `[θ, φ]` in degrees; null where nothing is emitted or reflected.
    #[schema(value_type = Vec<Option<Angles>>)]
    directions: Vec<Option<[f64; 2]>>,
    /// Probability densities of the drawn directions in sr⁻¹.
    pdf: Vec<f64>,
    /// Monte Carlo weights of the drawn directions: f · |cos θo| / pdf for a BRDF or BTDF, f / pdf otherwise. f is the
    /// mean over the wavelengths, each counted alike whatever its distance to the next.
    weight: Vec<f64>,
    /// Unit of the weights: that of the material times sr, such as `mW/nm` for a lamp in mW/sr/nm and `1` for a BRDF.
    weight_unit: &'static str,
}

/// Values of the answers to a batch, written to JSON as an array with one row of values for each query.
#[derive(Debug)]
struct Rows {
    values: Vec<f32>,
    width: usize,
}

impl Serialize for Rows {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        // JSON has no NaN: masked values are written as null.
        serializer.collect_seq(self.values.chunks(self.width.max(1)))
    }
}

#[derive(Serialize)]
struct RowLine<'a> {
    values: &'a [f32],
}

#[derive(Serialize)]
struct PdfLine {
    pdf: f64,
}

#[derive(Serialize)]
struct SampleLine {
    direction: Option<[f64; 2]>,
    pdf: f64,
    weight: f64,
}

impl SampleLine {
    fn of(drawn: Option<&DirectionSample>) -> Self {
        Self {
            direction: drawn.map(|s| [s.direction.theta_degrees(), s.direction.phi_degrees()]),
            pdf: drawn.map_or(0.0, |s| s.pdf),
            weight: drawn.map_or(0.0, |s| s.weight),
        }
    }
}

impl Answers {
    /// Returns the number of queries of a batch whose answers are in this list.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Rows { values, width } => values.len() / (*width).max(1),
            Self::Densities(densities) => densities.len(),
            Self::Samples(samples) => samples.len(),
        }
    }

    /// Appends `more`, the answers to the next queries of the same batch.
    pub(super) fn append(&mut self, more: Self) {
        match (self, more) {
            (Self::Rows { values, .. }, Self::Rows { values: more, .. }) => values.extend(more),
            (Self::Densities(densities), Self::Densities(more)) => densities.extend(more),
            (Self::Samples(samples), Self::Samples(more)) => samples.extend(more),
            _ => debug_assert!(false, "answers of one question are of one kind"),
        }
    }

    /// Encodes the answers as a part of a streamed HTTP response (NDJSON lines or f32).
    pub(super) fn bytes(&self, encoding: Encoding) -> serde_json::Result<Vec<u8>> {
        match encoding {
            Encoding::Floats => Ok(self.floats()),
            Encoding::Json | Encoding::Lines => self.lines(),
        }
    }

    fn floats(&self) -> Vec<u8> {
        match self {
            Self::Rows { values, .. } => {
                let mut out = vec![0; 4 * values.len()];
                for (bytes, value) in out.chunks_exact_mut(4).zip(values) {
                    bytes.copy_from_slice(&value.to_le_bytes());
                }
                out
            }
            Self::Densities(densities) => densities.iter().flat_map(|pdf| (*pdf as f32).to_le_bytes()).collect(),
            Self::Samples(samples) => {
                let four = samples.iter().flat_map(|drawn| {
                    let SampleLine { direction, pdf, weight } = SampleLine::of(drawn.as_ref());
                    let [theta, phi] = direction.unwrap_or([f64::NAN; 2]);
                    [theta, phi, pdf, weight]
                });
                four.flat_map(|value| (value as f32).to_le_bytes()).collect()
            }
        }
    }

    fn lines(&self) -> serde_json::Result<Vec<u8>> {
        let mut out = Vec::new();
        let mut write = |line: &dyn Fn(&mut Vec<u8>) -> serde_json::Result<()>| {
            line(&mut out)?;
            out.push(b'\n');
            Ok(())
        };
        match self {
            Self::Rows { values, width } => {
                values
                    .chunks((*width).max(1))
                    .try_for_each(|values| write(&|out| serde_json::to_writer(out, &RowLine { values })))?;
            }
            Self::Densities(densities) => {
                densities.iter().try_for_each(|&pdf| write(&|out| serde_json::to_writer(out, &PdfLine { pdf })))?;
            }
            Self::Samples(samples) => {
                samples
                    .iter()
                    .try_for_each(|drawn| write(&|out| serde_json::to_writer(out, &SampleLine::of(drawn.as_ref()))))?;
            }
        }
        Ok(out)
    }

    /// Encodes all answers of a batch as one JSON object.
    pub(super) fn json(self, question: &Question, material: &Material) -> serde_json::Result<Vec<u8>> {
        match self {
            Self::Rows { values, width } => {
                let values = Rows { values, width };
                if let Question::Evaluate { wavelengths, .. } = question {
                    let wavelengths = wavelengths.clone().or_else(|| material.wavelengths());
                    serde_json::to_vec(&EvaluateAnswer { wavelengths, values, unit: material.unit() })
                } else {
                    serde_json::to_vec(&AlbedosAnswer { wavelengths: material.wavelengths(), values })
                }
            }
            Self::Densities(pdf) => serde_json::to_vec(&PdfAnswer { pdf }),
            Self::Samples(samples) => {
                let (weight_unit, n) = (material.unit().over_directions(), samples.len());
                let (directions, pdf, weight) = (Vec::with_capacity(n), Vec::with_capacity(n), Vec::with_capacity(n));
                let mut answer = SampleAnswer { directions, pdf, weight, weight_unit };
                for drawn in &samples {
                    let SampleLine { direction, pdf, weight } = SampleLine::of(drawn.as_ref());
                    answer.directions.push(direction);
                    answer.pdf.push(pdf);
                    answer.weight.push(weight);
                }
                serde_json::to_vec(&answer)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Direction;

    #[test]
    fn masked_values_are_null_and_nan() {
        let rows = Rows { values: vec![1.0, f32::NAN, 0.5, 0.25], width: 2 };
        assert_eq!(serde_json::to_string(&rows).unwrap(), "[[1.0,null],[0.5,0.25]]");
        let answers = Answers::Rows { values: rows.values, width: 2 };
        let lines = answers.bytes(Encoding::Lines).unwrap();
        assert_eq!(lines, b"{\"values\":[1.0,null]}\n{\"values\":[0.5,0.25]}\n");
        let floats = answers.bytes(Encoding::Floats).unwrap();
        assert_eq!((floats.len(), &floats[..4]), (16, &1_f32.to_le_bytes()[..]));
        assert!(f32::from_le_bytes(floats[4..8].try_into().unwrap()).is_nan());
    }

    #[test]
    fn nothing_drawn_has_no_direction() {
        let drawn = DirectionSample { direction: Direction::from_degrees(90.0, 180.0), pdf: 0.5, weight: 2.0 };
        let mut answers = Answers::Samples(vec![Some(drawn)]);
        answers.append(Answers::Samples(vec![None]));
        assert_eq!(answers.len(), 2);
        let lines = String::from_utf8(answers.bytes(Encoding::Lines).unwrap()).unwrap();
        assert_eq!(lines.lines().nth(1).unwrap(), "{\"direction\":null,\"pdf\":0.0,\"weight\":0.0}");
        let floats = answers.bytes(Encoding::Floats).unwrap();
        let floats: Vec<f32> = floats.chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        assert_eq!(floats[..4], [90.0, 180.0, 0.5, 2.0]);
        assert!(floats[4].is_nan() && floats[5].is_nan() && floats[6..] == [0.0, 0.0]);
    }
}
