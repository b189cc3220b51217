//! Integrals over outgoing directions: the stored albedo, interpolated between incoming directions, and quadrature.

use super::albedo::{Side, is_above};
use super::error::{Buffer, EvaluateError, Need, QueryError, unfit};
use super::geometry::turned;
use super::lookup::Stencil;
use super::material::Material;
use super::place::{Interpolation, Place};
use super::stated::Stated;
use super::turning::Turning;
use crate::domain::{Direction, TriangleMesh};

impl Material {
    /// Writes the directional albedo a(wi, λ) = ∫ f · |cos θo| dωo of a BRDF, BTDF or BSDF to `out` (`lambdas()` long).
    /// Other quantities give ∫ f dωo: the spectral flux of an emission, about 1 for a phase function. f is piecewise
    /// constant; `how` interpolates between incoming samples. Masked samples are skipped; NaN if all are masked.
    pub fn albedo(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        how: Interpolation,
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        self.albedo_of(Side::Both, index, wi, how, out)
    }

    /// Like [`Material::albedo`], for reflected or transmitted light alone. The two parts sum to the whole albedo if no
    /// sample is masked. Fails for quantities without a cosine factor, for which reflection and transmission are not
    /// distinguished.
    pub fn albedo_of(
        &self,
        side: Side,
        index: &[usize],
        wi: Option<Direction>,
        how: Interpolation,
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        self.needs_light()?;
        let cells = self.over_triangles()?;
        cells.check_side(side)?;
        let [n_in, _, lambdas] = cells.geometry().shape();
        Buffer::Spectrum.check(out.len(), lambdas)?;
        let entry = cells.geometry().entry(index)?;
        // A list over the scattering angle sends as much light under any incoming direction as under one along the
        // normal.
        let wi = if self.stated().is_some_and(Stated::is_scattering) { wi.map(|_| Turning::up()) } else { wi };
        let stencil = match how {
            Interpolation::Constant => Stencil::one(cells.geometry().incoming_entry(wi)?),
            Interpolation::Smooth => cells.geometry().incoming_stencil(wi)?,
        };
        if let (Some(stated), None) = (self.stated(), wi) {
            out.copy_from_slice(&stated.integral(entry));
            return Ok(());
        }
        let Some(table) = cells.stored_albedos(side, is_above(wi)) else {
            out.fill(0.0);
            return Ok(());
        };
        for (lambda, value) in out.iter_mut().enumerate() {
            let (mut sum, mut total) = (0.0, 0.0);
            for (incoming, weight) in stencil.entries() {
                let sample = table[(entry * n_in + incoming) * lambdas + lambda];
                if !sample.is_nan() {
                    sum += weight * sample;
                    total += weight;
                }
            }
            *value = if total > 0.0 { sum / total } else { f32::NAN };
        }
        Ok(())
    }

    /// Integrates the function of [`Material::evaluate`] over outgoing directions by quadrature. It sums values at the
    /// centroids of triangles `finer` levels below those of the outgoing axis (at most level 8), times their
    /// (projected) solid angles.
    ///
    /// [`Interpolation::Constant`] gives the stored albedo up to rounding. The result for `Smooth` minus that for
    /// `Constant` is the effect of interpolation. Slow: one evaluation for each triangle.
    pub fn integrated(
        &self,
        side: Side,
        index: &[usize],
        wi: Option<Direction>,
        how: Interpolation,
        finer: u8,
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        self.needs_light()?;
        let cells = self.over_triangles()?;
        cells.check_side(side)?;
        let mut value = vec![0.0; self.lambdas()];
        Buffer::Spectrum.check(out.len(), value.len())?;
        let Some(own) = cells.geometry().mesh().map(|lookup| lookup.mesh()) else { return Ok(()) };
        let level = own.level().saturating_add(finer);
        let Some(mesh) = TriangleMesh::new(own.domain(), level) else {
            return unfit(QueryError::Level { found: level });
        };
        let has_cosine = self.quantity().has_cosine();
        // Isotropic data are rotated by the azimuth of wi, and so are the triangles.
        let azimuth = self.geometry().azimuth(wi);
        let mut sums = vec![(0.0_f64, false); value.len()];
        for i in 0..mesh.len() {
            let wo = turned(mesh.centroid(i), azimuth);
            let is_same = is_above(wi) == (wo.cos_theta() >= 0.0);
            if (side == Side::Reflected && !is_same) || (side == Side::Transmitted && is_same) {
                continue;
            }
            self.evaluate(Place { index, wi, wo: Some(wo) }, how, &mut value)?;
            let measure = if has_cosine { mesh.projected_solid_angle(i) } else { mesh.solid_angle(i) };
            for ((sum, is_measured), sample) in sums.iter_mut().zip(&value).filter(|(_, sample)| !sample.is_nan()) {
                *sum += measure * f64::from(*sample);
                *is_measured = true;
            }
        }
        for (out, (sum, is_measured)) in out.iter_mut().zip(sums) {
            // A side outside the outgoing domain sends no light.
            let is_nowhere = side != Side::Both && cells.stored_albedos(side, is_above(wi)).is_none();
            *out = if is_measured || is_nowhere { sum as f32 } else { f32::NAN };
        }
        Ok(())
    }

    fn check_side(&self, side: Side) -> Result<(), EvaluateError> {
        let quantity = self.quantity();
        if self.geometry().mesh().is_none() {
            return unfit(QueryError::NoOutgoing { need: Need::Integration, quantity });
        }
        if side != Side::Both && !quantity.has_cosine() {
            return unfit(QueryError::NoSides { quantity });
        }
        Ok(())
    }
}
