//! Removal of what nobody needs any more: abandoned files, old rows, bytes that no row names.

use super::archive::{Archive, ArchiveError};
use super::config::Limits;
use crate::catalog::{Doom, Retention};
use crate::store::{Object, StoreError};
use serde::Serialize;
use std::time::Duration;

/// Report of a sweep; the answer of `wavelume gc`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SweepReport {
    /// Blobs removed from the store, which nothing named for the time of grace.
    pub removed_blobs: u64,
    /// Bytes of the removed blobs.
    pub removed_bytes: u64,
    /// Removed staging files, which no process was writing.
    pub removed_staging: u64,
    /// Deleted rows of jobs that had ended long ago.
    pub forgotten_jobs: u64,
    /// Blobs that nothing names, and that wait for the end of their grace.
    pub waiting_blobs: u64,
    /// Bytes of the waiting blobs, as far as they are known.
    pub waiting_bytes: u64,
    /// Blobs kept, because a row names them.
    pub kept_blobs: u64,
}

/// Upper bound on the rows that are handled at once. Raising it makes longer transactions.
const AT_ONCE: u32 = 1000;

/// Minutes for which a process has the objects that it deletes to itself. Raising it delays another process's second
/// try after this one was killed.
const TAKEN: Duration = Duration::from_mins(10);

/// Hours after which the object of an expired announcement is deleted, because its write may still be under way.
/// Raising it tolerates writes that arrive later.
const LATE: Duration = Duration::from_hours(24);

/// Age of an idempotency key after which it is forgotten. Raising it lets clients repeat a request for longer.
const KEYS: Duration = Duration::from_hours(24);

impl Archive {
    /// Removes bytes that nothing has named for the time of grace, abandoned staging files and old jobs.
    pub async fn sweep(&self) -> Result<SweepReport, ArchiveError> {
        self.sweep_with(&Limits::default(), false).await
    }

    /// Sweeps with the ages of `limits`. If `now`, bytes that nothing names are removed without their grace, and a
    /// reader of them gets an error.
    pub(crate) async fn sweep_with(&self, limits: &Limits, now: bool) -> Result<SweepReport, ArchiveError> {
        if !now {
            return self.sweep_within(limits, &|| false).await;
        }
        self.catalog.end_grace().await?;
        self.sweep_within(&Limits { grace: Duration::ZERO, ..limits.clone() }, &|| false).await
    }

    /// Sweeps with the default ages and without grace.
    #[cfg(test)]
    pub(crate) async fn sweep_now(&self) -> Result<SweepReport, ArchiveError> {
        self.sweep_with(&Limits::default(), true).await
    }

    /// Sweeps with the ages of `limits`, and ends early once `stopped` returns true.
    pub(crate) async fn sweep_within(
        &self,
        limits: &Limits,
        stopped: &(dyn Fn() -> bool + Sync),
    ) -> Result<SweepReport, ArchiveError> {
        let (staging, stale) = (self.staging.clone(), limits.stale);
        let removed_staging =
            tokio::task::spawn_blocking(move || staging.sweep(stale)).await.map_err(|e| StoreError::Io(e.into()))??;
        let ages = Retention { succeeded: limits.keep_succeeded, failed: limits.keep_failed, keys: KEYS };
        let forgotten_jobs = self.catalog.forget(&ages).await?;
        let mut report = SweepReport { removed_staging, forgotten_jobs, ..SweepReport::default() };
        while self.catalog.doom_expired(AT_ONCE, LATE).await? == u64::from(AT_ONCE) && !stopped() {}
        self.doom(limits.grace, stopped).await?;
        self.delete(&mut report, stopped).await?;
        let counts = self.catalog.blob_counts().await?;
        report.kept_blobs = counts.live;
        (report.waiting_blobs, report.waiting_bytes) = (counts.doomed, counts.doomed_bytes);
        Ok(report)
    }

    /// Dooms the objects of digests that no row names any more.
    async fn doom(&self, grace: Duration, stopped: &(dyn Fn() -> bool + Sync)) -> Result<(), ArchiveError> {
        loop {
            let unnamed = self.catalog.unnamed(AT_ONCE).await?;
            for &digest in &unnamed {
                if stopped() {
                    return Ok(());
                }
                if let Doom::Doomed(bytes) = self.catalog.doom_unnamed(digest, grace).await? {
                    tracing::debug!(%digest, bytes, "no row names these bytes any more");
                }
            }
            if unnamed.len() < AT_ONCE as usize {
                return Ok(());
            }
        }
    }

    /// Deletes doomed objects whose time has come.
    async fn delete(&self, report: &mut SweepReport, stopped: &(dyn Fn() -> bool + Sync)) -> Result<(), ArchiveError> {
        while !stopped() {
            let taken = self.catalog.take_doomed(AT_ONCE, TAKEN).await?;
            if taken.is_empty() {
                return Ok(());
            }
            // Before each round: the store may have been taken over since the last.
            self.belongs().await?;
            let objects: Vec<Object> = taken.iter().map(|(object, _)| object.clone()).collect();
            let outcomes = self.store.remove(&objects).await;
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
            self.catalog.deleted(&gone).await?;
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
    use crate::jobs::publish::tests::stored;
    use crate::jobs::site::tests::sites;

    #[tokio::test]
    async fn bytes_that_no_row_names_go_after_their_grace() {
        for (site, _guard) in sites().await {
            let archive = Archive::serve(&site).await.unwrap();
            let (kept, deleted) = (stored(&archive, b"kept").await, stored(&archive, b"deleted").await);
            archive.catalog.delete_measurement(deleted).await.unwrap();
            let swept = archive.sweep().await.unwrap();
            assert_eq!((swept.removed_blobs, swept.waiting_blobs, swept.waiting_bytes, swept.kept_blobs), (0, 1, 7, 1));
            assert!(archive.get(deleted).await.is_err(), "nobody may read them");
            // The same bytes come back while the old object waits for its deletion.
            stored(&archive, b"deleted").await;
            let swept = archive.sweep_now().await.unwrap();
            assert_eq!((swept.removed_blobs, swept.removed_bytes, swept.kept_blobs), (1, 7, 2));
            assert_eq!(archive.get(deleted).await.unwrap(), b"deleted".as_slice());
            assert_eq!(archive.get(kept).await.unwrap(), b"kept".as_slice());
            assert_eq!(archive.check().await.unwrap().faults, []);
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
