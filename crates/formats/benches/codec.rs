//! Times of the codec: two virtual surfaces of 16 × 1024 × 75 samples, encoded at a fixed step, encoded to er(L2) 1 %,
//! and decoded, against `memcpy` of the same samples.
//!
//! `cargo bench -p wavelume-formats --bench codec`. One core; best of several runs, all in one process, so that
//! compared times are measured under the same load. On a shared machine the best run is closer to the true time than
//! the mean.
#![allow(clippy::print_stdout, reason = "a bench prints its figures")]

mod common;

use common::{encoded, least, measurement};
use std::hint::black_box;
use wavelume_core::compress::{Target, decode};
use wavelume_core::domain::Measurement;

/// Two surfaces: a gloss lobe on a diffuse ground that has all symmetries of the mesh, and one that has none.
const SURFACES: [(&str, &str); 2] =
    [("gloss", "data/virtual/plastic.json"), ("aniso", "data/virtual/brushed_copper.json")];

fn main() {
    let runs = std::env::var("RUNS").ok().and_then(|runs| runs.parse().ok()).unwrap_or(12);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.unwrap_or_else(|e| unreachable!("{e}")).install(|| {
        for (name, path) in SURFACES {
            surface(name, &measurement(path), runs);
        }
    });
}

fn surface(name: &str, measurement: &Measurement, runs: usize) {
    let samples = measurement.tensor.samples();
    let bytes = size_of_val(samples) as f64;
    let shape = measurement.tensor.shape().iter().map(ToString::to_string).collect::<Vec<_>>().join(" × ");
    let mut copy = vec![0.0_f32; samples.len()];
    let wanted = encoded(measurement, Target::ErL2(0.01));
    let step = Target::Step(0.1);
    // [copy, encode at a step, encode to an error, decode]; interleaved, so that all see the same machine.
    let mut best = [[f64::INFINITY; 2]; 4];
    for run in 0..runs {
        least(&mut best[0], || black_box(&mut copy).copy_from_slice(black_box(samples)));
        least(&mut best[1], || drop(black_box(encoded(black_box(measurement), step))));
        least(&mut best[3], || drop(black_box(decode(black_box(&wanted.bytes)))));
        // The slowest by far.
        if run % 4 == 0 {
            least(&mut best[2], || drop(black_box(encoded(black_box(measurement), Target::ErL2(0.01)))));
        }
    }
    let at_step = encoded(measurement, step);
    println!("{name}: {shape}, {:.1} MB, one core", bytes / 1e6);
    let lines = [
        (1, format!("encode at step 0.1 ({} bytes, er(L2) {:.4})", at_step.bytes.len(), at_step.summary.errors.er_l2)),
        (2, format!("encode to er(L2) 0.01 ({} bytes)", wanted.bytes.len())),
        (3, "decode that".to_owned()),
    ];
    for (k, what) in lines {
        let [ms, processor] = best[k];
        let (speed, copies) = (bytes / 1e3 / ms, ms / best[0][0]);
        println!("  {what}: {ms:.1} ms, {speed:.0} MB/s, {copies:.0} × memcpy; {processor:.1} ms of the processor");
    }
}
