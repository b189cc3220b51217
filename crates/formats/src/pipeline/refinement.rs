//! Refinement of the triangles for scattered samples until the cells add little error to the noise.

use super::error::PipelineError;
use super::fit::{AtSamples, FitReport, at_samples, promised, scatter_of};
use super::request::Request;
use crate::domain::{Axis, Note};
use crate::evaluate::Material;
use crate::formats::Acquisition;
use crate::notes::MaterialNote;
use crate::projection::{self, Projected};

/// Ratio of the error added at a finer subdivision level of triangles to that at the coarser level, below which the
/// finer level is used. Raising it accepts levels that gain less.
const GAIN: f64 = 0.95;

/// A measurement projected onto triangles, with the subdivision level that was tried for it.
pub(super) struct Refined {
    pub(super) projected: Projected,
    pub(super) tried: Tried,
}

/// Tensor axes onto which a measurement was projected on trial, and the errors of the values on the triangles of
/// directions at the scattered samples.
pub(super) struct Tried {
    axes: Vec<Axis>,
    /// Report on the deviations of the samples from the values on the triangles before compression; `None` if the
    /// samples are not scattered.
    fit: Option<FitReport>,
    /// Number of subdivision levels by which the tried triangles are finer than those that fit the spacing of the
    /// samples.
    finer: u8,
    /// True if no finer subdivision level of the triangles is left to try.
    is_last: bool,
}

/// Projects a measurement onto the axes of `request`. Scattered samples get the coarsest triangles whose error leaves
/// room for the promised error, or the best triangles tried.
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
        // A tensor that cannot be opened is compressed nevertheless; the error appears then.
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
    /// Projects the samples onto triangles of the next finer subdivision level. Returns `None` if no level is left or
    /// the finer one is not clearly better.
    pub(super) fn finer(&self, acquisition: &Acquisition, request: &Request) -> Result<Option<Refined>, PipelineError> {
        let Some(fit) = self.fit.filter(|_| !self.is_last) else { return Ok(None) };
        let next = at(acquisition, request, self.finer + 1)?;
        let is_better = next.tried.fit.is_some_and(|next| next.added < GAIN * fit.added);
        Ok(Some(next).filter(|next| is_better && next.tried.axes != self.axes))
    }
}

/// Returns a warning if a material on `axes` adds more error to the noise of its samples than allowed. `is_named` is
/// true if the user gave the subdivision level.
pub(super) fn warning(fit: &FitReport, axes: &[Axis], is_named: bool) -> Option<Note> {
    if fit.is_kept() {
        return None;
    }
    let level =
        axes.iter().rev().find_map(|axis| if let Axis::Triangles(mesh) = axis { Some(mesh.level()) } else { None });
    let note = MaterialNote::LevelCoarse {
        level: level.unwrap_or(0),
        is_named,
        added_percent: 100.0 * fit.added,
        noise_percent: fit.noise.map(|noise| 100.0 * noise),
        allowed_percent: 100.0 * fit.allowed,
    };
    Some(note.into())
}

/// Returns a warning if a material adds more error to the noise of its samples than `promised`, though no more than
/// [`warning`] allows.
pub(super) fn above_noise(fit: &FitReport, promised: f64) -> Option<Note> {
    let note = MaterialNote::AboveNoise {
        added_percent: 100.0 * fit.added,
        noise_percent: fit.noise.map(|noise| 100.0 * noise),
        promised_percent: 100.0 * promised,
    };
    (fit.is_kept() && fit.added > promised).then(|| note.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::ErrorReport;
    use crate::projection::ScatterReport;

    #[test]
    fn more_error_than_promised_is_warned_of_before_it_is_too_much() {
        let scatter = ScatterReport { noise: Some(0.01), ..ScatterReport::default() };
        for (er_l2, is_above, is_coarse) in [(0.0141, false, false), (0.0155, true, false), (0.025, false, true)] {
            let errors = ErrorReport { er_l2, ..ErrorReport::default() };
            let fit = FitReport::new(&scatter, &AtSamples { errors, ..AtSamples::default() }, 0.01);
            let found = above_noise(&fit, 0.01);
            assert_eq!((found.is_some(), warning(&fit, &[], false).is_some()), (is_above, is_coarse), "{er_l2}");
            let expected =
                "the material adds er(L2) 1.18 % to the noise of the samples (1.00 %), more than the promised 1.00 %";
            assert!(found.is_none_or(|note| note.message.starts_with(expected)));
        }
    }
}
