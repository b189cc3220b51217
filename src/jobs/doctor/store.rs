//! Verdicts on the store: reachable, of this catalog, and with every call that the service makes of it.

use super::super::archive::{BACKUP, INSTANCE};
use super::asked::Asked;
use super::finding::Finding;
use crate::catalog::{Database, Examined};
use crate::store::{Place, Probe, Step};

/// Store that `wavelume doctor` is to examine, as it was found before any request.
pub(super) enum Found {
    /// The directory of the store does not exist yet.
    Missing,
    /// The store cannot be used at all.
    Failed(String),
    /// The store was opened; nothing was read from it yet.
    Open(Probe),
}

impl Found {
    /// Looks for a store, without creating its directory. Blocks the thread.
    pub(super) fn at(place: &Place) -> Self {
        if matches!(place, Place::Directory(root) if !root.exists()) {
            return Self::Missing;
        }
        Probe::open(place).map_or_else(|error| Self::Failed(error.to_string()), Self::Open)
    }
}

/// State of a store, as `wavelume doctor` finds it.
pub(super) enum Stored {
    /// The directory of the store does not exist yet.
    Missing,
    /// The store cannot be used at all.
    Failed(String),
    /// The store has given its id and the outcome of each step of the test.
    Answered {
        /// Id of the catalog to which the store belongs, as the store carries it; `None` if it carries none.
        id: Option<String>,
        /// True if the store is the place of a backup.
        is_backup: bool,
        /// Steps of the test of the store, each with its outcome.
        steps: Vec<Step>,
    },
}

impl Stored {
    /// Reads the id of the catalog that a store carries, and tests if objects can be written, read, listed and removed
    /// there.
    pub(super) async fn of(found: Found) -> Self {
        match found {
            Found::Missing => Self::Missing,
            Found::Failed(reason) => Self::Failed(reason),
            Found::Open(probe) => match (probe.note(INSTANCE).await, probe.note(BACKUP).await) {
                (Ok(id), Ok(backup)) => Self::Answered { id, is_backup: backup.is_some(), steps: probe.run().await },
                (Err(reason), _) | (_, Err(reason)) => Self::Failed(reason),
            },
        }
    }

    /// Returns the verdicts on the store at `place`, used with the catalog in the database `database`.
    pub(super) fn judge(&self, place: &Place, database: &Database, asked: &Asked) -> Vec<Finding> {
        let (bond, steps) = match self {
            Self::Missing => {
                return vec![Finding::warning(
                    "store",
                    format!("the store {place} does not exist yet"),
                    "`wavelume serve` and `wavelume worker` create the store; check --data and --store if it should exist",
                )];
            }
            Self::Failed(reason) => {
                let remedy = match place {
                    Place::Directory(_) => "check that this user may read and write the directory",
                    Place::S3 { .. } => {
                        "check --store, AWS_ENDPOINT_URL, AWS_REGION, the AWS_ keys, and that the server runs"
                    }
                };
                return vec![Finding::fault("store", format!("{place}: {reason}"), remedy)];
            }
            Self::Answered { is_backup: true, steps, .. } => (backup(place), steps),
            Self::Answered { id, steps, .. } => (bond(id.as_deref(), database, asked), steps),
        };
        let mut findings = vec![Finding::ok("store", format!("{place} answered")), bond];
        findings.extend(steps.iter().map(|step| {
            let check = format!("store {}", step.name);
            match &step.outcome {
                Ok(found) => Finding::ok(&check, found.clone()),
                Err(reason) => Finding::fault(&check, reason.clone(), right(step.name)),
            }
        }));
        findings
    }
}

/// Returns the advice for the operator on a step that failed in the test of the store.
fn right(step: &str) -> &'static str {
    match step {
        "put" | "multipart" => {
            "let these credentials write objects, in parts too, and check the free space of the store"
        }
        "list" => "let these credentials list the bucket",
        "delete" => "let these credentials delete objects",
        _ => "let these credentials read objects, and check that nothing between changes them",
    }
}

/// Name of the check of `wavelume doctor` that the store belongs to the catalog.
const CHECK: &str = "store instance";

/// Returns the finding of `wavelume doctor` on a store that is the place of a backup.
fn backup(place: &Place) -> Finding {
    Finding::fault(
        CHECK,
        format!("{place} holds a backup"),
        format!("give another --store, and fill it with `wavelume restore {place}`"),
    )
}

/// Compares the id that the store carries with the id of the catalog, and returns the finding of `wavelume doctor`.
fn bond(id: Option<&str>, database: &Database, asked: &Asked) -> Finding {
    let carried = id.map_or_else(|| format!("the store carries no {INSTANCE}"), |id| format!("the store carries {id}"));
    let ours = match asked {
        Asked::Silent | Asked::Failed(_) => {
            return Finding::warning(CHECK, format!("{carried}; not compared"), "mend the database first");
        }
        Asked::Missing => None,
        Asked::Answered(examined) => Some(&**examined),
    };
    if let Some(Examined { is_copy: true, instance: Some(ours), .. }) = ours {
        return Finding::fault(
            CHECK,
            format!("the catalog {database} is a copy of the catalog {ours}; {carried}"),
            format!("give the copy a store of its own, or, if the original is gone for good, use --adopt-store {ours}"),
        );
    }
    let name = ours.and_then(|ours| ours.instance.as_deref());
    match (id, name) {
        (Some(id), Some(name)) if id == name => Finding::ok(CHECK, format!("store and catalog have the id {name}")),
        (Some(id), _) => {
            let name =
                name.map_or_else(|| "has a catalog without an id".to_owned(), |name| format!("has the catalog {name}"));
            Finding::fault(
                CHECK,
                format!("{carried}, but the database {database} {name}"),
                format!(
                    "check --store and --database; if the catalog {id} is gone for good, take its store over with \
                     --adopt-store {id}"
                ),
            )
        }
        (None, Some(name)) if ours.is_some_and(|ours| ours.has_claimed_store) => Finding::fault(
            CHECK,
            format!("{carried}, but the catalog {database} ({name}) has used a store before"),
            format!("check --store; if it is the right one and the text was removed, write {name} to {INSTANCE} in it"),
        ),
        (None, _) => Finding::ok(
            CHECK,
            "the store is new: the first start of `wavelume serve` or `worker` binds it to the catalog",
        ),
    }
}
