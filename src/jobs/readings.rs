//! Readings of stored measurements by this version of the program, compared with those at their upload, and with the
//! materials that were made of them.

use super::archive::{Archive, ArchiveError};
use super::describe::{DescribedAxis, Understood, describe};
use super::document::Manifest;
use super::material::excess;
use super::options::Options;
use crate::catalog::{MaterialFilter, MaterialRow, MeasurementFilter, MeasurementRow};
use crate::compress::Target;
use crate::domain::Unit;
use crate::formats::{FormatErrorKind, Interpretation};
use crate::pipeline::{self, Input, PipelineError, Request};
use crate::store::{Digest, StoreExt};
use bytes::Bytes;
use serde::Serialize;

/// Measurements that this version reads differently than they were read at their upload, as `wavelume fsck --readings`
/// reports them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct ReadingsReport {
    /// Number of measurements whose stored files were read.
    pub read: u64,
    /// Ids of the measurements whose stored files, or those of their spectra, are missing or damaged.
    pub unread: Vec<String>,
    /// Measurements whose stored files are read differently.
    pub differing: Vec<Differing>,
}

/// A stored measurement that this version of the program reads differently.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Differing {
    /// Id of the measurement.
    pub measurement: String,
    /// Name of the measurement, or else of its file.
    pub name: Option<String>,
    /// Tenant that owns the measurement; absent if it is the default tenant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tenant: Option<String>,
    /// Difference of the two readings in words.
    pub difference: String,
    /// Materials that were made of the measurement.
    pub materials: Vec<MadeOf>,
}

/// A material that was made of a measurement, compared with the reading of the measurement by this version.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct MadeOf {
    /// Id of the material.
    pub material: String,
    /// Name of the material.
    pub name: Option<String>,
    /// Result of the comparison of a material with today's reading.
    pub comparison: Comparison,
    /// Reason of the result in words; absent if the material agrees with the reading.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detail: Option<String>,
}

/// Result of the comparison of a material with the reading of its measurement by this version.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Comparison {
    /// The material has the errors that it states against today's reading, or smaller ones.
    Agrees,
    /// The material was made of another reading: its errors are larger than it states, or its axes are others.
    Differs,
    /// Comparing is impossible, because the measurement cannot be read today or the file of the material is missing.
    Unknown,
}

/// Number of rows of the catalog that are looked up at once. Raising it needs more memory.
const PAGE: usize = 100;

/// Largest relative difference between two equal facts, such as the last wavelength of an axis or the largest value.
/// Raising it overlooks larger differences.
const CLOSE: f64 = 1e-5;

/// Bytes of a measurement, of its spectrum if it has one, and the options with which they are read.
#[derive(Clone)]
struct Stored {
    content: Bytes,
    spectrum: Option<Bytes>,
    options: Options,
}

impl Archive {
    /// Reads the stored files of all measurements again, with the options of their uploads, and compares what is read
    /// with the description that the upload left. `progress` is told the number of measurements that were read.
    pub(crate) async fn check_readings(&self, mut progress: impl FnMut(u64)) -> Result<ReadingsReport, ArchiveError> {
        let mut report = ReadingsReport::default();
        for tenant in self.catalog.tenant_ids().await? {
            let archive = self.of(&tenant);
            let mut next = None;
            loop {
                let page = archive.catalog.measurements(&MeasurementFilter::default(), next, PAGE).await?;
                for row in &page.items {
                    archive.check_reading(row, &mut report).await?;
                    progress(report.read);
                }
                next = page.next;
                if next.is_none() {
                    break;
                }
            }
        }
        Ok(report)
    }

    async fn check_reading(&self, row: &MeasurementRow, report: &mut ReadingsReport) -> Result<(), ArchiveError> {
        let then: Result<Understood, _> = serde_json::from_str(&row.document);
        let (difference, materials) = match then {
            Err(error) => (Some(format!("the description of its upload cannot be read: {error}")), Vec::new()),
            Ok(then) => {
                let Some(stored) = self.stored(row.content, &then.options).await? else {
                    if self.catalog.measurement(row.id).await?.is_some() {
                        report.unread.push(row.id.to_string());
                    }
                    return Ok(());
                };
                report.read += 1;
                let reading = stored.clone();
                let now = on_a_thread(move || understood(&reading)).await;
                let difference = difference(&then, &now);
                // A description without a fingerprint may hide a difference of the values, which materials show.
                let is_sure = difference.is_none() && then.fingerprint.is_some();
                let mut materials = if is_sure { Vec::new() } else { self.compare_materials(row.id, &stored).await? };
                if !matches!(now, Ok(Ok(_))) {
                    // The reason is that of the measurement.
                    materials.iter_mut().filter(|made| made.comparison == Comparison::Unknown).for_each(|made| {
                        made.detail = None;
                    });
                }
                (difference, materials)
            }
        };
        let is_odd = materials.iter().any(|made| made.comparison == Comparison::Differs);
        let by_material = || is_odd.then(|| "read as described at its upload, but a material is not".to_owned());
        if let Some(difference) = difference.or_else(by_material) {
            let tenant = self.told_tenant();
            let name = row.name.clone().or_else(|| row.file_name.clone());
            report.differing.push(Differing { measurement: row.id.to_string(), name, tenant, difference, materials });
        }
        Ok(())
    }

    /// Returns the bytes of a measurement, and of its spectrum; `None` if they are missing or damaged.
    async fn stored(&self, content: Digest, options: &Options) -> Result<Option<Stored>, ArchiveError> {
        let Some(content) = self.sound_bytes(content).await? else { return Ok(None) };
        let spectrum = match options.spectrum {
            // The id of a spectrum is the digest of its bytes.
            Some(id) => match self.sound_bytes(id).await? {
                Some(bytes) => Some(bytes),
                None => return Ok(None),
            },
            None => None,
        };
        Ok(Some(Stored { content, spectrum, options: options.clone() }))
    }

    /// Returns stored bytes; `None` if they are missing or damaged, which is not marked.
    async fn sound_bytes(&self, digest: Digest) -> Result<Option<Bytes>, ArchiveError> {
        let Some(blob) = self.catalog.blob(digest).await? else { return Ok(None) };
        match self.store.get(&blob.object, blob.bytes).await {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.damage().is_some() => {
                // A store that is away has no bytes either.
                self.belongs().await?;
                Ok(None)
            }
            Err(error) => Err(error.into()),
        }
    }

    /// Compares all materials that were made of a measurement with its reading by this version.
    async fn compare_materials(&self, measurement: Digest, stored: &Stored) -> Result<Vec<MadeOf>, ArchiveError> {
        let filter = MaterialFilter { measurement: Some(measurement), ..MaterialFilter::default() };
        let (mut compared, mut next) = (Vec::new(), None);
        loop {
            let page = self.catalog.materials(&filter, next, PAGE).await?;
            for row in &page.items {
                let (comparison, detail) = match self.sound_bytes(row.id).await? {
                    None => (Comparison::Unknown, Some("its stored file is missing or damaged".to_owned())),
                    Some(bytes) => {
                        let (stored, interpretation) = (stored.clone(), interpretation_of(row, measurement, stored));
                        on_a_thread(move || compared_with(&stored, &interpretation, &bytes))
                            .await
                            .unwrap_or_else(|panic| (Comparison::Unknown, Some(panic)))
                    }
                };
                compared.push(MadeOf { material: row.id.to_string(), name: row.name.clone(), comparison, detail });
            }
            next = page.next;
            if next.is_none() {
                return Ok(compared);
            }
        }
    }
}

/// Runs a computation on a thread that may block. A panic becomes a sentence.
async fn on_a_thread<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, String> {
    tokio::task::spawn_blocking(work).await.map_err(|error| format!("the program failed: {error}"))
}

/// Returns the options with which the job read the measurement, as far as its material tells them.
fn interpretation_of(row: &MaterialRow, measurement: Digest, stored: &Stored) -> Interpretation {
    let uploaded = stored.options.interpretation();
    let request = Manifest::read(&row.document).ok().and_then(|manifest| manifest.provenance.request);
    match request {
        Some(request) if request.measurement == measurement => request.reading.replace(uploaded),
        _ => uploaded,
    }
}

/// Measures the errors of a material against the reading of its measurement by this version, and compares them with
/// those that the material states.
fn compared_with(stored: &Stored, interpretation: &Interpretation, material: &[u8]) -> (Comparison, Option<String>) {
    let stated = match pipeline::stated_in_header(material) {
        Ok(stated) => stated,
        Err(error) => return (Comparison::Unknown, Some(error.to_string())),
    };
    let errors = stated.report.errors;
    let request = stated.origin.request.unwrap_or_else(|| Request::to(Target::ErL2(errors.er_l2)));
    let spectrum = stored.spectrum.as_deref();
    let input = Input { bytes: &stored.content, spectrum, interpretation };
    match pipeline::remeasure(&input, material, &request) {
        Ok(found) => match excess(&errors, &found.errors) {
            None => (Comparison::Agrees, None),
            Some(excess) => (Comparison::Differs, Some(excess)),
        },
        Err(error @ pipeline::RemeasureError::Other { .. }) => (Comparison::Differs, Some(error.to_string())),
        Err(error) => (Comparison::Unknown, Some(error.to_string())),
    }
}

/// Describes a measurement as this version reads it.
fn understood(stored: &Stored) -> Result<Understood, PipelineError> {
    let (spectrum, interpretation) = (stored.spectrum.as_deref(), stored.options.interpretation());
    let input = Input { bytes: &stored.content, spectrum, interpretation: &interpretation };
    pipeline::read(&input).map(|source| describe(&source.acquisition, &stored.options))
}

/// Tells in words by what two readings of a measurement differ: the one at its upload, and that of this version.
fn difference(then: &Understood, now: &Result<Result<Understood, PipelineError>, String>) -> Option<String> {
    let was =
        then.needs.first().map_or_else(|| format!("was read as {}", in_words(then)), |need| format!("asked: {need}"));
    let now = match now {
        Ok(Ok(now)) => now,
        Ok(Err(PipelineError::Format(error))) if error.kind == FormatErrorKind::NeedsOption => {
            return then.needs.is_empty().then(|| format!("{was}; asks today: {error}"));
        }
        Ok(Err(error)) => return Some(format!("{was}; refused today: {error}")),
        Err(panic) => return Some(format!("{was}; today {panic}")),
    };
    if !then.needs.is_empty() || !is_alike(then, now) {
        return Some(format!("{was}; today as {}", in_words(now)));
    }
    if let (Some(old), Some(new)) = (then.range, now.range)
        && !old.iter().zip(&new).all(|(old, new)| close(*old, *new, old.abs().max(new.abs())))
    {
        let span = |[low, high]: [f64; 2]| format!("from {} to {}", short(low), short(high));
        return Some(format!("values {} then, {} today", span(old), span(new)));
    }
    let missing = |read: &Understood| read.coverage.as_ref().map(|coverage| coverage.missing_samples);
    if let (Some(old), Some(new)) = (missing(then), missing(now))
        && old != new
    {
        return Some(format!("{old} missing values then, {new} today"));
    }
    let (old, new) = (then.fingerprint?, now.fingerprint?);
    let told = |name: &str, part: f64| {
        let percent = 100.0 * part;
        let percent = if percent >= 0.1 { format!("{percent:.1}") } else { format!("{percent:.0e}") };
        format!("its {name} differ by about {percent} % of their root mean square")
    };
    let values = old.values.difference(&new.values).map(|part| told("values", part));
    values.or_else(|| old.coordinates.difference(&new.coordinates).map(|part| told("angles or wavelengths", part)))
}

/// Returns true if two readings have the same quantity, unit, axes and number of values.
fn is_alike(then: &Understood, now: &Understood) -> bool {
    (then.quantity, then.unit, then.samples) == (now.quantity, now.unit, now.samples)
        && then.axes.len() == now.axes.len()
        && then.axes.iter().zip(&now.axes).all(|(then, now)| is_same_axis(then, now))
}

/// Returns true if two descriptions are of one axis. What an earlier version has not recorded is not compared.
fn is_same_axis(then: &DescribedAxis, now: &DescribedAxis) -> bool {
    fn same<T: PartialEq>(then: Option<&T>, now: Option<&T>) -> bool {
        then.is_none() || then == now
    }
    let near = |then: Option<f64>, now: Option<f64>| match (then, now) {
        (Some(then), Some(now)) => close(then, now, 1.0_f64.max(then.abs())),
        (then, _) => then.is_none(),
    };
    then.kind == now.kind
        && same(then.count.as_ref(), now.count.as_ref())
        && near(then.first, now.first)
        && near(then.last, now.last)
        && near(then.spacing, now.spacing)
        && same(then.domain.as_ref(), now.domain.as_ref())
        && same(then.level.as_ref(), now.level.as_ref())
        && same(then.frame.as_ref(), now.frame.as_ref())
        && same(then.polar.as_ref(), now.polar.as_ref())
        && same(then.azimuths.as_ref(), now.azimuths.as_ref())
        && same(then.labels.as_ref(), now.labels.as_ref())
}

fn close(a: f64, b: f64, size: f64) -> bool {
    (a - b).abs() <= CLOSE * size
}

/// Formats a value, which is a float32, without the digits that float64 adds to it.
fn short(value: f64) -> String {
    let value = value as f32;
    if value == 0.0 || (1e-4..1e6).contains(&value.abs()) { value.to_string() } else { format!("{value:e}") }
}

/// Describes a reading in a few words: quantity, unit, axes.
fn in_words(read: &Understood) -> String {
    let quantity = read.quantity.map_or_else(|| "an unknown quantity".to_owned(), |quantity| quantity.to_string());
    let unit = read.unit.filter(|unit| *unit != Unit::One).map(|unit| format!(" ({unit})")).unwrap_or_default();
    let axis = |axis: &DescribedAxis| match (axis.description.as_str(), axis.count) {
        ("", Some(count)) => format!("{count} entries"),
        ("", None) => "an axis".to_owned(),
        (words, _) => words.to_owned(),
    };
    let axes: Vec<String> = read.axes.iter().map(axis).collect();
    format!("{quantity}{unit} on {}", axes.join(" × "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::{Added, NewMaterial, NewMeasurement, Uploaded, testing};
    use crate::jobs::publish::Published;
    use crate::jobs::site::tests::sites;
    use serde_json::Value;

    const TILE: &[u8] = b"wavelength [nm],reflectance\n400,0.10\n450,0.20\n500,0.35\n550,0.30\n600,0.25\n";
    const SAND: &[u8] = b"wavelength [nm],reflectance\n400,0.31\n450,0.32\n500,0.33\n550,0.34\n600,0.35\n";
    const MOSS: &[u8] = b"wavelength [nm],reflectance\n400,0.02\n450,0.03\n500,0.13\n550,0.24\n600,0.05\n";

    /// Returns the description of a file at its upload, as the catalog holds it.
    fn document(file: &[u8]) -> Value {
        let stored = Stored { content: Bytes::copy_from_slice(file), spectrum: None, options: Options::default() };
        serde_json::to_value(understood(&stored).unwrap()).unwrap()
    }

    /// Returns the description of a file that a version without fingerprints has left.
    fn old(file: &[u8]) -> Value {
        let mut document = document(file);
        document.as_object_mut().unwrap().remove("fingerprint").unwrap();
        document
    }

    /// Stores a file with a description of its upload.
    async fn store(archive: &Archive, file: &[u8], document: &Value) -> Digest {
        let published = Published::new(archive, archive.staging.stage(file).unwrap()).await.unwrap();
        let (id, document) = (Digest::of(file), document.to_string());
        let new = NewMeasurement { id, content: id, document, ..testing::measurement("tile") };
        let added = archive.catalog.add_measurement(&new, published.claim()).await.unwrap();
        assert!(matches!(added, Added::Row(..)), "{added:?}");
        id
    }

    /// Stores the material that a file gives, as if it had been made of a stored measurement.
    async fn make(archive: &Archive, measurement: Digest, file: &[u8]) -> Digest {
        let input = Input { bytes: file, spectrum: None, interpretation: &Interpretation::default() };
        let made = pipeline::read(&input).unwrap().compress(&Request::er_l2(0.01)).unwrap();
        let published = Published::new(archive, archive.staging.stage(&made.bytes).unwrap()).await.unwrap();
        let id = published.digest();
        let new = NewMaterial { id, measurements: vec![measurement], ..testing::material("made") };
        assert_eq!(archive.catalog.add_material(&new, published.claim()).await.unwrap(), Uploaded::Stored(true));
        id
    }

    /// Returns a file with other numbers in the place of some.
    fn with(file: &[u8], [from, to]: [&str; 2]) -> Vec<u8> {
        let text = str::from_utf8(file).unwrap();
        assert!(text.contains(from));
        text.replace(from, to).into_bytes()
    }

    #[tokio::test]
    async fn measurements_that_are_read_differently_are_listed_with_their_materials() {
        for (site, _guard) in sites().await {
            let archive = Archive::serve(&site).await.unwrap();
            let theirs = testing::other(&archive.catalog, "ab").await;
            let theirs = archive.of(theirs.tenant());
            // Unchanged, as an upload stores it, and as an earlier version did.
            let tile = store(&archive, TILE, &document(TILE)).await;
            make(&archive, tile, TILE).await;
            let sand = store(&archive, SAND, &old(SAND)).await;
            make(&archive, sand, SAND).await;
            let mut told = Vec::new();
            let report = archive.check_readings(|read| told.push(read)).await.unwrap();
            assert_eq!(report, ReadingsReport { read: 2, ..ReadingsReport::default() });
            assert_eq!(told, [1, 2]);

            // An earlier version has taken the wavelengths for other ones.
            let other = with(MOSS, ["600,", "650,"]);
            let moss = store(&theirs, MOSS, &old(&other)).await;
            let stale = make(&theirs, moss, &other).await;
            let right = make(&theirs, moss, MOSS).await;
            let report = archive.check_readings(|_| ()).await.unwrap();
            assert_eq!((report.read, report.unread.len(), report.differing.len()), (3, 0, 1));
            let Differing { measurement, name, tenant, difference, mut materials } = report.differing[0].clone();
            assert_eq!((measurement, name, tenant), (moss.to_string(), Some("tile".into()), Some("ab".into())));
            let words = "was read as reflectance on 400..650 nm (5); today as reflectance on 400..600 nm (5)";
            assert_eq!(difference, words);
            materials.sort_by_key(|made| made.comparison == Comparison::Differs);
            let [first, second] = materials.as_slice() else { panic!("{materials:?}") };
            assert_eq!((&first.material, first.comparison), (&right.to_string(), Comparison::Agrees));
            assert_eq!((&second.material, second.comparison), (&stale.to_string(), Comparison::Differs));
            assert!(second.detail.as_ref().unwrap().contains("the measurement gives"), "{second:?}");
        }
    }

    #[tokio::test]
    async fn a_material_shows_what_a_description_without_fingerprint_hides() {
        for (site, _guard) in sites().await {
            let archive = Archive::serve(&site).await.unwrap();
            // The smallest and largest value are the same.
            let other = with(TILE, ["550,0.30", "550,0.15"]);
            let tile = store(&archive, TILE, &old(&other)).await;
            assert_eq!(archive.check_readings(|_| ()).await.unwrap().differing, []);
            make(&archive, tile, &other).await;
            let differing = archive.check_readings(|_| ()).await.unwrap().differing;
            assert_eq!(differing.len(), 1);
            assert_eq!(differing[0].difference, "read as described at its upload, but a material is not");
            assert!(differing[0].materials[0].detail.as_ref().unwrap().contains("er_l2 is "), "{differing:?}");
        }
    }

    #[tokio::test]
    async fn a_missing_file_is_told_apart_and_not_marked() {
        for (site, _guard) in sites().await {
            let archive = Archive::serve(&site).await.unwrap();
            let tile = store(&archive, TILE, &document(TILE)).await;
            let object = archive.catalog.blob(tile).await.unwrap().unwrap().object;
            archive.store.remove(&[object]).await;
            let report = archive.check_readings(|_| ()).await.unwrap();
            assert_eq!(report, ReadingsReport { unread: vec![tile.to_string()], ..ReadingsReport::default() });
            assert!(!archive.catalog.blob(tile).await.unwrap().unwrap().suspect);
        }
    }

    #[test]
    fn differences_are_told_in_words() {
        let read = |file: &[u8]| serde_json::from_value::<Understood>(document(file)).unwrap();
        let told = |then: &Understood, file: &[u8]| difference(then, &Ok(Ok(read(file))));
        let then = read(TILE);
        assert_eq!(told(&then, TILE), None);
        let other = with(TILE, ["0.35", "0.95"]);
        assert_eq!(told(&then, &other).unwrap(), "values from 0.1 to 0.35 then, from 0.1 to 0.95 today");
        let words = told(&then, &with(TILE, ["550,0.30", "550,0.15"])).unwrap();
        assert!(words.starts_with("its values differ by about "), "{words}");
        let words = told(&then, &with(TILE, ["550,", "540,"])).unwrap();
        assert!(words.starts_with("its angles or wavelengths differ by about "), "{words}");

        let needy = super::super::describe::describe_needy("csv", "state the quantity", &Options::default());
        let words = told(&needy, TILE).unwrap();
        assert!(words.starts_with("asked: state the quantity; today as reflectance on "), "{words}");
        let refusal = |kind| {
            let message = "no axes".to_owned();
            Ok(Err(PipelineError::Format(crate::formats::FormatError { kind, format: "csv", position: None, message })))
        };
        assert_eq!(difference(&needy, &refusal(FormatErrorKind::NeedsOption)), None);
        let words = difference(&then, &refusal(FormatErrorKind::NeedsOption)).unwrap();
        assert!(words.contains("; asks today: csv: no axes"), "{words}");
        let words = difference(&then, &refusal(FormatErrorKind::Malformed)).unwrap();
        assert!(words.contains("; refused today: csv: no axes"), "{words}");
    }
}
