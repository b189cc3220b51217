//! Projection of samples that already lie on final axes: kept, made coarser, or resampled to other wavelengths.

use super::averages::Averages;
use super::error::{LevelError, ProjectionError, Role};
use super::projected::{Coverage, Projected};
use super::request::AxesRequest;
use super::resampling::{Directions, Resampling};
use super::spectral;
use crate::domain::{Axis, Layout, Measurement, Note, Sampling, Tensor, check_axes};
use crate::formats::Acquisition;
use crate::notes::ProjectionNote;

/// Projects `tensor`, whose axes the result can keep (wavelengths, grids or triangles of directions), onto the
/// requested axes. Averages its samples over coarser triangles or wavelength bands if the request demands it; otherwise
/// they stay unchanged.
pub(super) fn project(
    acquisition: &Acquisition,
    tensor: &Tensor,
    sampling: Sampling,
    request: &AxesRequest,
) -> Result<Projected, ProjectionError> {
    let layout = Layout::of(acquisition.quantity, tensor.axes())?;
    let role = |axis: Option<usize>| axis.map(|i| &tensor.axes()[i]);
    let mut notes = Vec::new();
    let (incoming_axis, incoming) = coarsen(Role::Incoming, role(layout.incoming), request.incoming_level, &mut notes)?;
    let (outgoing_axis, outgoing) = coarsen(Role::Outgoing, role(layout.outgoing), request.outgoing_level, &mut notes)?;
    let spectral =
        spectral::plan(role(layout.spectral), acquisition.spectral_factor.as_ref(), request.wavelengths.as_ref())?;
    notes.extend(spectral.notes);

    let mut axes = tensor.axes()[..layout.indices].to_vec();
    let outer = axes.iter().map(Axis::len).product();
    axes.extend([incoming_axis, outgoing_axis, spectral.axis].into_iter().flatten());
    check_axes(&axes)?;
    let averaged = [&incoming, &outgoing].iter().any(|d| matches!(d, Directions::Averaged { .. }));
    let resampling = Resampling { outer, incoming, outgoing, channels: spectral.channels };
    let tensor = if resampling.is_identity() {
        notes.push(ProjectionNote::AsInFile.into());
        tensor.clone()
    } else {
        Tensor::new(axes, resampling.apply(tensor.samples(), tensor.masked() > 0))?
    };
    let samples = tensor.samples();

    let width = resampling.channels.to();
    let cells = samples.len() / width;
    let empty = samples.chunks(width).filter(|spectrum| spectrum.iter().all(|s| s.is_nan())).count();
    let coverage = Coverage {
        cells: cells as u64,
        measured: (cells - empty) as u64,
        empty: empty as u64,
        notes,
        ..Coverage::default()
    };
    let sampling = if averaged { Sampling::Average } else { sampling };
    let measurement = Measurement::new(acquisition.quantity, acquisition.unit, sampling, tensor)?;
    Ok(Projected { measurement, coverage, filled: Vec::new(), numbers: None, scattered: None, lobe: None })
}

/// Returns the direction axis at the coarser triangle `level`, and the averages that convert samples on `axis` to it.
fn coarsen(
    role: Role,
    axis: Option<&Axis>,
    level: Option<u8>,
    notes: &mut Vec<Note>,
) -> Result<(Option<Axis>, Directions), ProjectionError> {
    let unfit = |level| Err(ProjectionError::Level { role, level });
    let kept = || (axis.cloned(), Directions::Kept(axis.map_or(1, Axis::len)));
    let Some(level) = level else { return Ok(kept()) };
    let mesh = match axis {
        Some(Axis::Triangles(mesh)) => *mesh,
        None => return unfit(LevelError::NoDirections),
        Some(Axis::Elevation(values)) => return unfit(LevelError::Isotropic { elevations: values.len() }),
        Some(other) => return unfit(LevelError::NoTriangles { axis: Box::new(other.clone()) }),
    };
    let Some(depth) = mesh.level().checked_sub(level) else {
        return unfit(LevelError::TooFine { found: level, mesh });
    };
    if depth == 0 {
        return Ok(kept());
    }
    let coarse = (0..depth).try_fold(mesh, |mesh, _| mesh.coarser());
    let means = ProjectionNote::LevelMeans {
        role: role.name(),
        level,
        triangles: 1_u32 << (2 * u32::from(depth)),
        file_level: mesh.level(),
    };
    notes.push(means.into());
    let averages = Averages::over_children(mesh, depth);
    Ok((coarse.map(Axis::Triangles), Directions::Averaged { from: mesh.len(), averages }))
}
