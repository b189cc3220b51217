//! Angles of the detector with a sign: the side of the plane of incidence on which they lie, and doubts about it.

use super::about::NAME;
use super::columns::{Angle, Columns};
use super::header::Header;
use super::rows::Rows;
use crate::domain::Quantity;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::in_plane::InPlaneSign;
use crate::formats::interpretation::Interpretation;
use crate::formats::text::Brief;
use crate::notes::ScatteringNote;
use std::collections::HashMap;

/// Smallest angle of incidence in degrees at which the side of a lobe is judged. Lowering it judges lobes that reach
/// over the normal.
const OBLIQUE: f64 = 10.0;
/// Largest azimuth in degrees from the plane of incidence at which a value belongs to one of its sides.
const NEAR_PLANE: f64 = 30.0;
/// Smallest number of values on each side of the plane from which an incidence is judged.
const FEWEST: usize = 3;
/// Smallest ratio of the largest values on the source's and on the mirror's side that is a lobe. Lowering it doubts
/// diffuse surfaces with noise.
const LOBE: f64 = 1.5;

/// Replaces angles of the detector with a sign by their size and an azimuth, if the file has such angles or the user
/// states their side. `alone` is true for a table whose names alone say what it is: without azimuths all its angles lie
/// in the plane of incidence.
pub(super) fn turn(
    rows: &mut Rows,
    columns: &mut Columns,
    header: &Header,
    alone: bool,
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<(), FormatError> {
    let Some(of_detector) = columns.angles[2].filter(|angle| angle.signed) else { return Ok(()) };
    let negative = rows.directions.iter().filter(|direction| direction[2] < 0.0).count();
    let has_azimuths = columns.angles[3].is_some();
    let turned_azimuths = || rows.directions.iter().any(|direction| direction[3].rem_euclid(360.0) != 0.0);
    if negative > 0 && how.in_plane_sign.is_none() && has_azimuths && turned_azimuths() {
        let message = format!(
            "{negative} negative angles theta_o beside azimuths phi_o other than 0, expected the side of positive angles at \
             azimuth 0, the option in_plane_sign: mirror or source"
        );
        return Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
    }
    let in_plane = negative > 0 || alone && !has_azimuths;
    let side = match how.in_plane_sign {
        Some(side) => {
            report.note(ScatteringNote::InPlaneAsAsked { positive: side.name() });
            side
        }
        None if in_plane => {
            report.note(ScatteringNote::InPlane);
            InPlaneSign::Mirror
        }
        None => {
            if alone {
                report.note(ScatteringNote::AzimuthsFromSource);
                doubt(rows, columns, header, report);
            }
            return Ok(());
        }
    };
    for direction in &mut rows.directions {
        let base = if has_azimuths { direction[3] } else { direction[1] };
        let is_turned = (direction[2] < 0.0) != (side == InPlaneSign::Mirror);
        // Adding zero removes the sign of a zero: angles are compared by their bits.
        direction[2] = direction[2].abs() + 0.0;
        direction[3] = if is_turned { (base + 180.0).rem_euclid(360.0) } else { base };
    }
    if !has_azimuths {
        columns.angles[3] = Some(Angle { radians: false, range: (-360.0, 720.0), from_nadir: false, signed: false });
    }
    columns.angles[2] = Some(Angle { signed: false, ..of_detector });
    doubt(rows, columns, header, report);
    Ok(())
}

/// Largest values and numbers of values on the source's and on the mirror's side of the plane of incidence.
#[derive(Clone, Copy, Default)]
struct Sides {
    largest: [f32; 2],
    values: [usize; 2],
}

/// Adds a warning if at most incidences the largest values lie on the source's side. Surfaces reflect towards the other
/// side, unless they are retro-reflectors.
fn doubt(rows: &Rows, columns: &Columns, header: &Header, report: &mut ParseReport) {
    if !matches!(header.quantity, Quantity::Brdf | Quantity::Bsdf) {
        return;
    }
    let mut incidences: HashMap<u64, Sides> = HashMap::new();
    let mut at = 0;
    for (i, direction) in rows.directions.iter().enumerate() {
        let length = rows.lengths.get(i).map_or(columns.width(), |&length| length as usize);
        let values = rows.values.get(at..at + length).unwrap_or_default();
        at += length;
        let [theta_i, phi_i, theta_o, phi_o] = *direction;
        let relative = if columns.angles[1].is_some() { phi_o - phi_i } else { phi_o }.rem_euclid(360.0);
        let from_source = relative.min(360.0 - relative);
        let side = match from_source {
            _ if theta_i < OBLIQUE || theta_o > 90.0 || theta_o == 0.0 => continue,
            near if near <= NEAR_PLANE => 0,
            far if far >= 180.0 - NEAR_PLANE => 1,
            _ => continue,
        };
        let sides = incidences.entry(theta_i.to_bits()).or_default();
        for value in values.iter().filter(|value| !value.is_nan()) {
            sides.largest[side] = sides.largest[side].max(*value);
            sides.values[side] += 1;
        }
    }
    let judged: Vec<f64> = incidences
        .values()
        .filter(|sides| sides.values.iter().all(|&values| values >= FEWEST) && sides.largest[1] > 0.0)
        .map(|sides| f64::from(sides.largest[0]) / f64::from(sides.largest[1]))
        .collect();
    let lobes = judged.iter().filter(|&&times| times > LOBE).count();
    if 2 * lobes > judged.len() {
        let times = judged.iter().copied().fold(0.0, f64::max);
        report.note(ScatteringNote::LobeOnSourceSide {
            incidences: lobes,
            of: judged.len(),
            times: Brief((times * 100.0).round() / 100.0),
        });
    }
}
