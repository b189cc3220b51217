//! A projected measurement, and the coverage of its cells.

use super::scattered::at_samples::ScatteredSamples;
use super::scattered::lobe::carried::CarriedLobe;
use super::scattered::report::ScatterReport;
use crate::domain::{Measurement, Note, NoteKind, Tensor};
use crate::formats::Contradictions;
use serde::{Deserialize, Deserializer, Serialize};

/// Result of a projection: a measurement resampled to the axes of its tensor, with facts about the resampling.
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
    /// Numbers as the file writes them, if it states a factor for all of them apart, on the axes of `measurement`.
    /// `None` if the factor is 1 or the numbers were resampled.
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
    /// Product of the multipliers that the measurement file states once for all its numbers, such as a ballast factor.
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
    /// Remarks for the user on the resampling: the axes, cells and fits that the program chose, and samples that are
    /// missing, left out or filled in.
    #[serde(deserialize_with = "notes_or_sentences")]
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

/// Reads a list of remarks for the user. In JSON of earlier versions a remark is its sentence alone, as a string: it
/// becomes a remark on a choice, without the stable name (`code`) and the values by which programs recognise it.
fn notes_or_sentences<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<Note>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "expected a note (an object with kind and message) or its sentence")]
    enum Stored {
        Note(Note),
        Sentence(String),
    }

    let stored = Vec::<Stored>::deserialize(from)?;
    let notes = stored.into_iter().map(|stored| match stored {
        Stored::Note(note) => note,
        Stored::Sentence(sentence) => Note::plain(NoteKind::Chosen, sentence),
    });
    Ok(notes.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::notes::{FitNote, ProjectionNote};
    use serde_json::json;

    fn coverage() -> Coverage {
        let notes = vec![ProjectionNote::AsInFile.into(), FitNote::Negative { values: 3, share_percent: 1.5 }.into()];
        Coverage { cells: 2, notes, ..Coverage::default() }
    }

    #[test]
    fn a_coverage_is_written_with_the_codes_and_values_of_its_notes_and_read_back() {
        let json = json!(coverage());
        let as_in_file = json!({
            "kind": "chosen", "message": "the axes and samples of the file", "code": "projection-as-in-file"
        });
        assert_eq!(json["notes"][0], as_in_file);
        assert_eq!((&json["notes"][1]["kind"], &json["notes"][1]["code"]), (&json!("warning"), &json!("fit-negative")));
        assert_eq!(json["notes"][1]["values"], json!({ "values": 3, "share_percent": 1.5 }));
        assert_eq!(serde_json::from_value::<Coverage>(json).unwrap(), coverage());
    }

    #[test]
    fn a_coverage_of_an_earlier_version_keeps_the_sentences_of_its_notes() {
        let mut json = json!(coverage());
        json["notes"][0] = json!("the axes and samples of the file");
        let read: Coverage = serde_json::from_value(json.clone()).unwrap();
        let sentence = Note::plain(NoteKind::Chosen, "the axes and samples of the file");
        assert_eq!(read.notes, [sentence, coverage().notes[1].clone()]);
        json["notes"][0] = json!(7);
        let error = serde_json::from_value::<Coverage>(json).unwrap_err().to_string();
        assert_eq!(error, "expected a note (an object with kind and message) or its sentence");
    }
}
