//! Times of single runs.

use std::time::Instant;

/// Times in ms: by the clock, and of the processor where the system tells (Linux): what a busy machine leaves comparable.
pub(crate) type Times = [f64; 2];

/// Does `work`, and keeps its times where they are less than the best so far.
pub(crate) fn least(best: &mut Times, work: impl FnOnce()) {
    let processor = || -> Option<f64> {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        Some(text.split_whitespace().next()?.parse::<f64>().ok()? / 1e6)
    };
    let (start, before) = (Instant::now(), processor());
    work();
    let after = processor();
    best[0] = best[0].min(start.elapsed().as_secs_f64() * 1e3);
    best[1] = best[1].min(after.zip(before).map_or(f64::NAN, |(after, before)| after - before));
}
