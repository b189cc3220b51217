//! Backup of a running service: its catalog as it is at one moment, and the stored bytes that this copy names.
//!
//! A backup is a directory or S3 prefix with the text `wavelume-backup` and objects under their digests: those of the
//! service, and the tables of the catalog as compressed files. Later backups to the same place add what is missing.

use super::apart::containing;
use super::archive::{Archive, ArchiveError, BACKUP, INSTANCE};
use super::dump::{Dump, Table, blocking};
use super::fetch::{Lost, Stored, Tally, UNREADABLE, fetch_each, stored};
use crate::catalog::Catalog;
use crate::store::{Digest, Object, Place, Staging, Store, StoreError, StoreExt};
use futures::TryStreamExt;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::mem;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tempfile::TempDir;
use tokio_util::task::AbortOnDropHandle;

/// Version of the format in which backups are written.
pub(super) const FORM: u32 = 1;

/// Time for which a killed backup or move still keeps stored objects from being deleted. Raising it bears longer
/// standstills of a running one.
const HOLD: Duration = Duration::from_mins(10);

/// Age above which a temporary file counts as left by a killed backup or restore. Raising it keeps such files for
/// longer.
pub(super) const STALE: Duration = Duration::from_hours(24);

/// Number of files that the backup lacks and that are copied together. Those that are missing in the store, too, wait
/// once for a second look. Raising it needs more memory, some 500 bytes for each.
const TOGETHER: usize = 5_000;
/// Number of missing or damaged files that are marked in one transaction.
const MARKED: usize = 250;

/// Description of a backup.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Manifest {
    /// Version of the format in which the backup is written.
    pub form: u32,
    /// Random id of the backup, which tells it from other backups of the same catalog.
    pub id: String,
    /// Id of the catalog that was copied.
    pub instance: String,
    /// Number of the last migration of the schema of the copied catalog.
    pub schema: i64,
    /// Time at which the catalog was copied, in ms of the Unix epoch, by the clock of the database.
    pub made_ms: i64,
    /// Tables of the copied catalog.
    pub tables: Vec<Table>,
    /// Digests of bytes that were missing or damaged when the backup was made.
    pub lost: Vec<Digest>,
}

/// Report of a backup; the output of `wavelume backup`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub(crate) struct BackupReport {
    /// Number of database rows in the copied catalog.
    pub rows: u64,
    /// Counts of the copied files and of those that were not copied.
    #[serde(flatten)]
    pub files: Tally,
}

/// Hold that keeps stored objects from being deleted; prolonged in the catalog until it is ended or dropped.
pub(super) struct Hold {
    catalog: Catalog,
    name: String,
    lapsed: Arc<AtomicBool>,
    _prolonging: AbortOnDropHandle<()>,
}

impl Hold {
    /// Keeps all processes from deleting stored objects.
    pub(super) async fn begin(catalog: &Catalog) -> Result<Self, ArchiveError> {
        let (name, lapsed) = (uuid::Uuid::now_v7().to_string(), Arc::new(AtomicBool::new(false)));
        catalog.begin_hold(&name, HOLD).await?;
        let prolonging = {
            let (catalog, name, lapsed) = (catalog.clone(), name.clone(), Arc::clone(&lapsed));
            async move {
                loop {
                    tokio::time::sleep(HOLD / 10).await;
                    match catalog.prolong_hold(&name, HOLD).await {
                        Ok(true) => {}
                        Ok(false) => lapsed.store(true, Ordering::Relaxed),
                        Err(error) => tracing::warn!(%error, "the hold that keeps stored objects was not prolonged"),
                    }
                }
            }
        };
        let prolonging = AbortOnDropHandle::new(tokio::spawn(prolonging));
        Ok(Self { catalog: catalog.clone(), name, lapsed, _prolonging: prolonging })
    }

    /// Ends the hold, so that processes may delete stored objects again. Fails if the hold was interrupted and there
    /// are `lost` files, which may have been deleted in between.
    pub(super) async fn end(self, lost: &[Lost]) -> Result<(), ArchiveError> {
        let held = self.catalog.prolong_hold(&self.name, HOLD).await? && !self.lapsed.load(Ordering::Relaxed);
        self.catalog.end_hold(&self.name).await?;
        if held || lost.is_empty() {
            return Ok(());
        }
        Err(ArchiveError::Copy(
            "this process stood still for too long, and stored bytes were deleted meanwhile: start the backup or the \
             move again"
                .to_owned(),
        ))
    }
}

/// Returns the name of the object that holds the bytes of this digest in a backup.
pub(super) fn kept(digest: Digest) -> Object {
    Object::plain(digest)
}

impl Archive {
    /// Copies the catalog, as it is now, and the stored bytes that it names to `to`. Bytes that an earlier backup has
    /// left there are not copied again; if `check`, their digests are computed again.
    pub(crate) async fn backup(&self, to: &Place, check: bool) -> Result<BackupReport, ArchiveError> {
        if let Place::Directory(directory) = to {
            self.refuse_own(directory)?;
            std::fs::create_dir_all(directory)
                .map_err(|source| ArchiveError::Directory { directory: directory.clone(), source })?;
        }
        let scratch = match to {
            Place::Directory(_) => None,
            Place::S3 { .. } => self.scratch()?,
        };
        let (store, staging) = to.open(scratch.as_ref().map_or(&self.data, |made| made.path()))?;
        if let Some(id) = store.note(INSTANCE).await? {
            return Err(ArchiveError::Copy(format!(
                "{to} is the store of the catalog {id}: choose another place for the backup"
            )));
        }
        let before = manifest(&store, to).await?;
        if let Place::Directory(_) = to {
            let swept = staging.clone();
            blocking(move || swept.sweep(STALE, |_| None)).await?;
        }
        // Without the right to write no deletion is held up; bytes that go meanwhile are reported as missing.
        let hold = if self.catalog.is_read_only() { None } else { Some(Hold::begin(&self.catalog).await?) };
        let made_ms = self.catalog.time().await?;
        let schema = self.catalog.version().await?;
        let dump = Dump::of(&self.catalog, &staging).await?;
        // The tables first: a service that runs here removes old temporary files.
        for (table, staged) in &dump.0 {
            store.publish(staged, &kept(table.digest)).await?;
        }
        let files = self.copy_blobs(&dump, &store, &staging, check).await?;
        if let Some(hold) = hold {
            hold.end(&files.lost).await?;
        }
        let manifest = Manifest {
            form: FORM,
            id: uuid::Uuid::now_v7().to_string(),
            instance: self.catalog.instance().await?,
            schema,
            made_ms,
            tables: dump.0.iter().map(|(table, _)| table.clone()).collect(),
            lost: files.lost.iter().map(|lost| lost.digest).collect(),
        };
        let newest = self::manifest(&store, to).await?;
        if newest.as_ref().map(|newest| &newest.id) != before.as_ref().map(|before| &before.id) {
            return Err(ArchiveError::Copy(format!(
                "another backup was made in {to} meanwhile: make one at a time, and start this one again"
            )));
        }
        store.set_note(BACKUP, serde_json::json!(manifest).to_string()).await?;
        // Bytes of the service stay, as an older catalog may name them; the older catalog itself is replaced.
        let tables = |manifest: &Manifest| manifest.tables.iter().map(|table| table.digest).collect::<Vec<_>>();
        let new = tables(&manifest);
        let old = before.map(|before| tables(&before)).unwrap_or_default();
        let old: Vec<Object> = old.into_iter().filter(|digest| !new.contains(digest)).map(kept).collect();
        for outcome in store.remove(&old).await {
            outcome?;
        }
        Ok(BackupReport { rows: dump.rows(), files })
    }

    /// Refuses a backup into the data directory, or into the directory of the store: it would be lost together with the
    /// original, and its files would be taken for those of the service.
    fn refuse_own(&self, directory: &Path) -> Result<(), ArchiveError> {
        let own = std::iter::once(self.data.as_path()).chain(self.places().1.directory());
        let own = containing(directory, own)
            .map_err(|source| ArchiveError::Directory { directory: directory.to_owned(), source })?;
        match own {
            None => Ok(()),
            Some(own) => Err(ArchiveError::Copy(format!(
                "{} lies in {}, which the backup is to copy: choose a place outside, best on another disk",
                directory.display(),
                own.display()
            ))),
        }
    }

    /// Returns a directory for temporary files on their way to an S3 bucket: a new one of the system if those of the
    /// data directory cannot be written, otherwise `None`.
    fn scratch(&self) -> Result<Option<TempDir>, ArchiveError> {
        if tempfile::tempfile_in(self.data.join("staging")).is_ok() {
            return Ok(None);
        }
        Ok(Some(tempfile::Builder::new().prefix("wavelume-").tempdir().map_err(StoreError::Io)?))
    }

    async fn copy_blobs(
        &self,
        dump: &Dump,
        to: &Arc<dyn Store>,
        staging: &Staging,
        check: bool,
    ) -> Result<Tally, ArchiveError> {
        let (mut rows, mut tally) = (dump.read("blobs")?, Tally::default());
        let (mut listed, mut there, mut absent) = (None, HashMap::new(), Vec::new());
        loop {
            let batch = stored(&mut rows).await?;
            let is_end = batch.is_empty();
            for blob in batch {
                let digest = blob.object.digest();
                // Digests of a tenant come in order: each folder is listed once for each.
                let folder = kept(digest).folder();
                if listed.as_ref() != Some(&folder) {
                    there = to.list(&folder).try_collect::<HashMap<Object, u64>>().await?;
                    listed = Some(folder);
                }
                match there.get(&kept(digest)) {
                    Some(size) if is_whole(to, &blob, *size, check).await? => tally.there(*size),
                    _ => absent.push((blob.object.clone(), blob.object)),
                }
            }
            if is_end || absent.len() >= TOGETHER {
                self.copy_absent(mem::take(&mut absent), to, staging, &mut tally).await?;
            }
            if is_end {
                return Ok(tally);
            }
        }
    }

    /// Copies stored files that the backup lacks, and marks in the catalog those that are missing or damaged.
    async fn copy_absent(
        &self,
        absent: Vec<(Object, Object)>,
        to: &Arc<dyn Store>,
        staging: &Staging,
        tally: &mut Tally,
    ) -> Result<(), ArchiveError> {
        let copies = fetch_each((&self.store, Some(&self.catalog)), absent, staging, |object, fetched| async move {
            if let Ok(staged) = &fetched {
                to.publish(staged, &kept(object.digest())).await?;
            }
            Ok((object, fetched.map(|staged| staged.bytes())))
        });
        let mut suspects = Vec::new();
        for (object, copied) in copies.await? {
            match copied {
                Ok(bytes) => tally.copied(bytes),
                Err(lost) => {
                    if lost.kind != UNREADABLE {
                        suspects.push(object);
                    }
                    tally.lost.push(lost);
                }
            }
        }
        if !suspects.is_empty() {
            self.belongs().await?;
        }
        // Few at a time: other writers of the catalog wait for each transaction.
        for some in suspects.chunks(MARKED) {
            self.catalog.suspect(some).await?;
        }
        Ok(())
    }
}

/// Returns true if a file of an earlier backup has the size that the catalog states, and, if `check` or if the catalog
/// states none, the right digest.
async fn is_whole(store: &Arc<dyn Store>, blob: &Stored, size: u64, check: bool) -> Result<bool, ArchiveError> {
    if blob.bytes.is_some_and(|bytes| bytes != size) {
        return Ok(false);
    }
    Ok(!check && blob.bytes.is_some() || Arc::clone(store).verify(&kept(blob.object.digest())).await.is_ok())
}

/// Reads the description of the newest backup at a place, if there is one.
pub(super) async fn manifest(store: &Arc<dyn Store>, place: &Place) -> Result<Option<Manifest>, ArchiveError> {
    let Some(text) = store.note(BACKUP).await? else { return Ok(None) };
    let wrong = |reason: String| ArchiveError::Copy(format!("{BACKUP} of {place} cannot be used: {reason}"));
    let form: Form = serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
    if form.form > FORM {
        return Err(wrong(format!(
            "found the backup format {}, expected at most {FORM}; use a newer program",
            form.form
        )));
    }
    serde_json::from_str(&text).map(Some).map_err(|error| wrong(error.to_string()))
}

/// Version of the format of a backup, read first because a later program may describe a backup in another way.
#[derive(Deserialize)]
struct Form {
    form: u32,
}
