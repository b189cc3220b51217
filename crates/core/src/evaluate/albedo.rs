//! The integral over outgoing directions, stored by wavelength for every incoming cell (\[CPB06\] section 6.1.3).

use super::lookup::Stencil;
use super::material::turned;
use super::{EvaluateError, Interpolation, Material, Place, unfit};
use crate::domain::{Direction, Domain, Measurement, TriangleMesh};
use rayon::prelude::*;
use std::ops::Range;

/// Which outgoing directions an albedo is of, as seen from the incoming direction; one on the horizon is above.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// All of them.
    #[default]
    Both,
    /// Those on the side of `wi`: reflection.
    Reflected,
    /// Those on the other side: transmission.
    Transmitted,
}

/// Stored integrals, `[cell, lambda]`; NaN where all that is summed is masked.
#[derive(Debug, Default)]
pub(super) struct Albedos {
    /// Over the whole outgoing axis; empty without one.
    both: Vec<f32>,
    /// Over its upper and its lower hemisphere, where it has both and the quantity has a cosine; otherwise empty.
    halves: [Vec<f32>; 2],
    /// The side of an outgoing axis that has one.
    domain: Option<Domain>,
}

impl Albedos {
    pub(super) fn new(measurement: &Measurement, mesh: TriangleMesh, lambdas: usize) -> Self {
        let table = |leaves: Range<usize>| table(measurement, mesh, lambdas, leaves);
        let n = mesh.len();
        let has_halves = measurement.quantity.has_cosine() && mesh.domain() == Domain::Sphere;
        let halves = if has_halves { [table(0..n / 2), table(n / 2..n)] } else { [Vec::new(), Vec::new()] };
        Self { both: table(0..n), halves, domain: Some(mesh.domain()) }
    }

    /// `[cell, lambda]` of one side, where `wi` is above or not; `None` where nothing goes there.
    pub(super) fn of(&self, side: Side, is_above: bool) -> Option<&[f32]> {
        let upward = match side {
            Side::Both => return Some(&self.both),
            Side::Reflected => is_above,
            Side::Transmitted => !is_above,
        };
        match self.domain? {
            Domain::Sphere => Some(&self.halves[usize::from(!upward)]),
            Domain::Hemisphere => upward.then_some(&self.both),
            Domain::Lower => (!upward).then_some(&self.both),
        }
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.both) + self.halves.iter().map(|half| size_of_val(&**half)).sum::<usize>()
    }
}

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
        self.albedo_of(Side::Both, index, wi, how, out)
    }

    /// [`Material::albedo`] of the light reflected or transmitted alone; the two add up to that of both where nothing is
    /// masked. Quantities without a cosine have no such sides and are refused.
    pub fn albedo_of(
        &self,
        side: Side,
        index: &[usize],
        wi: Option<Direction>,
        how: Interpolation,
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        self.check_side(side)?;
        let lambdas = self.lambdas();
        if out.len() != lambdas {
            return unfit(format!("room for {} samples, expected {lambdas}", out.len()));
        }
        let entry = self.entry(index)?;
        let stencil = match how {
            Interpolation::Constant => Stencil::one(self.incoming_entry(wi)?),
            Interpolation::Smooth => self.incoming_stencil(wi)?,
        };
        let Some(table) = self.albedos.of(side, is_above(wi)) else {
            out.fill(0.0);
            return Ok(());
        };
        for (lambda, value) in out.iter_mut().enumerate() {
            let (mut sum, mut total) = (0.0, 0.0);
            for (incoming, weight) in stencil.entries() {
                let sample = table[(entry * self.shape[0] + incoming) * lambdas + lambda];
                if !sample.is_nan() {
                    sum += weight * sample;
                    total += weight;
                }
            }
            *value = if total > 0.0 { sum / total } else { f32::NAN };
        }
        Ok(())
    }

    /// The same integral of the function as [`Material::spectrum`] gives it, by quadrature: its values at the centroids of
    /// triangles `finer` levels below those of the outgoing axis (at most to level 8), times their (projected) solid
    /// angles. For `Constant` that is the stored albedo to rounding; for `Smooth` the difference to it is what
    /// interpolation adds. Slow: as many evaluations as there are triangles.
    pub fn integrated(
        &self,
        side: Side,
        index: &[usize],
        wi: Option<Direction>,
        how: Interpolation,
        finer: u8,
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        self.check_side(side)?;
        let mut value = vec![0.0; self.lambdas()];
        if out.len() != value.len() {
            return unfit(format!("room for {} samples, expected {}", out.len(), value.len()));
        }
        let Some(own) = self.outgoing.as_ref().map(|lookup| lookup.mesh()) else { return Ok(()) };
        let level = own.level().saturating_add(finer);
        let Some(mesh) = TriangleMesh::new(own.domain(), level) else {
            return unfit(format!(
                "integration at level {level}, expected at most {}",
                crate::domain::limits::MAX_LEVEL
            ));
        };
        let has_cosine = self.quantity().has_cosine();
        // The whole of isotropic data is turned by the azimuth of wi; so are the triangles.
        let azimuth = self.azimuth(wi);
        let mut sums = vec![(0.0_f64, false); value.len()];
        for i in 0..mesh.len() {
            let wo = turned(mesh.centroid(i), azimuth);
            let is_same = is_above(wi) == (wo.cos_theta() >= 0.0);
            if (side == Side::Reflected && !is_same) || (side == Side::Transmitted && is_same) {
                continue;
            }
            self.spectrum(Place { index, wi, wo: Some(wo) }, how, &mut value)?;
            let measure = if has_cosine { mesh.projected_solid_angle(i) } else { mesh.solid_angle(i) };
            for ((sum, is_measured), sample) in sums.iter_mut().zip(&value).filter(|(_, sample)| !sample.is_nan()) {
                *sum += measure * f64::from(*sample);
                *is_measured = true;
            }
        }
        for (out, (sum, is_measured)) in out.iter_mut().zip(sums) {
            // A side without directions sends nothing.
            let is_nowhere = side != Side::Both && self.albedos.of(side, is_above(wi)).is_none();
            *out = if is_measured || is_nowhere { sum as f32 } else { f32::NAN };
        }
        Ok(())
    }

    fn check_side(&self, side: Side) -> Result<(), EvaluateError> {
        let quantity = self.quantity();
        if self.outgoing.is_none() {
            return unfit(format!("this {quantity} has no outgoing axis to integrate over"));
        }
        if side != Side::Both && !quantity.has_cosine() {
            return unfit(format!("this {quantity} has no reflected and transmitted side"));
        }
        Ok(())
    }
}

/// Whether an incoming direction is above; so is that of data without one.
pub(super) fn is_above(wi: Option<Direction>) -> bool {
    wi.is_none_or(|wi| wi.cos_theta() >= 0.0)
}

/// `[cell, lambda]`, summed over some of the outgoing triangles.
fn table(measurement: &Measurement, mesh: TriangleMesh, lambdas: usize, leaves: Range<usize>) -> Vec<f32> {
    let measures: Vec<f64> = if measurement.quantity.has_cosine() {
        leaves.clone().map(|i| mesh.projected_solid_angle(i)).collect()
    } else {
        mesh.solid_angles()[leaves.clone()].to_vec()
    };
    let samples = measurement.tensor.samples();
    let cell = mesh.len() * lambdas;
    let mut table = vec![0.0; samples.len() / mesh.len()];
    table.par_chunks_mut(lambdas).zip(samples.par_chunks(cell)).for_each(|(albedo, cell)| {
        let mut sums = vec![(0.0_f64, false); lambdas];
        let spectra = cell[leaves.start * lambdas..leaves.end * lambdas].chunks_exact(lambdas);
        for (spectrum, measure) in spectra.zip(&measures) {
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
