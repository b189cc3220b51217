//! A luminaire in use: opens a material, prints its flux, and checks it by drawing directions.
//!
//! `cargo run --release -p wavelume-formats --example luminaire -- LAMP.wlm`; without a file it uses a spotlight of its
//! own. The estimate is the mean of I / pdf over stratified directions ± one standard error, for every wavelength. It
//! fails (exit code 1) if an estimate is more than four standard errors from the stored flux.

mod common;

use rand::RngExt;
use rand_pcg::Pcg32;
use std::error::Error;
use std::io::Write;
use std::process::ExitCode;
use wavelume_core::domain::Quantity;
use wavelume_core::evaluate::{Interpolation, Material, Place};

/// Number of independent estimates, and of strata along a side of the square in each.
const ESTIMATES: usize = 24;
const STRATA: usize = 20;
/// Allowed deviation of an estimate in standard errors, and relative tolerance for sums of f32 samples.
const MOST_ERRORS: f64 = 4.0;
const ROUNDING: f64 = 5e-4;

/// A spotlight that points down, and some light everywhere.
const SPOTLIGHT: &str = r#"{"wavelume": "virtual", "quantity": "edf", "unit": "mW/sr/nm",
    "model": {"sum": [{"scale": 5.0, "lobe": {"cosine_power": {"theta": 180, "exponent": 12}}},
                      {"scale": 0.25, "lobe": "isotropic"}]},
    "axes": ["sphere:4", "lambda:400:20:17"]}"#;

fn main() -> ExitCode {
    common::main("luminaire", run)
}

/// Prints the flux of the luminaire in `path`, or of a built-in one; returns true if the estimates agree.
pub(crate) fn run(path: Option<&str>, out: &mut impl Write) -> Result<bool, Box<dyn Error>> {
    let bytes = common::material(path, SPOTLIGHT)?;
    let material = Material::open(&bytes)?;
    if material.quantity() != Quantity::Edf {
        return Err(format!("a {} has no flux, expected an edf", material.quantity()).into());
    }
    let flux = material.energy()?.flux.unwrap_or_default();
    let flux = flux.first().ok_or("no flux to report")?;
    writeln!(out, "{}: {} bytes", path.unwrap_or("spotlight"), bytes.len())?;
    if let Some(total) = flux.total {
        writeln!(out, "  {total:.2} {}", flux.total_unit)?;
    }
    match (flux.luminous, &flux.reason) {
        (Some(luminous), _) => writeln!(out, "  luminous flux {luminous:.1} lm")?,
        (None, reason) => writeln!(out, "  no luminous flux: {}", reason.as_deref().unwrap_or_default())?,
    }
    let index = vec![0; flux.index.len()];
    let estimates = estimate(&material, &index)?;
    let wavelengths = material.wavelengths();
    writeln!(out, "    lambda     stored      drawn, {}", flux.unit)?;
    let mut agrees = true;
    for (lambda, (stored, (mean, error))) in flux.spectral.iter().zip(estimates).enumerate() {
        let Some(stored) = stored else { continue };
        let good = (mean - stored).abs() <= MOST_ERRORS * error + ROUNDING * stored.abs();
        agrees &= good;
        let at = wavelengths.as_ref().map_or_else(|| format!("#{lambda}"), |nm| format!("{}", nm[lambda]));
        writeln!(out, "  {at:>8} {stored:10.4} {mean:10.4} ± {error:.4}{}", if good { "" } else { "  disagrees" })?;
    }
    writeln!(out, "  {}", if agrees { "estimates agree" } else { "ESTIMATES DISAGREE" })?;
    Ok(agrees)
}

/// Returns mean and standard error of the flux of every wavelength, for the piecewise constant intensity.
fn estimate(material: &Material, index: &[usize]) -> Result<Vec<(f64, f64)>, Box<dyn Error>> {
    let mut random = Pcg32::new(0x1a_37, 1);
    let mut intensity = vec![0.0; material.lambdas()];
    let mut sums = vec![(0.0, 0.0); intensity.len()];
    for _ in 0..ESTIMATES {
        let mut flux = vec![0.0; intensity.len()];
        for stratum in 0..STRATA * STRATA {
            let mut jittered = |k: usize| (k as f64 + random.random::<f64>()) / STRATA as f64;
            let u = [jittered(stratum / STRATA), jittered(stratum % STRATA)];
            let Some(sample) = material.sample(index, None, u, None::<u8>)? else { continue };
            let place = Place { index, wi: None, wo: Some(sample.direction) };
            material.evaluate(place, Interpolation::Constant, &mut intensity)?;
            for (flux, value) in flux.iter_mut().zip(&intensity).filter(|(_, value)| !value.is_nan()) {
                *flux += f64::from(*value) / sample.pdf / (STRATA * STRATA) as f64;
            }
        }
        for (sum, flux) in sums.iter_mut().zip(flux) {
            *sum = (sum.0 + flux, sum.1 + flux * flux);
        }
    }
    let n = ESTIMATES as f64;
    let estimate = |(first, second): (f64, f64)| {
        let mean = first / n;
        (mean, ((second / n - mean * mean).max(0.0) / (n - 1.0)).sqrt())
    };
    Ok(sums.into_iter().map(estimate).collect())
}
