//! Intensities of a luminaire in a plane through its vertical axis, and the width of their largest lobe.

/// Intensities around a plane: the angle from nadir, negative in the second half, −180 to 180 degrees, and the
/// intensity; NaN where it is masked. Angles do not decrease; two equal ones are a step.
#[derive(Debug)]
pub(super) struct Plane {
    points: Vec<(f64, f64)>,
}

impl Plane {
    /// Joins two half planes, each a list of gamma, 0 to 180 degrees, with intensities.
    pub(super) fn of(first: &[(f64, f64)], second: &[(f64, f64)]) -> Self {
        let second = second.iter().rev().map(|&(gamma, value)| (-gamma, value));
        Self { points: second.chain(first.iter().copied()).collect() }
    }

    /// Number of the largest intensity above 0; of equal ones that nearest to nadir, and of these one in the first
    /// half.
    fn largest(&self) -> Option<usize> {
        let lit = self.points.iter().enumerate().filter(|(_, (_, value))| *value > 0.0);
        let order = |&(_, (angle, value)): &(usize, &(f64, f64))| (*value, -angle.abs(), *angle);
        let best = lit.max_by(|a, b| order(a).partial_cmp(&order(b)).unwrap_or(std::cmp::Ordering::Equal));
        best.map(|(at, _)| at)
    }

    /// Angle from nadir, negative in the second half, and value of the largest intensity; `None` without light.
    pub(super) fn peak(&self) -> Option<(f64, f64)> {
        self.largest().map(|at| self.points[at])
    }

    /// Angle in degrees between the first directions on both sides of the largest intensity with at most `part` of it.
    /// `None` if there is none all around, or a direction before it is masked.
    pub(super) fn width(&self, part: f64) -> Option<f64> {
        let from = self.largest()?;
        let level = part * self.points[from].1;
        Some(self.falls(from, level, 1)? + self.falls(from, level, -1)?)
    }

    /// Angle in degrees from the point `from` to the first place with at most `level`, in the direction of `step`: 1 or
    /// −1. The plane closes at the zenith.
    fn falls(&self, from: usize, level: f64, step: isize) -> Option<f64> {
        let count = self.points.len() as isize;
        let start = self.points[from].0;
        let away = |at: isize| {
            let turns = 360.0 * at.div_euclid(count) as f64;
            let (angle, value) = self.points[at.rem_euclid(count) as usize];
            ((angle + turns - start).abs(), value)
        };
        let (mut before, mut at) = ((0.0, self.points[from].1), from as isize);
        for _ in 0..count {
            at += step;
            let here = away(at);
            if here.1.is_nan() {
                return None;
            }
            if here.1 <= level {
                let t = (before.1 - level) / (before.1 - here.1);
                return Some(before.0 + t * (here.0 - before.0));
            }
            before = here;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn half(values: &[f64], step: f64) -> Vec<(f64, f64)> {
        values.iter().enumerate().map(|(i, &value)| (step * i as f64, value)).collect()
    }

    #[test]
    fn a_triangle_has_the_widths_of_its_sides() {
        // Falls by 10 every 10 degrees from 100 at 10 degrees of the first half.
        let line = |from: f64| (0..=18).map(|i| (from - 10.0 * f64::from(i)).max(0.0)).collect::<Vec<f64>>();
        let mut first = line(110.0);
        first[0] = 90.0;
        let plane = Plane::of(&half(&first, 10.0), &half(&line(90.0), 10.0));
        assert_eq!(plane.peak(), Some((10.0, 100.0)));
        assert!((plane.width(0.5).unwrap() - 100.0).abs() < 1e-9);
        assert!((plane.width(0.1).unwrap() - 180.0).abs() < 1e-9);
        assert!((plane.width(0.95).unwrap() - 10.0).abs() < 1e-9);
    }

    #[test]
    fn the_first_fall_counts_and_the_zenith_joins_the_halves() {
        let batwing = half(&[40.0, 100.0, 30.0, 60.0, 0.0], 45.0);
        let plane = Plane::of(&batwing, &batwing);
        // From 45 degrees inwards 50 is reached at 7.5 degrees, outwards at 77.14 degrees.
        assert_eq!(plane.peak(), Some((45.0, 100.0)));
        assert!((plane.width(0.5).unwrap() - (37.5 + 45.0 * 5.0 / 7.0)).abs() < 1e-9);
        let up = half(&[0.0, 0.0, 0.0, 50.0, 100.0], 45.0);
        assert!((Plane::of(&up, &up).width(0.5).unwrap() - 90.0).abs() < 1e-9);
        let even = half(&[7.0; 5], 45.0);
        assert_eq!((Plane::of(&even, &even).width(0.5), Plane::of(&even, &even).peak()), (None, Some((0.0, 7.0))));
    }

    #[test]
    fn a_step_ends_a_lobe_and_a_masked_direction_hides_its_end() {
        let cut = vec![(0.0, 10.0), (30.0, 10.0), (30.0, 0.0), (180.0, 0.0)];
        assert_eq!(Plane::of(&cut, &cut).width(0.5), Some(60.0));
        let masked = vec![(0.0, 10.0), (30.0, 10.0), (30.0, f64::NAN), (180.0, f64::NAN)];
        assert_eq!(Plane::of(&cut, &masked).width(0.5), None);
        let dark = half(&[0.0; 5], 45.0);
        assert_eq!((Plane::of(&dark, &dark).peak(), Plane::of(&dark, &dark).width(0.5)), (None, None));
    }
}
