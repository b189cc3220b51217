//! The local fit: which weights of the nearest samples make the value at a place, robustly.
//!
//! A quadratic (Cleveland & Devlin 1988, "Locally weighted regression") in the slopes of the half vector for reflection,
//! where lobes of microfacets are functions of the slope, and in tangent coordinates otherwise; linear in the incoming
//! direction where several are fitted together. Samples count less with their distance, with their stated variance, and
//! next to nothing where their light lies far from the fit (bisquare, Beaton & Tukey 1974). Of the fits to all samples found
//! and to the nearest third, that one is taken whose noise and departure from the other are least (after Goldenshluger &
//! Nemirovski 1997). A quadratic that hangs on few samples gives way to a plane, that to a mean.

use super::cloud::{Cloud, tangents};
use super::rows::{Kind, PARTS, Rows};
use super::tree::Found;
use crate::domain::vector::{Vector, dot, sub};
use crate::domain::wide;

/// Terms of the largest basis: 1, u, v, a, b, u², uv, v².
const TERMS: usize = 8;
/// What is added to the diagonal, in parts of the sum of weights: directions in which samples do not differ get no part.
const RIDGE: f64 = 1e-9;
/// A value that is less certain than so many samples' own is not what the samples say.
const UNCERTAIN: f64 = 1.0;
/// Residuals of so many standard deviations lose all weight.
const FAR_OFF: f64 = 6.0;
/// Parts of the square of the reach within which fits compete.
const REACHES: [f64; 2] = [0.33, 1.0];
/// The variance of a weighted fit in parts of what weights by variance would give: they fall off with distance.
const FALL_OFF: f64 = 0.75;
/// Departures within so many variances of theirs are noise.
const CHANCE: f64 = 2.0;
/// A sample beyond so many is looked at.
const SUSPECT: f64 = 4.5;
/// A sample counts at most so many times as much as the middle one.
const MOST_CERTAIN: f64 = 1e6;
/// A fit has at least so many samples more than terms.
const FEWEST_LEFT: usize = 4;
/// Rounds of new weights at most.
const ROUNDS: usize = 4;

/// A place to fit at: within one cell, values are asked for at [`PARTS`] directions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) wi: Vector,
    pub(super) wo: Vector,
    pub(super) parts: [Vector; PARTS],
}

/// What a fit stands on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Support {
    /// The chord to the nearest sample and to the farthest that counts.
    pub(super) nearest: f64,
    pub(super) reach: f64,
    /// The chord to the nearest incoming direction.
    pub(super) nearest_incoming: f64,
    /// The number of the nearest point.
    pub(super) nearest_point: u32,
    /// Samples that counted.
    pub(super) count: usize,
    /// Whether they lie all around.
    pub(super) surrounded: bool,
    /// Variance of the value in parts of that of a sample.
    pub(super) variance: f64,
    /// 2 for a quadratic, 1 for a plane, 0 for a mean.
    pub(super) degree: u8,
}

/// Fits, with everything that is used again from one to the next.
#[derive(Default)]
pub(super) struct Fitter {
    /// The rows that count.
    pub(super) rows: Vec<u32>,
    /// For each of them its weight in the value at each part.
    pub(super) weights: Vec<[f32; PARTS]>,
    /// All rows gathered: within the first of [`REACHES`], then the rest.
    pub(super) gathered: Vec<u32>,
    counts: [usize; REACHES.len()],
    /// The last of [`REACHES`] that counts.
    size: usize,
    parts: [[f64; TERMS]; PARTS],
    joint: bool,
    basis: Vec<[f64; TERMS]>,
    /// The square of the distance in parts of that of the reach.
    squares: Vec<f64>,
    /// By stated uncertainty.
    certainty: Vec<f64>,
    robust: Vec<f64>,
    robust_of_all: Vec<f64>,
    light: Vec<f64>,
    residuals: Vec<f64>,
    sorted: Vec<f64>,
    /// The sides on which there are samples.
    around: Around,
    nearest_incoming: f64,
}

/// A symmetric system, factored, with its solution for the light.
struct Factored {
    factor: [[f64; TERMS]; TERMS],
    terms: usize,
    solution: [f64; TERMS],
    /// The variance of the light about the fit.
    scatter: f64,
}

impl Fitter {
    /// The weights at `place` of the samples `found` (squares of chords, in any order), for the values of `rows`; the noise of
    /// a value is `noise` times that of its row's light, as variances. `None` if there are no samples.
    pub(super) fn fit(
        &mut self,
        cloud: &Cloud,
        rows: &Rows<'_>,
        place: &Place,
        found: &[Found],
        noise: f64,
    ) -> Option<Support> {
        let &first = found.first()?;
        let (nearest, farthest) = found.iter().fold((first, first.0), |(nearest, farthest), &new| {
            (if super::tree::by_distance(&new, &nearest).is_lt() { new } else { nearest }, farthest.max(new.0))
        });
        // The farthest sample counts, too.
        let reach = (farthest * 1.05).max(1e-12);
        self.joint = cloud.stretch > 0.0;
        let axes = tangents(place.wo);
        let by_slope = self.gather(cloud, rows, place, found, (reach, &axes));
        let centre = super::cloud::slope(place.wi, place.wo);
        let length = self.scale(by_slope, centre);
        let joint = self.joint;
        self.parts = place.parts.map(|wo| {
            let [x, y] = if by_slope {
                let [x, y] = super::cloud::slope(place.wi, wo);
                [x - centre[0], y - centre[1]]
            } else {
                axes.map(|axis| dot(axis, wo))
            };
            terms([x / length, y / length], [0.0; 2], joint)
        });
        let mut support = Support {
            nearest: nearest.0.sqrt(),
            reach: farthest.sqrt(),
            nearest_point: nearest.1,
            count: found.len(),
            surrounded: self.around.everywhere,
            nearest_incoming: self.nearest_incoming,
            ..Support::default()
        };
        for (degree, count) in degrees(joint) {
            if degree == 0 || found.len() >= count + degree {
                self.robust.clear();
                self.robust.resize(found.len(), 1.0);
                self.size = REACHES.len() - 1;
                let factored = self.system(count);
                let mut factored = self.robustly(factored);
                if degree == 2 && !joint && factored.scatter > 0.0 && self.counts[0] >= count + FEWEST_LEFT {
                    factored = self.narrowed(factored, noise);
                }
                support.variance = self.weigh(&factored);
                support.degree = degree as u8;
                if support.variance <= UNCERTAIN {
                    break;
                }
            }
        }
        Some(support)
    }

    /// Sets the weights for a band that the rows `missing` of all gathered have not; `false` if none has it.
    pub(super) fn without(&mut self, missing: &[bool]) -> bool {
        let left = missing.iter().filter(|missing| !**missing).count();
        self.robust.clear();
        self.robust.extend(missing.iter().map(|&missing| f64::from(u8::from(!missing))));
        self.size = REACHES.len() - 1;
        for (degree, count) in degrees(self.joint) {
            if degree == 0 || left >= count + degree {
                let factored = self.system(count);
                if self.weigh(&factored) <= UNCERTAIN {
                    break;
                }
            }
        }
        left > 0
    }

    /// Looks up rows, coordinates and weights; whether the coordinates are slopes.
    fn gather(
        &mut self,
        cloud: &Cloud,
        rows: &Rows<'_>,
        place: &Place,
        found: &[Found],
        (reach, axes): (f64, &[Vector; 2]),
    ) -> bool {
        self.gathered.clear();
        self.basis.clear();
        self.squares.clear();
        self.certainty.clear();
        self.light.clear();
        self.around = Around::default();
        self.nearest_incoming = f64::INFINITY;
        let is_steep = |&wo: &Vector| super::cloud::slope(place.wi, wo)[0].is_nan();
        let mut by_slope = cloud.slopes && !place.parts.iter().any(is_steep) && !is_steep(&place.wo);
        let mut kind = Kind::Positive;
        let (mut low, inverse) = (-1.0, 1.0 / reach);
        for (count, high) in self.counts.iter_mut().zip(REACHES) {
            for &(square, item) in found {
                let square = square * inverse;
                if square <= low || square > high {
                    continue;
                }
                let point = &cloud.points[item as usize];
                kind = kind.max(rows.kinds[point.row as usize]);
                by_slope &= !point.slope[0].is_nan();
                self.gathered.push(point.row);
                self.squares.push(square);
                let [x, y] = axes.map(|axis| dot(axis, point.wo));
                let incoming = if self.joint { sub(point.wi, place.wi) } else { [0.0; 3] };
                self.basis.push([x, y, point.slope[0], point.slope[1], incoming[0], incoming[1], 0.0, 0.0]);
                self.nearest_incoming = self.nearest_incoming.min(dot(incoming, incoming));
                self.around.add([x, y]);
            }
            low = high;
            *count = self.gathered.len();
        }
        self.nearest_incoming = self.nearest_incoming.sqrt();
        // Of logarithms, or of values.
        let scale = usize::from(kind != Kind::Positive);
        self.light.extend(self.gathered.iter().map(|&row| rows.light[row as usize][scale]));
        let base = self.light[0];
        self.light.iter_mut().for_each(|light| *light -= base);
        if rows.certainty.is_empty() {
            self.certainty.resize(self.gathered.len(), 1.0);
        } else {
            self.certainty.extend(self.gathered.iter().map(|&row| rows.certainty[row as usize][scale]));
            self.count_certainty();
        }
        by_slope
    }

    /// Certainties in parts of their median; rows without any count as the median.
    fn count_certainty(&mut self) {
        self.sorted.clear();
        self.sorted.extend(self.certainty.iter().copied().filter(|&certainty| certainty > 0.0));
        let middle = self.sorted.len() / 2;
        let median =
            if self.sorted.is_empty() { 1.0 } else { *self.sorted.select_nth_unstable_by(middle, f64::total_cmp).1 };
        for certainty in &mut self.certainty {
            *certainty = if *certainty > 0.0 { (*certainty / median).clamp(1e-9, MOST_CERTAIN) } else { 1.0 };
        }
    }

    /// Turns what was gathered into the basis; the length that coordinates are divided by.
    fn scale(&mut self, by_slope: bool, centre: [f64; 2]) -> f64 {
        let coordinates = |found: &[f64; TERMS]| {
            if by_slope { [found[2] - centre[0], found[3] - centre[1]] } else { [found[0], found[1]] }
        };
        let (mut largest, mut most) = (1e-300_f64, 1e-300_f64);
        for found in &self.basis {
            let [x, y] = coordinates(found);
            largest = largest.max(x * x + y * y);
            most = most.max(found[4] * found[4] + found[5] * found[5]);
        }
        let (length, stretch) = (1.0 / largest.sqrt(), 1.0 / most.sqrt());
        for found in &mut self.basis {
            let [x, y] = coordinates(found);
            *found = terms([x * length, y * length], [found[4] * stretch, found[5] * stretch], self.joint);
        }
        largest.sqrt()
    }

    /// The fit to all samples, or to the nearest where it departs from theirs by more than it saves of noise.
    fn narrowed(&mut self, all: Factored, noise: f64) -> Factored {
        let last = self.size;
        // What is far off the fit to all is left out at first: of few samples an outlier bends the fit to itself.
        self.robust_of_all.clear();
        self.robust_of_all.extend_from_slice(&self.robust);
        self.size = 0;
        let mut few = self.system(all.terms);
        if self.suspicion(&few).is_none() {
            self.robust.fill(1.0);
            few = self.system(all.terms);
        }
        let few = self.robustly(few);
        let mut one = [0.0; TERMS];
        one[0] = 1.0;
        let [own, less] = [&few, &all].map(|fit| FALL_OFF * fit.solve(one)[0]);
        let scatter = few.scatter.min(all.scatter);
        let departure = (all.solution[0] - few.solution[0]).powi(2) - CHANCE * scatter * (own - less).max(0.0);
        if departure.max(0.0) <= noise * scatter * (own - less) {
            std::mem::swap(&mut self.robust, &mut self.robust_of_all);
            self.size = last;
            return all;
        }
        few
    }

    /// The same fit with samples far off left out.
    fn robustly(&mut self, mut factored: Factored) -> Factored {
        let mut last = f64::INFINITY;
        for _ in 0..ROUNDS {
            let Some(scale) = self.suspicion(&factored) else { break };
            for (robust, residual) in self.robust.iter_mut().zip(&self.residuals) {
                let far = residual / (FAR_OFF * scale);
                *robust = (1.0 - far * far).max(0.0).powi(2);
            }
            factored = self.system(factored.terms);
            if scale > 0.99 * last {
                break;
            }
            last = scale;
        }
        factored
    }

    /// The standard deviation of the light about the fit, by its median, if some sample is far off; `residuals` are left as
    /// the light's.
    fn suspicion(&mut self, factored: &Factored) -> Option<f64> {
        let (mut sum, mut squares, mut largest, mut brightest) = (0.0, 0.0, 0.0_f64, 0.0_f64);
        self.residuals.clear();
        let count = self.counts[self.size];
        for (basis, light) in self.basis.iter().zip(&self.light).take(count) {
            let fitted: f64 = factored.solution.iter().zip(basis).map(|(a, b)| a * b).sum();
            let residual = (light - fitted).abs();
            sum += residual;
            squares += residual * residual;
            largest = largest.max(residual);
            brightest = brightest.max(light.abs());
            self.residuals.push(residual);
        }
        let n = count as f64;
        let deviation = (squares / n).sqrt();
        // A normal distribution has 1.25 for the ratio of its standard to its mean deviation. Light that is not known has none.
        if squares.is_nan() || largest <= SUSPECT * deviation && deviation <= 1.6 * sum / n {
            return None;
        }
        self.sorted.clear();
        self.sorted.extend_from_slice(&self.residuals);
        let (_, &mut median, _) = self.sorted.select_nth_unstable_by(count / 2, f64::total_cmp);
        // Some residuals are used up by the terms of the fit; exact data have residuals of rounding.
        let used = (n / (n - factored.terms as f64).max(1.0)).sqrt();
        let scale = (1.4826 * median * used).max(1e-6 * brightest);
        (largest > SUSPECT * scale).then_some(scale)
    }

    /// How much sample `i` counts; the farthest does, too: its square is less than 1.
    fn counts(&self, i: usize) -> f64 {
        (1.0 - self.squares[i] / REACHES[self.size]) * self.certainty[i] * self.robust[i]
    }

    fn system(&self, terms: usize) -> Factored {
        let mut matrix = [[0.0; TERMS]; TERMS];
        let mut right = [0.0; TERMS];
        let (mut total, mut square, mut number) = (0.0, 0.0, 0.0);
        let count = self.counts[self.size];
        let inverse = 1.0 / REACHES[self.size];
        let (squares, certainty) = (&self.squares[..count], &self.certainty[..count]);
        let (robust, light, basis) = (&self.robust[..count], &self.light[..count], &self.basis[..count]);
        // Without incoming directions the last two are 0: their sums are not needed.
        let rows = if self.joint { TERMS } else { TERMS - 2 };
        wide(
            #[inline(always)]
            || {
                for i in 0..count {
                    let weight = (1.0 - squares[i] * inverse) * certainty[i] * robust[i];
                    let (basis, light) = (&basis[i], light[i]);
                    total += weight;
                    number += robust[i];
                    square += weight * light * light;
                    let weighted = basis.map(|factor| weight * factor);
                    for (sum, factor) in right.iter_mut().zip(weighted) {
                        *sum += light * factor;
                    }
                    for j in 0..TERMS - 2 {
                        for (sum, factor) in matrix[j].iter_mut().zip(weighted) {
                            *sum += basis[j] * factor;
                        }
                    }
                    if rows == TERMS {
                        for j in TERMS - 2..TERMS {
                            for (sum, factor) in matrix[j].iter_mut().zip(weighted) {
                                *sum += basis[j] * factor;
                            }
                        }
                    }
                }
            },
        );
        for (i, row) in matrix.iter_mut().enumerate().take(terms).skip(1) {
            row[i] += RIDGE * total;
        }
        let mut factored = Factored::new(matrix, terms);
        factored.solution = factored.solve(right);
        let explained: f64 = factored.solution.iter().zip(&right).map(|(a, b)| a * b).sum();
        let freedom = 1.0 - terms as f64 / number.max(terms as f64 + 1.0);
        // What rounding leaves of nothing is nothing.
        let left = square - explained;
        factored.scatter = if left > 1e-12 * square { left / (total * freedom) } else { 0.0 };
        factored
    }

    /// Sets the weights at the parts, and the rows that have any; the largest variance of a value, in parts of that of a
    /// sample.
    fn weigh(&mut self, factored: &Factored) -> f64 {
        let solutions = self.parts.map(|part| factored.solve(part));
        self.weights.clear();
        self.rows.clear();
        let mut variance = [0.0; PARTS];
        for i in 0..self.counts[self.size] {
            let counts = self.counts(i);
            if counts == 0.0 {
                continue;
            }
            let basis = &self.basis[i];
            let weights = solutions.map(|solution| {
                let sum: f64 = solution.iter().zip(basis).map(|(a, b)| a * b).sum();
                counts * sum
            });
            variance.iter_mut().zip(weights).for_each(|(sum, w)| *sum += w * w);
            self.weights.push(weights.map(|w| w as f32));
            self.rows.push(self.gathered[i]);
        }
        variance.into_iter().fold(0.0, |most, v| if v > most || v.is_nan() { v } else { most })
    }
}

/// Degrees and their numbers of terms, the highest first.
fn degrees(joint: bool) -> [(usize, usize); 3] {
    if joint { [(2, 8), (1, 5), (0, 1)] } else { [(2, 6), (1, 3), (0, 1)] }
}

/// The angle at the origin in which points lie, as long as it is less than half a turn.
#[derive(Clone, Copy, Debug, Default)]
struct Around {
    /// The points at its two sides, the second to the left of the first; none if both are 0.
    sides: [[f64; 2]; 2],
    /// Whether every half plane has a point.
    everywhere: bool,
}

impl Around {
    fn add(&mut self, point: [f64; 2]) {
        if self.everywhere || point == [0.0; 2] {
            return;
        }
        let left_of = |a: [f64; 2]| a[0] * point[1] - a[1] * point[0];
        let [first, last] = self.sides;
        if first == [0.0; 2] {
            self.sides = [point; 2];
            return;
        }
        match (left_of(first) < 0.0, left_of(last) > 0.0) {
            (true, true) => self.everywhere = true,
            (true, false) => self.sides[0] = point,
            (false, true) => self.sides[1] = point,
            (false, false) => {}
        }
    }
}

/// The basis at an offset of the outgoing (u, v) and the incoming direction (a, b).
#[inline]
fn terms([u, v]: [f64; 2], [a, b]: [f64; 2], joint: bool) -> [f64; TERMS] {
    if joint { [1.0, u, v, a, b, u * u, u * v, v * v] } else { [1.0, u, v, u * u, u * v, v * v, 0.0, 0.0] }
}

impl Factored {
    /// Cholesky's factor of the first `terms` rows of `matrix`.
    fn new(mut matrix: [[f64; TERMS]; TERMS], terms: usize) -> Self {
        let least = (1e-14 * matrix[0][0]).max(1e-300);
        for j in 0..terms {
            let row = matrix[j];
            let pivot = row[j] - row[..j].iter().map(|factor| factor * factor).sum::<f64>();
            // What rounding leaves of nothing.
            let root = pivot.max(least).sqrt();
            let inverse = 1.0 / root;
            for below in &mut matrix[j + 1..terms] {
                let explained: f64 = below.iter().zip(&row).take(j).map(|(a, b)| a * b).sum();
                below[j] = (below[j] - explained) * inverse;
            }
            // The inverse is what is asked for.
            matrix[j][j] = inverse;
        }
        Self { factor: matrix, terms, solution: [0.0; TERMS], scatter: 0.0 }
    }

    /// The solution for a right side, 0 beyond the terms.
    fn solve(&self, mut right: [f64; TERMS]) -> [f64; TERMS] {
        let n = self.terms;
        right[n..].fill(0.0);
        for i in 0..n {
            for k in 0..i {
                right[i] -= self.factor[i][k] * right[k];
            }
            right[i] *= self.factor[i][i];
        }
        for i in (0..n).rev() {
            for k in i + 1..n {
                right[i] -= self.factor[k][i] * right[k];
            }
            right[i] *= self.factor[i][i];
        }
        right
    }
}
