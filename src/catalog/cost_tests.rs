//! Cost of the statements that each job runs on PostgreSQL: CPU time of the server's processes and bytes of its log.

use super::testing::{self, measurement, publish};
use super::*;
use crate::domain::Quantity;
use crate::store::{Digest, Object};
use sqlx::Row;
use std::time::{Duration, Instant};

/// Duration of leases and announcements in the measurement, which ends earlier even on a busy machine.
const HOUR: Duration = Duration::from_hours(1);

/// Numbers of jobs and materials in the catalog before the first statement whose cost is measured.
const JOBS: u32 = 100_000;
const MATERIALS: u32 = 10_000;

/// Clock ticks of Linux in a second, the unit of CPU times in `/proc`.
const TICKS: f64 = 100.0;

/// Returns the CPU time in s that the processes of the PostgreSQL server have used, and the length in bytes of its
/// write-ahead log. The server must run on this machine. Processes that come and go to clean tables do not count.
async fn spent(catalog: &Catalog) -> (f64, i64) {
    let mut ticks = 0.0;
    let pids = sqlx::query("SELECT pid FROM pg_stat_activity WHERE backend_type NOT LIKE 'autovacuum%'")
        .fetch_all(&catalog.pool)
        .await
        .unwrap();
    for row in pids {
        let pid: i32 = row.try_get(0).unwrap();
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).expect("the server runs on this machine");
        // After the name in parentheses, which may hold blanks, come the 3rd field and those that follow it.
        let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
        ticks += fields[11].parse::<f64>().unwrap() + fields[12].parse::<f64>().unwrap();
    }
    let log = sqlx::query("SELECT CAST(pg_current_wal_insert_lsn() - '0/0' AS BIGINT)").fetch_one(&catalog.pool).await;
    (ticks / TICKS, log.unwrap().try_get(0).unwrap())
}

/// Awaits an operation `times` times, and prints the mean cost of one time: server CPU time, log bytes and duration.
async fn cost<T>(catalog: &Catalog, name: &str, times: u32, mut operation: impl AsyncFnMut(u32) -> T) -> Vec<T> {
    let (start, (cpu, log)) = (Instant::now(), spent(catalog).await);
    let mut done = Vec::new();
    for round in 0..times {
        done.push(operation(round).await);
    }
    let (wall, (cpu_after, log_after)) = (start.elapsed(), spent(catalog).await);
    let each = |total: f64| total / f64::from(times);
    println!(
        "cost {name} {:.3} ms of CPU, {:.0} B of log, {:.2} ms until the answer",
        1e3 * each(cpu_after - cpu),
        each((log_after - log) as f64),
        1e3 * each(wall.as_secs_f64())
    );
    done
}

#[tokio::test]
#[ignore = "measures times; run by tests/nights/simulation"]
async fn statements_of_a_job() {
    let place = testing::server().await;
    Catalog::migrate(&place, false).await.unwrap().0.close().await;
    testing::fill(&place, JOBS, MATERIALS, "").await;
    let catalog = Catalog::open_few(&place).await.unwrap();
    sqlx::query("VACUUM ANALYZE").execute(&catalog.pool).await.unwrap();
    let lamp = measurement("lamp");
    testing::add(&catalog, &lamp).await;
    let times = 1500;
    let new = |round: u32| NewJob {
        id: uuid::Uuid::now_v7().to_string(),
        frame: "00".repeat(80),
        measurement: Some(lamp.id),
        share: format!("10.0.0.{}", round % 50),
        level: 1,
        priority: Priority::Usual,
        idempotency: Some((format!("key {round}"), Digest::of(b"request"))),
    };
    let material = |round: u32| NewMaterial {
        id: Digest::of(format!("material {round}").as_bytes()),
        payload: Digest::of(b"payload"),
        quantity: Quantity::Edf,
        bytes: 3000,
        name: Some(format!("lamp {round}")),
        tags: vec!["office".to_owned()],
        measurements: vec![lamp.id],
        document: serde_json::Map::from_iter([("manifest".to_owned(), "0123456789abcdef".repeat(150).into())]),
    };
    let queued = cost(&catalog, "enqueue", times, async |round| catalog.enqueue(&new(round), 1_000_000).await.unwrap());
    assert!(queued.await.iter().all(|queued| matches!(queued, Enqueued::New(_))));
    let claimed = cost(&catalog, "claim", times, async |_| catalog.claim("worker", HOUR, &[]).await.unwrap().unwrap());
    let claimed = claimed.await;
    cost(&catalog, "look", times, async |_| catalog.reap(&[], true, 9, "{}").await.unwrap()).await;
    cost(&catalog, "measurement", times, async |_| catalog.measurement(lamp.id).await.unwrap().unwrap()).await;
    cost(&catalog, "beat", times, async |round| catalog.beat(&claimed[round as usize], 0.5, HOUR).await.unwrap()).await;
    let claims = cost(&catalog, "intent", times, async |round| {
        let (id, bytes) = (material(round).id, 3000);
        let object = Object::fresh(catalog.tenant(), id);
        catalog.intend(&object, bytes, HOUR).await.unwrap();
        Claim::Written(object, bytes)
    });
    let claims = claims.await;
    let ended = cost(&catalog, "publish", times, async |round| {
        let ended = Ended::Material(Box::new(material(round)), claims[round as usize].clone());
        catalog.end(&claimed[round as usize], &ended).await.unwrap()
    });
    assert!(ended.await.iter().all(|ended| *ended == Ending::Now(JobState::Succeeded)));
    let claimed = cost(&catalog, "claim", 500, async |_| catalog.claim("worker", HOUR, &[]).await.unwrap().unwrap());
    let claimed = claimed.await;
    cost(&catalog, "end", 500, async |round| {
        let failed = Ended::Failed("{}".to_owned());
        catalog.end(&claimed[round as usize], &failed).await.unwrap()
    })
    .await;
    cost(&catalog, "upload", 500, async |round| {
        let new = measurement(&format!("upload {round}"));
        let claim = publish(&catalog, new.content, new.bytes).await;
        catalog.add_measurement(&new, &claim).await.unwrap()
    })
    .await;
}
