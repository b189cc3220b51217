//! CIE 1931 tristimulus values: the three numbers that every colour here is computed from.

/// CIE 1931 tristimulus values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Xyz {
    /// X.
    pub x: f64,
    /// Y; the luminance factor × 100, or the absolute luminous quantity of an emission.
    pub y: f64,
    /// Z.
    pub z: f64,
}

impl Xyz {
    /// All three × `factor`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { x: factor * self.x, y: factor * self.y, z: factor * self.z }
    }
}
