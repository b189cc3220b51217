//! The local fit: which weights of the nearest samples make the value at a place, robustly.
//!
//! A quadratic (Cleveland & Devlin 1988, "Locally weighted regression") in the slopes of the half vector for reflection,
//! where lobes of microfacets are functions of the slope, and in tangent coordinates otherwise; linear in the incoming
//! direction where several are fitted together. Samples count less with their distance, with their stated variance, and
//! next to nothing where their light lies far from the fit (bisquare, Beaton & Tukey 1974). Of the fits to all samples found
//! and to the nearest third, that one is taken whose noise and departure from the other are least (after Goldenshluger &
//! Nemirovski 1997). A quadratic that hangs on few samples gives way to a plane, that to a mean.

use super::cloud::{Cloud, slope, tangents};
use super::gathering::{Frame, Gathered, REACHES};
use super::rows::{PARTS, Rows};
use super::system::{Factored, TERMS};
use super::tree::Found;
use crate::domain::vector::Vector;

/// A value that is less certain than so many samples' own is not what the samples say.
const UNCERTAIN: f64 = 1.0;
/// Residuals of so many standard deviations lose all weight.
const FAR_OFF: f64 = 6.0;
/// The variance of a weighted fit in parts of what weights by variance would give: they fall off with distance.
const FALL_OFF: f64 = 0.75;
/// Departures within so many variances of theirs are noise.
const CHANCE: f64 = 2.0;
/// A sample beyond so many is looked at.
const SUSPECT: f64 = 4.5;
/// A fit has at least so many samples more than terms.
const FEWEST_LEFT: usize = 4;
/// Where logarithms change by less than this within the reach, a fit serves the cells beside its own, too.
const EVEN: f64 = 0.25;
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
    /// At least the variance of the value, in parts of that of a sample; more only below [`UNCERTAIN`].
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
    pub(super) gathered: Gathered,
    /// The last of [`REACHES`] that counts.
    size: usize,
    parts: [[f64; TERMS]; PARTS],
    robust_of_all: Vec<f64>,
    fitted: Option<Factored>,
    frame: Frame,
}

impl Fitter {
    /// Fits to the samples `found` (squares of chords, in any order) around `place`, for the values of `rows`; the noise of a
    /// value is `noise` times that of its row's light, as variances. `None` if there are no samples.
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
            (if new.0 < nearest.0 { new } else { nearest }, if new.0 > farthest { new.0 } else { farthest })
        });
        // The farthest sample counts, too.
        let reach = (farthest * 1.05).max(1e-12);
        self.gathered.joint = cloud.stretch > 0.0;
        self.gathered.order(found, reach);
        let axes = tangents(place.wo);
        let centre = slope(place.wi, place.wo);
        let is_steep = |&wo: &Vector| slope(place.wi, wo)[0].is_nan();
        let steep = !cloud.slopes || centre[0].is_nan() || place.parts.iter().any(is_steep);
        self.gathered.gather(cloud, rows, place.wi);
        let by_slope = !steep && self.gathered.slopes(cloud, centre);
        if !by_slope {
            self.gathered.tangents(cloud, &axes);
        }
        let length = self.gathered.scale();
        self.frame = Frame { slopes: by_slope.then_some((place.wi, centre)), axes, length };
        let joint = self.gathered.joint;
        self.parts = place.parts.map(|wo| self.frame.at(wo, joint));
        let mut support = Support {
            nearest: nearest.0.sqrt(),
            reach: farthest.sqrt(),
            nearest_point: nearest.1,
            count: found.len(),
            surrounded: self.gathered.surrounded(cloud, &axes),
            nearest_incoming: self.gathered.nearest_incoming,
            ..Support::default()
        };
        for (degree, count) in degrees(joint) {
            if degree == 0 || found.len() >= count + degree {
                self.size = REACHES.len() - 1;
                if !self.gathered.plain {
                    self.gathered.columns.robust.fill(1.0);
                    self.gathered.plain = true;
                }
                let factored = self.system(count);
                let mut factored = self.robustly(factored);
                if degree == 2 && !joint && factored.scatter > 0.0 && self.gathered.counts[0] >= count + FEWEST_LEFT {
                    factored = self.narrowed(factored, noise);
                }
                support.variance = self.variance(&factored);
                support.degree = degree as u8;
                self.fitted = Some(factored);
                if support.variance <= UNCERTAIN {
                    break;
                }
            }
        }
        Some(support)
    }

    /// Takes the fit for other parts, nearby; the largest variance of a value there as [`Support`] has it. `None` where the
    /// fit is not as good there: it must be a quadratic through all samples, in coordinates that the parts have.
    pub(super) fn elsewhere(&mut self, parts: [Vector; PARTS], degree: u8) -> Option<f64> {
        let fitted = self.fitted.as_ref()?;
        let change: f64 = fitted.solution[1..].iter().map(|term| term.abs()).sum();
        let whole = degree == 2 && self.size + 1 == REACHES.len() && self.gathered.logarithms && change <= EVEN;
        let parts = parts.map(|wo| self.frame.at(wo, self.gathered.joint));
        if !whole || parts.iter().any(|part| part[1].is_nan()) {
            return None;
        }
        self.parts = parts;
        let fitted = self.fitted.take()?;
        let variance = self.variance(&fitted);
        self.fitted = Some(fitted);
        (variance <= UNCERTAIN).then_some(variance)
    }

    /// The light of the fit at each part, less that of the first row gathered.
    pub(super) fn lights(&self) -> [f64; PARTS] {
        self.fitted.as_ref().map_or([f64::NAN; PARTS], |fitted| self.parts.map(|part| fitted.light(&part)))
    }

    /// Standard deviation of the logarithms of the samples' light about the fit; 0 where values are fitted, not logarithms.
    pub(super) fn deviation(&self) -> f64 {
        let scatter = self.fitted.as_ref().filter(|_| self.gathered.logarithms).map(|fitted| fitted.scatter);
        scatter.map_or(0.0, f64::sqrt)
    }

    /// Sets the weights of the fit.
    pub(super) fn weigh(&mut self) {
        if let Some(fitted) = self.fitted.take() {
            self.weigh_by(&fitted);
            self.fitted = Some(fitted);
        }
    }

    /// Sets the weights for a band that the rows `missing` of all gathered have not; `false` if none has it.
    pub(super) fn without(&mut self, missing: &[bool]) -> bool {
        let left = missing.iter().filter(|missing| !**missing).count();
        for (robust, &missing) in self.gathered.columns.robust.iter_mut().zip(missing) {
            *robust = f64::from(u8::from(!missing));
        }
        self.gathered.plain = false;
        self.size = REACHES.len() - 1;
        for (degree, count) in degrees(self.gathered.joint) {
            if degree == 0 || left >= count + degree {
                let factored = self.system(count);
                if self.weigh_by(&factored) <= UNCERTAIN {
                    break;
                }
            }
        }
        left > 0
    }

    /// The fit to all samples, or to the nearest where it departs from theirs by more than it saves of noise.
    fn narrowed(&mut self, all: Factored, noise: f64) -> Factored {
        let last = self.size;
        // What is far off the fit to all is left out at first: of few samples an outlier bends the fit to itself.
        self.robust_of_all.clone_from(&self.gathered.columns.robust);
        let plain = self.gathered.plain;
        self.size = 0;
        let mut few = self.system(all.terms);
        let suspicion = self.suspicion(&few);
        if suspicion.is_some() {
            few = self.robustly(few);
        } else if !self.gathered.plain {
            self.gathered.columns.robust.fill(1.0);
            self.gathered.plain = true;
            few = self.system(all.terms);
            few = self.robustly(few);
        }
        let mut one = [0.0; TERMS];
        one[0] = 1.0;
        let [own, less] = [&few, &all].map(|fit| FALL_OFF * fit.variance(one));
        let scatter = few.scatter.min(all.scatter);
        let departure = (all.solution[0] - few.solution[0]).powi(2) - CHANCE * scatter * (own - less).max(0.0);
        if departure.max(0.0) <= noise * scatter * (own - less) {
            std::mem::swap(&mut self.gathered.columns.robust, &mut self.robust_of_all);
            self.gathered.plain = plain;
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
            self.gathered.columns.trust(FAR_OFF * scale);
            self.gathered.plain = false;
            factored = self.system(factored.terms);
            if scale > 0.99 * last {
                break;
            }
            last = scale;
        }
        factored
    }

    /// The standard deviation of the light about the fit, by its median, if some sample is far off; residuals are left as
    /// the light's.
    fn suspicion(&mut self, factored: &Factored) -> Option<f64> {
        let count = self.gathered.counts[self.size];
        let departure = self.gathered.columns.depart(count, &factored.solution);
        let n = count as f64;
        let (largest, deviation) = (departure.largest, (departure.squares / n).sqrt());
        // A normal distribution has 1.25 for the ratio of its standard to its mean deviation. Light that is not known has none.
        if departure.squares.is_nan() || largest <= SUSPECT * deviation && deviation <= 1.6 * departure.sum / n {
            return None;
        }
        self.gathered.sorted.clear();
        self.gathered.sorted.extend_from_slice(&self.gathered.columns.residuals[..count]);
        let (_, &mut median, _) = self.gathered.sorted.select_nth_unstable_by(count / 2, f64::total_cmp);
        // Some residuals are used up by the terms of the fit; exact data have residuals of rounding.
        let used = (n / (n - factored.terms as f64).max(1.0)).sqrt();
        let scale = (1.4826 * median * used).max(1e-6 * departure.brightest);
        (largest > SUSPECT * scale).then_some(scale)
    }

    fn system(&mut self, terms: usize) -> Factored {
        self.gathered.columns.system(self.gathered.counts[self.size], REACHES[self.size], self.gathered.joint, terms)
    }

    /// At least the largest variance of a value at the parts, in parts of that of a sample.
    fn variance(&mut self, factored: &Factored) -> f64 {
        // As if the samples varied by the inverse of how much they count; they vary less.
        let most = self.gathered.most_certain * most_of(self.parts.map(|part| factored.variance(part)));
        if most <= UNCERTAIN { most } else { self.weigh_by(factored) }
    }

    /// Sets the weights at the parts, and the rows that have any; the largest variance of a value, in parts of that of a
    /// sample.
    fn weigh_by(&mut self, factored: &Factored) -> f64 {
        self.weights.clear();
        self.rows.clear();
        let mut variance = [0.0; PARTS];
        let Self { gathered: Gathered { columns, rows: gathered, .. }, rows, weights, .. } = self;
        columns.weigh((self.gathered.counts[self.size], REACHES[self.size]), factored, &self.parts, |i, counts| {
            variance.iter_mut().zip(counts).for_each(|(sum, w)| *sum += w * w);
            weights.push(counts.map(|w| w as f32));
            rows.push(gathered[i]);
        });
        most_of(variance)
    }
}

/// The largest, or not a number if one is not.
fn most_of(variances: [f64; PARTS]) -> f64 {
    variances.into_iter().fold(0.0, |most, v| if v > most || v.is_nan() { v } else { most })
}

/// Degrees and their numbers of terms, the highest first.
fn degrees(joint: bool) -> [(usize, usize); 3] {
    if joint { [(2, 8), (1, 5), (0, 1)] } else { [(2, 6), (1, 3), (0, 1)] }
}
