//! Radial profile of a lobe, from a Gaussian to the tail of GGX.

use std::f64::consts::{LN_2, PI};

/// Radial profile of a lobe as a function of x, the squared distance from the centre in half-widths: 1 at x = 0, 1/2 at
/// x = 1. With the tail s and c = 2ˢ − 1 it is (1 + c·x)^(−1/s): the Gaussian 2^(−x) for s → 0, the GGX distribution
/// for s = 1/2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Profile {
    tail: f64,
    /// Coefficient c = 2ˢ − 1 of the lobe's radial profile (1 + c·x)^(−1/s), where s is the tail and x the squared
    /// distance from the centre in half-widths. For the Gaussian exp(−c·x), which replaces it if s = 0, c is ln 2.
    slope: f64,
}

impl Profile {
    /// Creates the radial profile of a lobe with a tail from 0 (Gaussian) to 1/2 (GGX).
    pub(super) fn new(tail: f64) -> Self {
        let slope = if tail == 0.0 { LN_2 } else { libm::expm1(tail * LN_2) };
        Self { tail, slope }
    }

    /// Returns the radial profile of a reflection lobe at `x`, the squared distance from its centre in squared
    /// half-widths.
    #[inline]
    pub(super) fn at(self, x: f64) -> f64 {
        libm::exp(-self.exponent(x))
    }

    /// Returns −ln of a reflection lobe's radial profile at `x`, the squared distance from its centre in squared
    /// half-widths.
    #[inline]
    fn exponent(self, x: f64) -> f64 {
        if self.tail == 0.0 { self.slope * x } else { libm::log1p(self.slope * x) / self.tail }
    }

    /// Returns the integral of a reflection lobe's radial profile over the whole plane, in squared half-widths.
    pub(super) fn area(self) -> f64 {
        if self.tail == 0.0 { PI / LN_2 } else { PI * self.tail / (self.slope * (1.0 - self.tail)) }
    }

    /// Returns the share of a reflection lobe's radial profile, integrated over the plane, that lies within the squared
    /// distance `x` from the lobe's centre. `x` is in squared half-widths.
    #[inline]
    pub(super) fn enclosed(self, x: f64) -> f64 {
        -libm::expm1(-self.exponent(x) * (1.0 - self.tail))
    }

    /// Returns the squared distance, in squared half-widths, from a reflection lobe's centre within which the given
    /// share (0 ≤ share < 1) of its radial profile lies: the inverse of [`Profile::enclosed`].
    #[inline]
    pub(super) fn enclosing(self, share: f64) -> f64 {
        let exponent = -libm::log1p(-share) / (1.0 - self.tail);
        if self.tail == 0.0 { exponent / self.slope } else { libm::expm1(exponent * self.tail) / self.slope }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profiles_halve_at_one_half_width_and_enclose_all_of_their_area() {
        for tail in [0.0, 1e-3, 0.1, 0.3, 0.5] {
            let profile = Profile::new(tail);
            assert!((profile.at(0.0) - 1.0).abs() < 1e-15 && (profile.at(1.0) - 0.5).abs() < 1e-12);
            let (mut sum, steps) = (0.0, 200_000);
            // ∫ k(ρ²) 2πρ dρ to a distance of 30 half-widths.
            for i in 0..steps {
                let rho = 30.0 * (f64::from(i) + 0.5) / f64::from(steps);
                sum += profile.at(rho * rho) * 2.0 * PI * rho * 30.0 / f64::from(steps);
            }
            let enclosed = profile.area() * profile.enclosed(900.0);
            assert!((sum / enclosed - 1.0).abs() < 1e-6, "{tail}: {sum} against {enclosed}");
            for share in [0.0, 1e-9, 0.2, 0.7, 0.999] {
                assert!((profile.enclosed(profile.enclosing(share)) - share).abs() < 1e-12);
            }
        }
        // The distribution of GGX: (1 + tan²/α²)⁻².
        let (ggx, alpha_squared) = (Profile::new(0.5), 1.0 / (2.0_f64.sqrt() - 1.0));
        for x in [0.3, 2.0, 50.0] {
            assert!((ggx.at(x) * (1.0 + x / alpha_squared).powi(2) - 1.0).abs() < 1e-12);
        }
    }
}
