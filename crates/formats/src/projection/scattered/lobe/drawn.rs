//! Random scans for tests: directions on a spiral, with noise.

use crate::domain::Direction;
use crate::formats::Scattered;

pub(super) const BASE: f64 = 0.3 / std::f64::consts::PI;

/// Generator of pseudo-random numbers, uniform between 0 and 1 (`SplitMix64`, Steele and others 2014).
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn even(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns a normally distributed pseudo-random number with standard deviation 1 (Box and Muller 1958).
    pub(super) fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.even()).ln()).sqrt() * (std::f64::consts::TAU * self.even()).cos()
    }
}

/// Test data: an isotropic scan with outgoing directions on a spiral, which is rotated from each incoming polar angle
/// to the next.
pub(super) fn spiral(
    truth: impl Fn(Direction, Direction) -> f64,
    elevations: &[f64],
    noise: f64,
    seed: u64,
) -> Scattered {
    let mut random = Random(seed);
    let (mut incoming, mut outgoing, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for &theta in elevations {
        let turned = 360.0 * random.even();
        for i in 0..4000 {
            let z = 1.0 - (f64::from(i) + 0.5) / 4000.0;
            let wo = [z.acos().to_degrees(), (222.492_235_949 * f64::from(i) + turned) % 360.0];
            if z < 0.02 {
                continue;
            }
            let value = truth(Direction::from_degrees(theta, 0.0), Direction::from_degrees(wo[0], wo[1]));
            values.push((value * (1.0 + noise * random.normal())) as f32);
            incoming.push([theta, 0.0]);
            outgoing.push(wo);
        }
    }
    Scattered { incoming, outgoing, isotropic: true, spectral: None, values, sigma: None }
}
