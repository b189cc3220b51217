//! Numbers and directions that the files hold.

/// Values of four digits.
pub(crate) struct Values(pub(crate) u32);

impl Values {
    /// Returns the next value, from 0 to 64.
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(self.0 >> 19) / 128.0
    }

    /// Returns `count` values as float32, little-endian.
    pub(crate) fn floats(&mut self, count: usize) -> Vec<u8> {
        (0..count).flat_map(|_| (self.next() as f32).to_le_bytes()).collect()
    }

    /// Returns `count` values as float64, little-endian.
    pub(crate) fn doubles(&mut self, count: usize) -> Vec<u8> {
        (0..count).flat_map(|_| self.next().to_le_bytes()).collect()
    }
}

/// Returns `[theta_i, phi_i, theta_o, phi_o]` at a position of a grid of 10° × 18° × 2.5° × 5°.
pub(crate) fn angles(place: usize) -> [f64; 4] {
    let [theta_i, phi_i, theta_o, phi_o] =
        [place / 51_840 * 10, place / 2592 % 20 * 18, place / 72 % 36, place % 72 * 5].map(|n| n as f64);
    [theta_i, phi_i, 2.5 * theta_o, phi_o]
}
