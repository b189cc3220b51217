//! Sizes, times and numbers of places of a service or worker, each declared once with its default and its unit.

use super::site::Site;
use super::unit::{Unit, Value};
use std::path::PathBuf;
use std::time::Duration;

/// Data directory, and the share of the machine to use.
#[derive(Clone, Debug)]
pub struct WorkConfig {
    /// Data directory, catalog and store.
    pub site: Site,
    /// Threads of each pool that computes; 0 = one per core.
    pub threads: usize,
    /// Jobs that this process runs at the same time; 0 leaves them to other processes.
    pub workers: usize,
    /// Sizes and times.
    pub limits: Limits,
}

impl WorkConfig {
    /// Builds a configuration with defaults for everything but the data directory.
    pub fn new(data: impl Into<PathBuf>) -> Self {
        Self { site: Site::new(data), threads: 0, workers: 1, limits: Limits::default() }
    }
}

/// A number that a user may set, declared once in [`SETTINGS`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setting {
    /// Name in `snake_case`; flag and environment variable follow from it.
    pub field: &'static str,
    /// Group under which help and documentation list it.
    pub heading: &'static str,
    /// Explanation, one sentence or two.
    pub help: &'static str,
    /// Unit in which its text is read.
    pub unit: Unit,
    /// Smallest value that is accepted.
    pub least: u64,
    /// Reads the value, times in milliseconds.
    pub get: fn(&WorkConfig) -> u64,
    /// Sets the value; `None` if it does not fit the machine's integers.
    pub set: fn(&mut WorkConfig, u64) -> Option<()>,
}

impl Setting {
    /// Reads text as a value of this setting.
    pub(crate) fn parse(&self, text: &str) -> Result<u64, String> {
        let expected = self.unit.expected();
        let value = self.unit.parse(text.trim()).ok_or_else(|| format!("expected {expected}"))?;
        if value < self.least {
            return Err(format!("expected {expected}, at least {}", self.unit.show(self.least)));
        }
        // A value that the field cannot hold is refused here, where the text is known.
        (self.set)(&mut WorkConfig::new(""), value).ok_or_else(|| format!("expected {expected}, and a smaller one"))?;
        Ok(value)
    }
}

/// Declares the fields of [`Limits`] with their defaults, and from the same lines the entries of [`SETTINGS`].
macro_rules! limits {
    ($($heading:literal {
        $($(#[doc = $help:literal])+ $field:ident: $type:ty = $default:expr, $unit:ident >= $least:expr;)+
    })+) => {
        /// Limits that a request or a job must stay within.
        #[derive(Clone, Debug, PartialEq, Eq)]
        pub struct Limits {
            $($($(#[doc = $help])+ pub $field: $type,)+)+
        }

        impl Default for Limits {
            fn default() -> Self {
                Self { $($($field: $default,)+)+ }
            }
        }

        /// Every number that a person may set, in the order of the documentation.
        pub(crate) const SETTINGS: &[Setting] = &[
            Setting {
                field: "workers",
                heading: "Work",
                help: "Jobs that this process runs at the same time; 0 leaves them to other processes.",
                unit: Unit::Count,
                least: 0,
                get: |config| config.workers.number(),
                set: |config, number| Some(config.workers = Value::from_number(number)?),
            },
            Setting {
                field: "threads",
                heading: "Work",
                help: "Threads of each pool that computes; 0 takes one per core.",
                unit: Unit::Count,
                least: 0,
                get: |config| config.threads.number(),
                set: |config, number| Some(config.threads = Value::from_number(number)?),
            },
            $($(Setting {
                field: stringify!($field),
                heading: $heading,
                help: concat!($($help),+),
                unit: Unit::$unit,
                least: $least,
                get: |config| config.limits.$field.number(),
                set: |config, number| Some(config.limits.$field = Value::from_number(number)?),
            },)+)+
        ];
    };
}

limits! {
    "Work" {
        /// Jobs that may wait in the queue; further ones get 429.
        queued_jobs: u64 = 10_000, Count >= 0;
        /// Attempts at a job whose disk, store or database failed, before the job is dead.
        attempts: u32 = 5, Count >= 1;
        /// Attempts at a job whose worker vanished, before the job is dead: it may be the job that ends its worker.
        lost: u32 = 5, Count >= 1;
        /// Lease: time without a sign of life after which a job is taken back from its worker.
        lease: Duration = Duration::from_secs(30), Time >= 1000;
        /// Pause after the first failed attempt; it doubles with each further one.
        backoff: Duration = Duration::from_secs(2), Time >= 0;
        /// Age at which a staging file counts as abandoned and is removed.
        stale: Duration = Duration::from_hours(1), Time >= 1000;
    }
    "Keeping" {
        /// Time for which bytes that no row names any more stay in the store. At least the time for which a backup or a
        /// signed address may still refer to them.
        grace: Duration = Duration::from_hours(24), Time >= 0;
        /// Age at which a job that has succeeded or was cancelled is forgotten, with its report; its material stays.
        keep_succeeded: Duration = Duration::from_hours(30 * 24), Time >= 0;
        /// Age at which a job that has failed is forgotten.
        keep_failed: Duration = Duration::from_hours(90 * 24), Time >= 0;
        /// Time between two looks for bytes and rows to remove.
        sweep: Duration = Duration::from_hours(1), Time >= 1000;
    }
    "Connections" {
        /// Connections held at once, over all addresses; fewer where the limit on descriptors is lower.
        connections: usize = 2048, Count >= 1;
        /// Connections held at once by one address (IPv6: one /64).
        connections_each: usize = 128, Count >= 1;
        /// Connections beyond those that are still accepted, for `/healthz` and `/readyz` alone.
        health_connections: usize = 64, Count >= 1;
        /// Such connections of one address.
        health_connections_each: usize = 4, Count >= 1;
        /// Requests under way at once, over all addresses; fewer where the limit on descriptors is lower.
        requests: usize = 1024, Count >= 1;
        /// Requests under way at once from one address.
        requests_each: usize = 256, Count >= 1;
        /// Time that a new connection has to send its first bytes, which tell HTTP/1 and HTTP/2 apart.
        first_bytes: Duration = Duration::from_secs(10), Time >= 100;
        /// Time without any progress after which a connection is closed: no request, an unfinished header, no piece of
        /// a body, no reading of an answer.
        idle: Duration = Duration::from_secs(30), Time >= 100;
        /// Size of the request line and headers of one request.
        header_bytes: usize = 32 << 10, Bytes >= 4096;
        /// Requests under way at once on one HTTP/2 connection.
        h2_streams: u32 = 128, Count >= 1;
        /// Streams of one HTTP/2 connection that the client may reset before the service handles them; more close the
        /// connection.
        h2_resets: usize = 20, Count >= 1;
    }
    "Uploads and bodies" {
        /// Size of a measurement after decoding.
        upload_bytes: u64 = 256 << 20, Bytes >= 1;
        /// Upper bound on decoded bytes per encoded byte of an upload, after the first MiB.
        upload_ratio: u64 = 200, Count >= 1;
        /// Uploads received at once, over all addresses.
        uploads: usize = 32, Count >= 0;
        /// Uploads received at once from one address.
        uploads_each: usize = 8, Count >= 0;
        /// Time that one upload or JSON body may take.
        upload_time: Duration = Duration::from_mins(15), Time >= 100;
        /// Lower bound on the rate at which an upload or a JSON body arrives, measured over any `body-window` after
        /// `body-grace`.
        body_rate: u64 = 16 << 10, Rate >= 0;
        /// Time over which `body-rate` is measured.
        body_window: Duration = Duration::from_secs(30), Time >= 100;
        /// Time at the beginning of a body in which `body-rate` does not apply.
        body_grace: Duration = Duration::from_secs(10), Time >= 0;
        /// Size of a JSON body.
        json_bytes: usize = 64 << 20, Bytes >= 1024;
        /// Memory for JSON bodies at once, over all addresses.
        bodies_bytes: usize = 512 << 20, Bytes >= 1024;
        /// Memory for JSON bodies at once from one address.
        bodies_bytes_each: usize = 128 << 20, Bytes >= 1024;
    }
    "Answers" {
        /// Queries running at once, over all addresses, from the request until the last byte of the answer is sent.
        queries: usize = 256, Count >= 0;
        /// Queries running at once from one address; lower than `queries-waiting`, so that other addresses can wait
        /// beside it.
        queries_each: usize = 32, Count >= 0;
        /// Queries that wait for a thread at once; further ones get 503.
        queries_waiting: usize = 64, Count >= 0;
        /// Directions or pairs in one batch.
        batch: usize = 1_000_000, Count >= 1;
        /// Values in one answer: pairs times wavelengths.
        values: usize = 4_000_000, Count >= 1;
        /// Directions drawn in one streamed answer.
        drawn: usize = 1_000_000_000, Count >= 1;
        /// Batches answered as streams at once, over all addresses.
        streams: usize = 16, Count >= 0;
        /// Batches answered as streams at once to one address.
        streams_each: usize = 4, Count >= 0;
        /// Exported files made or sent at once, over all addresses.
        exports: usize = 4, Count >= 0;
        /// Exported files made or sent at once to one address; one more than this is computed at the same time.
        exports_each: usize = 2, Count >= 0;
        /// Clients that follow a job at once, by its events or with `Prefer: wait`, over all addresses.
        followers: usize = 256, Count >= 0;
        /// Followers from one address; further ones get 429, or with `Prefer: wait` their answer at once.
        followers_each: usize = 32, Count >= 0;
        /// Memory for whole answers at once until they are sent, over all addresses.
        answers_bytes: usize = 1 << 30, Bytes >= 1024;
        /// Memory for whole answers at once until they are sent, to one address.
        answers_bytes_each: usize = 256 << 20, Bytes >= 1024;
    }
    "Memory" {
        /// Memory for opened materials that are cached.
        opened_bytes: u64 = 512 << 20, Bytes >= 0;
        /// Memory for small material files that are cached beside the store.
        content_bytes: u64 = 64 << 20, Bytes >= 0;
    }
    "Stopping" {
        /// Time after SIGTERM in which connections are still accepted and `/readyz` says *stopping*, so that a load
        /// balancer turns to another service. SIGINT skips it.
        notice: Duration = Duration::from_secs(2), Time >= 0;
        /// Time that running requests and jobs have to end when the service stops; unfinished jobs go back to the
        /// queue.
        drain: Duration = Duration::from_secs(7), Time >= 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_setting_is_one_of_a_kind_and_has_a_default_that_it_takes() {
        let mut names: Vec<&str> = SETTINGS.iter().map(|setting| setting.field).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), SETTINGS.len());
        let default = WorkConfig::new("");
        for setting in SETTINGS {
            let value = (setting.get)(&default);
            assert_eq!(setting.parse(&setting.unit.show(value)), Ok(value), "{}", setting.field);
            let mut other = default.clone();
            let next = setting.least.max(value.saturating_sub(1));
            (setting.set)(&mut other, next).unwrap();
            assert_eq!((setting.get)(&other), next, "{}", setting.field);
            assert!(setting.help.len() > 20, "{}", setting.field);
        }
        let zero = SETTINGS.iter().find(|setting| setting.field == "idle").unwrap().parse("0");
        assert_eq!(zero, Err("expected a time such as 500ms, 30s, 15min or 1h, at least 100ms".to_owned()));
    }
}
