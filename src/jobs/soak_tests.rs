//! Publishers, readers and sweeps of two processes over a store whose calls outlive their callers: no read of named
//! bytes may fail, and nothing may be left over. `WAVELUME_SOAK_SECONDS` says for how long.

use super::archive::{Archive, ArchiveError};
use super::config::Limits;
use super::publish::Published;
use super::site::tests::sites;
use crate::catalog::{Added, Deleted, NewMeasurement, testing};
use crate::store::{Digest, FOLDER, Object, Staged, Staging, Store, StoreError};
use crate::trust::Tenant;
use bytes::Bytes;
use futures::StreamExt;
use futures::future::BoxFuture;
use futures::stream::BoxStream;
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use std::collections::BTreeSet;
use std::io;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::sync::RwLock;
use tokio::time::sleep;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

/// Number of different contents that the publishers store, few so that two publishers often store equal bytes.
const CONTENTS: u64 = 12;

/// Probability in per cent that a store call is carried out after its caller was told that it failed, and that a
/// publisher pauses until its announcement has expired.
const LATE: u64 = 5;

/// Longest delay in ms of a store call that is carried out after its caller was told that it failed.
const OUTLIVES: u64 = 1000;

/// Generator of random numbers for one task of the test.
#[derive(Debug)]
struct Dice(Pcg64Mcg);

impl Dice {
    fn new(seed: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed))
    }

    fn below(&mut self, bound: u64) -> u64 {
        self.0.next_u64() % bound
    }
}

#[derive(Debug, Default)]
struct Counts {
    published: AtomicU64,
    refused: AtomicU64,
    stalled: AtomicU64,
    late_writes: AtomicU64,
    late_removals: AtomicU64,
    reads: AtomicU64,
    removed: AtomicU64,
    healed: AtomicU64,
}

impl Counts {
    fn add(count: &AtomicU64, number: u64) {
        count.fetch_add(number, Ordering::Relaxed);
    }

    /// Returns true if too few events of some kind have happened for the test to show anything.
    fn is_poor(&self) -> bool {
        let below = |count: &AtomicU64, least: u64| count.load(Ordering::Relaxed) < least;
        below(&self.published, 50)
            || below(&self.reads, 50)
            || [&self.refused, &self.late_writes, &self.late_removals, &self.removed]
                .iter()
                .any(|count| below(count, 1))
    }
}

/// A store that reports some writes and removals as failed at once, and carries them out up to a second later.
#[derive(Debug)]
struct Faulty {
    store: Arc<dyn Store>,
    staging: Staging,
    dice: Mutex<Dice>,
    counts: Arc<Counts>,
    /// Tasks that carry out the delayed store calls, whose callers were told at once that the calls failed.
    late: TaskTracker,
}

impl Faulty {
    /// Decides at random if a store call is reported as failed at once and carried out later, and then returns the
    /// delay.
    fn lateness(&self) -> Option<Duration> {
        let mut dice = self.dice.lock().unwrap();
        (dice.below(100) < LATE).then(|| Duration::from_millis(dice.below(OUTLIVES)))
    }
}

fn gave_up() -> StoreError {
    StoreError::Io(io::Error::new(io::ErrorKind::TimedOut, "the caller gave up"))
}

impl Store for Faulty {
    fn publish<'a>(&'a self, staged: &'a Staged, object: &'a Object) -> BoxFuture<'a, Result<(), StoreError>> {
        Box::pin(async move {
            let Some(delay) = self.lateness() else { return self.store.publish(staged, object).await };
            Counts::add(&self.counts.late_writes, 1);
            let (store, object) = (Arc::clone(&self.store), object.clone());
            let copy = self.staging.stage_again(staged)?;
            self.late.spawn(async move {
                sleep(delay).await;
                store.publish(&copy, &object).await
            });
            Err(gave_up())
        })
    }

    fn size<'a>(&'a self, object: &'a Object) -> BoxFuture<'a, Result<Option<u64>, StoreError>> {
        self.store.size(object)
    }

    fn read<'a>(&'a self, object: &'a Object, range: Range<u64>) -> BoxFuture<'a, Result<Bytes, StoreError>> {
        self.store.read(object, range)
    }

    fn list<'a>(&'a self, folder: &'a str) -> BoxStream<'a, Result<(Object, u64), StoreError>> {
        self.store.list(folder)
    }

    fn tenants(&self) -> BoxFuture<'_, Result<Vec<Tenant>, StoreError>> {
        self.store.tenants()
    }

    fn remove<'a>(&'a self, objects: &'a [Object]) -> BoxFuture<'a, Vec<Result<(), StoreError>>> {
        Box::pin(async move {
            let Some(delay) = self.lateness() else { return self.store.remove(objects).await };
            Counts::add(&self.counts.late_removals, objects.len() as u64);
            let (store, owned) = (Arc::clone(&self.store), objects.to_vec());
            self.late.spawn(async move {
                sleep(delay).await;
                store.remove(&owned).await
            });
            objects.iter().map(|_| Err(gave_up())).collect()
        })
    }

    fn note<'a>(&'a self, name: &'a str) -> BoxFuture<'a, Result<Option<String>, StoreError>> {
        self.store.note(name)
    }

    fn set_note<'a>(&'a self, name: &'a str, text: String) -> BoxFuture<'a, Result<(), StoreError>> {
        self.store.set_note(name, text)
    }
}

/// Measurement that the tests have stored in the catalog; its deletion waits for those who read it.
#[derive(Debug)]
struct Named {
    id: Digest,
    content: u64,
    there: RwLock<bool>,
}

#[derive(Clone, Debug)]
struct Soak {
    archive: Archive,
    named: Arc<Mutex<Vec<Arc<Named>>>>,
    counts: Arc<Counts>,
    faults: Arc<Mutex<Vec<String>>>,
    stop: CancellationToken,
}

fn content(number: u64) -> Vec<u8> {
    format!("content {number}").into_bytes()
}

impl Soak {
    fn fault(&self, text: String) {
        self.faults.lock().unwrap().push(text);
    }

    /// Returns a random one of the measurements that the catalog names; `None` if there are none.
    fn any(&self, dice: &mut Dice) -> Option<Arc<Named>> {
        let named = self.named.lock().unwrap();
        (!named.is_empty()).then(|| Arc::clone(&named[dice.below(named.len() as u64) as usize]))
    }

    async fn publishes(self, task: u64) {
        let mut dice = Dice::new(task);
        for round in 0_u64.. {
            if self.stop.is_cancelled() {
                return;
            }
            let number = dice.below(CONTENTS);
            let bytes = content(number);
            let staged = self.archive.staging.stage(&bytes).unwrap();
            // A client sees the failure of a call that outlives its caller, and comes back.
            let Ok(mut published) = Published::new(&self.archive, staged).await else { continue };
            if dice.below(100) < LATE {
                Counts::add(&self.counts.stalled, 1);
                sleep(Duration::from_millis(1500)).await;
            }
            let new = NewMeasurement {
                id: Digest::of(format!("{task} {round}").as_bytes()),
                ..testing::measurement(&String::from_utf8_lossy(&bytes))
            };
            let row = loop {
                match self.archive.catalog.add_measurement(&new, published.claim()).await.unwrap() {
                    Added::Row(row, true) => break Some(row),
                    Added::Unpublished => Counts::add(&self.counts.refused, 1),
                    other => panic!("{other:?}"),
                }
                match published.again(&self.archive).await {
                    Ok(again) => published = again,
                    Err(_) => break None,
                }
            };
            let Some(row) = row else { continue };
            Counts::add(&self.counts.published, 1);
            let named = Named { id: row.id, content: number, there: RwLock::new(true) };
            self.named.lock().unwrap().push(Arc::new(named));
            sleep(Duration::from_millis(dice.below(20))).await;
        }
    }

    async fn deletes(self, task: u64) {
        let mut dice = Dice::new(task);
        while !self.stop.is_cancelled() {
            // Few names, so that the last name of a content goes often.
            let many = self.named.lock().unwrap().len() > CONTENTS as usize;
            let victim = if many || dice.below(3) == 0 { self.any(&mut dice) } else { None };
            if let Some(victim) = victim {
                let mut there = victim.there.write().await;
                if *there {
                    *there = false;
                    self.named.lock().unwrap().retain(|named| named.id != victim.id);
                    let deleted = self.archive.catalog.delete_measurement(victim.id).await.unwrap();
                    assert_eq!(deleted, Deleted::Done);
                }
            }
            sleep(Duration::from_millis(dice.below(if many { 2 } else { 20 }))).await;
        }
    }

    async fn reads(self, task: u64) {
        let mut dice = Dice::new(task);
        while !self.stop.is_cancelled() {
            if let Some(named) = self.any(&mut dice) {
                let there = named.there.read().await;
                if *there {
                    self.read(&named).await;
                    // A reader that finds fault with an object: the next upload replaces it.
                    if dice.below(200) == 0
                        && let Ok(Some(blob)) = self.archive.catalog.blob(Digest::of(&content(named.content))).await
                    {
                        self.archive.catalog.suspect(std::slice::from_ref(&blob.object)).await.unwrap();
                        Counts::add(&self.counts.healed, 1);
                    }
                }
            }
            sleep(Duration::from_millis(dice.below(4))).await;
        }
    }

    async fn read(&self, named: &Named) {
        Counts::add(&self.counts.reads, 1);
        let bytes = content(named.content);
        match self.archive.get(Digest::of(&bytes)).await {
            Ok(read) if read == bytes => {}
            other => self.fault(format!("a read without bytes: content {}: {other:?}", named.content)),
        }
    }

    async fn sweeps(self) {
        let limits = Limits { grace: Duration::from_millis(500), ..Limits::default() };
        while !self.stop.is_cancelled() {
            // A removal that outlives its caller fails, and is repeated.
            match self.archive.sweep_within(&limits, &|| false).await {
                Ok(report) => Counts::add(&self.counts.removed, report.removed_blobs),
                Err(ArchiveError::Store(_)) => {}
                Err(error) => self.fault(format!("a sweep failed: {error}")),
            }
            sleep(Duration::from_millis(20)).await;
        }
    }

    async fn hurries(self) {
        while !self.stop.is_cancelled() {
            testing::hurry(&self.archive.catalog).await;
            sleep(Duration::from_millis(50)).await;
        }
    }
}

async fn objects(archive: &Archive) -> BTreeSet<Object> {
    let mut objects = BTreeSet::new();
    let mut found = archive.store.list(FOLDER);
    while let Some(found) = found.next().await {
        objects.insert(found.unwrap().0);
    }
    objects
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn nothing_is_lost_or_left_over_when_store_calls_outlive_their_callers() {
    let seconds = std::env::var("WAVELUME_SOAK_SECONDS").map_or(5, |text| text.parse().expect("WAVELUME_SOAK_SECONDS"));
    for (site, _guard) in sites().await {
        let (counts, late) = (Arc::new(Counts::default()), TaskTracker::new());
        let (named, faults, stop) = (Arc::default(), Arc::default(), CancellationToken::new());
        let mut processes = Vec::new();
        for seed in 0..2 {
            let mut archive = Archive::serve(&site).await.unwrap();
            archive.store = Arc::new(Faulty {
                store: Arc::clone(&archive.store),
                staging: archive.staging.clone(),
                dice: Mutex::new(Dice::new(seed)),
                counts: Arc::clone(&counts),
                late: late.clone(),
            });
            processes.push(Soak {
                archive,
                named: Arc::clone(&named),
                counts: Arc::clone(&counts),
                faults: Arc::clone(&faults),
                stop: stop.clone(),
            });
        }
        let tasks = TaskTracker::new();
        for (process, soak) in (0..).zip(&processes) {
            for task in 0..3 {
                tasks.spawn(soak.clone().publishes(100 + 10 * process + task));
            }
            tasks.spawn(soak.clone().deletes(200 + process));
            tasks.spawn(soak.clone().reads(300 + process));
            tasks.spawn(soak.clone().sweeps());
        }
        let hurry = CancellationToken::new();
        let clock = tokio::spawn(Soak { stop: hurry.clone(), ..processes[0].clone() }.hurries());
        let start = Instant::now();
        // Longer on a busy machine, so that each kind of mishap comes to pass.
        while start.elapsed() < Duration::from_secs(seconds)
            || (counts.is_poor() && start.elapsed() < Duration::from_secs(seconds + 60))
        {
            sleep(Duration::from_millis(100)).await;
        }
        stop.cancel();
        tasks.close();
        tasks.wait().await;
        late.close();
        late.wait().await;

        let soak = &processes[0];
        let left: Vec<Arc<Named>> = soak.named.lock().unwrap().clone();
        for named in &left {
            soak.read(named).await;
        }
        // Every time has run out after a few seconds; until then a removal may fail once more.
        let quiet = Soak { stop: CancellationToken::new(), ..soak.clone() };
        let sweeping = tokio::spawn(quiet.clone().sweeps());
        let deadline = Instant::now() + Duration::from_mins(1);
        while testing::count(&soak.archive.catalog, "intents").await
            + testing::count(&soak.archive.catalog, "doomed").await
            + testing::count(&soak.archive.catalog, "unnamed").await
            > 0
        {
            let faults = soak.faults.lock().unwrap().clone();
            assert!(faults.is_empty() && Instant::now() < deadline, "objects to be deleted are left over: {faults:?}");
            sleep(Duration::from_millis(100)).await;
        }
        quiet.stop.cancel();
        hurry.cancel();
        sweeping.await.unwrap();
        clock.await.unwrap();

        let contents: BTreeSet<u64> = left.iter().map(|named| named.content).collect();
        let stored = objects(&soak.archive).await;
        println!(
            "{}: {} s, {counts:?}, {} names and {} objects left",
            soak.archive.places().0,
            start.elapsed().as_secs(),
            left.len(),
            stored.len()
        );
        let checked = soak.archive.check().await.unwrap();
        assert_eq!((soak.faults.lock().unwrap().as_slice(), checked.faults), ([].as_slice(), vec![]));
        assert_eq!(stored.len(), contents.len(), "an object for each named content, and no other");
        assert!(!counts.is_poor(), "too little came to pass: {counts:?}");
    }
}
