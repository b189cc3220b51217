//! Chooses the interpolation between incidences: the one that best predicts each measured incidence from the others
//! (leave-one-out).

use super::fit::model;
use super::left_out::{Errors, left_out};
use super::tables::Tables;
use crate::compress::{Between, Divisor, estimate_noise};
use crate::domain::{Measurement, Quantity, Tensor};
use crate::evaluate::error::EvaluateError;
use crate::evaluate::incoming::Alignment;
use crate::evaluate::material::Material;

/// Minimum number of measured incoming directions for a choice of interpolation; with fewer the default is used.
const LEAST_INCIDENCES: usize = 4;
/// Maximum number of pairs of sampled incoming and outgoing directions for a choice of interpolation. Larger materials
/// take long to open and are sampled densely enough.
const MOST_PAIRS: usize = 1 << 20;
/// Factor on the least leave-one-out error among the methods of interpolation between incoming directions. The cheapest
/// method whose error is at most the product is chosen. Raising the factor favours cheaper methods.
const NEARLY_BEST: f64 = 1.1;
/// Ratio of leave-one-out errors below which lobes are treated as retroreflective (about the direction back to the
/// source). It divides the error with retroreflective lobes by the error with mirror-like ones.
///
/// The ratio is well below 1 because retroreflective lobes also make sampling draw about the direction back to the
/// source, and because lobes need not move at all if samples are divided by a model that fits them.
const MUCH_BETTER: f64 = 0.7;
/// Absolute difference up to which relative leave-one-out errors count as equal, as rounding and the finite triangles
/// cause such differences.
const SAME: f64 = 5e-4;

/// Chooses the interpolation between the incoming directions of a measurement by leave-one-out errors. The cheapest
/// candidate nearly as good as the best is chosen; linear ones are cheaper than cubic ones. With fewer than four
/// incoming directions, negative samples, or more than 2²⁰ pairs of directions, the result is the default.
///
/// ```
/// use wavelume_core::domain::{Axis, Measurement, Quantity, Sampling, Tensor, Unit};
/// use wavelume_core::evaluate::interpolation_between;
/// let tensor = Tensor::new(vec![Axis::Rgb], vec![0.1, 0.2, 0.3])?;
/// let colour = Measurement::new(Quantity::Spectrum, Unit::Relative, Sampling::Point, tensor)?;
/// assert!(interpolation_between(&colour)?.is_default());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn interpolation_between(measurement: &Measurement) -> Result<Between, EvaluateError> {
    let layout = measurement.layout()?;
    let axes = measurement.tensor.axes();
    let length = |axis: Option<usize>| axis.map_or(1, |axis| axes[axis].len());
    let (incidences, outgoing) = (length(layout.incoming), length(layout.outgoing));
    let is_signed = || measurement.tensor.samples().iter().any(|&sample| sample < 0.0);
    if incidences < LEAST_INCIDENCES || incidences.saturating_mul(outgoing) > MOST_PAIRS || is_signed() {
        return Ok(Between::default());
    }
    let grey = grey(measurement, length(layout.spectral))?;
    let noise = estimate_noise(&grey, 0.0).map_or(0.0, |noise| noise.relative);
    let material = Material::of(grey.clone())?;
    let Some(tables) = Tables::of(&material) else { return Ok(Between::default()) };
    let fitted = if measurement.quantity == Quantity::Brdf { model(&tables) } else { None };
    let (model, under_model) = match fitted {
        Some(first) if material.planes_of_cells().is_some() => {
            let (model, material) = refined(&grey, first)?;
            (Some(model), Some(material))
        }
        plain => (plain, None),
    };
    let under_model = under_model.as_ref().and_then(Tables::of);
    let divisors = divisors(model, measurement.quantity);
    let errors_of = |alignment: Alignment, divisors: &[Divisor], retro: bool| {
        let ways = candidates(divisors, retro).into_iter().filter(|way| way.fits(measurement.quantity, axes));
        let (modelled, plain): (Vec<Between>, Vec<Between>) =
            ways.partition(|way| matches!(way.divisor, Divisor::Model { .. }));
        let mut all: Vec<(Between, Errors)> =
            plain.iter().copied().zip(left_out(&tables, alignment, &plain, noise)?).collect();
        let of_model = left_out(under_model.as_ref().unwrap_or(&tables), alignment, &modelled, noise)?;
        all.extend(modelled.into_iter().zip(of_model));
        // The cheapest first; the model is the last of the divisors.
        all.sort_by_key(|(way, _)| way.cubic);
        best(all)
    };
    let Some((way, error)) = errors_of(tables.alignment(), &divisors, false) else {
        return Ok(Between::default());
    };
    if measurement.quantity == Quantity::Brdf && error > SAME {
        // The microfacet model's lobe lies about the mirror direction.
        let divisors: Vec<Divisor> =
            divisors.into_iter().filter(|divisor| !matches!(divisor, Divisor::Model { .. })).collect();
        if let Some((retro, retro_error)) = errors_of(Alignment::Rotation, &divisors, true)
            && retro_error < MUCH_BETTER * error
        {
            return Ok(retro);
        }
    }
    Ok(way)
}

/// Fits the microfacet model again to a measurement over triangles, with the light within triangles as the first fit
/// has it: the function's lobe may be as narrow as a triangle. Returns the model, and the material divided by it.
fn refined(grey: &Measurement, first: Divisor) -> Result<(Divisor, Material), EvaluateError> {
    let under = |divisor: Divisor| Material::with_between(grey.clone(), Between { divisor, ..Between::default() });
    let opened = under(first)?;
    match Tables::of(&opened).as_ref().and_then(model) {
        Some(divisor) if divisor != first => Ok((divisor, under(divisor)?)),
        _ => Ok((first, opened)),
    }
}

/// Candidate divisors (models by which samples are divided before interpolation) of a quantity, cheapest first.
fn divisors(model: Option<Divisor>, quantity: Quantity) -> Vec<Divisor> {
    let mut divisors = vec![Divisor::None];
    if quantity == Quantity::Brdf {
        divisors.push(Divisor::Cosines);
        if let Some(model @ Divisor::Model { roughness, .. }) = model {
            divisors.extend([Divisor::ProjectedAreas { roughness }, Divisor::Masking { roughness }, model]);
        }
    }
    divisors
}

/// Candidate interpolations between incoming directions.
fn candidates(divisors: &[Divisor], retro: bool) -> Vec<Between> {
    let of_order = |cubic: bool| divisors.iter().map(move |&divisor| Between { divisor, cubic, retro });
    of_order(false).chain(of_order(true)).collect()
}

/// Returns the first candidate interpolation whose leave-one-out error is nearly the least, and that error. Errors are
/// compared after the contribution of noise in the samples is subtracted.
fn best(ways: Vec<(Between, Errors)>) -> Option<(Between, f64)> {
    let least = ways.iter().map(|(_, error)| error.without_noise).fold(f64::INFINITY, f64::min);
    let good = ways.into_iter().find(|(_, error)| error.without_noise <= NEARLY_BEST * least + SAME);
    good.map(|(way, error)| (way, error.without_noise))
}

/// Replaces each spectrum of a measurement by its mean over wavelengths; masked samples are skipped.
fn grey(measurement: &Measurement, lambdas: usize) -> Result<Measurement, EvaluateError> {
    let axes = measurement.tensor.axes();
    let has_spectrum = measurement.layout()?.spectral.is_some();
    let axes = axes[..axes.len() - usize::from(has_spectrum)].to_vec();
    let mean = |spectrum: &[f32]| {
        let (sum, count) = spectrum
            .iter()
            .filter(|sample| !sample.is_nan())
            .fold((0.0, 0_u32), |(sum, count), &sample| (sum + f64::from(sample), count + 1));
        if count == 0 { f32::NAN } else { (sum / f64::from(count)) as f32 }
    };
    let samples = measurement.tensor.samples().chunks_exact(lambdas).map(mean).collect();
    let tensor = Tensor::new(axes, samples)?;
    Ok(Measurement { quantity: measurement.quantity, unit: measurement.unit, sampling: measurement.sampling, tensor })
}
