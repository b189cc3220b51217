//! Samples at directions of their own → averages over triangles of a local fit, holes filled by declared rules and marked.
//!
//! 1. Samples are grouped by incoming direction ([`cloud`]); isotropic data keep their elevations. How far and how densely
//!    they lie ([`extent`]) chooses levels and axes ([`plan`]).
//! 2. Withheld samples choose how many neighbours a value is fitted to, and tell whether the data are symmetric ([`trials`]).
//! 3. Each triangle is the mean of fits within it ([`cells`]): in slopes of the half vector for reflection, of logarithms
//!    where all samples around are positive. Samples around a block of triangles are looked up once ([`nearby`], in a
//!    [`tree`]); a fit ([`fit`]) takes its own from them as columns ([`gathering`]), solves for them ([`system`]) and weighs their
//!    rows of bands ([`rows`]).
//! 4. Holes are continued, or taken from mirror images or reciprocal directions where these hold ([`fill`]).
//! 5. The report has errors at the original samples and at withheld ones ([`report`]).

mod cells;
mod check;
mod cloud;
mod extent;
mod fill;
mod fit;
mod gathering;
mod nearby;
mod plan;
mod report;
mod rows;
mod system;
#[cfg(test)]
mod tests;
mod tree;
mod trials;

pub use report::{Regions, ScatterReport, Scores};

use super::spectral::{self, Spectral};
use super::{AxesRequest, Coverage, Projected, ProjectionError};
use crate::domain::vector::Vector;
use crate::domain::{Axis, ErrorAccumulator, ErrorReport, Layout, Measurement, Sampling, Tensor, check_axes};
use crate::formats::{Acquisition, Scattered};
use cells::{Fitted, Standing, standings};
use plan::{Located, Plan};
use rayon::prelude::*;
use report::{Region, Tally, brightest, compare, region};
use rows::{Kind, Rows};
use std::borrow::Cow;
use trials::{is_symmetric, trials};

/// Samples that are compared with the fit and left out at most.
const COMPARED: usize = 2000;
/// Values that are compared with the fit at most, in all bands.
const COMPARED_VALUES: usize = 1 << 20;
/// Samples are compared with cells in pieces.
const PIECE: usize = 1 << 12;

/// Projects `scattered`, the samples of `acquisition`.
pub(super) fn project(
    acquisition: &Acquisition,
    scattered: &Scattered,
    request: &AxesRequest,
) -> Result<Projected, ProjectionError> {
    let width = check::check(scattered)?;
    let Spectral { axis: spectral_axis, channels, notes: spectral_notes } = spectral::plan(
        scattered.spectral.as_ref(),
        acquisition.spectral_factor.as_ref(),
        request.wavelengths.as_ref(),
    )?;
    let rows = Rows::new(Cow::Borrowed(&scattered.values), scattered.sigma.as_deref(), width);
    let plan = Plan::new(acquisition.quantity, scattered, &rows, request, channels.to())?;
    let axes: Vec<Axis> = [plan.incoming_axis(), Some(Axis::Triangles(plan.outgoing.mesh)), spectral_axis]
        .into_iter()
        .flatten()
        .collect();
    Layout::of(acquisition.quantity, &axes)?;
    let count = check_axes(&axes)?;
    let mut notes = plan.notes.clone();
    notes.extend(spectral_notes);

    let mesh = plan.outgoing.mesh;
    let plane = mesh.len() * channels.to();
    let mut samples = vec![0.0_f32; count];
    let mut standing: Vec<Standing> = Vec::with_capacity(plan.entries.len() * mesh.len());
    let located = plan.located();
    let has_sample = located.has_sample.chunks(mesh.len());
    for ((entry, out), has_sample) in plan.entries.iter().zip(samples.chunks_mut(plane)).zip(has_sample) {
        let fitted = plan.fitted(&rows, entry.cloud);
        let drafts = fitted.cells(entry.wi, mesh, plan.parts, &channels, &|cell| Some(has_sample[cell]), out);
        standing.extend(standings(&drafts));
    }
    if plan.isotropic && !plan.unfolded && standing.iter().any(|s| matches!(s, Standing::Filled | Standing::Empty)) {
        let like = plan.fitted(plan.few(&rows), 0);
        if is_symmetric(&plan.clouds, like) {
            let filled = fill::by_symmetry(&plan, &rows, &channels, &mut samples, &mut standing);
            notes.extend((filled > 0).then(|| {
                format!("{filled} cells are filled from mirror images in the plane of incidence: withheld samples are predicted as well from there as from their own side")
            }));
        }
    }
    notes.extend(fill::by_reciprocity(acquisition.quantity, &plan, channels.to(), &mut samples, &mut standing));
    for (spectrum, standing) in samples.chunks_mut(channels.to()).zip(&mut standing) {
        if *standing == Standing::Empty {
            spectrum.fill(f32::NAN);
        } else if spectrum.iter().all(|v| v.is_nan()) {
            *standing = Standing::Empty;
        }
    }
    let tensor = Tensor::new(axes, samples)?;
    let measurement = Measurement::new(acquisition.quantity, acquisition.unit, Sampling::Average, tensor)?;
    let number = |wanted: Standing| standing.iter().filter(|s| **s == wanted).count() as u64;
    let report = report_of(acquisition, scattered, (&plan, &located), &rows, &measurement);
    notes.extend(remarks(&report, number(Standing::Filled), number(Standing::Empty)));
    let coverage = Coverage {
        cells: standing.len() as u64,
        measured: number(Standing::Measured),
        interpolated: number(Standing::Interpolated),
        filled: number(Standing::Filled),
        empty: number(Standing::Empty),
        notes,
        scatter: Some(Box::new(report)),
    };
    let filled =
        if coverage.filled > 0 { standing.iter().map(|s| *s == Standing::Filled).collect() } else { Vec::new() };
    Ok(Projected { measurement, coverage, filled })
}

fn remarks(report: &ScatterReport, filled: u64, empty: u64) -> Vec<String> {
    let mut notes = Vec::new();
    if report.missing > 0 {
        notes.push(format!("{} values are missing and left out of the fits", report.missing));
    }
    if report.negative > 0 {
        notes.push(format!(
            "{} values are negative and kept: fits around them are of values, not of logarithms",
            report.negative
        ));
    }
    if filled > 0 {
        notes.push(format!("{filled} cells without samples in or around them are filled and marked as such; without another rule they continue the fit of the samples around"));
    }
    if empty > 0 {
        notes.push(format!("{empty} cells are too far from any sample: masked"));
    }
    notes
}

fn report_of(
    acquisition: &Acquisition,
    scattered: &Scattered,
    (plan, located): (&Plan, &Located),
    rows: &Rows<'_>,
    measurement: &Measurement,
) -> ScatterReport {
    let light = |row: u32| rows.row(row).iter().map(|&v| f64::from(v)).filter(|v| !v.is_nan()).sum::<f64>();
    let mut regions = vec![Region::Middle; rows.kinds.len()];
    for members in &located.rows {
        let most = brightest(members.iter().map(|&row| light(row)).collect());
        for &row in members {
            regions[row as usize] = region(light(row), most, plan.directions[row as usize].1[2]);
        }
    }
    let count = COMPARED.min(COMPARED_VALUES / rows.width).max(100);
    let compared = trials(&plan.clouds, count);
    let like: Fitted<'_> = plan.fitted(rows, 0);
    let (left_out, outliers) = compare(&plan.clouds, like, &compared, &regions, true);
    let (fit, _) = compare(&plan.clouds, like, &compared, &regions, false);
    let mut tally = Tally::default();
    each_sample(acquisition, scattered, (measurement, Some(&located.cells)), |row, original, found| {
        original.iter().zip(found).for_each(|(&o, &f)| tally.add(regions[row], f, o));
    });
    ScatterReport {
        samples: rows.kinds.iter().filter(|kind| **kind != Kind::Missing).count() as u64,
        missing: scattered.values.iter().filter(|v| v.is_nan()).count() as u64,
        negative: scattered.values.iter().filter(|v| **v < 0.0).count() as u64,
        neighbours: plan.neighbours,
        left_out,
        fit,
        constant: tally.finish(),
        outliers,
        representation: plan.representation,
    }
}

/// The errors of `measurement` at the samples of `scattered`, each looked up in its cell (elevations: in the nearest).
pub(super) fn errors(
    acquisition: &Acquisition,
    scattered: &Scattered,
    measurement: &Measurement,
) -> Option<ErrorReport> {
    let mut errors = ErrorAccumulator::default();
    let (mut original, mut decoded) = (Vec::new(), Vec::new());
    each_sample(acquisition, scattered, (measurement, None), |row, o, d| {
        original.extend_from_slice(o);
        decoded.extend_from_slice(d);
        if (row + 1).is_multiple_of(PIECE) {
            errors.add(&original, &decoded, 0.0);
            original.clear();
            decoded.clear();
        }
    })?;
    errors.add(&original, &decoded, 0.0);
    Some(errors.finish())
}

/// Calls `with` for every sample in the tensor's directions: its number, its values, and those of its cell. `None` if the
/// tensor is not one of this file. `known` are the cells `[incoming, outgoing]` of the samples, if someone has them.
fn each_sample(
    acquisition: &Acquisition,
    scattered: &Scattered,
    (measurement, known): (&Measurement, Option<&[Option<usize>]>),
    mut with: impl FnMut(usize, &[f32], &[f32]),
) -> Option<()> {
    let layout = measurement.layout().ok()?;
    let axes = measurement.tensor.axes();
    let role = |axis: Option<usize>| axis.map(|i| &axes[i]);
    let factor = acquisition.spectral_factor.as_ref();
    let (width, channels) = super::samples::channels(scattered.spectral.as_ref(), factor, role(layout.spectral))?;
    let isotropic = matches!(role(layout.incoming), Some(Axis::Elevation(_)));
    if layout.indices > 0 || scattered.directions() * width != scattered.values.len() {
        return None;
    }
    let length = |axis: Option<usize>| axis.map_or(1, |i| axes[i].len());
    let (n_out, out_width) = (length(layout.outgoing), length(layout.spectral));
    let (mut original, mut found) = (vec![0.0; channels.len()], vec![0.0; channels.len()]);
    let cells = match known {
        Some(known) => Cow::Borrowed(known),
        None => Cow::Owned(check::is_sound(scattered).then(|| {
            let at = |axis: Option<&Axis>, d: Vector, theta: f64| {
                axis.map_or(Some(0), |axis| plan::entry_of(axis, d, theta))
            };
            let cell = |(row, &(wi, wo)): (usize, &(Vector, Vector))| {
                let theta = scattered.incoming.get(row).map_or(0.0, |wi| wi[0]);
                Some(at(role(layout.incoming), wi, theta)? * n_out + at(role(layout.outgoing), wo, theta)?)
            };
            cloud::directions(scattered, isotropic).par_iter().enumerate().map(cell).collect()
        })?),
    };
    for (row, &cell) in cells.iter().enumerate() {
        let Some(cell) = cell else { continue };
        let source = &scattered.values[row * width..][..width];
        let target = &measurement.tensor.samples()[cell * out_width..][..out_width];
        for ((original, found), channel) in original.iter_mut().zip(&mut found).zip(&channels) {
            (*original, *found) = channel.pair(source, target);
        }
        with(row, &original, &found);
    }
    Some(())
}
