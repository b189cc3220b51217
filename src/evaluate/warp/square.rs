//! One square of two triangles: densities constant or linear on each half, from the unit square and back.
//!
//! The square is drawn by its marginal density in a and the conditional one in b, so that the map is continuous over both
//! halves and runs along the square's edges. A density is measured against area with mean = mass on each half: a constant
//! one is its mass everywhere.

/// A point of a square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    /// In the upper half, b > a.
    pub(super) upper: bool,
    pub(super) a: f64,
    pub(super) b: f64,
}

impl Point {
    /// The point of a half with these barycentric coordinates: of the right angle, the hypotenuse's ends (0,0), (1,1).
    pub(super) fn new(upper: bool, [_, start, end]: [f64; 3]) -> Self {
        if upper { Self { upper, a: end, b: 1.0 - start } } else { Self { upper, a: 1.0 - start, b: end } }
    }

    /// The barycentric coordinates in its half: of the right angle, of (0,0), of (1,1).
    pub(super) fn coordinates(self) -> [f64; 3] {
        if self.upper {
            [self.b - self.a, 1.0 - self.b, self.a]
        } else {
            [self.a - self.b, 1.0 - self.a, self.b]
        }
    }
}

/// Constant on each half: the masses.
#[derive(Clone, Copy, Debug)]
pub(super) struct Constant(pub(super) [f64; 2]);

impl Constant {
    pub(super) fn draw(self, u: [f64; 2]) -> Point {
        let Self([lower, upper]) = self;
        let below = u[0] * (lower + upper);
        let root = (upper * upper + (lower - upper) * below).max(0.0).sqrt();
        let a = (below / (upper + root).max(f64::MIN_POSITIVE)).min(1.0);
        let (column, above) = (lower * a, upper * (1.0 - a));
        let v = u[1] * (column + above);
        if v < column || above == 0.0 {
            Point { upper: false, a, b: (v / lower).min(a) }
        } else {
            Point { upper: true, a, b: (a + (v - column) / upper).clamp(a, 1.0) }
        }
    }

    pub(super) fn place(self, Point { upper: is_upper, a, b }: Point) -> [f64; 2] {
        let Self([lower, upper]) = self;
        let (column, above) = (lower * a, upper * (1.0 - a));
        let v = if is_upper { column + upper * (b - a) } else { lower * b };
        [(lower * a * a + upper * a * (2.0 - a)) / (lower + upper), ratio(v, column + above)]
    }
}

/// Linear on each half: for each half the density at the right angle, at (0,0) and at (1,1).
#[derive(Clone, Copy, Debug)]
pub(super) struct Linear(pub(super) [[f64; 3]; 2]);

impl Linear {
    /// The linear density with the shape of `values` ≥ 0 at the corners and these masses; constant where a half's are all 0.
    pub(super) fn new(masses: [f64; 2], values: [[f64; 3]; 2]) -> Self {
        Self([0, 1].map(|half| scaled(masses[half], values[half])))
    }

    /// The coefficients of a, a² and a³ of the mass left of a.
    fn marginal(self) -> [f64; 3] {
        let Self([[lr, l0, l1], [ur, u0, u1]]) = self;
        let side = u0 + ur;
        [side, l0 + u1 - side, (lr + l1 - 2.0 * l0 + side - 2.0 * u1) / 3.0]
    }

    /// The density where the line at a meets the bottom, the hypotenuse from below and from above, and the top.
    fn column(self, a: f64) -> [f64; 4] {
        let Self([[lr, l0, l1], [ur, u0, u1]]) = self;
        let c = 1.0 - a;
        [c * l0 + a * lr, c * l0 + a * l1, c * u0 + a * u1, c * ur + a * u1]
    }

    pub(super) fn draw(self, u: [f64; 2]) -> Point {
        let a = root(self.marginal(), u[0]);
        let [bottom, below, above, top] = self.column(a);
        let (lower, upper) = (a * (bottom + below), (1.0 - a) * (above + top));
        let v = u[1] * (lower + upper);
        if v < lower || upper == 0.0 {
            Point { upper: false, a, b: a * along(bottom, below, ratio(v, lower).min(1.0)) }
        } else {
            Point { upper: true, a, b: a + (1.0 - a) * along(above, top, ((v - lower) / upper).clamp(0.0, 1.0)) }
        }
    }

    pub(super) fn place(self, Point { upper: is_upper, a, b }: Point) -> [f64; 2] {
        let [c1, c2, c3] = self.marginal();
        let [bottom, below, above, top] = self.column(a);
        let (lower, upper) = (a * (bottom + below), (1.0 - a) * (above + top));
        let v = if is_upper {
            lower + upper * mass_below(above, top, ratio(b - a, 1.0 - a))
        } else {
            lower * mass_below(bottom, below, ratio(b, a))
        };
        [ratio(a * (c1 + a * (c2 + a * c3)), c1 + c2 + c3), ratio(v, lower + upper)]
    }
}

/// The density with the shape of `values` and this mean over the triangle.
pub(super) fn scaled(mass: f64, values: [f64; 3]) -> [f64; 3] {
    let sum = values[0] + values[1] + values[2];
    if sum > 0.0 {
        let scale = 3.0 * mass / sum;
        values.map(|value| value * scale)
    } else {
        [mass; 3]
    }
}

/// `a / b`, 0 where `b` is.
fn ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 { a / b } else { 0.0 }
}

/// The part of a line with densities `p` and `q` at its ends that holds the part `v` of its mass.
fn along(p: f64, q: f64, v: f64) -> f64 {
    ratio(v * (p + q), p + ((1.0 - v) * p * p + v * q * q).sqrt()).min(1.0)
}

/// The inverse of [`along`].
fn mass_below(p: f64, q: f64, x: f64) -> f64 {
    ratio(x * (p * (2.0 - x) + q * x), p + q)
}

/// Cubic coefficients below this part of the total leave a quadratic with a correction.
const NEARLY_QUADRATIC: f64 = 1e-3;

/// The root in 0..=1 of c1·a + c2·a² + c3·a³ = u·(c1 + c2 + c3), whose left side grows on 0..=1: Cardano's formula, and two
/// steps of Newton's for the digits that it cancels.
fn root([c1, c2, c3]: [f64; 3], u: f64) -> f64 {
    let total = c1 + c2 + c3;
    let target = u * total;
    let start = if c3.abs() < NEARLY_QUADRATIC * total {
        ratio(2.0 * target, c1 + (c1 * c1 + 4.0 * c2 * target).max(0.0).sqrt())
    } else {
        // a = x − k makes it x³ + p·x + q = 0, whose left side has its extrema at ±√(−p/3).
        let inverse = 1.0 / c3;
        let k = c2 * inverse * (1.0 / 3.0);
        let p = c1 * inverse - 3.0 * k * k;
        let half = 0.5 * (k * (2.0 * k * k - c1 * inverse) - target * inverse);
        let third = p * (1.0 / 3.0);
        let discriminant = half * half + third * third * third;
        let x = if discriminant >= 0.0 {
            let t = libm::cbrt(half.abs() + discriminant.sqrt());
            -(t - ratio(third, t)).copysign(half)
        } else {
            // Which of the three: falling (c3 < 0) the middle one, else the one on the unit interval's side.
            let r = (-third).sqrt();
            let angle = libm::acos((-half / (r * r * r)).clamp(-1.0, 1.0)) * (1.0 / 3.0);
            let turn = if c3 < 0.0 {
                -std::f64::consts::TAU / 3.0
            } else if k > -0.5 {
                0.0
            } else {
                std::f64::consts::TAU / 3.0
            };
            2.0 * r * libm::cos(angle + turn)
        };
        x - k
    };
    let mut a = start.clamp(0.0, 1.0);
    for _ in 0..2 {
        let slope = c1 + a * (2.0 * c2 + a * 3.0 * c3);
        let error = a * (c1 + a * (c2 + a * c3)) - target;
        // Where the slope vanishes (both ends at most) the formula's root stays.
        if slope > 1e-6 * total {
            a = (a - error / slope).clamp(0.0, 1.0);
        }
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;
    use rand_pcg::Pcg32;

    /// Random corner values, some of them 0, some tiny.
    fn values(rng: &mut Pcg32) -> [[f64; 3]; 2] {
        [0, 1].map(|_| {
            [0, 1, 2].map(|_| match rng.random::<u32>() % 5 {
                0 => 0.0,
                1 => 1e-9 * rng.random::<f64>(),
                _ => rng.random::<f64>(),
            })
        })
    }

    fn masses(rng: &mut Pcg32) -> [f64; 2] {
        [[1.0, 0.0], [0.0, 1.0], [1e-12, 1.0], [rng.random(), rng.random()]][rng.random::<u32>() as usize % 4]
    }

    #[test]
    fn the_root_of_the_marginal_is_its_inverse() {
        let mut rng = Pcg32::new(11, 1);
        for _ in 0..200_000 {
            let linear = Linear::new(masses(&mut rng), values(&mut rng));
            let [c1, c2, c3] = linear.marginal();
            let total = c1 + c2 + c3;
            for u in [0.0, 1e-12, rng.random(), 1.0 - 1e-12, 1.0] {
                let a = root([c1, c2, c3], u);
                let back = a * (c1 + a * (c2 + a * c3)) / total;
                assert!((0.0..=1.0).contains(&a) && (back - u).abs() < 1e-9, "{linear:?} {u}: {a} {back}");
            }
        }
    }

    #[test]
    fn squares_are_inverted() {
        let mut rng = Pcg32::new(12, 1);
        for _ in 0..100_000 {
            let (masses, values) = (masses(&mut rng), values(&mut rng));
            let (constant, linear) = (Constant(masses), Linear::new(masses, values));
            let u: [f64; 2] = [rng.random(), rng.random()];
            for (point, back) in [
                (constant.draw(u), constant.place(constant.draw(u))),
                (linear.draw(u), linear.place(linear.draw(u))),
            ] {
                assert!(u.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-6), "{masses:?} {values:?} {u:?}: {back:?}");
                assert!(masses[usize::from(point.upper)] > 0.0);
                let coordinates = point.coordinates();
                assert!(coordinates.iter().all(|c| (-1e-12..=1.0).contains(c)), "{point:?}");
                let again = Point::new(point.upper, coordinates);
                assert!((again.a - point.a).abs() < 1e-15 && (again.b - point.b).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn the_density_is_that_of_the_map() {
        // |∂(a,b)/∂u| · density = total, by central differences away from the hypotenuse.
        let mut rng = Pcg32::new(13, 1);
        let mut tried = 0;
        while tried < 2000 {
            let (masses, values) = ([0, 1].map(|_| 0.1 + rng.random::<f64>()), [0, 1].map(|_| [0, 1, 2].map(|_| 0.1 + rng.random::<f64>())));
            let linear = Linear::new(masses, values);
            let u: [f64; 2] = [0.05 + 0.9 * rng.random::<f64>(), 0.05 + 0.9 * rng.random::<f64>()];
            let h = 1e-5;
            let at = |du: f64, dv: f64| linear.draw([u[0] + du, u[1] + dv]);
            let points = [at(h, 0.0), at(-h, 0.0), at(0.0, h), at(0.0, -h)];
            let centre = at(0.0, 0.0);
            if points.iter().any(|p| p.upper != centre.upper) {
                continue;
            }
            tried += 1;
            let [right, left, up, down] = points;
            let jacobian = ((right.a - left.a) * (up.b - down.b) - (right.b - left.b) * (up.a - down.a)) / (4.0 * h * h);
            let density: f64 =
                centre.coordinates().iter().zip(linear.0[usize::from(centre.upper)]).map(|(c, v)| c * v).sum();
            // Area 1/2 a half: a density of mean = mass against area is twice itself.
            let expected = (masses[0] + masses[1]) / (2.0 * density);
            assert!((jacobian / expected - 1.0).abs() < 1e-4, "{jacobian} {expected}");
        }
    }
}
