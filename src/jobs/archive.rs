//! Catalog and store opened together, and the bond between them.
//!
//! A store belongs to one catalog. The catalog has a random id, the store carries it in the text `wavelume-instance`,
//! and no process uses a store with another id: a catalog that was restored from a backup beside the running one would
//! otherwise delete what the original still names.

use super::site::Site;
use crate::catalog::{Catalog, CatalogError, Database, Dialect, Reserve};
use crate::store::{Disk, Place, Staging, Store, StoreError};
use crate::trust::Tenant;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A service's opened catalog (database) and store (directory or S3 prefix that holds the files); cheap to clone.
#[derive(Clone, Debug)]
pub struct Archive {
    pub(crate) data: PathBuf,
    pub(crate) store: Arc<dyn Store>,
    pub(crate) staging: Staging,
    pub(crate) catalog: Catalog,
    database: Database,
    place: Place,
    /// Time at which the store was last seen to hold the id of this catalog.
    seen: Arc<Mutex<Option<Instant>>>,
}

/// Failure to open or to maintain the catalog and store of a service.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// The data directory of the service cannot be created, opened or written.
    #[error("the data directory {} cannot be used: {source}", directory.display())]
    Directory {
        /// Path of the data directory that cannot be created, opened or written.
        directory: PathBuf,
        /// Error of the operating system when the directory was used.
        source: std::io::Error,
    },
    /// There is no service at the given place.
    #[error("{0}")]
    Absent(String),
    /// The store of files belongs to another catalog (database), or this catalog is a copy of another one.
    #[error("the store and the catalog do not belong together: {0}")]
    Belongs(String),
    /// The clock by which ages are told cannot be believed.
    #[error(
        "the clock may be wrong, so nothing is removed: {0}; set it right, or say that it is right with `wavelume gc \
         --trust-clock`"
    )]
    Clock(String),
    /// A backup, a restore or a move was refused, or could not end.
    #[error("{0}")]
    Copy(String),
    /// The store (directory or S3 prefix that holds the files) failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The database of measurements, materials and jobs failed.
    #[error(transparent)]
    Catalog(#[from] CatalogError),
    /// The pools of threads for jobs and requests could not be created.
    #[error("the pools of threads could not be created: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// Name of a small text in the store that holds the id of the catalog to which the store belongs.
pub(super) const INSTANCE: &str = "wavelume-instance";

/// Name of the text that describes the newest backup at a place, which must never be used as a store.
pub(super) const BACKUP: &str = "wavelume-backup";

/// Seconds that a starting service waits for a PostgreSQL database to have the schema it needs, while `wavelume
/// migrate` may be running. Raising it lets a service start earlier before the migration.
const PATIENCE: Duration = Duration::from_mins(1);

/// Upper bound on the connections of a service to a PostgreSQL database. Raising it answers more requests at once, up
/// to the limit of the database.
pub(super) const CONNECTIONS: u32 = 8;

/// Seconds for which a check that an S3 store holds this catalog's id stays valid for writes. Raising it lets a process
/// write for longer into a store that another catalog has taken over.
const BELIEVED: Duration = Duration::from_secs(30);

/// Seconds that the store has to answer the readiness check, or a worker whose job has failed. Raising it tolerates
/// slower stores, but delays both while the store is away.
const PROBE: Duration = Duration::from_secs(2);

impl Archive {
    /// Opens the catalog and store in a data directory, creates missing parts, and brings the catalog's schema up to
    /// date.
    pub async fn open(data: &Path) -> Result<Self, ArchiveError> {
        Self::serve(&Site::new(data)).await
    }

    /// Opens the catalog and store for a service or a worker. The schema of a SQLite catalog is brought up to date;
    /// that of a PostgreSQL catalog is only changed by [`Self::migrate`].
    pub async fn serve(site: &Site) -> Result<Self, ArchiveError> {
        let root = directory(site)?;
        let database = site.database(&root);
        let catalog = match database.dialect() {
            Dialect::Sqlite => Catalog::migrate(&database, false).await?.0,
            Dialect::Postgres => Catalog::open_as_is(&database, CONNECTIONS, PATIENCE).await?,
        };
        refuse_begun(&catalog, &database).await?;
        Self::with(site, root, database, catalog).await
    }

    /// Brings the catalog's schema up to date, and returns the number of migrations applied. `has_backup` confirms that
    /// a PostgreSQL database was backed up, which a migration that cannot be undone requires.
    pub async fn migrate(site: &Site, has_backup: bool) -> Result<usize, ArchiveError> {
        let root = directory(site)?;
        let (catalog, applied) = Catalog::migrate(&site.database(&root), has_backup).await?;
        catalog.close().await;
        Ok(applied)
    }

    /// Returns the data directory of a site, which is created if it is missing, and the place of its database.
    pub(super) fn places_of(site: &Site) -> Result<(PathBuf, Database), ArchiveError> {
        let root = directory(site)?;
        let database = site.database(&root);
        Ok((root, database))
    }

    /// Opens the store of a catalog.
    pub(super) async fn with(
        site: &Site,
        root: PathBuf,
        database: Database,
        catalog: Catalog,
    ) -> Result<Self, ArchiveError> {
        let place = site.store(&root);
        if let Place::Directory(directory) = &place {
            // Nothing is left in an empty mount point.
            let is_bare = matches!(directory.join(INSTANCE).try_exists(), Ok(false));
            if is_bare && catalog.has_claimed_store().await? && catalog.copied_from(false).await?.is_none() {
                return Err(lacks_id(&place, &database, &catalog.instance().await?));
            }
            std::fs::create_dir_all(directory)
                .map_err(|source| ArchiveError::Directory { directory: directory.clone(), source })?;
        }
        let opened = match place.open(&root) {
            Ok(opened) => opened,
            Err(StoreError::Io(source)) => return Err(ArchiveError::Directory { directory: root, source }),
            Err(other) => return Err(other.into()),
        };
        let archive = Self::of_parts(root, opened, catalog, database, place);
        archive.claim(site.adopt.as_deref(), true).await?;
        Ok(archive)
    }

    /// Returns the archive with `bytes` bytes of its disks kept free for deletions.
    pub(crate) fn keeping(self, bytes: u64) -> Self {
        Self { catalog: self.catalog.with_reserve(bytes), staging: self.staging.keeping(bytes), ..self }
    }

    /// Gives up the reserve beside the catalog of a site if its disk is full, so that the catalog can be opened.
    pub(crate) fn make_room(site: &Site, bytes: u64) {
        if let Some(file) = site.database(&site.data).file() {
            Reserve::beside(file, bytes).make_room();
        }
    }

    /// Fails if a disk of this service has no more space than is kept for deletions.
    pub(crate) async fn has_room(&self) -> Result<(), ArchiveError> {
        self.look_at_disks(|catalog, staging| {
            catalog.has_room()?;
            Ok(staging.has_room()?)
        })
        .await
    }

    /// Fails if a disk of this service has no space for an upload of `bytes` bytes.
    pub(crate) async fn takes_upload(&self, bytes: u64) -> Result<(), ArchiveError> {
        self.look_at_disks(move |catalog, staging| {
            catalog.takes_rows()?;
            Ok(staging.takes_upload(bytes)?)
        })
        .await
    }

    /// Fails if the disk of the catalog has no space for a further job, which may wait for space in the store.
    pub(crate) async fn takes_job(&self) -> Result<(), CatalogError> {
        let looked = self.look_at_disks(|catalog, _| Ok(catalog.takes_rows()?)).await;
        looked.map_err(|error| match error {
            ArchiveError::Catalog(error) => error,
            _ => CatalogError::NoSpace,
        })
    }

    async fn look_at_disks(
        &self,
        look: impl FnOnce(Catalog, Staging) -> Result<(), ArchiveError> + Send + 'static,
    ) -> Result<(), ArchiveError> {
        let (catalog, staging) = (self.catalog.clone(), self.staging.clone());
        let looked = tokio::task::spawn_blocking(move || look(catalog, staging)).await;
        looked.map_err(|error| StoreError::Io(error.into()))?
    }

    /// Measures the disks of the catalog, the store and the temporary files, as far as they are on this machine. Blocks
    /// the thread.
    pub(crate) fn disks(&self) -> Vec<(&'static str, Disk)> {
        let store = match &self.place {
            Place::Directory(directory) => Some(directory.as_path()),
            Place::S3 { .. } => None,
        };
        let places = [
            ("catalog", self.database.file().and_then(Path::parent)),
            ("store", store),
            ("staging", Some(self.staging.directory())),
        ];
        places.into_iter().filter_map(|(name, place)| Some((name, Disk::of(place?).ok()?))).collect()
    }

    /// Puts the opened parts of a service together: data directory, store and folder for temporary files, and catalog.
    pub(super) fn of_parts(
        data: PathBuf,
        (store, staging): (Arc<dyn Store>, Staging),
        catalog: Catalog,
        database: Database,
        place: Place,
    ) -> Self {
        Self { data, store, staging, catalog, database, place, seen: Arc::default() }
    }

    /// Returns the archive as the given tenant sees it: rows and stored bytes of others do not exist there.
    pub(crate) fn of(&self, tenant: &Tenant) -> Self {
        Self { catalog: self.catalog.of(tenant), ..self.clone() }
    }

    /// Returns the places of the catalog's database and of the store.
    pub(crate) fn places(&self) -> (&Database, &Place) {
        (&self.database, &self.place)
    }

    /// Makes the store belong to this catalog, if it belongs to the one with the id `adopt`, or to none and
    /// `may_begin`. Otherwise checks that both belong together, or that neither was used yet.
    pub(super) async fn claim(&self, adopt: Option<&str>, may_begin: bool) -> Result<(), ArchiveError> {
        if self.store.note(BACKUP).await?.is_some() {
            return Err(ArchiveError::Belongs(format!(
                "{} holds a backup: give another --store, and fill it with `wavelume restore {}`",
                self.place, self.place
            )));
        }
        let found = self.store.note(INSTANCE).await?;
        if adopt.is_some() && found.as_deref() == adopt {
            self.catalog.must_write()?;
            let id = self.catalog.rename_instance().await?;
            tracing::warn!(store = %self.place, id, adopted = adopt, "the store was taken over");
        } else {
            if let Some(moved) = self.catalog.copied_from(may_begin).await? {
                return Err(self.is_copy(&moved, found.as_deref()));
            }
            if found.is_some() || self.catalog.has_claimed_store().await? {
                return self.belongs().await;
            }
            if !may_begin {
                return Ok(());
            }
        }
        self.store.set_note(INSTANCE, self.catalog.instance().await?).await?;
        self.catalog.note_claimed_store().await?;
        self.belongs().await
    }

    /// Asks the store now if it holds this catalog's id: a store that is away, such as an unmounted directory or a
    /// bucket that a gateway denies, holds none. Done before each round of deletions, and around each look at a fault.
    pub(super) async fn belongs(&self) -> Result<(), ArchiveError> {
        let ours = self.catalog.instance().await?;
        let found = self.store.note(INSTANCE).await;
        let is_ours = found.as_ref().is_ok_and(|id| id.as_ref() == Some(&ours));
        *self.seen.lock().unwrap_or_else(PoisonError::into_inner) = is_ours.then(Instant::now);
        let Self { place, database, .. } = self;
        match found? {
            Some(id) if id == ours => Ok(()),
            Some(id) => Err(ArchiveError::Belongs(format!(
                "the store {place} belongs to the catalog {id}, but the catalog {database} is {ours}: check --store and \
                 --database; if the catalog {id} is gone for good, take its store over with --adopt-store {id}"
            ))),
            None => Err(lacks_id(place, database, &ours)),
        }
    }

    /// Checks that the store still holds this catalog's id. Asks a directory each time, because bytes could be written
    /// into an empty mount point; trusts an S3 store that held it within the last [`BELIEVED`]. Done before bytes are
    /// written.
    pub(super) async fn belonged(&self) -> Result<(), ArchiveError> {
        let seen = *self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let is_believed = seen.is_some_and(|seen| seen.elapsed() < BELIEVED);
        match self.place {
            Place::S3 { .. } if is_believed => Ok(()),
            Place::S3 { .. } | Place::Directory(_) => self.belongs().await,
        }
    }

    /// Asks the store now, for at most [`PROBE`], if it holds this catalog's id. Returns the reason why it is away.
    pub(crate) async fn answers(&self) -> Result<(), String> {
        match tokio::time::timeout(PROBE, self.belongs()).await {
            Ok(answer) => answer.map_err(|error| error.to_string()),
            Err(_) => Err(format!("the store {} did not answer within {} s", self.place, PROBE.as_secs())),
        }
    }

    fn is_copy(&self, id: &str, found: Option<&str>) -> ArchiveError {
        let Self { place, database, .. } = self;
        let carried = found.map_or_else(
            || "the store belongs to no catalog".to_owned(),
            |found| format!("the store belongs to {found}"),
        );
        ArchiveError::Belongs(format!(
            "the catalog {database} is a copy of the catalog {id}, made by a restored dump, and is used with \
             the store {place}; {carried}. The copy could delete there what the original still names. Give the copy a \
             store of its own, or, if the original is gone for good, take its store over with --adopt-store {id}"
        ))
    }
}

/// Builds the error for a store that carries no id, although the catalog with the id `ours` has used a store before.
fn lacks_id(place: &Place, database: &Database, ours: &str) -> ArchiveError {
    ArchiveError::Belongs(format!(
        "the store {place} carries no {INSTANCE}, but the catalog {database} ({ours}) has used a store before: check \
         --store and that its disk is mounted; if it is the right one and the text was removed, write {ours} to \
         {INSTANCE} in it"
    ))
}

/// Refuses a catalog that a restore or a move has begun to fill.
pub(super) async fn refuse_begun(catalog: &Catalog, database: &Database) -> Result<(), ArchiveError> {
    match catalog.copying().await? {
        None => Ok(()),
        Some(original) => Err(ArchiveError::Copy(format!(
            "a copy of {original} into {database} was begun and has not ended: start the same `wavelume restore` or \
             `wavelume move` again"
        ))),
    }
}

fn directory(site: &Site) -> Result<PathBuf, ArchiveError> {
    let wrong = |source| ArchiveError::Directory { directory: site.data.clone(), source };
    std::fs::create_dir_all(&site.data).map_err(wrong)?;
    // SQLite takes its path as text and the process may change its directory.
    site.data.canonicalize().map_err(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_directory_that_is_a_file_is_refused_by_name() {
        let data = tempfile::NamedTempFile::new().unwrap();
        let error = Archive::open(data.path()).await.unwrap_err();
        assert!(matches!(error, ArchiveError::Directory { .. }));
        assert!(error.to_string().contains(data.path().to_str().unwrap()));
    }

    #[tokio::test]
    async fn a_store_is_used_by_one_catalog_only() {
        let (mine, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let archive = Archive::open(mine.path()).await.unwrap();
        let id = archive.catalog.instance().await.unwrap();
        Archive::open(mine.path()).await.unwrap();

        let store = Some(Place::Directory(mine.path().to_owned()));
        let mut foreign = Site { store, ..Site::new(other.path()) };
        let error = Archive::serve(&foreign).await.unwrap_err().to_string();
        let theirs = Catalog::open_few(&Database::File(other.path().join("catalog.sqlite"))).await.unwrap();
        let theirs = theirs.instance().await.unwrap();
        for part in [&id, &theirs, &format!("--adopt-store {id}")] {
            assert!(error.contains(part), "{error}");
        }
        foreign.adopt = Some("a wrong id".to_owned());
        assert!(matches!(Archive::serve(&foreign).await, Err(ArchiveError::Belongs(_))));
        archive.belongs().await.unwrap();

        foreign.adopt = Some(id.clone());
        let taken = Archive::serve(&foreign).await.unwrap();
        assert!(matches!(archive.belongs().await, Err(ArchiveError::Belongs(_))), "the first is refused from now on");
        taken.belongs().await.unwrap();
        assert!(matches!(archive.belonged().await, Err(ArchiveError::Belongs(_))), "nor does it write");
        assert!(matches!(Archive::open(mine.path()).await, Err(ArchiveError::Belongs(_))));
    }

    #[tokio::test]
    async fn new_bytes_are_refused_before_the_kept_space_is_used() {
        let data = tempfile::tempdir().unwrap();
        let archive = Archive::open(data.path()).await.unwrap();
        archive.has_room().await.unwrap();
        // No disk has as much.
        let archive = Archive { staging: archive.staging.clone().keeping(0), ..archive.keeping(0) };
        archive.has_room().await.unwrap();
        let disk = Disk::of(data.path()).unwrap();
        assert!(Disk { free: 0, ..disk }.is_short(1 << 20));
        assert_eq!(archive.disks().len(), 3);
    }

    #[tokio::test]
    async fn a_store_that_stands_still_is_noticed() {
        let silent = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let data = tempfile::tempdir().unwrap();
        let mut archive = Archive::open(data.path()).await.unwrap();
        archive.answers().await.unwrap();
        archive.store = crate::store::s3_at(silent.local_addr().unwrap());
        let error = archive.answers().await.unwrap_err();
        assert!(error.contains("did not answer within"), "{error}");
    }

    #[tokio::test]
    async fn the_store_is_trusted_for_writes_until_it_is_seen_to_be_away() {
        for (site, _guard) in crate::jobs::site::tests::sites().await {
            let archive = Archive::serve(&site).await.unwrap();
            let id = archive.catalog.instance().await.unwrap();
            archive.store.set_note(INSTANCE, String::new()).await.unwrap();
            let is_trusted = archive.belonged().await.is_ok();
            assert_eq!(is_trusted, matches!(archive.place, Place::S3 { .. }), "a directory is asked each time");
            archive.answers().await.unwrap_err();
            assert!(matches!(archive.belonged().await, Err(ArchiveError::Belongs(_))), "it was seen to be away");
            archive.store.set_note(INSTANCE, id).await.unwrap();
            archive.belonged().await.unwrap();
        }
    }

    #[tokio::test]
    async fn a_store_that_has_lost_its_text_is_not_taken_for_a_new_one() {
        let data = tempfile::tempdir().unwrap();
        let mounted = data.path().join("store");
        let site = Site { store: Some(Place::Directory(mounted.clone())), ..Site::new(data.path()) };
        Archive::serve(&site).await.unwrap();
        std::fs::remove_dir_all(&mounted).unwrap();
        std::fs::create_dir(&mounted).unwrap();
        let error = Archive::serve(&site).await.unwrap_err().to_string();
        assert!(error.contains("carries no wavelume-instance") && error.contains("is mounted"), "{error}");
        assert_eq!(std::fs::read_dir(&mounted).unwrap().count(), 0, "nothing is left in the mount point");
    }
}
