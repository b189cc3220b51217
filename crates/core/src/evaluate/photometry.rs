//! Luminaires as photometry sees them: directions by C and gamma, and spectra reduced to one intensity.

use super::error::{EvaluateError, QueryError, unfit};
use super::material::Material;
use crate::domain::colour::Tristimulus;
use crate::domain::{Axis, Direction, Quantity, Unit, WavelengthGrid};

/// `N_A·h·c` in J·nm/µmol (SI of 2019). Divided by a wavelength in nm, it is the energy of 1 µmol of photons.
pub const JOULES_PER_MICROMOLE: f64 = 119.626_565_8;

/// Weights that reduce each spectrum of an emission to one intensity, and the unit of the intensity.
#[derive(Clone, Debug, PartialEq)]
pub struct Photometry {
    /// Weights of the spectral samples: the intensity in a direction is Σ weight · sample over wavelengths.
    pub weights: Vec<f64>,
    /// Unit of the intensity: candela if the spectrum has a power and covers the visible range.
    pub unit: Unit,
}

impl Photometry {
    /// Returns the weights with which the spectra of an emission are reduced to intensities: 683 lm/W · V(λ) Δλ for
    /// watts or photons over the visible range, Δλ for other densities over wavelength, 1 for single intensities.
    /// `spectral` is the axis of the wavelengths. `None` for other quantities, for spectra that are no densities, and
    /// for single values in a unit that is no intensity.
    pub fn of(quantity: Quantity, unit: Unit, spectral: Option<&Axis>) -> Option<Self> {
        if quantity != Quantity::Edf {
            return None;
        }
        let grid = match spectral {
            None => {
                let is_intensity =
                    matches!(unit, Unit::Candela | Unit::CandelaPerKilolumen) || unit.per_nanometre().is_some();
                return is_intensity.then(|| Self { weights: vec![1.0], unit });
            }
            Some(Axis::Wavelength(grid)) => grid,
            Some(_) => return None,
        };
        let (Some(watts), Ok(tristimulus)) = (unit.watts(), Tristimulus::emission(grid)) else {
            return Self::total(unit, grid);
        };
        let energy = |lambda: f64| if unit.counts_photons() { JOULES_PER_MICROMOLE / lambda } else { 1.0 };
        let weights = tristimulus.weights().iter().zip(grid.values()).map(|(w, l)| watts * energy(l) * w[1]).collect();
        Some(Self { weights, unit: Unit::Candela })
    }

    /// Returns the weights that sum the spectra of an emission over all wavelengths; `None` if they are no densities.
    pub fn total(unit: Unit, grid: &WavelengthGrid) -> Option<Self> {
        // Relative spectra are taken as densities.
        let density = if unit == Unit::Relative { Unit::RelativePerNanometre } else { unit };
        let total = Unit::ALL.iter().copied().find(|total| total.per_nanometre() == Some(density))?;
        Some(Self { weights: grid.weights(), unit: total })
    }

    /// Returns true if the intensities are photometric: candela or candela per kilolumen.
    pub fn is_luminous(&self) -> bool {
        matches!(self.unit, Unit::Candela | Unit::CandelaPerKilolumen)
    }

    /// Returns the intensity of a spectrum: NaN if a sample is masked.
    pub fn intensity(&self, spectrum: &[f32]) -> f64 {
        spectrum.iter().zip(&self.weights).map(|(&s, weight)| f64::from(s) * weight).sum()
    }

    /// Returns the intensities of samples `[direction, wavelength]`, one for each direction. A direction with a masked
    /// sample has NaN.
    ///
    /// # Panics
    /// If there are no weights.
    pub fn intensities(&self, samples: &[f32]) -> Vec<f64> {
        samples.chunks_exact(self.weights.len()).map(|spectrum| self.intensity(spectrum)).collect()
    }
}

/// Returns the direction with the angles C and gamma of a luminaire in degrees: theta = 180° − gamma, phi = C. Fails
/// for other quantities than an emission, and for angles that are no direction.
pub fn luminaire_direction(quantity: Quantity, c: f64, gamma: f64) -> Result<Direction, EvaluateError> {
    if quantity != Quantity::Edf {
        return unfit(QueryError::NoLuminaire { quantity });
    }
    if c.is_finite() && (0.0..=180.0).contains(&gamma) {
        Ok(Direction::from_luminaire_degrees(c, gamma))
    } else {
        unfit(QueryError::LuminaireAngles { c, gamma })
    }
}

impl Material {
    /// Returns the weights with which the spectra of an emission are reduced to intensities ([`Photometry::of`]).
    pub fn photometry(&self) -> Option<Photometry> {
        let spectral = self.axes().last().filter(|axis| axis.is_spectral());
        self.layout().outgoing.and_then(|_| Photometry::of(self.quantity(), self.unit(), spectral))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn c_and_gamma_are_angles_of_luminaires_alone() {
        let direction = |quantity, c, gamma| luminaire_direction(quantity, c, gamma).map_err(|error| error.to_string());
        assert_eq!(direction(Quantity::Edf, 90.0, 90.0), Ok(Direction::from_degrees(90.0, 90.0)));
        assert_eq!(direction(Quantity::Edf, -90.0, 0.0).unwrap().xyz()[2], -1.0);
        for (c, gamma) in [(0.0, -1.0), (0.0, 180.5), (f64::NAN, 0.0), (f64::INFINITY, 0.0), (0.0, f64::NAN)] {
            assert!(direction(Quantity::Edf, c, gamma).unwrap_err().contains("gamma from 0 (straight down) to 180"));
        }
        assert!(direction(Quantity::Brdf, 0.0, 0.0).unwrap_err().contains("but this is a brdf: give"));
    }

    #[test]
    fn spectra_are_summed_or_seen() {
        let lambda = Axis::Wavelength(WavelengthGrid::even(400.0, 100.0, 4).unwrap());
        let of =
            |unit, spectral| Photometry::of(Quantity::Edf, unit, spectral).map(|found| (found.weights, found.unit));
        assert_eq!(of(Unit::Candela, None), Some((vec![1.0], Unit::Candela)));
        assert_eq!(of(Unit::One, None), None);
        assert_eq!(of(Unit::Candela, Some(&Axis::Rgb)), None);
        let summed = of(Unit::Relative, Some(&lambda)).unwrap();
        assert_eq!(summed, (vec![50.0, 100.0, 100.0, 50.0], Unit::Relative));
        assert_eq!(Photometry::of(Quantity::Brdf, Unit::PerSteradian, None), None);
        let total = Photometry { weights: vec![1.0, 2.0], unit: Unit::Relative };
        let found = total.intensities(&[1.0, 1.0, 3.0, f32::NAN]);
        assert!(found[0] == 3.0 && found[1].is_nan() && !total.is_luminous());
    }
}
