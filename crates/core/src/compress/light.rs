//! The light that leaves each block of directions, at each wavelength: directional albedo, flux, or a phase function's integral.
//!
//! It is Σ sample · weight over the last axis of directions. The weight of a triangle is its solid angle, projected for
//! quantities that go with a cosine. Weights of a grid of angles integrate straight lines between polar angles, and are
//! trapezoids around the pole. A block is one entry of all axes before the directions. Masked samples do not count.

use crate::codec::Class;
use crate::domain::{Axis, AzimuthExtent, DirectionGrid, Frame, Quantity, TriangleMesh};
use crate::numeric::wide;
use serde::Serialize;

/// How far the light of the decoded file is from that of the measurement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LightReport {
    /// The largest relative error over blocks and wavelengths that have light.
    pub largest: f64,
    /// Its root mean square.
    pub rms: f64,
    /// The largest light of a block in the measurement: an albedo above 1 is none.
    pub brightest: f64,
}

/// How the samples of a tensor add up.
pub(crate) struct Light {
    weights: Vec<f64>,
    inner: usize,
}

impl Light {
    /// `None` where there are no directions.
    pub(crate) fn of(quantity: Quantity, axes: &[Axis]) -> Option<Self> {
        let at = axes.iter().rposition(|axis| matches!(axis, Axis::Triangles(_) | Axis::Grid(_)))?;
        let weights = match &axes[at] {
            Axis::Triangles(mesh) => weights(quantity, *mesh),
            Axis::Grid(grid) => weights_of_angles(quantity, grid),
            _ => return None,
        };
        Some(Self { weights, inner: axes[at + 1..].iter().map(Axis::len).product() })
    }

    /// Entries after the directions.
    pub(crate) fn inner(&self) -> usize {
        self.inner
    }

    /// Sums of a tensor of `samples` samples.
    pub(crate) fn entries(&self, samples: usize) -> usize {
        samples / self.weights.len()
    }

    /// `[blocks, entries after the directions]`
    pub(crate) fn sums(&self, samples: &[f32]) -> Vec<f64> {
        let block = self.weights.len() * self.inner;
        let mut sums = vec![0.0; samples.len() / self.weights.len()];
        wide(
            #[inline(always)]
            || {
                for (samples, sums) in samples.chunks_exact(block).zip(sums.chunks_exact_mut(self.inner)) {
                    for (row, weight) in samples.chunks_exact(self.inner).zip(&self.weights) {
                        for (sum, &s) in sums.iter_mut().zip(row) {
                            let more = *sum + weight * f64::from(s);
                            *sum = if s.is_nan() { *sum } else { more };
                        }
                    }
                }
            },
        );
        sums
    }

    /// Adds corrections to the logarithms of every block and entry.
    pub(crate) fn add(&self, how: Correcting<'_>, steps: &[i32], logs: &mut [f32]) {
        let block = self.weights.len() * self.inner;
        for (number, (logs, steps)) in logs.chunks_exact_mut(block).zip(steps.chunks_exact(self.inner)).enumerate() {
            if steps.iter().all(|&k| k == 0) {
                continue;
            }
            let classes = how.classes.map(|classes| &classes[number * block..]);
            for (first, row) in (0..).step_by(self.inner).zip(logs.chunks_exact_mut(self.inner)) {
                for (lane, (log, &k)) in row.iter_mut().zip(steps).enumerate() {
                    let (of_negative, shift) = shift(how.step, k);
                    let is_negative = classes.is_some_and(|classes| classes[first + lane] == Class::Negative);
                    if is_negative == of_negative {
                        *log += shift;
                        *log = if is_negative { log.min(how.bound) } else { *log };
                    }
                }
            }
        }
    }

    pub(crate) fn report(&self, original: &[f32], decoded: &[f32]) -> LightReport {
        let (wanted, found) = (self.sums(original), self.sums(decoded));
        let (mut largest, mut sum, mut count) = (0.0_f64, 0.0, 0_u64);
        for (&wanted, found) in wanted.iter().zip(found).filter(|(wanted, _)| **wanted > 0.0) {
            let error = (found / wanted - 1.0).abs();
            largest = largest.max(error);
            sum += error * error;
            count += 1;
        }
        let brightest = wanted.iter().fold(0.0_f64, |most, &light| most.max(light));
        LightReport { largest, rms: if count == 0 { 0.0 } else { (sum / count as f64).sqrt() }, brightest }
    }

    /// The steps of the logarithm that take the light of `decoded` within `bound` of that of `original`; 0 where it is. With
    /// a negative step the negative samples of a block take the correction if they can, as they keep no error, else the
    /// positive ones.
    pub(crate) fn steps(
        &self,
        bound: f64,
        (step, largest_negative): (f32, f32),
        (original, decoded): (&[f32], &[f32]),
    ) -> Vec<i32> {
        let (wanted, found) = (self.sums(original), self.sums(decoded));
        let of_block = |entry: usize, wanted: f64, found: f64| {
            if wanted <= 0.0 || (found / wanted - 1.0).abs() <= NEAR * bound {
                return 0;
            }
            let mut negative = Negative { samples: Vec::new(), largest: f64::from(largest_negative) };
            if step < 0.0 {
                negative.samples = self.negative_of(entry, decoded);
            }
            let fixed = negative.light(0.0);
            let positive = found + fixed;
            if fixed > 0.0 {
                let fine = -f64::from(step) / PARTS;
                let k = negative.nearest(positive - wanted, fine);
                let reached = positive - negative.light(f64::from(k) * fine);
                if k != 0 && (reached / wanted - 1.0).abs() <= NEAR * bound {
                    return 2 * k + 1;
                }
            }
            let ratio = (wanted + fixed) / positive;
            let is_usable = positive > 0.0 && ratio.is_finite();
            let k =
                if is_usable { libm::round(libm::log(ratio) / f64::from(step.abs())).clamp(-1e6, 1e6) } else { 0.0 };
            if step < 0.0 { 2 * k as i32 } else { k as i32 }
        };
        let all = wanted.into_iter().zip(found).enumerate();
        all.map(|(entry, (wanted, found))| of_block(entry, wanted, found)).collect()
    }

    /// Weights and sizes of the negative samples that an entry of the sums adds up.
    fn negative_of(&self, entry: usize, samples: &[f32]) -> Vec<(f64, f64)> {
        let first = entry / self.inner * self.weights.len() * self.inner + entry % self.inner;
        let own = samples[first..].iter().step_by(self.inner).zip(&self.weights);
        own.filter(|(sample, _)| **sample < 0.0).map(|(&sample, &weight)| (weight, f64::from(-sample))).collect()
    }
}

/// Corrections of the light: their step, and the negative samples that keep no error.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Correcting<'a> {
    /// Step of a logarithm; negative where odd steps are those of negative samples, see [`shift`].
    step: f32,
    /// Classes of samples on a grid of angles. A positive step leaves negative samples there as they are.
    classes: Option<&'a [Class]>,
    /// Largest logarithm of a negative sample.
    bound: f32,
}

impl<'a> Correcting<'a> {
    /// Corrections of a step. With a bound, the largest logarithm of a negative sample, `classes` tell which samples are
    /// negative; without, all samples are corrected alike.
    pub(crate) fn new(step: f32, classes: Option<&'a [Class]>, bound: Option<f32>) -> Self {
        Self { step, classes: classes.filter(|_| bound.is_some()), bound: bound.unwrap_or(f32::MAX) }
    }
}

/// Negative samples of a block: weights and sizes, and the largest size that a decoder gives any.
struct Negative {
    samples: Vec<(f64, f64)>,
    largest: f64,
}

impl Negative {
    /// Size of the light of all with this shift of their logarithms.
    fn light(&self, shift: f64) -> f64 {
        let factor = libm::exp(shift);
        self.samples.iter().map(|(weight, size)| weight * (factor * size).min(self.largest)).sum()
    }

    /// The number of steps, among those that float32 holds, with which the light is nearest to `wanted` from below.
    fn nearest(&self, wanted: f64, step: f64) -> i32 {
        let most = (MOST_SHIFT / step).min(MOST_STEPS) as i32;
        let (mut low, mut high) = (-most, most);
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            if self.light(f64::from(middle) * step) <= wanted { low = middle } else { high = middle }
        }
        low
    }
}

/// Part of a bound that light may be off without a correction: the rest is left to rounding.
const NEAR: f64 = 0.9;
/// Steps of negative samples are this much finer: their light may be many times that of their block.
const PARTS: f64 = 16.0;
/// Largest shift of the logarithms of negative samples, which makes them nothing or the largest.
const MOST_SHIFT: f64 = 20.0;
/// Most steps of that shift: float32 holds every integer up to it.
const MOST_STEPS: f64 = (1 << 24) as f64;

/// Change of a logarithm by the correction `k`; true with it where the change is for negative samples. A negative step stands
/// for one of its size: an even k is then twice the steps of samples that are not negative; an odd k is twice those of negative
/// samples, each a sixteenth as large, plus 1.
fn shift(step: f32, k: i32) -> (bool, f32) {
    match (step < 0.0, k & 1) {
        (false, _) => (false, k as f32 * step),
        (true, 0) => (false, (k >> 1) as f32 * -step),
        (true, _) => (true, (k >> 1) as f32 * (-step / PARTS as f32)),
    }
}

/// What a cell counts for: its solid angle, projected for quantities that go with a cosine.
pub(crate) fn weights(quantity: Quantity, mesh: TriangleMesh) -> Vec<f64> {
    if quantity.has_cosine() {
        (0..mesh.len()).map(|cell| mesh.projected_solid_angle(cell)).collect()
    } else {
        mesh.solid_angles()
    }
}

/// Solid angle, weighted by |cos θ| for surfaces, that each stated direction of a grid stands for.
fn weights_of_angles(quantity: Quantity, grid: &DirectionGrid) -> Vec<f64> {
    let (polar, around) = (polar_weights(quantity, grid), azimuth_weights(grid));
    polar.iter().flat_map(|polar| around.iter().map(move |around| polar * around)).collect()
}

/// Weights of polar angles: ∫ f sin θ dθ, or ∫ f sin θ |cos θ| dθ, of straight lines between them, f as at the ends beyond.
fn polar_weights(quantity: Quantity, grid: &DirectionGrid) -> Vec<f64> {
    let from_pole = if matches!(grid.frame(), Frame::TypeA | Frame::TypeB) { 90.0 } else { 0.0 };
    let angles: Vec<f64> = grid.polar().iter().map(|angle| (angle + from_pole).to_radians()).collect();
    let (low, high) = grid.covers();
    let [low, high] = [low, high].map(|angle| (angle + from_pole).to_radians());
    let mut weights = vec![0.0; angles.len()];
    let last = angles.len() - 1;
    weights[0] += zone(quantity, low, angles[0]).iter().sum::<f64>();
    weights[last] += zone(quantity, angles[last], high).iter().sum::<f64>();
    for k in 0..last {
        let [near, far] = zone(quantity, angles[k], angles[k + 1]);
        weights[k] += near;
        weights[k + 1] += far;
    }
    // Mirrored latitudes stand for both sides of the equator.
    let sides = if grid.is_polar_mirrored() { 2.0 } else { 1.0 };
    for weight in &mut weights {
        *weight *= sides;
    }
    weights
}

/// Weights of both ends of a zone from `a` to `b`, angles from a pole.
fn zone(quantity: Quantity, a: f64, b: f64) -> [f64; 2] {
    // ∫ sin u of the straight lines that are 1 at one end and 0 at the other.
    let of_sine = |a: f64, b: f64| {
        let slope = (libm::sin(b) - libm::sin(a)) / (b - a);
        [libm::cos(a) - slope, slope - libm::cos(b)]
    };
    if b <= a {
        [0.0, 0.0]
    } else if quantity.has_cosine() {
        // sin θ cos θ = ½ sin 2θ, u = 2θ. A zone across the horizon has about no weight.
        of_sine(2.0 * a, 2.0 * b).map(|weight| (0.25 * weight).abs())
    } else {
        of_sine(a, b)
    }
}

/// Weights of azimuths: half the angles to both neighbours, 2π in all but for sectors.
fn azimuth_weights(grid: &DirectionGrid) -> Vec<f64> {
    let Some(azimuths) = grid.azimuths() else { return vec![std::f64::consts::TAU] };
    let (angles, last) = (&azimuths.angles, azimuths.angles.len() - 1);
    let mut weights = vec![0.0; angles.len()];
    let mut add = |from: usize, to: usize, angle: f64| {
        weights[from] += 0.5 * angle.to_radians();
        weights[to] += 0.5 * angle.to_radians();
    };
    for k in 0..last {
        add(k, k + 1, angles[k + 1] - angles[k]);
    }
    if azimuths.extent == AzimuthExtent::Circle {
        add(last, 0, angles[0] + 360.0 - angles[last]);
    }
    let total: f64 = weights.iter().sum();
    if azimuths.extent != AzimuthExtent::Sector || total == 0.0 {
        let factor = std::f64::consts::TAU / total;
        let even = std::f64::consts::TAU / weights.len() as f64;
        for weight in &mut weights {
            *weight = if total > 0.0 { *weight * factor } else { even };
        }
    }
    weights
}

/// The step of the logarithm for a bound of the light's relative error; negative for samples with a sign, see [`shift`].
pub(crate) fn step_of(bound: f64, signed: bool) -> f32 {
    // Rounding to the nearest step leaves half a step; of positive samples alone, which are more than all.
    let part = if signed { -0.5 } else { 1.6 };
    (part * libm::log1p(bound)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Azimuths;

    #[test]
    fn steps_of_negative_samples_stay_integers_of_float32() {
        let negative = Negative { samples: vec![(1.0, 1.0), (2.0, 0.5)], largest: 2.0 };
        for step in [1e-3, 1e-9, 1e-300] {
            for wanted in [0.0, 1.5, 2.0, 1e9] {
                let k = negative.nearest(wanted, step);
                assert!(k.unsigned_abs() <= 1 << 24, "{step} {wanted}: {k}");
            }
        }
        let k = negative.nearest(3.0, 1e-4);
        assert!((negative.light(f64::from(k) * 1e-4) / 3.0 - 1.0).abs() < 1e-4);
    }

    #[test]
    fn weights_of_angles_are_those_of_the_sphere() {
        let every = |step: f64, count: usize| -> Vec<f64> { (0..count).map(|i| step * i as f64).collect() };
        let pi = std::f64::consts::PI;
        let grid = |frame, polar, azimuths: Option<(Vec<f64>, AzimuthExtent)>| {
            let azimuths = azimuths.map(|(angles, extent)| Azimuths { angles, extent });
            DirectionGrid::new(frame, polar, azimuths).unwrap()
        };
        for (quantity, grid, expected) in [
            (Quantity::Edf, grid(Frame::TypeC, every(10.0, 19), None), 4.0 * pi),
            (
                Quantity::Edf,
                grid(Frame::TypeC, every(10.0, 10), Some((every(22.5, 5), AzimuthExtent::Quadrant))),
                2.0 * pi,
            ),
            (
                Quantity::Edf,
                grid(Frame::TypeC, every(10.0, 19), Some((every(30.0, 13), AzimuthExtent::Closed))),
                4.0 * pi,
            ),
            (
                Quantity::Edf,
                grid(Frame::TypeB, every(10.0, 10), Some((every(60.0, 6), AzimuthExtent::Circle))).mirrored().unwrap(),
                4.0 * pi,
            ),
            (
                Quantity::Brdf,
                grid(Frame::Surface, vec![0.0, 7.0, 30.0, 90.0], Some((vec![5.0], AzimuthExtent::Circle))),
                pi,
            ),
            (
                Quantity::Edf,
                grid(Frame::Surface, every(30.0, 4), Some((vec![0.0, 45.0, 90.0], AzimuthExtent::Sector))),
                0.5 * pi,
            ),
        ] {
            let light = Light::of(quantity, &[Axis::Grid(grid.clone())]).unwrap();
            let found = light.sums(&vec![1.0; grid.len()])[0];
            assert!((found / expected - 1.0).abs() < 1e-12, "{} {found} {expected}", grid.describe());
        }
    }
}
