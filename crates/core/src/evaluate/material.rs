//! An opened material: the roles of its axes, its planes (or samples), and the tables that queries read.

use super::albedo::Albedos;
use super::incoming::{Alignment, Nodes};
use super::lookup::{MeshLookup, Stencil, elevation_stencil, nearest_elevation};
use super::planes::Planes;
use super::reconstruct::Cells;
use super::smooth::Smooth;
use super::trees::Trees;
use super::{EvaluateError, unfit};
use crate::compress::{self, LevelInfo, Summary};
use crate::domain::vector::{self, Vector};
use crate::domain::{Axis, Direction, Domain, Layout, Measurement, Quantity, Sampling, Unit, WavelengthGrid};
use std::sync::{Arc, OnceLock};

/// An opened material; share it between threads by reference.
#[derive(Debug)]
pub struct Material {
    quantity: Quantity,
    unit: Unit,
    pub(super) sampling: Sampling,
    axes: Vec<Axis>,
    layout: Layout,
    pub(super) summary: Option<Summary>,
    /// The lengths of the leading opaque axes.
    indices: Vec<usize>,
    incoming: Incoming,
    /// The directions of the entries of the incoming axis, of azimuth 0 for elevations; `+z` where there is none.
    pub(super) incoming_directions: Vec<[f64; 3]>,
    pub(super) outgoing: Option<Arc<MeshLookup>>,
    /// Entries of the incoming and the outgoing axis, samples of a spectrum; 1 where there is no such axis.
    pub(super) shape: [usize; 3],
    pub(super) form: Form,
    /// Built when a first direction is drawn.
    pub(super) trees: OnceLock<Trees>,
    /// Nothing without an outgoing axis.
    pub(super) albedos: Albedos,
}

/// How samples are kept for queries.
#[derive(Debug)]
pub(super) enum Form {
    /// A few planes, and smooth tables.
    Planes { planes: Box<Planes>, smooth: Box<Smooth> },
    /// Every sample.
    Samples { samples: Vec<f32>, has_masked: bool },
}

#[derive(Debug)]
enum Incoming {
    None,
    Triangles(Arc<MeshLookup>),
    Elevations(Vec<f64>),
}

/// What an opened material is made of.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct OpenedReport {
    /// Memory of the opened form in bytes: all of it.
    pub memory: usize,
    /// Planes of coefficients; `None` where every sample is kept.
    pub planes: Option<usize>,
    /// The largest relative deviation of the planes from the decoded samples (parts of the largest sample where some are
    /// negative); 0 where every sample is kept.
    pub deviation: f64,
    /// How the smooth form goes from one incoming direction to the next.
    pub alignment: Alignment,
    /// How much the shape of the function changes from one incoming direction to its neighbours under each alignment that
    /// competed: the standard deviation, by the square of the light, of the logarithm of the ratio. The least one is taken.
    pub changes: Vec<(Alignment, f64)>,
    /// The share of light that goes astray (Σ |error| · cos θo over Σ value · cos θo) where each incoming direction is
    /// predicted from those around it without itself. Between incoming directions, where gaps are half as wide, it is
    /// usually some four times less.
    pub left_out_error: Option<f64>,
}

/// Beyond this error of a left-out incoming direction, incoming directions are too sparse for the lobe between them.
const SPARSE: f64 = 0.2;

impl OpenedReport {
    /// A warning where incoming directions are too sparse to say what lies between them.
    pub fn warning(&self) -> Option<String> {
        let error = self.left_out_error.filter(|&error| error > SPARSE)?;
        Some(format!(
            "incoming directions are too sparse for the lobe: where one is left out, those around put {:.0} % of its light in the wrong place",
            100.0 * error
        ))
    }
}

impl Material {
    /// Opens a compressed material: bytes that were read, or a memory map of the file.
    pub fn open(bytes: &[u8]) -> Result<Self, EvaluateError> {
        let decoded = compress::decode(bytes)?;
        Ok(Self { summary: Some(decoded.summary), ..Self::of(decoded.measurement)? })
    }

    /// Opens a level of a compressed material: all of its file, or as many of its first bytes as [`compress::levels`] says
    /// that the level needs.
    pub fn open_level(bytes: &[u8], level: u8) -> Result<Self, EvaluateError> {
        let decoded = compress::decode_level(bytes, level)?;
        Ok(Self { summary: Some(decoded.summary), ..Self::of(decoded.measurement)? })
    }

    /// The levels that [`Material::open_level`] opens.
    pub fn levels(bytes: &[u8]) -> Result<Vec<LevelInfo>, EvaluateError> {
        Ok(compress::levels(bytes)?)
    }

    /// Uses a measurement as it is; the alignment between incoming directions is found.
    pub fn of(measurement: Measurement) -> Result<Self, EvaluateError> {
        Self::aligned(measurement, None)
    }

    /// Uses a measurement with a chosen alignment between incoming directions.
    pub fn with_alignment(measurement: Measurement, alignment: Alignment) -> Result<Self, EvaluateError> {
        Self::aligned(measurement, Some(alignment))
    }

    fn aligned(measurement: Measurement, alignment: Option<Alignment>) -> Result<Self, EvaluateError> {
        let layout = measurement.layout().map_err(|error| EvaluateError::Unfit(error.to_string()))?;
        let axes = measurement.tensor.axes();
        let incoming = match layout.incoming.map(|axis| &axes[axis]) {
            Some(Axis::Triangles(mesh)) => Incoming::Triangles(Arc::new(MeshLookup::new(*mesh))),
            Some(Axis::Elevation(values)) => Incoming::Elevations(values.clone()),
            _ => Incoming::None,
        };
        let outgoing = match (layout.outgoing.map(|axis| &axes[axis]), &incoming) {
            (Some(Axis::Triangles(mesh)), Incoming::Triangles(same)) if same.mesh() == *mesh => Some(Arc::clone(same)),
            (Some(Axis::Triangles(mesh)), _) => Some(Arc::new(MeshLookup::new(*mesh))),
            _ => None,
        };
        let indices: Vec<usize> = axes[..layout.indices].iter().map(Axis::len).collect();
        let length = |axis: Option<usize>| axis.map_or(1, |axis| axes[axis].len());
        let shape = [length(layout.incoming), length(layout.outgoing), length(layout.spectral)];
        let albedos =
            outgoing.as_ref().map(|lookup| Albedos::new(&measurement, lookup.mesh(), shape[2])).unwrap_or_default();
        let nodes = match &incoming {
            Incoming::None => Nodes::One,
            Incoming::Triangles(lookup) => Nodes::triangles(Arc::clone(lookup)),
            Incoming::Elevations(values) => Nodes::elevations(values),
        };
        let entries = indices.iter().product();
        let candidates = alignment.map_or_else(|| candidates(measurement.quantity), |alignment| vec![alignment]);
        let axes = axes.to_vec();
        let (quantity, unit, sampling) = (measurement.quantity, measurement.unit, measurement.sampling);
        let found = planes(&measurement, shape[2], outgoing.as_deref(), nodes, entries, &candidates);
        let form = if let Some((planes, smooth)) = found {
            Form::Planes { planes: Box::new(planes), smooth: Box::new(smooth) }
        } else {
            let samples = measurement.tensor.into_samples();
            let has_masked = samples.iter().any(|s| s.is_nan());
            Form::Samples { samples, has_masked }
        };
        let incoming_directions = match &incoming {
            Incoming::None => vec![[0.0, 0.0, 1.0]],
            Incoming::Triangles(lookup) => {
                let mesh = lookup.mesh();
                (0..mesh.len()).map(|i| mesh.centroid(i).xyz()).collect()
            }
            Incoming::Elevations(values) => {
                values.iter().map(|&theta| Direction::from_degrees(theta, 0.0).xyz()).collect()
            }
        };
        Ok(Self {
            quantity,
            unit,
            sampling,
            axes,
            layout: layout.clone(),
            summary: None,
            indices,
            incoming,
            incoming_directions,
            outgoing,
            shape,
            form,
            trees: OnceLock::new(),
            albedos,
        })
    }

    /// What was measured.
    pub fn quantity(&self) -> Quantity {
        self.quantity
    }

    /// The unit of a value.
    pub fn unit(&self) -> Unit {
        self.unit
    }

    /// The axes of the samples.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// The roles of the axes.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The header of the compressed material, if it was opened from one.
    pub fn summary(&self) -> Option<&Summary> {
        self.summary.as_ref()
    }

    /// Samples in one spectrum: 1 for monochromatic data, 3 for RGB.
    pub fn lambdas(&self) -> usize {
        self.shape[2]
    }

    /// The wavelengths in nm, if the spectral axis has any.
    pub fn wavelengths(&self) -> Option<Vec<f64>> {
        self.grid().map(WavelengthGrid::values)
    }

    /// What the opened form is made of.
    pub fn report(&self) -> OpenedReport {
        let (planes, deviation, smooth) = match &self.form {
            Form::Planes { planes, smooth } => (Some(planes.count), planes.deviation, Some(&**smooth)),
            Form::Samples { .. } => (None, 0.0, None),
        };
        OpenedReport {
            memory: self.memory(),
            planes,
            deviation,
            alignment: smooth.map_or(Alignment::None, |smooth| smooth.alignment),
            changes: smooth.map_or_else(Vec::new, |smooth| smooth.changes.clone()),
            left_out_error: smooth.and_then(|smooth| smooth.left_out),
        }
    }

    /// Memory of the opened form in bytes: planes or samples, smooth tables, tables of the meshes, albedo, and the sampling
    /// trees, which the first direction that is drawn builds.
    pub fn memory(&self) -> usize {
        let incoming = match &self.incoming {
            Incoming::None => 0,
            Incoming::Triangles(lookup) if self.outgoing.as_ref().is_some_and(|out| Arc::ptr_eq(out, lookup)) => 0,
            Incoming::Triangles(lookup) => lookup.memory(),
            Incoming::Elevations(values) => size_of_val(&**values),
        };
        let form = match &self.form {
            Form::Planes { planes, smooth } => planes.memory() + smooth.memory(),
            Form::Samples { samples, .. } => size_of_val(&**samples),
        };
        let expected = || self.outgoing.as_ref().map_or(0, |lookup| Trees::expected_memory(self, lookup));
        let trees = self.trees.get().map_or_else(expected, Trees::memory);
        size_of::<Self>()
            + form
            + incoming
            + self.outgoing.as_ref().map_or(0, |lookup| lookup.memory())
            + trees
            + size_of_val(&*self.incoming_directions)
            + self.albedos.memory()
    }

    pub(super) fn grid(&self) -> Option<&WavelengthGrid> {
        match self.axes.last() {
            Some(Axis::Wavelength(grid)) => Some(grid),
            _ => None,
        }
    }

    /// The number of `index` among the entries of the opaque axes, row-major.
    pub fn entry(&self, index: &[usize]) -> Result<usize, EvaluateError> {
        if index.len() != self.indices.len() {
            return unfit(format!("{} indices, expected {}: one for each index axis", index.len(), self.indices.len()));
        }
        let mut entry = 0;
        for (axis, (&i, &length)) in index.iter().zip(&self.indices).enumerate() {
            if i >= length {
                return unfit(format!("index {i} on axis {axis} of {length} entries, expected 0 to {}", length - 1));
            }
            entry = entry * length + i;
        }
        Ok(entry)
    }

    /// The entry of each opaque axis that `entry` is the row-major number of.
    pub fn index_of(&self, mut entry: usize) -> Vec<usize> {
        let mut index = self.indices.clone();
        for i in index.iter_mut().rev() {
            let length = *i;
            *i = entry % length;
            entry /= length;
        }
        index
    }

    /// The triangles of the incoming axis, if it is of triangles.
    pub(super) fn incoming_mesh(&self) -> Option<&MeshLookup> {
        if let Incoming::Triangles(lookup) = &self.incoming { Some(lookup) } else { None }
    }

    /// The entry of the incoming axis for `wi` in the piecewise constant sense; 0 where there is no such axis.
    #[inline(always)]
    pub(super) fn incoming_entry(&self, wi: Option<Direction>) -> Result<usize, EvaluateError> {
        self.look_up(wi, || 0, MeshLookup::locate, nearest_elevation)
    }

    /// The entries of the incoming axis for `wi` in the sense of means around vertices; entry 0 where there is no such axis.
    pub(super) fn incoming_stencil(&self, wi: Option<Direction>) -> Result<Stencil, EvaluateError> {
        self.look_up(wi, || Stencil::one(0), MeshLookup::stencil, elevation_stencil)
    }

    #[inline(always)]
    fn look_up<T>(
        &self,
        wi: Option<Direction>,
        none: impl Fn() -> T,
        on_triangles: impl Fn(&MeshLookup, Direction) -> Option<T>,
        on_elevations: impl Fn(&[f64], f64) -> T,
    ) -> Result<T, EvaluateError> {
        match (&self.incoming, wi) {
            (Incoming::None, None) => return Ok(none()),
            (Incoming::Triangles(lookup), Some(wi)) => {
                if let Some(found) = on_triangles(lookup, wi) {
                    return Ok(found);
                }
            }
            (Incoming::Elevations(values), Some(wi)) if wi.cos_theta() >= 0.0 => {
                return Ok(on_elevations(values, wi.theta_degrees()));
            }
            _ => {}
        }
        self.refuse_incoming(wi)
    }

    /// Why `wi` has no place on the incoming axis.
    #[cold]
    pub(super) fn refuse_incoming<T>(&self, wi: Option<Direction>) -> Result<T, EvaluateError> {
        let quantity = self.quantity;
        let (wi, domain) = match (&self.incoming, wi) {
            (Incoming::None, _) => return unfit(format!("wi was given, but this {quantity} has no incoming axis")),
            (_, None) => return unfit(format!("no wi was given, but this {quantity} has an incoming axis")),
            (Incoming::Triangles(lookup), Some(wi)) => (wi, lookup.mesh().domain()),
            (Incoming::Elevations(_), Some(wi)) => (wi, Domain::Hemisphere),
        };
        unfit(format!("wi has theta = {:.3} degrees, outside the incoming domain `{domain}`", wi.theta_degrees()))
    }

    /// `wi` as nodes know it: turned to azimuth 0 where they are elevations, and anything where there is none.
    #[inline]
    pub(super) fn wi_in_plane(&self, wi: Option<Direction>) -> Vector {
        let Some(wi) = wi else { return [0.0, 0.0, 1.0] };
        if self.is_isotropic() { in_plane(wi.xyz()).0 } else { wi.xyz() }
    }

    /// Entries of the opaque axes together.
    pub(super) fn entries(&self) -> usize {
        self.indices.iter().product()
    }

    pub(super) fn has_no_index(&self) -> bool {
        self.indices.is_empty()
    }

    pub(super) fn has_incoming(&self) -> bool {
        !matches!(self.incoming, Incoming::None)
    }

    /// Whether `direction` is inside the incoming domain.
    #[inline]
    pub(super) fn takes(&self, direction: Direction) -> bool {
        match &self.incoming {
            Incoming::None => false,
            Incoming::Triangles(lookup) => lookup.holds(direction.xyz()),
            Incoming::Elevations(_) => direction.cos_theta() >= 0.0,
        }
    }

    /// Whether `direction` is inside the outgoing domain.
    #[inline]
    pub(super) fn sends(&self, direction: Direction) -> bool {
        self.outgoing.as_ref().is_some_and(|lookup| lookup.holds(direction.xyz()))
    }

    pub(super) fn is_isotropic(&self) -> bool {
        matches!(self.incoming, Incoming::Elevations(_))
    }

    /// The mesh of the outgoing axis and the direction in it: `wo`, turned back by the azimuth of `wi` where incoming
    /// directions are elevations.
    #[inline(always)]
    pub(super) fn outgoing(
        &self,
        wi: Option<Direction>,
        wo: Option<Direction>,
    ) -> Result<Option<(&MeshLookup, Direction)>, EvaluateError> {
        let quantity = self.quantity;
        match (&self.outgoing, wo) {
            (None, None) => Ok(None),
            (None, Some(_)) => unfit(format!("wo was given, but this {quantity} has no outgoing axis")),
            (Some(_), None) => unfit(format!("no wo was given, but this {quantity} has an outgoing axis")),
            (Some(lookup), Some(wo)) => {
                if !self.is_isotropic() {
                    return Ok(Some((lookup, wo)));
                }
                let [cos, sin] = self.azimuth(wi);
                Ok(Some((lookup, turned(wo, [cos, -sin]))))
            }
        }
    }

    /// Cosine and sine of the azimuth that isotropic data take from `wi`; of 0 otherwise.
    #[inline]
    pub(super) fn azimuth(&self, wi: Option<Direction>) -> [f64; 2] {
        let (Incoming::Elevations(_), Some(wi)) = (&self.incoming, wi) else { return [1.0, 0.0] };
        in_plane(wi.xyz()).1
    }
}

/// How lobes may go from one incoming direction to the next.
fn candidates(quantity: Quantity) -> Vec<Alignment> {
    match quantity {
        Quantity::Brdf | Quantity::Bsdf => vec![Alignment::None, Alignment::HalfVector, Alignment::TurnedHalfVector],
        Quantity::Btdf | Quantity::Phase => vec![Alignment::None, Alignment::Rotation],
        _ => vec![Alignment::None],
    }
}

/// Planes and their smooth tables, where a few planes hold the samples.
fn planes(
    measurement: &Measurement,
    lambdas: usize,
    outgoing: Option<&MeshLookup>,
    nodes: Nodes,
    entries: usize,
    candidates: &[Alignment],
) -> Option<(Planes, Smooth)> {
    let lookup = outgoing?;
    let planes = Planes::of(measurement.tensor.samples(), lambdas)?;
    let cells = Cells::new(lookup.mesh(), measurement.sampling == Sampling::Average);
    let has_cosine = measurement.quantity.has_cosine();
    let smooth = Smooth::new(&planes, &cells, lookup, nodes, entries, candidates, has_cosine)?;
    Some((planes, smooth))
}

/// `direction` turned about `+z` by the angle with this cosine and sine.
#[inline]
pub(super) fn turned(direction: Direction, by: [f64; 2]) -> Direction {
    Direction::from_unit(vector::turned(direction.xyz(), by))
}

/// `d` turned about +z to azimuth 0, and cosine and sine of the azimuth that it had; the normal's is 0.
#[inline(always)]
pub(super) fn in_plane([x, y, z]: Vector) -> (Vector, [f64; 2]) {
    let length = (x * x + y * y).sqrt();
    let is_turned = length > 0.0;
    let azimuth = [if is_turned { x / length } else { 1.0 }, if is_turned { y / length } else { 0.0 }];
    ([length, 0.0, z], azimuth)
}
