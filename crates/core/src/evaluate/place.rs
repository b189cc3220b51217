//! Arguments of an evaluation: a place, the form of the function, and the treatment of wavelengths out of range.

use crate::domain::Direction;

/// Place in a material at which to evaluate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place<'a> {
    /// One entry for each leading index axis.
    pub index: &'a [usize],
    /// Incoming direction; `None` for quantities without.
    pub wi: Option<Direction>,
    /// Outgoing direction; `None` for quantities without.
    pub wo: Option<Direction>,
}

/// Form of the function of direction that is made of the samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// Value of the triangle that contains the direction, as in the paper; of the nearest incoming elevation.
    Constant,
    /// Continuous over directions.
    #[default]
    Smooth,
}

/// Value outside the measured range of wavelengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Beyond {
    /// Masked: NaN.
    #[default]
    Masked,
    /// Zero: no light.
    Zero,
    /// Sample at the end of the range, as in renderers.
    Nearest,
}
