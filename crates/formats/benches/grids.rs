//! Times of measurements on their own grids of angles: a lamp, a car paint and a table of 4.4 million samples. Each is
//! compressed to er(L2) 1 %, decoded, opened, and evaluated at 20,000 directions, one by one and in one batch.
//!
//! `cargo bench -p wavelume-formats --bench grids`; parts of names after it (`-- aerolamp carpaint`) select
//! measurements. One core; the least of several runs, in wall-clock and processor time. For directions it is the sum of
//! the least times of batches of a thousand, which are short enough that a busy machine leaves some undisturbed.
#![allow(clippy::print_stdout, reason = "a bench prints its figures")]

mod common;

use common::{Times, encoded, least, measurement};
use std::hint::black_box;
use wavelume_core::compress::{Target, decode};
use wavelume_core::domain::{
    Axis, AzimuthExtent, Azimuths, Direction, DirectionGrid, Frame, Measurement, Quantity, Sampling, Tensor,
};
use wavelume_core::evaluate::{Directions, Interpolation, Material, Pairs, Place};

const FILES: [&str; 2] = ["data/aerolamp.ies", "data/carpaint_blue.mbsdf"];
const QUERIES: usize = 20_000;
/// Number of directions timed together, and number of repetitions.
const SLICE: usize = 1_000;
const ROUNDS: usize = 40;

/// Returns a pseudo-random fraction.
fn fraction(i: usize) -> f64 {
    let mixed = (i as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    (((mixed >> 32) ^ mixed) & 0xFFFF_FFFF) as f64 / 4_294_967_296.0
}

/// A glossy BRDF with 1 % of noise on 45 × 90 × 360 directions, in three channels.
fn large() -> Measurement {
    let azimuths = Azimuths { angles: (0..360).map(f64::from).collect(), extent: AzimuthExtent::Circle };
    let polar = (0..90).map(f64::from).collect();
    let grid = DirectionGrid::new(Frame::Surface, polar, Some(azimuths)).unwrap_or_else(|e| unreachable!("{e}"));
    let directions: Vec<[f64; 3]> = (0..grid.len()).map(|i| grid.direction(i).xyz()).collect();
    let elevations: Vec<f64> = (0..45).map(|i| 2.0 * f64::from(i)).collect();
    let mut samples = Vec::with_capacity(elevations.len() * directions.len() * 3);
    for &theta in &elevations {
        let [x, _, z] = Direction::from_degrees(theta, 0.0).xyz();
        for wo in &directions {
            let h = [x + wo[0], wo[1], z + wo[2]];
            let slope = (h[0] * h[0] + h[1] * h[1]) / (h[2] * h[2] + 1e-9);
            let lobe = 4.0 / ((1.0 + 40.0 * slope) * (1.0 + 40.0 * slope));
            for base in [0.05, 0.1, 0.2] {
                samples.push(((base + lobe) * (1.0 + 0.034 * (fraction(samples.len()) - 0.5))) as f32);
            }
        }
    }
    let tensor = Tensor::new(vec![Axis::Elevation(elevations), Axis::Grid(grid), Axis::Rgb], samples);
    let tensor = tensor.unwrap_or_else(|e| unreachable!("{e}"));
    let unit = Quantity::Brdf.default_unit();
    Measurement::new(Quantity::Brdf, unit, Sampling::Point, tensor).unwrap_or_else(|e| unreachable!("{e}"))
}

fn compressed(measurement: &Measurement) -> Vec<u8> {
    encoded(measurement, Target::ErL2(0.01)).bytes
}

/// Returns the coordinates of directions on the measured side of the surface, or all around a lamp.
fn coordinates(first: usize, has_incoming: bool) -> [Vec<f32>; 3] {
    let direction = |i: usize| {
        let (z, phi) = (fraction(2 * i + first), 360.0 * fraction(2 * i + 1 + first));
        let z = if has_incoming { z } else { 2.0 * z - 1.0 };
        Direction::from_degrees(z.acos().to_degrees(), phi).xyz()
    };
    std::array::from_fn(|k| (0..QUERIES).map(|i| direction(i)[k] as f32).collect())
}

fn main() {
    let parts: Vec<String> = std::env::args().skip(1).filter(|part| !part.starts_with('-')).collect();
    let is_wanted = |name: &str| parts.is_empty() || parts.iter().any(|part| name.contains(part.as_str()));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.unwrap_or_else(|e| unreachable!("{e}")).install(|| {
        for path in FILES.into_iter().filter(|path| is_wanted(path)) {
            times(path, &measurement(path), 6);
        }
        for name in ["4.4 million samples"].into_iter().filter(|name| is_wanted(name)) {
            times(name, &large(), 1);
        }
    });
}

fn times(name: &str, measurement: &Measurement, runs: usize) {
    let samples = measurement.tensor.len();
    let bytes = compressed(measurement);
    let material = Material::open(&bytes).unwrap_or_else(|e| unreachable!("{e}"));
    let mut best: [Times; 3] = [[f64::INFINITY; 2]; 3];
    for run in 0..runs.max(3) {
        if run < runs {
            least(&mut best[0], || drop(black_box(compressed(black_box(measurement)))));
        }
        least(&mut best[1], || drop(black_box(decode(black_box(&bytes)))));
        least(&mut best[2], || drop(black_box(Material::open(black_box(&bytes)))));
    }
    println!("{name}: {samples} samples, {} bytes, one core", bytes.len());
    for (what, [clock, processor]) in ["compress to er(L2) 0.01", "decode", "open"].iter().zip(best) {
        println!("  {what}: {clock:.1} ms, {processor:.1} ms of the processor");
    }
    for (what, nanoseconds) in ["evaluate one by one", "evaluate in a batch"].iter().zip(directions(&material)) {
        println!("  {what}: {nanoseconds:.0} ns a direction");
    }
}

/// Returns nanoseconds per direction, one by one and in batches.
fn directions(material: &Material) -> [f64; 2] {
    let (has_incoming, lambdas) = (material.quantity() != Quantity::Edf, material.lambdas());
    let (wi, wo) = (coordinates(0, has_incoming), coordinates(1 << 20, has_incoming));
    let each = |of: &[Vec<f32>; 3]| -> Vec<Option<Direction>> {
        let [x, y, z] = of.each_ref().map(|c| c.iter().map(|&c| f64::from(c)));
        x.zip(y).zip(z).map(|((x, y), z)| Direction::new(x, y, z)).collect()
    };
    let (each_wi, each_wo) = (each(&wi), each(&wo));
    let mut out = vec![0.0; SLICE * lambdas];
    let mut sums = [0.0; 2];
    for start in (0..QUERIES).step_by(SLICE) {
        let mut best: [Times; 2] = [[f64::INFINITY; 2]; 2];
        for _ in 0..ROUNDS {
            least(&mut best[0], || {
                for (i, out) in (start..).zip(out.chunks_exact_mut(lambdas)) {
                    let place = Place { index: &[], wi: each_wi[i].filter(|_| has_incoming), wo: each_wo[i] };
                    let _ = black_box(material.evaluate(place, Interpolation::Smooth, out));
                }
            });
            least(&mut best[1], || {
                let [of_wi, of_wo] = [&wi, &wo].map(|of| {
                    let [x, y, z] = of.each_ref().map(|c| &c[start..start + SLICE]);
                    Some(Directions::new(x, y, z))
                });
                let pairs = Pairs { index: &[], wi: of_wi.filter(|_| has_incoming), wo: of_wo };
                let _ = black_box(material.spectra(pairs, Interpolation::Smooth, &mut out));
            });
        }
        sums.iter_mut().zip(best).for_each(|(sum, [clock, _])| *sum += 1e6 * clock / QUERIES as f64);
    }
    sums
}
