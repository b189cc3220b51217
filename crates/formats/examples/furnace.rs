//! A renderer's use of a material: opens it, draws directions, evaluates, and checks its estimate of albedo.
//!
//! `cargo run --release -p wavelume-formats --example furnace -- M.wlm`; without a file it uses a white GGX of its own.
//!
//! For some incoming directions and wavelengths it prints
//! * `stored`: the albedo that the material stores, of the piecewise constant function;
//! * `drawn`: its estimate by importance sampling alone, mean of f · cos / pdf ± one standard error;
//! * `smooth`: that of the smooth function, with three of four directions drawn from the material and one by the
//!   cosine, ± one standard error;
//! * `differs`: the change caused by interpolation itself, by quadrature of the smooth function.
//!
//! It fails (exit code 1) if an estimate is more than four standard errors from the stored albedo. For the smooth
//! function the change by interpolation is added first. It also fails if the energy report shows a violation of
//! conservation.

mod common;

use rand::RngExt;
use rand_pcg::Pcg32;
use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::io::Write;
use std::process::ExitCode;
use wavelume_core::domain::limits::MAX_LEVEL;
use wavelume_core::domain::{Axis, Direction, Domain, TriangleMesh};
use wavelume_core::evaluate::physics::Verdict;
use wavelume_core::evaluate::{Interpolation, Material, Place, Side};

/// Number of independent estimates, whose spread gives the standard error, and of strata along a side of the square in
/// each.
const ESTIMATES: usize = 24;
const STRATA: usize = 20;
/// Fraction of directions drawn from the material in the mixed estimate; the rest is drawn by the cosine.
const FROM_MATERIAL: f64 = 0.75;
/// Allowed deviation of an estimate in standard errors, and relative tolerance for sums of f32 samples.
const MOST_ERRORS: f64 = 4.0;
const ROUNDING: f64 = 5e-4;

/// White metal: every wavelength is reflected, and only light that facets hide from each other is lost.
const WHITE: &str = r#"{"wavelume": "virtual", "quantity": "brdf",
    "model": {"ggx": {"alpha": {"isotropic": 0.25}, "fresnel": "mirror"}},
    "axes": ["hemi:2", "hemi:4", "lambda:400:50:7"]}"#;

fn main() -> ExitCode {
    common::main("furnace", run)
}

/// Prints the table for the material in `path`, or for a built-in one; returns true if all estimates agree.
pub(crate) fn run(path: Option<&str>, out: &mut impl Write) -> Result<bool, Box<dyn Error>> {
    let bytes = common::material(path, WHITE)?;
    let material = Material::open(&bytes)?;
    if !material.quantity().has_cosine() {
        return Err(format!("a {} has no albedo, expected a brdf, btdf or bsdf", material.quantity()).into());
    }
    let index = vec![0; material.axes().iter().take_while(|axis| matches!(axis, Axis::Index { .. })).count()];
    writeln!(out, "{}: {} bytes, {}", path.unwrap_or("white GGX"), bytes.len(), material.quantity())?;
    writeln!(out, "  wi theta   lambda   stored     drawn              smooth             differs")?;
    let mut agrees = true;
    for wi in incoming(&material) {
        agrees &= row(&material, &index, wi, out)?;
    }
    let energy = material.energy()?.albedo.ok_or("no albedo to report")?;
    let largest = energy.largest.ok_or("everything is masked")?;
    let conserves = energy.verdict != Verdict::Broken;
    writeln!(
        out,
        "  furnace: albedo at most {:.4}, {} 1 + {:.4} (the file's largest error)",
        largest.value,
        if conserves { "within" } else { "above" },
        energy.allowance.bound
    )?;
    writeln!(out, "  {}", if agrees { "estimates agree" } else { "ESTIMATES DISAGREE" })?;
    Ok(agrees && conserves)
}

/// Returns some incoming directions spread over the material's incoming axis.
fn incoming(material: &Material) -> Vec<Direction> {
    let directions: Vec<Direction> = match material.axes().iter().find(|axis| axis.is_directional()) {
        Some(Axis::Triangles(mesh)) => (0..mesh.len()).map(|i| mesh.centroid(i)).collect(),
        Some(Axis::Elevation(values)) => values.iter().map(|&theta| Direction::from_degrees(theta, 25.0)).collect(),
        _ => Vec::new(),
    };
    directions.iter().copied().step_by(directions.len().div_ceil(5).max(1)).collect()
}

/// Processes one incoming direction: estimates every wavelength from the same directions, and prints the first, middle
/// and last.
fn row(material: &Material, index: &[usize], wi: Direction, out: &mut impl Write) -> Result<bool, Box<dyn Error>> {
    let lambdas = material.lambdas();
    let (mut stored, mut smooth_albedo) = (vec![0.0; lambdas], vec![0.0; lambdas]);
    material.albedo(index, Some(wi), Interpolation::Constant, &mut stored)?;
    let finer = 2.min(MAX_LEVEL - mesh(material).map_or(MAX_LEVEL, TriangleMesh::level));
    material.integrated(Side::Both, index, Some(wi), Interpolation::Smooth, finer, &mut smooth_albedo)?;
    let drawn = estimate(material, index, wi, Interpolation::Constant, 1.0)?;
    let smooth = estimate(material, index, wi, Interpolation::Smooth, FROM_MATERIAL)?;
    let mut agrees = true;
    let wavelengths = material.wavelengths();
    let mut shown = vec![0, lambdas / 2, lambdas - 1];
    shown.dedup();
    for lambda in 0..lambdas {
        let expected = f64::from(stored[lambda]);
        if expected.is_nan() {
            continue;
        }
        let differs = f64::from(smooth_albedo[lambda]) - expected;
        let allowed = |estimate: Estimate| MOST_ERRORS * estimate.error + ROUNDING * expected.abs();
        let good = (drawn[lambda].mean - expected).abs() <= allowed(drawn[lambda])
            && (smooth[lambda].mean - expected).abs() <= allowed(smooth[lambda]) + differs.abs();
        agrees &= good;
        if !good || shown.contains(&lambda) {
            writeln!(
                out,
                "  {:8.2} {:>8} {:8.4} {} {} {differs:+9.4}{}",
                wi.theta_degrees(),
                wavelengths.as_ref().map_or_else(|| format!("#{lambda}"), |nm| format!("{}", nm[lambda])),
                expected,
                drawn[lambda],
                smooth[lambda],
                if good { "" } else { "  disagrees" }
            )?;
        }
    }
    Ok(agrees)
}

/// Mean with its standard error.
#[derive(Clone, Copy)]
struct Estimate {
    mean: f64,
    error: f64,
}

impl std::fmt::Display for Estimate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:8.4} ± {:.5}", self.mean, self.error)
    }
}

/// Returns the albedo of every wavelength from stratified points. A fraction `share` of the directions is drawn from
/// the material, the others by the cosine. Every value is divided by the combined density of both.
fn estimate(
    material: &Material,
    index: &[usize],
    wi: Direction,
    how: Interpolation,
    share: f64,
) -> Result<Vec<Estimate>, Box<dyn Error>> {
    let mut random = Pcg32::new(0x00f0_2ace, 1);
    let mut spectrum = vec![0.0; material.lambdas()];
    let mut sums = vec![(0.0, 0.0); spectrum.len()];
    for _ in 0..ESTIMATES {
        let mut light = vec![0.0; spectrum.len()];
        for stratum in 0..STRATA * STRATA {
            let mut jittered = |k: usize| (k as f64 + random.random::<f64>()) / STRATA as f64;
            let u = [jittered(stratum / STRATA), jittered(stratum % STRATA)];
            let Some((wo, pdf)) = draw(material, index, wi, u, share)? else { continue };
            material.evaluate(Place { index, wi: Some(wi), wo: Some(wo) }, how, &mut spectrum)?;
            let factor = wo.cos_theta().abs() / pdf / (STRATA * STRATA) as f64;
            for (light, value) in light.iter_mut().zip(&spectrum).filter(|(_, value)| !value.is_nan()) {
                *light += factor * f64::from(*value);
            }
        }
        for (sum, light) in sums.iter_mut().zip(light) {
            *sum = (sum.0 + light, sum.1 + light * light);
        }
    }
    let n = ESTIMATES as f64;
    let estimate = |(first, second): (f64, f64)| {
        let mean = first / n;
        Estimate { mean, error: ((second / n - mean * mean).max(0.0) / (n - 1.0)).sqrt() }
    };
    Ok(sums.into_iter().map(estimate).collect())
}

/// Draws a direction with its density; `None` if the material reflects nothing.
fn draw(
    material: &Material,
    index: &[usize],
    wi: Direction,
    [u, v]: [f64; 2],
    share: f64,
) -> Result<Option<(Direction, f64)>, Box<dyn Error>> {
    let wo = if u < share {
        match material.sample(index, Some(wi), [u / share, v], None::<u8>)? {
            Some(sample) => sample.direction,
            None => return Ok(None),
        }
    } else {
        by_cosine(domain(material), [(u - share) / (1.0 - share), v])
    };
    let own = material.pdf(index, Some(wi), wo, None::<u8>)?;
    let whole = if domain(material) == Domain::Sphere { 2.0 } else { 1.0 };
    Ok(Some((wo, share * own + (1.0 - share) * wo.cos_theta().abs() / (PI * whole))))
}

/// Returns a direction of an outgoing domain with density |cos θ| / π; half of that on the sphere.
fn by_cosine(domain: Domain, [u, v]: [f64; 2]) -> Direction {
    let (u, up) = match domain {
        Domain::Hemisphere => (u, true),
        Domain::Lower => (u, false),
        Domain::Sphere => (2.0 * u % 1.0, u < 0.5),
    };
    // At least a little above the horizon: a density of 0 has no weight.
    let cos = (1.0 - u).max(1e-12).sqrt();
    let theta = cos.acos();
    Direction::from_radians(if up { theta } else { PI - theta }, TAU * v)
}

fn domain(material: &Material) -> Domain {
    mesh(material).map_or(Domain::Hemisphere, TriangleMesh::domain)
}

/// Returns the triangles of the outgoing axis, which is the last triangle axis.
fn mesh(material: &Material) -> Option<TriangleMesh> {
    material.axes().iter().rev().find_map(|axis| match axis {
        Axis::Triangles(mesh) => Some(*mesh),
        _ => None,
    })
}
