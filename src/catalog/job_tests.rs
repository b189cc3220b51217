//! Tests of the queue: claims, ends, cancels and what keeps a measurement.

use super::testing::{self, add, measurement};
use super::*;
use crate::domain::Quantity;
use crate::store::Digest;
use std::time::Duration;

const LEASE: Duration = Duration::from_mins(1);

fn job(id: &str) -> NewJob {
    NewJob {
        id: id.to_owned(),
        frame: "00".to_owned(),
        level: 1,
        measurement: Some(Digest::of(b"lamp")),
        priority: Priority::Usual,
        share: "somebody".to_owned(),
        idempotency: None,
    }
}

/// Opens a new catalog on each kind of database (SQLite and PostgreSQL), with the measurement of one lamp in each.
async fn with_lamp() -> Vec<(Catalog, testing::Guard)> {
    let catalogs = testing::catalogs().await;
    for (catalog, _) in &catalogs {
        add(catalog, &measurement("lamp")).await;
    }
    catalogs
}

async fn claim(catalog: &Catalog, worker: &str, lease: Duration) -> Option<Claimed> {
    catalog.claim(worker, lease, &[]).await.unwrap()
}

/// Announces the file of a material to the catalog, and builds the outcome of a job attempt that made the material.
async fn made(catalog: &Catalog, material: Box<NewMaterial>) -> Ended {
    let claim = testing::publish(catalog, material.id, material.bytes).await;
    Ended::Material(material, claim)
}

async fn state_of(catalog: &Catalog, id: &str) -> JobState {
    catalog.job(id).await.unwrap().unwrap().state
}

fn material(name: &str) -> Box<NewMaterial> {
    Box::new(NewMaterial {
        id: Digest::of(name.as_bytes()),
        payload: Digest::of(b"payload"),
        quantity: Quantity::Edf,
        bytes: 10,
        name: Some(name.to_owned()),
        tags: vec!["office".to_owned()],
        measurements: vec![Digest::of(b"lamp")],
        document: serde_json::Map::new(),
    })
}

#[tokio::test]
async fn the_same_key_and_body_are_the_same_job() {
    for (catalog, _guard) in with_lamp().await {
        let keyed = |id: &str, body: &str| NewJob {
            idempotency: Some(("key".to_owned(), Digest::of(body.as_bytes()))),
            ..job(id)
        };
        assert!(matches!(catalog.enqueue(&keyed("1", "a"), 9).await.unwrap(), Enqueued::New(_)));
        let Enqueued::Known(known) = catalog.enqueue(&keyed("2", "a"), 9).await.unwrap() else { panic!() };
        assert_eq!(known.id, "1");
        assert!(matches!(catalog.enqueue(&keyed("3", "b"), 9).await.unwrap(), Enqueued::KeyTaken));
    }
}

#[tokio::test]
async fn a_full_queue_and_an_unknown_measurement_are_refused() {
    for (catalog, _guard) in with_lamp().await {
        assert!(matches!(catalog.enqueue(&job("1"), 1).await.unwrap(), Enqueued::New(_)));
        assert!(matches!(catalog.enqueue(&job("2"), 1).await.unwrap(), Enqueued::Full));
        let lost = NewJob { measurement: Some(Digest::of(b"?")), ..job("3") };
        assert!(matches!(catalog.enqueue(&lost, 9).await.unwrap(), Enqueued::NoMeasurement));
    }
}

#[tokio::test]
async fn a_late_worker_changes_nothing() {
    for (catalog, _guard) in with_lamp().await {
        catalog.enqueue(&job("1"), 9).await.unwrap();
        let late = claim(&catalog, "slow", Duration::ZERO).await.unwrap();
        assert!(claim(&catalog, "other", LEASE).await.is_none(), "claimed once");
        assert_eq!(catalog.reap(&[], true, 3, "{}").await.unwrap(), ["1"]);
        let current = claim(&catalog, "other", LEASE).await.unwrap();
        assert!(current.epoch > late.epoch && current.attempts == 1);
        assert_eq!(catalog.beat(&late, 0.5, LEASE).await.unwrap(), Beat::Lost);
        let ended = made(&catalog, material("late")).await;
        assert_eq!(catalog.end(&late, &ended).await.unwrap(), Ending::Lost);
        assert!(catalog.material(Digest::of(b"late")).await.unwrap().is_none());
        let ended = made(&catalog, material("good")).await;
        assert_eq!(catalog.end(&current, &ended).await.unwrap(), Ending::Now(JobState::Succeeded));
        assert_eq!(catalog.job("1").await.unwrap().unwrap().material, Some(Digest::of(b"good")));
        assert_eq!(catalog.end(&current, &ended).await.unwrap(), Ending::Lost, "ended once");
    }
}

#[tokio::test]
async fn attempts_run_out() {
    for (catalog, _guard) in with_lamp().await {
        catalog.enqueue(&job("1"), 9).await.unwrap();
        let again = Ended::Retry { problem: "{}".to_owned(), delay: Duration::ZERO, attempts: 2 };
        let first = claim(&catalog, "w", LEASE).await.unwrap();
        assert_eq!(catalog.end(&first, &again).await.unwrap(), Ending::Now(JobState::Queued));
        let second = claim(&catalog, "w", LEASE).await.unwrap();
        assert_eq!(catalog.end(&second, &again).await.unwrap(), Ending::Now(JobState::Dead));

        catalog.enqueue(&job("2"), 9).await.unwrap();
        claim(&catalog, "gone", LEASE).await.unwrap();
        assert!(catalog.reap(&["another".to_owned()], true, 1, "{}").await.unwrap().is_empty());
        assert_eq!(catalog.reap(&["gone".to_owned()], false, 1, "{\"why\":1}").await.unwrap(), ["2"]);
        let dead = catalog.job("2").await.unwrap().unwrap();
        assert_eq!((dead.state, dead.problem.as_deref()), (JobState::Dead, Some("{\"why\":1}")));
    }
}

#[tokio::test]
async fn a_delay_is_waited_for_and_a_released_attempt_does_not_count() {
    for (catalog, _guard) in with_lamp().await {
        catalog.enqueue(&job("1"), 9).await.unwrap();
        let claimed = claim(&catalog, "w", LEASE).await.unwrap();
        catalog.end(&claimed, &Ended::Released).await.unwrap();
        let claimed = claim(&catalog, "w", LEASE).await.unwrap();
        assert_eq!(claimed.attempts, 1);
        let later = Ended::Retry { problem: "{}".to_owned(), delay: LEASE, attempts: 9 };
        catalog.end(&claimed, &later).await.unwrap();
        assert!(claim(&catalog, "w", LEASE).await.is_none());
    }
}

#[tokio::test]
async fn what_a_worker_leaves_to_others_is_taken_by_them() {
    for (catalog, _guard) in with_lamp().await {
        catalog.enqueue(&job("1"), 9).await.unwrap();
        catalog.enqueue(&job("2"), 9).await.unwrap();
        let but = ["1".to_owned()];
        assert_eq!(catalog.claim("old", LEASE, &but).await.unwrap().unwrap().id, "2");
        assert!(catalog.claim("old", LEASE, &but).await.unwrap().is_none());
        assert_eq!(claim(&catalog, "new", LEASE).await.unwrap().id, "1");
    }
}

#[tokio::test]
async fn an_end_is_refused_once_the_claim_on_its_result_has_run_out() {
    for (catalog, _guard) in with_lamp().await {
        catalog.enqueue(&job("1"), 9).await.unwrap();
        let claimed = claim(&catalog, "w", LEASE).await.unwrap();
        let late = testing::publish(&catalog, Digest::of(b"m"), 10).await;
        testing::expire_intents(&catalog).await;
        let unknown = Claim::Known(Digest::of(b"m"));
        for claim in [late, unknown] {
            for ended in [Ended::Material(material("m"), claim.clone()), Ended::Report(claim.clone())] {
                assert_eq!(catalog.end(&claimed, &ended).await.unwrap(), Ending::Unpublished, "{ended:?}");
                assert_eq!(catalog.namer(Digest::of(b"m")).await.unwrap(), None, "nothing was named");
            }
        }
        let mut ended = Ended::Material(material("m"), Claim::Known(Digest::of(b"m")));
        ended.reclaim(testing::publish(&catalog, Digest::of(b"m"), 10).await);
        assert_eq!(catalog.end(&claimed, &ended).await.unwrap(), Ending::Now(JobState::Succeeded));
    }
}

#[tokio::test]
async fn cancelling_ends_queued_jobs_at_once_and_running_ones_by_their_worker() {
    for (catalog, _guard) in with_lamp().await {
        catalog.enqueue(&job("1"), 9).await.unwrap();
        assert_eq!(catalog.cancel("1").await.unwrap().unwrap().job.state, JobState::Cancelled);
        catalog.enqueue(&job("2"), 9).await.unwrap();
        let claimed = claim(&catalog, "w", LEASE).await.unwrap();
        for is_first in [true, false] {
            let cancelling = catalog.cancel("2").await.unwrap().unwrap();
            assert_eq!((cancelling.job.state, cancelling.is_first), (JobState::Running, is_first));
        }
        assert_eq!(catalog.beat(&claimed, 0.1, LEASE).await.unwrap(), Beat::Cancel);
        catalog.end(&claimed, &Ended::Released).await.unwrap();
        assert_eq!(state_of(&catalog, "2").await, JobState::Cancelled);
        assert!(catalog.cancel("3").await.unwrap().is_none());
    }
}

#[tokio::test]
async fn a_report_is_named_by_its_job_until_that_is_forgotten() {
    for (catalog, _guard) in with_lamp().await {
        let report = Digest::of(b"report");
        catalog.enqueue(&NewJob { measurement: None, ..job("1") }, 9).await.unwrap();
        let claimed = claim(&catalog, "w", LEASE).await.unwrap();
        let ended = Ended::Report(testing::publish(&catalog, report, 6).await);
        assert_eq!(catalog.namer(report).await.unwrap(), None);
        assert_eq!(catalog.end(&claimed, &ended).await.unwrap(), Ending::Now(JobState::Succeeded));
        let row = catalog.job("1").await.unwrap().unwrap();
        assert_eq!((row.measurement, row.material, row.report), (None, None, Some(report)));
        assert_eq!(catalog.namer(report).await.unwrap(), Some(Namer::Report));
        assert_eq!(catalog.named_by(report).await.unwrap().as_deref(), Some("job 1"));
        let long = Retention { succeeded: LEASE, failed: LEASE, keys: LEASE, acts: LEASE };
        assert_eq!(catalog.forget(&long).await.unwrap(), 0);
        tokio::time::sleep(Duration::from_millis(20)).await;
        let short = Retention { succeeded: Duration::ZERO, ..long };
        assert_eq!(catalog.forget(&short).await.unwrap(), 1);
        assert!(catalog.job("1").await.unwrap().is_none());
        assert_eq!(catalog.doom_unnamed(report, LEASE).await.unwrap(), Doom::Doomed(6));
    }
}

#[tokio::test]
async fn shares_of_the_queue_take_turns() {
    for (catalog, _guard) in with_lamp().await {
        for number in 0..20 {
            catalog.enqueue(&job(&format!("flood {number:02}")), 99).await.unwrap();
        }
        let mut order = Vec::new();
        for _ in 0..2 {
            order.push(claim(&catalog, "w", LEASE).await.unwrap());
        }
        for number in 0..3 {
            let other = NewJob { share: "another".to_owned(), ..job(&format!("other {number}")) };
            catalog.enqueue(&other, 99).await.unwrap();
        }
        for _ in 0..7 {
            order.push(claim(&catalog, "w", LEASE).await.unwrap());
        }
        let ids: Vec<&str> = order.iter().map(|job| job.id.as_str()).collect();
        let place = |id: &str| ids.iter().position(|found| *found == id).unwrap();
        assert_eq!(ids[..2], ["flood 00", "flood 01"]);
        assert_eq!(place("other 0"), 2, "the newcomer is next: {ids:?}");
        assert!(place("other 1") <= 4 && place("other 2") <= 6, "and then they alternate: {ids:?}");
    }
}

#[tokio::test]
async fn a_share_that_queues_its_next_job_while_the_last_one_runs_takes_no_more_turns_than_others() {
    for (catalog, _guard) in with_lamp().await {
        let queue = async |share: &str, number: usize| {
            let new = NewJob { share: share.to_owned(), ..job(&format!("{share} {number}")) };
            assert!(matches!(catalog.enqueue(&new, 99).await.unwrap(), Enqueued::New(_)));
        };
        for number in 0..4 {
            queue("backlog", number).await;
        }
        let mut running = vec![claim(&catalog, "w", LEASE).await.unwrap()];
        queue("eager", 0).await;
        let mut eager = 0;
        for number in 1..=6 {
            let ended = running.pop().unwrap();
            catalog.end(&ended, &Ended::Failed("{}".to_owned())).await.unwrap();
            let next = claim(&catalog, "w", LEASE).await.unwrap();
            if next.id.starts_with("eager") {
                eager += 1;
                queue("eager", number).await;
            }
            running.push(next);
        }
        assert_eq!(eager, 3, "of 6 turns");
    }
}

#[tokio::test]
async fn a_share_does_not_wait_for_what_it_ran_on_idle_workers() {
    for (catalog, _guard) in with_lamp().await {
        let queue = async |share: &str, number: usize| {
            let new = NewJob { share: share.to_owned(), ..job(&format!("{share} {number}")) };
            assert!(matches!(catalog.enqueue(&new, 99).await.unwrap(), Enqueued::New(_)));
        };
        queue("long", 0).await;
        claim(&catalog, "w", LEASE).await.unwrap();
        for number in 0..9 {
            queue("busy", number).await;
            let ended = claim(&catalog, "v", LEASE).await.unwrap();
            catalog.end(&ended, &Ended::Failed("{}".to_owned())).await.unwrap();
        }
        for number in 0..9 {
            queue("late", number).await;
        }
        queue("busy", 9).await;
        let mut before = 0;
        while claim(&catalog, "v", LEASE).await.unwrap().id != "busy 9" {
            before += 1;
        }
        assert!(before <= 2, "{before} jobs of the late share");
    }
}

#[tokio::test]
async fn a_share_does_not_wait_for_jobs_that_it_has_cancelled() {
    for (catalog, _guard) in with_lamp().await {
        let queue = async |share: &str, id: &str| {
            let new = NewJob { share: share.to_owned(), ..job(id) };
            assert!(matches!(catalog.enqueue(&new, 99).await.unwrap(), Enqueued::New(_)));
        };
        for id in ["other 0", "other 1", "other 2", "other 3"] {
            queue("other", id).await;
        }
        claim(&catalog, "w", LEASE).await.unwrap();
        for id in ["wrong 0", "wrong 1", "wrong 2", "wrong 3", "wrong 4"] {
            queue("mine", id).await;
        }
        for id in ["wrong 0", "wrong 1", "wrong 2", "wrong 3", "wrong 4"] {
            for is_first in [true, false] {
                let cancelling = catalog.cancel(id).await.unwrap().unwrap();
                assert_eq!(
                    (cancelling.job.state, cancelling.is_first),
                    (JobState::Cancelled, is_first),
                    "twice is once"
                );
            }
        }
        queue("mine", "right").await;
        assert_eq!(claim(&catalog, "w", LEASE).await.unwrap().id, "right");
    }
}

#[tokio::test]
async fn measurements_stay_while_work_or_materials_stand_on_them() {
    for (catalog, _guard) in with_lamp().await {
        let lamp = Digest::of(b"lamp");
        catalog.enqueue(&job("1"), 9).await.unwrap();
        assert!(matches!(catalog.delete_measurement(lamp).await.unwrap(), Deleted::InUse(_)));
        let claimed = claim(&catalog, "w", LEASE).await.unwrap();
        let ended = made(&catalog, material("m")).await;
        catalog.end(&claimed, &ended).await.unwrap();
        assert!(matches!(catalog.delete_measurement(lamp).await.unwrap(), Deleted::InUse(_)));
        let listed = |filter: MaterialFilter| {
            let catalog = catalog.clone();
            async move { catalog.materials(&filter, None, 9).await.unwrap().items.len() }
        };
        assert_eq!(listed(MaterialFilter { tag: Some("office".to_owned()), ..MaterialFilter::default() }).await, 1);
        assert_eq!(listed(MaterialFilter { tag: Some("home".to_owned()), ..MaterialFilter::default() }).await, 0);
        assert_eq!(listed(MaterialFilter { measurement: Some(lamp), ..MaterialFilter::default() }).await, 1);
        assert_eq!(listed(MaterialFilter { q: Some("OFF".to_owned()), ..MaterialFilter::default() }).await, 1);
        assert_eq!(catalog.delete_material(Digest::of(b"m")).await.unwrap(), Deleted::Done);
        assert_eq!(catalog.delete_material(Digest::of(b"m")).await.unwrap(), Deleted::Absent);
        assert_eq!(catalog.delete_measurement(lamp).await.unwrap(), Deleted::Done);
    }
}

#[tokio::test]
async fn a_failed_job_is_queued_again_unless_its_measurement_is_gone() {
    for (catalog, _guard) in testing::catalogs().await {
        testing::add(&catalog, &testing::measurement("lamp")).await;
        catalog.enqueue(&job("1"), 99).await.unwrap();
        assert!(matches!(catalog.retry("1", 99).await.unwrap(), Retried::Unended(JobState::Queued)));
        let job = catalog.claim("w", LEASE, &[]).await.unwrap().unwrap();
        catalog.end(&job, &Ended::Failed("{}".to_owned())).await.unwrap();
        let Retried::Queued(row) = catalog.retry("1", 99).await.unwrap() else { panic!() };
        assert_eq!((row.state, row.attempts, row.problem), (JobState::Queued, 0, None));
        let again = catalog.claim("w", LEASE, &[]).await.unwrap().unwrap();
        assert!(again.epoch > job.epoch);
        catalog.end(&again, &Ended::Failed("{}".to_owned())).await.unwrap();
        catalog.delete_measurement(Digest::of(b"lamp")).await.unwrap();
        assert!(matches!(catalog.retry("1", 99).await.unwrap(), Retried::NoMeasurement));
        assert!(matches!(catalog.retry("2", 99).await.unwrap(), Retried::Absent));
    }
}

#[tokio::test]
async fn a_job_that_is_queued_again_waits_behind_others_and_within_the_limits() {
    for (catalog, _guard) in with_lamp().await {
        let limit = |most| TenantChange { queued: Some(Limit(most)), ..TenantChange::default() };
        for id in ["1", "2", "3"] {
            catalog.enqueue(&job(id), 3).await.unwrap();
        }
        for id in ["1", "2"] {
            let failed = claim(&catalog, "w", LEASE).await.unwrap();
            assert_eq!(failed.id, id);
            catalog.end(&failed, &Ended::Failed("{}".to_owned())).await.unwrap();
        }
        catalog.enqueue(&NewJob { share: "another".to_owned(), ..job("4") }, 3).await.unwrap();
        assert!(matches!(catalog.retry("1", 2).await.unwrap(), Retried::Full));
        catalog.change_tenant(catalog.tenant(), &limit(Some(3))).await.unwrap();
        assert!(matches!(catalog.retry("1", 9).await.unwrap(), Retried::Queued(_)));
        let Retried::Over(over) = catalog.retry("2", 9).await.unwrap() else { panic!() };
        assert_eq!(over, OverQuota { what: Limited::Queued, limit: 3, used: 3, added: 1 });
        assert_eq!(state_of(&catalog, "2").await, JobState::Failed);
        catalog.change_tenant(catalog.tenant(), &limit(None)).await.unwrap();
        let mut started = Vec::new();
        while let Some(job) = claim(&catalog, "w", LEASE).await {
            started.push(job.id);
        }
        assert_eq!(started, ["3", "4", "1"], "not in its old place, before all others");
    }
}

#[tokio::test]
async fn jobs_are_listed_by_state_and_measurement_and_seen_together() {
    for (catalog, _guard) in testing::catalogs().await {
        testing::add(&catalog, &testing::measurement("lamp")).await;
        for id in ["a", "b", "c", "d"] {
            catalog.enqueue(&job(id), 99).await.unwrap();
        }
        catalog.claim("w", LEASE, &[]).await.unwrap().unwrap();
        let listed = async |filter: JobFilter| {
            let page = catalog.jobs(&filter, None, 9).await.unwrap();
            page.items.into_iter().map(|row| row.id).collect::<Vec<_>>()
        };
        assert_eq!(listed(JobFilter::default()).await.len(), 4);
        assert_eq!(listed(JobFilter { state: Some(JobState::Running), ..JobFilter::default() }).await, ["a"]);
        let other = JobFilter { measurement: Some(Digest::of(b"other")), ..JobFilter::default() };
        assert!(listed(other).await.is_empty());
        let (mut ids, mut cursor) = (Vec::new(), None);
        loop {
            let page = catalog.jobs(&JobFilter::default(), cursor, 3).await.unwrap();
            ids.extend(page.items.into_iter().map(|row| row.id));
            cursor = page.next;
            if cursor.is_none() {
                break;
            }
        }
        ids.sort();
        assert_eq!(ids, ["a", "b", "c", "d"]);
        let wanted = ["a".to_owned(), "d".to_owned(), "absent".to_owned()];
        catalog.watch(&wanted, LEASE).await.unwrap();
        let mut seen = catalog.seen(&wanted).await.unwrap();
        seen.sort_by(|a, b| a.id.cmp(&b.id));
        let states: Vec<_> = seen.iter().map(|seen| (seen.id.as_str(), seen.state)).collect();
        assert_eq!(states, [("a", JobState::Running), ("d", JobState::Queued)]);
    }
}

#[tokio::test]
async fn jobs_are_started_by_priority_and_clients_take_turns_within_one() {
    for (catalog, _guard) in with_lamp().await {
        let queue = async |id: &str, share: &str, priority: Priority| {
            let new = NewJob { priority, share: share.to_owned(), ..job(id) };
            let Enqueued::New(row) = catalog.enqueue(&new, 99).await.unwrap() else { panic!("{id}") };
            assert_eq!(row.priority, priority);
        };
        for number in 0..4 {
            queue(&format!("batch {number} of a"), "a", Priority::Batch).await;
        }
        queue("batch of b", "b", Priority::Batch).await;
        for number in 0..3 {
            queue(&format!("usual {number} of b"), "b", Priority::Usual).await;
        }
        // The batch of this client has not taken its turns among the usual jobs.
        queue("usual of a", "a", Priority::Usual).await;
        queue("urgent", "a", Priority::Urgent).await;
        let mut started = Vec::new();
        while let Some(job) = claim(&catalog, "w", LEASE).await {
            started.push(job.id.clone());
            assert_eq!(catalog.end(&job, &Ended::Cancelled).await.unwrap(), Ending::Now(JobState::Cancelled));
        }
        let expected = [
            "urgent",
            "usual 0 of b",
            "usual of a",
            "usual 1 of b",
            "usual 2 of b",
            "batch 0 of a",
            "batch of b",
            "batch 1 of a",
            "batch 2 of a",
            "batch 3 of a",
        ];
        assert_eq!(started, expected);
    }
}

#[tokio::test]
async fn batch_jobs_that_have_waited_for_long_take_turns_with_usual_ones() {
    let hour = Duration::from_hours(1);
    for (catalog, _guard) in with_lamp().await {
        let queue = async |id: String, share: &str, priority: Priority| {
            let new = NewJob { priority, share: share.to_owned(), ..job(&id) };
            assert!(matches!(catalog.enqueue(&new, 99).await.unwrap(), Enqueued::New(_)));
        };
        for number in 0..3 {
            queue(format!("old {number}"), "a", Priority::Batch).await;
        }
        assert_eq!(catalog.age(hour).await.unwrap(), 0);
        sqlx::query("UPDATE jobs SET not_before = not_before - 3600000").execute(&catalog.pool).await.unwrap();
        queue("new".to_owned(), "c", Priority::Batch).await;
        for number in 0..3 {
            queue(format!("usual {number}"), "b", Priority::Usual).await;
        }
        let both = tokio::join!(catalog.age(hour), catalog.age(hour));
        assert_eq!(both.0.unwrap() + both.1.unwrap(), 3, "two processes age each job once");
        assert_eq!(catalog.job("old 2").await.unwrap().unwrap().priority, Priority::Usual);
        let mut started = Vec::new();
        while let Some(job) = claim(&catalog, "w", LEASE).await {
            started.push(job.id.clone());
            assert_eq!(catalog.end(&job, &Ended::Cancelled).await.unwrap(), Ending::Now(JobState::Cancelled));
        }
        // In turn, whichever of the two clients is first.
        let kinds: Vec<&str> = started.iter().map(|id| id.split(' ').next().unwrap()).collect();
        assert!(kinds[..2].contains(&"old") && kinds[..2].contains(&"usual"), "{started:?}");
        assert!(kinds[2..4].contains(&"old") && kinds[2..4].contains(&"usual"), "{started:?}");
        assert_eq!((started.len(), started.last().unwrap().as_str()), (7, "new"));
    }
}

#[tokio::test]
async fn batch_jobs_that_age_one_by_one_take_no_more_turns_than_usual_ones() {
    let hour = Duration::from_hours(1);
    for (catalog, _guard) in with_lamp().await {
        let queue = async |id: String, share: &str, priority: Priority| {
            let new = NewJob { priority, share: share.to_owned(), ..job(&id) };
            assert!(matches!(catalog.enqueue(&new, 99).await.unwrap(), Enqueued::New(_)));
        };
        for number in 0..4 {
            queue(format!("old {number}"), "a", Priority::Batch).await;
            sqlx::query("UPDATE jobs SET not_before = not_before - 3600000").execute(&catalog.pool).await.unwrap();
            assert_eq!(catalog.age(hour).await.unwrap(), 1);
        }
        for number in 0..4 {
            queue(format!("usual {number}"), "b", Priority::Usual).await;
        }
        let mut usual = 0;
        for _ in 0..4 {
            let job = claim(&catalog, "w", LEASE).await.unwrap();
            usual += usize::from(job.id.starts_with("usual"));
            catalog.end(&job, &Ended::Cancelled).await.unwrap();
        }
        assert_eq!(usual, 2, "of 4 turns");
    }
}
