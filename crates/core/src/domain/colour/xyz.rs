//! CIE 1931 tristimulus values, from which all other colours are computed.

/// CIE 1931 tristimulus values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Xyz {
    /// CIE tristimulus value X.
    pub x: f64,
    /// CIE tristimulus value Y: the luminance factor × 100, or the absolute luminous quantity of an emission.
    pub y: f64,
    /// CIE tristimulus value Z.
    pub z: f64,
}

impl Xyz {
    /// Multiplies all three tristimulus values by `factor`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { x: factor * self.x, y: factor * self.y, z: factor * self.z }
    }
}
