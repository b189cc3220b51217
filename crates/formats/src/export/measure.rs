//! Error of an exported file, read back, against the material, at direction pairs drawn from a fixed seed.

use crate::domain::{Direction, ErrorAccumulator, ErrorReport};
use crate::numeric::random::open;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use serde::Serialize;
use std::f64::consts::TAU;

/// Number of random pairs of an incoming and an outgoing direction at which an exported file is compared with the
/// material.
pub const PAIRS: usize = 10_000;
const SEED: u64 = 0x6578_706f_7274;
/// Upper bounds on the direction pairs, and on the values, that a comparison holds in memory at a time. Raising them
/// uses more memory.
const BLOCK: (usize, usize) = (512, 1 << 20);

/// Error of an exported file against the material from which it was written.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AddedError {
    /// Description of the values of file and material that are compared, in words.
    pub compared: &'static str,
    /// Number of direction pairs at which file and material are compared; number of samples for data without
    /// directions.
    pub pairs: usize,
    /// Mean of |f − m| / m over the compared samples with m > 0: f is the value that the exported file gives, and m the
    /// value of the material from which it was written.
    pub er_l1: f64,
    /// Root mean square of |f − m| / m over the compared samples with m > 0: f is the value that the exported file
    /// gives, and m the value of the material from which it was written.
    pub er_l2: f64,
    /// Maximum of |f − m| / m over the compared samples with m > 0: f is the value that the exported file gives, and m
    /// the value of the material from which it was written.
    pub max_relative_error: f64,
    /// Relative root mean square error √(Σ (f − m)² / Σ m²) over all compared samples: f is the value that the exported
    /// file gives, and m the value of the material from which it was written.
    pub relative_rmse: f64,
    /// Number of compared samples that enter the relative errors.
    pub scored_samples: u64,
    /// Number of samples that are masked (without a value) in the file but not in the material, or the other way round.
    pub mask_mismatches: u64,
}

/// Distribution of the random directions at which a file is compared with its material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Draws {
    /// Random directions for a BRDF, BTDF or BSDF: `wi` above the surface, and `wo` above it, below it or on both
    /// sides. The density of each is proportional to |cos θ|.
    Surface { above: bool, below: bool },
    /// Distribution without an incoming direction `wi`: `wo` is uniform on the part of the unit sphere between the
    /// heights `z = low` and `z = high`.
    Emission { low: i8, high: i8 },
    /// Distribution over the whole sphere: `wi` and `wo` are independent and uniform.
    Sphere,
}

/// Function of the directions `wi` and `wo` that writes one value per channel; `wi` is `None` for functions of one
/// direction.
pub(super) type Function<'a> = dyn Fn(Option<Direction>, Direction, &mut [f64]) + Sync + 'a;

/// Compares `file` with `material` at random directions; both functions write `channels` values.
pub(super) fn measure(
    compared: &'static str,
    draws: Draws,
    channels: usize,
    material: &Function<'_>,
    file: &Function<'_>,
) -> AddedError {
    let mut random = Pcg64::seed_from_u64(SEED);
    let pairs: Vec<(Option<Direction>, Direction)> = (0..PAIRS).map(|_| draws.draw(&mut random)).collect();
    let mut accumulator = ErrorAccumulator::default();
    let block = (BLOCK.1 / channels).clamp(1, BLOCK.0);
    for pairs in pairs.chunks(block) {
        let values = |function: &Function<'_>| -> Vec<f32> {
            let mut values = vec![0.0_f32; pairs.len() * channels];
            values.par_chunks_mut(channels).zip(pairs).for_each(|(row, &(wi, wo))| {
                let mut found = vec![0.0; channels];
                function(wi, wo, &mut found);
                row.iter_mut().zip(found).for_each(|(value, found)| *value = found as f32);
            });
            values
        };
        accumulator.add(&values(material), &values(file), 0.0);
    }
    AddedError::of(compared, PAIRS, &accumulator.finish())
}

impl AddedError {
    pub(crate) fn of(compared: &'static str, pairs: usize, report: &ErrorReport) -> Self {
        Self {
            compared,
            pairs,
            er_l1: report.er_l1,
            er_l2: report.er_l2,
            max_relative_error: report.max_relative_error,
            relative_rmse: report.relative_rmse,
            scored_samples: report.scored_samples,
            mask_mismatches: report.mask_mismatches,
        }
    }
}

impl Draws {
    /// Draws one random pair of directions. Each draw consumes five random numbers, so that the sequence is equal for
    /// every distribution.
    fn draw(self, random: &mut Pcg64) -> (Option<Direction>, Direction) {
        let [a, b, c, d, side] = [(); 5].map(|()| open(random));
        match self {
            Self::Surface { above, below } => {
                let down = below && (!above || side < 0.5);
                let z = c.sqrt();
                (Some(direction(a.sqrt(), b)), direction(if down { -z } else { z }, d))
            }
            Self::Emission { low, high } => {
                let (low, high) = (f64::from(low), f64::from(high));
                (None, direction(low + (high - low) * a, b))
            }
            Self::Sphere => (Some(direction(2.0 * a - 1.0, b)), direction(2.0 * c - 1.0, d)),
        }
    }
}

fn direction(z: f64, turn: f64) -> Direction {
    let (sin, cos) = libm::sincos(TAU * turn);
    let r = (1.0 - z * z).max(0.0).sqrt();
    Direction::from_unit([r * cos, r * sin, z])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_have_their_densities_and_are_the_same_every_time() {
        let mean = |draws: Draws, of: fn(Option<Direction>, Direction) -> f64| {
            let mut random = Pcg64::seed_from_u64(SEED);
            (0..PAIRS).map(|_| draws.draw(&mut random)).map(|(wi, wo)| of(wi, wo)).sum::<f64>() / PAIRS as f64
        };
        let surface = |above, below| Draws::Surface { above, below };
        // E[cos θ] of a density cos θ / π is 2/3; five standard errors are 0.012.
        assert!((mean(surface(true, false), |wi, _| wi.unwrap().cos_theta()) - 2.0 / 3.0).abs() < 0.012);
        assert!((mean(surface(false, true), |_, wo| wo.cos_theta()) + 2.0 / 3.0).abs() < 0.012);
        assert!(mean(surface(true, true), |_, wo| wo.cos_theta()).abs() < 0.036);
        assert!(mean(Draws::Sphere, |wi, wo| wi.unwrap().dot(wo)).abs() < 0.03);
        assert!((mean(Draws::Emission { low: -1, high: 0 }, |_, wo| wo.cos_theta()) + 0.5).abs() < 0.015);
    }

    #[test]
    fn a_known_error_is_found() {
        let one = |_: Option<Direction>, _: Direction, values: &mut [f64]| values.fill(1.0);
        let off = |_: Option<Direction>, wo: Direction, values: &mut [f64]| {
            values.fill(if wo.cos_theta() > 0.0 { 1.1 } else { f64::NAN });
        };
        let found = measure("test", Draws::Surface { above: true, below: false }, 3, &one, &off);
        assert_eq!((found.pairs, found.scored_samples, found.mask_mismatches), (PAIRS, 3 * PAIRS as u64, 0));
        assert!((found.er_l1 - 0.1).abs() < 1e-6 && (found.er_l2 - 0.1).abs() < 1e-6, "{found:?}");
        let found = measure("test", Draws::Surface { above: false, below: true }, 3, &one, &off);
        assert_eq!((found.scored_samples, found.mask_mismatches), (0, 3 * PAIRS as u64));
    }
}
