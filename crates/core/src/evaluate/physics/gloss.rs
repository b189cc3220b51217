//! Specular gloss of surfaces at 20, 60 and 85 degrees (ISO 2813, ASTM D523).

use crate::domain::colour::{Illuminant, Tristimulus};
use crate::domain::{Axis, Direction, Quantity};
use crate::evaluate::error::EvaluateError;
use crate::evaluate::material::Material;
use crate::evaluate::place::{Interpolation, Place};
use serde::Serialize;

/// Specular gloss of a surface at one angle of incidence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct GlossReport {
    /// Angle of incidence in degrees: 20, 60 or 85.
    pub angle: f64,
    /// Gloss units: 100 for black glass with the refractive index 1.567. `None` if a direction of the aperture was not
    /// measured, or the surface has colour channels without wavelengths.
    pub gloss: Option<f64>,
}

/// Geometries of ISO 2813: angle of incidence, and the receptor's aperture in the plane of incidence and across it, all
/// in degrees.
const GEOMETRIES: [(f64, f64, f64); 3] = [(20.0, 1.8, 3.6), (60.0, 4.4, 11.7), (85.0, 4.0, 6.0)];
/// Refractive index of the black glass that has 100 gloss units.
const GLASS: f64 = 1.567;
/// Parts of an aperture in the plane of incidence, and across it. Raising them costs time.
const PARTS: (usize, usize) = (24, 48);

impl Material {
    /// Computes the gloss of a BRDF or BSDF at 20, 60 and 85 degrees, for one combination of indices and light from
    /// azimuth 0; empty for other quantities.
    ///
    /// Light from one direction is reflected into the receptor's aperture: 100 · ∫ f cos θo dωo over the aperture about
    /// the mirror direction, divided by the reflectance of the glass. The image of the source, 0.75° × 2.5°, lies
    /// within the aperture, so that its size hardly matters. Spectra are weighted by illuminant C and V(λ).
    pub fn gloss(&self, index: &[usize]) -> Result<Vec<GlossReport>, EvaluateError> {
        if !matches!(self.quantity(), Quantity::Brdf | Quantity::Bsdf) || self.layout().outgoing.is_none() {
            return Ok(Vec::new());
        }
        let weights = self.luminous_weights();
        let reports = GEOMETRIES.map(|(angle, along, across)| {
            let gloss = weights.as_ref().and_then(|weights| {
                let light = self.light_in_aperture(index, angle, (along, across), weights)?;
                Some(100.0 * light / fresnel(angle))
            });
            GlossReport { angle, gloss }
        });
        Ok(reports.to_vec())
    }

    /// Weights that give the luminance factor of spectra under illuminant C; 1 for a single value. `None` for colour
    /// channels and for wavelengths that do not suffice.
    fn luminous_weights(&self) -> Option<Vec<f32>> {
        match self.axes().last() {
            Some(Axis::Wavelength(grid)) => {
                let weights = Tristimulus::reflectance(grid, Illuminant::C).ok()?;
                Some(weights.weights().iter().map(|xyz| (xyz[1] / 100.0) as f32).collect())
            }
            Some(Axis::Rgb) => None,
            _ => Some(vec![1.0]),
        }
    }

    /// Part of the light from an angle of incidence that is reflected into an aperture about the mirror direction.
    fn light_in_aperture(
        &self,
        index: &[usize],
        angle: f64,
        (along, across): (f64, f64),
        weights: &[f32],
    ) -> Option<f64> {
        let wi = Direction::from_degrees(angle, 0.0);
        let (steps, side) = PARTS;
        let mut sum = 0.0;
        for (i, k) in (0..steps).flat_map(|i| (0..side).map(move |k| (i, k))) {
            let middle = |i: usize, count: usize, whole: f64| whole * ((i as f64 + 0.5) / count as f64 - 0.5);
            let (in_plane, beside) = (middle(i, steps, along), middle(k, side, across).to_radians());
            let [x, _, z] = Direction::from_degrees(angle + in_plane, 180.0).xyz();
            let (sine, cosine) = libm::sincos(beside);
            let wo = Direction::from_unit([cosine * x, sine, cosine * z]);
            if !self.is_measured(Some(wi), Some(wo)) {
                return None;
            }
            let value = self.weighted(Place { index, wi: Some(wi), wo: Some(wo) }, Interpolation::Smooth, weights);
            let value = value.ok().filter(|value| !value.is_nan())?;
            sum += f64::from(value) * wo.cos_theta() * cosine;
        }
        let part = (along / steps as f64).to_radians() * (across / side as f64).to_radians();
        Some(sum * part)
    }
}

/// Reflectance of the black glass for unpolarised light at an angle of incidence in degrees.
fn fresnel(angle: f64) -> f64 {
    let (sine, cosine) = libm::sincos(angle.to_radians());
    let inside = (GLASS * GLASS - sine * sine).sqrt();
    let across = (cosine - inside) / (cosine + inside);
    let along = (GLASS * GLASS * cosine - inside) / (GLASS * GLASS * cosine + inside);
    0.5 * (across * across + along * along)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{
        AzimuthExtent, Azimuths, DirectionGrid, Frame, Measurement, Sampling, Tensor, Unit, WavelengthGrid,
    };
    use std::f64::consts::PI;

    fn surface(last: f64, value: f32) -> Material {
        let polar = (0..=(last as usize)).map(|theta| theta as f64).collect();
        let azimuths = Azimuths { angles: vec![0.0, 90.0, 180.0], extent: AzimuthExtent::Mirrored };
        let outgoing = DirectionGrid::new(Frame::Surface, polar, Some(azimuths)).unwrap();
        let lambda = Axis::Wavelength(WavelengthGrid::even(400.0, 20.0, 16).unwrap());
        let axes = vec![Axis::Elevation(vec![20.0, 60.0, 85.0]), Axis::Grid(outgoing), lambda];
        let samples = vec![value; axes.iter().map(Axis::len).product()];
        let tensor = Tensor::new(axes, samples).unwrap();
        Material::of(Measurement::new(Quantity::Brdf, Unit::PerSteradian, Sampling::Point, tensor).unwrap()).unwrap()
    }

    #[test]
    fn the_glass_reflects_what_the_standard_says() {
        for (angle, reflectance) in [(20.0, 0.0491), (60.0, 0.1000), (85.0, 0.6191)] {
            assert!((fresnel(angle) - reflectance).abs() < 1e-4, "{angle} {}", fresnel(angle));
        }
    }

    #[test]
    fn a_matt_white_surface_has_the_gloss_of_its_apertures() {
        let found = surface(90.0, (1.0 / PI) as f32).gloss(&[]).unwrap();
        for (report, (angle, along, across)) in found.iter().zip(GEOMETRIES) {
            let solid_angle = along.to_radians() * 2.0 * (0.5 * across.to_radians()).sin();
            let wanted = 100.0 / PI * solid_angle * angle.to_radians().cos() / fresnel(angle);
            assert!((report.gloss.unwrap() / wanted - 1.0).abs() < 3e-3, "{report:?} {wanted}");
        }
        assert!(found[1].gloss.unwrap() > 2.0 && found[1].gloss.unwrap() < 3.0, "{found:?}");
    }

    #[test]
    fn apertures_that_were_not_measured_have_no_gloss() {
        let found = surface(70.0, 0.1).gloss(&[]).unwrap();
        assert!(found[0].gloss.is_some() && found[1].gloss.is_some() && found[2].gloss.is_none(), "{found:?}");
        let masked = surface(90.0, f32::NAN).gloss(&[]).unwrap();
        assert!(masked.iter().all(|report| report.gloss.is_none()));
    }
}
