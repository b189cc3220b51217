//! The integral over outgoing directions, stored by wavelength for every incoming cell (\[CPB06\] section 6.1.3).

use super::lookup::Stencil;
use super::{EvaluateError, Interpolation, Material, unfit};
use crate::domain::{Direction, Measurement, TriangleMesh};
use rayon::prelude::*;

impl Material {
    /// The directional albedo a(wi, λ) = ∫ f · |cos θo| dωo of a BRDF, BTDF or BSDF; ∫ f dωo otherwise: the spectral flux
    /// of an emission, about 1 for a phase function. Into `out` (`lambdas()` long), of the piecewise constant function,
    /// between incoming cells as `how` says. Masked cells add nothing; NaN where all are masked.
    pub fn albedo(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        how: Interpolation,
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        if self.outgoing.is_none() {
            return unfit(format!("this {} has no outgoing axis to integrate over", self.quantity()));
        }
        let lambdas = self.lambdas();
        if out.len() != lambdas {
            return unfit(format!("room for {} samples, expected {lambdas}", out.len()));
        }
        let entry = self.entry(index)?;
        let stencil = match how {
            Interpolation::Constant => Stencil::one(self.incoming_entry(wi)?),
            Interpolation::Smooth => self.incoming_stencil(wi)?,
        };
        for (lambda, value) in out.iter_mut().enumerate() {
            let (mut sum, mut total) = (0.0, 0.0);
            for (incoming, weight) in stencil.entries() {
                let sample = self.albedos[(entry * self.shape[0] + incoming) * lambdas + lambda];
                if !sample.is_nan() {
                    sum += weight * sample;
                    total += weight;
                }
            }
            *value = if total > 0.0 { sum / total } else { f32::NAN };
        }
        Ok(())
    }
}

/// `[cell, lambda]`.
pub(super) fn table(measurement: &Measurement, mesh: TriangleMesh, lambdas: usize) -> Vec<f32> {
    let measures: Vec<f64> = if measurement.quantity.has_cosine() {
        (0..mesh.len()).map(|i| mesh.projected_solid_angle(i)).collect()
    } else {
        mesh.solid_angles()
    };
    let samples = measurement.tensor.samples();
    let cell = mesh.len() * lambdas;
    let mut table = vec![0.0; samples.len() / mesh.len()];
    table.par_chunks_mut(lambdas).zip(samples.par_chunks(cell)).for_each(|(albedo, cell)| {
        let mut sums = vec![(0.0_f64, false); lambdas];
        for (spectrum, measure) in cell.chunks_exact(lambdas).zip(&measures) {
            for ((sum, measured), &sample) in sums.iter_mut().zip(spectrum) {
                if !sample.is_nan() {
                    *sum += measure * f64::from(sample);
                    *measured = true;
                }
            }
        }
        for (albedo, (sum, measured)) in albedo.iter_mut().zip(sums) {
            *albedo = if measured { sum as f32 } else { f32::NAN };
        }
    });
    table
}
