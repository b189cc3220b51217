//! Frame about an incoming direction. A function of the angle between two directions is drawn under light along `+z`
//! and then rotated.

use crate::domain::Direction;
use crate::domain::vector::{Vector, add, dot, scale};

/// Orthonormal frame whose z axis is an incoming direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turning {
    axes: [Vector; 3],
}

impl Turning {
    /// Incoming direction in the frame about that direction: `+z`.
    pub(super) fn up() -> Direction {
        Direction::from_unit([0.0, 0.0, 1.0])
    }

    /// Frame whose z axis is `wi` (Duff et al. 2017); for `wi` = `+z` it is the frame of the material.
    pub(super) fn about(wi: Direction) -> Self {
        let [x, y, z] = wi.xyz();
        let sign = if z < 0.0 { -1.0 } else { 1.0 };
        let a = -1.0 / (sign + z);
        let b = x * y * a;
        let first = [1.0 + sign * x * x * a, sign * b, -sign * x];
        let second = [b, sign + y * y * a, -y];
        Self { axes: [first, second, [x, y, z]] }
    }

    /// Converts a direction from the frame of the material to the frame about the incoming direction.
    pub(super) fn inward(&self, direction: Direction) -> Direction {
        Direction::from_unit(self.axes.map(|axis| dot(axis, direction.xyz())))
    }

    /// Converts a direction from the frame about the incoming direction to the frame of the material.
    pub(super) fn outward(&self, direction: Direction) -> Direction {
        let [x, y, z] = direction.xyz();
        let [first, second, third] = self.axes;
        Direction::from_unit(add(add(scale(first, x), scale(second, y)), scale(third, z)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turning_keeps_angles_and_comes_back() {
        for theta in [0.0, 1e-7, 30.0, 90.0, 120.0, 180.0] {
            let wi = Direction::from_degrees(theta, 77.0);
            let turning = Turning::about(wi);
            assert!(dot(turning.inward(wi).xyz(), Turning::up().xyz()) > 1.0 - 1e-14);
            for wo in [Direction::from_degrees(12.0, 200.0), Direction::from_degrees(150.0, 3.0)] {
                let there = turning.inward(wo);
                assert!((there.cos_theta() - dot(wi.xyz(), wo.xyz())).abs() < 1e-14);
                assert!(dot(turning.outward(there).xyz(), wo.xyz()) > 1.0 - 1e-14);
            }
        }
        let at_rest = Turning::about(Turning::up());
        assert_eq!(at_rest.inward(Direction::from_degrees(40.0, 50.0)), Direction::from_degrees(40.0, 50.0));
    }
}
