//! Answers of a batch as JSON, as lines, and as little-endian f32.

use super::super::schemas::{Angles, LuminaireAngles};
use super::media::Encoding;
use super::question::Question;
use crate::domain::Unit;
use crate::evaluate::{DirectionSample, Material};
use serde::{Serialize, Serializer};
use utoipa::ToSchema;

/// Answers of a batch of queries, one for each query, in the order of the queries.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Answers {
    pub(super) values: Values,
    /// For each query, true if one of its directions lies beyond the measured angles.
    pub(super) extrapolated: Vec<bool>,
    /// True if drawn directions are stated as C and gamma of a luminaire, too.
    pub(super) is_luminaire: bool,
}

/// Values of the answers of a batch.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
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
    /// True if a direction lies beyond the measured polar angles, whose values are continued there; absent otherwise.
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
    /// For each query, true if one of its directions lies beyond the measured polar angles, whose values are continued
    /// there.
    extrapolated: Vec<bool>,
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
    /// True if the incoming direction lies beyond the last measured polar angle; absent otherwise.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) extrapolated: bool,
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
    /// For each query, true if one of its directions lies beyond the measured polar angles, whose values are continued
    /// there.
    extrapolated: Vec<bool>,
}

/// Probability densities of drawing a direction, one for each pair of directions, as a JSON answer.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Densities)]
pub(super) struct PdfAnswer {
    /// Probability densities in sr⁻¹ with which each outgoing direction is drawn.
    pdf: Vec<f64>,
    /// For each query, true if one of its directions lies beyond the measured polar angles, whose values are continued
    /// there.
    extrapolated: Vec<bool>,
}

/// Randomly drawn outgoing directions, as parallel arrays of a JSON answer.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Samples)]
pub(super) struct SampleAnswer {
    /// Drawn directions `[θ, φ]` in degrees; null where nothing is emitted or reflected.
    #[schema(value_type = Vec<Option<Angles>>)]
    directions: Vec<Option<[f64; 2]>>,
    /// Drawn directions of a luminaire as `[C, gamma]` in degrees; absent for other materials.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Vec<Option<LuminaireAngles>>>, nullable = false)]
    c_gamma: Option<Vec<Option<[f64; 2]>>>,
    /// Probability densities of the drawn directions in sr⁻¹.
    pdf: Vec<f64>,
    /// Monte Carlo weights of the drawn directions: f · |cos θo| / pdf for a BRDF or BTDF, f / pdf otherwise. f is the
    /// mean over the wavelengths, each counted alike whatever its distance to the next.
    weight: Vec<f64>,
    /// For each query, true if one of its directions lies beyond the measured polar angles, whose values are continued
    /// there.
    extrapolated: Vec<bool>,
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
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    extrapolated: bool,
}

#[derive(Serialize)]
struct PdfLine {
    pdf: f64,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    extrapolated: bool,
}

#[derive(Serialize)]
struct SampleLine {
    direction: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    c_gamma: Option<[f64; 2]>,
    pdf: f64,
    weight: f64,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    extrapolated: bool,
}

impl SampleLine {
    fn of(drawn: Option<&DirectionSample>, is_luminaire: bool, extrapolated: bool) -> Self {
        Self {
            direction: drawn.map(|s| [s.direction.theta_degrees(), s.direction.phi_degrees()]),
            c_gamma: drawn.filter(|_| is_luminaire).map(|s| s.direction.luminaire_degrees()),
            pdf: drawn.map_or(0.0, |s| s.pdf),
            weight: drawn.map_or(0.0, |s| s.weight),
            extrapolated,
        }
    }
}

impl Answers {
    /// Returns the number of queries of a batch whose answers are in this list.
    pub(super) fn len(&self) -> usize {
        self.extrapolated.len()
    }

    /// Appends `more`, the answers to the next queries of the same batch.
    pub(super) fn append(&mut self, more: Self) {
        self.extrapolated.extend(more.extrapolated);
        match (&mut self.values, more.values) {
            (Values::Rows { values, .. }, Values::Rows { values: more, .. }) => values.extend(more),
            (Values::Densities(densities), Values::Densities(more)) => densities.extend(more),
            (Values::Samples(samples), Values::Samples(more)) => samples.extend(more),
            _ => debug_assert!(false, "answers of one question are of one kind"),
        }
    }

    /// Encodes the answers as a part of a streamed HTTP response (NDJSON lines or f32).
    pub(super) fn bytes(&self, encoding: Encoding) -> serde_json::Result<Vec<u8>> {
        match encoding {
            Encoding::Floats => Ok(self.values.floats()),
            Encoding::Json | Encoding::Lines => self.lines(),
        }
    }

    fn lines(&self) -> serde_json::Result<Vec<u8>> {
        let mut out = Vec::new();
        let mut write = |line: &dyn Fn(&mut Vec<u8>) -> serde_json::Result<()>| {
            line(&mut out)?;
            out.push(b'\n');
            Ok(())
        };
        let mut flags = self.extrapolated.iter().copied();
        match &self.values {
            Values::Rows { values, width } => {
                values.chunks((*width).max(1)).zip(flags).try_for_each(|(values, extrapolated)| {
                    write(&|out| serde_json::to_writer(out, &RowLine { values, extrapolated }))
                })?;
            }
            Values::Densities(densities) => {
                densities.iter().zip(flags).try_for_each(|(&pdf, extrapolated)| {
                    write(&|out| serde_json::to_writer(out, &PdfLine { pdf, extrapolated }))
                })?;
            }
            Values::Samples(samples) => {
                samples.iter().try_for_each(|drawn| {
                    let line = SampleLine::of(drawn.as_ref(), self.is_luminaire, flags.next().unwrap_or(false));
                    write(&|out| serde_json::to_writer(out, &line))
                })?;
            }
        }
        Ok(out)
    }

    /// Encodes all answers of a batch as one JSON object.
    pub(super) fn json(self, question: &Question, material: &Material) -> serde_json::Result<Vec<u8>> {
        let Self { values, extrapolated, is_luminaire } = self;
        match values {
            Values::Rows { values, width } => {
                let values = Rows { values, width };
                if let Question::Evaluate { wavelengths, .. } = question {
                    let wavelengths = wavelengths.clone().or_else(|| material.wavelengths());
                    let unit = material.unit();
                    serde_json::to_vec(&EvaluateAnswer { wavelengths, values, unit, extrapolated })
                } else {
                    let wavelengths = material.wavelengths();
                    serde_json::to_vec(&AlbedosAnswer { wavelengths, values, extrapolated })
                }
            }
            Values::Densities(pdf) => serde_json::to_vec(&PdfAnswer { pdf, extrapolated }),
            Values::Samples(samples) => {
                let lines = || samples.iter().map(|drawn| SampleLine::of(drawn.as_ref(), is_luminaire, false));
                serde_json::to_vec(&SampleAnswer {
                    directions: lines().map(|line| line.direction).collect(),
                    c_gamma: is_luminaire.then(|| lines().map(|line| line.c_gamma).collect()),
                    pdf: lines().map(|line| line.pdf).collect(),
                    weight: lines().map(|line| line.weight).collect(),
                    weight_unit: material.unit().over_directions(),
                    extrapolated,
                })
            }
        }
    }
}

impl Values {
    /// Returns the number of queries whose answers these are.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Rows { values, width } => values.len() / (*width).max(1),
            Self::Densities(densities) => densities.len(),
            Self::Samples(samples) => samples.len(),
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
                    let SampleLine { direction, pdf, weight, .. } = SampleLine::of(drawn.as_ref(), false, false);
                    let [theta, phi] = direction.unwrap_or([f64::NAN; 2]);
                    [theta, phi, pdf, weight]
                });
                four.flat_map(|value| (value as f32).to_le_bytes()).collect()
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
        let values = Values::Rows { values: rows.values, width: 2 };
        let answers = Answers { values, extrapolated: vec![false, true], is_luminaire: false };
        let lines = answers.bytes(Encoding::Lines).unwrap();
        assert_eq!(lines, b"{\"values\":[1.0,null]}\n{\"values\":[0.5,0.25],\"extrapolated\":true}\n");
        let floats = answers.bytes(Encoding::Floats).unwrap();
        assert_eq!((floats.len(), &floats[..4]), (16, &1_f32.to_le_bytes()[..]));
        assert!(f32::from_le_bytes(floats[4..8].try_into().unwrap()).is_nan());
    }

    #[test]
    fn nothing_drawn_has_no_direction() {
        let drawn = DirectionSample { direction: Direction::from_degrees(90.0, 180.0), pdf: 0.5, weight: 2.0 };
        let of =
            |drawn| Answers { values: Values::Samples(vec![drawn]), extrapolated: vec![false], is_luminaire: true };
        let mut answers = of(Some(drawn));
        answers.append(of(None));
        assert_eq!(answers.len(), 2);
        let lines = String::from_utf8(answers.bytes(Encoding::Lines).unwrap()).unwrap();
        assert_eq!(lines.lines().nth(1).unwrap(), "{\"direction\":null,\"pdf\":0.0,\"weight\":0.0}");
        assert!(lines.starts_with("{\"direction\":[90.0,180.0],\"c_gamma\":[180.0,90.0],"), "{lines}");
        let floats = answers.bytes(Encoding::Floats).unwrap();
        let floats: Vec<f32> = floats.chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        assert_eq!(floats[..4], [90.0, 180.0, 0.5, 2.0]);
        assert!(floats[4].is_nan() && floats[5].is_nan() && floats[6..] == [0.0, 0.0]);
    }
}
