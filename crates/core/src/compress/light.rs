//! Light that leaves each block of directions, at each wavelength: directional albedo, flux, or a phase function's
//! integral.
//!
//! The light is Σ sample · weight over the last axis of directions. The weight of a triangle is its solid angle,
//! projected for quantities that go with a cosine. Weights of a grid of angles integrate straight lines between polar
//! angles, and are trapezoids around the pole. A block is one entry of all axes before the directions. Masked samples
//! are skipped.

use crate::codec::Class;
use crate::domain::{Axis, AzimuthExtent, DirectionGrid, Frame, Quantity, TriangleMesh};
use crate::numeric::wide;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

/// Deviation of the decoded file's light (directional albedo, flux) from the measurement's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct LightReport {
    /// Largest relative error of the light (directional albedo, flux) over incoming directions and wavelengths that
    /// have light.
    pub largest: f64,
    /// Root mean square of the relative error of the light (albedo, flux) over incoming directions and wavelengths that
    /// have light.
    pub rms: f64,
    /// Largest light (directional albedo, flux) of an incoming direction in the measurement; a value above 1 cannot be
    /// an albedo.
    pub brightest: f64,
}

/// Weights for integrating samples over the last axis of directions.
pub(crate) struct Light {
    weights: Vec<f64>,
    inner: usize,
}

impl Light {
    /// Computes the integration weights of the last axis of directions; `None` without directions.
    pub(crate) fn of(quantity: Quantity, axes: &[Axis]) -> Option<Self> {
        let at = axes.iter().rposition(|axis| matches!(axis, Axis::Triangles(_) | Axis::Grid(_)))?;
        let weights = match &axes[at] {
            Axis::Triangles(mesh) => weights(quantity, *mesh),
            Axis::Grid(grid) => weights_of_angles(quantity, grid),
            _ => return None,
        };
        Some(Self { weights, inner: axes[at + 1..].iter().map(Axis::len).product() })
    }

    /// Number of entries of all axes behind the directions, usually wavelengths.
    pub(crate) fn inner(&self) -> usize {
        self.inner
    }

    /// Number of integrals of samples over the outgoing directions, one for each incoming direction and wavelength, in
    /// a tensor of `samples` samples.
    pub(crate) fn entries(&self, samples: usize) -> usize {
        samples / self.weights.len()
    }

    /// Integrates the samples over the last axis of directions, weighted by solid angle (projected for quantities that
    /// go with a cosine). Returns the light (albedo, flux) `[incoming direction, wavelength]`. Masked samples count as
    /// 0.
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

    /// Corrects the light (albedo, flux): adds to the natural logarithms of the samples the number of correction steps
    /// that `steps` holds for their incoming direction and wavelength. `how` gives the size of a step.
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

    /// Computes corrections of the light (albedo, flux) for each incoming direction and wavelength: numbers of steps,
    /// each `step` in the samples' natural logarithms. They bring the relative error of the light of `decoded` down to
    /// `bound`.
    ///
    /// A correction is 0 where that error is within 0.9 · `bound` already.
    ///
    /// With a negative step, the negative samples of a block take the correction if they can, because their errors are
    /// not bounded. Otherwise the positive samples take it.
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

    /// Integration weights and magnitudes of the negative samples of one incoming direction and wavelength.
    fn negative_of(&self, entry: usize, samples: &[f32]) -> Vec<(f64, f64)> {
        let first = entry / self.inner * self.weights.len() * self.inner + entry % self.inner;
        let own = samples[first..].iter().step_by(self.inner).zip(&self.weights);
        own.filter(|(sample, _)| **sample < 0.0).map(|(&sample, &weight)| (weight, f64::from(-sample))).collect()
    }
}

/// Rule by which decoded samples are changed so that the total light (directional albedo, flux) keeps its bound: step
/// of the corrections of the samples' natural logarithms, and treatment of negative samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Correcting<'a> {
    /// Step of the corrections to the light (albedo, flux), which are added to natural logarithms of samples.
    ///
    /// If it is negative, its magnitude counts, and the lowest bit of a correction tells if negative samples take it
    /// (1) or all others (0).
    step: f32,
    /// Class (positive, negative, zero or masked) of each sample on a grid of angles; `None` if corrections of the
    /// light (albedo, flux) are added to positive and negative samples alike.
    ///
    /// With classes and a positive step, corrections leave negative samples unchanged.
    classes: Option<&'a [Class]>,
    /// Largest natural logarithm of a negative sample's magnitude that a decoder produces; a corrected sample with a
    /// larger one is decoded as this.
    bound: f32,
}

impl<'a> Correcting<'a> {
    /// Builds the rule for corrections to the light (albedo, flux). `classes` tells which samples are negative, and
    /// `bound` is the largest natural logarithm of a negative sample's magnitude.
    ///
    /// Without `bound`, `classes` is ignored, and positive and negative samples take the same corrections.
    pub(crate) fn new(step: f32, classes: Option<&'a [Class]>, bound: Option<f32>) -> Self {
        Self { step, classes: classes.filter(|_| bound.is_some()), bound: bound.unwrap_or(f32::MAX) }
    }
}

/// Negative samples of one incoming direction and wavelength: integration weights and magnitudes, and the largest
/// magnitude that a decoder produces.
struct Negative {
    samples: Vec<(f64, f64)>,
    largest: f64,
}

impl Negative {
    /// Total light of the negative samples, as a positive number, after `shift` is added to the natural logarithms of
    /// their magnitudes: the sum of weight · magnitude, with (projected) solid angles as weights. No magnitude exceeds
    /// the largest that a decoder produces.
    fn light(&self, shift: f64) -> f64 {
        let factor = libm::exp(shift);
        self.samples.iter().map(|(weight, size)| weight * (factor * size).min(self.largest)).sum()
    }

    /// Largest integer k such that the total light of the negative samples, as a positive number, is at most `wanted`
    /// after k · `step` is added to the natural logarithms of their magnitudes.
    ///
    /// Only integers that float32 holds exactly are considered.
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

/// Fraction of the allowed relative error of the light (albedo, flux) up to which decoded samples are not corrected.
/// The remainder allows for rounding.
const NEAR: f64 = 0.9;
/// Ratio of the step in which logarithms of non-negative samples are corrected to that for negative samples, to keep
/// the light (albedo, flux). Negative samples need finer steps, because the light may be a small difference of two
/// large sums.
const PARTS: f64 = 16.0;
/// Largest change of the natural logarithm of a negative sample's magnitude that corrects the light (albedo, flux). A
/// decrease by it makes the sample negligible; an increase takes the magnitude to the largest that a decoder produces.
const MOST_SHIFT: f64 = 20.0;
/// Upper bound on the number of correction steps added to the logarithm of a negative sample's magnitude to correct the
/// light (albedo, flux). Float32 holds every integer up to it.
const MOST_STEPS: f64 = (1 << 24) as f64;

/// Decodes the integer `k` of a correction that keeps the light (albedo, flux). Returns true if it applies to samples
/// marked as negative, false if to the others, and the change of their natural logarithms. The sign of `step` selects
/// the rule: with `step` ≥ 0, k changes the others by k · `step`.
///
/// With `step` < 0, an even k changes the others by k/2 · |`step`|, and an odd k changes negative samples by (k − 1)/2
/// · |`step`| / 16.
fn shift(step: f32, k: i32) -> (bool, f32) {
    match (step < 0.0, k & 1) {
        (false, _) => (false, k as f32 * step),
        (true, 0) => (false, (k >> 1) as f32 * -step),
        (true, _) => (true, (k >> 1) as f32 * (-step / PARTS as f32)),
    }
}

/// Integration weight of each triangle of a mesh: its solid angle, projected for quantities that go with a cosine.
pub(crate) fn weights(quantity: Quantity, mesh: TriangleMesh) -> Vec<f64> {
    if quantity.has_cosine() {
        (0..mesh.len()).map(|cell| mesh.projected_solid_angle(cell)).collect()
    } else {
        mesh.solid_angles()
    }
}

/// Zone of a grid that leaves out none of its polar angles.
pub(crate) const EVERYWHERE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// Solid angle that each measured direction of a grid represents, weighted by |cos θ| for surfaces.
pub(crate) fn weights_of_angles(quantity: Quantity, grid: &DirectionGrid) -> Vec<f64> {
    weights_of_zone(quantity, grid, EVERYWHERE)
}

/// Solid angle that each measured direction of a grid represents between two polar angles in degrees, `within`,
/// weighted by |cos θ| for surfaces. The weights of adjoining zones add up to those of [`weights_of_angles`].
pub(crate) fn weights_of_zone(quantity: Quantity, grid: &DirectionGrid, within: (f64, f64)) -> Vec<f64> {
    let (polar, around) = (polar_weights(quantity, grid, within), azimuth_weights(grid));
    polar.iter().flat_map(|polar| around.iter().map(move |around| polar * around)).collect()
}

/// Integration weights of the polar angles of a grid: ∫ f sin θ dθ, or ∫ f sin θ |cos θ| dθ, over the polar angles
/// `within` (degrees), with f linear between the grid's angles and constant beyond the ends.
pub(crate) fn polar_weights(quantity: Quantity, grid: &DirectionGrid, within: (f64, f64)) -> Vec<f64> {
    let from_pole = if matches!(grid.frame(), Frame::TypeA | Frame::TypeB) { 90.0 } else { 0.0 };
    let angles: Vec<f64> = grid.polar().iter().map(|angle| (angle + from_pole).to_radians()).collect();
    let (low, high) = grid.covers();
    let [low, high] = [low, high].map(|angle| (angle + from_pole).to_radians());
    let [from, to] = [within.0, within.1].map(|angle| (angle + from_pole).to_radians());
    // Weights of the values at `a` and `b` in the part of the zone between them that is integrated.
    let part = |a: f64, b: f64| {
        let (first, last) = (a.max(from), b.min(to));
        if last <= first {
            return [0.0, 0.0];
        }
        let [near, far] = zone(quantity, first, last);
        let [start, end] = [first, last].map(|at| (at - a) / (b - a));
        [near * (1.0 - start) + far * (1.0 - end), near * start + far * end]
    };
    let mut weights = vec![0.0; angles.len()];
    let last = angles.len() - 1;
    weights[0] += part(low, angles[0]).iter().sum::<f64>();
    weights[last] += part(angles[last], high).iter().sum::<f64>();
    for k in 0..last {
        let (a, b) = (angles[k], angles[k + 1]);
        // Each side of a surface ends at the horizon, as far as which its last value holds.
        let [near, far] = if quantity.has_cosine() && a <= FRAC_PI_2 && FRAC_PI_2 < b {
            [part(a, FRAC_PI_2), part(FRAC_PI_2, b)].map(|[near, far]| near + far)
        } else {
            part(a, b)
        };
        weights[k] += near;
        weights[k + 1] += far;
    }
    // Mirrored latitudes represent both sides of the equator.
    let sides = if grid.is_polar_mirrored() { 2.0 } else { 1.0 };
    for weight in &mut weights {
        *weight *= sides;
    }
    weights
}

/// Weights of the values at the polar angles `a` and `b`, both in radians from a pole, in an integral over the zone of
/// the sphere between them.
fn zone(quantity: Quantity, a: f64, b: f64) -> [f64; 2] {
    // ∫ sin u of the straight lines that are 1 at one end and 0 at the other.
    let of_sine = |a: f64, b: f64| {
        let slope = (libm::sin(b) - libm::sin(a)) / (b - a);
        [libm::cos(a) - slope, slope - libm::cos(b)]
    };
    if b <= a {
        [0.0, 0.0]
    } else if quantity.has_cosine() {
        // sin θ cos θ = ½ sin 2θ, u = 2θ.
        of_sine(2.0 * a, 2.0 * b).map(|weight| (0.25 * weight).abs())
    } else {
        of_sine(a, b)
    }
}

/// Integration weights of azimuths in radians: half the angles to both neighbours, 2π in total except for sectors.
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

/// Step of the amounts added to the logarithms of samples to keep the relative error of the light (albedo, flux) within
/// `bound`. It carries a minus sign, as a flag, if negative samples may take a different amount from the rest.
pub(crate) fn step_of(bound: f64, signed: bool) -> f32 {
    // Rounding to the nearest step leaves an error of half a step. The signed factor is smaller: positive light alone
    // exceeds the total.
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

    #[test]
    fn zones_add_up_to_the_sphere() {
        let azimuths = Some(Azimuths { angles: vec![0.0, 45.0, 90.0], extent: AzimuthExtent::Quadrant });
        let grid = DirectionGrid::new(Frame::TypeC, vec![0.0, 7.5, 50.0, 95.0, 160.0], azimuths).unwrap();
        let grid = grid.covering(0.0, 180.0).unwrap();
        let whole = weights_of_angles(Quantity::Edf, &grid);
        let borders = [0.0, 30.0, 40.0, 60.0, 90.0, 120.0, 180.0];
        let mut sums = vec![0.0; grid.len()];
        for [low, high] in borders.array_windows() {
            let zone = weights_of_zone(Quantity::Edf, &grid, (*low, *high));
            sums.iter_mut().zip(&zone).for_each(|(sum, weight)| *sum += weight);
            let solid_angle = 2.0 * std::f64::consts::PI * (low.to_radians().cos() - high.to_radians().cos());
            assert!((zone.iter().sum::<f64>() / solid_angle - 1.0).abs() < 1e-12, "{low} {high}");
        }
        assert!(sums.iter().zip(&whole).all(|(sum, whole)| (sum - whole).abs() < 1e-12), "{sums:?} {whole:?}");
    }
}
