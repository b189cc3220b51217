//! Regions of outgoing directions (peak, middle, grazing), and the errors tallied in each.

use super::report::{Regions, Scores};

/// A sample of at least this part of what the brightest are under its incoming direction belongs to the peak.
const PEAK: f64 = 0.5;
/// One in so many samples may be brighter than what counts as the brightest: outliers are.
const BRIGHTER: usize = 200;
/// The height below which an outgoing direction grazes: that of 70°.
const GRAZING: f64 = 0.342_020_143_325_668_7;

/// A region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Region {
    Peak,
    Middle,
    Grazing,
}

/// Scores in the making: count, sum, sum of squares in the order of [`Region`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally([(u64, f64, f64); 3]);

impl Tally {
    pub(super) fn add(&mut self, region: Region, found: f32, expected: f32) {
        let error = (f64::from(found) - f64::from(expected)).abs() / f64::from(expected);
        if expected > 0.0 && !error.is_nan() {
            let sums = &mut self.0[region as usize];
            *sums = (sums.0 + 1, sums.1 + error, sums.2 + error * error);
        }
    }

    pub(super) fn join(&mut self, other: &Self) {
        for (sums, more) in self.0.iter_mut().zip(&other.0) {
            *sums = (sums.0 + more.0, sums.1 + more.1, sums.2 + more.2);
        }
    }

    pub(super) fn finish(&self) -> Regions {
        let scores = |sums: &[(u64, f64, f64)]| {
            let (count, sum, squares) = sums.iter().fold((0, 0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2));
            let n = (count as f64).max(1.0);
            Scores { values: count, er_l1: sum / n, er_l2: (squares / n).sqrt() }
        };
        let [peak, middle, grazing] = &self.0;
        Regions {
            all: scores(&self.0),
            peak: scores(&[*peak]),
            middle: scores(&[*middle]),
            grazing: scores(&[*grazing]),
        }
    }
}

/// The brightest light of samples, but for a few.
pub(super) fn brightest(mut lights: Vec<f64>) -> f64 {
    lights.retain(|light| !light.is_nan());
    if lights.is_empty() {
        return f64::INFINITY;
    }
    let place = lights.len() - 1 - lights.len() / BRIGHTER;
    *lights.select_nth_unstable_by(place, f64::total_cmp).1
}

/// The region of a sample of so much light, at this height, where the brightest have `brightest`.
pub(super) fn region(light: f64, brightest: f64, height: f64) -> Region {
    if light >= PEAK * brightest {
        Region::Peak
    } else if height.abs() < GRAZING {
        Region::Grazing
    } else {
        Region::Middle
    }
}
