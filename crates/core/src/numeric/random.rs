//! Uniform random numbers from the bits of a generator.
//!
//! They are implemented here because `rand` may change its distributions between versions: a seed must always give the
//! same numbers.

use rand::Rng;

/// Returns a uniform random number in [0, 1), a multiple of 2⁻⁵³.
pub fn half_open(random: &mut impl Rng) -> f64 {
    (random.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
}

/// Returns a uniform random number in (0, 1), an odd multiple of 2⁻⁵³, never 0 or 1.
pub fn open(random: &mut impl Rng) -> f64 {
    ((random.next_u64() >> 12) as f64 + 0.5) / (1_u64 << 52) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::distr::{Distribution, Open01, StandardUniform};
    use rand::{SeedableRng, TryRng};
    use rand_pcg::Pcg64Mcg;
    use std::convert::Infallible;

    /// Random number generator that always returns the same number, for tests.
    struct Always(u64);

    impl TryRng for Always {
        type Error = Infallible;

        fn try_next_u32(&mut self) -> Result<u32, Infallible> {
            Ok(self.0 as u32)
        }

        fn try_next_u64(&mut self) -> Result<u64, Infallible> {
            Ok(self.0)
        }

        fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
            bytes.fill(self.0 as u8);
            Ok(())
        }
    }

    #[test]
    fn ends_are_in_or_out() {
        assert_eq!(half_open(&mut Always(0)), 0.0);
        assert_eq!(half_open(&mut Always(u64::MAX)), 1.0 - f64::EPSILON / 2.0);
        assert_eq!(open(&mut Always(0)), f64::EPSILON / 2.0);
        assert_eq!(open(&mut Always(u64::MAX)), 1.0 - f64::EPSILON / 2.0);
    }

    #[test]
    fn numbers_are_those_of_the_usual_distributions() {
        let generators = || (Pcg64Mcg::seed_from_u64(7), Pcg64Mcg::seed_from_u64(7));
        let (mut ours, mut theirs) = generators();
        for _ in 0..1000 {
            assert_eq!(half_open(&mut ours), Distribution::<f64>::sample(&StandardUniform, &mut theirs));
        }
        let (mut ours, mut theirs) = generators();
        for _ in 0..1000 {
            assert_eq!(open(&mut ours), Distribution::<f64>::sample(&Open01, &mut theirs));
        }
    }
}
