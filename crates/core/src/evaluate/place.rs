//! Arguments of an evaluation: a place, the form of the function, and the treatment of wavelengths out of range.

use crate::domain::{Declared, Direction, Values, named};

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

named!(Interpolation, "interpolation", { Constant = "constant", Smooth = "smooth" }, INTERPOLATION);

/// Option of an evaluation that chooses the interpolation between the stored directions.
pub const INTERPOLATION: Declared = Declared {
    name: "interpolation",
    help: "Interpolation over directions. `smooth` is continuous; on a grid of angles it is cubic or linear, as the \
           material states. `constant` is the value of the nearest direction of a grid of angles, or of the triangle \
           that contains the direction.",
    values: Values::Name { shown: None, names: Interpolation::all_names },
    default: || serde_json::json!(Interpolation::default()),
};

/// Option of an evaluation that chooses the values outside the measured range of wavelengths.
pub const BEYOND: Declared = Declared {
    name: "beyond",
    help: "Values outside the measured range of wavelengths: `masked` (null in JSON, NaN in tables), `zero`, or \
           `nearest`, the value at the first or last measured wavelength.",
    values: Values::Name { shown: None, names: Beyond::all_names },
    default: || serde_json::json!(Beyond::default()),
};

/// Value that evaluation returns outside the measured range of wavelengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Beyond {
    /// Values outside the measured wavelengths are NaN (masked).
    #[default]
    Masked,
    /// Values outside the measured wavelengths are 0 (no light).
    Zero,
    /// Values outside the measured wavelengths are those of the nearest end of the range, as in renderers.
    Nearest,
}
named!(Beyond, "value outside the measured wavelengths", {
    Masked = "masked",
    Zero = "zero",
    Nearest = "nearest",
}, BEYOND);
