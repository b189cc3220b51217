//! Conversion of a grid of angles to the grid that the file states.

use super::numbers::StatedGrid;
use super::repeated::Repeated;
use crate::domain::{self, Axis, AxisError, DirectionGrid, DirectionGridError, Frame, Shared, Tensor, TensorError};
use crate::formats::acquisition::{AngleGrid, Angles, AzimuthExtent, Outside};

/// Reasons why a grid of angles cannot be converted to the grid that its file lists.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StatedGridError {
    /// The angles that the file lists form no valid grid of directions, for example because one is out of range.
    #[error(transparent)]
    Directions(#[from] DirectionGridError),
    /// The grid that the file lists has too many axes, too many samples, or an axis with invalid entries.
    #[error(transparent)]
    Axes(#[from] AxisError),
    /// The numbers that the file lists do not form a tensor on the grid of its angles.
    #[error(transparent)]
    Tensor(#[from] TensorError),
}

/// Incoming and outgoing azimuths as listed in the file; `None` unless the first azimuth is repeated 360° later.
pub(in crate::formats) type Listed = [Option<Vec<f64>>; 2];

impl AngleGrid {
    /// Returns the grid as its file lists it, before azimuths are merged and symmetries unfolded.
    pub fn as_stated(&self) -> Result<StatedGrid, StatedGridError> {
        match &self.stated {
            Some(stated) => Ok((**stated).clone()),
            None => self.stated_as(self.values.clone(), &[None, None]),
        }
    }

    /// Returns this grid with other `values` and with the azimuths in `listed`, whose last one repeats the first 360°
    /// later.
    pub(in crate::formats) fn stated_as(
        &self,
        values: impl Into<Shared>,
        listed: &Listed,
    ) -> Result<StatedGrid, StatedGridError> {
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
        let tensor = Tensor::sharing(axes.collect(), values.into())?;
        Ok(StatedGrid { tensor, factor: 1.0, repeated: Repeated::default() })
    }
}

/// Returns the incoming or the outgoing angles as a grid of directions in the surface frame.
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
