//! Removal of what nobody needs any more: abandoned files, old rows, bytes that no row names.

use super::archive::{Archive, ArchiveError};
use super::config::Limits;
use super::dump::blocking;
use super::presence::{WORKERS, is_alive};
use crate::catalog::{Doom, Retention};
use crate::store::{Object, StoreError};
use serde::Serialize;
use std::time::Duration;

/// Report of a sweep (removal of unused files and old jobs); the output of `wavelume gc`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SweepReport {
    /// Number of unused files removed from the store after their grace period.
    pub removed_blobs: u64,
    /// Total size in bytes of the files removed from the store.
    pub removed_bytes: u64,
    /// Number of removed staging (temporary) files, which no process was writing.
    pub removed_staging: u64,
    /// Number of deleted rows of jobs that had ended long ago.
    pub forgotten_jobs: u64,
    /// Number of unused files in the store that wait for the end of their grace period.
    pub waiting_blobs: u64,
    /// Total size in bytes of the unused files that wait for the end of their grace period, as far as the sizes are
    /// known.
    pub waiting_bytes: u64,
    /// Number of stored files kept, because a row of the catalog refers to them.
    pub kept_blobs: u64,
}

/// Upper bound on the number of rows that a sweep handles at once. Raising it makes transactions longer.
const AT_ONCE: u32 = 1000;

/// Minutes for which a process reserves the objects that it deletes. Raising it delays the next try by another process
/// if this one is killed.
const TAKEN: Duration = Duration::from_mins(10);

/// Hours for which an object is kept after its announcement has expired, because the announced write may still be under
/// way. Raising it tolerates later writes.
const LATE: Duration = Duration::from_hours(24);

/// Age after which an idempotency key is deleted. Raising it lets clients safely repeat a request for longer.
const KEYS: Duration = Duration::from_hours(24);

/// Hours for which an expired upload is remembered, so that its client gets the answer that it has expired. Raising it
/// keeps more rows.
const REMEMBERED: Duration = Duration::from_hours(24);

impl Archive {
    /// Removes stored files to which nothing has referred for the grace period, abandoned temporary files and old jobs.
    pub async fn sweep(&self) -> Result<SweepReport, ArchiveError> {
        self.sweep_with(&Limits::default(), false).await
    }

    /// Removes unused files and old jobs by the ages in `limits`. If `now`, unused files are removed without their
    /// grace period, and a client that is reading one gets an error.
    pub(crate) async fn sweep_with(&self, limits: &Limits, now: bool) -> Result<SweepReport, ArchiveError> {
        let mut report = if now {
            self.catalog.repeat(|_| self.catalog.end_grace()).await?;
            self.sweep_within(&Limits { grace: Duration::ZERO, ..limits.clone() }, &|| false).await?
        } else {
            self.sweep_within(limits, &|| false).await?
        };
        let counts = self.catalog.blob_counts().await?;
        report.kept_blobs = counts.live;
        (report.waiting_blobs, report.waiting_bytes) = (counts.doomed, counts.doomed_bytes);
        Ok(report)
    }

    /// Removes old jobs by the default ages, and unused files without their grace period.
    #[cfg(test)]
    pub(crate) async fn sweep_now(&self) -> Result<SweepReport, ArchiveError> {
        self.sweep_with(&Limits::default(), true).await
    }

    /// Removes unused files and old jobs by the ages in `limits`, and ends early once `stopped` returns true. What is
    /// left is not counted, because that reads every row about a stored file.
    pub(crate) async fn sweep_within(
        &self,
        limits: &Limits,
        stopped: &(dyn Fn() -> bool + Sync),
    ) -> Result<SweepReport, ArchiveError> {
        let removed_staging = self.sweep_staging(limits.stale).await?;
        let ages = Retention {
            succeeded: limits.keep_succeeded,
            failed: limits.keep_failed,
            keys: KEYS,
            acts: limits.keep_audit,
        };
        // Each step is repeated where a full disk stopped it: this is the way out of one.
        let catalog = &self.catalog;
        let forgotten_jobs = catalog.repeat(|_| catalog.forget(&ages)).await?;
        catalog.repeat(|_| catalog.forget_partials(REMEMBERED)).await?;
        let mut report = SweepReport { removed_staging, forgotten_jobs, ..SweepReport::default() };
        let doom_expired = || catalog.repeat(|_| catalog.doom_expired(AT_ONCE, LATE));
        while doom_expired().await? == u64::from(AT_ONCE) && !stopped() {}
        self.doom(limits.grace, stopped).await?;
        self.delete(&mut report, stopped).await?;
        // Last, and without consequence: neither may keep what is to be deleted.
        if let Err(error) = self.date_tags(stopped).await {
            tracing::error!(%error, "tags did not get the time of their material, so lists find them more slowly");
        }
        if !stopped()
            && let Err(error) = self.catalog.recount().await
        {
            tracing::error!(%error, "the bytes and materials of tenants were not counted");
        }
        Ok(report)
    }

    /// Removes the temporary files of processes of this host that were killed, and those of unknown processes that were
    /// last written more than `stale` ago. Returns their number.
    pub(super) async fn sweep_staging(&self, stale: Duration) -> Result<u64, StoreError> {
        let (staging, workers) = (self.staging.clone(), self.data.join(WORKERS));
        blocking(move || staging.sweep(stale, |owner| is_alive(&workers, owner))).await
    }

    /// Writes beside tags the time of their material, where programs of an earlier schema have left it out.
    async fn date_tags(&self, stopped: &(dyn Fn() -> bool + Sync)) -> Result<(), ArchiveError> {
        while !stopped() && self.catalog.date_tags(AT_ONCE).await? == u64::from(AT_ONCE) {}
        Ok(())
    }

    /// Lists for deletion the objects of all tenants to which no row of the catalog refers any more.
    async fn doom(&self, grace: Duration, stopped: &(dyn Fn() -> bool + Sync)) -> Result<(), ArchiveError> {
        loop {
            let unnamed = self.catalog.unnamed(AT_ONCE).await?;
            for (tenant, digest) in &unnamed {
                if stopped() {
                    return Ok(());
                }
                let catalog = self.catalog.of(tenant);
                if let Doom::Doomed(bytes) = catalog.repeat(|_| catalog.doom_unnamed(*digest, grace)).await? {
                    tracing::debug!(%tenant, %digest, bytes, "no row of the catalog refers to these bytes any more");
                }
            }
            if unnamed.len() < AT_ONCE as usize {
                return Ok(());
            }
        }
    }

    /// Deletes the objects that are due for deletion from the store.
    async fn delete(&self, report: &mut SweepReport, stopped: &(dyn Fn() -> bool + Sync)) -> Result<(), ArchiveError> {
        while !stopped() {
            let taken = self.catalog.repeat(|_| self.catalog.take_doomed(AT_ONCE, TAKEN)).await?;
            if taken.is_empty() {
                return Ok(());
            }
            // Before each round: the store may have been taken over since the last.
            self.belongs().await?;
            let objects: Vec<Object> = taken.iter().map(|(object, _)| object.clone()).collect();
            let outcomes = self.store.remove(&objects).await;
            // A store that went away meanwhile lacks them and will be back with them: they are due again later.
            self.belongs().await?;
            let (mut gone, mut failure) = (Vec::new(), None);
            for ((object, bytes), outcome) in taken.iter().zip(outcomes) {
                match outcome {
                    Ok(()) => {
                        report.removed_blobs += 1;
                        report.removed_bytes += bytes;
                        gone.push(object.clone());
                    }
                    Err(error) => failure = Some(error),
                }
            }
            self.catalog.repeat(|_| self.catalog.deleted(&gone)).await?;
            // The others are tried again when they are due.
            if let Some(error) = failure {
                return Err(error.into());
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::testing;
    use crate::jobs::archive::INSTANCE;
    use crate::jobs::publish::tests::stored;
    use crate::jobs::site::tests::sites;
    use crate::store::{Staged, Store};
    use crate::trust::Tenant;
    use bytes::Bytes;
    use futures::future::BoxFuture;
    use futures::stream::BoxStream;
    use std::ops::Range;
    use std::sync::Arc;

    /// A store for tests that goes away as soon as it is asked to remove objects, and lacks everything from then on.
    #[derive(Debug)]
    struct Leaving(Arc<dyn Store>);

    impl Store for Leaving {
        fn publish<'a>(&'a self, staged: &'a Staged, object: &'a Object) -> BoxFuture<'a, Result<(), StoreError>> {
            self.0.publish(staged, object)
        }

        fn size<'a>(&'a self, object: &'a Object) -> BoxFuture<'a, Result<Option<u64>, StoreError>> {
            self.0.size(object)
        }

        fn read<'a>(&'a self, object: &'a Object, range: Range<u64>) -> BoxFuture<'a, Result<Bytes, StoreError>> {
            self.0.read(object, range)
        }

        fn list<'a>(&'a self, folder: &'a str) -> BoxStream<'a, Result<(Object, u64), StoreError>> {
            self.0.list(folder)
        }

        fn tenants(&self) -> BoxFuture<'_, Result<Vec<Tenant>, StoreError>> {
            self.0.tenants()
        }

        fn remove<'a>(&'a self, objects: &'a [Object]) -> BoxFuture<'a, Vec<Result<(), StoreError>>> {
            Box::pin(async move {
                self.0.set_note(INSTANCE, String::new()).await.unwrap();
                objects.iter().map(|_| Ok(())).collect()
            })
        }

        fn note<'a>(&'a self, name: &'a str) -> BoxFuture<'a, Result<Option<String>, StoreError>> {
            self.0.note(name)
        }

        fn set_note<'a>(&'a self, name: &'a str, text: String) -> BoxFuture<'a, Result<(), StoreError>> {
            self.0.set_note(name, text)
        }
    }

    #[tokio::test]
    async fn bytes_that_no_row_names_go_after_their_grace() {
        for (site, _guard) in sites().await {
            let archive = Archive::serve(&site).await.unwrap();
            let (kept, deleted) = (stored(&archive, b"kept").await, stored(&archive, b"deleted").await);
            archive.catalog.delete_measurement(deleted).await.unwrap();
            let swept = archive.sweep().await.unwrap();
            assert_eq!((swept.removed_blobs, swept.waiting_blobs, swept.waiting_bytes, swept.kept_blobs), (0, 1, 7, 1));
            assert!(archive.get(deleted).await.is_err(), "nobody may read them");
            // Equal bytes are stored again while the old object waits for its deletion.
            stored(&archive, b"deleted").await;
            let swept = archive.sweep_now().await.unwrap();
            assert_eq!((swept.removed_blobs, swept.removed_bytes, swept.kept_blobs), (1, 7, 2));
            assert_eq!(archive.get(deleted).await.unwrap(), b"deleted".as_slice());
            assert_eq!(archive.get(kept).await.unwrap(), b"kept".as_slice());
            assert_eq!(archive.check().await.unwrap().faults, []);
        }
    }

    #[tokio::test]
    async fn a_count_that_fails_keeps_nothing_from_its_deletion() {
        for (site, _guard) in sites().await {
            let archive = Archive::serve(&site).await.unwrap();
            let deleted = stored(&archive, b"deleted").await;
            archive.catalog.delete_measurement(deleted).await.unwrap();
            testing::drop_table(&archive.catalog, "usage").await;
            assert_eq!(archive.sweep_now().await.unwrap().removed_blobs, 1);
        }
    }

    #[tokio::test]
    async fn ages_are_those_of_the_settings() {
        for (site, _guard) in sites().await {
            let archive = Archive::serve(&site).await.unwrap();
            let deleted = stored(&archive, b"deleted").await;
            archive.catalog.delete_measurement(deleted).await.unwrap();
            let short = Limits { grace: Duration::ZERO, ..Limits::default() };
            assert_eq!(archive.sweep_with(&short, false).await.unwrap().removed_blobs, 1);
        }
    }

    #[tokio::test]
    async fn what_a_store_lacks_while_it_is_away_is_deleted_when_it_is_back() {
        for (site, _guard) in sites().await {
            let mut archive = Archive::serve(&site).await.unwrap();
            let deleted = stored(&archive, b"deleted").await;
            archive.catalog.delete_measurement(deleted).await.unwrap();
            archive.store = Arc::new(Leaving(Arc::clone(&archive.store)));
            archive.sweep_now().await.unwrap_err();
            let left = archive.catalog.blob_counts().await.unwrap().doomed;
            assert_eq!(left, 1, "it may be back with the store");
        }
    }

    #[tokio::test]
    async fn nothing_is_deleted_from_a_store_that_another_catalog_has_taken_over() {
        for (site, _guard) in sites().await {
            let archive = Archive::serve(&site).await.unwrap();
            let deleted = stored(&archive, b"deleted").await;
            let object = archive.catalog.blob(deleted).await.unwrap().unwrap().object;
            archive.catalog.delete_measurement(deleted).await.unwrap();
            archive.store.set_note("wavelume-instance", "another".to_owned()).await.unwrap();
            let error = archive.sweep_now().await.unwrap_err();
            assert!(matches!(error, ArchiveError::Belongs(_)), "{error}");
            assert_eq!(archive.store.size(&object).await.unwrap(), Some(7));
        }
    }
}
