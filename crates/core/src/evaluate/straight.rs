//! Fraction of linear interpolation between stated directions that preserves the flux stated by makers of luminaires.

use super::error::EvaluateError;
use super::form::Course;
use super::geometry::Geometry;
use super::stated::Stated;
use crate::domain::{Measurement, Quantity};

/// Relative difference of the flux with cubic interpolation between the angles from the zonal flux (with straight lines
/// between them), up to which cubic interpolation alone is used.
const TOLERATED: f64 = 0.003;
/// Denominator of the share of linear interpolation in a blend with cubic interpolation; a file stores only the
/// numerator.
const ALL: f64 = 255.0;

/// Returns the least fraction of linear interpolation, in 255ths, that keeps the flux of an emission or a phase
/// function on a grid of angles. The flux must be within 0.3 % of the zonal flux of the samples, their integral with
/// straight lines between the angles. Returns 0 for other measurements.
///
/// ```
/// use wavelume_core::domain::{Axis, DirectionGrid, Frame, Measurement, Quantity, Sampling, Tensor, Unit};
/// use wavelume_core::evaluate::straight_lines_for_flux;
/// // Cubics of logarithms overshoot before a cliff of 100 : 1.
/// let gamma = DirectionGrid::new(Frame::TypeC, vec![0.0, 30.0, 60.0, 90.0], None)?;
/// let tensor = Tensor::new(vec![Axis::Grid(gamma)], vec![100.0, 100.0, 1.0, 1.0])?;
/// let lamp = Measurement::new(Quantity::Edf, Unit::Candela, Sampling::Point, tensor)?;
/// assert!(straight_lines_for_flux(&lamp)? > 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn straight_lines_for_flux(measurement: &Measurement) -> Result<u8, EvaluateError> {
    if !matches!(measurement.quantity, Quantity::Edf | Quantity::Phase) {
        return Ok(0);
    }
    let geometry = Geometry::new(measurement)?;
    if geometry.outgoing_grid().is_none() {
        return Ok(0);
    }
    let entries = geometry.entries();
    let stated = Stated::new(measurement, geometry, Course::default());
    let shares = (0..entries).map(|entry| share_of(stated.fluxes(entry)));
    Ok(shares.fold(0.0, f64::max).min(ALL) as u8)
}

/// Least share of linear interpolation in a blend with cubic interpolation, in 255ths, rounded up, for which the flux
/// differs from that of linear interpolation alone by no more than the tolerance. The flux is linear in the share.
fn share_of([curved, straight]: [f64; 2]) -> f64 {
    let difference = (curved - straight).abs();
    let tolerated = TOLERATED * straight.abs();
    if difference > tolerated { libm::ceil(ALL * (1.0 - tolerated / difference)) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compress::{self, Policy, Settings, Target};
    use crate::domain::{Axis, AzimuthExtent, Azimuths, DirectionGrid, Frame, Sampling, Silent, Tensor, Unit};
    use crate::evaluate::{Interpolation, Material};

    fn evenly(count: usize, to: f64) -> Vec<f64> {
        (0..count).map(|i| to * i as f64 / (count - 1) as f64).collect()
    }

    /// Test lamp on C-γ angles: γ from 0 to 90°, and C from 0 to 90°, one quadrant of the symmetric lamp.
    fn lamp(gamma: usize, azimuths: usize, value: impl Fn(f64, f64) -> f64) -> Measurement {
        let (polar, angles) = (evenly(gamma, 90.0), evenly(azimuths, 90.0));
        let samples = polar.iter().flat_map(|&g| angles.iter().map(move |&c| (g, c)));
        let samples = samples.map(|(g, c)| value(g, c) as f32).collect();
        let azimuths = Azimuths { angles, extent: AzimuthExtent::Quadrant };
        let grid = DirectionGrid::new(Frame::TypeC, polar, Some(azimuths)).unwrap();
        let tensor = Tensor::new(vec![Axis::Grid(grid)], samples).unwrap();
        Measurement::new(Quantity::Edf, Unit::Candela, Sampling::Point, tensor).unwrap()
    }

    /// Flux of the function of a material, which may curve between the angles.
    fn flux(material: &Material) -> f64 {
        let mut flux = [0.0];
        material.albedo(&[], None, Interpolation::Smooth, &mut flux).unwrap();
        f64::from(flux[0])
    }

    #[test]
    fn flux_is_kept_by_coarse_files_and_across_cliffs() {
        let smooth = |g: f64, c: f64| 1000.0 * libm::pow(libm::cos(g.to_radians()), 4.0) * (1.0 + c / 90.0) + 1.0;
        let cliff = |g: f64, _: f64| if g < 44.0 { 1000.0 } else { 10.0 };
        let fine = lamp(91, 19, smooth);
        assert_eq!(straight_lines_for_flux(&fine).unwrap(), 0);
        for (name, lamp) in
            [("3 x 5", lamp(3, 5, smooth)), ("16 elevations", lamp(16, 2, smooth)), ("cliff", lamp(10, 5, cliff))]
        {
            let share = straight_lines_for_flux(&lamp).unwrap();
            let stated = flux(&Material::of(lamp.clone()).unwrap().with_straight_lines(1.0));
            let curved = flux(&Material::of(lamp.clone()).unwrap());
            assert_eq!(share > 0, (curved / stated - 1.0).abs() > 0.003, "{name}: {curved} {stated} {share}");
            for (target, policy) in [(Target::Lossless, Policy::Lossless), (Target::ErL2(0.005), Policy::Rd)] {
                let settings = Settings { target, policy, straight_lines: share, ..Settings::default() };
                let file = compress::compress(&lamp, &settings, &Silent).unwrap();
                let opened = Material::open(&file.bytes).unwrap();
                let kept = flux(&opened);
                // Errors of the samples change both fluxes alike, and their ratio only slightly.
                let (stated, moved) = match target {
                    Target::Lossless => (stated, 1e-6),
                    _ => (flux(&opened.with_straight_lines(1.0)), 2e-4),
                };
                assert!((kept / stated - 1.0).abs() < 0.003 + moved, "{name}: {kept} {stated} with {share}");
                let in_file = compress::inspect(&file.bytes).unwrap().straight_lines;
                assert_eq!(in_file, Some(f64::from(share) / 255.0));
            }
            // The fraction is minimal: one 255th less is too little.
            if share > 1 {
                let less = Material::of(lamp).unwrap().with_straight_lines(f32::from(share - 1) / 255.0);
                assert!((flux(&less) / stated - 1.0).abs() > 0.003, "{name}");
            }
        }
    }

    #[test]
    fn straight_lines_by_name_are_refused_without_a_grid() {
        let tensor = Tensor::new(vec![Axis::Rgb], vec![1.0, 2.0, 3.0]).unwrap();
        let colour = Measurement::new(Quantity::Spectrum, Unit::Relative, Sampling::Point, tensor).unwrap();
        let settings = Settings { straight_lines: 255, ..Settings::default() };
        let refused = compress::compress(&colour, &settings, &Silent).unwrap_err();
        assert!(refused.to_string().contains("no grid of outgoing angles"), "{refused}");
        assert_eq!(straight_lines_for_flux(&colour).unwrap(), 0);
    }
}
