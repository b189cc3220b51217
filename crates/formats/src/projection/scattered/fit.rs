//! Robust local fit: weights of the nearest samples for the value at a place.
//!
//! The fit is a quadratic (Cleveland & Devlin 1988, "Locally weighted regression"). For reflection its coordinates are
//! the slopes of the half vector, since microfacet lobes are functions of the slope. Otherwise they are tangent
//! coordinates. It is linear in the incoming direction if several are fitted together.
//!
//! Weights fall with distance and with stated variance. They are next to 0 for samples whose mean over bands, the
//! *light*, lies far from the fit (bisquare, Beaton & Tukey 1974).
//!
//! Fits to all samples found and to the nearest third compete by noise and departure from each other (after
//! Goldenshluger & Nemirovski 1997). A quadratic that depends on few samples is replaced by a plane, and that by a
//! mean.

use super::cloud::{Cloud, slope, tangents};
use super::gathering::{Frame, Gathered, REACHES};
use super::rows::{PARTS, Rows};
use super::system::{Factored, TERMS};
use super::tree::Found;
use crate::domain::vector::Vector;

/// Largest variance of a local fit, in multiples of the variance of one sample; fits above it are replaced by a lower
/// degree. Raising it accepts less certain fits of higher degree.
const UNCERTAIN: f64 = 1.0;
/// Residual, in standard deviations, from which a sample gets weight 0 in a local fit. Raising it tolerates larger
/// outliers.
const FAR_OFF: f64 = 6.0;
/// Ratio of the true variance of a locally fitted value to the computed variance. The computation takes the weights of
/// samples for inverse variances, but they also fall with distance: the ratio is below 1. Raising it favours fits to
/// more samples.
const FALL_OFF: f64 = 0.75;
/// Multiple of the expected variance up to which the squared difference between the local fit to all samples around and
/// that to the nearest ones counts as noise. Raising it favours the fit to all samples.
const CHANCE: f64 = 2.0;
/// Largest residual of a local fit, in standard deviations, for which no robust refit is made. Raising it saves time
/// and tolerates larger outliers.
const SUSPECT: f64 = 4.5;
/// Least difference between the number of samples of a local polynomial fit and its number of terms.
const FEWEST_LEFT: usize = 4;
/// Largest change of the fitted natural logarithm, between the centre and the outermost samples of a local fit, at
/// which the neighbouring triangles reuse the fit. Raising it is faster and less accurate.
const EVEN: f64 = 0.25;
/// Upper bound on the rounds of robust reweighting in a local fit.
const ROUNDS: usize = 4;

/// Place of a local fit within one triangle: its centre, and the [`PARTS`] outgoing directions at which values are
/// computed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) wi: Vector,
    pub(super) wo: Vector,
    pub(super) parts: [Vector; PARTS],
}

/// Facts about a local polynomial fit: distances, number and arrangement of its samples, and its uncertainty.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Support {
    /// Distance to the nearest sample from the pair of directions about which a polynomial is fitted. It is measured in
    /// the six-dimensional space in which nearest neighbours are sought.
    pub(super) nearest: f64,
    /// Distance from the pair of directions about which a polynomial is fitted to the farthest fitted sample, in the
    /// six-dimensional space in which nearest neighbours are sought.
    pub(super) reach: f64,
    /// Chord, on the unit sphere, from the incoming direction of a local fit to the nearest measured incoming
    /// direction.
    pub(super) nearest_incoming: f64,
    /// Index, in the k-d tree of the samples, of the sample nearest to the place of the fit.
    pub(super) nearest_point: u32,
    /// Number of samples to which the local polynomial is fitted.
    pub(super) count: usize,
    /// True if the samples of the local polynomial fit surround its place on all sides.
    pub(super) surrounded: bool,
    /// Upper bound on the variance of the values of a local polynomial fit, in multiples of the variance of one sample.
    /// If the bound exceeds [`UNCERTAIN`], this is the largest variance itself.
    pub(super) variance: f64,
    /// Polynomial degree of the fit: 2 for a quadratic, 1 for a plane, 0 for a mean.
    pub(super) degree: u8,
}

/// Local polynomial fits to scattered samples, with buffers that are reused from fit to fit.
#[derive(Default)]
pub(super) struct Fitter {
    /// Indices of the samples with nonzero weight in the last local fit.
    pub(super) rows: Vec<u32>,
    /// For each sample of the last local fit, its weight in each of the four fitted values: a value is a weighted sum
    /// of the samples, and is computed at one of four neighbouring outgoing directions.
    pub(super) weights: Vec<[f32; PARTS]>,
    pub(super) gathered: Gathered,
    /// Index in [`REACHES`] of the radius within which samples take part in the last local polynomial fit.
    size: usize,
    parts: [[f64; TERMS]; PARTS],
    robust_of_all: Vec<f64>,
    fitted: Option<Factored>,
    frame: Frame,
}

impl Fitter {
    /// Fits a local polynomial around `place` to the samples `found` (squared chords, in any order). `noise` is the
    /// variance of a value in one band, relative to that of the mean over bands. Returns `None` if there are no
    /// samples.
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
        // The farthest sample gets some weight, too.
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

    /// Evaluates the last local fit at other outgoing directions nearby, `parts`, instead of fitting again. Returns the
    /// largest variance of a fitted value there, relative to the variance of a sample.
    ///
    /// Returns `None` if the fit may be inaccurate there. It must be a quadratic in logarithms, fitted to all samples
    /// around, that changes little and has a small variance. Its coordinates, such as half-vector slopes, must exist
    /// for all of the directions.
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

    /// Returns the value of the last local polynomial fit at each of its [`PARTS`] outgoing directions, minus the value
    /// of the first fitted sample. Values are means over spectral bands, of the measured values or of their natural
    /// logarithms.
    pub(super) fn lights(&self) -> [f64; PARTS] {
        self.fitted.as_ref().map_or([f64::NAN; PARTS], |fitted| self.parts.map(|part| fitted.light(&part)))
    }

    /// Returns the standard deviation of the samples from the polynomial last fitted to them; a sample counts as the
    /// mean of its natural logarithms over the bands. Returns 0 if the fit is to values instead of logarithms.
    pub(super) fn deviation(&self) -> f64 {
        let scatter = self.fitted.as_ref().filter(|_| self.gathered.logarithms).map(|fitted| fitted.scatter);
        scatter.map_or(0.0, f64::sqrt)
    }

    /// Computes the weight of each sample in the values of the last local fit, which are weighted sums of the samples.
    pub(super) fn weigh(&mut self) {
        if let Some(fitted) = self.fitted.take() {
            self.weigh_by(&fitted);
            self.fitted = Some(fitted);
        }
    }

    /// Computes the weights of the samples for a spectral band that is `missing` in some of them. Returns false if all
    /// samples lack the band.
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

    /// Chooses between two local polynomial fits: `all`, to all samples around, and one to the nearest samples only.
    /// Takes the second if both differ by more than the noise that the additional samples average out.
    fn narrowed(&mut self, all: Factored, noise: f64) -> Factored {
        let last = self.size;
        // Starts without the outliers of the fit to all samples: with few samples an outlier bends the fit to itself.
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

    /// Repeats a local fit with lower weights for outliers.
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

    /// Returns the robust standard deviation of the samples from the polynomial fitted to them, if some sample is an
    /// outlier; otherwise `None`. A sample counts as its mean over bands. Leaves the residuals in `gathered.columns`.
    fn suspicion(&mut self, factored: &Factored) -> Option<f64> {
        let count = self.gathered.counts[self.size];
        let departure = self.gathered.columns.depart(count, &factored.solution);
        let n = count as f64;
        let (largest, deviation) = (departure.largest, (departure.squares / n).sqrt());
        // The ratio of standard to mean deviation of a normal distribution is 1.25. Unknown light has no deviation.
        if departure.squares.is_nan() || largest <= SUSPECT * deviation && deviation <= 1.6 * departure.sum / n {
            return None;
        }
        self.gathered.sorted.clear();
        self.gathered.sorted.extend_from_slice(&self.gathered.columns.residuals[..count]);
        let (_, &mut median, _) = self.gathered.sorted.select_nth_unstable_by(count / 2, f64::total_cmp);
        // The terms of the fit use up some residuals. Exact data have residuals from rounding.
        let used = (n / (n - factored.terms as f64).max(1.0)).sqrt();
        let scale = (1.4826 * median * used).max(1e-6 * departure.brightest);
        (largest > SUSPECT * scale).then_some(scale)
    }

    fn system(&mut self, terms: usize) -> Factored {
        self.gathered.columns.system(self.gathered.counts[self.size], REACHES[self.size], self.gathered.joint, terms)
    }

    /// Returns an upper bound on the variance of the values of a local polynomial fit at its [`PARTS`] outgoing
    /// directions, in multiples of the variance of one sample. If the bound exceeds [`UNCERTAIN`], returns the largest
    /// variance itself.
    fn variance(&mut self, factored: &Factored) -> f64 {
        // Assumes that samples vary by their inverse weights; they vary less.
        let most = self.gathered.most_certain * most_of(self.parts.map(|part| factored.variance(part)));
        if most <= UNCERTAIN { most } else { self.weigh_by(factored) }
    }

    /// Computes the weight of each sample in each value of a local fit, and the indices of the samples with any weight.
    /// Returns the largest variance of a fitted value, relative to that of a sample.
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

/// Returns the largest of the variances of the values of a local fit, or NaN if one is NaN.
fn most_of(variances: [f64; PARTS]) -> f64 {
    variances.into_iter().fold(0.0, |most, v| if v > most || v.is_nan() { v } else { most })
}

/// Returns the polynomial degrees that a local fit tries, with their numbers of terms, highest degree first.
fn degrees(joint: bool) -> [(usize, usize); 3] {
    if joint { [(2, 8), (1, 5), (0, 1)] } else { [(2, 6), (1, 3), (0, 1)] }
}
