//! Arguments of an evaluation: a place, the form of the function, and the treatment of wavelengths out of range.

use crate::domain::Direction;

/// Indices and directions at which to evaluate a material.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place<'a> {
    /// Position on each index axis (axis of the samples before those of directions and wavelength).
    pub index: &'a [usize],
    /// Incoming direction; `None` for quantities without an incoming direction.
    pub wi: Option<Direction>,
    /// Outgoing direction; `None` for quantities without an outgoing direction.
    pub wo: Option<Direction>,
}

/// Interpolation between the samples over directions: piecewise constant or smooth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// Piecewise constant interpolation: the sample of the triangle that contains a direction, and for incoming
    /// elevations the sample of the nearest one.
    Constant,
    /// Smooth interpolation, continuous over directions.
    #[default]
    Smooth,
}

/// Value that evaluation returns outside the measured range of wavelengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Beyond {
    /// Values outside the measured wavelengths are NaN (masked).
    #[default]
    Masked,
    /// Values outside the measured wavelengths are 0 (no light).
    Zero,
    /// Values outside the measured wavelengths are those of the nearest end of the range, as in renderers.
    Nearest,
}
