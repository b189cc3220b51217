//! Copy of a catalog and of its stored bytes into an empty service, from a backup or from another service.
//!
//! Bytes come first, announced and listed batch by batch, so that a killed copy goes on where it was. The rows that
//! name them follow in one transaction: the service is empty, or it is the whole copy.

use super::archive::{Archive, ArchiveError, BACKUP, INSTANCE};
use super::dump::{Dump, Rows, blocking};
use super::fetch::{Lost, Stored, Tally, fetch_each, stored};
use super::presence::{WORKERS, living};
use super::site::Site;
use crate::catalog::{Catalog, Filling, TABLES};
use crate::store::{Digest, FOLDER, Object, Place, Store, StoreError, give_all};
use crate::trust::Tenant;
use futures::TryStreamExt;
use serde::Serialize;
use serde_json::Value;
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// Time after the announcement of a copied object within which it must be entered in the catalog. Raising it keeps what
/// a killed copy has written for longer.
const INTENT: Duration = Duration::from_hours(1);

/// Upper bound on the number of copied files that are announced and entered in the catalog together, and about on their
/// bytes. Raising it writes to the database less often, but a slow copy may let the announcement expire.
const BATCH: (usize, u64) = (64, 1 << 30);

/// Report of a copy into an empty service; the output of `wavelume restore` and `wavelume move`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub(crate) struct CopyReport {
    /// Id of the catalog that was filled by the copy.
    pub instance: String,
    /// Number of database rows that were copied.
    pub rows: u64,
    /// Counts of the copied files and of those that were not copied.
    #[serde(flatten)]
    pub files: Tally,
}

/// Source of a copy: a store, and the catalog of the original if it is at hand.
pub(super) struct Origin<'a> {
    /// Store from which the bytes are copied.
    pub store: &'a Arc<dyn Store>,
    /// Catalog of the original, if it is at hand; it tells where equal bytes are stored.
    pub catalog: Option<&'a Catalog>,
    /// Returns the object in the source's store with the bytes of an object that the copied catalog names.
    pub object: fn(&Object) -> Object,
}

impl Archive {
    /// Opens an empty service that a copy of the catalog with the id `original` is to fill, or one that such a copy has
    /// begun to fill. Refuses any other.
    pub(super) async fn to_fill(site: &Site, original: &str) -> Result<Self, ArchiveError> {
        let (root, database) = Self::places_of(site)?;
        refuse_served(&root).await?;
        let place = site.store(&root);
        let catalog = Catalog::open_to_fill(&database).await?;
        match catalog.copying().await? {
            Some(begun) if begun == original => {}
            Some(begun) => {
                return Err(ArchiveError::Copy(format!(
                    "a copy of {begun} into {database} was begun and has not ended: go on with that one, or begin with a \
                     new database and store"
                )));
            }
            None => {
                if let Some(found) = catalog.contents().await? {
                    return Err(ArchiveError::Copy(format!(
                        "found {found} in {database}, expected an empty database: choose another one"
                    )));
                }
                refuse_used(&place, &catalog).await?;
                catalog.begin_copy(original).await?;
            }
        }
        Self::with(&Site { adopt: None, ..site.clone() }, root, database, catalog).await
    }

    /// Lets the owner of the data directory, and that of the directory of the store, have what root has copied there.
    pub(super) async fn give_away(&self) -> Result<(), ArchiveError> {
        let store = match self.places().1 {
            Place::Directory(store) if *store != self.data => Some(store.clone()),
            _ => None,
        };
        let directories = std::iter::once(self.data.clone()).chain(store);
        Ok(blocking(move || directories.into_iter().try_for_each(|own| give_all(&own)).map_err(StoreError::Io)).await?)
    }

    /// Copies the stored bytes that a copied catalog names, apart from those that are here already.
    pub(super) async fn fill_blobs(&self, dump: &Dump, origin: &Origin<'_>) -> Result<Tally, ArchiveError> {
        // Rows about stored bytes refer to their owners.
        if dump.has("tenants") {
            let mut filling = self.catalog.fill().await?;
            insert_all(&mut filling, dump, "tenants", |_, _| Ok(())).await?;
            filling.pause().await?;
        }
        let (mut rows, mut tally) = (dump.read("blobs")?, Tally::default());
        loop {
            let page = stored(&mut rows).await?;
            if page.is_empty() {
                return Ok(tally);
            }
            let mut rest = page.as_slice();
            while !rest.is_empty() {
                let (batch, after) = rest.split_at(batch_of(rest));
                rest = after;
                self.belonged().await?;
                while !self.fill_batch(batch, origin, &mut tally).await? {
                    tracing::warn!(
                        "the announcement of copied files expired before they were entered; they are copied again"
                    );
                }
            }
        }
    }

    /// Copies the bytes of some files that the new service lacks, and enters them in its catalog. Returns false if the
    /// announcement of the copies expired before.
    async fn fill_batch(&self, batch: &[Stored], origin: &Origin<'_>, tally: &mut Tally) -> Result<bool, ArchiveError> {
        let mut absent = Vec::with_capacity(batch.len());
        for blob in batch {
            let tenant = blob.object.tenant();
            match self.catalog.of(tenant).blob(blob.object.digest()).await? {
                Some(known) => tally.there(known.bytes.unwrap_or(0)),
                None => absent.push((blob.clone(), Object::fresh(tenant, blob.object.digest()))),
            }
        }
        if absent.is_empty() {
            return Ok(true);
        }
        let announced: Vec<_> = absent.iter().map(|(blob, new)| (new.clone(), blob.bytes.unwrap_or(0))).collect();
        self.catalog.intend_all(&announced, INTENT).await?;
        let files = absent.into_iter().map(|(blob, new)| ((origin.object)(&blob.object), (blob, new))).collect();
        let copies =
            fetch_each((origin.store, origin.catalog), files, &self.staging, |(blob, new), fetched| async move {
                if let Ok(staged) = &fetched {
                    self.store.publish(staged, &new).await?;
                }
                // A backup keeps equal bytes of two tenants once, under the default one.
                let fetched = fetched.map_err(|lost| Lost { tenant: new.tenant().clone(), ..lost });
                Ok(fetched.map(|staged| (new, staged.bytes(), blob.created_at)))
            });
        let (mut copied, mut lost) = (Vec::new(), Vec::new());
        for outcome in copies.await? {
            match outcome {
                Ok(one) => copied.push(one),
                Err(one) => lost.push(one),
            }
        }
        if !self.catalog.add_copied(&copied).await? {
            return Ok(false);
        }
        for (_, bytes, _) in &copied {
            tally.copied(*bytes);
        }
        tally.lost.extend(lost);
        Ok(true)
    }

    /// Writes all rows of a copied catalog to the new catalog, and marks the copy as complete. `lost` lists the files
    /// that could not be copied.
    pub(super) async fn fill_rows(&self, dump: &Dump, lost: &[Lost]) -> Result<(), ArchiveError> {
        let mut filling = self.catalog.fill().await?;
        let lost: HashSet<(&Tenant, Digest)> = lost.iter().map(|lost| (&lost.tenant, lost.digest)).collect();
        for (tenant, digest) in lost {
            filling.insert_lost(&Object::fresh(tenant, digest)).await?;
        }
        let mut joined = Vec::new();
        for (name, _) in TABLES.iter().filter(|(name, _)| *name != "blobs" && dump.has(name)) {
            insert_all(&mut filling, dump, name, |rows, batch| match *name {
                "measurements" => take_spectra(rows, batch, &mut joined),
                _ => Ok(()),
            })
            .await?;
        }
        for [tenant, id, spectrum] in &joined {
            filling.join(tenant, id, spectrum).await?;
        }
        filling.finish().await?;
        Ok(())
    }
}

/// Copies all rows of a table into the new catalog, each batch after `change` has edited it.
async fn insert_all(
    filling: &mut Filling,
    dump: &Dump,
    table: &str,
    mut change: impl FnMut(&Rows, &mut [Value]) -> Result<(), ArchiveError>,
) -> Result<(), ArchiveError> {
    let mut rows = dump.read(table)?;
    let columns = rows.columns().to_vec();
    loop {
        let mut batch = rows.next().await?;
        if batch.is_empty() {
            return Ok(());
        }
        change(&rows, &mut batch)?;
        filling.insert(table, &columns, &batch).await?;
    }
}

/// Returns the number of files at the beginning of `files`, one at least, that are announced together.
fn batch_of(files: &[Stored]) -> usize {
    let mut bytes: u64 = 0;
    let fits = |file: &&Stored| {
        let is_open = bytes < BATCH.1;
        bytes = bytes.saturating_add(file.bytes.unwrap_or(0));
        is_open
    };
    files.iter().take(BATCH.0).take_while(fits).count()
}

/// Clears the reference to a spectrum in each row of `measurements`, and appends it to `joined`. A row may come before
/// that of its spectrum, so the references are set later.
fn take_spectra(rows: &Rows, batch: &mut [Value], joined: &mut Vec<[String; 3]>) -> Result<(), ArchiveError> {
    let [tenant, id, spectrum] = [rows.column("tenant")?, rows.column("id")?, rows.column("spectrum")?];
    for row in batch {
        if let [Some(tenant), Some(id), Some(text)] = [tenant, id, spectrum].map(|at| row[at].as_str()) {
            joined.push([tenant, id, text].map(str::to_owned));
            row[spectrum] = Value::Null;
        }
    }
    Ok(())
}

/// Refuses a data directory that nodes or workers of this machine use.
pub(super) async fn refuse_served(data: &Path) -> Result<(), ArchiveError> {
    let workers = data.join(WORKERS);
    let living = blocking(move || Ok(living(&workers)?)).await?;
    if living == 0 {
        return Ok(());
    }
    Err(ArchiveError::Copy(format!(
        "{living} nodes or workers use the data directory {}: stop them, and start this again",
        data.display()
    )))
}

/// Refuses a store that belongs to another catalog or holds objects.
async fn refuse_used(place: &Place, catalog: &Catalog) -> Result<(), ArchiveError> {
    let Some(store) = place.open_to_read()? else { return Ok(()) };
    let refused = |found: String| {
        Err(ArchiveError::Copy(format!(
            "found {found} in the store {place}, expected an empty one: choose another one"
        )))
    };
    if let Some(id) = store.note(INSTANCE).await?
        && id != catalog.instance().await?
    {
        return refused(format!("the bytes of the catalog {id}"));
    }
    if store.note(BACKUP).await?.is_some() {
        return refused("a backup".to_owned());
    }
    match store.list(FOLDER).try_next().await? {
        Some((object, _)) => refused(format!("the object {object}")),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_batch_ends_by_its_number_and_by_its_bytes() {
        let files = |bytes: Option<u64>| {
            let object = Object::fresh(&Tenant::default(), Digest::of(b"any"));
            vec![Stored { object, bytes, created_at: 0 }; 100]
        };
        for (bytes, expected) in
            [(Some(1), 64), (None, 64), (Some(1 << 28), 4), (Some(300 << 20), 4), (Some(2 << 30), 1)]
        {
            assert_eq!(batch_of(&files(bytes)), expected, "{bytes:?}");
        }
        assert_eq!(batch_of(&files(Some(1))[..7]), 7);
    }
}
