//! Grids whose angles leave the values between them undefined. One incoming azimuth is taken as isotropic; scan planes
//! become scattered samples where triangles are wanted.

use super::request::DirectionDomain;
use crate::domain::{Axis, Note, WIDEST_GAP};
use crate::formats::{Acquisition, AngleGrid, Angles, AzimuthExtent, Samples, Scattered};
use crate::notes::ProjectionNote;
use std::borrow::Cow;

/// Largest number of direction pairs for which a grid of scan planes is treated as scattered samples; larger grids are
/// averaged as grids. Scans in planes have fewer.
const MOST: usize = 1 << 22;

/// Names of file formats that define the function between any two of their azimuths, so that their grids are no
/// separate scan planes.
const DENSE: [&str; 1] = ["mbsdf"];

/// Returns the samples at scattered directions of a file that has no grid of angles, or whose grid consists of separate
/// scan planes.
pub(crate) fn scattered_samples(acquisition: &Acquisition) -> Option<Cow<'_, Scattered>> {
    match &acquisition.samples {
        Samples::Scattered(scattered) => Some(Cow::Borrowed(scattered)),
        _ => open_samples(acquisition).map(Cow::Owned),
    }
}

/// Returns samples that replace the grid of a measurement, and a note for the user; `None` if the grid is kept. If
/// triangles are `wanted`, scan planes become scattered samples.
pub(super) fn instead(acquisition: &Acquisition, wanted: DirectionDomain) -> Option<(Samples, Note)> {
    if wanted == DirectionDomain::Triangles
        && let Some(scattered) = open_samples(acquisition)
    {
        return Some((Samples::Scattered(scattered), ProjectionNote::WithoutGrid.into()));
    }
    let (grid, incoming, _) = pairs_of_directions(acquisition)?;
    let azimuth = single_azimuth(incoming)?;
    let mut grid = grid.clone();
    grid.incoming = Some(Angles { phi: None, ..incoming.clone() });
    if let Some(azimuths) = grid.outgoing.as_mut().and_then(|angles| angles.phi.as_mut()) {
        // Half a circle is mirrored at azimuth 0 only.
        if azimuths.extent == AzimuthExtent::Mirrored && azimuth != 0.0 {
            return None;
        }
        azimuths.phi.iter_mut().for_each(|phi| *phi -= azimuth);
    }
    grid.stated = grid.stated.and_then(|stated| stated.isotropic(azimuth)).map(Box::new);
    Some((Samples::Grid(grid), ProjectionNote::OneAzimuthIsotropic.into()))
}

/// Returns scattered samples in place of a grid of angles between which the values are undefined (scan planes or single
/// rings); `None` for other samples.
fn open_samples(acquisition: &Acquisition) -> Option<Scattered> {
    let (grid, incoming, outgoing) = pairs_of_directions(acquisition)?;
    let is_ring = |angles: &Angles| angles.phi.is_some() && angles.covers.0 == angles.covers.1;
    let is_open = is_ring(incoming) || is_ring(outgoing) || is_plane(outgoing);
    let width = grid.spectral.as_ref().map_or(1, Axis::len);
    let is_taken = is_open && !DENSE.contains(&acquisition.format) && grid.values.len() / width <= MOST;
    is_taken.then(|| scattered(grid, incoming, outgoing, width))
}

/// Returns the grid of a BRDF, BTDF or BSDF, with its incoming and outgoing angles; `None` for other quantities and for
/// series of several measurements.
fn pairs_of_directions(acquisition: &Acquisition) -> Option<(&AngleGrid, &Angles, &Angles)> {
    let Samples::Grid(grid) = &acquisition.samples else { return None };
    let is_single = acquisition.quantity.has_cosine() && grid.index.is_empty();
    Some((grid, grid.incoming.as_ref()?, grid.outgoing.as_ref()?)).filter(|_| is_single)
}

/// Returns a note on the widest gap between the outgoing azimuths of a grid if nothing is known across it.
pub(super) fn gap(acquisition: &Acquisition) -> Option<Note> {
    let (_, _, outgoing) = pairs_of_directions(acquisition).filter(|_| !DENSE.contains(&acquisition.format))?;
    let [from_degrees, to_degrees] = widest_gap(outgoing).filter(|[from, to]| to - from > WIDEST_GAP)?;
    Some(ProjectionNote::AzimuthGap { from_degrees, to_degrees }.into())
}

/// Returns true if the azimuths of a grid are scan planes, or have a gap across which nothing is known.
fn is_plane(angles: &Angles) -> bool {
    single_azimuth(angles).is_some() || widest_gap(angles).is_some_and(|[from, to]| to - from > WIDEST_GAP)
}

/// Returns true if the angles of a grid cover an area on the sphere: they are neither a single ring nor scan planes.
pub(super) fn has_area(angles: &Angles) -> bool {
    angles.covers.0 < angles.covers.1 && !is_plane(angles)
}

/// Returns the azimuth of a grid that has a single azimuth; `None` for other grids.
pub(super) fn single_azimuth(angles: &Angles) -> Option<f64> {
    let azimuths = angles.phi.as_ref().filter(|azimuths| azimuths.extent == AzimuthExtent::Sector)?;
    if let [alone] = azimuths.phi[..] { Some(alone) } else { None }
}

/// Returns the two neighbouring azimuths of a grid, in degrees, that are farthest apart; `None` for a single one.
fn widest_gap(angles: &Angles) -> Option<[f64; 2]> {
    let azimuths = angles.phi.as_ref()?;
    let around = match azimuths.phi[..] {
        [first, .., last] if azimuths.extent == AzimuthExtent::Circle => Some([last, first + 360.0]),
        _ => None,
    };
    let pairs = azimuths.phi.array_windows().copied().chain(around);
    pairs.max_by(|[a, b], [c, d]| (b - a).total_cmp(&(d - c)))
}

/// Converts a grid of angles to scattered samples: each measured pair of directions with its spectrum.
fn scattered(grid: &AngleGrid, incoming: &Angles, outgoing: &Angles, width: usize) -> Scattered {
    let [into, out] = [incoming, outgoing].map(directions);
    let pairs = into.iter().flat_map(|wi| out.iter().map(move |wo| (*wi, *wo)));
    let measured =
        pairs.zip(grid.values.chunks_exact(width)).enumerate().filter(|(_, (_, row))| row.iter().any(|v| !v.is_nan()));
    let mut found = Scattered {
        incoming: Vec::new(),
        outgoing: Vec::new(),
        isotropic: incoming.phi.is_none(),
        spectral: grid.spectral.clone(),
        values: Vec::new(),
        sigma: None,
    };
    let mut kept = Vec::new();
    for (at, ((wi, wo), row)) in measured {
        found.incoming.push(wi);
        found.outgoing.push(wo);
        found.values.extend_from_slice(row);
        kept.push(at);
    }
    found.sigma = grid.sigma.as_ref().filter(|sigma| sigma.values.len() == grid.values.len()).map(|sigma| {
        let row = |at: usize| &sigma.values[at * width..][..width];
        kept.iter().flat_map(|&at| row(at)).copied().collect()
    });
    found
}

/// Returns `[theta, phi]` in degrees of every direction of a grid of angles.
fn directions(angles: &Angles) -> Vec<[f64; 2]> {
    let phi = angles.phi.as_ref().map_or(&[0.0][..], |azimuths| &azimuths.phi);
    angles.theta.iter().flat_map(|&theta| phi.iter().map(move |&phi| [theta, phi])).collect()
}
