//! An opened material: the samples, the roles of their axes, and the tables that queries read.

use super::albedo;
use super::lookup::{MeshLookup, Stencil, elevation_stencil, nearest_elevation};
use super::sampling::Trees;
use super::{EvaluateError, unfit};
use crate::compress::{self, Summary};
use crate::domain::{Axis, Direction, Domain, Measurement, WavelengthGrid};
use std::sync::Arc;

/// An opened material; share it between threads by reference.
#[derive(Debug)]
pub struct Material {
    pub(super) measurement: Measurement,
    summary: Option<Summary>,
    /// The lengths of the leading opaque axes.
    indices: Vec<usize>,
    incoming: Incoming,
    pub(super) outgoing: Option<Arc<MeshLookup>>,
    /// Entries of the incoming and the outgoing axis, samples of a spectrum; 1 where there is no such axis.
    pub(super) shape: [usize; 3],
    pub(super) has_masked: bool,
    /// Present with an outgoing axis.
    pub(super) trees: Option<Trees>,
    /// `[cell, lambda]`; empty without an outgoing axis.
    pub(super) albedos: Vec<f32>,
}

#[derive(Debug)]
enum Incoming {
    None,
    Triangles(Arc<MeshLookup>),
    Elevations(Vec<f64>),
}

impl Material {
    /// Opens a compressed material.
    pub fn open(bytes: &[u8]) -> Result<Self, EvaluateError> {
        let decoded = compress::decode(bytes)?;
        Ok(Self { summary: Some(decoded.summary), ..Self::of(decoded.measurement)? })
    }

    /// Uses a measurement as it is.
    pub fn of(measurement: Measurement) -> Result<Self, EvaluateError> {
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
        let has_masked = measurement.tensor.masked() > 0;
        let trees = outgoing.as_ref().map(|lookup| Trees::new(&measurement, lookup.mesh(), shape[2]));
        let albedos =
            outgoing.as_ref().map(|lookup| albedo::table(&measurement, lookup.mesh(), shape[2])).unwrap_or_default();
        Ok(Self { measurement, summary: None, indices, incoming, outgoing, shape, has_masked, trees, albedos })
    }

    /// The decoded samples and what they are.
    pub fn measurement(&self) -> &Measurement {
        &self.measurement
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

    /// Memory of the opened form in bytes: samples, tables of the meshes, sampling trees, albedo.
    pub fn memory(&self) -> usize {
        let incoming = match &self.incoming {
            Incoming::None => 0,
            Incoming::Triangles(lookup) if self.outgoing.as_ref().is_some_and(|out| Arc::ptr_eq(out, lookup)) => 0,
            Incoming::Triangles(lookup) => lookup.memory(),
            Incoming::Elevations(values) => size_of_val(&**values),
        };
        size_of::<Self>()
            + size_of_val(self.measurement.tensor.samples())
            + incoming
            + self.outgoing.as_ref().map_or(0, |lookup| lookup.memory())
            + self.trees.as_ref().map_or(0, Trees::memory)
            + size_of_val(&*self.albedos)
    }

    pub(super) fn grid(&self) -> Option<&WavelengthGrid> {
        match self.measurement.tensor.axes().last() {
            Some(Axis::Wavelength(grid)) => Some(grid),
            _ => None,
        }
    }

    /// The number of `index` among the entries of the opaque axes, row-major.
    pub(super) fn entry(&self, index: &[usize]) -> Result<usize, EvaluateError> {
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

    /// The entry of the incoming axis for `wi` in the piecewise constant sense; 0 where there is no such axis.
    pub(super) fn incoming_entry(&self, wi: Option<Direction>) -> Result<usize, EvaluateError> {
        self.look_up(wi, || 0, MeshLookup::locate, nearest_elevation)
    }

    /// The entries of the incoming axis for `wi` in the smooth sense; entry 0 where there is no such axis.
    pub(super) fn incoming_stencil(&self, wi: Option<Direction>) -> Result<Stencil, EvaluateError> {
        self.look_up(wi, || Stencil::one(0), MeshLookup::stencil, elevation_stencil)
    }

    fn look_up<T>(
        &self,
        wi: Option<Direction>,
        none: impl Fn() -> T,
        on_triangles: impl Fn(&MeshLookup, Direction) -> Option<T>,
        on_elevations: impl Fn(&[f64], f64) -> T,
    ) -> Result<T, EvaluateError> {
        let quantity = self.measurement.quantity;
        let (wi, domain) = match (&self.incoming, wi) {
            (Incoming::None, None) => return Ok(none()),
            (Incoming::None, Some(_)) => {
                return unfit(format!("wi was given, but this {quantity} has no incoming axis"));
            }
            (_, None) => return unfit(format!("no wi was given, but this {quantity} has an incoming axis")),
            (Incoming::Triangles(lookup), Some(wi)) => match on_triangles(lookup, wi) {
                Some(found) => return Ok(found),
                None => (wi, lookup.mesh().domain()),
            },
            (Incoming::Elevations(_), Some(wi)) if wi.cos_theta() < 0.0 => (wi, Domain::Hemisphere),
            (Incoming::Elevations(values), Some(wi)) => return Ok(on_elevations(values, wi.theta_degrees())),
        };
        unfit(format!("wi has theta = {:.3} degrees, outside the incoming domain `{domain}`", wi.theta_degrees()))
    }

    /// The mesh of the outgoing axis and the direction in it: `wo`, turned back by the azimuth of `wi` where incoming
    /// directions are elevations.
    pub(super) fn outgoing(
        &self,
        wi: Option<Direction>,
        wo: Option<Direction>,
    ) -> Result<Option<(&MeshLookup, Direction)>, EvaluateError> {
        let quantity = self.measurement.quantity;
        match (&self.outgoing, wo) {
            (None, None) => Ok(None),
            (None, Some(_)) => unfit(format!("wo was given, but this {quantity} has no outgoing axis")),
            (Some(_), None) => unfit(format!("no wo was given, but this {quantity} has an outgoing axis")),
            (Some(lookup), Some(wo)) => {
                let [cos, sin] = self.azimuth(wi);
                Ok(Some((lookup, turned(wo, cos, -sin))))
            }
        }
    }

    /// Cosine and sine of the azimuth that isotropic data take from `wi`; of 0 otherwise.
    pub(super) fn azimuth(&self, wi: Option<Direction>) -> [f64; 2] {
        let (Incoming::Elevations(_), Some(wi)) = (&self.incoming, wi) else { return [1.0, 0.0] };
        let [x, y, _] = wi.xyz();
        let length = libm::hypot(x, y);
        if length > 0.0 { [x / length, y / length] } else { [1.0, 0.0] }
    }
}

/// `direction` turned about `+z` by the angle with this cosine and sine.
pub(super) fn turned(direction: Direction, cos: f64, sin: f64) -> Direction {
    let [x, y, z] = direction.xyz();
    Direction::from_unit([cos * x - sin * y, sin * x + cos * y, z])
}
