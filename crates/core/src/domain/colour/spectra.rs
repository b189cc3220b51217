//! Colours of the spectra of a measurement, and colour differences of its decoded samples.
//!
//! A spectrum is a row along the last axis. The white to which its colour is relative depends on the quantity:
//!
//! * reflectance factors (unit 1) and BSDF (sr⁻¹) × π, that is, radiance factors: white is the perfect diffuser under
//!   the illuminant. A gloss peak above 1 has L* above 100, where the formulas still hold;
//! * phase functions, and scattering in relative units: white is the illuminant scaled to the Y of the brightest
//!   spectrum;
//! * emission (luminaires, light sources), seen directly: white has the chromaticity of the illuminant and the Y of the
//!   brightest spectrum. (The chromaticity of the brightest spectrum cannot serve as white: red light has Z = 0, by
//!   which the formulas would divide.)
//!
//! White, and thus the brightest spectrum, is always that of the original measurement. Masked samples are replaced by
//! linear interpolation between measured ones. A spectrum with too few measured ones for a colour
//! ([`super::ColourError`]) is not scored.

use super::coverage::{ColourError, check};
use super::difference::ciede2000;
use super::lab::Lab;
use super::tables::Illuminant;
use super::tristimulus::Tristimulus;
use super::xyz::Xyz;
use crate::domain::{Axis, Measurement, Quantity, Unit};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// CIEDE2000 colour differences between the spectra of two measurements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ColourReport {
    /// Illuminant under which the colours are computed.
    pub illuminant: Illuminant,
    /// Largest CIEDE2000 difference of a spectrum whose colour could be computed.
    pub largest: f64,
    /// Mean CIEDE2000 difference of the spectra whose colour could be computed.
    pub mean: f64,
    /// Number of spectra whose colour could be computed.
    pub spectra: u64,
    /// Number of spectra with too few measured wavelengths for a colour.
    pub unscored_spectra: u64,
}

/// Colours of all spectra of a measurement, as reference for colour differences.
#[derive(Clone, Debug)]
pub struct SpectraColours {
    illuminant: Illuminant,
    weights: Tristimulus,
    lambdas: Vec<f64>,
    /// White point in the scale of the samples' tristimulus values. For a BRDF it is that of the perfect diffuser with
    /// values 1/π, not 1.
    white: Xyz,
    colours: Vec<Option<Lab>>,
}

/// Number of spectra whose colours one parallel task computes; the results are added in order.
const BLOCK: usize = 256;

impl SpectraColours {
    /// Computes the colours of all spectra of `measurement` under `illuminant`.
    pub fn of(measurement: &Measurement, illuminant: Illuminant) -> Result<Self, ColourError> {
        let tensor = &measurement.tensor;
        let Some(Axis::Wavelength(grid)) = tensor.axes().last() else { return Err(ColourError::NoWavelengths) };
        let quantity = measurement.quantity;
        let emits = matches!(quantity, Quantity::Spectrum | Quantity::Edf);
        let weights = if emits { Tristimulus::emission(grid) } else { Tristimulus::reflectance(grid, illuminant) }?;
        let lambdas = grid.values();
        let all = tristimulus(&weights, &lambdas, tensor.samples());
        if all.iter().all(Option::is_none) {
            return Err(ColourError::Masked);
        }
        let brightest = all.iter().flatten().map(|xyz| xyz.y).fold(0.0, f64::max);
        let light = if emits { Tristimulus::reflectance(grid, illuminant)?.white() } else { weights.white() };
        let white = match measurement.unit {
            Unit::One if quantity == Quantity::Reflectance => light,
            // β = π·f, so f of the perfect diffuser is 1/π.
            Unit::PerSteradian if quantity.has_cosine() => light.scaled(std::f64::consts::FRAC_1_PI),
            _ if brightest > 0.0 => light.scaled(brightest / light.y),
            _ => return Err(ColourError::Dark),
        };
        let colours = all.into_iter().map(|xyz| xyz.map(|xyz| Lab::of(xyz, white))).collect();
        Ok(Self { illuminant, weights, lambdas, white, colours })
    }

    /// Returns the colour of each spectrum in CIELAB; `None` if too few of its wavelengths were measured.
    pub fn colours(&self) -> &[Option<Lab>] {
        &self.colours
    }

    /// Returns the CIEDE2000 differences between the spectra of `samples` and those of the original; both have the same
    /// axes and masks.
    ///
    /// # Panics
    /// If the number of samples differs from that of the original.
    pub fn differences(&self, samples: &[f32]) -> ColourReport {
        let found = tristimulus(&self.weights, &self.lambdas, samples);
        assert_eq!(found.len(), self.colours.len(), "measurements to compare have the same length");
        let blocks: Vec<(f64, f64, u64)> = self
            .colours
            .par_chunks(BLOCK)
            .zip(found.par_chunks(BLOCK))
            .map(|(wanted, found)| {
                let pairs = wanted.iter().zip(found).filter_map(|(wanted, found)| {
                    let wanted = (*wanted)?;
                    // A spectrum without a colour in `samples` has an infinite difference.
                    Some(found.map_or(f64::INFINITY, |xyz| ciede2000(wanted, Lab::of(xyz, self.white))))
                });
                pairs.fold((0.0_f64, 0.0, 0), |(largest, sum, n), e| (largest.max(e), sum + e, n + 1))
            })
            .collect();
        let (largest, sum, spectra) =
            blocks.iter().fold((0.0_f64, 0.0, 0), |total, b| (total.0.max(b.0), total.1 + b.1, total.2 + b.2));
        ColourReport {
            illuminant: self.illuminant,
            largest,
            mean: sum / (spectra.max(1)) as f64,
            spectra,
            unscored_spectra: self.colours.len() as u64 - spectra,
        }
    }
}

/// Returns the tristimulus values XYZ of each spectrum; `None` if too few of its wavelengths were measured.
fn tristimulus(weights: &Tristimulus, lambdas: &[f64], samples: &[f32]) -> Vec<Option<Xyz>> {
    samples.par_chunks(lambdas.len()).with_min_len(BLOCK).map(|s| xyz_of(weights, lambdas, s)).collect()
}

/// Returns the tristimulus values XYZ of a spectrum, with masked samples interpolated; `None` if too few of its
/// wavelengths were measured.
pub fn xyz_of(weights: &Tristimulus, lambdas: &[f64], spectrum: &[f32]) -> Option<Xyz> {
    if spectrum.iter().any(|s| s.is_nan()) {
        bridged(lambdas, spectrum).map(|whole| weights.xyz(&whole))
    } else {
        Some(weights.xyz(spectrum))
    }
}

/// Replaces the masked samples of a spectrum by linear interpolation; `None` if too few samples were measured.
fn bridged(lambdas: &[f64], spectrum: &[f32]) -> Option<Vec<f32>> {
    let known: Vec<usize> = (0..spectrum.len()).filter(|&i| !spectrum[i].is_nan()).collect();
    let measured: Vec<f64> = known.iter().map(|&i| lambdas[i]).collect();
    check(&measured).ok()?;
    let at = |i: usize| {
        let above = known.partition_point(|&k| k < i);
        match (above.checked_sub(1).map(|below| known[below]), known.get(above).copied()) {
            (_, Some(k)) if k == i => spectrum[i],
            (Some(a), Some(b)) => {
                let t = (lambdas[i] - lambdas[a]) / (lambdas[b] - lambdas[a]);
                ((1.0 - t) * f64::from(spectrum[a]) + t * f64::from(spectrum[b])) as f32
            }
            (Some(end), None) | (None, Some(end)) => spectrum[end],
            (None, None) => f32::NAN,
        }
    };
    Some((0..spectrum.len()).map(at).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Sampling, Tensor, WavelengthGrid};

    fn measurement(quantity: Quantity, unit: Unit, lambdas: &WavelengthGrid, spectra: &[Vec<f32>]) -> Measurement {
        let index = Axis::Index { count: spectra.len(), labels: Vec::new() };
        let axes = vec![index, Axis::Wavelength(lambdas.clone())];
        Measurement::new(quantity, unit, Sampling::Point, Tensor::new(axes, spectra.concat()).unwrap()).unwrap()
    }

    fn grid() -> WavelengthGrid {
        WavelengthGrid::even(380.0, 10.0, 41).unwrap()
    }

    fn ramp(from: f32, to: f32) -> Vec<f32> {
        (0..41).map(|i| from + (to - from) * i as f32 / 40.0).collect()
    }

    #[test]
    fn a_perfect_diffuser_is_white_and_grey_is_a_lightness() {
        let grey = |v: f32| vec![v; 41];
        let reflectance = measurement(Quantity::Reflectance, Unit::One, &grid(), &[grey(1.0), grey(0.184_186_5)]);
        let colours = SpectraColours::of(&reflectance, Illuminant::A).unwrap();
        let lightness: Vec<f64> = colours.colours().iter().map(|lab| lab.unwrap().l).collect();
        assert!((lightness[0] - 100.0).abs() < 1e-9 && (lightness[1] - 50.0).abs() < 1e-5, "{lightness:?}");
        let brdf = [grey(std::f32::consts::FRAC_1_PI)];
        let brdf = measurement(Quantity::Brdf, Unit::PerSteradian, &grid(), &brdf);
        let brdf = SpectraColours::of(&brdf, Illuminant::D65).unwrap();
        assert!((brdf.colours()[0].unwrap().l - 100.0).abs() < 1e-5);
        // Only ΔL* = 10 from 50: S_L = 1 + 0.015·25/√45 at the mean of 55.
        let sixty = (76.0_f64 / 116.0).powi(3) as f32;
        let found = colours.differences(&[grey(1.0), grey(sixty)].concat());
        let wanted = 10.0 / (1.0 + 0.015 * 25.0 / 45.0_f64.sqrt());
        assert!((found.largest - wanted).abs() < 1e-4 && (found.mean - 0.5 * wanted).abs() < 1e-4, "{found:?}");
        assert_eq!((found.spectra, found.unscored_spectra), (2, 0));
    }

    #[test]
    fn emission_is_relative_to_its_brightest_spectrum() {
        let spectra = [ramp(0.1, 2.0), ramp(1.0, 7.0), vec![0.0; 41]];
        for scale in [1.0_f32, 1e-6, 1e6] {
            let scaled = spectra.clone().map(|s| s.iter().map(|v| v * scale).collect::<Vec<f32>>());
            let lamp = measurement(Quantity::Edf, Unit::WattPerSteradianNanometre, &grid(), &scaled);
            // An EDF may have an index axis and thus no directions.
            let colours = SpectraColours::of(&lamp, Illuminant::D65).unwrap();
            let l: Vec<f64> = colours.colours().iter().map(|lab| lab.unwrap().l).collect();
            assert!((l[1] - 100.0).abs() < 1e-9 && l[0] < 70.0 && l[2].abs() < 1e-9, "{l:?}");
        }
        let red: Vec<f32> = (0..41).map(|i| if i > 25 { 1.0 } else { 0.0 }).collect();
        let red = measurement(Quantity::Spectrum, Unit::Relative, &grid(), &[red]);
        assert!(SpectraColours::of(&red, Illuminant::D65).unwrap().colours()[0].unwrap().b.is_finite());
        let phase = measurement(Quantity::Phase, Unit::PerSteradian, &grid(), &spectra);
        let phase = SpectraColours::of(&phase, Illuminant::E).unwrap();
        assert!((phase.colours()[1].unwrap().l - 100.0).abs() < 1e-9);
    }

    #[test]
    fn masked_samples_are_bridged_and_too_many_leave_the_score() {
        let whole = ramp(0.2, 0.8);
        let mut holes = whole.clone();
        for i in [0, 7, 20, 21, 40] {
            holes[i] = f32::NAN;
        }
        // Two masked neighbours leave a gap of 30 nm.
        let mut few = whole.clone();
        few[20] = f32::NAN;
        let table =
            measurement(Quantity::Reflectance, Unit::One, &grid(), &[whole.clone(), holes.clone(), few.clone()]);
        let colours = SpectraColours::of(&table, Illuminant::D65).unwrap();
        assert!(colours.colours()[1].is_none() && colours.colours()[2].is_some());
        let difference = ciede2000(colours.colours()[0].unwrap(), colours.colours()[2].unwrap());
        assert!(difference < 1e-5, "a straight spectrum loses nothing: {difference}");
        let report = colours.differences(table.tensor.samples());
        assert_eq!((report.largest, report.mean, report.spectra, report.unscored_spectra), (0.0, 0.0, 2, 1));
        let lost = colours.differences(&[whole.clone(), holes.clone(), vec![f32::NAN; 41]].concat());
        assert_eq!((lost.largest, lost.spectra), (f64::INFINITY, 2));
        let masked = measurement(Quantity::Reflectance, Unit::One, &grid(), &[holes]);
        assert_eq!(SpectraColours::of(&masked, Illuminant::D65).unwrap_err(), ColourError::Masked);
    }

    #[test]
    fn what_has_no_colour_is_refused() {
        let of = |m: &Measurement| SpectraColours::of(m, Illuminant::D65).unwrap_err();
        let dark = measurement(Quantity::Spectrum, Unit::Relative, &grid(), &[vec![0.0; 41]]);
        assert_eq!(of(&dark), ColourError::Dark);
        let ultraviolet = WavelengthGrid::even(200.0, 5.0, 41).unwrap();
        let lamp = measurement(Quantity::Spectrum, Unit::Relative, &ultraviolet, &[ramp(0.0, 1.0)]);
        assert_eq!(of(&lamp), ColourError::Uncovered { first: 200.0, last: 400.0 });
        let tensor = Tensor::new(vec![Axis::Rgb], vec![0.1, 0.2, 0.3]).unwrap();
        let rgb = Measurement::new(Quantity::Reflectance, Unit::One, Sampling::Point, tensor).unwrap();
        assert_eq!(of(&rgb), ColourError::NoWavelengths);
    }
}
