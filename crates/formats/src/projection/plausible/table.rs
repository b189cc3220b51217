//! Tables of directions in a file: values for each pair of an incoming and an outgoing direction.

use super::sides::Side;
use crate::domain::{Axis, Layout, Quantity, Tensor};
use crate::formats::{Acquisition, Angles, AzimuthExtent, Azimuths, Samples};
use crate::projection::planes::single_azimuth;
use std::borrow::Cow;

/// Table of the values of a file, row-major `[entry, incoming direction, outgoing direction, band]`; all leading index
/// axes of the file count as one axis of entries.
pub(super) struct Table<'a> {
    pub(super) values: &'a [f32],
    pub(super) incoming: Side<'a>,
    pub(super) outgoing: Side<'a>,
    pub(super) spectral: Option<&'a Axis>,
}

impl<'a> Table<'a> {
    /// Returns the table of values of a file; `None` if it has no table over incoming and outgoing directions.
    pub(super) fn of(acquisition: &'a Acquisition) -> Option<Self> {
        let table = match &acquisition.samples {
            Samples::Grid(grid) => {
                let (incoming, outgoing) = isotropic(grid.incoming.as_ref()?, grid.outgoing.as_ref()?);
                Self {
                    values: &grid.values,
                    incoming: Side::of_angles(incoming)?,
                    outgoing: Side::of_angles(outgoing)?,
                    spectral: grid.spectral.as_ref(),
                }
            }
            Samples::OnAxes { tensor, .. } => return Self::of_tensor(acquisition.quantity, tensor),
            Samples::Scattered(_) | Samples::Function(_) => return None,
        };
        table.checked()
    }

    /// Returns the table of the samples of a tensor; `None` if it has no incoming and outgoing directions.
    pub(super) fn of_tensor(quantity: Quantity, tensor: &'a Tensor) -> Option<Self> {
        let layout = Layout::of(quantity, tensor.axes()).ok()?;
        let axis = |number: Option<usize>| number.map(|number| &tensor.axes()[number]);
        let table = Self {
            values: tensor.samples(),
            incoming: Side::of_axis(axis(layout.incoming)?)?,
            outgoing: Side::of_axis(axis(layout.outgoing)?)?,
            spectral: axis(layout.spectral),
        };
        table.checked()
    }

    /// Returns the table if it has as many values as pairs of directions and bands.
    fn checked(self) -> Option<Self> {
        let block = self.incoming.len() * self.block();
        (block > 0 && self.values.len().is_multiple_of(block)).then_some(self)
    }

    /// Returns true if the outgoing directions have no azimuths, although light comes in obliquely: they lie on one
    /// side of the plane of incidence and cover no area.
    pub(super) fn is_half_plane(&self) -> bool {
        self.outgoing.is_isotropic()
            && (0..self.incoming.len()).any(|incoming| self.incoming.degrees(incoming)[0] > 0.0)
    }

    /// Returns the number of spectral bands of the table.
    pub(super) fn bands(&self) -> usize {
        self.spectral.map_or(1, Axis::len)
    }

    /// Returns the number of values under one incoming direction: outgoing directions times bands.
    pub(super) fn block(&self) -> usize {
        self.outgoing.len() * self.bands()
    }
}

/// Converts angles with a single incoming azimuth to those of an isotropic surface, with outgoing azimuths relative to
/// the incoming one.
fn isotropic<'a>(incoming: &'a Angles, outgoing: &'a Angles) -> (Cow<'a, Angles>, Cow<'a, Angles>) {
    let as_stated = (Cow::Borrowed(incoming), Cow::Borrowed(outgoing));
    let (Some(azimuth), Some(azimuths)) = (single_azimuth(incoming), &outgoing.phi) else { return as_stated };
    let phi: Vec<f64> = azimuths.phi.iter().map(|phi| phi - azimuth).collect();
    // Half a circle is mirrored at azimuth 0 only.
    if azimuths.extent == AzimuthExtent::Mirrored && azimuth != 0.0 {
        return as_stated;
    }
    let turned = Azimuths { phi, extent: azimuths.extent };
    (Cow::Owned(Angles { phi: None, ..incoming.clone() }), Cow::Owned(Angles { phi: Some(turned), ..outgoing.clone() }))
}
