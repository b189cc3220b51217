//! Two tenants with equal data: each sees its own rows, and neither those of the other.

use super::testing::{self, add, measurement, publish};
use super::*;
use crate::domain::Quantity;
use crate::store::Digest;
use std::time::Duration;

const MINUTE: Duration = Duration::from_mins(1);

fn job(id: &str, measurement: Digest) -> NewJob {
    NewJob {
        id: id.to_owned(),
        frame: "00".to_owned(),
        level: 1,
        measurement: Some(measurement),
        priority: Priority::Usual,
        share: "10.0.0.1".to_owned(),
        idempotency: Some(("key".to_owned(), Digest::of(id.as_bytes()))),
    }
}

fn material(measurement: Digest) -> NewMaterial {
    NewMaterial {
        id: Digest::of(b"file"),
        payload: Digest::of(b"payload"),
        quantity: Quantity::Edf,
        bytes: 4,
        name: Some("lamp".to_owned()),
        tags: vec!["office".to_owned()],
        measurements: vec![measurement],
        document: serde_json::Map::new(),
    }
}

#[tokio::test]
async fn measurements_and_materials_belong_to_one_tenant() {
    for (mine, _guard) in testing::catalogs().await {
        let theirs = testing::other(&mine, "lab").await;
        let lamp = measurement("lamp");
        assert!(add(&mine, &lamp).await.1);
        assert!(theirs.measurement(lamp.id).await.unwrap().is_none());
        assert!(theirs.blob(lamp.content).await.unwrap().is_none());
        assert_eq!(theirs.namer(lamp.content).await.unwrap(), None);
        assert_eq!(theirs.delete_measurement(lamp.id).await.unwrap(), Deleted::Absent);
        let claim = Claim::Known(lamp.content);
        assert!(matches!(theirs.add_measurement(&lamp, &claim).await.unwrap(), Added::Unpublished));
        assert!(add(&theirs, &lamp).await.1, "the same bytes are new to the other tenant");
        let objects = [&mine, &theirs].map(|catalog| catalog.blob(lamp.content));
        let [one, other] = futures::future::try_join_all(objects).await.unwrap().try_into().unwrap();
        assert_ne!(one.unwrap().object, other.unwrap().object);

        let made = material(lamp.id);
        let claim = publish(&mine, made.id, 4).await;
        assert_eq!(mine.add_material(&made, &claim).await.unwrap(), Uploaded::Stored(true));
        let page = async |catalog: &Catalog, filter| catalog.materials(&filter, None, 9).await.unwrap().items.len();
        for filter in [
            MaterialFilter::default(),
            MaterialFilter { measurement: Some(lamp.id), ..MaterialFilter::default() },
            MaterialFilter { tag: Some("office".to_owned()), ..MaterialFilter::default() },
            MaterialFilter { q: Some("lamp".to_owned()), ..MaterialFilter::default() },
        ] {
            assert_eq!((page(&mine, filter.clone()).await, page(&theirs, filter).await), (1, 0));
        }
        assert!(theirs.material(made.id).await.unwrap().is_none());
        assert_eq!(theirs.material_name(made.id).await.unwrap(), None);
        assert_eq!(theirs.delete_material(made.id).await.unwrap(), Deleted::Absent);
        assert_eq!(theirs.delete_measurement(lamp.id).await.unwrap(), Deleted::Done, "its own, which nothing uses");
        assert!(matches!(mine.delete_measurement(lamp.id).await.unwrap(), Deleted::InUse(_)));
        // A sweep finds the digests of both.
        assert_eq!(mine.unnamed(9).await.unwrap(), [(theirs.tenant().clone(), lamp.content)]);
        assert_eq!(mine.doom_unnamed(lamp.content, MINUTE).await.unwrap(), Doom::Named);
        assert_eq!(theirs.doom_unnamed(lamp.content, MINUTE).await.unwrap(), Doom::Doomed(4));
    }
}

#[tokio::test]
async fn jobs_keys_and_uploads_belong_to_one_tenant_and_workers_serve_all() {
    for (mine, _guard) in testing::catalogs().await {
        let theirs = testing::other(&mine, "lab").await;
        let lamp = measurement("lamp");
        add(&mine, &lamp).await;
        let refused = theirs.enqueue(&job("b", lamp.id), 9).await.unwrap();
        assert!(matches!(refused, Enqueued::NoMeasurement), "the measurement is another tenant's");
        add(&theirs, &lamp).await;
        for (catalog, id) in [(&mine, "a"), (&theirs, "b")] {
            let queued = catalog.enqueue(&job(id, lamp.id), 9).await.unwrap();
            assert!(matches!(queued, Enqueued::New(_)), "the same key of another tenant is another key");
        }
        assert!(theirs.job("a").await.unwrap().is_none());
        assert!(theirs.cancel("a").await.unwrap().is_none());
        assert!(matches!(theirs.retry("a", 9).await.unwrap(), Retried::Absent));
        assert_eq!(mine.job("a").await.unwrap().unwrap().state, JobState::Queued);
        assert_eq!(theirs.jobs(&JobFilter::default(), None, 9).await.unwrap().items.len(), 1);

        let mut owners = Vec::new();
        for _ in 0..2 {
            let job = mine.claim("worker", MINUTE, &[]).await.unwrap().unwrap();
            let made = material(lamp.id);
            let owner = mine.of(&job.tenant);
            let claim = publish(&owner, made.id, 4).await;
            let ended = mine.end(&job, &Ended::Material(Box::new(made), claim)).await.unwrap();
            assert_eq!(ended, Ending::Now(JobState::Succeeded));
            assert!(owner.material(Digest::of(b"file")).await.unwrap().is_some());
            owners.push(job.tenant);
        }
        assert_eq!(owners, [mine.tenant().clone(), theirs.tenant().clone()]);

        let new = NewPartial { id: "0a".to_owned(), client: "x".to_owned(), length: None, metadata: String::new() };
        let limits = PartialLimits {
            all: 9,
            each: 9,
            tenant: 9,
            bytes: 9,
            bytes_each: 9,
            bytes_tenant: 9,
            largest: 1,
            keep: MINUTE,
        };
        assert!(matches!(mine.begin_partial(&new, &limits).await.unwrap(), Begun::Now(_)));
        assert_eq!(theirs.partial("0a").await.unwrap(), None);
        assert_eq!(theirs.hold_partial("0a", "holder", MINUTE, None).await.unwrap(), Held::Absent);
        assert!(!theirs.end_partial("0a", MINUTE).await.unwrap());
        assert!(mine.partial("0a").await.unwrap().is_some());
    }
}

#[tokio::test]
async fn tenants_take_turns_by_their_weights_and_a_new_one_waits_for_one_job_at_most() {
    for (mine, _guard) in testing::catalogs().await {
        let (heavy, late) = (testing::other(&mine, "heavy").await, testing::other(&mine, "late").await);
        let weight = TenantChange { weight: Some(300), ..TenantChange::default() };
        mine.change_tenant(heavy.tenant(), &weight).await.unwrap();
        let lamp = measurement("lamp");
        for catalog in [&mine, &heavy, &late] {
            add(catalog, &lamp).await;
        }
        let queue = async |catalog: &Catalog, number: u32| {
            let id = format!("{} {number}", catalog.tenant());
            let new = NewJob { share: catalog.tenant().to_string(), idempotency: None, ..job(&id, lamp.id) };
            assert!(matches!(catalog.enqueue(&new, 999).await.unwrap(), Enqueued::New(_)));
        };
        for number in 0..60 {
            queue(&mine, number).await;
            queue(&heavy, number).await;
        }
        let done = async || {
            let job = mine.claim("worker", MINUTE, &[]).await.unwrap().unwrap();
            mine.end(&job, &Ended::Failed("{}".to_owned())).await.unwrap();
            job.tenant
        };
        let mut heavier = 0;
        for _ in 0..40 {
            heavier += usize::from(done().await == *heavy.tenant());
        }
        assert!(heavier.abs_diff(30) <= 1, "{heavier} of 40 with three times the weight");
        queue(&late, 0).await;
        let next = [done().await, done().await];
        assert!(next.contains(late.tenant()), "{next:?}");
    }
}

#[tokio::test]
async fn a_full_queue_has_room_for_each_tenant_until_it_has_its_part() {
    for (mine, _guard) in testing::catalogs().await {
        let (theirs, third) = (testing::other(&mine, "lab").await, testing::other(&mine, "third").await);
        let queue = async |catalog: &Catalog, most: u64| {
            let mut queued = 0;
            loop {
                let id = format!("{} {queued}", catalog.tenant());
                let new = NewJob { measurement: None, idempotency: None, ..job(&id, Digest::of(b"none")) };
                match catalog.enqueue(&new, most).await.unwrap() {
                    Enqueued::New(_) => queued += 1,
                    Enqueued::Full => return queued,
                    other => panic!("{other:?}"),
                }
            }
        };
        assert_eq!(queue(&mine, 12).await, 12);
        assert_eq!(queue(&theirs, 12).await, 6, "half of the limit");
        assert_eq!(queue(&third, 12).await, 4, "a third of it");
        assert_eq!(queue(&third, 0).await, 0);
    }
}

#[tokio::test]
async fn jobs_of_a_closed_tenant_wait_until_it_is_opened() {
    for (mine, _guard) in testing::catalogs().await {
        let theirs = testing::other(&mine, "lab").await;
        for (catalog, id) in [(&theirs, "closed"), (&mine, "open")] {
            let new = NewJob { measurement: None, idempotency: None, ..job(id, Digest::of(b"none")) };
            assert!(matches!(catalog.enqueue(&new, 9).await.unwrap(), Enqueued::New(_)));
        }
        let set = async |state| {
            let change = TenantChange { state: Some(state), ..TenantChange::default() };
            mine.change_tenant(theirs.tenant(), &change).await.unwrap();
        };
        let next = async || mine.claim("worker", MINUTE, &[]).await.unwrap().map(|job| job.id);
        set(TenantState::Closed).await;
        assert_eq!((next().await.as_deref(), next().await), (Some("open"), None));
        // The queue of all has room for as many as before.
        for id in ["one", "two"] {
            let new = NewJob { measurement: None, idempotency: None, ..job(id, Digest::of(b"none")) };
            assert!(matches!(mine.enqueue(&new, 2).await.unwrap(), Enqueued::New(_)), "{id}");
        }
        assert_eq!((next().await.as_deref(), next().await.as_deref(), next().await), (Some("one"), Some("two"), None));
        set(TenantState::Active).await;
        assert_eq!(next().await.as_deref(), Some("closed"));
    }
}
