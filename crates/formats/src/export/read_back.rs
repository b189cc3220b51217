//! Interpolation of a grid of angles as its readers do it: linear in every angle, constant beyond the last angles.

use crate::domain::Direction;
use crate::formats::{AngleGrid, Angles, AzimuthExtent, Outside};
use crate::numeric::bracket::Bracket;

/// Indices of the two list entries around a value, with their weights of linear interpolation; an unused entry has
/// weight 0.
type Ends = [(usize, f64); 2];

const ALL: Ends = [(0, 1.0), (0, 0.0)];

/// Interpolates the grid of angles of an exported file at a pair of directions; `wi` is needed if the grid has incoming
/// angles. Outside the covered angles the values are 0 or NaN, as [`Outside`] states.
pub(super) fn evaluate(grid: &AngleGrid, wi: Option<Direction>, wo: Direction, values: &mut [f64]) {
    let outside = if grid.outside == Outside::Zero { 0.0 } else { f64::NAN };
    let (incoming, turn) = match (&grid.incoming, wi) {
        // Isotropic: the azimuth of `wo` is relative to that of `wi`.
        (Some(angles), Some(wi)) => (around(&angles.theta, wi.theta_degrees()), wi.phi_degrees()),
        _ => (ALL, 0.0),
    };
    let Some(angles) = &grid.outgoing else { return values.fill(f64::NAN) };
    let theta = wo.theta_degrees();
    if !(angles.covers.0..=angles.covers.1).contains(&theta) {
        return values.fill(outside);
    }
    let rows = around(&angles.theta, theta);
    let (columns, count) = azimuths(angles, wo.phi_degrees() - turn);
    values.fill(0.0);
    for (i, incoming_weight) in incoming {
        for (row, row_weight) in rows {
            for (column, column_weight) in columns {
                let weight = incoming_weight * row_weight * column_weight;
                if weight > 0.0 {
                    let at = ((i * angles.theta.len() + row) * count + column) * values.len();
                    let stored = &grid.values[at..at + values.len()];
                    values.iter_mut().zip(stored).for_each(|(value, &s)| *value += weight * f64::from(s));
                }
            }
        }
    }
}

/// Returns the indices of the listed angles around `angle` with their weights of linear interpolation, clamped at the
/// ends of the list.
fn around(angles: &[f64], angle: f64) -> Ends {
    Bracket::held(angles, angle).weights()
}

/// Returns the indices of the listed azimuths around `phi` with their weights of linear interpolation, and the length
/// of the list.
fn azimuths(angles: &Angles, phi: f64) -> (Ends, usize) {
    let Some(azimuths) = &angles.phi else { return (ALL, 1) };
    let listed = &azimuths.phi;
    let phi = phi - 360.0 * libm::floor(phi / 360.0);
    let ends = match azimuths.extent {
        AzimuthExtent::Mirrored => around(listed, if phi > 180.0 { 360.0 - phi } else { phi }),
        AzimuthExtent::Sector => around(listed, phi),
        AzimuthExtent::Circle => {
            let (first, last) = (listed[0], listed[listed.len() - 1]);
            let phi = if phi < first { phi + 360.0 } else { phi };
            if phi <= last {
                around(listed, phi)
            } else {
                let t = (phi - last) / (first + 360.0 - last);
                [(listed.len() - 1, 1.0 - t), (0, t)]
            }
        }
    };
    (ends, listed.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::Azimuths;

    fn grid(extent: AzimuthExtent) -> AngleGrid {
        let phi = vec![0.0, 90.0, 180.0];
        AngleGrid {
            index: Vec::new(),
            incoming: Some(Angles { theta: vec![0.0, 60.0], covers: (0.0, 90.0), phi: None }),
            outgoing: Some(Angles { theta: vec![0.0, 45.0], covers: (0.0, 90.0), phi: Some(Azimuths { phi, extent }) }),
            spectral: None,
            outside: Outside::Masked,
            values: (0..12).map(|i| i as f32).collect(),
            stated: None,
            sigma: None,
        }
    }

    fn at(grid: &AngleGrid, wi: (f64, f64), wo: (f64, f64)) -> f64 {
        let mut value = [0.0];
        let direction = |(theta, phi)| Direction::from_degrees(theta, phi);
        evaluate(grid, Some(direction(wi)), direction(wo), &mut value);
        value[0]
    }

    #[test]
    fn grids_are_linear_in_every_angle() {
        let mirrored = grid(AzimuthExtent::Mirrored);
        let close = |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-9, "{found} {wanted}");
        close(at(&mirrored, (0.0, 0.0), (45.0, 90.0)), 4.0);
        close(at(&mirrored, (30.0, 20.0), (45.0, 110.0)), 7.0);
        // Held beyond the last angles; 270° is 90°.
        close(at(&mirrored, (80.0, 0.0), (89.0, 270.0)), 10.0);
        close(at(&mirrored, (0.0, 0.0), (22.5, 45.0)), 2.0);
        assert!(at(&mirrored, (0.0, 0.0), (91.0, 0.0)).is_nan());
        let circle = grid(AzimuthExtent::Circle);
        close(at(&circle, (0.0, 0.0), (45.0, 270.0)), 4.0);
        close(at(&circle, (0.0, 0.0), (45.0, 225.0)), 4.5);
    }
}
