//! The function of a material at one place: its geometry and its form together.

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

/// Where directions lie, and what the function is there.
#[derive(Debug)]
pub(super) struct Function {
    geometry: Geometry,
    form: Form,
}

impl Function {
    /// The function of a measurement with this geometry.
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

    /// Memory in bytes, without the size of the type.
    pub(super) fn memory(&self) -> usize {
        self.geometry.memory() + self.form.memory()
    }

    /// What `work` makes of the row of planes at a place and of its presence: 0 if `wo` is outside the outgoing domain, NaN
    /// where it is masked. The smooth form need not look for the entry of the incoming axis where it is known.
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

    /// A place as the smooth form sees it, where the entry of the incoming axis may be known; `None` outside the outgoing
    /// domain.
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

    /// The nodes around an incoming direction, and the direction as they know it; the entry that holds it may be known.
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

    /// The incoming direction whose function a node holds.
    #[inline(always)]
    pub(super) fn node_direction(&self, node: usize) -> Vector {
        match &self.form {
            Form::Planes { smooth, .. } => smooth.nodes().direction(node),
            Form::Samples(_) => self.geometry.incoming_direction(node),
        }
    }

    /// Whether the first of the nodes around an incoming direction is the entry that holds it.
    #[inline]
    pub(super) fn knows_entry(smooth: &Smooth) -> bool {
        matches!(smooth.nodes(), Nodes::Triangles(_))
    }
}

/// Returns true on the upper side and on the horizon; a height that is no number is on neither side.
fn is_above(z: f64) -> bool {
    z >= 0.0
}
