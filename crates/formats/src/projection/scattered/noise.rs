//! Noise of samples about their neighbours, and rejection of outliers; both are independent of cells.
//!
//! Every sample is predicted by a robust fit to its nearest neighbours without itself. The difference of logarithms
//! contains its own noise and that of the prediction, known from the weights of the fit. The median over samples of
//! similar brightness is insensitive to lobes and outliers.
//!
//! A sample is rejected if it differs by a third from the fit or the median of its neighbours. The difference must
//! also be many times the usual one at its brightness and the scatter of the neighbours. It is kept if several
//! neighbours deviate to the same side: then they are a lobe. Fits are repeated without the outliers, since these come
//! in pairs.
//!
//! Samples that form a lobe only together with other incidences are not rejected either
//! ([`together`](super::together)). A few outliers of several incidences about one likely centre are
//! rejected; the report tells them as a lobe that the scan may not resolve ([`centred`](super::centred)).

use super::cells::{Fitted, Scratch};
use super::centred::unresolved;
use super::cloud::Cloud;
use super::fit::{Place, Support};
use super::plan::Plan;
use super::report::UnresolvedLobe;
use super::rows::{PARTS, Rows};
use super::together::{Company, Off, companies};
use super::tree::Found;
use crate::domain::Quantity;
use crate::projection::resampling::Channels;
use rayon::prelude::*;

/// Two counts of nearest neighbours from which each sample is predicted, to estimate the noise from the differences.
/// The smaller estimate counts, because noise does not depend on the count: differences that grow with it are signal.
const NEIGHBOURS: [usize; 2] = [27, 16];
/// Approximate number of samples from which the noise is estimated, each in all bands. Raising it is more accurate and
/// slower.
const JUDGES: usize = 1 << 13;
/// Upper bound on the number of values from which the noise is estimated. Raising it is more accurate and slower.
const JUDGED_VALUES: usize = 1 << 20;
/// Upper bound on the number of brightness classes: ranges of sample values in which the noise is estimated separately.
const CLASSES: usize = 16;
/// Least number of sample values in a range of brightness for which the noise is estimated separately.
const CLASS: usize = 200;
/// Least number of positive values for a noise estimate.
const FEWEST: usize = 48;
/// Ratio of the standard deviation of a normal distribution to the median of the magnitudes of its deviates.
pub(super) const OF_MEDIAN: f64 = 1.4826;
/// Relative noise that the rounding of values to float32 explains; noise below it counts as 0.
const ROUNDING: f64 = 2e-7;
/// Least difference of a sample from the prediction by its neighbours at which it counts as an outlier, in standard
/// deviations. The larger of two standard deviations counts: that of samples of similar brightness, and that of the
/// neighbours about their own fit or median. Raising the difference rejects fewer samples.
const FAR_OFF: f64 = 8.0;
/// Least difference of natural logarithms by which a deviating sample differs from its neighbours: a third. Raising it
/// rejects fewer samples.
const LEAST_OFF: f64 = 0.3;
/// Difference of natural logarithms above which a sample is *high*: brighter than its neighbours, but not a deviating
/// sample. High samples are kept, and support a lobe together with deviating ones. Raising it finds fewer high samples.
const HIGH: f64 = 0.05;
/// Number of standard deviations of its brightness class above which a sample is *high*: brighter than its neighbours,
/// but not a deviating sample. Raising it finds fewer high samples.
const HIGH_OFF: f64 = 4.0;
/// Number of nearest neighbours with whose median a sample is compared.
const NEAREST: usize = 12;
/// Number of rounds in which samples are predicted from their neighbours: first with all samples, then without
/// deviating ones.
const ROUNDS: usize = 2;
/// Number of neighbours examined around a deviating sample to tell whether several of them form a lobe.
const BESIDE: usize = 6;
/// Least number of neighbours that must deviate in the same sense (brighter or darker) as a sample for both to form a
/// lobe. Raising it rejects more samples.
const LOBE: usize = 2;

/// Noise and outliers of scattered samples.
#[derive(Clone, Debug, Default)]
pub(super) struct Scatter {
    /// Root mean square of the relative noise of positive samples; `None` if there are too few samples.
    pub(super) noise: Option<f64>,
    /// Measured values rejected as outliers, in increasing order of their positions in the array `[sample, channel]` of
    /// measured values.
    pub(super) rejected: Vec<Rejection>,
    /// Sum of the outliers as a fraction of the sum of all positive values.
    pub(super) light: f64,
    /// Sum of the isolated outliers as a fraction of the sum of all positive values.
    pub(super) isolated_light: f64,
    /// Number of values that differ strongly from their neighbours but belong to a lobe, and are not rejected.
    pub(super) lobe: u64,
    /// Outliers that suggest a lobe too narrow for the sample spacing; `None` if there are none.
    pub(super) unresolved: Option<UnresolvedLobe>,
    /// Number of positive values of the scan.
    pub(super) positive: u64,
}

/// A measured value that was rejected as an outlier.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Rejection {
    /// Index of the outlier in the row-major array `[sample, channel]` of the measured values, averaged over the
    /// wavelength bands of the tensor if these were requested.
    pub(super) position: usize,
    /// True if the outlier is one of several that lie close together, false if it is isolated.
    pub(super) is_together: bool,
}

/// Noise of the samples whose brightness lies in one range.
struct Class {
    /// Upper end of a range of brightness: natural logarithm of the largest value that is predicted for a sample in it.
    up_to: f64,
    deviation: f64,
}

/// Channels on which a sample is compared with its neighbours: the wavelengths of the tensor, or the single value
/// before a spectrum multiplies it.
pub(super) struct Own<'a>(pub(super) &'a Channels);

impl Own<'_> {
    /// Returns the number of channels in which a sample is compared with its neighbours: 1 if a spectrum multiplies the
    /// samples, else one for each wavelength.
    pub(super) fn width(&self) -> usize {
        if let Channels::Multiplied(_) = self.0 { 1 } else { self.0.to() }
    }

    pub(super) fn write(&self, row: &[f32], wide: &mut Vec<f64>, out: &mut [f32]) {
        if let Channels::Banded { .. } = self.0 {
            wide.clear();
            wide.extend(row.iter().map(|&v| f64::from(v)));
            self.0.write(wide, out);
        } else {
            out.copy_from_slice(row);
        }
    }
}

/// Scratch space of one task that compares samples with predictions from their neighbours.
#[derive(Default)]
struct Compared {
    scratch: Scratch,
    wide: Vec<f64>,
    found: Vec<f32>,
    row: Vec<f32>,
    near: Vec<Found>,
}

impl Compared {
    /// Computes the differences of logarithms between the sample `point` and its prediction from neighbours, and the
    /// logarithms of the prediction. Both are NaN in channels with a value that is not positive. Returns `None` if
    /// there is no prediction.
    fn differences(
        &mut self,
        fitted: &Fitted<'_>,
        point: u32,
        own: &Own<'_>,
        is_left_out: impl Fn(u32) -> bool,
    ) -> Option<Support> {
        let row = fitted.rows.row(fitted.cloud.rows[point as usize]);
        self.row.resize(own.width(), 0.0);
        self.found.resize(own.width(), 0.0);
        own.write(row, &mut self.wide, &mut self.row);
        let support = without_itself(fitted, point, is_left_out, &mut self.scratch)?;
        own.write(&self.scratch.row, &mut self.wide, &mut self.found);
        for (value, found) in self.row.iter_mut().zip(&mut self.found) {
            let log = |v: f32| if v > 0.0 { libm::logf(v) } else { f32::NAN };
            (*value, *found) = (log(*value) - log(*found), log(*found));
        }
        Some(support)
    }
}

/// Predicts the sample `point` from its neighbours, without the sample itself, its mirror image, and samples for which
/// `is_left_out` is true. The result is in `scratch.row`.
pub(super) fn without_itself(
    fitted: &Fitted<'_>,
    point: u32,
    is_left_out: impl Fn(u32) -> bool,
    scratch: &mut Scratch,
) -> Option<Support> {
    let cloud = fitted.cloud;
    let (wi, wo) = (cloud.wi[point as usize], cloud.wo[point as usize]);
    let row = cloud.rows[point as usize];
    let taken = |item: u32| {
        let is_other = cloud.rows[item as usize] != row && !is_left_out(item);
        let item = item as usize;
        is_other && (!fitted.sides_apart || cloud.wo[item][2] * wo[2] >= 0.0)
    };
    cloud.nearest(&cloud.place(point), fitted.neighbours, taken, &mut scratch.found);
    scratch.row.resize(fitted.rows.width, 0.0);
    let support = fitted.value(&Place { wi, wo, parts: [wo; PARTS] }, [1.0; PARTS], scratch)?;
    (support.nearest < support.reach).then_some(support)
}

/// Finds the noise and the outliers of scattered samples.
pub(super) fn scatter(quantity: Quantity, plan: &Plan, rows: &Rows<'_>, channels: &Channels) -> Scatter {
    let own = Own(channels);
    let classes = classes(plan, rows, &own);
    let mut scatter = Scatter::default();
    let count: usize = classes.iter().map(|class| class.1).sum();
    if count >= FEWEST {
        let squares: f64 = classes.iter().map(|(class, n)| *n as f64 * class.deviation.powi(2)).sum();
        let noise = (squares / count as f64).sqrt();
        scatter.noise = Some(if noise < ROUNDING { 0.0 } else { noise });
    }
    let classes: Vec<Class> = classes.into_iter().map(|(class, _)| class).collect();
    let (mut wide, mut row) = (Vec::new(), vec![0.0; own.width()]);
    let (mut found, mut light) = (Vec::new(), 0.0);
    for cloud in 0..plan.clouds.len() {
        let fitted = Fitted { neighbours: NEIGHBOURS[0], ..plan.fitted(rows, cloud) };
        found.extend(off(&fitted, &own, &classes, plan.spacing));
        for &number in &fitted.cloud.rows[..fitted.cloud.own()] {
            own.write(rows.row(number), &mut wide, &mut row);
            for value in row.iter().filter(|value| **value > 0.0) {
                light += f64::from(*value);
                scatter.positive += 1;
            }
        }
    }
    found.sort_unstable_by_key(|(off, _)| off.row);
    let (offs, shared): (Vec<Off>, Vec<Vec<bool>>) = found.into_iter().unzip();
    let companies = companies(quantity, plan, &offs);
    scatter.unresolved = unresolved(quantity, plan, &offs, &companies);
    for ((off, shared), company) in offs.iter().zip(shared).zip(companies) {
        if company == Company::Light {
            scatter.lobe += off.channels.len() as u64;
            continue;
        }
        own.write(rows.row(off.row), &mut wide, &mut row);
        for (&(channel, _), _) in off.channels.iter().zip(shared).filter(|(_, is_shared)| !is_shared) {
            let (position, value) = (off.row as usize * own.width() + channel, f64::from(row[channel]));
            let is_together = company == Company::Together;
            scatter.rejected.push(Rejection { position, is_together });
            scatter.light += value / light;
            scatter.isolated_light += if is_together { 0.0 } else { value / light };
        }
    }
    scatter.rejected.sort_unstable();
    scatter
}

/// Returns the noise by brightness class of the predicted values, and the number of values in each class.
fn classes(plan: &Plan, rows: &Rows<'_>, own: &Own<'_>) -> Vec<(Class, usize)> {
    let points: usize = plan.clouds.iter().map(Cloud::own).sum();
    let judges = JUDGES.min(JUDGED_VALUES / own.width()).max(100);
    let step = points.div_ceil(judges).max(1);
    let chosen: Vec<(usize, u32)> = plan
        .clouds
        .iter()
        .enumerate()
        .flat_map(|(i, cloud)| (0..cloud.own() as u32).map(move |point| (i, point)))
        .step_by(step)
        .collect();
    let judged = |neighbours: usize| -> Vec<(f32, f32)> {
        let of = |compared: &mut Compared, &(cloud, point): &(usize, u32)| {
            let fitted = Fitted { neighbours, ..plan.fitted(rows, cloud) };
            let support = compared.differences(&fitted, point, own, |_| false).filter(|support| support.surrounded);
            if support.is_none() {
                return Vec::new();
            }
            let fitter = &mut compared.scratch.fitter;
            fitter.weigh();
            let variance: f64 = fitter.weights.iter().map(|weights| f64::from(weights[0]).powi(2)).sum();
            let scale = (1.0 + variance).sqrt();
            let pairs = compared.found.iter().zip(&compared.row).filter(|(_, difference)| !difference.is_nan());
            pairs.map(|(&found, &difference)| (found, (f64::from(difference).abs() / scale) as f32)).collect()
        };
        let found: Vec<Vec<(f32, f32)>> = chosen.par_iter().map_init(Compared::default, of).collect();
        let mut found: Vec<(f32, f32)> = found.into_iter().flatten().collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        found
    };
    let mut all = NEIGHBOURS.map(|neighbours| divided(judged(neighbours))).into_iter();
    let Some(mut classes) = all.next() else { return Vec::new() };
    for others in all {
        for ((class, _), (other, _)) in classes.iter_mut().zip(others) {
            class.deviation = class.deviation.min(other.deviation);
        }
    }
    classes
}

/// Divides predictions of samples from their neighbours, in increasing order, into ranges of brightness with about
/// equally many predictions each, and estimates the noise in each range. A pair holds the natural logarithm of a
/// prediction and the magnitude of the difference of the measured logarithm from it.
fn divided(mut pairs: Vec<(f32, f32)>) -> Vec<(Class, usize)> {
    let count = pairs.len();
    let number = (count / CLASS).clamp(1, CLASSES);
    let mut classes = Vec::new();
    let mut rest = &mut pairs[..];
    for i in 0..number {
        let (part, after) = rest.split_at_mut((i + 1) * count / number - i * count / number);
        rest = after;
        let Some(&(up_to, _)) = part.last() else { continue };
        let n = part.len();
        let (_, median, _) = part.select_nth_unstable_by(n / 2, |a, b| a.1.total_cmp(&b.1));
        classes.push((Class { up_to: f64::from(up_to), deviation: OF_MEDIAN * f64::from(median.1) }, n));
    }
    classes
}

/// Channels in which a sample deviates from its neighbours, each with the difference of logarithms.
type Sides = Vec<(usize, f32)>;

/// Returns the samples of one group that deviate from their neighbours or are *high* (brighter than noise explains).
/// For each channel of a sample, true marks a value that is not rejected: neighbours deviate likewise as in a lobe, or
/// the sample is only high. `usual` is the sample spacing if several incoming directions are fitted together.
fn off(fitted: &Fitted<'_>, own: &Own<'_>, classes: &[Class], usual: f64) -> Vec<(Off, Vec<bool>)> {
    if classes.is_empty() {
        return Vec::new();
    }
    let cloud = fitted.cloud;
    let mut found: Vec<Sides> = vec![Vec::new(); cloud.own()];
    let mut suspects: Vec<u32> = (0..cloud.own() as u32).collect();
    let mut high: Vec<(u32, Sides)> = Vec::new();
    for _ in 0..ROUNDS {
        let is_left_out = |item: u32| !found[own_point(cloud, item)].is_empty();
        let sides = |compared: &mut Compared, &point: &u32| compared.sides(fitted, point, (own, classes), is_left_out);
        let looked: Vec<Option<[Sides; 2]>> = suspects.par_iter().map_init(Compared::default, sides).collect();
        let still = suspects.iter().zip(looked).filter_map(|(&point, sides)| Some((point, sides?)));
        let still: Vec<(u32, [Sides; 2])> = still.collect();
        suspects = still.iter().map(|(point, _)| *point).collect();
        found.iter_mut().for_each(Vec::clear);
        high.clear();
        for (point, [off, above]) in still {
            if off.is_empty() && !above.is_empty() {
                high.push((point, above));
            }
            found[point as usize] = off;
        }
    }
    let mut around = Vec::new();
    let of = |(point, sides, is_high): (u32, &Sides, bool)| {
        let number = cloud.rows[point as usize];
        cloud.nearest(&cloud.place(point), BESIDE, |item| cloud.rows[item as usize] != number, &mut around);
        let is_shared = |side: &(usize, f32)| {
            let is_alike = |other: &(usize, f32)| other.0 == side.0 && other.1 * side.1 > 0.0;
            around.iter().filter(|near| found[own_point(cloud, near.1)].iter().any(is_alike)).count() >= LOBE
        };
        let shared = sides.iter().map(|side| is_high || is_shared(side)).collect();
        let square = around.first().map_or(0.0, |farthest| farthest.0);
        let apart = (std::f64::consts::PI * square / around.len().max(1) as f64).sqrt();
        let spacing = if cloud.stretch > 0.0 { usual } else { apart };
        (Off { row: number, channels: sides.clone(), spacing, is_high }, shared)
    };
    let off = found.iter().zip(0..).filter(|(sides, _)| !sides.is_empty()).map(|(sides, point)| (point, sides, false));
    off.chain(high.iter().map(|(point, sides)| (*point, sides, true))).map(of).collect()
}

/// Returns the index of the measured sample behind `item`, a sample or mirror image of the group `cloud`: the sample
/// itself, or the one that is mirrored in the plane of incidence.
fn own_point(cloud: &Cloud, item: u32) -> usize {
    let item = item as usize;
    if item < cloud.own() { item } else { item - cloud.own() }
}

impl Compared {
    /// Returns the channels in which a sample deviates from its neighbours, and those in which it is *high* (brighter
    /// than noise explains). Predicts the sample without points for which `is_left_out` is true. Returns `None` if no
    /// channel differs much.
    fn sides(
        &mut self,
        fitted: &Fitted<'_>,
        point: u32,
        (own, classes): (&Own<'_>, &[Class]),
        is_left_out: impl Fn(u32) -> bool,
    ) -> Option<[Sides; 2]> {
        let support = self.differences(fitted, point, own, is_left_out)?;
        let scale = (1.0 + support.variance).sqrt();
        let usual = |found: f32| {
            let class = classes.partition_point(|class| class.up_to < f64::from(found)).min(classes.len() - 1);
            classes[class].deviation
        };
        let above = |(channel, (&difference, &found)): (usize, (&f32, &f32))| {
            let is_high = f64::from(difference) > HIGH.max(HIGH_OFF * usual(found) * scale);
            is_high.then_some((channel, difference))
        };
        let high: Sides = self.row.iter().zip(&self.found).enumerate().filter_map(above).collect();
        if !self.row.iter().any(|difference| f64::from(difference.abs()) > LEAST_OFF) {
            return (!high.is_empty()).then_some([Vec::new(), high]);
        }
        let around = self.scratch.fitter.deviation();
        let cloud = fitted.cloud;
        let number = cloud.rows[point as usize];
        cloud.nearest(&cloud.place(point), NEAREST, |item| cloud.rows[item as usize] != number, &mut self.near);
        let rows: Vec<u32> = self.near.iter().map(|near| cloud.rows[near.1 as usize]).collect();
        let mut neighbours = vec![0.0_f32; rows.len() * own.width()];
        for (&row, out) in rows.iter().zip(neighbours.chunks_exact_mut(own.width())) {
            own.write(fitted.rows.row(row), &mut self.wide, out);
        }
        let side = |(channel, (&difference, &found)): (usize, (&f32, &f32))| {
            let usual = usual(found);
            let by_fit = f64::from(difference);
            let by_median = beside_median(
                neighbours.iter().skip(channel).step_by(own.width()).copied(),
                f64::from(difference) + f64::from(found),
            );
            let is_off = |difference: f64, limit: f64| difference.abs() > (FAR_OFF * limit).max(LEAST_OFF);
            if is_off(by_fit, usual.max(around) * scale) {
                Some((channel, difference))
            } else {
                by_median.filter(|found| is_off(found.0, usual.max(found.1))).map(|found| (channel, found.0 as f32))
            }
        };
        Some([self.row.iter().zip(&self.found).enumerate().filter_map(side).collect(), high])
    }
}

/// Returns the difference of `log` from the median logarithm of `values`, and the robust standard deviation of the
/// logarithms. Returns `None` if one of the values is not positive.
fn beside_median(values: impl Iterator<Item = f32>, log: f64) -> Option<(f64, f64)> {
    let logs: Option<Vec<f64>> = values.map(|v| (v > 0.0).then(|| f64::from(libm::logf(v)))).collect();
    let mut logs = logs.filter(|logs| !logs.is_empty() && !log.is_nan())?;
    let middle = logs.len() / 2;
    let median = *logs.select_nth_unstable_by(middle, f64::total_cmp).1;
    for value in &mut logs {
        *value = (*value - median).abs();
    }
    let deviation = OF_MEDIAN * *logs.select_nth_unstable_by(middle, f64::total_cmp).1;
    Some((log - median, deviation))
}
