//! Width of the narrowest lobe of a file, along theta in the plane of incidence, through the brightest sample.

use super::planes::scattered_samples;
use super::same_angle::{SAME, azimuth_steps, steps};
use crate::domain::{Axis, Note, Quantity};
use crate::formats::{Acquisition, AngleGrid, Angles, AzimuthExtent, Samples, Scattered, not_wider};
use std::collections::BTreeMap;

/// Largest angle in degrees between a direction and the plane of incidence at which the direction counts as in-plane.
const IN_PLANE: f64 = 0.6;
/// Upper bound on the number of direction pairs in a file. In larger files the width of the narrowest lobe is not
/// measured for comparison with the instrument's angular resolution.
const MOST: usize = 1 << 24;

/// Sample in the plane of incidence: theta in degrees, positive on the side of the mirror direction, and the value.
type Sample = (f64, f32);

/// Returns the full width at half maximum, in degrees, of the narrowest lobe of a BRDF, BTDF or BSDF. It is taken over
/// all incoming directions, in the middle band. Returns `None` if no lobe falls to half its height on both sides of
/// its peak.
///
/// A lobe narrower than the sample spacing appears as wide as the spacing.
fn narrowest_lobe(acquisition: &Acquisition) -> Option<f64> {
    if !acquisition.quantity.has_cosine() {
        return None;
    }
    let profiles = match (&acquisition.samples, scattered_samples(acquisition)) {
        (_, Some(scattered)) => of_scattered(acquisition.quantity, &scattered),
        (Samples::Grid(grid), None) => of_grid(grid),
        _ => Vec::new(),
    };
    profiles.into_iter().filter_map(full_width).reduce(f64::min)
}

/// Returns a remark if the narrowest lobe of a file is no wider than the detector aperture or the source divergence of
/// the instrument. Returns `None` if it is wider, if there is no lobe, or if the file states neither angle.
pub(crate) fn unresolved_lobe(acquisition: &Acquisition) -> Option<Note> {
    let instrument = &acquisition.instrument;
    let width = if instrument.is_unknown() { None } else { narrowest_lobe(acquisition) };
    not_wider(instrument, width?)
}

/// Returns the full width at half maximum of an in-plane profile around its brightest sample, in degrees.
fn full_width(mut profile: Vec<Sample>) -> Option<f64> {
    profile.retain(|(_, value)| !value.is_nan());
    profile.sort_by(|a, b| a.0.total_cmp(&b.0));
    let peak = (0..profile.len()).reduce(|most, next| if profile[next].1 > profile[most].1 { next } else { most })?;
    let half = 0.5 * f64::from(profile[peak].1);
    if half <= 0.0 {
        return None;
    }
    let crossing = |above: Sample, below: Sample| {
        let (high, low) = (f64::from(above.1), f64::from(below.1));
        above.0 + (below.0 - above.0) * (high - half) / (high - low)
    };
    let is_below = |sample: &Sample| f64::from(sample.1) < half;
    let after = (peak + 1..profile.len()).find(|&i| is_below(&profile[i]))?;
    let before = (0..peak).rev().find(|&i| is_below(&profile[i]))?;
    Some(crossing(profile[after - 1], profile[after]) - crossing(profile[before + 1], profile[before]))
}

fn of_grid(grid: &AngleGrid) -> Vec<Vec<Sample>> {
    let (Some(incoming), Some(outgoing)) = (&grid.incoming, &grid.outgoing) else { return Vec::new() };
    let width = grid.spectral.as_ref().map_or(1, Axis::len);
    let azimuths = |angles: &Angles| angles.phi.as_ref().map_or(1, |azimuths| azimuths.phi.len());
    let (n_in, n_out) = (incoming.theta.len() * azimuths(incoming), outgoing.theta.len() * azimuths(outgoing));
    if !grid.index.is_empty() || grid.values.len() != n_in * n_out * width || n_in * outgoing.theta.len() > MOST {
        return Vec::new();
    }
    let phi_i = |i: usize| incoming.phi.as_ref().map_or(0.0, |azimuths| azimuths.phi[i % azimuths.phi.len()]);
    let profile = |i: usize| {
        let columns = columns(outgoing, phi_i(i));
        let row = |(t, &theta): (usize, &f64)| {
            let at = move |column: usize| (i * n_out + t * azimuths(outgoing) + column) * width + width / 2;
            columns.iter().map(move |&(column, sign)| (sign * theta, grid.values[at(column)])).collect::<Vec<_>>()
        };
        outgoing.theta.iter().enumerate().flat_map(row).collect()
    };
    (0..n_in).map(profile).collect()
}

/// Returns the indices of the outgoing azimuths in the plane of incidence, each with the sign that polar angles get
/// there: positive on the side of the mirror direction.
fn columns(outgoing: &Angles, phi_i: f64) -> Vec<(usize, f64)> {
    let Some(azimuths) = &outgoing.phi else { return vec![(0, 1.0), (0, -1.0)] };
    let sign = |phi: f64| {
        let off = (phi - phi_i).rem_euclid(360.0);
        if off.min(360.0 - off) < IN_PLANE { Some(-1.0) } else { Some(1.0).filter(|_| (off - 180.0).abs() < IN_PLANE) }
    };
    let mirrored = azimuths.extent == AzimuthExtent::Mirrored;
    let own = azimuths.phi.iter().enumerate();
    let images =
        own.clone().filter(|(_, phi)| mirrored && **phi > 0.0 && **phi < 180.0).map(|(i, phi)| (i, 360.0 - phi));
    own.map(|(i, &phi)| (i, phi)).chain(images).filter_map(|(i, phi)| Some((i, sign(phi)?))).collect()
}

fn of_scattered(quantity: Quantity, scattered: &Scattered) -> Vec<Vec<Sample>> {
    let count = scattered.directions();
    let width = scattered.spectral.as_ref().map_or(1, Axis::len);
    let is_paired = scattered.incoming.len() == count && scattered.outgoing.len() == count;
    if !is_paired || count > MOST || scattered.values.len() != count * width {
        return Vec::new();
    }
    let mut profiles: BTreeMap<[i64; 2], Vec<Sample>> = BTreeMap::new();
    for (row, (&[theta_i, phi_i], &[theta, phi])) in scattered.incoming.iter().zip(&scattered.outgoing).enumerate() {
        // At normal incidence every plane is a plane of incidence: that of azimuth 0 is used.
        let off = (phi - if theta_i < SAME { 0.0 } else { phi_i }).rem_euclid(360.0);
        let across = libm::sin(off.to_radians()) * libm::sin(theta.to_radians());
        if across.abs() > libm::sin(IN_PLANE.to_radians()) || quantity == Quantity::Brdf && theta > 90.0 {
            continue;
        }
        let sign = if (90.0..=270.0).contains(&off) { 1.0 } else { -1.0 };
        let azimuth = if scattered.isotropic { 0 } else { azimuth_steps(theta_i, phi_i) };
        let value = scattered.values[row * width + width / 2];
        profiles.entry([steps(theta_i), azimuth]).or_default().push((sign * theta, value));
    }
    profiles.into_values().collect()
}
