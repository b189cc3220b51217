//! Materials that commands use, from their files or compressed in memory from measurements.

use super::failure::Failure;
use super::input::{read_file, read_manifest_beside};
use super::output::{note, per_cent, warn};
use crate::compress::{self, Target};
use crate::domain::Silent;
use crate::evaluate::Material;
use crate::formats::{FormatErrorKind, Interpretation, NoteKind};
use crate::pipeline::{self, Input, PipelineError};
use serde::Serialize;
use std::path::Path;

/// Bytes of a material.
pub(super) struct Opened {
    pub(super) bytes: Vec<u8>,
    pub(super) made: Option<Made>,
}

/// Statement of an answer that its material was compressed in memory from a measurement.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Made {
    /// Format of the file with the measurement.
    format: String,
    /// Promise of the compression.
    target: Target,
    /// Root mean square relative error of the material against the samples.
    er_l2: f64,
    /// Size of the compressed material.
    bytes: u64,
}

impl Opened {
    /// Reads the material in `path`, or makes one from the measurement in it, which is said on stderr.
    pub(super) fn read(path: &Path) -> Result<Self, Failure> {
        let bytes = read_file(path)?;
        if compress::is_material(&bytes) {
            return Ok(Self { bytes, made: None });
        }
        let interpretation = Interpretation { axes: read_manifest_beside(path)?, ..Interpretation::default() };
        let source = pipeline::read(&Input { bytes: &bytes, spectrum: None, interpretation: &interpretation });
        let source = source.map_err(|error| unread(error).about(path))?;
        drop(bytes);
        let request = pipeline::for_use(&source.acquisition);
        let outcome = pipeline::compress(&source, &request, &Silent);
        let outcome = outcome.map_err(|error| Failure::from(error).about(path))?;
        let report = &outcome.report;
        let made = Made {
            format: report.format.clone(),
            target: request.target,
            er_l2: report.errors.er_l2,
            bytes: report.bytes,
        };
        note(&format!("{}: a measurement ({}), compressed in memory {}", path.display(), made.format, made.how()));
        for one in report.notes.iter().filter(|note| note.kind == NoteKind::Warning) {
            warn(&one.message);
        }
        Ok(Self { bytes: outcome.bytes, made: Some(made) })
    }

    /// Opens the material.
    pub(super) fn open(path: &Path) -> Result<(Material, Option<Made>), Failure> {
        let Self { bytes, made } = Self::read(path)?;
        let material = Material::open(&bytes).map_err(|error| Failure::from(error).about(path))?;
        Ok((material, made))
    }
}

impl Made {
    fn how(&self) -> String {
        match self.target {
            Target::Lossless => "without loss".to_owned(),
            _ => format!("with er(L2) {}", per_cent(self.er_l2)),
        }
    }
}

/// Returns the failure to read a measurement. Options that the file needs are those of `compress`.
fn unread(error: PipelineError) -> Failure {
    let needs_option = matches!(&error, PipelineError::Format(refusal) if refusal.kind == FormatErrorKind::NeedsOption);
    match Failure::from(error) {
        Failure::Usage(message) if needs_option => Failure::Usage(format!(
            "{message}; this command has no options for reading: run `wavelume compress` with them first, and give it \
             the material"
        )),
        other => other,
    }
}
