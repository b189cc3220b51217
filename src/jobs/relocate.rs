//! Move of a service to another database and store: a copy without a backup in between.

use super::apart::containing;
use super::archive::{Archive, ArchiveError};
use super::backup::Hold;
use super::dump::Dump;
use super::fetch::Tally;
use super::refill::{CopyReport, Origin, refuse_served};
use super::site::Site;

/// Number of times that the original is copied before a move gives up because it is still written to. Raising it waits
/// for longer until nodes and workers have stopped.
const ROUNDS: u32 = 3;

impl Archive {
    /// Fills an empty service with the catalog and the stored bytes of `self`, which keeps both. The original must not
    /// be written to meanwhile: if it is, the copy is brought up to date, and given up in the end.
    pub(crate) async fn relocate(&self, site: &Site) -> Result<CopyReport, ArchiveError> {
        self.refuse_itself(site)?;
        let original = format!("the catalog {}", self.catalog.instance().await?);
        refuse_served(&self.data).await?;
        let archive = Self::to_fill(site, &original).await?;
        let hold = Hold::begin(&self.catalog).await?;
        let origin = Origin { store: &self.store, catalog: Some(&self.catalog), object: Clone::clone };
        let mut dump = Dump::of(&self.catalog, &archive.staging).await?;
        let mut sum = Tally::default();
        for round in 0..ROUNDS {
            let files = archive.fill_blobs(&dump, &origin).await?;
            sum.copied_blobs += files.copied_blobs;
            sum.copied_bytes += files.copied_bytes;
            if round == 0 {
                (sum.there_blobs, sum.there_bytes) = (files.there_blobs, files.there_bytes);
            }
            sum.lost = files.lost;
            let now = Dump::of(&self.catalog, &archive.staging).await?;
            if !now.equals(&dump) {
                dump = now;
                continue;
            }
            hold.end(&sum.lost).await?;
            archive.fill_rows(&dump, &sum.lost).await?;
            archive.give_away().await?;
            return Ok(CopyReport { instance: archive.catalog.instance().await?, rows: dump.rows(), files: sum });
        }
        hold.end(&[]).await?;
        Err(ArchiveError::Copy(format!(
            "{original} is still written to: stop its nodes and workers, and start the move again; the {} files copied so \
             far are kept",
            sum.copied_blobs + sum.there_blobs
        )))
    }

    /// Refuses to move a service to its own database file or into its own store.
    fn refuse_itself(&self, site: &Site) -> Result<(), ArchiveError> {
        let (database, store) = (site.database(&site.data), site.store(&site.data));
        let own = self.places();
        let pairs = [(store.directory(), own.1.directory()), (database.file(), own.0.file())];
        for (to, own) in pairs.into_iter().filter_map(|(to, own)| to.zip(own)) {
            let found = containing(to, [own]);
            let found = found.map_err(|source| ArchiveError::Directory { directory: to.to_owned(), source })?;
            if found.is_some() {
                return Err(ArchiveError::Copy(format!(
                    "{} would be written into {}, which is moved and only read: choose another --data, --database and \
                     --store",
                    to.display(),
                    own.display()
                )));
            }
        }
        Ok(())
    }
}
