//! Speed of the generic wavelet transform on S² × S² × wavelength, forward and inverse, compared with memory speed and
//! numbers of threads.
//!
//! `cargo bench -p wavelume-core --bench transform`. All runs share one process, so that ratios compare runs under
//! equal conditions. The best of several runs counts, which is more reliable than the mean on a shared machine.
#![allow(clippy::print_stdout, reason = "a bench prints its figures")]

use std::collections::BTreeMap;
use std::hint::black_box;
use std::time::Instant;
use wavelume_core::domain::{Axis, Domain, TriangleMesh};
use wavelume_core::transform::{AxisTransform, LineBasis, Plan, SphereBasis, Weights};

/// Returns the best time of `runs` runs, in ms.
fn best(runs: usize, mut work: impl FnMut()) -> f64 {
    (0..runs)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64() * 1e3
        })
        .fold(f64::INFINITY, f64::min)
}

fn hemisphere(level: u8) -> Axis {
    Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, level).unwrap_or_else(|| unreachable!("level {level}")))
}

fn index(count: usize) -> Axis {
    Axis::Index { count, labels: vec![] }
}

fn plan(axes: &[Axis], transforms: &[AxisTransform]) -> Plan {
    Plan::new(axes, transforms).unwrap_or_else(|e| unreachable!("{e}"))
}

fn noise(n: usize) -> Vec<f32> {
    let mut state = 1_u32;
    (0..n)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 8_388_608.0 - 1.0
        })
        .collect()
}

fn on<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.unwrap_or_else(|e| unreachable!("{e}")).install(work)
}

/// Returns the processor time of each thread in ms (Linux only), which is comparable even on a busy machine.
fn processor_times() -> BTreeMap<String, f64> {
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let time = |path: std::path::PathBuf| -> Option<f64> {
        let text = std::fs::read_to_string(path.join("schedstat")).ok()?;
        Some(text.split_whitespace().next()?.parse::<f64>().ok()? / 1e6)
    };
    tasks.filter_map(|task| Some((task.file_name().into_string().ok()?, time(task.path())?))).collect()
}

/// Returns the best time, and the processor time of the busiest thread per run, on `threads` threads.
fn large(threads: usize, plan: &Plan, data: &mut [f32]) -> (f64, f64) {
    const RUNS: usize = 8;
    on(threads, || {
        plan.forward(data);
        let before = processor_times();
        let wall = best(RUNS, || plan.forward(black_box(data)));
        let after = processor_times();
        let spent = after.iter().map(|(thread, time)| time - before.get(thread).copied().unwrap_or(0.0));
        (wall, spent.fold(0.0, f64::max) / RUNS as f64)
    })
}

fn main() {
    let runs = std::env::var("RUNS").ok().and_then(|runs| runs.parse().ok()).unwrap_or(40);
    let sphere = AxisTransform::Sphere(SphereBasis::Orthonormal(Weights::Count));
    let axes = [hemisphere(1), hemisphere(4), index(75)];
    let transforms = [sphere, sphere, AxisTransform::line(LineBasis::BIOR44)];
    let full = plan(&axes, &transforms);
    let alone = plan(&axes, &[sphere, sphere, AxisTransform::Identity]);
    let samples = 16 * 1024 * 75;
    let mut data = noise(samples);
    let mut copy = vec![0.0_f32; samples];

    let small = on(1, || {
        let forward = best(runs, || full.forward(black_box(&mut data)));
        let inverse = best(runs, || full.inverse(black_box(&mut data)));
        println!("16 × 1024 × 75, {full}, one core: forward {forward:.2} ms, inverse {inverse:.2} ms (goal 12)");
        for basis in ["haar", "bior2.2", "db4", "db10", "bior6.8", "db38", "dmey"] {
            let Ok(basis) = basis.parse() else { continue };
            let plan = plan(&axes, &[sphere, sphere, AxisTransform::line(basis)]);
            let forward = best(runs / 4 + 1, || plan.forward(black_box(&mut data)));
            let inverse = best(runs / 4 + 1, || plan.inverse(black_box(&mut data)));
            println!("  with {basis} instead: forward {forward:.2} ms, inverse {inverse:.2} ms");
        }
        // Interleaved, so that both run under equal conditions.
        let (mut transformed, mut copied) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..runs {
            transformed = transformed.min(best(1, || alone.forward(black_box(&mut data))));
            copied = copied.min(best(1, || black_box(&mut copy).copy_from_slice(black_box(&data))));
        }
        let ratio = transformed / copied;
        println!("  sphere axes alone {transformed:.2} ms, memcpy {copied:.2} ms: {ratio:.2} × (goal 3)");
        forward
    });

    let large_axes = [hemisphere(3), hemisphere(5), index(75)];
    let plan_large = plan(&large_axes, &transforms);
    let count = 256 * 4096 * 75;
    let mut data = noise(count);
    let (one, busy_one) = large(1, &plan_large, &mut data);
    let growth = |time: f64| (time / count as f64) / (small / samples as f64);
    println!("256 × 4096 × 75, one core: forward {one:.0} ms, {:.2} × the time per sample (goal 1.5)", growth(one));
    println!("  processor time {busy_one:.0} ms, {:.2} ×", growth(busy_one));
    let (two, busy_two) = large(2, &plan_large, &mut data);
    println!("  two threads {two:.0} ms: {:.2} × (goal 1.7)", one / two);
    println!("  processor time of the busier {busy_two:.0} ms: {:.2} ×", busy_one / busy_two);

    // A separable problem, equal to that of tests/benches/pywavelets.py.
    let line_axes = [index(16), index(1024), index(75)];
    let haar = AxisTransform::line(LineBasis::HAAR);
    let lines = plan(&line_axes, &[haar, haar, AxisTransform::line(LineBasis::BIOR44)]);
    let mut data = noise(samples);
    let time = on(1, || best(runs, || lines.forward(black_box(&mut data))));
    println!("16 × 1024 × 75, {lines}, one core: {time:.2} ms (compare tests/benches/pywavelets.py)");
    let start = Instant::now();
    let made = plan(&[index(2101)], &[AxisTransform::line("db38".parse().unwrap_or(LineBasis::HAAR))]);
    println!("plan of {made}: {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
}
