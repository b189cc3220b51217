//! From an uploaded archive to one measurement for each of its files. Other files are listed with the reason.

use super::engine::Engine;
use super::ingest::{IngestError, Upload, UploadError};
use crate::catalog::MeasurementRow;
use crate::formats::{Archive, FormatError, is_archive};
use crate::store::{Staged, StoreError};
use std::fs::File;
use std::io::Read;
use std::sync::Arc;

/// Outcome of an upload: one measurement, or several from an archive.
#[derive(Debug)]
pub(crate) enum Ingested {
    /// One measurement from a file that is no archive; true if this upload stored it, false if it was stored before.
    One(MeasurementRow, bool),
    /// Measurements made from the files of an uploaded archive, and the names of the files that were refused.
    Several {
        /// Measurements sorted by file name, each with true if this upload stored it, or false if it was stored before.
        items: Vec<(MeasurementRow, bool)>,
        /// Names of the refused files of the archive, each with the reason why it did not become a measurement.
        skipped: Vec<(String, String)>,
    },
}

/// File of an uploaded archive, unpacked to a temporary file.
struct Unpacked {
    name: String,
    staged: Staged,
    /// Axes of an array, from the manifest beside it.
    axes: Result<Option<serde_json::Value>, FormatError>,
}

impl Engine {
    /// Stores an uploaded file as a measurement, or each file of an uploaded zip archive as one; the archive itself is
    /// not kept.
    pub(crate) async fn ingest_any(self: &Arc<Self>, staged: Staged, upload: Upload) -> Result<Ingested, IngestError> {
        let (staged, files) = self.unpack(staged).await?;
        let Some(files) = files else {
            let (row, new) = self.ingest(staged, upload).await?;
            return Ok(Ingested::One(row, new));
        };
        let (mut items, mut skipped) = (Vec::new(), Vec::new());
        for Unpacked { name, staged, axes } in files {
            let axes = match axes {
                Ok(axes) => axes,
                Err(error) => {
                    skipped.push((name, error.to_string()));
                    continue;
                }
            };
            let one = Upload {
                name: upload.name.as_ref().map(|all| format!("{all}: {name}")),
                file_name: Some(name.clone()),
                options: upload.options.with_axes(axes),
            };
            match self.ingest(staged, one).await {
                Ok(item) => items.push(item),
                Err(error @ (IngestError::Refused(_) | IngestError::Unfit(_))) => {
                    skipped.push((name, error.to_string()));
                }
                Err(other) => return Err(other),
            }
        }
        if items.is_empty() {
            return Err(UploadError::NoMeasurement { skipped }.into());
        }
        Ok(Ingested::Several { items, skipped })
    }

    /// Stages each file of an archive separately; `None` if the bytes are not an archive.
    async fn unpack(self: &Arc<Self>, staged: Staged) -> Result<(Staged, Option<Vec<Unpacked>>), IngestError> {
        let (staging, most) = (self.archive.staging.clone(), self.limits.upload_bytes);
        self.background_light
            .run(move || {
                let mut mark = Vec::new();
                File::open(staged.path())
                    .and_then(|file| file.take(4).read_to_end(&mut mark))
                    .map_err(StoreError::from)?;
                if !is_archive(&mark) {
                    return Ok((staged, None));
                }
                let bytes = staged.read()?;
                let mut archive = Archive::open(&bytes).map_err(IngestError::Refused)?;
                let mut members = archive.members().to_vec();
                let total = members.iter().fold(0_u64, |total, member| total.saturating_add(member.bytes));
                if total > most {
                    return Err(UploadError::ArchiveLength { found: total, most }.into());
                }
                members.retain(|member| member.bytes > 0 && !archive.is_manifest(member));
                let files = members.into_iter().map(|member| {
                    let axes = archive.manifest_of(&member);
                    let unpacked = archive.unpack(&member).map_err(IngestError::Refused)?;
                    Ok(Unpacked { name: member.name, staged: staging.stage(&unpacked)?, axes })
                });
                let files = files.collect::<Result<Vec<_>, IngestError>>()?;
                Ok((staged, Some(files)))
            })
            .await?
    }
}
