//! From an uploaded material to a row of the catalog: decoded wholly, and compared with its measurement if it is known.

use super::document::{Manifest, MeasuredAgain, Origin, Provenance};
use super::engine::Engine;
use super::ingest::IngestError;
use super::options::{LaterOptions, Options};
use super::publish::Published;
use super::request::{CompressKind, CompressRequest, check_names};
use crate::catalog::{CatalogError, MaterialRow, MeasurementRow, NewMaterial, OverQuota, Priority, Uploaded};
use crate::compress::Target;
use crate::domain::ErrorReport;
use crate::pipeline::{self, Input, PipelineError, Remeasured, Report, Request, Stated, StatedOrigin, samples_of};
use crate::store::{Digest, Staged};
use std::sync::Arc;

/// Names that a client gives to an uploaded material, and the measurements that it was made from.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MaterialUpload {
    /// Name of the material.
    pub name: Option<String>,
    /// Licence of the material.
    pub licence: Option<String>,
    /// Tags of the material.
    pub tags: Vec<String>,
    /// Ids of the stored measurements that the material was made from; empty to find them by the digest that the file
    /// states.
    pub measurements: Vec<Digest>,
}

/// Reason why an upload did not become a material.
#[derive(Debug, thiserror::Error)]
pub(crate) enum MaterialError {
    /// The bytes are not a material, or a damaged one.
    #[error("{0}")]
    Malformed(PipelineError),
    /// The material decodes, but its description cannot be kept.
    #[error("the description of the material cannot be kept: {0}")]
    Described(String),
    /// A measurement that the client names is not stored.
    #[error("measurement: there is no measurement {0}")]
    NoMeasurement(Digest),
    /// The material was made from another measurement, or its errors are larger than it states.
    #[error("{0}")]
    NotOf(String),
    /// There is no room in memory for the bytes of a measurement.
    #[error("there is no room in memory for the measurement of the material; try again soon")]
    NoRoom,
    /// Reading a stored measurement, a computation, the store or the catalog failed.
    #[error(transparent)]
    Ingest(#[from] IngestError),
}

/// Bytes of memory that decoding an uploaded material and comparing it with its measurement takes for each sample.
const MEMORY: u64 = 24;

/// Largest number of measurements with which an uploaded material is compared. Raising it makes an upload take longer.
const MOST_MEASUREMENTS: usize = 8;

/// Largest ratio of a measured error to the stated one: versions of the program may round differently. Raising it
/// accepts materials that are worse than they state.
const SLACK: f64 = 1.01;

impl MaterialUpload {
    /// Checks the texts of the client, and the number of measurements. The error describes the fault.
    pub(crate) fn check(&self) -> Result<(), String> {
        if self.measurements.len() > MOST_MEASUREMENTS {
            return Err(format!("{} measurements, expected at most {MOST_MEASUREMENTS}", self.measurements.len()));
        }
        check_names(self.name.as_ref(), self.licence.as_ref(), &self.tags)
    }
}

/// A stored measurement that an uploaded material may have been made from.
struct Candidate {
    row: MeasurementRow,
    options: Options,
    /// Size in bytes of the measurement and of its spectrum.
    size: u64,
}

/// Memory held for the bytes of measurements, as much as the largest of them needs: they are read one after the other.
struct Room<'a> {
    held: u64,
    more: &'a mut (dyn FnMut(u64) -> bool + Send),
}

impl Room<'_> {
    fn hold(&mut self, bytes: u64) -> Result<(), MaterialError> {
        let lacking = bytes.saturating_sub(self.held);
        if lacking > 0 && !(self.more)(lacking) {
            return Err(MaterialError::NoRoom);
        }
        self.held += lacking;
        Ok(())
    }
}

impl Engine {
    /// Returns the bytes of memory that checking an uploaded material will take, from its header alone.
    pub(crate) async fn material_memory(&self, staged: Staged) -> Result<(Staged, u64), MaterialError> {
        let looked = self.background_light.run(move || {
            let bytes = staged.read().map_err(IngestError::from)?;
            let samples = samples_of(&bytes).map_err(MaterialError::Malformed)?;
            Ok((staged, MEMORY.saturating_mul(samples).saturating_add(bytes.len() as u64)))
        });
        looked.await.map_err(IngestError::from)?
    }

    /// Stores an uploaded file as a material. Returns its row in the catalog, and true if it is new. A refused upload
    /// leaves nothing behind. `more` is asked for each number of bytes of memory that measurements need beside the
    /// material, and returns false if there is no room for them.
    pub(crate) async fn ingest_material(
        self: &Arc<Self>,
        staged: Staged,
        upload: MaterialUpload,
        more: &mut (dyn FnMut(u64) -> bool + Send),
    ) -> Result<(MaterialRow, bool), MaterialError> {
        let looked = self.background_light.run(move || {
            let bytes = staged.read().map_err(IngestError::from)?;
            let stated = pipeline::stated(&bytes).map_err(MaterialError::Malformed)?;
            Ok::<_, MaterialError>((staged, bytes, stated))
        });
        let (staged, bytes, Stated { report, origin, .. }) = looked.await.map_err(IngestError::from)??;
        let compared = self.compare(bytes, &upload.measurements, (&report, &origin), Room { held: 0, more }).await?;
        let new = material(&staged, upload, report, origin, &compared)?;
        if let Some(over) = self.lacks_room_for(new.id, new.bytes).await.map_err(IngestError::from)? {
            return Err(IngestError::Over(over).into());
        }
        let mut published = Published::new(&self.archive, staged).await.map_err(IngestError::from)?;
        let refused = loop {
            let added = self.archive.catalog.add_material(&new, published.claim()).await.map_err(IngestError::from)?;
            match added {
                Uploaded::Stored(is_new) => {
                    let row = self.archive.catalog.material(new.id).await.map_err(IngestError::from)?;
                    let row = row.ok_or_else(|| {
                        MaterialError::Described("the material was deleted right after it was stored".to_owned())
                    })?;
                    return Ok((row, is_new));
                }
                Uploaded::NoMeasurement(id) => break MaterialError::NoMeasurement(id),
                Uploaded::Over(over) => break IngestError::Over(over).into(),
                Uploaded::Unpublished => {
                    published = published.again(&self.archive).await.map_err(IngestError::from)?;
                }
            }
        };
        published.withdraw(&self.archive).await;
        Err(refused)
    }

    /// Returns the limit of the tenant that a material with these bytes would exceed, before they are stored.
    pub(super) async fn lacks_room_for(&self, id: Digest, bytes: u64) -> Result<Option<OverQuota>, CatalogError> {
        if self.archive.catalog.material_name(id).await?.is_some() {
            return Ok(None);
        }
        self.archive.catalog.lacks_room(bytes, 1).await
    }

    /// Compares an uploaded material with stored measurements: those that the client names, or else those whose bytes
    /// have the digest that the file states. A named measurement must not show larger errors than the file states. One
    /// found by digest that shows larger errors is left out, because it may have been read with other options. If it is
    /// the only one that was compared, and was read without options, the material is refused.
    async fn compare(
        self: &Arc<Self>,
        bytes: Vec<u8>,
        named: &[Digest],
        (report, origin): (&Report, &StatedOrigin),
        mut room: Room<'_>,
    ) -> Result<Vec<(MeasurementRow, Options, Remeasured)>, MaterialError> {
        let content = origin.content_digest.as_deref().and_then(|text| text.parse().ok());
        let ids = match (named, content) {
            ([], Some(content)) => {
                let found = self.archive.catalog.measurements_of(content, MOST_MEASUREMENTS as u32).await;
                found.map_err(IngestError::from)?
            }
            (named, _) => named.to_vec(),
        };
        let bytes = Arc::new(bytes);
        let (mut compared, mut tried, mut refusal) = (Vec::new(), 0, None);
        for id in ids {
            let Some(candidate) = self.candidate(id).await? else {
                if named.is_empty() {
                    continue;
                }
                return Err(MaterialError::NoMeasurement(id));
            };
            if named.is_empty() && !is_joined_alike(&candidate.options, origin) {
                continue;
            }
            tried += 1;
            room.hold(candidate.size)?;
            let Candidate { row, options, .. } = candidate;
            let content = self.archive.get(row.content).await.map_err(IngestError::from)?;
            let spectrum = match options.spectrum {
                Some(spectrum) => Some(self.spectrum(spectrum).await?),
                None => None,
            };
            let request = origin.request.clone().unwrap_or_else(|| Request::to(Target::ErL2(report.errors.er_l2)));
            let (material, interpretation) = (Arc::clone(&bytes), options.interpretation());
            let measured = self.background_light.run(move || {
                let spectrum = spectrum.as_deref();
                let input = Input { bytes: &content, spectrum, interpretation: &interpretation };
                pipeline::remeasure(&input, &material, &request)
            });
            match measured.await.map_err(IngestError::from)? {
                Ok(found) => match excess(&report.errors, &found.errors) {
                    None => compared.push((row, options, found)),
                    Some(excess) => {
                        let detail =
                            format!("compared with measurement {id}, {excess}: the material was not made from it");
                        if !named.is_empty() {
                            return Err(MaterialError::NotOf(detail));
                        }
                        tracing::debug!(
                            measurement = %id, excess, "an uploaded material was made from another measurement"
                        );
                        refusal = refusal.or(options.is_default().then_some(detail));
                    }
                },
                // Read with other options, the same bytes are another measurement.
                Err(error) if named.is_empty() => {
                    tracing::debug!(
                        measurement = %id, %error, "an uploaded material cannot be compared with a measurement"
                    );
                }
                Err(error) => return Err(MaterialError::NotOf(format!("measurement {id}: {error}"))),
            }
        }
        match refusal {
            Some(detail) if tried == 1 => Err(MaterialError::NotOf(detail)),
            _ => Ok(compared),
        }
    }

    /// Returns a stored measurement with its options and size; `None` if it is not stored.
    async fn candidate(&self, id: Digest) -> Result<Option<Candidate>, MaterialError> {
        let row = self.archive.catalog.measurement(id).await.map_err(IngestError::from)?;
        let Some(row) = row else { return Ok(None) };
        let options = Options::kept(&row.document).map_err(|error| {
            IngestError::from(CatalogError::Row {
                table: "measurements",
                id: id.to_string(),
                reason: error.to_string(),
            })
        })?;
        let spectrum = match options.spectrum {
            Some(spectrum) => self.archive.catalog.measurement(spectrum).await.map_err(IngestError::from)?,
            None => None,
        };
        let size = row.bytes.saturating_add(spectrum.map_or(0, |spectrum| spectrum.bytes));
        Ok(Some(Candidate { row, options, size }))
    }
}

/// Returns true if a material states that its measurement was joined with the spectrum of these options, or with none.
fn is_joined_alike(options: &Options, origin: &StatedOrigin) -> bool {
    // The id of a spectrum is the digest of its bytes.
    options.spectrum.map(|id| id.to_string()) == origin.spectrum_digest
}

/// Describes the first error measure of a material that is larger than its file states; `None` if none is.
pub(super) fn excess(stated: &ErrorReport, found: &ErrorReport) -> Option<String> {
    if found.mask_mismatches > stated.mask_mismatches {
        let (found, stated) = (found.mask_mismatches, stated.mask_mismatches);
        return Some(format!(
            "samples with a value in only one of the two, the measurement and the material: {found}; the file states {stated}"
        ));
    }
    let measures = [
        ("er_l2", stated.er_l2, found.er_l2),
        ("er_l1", stated.er_l1, found.er_l1),
        ("max_relative_error", stated.max_relative_error, found.max_relative_error),
        ("relative_rmse", stated.relative_rmse, found.relative_rmse),
        ("max_absolute_error", stated.max_absolute_error, found.max_absolute_error),
    ];
    let worse =
        measures.into_iter().find(|(_, stated, found)| found.is_nan() || *found > SLACK * stated + f64::EPSILON);
    worse.map(|(name, stated, found)| format!("{name} is {found:.6}, the file states {stated:.6}"))
}

/// Builds the row of an uploaded material.
fn material(
    staged: &Staged,
    upload: MaterialUpload,
    report: Report,
    origin: StatedOrigin,
    compared: &[(MeasurementRow, Options, Remeasured)],
) -> Result<NewMaterial, MaterialError> {
    let described = |error: &dyn std::fmt::Display| MaterialError::Described(error.to_string());
    let payload = report.payload_digest.parse().map_err(|error| described(&error))?;
    let quantity = report.quantity;
    let known = compared.first();
    let request = known.zip(origin.request).map(|((row, ..), options)| CompressRequest {
        kind: CompressKind::Compress,
        measurement: row.id,
        reading: LaterOptions::default(),
        options,
        name: upload.name.clone(),
        licence: upload.licence.clone(),
        tags: upload.tags.clone(),
        priority: Priority::default(),
    });
    let manifest = Manifest {
        // The digest repeats the id.
        report: Report { digest: String::new(), ..report },
        names: Vec::new(),
        licence: upload.licence,
        licences: Vec::new(),
        provenance: Provenance {
            origin: Origin::Upload,
            generator: origin.generator.unwrap_or_default(),
            measurement: known.map(|(row, ..)| row.id),
            content_digest: origin.content_digest,
            options: known.map(|(_, options, _)| options.clone()).unwrap_or_default(),
            request,
        },
        measured_again: compared
            .iter()
            .map(|(row, _, found)| MeasuredAgain {
                measurement: row.id,
                generator: concat!("wavelume ", env!("CARGO_PKG_VERSION")).to_owned(),
                errors: found.errors,
                errors_at_samples: found.at_samples,
            })
            .collect(),
    };
    let document = manifest.document().map_err(|error| described(&error))?;
    // A number that JSON cannot hold, such as an infinite error, could be written but never read again.
    Manifest::read(&serde_json::Value::Object(document.clone()).to_string()).map_err(|error| described(&error))?;
    Ok(NewMaterial {
        id: staged.digest(),
        payload,
        quantity,
        bytes: staged.bytes(),
        name: upload.name,
        tags: upload.tags,
        measurements: compared.iter().map(|(row, ..)| row.id).collect(),
        document,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn room_is_asked_for_what_the_largest_measurement_needs() {
        let mut asked = Vec::new();
        let mut more = |bytes| {
            asked.push(bytes);
            bytes < 100
        };
        let mut room = Room { held: 0, more: &mut more };
        for bytes in [10, 5, 10, 30] {
            room.hold(bytes).unwrap();
        }
        assert!(matches!(room.hold(200), Err(MaterialError::NoRoom)));
        assert_eq!(asked, [10, 20, 170]);
    }

    #[test]
    fn larger_errors_than_stated_are_told_with_both_figures() {
        let stated = ErrorReport { er_l2: 0.01, er_l1: 0.008, ..ErrorReport::default() };
        assert_eq!(excess(&stated, &ErrorReport { er_l2: 1.005 * stated.er_l2, ..stated }), None);
        let told = excess(&stated, &ErrorReport { er_l2: 0.02, ..stated }).unwrap();
        assert_eq!(told, "er_l2 is 0.020000, the file states 0.010000");
        assert!(excess(&stated, &ErrorReport { er_l1: f64::NAN, ..stated }).is_some());
        assert!(
            excess(&stated, &ErrorReport { mask_mismatches: 1, ..stated }).unwrap().contains("in only one of the two")
        );
    }
}
