//! Restoring of a backup into an empty service.

use super::apart::containing;
use super::archive::{Archive, ArchiveError, BACKUP};
use super::backup::{STALE, kept, manifest};
use super::dump::{Dump, blocking};
use super::fetch::fetch;
use super::refill::{CopyReport, Origin};
use super::site::Site;
use crate::catalog::{SCHEMA, TABLES};
use crate::store::{Place, Staging, StoreError, give};

impl Archive {
    /// Fills an empty service with the newest backup in `from`, which is only read. A killed restore is started again
    /// with the same places, and goes on, also with a newer backup of the same catalog. Files that were whole when the
    /// backup was made and are faulty now end the restore, unless `accept_lost`.
    pub(crate) async fn restore(site: &Site, from: &Place, accept_lost: bool) -> Result<CopyReport, ArchiveError> {
        refuse_backup(site, from)?;
        let absent = || ArchiveError::Copy(format!("found no {BACKUP} in {from}, expected the place of a backup"));
        let store = from.open_to_read()?.ok_or_else(absent)?;
        let manifest = manifest(&store, from).await?.ok_or_else(absent)?;
        if manifest.schema > SCHEMA {
            return Err(ArchiveError::Copy(format!(
                "the backup in {from} has the schema {}, and this program knows {}: use a newer program",
                manifest.schema, SCHEMA
            )));
        }
        // An older schema may have had fewer tables.
        let lacks = |name: &str| manifest.tables.iter().all(|table| table.name != name);
        if let Some((name, _)) = TABLES.iter().find(|(name, _)| manifest.schema == SCHEMA && lacks(name)) {
            return Err(ArchiveError::Copy(format!("the backup in {from} is unusable: it has no table {name}")));
        }
        // Nothing is begun with a backup whose tables are damaged.
        let staging = scratch(site).await?;
        let mut tables = Vec::with_capacity(manifest.tables.len());
        for table in manifest.tables {
            let staged = fetch(&store, &kept(table.digest), &staging).await;
            let damaged = |error: StoreError| {
                ArchiveError::Copy(format!("the table {} of the backup in {from} is unusable: {error}", table.name))
            };
            let staged = staged.map_err(damaged)?;
            tables.push((table, staged));
        }
        let dump = Dump(tables);
        let archive = Self::to_fill(site, &format!("a backup of the catalog {}", manifest.instance)).await?;
        let origin = Origin { store: &store, catalog: None, object: |object| kept(object.digest()) };
        let files = archive.fill_blobs(&dump, &origin).await?;
        let new: Vec<_> = files.lost.iter().filter(|lost| !manifest.lost.contains(&lost.digest)).collect();
        if let Some(first) = new.first()
            && !accept_lost
        {
            return Err(ArchiveError::Copy(format!(
                "{} files of the backup in {from} are faulty, and were whole when it was made; the first is {}, which \
                 is {}: mend the backup and start the restore again, which goes on, or go on without them with \
                 --accept-lost",
                new.len(),
                first.digest,
                first.kind
            )));
        }
        archive.fill_rows(&dump, &files.lost).await?;
        archive.give_away().await?;
        Ok(CopyReport { instance: archive.catalog.instance().await?, rows: dump.rows(), files })
    }
}

/// Refuses to restore a backup into its own directory, in which nothing may be written.
fn refuse_backup(site: &Site, from: &Place) -> Result<(), ArchiveError> {
    let Some(backup) = from.directory() else { return Ok(()) };
    let (database, store) = (site.database(&site.data), site.store(&site.data));
    let places = [Some(site.data.as_path()), database.file(), store.directory()];
    for place in places.into_iter().flatten() {
        let found = containing(place, [backup]);
        let found = found.map_err(|source| ArchiveError::Directory { directory: place.to_owned(), source })?;
        if found.is_some() {
            return Err(ArchiveError::Copy(format!(
                "{} would be written into {}, which holds a backup and is only read: choose a place outside",
                place.display(),
                backup.display()
            )));
        }
    }
    Ok(())
}

/// Returns a directory for temporary files in the data directory of a site, without what a killed restore has left.
async fn scratch(site: &Site) -> Result<Staging, ArchiveError> {
    let (root, _) = Archive::places_of(site)?;
    let directory = root.join("staging");
    std::fs::create_dir_all(&directory)
        .and_then(|()| give(&std::fs::File::open(&directory)?, &root))
        .map_err(|source| ArchiveError::Directory { directory: root, source })?;
    let staging = Staging::new(directory);
    let swept = staging.clone();
    blocking(move || swept.sweep(STALE, |_| None)).await?;
    Ok(staging)
}
