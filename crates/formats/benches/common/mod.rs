//! Measurements and their compression for benches, and times of single runs.

use std::path::Path;
use std::time::Instant;
use wavelume_core::compress::{Between, Compressed, Policy, Settings, Target, compress};
use wavelume_core::domain::{Measurement, Silent};
use wavelume_formats::formats::{self, Interpretation};
use wavelume_formats::projection::{self, AxesRequest};

/// Times in ms: wall clock, and processor time where available (Linux), which is comparable on a busy machine.
pub(crate) type Times = [f64; 2];

/// Runs `work` and updates `best` with its times if they are smaller.
pub(crate) fn least(best: &mut Times, work: impl FnOnce()) {
    let processor = || -> Option<f64> {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        Some(text.split_whitespace().next()?.parse::<f64>().ok()? / 1e6)
    };
    let (start, before) = (Instant::now(), processor());
    work();
    let elapsed = start.elapsed();
    let after = processor();
    best[0] = best[0].min(elapsed.as_secs_f64() * 1e3);
    best[1] = best[1].min(after.zip(before).map_or(f64::NAN, |(after, before)| after - before));
}

/// Returns the measurement in a file of the project.
pub(crate) fn measurement(path: &str) -> Measurement {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path);
    let document = std::fs::read(&path).unwrap_or_else(|e| unreachable!("{}: {e}", path.display()));
    let acquisition = formats::read(&document, &Interpretation::default()).unwrap_or_else(|e| unreachable!("{e}"));
    let projected = projection::project(&acquisition, &AxesRequest::default());
    projected.unwrap_or_else(|e| unreachable!("{e}")).measurement
}

/// A measurement compressed to a target, without metadata.
pub(crate) fn encoded(measurement: &Measurement, target: Target) -> Compressed {
    let settings = Settings {
        target,
        policy: Policy::Rd,
        basis: "auto".to_owned(),
        floor: None,
        albedo_error: None,
        straight_lines: 0,
        between: Between::default(),
        lobe: None,
        metadata: None,
        random_access: false,
    };
    compress(measurement, &settings, &Silent).unwrap_or_else(|e| unreachable!("{e}"))
}
