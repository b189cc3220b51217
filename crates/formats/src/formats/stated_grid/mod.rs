//! Grids of directions as files state them: their own angles, symmetries and numbers, before anything is unfolded,
//! averaged or resampled.

mod contradictions;
#[cfg(test)]
mod tests;

pub use contradictions::Contradictions;

use super::acquisition::{AngleGrid, Angles, AzimuthExtent, Outside};
use crate::domain::{self, Axis, AxisError, DirectionGrid, DirectionGridError, Frame, Tensor, TensorError};

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

/// Spread of values that are stated more than once for one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Repeated {
    /// Sum of squared relative deviations from the mean of each direction.
    pub squares: f64,
    /// Values that enter the sum: those at directions whose mean is not 0.
    pub values: u64,
}

impl Repeated {
    /// Adds the values of one direction; missing ones are left out. Fewer than two say nothing.
    pub(crate) fn add(&mut self, values: impl Iterator<Item = f64> + Clone) {
        let values = values.filter(|value| !value.is_nan());
        let (sum, count) = values.clone().fold((0.0, 0_u64), |(sum, count), value| (sum + value, count + 1));
        let mean = sum / count as f64;
        if count > 1 && mean != 0.0 {
            let relative = |value: f64| (value - mean) / mean;
            self.squares += values.map(|value| relative(value) * relative(value)).sum::<f64>();
            self.values += count;
        }
    }

    /// Root mean square of the relative deviations; `None` where no direction is stated more than once.
    pub fn rms(&self) -> Option<f64> {
        (self.values > 0).then(|| (self.squares / self.values as f64).sqrt())
    }
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

/// Reasons why a grid of angles has no form as a file states it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StatedGridError {
    /// The angles are out of their limits.
    #[error(transparent)]
    Directions(#[from] DirectionGridError),
    /// The axes are out of their limits.
    #[error(transparent)]
    Axes(#[from] AxisError),
    /// The tensor cannot be made.
    #[error(transparent)]
    Tensor(#[from] TensorError),
}

/// Azimuths of the incoming and the outgoing side as they were listed, where one of them was stated again 360° later.
pub(super) type Listed = [Option<Vec<f64>>; 2];

impl AngleGrid {
    /// The grid as the file states it.
    pub fn as_stated(&self) -> Result<StatedGrid, StatedGridError> {
        match &self.stated {
            Some(stated) => Ok((**stated).clone()),
            None => self.stated_as(self.values.clone(), &[None, None]),
        }
    }

    /// This grid with `values` in place of its own; azimuths that are `listed` end where they begin.
    pub(super) fn stated_as(&self, values: Vec<f32>, listed: &Listed) -> Result<StatedGrid, StatedGridError> {
        let [first, second] = listed;
        let incoming = match &self.incoming {
            Some(Angles { theta, phi: None, .. }) => Some(Axis::Elevation(theta.clone())),
            Some(angles) => Some(Axis::Grid(surface(angles, first.as_deref(), self.outside)?)),
            None => None,
        };
        let outgoing = match &self.outgoing {
            Some(angles) => Some(Axis::Grid(surface(angles, second.as_deref(), self.outside)?)),
            None => None,
        };
        let axes = self.index.iter().cloned().chain([incoming, outgoing, self.spectral.clone()].into_iter().flatten());
        let tensor = Tensor::new(axes.collect(), values)?;
        Ok(StatedGrid { tensor, factor: 1.0, repeated: Repeated::default() })
    }
}

/// The directions of one side in the surface frame.
fn surface(angles: &Angles, listed: Option<&[f64]>, outside: Outside) -> Result<DirectionGrid, DirectionGridError> {
    let azimuths = angles.phi.as_ref().map(|azimuths| match listed {
        Some(listed) => domain::Azimuths { angles: listed.to_vec(), extent: domain::AzimuthExtent::Closed },
        None => domain::Azimuths {
            angles: azimuths.phi.clone(),
            extent: match azimuths.extent {
                AzimuthExtent::Circle => domain::AzimuthExtent::Circle,
                AzimuthExtent::Mirrored => domain::AzimuthExtent::Mirrored,
                AzimuthExtent::Sector => domain::AzimuthExtent::Sector,
            },
        },
    });
    let grid = DirectionGrid::new(Frame::Surface, angles.theta.clone(), azimuths)?;
    let (low, high) = angles.covers;
    let outside = match outside {
        Outside::Zero => domain::Outside::Dark,
        Outside::Masked => domain::Outside::Masked,
    };
    Ok(grid.covering(low, high)?.with_outside(outside))
}
