//! Grids of scattered light that leave too much open: one incoming azimuth is isotropic, planes of a scan are directions.

use super::request::DirectionDomain;
use crate::domain::Axis;
use crate::formats::{Acquisition, AngleGrid, Angles, AzimuthExtent, Samples, Scattered};
use std::borrow::Cow;

/// Degrees between azimuths beyond which they are planes of a scan rather than steps of a grid: light between them does not
/// follow from them.
const PLANES: f64 = 90.0;
/// Directions that are fitted without a grid, at most: scans in planes have fewer.
const MOST: usize = 1 << 22;

/// Formats whose files define the function between any two of their azimuths: their grids are no scans in planes.
const DENSE: [&str; 1] = ["mbsdf"];

/// Samples at scattered directions: those of a file that states no grid, or one that leaves too much open.
pub(crate) fn scattered_samples(acquisition: &Acquisition) -> Option<Cow<'_, Scattered>> {
    match &acquisition.samples {
        Samples::Scattered(scattered) => Some(Cow::Borrowed(scattered)),
        _ => match instead(acquisition, None)? {
            (Samples::Scattered(scattered), _) => Some(Cow::Owned(scattered)),
            _ => None,
        },
    }
}

/// Samples that stand for the grid of `acquisition`, and the note that says so; `None` where it is kept. With the domain
/// [`DirectionDomain::Grid`] by name, planes stay a grid.
pub(super) fn instead(acquisition: &Acquisition, domain: Option<DirectionDomain>) -> Option<(Samples, &'static str)> {
    let Samples::Grid(grid) = &acquisition.samples else { return None };
    let (true, [], Some(incoming), Some(outgoing)) =
        (acquisition.quantity.has_cosine(), &grid.index[..], &grid.incoming, &grid.outgoing)
    else {
        return None;
    };
    let is_ring = |angles: &Angles| angles.phi.is_some() && angles.covers.0 == angles.covers.1;
    let is_plane = single_azimuth(outgoing).is_some() || widest_gap(outgoing) > PLANES;
    let is_open = is_ring(incoming) || is_ring(outgoing) || is_plane;
    let width = grid.spectral.as_ref().map_or(1, Axis::len);
    let is_kept = domain == Some(DirectionDomain::Grid) || DENSE.contains(&acquisition.format);
    if is_open && !is_kept && grid.values.len() / width <= MOST {
        let note = "angles with nothing between them (one of them, or azimuths more than 90 degrees apart): taken as \
                    directions without a grid";
        return Some((Samples::Scattered(scattered(grid, incoming, outgoing, width)), note));
    }
    let azimuth = single_azimuth(incoming)?;
    let mut grid = grid.clone();
    grid.incoming = Some(Angles { phi: None, ..incoming.clone() });
    if let Some(azimuths) = grid.outgoing.as_mut().and_then(|angles| angles.phi.as_mut()) {
        // Half a circle is mirrored at azimuth 0 alone.
        if azimuths.extent == AzimuthExtent::Mirrored && azimuth != 0.0 {
            return None;
        }
        azimuths.phi.iter_mut().for_each(|phi| *phi -= azimuth);
    }
    grid.stated = grid.stated.and_then(|stated| stated.isotropic(azimuth)).map(Box::new);
    Some((Samples::Grid(grid), "incoming directions of one azimuth only: taken as isotropic"))
}

/// The azimuth of a sector that is one plane.
fn single_azimuth(angles: &Angles) -> Option<f64> {
    let azimuths = angles.phi.as_ref().filter(|azimuths| azimuths.extent == AzimuthExtent::Sector)?;
    if let [alone] = azimuths.phi[..] { Some(alone) } else { None }
}

/// The largest difference of neighbouring azimuths, in degrees.
fn widest_gap(angles: &Angles) -> f64 {
    let Some(azimuths) = &angles.phi else { return 0.0 };
    let within = azimuths.phi.array_windows().map(|[a, b]| b - a).fold(0.0, f64::max);
    match (azimuths.extent, azimuths.phi.first(), azimuths.phi.last()) {
        (AzimuthExtent::Circle, Some(first), Some(last)) if last > first => within.max(first + 360.0 - last),
        _ => within,
    }
}

/// Each pair of directions with its spectrum, those that are missing left out.
fn scattered(grid: &AngleGrid, incoming: &Angles, outgoing: &Angles, width: usize) -> Scattered {
    let [into, out] = [incoming, outgoing].map(directions);
    let pairs = into.iter().flat_map(|wi| out.iter().map(move |wo| (*wi, *wo)));
    let measured = pairs.zip(grid.values.chunks_exact(width)).filter(|(_, row)| row.iter().any(|v| !v.is_nan()));
    let mut found = Scattered {
        incoming: Vec::new(),
        outgoing: Vec::new(),
        isotropic: incoming.phi.is_none(),
        spectral: grid.spectral.clone(),
        values: Vec::new(),
        sigma: None,
    };
    for ((wi, wo), row) in measured {
        found.incoming.push(wi);
        found.outgoing.push(wo);
        found.values.extend_from_slice(row);
    }
    found
}

/// `[theta, phi]` of every sample of one side.
fn directions(angles: &Angles) -> Vec<[f64; 2]> {
    let phi = angles.phi.as_ref().map_or(&[0.0][..], |azimuths| &azimuths.phi);
    angles.theta.iter().flat_map(|&theta| phi.iter().map(move |&phi| [theta, phi])).collect()
}
