//! Figures of the spectra of lights: chromaticity, colour temperature and colour rendering.

use crate::appearance::emits;
use crate::domain::colour::{ColourRendering, ColourTemperature, Observer, Tristimulus};
use crate::domain::{Axis, Quantity, WavelengthGrid};
use crate::evaluate::physics::FluxReport;
use crate::evaluate::{EvaluateError, JOULES_PER_MICROMOLE, Material};
use serde::Serialize;

/// Figures of the spectrum of a light: of a table of spectra, or the flux of a luminaire.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct LightFigures {
    /// Index on each index axis (leading axis other than directions and wavelength).
    pub index: Vec<usize>,
    /// Chromaticity (x, y) for the CIE 1931 observer.
    #[cfg_attr(feature = "schema", schema(min_items = 2, max_items = 2))]
    pub xy: [f64; 2],
    /// Correlated colour temperature in K; `None` if the chromaticity is more than 0.05 away from the Planckian locus
    /// in CIE 1960 (u, v) (CIE 015:2018, section 9.5).
    pub cct: Option<f64>,
    /// Distance Duv from the Planckian locus in CIE 1960 (u, v), positive towards green (ANSI C78.377, Ohno 2013);
    /// `None` together with the colour temperature.
    pub duv: Option<f64>,
    /// Colour rendering indices (CIE 013.3); `None` unless the spectrum covers 380 to 780 nm and the light is near
    /// enough to a reference illuminant.
    pub rendering: Option<ColourRendering>,
}

/// Computes the figures of the spectra of a light, one entry for each spectrum whose wavelengths suffice and that has
/// light; empty for other materials. `fluxes` are those of a luminaire.
pub(super) fn light_figures(
    material: &Material,
    fluxes: Option<&[FluxReport]>,
) -> Result<Vec<LightFigures>, EvaluateError> {
    let Some(Axis::Wavelength(grid)) = material.axes().last() else { return Ok(Vec::new()) };
    let Ok(tristimulus) = Tristimulus::emission(grid) else { return Ok(Vec::new()) };
    let spectra: Vec<(Vec<usize>, Vec<f32>)> = match (material.quantity(), fluxes) {
        (Quantity::Spectrum, _) => {
            let measurement = material.measurement()?;
            let rows = measurement.tensor.samples().chunks_exact(grid.len());
            rows.enumerate().map(|(entry, row)| (material.index_of(entry), row.to_vec())).collect()
        }
        (quantity, Some(fluxes)) if emits(quantity) => {
            let row = |flux: &FluxReport| flux.spectral.iter().map(|v| v.map_or(f32::NAN, |v| v as f32)).collect();
            fluxes.iter().map(|flux| (flux.index.clone(), row(flux))).collect()
        }
        _ => return Ok(Vec::new()),
    };
    let photons = material.unit().counts_photons();
    let figures = spectra.into_iter().filter_map(|(index, mut spectrum)| {
        if photons {
            let energies = grid.values().into_iter().map(|lambda| JOULES_PER_MICROMOLE / lambda);
            spectrum.iter_mut().zip(energies).for_each(|(value, energy)| *value = (f64::from(*value) * energy) as f32);
        }
        of_spectrum(index, grid, &spectrum, &tristimulus)
    });
    Ok(figures.collect())
}

fn of_spectrum(
    index: Vec<usize>,
    grid: &WavelengthGrid,
    spectrum: &[f32],
    tristimulus: &Tristimulus,
) -> Option<LightFigures> {
    let xyz = tristimulus.xyz(spectrum);
    let sum = xyz.x + xyz.y + xyz.z;
    if !(sum.is_finite() && sum > 0.0) {
        return None;
    }
    let temperature = ColourTemperature::of(xyz, Observer::cie_1931());
    Some(LightFigures {
        index,
        xy: [xyz.x / sum, xyz.y / sum],
        cct: temperature.map(|found| found.kelvin),
        duv: temperature.map(|found| found.duv),
        rendering: ColourRendering::of(grid, spectrum),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::colour::Illuminant;
    use crate::domain::{Measurement, Sampling, Tensor, Unit};

    fn figures(first: f64, value: fn(f64) -> f32) -> Vec<LightFigures> {
        let grid = WavelengthGrid::even(first, 10.0, 41).unwrap();
        let samples = grid.values().into_iter().map(value).collect();
        let tensor = Tensor::new(vec![Axis::Wavelength(grid)], samples).unwrap();
        let light = Measurement::new(Quantity::Spectrum, Unit::Relative, Sampling::Point, tensor).unwrap();
        light_figures(&Material::of(light).unwrap(), None).unwrap()
    }

    #[test]
    fn an_incandescent_light_has_its_temperature_and_rendering() {
        let lamp = |lambda: f64| Illuminant::A.power().at(lambda) as f32;
        let [light] = &figures(380.0, lamp)[..] else { panic!("one spectrum") };
        assert!((light.xy[0] - 0.4476).abs() < 1e-3 && (light.xy[1] - 0.4075).abs() < 1e-3, "{light:?}");
        assert!((light.cct.unwrap() - 2856.0).abs() < 5.0 && light.duv.unwrap().abs() < 1e-3, "{light:?}");
        assert!(light.rendering.unwrap().general > 99.0, "{light:?}");
    }

    #[test]
    fn coloured_short_and_dark_spectra_have_no_temperature_or_index() {
        let [green] = &figures(380.0, |lambda| if (500.0..560.0).contains(&lambda) { 1.0 } else { 0.0 })[..] else {
            panic!("one spectrum")
        };
        assert_eq!((green.cct, green.duv, green.rendering), (None, None, None));
        let [short] = &figures(390.0, |_| 1.0)[..] else { panic!("one spectrum") };
        assert!(short.cct.is_some() && short.rendering.is_none());
        assert!(figures(380.0, |_| 0.0).is_empty() && figures(800.0, |_| 1.0).is_empty());
    }
}
