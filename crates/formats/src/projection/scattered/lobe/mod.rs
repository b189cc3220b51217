//! Lobes narrower than cells: found in the samples of all incidences together, and carried beside the cells.
//!
//! 1. Samples about a centre ([`near`]) of a [`scan`] are compared with the prediction of their neighbours
//!    ([`beside`]). A scan without high samples there has no lobe ([`candidates`]).
//! 2. A lobe ([`shape`]) and a base under each incidence are fitted together ([`solve`]), about each centre. Withheld
//!    samples decide between these, and against no lobe ([`choose`]).
//! 3. Each band has its own factor ([`bands`]). Cells are fitted to the samples minus the lobe ([`residual`]), if that
//!    predicts samples better than cells alone do ([`against_cells`]).
//! 4. The lobe is limited to conserve energy ([`bound`]). If few samples see it, the possible range of its light is
//!    reported ([`range`]). The result is [`carried`].

mod against_cells;
mod bands;
mod beside;
mod bound;
mod candidates;
pub(in crate::projection) mod carried;
mod choose;
#[cfg(test)]
mod drawn;
mod near;
#[cfg(test)]
mod random_scans;
mod range;
mod residual;
mod scan;
mod shape;
mod solve;
#[cfg(test)]
mod tests;

pub use carried::CarriedLobe;

use super::incidences::Incidence;
use super::plan::Plan;
use super::rows::Rows;
use crate::domain::vector::Vector;
use crate::domain::{Direction, Lobe, LobeCentre, LobeParameters};
use crate::projection::resampling::Channels;
use carried::RESOLVED;
use choose::Found;
use scan::Scan;

/// Usual number of samples within half maximum under one incoming direction above which triangles represent a lobe well
/// enough. Raising it stores more lobes separately.
const ENOUGH: f64 = 16.0;
/// Number of samples within half maximum, over all incoming directions, that determine the albedo of a lobe. With fewer
/// a range is given.
const CERTAIN: u64 = 12;
/// Least factor by which a lobe that reflects too much light is dimmed.
const DARKEST: f64 = 1e-3;

/// A narrow lobe, and the values of the samples without it.
pub(super) struct Split {
    pub(super) carried: CarriedLobe,
    /// Values of the samples minus the lobe, `[sample, band]`.
    pub(super) left: Vec<f32>,
    /// Number of sample values, over all bands, that the narrow lobe raises clearly above the background: by more than
    /// 35 %.
    pub(super) values: u64,
}

/// Finds a lobe of a BRDF that is too narrow for triangles, and separates it from the samples. Returns `None` if the
/// samples show no such lobe.
pub(super) fn split(
    plan: &Plan,
    rows: &Rows<'_>,
    sigma: Option<&[f32]>,
    channels: &Channels,
    incidences: &[Incidence],
) -> Option<Split> {
    let scan = Scan::new(plan, rows, incidences);
    let mut best: Option<Found> = None;
    for centre in [LobeCentre::Mirror, LobeCentre::Source] {
        let found = candidates::candidate(&scan, centre).and_then(|candidate| choose::best(&scan, &candidate));
        if let Some(found) = found
            && best.as_ref().is_none_or(|best| found.gain > best.gain)
        {
            best = Some(found);
        }
    }
    let found = best?;
    if choose::usually_within_half(&found) > ENOUGH {
        return None;
    }
    let colours = bands::colours(&scan, &found);
    let parameters = found.shape.parameters(found.near.mean_t, found.near.range());
    let mut lobe = Lobe::new(parameters).ok()?;
    let (mut left, values) = residual::residual(&scan, &found, &lobe, &colours);
    let left_rows = Rows::new(std::borrow::Cow::Borrowed(&left), sigma, rows.width);
    if !against_cells::is_better(&scan, &found, &left_rows) {
        return None;
    }
    drop(left_rows);
    let factor = bound::factor(&scan, &lobe, &colours, &left).max(DARKEST);
    if factor < 1.0 {
        let LobeParameters { peak: [p0, p1, p2], .. } = lobe.parameters();
        let peak = [p0 + libm::log(factor), p1, p2];
        lobe = Lobe::new(LobeParameters { peak, ..lobe.parameters() }).ok()?;
        left = residual::residual(&scan, &found, &lobe, &colours).0;
    }
    let (lobe, scale) = coloured(&lobe, channels, &colours.lobe)?;
    let elevations = elevations(&scan, &found);
    let samples_within_half = choose::within_half(&found);
    let light = range::light(&lobe, &elevations);
    let whole = light / (scale * factor);
    let range = || {
        let [low, high] = range::range(&found, &elevations, whole).map(|light| light * scale);
        // A lobe that was dimmed to conserve energy may lie below the range.
        [low.min(light), high.max(light)]
    };
    let light_range = (samples_within_half < CERTAIN).then(range);
    let carried = CarriedLobe {
        full_width: lobe.full_widths(),
        samples_within_half,
        is_resolved: samples_within_half >= RESOLVED,
        light_range,
        light,
        incidences: elevations,
        reduced: (factor < 1.0).then_some(1.0 - factor),
        unseen_bands: colours.unseen,
        lobe,
    };
    Some(Split { carried, left, values })
}

/// Returns the lobe with a colour factor for each wavelength of the tensor, normalised to a mean of 1. Also returns the
/// factor by which the lobe grew in exchange.
fn coloured(lobe: &Lobe, channels: &Channels, colours: &[f64]) -> Option<(Lobe, f64)> {
    let mut on_axis = vec![0.0_f32; channels.to()];
    channels.write(colours, &mut on_axis);
    on_axis.iter_mut().filter(|colour| colour.is_nan()).for_each(|colour| *colour = 0.0);
    let mean = on_axis.iter().map(|&colour| f64::from(colour)).sum::<f64>() / on_axis.len() as f64;
    if mean.is_nan() || mean <= 0.0 {
        return None;
    }
    let colours = on_axis.iter().map(|&colour| (f64::from(colour) / mean) as f32).collect();
    let LobeParameters { peak: [p0, p1, p2], .. } = lobe.parameters();
    let peak = [p0 + libm::log(mean), p1, p2];
    Lobe::new(LobeParameters { peak, colours, ..lobe.parameters() }).ok().map(|lobe| (lobe, mean))
}

/// Returns the polar angles of the incoming directions to which a lobe was fitted, in degrees.
fn elevations(scan: &Scan<'_>, found: &Found) -> Vec<f64> {
    let wi =
        |group: &Vec<near::Sample>| -> Option<Vector> { Some(scan.plan.directions[group.first()?.row as usize].0) };
    found.near.groups.iter().filter_map(wi).map(|wi| Direction::from_unit(wi).theta_degrees()).collect()
}
