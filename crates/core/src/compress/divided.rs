//! Logarithm of the function that samples are divided by before they are interpolated between incidences, or coded.

#![allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]

use super::between::Divisor;
use crate::numeric::logarithm::{ln_f32, ln_four};
use crate::numeric::number::Number;
use wide::f32x4;

/// Lower bound on the cosines of polar angles in a divisor (model divided out before interpolation), which would be
/// unbounded at the horizon for smooth surfaces.
const LEAST_COSINE: f32 = 1e-3;
/// Lower bound on the squared length of a half vector, which avoids a division by 0.
const LEAST_SQUARE: f32 = 1e-12;

/// Divisor (model by which samples are divided before interpolation between incoming directions, or before they are
/// coded) ready to be evaluated. `square` is the squared roughness.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Divided {
    None,
    Cosines,
    ProjectedAreas { square: f32 },
    Masking { square: f32 },
    Model { square: f32, reflectance: f32, base: f32 },
}

impl Divided {
    pub(crate) fn by(divisor: Divisor) -> Self {
        match divisor {
            Divisor::None => Self::None,
            Divisor::Cosines => Self::Cosines,
            Divisor::ProjectedAreas { roughness } => Self::ProjectedAreas { square: roughness * roughness },
            Divisor::Masking { roughness } => Self::Masking { square: roughness * roughness },
            Divisor::Model { roughness, reflectance, base } => {
                Self::Model { square: roughness * roughness, reflectance, base }
            }
        }
    }

    /// Value of the divisor (model divided out before interpolation) for light from `wi` to `wo`; positive, and
    /// infinite for the model where `wi` and `wo` are opposite.
    #[inline(always)]
    pub(crate) fn value<T: Number>(self, [ix, iy, iz]: [T; 3], [ox, oy, oz]: [T; 3]) -> T {
        let (one, least) = (T::of(1.0), T::of(LEAST_COSINE));
        let (ci, co) = (iz.size().larger(least), oz.size().larger(least));
        let root = |square: f32, c: T| (c * c + T::of(square) * (one - c * c)).root();
        let masking = |square: f32| co * root(square, ci) + ci * root(square, co);
        match self {
            Self::None => one,
            Self::Cosines => one / (ci + co),
            Self::ProjectedAreas { square } => one / ((ci + root(square, ci)) * (co + root(square, co))),
            Self::Masking { square } => one / masking(square),
            Self::Model { square, reflectance, base } => {
                let [hx, hy, hz] = [ix + ox, iy + oy, iz + oz];
                let across = hx * hx + hy * hy;
                let length = (across + hz * hz).larger(T::of(LEAST_SQUARE));
                // D = a² / (h_x² + h_y² + a²·h_z²)² of the unit half vector.
                let spread = (across + T::of(square) * hz * hz) / length;
                let away = (one - T::of(0.5) * length.root()).larger(T::of(0.0));
                let fourth = (away * away) * (away * away);
                let fresnel = T::of(reflectance) + T::of(1.0 - reflectance) * (fourth * away);
                T::of(base) + fresnel * T::of(square) / (spread * spread * masking(square))
            }
        }
    }

    /// Logarithms of the model by which samples are divided before interpolation between incoming directions, for four
    /// pairs of an incoming and an outgoing direction.
    #[inline(always)]
    pub(crate) fn four(self, wi: [f32x4; 3], wo: [f32x4; 3]) -> f32x4 {
        if matches!(self, Self::None) {
            return f32x4::ZERO;
        }
        ln_four(self.value(wi, wo))
    }

    /// Natural logarithm of the reflection model by which samples are divided before interpolation between incoming
    /// directions, for one pair of an incoming and an outgoing direction. It is bit-identical to the result of
    /// [`Divided::four`] for this pair.
    #[inline(always)]
    pub(crate) fn one(self, wi: [f32; 3], wo: [f32; 3]) -> f32 {
        if matches!(self, Self::None) { 0.0 } else { ln_f32(self.value(wi, wo)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Direction;

    fn all() -> [Divisor; 5] {
        [
            Divisor::None,
            Divisor::Cosines,
            Divisor::ProjectedAreas { roughness: 0.2 },
            Divisor::Masking { roughness: 0.2 },
            Divisor::Model { roughness: 0.2, reflectance: 0.1, base: 0.3 },
        ]
    }

    #[test]
    fn divisors_are_their_formulas() {
        let directions = [(0.0, 0.0), (20.0, 50.0), (70.0, 180.0), (89.0, 200.0)];
        for (wi, wo) in directions.into_iter().flat_map(|wi| directions.map(|wo| (wi, wo))) {
            let [wi, wo] = [wi, wo].map(|(theta, phi)| Direction::from_degrees(theta, phi).xyz());
            let (ci, co, aa) = (wi[2], wo[2], 0.04);
            let r = |c: f64| (c * c + aa * (1.0 - c * c)).sqrt();
            let h = crate::domain::vector::unit([wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]]);
            let masking = 1.0 / (co * r(ci) + ci * r(co));
            let spread = h[0] * h[0] + h[1] * h[1] + aa * h[2] * h[2];
            let cosine = wi[0] * h[0] + wi[1] * h[1] + wi[2] * h[2];
            let fresnel = 0.1 + 0.9 * (1.0 - cosine).powi(5);
            let model = 0.3 + fresnel * aa / (spread * spread) * masking;
            let expected = [1.0, 1.0 / (ci + co), 1.0 / ((ci + r(ci)) * (co + r(co))), masking, model];
            for (divisor, expected) in all().into_iter().zip(expected) {
                let found = Divided::by(divisor).one(wi.map(|x| x as f32), wo.map(|x| x as f32));
                assert!((f64::from(found) - expected.ln()).abs() < 1e-5, "{divisor:?} {wi:?} {wo:?}");
            }
        }
    }

    #[test]
    fn one_and_four_have_the_same_bits_and_are_finite_anywhere() {
        for divisor in all().map(Divided::by) {
            for [wi, wo] in [[[0.6, 0.0, 0.8], [0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], [[0.0; 3]; 2]] {
                let one = divisor.one(wi, wo);
                assert!(one.is_finite(), "{divisor:?}");
                assert_eq!(divisor.four(wi.map(f32x4::splat), wo.map(f32x4::splat)).to_array(), [one; 4]);
            }
        }
    }
}
