//! Directions for which a measurement states several values, and the errors of the mean of these values.
//!
//! A file may state a value for every azimuth of a pole, or for 0° and 360°. Decoding keeps each of them, evaluation
//! returns their mean. The mean of values whose relative errors are within a bound may still be outside it, because
//! larger values weigh more in it.

use super::axis::Axis;
use super::direction_grid::DirectionGrid;
use super::tensor::Tensor;
use super::totals::Totals;
use std::ops::Range;

/// Smallest mean of the values of one direction, as a fraction of the mean of their magnitudes, that has a relative
/// error. Values of both signs whose mean is smaller cancel. Lowering it makes files larger that have such values.
const CANCELS: f64 = 0.5;

/// Largest number of samples for which these directions are looked for, so that a sample number has 32 bits.
const MOST: usize = u32::MAX as usize;

/// Directions (or pairs of incoming and outgoing ones) for which a measurement states several values that differ. Their
/// mean has a relative error if it is above 0 and not below the floor, the smallest sample whose relative error counts.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Restated {
    /// Numbers of the samples, direction by direction.
    samples: Vec<u32>,
    /// For each direction, the end of its samples in the list above, and their mean; `None` if values of both signs
    /// cancel.
    directions: Vec<(u32, Option<f64>)>,
    /// Largest ratio of the mean magnitude of a direction's values to their mean: 1 if none is negative.
    amplification: f64,
    /// Smallest mean that has a relative error if it is above 0.
    floor: f64,
    /// Number of samples at directions whose values, of both signs, nearly cancel.
    cancelling: u64,
}

/// Errors of the means of the values of each direction, compared with the errors of the values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct MeanErrors {
    /// Totals over the means, each as often as its direction is stated, less those over the values themselves. Added to
    /// the totals over all samples, they give the errors of evaluation at the samples.
    pub(crate) instead: Totals,
    /// Largest relative error of a mean.
    pub(crate) largest: f64,
}

impl MeanErrors {
    /// Returns the larger one of a measure of error of the samples, whose totals are given, and of their means.
    pub(crate) fn larger(&self, samples: &Totals, figure: impl Fn(&Totals) -> f64) -> f64 {
        figure(samples).max(figure(&(*samples + self.instead)))
    }
}

impl Restated {
    /// Finds the directions of a table with the given axes that have several values which differ. `floor` is the
    /// smallest sample whose relative error counts.
    pub(crate) fn of(axes: &[Axis], samples: &[f32], floor: f64) -> Self {
        let mut found = Self { amplification: 1.0, floor, ..Self::default() };
        let Some(first) = axes.iter().position(|axis| matches!(axis, Axis::Grid(_))) else { return found };
        if samples.len() > MOST {
            return found;
        }
        let grids = axes[first..].iter().take_while(|axis| matches!(axis, Axis::Grid(_))).count();
        let [incoming, outgoing] = match &axes[first..first + grids] {
            [Axis::Grid(incoming), Axis::Grid(outgoing)] => [Some(incoming), Some(outgoing)],
            [Axis::Grid(only)] => [None, Some(only)],
            _ => return found,
        };
        let [incoming, outgoing] = [incoming, outgoing].map(|grid| grid.map_or_else(Entries::one, Entries::of));
        let inner: usize = axes[first + grids..].iter().map(Axis::len).product();
        let block = incoming.count * outgoing.count * inner;
        for start in (0..samples.len()).step_by(block.max(1)) {
            for (i, from) in incoming.directions.iter().enumerate() {
                let is_single = i >= incoming.shared;
                let to = if is_single { &outgoing.directions[..outgoing.shared] } else { &outgoing.directions[..] };
                for (to, lane) in to.iter().flat_map(|to| (0..inner).map(move |lane| (to, lane))) {
                    let pairs = from.iter().flat_map(|i| to.iter().map(move |o| (*i as usize, *o as usize)));
                    let places = pairs.map(|(i, o)| start + (i * outgoing.count + o) * inner + lane);
                    found.add(places, samples);
                }
            }
        }
        found
    }

    /// Adds the samples `places` of one direction if they differ.
    fn add(&mut self, places: impl Iterator<Item = usize> + Clone, samples: &[f32]) {
        let known = places.filter(|&at| !samples[at].is_nan());
        let mut all = known.clone().map(|at| f64::from(samples[at]));
        let Some(first) = all.next() else { return };
        let start = (first, first.abs(), 1_u64, true);
        let (sum, size, count, is_one) = all.fold(start, |(sum, size, count, is_one), s| {
            (sum + s, size + s.abs(), count + 1, is_one && s.to_bits() == first.to_bits())
        });
        if is_one {
            return;
        }
        let mean = sum / count as f64;
        let cancels = sum.abs() < CANCELS * size;
        if cancels {
            self.cancelling += count;
        } else if self.is_scored(mean) {
            self.amplification = self.amplification.max(size / sum);
        }
        self.samples.extend(known.map(|at| at as u32));
        self.directions.push((self.samples.len() as u32, Some(mean).filter(|_| !cancels)));
    }

    fn is_scored(&self, mean: f64) -> bool {
        mean > 0.0 && mean >= self.floor
    }

    /// Largest ratio of the mean magnitude of the values of a direction to their mean. It is how much larger the
    /// relative error of the mean may be than the largest one of the values: 1 if no value is negative.
    pub(crate) fn amplification(&self) -> f64 {
        self.amplification
    }

    /// Numbers of the samples whose mean has a relative error, in no particular order.
    pub(crate) fn samples(&self) -> impl Iterator<Item = usize> + '_ {
        let scored = self.ranges().filter(|(_, mean)| mean.is_some_and(|mean| self.is_scored(mean)));
        scored.flat_map(|(range, _)| &self.samples[range]).map(|&at| at as usize)
    }

    /// Returns the errors of the means of decoded values. `decoded` gives the decoded value of a sample by its number.
    pub(crate) fn errors(&self, original: &[f32], decoded: impl Fn(usize) -> f32) -> MeanErrors {
        let mut errors = MeanErrors::default();
        let (mut means, mut singles) = (Totals::default(), Totals::default());
        for (range, mean) in self.ranges() {
            let places = &self.samples[range];
            let count = places.len() as f64;
            let mut sum = 0.0;
            for &at in places {
                let (s, d) = (f64::from(original[at as usize]), f64::from(decoded(at as usize)));
                let absolute = (d - s).abs();
                sum += d;
                // Values that cancel have no mean to take their place.
                if mean.is_some() {
                    singles.squared += absolute * absolute;
                    singles.signal += s * s;
                }
                if self.is_scored(s) {
                    let relative = absolute / s;
                    singles.scored += 1.0;
                    singles.relative += relative;
                    singles.relative_squared += relative * relative;
                }
            }
            let Some(mean) = mean else { continue };
            let absolute = (sum / count - mean).abs();
            means.squared += count * absolute * absolute;
            means.signal += count * mean * mean;
            if self.is_scored(mean) {
                let relative = absolute / mean;
                means.scored += count;
                means.relative += count * relative;
                means.relative_squared += count * relative * relative;
                errors.largest = errors.largest.max(relative);
            }
        }
        errors.instead = means - singles;
        errors
    }

    /// Ranges of the samples of each direction in the list of samples, with their mean.
    fn ranges(&self) -> impl Iterator<Item = (Range<usize>, Option<f64>)> + '_ {
        let starts = [0].into_iter().chain(self.directions.iter().map(|(end, _)| *end));
        starts.zip(&self.directions).map(|(start, &(end, mean))| (start as usize..end as usize, mean))
    }
}

/// Returns the number of samples at directions whose values, of both signs, cancel to less than half their mean
/// magnitude. No error is promised of the mean of such values, which evaluation returns.
pub fn cancelling_samples(tensor: &Tensor) -> u64 {
    Restated::of(tensor.axes(), tensor.samples(), 0.0).cancelling
}

/// Entries of an axis, direction by direction.
struct Entries {
    /// First the directions with several entries, then those with one.
    directions: Vec<Vec<u32>>,
    /// Number of directions with several entries.
    shared: usize,
    count: usize,
}

impl Entries {
    /// Axis of a single entry, for tables without one.
    fn one() -> Self {
        Self { directions: vec![vec![0]], shared: 0, count: 1 }
    }

    fn of(grid: &DirectionGrid) -> Self {
        let mut directions = grid.coinciding();
        let shared = directions.len();
        let mut is_shared = vec![false; grid.len()];
        directions.iter().flatten().for_each(|&entry| is_shared[entry as usize] = true);
        directions.extend((0..grid.len()).filter(|&entry| !is_shared[entry]).map(|entry| vec![entry as u32]));
        Self { directions, shared, count: grid.len() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{AzimuthExtent, Azimuths, ErrorReport, Frame};

    fn closed(frame: Frame, polar: &[f64]) -> Axis {
        let azimuths = Azimuths { angles: vec![0.0, 120.0, 360.0], extent: AzimuthExtent::Closed };
        Axis::Grid(DirectionGrid::new(frame, polar.to_vec(), Some(azimuths)).unwrap())
    }

    #[test]
    fn the_mean_of_a_pole_may_be_further_off_than_its_values() {
        let axes = [closed(Frame::TypeC, &[0.0, 45.0])];
        // One value of the pole outweighs the others, and it alone is wrong. The seam agrees.
        let original = [100.0, 1.0, 1.0, 5.0, 6.0, 5.0];
        let decoded = [110.0, 1.0, 1.0, 5.0, 6.0, 5.0];
        let restated = Restated::of(&axes, &original, 0.0);
        assert_eq!((restated.ranges().count(), restated.amplification()), (1, 1.0));
        let singles = ErrorReport::measure(&original, &decoded, 0.0);
        let both = ErrorReport::at_directions(&axes, &original, &decoded, 0.0);
        let mean = (112.0_f64 / 3.0) / 34.0 - 1.0;
        let wanted = f64::sqrt(3.0 * mean * mean / 6.0);
        assert!((both.er_l2 - wanted).abs() < 1e-12 && both.er_l2 > 1.5 * singles.er_l2, "{both:?} {singles:?}");
        assert!((both.er_l1 - mean / 2.0).abs() < 1e-12, "{both:?}");
        assert_eq!((both.max_relative_error, both.scored_samples), (singles.max_relative_error, 6));
    }

    #[test]
    fn values_that_agree_change_nothing() {
        let axes = [closed(Frame::TypeC, &[0.0, 45.0, 90.0])];
        let original = [2.0, 2.0, 2.0, 5.0, 6.0, 5.0, 1.0, 1.0, f32::NAN];
        let decoded = [2.1, 1.9, 2.0, 5.1, 6.3, 4.8, 1.2, 1.0, f32::NAN];
        assert_eq!(Restated::of(&axes, &original, 0.0).samples().count(), 0);
        let singles = ErrorReport::measure(&original, &decoded, 0.0);
        assert_eq!(ErrorReport::at_directions(&axes, &original, &decoded, 0.0), singles);
    }

    #[test]
    fn means_are_scored_where_values_do_not_cancel() {
        let axes = [closed(Frame::TypeC, &[0.0, 45.0]), Axis::Rgb];
        let samples = |pole: [f32; 3], seam: [f32; 2]| {
            let lanes = |v: f32| [v, 1.0, 1.0];
            pole.into_iter().chain([seam[0], 9.0, seam[1]]).flat_map(lanes).collect::<Vec<_>>()
        };
        let of = |samples: &[f32], floor: f64| Restated::of(&axes, samples, floor);
        let mixed = samples([3.0, -1.0, f32::NAN], [1.0, -0.9]);
        let found = of(&mixed, 0.0);
        assert_eq!((found.samples().collect::<Vec<_>>(), found.cancelling), (vec![0, 3], 2));
        assert!((found.amplification() - 2.0).abs() < 1e-12);
        // Means below the floor have no relative error, nor have those below 0.
        assert_eq!(of(&mixed, 1.5).samples().count(), 0);
        assert_eq!(of(&samples([-3.0, 1.0, 1.0], [-1.0, 0.5]), 0.0).samples().count(), 0);
        // The mean is at least the floor although one value is below.
        assert_eq!(of(&samples([1.0, 1.0, 1.0], [0.8, 1.4]), 1.0).samples().collect::<Vec<_>>(), [9, 15]);
    }

    #[test]
    fn incoming_and_outgoing_directions_coincide_together() {
        let axes = [closed(Frame::Surface, &[0.0, 40.0]), closed(Frame::Surface, &[0.0, 30.0])];
        let samples: Vec<f32> = (1..=36).map(|i| i as f32).collect();
        let found = Restated::of(&axes, &samples, 0.0);
        let sizes: Vec<usize> = found.ranges().map(|(range, _)| range.len()).collect();
        // Incoming pole, seam and single direction: 3, 2 and 1 entries; the same of outgoing ones.
        assert_eq!(sizes, [9, 6, 3, 6, 4, 2, 3, 2]);
        let means: Vec<f64> = found.ranges().filter_map(|(_, mean)| mean).collect();
        assert_eq!((means[0], means[4]), (8.0, (22.0 + 24.0 + 34.0 + 36.0) / 4.0));
    }
}
