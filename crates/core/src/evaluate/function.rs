//! A material's function at one place: geometry and form together.

use super::error::EvaluateError;
use super::form::{Course, Form};
use super::geometry::Geometry;
use super::incoming::{Around, Nodes};
use super::place::{Interpolation, Place};
use super::planes::Planes;
use super::smooth::{Seen, Smooth};
use crate::domain::vector::Vector;
use crate::domain::{Direction, Measurement};
use crate::numeric::wide;

/// Function of direction and wavelength of an opened material: the axes that locate directions, and the stored samples.
#[derive(Debug)]
pub(super) struct Function {
    geometry: Geometry,
    form: Form,
}

impl Function {
    /// Builds the function of directions and wavelength that a measurement samples. `geometry` describes the
    /// measurement's axes.
    pub(super) fn new(measurement: Measurement, geometry: Geometry, course: Course) -> Self {
        let form = Form::of(measurement, &geometry, course);
        Self { geometry, form }
    }

    #[inline(always)]
    pub(super) fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    #[inline(always)]
    pub(super) fn form(&self) -> &Form {
        &self.form
    }

    /// Heap memory of a material's function in bytes: lookup tables, samples and interpolation tables.
    pub(super) fn memory(&self) -> usize {
        self.geometry.memory() + self.form.memory()
    }

    /// Calls `work` with the spectral coefficients at a query and with their share of light (0 dark to 1 lit). The
    /// share is 0 if `wo` is outside the outgoing domain and NaN if the samples are masked. Passing the number of the
    /// incoming sample as `incoming` saves a search.
    #[inline(always)]
    pub(super) fn with_row<R>(
        &self,
        planes: &Planes,
        smooth: &Smooth,
        place: Place<'_>,
        how: Interpolation,
        incoming: Option<usize>,
        work: impl FnOnce(&[f32], f32) -> R,
    ) -> Result<R, EvaluateError> {
        let entry = self.geometry.entry_of(place)?;
        wide(
            #[inline(always)]
            || {
                Ok(match how {
                    Interpolation::Constant => match self.geometry.cell_at(entry, place)? {
                        Some(cell) => work(planes.row(cell), planes.presence(cell)),
                        None => work(&[], 0.0),
                    },
                    Interpolation::Smooth => match self.seen(smooth, incoming, place)? {
                        Some(seen) => {
                            let mixed = smooth.at(entry, &seen);
                            work(&mixed.row, mixed.presence)
                        }
                        None => work(&[], 0.0),
                    },
                })
            },
        )
    }

    /// Locates a pair of directions for smooth interpolation; `None` if `wo` is outside the outgoing domain. Passing
    /// the number of the incoming sample as `incoming` saves a search.
    #[inline(always)]
    pub(super) fn seen(
        &self,
        smooth: &Smooth,
        incoming: Option<usize>,
        place: Place<'_>,
    ) -> Result<Option<Seen>, EvaluateError> {
        let (around, wi) = self.around(smooth, incoming, place.wi)?;
        let Some((lookup, wo)) = self.geometry.outgoing(place.wi, place.wo)? else { return Ok(None) };
        let wo = wo.xyz();
        Ok(if lookup.holds(wo) { Some(Seen { around, wi, wo }) } else { None })
    }

    /// Interpolation nodes around an incoming direction, and that direction in the frame of the nodes (azimuth 0 for
    /// isotropic data). Passing the number of the incoming sample as `incoming` saves a search.
    #[inline(always)]
    pub(super) fn around(
        &self,
        smooth: &Smooth,
        incoming: Option<usize>,
        wi: Option<Direction>,
    ) -> Result<(Around, Vector), EvaluateError> {
        if wi.is_some() != self.geometry.has_incoming() {
            return self.geometry.refuse_incoming(wi);
        }
        let plane = self.geometry.wi_in_plane(wi);
        let around =
            incoming.map_or_else(|| smooth.nodes().around(plane), |incoming| smooth.nodes().around_in(incoming, plane));
        match around.filter(|_| !self.geometry.is_isotropic() || is_above(plane[2])) {
            Some(around) => Ok((around, plane)),
            None => self.geometry.refuse_incoming(wi),
        }
    }

    /// Incoming direction under which an interpolation node holds the function over outgoing directions.
    #[inline(always)]
    pub(super) fn node_direction(&self, node: usize) -> Vector {
        match &self.form {
            Form::Planes { smooth, .. } => smooth.nodes().direction(node),
            Form::Samples(_) => self.geometry.incoming_direction(node),
        }
    }

    /// Returns true if the first interpolation node around an incoming direction is always the centre of the incoming
    /// triangle that contains the direction.
    #[inline]
    pub(super) fn knows_entry(smooth: &Smooth) -> bool {
        matches!(smooth.nodes(), Nodes::Triangles(_))
    }
}

/// Returns true if a height z is at or above the horizon; false for NaN.
fn is_above(z: f64) -> bool {
    z >= 0.0
}
