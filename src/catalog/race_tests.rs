//! Tests of statements that meet: two processes start at a barrier, a hundred times, and the rows must be as if one had
//! come after the other.

use super::testing::{self, measurement, publish};
use super::*;
use crate::domain::Quantity;
use crate::store::Digest;
use std::time::Duration;
use tokio::sync::Barrier;
use tokio::time::sleep;

const LEASE: Duration = Duration::from_mins(1);
const ROUNDS: u32 = 100;

/// Opens a catalog twice on each kind of database, as two processes would.
async fn pairs() -> Vec<([Catalog; 2], testing::Guard)> {
    let mut pairs = Vec::new();
    for (place, guard) in testing::places().await {
        let first = Catalog::migrate(&place, false).await.unwrap().0;
        pairs.push(([first, Catalog::migrate(&place, false).await.unwrap().0], guard));
    }
    pairs
}

/// Runs two operations at the same time. The second starts up to 1 ms before or after the first, depending on `round`.
async fn meet<A, B>(round: u32, first: impl Future<Output = A>, second: impl Future<Output = B>) -> (A, B) {
    let barrier = Barrier::new(2);
    let late = |delay: i64| Duration::from_micros(delay.max(0) as u64);
    let delay = i64::from(round % 41) * 50 - 1000;
    let first = async {
        barrier.wait().await;
        sleep(late(delay)).await;
        first.await
    };
    let second = async {
        barrier.wait().await;
        sleep(late(-delay)).await;
        second.await
    };
    tokio::join!(first, second)
}

fn job(id: String, measurement: Option<Digest>) -> NewJob {
    let priority = Priority::Usual;
    NewJob { id, frame: "00".to_owned(), level: 1, measurement, priority, share: String::new(), idempotency: None }
}

/// Queues a job that reads no measurement, and claims it for a worker.
async fn claimed(catalog: &Catalog, id: String, lease: Duration) -> Claimed {
    catalog.enqueue(&job(id.clone(), None), 999).await.unwrap();
    let claimed = catalog.claim("first", lease, &[]).await.unwrap().unwrap();
    assert_eq!(claimed.id, id);
    claimed
}

async fn material(catalog: &Catalog, name: &str, lamp: Digest) -> Ended {
    let new = NewMaterial {
        id: Digest::of(name.as_bytes()),
        payload: Digest::of(b"payload"),
        quantity: Quantity::Edf,
        bytes: 10,
        name: Some(name.to_owned()),
        tags: vec!["office".to_owned()],
        measurements: vec![lamp],
        document: serde_json::Map::new(),
    };
    let claim = publish(catalog, new.id, new.bytes).await;
    Ended::Material(Box::new(new), claim)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_is_claimed_by_one_worker() {
    for ([a, b], _guard) in pairs().await {
        for round in 0..ROUNDS {
            a.enqueue(&job(format!("{round}"), None), 999).await.unwrap();
            let (first, second) = meet(round, a.claim("a", LEASE, &[]), b.claim("b", LEASE, &[])).await;
            let claims: Vec<_> = [first.unwrap(), second.unwrap()].into_iter().flatten().collect();
            assert_eq!(claims.len(), 1, "round {round}");
            assert_eq!(a.end(&claims[0], &Ended::Cancelled).await.unwrap(), Ending::Now(JobState::Cancelled));
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_end_and_a_reap_of_the_same_job_exclude_each_other() {
    for ([a, b], _guard) in pairs().await {
        for round in 0..ROUNDS {
            let old = claimed(&a, format!("{round}"), Duration::ZERO).await;
            let failed = Ended::Failed("{}".to_owned());
            let (ended, reaped) = meet(round, a.end(&old, &failed), b.reap(&[], true, 99, "{}")).await;
            let state = a.job(&old.id).await.unwrap().unwrap().state;
            match (ended.unwrap(), reaped.unwrap().len()) {
                (Ending::Now(JobState::Failed), 0) => assert_eq!(state, JobState::Failed, "round {round}"),
                (Ending::Lost, 1) => {
                    assert_eq!(state, JobState::Queued, "round {round}");
                    let new = b.claim("b", LEASE, &[]).await.unwrap().unwrap();
                    assert_eq!(a.end(&old, &failed).await.unwrap(), Ending::Lost, "a stale owner");
                    assert_eq!(b.end(&new, &failed).await.unwrap(), Ending::Now(JobState::Failed));
                }
                other => panic!("round {round}: {other:?}"),
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cancel_is_not_lost_to_a_retry() {
    for ([a, b], _guard) in pairs().await {
        for round in 0..ROUNDS {
            let running = claimed(&a, format!("{round}"), LEASE).await;
            let again = Ended::Retry { problem: "{}".to_owned(), delay: LEASE, attempts: 9 };
            let (ended, cancelled) = meet(round, a.end(&running, &again), b.cancel(&running.id)).await;
            ended.unwrap();
            cancelled.unwrap();
            let row = a.job(&running.id).await.unwrap().unwrap();
            assert_eq!(row.state, JobState::Cancelled, "round {round}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn one_key_is_one_job() {
    for ([a, b], _guard) in pairs().await {
        for round in 0..ROUNDS {
            let key = Some((format!("key {round}"), Digest::of(b"body")));
            let keyed = |id: &str| NewJob { idempotency: key.clone(), ..job(format!("{round} {id}"), None) };
            let (of_a, of_b) = (keyed("a"), keyed("b"));
            let (first, second) = meet(round, a.enqueue(&of_a, 999), b.enqueue(&of_b, 999)).await;
            let ids: Vec<String> = [first.unwrap(), second.unwrap()]
                .into_iter()
                .map(|enqueued| match enqueued {
                    Enqueued::New(row) | Enqueued::Known(row) => row.id,
                    other => panic!("round {round}: {other:?}"),
                })
                .collect();
            assert_eq!(ids[0], ids[1], "round {round}");
        }
        assert_eq!(testing::count(&a, "jobs").await, i64::from(ROUNDS));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_queued_job_has_its_measurement() {
    for ([a, b], _guard) in pairs().await {
        for round in 0..ROUNDS {
            let lamp = measurement(&format!("lamp {round}"));
            testing::add(&a, &lamp).await;
            let new = job(format!("{round}"), Some(lamp.id));
            let (queued, deleted) = meet(round, a.enqueue(&new, 999), b.delete_measurement(lamp.id)).await;
            let is_there = a.measurement(lamp.id).await.unwrap().is_some();
            match (queued.unwrap(), deleted.unwrap()) {
                (Enqueued::New(_), Deleted::InUse(_)) => assert!(is_there, "round {round}"),
                (Enqueued::NoMeasurement, Deleted::Done) => assert!(!is_there, "round {round}"),
                other => panic!("round {round}: {other:?}"),
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_joined_measurement_has_its_spectrum() {
    for ([a, b], _guard) in pairs().await {
        for round in 0..ROUNDS {
            let spectrum = measurement(&format!("spectrum {round}"));
            testing::add(&a, &spectrum).await;
            let joined = NewMeasurement { spectrum: Some(spectrum.id), ..measurement(&format!("lamp {round}")) };
            let claim = publish(&a, joined.content, joined.bytes).await;
            let adding = async {
                // As a publisher does: refused for an unknown reason, it publishes and tries again.
                match a.add_measurement(&joined, &claim).await.unwrap() {
                    Added::Unpublished => {
                        let claim = publish(&a, joined.content, joined.bytes).await;
                        a.add_measurement(&joined, &claim).await.unwrap()
                    }
                    added => added,
                }
            };
            let (added, deleted) = meet(round, adding, b.delete_measurement(spectrum.id)).await;
            let is_there = a.measurement(spectrum.id).await.unwrap().is_some();
            match (added, deleted.unwrap()) {
                (Added::Row(..), Deleted::InUse(_)) => assert!(is_there, "round {round}"),
                (Added::NoSpectrum, Deleted::Done) => assert!(!is_there, "round {round}"),
                other => panic!("round {round}: {other:?}"),
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn materials_that_are_made_twice_or_deleted_leave_no_rows_behind() {
    for ([a, b], _guard) in pairs().await {
        let lamp = measurement("lamp");
        for round in 0..ROUNDS {
            testing::add(&a, &lamp).await;
            let mut ends = Vec::new();
            for (catalog, name) in [(&a, "a"), (&b, "b")] {
                catalog.enqueue(&job(format!("{round} {name}"), Some(lamp.id)), 999).await.unwrap();
                let claimed = catalog.claim(name, LEASE, &[]).await.unwrap().unwrap();
                ends.push((claimed, material(catalog, &format!("material {}", round % 3), lamp.id).await));
            }
            let id = Digest::of(format!("material {}", round % 3).as_bytes());
            let ((first, second), deleted) = meet(
                round,
                Box::pin(meet(round / 7, a.end(&ends[0].0, &ends[0].1), b.end(&ends[1].0, &ends[1].1))),
                b.delete_material(id),
            )
            .await;
            // A claim whose object was doomed meanwhile is taken again by a real worker; here both hold.
            assert_eq!(first.unwrap(), Ending::Now(JobState::Succeeded), "round {round}");
            assert_eq!(second.unwrap(), Ending::Now(JobState::Succeeded), "round {round}");
            deleted.unwrap();
            a.delete_material(id).await.unwrap();
            assert_eq!(b.delete_measurement(lamp.id).await.unwrap(), Deleted::Done, "round {round}");
        }
        for table in ["materials", "material_sources", "material_tags", "measurements", "intents"] {
            assert_eq!(testing::count(&a, table).await, 0, "{table}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_digest_is_named_or_doomed_and_never_both() {
    for ([a, b], _guard) in pairs().await {
        let lamp = measurement("lamp");
        let (mut named, mut doomed) = (0, 0);
        for round in 0..ROUNDS {
            testing::add(&a, &lamp).await;
            a.delete_measurement(lamp.id).await.unwrap();
            let known = Claim::Known(lamp.content);
            let (added, doom) =
                meet(round, a.add_measurement(&lamp, &known), b.doom_unnamed(lamp.content, LEASE)).await;
            let stored = a.blob(lamp.content).await.unwrap();
            match (added.unwrap(), doom.unwrap()) {
                (Added::Row(..), Doom::Named) => {
                    named += 1;
                    assert!(stored.is_some(), "round {round}");
                }
                (Added::Unpublished, Doom::Doomed(_)) => {
                    doomed += 1;
                    assert!(stored.is_none(), "round {round}");
                }
                other => panic!("round {round}: {other:?}"),
            }
            a.delete_measurement(lamp.id).await.unwrap();
            a.doom_unnamed(lamp.content, LEASE).await.unwrap();
        }
        println!("{:?}: {named} named first, {doomed} doomed first", a.dialect());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_digest_that_loses_its_last_name_while_it_is_examined_is_examined_again() {
    for ([a, b], _guard) in pairs().await {
        let lamp = measurement("lamp");
        for round in 0..ROUNDS {
            testing::add(&a, &lamp).await;
            a.list_unnamed(lamp.content).await.unwrap();
            let (deleted, doom) = meet(round, a.delete_measurement(lamp.id), b.doom_unnamed(lamp.content, LEASE)).await;
            assert_eq!(deleted.unwrap(), Deleted::Done, "round {round}");
            let is_stored = a.blob(lamp.content).await.unwrap().is_some();
            assert_eq!(doom.unwrap() == Doom::Named, is_stored, "round {round}");
            assert_eq!(a.is_unnamed(lamp.content).await.unwrap(), is_stored, "round {round}");
            a.doom_unnamed(lamp.content, LEASE).await.unwrap();
        }
    }
}
