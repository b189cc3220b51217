//! What a service or worker may use: where its data are, how many threads, how large and how long things may be.

use std::path::PathBuf;
use std::time::Duration;

/// Where the data are and how much of the machine to use.
#[derive(Clone, Debug)]
pub struct WorkConfig {
    /// The data directory: blobs, staging files, the catalog.
    pub data: PathBuf,
    /// Threads of the pool that does the maths; 0 = one per core.
    pub threads: usize,
    /// Jobs at the same time in this process; 0 runs none here.
    pub workers: usize,
    /// Sizes and times.
    pub limits: Limits,
}

impl WorkConfig {
    /// Defaults for everything but the data directory.
    pub fn new(data: impl Into<PathBuf>) -> Self {
        Self { data: data.into(), threads: 0, workers: 1, limits: Limits::default() }
    }
}

/// Sizes and times that a request or a job must stay within.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of a measurement after decoding.
    pub upload_bytes: u64,
    /// Decoded bytes per encoded byte, after the first MiB.
    pub upload_ratio: u64,
    /// Uploads at the same time.
    pub uploads: usize,
    /// Bytes of a JSON body.
    pub json_bytes: usize,
    /// Queries that compute at the same time; more wait a little, then get 503.
    pub queries: usize,
    /// Exported files that are made, wait to be made or are sent at the same time; more get 503.
    pub exports: usize,
    /// Directions or pairs in one batch.
    pub batch: usize,
    /// Values in one answer: pairs × wavelengths.
    pub values: usize,
    /// Batches that are answered as streams at the same time; more get 503.
    pub streams: usize,
    /// Directions drawn in one streamed answer.
    pub drawn: usize,
    /// Bytes of opened materials that are kept.
    pub opened_bytes: u64,
    /// Bytes of small material files that are kept beside the store.
    pub content_bytes: u64,
    /// Jobs that may wait.
    pub queued_jobs: u64,
    /// Attempts before a job is dead.
    pub attempts: u32,
    /// How long a job stays its worker's without a sign of life.
    pub lease: Duration,
    /// The first back-off after a failed attempt; it doubles.
    pub backoff: Duration,
    /// How long a client may take for its headers, and between two pieces of a body.
    pub idle: Duration,
    /// How long one upload may take.
    pub upload_time: Duration,
    /// How long running requests and jobs may take after the signal to stop.
    pub drain: Duration,
    /// Age at which a staging file is nobody's.
    pub stale: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            upload_bytes: 256 << 20,
            upload_ratio: 200,
            uploads: 16,
            json_bytes: 64 << 20,
            queries: 64,
            exports: 4,
            batch: 1_000_000,
            values: 4_000_000,
            streams: 16,
            drawn: 1_000_000_000,
            opened_bytes: 512 << 20,
            content_bytes: 64 << 20,
            queued_jobs: 10_000,
            attempts: 5,
            lease: Duration::from_secs(30),
            backoff: Duration::from_secs(2),
            idle: Duration::from_secs(30),
            upload_time: Duration::from_mins(15),
            drain: Duration::from_secs(20),
            stale: Duration::from_hours(1),
        }
    }
}
