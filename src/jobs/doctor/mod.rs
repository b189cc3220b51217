//! Examination of a site before or beside a running service: database, store and local disk, each with a verdict and a
//! remedy. It creates no data directory, no catalog and no schema.

mod asked;
mod database;
mod finding;
mod local;
mod store;

pub(crate) use finding::{Finding, Verdict};

use super::config::WorkConfig;
use super::site::Site;
use crate::catalog::Database;
use crate::store::Place;
use asked::{Asked, PATIENCE};
use local::Disks;
use std::path::PathBuf;
use store::{Found, Stored};
use tokio::task::spawn_blocking;
use tokio::time::timeout;

/// Data directory, database and store of a service, as `wavelume doctor` finds them.
struct Layout {
    root: PathBuf,
    database: Database,
    /// True if the catalog is a SQLite file that does not exist yet.
    is_missing: bool,
    store: Place,
    found: Found,
}

impl Layout {
    /// Finds data directory, database and store of a service, without creating them. Blocks the thread.
    fn of(site: &Site) -> Self {
        // A missing directory has no other name.
        let root = site.data.canonicalize().unwrap_or_else(|_| site.data.clone());
        let (database, store) = (site.database(&root), site.store(&root));
        let is_missing = database.file().is_some_and(|file| !file.exists());
        Self { is_missing, found: Found::at(&store), root, database, store }
    }
}

/// Examines the machine, the database and the store of a service. `processes` is the number of nodes and workers that
/// share the database; `umask` has the permissions that nobody but the owner shall have on data.
pub(crate) async fn examine(config: &WorkConfig, processes: u32, umask: u32) -> Vec<Finding> {
    let (site, upload) = (config.site.clone(), config.limits.upload_bytes);
    let Some(layout) = patiently(move || Layout::of(&site)).await else { return vec![silent(config)] };
    let Layout { root, database, is_missing, store, found } = layout;
    let (asked, stored) = tokio::join!(Asked::of(&database, is_missing), Stored::of(found));
    let mut findings = database::judge(&database, &asked, processes);
    findings.extend(stored.judge(&store, &database, &asked));
    let disks = Disks::of(&root, &database, &store, upload, umask);
    findings.extend(patiently(move || disks.judge()).await.unwrap_or_else(|| vec![silent(config)]));
    findings
}

/// Runs blocking calls to the file system; `None` if they do not end in time, as on a network file system whose server
/// is away.
async fn patiently<T: Send + 'static>(calls: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    timeout(PATIENCE, spawn_blocking(calls)).await.ok()?.ok()
}

fn silent(config: &WorkConfig) -> Finding {
    Finding::fault(
        "local disk",
        format!("the file system of {} gave no answer within {} s", config.site.data.display(), PATIENCE.as_secs()),
        "check the disk, or the server behind it",
    )
}
