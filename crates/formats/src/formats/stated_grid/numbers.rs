//! The numbers of a file on the grid of directions that the file states, and the factor that they share.

use super::repeated::Repeated;
use crate::domain::{self, Axis, DirectionGrid, Tensor};

/// The numbers of a file at the angles of a file.
///
/// A value in the unit of the measurement is `factor · number`. The tensor holds the numbers as they are written, so that
/// nothing is rounded that was not rounded by the file.
#[derive(Clone, Debug, PartialEq)]
pub struct StatedGrid {
    /// The numbers on `[index…, incoming, outgoing, spectral]`, absent axes left out; NaN = missing. Directions are
    /// [`Axis::Grid`], incoming ones of isotropic data [`Axis::Elevation`].
    pub tensor: Tensor,
    /// Product of all multipliers that the file states once for all numbers (candela multiplier, ballast factor,
    /// conversion factor, lumens / 1000).
    pub factor: f64,
    /// Values that the file lists at angles that it lists twice, which the tensor holds as their mean.
    pub repeated: Repeated,
}

impl StatedGrid {
    /// The grid with the elevations of its incoming directions, all of which have `azimuth`, and outgoing azimuths relative
    /// to it; `None` where it has no such directions.
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
