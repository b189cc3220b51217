//! Linear interpolation in increasing lists: the two entries around a value and their weights.

/// Largest number of entries of a sorted list that is searched linearly instead of by binary search.
const SHORT: usize = 16;

/// Position of a number in an increasing list: the entries below and above it, and weight t of the upper one. For
/// linear interpolation the lower entry has weight `1 − t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bracket {
    /// Index of the lower of the two entries of an increasing list between which a given number lies; of the first or
    /// last entry if the number is outside the list.
    pub below: usize,
    /// Index of the upper of the two entries of an increasing list between which a given number lies. If no entry is
    /// larger than the number, index of the last entry; if all are, of the first.
    pub above: usize,
    /// Weight of the upper of the two neighbouring list entries in linear interpolation, 0..=1; 0 beyond the ends of
    /// the list.
    pub t: f64,
}

impl Bracket {
    /// Finds the interpolation position of `x` in strictly increasing `values`. Beyond the ends it is the first or last
    /// entry, for NaN the first.
    #[inline]
    pub fn held(values: &[f64], x: f64) -> Self {
        let above = count_up_to(values, x);
        if above == 0 || above == values.len() {
            let end = above.saturating_sub(1);
            return Self { below: end, above: end, t: 0.0 };
        }
        let below = above - 1;
        Self { below, above, t: (x - values[below]) / (values[above] - values[below]) }
    }

    /// Returns the indices of the two list entries between which a number lies, lower one first, each with its weight
    /// in linear interpolation.
    #[inline]
    pub fn weights(self) -> [(usize, f64); 2] {
        [(self.below, 1.0 - self.t), (self.above, self.t)]
    }

    /// Rounds interpolation weights within `rounding` of 0 or 1 to exactly 0 or 1.
    #[must_use]
    pub fn snapped(self, rounding: f64) -> Self {
        let t = if self.t < rounding {
            0.0
        } else if self.t > 1.0 - rounding {
            1.0
        } else {
            self.t
        };
        Self { t, ..self }
    }
}

/// Returns the number of entries of the increasing list `values` that are at most `x`.
#[inline]
pub fn count_up_to(values: &[f64], x: f64) -> usize {
    let is_below = |&v: &f64| v <= x;
    if values.len() <= SHORT {
        // The branches of a binary search would be mispredicted every other time.
        values.iter().filter(|v| is_below(v)).count()
    } else {
        values.partition_point(is_below)
    }
}

/// Returns the index of the entry of the increasing list `values` nearest to `x`; of two equally near ones the first.
/// It is 0 for an empty list or NaN.
#[inline]
pub fn nearest(values: &[f64], x: f64) -> usize {
    let Some(last) = values.len().checked_sub(1) else { return 0 };
    let above = count_up_to(values, x);
    let (below, above) = (above.saturating_sub(1), above.min(last));
    let is_past_middle = x - values[below] > 0.5 * (values[above] - values[below]);
    below + (above - below) * usize::from(is_past_middle)
}

/// Returns the value at `x` of the polyline through the points `(xs, ys)`; 0 outside the range of the strictly
/// increasing `xs`.
///
/// It does not use [`Bracket`], because it divides last, and recorded luminous fluxes depend on this rounding.
pub fn polyline(xs: &[f64], ys: &[f64], x: f64) -> f64 {
    match xs.partition_point(|&known| known <= x) {
        0 => 0.0,
        n if n == xs.len() => {
            if xs[n - 1] == x {
                ys[n - 1]
            } else {
                0.0
            }
        }
        n => ys[n - 1] + (ys[n] - ys[n - 1]) * (x - xs[n - 1]) / (xs[n] - xs[n - 1]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NODES: [f64; 3] = [0.5, 1.0, 3.0];

    #[test]
    fn ends_hold_beyond_the_list() {
        let at = |below, above, t| Bracket { below, above, t };
        assert_eq!(Bracket::held(&NODES, 0.0), at(0, 0, 0.0));
        assert_eq!(Bracket::held(&NODES, 0.5), at(0, 1, 0.0));
        assert_eq!(Bracket::held(&NODES, 2.5), at(1, 2, 0.75));
        assert_eq!(Bracket::held(&NODES, 3.0), at(2, 2, 0.0));
        assert_eq!(Bracket::held(&NODES, 9.0), at(2, 2, 0.0));
        assert_eq!(Bracket::held(&NODES, f64::NAN), at(0, 0, 0.0));
        assert_eq!(Bracket::held(&[7.0], 9.0), at(0, 0, 0.0));
        assert_eq!(Bracket::held(&[], 9.0), at(0, 0, 0.0));
    }

    #[test]
    fn the_nearest_entry_is_found() {
        let long: Vec<f64> = (0..40).map(|i| f64::from(i * i)).collect();
        for (x, wanted) in
            [(-3.0, 0), (0.5, 0), (0.75, 0), (0.76, 1), (2.0, 1), (2.1, 2), (3.0, 2), (9.0, 2), (f64::NAN, 0)]
        {
            assert_eq!(nearest(&NODES, x), wanted, "{x}");
        }
        assert_eq!(
            (nearest(&long, 30.4), nearest(&long, 30.5), nearest(&long, 30.6), nearest(&long, 1e9)),
            (5, 5, 6, 39)
        );
        assert_eq!((nearest(&[7.0], 9.0), nearest(&[], 9.0)), (0, 0));
    }

    #[test]
    fn rounding_is_snapped_to_entries() {
        let snapped = |x| Bracket::held(&NODES, x).snapped(1e-9).weights();
        assert_eq!(snapped(1.0 + 1e-12), [(1, 1.0), (2, 0.0)]);
        assert_eq!(snapped(3.0 - 1e-12), [(1, 0.0), (2, 1.0)]);
        assert_eq!(snapped(2.5), [(1, 0.25), (2, 0.75)]);
    }

    #[test]
    fn both_formulas_are_the_line_through_two_points() {
        let ys = [2.0, -1.0, 4.0];
        for i in 0..=250 {
            let x = 0.5 + 0.01 * f64::from(i);
            let plain = if x < 1.0 { 2.0 - 6.0 * (x - 0.5) } else { -1.0 + 2.5 * (x - 1.0) };
            let mixed: f64 = Bracket::held(&NODES, x).weights().map(|(k, weight)| weight * ys[k]).iter().sum();
            assert!((mixed - plain).abs() < 1e-12, "{x}: {mixed} {plain}");
            assert!((polyline(&NODES, &ys, x) - plain).abs() < 1e-12, "{x}");
        }
        assert_eq!([0.4, 3.1].map(|x| polyline(&NODES, &ys, x)), [0.0, 0.0]);
        assert_eq!(polyline(&NODES, &ys, 3.0), 4.0);
    }
}
