//! Scrub: the digest of every stored file computed again from time to time, slowly, while the service runs.

use super::archive::{Archive, ArchiveError};
use super::blobs::APART;
use super::config::Limits;
use super::engine::Engine;
use crate::catalog::Blob;
use crate::store::{StoreError, StoreExt};
use futures::TryStreamExt;
use futures::future::BoxFuture;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::time::{MissedTickBehavior, interval, sleep};
use tokio_util::sync::CancellationToken;

/// Number of stored files that a process reserves at once to check their digests. Raising it writes to the database
/// less often; a killed process leaves as many unchecked until their next turn.
const AT_ONCE: u32 = 32;

/// Number of bytes as which a file counts at least when the rate of reading is limited. Raising it sends fewer requests
/// a second to a store of many small files.
const LEAST: u64 = 256 << 10;

/// Clock by which the check of stored files (scrub) keeps below its rate of reading.
pub(super) trait Clock: Send + Sync {
    /// Returns the time that has passed since a moment that stays the same for this clock.
    fn now(&self) -> Duration;
    /// Waits for the given time, or until this process is stopping.
    fn sleep(&self, time: Duration) -> BoxFuture<'_, ()>;
    /// Returns true if this process is stopping.
    fn is_stopped(&self) -> bool;
}

/// Report of one round of the check of stored files (scrub). A round checks all files that are due.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct ScrubReport {
    /// Number of files whose check is complete.
    pub blobs: u64,
    /// Total size in bytes of the files that were read and found right.
    pub bytes: u64,
    /// Number of files that are missing or damaged.
    pub faults: u64,
}

/// Upper bound on the rate at which the check of stored files (scrub) reads them.
struct Pace<'a> {
    clock: &'a dyn Clock,
    /// Upper bound on the rate of reading, in bytes per second.
    rate: u64,
    /// Time by the clock until which reading must pause, so that the rate stays below its bound.
    free: Duration,
}

impl Pace<'_> {
    /// Waits until `bytes`, whose reading began at `start`, keep to the bound on the rate.
    async fn spend(&mut self, start: Duration, bytes: u64) {
        self.free = self.free.max(start) + Duration::from_secs_f64(bytes as f64 / self.rate.max(1) as f64);
        let left = self.free.saturating_sub(self.clock.now());
        if !left.is_zero() {
            self.clock.sleep(left).await;
        }
    }
}

impl Archive {
    /// Checks the digest of every stored file that was last checked longer ago than the settings say, the oldest first
    /// and no faster than they say.
    pub(super) async fn scrub(&self, limits: &Limits, clock: &dyn Clock) -> Result<ScrubReport, ArchiveError> {
        let before = self.catalog.time().await? - limits.scrub_every.as_millis() as i64;
        let mut pace = Pace { clock, rate: limits.scrub_rate, free: clock.now() };
        let mut report = ScrubReport::default();
        while !clock.is_stopped() {
            let claimed = self.catalog.claim_checks(before, AT_ONCE).await?;
            if claimed.is_empty() {
                break;
            }
            for (at, due) in claimed.iter().enumerate() {
                match self.of(due.blob.object.tenant()).scrub_blob(&due.blob, &mut pace, &mut report).await {
                    Ok(true) => {}
                    Ok(false) => {
                        self.catalog.unclaim_checks(&claimed[at..]).await?;
                        break;
                    }
                    // The store is away, or cannot read this one file, which then must not be in the way of others.
                    Err(error) => {
                        tracing::warn!(
                            object = %due.blob.object, %error, "the digest of a stored object was not checked"
                        );
                        self.catalog.unclaim_checks(&claimed[at + 1..]).await?;
                        return Err(error);
                    }
                }
            }
        }
        Ok(report)
    }

    /// Checks the digest of one stored file. Returns false if this process is stopping, before the check is complete.
    async fn scrub_blob(
        &self,
        blob: &Blob,
        pace: &mut Pace<'_>,
        report: &mut ScrubReport,
    ) -> Result<bool, ArchiveError> {
        if pace.clock.is_stopped() {
            return Ok(false);
        }
        let fault = match self.read_slowly(blob, pace).await {
            Ok(None) => return Ok(false),
            Ok(Some(bytes)) => {
                report.blobs += 1;
                report.bytes += bytes;
                metrics::counter!("wavelume_scrub_blobs_total").increment(1);
                metrics::counter!("wavelume_scrub_bytes_total").increment(bytes);
                if blob.suspect || blob.bytes != Some(bytes) {
                    self.catalog.checked(&blob.object, bytes).await?;
                }
                return Ok(true);
            }
            Err(error) => error,
        };
        report.blobs += 1;
        if let Some(kind) = self.confirmed(blob, fault).await? {
            report.faults += 1;
            metrics::counter!("wavelume_scrub_faults_total", "kind" => kind).increment(1);
        }
        Ok(true)
    }

    /// Reads a stored file in pieces and checks its digest. Returns its size, or `None` if the process stops.
    async fn read_slowly(&self, blob: &Blob, pace: &mut Pace<'_>) -> Result<Option<u64>, StoreError> {
        let (mut start, mut read) = (pace.clock.now(), 0);
        let size = self.store.size(&blob.object).await?.ok_or(StoreError::NotFound(blob.object.digest()))?;
        if size == 0 {
            self.store.get(&blob.object, Some(0)).await?;
        }
        let mut pieces = Arc::clone(&self.store).stream(blob.object.clone(), 0..size, size);
        while let Some(piece) = pieces.try_next().await? {
            read += piece.len() as u64;
            let is_last = read == size;
            pace.spend(start, piece.len() as u64).await;
            if !is_last && pace.clock.is_stopped() {
                return Ok(None);
            }
            start = pace.clock.now();
        }
        pace.spend(start, LEAST.saturating_sub(size)).await;
        Ok(Some(size))
    }

    /// Looks a second time at a file in which a fault was found. If the fault is still there, marks the file, so that
    /// the next upload of the same bytes replaces it, and returns the kind of the fault.
    async fn confirmed(&self, blob: &Blob, first: StoreError) -> Result<Option<&'static str>, ArchiveError> {
        if first.damage().is_none() {
            return Err(first.into());
        }
        sleep(APART).await;
        let fault = match self.confirm(blob, Arc::clone(&self.store).verify(&blob.object)).await {
            Ok(bytes) => {
                self.catalog.checked(&blob.object, bytes).await?;
                return Ok(None);
            }
            Err(ArchiveError::Store(fault)) => fault,
            Err(away) => return Err(away),
        };
        let Some(kind) = fault.damage() else { return Err(fault.into()) };
        let digest = blob.object.digest();
        // It may have been swept, or replaced by an upload.
        if self.catalog.blob(digest).await?.is_none_or(|now| now.object != blob.object) {
            return Ok(None);
        }
        let named_by = self.catalog.named_by(digest).await?.unwrap_or_else(|| "no row".to_owned());
        tracing::warn!(
            %digest,
            kind,
            named_by,
            "stored bytes are {kind}: upload the same file again, or repeat the job, and they are replaced"
        );
        Ok(Some(kind))
    }
}

/// Clock of the system, until a process stops.
struct System<'a> {
    start: Instant,
    stop: &'a CancellationToken,
}

impl Clock for System<'_> {
    fn now(&self) -> Duration {
        self.start.elapsed()
    }

    fn sleep(&self, time: Duration) -> BoxFuture<'_, ()> {
        Box::pin(async move {
            tokio::select! {
                () = self.stop.cancelled() => {}
                () = tokio::time::sleep(time) => {}
            }
        })
    }

    fn is_stopped(&self) -> bool {
        self.stop.is_cancelled()
    }
}

/// Scrubs the store of a service until `stop`, a round with each tick of the sweeps.
pub(super) async fn scrubbing(engine: Arc<Engine>, stop: CancellationToken) {
    if engine.limits.scrub_rate == 0 {
        return;
    }
    let clock = System { start: Instant::now(), stop: &stop };
    let mut ticks = interval(engine.limits.sweep);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            biased;
            () = stop.cancelled() => return,
            _ = ticks.tick() => {}
        }
        match engine.archive.scrub(&engine.limits, &clock).await {
            Ok(report) if report.blobs > 0 => {
                tracing::info!(blobs = report.blobs, bytes = report.bytes, faults = report.faults, "scrubbed");
            }
            Ok(_) => {}
            Err(error) => {
                tracing::error!(%error, "the check of stored files (scrub) failed, and goes on with the next round");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::publish::tests::stored;
    use crate::jobs::site::tests::sites;
    use crate::store::Digest;
    use std::sync::Mutex;

    /// Clock for tests: its time advances only while it sleeps, and it reports the process as stopping after a given
    /// time.
    struct Stepped(Mutex<Duration>, Duration);

    impl Clock for Stepped {
        fn now(&self) -> Duration {
            *self.0.lock().unwrap()
        }

        fn sleep(&self, time: Duration) -> BoxFuture<'_, ()> {
            *self.0.lock().unwrap() += time;
            Box::pin(async {})
        }

        fn is_stopped(&self) -> bool {
            self.now() >= self.1
        }
    }

    fn stepped(seconds: u64) -> Stepped {
        Stepped(Mutex::default(), Duration::from_secs(seconds))
    }

    fn limits(rate: u64) -> Limits {
        Limits { scrub_rate: rate, scrub_every: Duration::ZERO, ..Limits::default() }
    }

    #[tokio::test]
    async fn damage_is_found_marked_and_healed_by_an_upload() {
        for (site, _guard) in sites().await {
            let archive = Archive::serve(&site).await.unwrap();
            let [flipped, gone, good] = [b"flipped".as_slice(), b"gone", b"good"];
            let mut digests = Vec::new();
            for bytes in [flipped, gone, good, b""] {
                digests.push(stored(&archive, bytes).await);
            }
            let object = async |digest| archive.catalog.blob(digest).await.unwrap().unwrap().object;
            let other = archive.staging.stage(b"flippee").unwrap();
            archive.store.publish(&other, &object(digests[0]).await).await.unwrap();
            archive.store.remove(&[object(digests[1]).await]).await;

            archive.catalog.forget_checks().await;
            let report = archive.scrub(&limits(1 << 20), &stepped(999)).await.unwrap();
            assert_eq!(report, ScrubReport { blobs: 4, bytes: 4, faults: 2 });
            let blob = async |digest: Digest| archive.catalog.blob(digest).await.unwrap().unwrap();
            assert!(blob(digests[0]).await.suspect && blob(digests[1]).await.suspect);
            assert_eq!((blob(digests[2]).await.suspect, blob(digests[2]).await.bytes), (false, Some(4)));
            assert_eq!(blob(digests[3]).await.bytes, Some(0), "an unknown size is filled in");
            let again = archive.scrub(&limits(1 << 20), &stepped(999)).await.unwrap();
            assert!(again.blobs == 0 || again.faults == 2, "once a round: {again:?}");

            for bytes in [flipped, gone] {
                stored(&archive, bytes).await;
            }
            archive.catalog.forget_checks().await;
            let healed = archive.scrub(&limits(1 << 20), &stepped(999)).await.unwrap();
            assert_eq!(healed, ScrubReport { blobs: 4, bytes: 15, faults: 0 });
            assert!(!blob(digests[0]).await.suspect && !blob(digests[1]).await.suspect);
        }
    }

    #[tokio::test]
    async fn a_store_that_is_away_marks_no_file() {
        let data = tempfile::tempdir().unwrap();
        let archive = Archive::open(data.path()).await.unwrap();
        let digest = stored(&archive, b"bytes").await;
        let digest = archive.catalog.measurement(digest).await.unwrap().unwrap().content;
        archive.store.remove(&[archive.catalog.blob(digest).await.unwrap().unwrap().object]).await;
        std::fs::remove_file(data.path().join("wavelume-instance")).unwrap();
        archive.catalog.forget_checks().await;
        let error = archive.scrub(&limits(1 << 20), &stepped(999)).await.unwrap_err();
        assert!(matches!(error, ArchiveError::Belongs(_)), "{error}");
        assert!(!archive.catalog.blob(digest).await.unwrap().unwrap().suspect);
    }

    #[tokio::test]
    async fn the_rate_is_kept_and_a_stop_gives_the_rest_back() {
        for (site, _guard) in sites().await {
            let archive = Archive::serve(&site).await.unwrap();
            let large = vec![7; 9 << 20];
            let mut digests = vec![stored(&archive, &large).await];
            for number in 0..8 {
                digests.push(stored(&archive, format!("{number}").as_bytes()).await);
            }
            archive.catalog.forget_checks().await;
            let clock = stepped(999);
            let report = archive.scrub(&limits(1 << 20), &clock).await.unwrap();
            assert_eq!((report.blobs, report.bytes), (9, (9 << 20) + 8));
            // 9 MiB, and 8 files that count as 256 KiB, at 1 MiB a second.
            assert!(clock.now().abs_diff(Duration::from_secs(11)) < Duration::from_millis(1), "{:?}", clock.now());

            archive.catalog.forget_checks().await;
            let first = archive.scrub(&limits(1 << 20), &stepped(2)).await.unwrap();
            assert!(first.blobs < 9, "{first:?}");
            let rest = archive.catalog.claim_checks(1, 99).await.unwrap();
            assert_eq!(rest.len() as u64 + first.blobs, 9, "{first:?}");
        }
    }
}
