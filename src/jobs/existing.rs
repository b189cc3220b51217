//! Service that exists already, opened for a maintenance command: nothing is made, and a place without one is named
//! with what is probably wrong.

use super::archive::{Archive, ArchiveError, BACKUP, refuse_begun};
use super::site::Site;
use crate::catalog::{Catalog, Database};
use crate::store::{FOLDER, Staging};
use std::path::{Path, PathBuf};

/// Use that a command makes of a catalog which it opens without a store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Use {
    /// The catalog is read; the user of the command need not have the right to write it.
    Read,
    /// Rows of an existing catalog are changed.
    Change,
    /// A missing SQLite catalog is made, and an old one brought up to date, as a starting service does.
    Make,
}

impl Archive {
    /// Opens the catalog and store of an existing service for a maintenance command, without making or changing either.
    /// A SQLite catalog that this user may not write is opened for reading alone.
    pub async fn look_after(site: &Site) -> Result<Self, ArchiveError> {
        let (root, database) = existing(site)?;
        let catalog = Catalog::open_existing(&database).await?;
        refuse_begun(&catalog, &database).await?;
        let place = site.store(&root);
        let absent = || ArchiveError::Absent(format!("there is no directory of the store {place}; check --store"));
        let store = place.open_to_read()?.ok_or_else(absent)?;
        let staging = Staging::new(place.staging(&root));
        let archive = Self::of_parts(root, (store, staging), catalog, database, place);
        archive.claim(site.adopt.as_deref(), false).await?;
        Ok(archive)
    }

    /// Refuses to go on if the catalog is opened for reading alone.
    pub(crate) fn must_write(&self) -> Result<(), ArchiveError> {
        Ok(self.catalog.must_write()?)
    }

    /// Opens the catalog alone, for a command that runs beside services.
    pub(crate) async fn open_catalog(site: &Site, purpose: Use) -> Result<Catalog, ArchiveError> {
        let (catalog, database) = match purpose {
            Use::Make => {
                // Only a catalog in the data directory needs one.
                let database = match &site.database {
                    Some(database) => database.clone(),
                    None => Self::places_of(site)?.1,
                };
                let catalog = match &database {
                    Database::File(_) => Catalog::migrate(&database, false).await?.0,
                    Database::Server(_) => Catalog::open_few(&database).await?,
                };
                (catalog, database)
            }
            Use::Read | Use::Change => {
                let (_, database) = existing(site)?;
                (Catalog::open_existing(&database).await?, database)
            }
        };
        if purpose != Use::Read {
            catalog.must_write()?;
        }
        refuse_begun(&catalog, &database).await?;
        Ok(catalog)
    }
}

/// Returns the data directory of an existing service and the place of its database. A missing one is an error: the
/// place is most likely a wrong one.
fn existing(site: &Site) -> Result<(PathBuf, Database), ArchiveError> {
    let root = match site.data.canonicalize() {
        Ok(root) => root,
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
            return Err(ArchiveError::Directory { directory: site.data.clone(), source });
        }
        Err(_) if site.database.is_none() => {
            let data = site.data.display();
            return Err(ArchiveError::Absent(format!("{data}: no such data directory; check --data")));
        }
        Err(_) => site.data.clone(),
    };
    let database = site.database(&root);
    match database.file().map(|file| (file, file.try_exists())) {
        Some((file, Ok(false))) => Err(ArchiveError::Absent(no_catalog(&root, file))),
        Some((file, Err(source))) => {
            let directory = file.parent().unwrap_or(&root).to_owned();
            Err(ArchiveError::Directory { directory, source })
        }
        Some((_, Ok(true))) | None => Ok((root, database)),
    }
}

/// Builds the message for a missing SQLite file of a catalog, with what is probably wrong.
fn no_catalog(root: &Path, file: &Path) -> String {
    let found = |name: &str| root.join(name).exists();
    let advice = if found(BACKUP) {
        "the directory holds a backup; `wavelume restore` fills a data directory with it"
    } else if found(FOLDER) {
        "the directory has stored files, whose catalog is elsewhere; check --database"
    } else {
        "check --data; a new service makes its catalog when `wavelume serve`, `worker`, `migrate` or `keys create` is \
         first run"
    };
    format!("there is no catalog {}: {advice}", file.display())
}
