//! One square of two triangles: densities constant or linear on each half, from the unit square and back.
//!
//! Points are drawn by the marginal density in a and the conditional one in b, so that the map is continuous over both
//! halves and follows the square's edges. Densities are with respect to area, normalised so that the mean on each half
//! is its mass: a constant density equals its mass everywhere.

use std::hint::select_unpredictable;

/// Point of the unit square (a, b), which consists of a lower triangle (b < a) and an upper triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    /// True if the point (a, b) of the unit square lies in the upper triangle, b > a; false in the lower one.
    pub(super) upper: bool,
    pub(super) a: f64,
    pub(super) b: f64,
}

impl Point {
    /// Point of the lower or upper triangle of a square, given by its barycentric coordinates with respect to the right
    /// angle and the hypotenuse's ends (0,0) and (1,1).
    pub(super) fn new(upper: bool, [_, start, end]: [f64; 3]) -> Self {
        if upper { Self { upper, a: end, b: 1.0 - start } } else { Self { upper, a: 1.0 - start, b: end } }
    }

    /// Barycentric coordinates of this point of the unit square in its half, the lower or upper triangle. They are with
    /// respect to the right angle and the hypotenuse's ends (0,0) and (1,1).
    #[inline(always)]
    pub(super) fn coordinates(self) -> [f64; 3] {
        if self.upper { [self.b - self.a, 1.0 - self.b, self.a] } else { [self.a - self.b, 1.0 - self.a, self.b] }
    }
}

/// Density on a square that is constant on each of its two triangles, given by the triangles' probabilities.
#[derive(Clone, Copy, Debug)]
pub(super) struct Constant(pub(super) [f64; 2]);

#[allow(clippy::needless_bitwise_bool, reason = "neither can be predicted")]
impl Constant {
    #[inline(always)]
    pub(super) fn draw(self, u: [f64; 2]) -> Point {
        let Self([lower, upper]) = self;
        let below = u[0] * (lower + upper);
        let root = (upper * upper + (lower - upper) * below).max(0.0).sqrt();
        let a = (below / (upper + root).max(f64::MIN_POSITIVE)).min(1.0);
        let (column, above) = (lower * a, upper * (1.0 - a));
        let v = u[1] * (column + above);
        // The half is unpredictable: selects rather than branches, as far as the processor has them.
        let is_upper = (v >= column) & (above > 0.0);
        let start = select_unpredictable(is_upper, a, 0.0);
        let end = select_unpredictable(is_upper, 1.0, a);
        let mass = select_unpredictable(is_upper, v - column, v);
        Point { upper: is_upper, a, b: (start + mass / select_unpredictable(is_upper, upper, lower)).min(end) }
    }

    pub(super) fn place(self, Point { upper: is_upper, a, b }: Point) -> [f64; 2] {
        let Self([lower, upper]) = self;
        let (column, above) = (lower * a, upper * (1.0 - a));
        let v = if is_upper { column + upper * (b - a) } else { lower * b };
        [(lower * a * a + upper * a * (2.0 - a)) / (lower + upper), ratio(v, column + above)]
    }
}

/// Density on a square that is linear on each of its two triangles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Linear {
    /// For the lower (b < a) and the upper triangle of the unit square (a, b): density at the vertex with the right
    /// angle, at (0,0) and at (1,1), each divided by the common factor `scale`.
    values: [[f64; 3]; 2],
    scale: f64,
}

#[allow(clippy::needless_bitwise_bool, reason = "neither can be predicted")]
impl Linear {
    /// Builds a probability density that is linear on each of two triangles, in proportion to the values `shapes` (at
    /// least 0) at the triangle's corners. `masses` are the probabilities of the triangles. The density is constant on
    /// a triangle whose values are all 0.
    #[inline(always)]
    pub(super) fn new(masses: [f64; 2], shapes: [[f64; 3]; 2]) -> Self {
        let [(lower, lower_sum), (upper, upper_sum)] = [shaped(shapes[0]), shaped(shapes[1])];
        // Brought to a common scale without a division, for which the draw would wait.
        let (l, u) = (masses[0] * upper_sum, masses[1] * lower_sum);
        let values = [[lower[0] * l, lower[1] * l, lower[2] * l], [upper[0] * u, upper[1] * u, upper[2] * u]];
        Self { values, scale: 3.0 / (lower_sum * upper_sum) }
    }

    /// Probability density at a point, given by barycentric coordinates, of the lower (b < a) or upper triangle of the
    /// unit square (a, b). The area of each triangle counts as 1: the mean of the density over a triangle is the
    /// triangle's probability.
    #[inline(always)]
    pub(super) fn density(self, upper: bool, [a, b, c]: [f64; 3]) -> f64 {
        let [right, start, end] = [0, 1, 2].map(|k| if upper { self.values[1][k] } else { self.values[0][k] });
        (right * a + start * b + end * c) * self.scale
    }

    /// Coefficients of a, a² and a³ in the cumulative distribution of the coordinate a of points (a, b) in the unit
    /// square, whose density is linear on the triangles b < a and b > a. They have a common factor.
    #[inline(always)]
    fn marginal(self) -> [f64; 3] {
        let [[lr, l0, l1], [ur, u0, u1]] = self.values;
        let side = u0 + ur;
        [side, l0 + u1 - side, (lr + l1 - 2.0 * l0 + side - 2.0 * u1) / 3.0]
    }

    /// Densities at four points of the unit square (a, b) with the given a, up to a common factor: at b = 0, on the
    /// diagonal b = a as part of the lower and of the upper triangle, and at b = 1.
    #[inline(always)]
    fn column(self, a: f64) -> [f64; 4] {
        let [[lr, l0, l1], [ur, u0, u1]] = self.values;
        let c = 1.0 - a;
        [c * l0 + a * lr, c * l0 + a * l1, c * u0 + a * u1, c * ur + a * u1]
    }

    #[inline]
    pub(super) fn draw(self, u: [f64; 2]) -> Point {
        self.draw_on(self.line_at(u[0]), u[1])
    }

    /// Coordinate a of a point (a, b) drawn in the unit square, found from the random number `u` by inverting the
    /// cumulative distribution of a.
    #[inline]
    pub(super) fn line_at(self, u: f64) -> f64 {
        root(self.marginal(), u)
    }

    /// Coordinate a of a point (a, b) drawn in the unit square, found from the random number `u` by inverting the
    /// cumulative distribution of a without branches. The flag is true if the result is exact to rounding.
    #[inline(always)]
    pub(super) fn near(self, u: f64) -> (f64, bool) {
        near_root(self.marginal(), u)
    }

    /// Point (a, b) of the unit square whose coordinate `a` is given; b is found from the random number `u` by
    /// inverting the conditional distribution of b.
    #[inline(always)]
    pub(super) fn draw_on(self, a: f64, u: f64) -> Point {
        let [bottom, below, above, top] = self.column(a);
        let (lower, upper) = (a * (bottom + below), (1.0 - a) * (above + top));
        let v = u * (lower + upper);
        let is_upper = (v >= lower) & (upper > 0.0);
        let start = select_unpredictable(is_upper, a, 0.0);
        let end = select_unpredictable(is_upper, 1.0, a);
        let p = select_unpredictable(is_upper, above, bottom);
        let q = select_unpredictable(is_upper, top, below);
        let mass = select_unpredictable(is_upper, v - lower, v);
        Point { upper: is_upper, a, b: (start + along(p, q, end - start, mass)).min(end) }
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

/// Corner values that a linear density is proportional to, and their sum; all 1 if the given values are all 0.
#[inline(always)]
fn shaped(values: [f64; 3]) -> ([f64; 3], f64) {
    let sum = values[0] + values[1] + values[2];
    if sum > 0.0 { (values, sum) } else { ([1.0; 3], 3.0) }
}

/// Linear density at a point of a triangle, given by its barycentric coordinates. The density is proportional to
/// `values` at the vertices and has the mean `mass`.
#[inline(always)]
pub(super) fn linear_at(mass: f64, values: [f64; 3], [a, b, c]: [f64; 3]) -> f64 {
    let ([x, y, z], sum) = shaped(values);
    3.0 * mass * (x * a + y * b + z * c) / sum
}

/// Quotient `a / b`; 0 if `b` is 0.
#[inline(always)]
fn ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 { a / b } else { 0.0 }
}

/// Distance x from the start of a line of the given `length` at which the integral of a density from 0 to x is `v` / 2.
/// The density is linear, from `p` at the start to `q` at the end. Callers double all integrals, which saves the factor
/// ½ in (`p` + `q`) · `length` / 2.
#[inline(always)]
fn along(p: f64, q: f64, length: f64, v: f64) -> f64 {
    ratio(v, p + (p * p + v * (q - p) / length).max(0.0).sqrt())
}

/// Fraction of the integral of a density along a line that lies between the start and the fraction `x` of the length.
/// The density is linear, from `p` at the start to `q` at the end. Inverse of [`along`].
fn mass_below(p: f64, q: f64, x: f64) -> f64 {
    ratio(x * (p * (2.0 - x) + q * x), p + q)
}

/// Fraction of the total probability of a unit square's points below which an error of their cumulative distribution
/// counts as rounding.
const ROUNDING: f64 = 1e-14;
/// Maximum number of iterations of the root search: bisection reaches neighbouring numbers after about as many as there
/// are binary digits.
const MOST_STEPS: usize = 64;

/// Root in 0..=1 of m(a) = c1·a + c2·a² + c3·a³ = u·(c1 + c2 + c3), where m increases on 0..=1. Two Halley steps are
/// nearly always enough. Cardano's formula needs a cosine of a third of an arc cosine, and cancels where the slope is
/// small.
#[inline]
fn root(c: [f64; 3], u: f64) -> f64 {
    let (a, is_found) = near_root(c, u);
    if is_found { a } else { bounded_root(c, u) }
}

/// Approximate solution a of m(a) = u·m(1) after two Halley steps, where m(a) = c1·a + c2·a² + c3·a³ is a cumulative
/// distribution up to a factor. The flag is true if it is exact to rounding.
#[inline(always)]
#[allow(clippy::needless_bitwise_bool, clippy::manual_range_contains, reason = "without branches")]
fn near_root([c1, c2, c3]: [f64; 3], u: f64) -> (f64, bool) {
    let total = c1 + c2 + c3;
    // m(u) − u·m(1), with fewer operations after u.
    let mut a = halley([c1, c2, c3], u, -u * (1.0 - u) * (c2 + c3 + u * c3));
    let target = u * total;
    a = halley([c1, c2, c3], a, mass_left([c1, c2, c3], a) - target);
    let left = mass_left([c1, c2, c3], a) - target;
    (a, (left.abs() <= ROUNDING * total) & (a >= 0.0) & (a <= 1.0))
}

/// Solves m(a) = u·m(1) for a in 0..=1, where m(a) = c1·a + c2·a² + c3·a³ increases. Halley steps stay within bounds
/// that each step narrows, with bisection as a fallback.
#[cold]
fn bounded_root(c: [f64; 3], u: f64) -> f64 {
    let total = c[0] + c[1] + c[2];
    let (mut low, mut high) = (0.0, 1.0);
    let mut a = u;
    for _ in 0..MOST_STEPS {
        let left = mass_left(c, a) - u * total;
        if left.abs() <= ROUNDING * total {
            break;
        }
        if left > 0.0 {
            high = a;
        } else {
            low = a;
        }
        a = halley(c, a, left);
        if !(low < a && a < high) {
            a = 0.5 * (low + high);
        }
    }
    a
}

/// Cumulative distribution, up to a factor, of the coordinate a of points in the unit square: m(a) = c1·a + c2·a² +
/// c3·a³, proportional to the probability of a smaller coordinate.
#[inline(always)]
fn mass_left([c1, c2, c3]: [f64; 3], a: f64) -> f64 {
    a * (c1 + a * (c2 + a * c3))
}

/// Halley step from `a` towards the solution of m(a) = c1·a + c2·a² + c3·a³ = v, where m(a) is too large by `error`.
#[inline(always)]
fn halley([c1, c2, c3]: [f64; 3], a: f64, error: f64) -> f64 {
    let slope = c1 + a * (2.0 * c2 + a * 3.0 * c3);
    let bend = c2 + 3.0 * a * c3;
    a - error * slope / (slope * slope - error * bend)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;
    use rand_pcg::Pcg32;

    /// Random corner values of the two triangles of a square, some of them 0, some tiny.
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
            for u in [0.0, 1e-18, 1e-12, rng.random(), 1.0 - 1e-12, 1.0] {
                let a = root([c1, c2, c3], u);
                let back = a * (c1 + a * (c2 + a * c3)) / total;
                assert!((0.0..=1.0).contains(&a) && (back - u).abs() < 1e-13, "{linear:?} {u}: {a} {back}");
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
            for (point, back) in
                [(constant.draw(u), constant.place(constant.draw(u))), (linear.draw(u), linear.place(linear.draw(u)))]
            {
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
            let (masses, values) = (
                [0, 1].map(|_| 0.1 + rng.random::<f64>()),
                [0, 1].map(|_| [0, 1, 2].map(|_| 0.1 + rng.random::<f64>())),
            );
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
            let jacobian =
                ((right.a - left.a) * (up.b - down.b) - (right.b - left.b) * (up.a - down.a)) / (4.0 * h * h);
            let density = linear.density(centre.upper, centre.coordinates());
            // Each half has area 1/2: a density whose mean equals the mass is half the one with respect to area.
            let expected = (masses[0] + masses[1]) / (2.0 * density);
            assert!((jacobian / expected - 1.0).abs() < 1e-4, "{jacobian} {expected}");
        }
    }
}
