//! Where in a material to look, and how: a place, the form of the function, what lies outside the wavelengths.

use crate::domain::Direction;

/// Where in a material to look.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place<'a> {
    /// One entry for each leading opaque axis.
    pub index: &'a [usize],
    /// The incoming direction, for quantities that have one.
    pub wi: Option<Direction>,
    /// The outgoing direction, for quantities that have one.
    pub wo: Option<Direction>,
}

/// How samples become a function of direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// The value of the triangle that holds the direction, as the paper has it; of the nearest incoming elevation.
    Constant,
    /// Continuous over directions.
    #[default]
    Smooth,
}

/// What there is outside the measured range of wavelengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Beyond {
    /// Nothing is known: NaN.
    #[default]
    Masked,
    /// No light.
    Zero,
    /// The sample at the end of the range, as renderers do.
    Nearest,
}
