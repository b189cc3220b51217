//! Numbers of a file on the grid of directions that it states, and their common factor.

use super::repeated::Repeated;
use crate::domain::{self, Axis, DirectionGrid, Tensor};

/// Numbers of a file, before multiplication by their common factor, at the angles that the file lists.
///
/// A value in the unit of the measurement is `factor · number`. The tensor holds the numbers as written, so that no
/// additional rounding occurs.
#[derive(Clone, Debug, PartialEq)]
pub struct StatedGrid {
    /// Numbers of the file on `[index…, incoming, outgoing, spectral]` without absent axes; NaN = missing. Directions
    /// are [`Axis::Grid`], incoming ones of isotropic data [`Axis::Elevation`].
    pub tensor: Tensor,
    /// Factor from numbers to values: product of all multipliers of the file (candela multiplier, ballast factor,
    /// conversion factor, lumens / 1000).
    pub factor: f64,
    /// Deviations between values at angles that the file lists twice; the tensor holds their mean.
    pub repeated: Repeated,
}

impl StatedGrid {
    /// Returns the grid as isotropic data, with incoming elevations and with outgoing azimuths relative to `azimuth`,
    /// which must be the azimuth of all incoming directions. `None` for any other grid.
    pub(crate) fn isotropic(&self, azimuth: f64) -> Option<Self> {
        let mut axes = self.tensor.axes().to_vec();
        let [Axis::Grid(incoming), Axis::Grid(outgoing), ..] = &axes[..] else { return None };
        let turned = outgoing.azimuths().map(|azimuths| domain::Azimuths {
            angles: azimuths.angles.iter().map(|angle| angle - azimuth).collect(),
            extent: azimuths.extent,
        });
        let (low, high) = outgoing.covers();
        let turned = DirectionGrid::new(outgoing.frame(), outgoing.polar().to_vec(), turned).ok()?;
        let turned = turned.covering(low, high).ok()?.with_outside(outgoing.outside());
        (axes[0], axes[1]) = (Axis::Elevation(incoming.polar().to_vec()), Axis::Grid(turned));
        let tensor = Tensor::new(axes, self.tensor.samples().to_vec()).ok()?;
        Some(Self { tensor, ..*self })
    }
}
