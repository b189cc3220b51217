//! Conversion of photometric types A and B to a type C grid, bilinear in the file's own angles.

use crate::domain::{AzimuthExtent, Azimuths, Direction, DirectionGrid, Frame, Outside};
use crate::formats::acquisition::{AngleGrid, ParseReport};
use crate::formats::azimuth::circle;
use crate::formats::error::FormatError;
use crate::formats::intensities::{Ordered, Polar, Stated, ordered};
use crate::formats::stated_grid::{StatedGrid, StatedGridError};
use crate::formats::text::{Source, listed};
use crate::formats::type_c::luminaire;
use crate::notes::LuminaireNote;
use crate::numeric::bracket::Bracket;

/// Photometric type of an LM-63 file: the coordinate system of its angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Photometry {
    A,
    B,
    C,
}

impl Photometry {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::A => "A",
            Self::B => "B",
            Self::C => "C",
        }
    }
}

/// Candidate steps of the resampled C grid in degrees, coarse first, each a divisor of 90.
const STEPS: [f64; 6] = [5.0, 2.5, 2.0, 1.0, 0.5, 0.25];
/// Tolerance in degrees outside the range of the listed angles, for rounding errors of `asin` and `atan2`.
const ROUNDING: f64 = 1e-9;

/// Resamples intensities of type A or B onto a type C grid as fine as the listed angles, but no finer than 0.25°.
/// Values outside the listed angles are zero.
///
/// Type B has planes about a horizontal axis, `d = (cos H sin V, −sin H, −cos H cos V)`. Type A has planes about the
/// vertical axis, `d = (cos V cos H, −cos V sin H, sin V)`. H grows clockwise.
pub(super) fn convert(
    stated: Stated,
    photometry: Photometry,
    source: &Source,
    report: &mut ParseReport,
) -> Result<(AngleGrid, &'static str), FormatError> {
    let (vertical_range, horizontal_range) = match photometry {
        Photometry::B => ((-180.0, 180.0), (-90.0, 90.0)),
        _ => ((-90.0, 90.0), (-180.0, 180.0)),
    };
    if stated.horizontal.len() < 2 {
        let message = format!("one horizontal angle in type {}, expected at least two", photometry.name());
        return Err(source.malformed(source.text().len(), message));
    }
    let table = ordered(stated, vertical_range, horizontal_range, source, report)?;
    report.metadata.push(("native_vertical_angles".to_owned(), listed(&table.vertical)));
    report.metadata.push(("native_horizontal_angles".to_owned(), listed(&table.horizontal)));
    let lateral = table.horizontal[0] >= 0.0;
    let step = step(&table);
    // Planes within ±90° of nadir contain no direction above the horizon.
    let below =
        photometry == Photometry::B && table.vertical[0] >= -90.0 && table.vertical[table.vertical.len() - 1] <= 90.0;
    let lowest = if below { 90.0 } else { 0.0 };
    let rows = ((180.0 - lowest) / step) as usize + 1;
    let theta: Vec<f64> = (0..rows).map(|i| lowest + i as f64 * step).collect();
    let phi: Vec<f64> = (0..(360.0 / step) as usize).map(|i| i as f64 * step).collect();
    let mut values = Vec::with_capacity(theta.len() * phi.len());
    for &t in &theta {
        for &c in &phi {
            let (vertical, horizontal) = native_angles(photometry, Direction::from_degrees(t, c));
            values.push(table.at(vertical, if lateral { horizontal.abs() } else { horizontal }));
        }
    }
    report.note_unfolding(LuminaireNote::ResampledToTypeC {
        photometry: photometry.name(),
        rows: table.vertical.len(),
        columns: table.horizontal.len(),
        polar: theta.len(),
        planes: phi.len(),
    });
    if lateral {
        report.note(LuminaireNote::SidesAlike);
    }
    let symmetry = if lateral { "laterally symmetric" } else { "no symmetry" };
    let mut grid = luminaire(theta, (lowest, 180.0), Some(circle(phi)), values);
    let stated =
        stated_planes(&table, photometry).map_err(|error| source.malformed(source.text().len(), error.to_string()))?;
    grid.stated = Some(Box::new(stated));
    Ok((grid, symmetry))
}

/// Returns the intensities of an LM-63 file of type A or B on the planes that the file lists. Horizontal angles are the
/// latitudes of type B, vertical angles those of type A. If no horizontal angle is negative, the values hold for both
/// sides of the luminaire, left and right of horizontal angle 0.
fn stated_planes(table: &Ordered, photometry: Photometry) -> Result<StatedGrid, StatedGridError> {
    let is_lateral = table.horizontal[0] >= 0.0;
    let azimuths = |angles: &[f64], is_mirrored: bool| {
        let span = angles[angles.len() - 1] - angles[0];
        let extent = match (is_mirrored, span == 360.0) {
            (true, _) => AzimuthExtent::Mirrored,
            (_, true) => AzimuthExtent::Closed,
            _ => AzimuthExtent::Sector,
        };
        Azimuths { angles: angles.to_vec(), extent }
    };
    let (directions, polar) = if photometry == Photometry::B {
        let planes = azimuths(&table.vertical, false);
        let directions = DirectionGrid::new(Frame::TypeB, table.horizontal.clone(), Some(planes))?;
        (if is_lateral { directions.mirrored()? } else { directions }, Polar::Horizontal)
    } else {
        let planes = azimuths(&table.horizontal, is_lateral);
        (DirectionGrid::new(Frame::TypeA, table.vertical.clone(), Some(planes))?, Polar::Vertical)
    };
    table.stated(directions.with_outside(Outside::Dark), polar)
}

/// Returns the vertical and the horizontal angle of a direction in degrees, in type A or B. The angle of the plane is 0
/// at the poles, where all planes meet.
fn native_angles(photometry: Photometry, direction: Direction) -> (f64, f64) {
    let [x, y, z] = direction.xyz();
    let azimuth = |y: f64, x: f64| if libm::hypot(x, y) < 1e-12 { 0.0 } else { libm::atan2(y, x) };
    let (vertical, horizontal) = match photometry {
        Photometry::B => (azimuth(x, -z), libm::asin((-y).clamp(-1.0, 1.0))),
        _ => (libm::asin(z.clamp(-1.0, 1.0)), azimuth(-y, x)),
    };
    (vertical.to_degrees(), horizontal.to_degrees())
}

/// Returns the step in degrees of the C planes and angles to which a luminaire is resampled: the coarsest of the
/// candidates that is no coarser than the steps in the file.
fn step(table: &Ordered) -> f64 {
    let spacing = |angles: &[f64]| angles.array_windows().map(|[a, b]| b - a).fold(f64::MAX, f64::min);
    let finest = spacing(&table.vertical).min(spacing(&table.horizontal));
    STEPS.into_iter().find(|&step| step <= finest).unwrap_or(0.25)
}

impl Ordered {
    /// Returns the intensity at a vertical and a horizontal angle, bilinear in the listed angles and 0 outside them. A
    /// single plane is valid at its own angle only.
    fn at(&self, vertical: f64, horizontal: f64) -> f32 {
        let (Some(v), Some(h)) = (locate(&self.vertical, vertical), locate(&self.horizontal, horizontal)) else {
            return 0.0;
        };
        let n = self.vertical.len();
        let values = self.intensities.values();
        let value = |h: usize, v: usize| f64::from(values[h * n + v]);
        let along = |h: usize| (1.0 - v.t) * value(h, v.below) + v.t * value(h, v.above);
        ((1.0 - h.t) * along(h.below) + h.t * along(h.above)) as f32
    }
}

/// Returns the listed angles around `angle` for interpolation; `None` outside the listed angles.
fn locate(angles: &[f64], angle: f64) -> Option<Bracket> {
    let (first, last) = (angles[0], angles[angles.len() - 1]);
    if angle < first - ROUNDING || angle > last + ROUNDING {
        return None;
    }
    Some(Bracket::held(angles, angle))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::intensities::Intensities;

    #[test]
    fn native_angles_invert_their_directions() {
        let (sin, cos) = (|d: f64| libm::sin(d.to_radians()), |d: f64| libm::cos(d.to_radians()));
        for v in [-80.0, -30.0, 0.0, 45.0, 89.0] {
            for h in [-89.0, -10.0, 0.0, 20.0, 75.0] {
                let b = Direction::new(cos(h) * sin(v), -sin(h), -cos(h) * cos(v)).unwrap();
                let a = Direction::new(cos(v) * cos(h), -cos(v) * sin(h), sin(v)).unwrap();
                for (photometry, d) in [(Photometry::A, a), (Photometry::B, b)] {
                    let (found_v, found_h) = native_angles(photometry, d);
                    assert!((found_v - v).abs() < 1e-9 && (found_h - h).abs() < 1e-9, "{photometry:?} {v} {h}");
                }
            }
        }
        assert_eq!(native_angles(Photometry::B, Direction::from_degrees(90.0, 90.0)), (0.0, -90.0));
        assert_eq!(native_angles(Photometry::A, Direction::from_degrees(180.0, 180.0)), (-90.0, 0.0));
    }

    #[test]
    fn tables_are_bilinear_inside_and_dark_outside() {
        let list = |angles: &[f64]| angles.iter().map(|&angle| (angle, 0)).collect();
        let mut intensities = Intensities::new(1.0, 6);
        for number in [0.0, 2.0, 4.0, 8.0, 0.0, 0.0] {
            intensities.push(number);
        }
        let stated = Stated { vertical: list(&[-90.0, 90.0]), horizontal: list(&[-90.0, 0.0, 90.0]), intensities };
        let (source, range) = (Source::decode(b"", "t"), (-90.0, 90.0));
        let table = ordered(stated, range, range, &source, &mut ParseReport::default()).unwrap();
        assert_eq!(table.at(0.0, 0.0), 6.0);
        assert_eq!(table.at(0.0, -45.0), 3.5);
        assert_eq!(table.at(90.0 + 1e-12, 0.0), 8.0);
        assert_eq!(table.at(91.0, 0.0), 0.0);
    }
}
