//! Tests of backup, restore and move, from and to each kind of database and store.

use super::archive::{Archive, ArchiveError};
use super::dump::Dump;
use super::presence::{Presence, WORKERS};
use super::publish::Published;
use super::publish::tests::stored;
use super::site::Site;
use super::site::tests::sites;
use crate::catalog::{Database, Deleted, Ended, Ending, JobState, MaterialFilter, NewJob, NewMaterial, Priority};
use crate::domain::Quantity;
use crate::store::{Digest, FOLDER, Object, Place, contract};
use futures::TryStreamExt;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const LEASE: Duration = Duration::from_mins(1);

/// Returns a place for a backup of each kind: a directory and an S3 prefix.
fn destinations() -> (Vec<Place>, tempfile::TempDir) {
    let directory = tempfile::tempdir().unwrap();
    (vec![Place::Directory(directory.path().join("backup")), contract::bucket()], directory)
}

async fn objects(archive: &Archive) -> BTreeSet<(Object, u64)> {
    archive.store.list(FOLDER).try_collect().await.unwrap()
}

fn job(id: &str, measurement: Option<Digest>) -> NewJob {
    NewJob {
        id: id.to_owned(),
        frame: "00".to_owned(),
        level: 1,
        measurement,
        priority: Priority::Usual,
        share: String::new(),
        idempotency: None,
    }
}

/// Makes a material of a measurement, one job that runs and one that waits. Returns the id of the material.
async fn used(archive: &Archive, measurement: Digest) -> Digest {
    let catalog = &archive.catalog;
    catalog.enqueue(&job("1 ended", Some(measurement)), 99).await.unwrap();
    let claimed = catalog.claim("worker", LEASE, &[]).await.unwrap().unwrap();
    let staged = archive.staging.stage(b"a material").unwrap();
    let published = Published::new(archive, staged).await.unwrap();
    let material = NewMaterial {
        id: published.digest(),
        payload: Digest::of(b"payload"),
        quantity: Quantity::Edf,
        bytes: 10,
        name: Some("A \"name\" – with\nlines".to_owned()),
        tags: vec!["office".to_owned()],
        measurements: vec![measurement],
        document: serde_json::Map::new(),
    };
    let ended = Ended::Material(Box::new(material), published.claim().clone());
    assert_eq!(catalog.end(&claimed, &ended).await.unwrap(), Ending::Now(JobState::Succeeded));
    catalog.enqueue(&job("2 running", Some(measurement)), 99).await.unwrap();
    catalog.claim("worker", LEASE, &[]).await.unwrap().unwrap();
    catalog.enqueue(&job("3 queued", None), 99).await.unwrap();
    published.digest()
}

/// Checks that a copied service is sound, and has these files and the rows that [`used`] made.
async fn is_whole(archive: &Archive, files: &[(Digest, Vec<u8>)], material: Digest) {
    assert_eq!(archive.check().await.unwrap().faults, []);
    for (id, bytes) in files {
        let row = archive.catalog.measurement(*id).await.unwrap().expect("accepted before the copy");
        assert_eq!(&archive.get(row.content).await.unwrap(), bytes);
    }
    assert_eq!(archive.get(material).await.unwrap(), b"a material".as_slice());
    let row = archive.catalog.material(material).await.unwrap().unwrap();
    assert_eq!(row.tags, ["office"]);
    let filter = MaterialFilter { q: Some("ffic".to_owned()), ..MaterialFilter::default() };
    assert_eq!(archive.catalog.materials(&filter, None, 9).await.unwrap().items.len(), 1);
    let state = async |id: &str| archive.catalog.job(id).await.unwrap().unwrap();
    assert_eq!(state("1 ended").await.material, Some(material));
    let running = state("2 running").await;
    assert_eq!((running.state, running.attempts), (JobState::Queued, 0), "running jobs are queued again");
    assert_eq!(state("3 queued").await.state, JobState::Queued);
    let claimed = archive.catalog.claim("other", LEASE, &[]).await.unwrap().unwrap();
    assert_eq!((claimed.id.as_str(), claimed.attempts), ("2 running", 1));
}

/// Stores files, some of which are deleted again at once, and sweeps, until the flag is set.
async fn load(archive: Archive, stop: Arc<AtomicBool>, number: u32) -> u32 {
    for round in 0.. {
        if stop.load(Ordering::Relaxed) {
            return round;
        }
        let id = stored(&archive, format!("load {number} {round}").as_bytes()).await;
        if round % 2 == 0 {
            assert_eq!(archive.catalog.delete_measurement(id).await.unwrap(), Deleted::Done);
            archive.sweep_now().await.unwrap();
        }
    }
    0
}

#[tokio::test(flavor = "multi_thread")]
async fn a_backup_under_load_is_restored_to_each_kind_of_service() {
    for (site, _guard) in sites().await {
        let archive = Archive::serve(&site).await.unwrap();
        let mut files = Vec::new();
        for number in 0..30 {
            let bytes = format!("file {number}").into_bytes();
            files.push((stored(&archive, &bytes).await, bytes));
        }
        let large = vec![7; (9 << 20) + 1];
        files.push((stored(&archive, &large).await, large));
        let material = used(&archive, files[0].0).await;
        let stop = Arc::new(AtomicBool::new(false));
        let loads = [0, 1].map(|number| tokio::spawn(load(archive.clone(), Arc::clone(&stop), number)));
        let (places, _backups) = destinations();
        for place in &places {
            let report = archive.backup(place, false).await.unwrap();
            assert!(report.files.copied_blobs >= 32 && report.files.lost.is_empty(), "{report:?}");
        }
        stop.store(true, Ordering::Relaxed);
        for load in loads {
            assert!(load.await.unwrap() > 0);
        }
        for (place, (target, _guard)) in places.iter().zip(sites().await) {
            let report = Archive::restore(&target, place, false).await.unwrap();
            assert!(report.files.copied_blobs >= 32 && report.files.lost.is_empty(), "{report:?}");
            let restored = Archive::serve(&target).await.unwrap();
            assert_ne!(report.instance, archive.catalog.instance().await.unwrap());
            assert_eq!(report.instance, restored.catalog.instance().await.unwrap());
            is_whole(&restored, &files, material).await;
            let error = Archive::restore(&target, place, false).await.unwrap_err().to_string();
            assert!(error.contains("measurements") && error.contains("expected an empty database"), "{error}");
        }
        // A later backup to the same place copies what is new.
        let again = archive.backup(&places[0], true).await.unwrap();
        assert!(again.files.there_blobs >= 32, "{again:?}");
        let quiet = archive.backup(&places[0], false).await.unwrap();
        assert_eq!(quiet.files.copied_blobs, 0, "{quiet:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_backup_and_a_killed_restore_go_on() {
    for (site, _guard) in sites().await {
        let archive = Archive::serve(&site).await.unwrap();
        let mut files = Vec::new();
        for number in 0..200 {
            let bytes = format!("file {number}").into_bytes();
            files.push((stored(&archive, &bytes).await, bytes));
        }
        let material = used(&archive, files[0].0).await;
        let (places, _backups) = destinations();
        for (place, (target, _guard)) in places.into_iter().zip(sites().await) {
            let (from, to) = (archive.clone(), place.clone());
            let report = killed(move || {
                let (from, to) = (from.clone(), to.clone());
                async move { from.backup(&to, false).await }
            });
            let report = report.await.unwrap();
            assert_eq!(report.files.copied_blobs + report.files.there_blobs, 201, "{report:?}");

            let (to, from) = (target.clone(), place.clone());
            let report = killed(move || {
                let (to, from) = (to.clone(), from.clone());
                async move { Archive::restore(&to, &from, false).await }
            });
            match report.await {
                Ok(report) => assert_eq!(report.files.copied_blobs + report.files.there_blobs, 201, "{report:?}"),
                // Killed between its last commit and the answer: it had ended, and `is_whole` sees that.
                Err(ArchiveError::Copy(reason)) => assert!(reason.contains("expected an empty database"), "{reason}"),
                Err(error) => panic!("{error}"),
            }
            let restored = Archive::serve(&target).await.unwrap();
            is_whole(&restored, &files, material).await;
            let kept = restored.catalog.blob_counts().await.unwrap().live;
            assert_eq!(kept, 201);
        }
    }
}

/// Runs an operation several times, each time killed after a longer time, and at last to its end.
async fn killed<T, F: Future<Output = Result<T, ArchiveError>>>(operation: impl Fn() -> F) -> Result<T, ArchiveError> {
    for time in [10, 60, 150, 400] {
        if let Ok(done) = tokio::time::timeout(Duration::from_millis(time), operation()).await {
            // A fast machine.
            return done;
        }
    }
    operation().await
}

#[tokio::test]
async fn damaged_bytes_are_named_and_all_others_are_copied() {
    for ((site, _guard), (target, _other)) in sites().await.into_iter().zip(sites().await.into_iter().rev()) {
        let archive = Archive::serve(&site).await.unwrap();
        let [flipped, gone, good] = [b"flipped".as_slice(), b"gone", b"good"];
        let mut digests = Vec::new();
        for bytes in [flipped, gone, good] {
            digests.push(stored(&archive, bytes).await);
        }
        let object = async |digest| archive.catalog.blob(digest).await.unwrap().unwrap().object;
        let other = archive.staging.stage(b"flippee").unwrap();
        archive.store.publish(&other, &object(digests[0]).await).await.unwrap();
        archive.store.remove(&[object(digests[1]).await]).await;
        let (places, _backups) = destinations();
        let report = archive.backup(&places[0], false).await.unwrap();
        let lost: BTreeSet<_> = report.files.lost.iter().map(|lost| (lost.kind, lost.digest)).collect();
        assert_eq!(lost, BTreeSet::from([("corrupt", digests[0]), ("missing", digests[1])]));
        assert_eq!(report.files.copied_blobs, 1);

        let report = Archive::restore(&target, &places[0], false).await.unwrap();
        assert_eq!((report.files.copied_blobs, report.files.lost.len()), (1, 2));
        let restored = Archive::serve(&target).await.unwrap();
        assert_eq!(restored.get(digests[2]).await.unwrap(), good);
        for bytes in [flipped, gone] {
            assert!(restored.get(Digest::of(bytes)).await.is_err());
            stored(&restored, bytes).await;
            assert_eq!(restored.get(Digest::of(bytes)).await.unwrap(), bytes);
        }
        assert_eq!(restored.check().await.unwrap().faults, []);

        // A bit that flips in the backup is found, too, and a later backup heals it.
        stored(&archive, flipped).await;
        stored(&archive, gone).await;
        archive.backup(&places[0], false).await.unwrap();
        let (backup, staging) = places[0].open(&site.data).unwrap();
        let damaged = super::backup::kept(digests[2]);
        backup.publish(&staging.stage(b"goof").unwrap(), &damaged).await.unwrap();
        let repaired = archive.backup(&places[0], true).await.unwrap();
        assert_eq!((repaired.files.copied_blobs, repaired.files.there_blobs), (1, 2));
    }
}

#[tokio::test]
async fn a_place_that_is_used_is_refused() {
    let (places, _backups) = destinations();
    let mut backups = places.into_iter();
    for (site, _guard) in sites().await {
        let archive = Archive::serve(&site).await.unwrap();
        stored(&archive, b"bytes").await;
        let (_, store) = archive.places();
        let error = archive.backup(store, false).await.unwrap_err().to_string();
        let refusals = ["is the store of the catalog", "choose a place outside"];
        assert!(refusals.iter().any(|refusal| error.contains(refusal)), "{error}");
        let place = backups.next().unwrap();
        archive.backup(&place, false).await.unwrap();

        let empty = tempfile::tempdir().unwrap();
        let taken = Site { store: Some(store.clone()), ..Site::new(empty.path()) };
        let error = Archive::restore(&taken, &place, false).await.unwrap_err().to_string();
        let id = archive.catalog.instance().await.unwrap();
        assert!(error.contains(&format!("the bytes of the catalog {id}")) && error.contains("empty one"), "{error}");
        let backup = Site { store: Some(place.clone()), ..Site::new(empty.path()) };
        for refusal in
            [Archive::restore(&backup, &place, false).await.unwrap_err(), Archive::serve(&backup).await.unwrap_err()]
        {
            assert!(refusal.to_string().contains("a backup"), "{refusal}");
        }
        let error = Archive::restore(&Site::new(empty.path()), store, false).await.unwrap_err().to_string();
        assert!(error.contains("found no wavelume-backup"), "{error}");

        // As a killed restore leaves it: nobody serves it, and nothing else is copied into it.
        let begun = Archive::to_fill(&Site::new(empty.path()), "the catalog x").await.unwrap();
        begun.catalog.close().await;
        let error = Archive::serve(&Site::new(empty.path())).await.unwrap_err().to_string();
        assert!(error.contains("the catalog x") && error.contains("start the same"), "{error}");
        let error = Archive::restore(&Site::new(empty.path()), &place, false).await.unwrap_err().to_string();
        assert!(error.contains("a copy of the catalog x into"), "{error}");

        let served = tempfile::tempdir().unwrap();
        let _node = Presence::enter(&served.path().join(WORKERS)).unwrap();
        let error = Archive::restore(&Site::new(served.path()), &place, false).await.unwrap_err().to_string();
        assert!(error.contains("1 nodes or workers use") && !served.path().join("catalog.sqlite").exists(), "{error}");
    }
}

/// Returns the paths of all files and directories in a directory.
fn paths(directory: &Path) -> BTreeSet<PathBuf> {
    let mut found = BTreeSet::new();
    for entry in std::fs::read_dir(directory).unwrap() {
        let entry = entry.unwrap();
        if entry.file_type().unwrap().is_dir() {
            found.extend(paths(&entry.path()));
        }
        found.insert(entry.path());
    }
    found
}

#[tokio::test]
async fn no_copy_is_written_into_what_it_reads() {
    let top = tempfile::tempdir().unwrap();
    let at = |name: &str| top.path().join(name);
    std::fs::create_dir(at("data")).unwrap();
    let archive = Archive::serve(&Site::new(at("data"))).await.unwrap();
    let backup = Place::Directory(at("backup"));
    archive.backup(&backup, false).await.unwrap();
    for (link, original) in [("data link", "data"), ("backup link", "backup")] {
        std::os::unix::fs::symlink(original, at(link)).unwrap();
    }
    std::fs::hard_link(at("data/catalog.sqlite"), at("hard link.sqlite")).unwrap();
    let before = paths(top.path());
    let file = |name: &str| Some(Database::File(at(name)));
    let refused = |failure: ArchiveError, reason: &str| {
        let message = failure.to_string();
        assert!(matches!(failure, ArchiveError::Copy(_)) && message.contains(reason), "{message}");
        assert_eq!(paths(top.path()), before, "{message}");
    };
    for own in ["data", "data/new", "data link", "data link/new"] {
        let place = Place::Directory(at(own));
        refused(archive.backup(&place, false).await.unwrap_err(), "which the backup is to copy");
        let site = Site { store: Some(place), database: file("new.sqlite"), ..Site::new(at("new")) };
        refused(archive.relocate(&site).await.unwrap_err(), "which is moved and only read");
        refused(archive.relocate(&Site::new(at(own))).await.unwrap_err(), "which is moved and only read");
    }
    for own in ["data link/catalog.sqlite", "hard link.sqlite"] {
        let site = Site { database: file(own), ..Site::new(at("new")) };
        refused(archive.relocate(&site).await.unwrap_err(), "which is moved and only read");
    }
    for own in ["backup", "backup/new", "backup link", "backup link/new"] {
        let new = Site::new(at("new"));
        let store = Some(Place::Directory(at(own)));
        let database = file(&format!("{own}/catalog.sqlite"));
        for site in [Site::new(at(own)), Site { store, ..new.clone() }, Site { database, ..new }] {
            refused(Archive::restore(&site, &backup, false).await.unwrap_err(), "holds a backup and is only read");
        }
    }
    // Places beside the original are taken, also of a service that keeps its data directory.
    let beside =
        Site { store: Some(Place::Directory(at("store"))), database: file("new.sqlite"), ..Site::new(at("data")) };
    archive.relocate(&beside).await.unwrap();
    Archive::restore(&Site::new(at("new")), &backup, false).await.unwrap();
}

#[tokio::test]
async fn a_faulty_backup_ends_a_restore_that_goes_on_with_a_newer_one() {
    let (places, _backups) = destinations();
    for (place, (site, _guard)) in places.iter().zip(sites().await) {
        let archive = Archive::serve(&site).await.unwrap();
        let (kept, gone) = (stored(&archive, b"kept").await, stored(&archive, b"gone").await);
        archive.backup(place, false).await.unwrap();
        let (backup, _) = place.open(&site.data).unwrap();
        backup.remove(&[super::backup::kept(Digest::of(b"gone"))]).await;
        let data = tempfile::tempdir().unwrap();
        let target = Site::new(data.path());
        for _ in 0..2 {
            let error = Archive::restore(&target, place, false).await.unwrap_err().to_string();
            assert!(error.starts_with("1 files of the backup") && error.contains("--accept-lost"), "{error}");
            assert!(Archive::serve(&target).await.is_err(), "the restore has not ended");
        }
        let other = tempfile::tempdir().unwrap();
        let report = Archive::restore(&Site::new(other.path()), place, true).await.unwrap();
        assert_eq!((report.files.copied_blobs, report.files.lost.len()), (1, 1), "{report:?}");

        assert_eq!(archive.backup(place, false).await.unwrap().files.copied_blobs, 1);
        let report = Archive::restore(&target, place, false).await.unwrap();
        assert_eq!((report.files.there_blobs, report.files.copied_blobs), (1, 1), "{report:?}");
        let restored = Archive::serve(&target).await.unwrap();
        for (id, bytes) in [(kept, b"kept"), (gone, b"gone")] {
            let row = restored.catalog.measurement(id).await.unwrap().unwrap();
            assert_eq!(restored.get(row.content).await.unwrap(), bytes.as_slice());
        }
    }
}

#[tokio::test]
async fn bytes_of_a_store_that_is_away_are_not_lost() {
    let (places, _backups) = destinations();
    let data = tempfile::tempdir().unwrap();
    let site = Site::new(data.path());
    let archive = Archive::serve(&site).await.unwrap();
    let digest = stored(&archive, b"bytes").await;
    let object = archive.catalog.blob(Digest::of(b"bytes")).await.unwrap().unwrap().object;
    // As below the mount point of a disk that was unmounted.
    archive.store.remove(&[object]).await;
    std::fs::remove_file(data.path().join("wavelume-instance")).unwrap();
    let other = tempfile::tempdir().unwrap();
    for error in [
        archive.backup(&places[0], false).await.unwrap_err(),
        archive.relocate(&Site::new(other.path())).await.unwrap_err(),
    ] {
        assert!(error.to_string().contains("check that its disk is mounted"), "{error}");
    }
    assert!(!archive.catalog.blob(Digest::of(b"bytes")).await.unwrap().unwrap().suspect, "{digest}");
}

#[tokio::test]
async fn one_backup_at_a_time_and_none_of_a_newer_schema() {
    let (places, _backups) = destinations();
    let Place::Directory(directory) = &places[0] else { panic!("{places:?}") };
    let data = tempfile::tempdir().unwrap();
    let archive = Archive::serve(&Site::new(data.path())).await.unwrap();
    stored(&archive, b"bytes").await;
    archive.backup(&places[0], false).await.unwrap();
    let left = directory.join("staging/left");
    std::fs::write(&left, b"half").unwrap();
    let old = std::time::SystemTime::now() - Duration::from_hours(25);
    std::fs::File::options().write(true).open(&left).unwrap().set_modified(old).unwrap();
    let (first, second) = tokio::join!(archive.backup(&places[0], false), archive.backup(&places[0], true));
    let failed: Vec<String> = [first, second].into_iter().filter_map(|made| Some(made.err()?.to_string())).collect();
    assert!(failed.len() <= 1 && failed.iter().all(|error| error.contains("another backup was made")), "{failed:?}");
    assert!(!left.exists());

    archive.catalog.pretend_newer().await;
    let error = archive.backup(&places[0], false).await.unwrap_err().to_string();
    assert!(error.contains("use a newer program"), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_service_moves_to_the_other_kind_and_back() {
    for ((site, _guard), (other, _other)) in sites().await.into_iter().zip(sites().await.into_iter().rev()) {
        let archive = Archive::serve(&site).await.unwrap();
        let mut files = Vec::new();
        for number in 0..20 {
            let bytes = format!("file {number}").into_bytes();
            files.push((stored(&archive, &bytes).await, bytes));
        }
        let material = used(&archive, files[0].0).await;
        let stop = Arc::new(AtomicBool::new(false));
        let loads = [0, 1].map(|number| tokio::spawn(load(archive.clone(), Arc::clone(&stop), number)));
        let error = archive.relocate(&other).await.unwrap_err().to_string();
        assert!(error.contains("is still written to: stop its nodes and workers"), "{error}");
        stop.store(true, Ordering::Relaxed);
        futures::future::try_join_all(loads).await.unwrap();

        let idle = Presence::enter(&archive.data.join(WORKERS)).unwrap();
        let error = archive.relocate(&other).await.unwrap_err().to_string();
        assert!(error.contains("1 nodes or workers use") && error.contains("stop them"), "{error}");
        drop(idle);

        let staging = &archive.staging;
        let (before, held) = (Dump::of(&archive.catalog, staging).await.unwrap(), objects(&archive).await);
        let report = archive.relocate(&other).await.unwrap();
        assert!(report.files.there_blobs >= 21 && report.files.lost.is_empty(), "{report:?}");
        assert_eq!(report.rows, before.rows());
        assert!(Dump::of(&archive.catalog, staging).await.unwrap().equals(&before), "the original stays as it is");
        assert_eq!(objects(&archive).await, held);

        let moved = Archive::serve(&other).await.unwrap();
        let backs = tempfile::tempdir().unwrap();
        let back = Site::new(backs.path());
        moved.relocate(&back).await.unwrap();
        let back = Archive::serve(&back).await.unwrap();
        let mut ids = BTreeSet::new();
        for archive in [&archive, &moved, &back] {
            ids.insert(archive.catalog.instance().await.unwrap());
        }
        assert_eq!(ids.len(), 3, "each copy has an id of its own");
        for archive in [&moved, &back] {
            is_whole(archive, &files, material).await;
            assert_eq!(archive.sweep_now().await.unwrap().waiting_blobs, 0);
            assert_eq!(archive.check().await.unwrap().faults, []);
        }
    }
}
