//! Projection of acquired samples onto chosen axes: a tensor of cell averages, with a coverage report.

mod angles;
mod averages;
mod bands;
mod error;
mod grid;
mod levels;
mod lobe_width;
mod modelled;
mod on_axes;
mod planes;
mod plausible;
mod projected;
mod reciprocal;
mod request;
mod resampling;
mod same_angle;
mod samples;
mod scattered;
mod spectral;
mod stated;
#[cfg(test)]
mod tests;

pub use error::{
    Angle, AnglesError, DomainError, LevelError, ProjectionError, ReciprocalError, Role, ScatteredError, SpectralError,
};
pub(crate) use lobe_width::unresolved_lobe;
pub(crate) use planes::scattered_samples;
pub use plausible::{Band, LargestAlbedo, Negatives, Plausibility, Reciprocity, implausible, plausibility};
pub use projected::{Coverage, Numbers, Projected};
pub use reciprocal::{Reciprocal, reciprocal};
pub use request::{AxesRequest, DirectionDomain};
pub use samples::error_at_samples;
pub use scattered::{CarriedLobe, Incidence, Rejected, ScatterReport, ScatteredSamples, UnresolvedLobe};

use crate::formats::{Acquisition, Samples};

/// Projects a measured file, `acquisition`, onto the axes of `request`.
///
/// The result is `[index…, incoming, outgoing, spectral]`, with NaN where nothing was measured.
///
/// - Samples on angles become averages of their bilinear interpolant over triangles. Isotropic incoming elevations
///   stay unchanged.
/// - Samples on final axes stay, or become averages over coarser triangles.
/// - A function given by the file is averaged over triangles, weighted by |cos θ| of the outgoing direction.
/// - Samples at scattered directions become averages of local fits; isotropic elevations stay. Holes are filled by
///   rules that the notes declare, and marked.
/// - Requested wavelengths become averages over their bands.
///
/// With [`DirectionDomain::Grid`] a grid of angles stays as the file states it. Each direction of the tensor is then
/// one of the file. Each sample is one of its numbers, times the file's multipliers.
pub fn project(acquisition: &Acquisition, request: &AxesRequest) -> Result<Projected, ProjectionError> {
    let instead = planes::instead(acquisition, request.domain()?);
    if let (Samples::Grid(grid), Some(_)) = (&acquisition.samples, &instead) {
        grid::check_values(grid)?;
    }
    let samples = instead.as_ref().map_or(&acquisition.samples, |(samples, _)| samples);
    let on_grid = stated::is_wanted(samples, request)?;
    let mut projected = match samples {
        samples if on_grid => stated::project(acquisition, samples, request)?,
        samples => project_samples(acquisition, samples, request)?,
    };
    if let Some((_, note)) = &instead {
        projected.coverage.notes.insert(0, note.clone());
    }
    if matches!(samples, Samples::Grid(_)) && !on_grid {
        projected.coverage.notes.extend(samples::coarseness(acquisition, &projected.measurement, request));
    }
    Ok(projected)
}

fn project_samples(
    acquisition: &Acquisition,
    samples: &Samples,
    request: &AxesRequest,
) -> Result<Projected, ProjectionError> {
    match samples {
        Samples::OnAxes { tensor, sampling } => on_axes::project(acquisition, tensor, *sampling, request),
        Samples::Grid(grid) => grid::project(acquisition, grid, request),
        Samples::Scattered(scattered) => scattered::project(acquisition, scattered, request),
        Samples::Function(modelled) => modelled::project(acquisition, modelled, request),
    }
}
