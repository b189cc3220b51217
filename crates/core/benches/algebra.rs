//! Speed of the algebra in the compressed domain, compared with decoding: gathering of photons, products of spectra.
//!
//! `cargo bench -p wavelume-core --bench algebra`. One core. The methods of a row run alternately in one process, and
//! the best of several runs counts, so that ratios compare runs under equal conditions.
#![allow(clippy::print_stdout, reason = "a bench prints its figures")]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;
use wavelume_core::algebra::{Accumulator, Couplings, LineSpace, Multiplier, SparseSpectrum, SpectrumPool};
use wavelume_core::domain::Axis;
use wavelume_core::transform::{AxisTransform, Plan};

/// Number of photons gathered for one radiance estimate.
const PHOTONS: usize = 1000;
/// Number of pairs of spectra that are multiplied in one run.
const PAIRS: usize = 64;

/// Returns the best time of each method in µs; the methods run alternately.
fn best<const N: usize>(runs: usize, mut ways: [&mut dyn FnMut(); N]) -> [f64; N] {
    let mut times = [f64::INFINITY; N];
    for _ in 0..runs {
        for (time, way) in times.iter_mut().zip(&mut ways) {
            let start = Instant::now();
            way();
            *time = time.min(start.elapsed().as_secs_f64() * 1e6);
        }
    }
    times
}

fn transform(name: &str) -> AxisTransform {
    AxisTransform::line(name.parse().unwrap_or_else(|e| unreachable!("{e}")))
}

fn line(name: &str, length: usize) -> Arc<LineSpace> {
    LineSpace::new(transform(name), length).unwrap_or_else(|e| unreachable!("{e}"))
}

/// Returns a smooth spectrum with lines and noise; each seed gives another one.
fn samples(length: usize, seed: usize) -> Vec<f64> {
    let mut state = (seed as u32).wrapping_mul(2_654_435_761).wrapping_add(12_345);
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / 16_777_216.0
    };
    let (phase, place) = (next() * 6.0, next() * length as f64);
    let value = |i: usize, noise: f64| {
        let x = i as f64;
        1.0 + 0.5 * (x * 0.1 + phase).sin() + 2.0 * (-((x - place) / 3.0).powi(2)).exp() + 0.1 * noise
    };
    (0..length).map(|i| value(i, next())).collect()
}

fn spectra(space: &Arc<LineSpace>, count: usize, k: usize, seed: usize) -> Vec<SparseSpectrum> {
    let of = |i| SparseSpectrum::largest(space, &samples(space.length(), seed + i), k);
    (0..count).map(|i| of(i).unwrap_or_else(|e| unreachable!("{e}"))).collect()
}

fn gathering(runs: usize, name: &str, n: usize) {
    let space = line(name, n);
    let plan = Plan::new(&[Axis::Index { count: n, labels: vec![] }], &[transform(name)]);
    let plan = plan.unwrap_or_else(|e| unreachable!("{e}"));
    for k in [4, 8, 16] {
        let photons = spectra(&space, PHOTONS, k, 0);
        let weights: Vec<f64> = (0..PHOTONS).map(|i| 0.5 + i as f64 / PHOTONS as f64).collect();
        let mut pool = SpectrumPool::new(&space);
        for photon in &photons {
            pool.push(photon).unwrap_or_else(|e| unreachable!("{e}"));
        }
        let stored: Vec<f32> = photons.iter().flat_map(SparseSpectrum::samples).map(|x| x as f32).collect();
        let coefficients: Vec<f32> = photons
            .iter()
            .flat_map(|photon| {
                let mut dense = vec![0.0; n];
                photon.entries().iter().for_each(|entry| dense[entry.index as usize] = entry.value as f32);
                dense
            })
            .collect();
        let mut sum = Accumulator::new(&space);
        let mut other = Accumulator::new(&space);
        let (mut a, mut b, mut c, mut d, mut e) =
            (vec![0.0; n], vec![0.0; n], vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut scratch = vec![0.0_f32; n];
        let [axpy, pooled, sparse, dense, uncompressed] = best(
            runs,
            [
                &mut || {
                    sum.clear();
                    for (photon, &weight) in black_box(&photons).iter().zip(&weights) {
                        sum.axpy(weight, photon).unwrap_or_else(|e| unreachable!("{e}"));
                    }
                    sum.samples_into(black_box(&mut a));
                },
                &mut || {
                    other.clear();
                    let weighted = black_box(&weights).iter().copied().enumerate();
                    pool.gather(weighted, &mut other).unwrap_or_else(|e| unreachable!("{e}"));
                    other.samples_into(black_box(&mut b));
                },
                &mut || {
                    c.fill(0.0);
                    for (photon, &weight) in black_box(&photons).iter().zip(&weights) {
                        photon.add_samples(weight, &mut c);
                    }
                },
                &mut || {
                    d.fill(0.0);
                    for (photon, &weight) in black_box(&coefficients).chunks_exact(n).zip(&weights) {
                        scratch.copy_from_slice(photon);
                        plan.inverse(&mut scratch);
                        d.iter_mut().zip(&scratch).for_each(|(sum, &x)| *sum += weight * f64::from(x));
                    }
                },
                &mut || {
                    e.fill(0.0);
                    for (photon, &weight) in black_box(&stored).chunks_exact(n).zip(&weights) {
                        e.iter_mut().zip(photon).for_each(|(sum, &x)| *sum += weight * f64::from(x));
                    }
                },
            ],
        );
        let off = |other: &[f64]| {
            let most = other.iter().zip(&c).fold(0.0_f64, |most, (x, y)| most.max((x - y).abs()));
            most / c.iter().fold(0.0_f64, |most, x| most.max(x.abs()))
        };
        let worst = [&a, &b, &d, &e].into_iter().map(|x| off(x)).fold(0.0, f64::max);
        assert!(worst < 1e-5, "{worst}");
        println!(
            "| {} | {k} | {axpy:.1} | {pooled:.1} | {sparse:.1} | {dense:.0} | {uncompressed:.1} | {:.1} × | {:.1} × | {:.0} | {:.0} |",
            space.name(),
            sparse / pooled,
            uncompressed / pooled,
            pool.bytes() as f64 / 1024.0,
            4.0 * (stored.len() as f64) / 1024.0,
        );
    }
}

fn products(runs: usize, name: &str, n: usize) {
    let space = line(name, n);
    let plan = Plan::new(&[Axis::Index { count: n, labels: vec![] }], &[transform(name)]);
    let plan = plan.unwrap_or_else(|e| unreachable!("{e}"));
    let start = Instant::now();
    let couplings = Couplings::new(&space).unwrap_or_else(|e| unreachable!("{e}"));
    let built = start.elapsed().as_secs_f64() * 1e3;
    for k in [4, 8, 16, 32] {
        let (left, right) = (spectra(&space, PAIRS, k, 0), spectra(&space, PAIRS, k, 10_000));
        let fixed = Multiplier::new(&space, &left[0].samples()).unwrap_or_else(|e| unreachable!("{e}"));
        let (mut a, mut b, mut c) = (Accumulator::new(&space), Accumulator::new(&space), vec![0.0; n]);
        let (mut f, mut g, mut single) = (vec![0.0; n], vec![0.0; n], vec![0.0_f32; n]);
        let (mut f2, mut g2) = (vec![0.0; n], vec![0.0; n]);
        let known = left[0].samples();
        let (mut g3, mut c3) = (vec![0.0; n], vec![0.0; n]);
        let [coupled, by_rows, by_plan, multiplied, half] = best(
            runs,
            [
                &mut || {
                    for (x, y) in black_box(&left).iter().zip(&right) {
                        a.clear();
                        couplings.product_into(1.0, x, y, &mut a).unwrap_or_else(|e| unreachable!("{e}"));
                    }
                },
                &mut || {
                    for (x, y) in black_box(&left).iter().zip(&right) {
                        f.fill(0.0);
                        g.fill(0.0);
                        x.add_samples(1.0, &mut f);
                        y.add_samples(1.0, &mut g);
                        f.iter_mut().zip(&g).for_each(|(f, g)| *f *= g);
                        space.analyse_into(&f, black_box(&mut c));
                    }
                },
                &mut || {
                    for (x, y) in black_box(&left).iter().zip(&right) {
                        f2.fill(0.0);
                        g2.fill(0.0);
                        x.add_samples(1.0, &mut f2);
                        y.add_samples(1.0, &mut g2);
                        single.iter_mut().zip(&f2).zip(&g2).for_each(|((s, f), g)| *s = (f * g) as f32);
                        plan.forward(black_box(&mut single));
                    }
                },
                &mut || {
                    for y in black_box(&right) {
                        b.clear();
                        fixed.product_into(1.0, y, &mut b).unwrap_or_else(|e| unreachable!("{e}"));
                    }
                },
                &mut || {
                    for y in black_box(&right) {
                        g3.fill(0.0);
                        y.add_samples(1.0, &mut g3);
                        g3.iter_mut().zip(&known).for_each(|(g, f)| *g *= f);
                        space.analyse_into(&g3, black_box(&mut c3));
                    }
                },
            ],
        );
        let each = |time: f64| time / PAIRS as f64;
        let decoded = by_rows.min(by_plan);
        println!(
            "| {} | {k} | {:.2} | {:.2} | {:.2} × | {:.2} | {:.2} | {:.2} × | {:.0} | {:.0} | {built:.0} |",
            space.name(),
            each(coupled),
            each(decoded),
            decoded / coupled,
            each(multiplied),
            each(half),
            half / multiplied,
            couplings.len() as f64 / 1000.0,
            couplings.bytes() as f64 / 1024.0,
        );
    }
}

fn main() {
    let runs = std::env::var("RUNS").ok().and_then(|runs| runs.parse().ok()).unwrap_or(200);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.unwrap_or_else(|e| unreachable!("{e}")).install(|| {
        println!("Gathering {PHOTONS} photons, µs:");
        println!("| basis | k | axpy | axpy from a pool | decode each | decode each by the plan | uncompressed | decode / pool | uncompressed / pool | pool, KiB | uncompressed, KiB |");
        println!("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|");
        gathering(runs, "villasenor9.7", 75);
        gathering(runs, "haar", 75);
        println!("\nProducts of two spectra of k coefficients, µs each:");
        println!("| basis | k | couplings | decode, multiply, encode | ratio | multiplier | decode, multiply, encode, one factor decoded | ratio | couplings, thousand | KiB | made in ms |");
        println!("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|");
        for name in ["haar", "bior4.4", "db4"] {
            for n in [75, 96] {
                products(runs, name, n);
            }
        }
    });
}
