//! Reproduction of table 9 of \[CPB06\]: variance reduction by importance sampling, by the tree level at which sampling
//! ends.
//!
//! `cargo run --release -p wavelume-formats --example table9`
//!
//! An analytic gloss (α = 0.2) is summed over the 1,024 triangles of level 4 for 24 incoming directions. Directions are
//! drawn from that tree down to levels 0 to 4, with a density in the last triangle that is uniform, or linear between
//! its vertices. The table has the variance of f · cos / pdf, with f analytic and averaged over 75 wavelengths. It is
//! relative to that of directions drawn uniformly over the hemisphere: (a) incoming cosines from 0.5 to 1, (b) from
//! 0.05 to 1.
//!
//! It fails (exit code 1) if an estimate is more than 5 % from the reference, or a variance of (a) above the paper's.

mod common;
mod gloss;

use gloss::{Gloss, Vector};
use rand::RngExt;
use rand_pcg::Pcg32;
use std::error::Error;
use std::f64::consts::TAU;
use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use wavelume_core::domain::{Direction, Domain, TriangleMesh};
use wavelume_core::evaluate::{Density, Measure, SampleOptions, WarpMesh, Warps};

const SURFACE: Gloss = Gloss { alpha: 0.2, diffuse: 0.5 };
const LEVEL: u8 = 4;
/// Number of incoming directions, and of strata along a side of the square for each of them.
const INCOMING: usize = 24;
const STRATA: usize = 100;
/// Level difference of the triangles over which a leaf is integrated.
const FINER: u8 = 3;
/// Change of the variance in % as published: directions drawn by the cosine, and from the tree down to levels 0 to 4.
const PAPER: [f64; 6] = [-50.0, -60.0, -78.0, -85.0, -86.0, -87.0];

fn main() -> ExitCode {
    common::main("table9", |path, out| match path {
        None => run(INCOMING, STRATA, out),
        Some(_) => Err("expected no argument".into()),
    })
}

/// Prints the table; returns true if its checks pass.
pub(crate) fn run(incoming: usize, strata: usize, out: &mut impl Write) -> Result<bool, Box<dyn Error>> {
    let mesh = TriangleMesh::new(Domain::Hemisphere, LEVEL).ok_or("no such level")?;
    let mesh = Arc::new(WarpMesh::new(mesh, Measure::Projected));
    writeln!(out, "| variance against uniform directions, % | cosine | level 0 | 1 | 2 | 3 | 4 |")?;
    writeln!(out, "|---|--:|--:|--:|--:|--:|--:|")?;
    row(out, "[CPB06], a shiny plastic", &PAPER, 0)?;
    let mut holds = true;
    for (name, cosines) in [("(a) cos θi 0.5 to 1", [0.5, 1.0]), ("(b) cos θi 0.05 to 1", [0.05, 1.0])] {
        let found = changes(&mesh, cosines, incoming, strata)?;
        holds &= found.agrees;
        for (density, changes) in ["equal density", "linear density"].into_iter().zip(found.changes) {
            row(out, &format!("{name}, {density}"), &changes, 2)?;
            let below = changes[1..].iter().zip(&PAPER[1..]).all(|(ours, paper)| ours <= paper);
            holds &= below || cosines[0] < 0.5;
        }
    }
    Ok(holds)
}

fn row(out: &mut impl Write, name: &str, changes: &[f64; 6], digits: usize) -> Result<(), Box<dyn Error>> {
    let cells: Vec<String> = changes.iter().map(|change| format!("{change:.digits$}").replace('-', "−")).collect();
    Ok(writeln!(out, "| {name} | {} |", cells.join(" | "))?)
}

struct Found {
    /// Change of the variance in %, for uniform and for linear density: by the cosine, and from the tree down to levels
    /// 0 to 4.
    changes: [[f64; 6]; 2],
    /// True if every estimate is within 5 % of the reference.
    agrees: bool,
}

/// Returns the change of the variance, averaged over random incoming directions.
fn changes(mesh: &Arc<WarpMesh>, cosines: [f64; 2], incoming: usize, strata: usize) -> Result<Found, Box<dyn Error>> {
    let mut random = Pcg32::new(0x7_ab1e, 9);
    let (mut uniform, mut drawn, mut agrees) = (0.0, [[0.0; 6]; 2], true);
    for _ in 0..incoming {
        let z: f64 = cosines[0] + (cosines[1] - cosines[0]) * random.random::<f64>();
        let wi = Direction::from_radians(z.acos(), TAU * random.random::<f64>()).xyz();
        let warps = warps(mesh, wi)?;
        let on_hemisphere = |z: f64, v: f64| {
            let r = (1.0 - z * z).sqrt();
            [r * (TAU * v).cos(), r * (TAU * v).sin(), z]
        };
        let [reference, variance] = moments(2 * strata, |[u, v]| Some(light(wi, on_hemisphere(u, v)) * TAU));
        uniform += variance;
        let by_cosine = moments(2 * strata, |[u, v]| {
            let wo = on_hemisphere((1.0 - u).sqrt(), v);
            Some(light(wi, wo) * (0.5 * TAU) / wo[2])
        });
        for (density, drawn) in [Density::Uniform, Density::Linear].into_iter().zip(&mut drawn) {
            drawn[0] += by_cosine[1];
            for (level, drawn) in (0..=LEVEL).zip(&mut drawn[1..]) {
                let options = SampleOptions { level: Some(level), density, defensive: 0.0 };
                let [mean, variance] = moments(strata, |u| {
                    warps.sample(0, u, &options).map(|drawn| light(wi, drawn.direction.xyz()) / drawn.pdf)
                });
                agrees &= (mean / reference - 1.0).abs() < 0.05;
                *drawn += variance;
            }
        }
    }
    Ok(Found { changes: drawn.map(|all| all.map(|variance| 100.0 * (variance / uniform - 1.0))), agrees })
}

/// Returns the tree of one incoming direction.
fn warps(mesh: &Arc<WarpMesh>, wi: Vector) -> Result<Warps, Box<dyn Error>> {
    let fine = TriangleMesh::new(mesh.mesh().domain(), LEVEL + FINER).ok_or("no such level")?;
    let parts = 1 << (2 * FINER);
    Ok(Warps::new(Arc::clone(mesh), 1, |_, integrals, values| {
        for i in 0..fine.len() {
            integrals[i / parts] += light(wi, fine.centroid(i).xyz()) * fine.solid_angle(i);
        }
        for (value, vertex) in values.iter_mut().zip(mesh.vertices()) {
            *value = light(wi, vertex.xyz());
        }
    }))
}

/// Returns f · cos, averaged over 380 to 750 nm every 5 nm.
fn light(wi: Vector, wo: Vector) -> f64 {
    static BASE: std::sync::LazyLock<f64> =
        std::sync::LazyLock::new(|| (0..75).map(|i| SURFACE.base(380.0 + 5.0 * f64::from(i))).sum::<f64>() / 75.0);
    (*BASE + SURFACE.lobe(wi, wo)) * wo[2].max(1e-9)
}

/// Returns mean and variance of a weight evaluated at one point in each of n × n strata.
fn moments(n: usize, weight: impl Fn([f64; 2]) -> Option<f64>) -> [f64; 2] {
    let mut random = Pcg32::new(0x7a_b1e9, 1);
    let mut sums = [0.0; 2];
    for i in 0..n * n {
        let w = weight([i / n, i % n].map(|k| (k as f64 + random.random::<f64>()) / n as f64)).unwrap_or(0.0);
        sums[0] += w;
        sums[1] += w * w;
    }
    let [mean, square] = sums.map(|s| s / (n * n) as f64);
    [mean, square - mean * mean]
}
