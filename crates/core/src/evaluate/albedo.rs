//! Albedo: the integral over outgoing directions, stored by wavelength for every incoming cell (\[CPB06\] section
//! 6.1.3).

use super::geometry::Geometry;
use super::stated::{Stated, domain_of};
use crate::compress::weights_of_angles;
use crate::domain::{Direction, Domain, Measurement, TriangleMesh};
use rayon::prelude::*;
use std::ops::Range;

/// Hemisphere of outgoing directions that an albedo integrates over, relative to the incoming direction. An incoming
/// direction on the horizon counts as above it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Upper and lower hemisphere of outgoing directions together: reflected plus transmitted light.
    #[default]
    Both,
    /// Outgoing directions on the side of `wi`: reflection.
    Reflected,
    /// Outgoing directions on the side opposite `wi`: transmission.
    Transmitted,
}

/// Albedos computed when a material is opened, `[incoming direction, wavelength]`. NaN where every sample of the
/// integral is masked.
#[derive(Debug, Default)]
pub(super) struct Albedos {
    /// Integrals of the measured function (times |cos θo| for a BRDF, BTDF or BSDF) over all outgoing directions,
    /// `[incoming direction, wavelength]`. Empty if the outgoing axis is not a triangle mesh.
    both: Vec<f32>,
    /// Integrals of the measured function times |cos θo| over the outgoing directions above, then below the horizon.
    /// Empty unless the data cover the whole sphere and the quantity has a factor |cos θo|.
    halves: [Vec<f32>; 2],
    /// Domain of outgoing directions (hemisphere or sphere); `None` without an outgoing axis.
    domain: Option<Domain>,
}

impl Albedos {
    /// Integrates a measurement over outgoing directions, for every incoming direction and wavelength. The result holds
    /// no integrals if the outgoing axis is not a triangle mesh.
    pub(super) fn new(measurement: &Measurement, geometry: &Geometry) -> Self {
        let Some(mesh) = geometry.mesh().map(|lookup| lookup.mesh()) else { return Self::default() };
        let lambdas = geometry.lambdas();
        let table = |leaves: Range<usize>| table(measurement, mesh, lambdas, leaves);
        let n = mesh.len();
        let has_halves = measurement.quantity.has_cosine() && mesh.domain() == Domain::Sphere;
        let halves = if has_halves { [table(0..n / 2), table(n / 2..n)] } else { [Vec::new(), Vec::new()] };
        Self { both: table(0..n), halves, domain: Some(mesh.domain()) }
    }

    /// Integrates samples on a grid of angles, times |cos θo|, for every incoming direction of the grid and every
    /// wavelength. Between the angles of the grid values are linear, as compression measures light. The result holds no
    /// integrals if the grid covers no area.
    pub(super) fn of_angles(stated: &Stated) -> Self {
        let geometry = stated.geometry();
        let Some(grid) = geometry.outgoing_grid().filter(|_| stated.has_albedo()) else { return Self::default() };
        let (quantity, [n_in, _, lambdas]) = (geometry.quantity(), geometry.shape());
        let all = weights_of_angles(quantity, grid);
        let of_side = |is_above: bool| -> Vec<f64> {
            let is_here = |outgoing: usize| (grid.direction(outgoing).cos_theta() >= 0.0) == is_above;
            all.iter().enumerate().map(|(outgoing, &weight)| if is_here(outgoing) { weight } else { 0.0 }).collect()
        };
        let table = |weights: &[f64]| {
            let mut table = vec![0.0; geometry.entries() * n_in * lambdas];
            table.par_chunks_mut(lambdas).enumerate().for_each(|(slice, albedo)| {
                write_integrals(&stated.slice(slice), weights, albedo);
            });
            table
        };
        let domain = domain_of(quantity);
        let halves = match domain {
            Domain::Sphere => [true, false].map(|is_above| table(&of_side(is_above))),
            _ => [Vec::new(), Vec::new()],
        };
        Self { both: table(&all), halves, domain: Some(domain) }
    }

    /// Returns the albedos `[incoming direction, wavelength]` of reflected, transmitted or all light. `is_above` is
    /// true if incoming directions lie above the horizon; `None` if no light can leave on the requested side.
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

    /// Changes the material's table of albedos (integrals over all outgoing directions) by the given function `add`,
    /// unless the table is empty.
    pub(super) fn add(&mut self, add: impl FnOnce(&mut [f32])) {
        if !self.both.is_empty() {
            add(&mut self.both);
        }
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.both) + self.halves.iter().map(|half| size_of_val(&**half)).sum::<usize>()
    }
}

/// Returns true if an incoming direction is above the horizon, or if the data have no incoming direction.
pub(super) fn is_above(wi: Option<Direction>) -> bool {
    wi.is_none_or(|wi| wi.cos_theta() >= 0.0)
}

/// Returns the integrals of samples over the outgoing triangles `leaves`, `[incoming direction, wavelength]`. Triangles
/// are weighted by projected solid angle if the quantity has a cosine factor, else by solid angle.
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
        write_integrals(&cell[leaves.start * lambdas..leaves.end * lambdas], &measures, albedo);
    });
    table
}

/// Writes the sums of `samples` `[outgoing, wavelength]` times `measures`, one for each outgoing direction, to `out`. A
/// sum is NaN if all its samples are masked.
pub(super) fn write_integrals(samples: &[f32], measures: &[f64], out: &mut [f32]) {
    let mut sums = vec![(0.0_f64, false); out.len()];
    for (spectrum, measure) in samples.chunks_exact(out.len()).zip(measures) {
        for ((sum, measured), &sample) in sums.iter_mut().zip(spectrum) {
            if !sample.is_nan() {
                *sum += measure * f64::from(sample);
                *measured = true;
            }
        }
    }
    for (out, (sum, measured)) in out.iter_mut().zip(sums) {
        *out = if measured { sum as f32 } else { f32::NAN };
    }
}
