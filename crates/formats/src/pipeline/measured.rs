//! Materials of which too few directions were measured for an albedo, a flux, samples or a picture.

use super::error::PipelineError;
use crate::domain::Note;
use crate::evaluate::MeasuredShare;
use crate::notes::MaterialNote;

/// Returns a warning if too few outgoing directions were measured for an albedo or a flux.
pub(super) fn warning(measured: Option<MeasuredShare>) -> Option<Note> {
    let measured = measured.filter(|measured| !measured.is_whole())?;
    let note = MaterialNote::PartlyMeasured {
        measured: measured.to_string(),
        share_percent: 100.0 * measured.share,
        light: measured.light(),
    };
    Some(note.into())
}

/// Refuses a bound on the error of the albedo or flux if too few outgoing directions were measured for one.
pub(super) fn check(measured: Option<MeasuredShare>, albedo_error: Option<f64>) -> Result<(), PipelineError> {
    match measured {
        Some(measured) if albedo_error.is_some() => {
            measured.needs_whole(measured.light()).map_err(PipelineError::Unbounded)
        }
        _ => Ok(()),
    }
}
