//! A projected measurement, and the coverage of its cells.

use super::scattered::at_samples::ScatteredSamples;
use super::scattered::lobe::carried::CarriedLobe;
use super::scattered::report::ScatterReport;
use crate::domain::{Measurement, Note, Tensor};
use crate::formats::Contradictions;
use serde::{Deserialize, Serialize};

/// Result of a projection: a measurement resampled to final axes, with facts about the resampling.
#[derive(Clone, Debug)]
pub struct Projected {
    /// Resampled tensor with its physical quantity and unit.
    pub measurement: Measurement,
    /// Coverage of the direction cells (triangles, grid directions, or pairs of them) by samples.
    pub coverage: Coverage,
    /// One flag for each spectrum of the tensor, in row-major order: true if its values are filled in, neither measured
    /// nor interpolated. They are continued from samples nearby, mirrored in the plane of incidence, or taken from
    /// exchanged directions, f(ωo, ωi). Empty if no spectrum is filled in.
    pub filled: Vec<bool>,
    /// Numbers as a file writes them if it states a separate factor, on the axes of the measurement. `None` if the
    /// factor is 1 or the numbers were resampled.
    pub numbers: Option<Numbers>,
    /// Measured samples at scattered directions, with which the compressed material is compared; `None` for files with
    /// a grid.
    pub scattered: Option<ScatteredSamples>,
    /// Lobe narrower than the cells of the tensor; the measurement is the sum of the tensor and the lobe.
    pub lobe: Option<CarriedLobe>,
}

/// Numbers as the file writes them. A value of the measurement is `factor` times its number.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    /// Numbers as the measurement file lists them, not yet multiplied by the factor that the file states apart from
    /// them.
    pub tensor: Tensor,
    /// Product of all multipliers that the file states once for all numbers.
    pub factor: f64,
}

/// Coverage of a measurement resampled to direction cells: how many cells are measured, interpolated, filled or empty.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Coverage {
    /// Number of direction cells (triangles, grid directions, or pairs of them), each of which holds one spectrum.
    pub cells: u64,
    /// Number of direction cells that contain a sample, or of all cells for data already on their final axes.
    pub measured: u64,
    /// Number of direction cells (triangles, grid directions, or pairs of them) that contain no sample, but have values
    /// interpolated from samples around.
    pub interpolated: u64,
    /// Number of direction cells in holes or beyond the outermost samples, filled by a rule that the notes declare.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub filled: u64,
    /// Number of direction cells (triangles, grid directions, or pairs of them) outside the measured range. Their
    /// values are masked (NaN), or 0 if the standard of the file format prescribes 0 there.
    pub empty: u64,
    /// Remarks for the user on why the program chose the axes of the resampled data. JSON holds the sentence of each
    /// remark only.
    #[serde(with = "sentences")]
    #[cfg_attr(feature = "schema", schema(value_type = Vec<String>))]
    pub notes: Vec<Note>,
    /// Differences between values that the file states several times for one direction; measured only if the file's own
    /// grid is kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contradictions: Option<Contradictions>,
    /// Noise and outliers of samples at scattered directions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scatter: Option<Box<ScatterReport>>,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// Serialisation of notes for the user as their sentences alone. Notes that are read back lack the stable names
/// (`code`) by which programs recognise them.
mod sentences {
    use crate::domain::{Note, NoteKind};
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(notes: &[Note], to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(notes.iter().map(|note| &note.message))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<Note>, D::Error> {
        let sentences = Vec::<String>::deserialize(from)?;
        Ok(sentences.into_iter().map(|sentence| Note::plain(NoteKind::Chosen, sentence)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::notes::ProjectionNote;

    #[test]
    fn a_coverage_that_was_written_is_read_with_its_sentences() {
        let coverage = Coverage { cells: 2, notes: vec![ProjectionNote::AsInFile.into()], ..Coverage::default() };
        let json = serde_json::to_value(&coverage).unwrap();
        assert_eq!(json["notes"], serde_json::json!(["the axes and samples of the file"]));
        let read: Coverage = serde_json::from_value(json).unwrap();
        assert_eq!((read.cells, read.notes[0].to_string()), (2, coverage.notes[0].to_string()));
    }
}
