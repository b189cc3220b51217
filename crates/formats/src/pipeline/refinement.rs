//! Scattered samples on triangles that are refined until a material adds little to the noise of the samples.

use super::error::PipelineError;
use super::fit::{AtSamples, FitReport, at_samples, promised, scatter_of};
use super::request::Request;
use crate::domain::Axis;
use crate::evaluate::Material;
use crate::formats::Acquisition;
use crate::projection::{self, Projected};

/// A finer level must add less by this factor: else none represents the samples better.
const GAIN: f64 = 0.95;

/// A projection onto triangles that were tried.
pub(super) struct Refined {
    pub(super) projected: Projected,
    pub(super) tried: Tried,
}

/// Axes that were tried, and how well cells on them fit the samples where these are scattered.
pub(super) struct Tried {
    axes: Vec<Axis>,
    /// Error that the cells add before they are compressed; `None` where samples are not scattered.
    fit: Option<FitReport>,
    /// Levels finer than the one that fits the spacing of the samples.
    finer: u8,
    /// True where no finer level is left to try.
    is_last: bool,
}

/// Puts a measurement on the axes that `request` asks for, scattered samples on the coarsest triangles that leave room for the
/// promised error, or on the best tried.
pub(super) fn refined(acquisition: &Acquisition, request: &Request) -> Result<Refined, PipelineError> {
    let mut best = at(acquisition, request, 0)?;
    loop {
        let is_good = best.tried.fit.is_none_or(|fit| {
            let error = promised(request.target, 0.0);
            fit.added * fit.added + error * error <= fit.allowed * fit.allowed
        });
        if is_good {
            return Ok(best);
        }
        match best.tried.finer(acquisition, request)? {
            Some(finer) => best = finer,
            None => return Ok(Refined { tried: Tried { is_last: true, ..best.tried }, ..best }),
        }
    }
}

fn at(acquisition: &Acquisition, request: &Request, finer: u8) -> Result<Refined, PipelineError> {
    let axes = projection::AxesRequest { finer, ..request.axes()? };
    let projected = projection::project(acquisition, &axes)?;
    let fit = projected.scattered.as_ref().map(|samples| {
        // A tensor that does not open is compressed all the same, and says so then.
        let found = Material::of(projected.measurement.clone()).map(|material| match &projected.lobe {
            Some(carried) => material.with_lobe(carried.lobe.clone()),
            None => material,
        });
        let found =
            found.map_or_else(|_| AtSamples::default(), |material| at_samples(acquisition, samples, &material, None));
        FitReport::new(&scatter_of(&projected), &found, promised(request.target, 0.0))
    });
    let axes = projected.measurement.tensor.axes().to_vec();
    Ok(Refined { projected, tried: Tried { axes, fit, finer, is_last: request.outgoing_level.is_some() } })
}

impl Tried {
    /// The samples on the next finer level; `None` where there is none, or none that fits them better.
    pub(super) fn finer(&self, acquisition: &Acquisition, request: &Request) -> Result<Option<Refined>, PipelineError> {
        let Some(fit) = self.fit.filter(|_| !self.is_last) else { return Ok(None) };
        let next = at(acquisition, request, self.finer + 1)?;
        let is_better = next.tried.fit.is_some_and(|next| next.added < GAIN * fit.added);
        Ok(Some(next).filter(|next| is_better && next.tried.axes != self.axes))
    }
}

/// A warning of a material on `axes` that adds more than it may.
pub(super) fn warning(fit: &FitReport, axes: &[Axis], is_named: bool) -> Option<String> {
    if fit.is_kept() {
        return None;
    }
    let level =
        axes.iter().rev().find_map(|axis| if let Axis::Triangles(mesh) = axis { Some(mesh.level()) } else { None });
    let (which, advice) = if is_named {
        ("", "give a finer outgoing_level, or none")
    } else {
        (", the best tried,", "give a finer outgoing_level, or a larger error")
    };
    let noise = fit.noise.map_or_else(|| "unknown".to_owned(), |noise| format!("{:.2} %", 100.0 * noise));
    Some(format!(
        "outgoing level {}{which} adds er(L2) {:.2} % to the noise of the samples ({noise}), more than {:.2} % (twice the \
         promised error, or half the noise): {advice}",
        level.unwrap_or(0),
        100.0 * fit.added,
        100.0 * fit.allowed
    ))
}
