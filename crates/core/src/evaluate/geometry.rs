//! Geometry of a material: its axes, their entries and the cells that contain directions.

use super::directions::Pairs;
use super::error::{Argument, EvaluateError, QueryError, unfit};
use super::incoming::Nodes;
use super::located::OUTSIDE;
use super::lookup::{MeshLookup, Stencil, elevation_stencil};
use super::place::Place;
use crate::domain::vector::{self, Vector};
use crate::domain::{
    Axis, Direction, DirectionGrid, Domain, Layout, Measurement, Quantity, Sampling, TriangleMesh, Unit, WavelengthGrid,
};
use crate::numeric::bracket::nearest;
use std::sync::Arc;

/// Axes of a material, and the tables that locate directions on these axes.
#[derive(Debug)]
pub(super) struct Geometry {
    quantity: Quantity,
    unit: Unit,
    sampling: Sampling,
    axes: Vec<Axis>,
    layout: Layout,
    /// Lengths of the index axes (axes of the samples before those of directions and wavelength).
    indices: Vec<usize>,
    incoming: Incoming,
    /// Sampled incoming directions, at azimuth 0 if only elevations are sampled; a single `+z` without an incoming
    /// axis.
    incoming_directions: Vec<Vector>,
    outgoing: Option<Arc<MeshLookup>>,
    /// Grid of polar angles and azimuths of the outgoing directions; `None` if outgoing directions do not form one.
    outgoing_grid: Option<DirectionGrid>,
    /// Numbers of incoming directions, of outgoing directions and of samples in a spectrum; 1 for a missing axis.
    shape: [usize; 3],
    /// True if the data are a single spectrum, independent of indices and directions.
    is_alone: bool,
}

/// Tolerance in degrees within which a polar angle counts as equal to the last measured one.
const ROUNDING: f64 = 1e-6;

#[derive(Debug)]
enum Incoming {
    None,
    Triangles(Arc<MeshLookup>),
    Elevations(Vec<f64>),
    Grid(DirectionGrid),
}

impl Geometry {
    /// Describes the axes of a measurement; fails if they do not fit its quantity.
    pub(super) fn new(measurement: &Measurement) -> Result<Self, EvaluateError> {
        let layout = measurement.layout()?;
        let axes = measurement.tensor.axes();
        // The two sides of a surface are functions of their own; a phase function or a luminaire goes on smoothly.
        let lookup = |mesh: TriangleMesh| Arc::new(MeshLookup::new(mesh, measurement.quantity.has_cosine()));
        let incoming = match layout.incoming.map(|axis| &axes[axis]) {
            Some(Axis::Triangles(mesh)) => Incoming::Triangles(lookup(*mesh)),
            Some(Axis::Elevation(values)) => Incoming::Elevations(values.clone()),
            Some(Axis::Grid(grid)) => Incoming::Grid(grid.clone()),
            _ => Incoming::None,
        };
        let outgoing_grid = match layout.outgoing.map(|axis| &axes[axis]) {
            Some(Axis::Grid(grid)) => Some(grid.clone()),
            _ => None,
        };
        let outgoing = match (layout.outgoing.map(|axis| &axes[axis]), &incoming) {
            (Some(Axis::Triangles(mesh)), Incoming::Triangles(same)) if same.mesh() == *mesh => Some(Arc::clone(same)),
            (Some(Axis::Triangles(mesh)), _) => Some(lookup(*mesh)),
            _ => None,
        };
        let indices: Vec<usize> = axes[..layout.indices].iter().map(Axis::len).collect();
        let length = |axis: Option<usize>| axis.map_or(1, |axis| axes[axis].len());
        let shape = [length(layout.incoming), length(layout.outgoing), length(layout.spectral)];
        let incoming_directions = match layout.incoming.map(|axis| &axes[axis]) {
            None => vec![[0.0, 0.0, 1.0]],
            Some(axis) => (0..axis.len()).filter_map(|entry| axis.direction(entry)).map(Direction::xyz).collect(),
        };
        let (quantity, unit, sampling) = (measurement.quantity, measurement.unit, measurement.sampling);
        let (axes, layout) = (axes.to_vec(), layout.clone());
        let is_alone = layout.incoming.is_none() && indices.iter().product::<usize>() * shape[1] == 1;
        Ok(Self {
            quantity,
            unit,
            sampling,
            axes,
            layout,
            indices,
            incoming,
            incoming_directions,
            outgoing,
            outgoing_grid,
            shape,
            is_alone,
        })
    }

    /// Returns true if incoming or outgoing directions form a grid of polar angles and azimuths.
    #[inline]
    pub(super) fn is_grid(&self) -> bool {
        self.outgoing_grid.is_some() || matches!(self.incoming, Incoming::Grid(_))
    }

    /// Grid of polar angles and azimuths of the outgoing directions; `None` if outgoing directions do not form one.
    pub(super) fn outgoing_grid(&self) -> Option<&DirectionGrid> {
        self.outgoing_grid.as_ref()
    }

    /// Interpolation nodes over incoming directions.
    pub(super) fn nodes(&self) -> Nodes {
        match &self.incoming {
            // Samples on a grid have nodes of their own.
            Incoming::None | Incoming::Grid(_) => Nodes::One,
            Incoming::Triangles(lookup) => Nodes::triangles(Arc::clone(lookup)),
            Incoming::Elevations(values) => Nodes::elevations(values),
        }
    }

    #[inline]
    pub(super) fn quantity(&self) -> Quantity {
        self.quantity
    }

    pub(super) fn unit(&self) -> Unit {
        self.unit
    }

    pub(super) fn sampling(&self) -> Sampling {
        self.sampling
    }

    pub(super) fn axes(&self) -> &[Axis] {
        &self.axes
    }

    pub(super) fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Numbers of incoming directions, of outgoing directions and of samples in a spectrum; 1 for a missing axis.
    #[inline]
    pub(super) fn shape(&self) -> [usize; 3] {
        self.shape
    }

    /// Number of samples in one spectrum.
    #[inline]
    pub(super) fn lambdas(&self) -> usize {
        self.shape[2]
    }

    /// Wavelengths of the samples; `None` for RGB and monochromatic data.
    pub(super) fn grid(&self) -> Option<&WavelengthGrid> {
        match self.axes.last() {
            Some(Axis::Wavelength(grid)) => Some(grid),
            _ => None,
        }
    }

    /// Number of combinations of indices: product of the lengths of the index axes (axes of the samples before those of
    /// directions and wavelength).
    pub(super) fn entries(&self) -> usize {
        self.indices.iter().product()
    }

    /// Returns true if the data are a single spectrum, independent of indices and directions.
    #[inline]
    pub(super) fn is_alone(&self) -> bool {
        self.is_alone
    }

    /// Number of spectra: product of the lengths of all axes but the spectral one.
    pub(super) fn cells(&self) -> usize {
        let [n_in, n_out, _] = self.shape;
        self.entries() * n_in * n_out
    }

    /// Triangle mesh of the outgoing directions with its lookup tables; `None` if outgoing directions do not form one.
    #[inline]
    pub(super) fn mesh(&self) -> Option<&Arc<MeshLookup>> {
        self.outgoing.as_ref()
    }

    /// Sampled incoming direction of this number: a triangle's centroid, or an elevation at azimuth 0; `+z` without an
    /// incoming axis.
    #[inline(always)]
    pub(super) fn incoming_direction(&self, entry: usize) -> Vector {
        self.incoming_directions[entry]
    }

    /// Row-major position of `index` (one index for each index axis) among all combinations of indices (positions on
    /// the axes before the directions).
    #[inline]
    pub(super) fn entry(&self, index: &[usize]) -> Result<usize, EvaluateError> {
        if index.len() != self.indices.len() {
            return unfit(QueryError::Indices { found: index.len(), expected: self.indices.len() });
        }
        let mut entry = 0;
        for (axis, (&i, &length)) in index.iter().zip(&self.indices).enumerate() {
            if i >= length {
                return unfit(QueryError::Index { found: i, axis, length });
            }
            entry = entry * length + i;
        }
        Ok(entry)
    }

    /// Index on each index axis of the combination at row-major position `entry`; inverse of [`Geometry::entry`].
    pub(super) fn index_of(&self, mut entry: usize) -> Vec<usize> {
        let mut index = self.indices.clone();
        for i in index.iter_mut().rev() {
            let length = *i;
            *i = entry % length;
            entry /= length;
        }
        index
    }

    /// Triangle mesh of the incoming directions; `None` if incoming directions do not form one.
    #[inline]
    pub(super) fn incoming_mesh(&self) -> Option<&MeshLookup> {
        if let Incoming::Triangles(lookup) = &self.incoming { Some(lookup) } else { None }
    }

    /// Number of the incoming sample that holds at `wi` in piecewise constant evaluation; 0 without an incoming axis.
    #[inline(always)]
    pub(super) fn incoming_entry(&self, wi: Option<Direction>) -> Result<usize, EvaluateError> {
        self.look_up(wi, || 0, MeshLookup::locate, nearest, |entry| entry)
    }

    /// Incoming samples, with weights, from which values at `wi` are interpolated smoothly; sample 0 alone without an
    /// incoming axis. On a mesh, means of the triangles around each vertex are interpolated between vertices.
    pub(super) fn incoming_stencil(&self, wi: Option<Direction>) -> Result<Stencil, EvaluateError> {
        self.look_up(wi, || Stencil::one(0), MeshLookup::stencil, elevation_stencil, Stencil::one)
    }

    #[inline(always)]
    fn look_up<T>(
        &self,
        wi: Option<Direction>,
        none: impl Fn() -> T,
        on_triangles: impl Fn(&MeshLookup, Direction) -> Option<T>,
        on_elevations: impl Fn(&[f64], f64) -> T,
        on_grid: impl Fn(usize) -> T,
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
            (Incoming::Grid(grid), Some(wi)) => {
                if let Some(entry) = grid.nearest(wi) {
                    return Ok(on_grid(entry));
                }
            }
            _ => {}
        }
        self.refuse_incoming(wi)
    }

    /// Returns the error for an incoming direction that is missing, superfluous or outside the incoming axis.
    #[cold]
    pub(super) fn refuse_incoming<T>(&self, wi: Option<Direction>) -> Result<T, EvaluateError> {
        let quantity = self.quantity;
        let (wi, domain) = match (&self.incoming, wi) {
            (Incoming::None, _) => return unfit(QueryError::UnexpectedDirection { argument: Argument::Wi, quantity }),
            (_, None) => return unfit(QueryError::MissingDirection { argument: Argument::Wi, quantity }),
            (Incoming::Triangles(lookup), Some(wi)) => (wi, lookup.mesh().domain()),
            (Incoming::Elevations(_), Some(wi)) => (wi, Domain::Hemisphere),
            (Incoming::Grid(_), Some(wi)) => {
                return unfit(QueryError::Unmeasured { theta: wi.theta_degrees(), phi: wi.phi_degrees() });
            }
        };
        unfit(QueryError::Outside { theta: wi.theta_degrees(), domain })
    }

    /// Rotates an incoming direction into the frame of the interpolation nodes: to azimuth 0 for isotropic data.
    /// Returns `+z` for data without an incoming direction.
    #[inline]
    pub(super) fn wi_in_plane(&self, wi: Option<Direction>) -> Vector {
        let Some(wi) = wi else { return [0.0, 0.0, 1.0] };
        if self.is_isotropic() { in_plane(wi.xyz()).0 } else { wi.xyz() }
    }

    #[inline]
    fn has_no_index(&self) -> bool {
        self.indices.is_empty()
    }

    #[inline]
    pub(super) fn has_incoming(&self) -> bool {
        !matches!(self.incoming, Incoming::None)
    }

    /// Returns true if `direction` is inside the domain of the incoming axis.
    #[inline]
    pub(super) fn takes(&self, direction: Direction) -> bool {
        match &self.incoming {
            Incoming::None => false,
            Incoming::Triangles(lookup) => lookup.holds(direction.xyz()),
            Incoming::Elevations(_) => direction.cos_theta() >= 0.0,
            Incoming::Grid(grid) => grid.angles(direction).is_some(),
        }
    }

    /// Measured polar angles of incidence in degrees, in increasing order; empty for triangles.
    fn incoming_polar(&self) -> &[f64] {
        match self.layout.incoming.map(|axis| &self.axes[axis]) {
            Some(Axis::Elevation(angles)) => angles,
            Some(Axis::Grid(grid)) => grid.polar(),
            _ => &[],
        }
    }

    /// Returns true if `direction` is further from the normal than the last measured polar angle of incidence.
    pub(super) fn is_past_last(&self, direction: Direction) -> bool {
        self.incoming_polar().last().is_some_and(|&last| direction.theta_degrees() > last + ROUNDING)
    }

    /// Returns true if `direction` is nearer to the normal than the first measured polar angle of incidence.
    pub(super) fn is_before_first(&self, direction: Direction) -> bool {
        self.incoming_polar().first().is_some_and(|&first| direction.theta_degrees() < first - ROUNDING)
    }

    /// Returns true if the outgoing `direction` is beyond the first or last polar angle at which a grid was measured,
    /// where the grid continues the value of that angle.
    pub(super) fn is_beyond_measured(&self, direction: Direction) -> bool {
        let Some(grid) = &self.outgoing_grid else { return false };
        let [polar, _] = grid.frame().angles(direction);
        let (first, last) = (grid.polar()[0], grid.polar()[grid.polar().len() - 1]);
        // Mirrored latitudes meet at the equator.
        let (first, polar) = if grid.is_polar_mirrored() { (0.0, polar.abs()) } else { (first, polar) };
        (polar < first - ROUNDING || polar > last + ROUNDING) && grid.angles(direction).is_some()
    }

    /// Returns true if `direction` is inside the domain of the outgoing axis.
    #[inline]
    pub(super) fn sends(&self, direction: Direction) -> bool {
        match &self.outgoing_grid {
            Some(grid) => grid.angles(direction).is_some(),
            None => self.outgoing.as_ref().is_some_and(|lookup| lookup.holds(direction.xyz())),
        }
    }

    /// Returns true if the data are isotropic: incoming directions are elevations alone, without azimuths.
    #[inline]
    pub(super) fn is_isotropic(&self) -> bool {
        matches!(self.incoming, Incoming::Elevations(_))
    }

    /// Mesh of the outgoing directions, and `wo` in its frame: rotated back by the azimuth of `wi` for isotropic data.
    #[inline(always)]
    pub(super) fn outgoing(
        &self,
        wi: Option<Direction>,
        wo: Option<Direction>,
    ) -> Result<Option<(&MeshLookup, Direction)>, EvaluateError> {
        let quantity = self.quantity;
        match (&self.outgoing, wo) {
            (None, None) => Ok(None),
            (None, Some(_)) => unfit(QueryError::UnexpectedDirection { argument: Argument::Wo, quantity }),
            (Some(_), None) => unfit(QueryError::MissingDirection { argument: Argument::Wo, quantity }),
            (Some(lookup), Some(wo)) => {
                if !self.is_isotropic() {
                    return Ok(Some((lookup, wo)));
                }
                let [cos, sin] = self.azimuth(wi);
                Ok(Some((lookup, turned(wo, [cos, -sin]))))
            }
        }
    }

    /// Incoming and outgoing direction of a query in the frame of samples on a grid of angles: rotated so that `wi` has
    /// azimuth 0 if the data are isotropic. `+z` replaces a missing direction.
    #[inline]
    pub(super) fn in_lines(&self, place: Place<'_>) -> Result<[Vector; 2], EvaluateError> {
        let quantity = self.quantity;
        if place.wi.is_some() != self.has_incoming() {
            return self.refuse_incoming(place.wi);
        }
        let (wi, [cos, sin]) = match place.wi {
            None => ([0.0, 0.0, 1.0], [1.0, 0.0]),
            Some(wi) if self.is_isotropic() => in_plane(wi.xyz()),
            Some(wi) => (wi.xyz(), [1.0, 0.0]),
        };
        let wo = match (&self.outgoing_grid, place.wo) {
            (None, None) => [0.0, 0.0, 1.0],
            (None, Some(_)) => return unfit(QueryError::UnexpectedDirection { argument: Argument::Wo, quantity }),
            (Some(_), None) => return unfit(QueryError::MissingDirection { argument: Argument::Wo, quantity }),
            (Some(_), Some(wo)) if self.is_isotropic() => vector::turned(wo.xyz(), [cos, -sin]),
            (Some(_), Some(wo)) => wo.xyz(),
        };
        Ok([wi, wo])
    }

    /// Row-major position of a query's indices among all combinations of indices (positions on the axes before the
    /// directions).
    #[inline]
    pub(super) fn entry_of(&self, place: Place<'_>) -> Result<usize, EvaluateError> {
        if place.index.is_empty() && self.has_no_index() { Ok(0) } else { self.entry(place.index) }
    }

    /// Number of the spectrum that holds at a query in piecewise constant evaluation, row-major over all axes but the
    /// spectral one; `None` if `wo` is outside the outgoing domain.
    #[inline]
    pub(super) fn cell_of(&self, place: Place<'_>) -> Result<Option<usize>, EvaluateError> {
        let entry = self.entry_of(place)?;
        self.cell_at(entry, place)
    }

    /// Number of the spectrum that holds at a query in piecewise constant evaluation, as [`Geometry::cell_of`] returns
    /// it. `entry` is the known row-major position of the query's indices (positions on the axes before the
    /// directions).
    #[inline(always)]
    pub(super) fn cell_at(&self, entry: usize, place: Place<'_>) -> Result<Option<usize>, EvaluateError> {
        let incoming = self.incoming_entry(place.wi)?;
        let outgoing = match self.outgoing(place.wi, place.wo)? {
            None => Some(0),
            Some((lookup, wo)) => lookup.locate(wo),
        };
        let [n_in, n_out, _] = self.shape;
        Ok(outgoing.map(|outgoing| (entry * n_in + incoming) * n_out + outgoing))
    }

    /// Cosine and sine of the azimuth of `wi` for isotropic data; [1, 0] otherwise.
    #[inline]
    pub(super) fn azimuth(&self, wi: Option<Direction>) -> [f64; 2] {
        let (Incoming::Elevations(_), Some(wi)) = (&self.incoming, wi) else { return [1.0, 0.0] };
        in_plane(wi.xyz()).1
    }

    /// For isotropic data, rotates `wo` about the normal by plus the azimuth of `wi`: from the frame in which `wi` has
    /// azimuth 0 to the frame in which `wi` is given. Leaves it unchanged for other data.
    #[inline]
    pub(super) fn turned_with(&self, wi: Option<Direction>, wo: Direction) -> Direction {
        if !self.is_isotropic() {
            return wo;
        }
        turned(wo, self.azimuth(wi))
    }

    /// Writes, for each incoming direction of `pairs`, the number of the incoming sample that holds there in piecewise
    /// constant evaluation.
    pub(super) fn incoming_entries(&self, pairs: Pairs<'_>, to: &mut [u32]) -> Result<(), EvaluateError> {
        if let (Some(lookup), Some(wi)) = (self.incoming_mesh(), pairs.wi)
            && lookup.locate_all(wi, to)
            && !to.contains(&OUTSIDE)
        {
            return Ok(());
        }
        // Locates one by one, so that the error names the direction.
        for (i, to) in to.iter_mut().enumerate() {
            *to = self.incoming_entry(pairs.wi_at(i)?)? as u32;
        }
        Ok(())
    }

    /// Writes, for each outgoing direction of `pairs`, the number of the triangle that contains it, or [`OUTSIDE`].
    pub(super) fn outgoing_entries(&self, pairs: Pairs<'_>, to: &mut [u32]) -> Result<(), EvaluateError> {
        if let (Some(lookup), Some(wo), false) = (&self.outgoing, pairs.wo, self.is_isotropic())
            && lookup.locate_all(wo, to)
        {
            return Ok(());
        }
        for (i, to) in to.iter_mut().enumerate() {
            let place = pairs.place(i)?;
            *to = match self.outgoing(place.wi, place.wo)? {
                None => 0,
                Some((lookup, wo)) => lookup.locate_or_outside(wo.xyz()),
            };
        }
        Ok(())
    }

    /// Heap memory, in bytes, of the tables in which incoming and outgoing directions are looked up.
    pub(super) fn memory(&self) -> usize {
        let incoming = match &self.incoming {
            Incoming::None => 0,
            Incoming::Triangles(lookup) if self.outgoing.as_ref().is_some_and(|out| Arc::ptr_eq(out, lookup)) => 0,
            Incoming::Triangles(lookup) => lookup.memory(),
            Incoming::Elevations(values) => size_of_val(&**values),
            Incoming::Grid(grid) => 8 * grid.shape().into_iter().sum::<usize>(),
        };
        incoming + self.outgoing.as_ref().map_or(0, |lookup| lookup.memory()) + size_of_val(&*self.incoming_directions)
    }
}

/// Direction rotated about `+z` by the angle with the given cosine and sine.
#[inline]
pub(super) fn turned(direction: Direction, by: [f64; 2]) -> Direction {
    Direction::from_unit(vector::turned(direction.xyz(), by))
}

/// Vector `d` rotated about +z to azimuth 0, and cosine and sine of its original azimuth. The azimuth of a vector along
/// the normal counts as 0.
#[inline(always)]
pub(super) fn in_plane([x, y, z]: Vector) -> (Vector, [f64; 2]) {
    let length = (x * x + y * y).sqrt();
    let is_turned = length > 0.0;
    let azimuth = [if is_turned { x / length } else { 1.0 }, if is_turned { y / length } else { 0.0 }];
    ([length, 0.0, z], azimuth)
}
