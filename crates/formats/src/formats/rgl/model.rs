//! Evaluation of the function in a tensor file: f(wi, wo, channel) by its warps and interpolation.
//!
//! Dupuy & Jakob 2018, section 4, with the conventions of Mitsuba 3 (`measured`). Mitsuba's `eval` is this function
//! times the cosine of `wo`.

use super::super::acquisition::DirectionalFunction;
use super::warp::{Map, Warp, azimuth_to_unit, between, cell, elevation_to_unit, unit_to_azimuth, unit_to_elevation};
use crate::domain::Direction;
use crate::domain::vector::{Vector, add, dot, norm, scale, sub, unit};
use std::f64::consts::PI;

/// Symmetry of an anisotropic surface, which extends the stored incident azimuths to a full turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reduction {
    /// The measured surface has no symmetry; incident azimuths of a full turn are stored.
    None,
    /// The measured surface is symmetric under rotation by 180°; incident azimuths of half a turn are stored, −180° to
    /// 0°.
    Half,
    /// The measured surface is mirror-symmetric along both axes; incident azimuths of a quarter turn are stored, −180°
    /// to −90°.
    Quarter,
}

/// BRDF of an RGL file, prepared for evaluation.
#[derive(Debug)]
pub(super) struct Model {
    /// Azimuths, and polar angles, of the stored incident directions in radians, increasing.
    pub(super) phi: Vec<f64>,
    pub(super) theta: Vec<f64>,
    /// True for an isotropic surface, whose microfacet azimuths are relative to the incident azimuth.
    pub(super) isotropic: bool,
    pub(super) reduction: Reduction,
    /// Maps of the microfacet distribution D and of the projected area σ, if the file's values times D / 4σ are f · cos
    /// θo; `None` if the values alone are.
    pub(super) microfacets: Option<(Map, Map)>,
    /// Invertible mapping between the unit square of microfacet directions, with the density of visible normals, and a
    /// square with uniform density. Each stored incident direction `[phi, theta]` has its own.
    pub(super) visible: Warp,
    /// Number of nodes along a side of the square table of values for one incident direction.
    pub(super) side: usize,
    pub(super) channels: usize,
    /// Stored values, row-major `[phi, theta, row, column, channel]` with the incident angles first; NaN = missing.
    pub(super) values: Vec<f32>,
    /// Number of missing values in the file.
    pub(super) missing: usize,
}

/// Stored incident directions of an RGL file around the one at which its BRDF is evaluated, with their weights of
/// linear interpolation; weights of 0 are left out.
struct Slices {
    entries: [(usize, f64); 4],
    count: usize,
}

impl DirectionalFunction for Model {
    /// Writes the BRDF in sr⁻¹ without the factor cos θo. The result is 0 if a direction is below the surface or `wo`
    /// is at the horizon. A `wi` at the horizon gives the limit from above.
    fn evaluate(&self, wi: Direction, wo: Direction, values: &mut [f64]) {
        debug_assert_eq!(values.len(), self.channels, "one value a channel");
        let (wi, wo) = self.reduced(wi.xyz(), wo.xyz());
        if wi[2] < 0.0 || wo[2] <= 0.0 {
            values.fill(0.0);
            return;
        }
        let (theta_i, phi_i) = angles(wi);
        let (theta_m, phi_m) = angles(unit(add(wi, wo)));
        let turned = azimuth_to_unit(if self.isotropic { phi_m - phi_i } else { phi_m });
        let u_m = [elevation_to_unit(theta_m), turned - libm::floor(turned)];
        let slices = self.slices(phi_i, theta_i);
        let Some(place) = self.visible.invert(slices.get(), u_m) else {
            values.fill(f64::NAN);
            return;
        };
        self.interpolate(&slices, place, values);
        let factor = self.microfacets.as_ref().map_or(1.0, |(normals, area)| {
            let u_i = [elevation_to_unit(theta_i), azimuth_to_unit(phi_i)];
            normals.at(u_m) / (4.0 * area.at(u_i))
        });
        // D or σ of 0 leaves the value undefined.
        let factor = if factor.is_finite() { factor / wo[2] } else { f64::NAN };
        for value in values {
            *value *= factor;
        }
    }
}

impl Model {
    /// Returns the mean distance in degrees between neighbouring outgoing directions in the square tables of an RGL
    /// file. It is the geometric mean over up to 16 × 16 points of a table for up to 64 incident directions; the
    /// directions are densest at the lobe.
    pub(super) fn spacing(&self) -> Option<f64> {
        const SLICES: usize = 64;
        const PLACES: usize = 16;
        let slices = self.phi.len() * self.theta.len();
        let side = (self.side - 1).min(PLACES);
        let (mut sum, mut count) = (0.0, 0_usize);
        for slice in (0..slices).step_by(slices.div_ceil(SLICES)) {
            let (phi_i, theta_i) = (self.phi[slice / self.theta.len()], self.theta[slice % self.theta.len()]);
            let wi = Direction::from_radians(theta_i, phi_i).xyz();
            for node in 0..side * side {
                let middle = |i: usize| (i as f64 + 0.5) / side as f64;
                let (u, density) = self.visible.warp(&[(slice, 1.0)], [middle(node % side), middle(node / side)]);
                let theta_m = unit_to_elevation(u[0]);
                let phi_m = unit_to_azimuth(u[1]) + if self.isotropic { phi_i } else { 0.0 };
                let m = Direction::from_radians(theta_m, phi_m).xyz();
                let cosine = dot(wi, m);
                let wo = sub(scale(m, 2.0 * cosine), wi);
                // dωo = 4 (wi · m) dωm, dωm = 2π² u sin θm du dv, du dv = ds / density.
                let solid_angle = 8.0 * PI * PI * u[0] * libm::sin(theta_m) * cosine / density;
                if wo[2] > 0.0 && solid_angle > 0.0 && solid_angle.is_finite() {
                    sum += 0.5 * libm::log(solid_angle);
                    count += 1;
                }
            }
        }
        (count > 0).then(|| (libm::exp(sum / count as f64) / (self.side - 1) as f64).to_degrees())
    }

    /// Returns `wi` and `wo` rotated or mirrored together so that the azimuth of `wi` is among the stored ones.
    fn reduced(&self, mut wi: Vector, mut wo: Vector) -> (Vector, Vector) {
        let (x, y) = match self.reduction {
            Reduction::None => return (wi, wo),
            Reduction::Half => (wi[1] >= 0.0, wi[1] >= 0.0),
            Reduction::Quarter => (wi[0] >= 0.0, wi[1] >= 0.0),
        };
        for (k, mirrored) in [x, y].into_iter().enumerate() {
            if mirrored {
                wi[k] = -wi[k];
                wo[k] = -wo[k];
            }
        }
        (wi, wo)
    }

    fn slices(&self, phi_i: f64, theta_i: f64) -> Slices {
        let mut slices = Slices { entries: [(0, 0.0); 4], count: 0 };
        for (p, phi_weight) in between(&self.phi, phi_i) {
            for (t, theta_weight) in between(&self.theta, theta_i) {
                let weight = phi_weight * theta_weight;
                if weight > 0.0 {
                    slices.entries[slices.count] = (p * self.theta.len() + t, weight);
                    slices.count += 1;
                }
            }
        }
        slices
    }

    /// Interpolates the stored values of an RGL file at a point of the unit square of outgoing directions: bilinear in
    /// the square, linear between incident directions.
    fn interpolate(&self, slices: &Slices, [x, y]: [f64; 2], sums: &mut [f64]) {
        let ((i, a), (j, b)) = (cell(x, self.side), cell(y, self.side));
        sums.fill(0.0);
        for &(slice, slice_weight) in slices.get() {
            for (row, row_weight) in [(j, 1.0 - b), (j + 1, b)] {
                for (column, column_weight) in [(i, 1.0 - a), (i + 1, a)] {
                    let weight = slice_weight * row_weight * column_weight;
                    if weight == 0.0 {
                        continue;
                    }
                    let node = (slice * self.side + row) * self.side + column;
                    let values = &self.values[node * self.channels..][..self.channels];
                    sums.iter_mut().zip(values).for_each(|(sum, &value)| *sum += weight * f64::from(value));
                }
            }
        }
    }
}

impl Slices {
    fn get(&self) -> &[(usize, f64)] {
        &self.entries[..self.count]
    }
}

/// Returns the polar angle of a direction, precise near the normal, and its azimuth −π..=π, in radians.
fn angles(d: Vector) -> (f64, f64) {
    let chord = norm(sub(d, [0.0, 0.0, 1.0]));
    (2.0 * libm::asin((0.5 * chord).min(1.0)), libm::atan2(d[1], d[0]))
}
