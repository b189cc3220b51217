//! From a staged upload to a measurement: parsed before it is kept, published before a row names it.

use super::blobs::BlobError;
use super::describe::{Understood, describe, describe_needy};
use super::engine::Engine;
use super::maths::MathsError;
use super::options::Options;
use super::publish::Published;
use crate::catalog::{Added, CatalogError, MeasurementRow, NewMeasurement, OverQuota};
use crate::domain::Quantity;
use crate::formats::{FormatError, FormatErrorKind};
use crate::pipeline::{self, Input, PipelineError};
use crate::store::{Digest, Staged, StoreError};
use std::sync::Arc;

/// Names that a client gives with an upload, and options by which the uploaded bytes are to be read.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Upload {
    /// Name of the uploaded file.
    pub file_name: Option<String>,
    /// Name that the client gives to the measurement.
    pub name: Option<String>,
    /// Options by which the uploaded bytes are to be read, such as the unit of the values. The id of the measurement
    /// depends on them.
    pub options: Options,
}

/// Reason why an upload did not become a measurement.
#[derive(Debug, thiserror::Error)]
pub(crate) enum IngestError {
    /// A parser refused the uploaded bytes: they are no measurement file, or a damaged one.
    #[error(transparent)]
    Refused(FormatError),
    /// The upload cannot be stored for a reason that no parser checks, such as the total length of an unpacked archive.
    #[error(transparent)]
    Unfit(#[from] UploadError),
    /// The measurement by whose spectrum the upload is to be multiplied cannot be used for that.
    #[error("the upload cannot be multiplied by the spectrum of another measurement: {0}")]
    Spectrum(#[from] SpectrumError),
    /// The computation that reads and describes the upload failed, or too many others were waiting.
    #[error(transparent)]
    Maths(#[from] MathsError),
    /// The store of uploaded and computed files failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The database of measurements, materials and jobs failed.
    #[error(transparent)]
    Catalog(#[from] CatalogError),
    /// The store of uploaded and computed files is away, or belongs to another catalog now.
    #[error("{0}")]
    Away(String),
    /// The upload would exceed a limit of the tenant.
    #[error("{0}")]
    Over(OverQuota),
}

/// Uploads that are refused although their bytes may be readable.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum UploadError {
    /// The uploaded bytes were read, but do not make a valid measurement.
    #[error(transparent)]
    Content(PipelineError),
    /// The description of the uploaded measurement (axes, range of values, header) cannot be written as JSON.
    #[error("the description of the measurement cannot be written: {0}")]
    Described(String),
    /// The files of an uploaded archive together exceed the limit on the length of an upload.
    #[error("the files of the archive have {found} bytes when unpacked, expected at most {most}")]
    ArchiveLength {
        /// Total decompressed length of the archive's files, in bytes.
        found: u64,
        /// Upper bound on the total decompressed length of the archive's files, in bytes.
        most: u64,
    },
    /// No file of the uploaded archive is a measurement.
    #[error("none of {} files in the archive is a measurement; first reasons: {}", skipped.len(), first_of(skipped))]
    NoMeasurement {
        /// Names of the files in the uploaded archive, each with the reason why the service does not store it as a
        /// measurement.
        skipped: Vec<(String, String)>,
    },
}

/// Reasons why an upload cannot be multiplied by the spectrum of a stored measurement.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum SpectrumError {
    /// The service has no measurement with the identifier that the client gave for the spectrum by which the upload is
    /// to be multiplied.
    #[error("there is no measurement {id}")]
    Missing {
        /// Identifier, as the client gave it, of the stored measurement by whose spectrum the upload is to be
        /// multiplied.
        id: Digest,
    },
    /// The measurement by whose spectrum the upload is to be multiplied was itself uploaded with options for reading,
    /// which the multiplication does not apply.
    #[error("measurement {id} has reading options and cannot multiply an upload; upload its spectrum without options")]
    WithOptions {
        /// Identifier of the stored measurement by whose spectrum the upload is to be multiplied.
        id: Digest,
    },
    /// The measurement by whose spectrum the upload is to be multiplied was deleted while the upload was read.
    #[error("the spectrum by which to multiply the upload was deleted meanwhile; upload the spectrum again")]
    Deleted,
    /// The stored measurement by which the upload is to be multiplied does not contain a spectrum.
    #[error(transparent)]
    Content(FormatError),
}

/// Formats the names of the first few files of an archive, each with the reason why it is not stored as a measurement.
fn first_of(skipped: &[(String, String)]) -> String {
    const SHOWN: usize = 5;
    let reasons: Vec<String> = skipped.iter().take(SHOWN).map(|(name, reason)| format!("{name}: {reason}")).collect();
    reasons.join("; ")
}

impl From<BlobError> for IngestError {
    fn from(error: BlobError) -> Self {
        match error {
            BlobError::Store(error) => error.into(),
            BlobError::Catalog(error) => error.into(),
            BlobError::Away(reason) => Self::Away(reason),
        }
    }
}

impl Engine {
    /// Stores an uploaded file, held as a temporary file so far, as a measurement. Returns its row in the catalog, and
    /// true if it is new. A refused upload leaves nothing behind.
    pub(crate) async fn ingest(
        self: &Arc<Self>,
        staged: Staged,
        upload: Upload,
    ) -> Result<(MeasurementRow, bool), IngestError> {
        let content = staged.digest();
        let id = upload.options.identity(content);
        let bytes = staged.bytes();
        // A known measurement was parsed when it came; its bytes are published again if they are missing or damaged.
        let known = self.archive.catalog.measurement(id).await?;
        let is_new = known.is_none();
        let (staged, summary) = match known {
            Some(known) => (staged, Summary::of_known(&known)?),
            None => self.understand(staged, &upload.options).await?,
        };
        // Before the bytes are stored, and again with the row: their size may have been unknown before they came.
        if is_new && let Some(over) = self.archive.catalog.lacks_room(bytes, 0).await? {
            return Err(IngestError::Over(over));
        }
        let mut published = Published::new(&self.archive, staged).await?;
        let new = NewMeasurement {
            id,
            content,
            spectrum: upload.options.spectrum,
            name: upload.name,
            file_name: upload.file_name,
            bytes,
            format: summary.format,
            quantity: summary.quantity,
            document: summary.document,
        };
        let refused = loop {
            match self.archive.catalog.add_measurement(&new, published.claim()).await? {
                Added::Row(row, new) => return Ok((row, new)),
                Added::NoSpectrum => break SpectrumError::Deleted.into(),
                Added::Over(over) => break IngestError::Over(over),
                Added::Unpublished => published = published.again(&self.archive).await?,
            }
        };
        published.withdraw(&self.archive).await;
        Err(refused)
    }

    async fn understand(self: &Arc<Self>, staged: Staged, options: &Options) -> Result<(Staged, Summary), IngestError> {
        let spectrum = match options.spectrum {
            Some(id) => Some(self.spectrum(id).await?),
            None => None,
        };
        let options = options.clone();
        self.background_light
            .run(move || {
                let bytes = staged.read()?;
                let interpretation = options.interpretation();
                let input = Input { bytes: &bytes, spectrum: spectrum.as_deref(), interpretation: &interpretation };
                let described = match pipeline::read(&input) {
                    Ok(source) => describe(&source.acquisition, &options),
                    Err(PipelineError::Format(error)) if can_wait(&error, &options) => {
                        describe_needy(error.format, &error.message, &options)
                    }
                    Err(PipelineError::Format(error)) => return Err(IngestError::Refused(error)),
                    Err(PipelineError::Spectrum(error)) => return Err(SpectrumError::Content(error).into()),
                    Err(other) => return Err(UploadError::Content(other).into()),
                };
                let document = serde_json::to_string(&described).map_err(|e| UploadError::Described(e.to_string()))?;
                let summary = Summary { format: described.format, quantity: described.quantity, document };
                Ok((staged, summary))
            })
            .await?
    }

    /// Returns the stored bytes of a spectrum that a client uploaded earlier as the measurement `id`.
    pub(crate) async fn spectrum(&self, id: Digest) -> Result<bytes::Bytes, IngestError> {
        let row = self.archive.catalog.measurement(id).await?;
        let row = row.ok_or(SpectrumError::Missing { id })?;
        if row.content != id {
            return Err(SpectrumError::WithOptions { id }.into());
        }
        Ok(self.archive.get(row.content).await?)
    }
}

/// Returns true if an uploaded file that needs an option may be stored until a job states the option. An array may
/// always wait for its axes. Any other file may wait only if the upload stated no option, since otherwise a stated
/// option is at fault.
fn can_wait(error: &FormatError, options: &Options) -> bool {
    error.kind == FormatErrorKind::NeedsOption && (error.format == "npy" || options.is_default())
}

struct Summary {
    format: String,
    quantity: Option<Quantity>,
    document: String,
}

impl Summary {
    fn of_known(row: &MeasurementRow) -> Result<Self, CatalogError> {
        let known: Understood = serde_json::from_str(&row.document).map_err(|e| CatalogError::Row {
            table: "measurements",
            id: row.id.to_string(),
            reason: e.to_string(),
        })?;
        Ok(Self { format: known.format, quantity: known.quantity, document: row.document.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_about_which_nothing_was_said_wait_for_an_option() {
        let needs = |format| FormatError {
            kind: FormatErrorKind::NeedsOption,
            format,
            position: None,
            message: "no axes".to_owned(),
        };
        let quantity = Some(Quantity::Brdf.into());
        let said = Options::from(crate::formats::Interpretation { quantity, ..Default::default() });
        assert!(can_wait(&needs("npy"), &said) && can_wait(&needs("csv"), &Options::default()));
        assert!(!can_wait(&needs("csv"), &said));
        let broken = FormatError { kind: FormatErrorKind::Malformed, ..needs("npy") };
        assert!(!can_wait(&broken, &Options::default()));
    }
}
