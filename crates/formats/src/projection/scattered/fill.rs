//! Filling of cells without samples around them, from mirror images or reciprocal directions, if the data are
//! symmetric or reciprocal.

use super::cells::{Fitted, Standing, standings};
use super::plan::Plan;
use super::rows::Rows;
use crate::domain::vector::{Vector, add, dot, scale, sub, unit};
use crate::domain::{Direction, Note, Quantity};
use crate::notes::FitNote;
use crate::projection::resampling::Channels;

/// Largest median relative difference between f(wi, wo) and f(wo, wi) at which data count as reciprocal. Raising it
/// fills empty triangles by reciprocity in less reciprocal data.
const RECIPROCAL: f64 = 0.05;
/// Approximate number of direction pairs (wi, wo) for which f(wi, wo) and f(wo, wi) are compared before empty triangles
/// are filled by reciprocity.
const COMPARED: usize = 2000;
/// Least number of direction pairs (wi, wo) for which f(wi, wo) and f(wo, wi) must be comparable before empty triangles
/// are filled by reciprocity.
const ENOUGH: usize = 50;

/// Fills triangles of outgoing directions without samples, from fits to the samples and their mirror images in the
/// plane of incidence. Returns the number of filled triangles.
pub(super) fn by_symmetry(
    plan: &Plan,
    rows: &Rows<'_>,
    channels: &Channels,
    samples: &mut [f32],
    standing: &mut [Standing],
) -> usize {
    let mesh = plan.outgoing.mesh;
    let width = channels.to();
    let mut filled = 0;
    let mut plane = vec![0.0_f32; mesh.len() * width];
    let entries = plan.entries.iter().zip(samples.chunks_mut(plane.len())).zip(standing.chunks_mut(mesh.len()));
    for ((entry, samples), standing) in entries {
        if standing.iter().all(|s| matches!(s, Standing::Measured | Standing::Interpolated)) {
            continue;
        }
        let own = plan.fitted(rows, entry.cloud);
        let cloud = own.cloud.mirrored();
        let mirrored = Fitted { cloud: &cloud, ..own };
        let lacks = |cell: usize| matches!(standing[cell], Standing::Filled | Standing::Empty).then_some(false);
        let drafts = mirrored.cells(entry.wi, mesh, plan.parts, channels, &lacks, &mut plane);
        let found = standings(&drafts);
        for (cell, standing) in standing.iter_mut().enumerate() {
            let lacking = matches!(standing, Standing::Filled | Standing::Empty);
            if lacking && found[cell] == Standing::Interpolated {
                samples[cell * width..][..width].copy_from_slice(&plane[cell * width..][..width]);
                *standing = Standing::Filled;
                filled += 1;
            }
        }
    }
    filled
}

/// Fills empty triangles of an isotropic BRDF with the values of exchanged directions, f(wo, wi), if the measured
/// values agree with reciprocity. Returns a note for the user.
pub(super) fn by_reciprocity(
    quantity: Quantity,
    plan: &Plan,
    width: usize,
    samples: &mut [f32],
    standing: &mut [Standing],
) -> Option<Note> {
    if quantity != Quantity::Brdf || plan.elevations.len() < 2 || !standing.contains(&Standing::Empty) {
        return None;
    }
    let mesh = plan.outgoing.mesh;
    let own = |cell: usize| -> Option<f64> {
        let known = matches!(standing[cell], Standing::Measured | Standing::Interpolated);
        known.then(|| samples[cell * width..][..width].iter().map(|&v| f64::from(v)).sum())
    };
    let mut row = vec![0.0; width];
    let mut differences: Vec<f64> = (0..standing.len())
        .step_by((standing.len() / COMPARED).max(1))
        .filter_map(|cell| {
            let own = own(cell)?;
            let entry = plan.entries[cell / mesh.len()].wi;
            exchanged(plan, samples, standing, (entry, mesh.centroid(cell % mesh.len())), &mut row)?;
            let other: f64 = row.iter().sum();
            Some((own - other).abs() / own.abs().max(other.abs()).max(f64::MIN_POSITIVE))
        })
        .collect();
    if differences.len() < ENOUGH {
        return None;
    }
    let middle = differences.len() / 2;
    let median = *differences.select_nth_unstable_by(middle, f64::total_cmp).1;
    if median > RECIPROCAL {
        return None;
    }
    let mut found = Vec::new();
    for cell in (0..standing.len()).filter(|&cell| standing[cell] == Standing::Empty) {
        let entry = plan.entries[cell / mesh.len()].wi;
        if exchanged(plan, samples, standing, (entry, mesh.centroid(cell % mesh.len())), &mut row).is_some() {
            found.push((cell, row.clone()));
        }
    }
    for (cell, row) in &found {
        let spectrum = &mut samples[cell * width..][..width];
        spectrum.iter_mut().zip(row).for_each(|(s, &v)| *s = v as f32);
        standing[*cell] = Standing::Filled;
    }
    (!found.is_empty())
        .then(|| FitNote::FromReciprocity { cells: found.len(), difference_percent: 100.0 * median }.into())
}

/// Writes the values f(wo, wi) for a cell (wi, wo) into `row`, one for each band. They are interpolated between the
/// tensor's incoming polar angles just below and above the polar angle of `wo`. The values under each angle are read at
/// the half vector of the cell. Returns `None` if there is no value.
fn exchanged(
    plan: &Plan,
    samples: &[f32],
    standing: &[Standing],
    (wi, wo): (Vector, Direction),
    row: &mut [f64],
) -> Option<()> {
    let mesh = plan.outgoing.mesh;
    let theta = wo.theta_degrees();
    let above = plan.elevations.iter().position(|&elevation| elevation >= theta)?;
    let below = above.saturating_sub(usize::from(plan.elevations[above] > theta));
    if plan.elevations[below] > theta {
        return None;
    }
    // The new incoming direction is wo, rotated above the x axis.
    let new_wi = Direction::from_degrees(theta, 0.0).xyz();
    let new_wo = Direction::from_unit(wi).rotated_about_z(-wo.phi()).xyz();
    let h = unit(add(new_wi, new_wo));
    let gap = plan.elevations[above] - plan.elevations[below];
    let t = if gap > 0.0 { (theta - plan.elevations[below]) / gap } else { 0.0 };
    row.fill(0.0);
    for (entry, share) in [(below, 1.0 - t), (above, t)] {
        let wi = plan.entries[entry].wi;
        let there = sub(scale(h, 2.0 * dot(wi, h)), wi);
        let cell = entry * mesh.len() + mesh.locate(Direction::from_unit(there))?;
        if !matches!(standing[cell], Standing::Measured | Standing::Interpolated) {
            return None;
        }
        let spectrum = &samples[cell * row.len()..][..row.len()];
        row.iter_mut().zip(spectrum).for_each(|(sum, &v)| *sum += share * f64::from(v));
    }
    Some(())
}
