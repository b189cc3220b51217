//! Conversion of C planes of intensities (LM-63 type C, EULUMDAT) to a grid in the luminaire frame with symmetries
//! unfolded; its flux.

use super::acquisition::{AngleGrid, Angles, AzimuthExtent, Azimuths, Outside, ParseReport};
use super::azimuth::{Closing, circle, closing, merge_repeated};
use super::error::FormatError;
use super::intensities::{Ordered, Polar, Stated, mean, ordered};
use super::stated_grid::{StatedGrid, StatedGridError};
use super::text::{Brief, Source};
use crate::domain::{self, DirectionGrid, Frame};
use crate::notes::LuminaireNote;

/// Number of rows of a grid that are filled at a time, for cache locality.
const ROWS: usize = 16;

/// Rule that tells which azimuths the listed C planes of a luminaire represent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Planes {
    /// The symmetry of the luminaire follows from the first and last angle C (LM-63).
    ByAngles,
    /// The C planes cover the full circle; the first plane follows the last one.
    Circle,
}

/// Builds the grid of a luminaire in type C coordinates: gamma from nadir, C planes about the vertical axis (LM-63-2002
/// section 5.11, symmetry by the last angle).
pub(super) fn type_c(
    stated: Stated,
    stand_for: Planes,
    source: &Source,
    report: &mut ParseReport,
) -> Result<(AngleGrid, &'static str), FormatError> {
    let last_offset = stated.horizontal.last().map_or(0, |&(_, offset)| offset);
    let table = ordered(stated, (0.0, 180.0), (0.0, 360.0), source, report)?;
    let (vertical, horizontal) = (&table.vertical, &table.horizontal);
    let mut values = table.intensities.values().to_vec();
    let (first, last) = (vertical[0], vertical[vertical.len() - 1]);
    if !((first == 0.0 || first == 90.0) && (last == 90.0 || last == 180.0)) {
        report.note(LuminaireNote::VerticalAnglesUnusual { first_degrees: Brief(first), last_degrees: Brief(last) });
    }
    average_poles(vertical, horizontal.len(), &mut values, report);
    let Some(planes) = planes(horizontal.clone(), stand_for, &mut values, vertical.len(), report) else {
        return Err(source.malformed(
            last_offset,
            "horizontal angles that are no symmetry of type C, expected 0, 0–90, 0–180, 90–270 or 0–360",
        ));
    };
    let (n, columns) = (vertical.len(), planes.columns.len());
    let mut turned = vec![0.0; n * columns];
    // Processes a few rows at a time, for which each plane has a contiguous piece.
    for (block, rows) in turned.chunks_mut(ROWS * columns).enumerate() {
        let last = n - block * ROWS;
        let count = rows.len() / columns;
        for (column, &(_, plane)) in planes.columns.iter().enumerate() {
            let piece = &values[plane * n + last - count..plane * n + last];
            for (row, &value) in piece.iter().rev().enumerate() {
                rows[row * columns + column] = value;
            }
        }
    }
    let theta = vertical.iter().rev().map(|gamma| 180.0 - gamma).collect();
    let phi = planes.extent.map(|extent| Azimuths { phi: planes.columns.iter().map(|&(c, _)| c).collect(), extent });
    let mut grid = luminaire(theta, (180.0 - last, 180.0 - first), phi, turned);
    let stated =
        stated_planes(&table, planes.stated).map_err(|error| source.malformed(last_offset, error.to_string()))?;
    grid.stated = Some(Box::new(stated));
    Ok((grid, planes.symmetry))
}

/// Returns the C planes as the file lists them, before symmetries are unfolded.
fn stated_planes(table: &Ordered, extent: Option<domain::AzimuthExtent>) -> Result<StatedGrid, StatedGridError> {
    let azimuths = extent.map(|extent| domain::Azimuths { angles: table.horizontal.clone(), extent });
    let directions = DirectionGrid::new(Frame::TypeC, table.vertical.clone(), azimuths)?;
    table.stated(directions.with_outside(domain::Outside::Dark), Polar::Vertical)
}

/// Returns a grid of luminaire intensities in the surface frame, 0 outside the covered angles.
pub(super) fn luminaire(theta: Vec<f64>, covers: (f64, f64), phi: Option<Azimuths>, values: Vec<f32>) -> AngleGrid {
    AngleGrid {
        index: Vec::new(),
        incoming: None,
        outgoing: Some(Angles { theta, covers, phi }),
        spectral: None,
        outside: Outside::Zero,
        values: values.into(),
        stated: None,
        sigma: None,
    }
}

/// Averages the intensities at nadir and at zenith, where all C planes meet in one direction.
fn average_poles(vertical: &[f64], planes: usize, values: &mut [f32], report: &mut ParseReport) {
    let n = vertical.len();
    for (v, name) in [(0, "nadir"), (n - 1, "zenith")] {
        if !(vertical[v] == 0.0 || vertical[v] == 180.0) {
            continue;
        }
        let column = || (0..planes).map(|h| values[h * n + v]);
        let (low, high) = column().fold((f32::MAX, f32::MIN), |(low, high), x| (low.min(x), high.max(x)));
        if low == high {
            continue;
        }
        let average = mean(column());
        for h in 0..planes {
            values[h * n + v] = average;
        }
        report.note_unfolding(LuminaireNote::PolesAveraged { pole: name, low, high, average });
    }
}

/// Azimuths after symmetries are unfolded, each with the stored C plane that provides its intensities.
struct Unfolded {
    columns: Vec<(f64, usize)>,
    extent: Option<AzimuthExtent>,
    /// Extent of the stored C planes; `None` for a single plane C0 that represents all azimuths.
    stated: Option<domain::AzimuthExtent>,
    symmetry: &'static str,
}

fn planes(
    mut horizontal: Vec<f64>,
    stand_for: Planes,
    values: &mut Vec<f32>,
    verticals: usize,
    report: &mut ParseReport,
) -> Option<Unfolded> {
    use domain::AzimuthExtent::{Circle, Closed, Mirrored, MirroredAt90, Quadrant};
    let listed = |angles: &[f64]| angles.iter().copied().enumerate().map(|(i, c)| (c, i)).collect::<Vec<_>>();
    let (first, last) = (horizontal[0], horizontal[horizontal.len() - 1]);
    let mirrored = Some(AzimuthExtent::Mirrored);
    if horizontal.len() == 1 {
        if first != 0.0 {
            report.note(LuminaireNote::OnePlane { plane_degrees: Brief(first) });
        }
        // A single plane at another angle keeps its angle.
        let stated = (first != 0.0).then_some(Circle);
        return Some(Unfolded { columns: listed(&horizontal), extent: None, stated, symmetry: "axially symmetric" });
    }
    let by_angles = stand_for == Planes::ByAngles;
    if by_angles && (first, last) == (0.0, 90.0) {
        let mut columns = listed(&horizontal);
        let folded: Vec<_> = columns.iter().rev().filter(|(c, _)| *c < 90.0).map(|&(c, i)| (180.0 - c, i)).collect();
        columns.extend(folded);
        let stated = Some(Quadrant);
        return Some(Unfolded { columns, extent: mirrored, stated, symmetry: "quadrant symmetric" });
    }
    if by_angles && (first, last) == (0.0, 180.0) {
        let columns = listed(&horizontal);
        let stated = Some(Mirrored);
        return Some(Unfolded { columns, extent: mirrored, stated, symmetry: "symmetric about the 0-180 plane" });
    }
    if by_angles && (first, last) == (90.0, 270.0) {
        let measured = listed(&horizontal);
        let before = measured.iter().rev().filter(|(c, _)| *c > 90.0 && *c <= 180.0).map(|&(c, i)| (180.0 - c, i));
        let after = measured.iter().rev().filter(|(c, _)| *c > 180.0 && *c < 270.0).map(|&(c, i)| (540.0 - c, i));
        let columns = before.chain(measured.iter().copied()).chain(after).collect();
        let (extent, stated) = (Some(AzimuthExtent::Circle), Some(MirroredAt90));
        return Some(Unfolded { columns, extent, stated, symmetry: "symmetric about the 90-270 plane" });
    }
    let mut stated = Some(Circle);
    match closing(&horizontal) {
        Closing::Repeated => {
            stated = Some(Closed);
            let difference = merge_repeated(&mut horizontal, values, verticals);
            if difference > 0.0 {
                report.note_unfolding(LuminaireNote::ClosingPlaneDiffers {
                    first_degrees: Brief(first),
                    last_degrees: Brief(last),
                    difference_percent: 100.0 * difference,
                });
            }
        }
        _ if !by_angles => {}
        _ if first == 0.0 && last > 180.0 => assume_closed(first, last, report),
        Closing::Open => assume_closed(first, last, report),
        Closing::Gap => return None,
    }
    let extent = Some(circle(Vec::new()).extent);
    Some(Unfolded { columns: listed(&horizontal), extent, stated, symmetry: "no symmetry" })
}

fn assume_closed(first: f64, last: f64, report: &mut ParseReport) {
    report.note(LuminaireNote::PlanesDoNotClose { first_degrees: Brief(first), last_degrees: Brief(last) });
}

/// Returns the flux in lumens of a grid of candela: `∫ I dω` over the covered angles, linear in gamma and in C.
pub(crate) fn flux(grid: &AngleGrid) -> f64 {
    let Some(Angles { theta, phi, .. }) = &grid.outgoing else { return 0.0 };
    let columns = grid.values.len() / theta.len();
    let weights: Vec<f64> = match phi {
        None => vec![360.0],
        Some(Azimuths { phi, extent }) => {
            let n = phi.len();
            let step = |i: usize| if i + 1 < n { phi[i + 1] - phi[i] } else { phi[0] + 360.0 - phi[n - 1] };
            match extent {
                AzimuthExtent::Circle => (0..n).map(|i| 0.5 * (step(i) + step((i + n - 1) % n))).collect(),
                AzimuthExtent::Mirrored | AzimuthExtent::Sector => {
                    let side = |i: usize| if i + 1 < n { step(i) } else { 0.0 };
                    (0..n).map(|i| side(i) + if i > 0 { side(i - 1) } else { 0.0 }).collect()
                }
            }
        }
    };
    let ring = |t: usize| -> f64 {
        let row = &grid.values[t * columns..][..columns];
        row.iter().zip(&weights).map(|(&value, weight)| f64::from(value) * weight).sum::<f64>().to_radians()
    };
    // Between two rows: `∫ (r + s·(θ − a)) sin θ dθ`, by parts.
    let zone = |t: usize| {
        let (a, b) = (theta[t - 1].to_radians(), theta[t].to_radians());
        let (r, last) = (ring(t - 1), ring(t));
        let slope = (last - r) / (b - a);
        r * libm::cos(a) - last * libm::cos(b) + slope * (libm::sin(b) - libm::sin(a))
    };
    (1..theta.len()).map(zone).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flux_of_one_candela_is_the_solid_angle() {
        let theta: Vec<f64> = (0..=36).map(|i| f64::from(i) * 5.0).collect();
        let full = 4.0 * std::f64::consts::PI;
        let circle_of = |phi: Vec<f64>, extent| Some(Azimuths { phi, extent });
        for phi in [
            None,
            circle_of(vec![0.0, 90.0, 200.0, 270.0], AzimuthExtent::Circle),
            circle_of(vec![0.0, 45.0, 180.0], AzimuthExtent::Mirrored),
        ] {
            let n = phi.as_ref().map_or(1, |azimuths| azimuths.phi.len());
            let grid = luminaire(theta.clone(), (0.0, 180.0), phi, vec![1.0; 37 * n]);
            assert!((flux(&grid) - full).abs() < 1e-9, "{}", flux(&grid));
        }
    }
    #[test]
    fn the_flux_of_a_disk_is_pi_times_its_intensity() {
        let theta: Vec<f64> = (0..=90).map(|i| 90.0 + f64::from(i)).collect();
        let values = theta.iter().map(|t| -libm::cos(t.to_radians()) as f32).collect();
        let grid = luminaire(theta, (90.0, 180.0), None, values);
        assert!((flux(&grid) / std::f64::consts::PI - 1.0).abs() < 5e-5, "{}", flux(&grid));
    }
}
