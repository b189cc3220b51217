//! Errors of a luminaire as photometric laboratories state them: peak, flux, deviations relative to the peak.

use crate::domain::{AzimuthExtent, Azimuths, DirectionGrid, Frame};
use serde::Serialize;

/// Fraction of the largest intensity above which an intensity enters [`LampErrors::er_l2_bright`]. Raising it leaves
/// out more weak intensities.
const BRIGHT: f64 = 0.01;

/// Errors of the intensities of a luminaire against the values in its source file, as fractions (0.01 is 1 %).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LampErrors {
    /// Relative error of the luminaire's largest intensity, as a fraction.
    pub peak: f64,
    /// Relative error of the zonal flux of a luminaire, with intensities linear in the polar angle and in the azimuth.
    pub flux: f64,
    /// Root mean square error of all intensities of the luminaire, divided by the largest intensity.
    pub rms_of_peak: f64,
    /// Root mean square of the relative errors of the luminaire's intensities above 1 % of the largest one.
    pub er_l2_bright: f64,
}

impl LampErrors {
    /// Compares intensities `found` with the original ones, `stated`, both `[polar, azimuth]` on `directions`. Returns
    /// `None` if no stated intensity is positive. Masked samples are skipped, and count as 0 in the flux.
    pub fn of(directions: &DirectionGrid, stated: &[f32], found: &[f32]) -> Option<Self> {
        let largest = |values: &[f32]| f64::from(values.iter().copied().fold(0.0, f32::max));
        let (peak, flux) = (largest(stated), zonal_flux(directions, stated));
        if !(peak > 0.0 && flux > 0.0) || stated.len() != directions.len() || found.len() != stated.len() {
            return None;
        }
        let (mut squares, mut count, mut relative, mut bright) = (0.0, 0_u64, 0.0, 0_u64);
        for (&stated, &found) in stated.iter().zip(found).filter(|(a, b)| !a.is_nan() && !b.is_nan()) {
            let (stated, error) = (f64::from(stated), f64::from(found) - f64::from(stated));
            squares += error * error;
            count += 1;
            if stated > BRIGHT * peak {
                relative += (error / stated) * (error / stated);
                bright += 1;
            }
        }
        let rms = |sum: f64, count: u64| (sum / count.max(1) as f64).sqrt();
        Some(Self {
            peak: largest(found) / peak - 1.0,
            flux: zonal_flux(directions, found) / flux - 1.0,
            rms_of_peak: rms(squares, count) / peak,
            er_l2_bright: rms(relative, bright),
        })
    }
}

/// Returns the flux of a luminaire, `∫ I dω` over the listed polar angles, linear in the polar angle and the azimuth.
/// Symmetries are unfolded.
pub(crate) fn zonal_flux(directions: &DirectionGrid, values: &[f32]) -> f64 {
    let weights = directions.azimuths().map_or_else(|| vec![360.0], azimuth_weights);
    let ring = |row: usize| -> f64 {
        let row = values[row * weights.len()..][..weights.len()].iter().zip(&weights);
        row.map(|(&value, weight)| if value.is_nan() { 0.0 } else { f64::from(value) * weight })
            .sum::<f64>()
            .to_radians()
    };
    let from_pole = match directions.frame() {
        Frame::Surface | Frame::TypeC => 0.0,
        Frame::TypeA | Frame::TypeB => 90.0,
    };
    let zone = |row: usize| {
        let [a, b] = [row - 1, row].map(|row| (directions.polar()[row] + from_pole).to_radians());
        let (first, last) = (ring(row - 1), ring(row));
        // ∫ (first + slope · (θ − a)) sin θ dθ, by parts.
        let slope = (last - first) / (b - a);
        first * libm::cos(a) - last * libm::cos(b) + slope * (libm::sin(b) - libm::sin(a))
    };
    let half = (1..directions.polar().len()).map(zone).sum::<f64>();
    if directions.is_polar_mirrored() { 2.0 * half } else { half }
}

/// Returns the degrees of the circle that each listed azimuth represents, including its mirror images.
fn azimuth_weights(azimuths: &Azimuths) -> Vec<f64> {
    let listed = &azimuths.angles;
    let (n, span) = (listed.len(), listed[listed.len() - 1] - listed[0]);
    let seam = if azimuths.extent == AzimuthExtent::Circle { 360.0 - span } else { 0.0 };
    let gap = |i: usize| if i + 1 < n { listed[i + 1] - listed[i] } else { seam };
    let images = match azimuths.extent {
        AzimuthExtent::Circle | AzimuthExtent::Closed | AzimuthExtent::Sector => 1.0,
        AzimuthExtent::Mirrored | AzimuthExtent::MirroredAt90 => 2.0,
        AzimuthExtent::Quadrant => 4.0,
    };
    (0..n).map(|i| 0.5 * images * (gap(i) + if i > 0 { gap(i - 1) } else { seam })).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn grid(frame: Frame, polar: Vec<f64>, angles: &[f64], extent: AzimuthExtent) -> DirectionGrid {
        DirectionGrid::new(frame, polar, Some(Azimuths { angles: angles.to_vec(), extent })).unwrap()
    }

    fn steps(from: f64, step: f64, count: usize) -> Vec<f64> {
        (0..count).map(|i| from + step * i as f64).collect()
    }

    #[test]
    fn one_candela_everywhere_is_the_whole_solid_angle() {
        use AzimuthExtent as E;
        for (angles, extent) in [
            (&[0.0, 90.0, 200.0, 270.0][..], E::Circle),
            (&[30.0], E::Circle),
            (&[0.0, 100.0, 360.0], E::Closed),
            (&[0.0, 45.0, 180.0], E::Mirrored),
            (&[90.0, 100.0, 270.0], E::MirroredAt90),
            (&[0.0, 30.0, 90.0], E::Quadrant),
        ] {
            let lamp = grid(Frame::TypeC, steps(0.0, 5.0, 37), angles, extent);
            assert!((zonal_flux(&lamp, &vec![1.0; lamp.len()]) / (4.0 * PI) - 1.0).abs() < 1e-12, "{extent}");
        }
        let a = grid(Frame::TypeA, steps(-90.0, 5.0, 37), &[0.0, 180.0], E::Mirrored);
        let b = grid(Frame::TypeB, steps(0.0, 5.0, 19), &[-180.0, 180.0], E::Closed).mirrored().unwrap();
        for lamp in [a, b] {
            assert!((zonal_flux(&lamp, &vec![1.0; lamp.len()]) / (4.0 * PI) - 1.0).abs() < 1e-12);
        }
        let half = grid(Frame::TypeB, steps(-90.0, 5.0, 37), &[-90.0, 90.0], E::Sector);
        assert!((zonal_flux(&half, &vec![1.0; half.len()]) / (2.0 * PI) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn errors_are_those_that_were_made() {
        let lamp = DirectionGrid::new(Frame::TypeC, vec![0.0, 45.0, 90.0], None).unwrap();
        let stated = [100.0, 50.0, 0.5];
        let found = LampErrors::of(&lamp, &stated, &[98.0, 51.0, 0.6]).unwrap();
        assert!((found.peak + 0.02).abs() < 1e-6 && (found.er_l2_bright - 0.02).abs() < 1e-6, "{found:?}");
        assert!((found.rms_of_peak - (5.01_f64 / 3.0).sqrt() / 100.0).abs() < 1e-6, "{found:?}");
        let brighter: Vec<f32> = stated.iter().map(|value| 1.01 * value).collect();
        assert!((LampErrors::of(&lamp, &stated, &brighter).unwrap().flux - 0.01).abs() < 1e-6);
        assert_eq!(LampErrors::of(&lamp, &[0.0; 3], &stated), None);
        assert_eq!(LampErrors::of(&lamp, &stated, &[1.0]), None);
    }
}
