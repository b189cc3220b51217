//! Averages over triangles of samples on a grid of angles: the basis of sampling, integrals and pictures.

use super::error::EvaluateError;
use super::geometry::Geometry;
use super::place::{Interpolation, Place};
use super::stated::{Stated, domain_of};
use crate::domain::{
    Axis, Direction, DirectionGrid, Domain, Measurement, Sampling, Tensor, TriangleMesh, centroid, child,
};
use rayon::prelude::*;

/// Coarsest and finest subdivision level of the triangles that replace a grid of directions.
const COARSEST: u8 = 2;
const FINEST: u8 = 6;
/// Maximum number of triangle averages, counted over all axes; beyond it coarser triangles are used.
const MOST_SAMPLES: usize = 1 << 24;

impl Stated {
    /// Converts samples on a grid of directions to averages over triangles about as wide as the grid's spacing. Each
    /// average is the mean of the values interpolated at the centroids of an outgoing triangle's four sub-triangles.
    ///
    /// A grid of incoming directions also becomes triangles, with the values at their centroids; incoming elevations
    /// are kept. Data over the scattering angle are evaluated under light along `+z`.
    pub(super) fn cell_averages(&self) -> Result<Measurement, EvaluateError> {
        let geometry = self.geometry();
        let layout = geometry.layout();
        let (incoming, outgoing) = meshes(geometry);
        let axes: Vec<Axis> = geometry
            .axes()
            .iter()
            .enumerate()
            .map(|(axis, own)| match (incoming, outgoing) {
                (Some(mesh), _) if layout.incoming == Some(axis) => Axis::Triangles(mesh),
                (_, Some(mesh)) if layout.outgoing == Some(axis) => Axis::Triangles(mesh),
                _ => own.clone(),
            })
            .collect();
        let wi: Vec<Option<Direction>> = match (incoming, layout.incoming) {
            (Some(mesh), _) => (0..mesh.len()).map(|i| Some(mesh.centroid(i))).collect(),
            (None, Some(_)) => {
                (0..geometry.shape()[0]).map(|i| Some(Direction::from_unit(geometry.incoming_direction(i)))).collect()
            }
            (None, None) => vec![None],
        };
        let wo: Vec<Vec<Option<Direction>>> = match outgoing {
            Some(mesh) => (0..mesh.len()).map(|i| quarters(mesh, i)).collect(),
            None => vec![vec![None]],
        };
        let lambdas = geometry.lambdas();
        let mut samples = vec![0.0_f32; geometry.entries() * wi.len() * wo.len() * lambdas];
        samples.par_chunks_mut(wo.len() * lambdas).enumerate().try_for_each(|(row, samples)| {
            let index = geometry.index_of(row / wi.len());
            let mut value = vec![0.0; lambdas];
            for (sample, parts) in samples.chunks_exact_mut(lambdas).zip(&wo) {
                let mut sums = vec![(0.0_f64, 0_u32); lambdas];
                for &wo in parts {
                    let place = Place { index: &index, wi: wi[row % wi.len()], wo };
                    match self.spectrum(place, Interpolation::Smooth, &mut value) {
                        // A triangle may reach beyond the measured incoming directions.
                        Err(_) if incoming.is_some() => value.fill(f32::NAN),
                        other => other?,
                    }
                    for ((sum, count), &value) in sums.iter_mut().zip(&value).filter(|(_, value)| !value.is_nan()) {
                        *sum += f64::from(value);
                        *count += 1;
                    }
                }
                for (sample, (sum, count)) in sample.iter_mut().zip(sums) {
                    *sample = if count == 0 { f32::NAN } else { (sum / f64::from(count)) as f32 };
                }
            }
            Ok::<(), EvaluateError>(())
        })?;
        let tensor = Tensor::new(axes, samples)?;
        Ok(Measurement { quantity: geometry.quantity(), unit: geometry.unit(), sampling: Sampling::Average, tensor })
    }
}

/// Returns the triangle meshes that replace the incoming and the outgoing grid of directions; `None` for an axis that
/// is not a grid. Meshes become coarser, if need be, to keep the number of averages within [`MOST_SAMPLES`].
fn meshes(geometry: &Geometry) -> (Option<TriangleMesh>, Option<TriangleMesh>) {
    let layout = geometry.layout();
    let grid = |axis: Option<usize>| match axis.map(|axis| &geometry.axes()[axis]) {
        Some(Axis::Grid(grid)) => Some(grid),
        _ => None,
    };
    let incoming_domain = |grid: &DirectionGrid| {
        let heights = (0..grid.len()).map(|entry| grid.direction(entry).cos_theta());
        let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(z), high.max(z)));
        match (low < -HORIZON, high > HORIZON) {
            (true, true) => Domain::Sphere,
            (true, false) => Domain::Lower,
            _ => Domain::Hemisphere,
        }
    };
    let mut incoming = grid(layout.incoming).map(|grid| (incoming_domain(grid), level_of(grid).min(3)));
    let mut outgoing = grid(layout.outgoing).map(|grid| (domain_of(geometry.quantity()), level_of(grid)));
    let mesh = |side: Option<(Domain, u8)>| side.and_then(|(domain, level)| TriangleMesh::new(domain, level));
    loop {
        let length = |side, other: usize| mesh(side).map_or(other, TriangleMesh::len);
        let [n_in, n_out, lambdas] = geometry.shape();
        let samples = [geometry.entries(), length(incoming, n_in), length(outgoing, n_out), lambdas];
        let count = samples.into_iter().fold(1, usize::saturating_mul);
        let finer = [&mut incoming, &mut outgoing].into_iter().flatten().filter(|(_, level)| *level > COARSEST);
        match finer.max_by_key(|(_, level)| *level) {
            Some((_, level)) if count > MOST_SAMPLES => *level -= 1,
            _ => return (mesh(incoming), mesh(outgoing)),
        }
    }
}

/// Magnitude of the cosine below which a direction counts as lying on the horizon.
const HORIZON: f64 = 1e-6;

/// Subdivision level at which a triangle's edge is about as long as the median step of the grid's polar angle.
fn level_of(grid: &DirectionGrid) -> u8 {
    let polar = grid.polar();
    let mut steps: Vec<f64> = polar.array_windows().map(|[a, b]| b - a).collect();
    steps.sort_by(f64::total_cmp);
    let step = steps.get(steps.len() / 2).copied().unwrap_or(90.0);
    (COARSEST..FINEST).find(|&level| 90.0 / f64::from(1_u32 << level) <= step).unwrap_or(FINEST)
}

/// Centroids of the four children of a triangle.
fn quarters(mesh: TriangleMesh, triangle: usize) -> Vec<Option<Direction>> {
    let vertices = mesh.vertices(triangle);
    (0..4).map(|k| Some(centroid(child(vertices, k)))).collect()
}
