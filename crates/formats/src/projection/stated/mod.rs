//! Projection of direction grids onto the same grids: only wavelengths are resampled.

#[cfg(test)]
mod tests;

use super::error::{AnglesError, DomainError, ProjectionError, Role};
use super::grid;
use super::planes;
use super::projected::{Coverage, Numbers, Projected};
use super::request::{AxesRequest, DirectionDomain};
use super::resampling::{Directions, Resampling};
use super::spectral;
use crate::domain::{
    Axis, Azimuths, DirectionGrid, Domain, Frame, Layout, Measurement, Note, Quantity, Sampling, Tensor,
};
use crate::formats::{Acquisition, Contradictions, Modelled, Samples, StatedGrid};
use crate::notes::ProjectionNote;

/// Returns true if a file's samples are to be converted to a tensor on the file's own grid of directions. Fails if the
/// user demands a grid that the file lacks, or triangles for a tensor that must stay on its grid.
pub(super) fn is_wanted(samples: &Samples, request: &AxesRequest) -> Result<bool, ProjectionError> {
    let wanted = request.domain()?;
    let is_named = request.domain.is_some();
    match samples {
        Samples::Grid(_) => Ok(wanted == DirectionDomain::Grid),
        Samples::Function(modelled) if modelled.stated.is_some() => Ok(wanted == DirectionDomain::Grid),
        // Such a tensor stays unchanged, whatever the default.
        Samples::OnAxes { tensor, .. } if tensor.axes().iter().any(|axis| matches!(axis, Axis::Grid(_))) => {
            if is_named && wanted == DirectionDomain::Triangles { Err(DomainError::Final.into()) } else { Ok(false) }
        }
        _ if is_named && wanted == DirectionDomain::Grid => Err(DomainError::NoGrid.into()),
        _ => Ok(false),
    }
}

/// Converts the samples of a file to a tensor on the file's own grid of directions, without resampling them to
/// triangles. Fails for samples without a grid.
pub(super) fn project(
    acquisition: &Acquisition,
    samples: &Samples,
    request: &AxesRequest,
) -> Result<Projected, ProjectionError> {
    let stated = match samples {
        Samples::Grid(grid) => {
            grid::check_values(grid)?;
            grid::check_sides(acquisition.quantity, grid)?;
            grid.as_stated()?
        }
        Samples::Function(Modelled { stated: Some(stated), .. }) => (**stated).clone(),
        _ => return Err(DomainError::NoGrid.into()),
    };
    let StatedGrid { tensor, factor, repeated } = stated;
    let (numbers, left_out) = within(acquisition.quantity, tensor)?;
    let layout = Layout::of(acquisition.quantity, numbers.axes())?;
    let length = |axis: Option<usize>| axis.map_or(1, |i| numbers.axes()[i].len());
    let own = layout.spectral.map(|i| &numbers.axes()[i]);
    let spectral = spectral::plan(own, acquisition.spectral_factor.as_ref(), request.wavelengths.as_ref())?;
    let resampling = Resampling {
        outer: numbers.axes()[..layout.indices].iter().map(Axis::len).product(),
        incoming: Directions::Kept(length(layout.incoming)),
        outgoing: Directions::Kept(length(layout.outgoing)),
        channels: spectral.channels,
    };
    let (missing, all) = (numbers.masked(), numbers.len());
    let values = scaled(&numbers, factor)?;
    let is_kept = resampling.is_identity();
    let tensor = if is_kept {
        values
    } else {
        let directions = numbers.axes().iter().filter(|axis| !axis.is_spectral()).cloned();
        let axes = directions.chain(spectral.axis).collect();
        Tensor::new(axes, resampling.apply(values.samples(), missing > 0))?
    };

    let mut notes = Vec::new();
    // The incoming direction of a list over the scattering angle is artificial.
    let incoming = layout.incoming.filter(|_| acquisition.quantity != Quantity::Phase);
    for (role, axis) in [(Role::Incoming, incoming), (Role::Outgoing, layout.outgoing)] {
        let stated =
            axis.map(|i| ProjectionNote::AxisAsStated { role: role.name(), axis: numbers.axes()[i].describe() });
        notes.extend(stated.map(Note::from));
    }
    notes.extend(left_out);
    notes.extend(planes::gap(acquisition));
    notes.extend(spectral.notes);
    // A reader that has counted them has said so.
    let is_said = acquisition.report.notes.iter().any(|note| note.code == "value-without-sample");
    if missing > 0 && !is_said {
        notes.push(ProjectionNote::MissingMasked { samples: missing, of: all }.into());
    }
    let contradictions = Contradictions::of(&numbers, repeated);
    notes.extend(contradictions.note());
    let width = resampling.channels.to();
    let cells = tensor.len() / width;
    let empty = tensor.samples().chunks(width).filter(|spectrum| spectrum.iter().all(|s| s.is_nan())).count();
    let coverage = Coverage {
        cells: cells as u64,
        measured: (cells - empty) as u64,
        empty: empty as u64,
        notes,
        contradictions: Some(contradictions).filter(|found| *found != Contradictions::default()),
        ..Coverage::default()
    };
    let measurement = Measurement::new(acquisition.quantity, acquisition.unit, Sampling::Point, tensor)?;
    let numbers = (is_kept && factor != 1.0).then_some(Numbers { tensor: numbers, factor });
    Ok(Projected { measurement, coverage, filled: Vec::new(), numbers, scattered: None, lobe: None })
}

/// Returns the numbers of the file times their common factor.
fn scaled(numbers: &Tensor, factor: f64) -> Result<Tensor, ProjectionError> {
    if factor == 1.0 {
        return Ok(numbers.clone());
    }
    let values = numbers.samples().iter().map(|&number| (f64::from(number) * factor) as f32).collect();
    Ok(Tensor::new(numbers.axes().to_vec(), values)?)
}

/// Returns the samples whose outgoing polar angles lie on the side of the surface that the quantity describes, and a
/// note if others were left out.
fn within(quantity: Quantity, tensor: Tensor) -> Result<(Tensor, Option<Note>), ProjectionError> {
    let (domain, low, high) = match quantity {
        Quantity::Brdf => (Domain::Hemisphere, 0.0, 90.0),
        Quantity::Btdf => (Domain::Lower, 90.0, 180.0),
        _ => return Ok((tensor, None)),
    };
    let outgoing = Layout::of(quantity, tensor.axes())?.outgoing;
    let Some((axis, Axis::Grid(directions))) = outgoing.map(|axis| (axis, &tensor.axes()[axis])) else {
        return Ok((tensor, None));
    };
    let (first, last) = directions.covers();
    if directions.frame() != Frame::Surface || first >= low && last <= high {
        return Ok((tensor, None));
    }
    let polar = directions.polar();
    let (from, to) = (polar.partition_point(|&theta| theta < low), polar.partition_point(|&theta| theta <= high));
    if from == to {
        let angles = AnglesError::Beside { low: first, high: last, domain, quantity };
        return Err(ProjectionError::Angles { role: Role::Outgoing, angles });
    }
    let azimuths: Option<Azimuths> = directions.azimuths().cloned();
    let part = DirectionGrid::new(directions.frame(), polar[from..to].to_vec(), azimuths)
        .and_then(|part| part.covering(first.max(low), last.min(high)));
    let part = part.map_err(|grid| ProjectionError::Grid(grid.into()))?.with_outside(directions.outside());
    let row = directions.shape()[1] * tensor.axes()[axis + 1..].iter().map(Axis::len).product::<usize>();
    let kept = tensor.samples().chunks_exact(row * polar.len()).flat_map(|table| &table[from * row..to * row]);
    let kept = kept.copied().collect();
    let mut axes = tensor.axes().to_vec();
    let left_out = polar.len() - (to - from);
    axes[axis] = Axis::Grid(part);
    let note = (left_out > 0)
        .then(|| ProjectionNote::ElevationsBeyond { elevations: left_out, of: polar.len(), domain }.into());
    Ok((Tensor::new(axes, kept)?, note))
}
