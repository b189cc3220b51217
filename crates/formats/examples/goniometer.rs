//! Scattered scan of a virtual goniometer: its projection compared with the truth.
//!
//! `cargo run --release -p wavelume-formats --example goniometer`; with the argument `speed` it prints the times of two
//! large scans on one thread instead.
//!
//! A gloss (GGX, α = 0.15, over a coloured diffuse base of 0.05 or 0.3) is measured at 12 incoming elevations from 0 to
//! 80°. Each has 8,000 outgoing directions, uniform in solid angle, with 1 % noise on every value and a blind spot
//! within 5° of the lamp. The table has er(L2) in % against the analytic surface at 4,000 other outgoing directions per
//! incoming one, down to 80°. It compares the smooth form with the piecewise constant cells: outside and inside the
//! blind spot, by region, and half way between incoming elevations.
//!
//! It fails (exit code 1) if the smooth form outside the blind spot is off by more than 0.6 %, or withheld samples by
//! more than 1.15 %.

mod common;
mod gloss;

use gloss::Gloss;
use std::error::Error;
use std::io::Write;
use std::process::ExitCode;
use std::time::Instant;
use wavelume_core::domain::{Axis, Direction, Quantity, Unit, WavelengthGrid};
use wavelume_core::evaluate::{Interpolation, Material, Place};
use wavelume_formats::formats::{Acquisition, Instrument, ParseReport, Samples, Scattered};
use wavelume_formats::projection::{AxesRequest, project};

/// Cosine of the radius of the blind spot around the lamp, 5°.
const BLIND: f64 = 0.996_194_698_091_745_6;
/// Height (z) of the lowest directions of the table: 80°.
const LOWEST: f64 = 0.173_648_177_666_930_3;
const NOISE: f64 = 0.01;
/// Upper bounds on er(L2) of the smooth form, and on the relative difference between the estimated noise and that of
/// the samples.
const SMOOTH: f64 = 0.006;
const OFF: f64 = 0.1;

/// Size of the scan and of its comparison.
pub(crate) struct Scan {
    pub(crate) elevations: usize,
    pub(crate) outgoing: usize,
    pub(crate) bands: usize,
    /// Number of directions in the table per incoming direction.
    pub(crate) fresh: usize,
}

const WHOLE: Scan = Scan { elevations: 12, outgoing: 8000, bands: 8, fresh: 4000 };

fn main() -> ExitCode {
    common::main("goniometer", |argument, out| match argument {
        Some("speed") => speed(out),
        _ => run(&WHOLE, out),
    })
}

/// Generator of uniform numbers from 0 to 1 (splitmix64, Steele et al. 2014).
struct Random(u64);

impl Random {
    fn even(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns a standard normal deviate (Box & Muller 1958).
    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.even()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.even()).cos()
    }

    /// Returns a direction uniform in solid angle above the height `lowest`.
    fn direction(&mut self, lowest: f64) -> Direction {
        let z = lowest + (1.0 - lowest) * self.even();
        Direction::from_radians(z.acos(), std::f64::consts::TAU * self.even())
    }
}

fn is_blind(wi: Direction, wo: Direction) -> bool {
    wi.dot(wo) > BLIND
}

impl Scan {
    pub(crate) fn theta(&self, i: usize) -> f64 {
        let last = (self.elevations - 1) as f64;
        ((80.0 * i as f64 / last) * 100.0).round() / 100.0
    }

    fn lambdas(&self) -> Result<WavelengthGrid, Box<dyn Error>> {
        Ok(WavelengthGrid::even(400.0, 300.0 / (self.bands.max(2) - 1) as f64, self.bands)?)
    }

    pub(crate) fn measure(&self, surface: &Gloss) -> Result<Acquisition, Box<dyn Error>> {
        let grid = self.lambdas()?;
        let mut random = Random(1);
        let (mut incoming, mut outgoing, mut values) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..self.elevations {
            let wi = Direction::from_degrees(self.theta(i), 0.0);
            for _ in 0..self.outgoing {
                let wo = random.direction(0.0);
                if is_blind(wi, wo) {
                    continue;
                }
                incoming.push([self.theta(i), 0.0]);
                outgoing.push([wo.theta_degrees(), wo.phi_degrees()]);
                let lobe = surface.lobe(wi.xyz(), wo.xyz());
                let value = |b| (surface.base(grid.at(b)) + lobe) * (1.0 + NOISE * random.normal());
                values.extend((0..self.bands).map(value).map(|v| v as f32));
            }
        }
        let spectral = Some(Axis::Wavelength(grid));
        Ok(Acquisition {
            format: "goniometer",
            dialect: "virtual".to_owned(),
            quantity: Quantity::Brdf,
            unit: Unit::PerSteradian,
            samples: Samples::Scattered(Scattered {
                incoming,
                outgoing,
                isotropic: true,
                spectral,
                values,
                sigma: None,
            }),
            spectral_factor: None,
            instrument: Instrument::default(),
            report: ParseReport::default(),
        })
    }
}

/// Sums of squared relative errors of the smooth and the constant form, and their count.
type Sums = [f64; 3];
const ROWS: [&str; 6] =
    ["outside the blind spot", "… peak", "… middle", "… beyond 70°", "inside the blind spot", "between elevations"];

/// Returns er(L2) of every row of the table.
fn errors(scan: &Scan, surface: &Gloss, material: &Material) -> Result<[[f64; 2]; 6], Box<dyn Error>> {
    let mut random = Random(2);
    let mut sums = [Sums::default(); 6];
    let grid = scan.lambdas()?;
    let (mut smooth, mut constant) = (vec![0.0; scan.bands], vec![0.0; scan.bands]);
    for i in 0..2 * scan.elevations - 1 {
        let theta = if i % 2 == 0 { scan.theta(i / 2) } else { 0.5 * (scan.theta(i / 2) + scan.theta(i / 2 + 1)) };
        let wi = Direction::from_degrees(theta, 0.0);
        let mut directions: Vec<Direction> = (0..scan.fresh).map(|_| random.direction(LOWEST)).collect();
        // The blind spot is small: some more for it.
        directions.extend((0..scan.fresh * 20).map(|_| random.direction(LOWEST)).filter(|&wo| is_blind(wi, wo)));
        let brightest = directions.iter().map(|wo| surface.lobe(wi.xyz(), wo.xyz())).fold(0.0, f64::max);
        for wo in directions {
            let place = Place { index: &[], wi: Some(wi), wo: Some(wo) };
            material.evaluate(place, Interpolation::Smooth, &mut smooth)?;
            material.evaluate(place, Interpolation::Constant, &mut constant)?;
            let lobe = surface.lobe(wi.xyz(), wo.xyz());
            let rows: &[usize] = match (i % 2, is_blind(wi, wo)) {
                (1, true) => continue,
                (1, false) => &[5],
                (_, true) => &[4],
                _ if lobe > 0.5 * brightest => &[0, 1],
                _ if wo.cos_theta() < 0.342 => &[0, 3],
                _ => &[0, 2],
            };
            for b in 0..scan.bands {
                let truth = surface.base(grid.at(b)) + lobe;
                for &row in rows {
                    sums[row][0] += (f64::from(smooth[b]) / truth - 1.0).powi(2);
                    sums[row][1] += (f64::from(constant[b]) / truth - 1.0).powi(2);
                    sums[row][2] += 1.0;
                }
            }
        }
    }
    Ok(sums.map(|[s, c, n]| [(s / n).sqrt(), (c / n).sqrt()]))
}

/// Prints the table; returns true if both bounds are met.
pub(crate) fn run(scan: &Scan, out: &mut impl Write) -> Result<bool, Box<dyn Error>> {
    let mut good = true;
    for diffuse in [0.05, 0.3] {
        let surface = Gloss { alpha: 0.15, diffuse };
        let projected = project(&scan.measure(&surface)?, &AxesRequest::default())?;
        let report = projected.coverage.scatter.ok_or("no report")?;
        let axes: Vec<String> = projected.measurement.tensor.axes().iter().map(Axis::describe).collect();
        writeln!(out, "GGX 0.15 over {diffuse}: {} samples onto {}", report.samples, axes.join(" × "))?;
        for note in &projected.coverage.notes {
            writeln!(out, "  {note}")?;
        }
        let material = Material::of(projected.measurement)?;
        let found = errors(scan, &surface, &material)?;
        writeln!(out, "\n| er(L2) in % against the truth | smooth | constant |\n|:--|--:|--:|")?;
        for (name, [smooth, constant]) in ROWS.iter().zip(found) {
            writeln!(out, "| {name} | {:.2} | {:.2} |", 100.0 * smooth, 100.0 * constant)?;
        }
        let (noise, rejected) = (report.noise.unwrap_or(0.0), report.rejected.samples);
        writeln!(out, "\nnoise {:.2} % of the samples, {:.2} % of them rejected", 100.0 * noise, 100.0 * rejected)?;
        writeln!(out)?;
        good &= found[0][0] <= SMOOTH && (noise / NOISE - 1.0).abs() <= OFF;
    }
    Ok(good)
}

/// Prints the times of projecting 127,000 samples in one band, and 20,000 in 2,101 bands, on one thread and on all.
fn speed(out: &mut impl Write) -> Result<bool, Box<dyn Error>> {
    for (elevations, outgoing, bands) in [(16, 7950, 1), (4, 5000, 2101)] {
        let scan = Scan { elevations, outgoing, bands, fresh: 0 };
        let measured = scan.measure(&Gloss { alpha: 0.15, diffuse: 0.3 })?;
        for threads in [1, 0] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
            let start = Instant::now();
            let projected = pool.install(|| project(&measured, &AxesRequest::default()))?;
            let seconds = start.elapsed().as_secs_f64();
            writeln!(
                out,
                "{} × {bands}: {seconds:.2} s on {} threads, {:?}",
                elevations * outgoing,
                pool.current_num_threads(),
                projected.measurement.tensor.shape()
            )?;
        }
    }
    Ok(true)
}
