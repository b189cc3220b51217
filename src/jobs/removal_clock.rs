//! Clock by which ages are told before anything is removed: believed only while it agrees with what the machine has
//! counted and with what the catalog knows.

use super::archive::{Archive, ArchiveError};
use super::clock::date;
use super::presence::boot;
use crate::catalog::{Counted, Doubt};
use std::time::{SystemTime, UNIX_EPOCH};

impl Archive {
    /// Fails if the clock of the database has jumped by more than a day, as far as this can be told: ages would be
    /// wrong, and what is to be kept would be removed.
    pub(crate) async fn check_clock(&self) -> Result<(), ArchiveError> {
        let here = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis() as i64);
        match self.catalog.doubt(counted().as_ref(), here).await? {
            None => Ok(()),
            Some(doubt) => Err(ArchiveError::Clock(reason(doubt))),
        }
    }

    /// Takes the clock of the database for right from now on, for all processes.
    pub(crate) async fn vouch_for_clock(&self) -> Result<(), ArchiveError> {
        Ok(self.catalog.vouch(counted().as_ref()).await?)
    }
}

fn reason(doubt: Doubt) -> String {
    let at = |ms: i64| format!("{} UTC", date(ms.div_euclid(1000)));
    match doubt {
        Doubt::Behind { now, newest } => {
            format!("it is {} by the clock of the database, but the newest row is of {}", at(now), at(newest))
        }
        Doubt::Jumped { now, counted } => format!(
            "it is {} by the clock of the database, but {} by the time that this machine has counted since its start",
            at(now),
            at(counted)
        ),
        Doubt::Apart { now, here } => {
            format!("it is {} by the clock of the database, but {} by that of this machine", at(now), at(here))
        }
    }
}

/// Returns the time that this machine has counted since its start, standby included. Setting the clock does not change
/// it.
#[cfg(target_os = "linux")]
fn counted() -> Option<Counted> {
    use rustix::time::{ClockId, clock_gettime};
    let start = boot();
    let since = clock_gettime(ClockId::Boottime);
    let elapsed_ms = since.tv_sec.saturating_mul(1000).saturating_add(since.tv_nsec / 1_000_000);
    (!start.is_empty()).then_some(Counted { start, elapsed_ms })
}

#[cfg(not(target_os = "linux"))]
fn counted() -> Option<Counted> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_doubted_clock_is_named_with_both_times() {
        let data = tempfile::tempdir().unwrap();
        let archive = Archive::open(data.path()).await.unwrap();
        archive.check_clock().await.unwrap();
        archive.check_clock().await.unwrap();
        archive.vouch_for_clock().await.unwrap();
        archive.check_clock().await.unwrap();
        let text = reason(Doubt::Jumped { now: 86_400_000 * 40, counted: 0 });
        assert!(text.contains("1970-02-10 00:00 UTC") && text.contains("1970-01-01 00:00 UTC"), "{text}");
    }
}
