//! Weights of the cubic through the four incidences around an angle.

use crate::numeric::number::Number;

/// Number of incoming directions around a query through whose values an interpolating cubic passes.
pub(in crate::evaluate) const FOUR: usize = 4;
/// Overshoot allowed to a cubic between incoming directions, as a fraction of the range of the values that linear
/// interpolation would mix. Raising it permits narrower peaks and more ringing.
pub(in crate::evaluate) const ROOM: f32 = 1.0;
/// Magnitude up to which an interpolation weight is negligible, so that its incoming direction may be dark or masked.
pub(in crate::evaluate) const NO_WEIGHT: f32 = 1e-3;

/// Increasing polar angles of incidence, with the denominators of Lagrange's cubic polynomials between them.
#[derive(Debug)]
pub(in crate::evaluate) struct Cubic {
    angles: Vec<f64>,
    /// For each interval between angles, the reciprocal denominators of four Lagrange polynomials; 0 for an angle
    /// beyond the ends.
    factors: Vec<[f64; FOUR]>,
}

impl Cubic {
    pub(in crate::evaluate) fn new(angles: &[f64]) -> Self {
        let factor = |below: usize, k: usize| {
            let own = angle(angles, below, k)?;
            let others = (0..FOUR).filter(|&m| m != k).filter_map(|m| angle(angles, below, m));
            Some(1.0 / others.map(|other| own - other).product::<f64>())
        };
        let intervals = 0..angles.len().saturating_sub(1);
        let factors = intervals.map(|below| std::array::from_fn(|k| factor(below, k).unwrap_or(0.0))).collect();
        Self { angles: angles.to_vec(), factors }
    }

    /// Four angles around the fraction `t` of the interval that starts at angle number `below`, two on each side, with
    /// cubic weights. Beyond the ends of the axis, the end's angle takes the place of the missing one with weight 0;
    /// the polynomial then passes through three.
    #[inline]
    pub(in crate::evaluate) fn around(&self, below: usize, t: f32) -> ([u32; FOUR], [f32; FOUR]) {
        let (from, to) = (self.angles[below], self.angles[below + 1]);
        let x = from + f64::from(t) * (to - from);
        let distances: [f64; FOUR] =
            std::array::from_fn(|k| angle(&self.angles, below, k).map_or(1.0, |angle| x - angle));
        let [a, b, c, d] = distances;
        let products = [b * c * d, a * c * d, a * b * d, a * b * c];
        let last = self.angles.len() - 1;
        let entries = [below.saturating_sub(1), below, below + 1, (below + 2).min(last)].map(|entry| entry as u32);
        (entries, std::array::from_fn(|k| (self.factors[below][k] * products[k]) as f32))
    }

    pub(in crate::evaluate) fn memory(&self) -> usize {
        size_of_val(&*self.angles) + size_of_val(&*self.factors)
    }
}

/// Entry `below + k − 1` of a list of angles, for `k` from 0 to 3: one of the two ends of the interval between entries
/// `below` and `below + 1`, or of their two outer neighbours. `None` beyond the ends of the list.
#[inline]
fn angle(angles: &[f64], below: usize, k: usize) -> Option<f64> {
    angles.get((below + k).checked_sub(1)?).copied()
}

/// Clamps a cubic's value to the range of the values that linear interpolation would mix, widened by [`ROOM`].
#[inline(always)]
pub(in crate::evaluate) fn held<T: Number>(cubic: T, [low, high]: [T; 2]) -> T {
    let room = T::of(ROOM) * (high - low);
    cubic.larger(low - room).smaller(high + room)
}

/// Minimum and maximum of the numbers that `values` yields; infinity and minus infinity if there are none.
#[inline(always)]
pub(super) fn range(values: impl Iterator<Item = f32>) -> [f32; 2] {
    values.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubics_are_exact_inside_and_parabolas_at_the_ends() {
        let angles = [0.0, 5.0, 20.0, 30.0, 60.0];
        let cubic = Cubic::new(&angles);
        for below in 0..4 {
            let is_inside = (1..3).contains(&below);
            for t in [0.0, 0.25, 0.9, 1.0] {
                let (entries, weights) = cubic.around(below, t);
                let x = angles[below] + f64::from(t) * (angles[below + 1] - angles[below]);
                let f = |x: f64| 1.0 - x / 40.0 + x * x / 900.0 - if is_inside { x * x * x / 50_000.0 } else { 0.0 };
                let found: f64 =
                    entries.iter().zip(weights).map(|(&entry, w)| f64::from(w) * f(angles[entry as usize])).sum();
                assert!((found - f(x)).abs() < 1e-5, "{below} {t}: {found} {}", f(x));
                assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
            }
        }
        // With two entries the cubic is the line between them.
        assert_eq!(Cubic::new(&[10.0, 30.0]).around(0, 0.25).1, [0.0, 0.75, 0.25, 0.0]);
    }

    #[test]
    fn overshoots_are_held() {
        assert_eq!([5.0, -5.0, 1.5].map(|cubic| held(cubic, range([2.0, 1.0].into_iter()))), [3.0, 0.0, 1.5]);
    }
}
