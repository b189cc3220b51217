//! Light under the measured incidences of a material, and the incidences around one that is left out.

use super::Cubic;
use crate::compress::Between;
use crate::domain::vector::Vector;
use crate::domain::{Axis, DirectionGrid, Domain};
use crate::evaluate::Material;
use crate::evaluate::geometry::Geometry;
use crate::evaluate::incoming::Alignment;
use crate::evaluate::incoming::middles::Predicting;
use crate::evaluate::lines::Lines;
use crate::evaluate::planes::Planes;
use crate::evaluate::smooth::Smooth;

/// Number of outgoing directions at which leave-one-out errors are measured, on each side of the horizon that the data
/// cover. More give more reliable errors and take longer.
const DIRECTIONS: u32 = 2048;
/// Minimum |cos θ| of the outgoing directions at which leave-one-out errors are measured: 80° from the normal.
const LOWEST: f64 = 0.173_648_177_666_930_35;

/// Measured incoming directions of a material and its smooth function, for leave-one-out predictions.
pub(super) struct Tables<'a> {
    form: Form<'a>,
    geometry: &'a Geometry,
    domain: Domain,
    alignment: Alignment,
    incidences: Vec<Vector>,
    outgoing: Vec<Vector>,
    is_scan: bool,
    /// For each triangle of the incoming mesh, the other triangles that predict it in a leave-one-out test; empty for
    /// other axes.
    triangles: Vec<Option<Others>>,
}

enum Form<'a> {
    Planes(&'a Planes, &'a Smooth),
    Lines(&'a Lines),
}

/// Measured incoming directions from which values under a left-out one are predicted (leave-one-out test), with weights
/// for three predictions: a mean, linear interpolation, and cubic (between triangles quadratic) interpolation.
#[derive(Clone, Debug)]
pub(super) struct Others {
    /// Numbers of measured incoming directions with their weights in a mean that predicts the value under another
    /// measured one (leave-one-out test). The weights are nonnegative and sum to 1.
    pub(super) mean: Vec<(usize, f32)>,
    /// Weights of measured incoming directions in linear, then in cubic interpolation, which predicts the value under
    /// another measured one. Where the function is 0 or masked under one of them, a mean with nonnegative weights is
    /// used instead.
    pub(super) linear: Option<Vec<(usize, f32)>>,
    pub(super) cubic: Option<Vec<(usize, f32)>>,
}

impl<'a> Tables<'a> {
    /// Prepares leave-one-out predictions for a material with several incoming directions and smooth interpolation
    /// between them; otherwise `None`.
    pub(super) fn of(material: &'a Material) -> Option<Self> {
        let geometry = material.geometry();
        let (form, domain, alignment) = match (material.planes_of_cells(), material.stated()) {
            (Some((_, planes, smooth)), _) => (Form::Planes(planes, smooth), smooth.domain(), smooth.alignment()),
            (None, Some(stated)) => {
                let lines = stated.lines();
                (Form::Lines(lines), lines.domain(), lines.alignment())
            }
            (None, None) => return None,
        };
        let count = geometry.shape()[0];
        if count < 2 || geometry.layout().outgoing.is_none() {
            return None;
        }
        let incidences = (0..count).map(|entry| geometry.incoming_direction(entry)).collect();
        let triangles = match form {
            Form::Planes(_, smooth) => smooth.nodes().predicting(),
            Form::Lines(_) => Vec::new(),
        };
        let others =
            |Predicting { mean, linear, quadratic }| Others { mean, linear: Some(linear), cubic: Some(quadratic) };
        let triangles = triangles.into_iter().map(|predicting| predicting.map(others)).collect();
        let scan = geometry.outgoing_grid().filter(|grid| grid.is_scan());
        let is_scan = scan.is_some();
        let outgoing = scan.map_or_else(|| outgoing(domain), outgoing_of);
        Some(Self { form, geometry, domain, alignment, incidences, outgoing, is_scan, triangles })
    }

    pub(super) fn entries(&self) -> usize {
        self.geometry.entries()
    }

    pub(super) fn incidences(&self) -> &[Vector] {
        &self.incidences
    }

    /// Outgoing directions at which leave-one-out errors are measured: up to 80° from the normal, uniform in solid
    /// angle. For a scan in planes they are the measured ones.
    pub(super) fn outgoing(&self) -> &[Vector] {
        &self.outgoing
    }

    /// True for outgoing directions in planes far apart, between which nothing is known.
    pub(super) fn is_scan(&self) -> bool {
        self.is_scan
    }

    pub(super) fn domain(&self) -> Domain {
        self.domain
    }

    pub(super) fn alignment(&self) -> Alignment {
        self.alignment
    }

    /// Interpolation that the material uses between measured incoming directions.
    pub(super) fn between(&self) -> Between {
        match self.form {
            Form::Planes(_, smooth) => smooth.between(),
            Form::Lines(lines) => lines.between(),
        }
    }

    /// Sum over three wavelengths of the material's function at one measured incoming direction and the outgoing
    /// direction `wo`; NaN where it is masked.
    pub(super) fn light(&self, entry: usize, node: usize, wo: Vector) -> f64 {
        match self.form {
            Form::Planes(planes, smooth) => smooth.brightness(planes, (entry, node), self.incidences[node], wo),
            Form::Lines(lines) => lines.brightness(entry, node, wo),
        }
    }

    /// Other incoming directions, with weights, from which values under incoming direction `node` are predicted in a
    /// leave-one-out test; `None` at the rim of the measured directions.
    pub(super) fn others(&self, node: usize) -> Option<Others> {
        let axes = self.geometry.axes();
        match self.geometry.layout().incoming.map(|axis| &axes[axis]) {
            Some(Axis::Elevation(angles)) => {
                let linear = between(angles, node)?;
                let cubic = Some(curved(angles, node, linear[1].1));
                Some(Others { mean: linear.to_vec(), linear: None, cubic })
            }
            Some(Axis::Grid(grid)) => on_grid(grid, node),
            _ => self.triangles.get(node)?.clone(),
        }
    }
}

/// Neighbours, below and above, of angle number `node` in a list, with the weights of linear interpolation between them
/// at that angle; `None` at the ends of the list.
fn between(angles: &[f64], node: usize) -> Option<[(usize, f32); 2]> {
    let (below, above) = (angles.get(node.checked_sub(1)?)?, angles.get(node + 1)?);
    let t = ((angles[node] - below) / (above - below)) as f32;
    Some([(node - 1, 1.0 - t), (node + 1, t)])
}

/// Neighbours, up to two below and two above, of angle number `node` in a list, with their weights in a cubic at that
/// angle. `t` is the weight that linear interpolation gives the neighbour above.
fn curved(angles: &[f64], node: usize, t: f32) -> Vec<(usize, f32)> {
    let rest: Vec<f64> = angles.iter().enumerate().filter(|(k, _)| *k != node).map(|(_, angle)| *angle).collect();
    let (entries, weights) = Cubic::new(&rest).around(node - 1, t);
    let restored = entries.map(|entry| entry as usize + usize::from(entry as usize >= node));
    restored.into_iter().zip(weights).filter(|(_, weight)| *weight != 0.0).collect()
}

/// Directions, with weights, from which values at grid direction `entry` are predicted in a leave-one-out test:
/// neighbours along the polar angle, or in azimuth at the first and last polar angle.
fn on_grid(grid: &DirectionGrid, entry: usize) -> Option<Others> {
    let [_, columns] = grid.shape();
    let (row, column) = (entry / columns, entry % columns);
    if let Some(rows) = between(grid.polar(), row) {
        let of_rows = |rows: Vec<(usize, f32)>| rows.into_iter().map(|(row, w)| (row * columns + column, w)).collect();
        let cubic = of_rows(curved(grid.polar(), row, rows[1].1));
        return Some(Others { mean: of_rows(rows.to_vec()), linear: None, cubic: Some(cubic) });
    }
    let beside = between(&grid.azimuths()?.angles, column)?;
    let mean = beside.map(|(column, weight)| (row * columns + column, weight)).to_vec();
    Some(Others { mean, linear: None, cubic: None })
}

/// Outgoing directions on a spiral (Swinbank & Purser 2006), on the sides of the horizon that a domain includes.
fn outgoing(domain: Domain) -> Vec<Vector> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let above = (0..DIRECTIONS).map(|k| {
        let height = 1.0 - (1.0 - LOWEST) * (f64::from(k) + 0.5) / f64::from(DIRECTIONS);
        let (sin, cos) = libm::sincos(golden * f64::from(k));
        let radius = (1.0 - height * height).sqrt();
        [radius * cos, radius * sin, height]
    });
    let below = above.clone().map(|[x, y, z]| [x, y, -z]);
    match domain {
        Domain::Hemisphere => above.collect(),
        Domain::Lower => below.collect(),
        Domain::Sphere => above.chain(below).collect(),
    }
}

/// Outgoing directions of a scan in planes, those near the horizon left out.
fn outgoing_of(scan: &DirectionGrid) -> Vec<Vector> {
    let step = scan.len().div_ceil(DIRECTIONS as usize);
    let all = (0..scan.len()).step_by(step).map(|entry| scan.direction(entry).xyz());
    all.filter(|direction| direction[2].abs() >= LOWEST).collect()
}
