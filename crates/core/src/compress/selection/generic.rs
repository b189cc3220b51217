//! The paper's policies on a tensor: conventional, generic, adaptive (\[CPB06\] section 4.2), with automatic
//! thresholds.
//!
//! Transforming over the first axis turns the tensor into *generic coefficients*, functions of the remaining axes. Each
//! is then transformed over the next axis, and so on. A generic coefficient whose norm √⟨u, u⟩ is below the threshold
//! of its space is dropped, together with every coefficient derived from it. Dropping a function does not change the
//! others. All norms are therefore computed once, and a set of thresholds only needs comparisons.

use crate::domain::Axis;
use crate::transform::{AxisTransform, Plan, PlanError, Weights};
use rayon::prelude::*;

/// Rule for dropping transform coefficients below thresholds: one of three from the paper \[CPB06\].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Rule {
    /// One threshold on the final coefficients, those transformed along all axes.
    Conventional,
    /// One threshold for each axis, applied as soon as the tensor is transformed along it. A coefficient, then a
    /// function of the remaining axes, is dropped with all that derives from it if its norm is below the threshold.
    Generic,
    /// One threshold for each axis, applied as soon as the tensor is transformed along it, and multiplied by √d: d is
    /// the range (max − min) of the function that the transform turns into coefficients.
    ///
    /// Coefficients with smaller norms are dropped, with all that derives from them.
    Adaptive,
}

/// Coefficients of a tensor that is transformed along one axis after another. After each axis, coefficients are
/// functions of the remaining axes; the norms of these functions are kept for comparison with thresholds.
#[derive(Clone, Debug)]
pub struct GenericTransform {
    plan: Plan,
    coefficients: Vec<f32>,
    spaces: Vec<Space>,
    /// Square root of the range, √(max − min), of all samples of the tensor before any transform.
    spread: f32,
}

#[derive(Clone, Debug)]
struct Space {
    /// Norm of each coefficient after the transforms along this axis and all before it. Such a coefficient is a
    /// function of the axes not yet transformed, or a single number after the last axis.
    norms: Vec<f32>,
    /// Square root of the range, √(max − min), of each coefficient of the transform along this axis. The coefficient is
    /// a function of all later axes, over which the range is taken. Empty for the last axis, after which coefficients
    /// are numbers.
    spreads: Vec<f32>,
    /// Number of coefficients into which the transform along this axis turns each function of this and the later axes:
    /// one for each basis function of the axis.
    length: usize,
}

/// Result of a search for thresholds: the thresholds and the coefficients they keep.
#[derive(Clone, Debug, PartialEq)]
pub struct Search {
    /// Threshold on coefficients for each axis, outermost first; 0 drops nothing.
    pub thresholds: Vec<f64>,
    /// Number of transform coefficients that the thresholds keep.
    pub kept: usize,
    /// Error of the decoded samples, for example the relative RMS error; the caller of the threshold search supplies
    /// the measure.
    pub error: f64,
    /// All transform coefficients of the samples, with those that the thresholds drop set to 0.
    pub coefficients: Vec<f32>,
    /// Samples reconstructed from the kept coefficients.
    pub decoded: Vec<f32>,
}

/// Thresholds to try for an axis before the last, as multiples of the last axis's threshold. They span four decades,
/// because the norms of coefficients differ widely between axes.
const RATIOS: [f64; 8] = [1.0 / 16.0, 0.25, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0];
/// Factors on the best of the coarsely spaced ratios between an outer axis's threshold and that of the last axis. The
/// products are tried as finer ratios.
const REFINEMENTS: [f64; 2] = [0.5, 2.0];

impl GenericTransform {
    /// Transforms `samples` axis after axis, and computes the norms of the coefficients for a later choice by
    /// thresholds. If `normalised`, a coefficient is weighted by the norm of its synthesis function, with all samples
    /// weighted alike; otherwise it is not weighted.
    pub fn new(
        axes: &[Axis],
        transforms: &[AxisTransform],
        samples: &[f32],
        normalised: bool,
    ) -> Result<Self, PlanError> {
        let plan = Plan::new(axes, transforms)?;
        let mut coefficients = samples.to_vec();
        let spread = spread(&coefficients);
        let mut spaces = Vec::with_capacity(axes.len());
        let mut scales = vec![1.0_f64];
        for (a, axis) in axes.iter().enumerate() {
            let only: Vec<AxisTransform> = transforms
                .iter()
                .enumerate()
                .map(|(b, &transform)| if b == a { transform } else { AxisTransform::Identity })
                .collect();
            Plan::new(axes, &only)?.forward(&mut coefficients);
            let norms = if normalised { plan.norms(a, Weights::Count) } else { vec![1.0; axis.len()] };
            scales = scales.iter().flat_map(|scale| norms.iter().map(move |norm| scale * norm)).collect();
            spaces.push(Space::new(&coefficients, &scales, axis.len(), a + 1 == axes.len()));
        }
        Ok(Self { plan, coefficients, spaces, spread })
    }

    /// Returns the coefficients of the samples after the transforms along all axes, in the order of the transform plan.
    pub fn coefficients(&self) -> &[f32] {
        &self.coefficients
    }

    /// Returns the transforms along all axes that turn the samples into these coefficients.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Returns the coefficients that `thresholds` (one for each axis) keep, with the others set to 0, and the number of
    /// kept ones.
    ///
    /// # Panics
    /// If the number of thresholds is not the number of spaces.
    pub fn select(&self, thresholds: &[f64], rule: Rule) -> (Vec<f32>, usize) {
        let critical = self.critical(thresholds, rule);
        self.keep(|i| critical[i] > 1.0)
    }

    /// Finds the thresholds, one for each axis, that keep at most `count` coefficients with the least error, as `judge`
    /// measures it on the decoded samples. The search starts from one threshold on the last axis, and adds those of
    /// other axes.
    ///
    /// With `Rule::Generic` the result is no worse than with `Rule::Conventional`. With `Rule::Adaptive` it may be,
    /// because each threshold is multiplied by the root of a function's range.
    pub fn search_count(&self, count: usize, rule: Rule, judge: &(dyn Fn(&[f32]) -> f64 + Sync)) -> Search {
        let last = self.spaces.len() - 1;
        let mut ratios = vec![0.0; self.spaces.len()];
        ratios[last] = 1.0;
        let mut best = self.at_count(count, &ratios, rule, judge);
        if rule == Rule::Conventional {
            return best;
        }
        for a in (0..last).rev() {
            let mut chosen = 0.0;
            let mut attempt = |ratio: f64, chosen: &mut f64| {
                ratios[a] = ratio;
                let found = self.at_count(count, &ratios, rule, judge);
                if found.error < best.error {
                    best = found;
                    *chosen = ratio;
                }
            };
            for ratio in RATIOS {
                attempt(ratio, &mut chosen);
            }
            let coarse = chosen;
            if coarse > 0.0 {
                for refinement in REFINEMENTS {
                    attempt(coarse * refinement, &mut chosen);
                }
            }
            ratios[a] = chosen;
        }
        best
    }

    /// Finds the thresholds that keep the fewest coefficients with an error, as `judge` measures it, of at most
    /// `error`. `None` if even all coefficients do not reach it. Assumes that the error falls as coefficients are
    /// added.
    pub fn search_error(&self, error: f64, rule: Rule, judge: &(dyn Fn(&[f32]) -> f64 + Sync)) -> Option<Search> {
        let (mut low, mut high) = (0, self.coefficients.len());
        let mut best = Some(self.search_count(high, rule, judge)).filter(|found| found.error <= error)?;
        while high - low > 1.max(high / 256) {
            let middle = if low == 0 {
                (high / 8).max(1)
            } else {
                ((low as f64 * high as f64).sqrt() as usize).clamp(low + 1, high - 1)
            };
            let found = self.search_count(middle, rule, judge);
            if found.error <= error {
                (best, high) = (found, middle);
            } else {
                low = middle;
            }
            if high <= 1 {
                break;
            }
        }
        Some(best)
    }

    fn at_count(&self, count: usize, ratios: &[f64], rule: Rule, judge: &(dyn Fn(&[f32]) -> f64 + Sync)) -> Search {
        let critical = self.critical(ratios, rule);
        let threshold = threshold_of(&critical, count);
        let (coefficients, kept) = self.keep(|i| critical[i] > threshold);
        let mut decoded = coefficients.clone();
        self.plan.inverse(&mut decoded);
        let thresholds = ratios.iter().map(|ratio| if *ratio == 0.0 { 0.0 } else { ratio * f64::from(threshold) });
        Search { thresholds: thresholds.collect(), kept, error: judge(&decoded), coefficients, decoded }
    }

    fn keep(&self, keeps: impl Fn(usize) -> bool) -> (Vec<f32>, usize) {
        let mut kept = 0;
        let selected = self.coefficients.iter().enumerate().map(|(i, &c)| {
            if keeps(i) {
                kept += 1;
                c
            } else {
                0.0
            }
        });
        let selected = selected.collect();
        (selected, kept)
    }

    /// Computes, for each coefficient of the complete transform, the largest factor c for which the thresholds c ·
    /// `ratios`, one for each axis, keep it.
    ///
    /// A larger factor drops it: its norm, or that of a coefficient from which it was computed along a later axis,
    /// falls below the threshold.
    fn critical(&self, ratios: &[f64], rule: Rule) -> Vec<f32> {
        assert_eq!(ratios.len(), self.spaces.len(), "one threshold a space");
        let mut outer = vec![f32::INFINITY];
        let mut spreads: &[f32] = std::slice::from_ref(&self.spread);
        for (space, &ratio) in self.spaces.iter().zip(ratios) {
            let mut critical = vec![0.0_f32; space.norms.len()];
            let rows = critical.par_chunks_mut(space.length).zip(space.norms.par_chunks(space.length)).enumerate();
            rows.with_min_len(64).for_each(|(function, (critical, norms))| {
                let local = if rule == Rule::Adaptive { ratio as f32 * spreads[function] } else { ratio as f32 };
                for (critical, &norm) in critical.iter_mut().zip(norms) {
                    let own = if local > 0.0 { norm / local } else { f32::INFINITY };
                    *critical = if norm > 0.0 { own.min(outer[function]) } else { 0.0 };
                }
            });
            outer = critical;
            spreads = &space.spreads;
        }
        outer
    }
}

impl Space {
    fn new(coefficients: &[f32], scales: &[f64], length: usize, last: bool) -> Self {
        let inner = coefficients.len() / scales.len();
        let rows = || coefficients.par_chunks(inner).zip(scales).with_min_len(64);
        let norm = |(row, &scale): (&[f32], &f64)| {
            let square: f64 = row.iter().map(|&c| f64::from(c) * f64::from(c)).sum();
            (square.sqrt() * scale) as f32
        };
        let norms = rows().map(norm).collect();
        let spreads =
            if last { Vec::new() } else { rows().map(|(row, &scale)| spread(row) * scale.sqrt() as f32).collect() };
        Self { norms, spreads, length }
    }
}

/// Square root of the range, √(max − min), of the values in `row`, a function of the axes that are not yet transformed.
/// Adaptive selection of coefficients multiplies its thresholds by it.
fn spread(row: &[f32]) -> f32 {
    let (low, high) = row.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &c| (l.min(c), h.max(c)));
    (high - low).max(0.0).sqrt()
}

/// Returns a threshold above which `count` of the values lie, fewer if the next ones are equal. It is half way between
/// two neighbouring values, and 0 if all are to lie above it.
fn threshold_of(values: &[f32], count: usize) -> f32 {
    if count >= values.len() {
        return 0.0;
    }
    let mut sorted = values.to_vec();
    let (above, &mut below, _) = sorted.select_nth_unstable_by(count, |a, b| b.total_cmp(a));
    let least = above.iter().copied().fold(f32::INFINITY, f32::min);
    let middle = below + 0.5 * (least - below);
    if middle.is_finite() { middle } else { below.min(f32::MAX) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Domain, ErrorReport, TriangleMesh, WavelengthGrid};
    use crate::transform::{LineBasis, SphereBasis};

    fn setup(normalised: bool) -> (GenericTransform, Vec<f32>) {
        let mesh = |level| Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, level).unwrap());
        let axes = [mesh(1), mesh(2), Axis::Index { count: 19, labels: Vec::new() }];
        let samples: Vec<f32> = (0..16 * 64 * 19)
            .map(|i| {
                let (a, b, c) = (i / (64 * 19), i / 19 % 64, i % 19);
                let peak = if (b + 4 * a) % 61 < 3 { 30.0 } else { 0.0 };
                1.0 + 0.3 * ((a * b) as f32 * 0.1).sin() + 0.1 * (c as f32 * 0.7).cos() + peak
            })
            .collect();
        let sphere = AxisTransform::Sphere(SphereBasis::BioHaar);
        let transforms = [sphere, sphere, AxisTransform::line(LineBasis::BIOR44)];
        (GenericTransform::new(&axes, &transforms, &samples, normalised).unwrap(), samples)
    }

    fn er(samples: &[f32]) -> impl Fn(&[f32]) -> f64 + Sync {
        move |decoded| ErrorReport::measure(samples, decoded, 0.0).er_l2
    }

    /// Applies the generic or adaptive rule of \[CPB06\] literally, for comparison: if the coefficient after one axis
    /// is below its threshold, all coefficients that derive from it by transforms along later axes are set to 0.
    fn by_the_letter(t: &GenericTransform, thresholds: &[f64], adaptive: bool) -> Vec<f32> {
        let (n1, n2) = (64, 19);
        let mut kept = t.coefficients.clone();
        for i in 0..16 {
            let root = if adaptive { t.spread } else { 1.0 };
            let dead = t.spaces[0].norms[i] < thresholds[0] as f32 * root;
            for j in 0..n1 {
                let local = if adaptive { t.spaces[0].spreads[i] } else { 1.0 };
                let dead = dead || t.spaces[1].norms[i * n1 + j] < thresholds[1] as f32 * local;
                for k in 0..n2 {
                    let at = (i * n1 + j) * n2 + k;
                    let local = if adaptive { t.spaces[1].spreads[i * n1 + j] } else { 1.0 };
                    if dead || t.spaces[2].norms[at] < thresholds[2] as f32 * local {
                        kept[at] = 0.0;
                    }
                }
            }
        }
        kept
    }

    #[test]
    fn selection_is_that_of_the_paper() {
        for normalised in [false, true] {
            let (t, _) = setup(normalised);
            for thresholds in [[0.0, 0.0, 0.2], [3.0, 1.0, 0.5], [20.0, 0.0, 0.0]] {
                for (rule, adaptive) in [(Rule::Generic, false), (Rule::Adaptive, true)] {
                    let (found, kept) = t.select(&thresholds, rule);
                    let expected = by_the_letter(&t, &thresholds, adaptive);
                    let differing = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
                    // A norm equal to the threshold may fall on either side by rounding.
                    assert!(differing <= 1, "{thresholds:?} {rule:?}: {differing}");
                    assert!(kept > 0 && kept < found.len());
                }
            }
        }
    }

    #[test]
    fn searches_keep_to_their_count_and_generic_ones_are_no_worse() {
        for normalised in [false, true] {
            let (t, samples) = setup(normalised);
            for count in [200, 1000, 5000] {
                let conventional = t.search_count(count, Rule::Conventional, &er(&samples));
                let generic = t.search_count(count, Rule::Generic, &er(&samples));
                let adaptive = t.search_count(count, Rule::Adaptive, &er(&samples));
                assert!(generic.error <= conventional.error);
                for found in [&conventional, &generic, &adaptive] {
                    // Functions are kept or dropped whole, so a generic count may fall short.
                    assert!(found.kept <= count && found.kept > count / 2, "{} of {count}", found.kept);
                }
                let (mut again, _) = t.select(&generic.thresholds, Rule::Generic);
                t.plan().inverse(&mut again);
                assert!((er(&samples)(&again) - generic.error).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn a_wanted_error_is_met_with_few_coefficients() {
        let (t, samples) = setup(true);
        let found = t.search_error(0.05, Rule::Generic, &er(&samples)).unwrap();
        assert!(found.error <= 0.05 && found.kept < samples.len() / 2);
        let fewer = t.search_count(found.kept * 9 / 10, Rule::Generic, &er(&samples));
        assert!(fewer.error > 0.05);
        assert!(t.search_error(-1.0, Rule::Conventional, &er(&samples)).is_none());
    }

    #[test]
    fn a_search_ends_where_two_coefficients_are_enough_and_one_is_not() {
        let axes = [Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, 16).unwrap())];
        let samples: Vec<f32> = (0..16).map(|i| if i < 8 { 1.0 } else { 2.0 }).collect();
        let t = GenericTransform::new(&axes, &[AxisTransform::line(LineBasis::HAAR)], &samples, true).unwrap();
        for rule in [Rule::Conventional, Rule::Generic, Rule::Adaptive] {
            let found = t.search_error(0.05, rule, &er(&samples)).unwrap();
            assert!(found.error <= 0.05 && found.kept == 2, "{rule:?}: {}", found.kept);
        }
    }

    #[test]
    fn normalised_conventional_thresholds_rank_by_norm() {
        let (t, _) = setup(true);
        let norms = &t.spaces[2].norms;
        let (_, kept) = t.select(&[0.0, 0.0, 0.3], Rule::Conventional);
        assert_eq!(kept, norms.iter().filter(|&&n| n / 0.3 > 1.0).count());
    }
}
