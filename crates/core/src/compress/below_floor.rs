//! Absolute errors of the samples that a floor leaves out of the relative errors, and the bounds that they keep.

use rayon::prelude::*;

/// Largest absolute errors of the samples that have no relative error under a floor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct BelowFloor {
    /// Largest error of a sample whose magnitude is below the floor.
    small: f64,
    /// Largest error of a sample below 0 whose magnitude is at least the floor.
    negative: f64,
    /// Largest magnitude of such a negative sample.
    lowest: f64,
}

impl BelowFloor {
    /// Measures the errors of `decoded` samples against the original ones; masked samples are NaN.
    pub(crate) fn measure(original: &[f32], decoded: &[f32], floor: f32) -> Self {
        let one = |(&s, &d): (&f32, &f32)| {
            let off = (f64::from(d) - f64::from(s)).abs();
            if s.abs() < floor {
                Self { small: off, ..Self::default() }
            } else if s < 0.0 {
                Self { negative: off, lowest: f64::from(-s), ..Self::default() }
            } else {
                Self::default()
            }
        };
        // The largest number does not depend on the order.
        original.par_iter().zip(decoded).map(one).reduce(Self::default, Self::or)
    }

    fn or(self, other: Self) -> Self {
        Self {
            small: self.small.max(other.small),
            negative: self.negative.max(other.negative),
            lowest: self.lowest.max(other.lowest),
        }
    }

    /// Returns true if every sample of a magnitude below the floor is at most the floor off.
    pub(crate) fn keeps(&self, floor: f32) -> bool {
        self.small <= f64::from(floor)
    }

    /// Returns 0 if every sample without a relative error is at most the floor off; 1 if only larger negative samples
    /// are not, and these at most their largest magnitude; otherwise 2.
    pub(crate) fn breach(&self, floor: f32) -> u8 {
        let most = f64::from(floor);
        if !self.keeps(floor) || self.negative > self.lowest.max(most) { 2 } else { u8::from(self.negative > most) }
    }

    /// Largest error of a sample whose magnitude is below the floor, in the unit of the samples.
    pub(crate) fn small(&self) -> f64 {
        self.small
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_samples_keep_the_floor_and_negative_ones_their_largest_magnitude() {
        let original = [5.0, 0.5, -0.5, -3.0, 0.0, f32::NAN];
        let breach = |decoded: [f32; 6]| BelowFloor::measure(&original, &decoded, 1.0).breach(1.0);
        assert_eq!(breach([9.0, 1.5, 0.0, -2.0, 0.0, f32::NAN]), 0);
        assert_eq!(breach([9.0, 1.5, 0.0, -0.1, 0.0, f32::NAN]), 1);
        assert_eq!(breach([9.0, 1.5, 0.0, -6.1, 0.0, f32::NAN]), 2);
        assert_eq!(breach([9.0, 1.6, 0.0, -3.0, 0.0, f32::NAN]), 2);
        let off = BelowFloor::measure(&original, &[5.0, 0.5, -1.7, -3.0, 0.0, f32::NAN], 1.0);
        assert!(!off.keeps(1.0) && (off.small() - 1.2).abs() < 1e-6);
    }
}
