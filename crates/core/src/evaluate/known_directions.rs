//! Determination of the measured share of outgoing directions, and the refusal of what needs all of them.

use super::error::{EvaluateError, QueryError, unfit};
use super::lines::{Node, azimuth_nodes};
use super::measured_share::{MeasuredExtent, MeasuredShare, ON_PLANE, has_no_azimuths, has_planes};
use super::stated::domain_of;
use crate::compress::{EVERYWHERE, polar_weights, weights};
use crate::domain::{
    Axis, AzimuthExtent, DirectionGrid, Domain, Layout, Measurement, Outside, Quantity, TriangleMesh, WIDEST_GAP,
};
use std::f64::consts::{PI, TAU};

impl MeasuredShare {
    /// Fails if less than 80 % of the outgoing directions were measured. `asked` says in words what was asked for, such
    /// as `albedo`; the error names it.
    #[inline]
    pub fn needs_whole(self, asked: &'static str) -> Result<(), EvaluateError> {
        if self.is_whole() { Ok(()) } else { unfit(QueryError::PartlyMeasured { asked, measured: self }) }
    }

    /// Determines the measured share of a measurement, of which a rule filled in the cells `filled`. `None` for data
    /// without outgoing directions.
    pub(super) fn of(measurement: &Measurement, filled: &FilledCells) -> Option<Self> {
        let axes = measurement.tensor.axes();
        let layout = measurement.layout().ok()?;
        let axis = layout.outgoing.map(|axis| &axes[axis])?;
        let quantity = measurement.quantity;
        let known = Known::of(measurement, &layout, filled);
        let (weights, extent, domain) = match axis {
            Axis::Triangles(mesh) if known.is_all() => return Some(Self::whole(quantity, mesh.domain())),
            Axis::Triangles(mesh) => (weights(quantity, *mesh), known.extent(*mesh), mesh.domain()),
            Axis::Grid(grid) if grid.outside() == Outside::Dark => {
                return Some(Self::whole(quantity, domain_of(quantity)));
            }
            Axis::Grid(grid) => {
                let (around, extent) = around(quantity, grid, has_no_azimuths(measurement));
                let polar = polar_weights(quantity, grid, EVERYWHERE);
                let weights = polar.iter().flat_map(|polar| around.iter().map(move |around| polar * around)).collect();
                (weights, extent, domain_of(quantity))
            }
            _ => return None,
        };
        let domain = if quantity == Quantity::Edf { known.lit(axis) } else { domain };
        let all = match (quantity.has_cosine(), domain) {
            (true, Domain::Sphere) | (false, Domain::Hemisphere | Domain::Lower) => TAU,
            (true, _) => PI,
            (false, Domain::Sphere) => 2.0 * TAU,
        };
        let share = (known.least(&weights) / all).min(1.0);
        Some(Self { share, extent, domain, quantity })
    }

    fn whole(quantity: Quantity, domain: Domain) -> Self {
        Self { share: 1.0, extent: MeasuredExtent::Area, domain, quantity }
    }
}

/// Returns the measured share of the outgoing directions of a measurement. `metadata` is the text that its file has
/// beside the samples. `None` for data without outgoing directions.
pub fn measured_share(measurement: &Measurement, metadata: Option<&str>) -> Option<MeasuredShare> {
    MeasuredShare::of(measurement, &metadata.map_or_else(FilledCells::default, FilledCells::stated))
}

/// Cells of a material whose values are filled in by a rule, as its metadata states them.
#[derive(Debug, Default, serde::Deserialize)]
pub(super) struct FilledCells {
    /// Number of cells, each with a spectrum.
    of: usize,
    /// Lengths of runs of cells that are measured, and filled in, in turn.
    runs: Vec<usize>,
}

impl FilledCells {
    /// Reads the filled cells from the metadata of a material; none if the metadata do not state them.
    pub(super) fn stated(metadata: &str) -> Self {
        #[derive(serde::Deserialize)]
        struct Stated {
            filled: FilledCells,
        }
        serde_json::from_str::<Stated>(metadata).map_or_else(|_| Self::default(), |stated| stated.filled)
    }
}

/// Outgoing directions with measured values.
struct Known {
    /// One flag for each spectrum, `[incoming][outgoing]`; empty if all are measured.
    flags: Vec<bool>,
    outgoing: usize,
}

impl Known {
    fn of(measurement: &Measurement, layout: &Layout, filled: &FilledCells) -> Self {
        let axes = measurement.tensor.axes();
        let length = |axis: Option<usize>| axis.map_or(1, |axis| axes[axis].len());
        let samples = measurement.tensor.samples();
        let spectra = samples.chunks_exact(length(layout.spectral));
        // The metadata of a file may be those of a finer level.
        let runs = if filled.of == spectra.len() { &filled.runs[..] } else { &[] };
        let mut flags = Vec::new();
        if !runs.is_empty() || samples.iter().any(|sample| sample.is_nan()) {
            flags = spectra.map(|spectrum| spectrum.iter().any(|sample| !sample.is_nan())).collect();
        }
        let mut rest = flags.as_mut_slice();
        for (run, &count) in runs.iter().enumerate() {
            let (part, after) = rest.split_at_mut(count.min(rest.len()));
            if run % 2 == 1 {
                part.fill(false);
            }
            rest = after;
        }
        if flags.iter().all(|known| *known) {
            flags.clear();
        }
        Self { flags, outgoing: length(layout.outgoing) }
    }

    fn is_all(&self) -> bool {
        self.flags.is_empty()
    }

    /// Returns true if an outgoing direction was measured under some incidence.
    fn is_known(&self, outgoing: usize) -> bool {
        self.is_all() || self.flags.iter().skip(outgoing).step_by(self.outgoing).any(|known| *known)
    }

    /// Least sum of the weights of measured directions over the incidences under which anything was measured.
    fn least(&self, weights: &[f64]) -> f64 {
        if self.is_all() {
            return weights.iter().sum();
        }
        let incidences = self.flags.chunks_exact(self.outgoing).filter(|flags| flags.contains(&true));
        let sum =
            |flags: &[bool]| flags.iter().zip(weights).filter(|(known, _)| **known).map(|(_, weight)| weight).sum();
        let least = incidences.map(sum).fold(f64::INFINITY, f64::min);
        if least.is_finite() { least } else { 0.0 }
    }

    /// Returns the hemisphere that contains all measured directions of a light, or the sphere.
    fn lit(&self, outgoing: &Axis) -> Domain {
        let heights =
            (0..self.outgoing).filter(|&entry| self.is_known(entry)).filter_map(|entry| outgoing.direction(entry));
        let (low, high) = heights.fold((0.0_f64, 0.0_f64), |(low, high), direction| {
            (low.min(direction.cos_theta()), high.max(direction.cos_theta()))
        });
        match (low < -ON_PLANE, high > ON_PLANE) {
            (true, false) => Domain::Lower,
            (false, true) => Domain::Hemisphere,
            _ => Domain::Sphere,
        }
    }

    /// Arrangement of the measured triangles: in the plane of incidence if that crosses every one of them.
    fn extent(&self, mesh: TriangleMesh) -> MeasuredExtent {
        let (mut is_source, mut is_mirror) = (false, false);
        for triangle in (0..self.outgoing).filter(|&triangle| self.is_known(triangle)) {
            let vertices = mesh.vertices(triangle);
            let heights = vertices.map(|[_, y, _]| y);
            if heights.iter().all(|y| *y > ON_PLANE) || heights.iter().all(|y| *y < -ON_PLANE) {
                return MeasuredExtent::Area;
            }
            let across = vertices.iter().map(|[x, ..]| x).sum::<f64>();
            (is_source, is_mirror) = (is_source || across > ON_PLANE, is_mirror || across < -ON_PLANE);
        }
        if is_source && is_mirror { MeasuredExtent::Plane } else { MeasuredExtent::HalfPlane }
    }
}

/// Angle in radians for which each azimuth of a grid stands: half of the way to the next azimuth on either side, if
/// that is at most 90° away and between them is measured. Also returns the arrangement of the azimuths.
fn around(quantity: Quantity, grid: &DirectionGrid, is_half_plane: bool) -> (Vec<f64>, MeasuredExtent) {
    let has_planes = has_planes(quantity, grid);
    let Some(azimuths) = grid.azimuths() else {
        return if is_half_plane { (vec![0.0], MeasuredExtent::HalfPlane) } else { (vec![TAU], MeasuredExtent::Area) };
    };
    let nodes = azimuth_nodes(grid);
    let (low, high) = grid.covers();
    let is_covered = |azimuth: f64| grid.held([0.5 * (low + high), azimuth]).is_some();
    let mut around = vec![0.0; azimuths.angles.len()];
    let first = (azimuths.extent != AzimuthExtent::Sector).then(|| Node { angle: nodes[0].angle + 360.0, ..nodes[0] });
    for (from, to) in nodes.iter().zip(nodes[1..].iter().copied().chain(first)) {
        let angle = to.angle - from.angle;
        if (angle <= WIDEST_GAP || !has_planes) && is_covered(0.5 * (from.angle + to.angle)) {
            around[from.entry as usize] += 0.5 * angle.to_radians();
            around[to.entry as usize] += 0.5 * angle.to_radians();
        }
    }
    let has = |wanted: f64| nodes.iter().any(|node| node.angle.rem_euclid(360.0) == wanted);
    let is_only = nodes.iter().all(|node| node.angle.rem_euclid(180.0) == 0.0);
    let extent = match (around.iter().any(|angle| *angle > 0.0), is_only) {
        (true, _) => MeasuredExtent::Area,
        (false, false) => MeasuredExtent::Planes,
        (false, true) if has(0.0) && has(180.0) => MeasuredExtent::Plane,
        (false, true) => MeasuredExtent::HalfPlane,
    };
    (around, extent)
}
