//! Energy conservation: compares the stored albedo of every incoming direction, or a phase function's integral, with 1.

use super::flux::FluxReport;
use super::spot::Spot;
use crate::domain::{Domain, ErrorReport, Quantity};
use crate::evaluate::albedo::{Side, is_above};
use crate::evaluate::error::{EvaluateError, Need};
use crate::evaluate::material::Material;
use crate::evaluate::measured_share::MeasuredShare;
use crate::evaluate::stated::{Stated, domain_of};
use serde::Serialize;
use std::f64::consts::PI;

/// Tolerance for the effect that rounding samples to f32 has on an integral that is exactly 1.
const ROUNDING: f64 = 1e-6;

/// Report on the energy that leaves a material. It holds an albedo, a normalisation or a flux, depending on the
/// quantity.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct EnergyReport {
    /// Radiometric quantity of the material, such as `brdf`.
    pub quantity: Quantity,
    /// Albedo of a BRDF, BTDF or BSDF.
    pub albedo: Option<AlbedoReport>,
    /// Integrals of a phase function over the sphere, compared with 1; `None` for other quantities.
    pub normalisation: Option<NormalisationReport>,
    /// Flux of an emission, one for each combination of indices (positions on the axes before the directions).
    pub flux: Option<Vec<FluxReport>>,
    /// Measured share of the outgoing directions. With less than 80 % there is no albedo, normalisation or flux.
    pub measured: Option<MeasuredShare>,
    /// Reason why there is no albedo, normalisation or flux: too few outgoing directions were measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// Result of comparing an integral with 1, which an albedo must not exceed and the integral of a phase function must
/// equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The albedo is at most 1, or the integral of the phase function is 1, up to rounding of samples.
    Holds,
    /// The albedo exceeds 1, or the integral of the phase function differs from 1, by no more than the error of the
    /// compressed file can explain.
    WithinError,
    /// The albedo exceeds 1, or the integral of the phase function differs from 1, by more than compression can
    /// explain: the measurement itself is at fault.
    Broken,
}

/// Relative error of a sample by lossy compression, and an upper bound on the resulting error of an integral over
/// directions. Both derive from the compression errors that the file's header states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Allowance {
    /// Root mean square relative error er(L2) of a sample, as the file's header gives it.
    pub er_l2: f64,
    /// Upper bound on the error of an integral over directions whose true value is 1: largest relative error of a
    /// sample, plus the largest absolute error of samples without a relative one times the whole (projected) solid
    /// angle. 0 if the material was opened from a measurement instead of a compressed file.
    pub bound: f64,
}

/// Report on the directional–hemispherical albedos ∫ f · |cos θo| dωo of a material.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct AlbedoReport {
    /// Largest albedo among all sampled incoming directions and wavelengths; `None` if all are masked.
    pub largest: Option<Spot>,
    /// Largest albedo of reflected light alone; `None` unless both sides are measured.
    pub reflected: Option<Spot>,
    /// Largest albedo of transmitted light alone; `None` unless both sides are measured.
    pub transmitted: Option<Spot>,
    /// Mean albedo over sampled incoming directions and wavelengths.
    pub mean: f64,
    /// Excess of the largest albedo over 1; 0 if it is at most 1.
    pub excess: f64,
    /// Relative error of a sample by lossy compression, and an upper bound on the resulting error of an albedo whose
    /// true value is 1.
    pub allowance: Allowance,
    /// Result of comparing the largest albedo with 1, which it must not exceed.
    pub verdict: Verdict,
    /// Number of albedos below 0; only negative samples cause them.
    pub negative: u64,
    /// Largest albedo among all wavelengths, for every sampled incoming direction.
    pub entries: Vec<Spot>,
}

/// Report on the integrals of a phase function over the sphere, which should be 1.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct NormalisationReport {
    /// Smallest of the phase function's integrals over the sphere, one for each sampled incoming direction and
    /// wavelength.
    pub least: Option<Spot>,
    /// Largest of the phase function's integrals over the sphere, one for each sampled incoming direction and
    /// wavelength.
    pub largest: Option<Spot>,
    /// Mean of the phase function's integrals over the sphere, one for each sampled incoming direction and wavelength.
    pub mean: f64,
    /// Largest absolute difference of an integral of the phase function from 1.
    pub deviation: f64,
    /// Relative error of a sample by lossy compression, and an upper bound on the resulting error of the phase
    /// function's integral, which should be 1.
    pub allowance: Allowance,
    /// Result of comparing all integrals of the phase function with 1. [`super::Preparation::normalise`] scales those
    /// that differ.
    pub verdict: Verdict,
}

impl Material {
    /// Reports the energy that leaves the material for every sampled incoming direction and wavelength, from the
    /// piecewise constant function; albedos of samples on a grid of angles are those of the function that is linear
    /// between the angles. Fails for quantities without an outgoing axis.
    pub fn energy(&self) -> Result<EnergyReport, EvaluateError> {
        let quantity = self.quantity();
        let (measured, reason) = (self.measured_share(), self.needs_light().err());
        let reason = reason.map(|reason| reason.to_string());
        let mut report = EnergyReport { quantity, albedo: None, normalisation: None, flux: None, measured, reason };
        if report.reason.is_some() {
            return Ok(report);
        }
        if self.stated().is_some_and(Stated::has_albedo) {
            report.albedo = Some(self.albedo_report());
            return Ok(report);
        }
        if quantity == Quantity::Edf && self.outgoing_grid().is_some() {
            report.flux = Some(self.fluxes());
            return Ok(report);
        }
        let cells = self.over_triangles()?;
        cells.needs_outgoing(Need::Energy)?;
        match quantity {
            Quantity::Edf => report.flux = Some(self.fluxes()),
            Quantity::Phase => report.normalisation = Some(cells.normalisation()),
            _ => report.albedo = Some(cells.albedo_report()),
        }
        Ok(report)
    }

    /// Precomputed albedos of reflected, transmitted or all light: `[combination of indices, incoming, wavelength]`.
    pub(super) fn side(&self, side: Side) -> Vec<f32> {
        let lambdas = self.lambdas();
        let [n_in, ..] = self.geometry().shape();
        let rows = self.geometry().entries() * n_in;
        let mut values = vec![0.0; rows * lambdas];
        for (row, values) in values.chunks_exact_mut(lambdas).enumerate() {
            let is_above = is_above(self.incoming_direction(row % n_in));
            if let Some(table) = self.stored_albedos(side, is_above) {
                values.copy_from_slice(&table[row * lambdas..][..lambdas]);
            }
        }
        values
    }

    fn largest(&self, values: &[f32], sign: f64) -> Option<Spot> {
        let lambdas = self.lambdas();
        let best =
            values.iter().enumerate().filter(|(_, v)| !v.is_nan()).fold(None, |best: Option<(usize, f64)>, (i, &v)| {
                let value = sign * f64::from(v);
                if best.is_none_or(|(_, most)| value > most) { Some((i, value)) } else { best }
            });
        best.map(|(i, value)| self.spot(sign * value, i / lambdas, i % lambdas))
    }

    fn albedo_report(&self) -> AlbedoReport {
        let both = self.side(Side::Both);
        let lambdas = self.lambdas();
        let domain = match self.geometry().mesh() {
            Some(lookup) => lookup.mesh().domain(),
            None => domain_of(self.quantity()),
        };
        let has_both = domain == Domain::Sphere;
        let part = |side| if has_both { self.largest(&self.side(side), 1.0) } else { None };
        let largest = self.largest(&both, 1.0);
        let excess = largest.as_ref().map_or(0.0, |spot| (spot.value - 1.0).max(0.0));
        let allowance = self.allowance(if has_both { 2.0 * PI } else { PI });
        let entries = both.chunks_exact(lambdas).enumerate().filter_map(|(row, spectrum)| {
            let spot = self.largest(spectrum, 1.0)?;
            Some(self.spot(spot.value, row, spot.lambda))
        });
        AlbedoReport {
            reflected: part(Side::Reflected),
            transmitted: part(Side::Transmitted),
            mean: mean(&both),
            excess,
            verdict: verdict(excess, allowance.bound),
            allowance,
            negative: both.iter().filter(|&&v| v < 0.0).count() as u64,
            entries: entries.collect(),
            largest,
        }
    }

    fn normalisation(&self) -> NormalisationReport {
        let values = self.side(Side::Both);
        let (least, largest) = (self.largest(&values, -1.0), self.largest(&values, 1.0));
        let deviation = [&least, &largest].into_iter().flatten().fold(0.0, |d: f64, s| d.max((s.value - 1.0).abs()));
        let allowance = self.allowance(4.0 * PI);
        NormalisationReport {
            least,
            largest,
            mean: mean(&values),
            deviation,
            allowance,
            verdict: verdict(deviation, allowance.bound),
        }
    }

    /// Error er(L2) of a sample by compression, and upper bound on the resulting relative error of an integral over
    /// `measure` sr. Both are 0 if the material is a measurement rather than a compressed file.
    fn allowance(&self, measure: f64) -> Allowance {
        let Some(summary) = self.summary() else { return Allowance::default() };
        let ErrorReport { er_l2, max_relative_error, max_absolute_error_unscored, .. } = summary.errors;
        Allowance { er_l2, bound: max_relative_error + measure * max_absolute_error_unscored }
    }
}

fn verdict(excess: f64, bound: f64) -> Verdict {
    match excess {
        e if e <= ROUNDING => Verdict::Holds,
        e if e <= ROUNDING + bound => Verdict::WithinError,
        _ => Verdict::Broken,
    }
}

/// Returns the mean of the values that are not masked (NaN); 0 if all values are masked.
fn mean(values: &[f32]) -> f64 {
    let known = values.iter().filter(|v| !v.is_nan());
    let (sum, count) = known.fold((0.0, 0_u64), |(sum, count), &v| (sum + f64::from(v), count + 1));
    if count > 0 { sum / count as f64 } else { 0.0 }
}
