//! Restoring of a backup into an empty service.

use super::archive::{Archive, ArchiveError, BACKUP};
use super::backup::{kept, manifest};
use super::dump::Dump;
use super::fetch::fetch;
use super::refill::{CopyReport, Origin};
use super::site::Site;
use crate::catalog::SCHEMA;
use crate::store::{Place, StoreError};

impl Archive {
    /// Fills an empty service with the newest backup in `from`, which is only read. A killed restore is started again
    /// with the same places, and goes on.
    pub(crate) async fn restore(site: &Site, from: &Place) -> Result<CopyReport, ArchiveError> {
        let absent = || ArchiveError::Copy(format!("found no {BACKUP} in {from}, expected the place of a backup"));
        let store = from.open_to_read()?.ok_or_else(absent)?;
        let manifest = manifest(&store, from).await?.ok_or_else(absent)?;
        if manifest.schema > SCHEMA {
            return Err(ArchiveError::Copy(format!(
                "the backup in {from} has the schema {}, and this program knows {}: use a newer program",
                manifest.schema, SCHEMA
            )));
        }
        let archive = Self::to_fill(site, &format!("the backup {}", manifest.id)).await?;
        let mut tables = Vec::with_capacity(manifest.tables.len());
        for table in manifest.tables {
            let staged = fetch(&store, &kept(table.digest), &archive.staging).await;
            let damaged = |error: StoreError| {
                ArchiveError::Copy(format!("the table {} of the backup in {from} is unusable: {error}", table.name))
            };
            let staged = staged.map_err(damaged)?;
            tables.push((table, staged));
        }
        let dump = Dump(tables);
        let origin = Origin { store: &store, catalog: None, object: |object| kept(object.digest()) };
        let files = archive.fill_blobs(&dump, &origin).await?;
        let lost: Vec<_> = files.lost.iter().map(|lost| lost.digest).collect();
        archive.fill_rows(&dump, &lost).await?;
        Ok(CopyReport { instance: archive.catalog.instance().await?, rows: dump.rows(), files })
    }
}
