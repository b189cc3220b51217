//! Sizes, times and numbers of places of a service or worker, each declared once with its default and its unit.

use super::site::Site;
use super::unit::{Brief, Unit, Value};
use std::path::PathBuf;
use std::time::Duration;

/// Configuration of the work of a service: data directory, threads, jobs at a time and limits.
#[derive(Clone, Debug)]
pub struct WorkConfig {
    /// Places of the data directory, of the catalog's database and of the store.
    pub site: Site,
    /// Threads of each pool that computes; 0 = one per core.
    pub threads: usize,
    /// Number of jobs that this process runs at the same time; 0 leaves all jobs to other processes.
    pub workers: usize,
    /// Program that computes each job in a process of its own, whose memory is limited: the program `wavelume`. `None`
    /// computes jobs in this process.
    pub isolate: Option<PathBuf>,
    /// True if tenants take turns in the queue of jobs; false if client addresses do, as in a service without keys.
    pub by_tenant: bool,
    /// Limits of the service, such as the number of waiting jobs, the number of open connections, and the size of
    /// uploads.
    pub limits: Limits,
}

impl WorkConfig {
    /// Builds a configuration with defaults for everything but the data directory.
    pub fn new(data: impl Into<PathBuf>) -> Self {
        let (site, limits) = (Site::new(data), Limits::default());
        Self { site, threads: 0, workers: 1, isolate: None, by_tenant: false, limits }
    }
}

/// A number that a user may set, declared once in [`SETTINGS`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setting {
    /// Name of the setting in `snake_case`; flag and environment variable follow from it.
    pub field: &'static str,
    /// Group under which help and documentation list the setting.
    pub heading: &'static str,
    /// Help text of the setting, one or two sentences.
    pub help: &'static str,
    /// Unit of the setting, which decides how its text is read.
    pub unit: Unit,
    /// Smallest value that the setting accepts; times are in milliseconds.
    pub least: u64,
    /// Returns the value of the setting from a configuration; times are in milliseconds.
    pub get: fn(&WorkConfig) -> u64,
    /// Writes the value of the setting into a configuration; `None` if it exceeds the integer type of the field.
    pub set: fn(&mut WorkConfig, u64) -> Option<()>,
}

impl Setting {
    /// Parses a text as the value of this setting, and checks its range.
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

        /// All numeric settings of the service, in the order of the documentation.
        pub(crate) const SETTINGS: &[Setting] = &[
            Setting {
                field: "workers",
                heading: "Work",
                help: "Jobs that this process runs at the same time; 0 leaves all jobs to other processes.",
                unit: Unit::Count,
                least: 0,
                get: |config| config.workers.number(),
                set: |config, number| Some(config.workers = Value::from_number(number)?),
            },
            Setting {
                field: "threads",
                heading: "Work",
                help: "Number of threads in each thread pool; 0 takes one per core.",
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
        /// Upper bound on the jobs that wait in the queue; a further job is refused with 429, unless its tenant has
        /// fewer waiting than this number divided by the number of tenants with waiting jobs. Each further node may
        /// exceed it by an eighth.
        queued_jobs: u64 = 10_000, Count >= 0;
        /// Time after which a waiting batch job (`"priority": 1`) counts as a usual one, so that usual jobs do not hold
        /// it up for ever.
        batch_age: Duration = Duration::from_hours(1), Time >= 1000;
        /// Upper bound on the attempts at a job whose disk or database failed, or whose stored bytes are missing or
        /// damaged; after the last one its state is `dead`. Attempts without the store do not count.
        attempts: u32 = 7, Count >= 1;
        /// Upper bound on the attempts at a job whose worker process died; after the last one its state is `dead`,
        /// because the job may be what ends its workers.
        lost: u32 = 20, Count >= 1;
        /// Upper bound on the memory of one job in a process of its own (`isolate`); a job that needs more fails. 0
        /// takes three quarters of the machine's memory, or of its control group's, divided by `workers`.
        job_memory: u64 = 0, Bytes >= 0;
        /// Time without a sign of life from a worker after which its job goes back to the queue.
        lease: Duration = Duration::from_secs(30), Time >= 1000;
        /// Pause between the first failed attempt at a job and the second one; it doubles with each further failure.
        backoff: Duration = Duration::from_secs(2), Time >= 0;
        /// Age at which a temporary file of the data directory counts as abandoned and is removed.
        stale: Duration = Duration::from_hours(1), Time >= 1000;
    }
    "Keeping" {
        /// Time for which the bytes of deleted measurements and materials stay in the store. A backup of the database
        /// must not be older when it is restored.
        grace: Duration = Duration::from_hours(24), Time >= 0;
        /// Age at which the entry of a job that has succeeded or was cancelled is deleted, with its report; its
        /// material stays.
        keep_succeeded: Duration = Duration::from_hours(30 * 24), Time >= 0;
        /// Age at which the entry of a job that has failed or is dead is deleted.
        keep_failed: Duration = Duration::from_hours(90 * 24), Time >= 0;
        /// Age at which a record of the audit trail is deleted.
        keep_audit: Duration = Duration::from_hours(400 * 24), Time >= 0;
        /// Interval at which the service removes the bytes of deleted measurements and materials and the entries of
        /// ended jobs, once they were kept for long enough.
        sweep: Duration = Duration::from_hours(1), Time >= 1000;
    }
    "Disk" {
        /// Space that jobs leave free on the disks of the catalog, the store and the temporary files, so that deletions
        /// still work; a small disk keeps a sixteenth. Uploads leave twice as much. Beside a SQLite catalog a file
        /// holds as much in reserve, which is given up when the disk is full. 0 keeps none.
        disk_reserve: u64 = 16 << 20, Bytes >= 0;
    }
    "Checking" {
        /// Rate at which this process reads stored bytes to check their digests; 0 checks none.
        scrub_rate: u64 = 10 << 20, Rate >= 0;
        /// Age of the last check of a stored file at which it is checked again.
        scrub_every: Duration = Duration::from_hours(30 * 24), Time >= 1000;
    }
    "Access" {
        /// Upper bound on the time for which a new key is valid, and the default of that time. Keys that exist stay as
        /// they are.
        key_age: Duration = Duration::from_hours(365 * 24), Time >= 60_000;
        /// Upper bound on the valid keys of one tenant; a further one is refused with 403. Counted together with ended
        /// ones, which are forgotten after 30 days, a tenant may have ten times as many.
        keys_each: u64 = 1000, Count >= 1;
    }
    "Connections" {
        /// Upper bound on the connections that are open at once, over all addresses; lower where the system allows
        /// fewer file descriptors.
        connections: usize = 2048, Count >= 1;
        /// Upper bound on the connections that are open at once from one address (IPv6: one /64).
        connections_each: usize = 128, Count >= 1;
        /// Reserve of connections that are accepted when `connections` or `connections-each` is reached, for the health
        /// checks `/healthz` and `/readyz` alone.
        health_connections: usize = 64, Count >= 1;
        /// Upper bound on the connections from one address in the reserve `health-connections`.
        health_connections_each: usize = 4, Count >= 1;
        /// Upper bound on the requests that are under way at once, over all addresses; lower where the system allows
        /// fewer file descriptors.
        requests: usize = 1024, Count >= 1;
        /// Upper bound on the requests that are under way at once from one address.
        requests_each: usize = 256, Count >= 1;
        /// Upper bound on the wrong keys that one address (IPv6: one /64) may send within a minute; further requests
        /// with a key that is not known to be right are refused with 429 until the minute is over.
        wrong_keys: u32 = 10, Count >= 1;
        /// Time within which a new connection must send its first bytes, which tell HTTP/1 and HTTP/2 apart. The
        /// handshake of TLS, which comes before, has the same time.
        first_bytes: Duration = Duration::from_secs(10), Time >= 100;
        /// Time after which a connection without progress is closed. Progress is a request, a complete header, a piece
        /// of a body, or a client that reads its answer.
        idle: Duration = Duration::from_secs(30), Time >= 100;
        /// Upper bound on the size of the request line and the headers of one request.
        header_bytes: usize = 32 << 10, Bytes >= 4096;
        /// Upper bound on the requests that are under way at once on one HTTP/2 connection.
        h2_streams: u32 = 128, Count >= 1;
        /// Upper bound on the streams of one HTTP/2 connection that the client resets before the service handles them;
        /// more close the connection.
        h2_resets: usize = 20, Count >= 1;
    }
    "Uploads and bodies" {
        /// Upper bound on the size of an uploaded measurement, after decompression.
        upload_bytes: u64 = 256 << 20, Bytes >= 1;
        /// Upper bound on the compression ratio of an upload: decompressed bytes, after the first MiB, for each
        /// received byte.
        upload_ratio: u64 = 200, Count >= 1;
        /// Upper bound on the uploads that are received at once, over all addresses.
        uploads: usize = 32, Count >= 0;
        /// Upper bound on the uploads that are received at once from one address.
        uploads_each: usize = 8, Count >= 0;
        /// Upper bound on the time that one upload or one JSON body takes to arrive.
        upload_time: Duration = Duration::from_mins(15), Time >= 100;
        /// Lower bound, in bytes a second, on the rate at which an upload or a JSON body arrives. The rate is an
        /// average over the time `body-window`; the time `body-grace` at the beginning does not count.
        body_rate: u64 = 16 << 10, Rate >= 0;
        /// Time over which the rate of an arriving body is averaged, to compare it with `body-rate`.
        body_window: Duration = Duration::from_secs(30), Time >= 100;
        /// Time at the beginning of an upload or a JSON body in which it may arrive more slowly than `body-rate`.
        body_grace: Duration = Duration::from_secs(10), Time >= 0;
        /// Upper bound on the resumable uploads that are not used yet, over all addresses.
        partial_uploads: u64 = 1024, Count >= 0;
        /// Upper bound on the resumable uploads of one address that are not used yet.
        partial_uploads_each: u64 = 64, Count >= 0;
        /// Upper bound on the bytes in the store for resumable uploads that are not used yet, over all addresses. An
        /// upload counts with its stated size from its beginning.
        partial_bytes: u64 = 64 << 30, Bytes >= 0;
        /// Upper bound on the bytes in the store for the resumable uploads of one address that are not used yet.
        partial_bytes_each: u64 = 8 << 30, Bytes >= 0;
        /// Upper bound on the parts of one resumable upload: each request with bytes has one, or one for each 16 MiB.
        partial_parts: u32 = 10_000, Count >= 1;
        /// Time after its first byte at which a resumable upload expires; one without a byte expires after 15 minutes.
        partial_keep: Duration = Duration::from_hours(24), Time >= 1000;
        /// Time after which a resumable upload whose request vanished with its process may be continued.
        partial_lease: Duration = Duration::from_secs(5), Time >= 1000;
        /// Upper bound on the memory for checking uploaded materials at once, over all addresses: 24 bytes for each
        /// sample of a material, and the bytes of its measurement.
        checking_bytes: usize = 2 << 30, Bytes >= 1024;
        /// Upper bound on the memory for checking uploaded materials at once for one address; a material that needs
        /// more is refused. The default admits 22 million samples.
        checking_bytes_each: usize = 512 << 20, Bytes >= 1024;
        /// Upper bound on the size of the JSON body of one request.
        json_bytes: usize = 64 << 20, Bytes >= 1024;
        /// Upper bound on the memory for all JSON bodies that are held at once, over all addresses.
        bodies_bytes: usize = 512 << 20, Bytes >= 1024;
        /// Upper bound on the memory for all JSON bodies that are held at once for one address.
        bodies_bytes_each: usize = 128 << 20, Bytes >= 1024;
    }
    "Answers" {
        /// Upper bound on the queries to materials that run at once, over all addresses. A query runs until the last
        /// byte of its answer is sent.
        queries: usize = 256, Count >= 0;
        /// Upper bound on the queries to materials that run at once from one address. Below `queries-waiting` it leaves
        /// room for queries of other addresses to wait.
        queries_each: usize = 32, Count >= 0;
        /// Upper bound on the queries to materials that wait for a free thread at once; a further query is refused with
        /// 503.
        queries_waiting: usize = 64, Count >= 0;
        /// Upper bound on the directions, or pairs of directions, of one request that is asked and answered in JSON.
        batch: usize = 1_000_000, Count >= 1;
        /// Upper bound on the values of one answer in JSON: pairs of directions times wavelengths.
        values: usize = 4_000_000, Count >= 1;
        /// Upper bound on the directions drawn for one request in JSON whose answer is streamed.
        drawn: usize = 1_000_000_000, Count >= 1;
        /// Upper bound on the batches of queries whose answers are streamed at once, over all addresses.
        streams: usize = 16, Count >= 0;
        /// Upper bound on the batches of queries whose answers are streamed at once to one address.
        streams_each: usize = 4, Count >= 0;
        /// Upper bound on the exported files that are computed or sent at once, over all addresses.
        exports: usize = 4, Count >= 0;
        /// Upper bound on the exported files that are computed or sent at once for one address. Over all addresses, at
        /// most one file more than this is computed at once.
        exports_each: usize = 2, Count >= 0;
        /// Upper bound on the clients that follow a job at once, over all addresses: through its event stream or with
        /// `Prefer: wait`.
        followers: usize = 256, Count >= 0;
        /// Upper bound on the clients from one address that follow a job at once. A further one gets 429, or with
        /// `Prefer: wait` an answer without waiting.
        followers_each: usize = 32, Count >= 0;
        /// Upper bound on the memory for answers that are held whole until they are sent, over all addresses.
        answers_bytes: usize = 1 << 30, Bytes >= 1024;
        /// Upper bound on the memory for answers that are held whole until they are sent to one address.
        answers_bytes_each: usize = 256 << 20, Bytes >= 1024;
        /// Time for which a URL of an S3 store reads one material; downloads are redirected to it. At most 15min; 0
        /// sends the bytes from here. Revoking a key does not end a URL that was given out.
        store_redirect: Brief = Brief(Duration::ZERO), Time >= 0;
    }
    "Memory" {
        /// Upper bound on the memory for decoded materials that are kept for further queries.
        opened_bytes: u64 = 512 << 20, Bytes >= 0;
        /// Upper bound on the memory for the bytes of small material files that are kept for further downloads.
        content_bytes: u64 = 64 << 20, Bytes >= 0;
    }
    "Stopping" {
        /// Time after SIGTERM in which connections are still accepted and `/readyz` answers *stopping*, so that a load
        /// balancer turns to another service. SIGINT skips it.
        notice: Duration = Duration::from_secs(2), Time >= 0;
        /// Time that running requests and jobs have to end when the service stops; jobs that do not end go back to the
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
        let redirect = SETTINGS.iter().find(|setting| setting.field == "store_redirect").unwrap();
        assert_eq!((redirect.parse("0s"), redirect.parse("15min")), (Ok(0), Ok(900_000)));
        assert!(redirect.parse("16min").is_err());
        let zero = SETTINGS.iter().find(|setting| setting.field == "idle").unwrap().parse("0");
        assert_eq!(zero, Err("expected a time such as 500ms, 30s, 15min or 1h, at least 100ms".to_owned()));
    }
}
