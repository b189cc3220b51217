//! Upkeep of the bytes of two tenants: checks, sweeps, backups and restores see both, and mix them nowhere.

use super::fsck::{Check, Fault};
use super::publish::Published;
use super::publish::tests::{SPECTRUM, stored, upload};
use super::site::tests::sites;
use super::*;
use crate::catalog::{Enqueued, JobState, Limit, TenantChange, testing};
use crate::store::{Digest, Object, StoreExt};
use std::sync::Arc;
use std::time::Duration;
use tokio_util::sync::CancellationToken;

/// Returns the archive of a service as two different tenants see it.
async fn archives(site: &Site) -> [Archive; 2] {
    let mine = Archive::serve(site).await.unwrap();
    let theirs = testing::other(&mine.catalog, "ab").await;
    let theirs = mine.of(theirs.tenant());
    [mine, theirs]
}

#[tokio::test]
async fn equal_bytes_of_two_tenants_are_two_objects_that_are_checked_and_swept_apart() {
    for (site, _guard) in sites().await {
        let [mine, theirs] = archives(&site).await;
        let (digest, other) = (stored(&mine, b"bytes").await, stored(&theirs, b"bytes").await);
        assert_eq!(digest, other);
        let object = async |archive: &Archive| archive.catalog.blob(digest).await.unwrap().unwrap().object;
        let objects = [object(&mine).await, object(&theirs).await];
        assert_ne!(objects[0], objects[1]);
        assert_eq!(mine.check().await.unwrap().checked_blobs, 2);

        theirs.store.publish(&theirs.staging.stage(b"setyb").unwrap(), &objects[1]).await.unwrap();
        let checked = mine.check_within(Check::default()).await.unwrap();
        let tenant = Some("ab".to_owned());
        assert_eq!(checked.faults, [Fault::Corrupt { digest: digest.to_string(), tenant }]);
        assert!(theirs.catalog.blob(digest).await.unwrap().unwrap().suspect);
        assert!(!mine.catalog.blob(digest).await.unwrap().unwrap().suspect);
        assert_eq!(mine.get(digest).await.unwrap(), b"bytes".as_slice());
        assert!(theirs.get(digest).await.is_err());
        stored(&theirs, b"bytes").await;
        assert_eq!(theirs.get(digest).await.unwrap(), b"bytes".as_slice());

        theirs.catalog.delete_measurement(digest).await.unwrap();
        // The damaged object and the deleted one.
        assert_eq!(mine.sweep_now().await.unwrap().removed_blobs, 2);
        assert!(theirs.get(digest).await.is_err());
        assert_eq!(mine.get(digest).await.unwrap(), b"bytes".as_slice());
        assert_eq!(mine.check().await.unwrap().faults, []);
    }
}

#[tokio::test]
async fn what_a_limit_refuses_is_not_kept() {
    for (site, _guard) in sites().await {
        let engine = Engine::open(&WorkConfig { site: site.clone(), ..WorkConfig::new(&site.data) }).await.unwrap();
        let catalog = &engine.archive.catalog;
        let limit = |bytes, materials| TenantChange {
            bytes: Some(Limit(bytes)),
            materials: Some(Limit(materials)),
            ..TenantChange::default()
        };
        let rows = async || {
            let count = |table| testing::count(catalog, table);
            [count("intents").await, count("doomed").await, count("blobs").await]
        };
        let ingest = async || engine.ingest(engine.archive.staging.stage(SPECTRUM).unwrap(), upload()).await;
        catalog.change_tenant(catalog.tenant(), &limit(Some(1), None)).await.unwrap();
        assert!(matches!(ingest().await, Err(IngestError::Over(_))));
        assert_eq!(rows().await, [0, 0, 0], "nothing was stored");
        assert_eq!(engine.archive.check().await.unwrap().faults, []);

        // The result of a job, which has no size before it is made.
        catalog.change_tenant(catalog.tenant(), &limit(None, Some(0))).await.unwrap();
        let (row, _) = ingest().await.unwrap();
        let request = serde_json::json!({ "measurement": row.id, "target": { "er_l2": 0.01 } });
        let request = JobRequest::Compress(Box::new(serde_json::from_value(request).unwrap()));
        let Enqueued::New(job) = engine.enqueue(&request, None).await.unwrap() else { panic!() };
        let stop = CancellationToken::new();
        let working = tokio::spawn({
            let (engine, stop) = (Arc::clone(&engine), stop.clone());
            async move { run_workers(&engine, 1, &stop).await }
        });
        while !engine.job(&job.id).await.unwrap().unwrap().state.is_final() {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        stop.cancel();
        working.await.unwrap();
        assert_eq!(engine.job(&job.id).await.unwrap().unwrap().state, JobState::Failed);
        assert_eq!(rows().await, [0, 0, 1]);

        // Bytes that were stored before the limit was reached are deleted with the next sweep.
        let published = Published::new(&engine.archive, engine.archive.staging.stage(b"late").unwrap()).await.unwrap();
        published.withdraw(&engine.archive).await;
        assert_eq!(rows().await, [0, 1, 1]);
        assert_eq!(engine.archive.sweep().await.unwrap().removed_blobs, 1, "without a time of grace");
        assert_eq!(engine.archive.check().await.unwrap().faults, []);
    }
}

#[tokio::test]
async fn a_check_finds_objects_of_tenants_that_the_catalog_does_not_know() {
    for (site, _guard) in sites().await {
        let [mine, theirs] = archives(&site).await;
        // The folder of this tenant is one of the first version's, too.
        let lost = Object::fresh(theirs.catalog.tenant(), Digest::of(b"lost"));
        let unknown = Object::fresh(&"unknown".parse().unwrap(), Digest::of(b"lost"));
        for object in [&lost, &unknown] {
            mine.store.publish(&mine.staging.stage(b"lost").unwrap(), object).await.unwrap();
        }
        let fault = |object: &Object| Fault::OrphanObject { object: object.to_string(), bytes: 4 };
        assert_eq!(mine.check().await.unwrap().faults, [fault(&lost), fault(&unknown)]);
        mine.check_within(Check { repair: true, ..Check::default() }).await.unwrap();
        mine.sweep_now().await.unwrap();
        assert_eq!(mine.check().await.unwrap().faults, []);
        assert_eq!(mine.store.size(&unknown).await.unwrap(), None);
    }
}

#[tokio::test]
async fn a_restored_backup_has_the_bytes_of_every_tenant() {
    for ((site, _guard), (new, _other)) in sites().await.into_iter().zip(sites().await) {
        let [mine, theirs] = archives(&site).await;
        let (both, lost) = (stored(&mine, b"both").await, stored(&theirs, b"lost").await);
        stored(&theirs, b"both").await;
        stored(&mine, b"lost").await;
        stored(&theirs, b"theirs").await;
        let object = mine.catalog.blob(lost).await.unwrap().unwrap().object;
        mine.store.remove(&[object]).await;
        let place = tempfile::tempdir().unwrap();
        let place = Place::Directory(place.path().join("backup"));
        let report = mine.backup(&place, false).await.unwrap();
        assert_eq!(report.files.lost.len(), 1);
        assert_eq!(report.files.lost[0].tenant, *mine.catalog.tenant());

        let restored = Archive::restore(&new, &place, false).await.unwrap();
        assert_eq!(restored.files.lost, [], "the bytes that one tenant has lost are the other's");
        let again = Archive::serve(&new).await.unwrap();
        let theirs = again.of(theirs.catalog.tenant());
        for (archive, digest, bytes) in
            [(&again, both, b"both"), (&theirs, both, b"both"), (&again, lost, b"lost"), (&theirs, lost, b"lost")]
        {
            let blob = archive.catalog.blob(digest).await.unwrap().unwrap();
            assert_eq!(blob.object.tenant(), archive.catalog.tenant());
            assert_eq!(Arc::clone(&archive.store).verify(&blob.object).await.unwrap(), 4);
            assert_eq!(archive.get(digest).await.unwrap(), bytes.as_slice());
        }
        assert_eq!(again.check().await.unwrap().faults, []);
    }
}
