//! Projection of samples on a grid of angles: averages over triangles.

use super::angles::{self, check, check_area, sampled_cells};
use super::averages::{Averages, divisions};
use super::error::{AnglesError, LevelError, ProjectionError, Role};
use super::levels::{self, Choice, Entries, lower_to_fit, rounded};
use super::projected::{Coverage, Projected};
use super::request::AxesRequest;
use super::resampling::{Directions, Resampling};
use super::spectral;
use crate::domain::{Axis, Domain, Layout, Measurement, Note, Quantity, Sampling, Tensor, TensorError, check_axes};
use crate::formats::{Acquisition, AngleGrid, Angles, AzimuthExtent, Outside};
use crate::notes::ProjectionNote;

/// Conversion of the incoming or the outgoing directions of a file to a tensor axis.
enum Side<'a> {
    /// The file has no directions of this role (incoming or outgoing).
    Absent,
    /// Polar angles of isotropic data. They become an axis of the tensor as they are in the file, without averages over
    /// triangles.
    Elevations(&'a Angles),
    /// Averages over triangles of directions, with the angles of the file and the chosen mesh.
    Triangles(&'a Angles, Choice),
}

/// Projects the samples `grid` of a measurement, which lie on a grid of angles, onto the requested axes.
pub(super) fn project(
    acquisition: &Acquisition,
    grid: &AngleGrid,
    request: &AxesRequest,
) -> Result<Projected, ProjectionError> {
    let missing = check_values(grid)?;
    if is_half_plane(acquisition.quantity, grid) {
        return Err(ProjectionError::Angles { role: Role::Outgoing, angles: AnglesError::NoAzimuths });
    }
    let mut incoming = incoming_side(grid.incoming.as_ref(), request.incoming_level)?;
    let mut outgoing = outgoing_side(acquisition.quantity, grid.outgoing.as_ref(), request.outgoing_level)?;
    let spectral =
        spectral::plan(grid.spectral.as_ref(), acquisition.spectral_factor.as_ref(), request.wavelengths.as_ref())?;
    let outer: usize = grid.index.iter().map(Axis::len).product();
    lower_to_fit(incoming.entries(), outgoing.entries(), outer.saturating_mul(spectral.channels.to()));
    let mut axes = grid.index.clone();
    axes.extend([incoming.axis(), outgoing.axis(), spectral.axis].into_iter().flatten());
    Layout::of(acquisition.quantity, &axes)?;
    check_axes(&axes)?;

    let mut notes = Vec::new();
    incoming.describe(Role::Incoming, grid.outside, &mut notes);
    outgoing.describe(Role::Outgoing, grid.outside, &mut notes);
    notes.extend(spectral.notes);
    if missing > 0 {
        notes.push(ProjectionNote::MissingAveraged { samples: missing, of: grid.values.len() }.into());
    }

    let resampling = Resampling {
        outer,
        incoming: incoming.directions(acquisition.quantity, grid.outside),
        outgoing: outgoing.directions(acquisition.quantity, grid.outside),
        channels: spectral.channels,
    };
    let samples = resampling.apply(&grid.values, missing > 0);
    let coverage = Coverage { notes, ..cover(grid, &resampling, &incoming, &outgoing, &samples, missing > 0) };
    let tensor = Tensor::new(axes, samples)?;
    let measurement = Measurement::new(acquisition.quantity, acquisition.unit, Sampling::Average, tensor)?;
    Ok(Projected { measurement, coverage, filled: Vec::new(), numbers: None, scattered: None, lobe: None })
}

/// Returns true for a surface whose outgoing directions have no azimuths although light comes in obliquely, unless the
/// standard of the file format defines all of them.
fn is_half_plane(quantity: Quantity, grid: &AngleGrid) -> bool {
    let is_oblique = grid.incoming.as_ref().is_some_and(|angles| angles.theta[..] != [0.0]);
    let has_azimuths = grid.outgoing.as_ref().is_none_or(|angles| angles.phi.is_some());
    quantity.has_cosine() && is_oblique && !has_azimuths && grid.outside == Outside::Masked
}

/// Checks the number and the finiteness of the values of a grid of angles. Returns the number of missing (NaN) samples.
pub(super) fn check_values(grid: &AngleGrid) -> Result<usize, ProjectionError> {
    check_axes(&grid.index)?;
    let mut shape: Vec<usize> = grid.index.iter().map(Axis::len).collect();
    for (role, side) in [(Role::Incoming, &grid.incoming), (Role::Outgoing, &grid.outgoing)] {
        if let Some(angles) = side {
            check(role, angles)?;
            shape.push(angles::count(angles));
        }
    }
    shape.extend(grid.spectral.as_ref().map(Axis::len));
    let expected = shape.iter().fold(1_usize, |product, &n| product.saturating_mul(n));
    if grid.values.len() != expected {
        return Err(TensorError::Count { found: grid.values.len(), expected, shape }.into());
    }
    if let Some(index) = grid.values.iter().position(|v| v.is_infinite()) {
        return Err(TensorError::Infinite { index }.into());
    }
    Ok(grid.values.iter().filter(|v| v.is_nan()).count())
}

/// Refuses angles that are no valid grid of directions for the physical quantity. The directions of a surface may be a
/// scan in one plane; those of other quantities cover an area.
pub(super) fn check_sides(quantity: Quantity, grid: &AngleGrid) -> Result<(), ProjectionError> {
    if quantity.has_cosine() {
        grid.outgoing.as_ref().map_or(Ok(()), |angles| outgoing_domain(quantity, angles).map(drop))
    } else {
        incoming_side(grid.incoming.as_ref(), None)?;
        outgoing_side(quantity, grid.outgoing.as_ref(), None).map(drop)
    }
}

fn incoming_side(angles: Option<&Angles>, level: Option<u8>) -> Result<Side<'_>, ProjectionError> {
    let unfit = |level| Err(ProjectionError::Level { role: Role::Incoming, level });
    match (angles, level) {
        (None, None) => Ok(Side::Absent),
        (None, Some(_)) => unfit(LevelError::NoDirections),
        (Some(angles), level) if angles.phi.is_none() => match level {
            None => Ok(Side::Elevations(angles)),
            Some(_) => unfit(LevelError::Isotropic { elevations: angles.theta.len() }),
        },
        (Some(angles), level) => {
            check_area(Role::Incoming, angles)?;
            let domain = match angles.covers {
                (_, high) if high <= 90.0 => Domain::Hemisphere,
                (low, _) if low >= 90.0 => Domain::Lower,
                _ => Domain::Sphere,
            };
            Ok(Side::Triangles(angles, levels::choose(Role::Incoming, domain, angles, level)?))
        }
    }
}

fn outgoing_side(quantity: Quantity, angles: Option<&Angles>, level: Option<u8>) -> Result<Side<'_>, ProjectionError> {
    let Some(angles) = angles else {
        return match level {
            None => Ok(Side::Absent),
            Some(_) => Err(ProjectionError::Level { role: Role::Outgoing, level: LevelError::NoDirections }),
        };
    };
    check_area(Role::Outgoing, angles)?;
    let domain = outgoing_domain(quantity, angles)?;
    Ok(Side::Triangles(angles, levels::choose(Role::Outgoing, domain, angles, level)?))
}

/// Returns the part of the sphere that the outgoing directions of a quantity lie in. Fails if none of the `angles`
/// does.
fn outgoing_domain(quantity: Quantity, angles: &Angles) -> Result<Domain, ProjectionError> {
    let domain = match quantity {
        Quantity::Brdf => Domain::Hemisphere,
        Quantity::Btdf => Domain::Lower,
        _ => Domain::Sphere,
    };
    let (low, high) = angles.covers;
    let beside = match domain {
        Domain::Hemisphere => low >= 90.0,
        Domain::Lower => high <= 90.0,
        Domain::Sphere => false,
    };
    if beside {
        let angles = AnglesError::Beside { low, high, domain, quantity };
        return Err(ProjectionError::Angles { role: Role::Outgoing, angles });
    }
    Ok(domain)
}

impl Side<'_> {
    fn entries(&mut self) -> Entries<'_> {
        match self {
            Self::Triangles(_, choice) => Entries::Chosen(choice),
            _ => Entries::Fixed(self.len()),
        }
    }

    fn axis(&self) -> Option<Axis> {
        match self {
            Self::Absent => None,
            Self::Elevations(angles) => Some(Axis::Elevation(angles.theta.clone())),
            Self::Triangles(_, choice) => Some(Axis::Triangles(choice.mesh)),
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Absent => 1,
            Self::Elevations(angles) => angles.theta.len(),
            Self::Triangles(_, choice) => choice.mesh.len(),
        }
    }

    fn directions(&self, quantity: Quantity, outside: Outside) -> Directions {
        match self {
            Self::Absent => Directions::Kept(1),
            Self::Elevations(angles) => Directions::Kept(angles.theta.len()),
            Self::Triangles(angles, choice) => Directions::Averaged {
                from: angles::count(angles),
                averages: Averages::over_triangles(choice.mesh, angles, outside, quantity.has_cosine()),
            },
        }
    }

    /// Returns pairs (sample, axis position): each direction of the file, and the position on the tensor axis whose
    /// triangle or polar angle contains it.
    fn sampled(&self) -> Vec<(usize, usize)> {
        match self {
            Self::Absent => vec![(0, 0)],
            Self::Elevations(angles) => (0..angles.theta.len()).map(|i| (i, i)).collect(),
            Self::Triangles(angles, choice) => sampled_cells(angles, choice.mesh),
        }
    }

    /// Adds notes for the user on choices and assumptions about the incoming or the outgoing directions of a file.
    fn describe(&self, of: Role, outside: Outside, notes: &mut Vec<Note>) {
        let role = of.name();
        let (angles, choice) = match self {
            Self::Absent => return,
            Self::Elevations(angles) => {
                notes.push(ProjectionNote::Elevations { role, elevations: angles.theta.len() }.into());
                return;
            }
            Self::Triangles(angles, choice) => (angles, choice),
        };
        let domain = choice.mesh.domain();
        notes.push(choice.note(of));
        let parts = 1_u64 << (2 * divisions(choice.mesh, angles));
        notes.push(ProjectionNote::CellsOfBilinear { role, parts }.into());
        let is_zero = outside == Outside::Zero;
        let (top, bottom) = match domain {
            Domain::Hemisphere => (0.0, 90.0),
            Domain::Lower => (90.0, 180.0),
            Domain::Sphere => (0.0, 180.0),
        };
        let (low, high) = angles.covers;
        if low > top || high < bottom {
            let (first_degrees, last_degrees) = (rounded(low), rounded(high));
            notes.push(ProjectionNote::OutsideTheta { role, first_degrees, last_degrees, is_zero }.into());
        }
        if low < top || high > bottom {
            notes.push(ProjectionNote::SamplesBeyond { role, domain }.into());
        }
        let Some(azimuths) = &angles.phi else {
            notes.push(ProjectionNote::RotationallySymmetric { role }.into());
            return;
        };
        if let (AzimuthExtent::Sector, [first, .., last]) = (azimuths.extent, azimuths.phi.as_slice())
            && last - first < 360.0
        {
            let (first_degrees, last_degrees) = (rounded(*first), rounded(*last));
            notes.push(ProjectionNote::OutsidePhi { role, first_degrees, last_degrees, is_zero }.into());
        }
    }
}

/// Counts the cells (pairs of an incoming and an outgoing triangle) that contain samples, lie between samples, or have
/// no data.
fn cover(
    grid: &AngleGrid,
    resampling: &Resampling,
    incoming: &Side<'_>,
    outgoing: &Side<'_>,
    samples: &[f32],
    missing: bool,
) -> Coverage {
    let (n_in, n_out) = (resampling.incoming.to(), resampling.outgoing.to());
    let (from_in, from_out, width) =
        (resampling.incoming.from(), resampling.outgoing.from(), resampling.channels.from());
    let (pairs_in, pairs_out) = (incoming.sampled(), outgoing.sampled());
    let mut coverage = Coverage { cells: (resampling.outer * n_in * n_out) as u64, ..Coverage::default() };
    let mut sampled = vec![false; n_in * n_out];
    let spectra = samples.chunks(n_in * n_out * resampling.channels.to());
    for (values, spectra) in grid.values.chunks(from_in * from_out * width).zip(spectra) {
        sampled.fill(false);
        for &(i, cell_in) in &pairs_in {
            for &(o, cell_out) in &pairs_out {
                let there = !missing || {
                    let at = (i * from_out + o) * width;
                    values[at..at + width].iter().any(|v| !v.is_nan())
                };
                sampled[cell_in * n_out + cell_out] |= there;
            }
        }
        for (cell, spectrum) in spectra.chunks(resampling.channels.to()).enumerate() {
            let unreached = resampling.incoming.is_empty(cell / n_out) || resampling.outgoing.is_empty(cell % n_out);
            if unreached || spectrum.iter().all(|s| s.is_nan()) {
                coverage.empty += 1;
            } else if sampled[cell] {
                coverage.measured += 1;
            } else {
                coverage.interpolated += 1;
            }
        }
    }
    coverage
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chosen_levels_give_way_to_the_size_limit_and_named_ones_do_not() {
        let angles = Angles { theta: (0..=90).map(f64::from).collect(), covers: (0.0, 90.0), phi: None };
        let side = |level| {
            let choice = levels::choose(Role::Outgoing, Domain::Hemisphere, &angles, level).unwrap();
            Side::Triangles(&angles, choice)
        };
        let level = |side: &Side<'_>| match side.axis() {
            Some(Axis::Triangles(mesh)) => mesh.level(),
            other => panic!("{other:?}"),
        };
        let (mut a, mut b) = (side(None), side(None));
        lower_to_fit(a.entries(), b.entries(), 1);
        assert_eq!((level(&a), level(&b)), (5, 5));
        lower_to_fit(a.entries(), b.entries(), 3);
        assert_eq!((level(&a), level(&b)), (5, 4));
        let (mut a, mut b) = (side(None), side(Some(7)));
        lower_to_fit(a.entries(), b.entries(), 16);
        assert_eq!((level(&a), level(&b)), (1, 7));
        let (mut a, mut b) = (side(Some(7)), side(Some(7)));
        lower_to_fit(a.entries(), b.entries(), 1);
        assert_eq!((level(&a), level(&b)), (7, 7));
        let mut elevations = Side::Elevations(&angles);
        lower_to_fit(elevations.entries(), a.entries(), usize::MAX);
        assert_eq!((level(&a), elevations.len()), (7, 91));
    }
}
