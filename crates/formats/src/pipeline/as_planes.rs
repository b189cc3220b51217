//! Conversion of luminaires measured from the zenith into the type C planes of luminaire files.

use crate::domain::{Axis, AzimuthExtent, Azimuths, DirectionGrid, Frame, Measurement, Outside, Quantity, Tensor};
use crate::export::ExportFormat;

/// Number of rounding steps of polar angles in one degree: 1e9 rounds to 1e-9°. Raising it keeps more floating-point
/// noise of `180 − theta`.
const PARTS: f64 = 1e9;

/// Converts a luminaire from a grid of theta and phi to the luminaire angles gamma = 180° − theta and C = phi, in order
/// of increasing gamma. The samples are unchanged. Returns `None` for other measurements, and for azimuths that
/// `format` cannot hold.
pub(super) fn as_planes(measurement: &Measurement, format: ExportFormat) -> Option<Measurement> {
    let [Axis::Grid(own)] = measurement.tensor.axes() else { return None };
    let is_luminaire = matches!(format, ExportFormat::Lm63 | ExportFormat::Eulumdat);
    if !is_luminaire || measurement.quantity != Quantity::Edf || own.frame() != Frame::Surface {
        return None;
    }
    // LM-63 repeats the first plane of a full circle as the last.
    let closes =
        format == ExportFormat::Lm63 && own.azimuths().is_some_and(|azimuths| azimuths.extent == AzimuthExtent::Circle);
    let azimuths = match own.azimuths() {
        None => None,
        Some(azimuths) if azimuths.extent == AzimuthExtent::Sector || closes && azimuths.angles[0] != 0.0 => {
            return None;
        }
        Some(azimuths) if closes => {
            let angles = azimuths.angles.iter().copied().chain([360.0]).collect();
            Some(Azimuths { angles, extent: AzimuthExtent::Closed })
        }
        Some(azimuths) => Some(azimuths.clone()),
    };
    let from_nadir = |theta: &f64| ((180.0 - theta) * PARTS).round() / PARTS;
    let polar: Vec<f64> = own.polar().iter().rev().map(from_nadir).collect();
    let grid = DirectionGrid::new(Frame::TypeC, polar, azimuths).ok()?.with_outside(Outside::Dark);
    let [_, columns] = own.shape();
    let rows = measurement.tensor.samples().chunks_exact(columns).rev();
    let samples = rows.flat_map(|row| row.iter().chain(&row[..usize::from(closes)])).copied().collect();
    let tensor = Tensor::new(vec![Axis::Grid(grid)], samples).ok()?;
    Some(Measurement { tensor, ..measurement.clone() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Sampling;

    #[test]
    fn samples_keep_their_directions() {
        for extent in [AzimuthExtent::Circle, AzimuthExtent::Mirrored] {
            let azimuths = Azimuths { angles: vec![0.0, 60.0, 180.0], extent };
            let grid = DirectionGrid::new(Frame::Surface, vec![90.0, 120.1, 179.9], Some(azimuths)).unwrap();
            let tensor = Tensor::new(vec![Axis::Grid(grid.clone())], (1_u8..10).map(f32::from).collect()).unwrap();
            let unit = Quantity::Edf.default_unit();
            let measurement = Measurement::new(Quantity::Edf, unit, Sampling::Point, tensor).unwrap();
            let planes = as_planes(&measurement, ExportFormat::Lm63).unwrap();
            let [Axis::Grid(found)] = planes.tensor.axes() else { panic!("a grid") };
            assert_eq!(found.polar(), [0.1, 59.9, 90.0]);
            for (entry, value) in measurement.tensor.samples().iter().enumerate() {
                let at = found.nearest(grid.direction(entry)).unwrap();
                assert_eq!(planes.tensor.samples()[at], *value);
            }
        }
    }
}
