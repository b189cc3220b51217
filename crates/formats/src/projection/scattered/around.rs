//! Test whether points lie on all sides of the origin.

/// Narrowest sector, seen from the origin of a plane, that contains all points given so far, as long as it is narrower
/// than half a turn.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Around {
    /// Two of the given points, through which the clockwise and the counterclockwise edge of the sector around all of
    /// them pass. Both are 0 if no point was given.
    sides: [[f64; 2]; 2],
}

impl Around {
    /// Widens the narrowest sector around all points given so far, seen from the origin, to contain `point`. Returns
    /// true if it would reach half a turn: the points then lie on all sides of the origin, and no more may be given.
    pub(super) fn add(&mut self, point: [f64; 2]) -> bool {
        let left_of = |a: [f64; 2]| a[0] * point[1] - a[1] * point[0];
        let [first, last] = self.sides;
        if first == [0.0; 2] {
            self.sides = [point; 2];
            return false;
        }
        match (left_of(first) < 0.0, left_of(last) > 0.0) {
            (true, true) => return true,
            (true, false) => self.sides[0] = point,
            (false, true) => self.sides[1] = point,
            (false, false) => {}
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_a_line_are_never_all_around() {
        for (turn, beside) in [(0.3_f64, 1e-6), (1.0, 1e-3), (2.5, 0.5), (0.0, 1e-9)] {
            let mut around = Around::default();
            let found = (-100..=100).any(|i| {
                let along = f64::from(i) * 0.01 + 1e-5;
                let (sin, cos) = turn.sin_cos();
                around.add([along * cos - beside * sin, along * sin + beside * cos])
            });
            assert!(!found, "{turn} {beside}");
        }
    }

    #[test]
    fn three_points_are_around_what_lies_between_them() {
        for turn in 0..360 {
            let at = |degrees: i32| {
                let (sin, cos) = f64::from(degrees + turn).to_radians().sin_cos();
                [cos, sin]
            };
            let around = |degrees: [i32; 3]| {
                let mut around = Around::default();
                degrees.into_iter().any(|degrees| around.add(at(degrees)))
            };
            for order in [[0, 1, 2], [1, 0, 2], [2, 1, 0], [0, 2, 1]] {
                assert!(around(order.map(|i| [0, 100, 230][i])) && !around(order.map(|i| [0, 100, 170][i])), "{turn}");
            }
        }
    }
}
