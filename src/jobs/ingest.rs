//! From a staged upload to a measurement: parsed before it is kept, pinned before it is published, published before a
//! row names it.

use super::describe::{describe, describe_needy};
use super::engine::Engine;
use super::maths::MathsError;
use super::publish::{PublishError, Published};
use crate::catalog::{Added, CatalogError, MeasurementRow, NewMeasurement};
use crate::domain::{Quantity, Unit};
use crate::formats::{FormatError, FormatErrorKind, Interpretation, Normalization, StatedQuantity};
use crate::pipeline::{self, Input, PipelineError};
use crate::store::{Digest, Staged, StoreError, StoreExt};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Statements of a client about the bytes that it uploads.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Upload {
    /// Name of the file.
    pub file_name: Option<String>,
    /// Name of the measurement.
    pub name: Option<String>,
    /// Reading options; part of the measurement's identity.
    pub options: Options,
}

/// Options for reading the bytes of a measurement; kept in its document. An option unknown to this version is an error:
/// bytes read without it would be read wrongly.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Options {
    /// The measurement whose content is the spectrum to join.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spectrum: Option<Digest>,
    /// Quantity, if the file does not state it; reflectance factors are divided by π.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantity: Option<StatedQuantity>,
    /// The unit of a value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// The unit of wavelengths.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wavelength_unit: Option<String>,
    /// The column of a table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// Integral of the values of a phase table over the sphere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normalization: Option<Normalization>,
    /// The axes of an array, from the manifest beside it in an archive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axes: Option<serde_json::Value>,
}

/// Reason why an upload did not become a measurement.
#[derive(Debug, thiserror::Error)]
pub(crate) enum IngestError {
    /// A parser refused the bytes.
    #[error("{0}")]
    Refused(FormatError),
    /// The bytes do not fit the client's statements, beyond what a parser checks.
    #[error(transparent)]
    Unfit(#[from] UploadError),
    /// The referenced measurement is not a spectrum.
    #[error("spectrum: {0}")]
    Spectrum(#[from] SpectrumError),
    /// The computation failed.
    #[error(transparent)]
    Maths(#[from] MathsError),
    /// The store of blobs failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The catalog failed.
    #[error(transparent)]
    Catalog(#[from] CatalogError),
}

/// Uploads that are refused although their bytes may be readable.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum UploadError {
    /// The content does not make a measurement.
    #[error(transparent)]
    Content(PipelineError),
    /// Files of an archive that together exceed the limit of an upload.
    #[error("the files of the archive have {found} bytes, expected at most {most}")]
    ArchiveLength {
        /// Decompressed length of the files in bytes.
        found: u64,
        /// The limit in bytes.
        most: u64,
    },
    /// An archive in which no file is a measurement.
    #[error("an archive of {} files without a measurement: {}", skipped.len(), first_of(skipped))]
    NoMeasurement {
        /// Names of the files, each with the reason for which it is not kept.
        skipped: Vec<(String, String)>,
    },
}

/// Spectra that cannot be joined.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum SpectrumError {
    /// No measurement with this identifier.
    #[error("there is no measurement {id}")]
    Missing {
        /// The identifier.
        id: Digest,
    },
    /// A measurement that was uploaded with reading options.
    #[error("measurement {id} was uploaded with options, which joining does not heed; expected one uploaded without")]
    WithOptions {
        /// Identifier of the measurement.
        id: Digest,
    },
    /// A measurement that was deleted while the upload was read.
    #[error("it was deleted meanwhile")]
    Deleted,
    /// Content that is not a spectrum.
    #[error(transparent)]
    Content(FormatError),
}

/// Formats the first few names with their reasons.
fn first_of(skipped: &[(String, String)]) -> String {
    const SHOWN: usize = 5;
    let reasons: Vec<String> = skipped.iter().take(SHOWN).map(|(name, reason)| format!("{name}: {reason}")).collect();
    reasons.join("; ")
}

impl From<PublishError> for IngestError {
    fn from(error: PublishError) -> Self {
        match error {
            PublishError::Store(error) => error.into(),
            PublishError::Catalog(error) => error.into(),
        }
    }
}

impl Options {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the options as the parsers take them.
    pub(crate) fn interpretation(&self) -> Interpretation {
        Interpretation {
            quantity: self.quantity,
            unit: self.unit,
            wavelength_unit: self.wavelength_unit.clone(),
            column: self.column.clone(),
            normalization: self.normalization,
            member: None,
            axes: self.axes.clone(),
            wavelengths: None,
        }
    }

    /// Returns the identity of `content` read with these options. Without options it is the content's digest. Otherwise
    /// it is the digest of `{"content":"b3-…","options":{…}}`: JSON without white space, keys in alphabetical order,
    /// values as text.
    pub(crate) fn identity(&self, content: Digest) -> Digest {
        if self.is_default() {
            return content;
        }
        let mut options = BTreeMap::new();
        options.extend(self.spectrum.map(|v| ("spectrum", v.to_string())));
        options.extend(self.quantity.map(|v| ("quantity", v.name().to_owned())));
        options.extend(self.unit.map(|v| ("unit", v.name().to_owned())));
        options.extend(self.wavelength_unit.clone().map(|v| ("wavelength_unit", v)));
        options.extend(self.column.clone().map(|v| ("column", v)));
        options.extend(self.normalization.map(|v| ("normalization", v.name().to_owned())));
        options.extend(self.axes.as_ref().map(|v| ("axes", v.to_string())));
        let quoted = |text: &str| serde_json::Value::from(text).to_string();
        let listed: Vec<String> =
            options.iter().map(|(key, value)| format!("{}:{}", quoted(key), quoted(value))).collect();
        Digest::of(format!("{{\"content\":\"{content}\",\"options\":{{{}}}}}", listed.join(",")).as_bytes())
    }
}

impl Engine {
    /// Makes a measurement of staged bytes. Returns the row, and true if it is new. A refused upload leaves nothing
    /// behind.
    pub(crate) async fn ingest(
        self: &Arc<Self>,
        staged: Staged,
        upload: Upload,
    ) -> Result<(MeasurementRow, bool), IngestError> {
        let content = staged.digest();
        let id = upload.options.identity(content);
        let bytes = staged.bytes();
        // A known measurement was parsed when it came; its bytes are published again, which heals a damaged blob.
        let (staged, summary) = match self.archive.catalog.measurement(id).await? {
            Some(known) => (staged, Summary::of_known(&known)?),
            None => self.understand(staged, &upload.options).await?,
        };
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
        loop {
            match self.archive.catalog.add_measurement(&new, published.holder()).await? {
                Added::Row(row, new) => return Ok((row, new)),
                Added::NoSpectrum => return Err(SpectrumError::Deleted.into()),
                Added::Unpinned => published = published.again(&self.archive).await?,
            }
        }
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
                let mut described = match pipeline::read(&input) {
                    Ok(source) => describe(&source.acquisition),
                    Err(PipelineError::Format(error)) if can_wait(&error, &options) => {
                        describe_needy(error.format, &error.message)
                    }
                    Err(PipelineError::Format(error)) => return Err(IngestError::Refused(error)),
                    Err(PipelineError::Spectrum(error)) => return Err(SpectrumError::Content(error).into()),
                    Err(other) => return Err(UploadError::Content(other).into()),
                };
                described.insert("options".to_owned(), serde_json::json!(options));
                let text = |key: &str| described.get(key).and_then(|v| v.as_str()).map(str::to_owned);
                let summary = Summary {
                    format: text("format").unwrap_or_default(),
                    quantity: text("quantity").and_then(|name| name.parse().ok()),
                    document: serde_json::Value::Object(described).to_string(),
                };
                Ok((staged, summary))
            })
            .await?
    }

    /// Returns the bytes of an uploaded spectrum.
    pub(crate) async fn spectrum(&self, id: Digest) -> Result<bytes::Bytes, IngestError> {
        let row = self.archive.catalog.measurement(id).await?;
        let row = row.ok_or(SpectrumError::Missing { id })?;
        if row.content != id {
            return Err(SpectrumError::WithOptions { id }.into());
        }
        Ok(self.archive.store.get(row.content).await?)
    }
}

/// Returns true if a file that needs an option may be kept until a job names it. An array may always wait for its axes.
/// Any other file may wait only if the client stated no option, since otherwise a stated option is at fault.
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
        #[derive(Deserialize)]
        struct Known {
            format: String,
            quantity: Option<Quantity>,
        }
        let known: Known = serde_json::from_str(&row.document).map_err(|e| CatalogError::Row {
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
    fn options_are_part_of_the_identity() {
        let content = Digest::of(b"table");
        let none = Options::default();
        assert_eq!(none.identity(content), content);
        let column = Options { column: Some("light \"skin\"".to_owned()), ..none.clone() };
        let both = Options { quantity: Some(Quantity::Reflectance.into()), ..column.clone() };
        let text = format!(
            "{{\"content\":\"{content}\",\"options\":{{\"column\":\"light \\\"skin\\\"\",\"quantity\":\"reflectance\"}}}}"
        );
        assert_eq!(both.identity(content), Digest::of(text.as_bytes()));
        assert_ne!(column.identity(content), both.identity(content));
        assert_ne!(column.identity(content), content);
    }

    #[test]
    fn only_files_about_which_nothing_was_said_wait_for_an_option() {
        let needs = |format| FormatError {
            kind: FormatErrorKind::NeedsOption,
            format,
            position: None,
            message: "no axes".to_owned(),
        };
        let said = Options { quantity: Some(Quantity::Brdf.into()), ..Options::default() };
        assert!(can_wait(&needs("npy"), &said) && can_wait(&needs("csv"), &Options::default()));
        assert!(!can_wait(&needs("csv"), &said));
        let broken = FormatError { kind: FormatErrorKind::Malformed, ..needs("npy") };
        assert!(!can_wait(&broken, &Options::default()));
    }
}
