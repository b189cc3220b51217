//! Projection of samples at scattered directions: averages of local fits over triangles. Holes are filled by declared
//! rules and marked.
//!
//! 1. Samples are grouped by incoming direction ([`cloud`]); isotropic data keep their elevations. The extent and
//!    density of the samples ([`extent`]) determine levels and axes ([`plan`]).
//! 2. Withheld samples determine the number of neighbours of a fit, and whether the data are symmetric ([`withheld`],
//!    [`trials`]).
//! 3. Each triangle is the mean of fits within it ([`cells`]). For reflection the coordinates are slopes of the half
//!    vector; logarithms are fitted if all samples around are positive. Samples around a block of triangles are looked
//!    up once ([`nearby`], in a [`tree`]). A fit ([`fit`]) gathers its samples as columns ([`gathering`]), solves for
//!    them ([`system`]) and averages their rows of bands ([`rows`]).
//! 4. Holes are extrapolated, or filled from mirror images or reciprocal directions if the data allow it ([`fill`]).
//! 5. A lobe narrower than the cells is fitted to all samples together and stored beside the cells. The cells are
//!    fitted to the samples minus the lobe ([`lobe`]).
//! 6. Differences between neighbouring samples give their noise and the rejected samples ([`noise`]). A material is
//!    compared with the others at their own directions ([`at_samples`]). Samples of a narrow lobe differ from their
//!    neighbours, too, but lie close together ([`together`], in the coordinates of [`relative`]); if there are too few,
//!    they may still stand about one centre ([`centred`]). Under each incoming
//!    direction ([`incidences`]) the light of the samples is their sum, weighted by the areas that they represent
//!    ([`areas`]).

mod areas;
mod around;
pub(super) mod at_samples;
mod cells;
mod centred;
mod check;
mod cloud;
mod extent;
mod fill;
mod fit;
mod gathering;
mod incidences;
pub(super) mod lobe;
mod nearby;
mod noise;
mod plan;
mod relative;
pub(super) mod report;
mod rows;
mod system;
#[cfg(test)]
mod tests;
mod together;
#[cfg(test)]
mod together_tests;
mod tree;
mod trials;
mod withheld;

pub(super) use areas::areas;
pub use at_samples::ScatteredSamples;
pub(super) use cloud::directions;
pub use incidences::Incidence;
pub use lobe::CarriedLobe;
pub use report::{Rejected, ScatterReport, UnresolvedLobe};

use super::error::ProjectionError;
use super::projected::{Coverage, Projected};
use super::request::AxesRequest;
use super::spectral::{self, Spectral};
use crate::domain::{Axis, Layout, Measurement, Note, Quantity, Sampling, Tensor, check_axes};
use crate::formats::{Acquisition, Scattered};
use crate::notes::FitNote;
use cells::{Standing, standings};
use incidences::incidences;
use lobe::Split;
use noise::{Scatter, scatter};
use plan::Plan;
use rows::{Kind, Rows};
use std::borrow::Cow;
use trials::is_symmetric;

/// Projects the samples `scattered` of a file, which lie at scattered directions, onto the requested axes.
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
    let incidences = incidences(acquisition.quantity, &plan, !scattered.incoming.is_empty());
    let sigma = scattered.sigma.as_deref();
    let split = (acquisition.quantity == Quantity::Brdf && !scattered.incoming.is_empty())
        .then(|| lobe::split(&plan, &rows, sigma, &channels, &incidences))
        .flatten();
    // Rows for the cells, the lobe beside them, and the number of values that differ from their neighbours because of
    // it.
    let (rows, carried, of_lobe) = match split {
        Some(Split { carried, left, values }) => {
            notes.push(carried.note());
            (Rows::new(Cow::Owned(left), sigma, width), Some(carried), values)
        }
        None => (rows, None, 0),
    };

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
            notes.extend((filled > 0).then(|| FitNote::FromMirrorImages { cells: filled }.into()));
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
    let mut found = scatter(acquisition.quantity, &plan, &rows, &channels);
    found.lobe += of_lobe;
    let report = report_of(scattered, &plan, &rows, &found);
    notes.extend(remarks(&report, scattered.values.len(), number(Standing::Filled), number(Standing::Empty)));
    let coverage = Coverage {
        cells: standing.len() as u64,
        measured: number(Standing::Measured),
        interpolated: number(Standing::Interpolated),
        filled: number(Standing::Filled),
        empty: number(Standing::Empty),
        notes,
        contradictions: None,
        scatter: Some(Box::new(report)),
    };
    let filled =
        if coverage.filled > 0 { standing.iter().map(|s| *s == Standing::Filled).collect() } else { Vec::new() };
    let samples = ScatteredSamples {
        is_turned: scattered.outgoing.is_empty(),
        has_incoming: !scattered.incoming.is_empty(),
        has_outgoing: !scattered.outgoing.is_empty(),
        domain: plan.outgoing.mesh.domain(),
        quantity: acquisition.quantity,
        incidences,
        directions: plan.directions,
        channels,
        rejected: found.rejected,
    };
    Ok(Projected { measurement, coverage, filled, numbers: None, scattered: Some(samples), lobe: carried })
}

/// Returns a report on scattered samples: counts, noise and outliers.
fn report_of(scattered: &Scattered, plan: &Plan, rows: &Rows<'_>, found: &Scatter) -> ScatterReport {
    let positive = found.positive.max(1) as f64;
    let share = |values: u64, light| Rejected { values, samples: values as f64 / positive, light };
    let isolated = found.rejected.iter().filter(|rejection| !rejection.is_together).count() as u64;
    ScatterReport {
        samples: rows.kinds.iter().filter(|kind| **kind != Kind::Missing).count() as u64,
        missing: scattered.values.iter().filter(|v| v.is_nan()).count() as u64,
        negative: scattered.values.iter().filter(|v| **v < 0.0).count() as u64,
        neighbours: plan.neighbours,
        noise: found.noise,
        rejected: share(found.rejected.len() as u64, found.light),
        isolated: share(isolated, found.isolated_light),
        lobe: found.lobe,
        unresolved: found.unresolved,
    }
}

/// Returns notes for the user: how many of the `values` measured values are missing or negative, and how many cells of
/// the tensor were filled in or left empty because no sample is near.
fn remarks(report: &ScatterReport, values: usize, filled: u64, empty: u64) -> Vec<Note> {
    let mut notes: Vec<Note> = Vec::new();
    if report.missing > 0 {
        notes.push(FitNote::Missing { values: report.missing }.into());
    }
    if report.negative > 0 {
        let share_percent = 100.0 * report.negative as f64 / values.max(1) as f64;
        notes.push(FitNote::Negative { values: report.negative, share_percent }.into());
    }
    if filled > 0 {
        notes.push(FitNote::Continued { cells: filled }.into());
    }
    if empty > 0 {
        notes.push(FitNote::FarFromSamples { cells: empty }.into());
    }
    notes
}
