//! Flux of an emission: its intensity integrated over all directions, by wavelength, in total and as luminous flux.

use crate::compress::weights_of_angles;
use crate::domain::colour::Tristimulus;
use crate::domain::{Unit, WavelengthGrid};
use crate::evaluate::albedo::{Side, write_integrals};
use crate::evaluate::material::Material;
use crate::evaluate::photometry::Photometry;
use serde::Serialize;

/// Flux of an emission for one combination of indices (positions on the axes before the directions).
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FluxReport {
    /// Index on each index axis (leading axis other than directions and wavelength).
    pub index: Vec<usize>,
    /// Flux ∫ I dω over all directions for each sample of a spectrum; `None` if all directions are masked.
    pub spectral: Vec<Option<f64>>,
    /// Unit of the spectral flux: that of the intensity, times sr.
    pub unit: &'static str,
    /// Total flux over wavelengths. Spectral densities are integrated by the trapezoidal rule; data without wavelengths
    /// have one value, which is the total. `None` if a sample is masked, or if samples are not densities, as their sum
    /// would depend on their number.
    pub total: Option<f64>,
    /// Unit of the total flux over wavelengths.
    pub total_unit: &'static str,
    /// Luminous flux in lm (per 1000 lamp lumens for cd/klm): the total flux for candela, 683 lm/W · ∫ V(λ) Φ(λ) dλ for
    /// watts or photons per nm.
    pub luminous: Option<f64>,
    /// Reason why the luminous flux is missing.
    pub reason: Option<String>,
}

impl Material {
    pub(super) fn fluxes(&self) -> Vec<FluxReport> {
        let (photometry, weights) = (self.photometry(), self.flux_weights());
        let flux = |entry| self.flux(entry, &self.flux_row(entry, weights.as_deref()), photometry.as_ref());
        (0..self.geometry().entries()).map(flux).collect()
    }

    /// Solid angles of the angles of a grid; `None` for triangles.
    pub(super) fn flux_weights(&self) -> Option<Vec<f64>> {
        self.outgoing_grid().map(|grid| weights_of_angles(self.quantity(), grid))
    }

    /// Flux over all directions at each wavelength, for one combination of indices; NaN if all directions are masked.
    /// For a grid, `weights` are the solid angles of its directions, so that intensities are straight lines between its
    /// angles, as in zonal fluxes (CIE 121, IES LM-79).
    pub(super) fn flux_row(&self, entry: usize, weights: Option<&[f64]>) -> Vec<f32> {
        let lambdas = self.lambdas();
        if let Some(weights) = weights {
            let mut row = vec![0.0; lambdas];
            write_integrals(&self.slice(entry), weights, &mut row);
            return row;
        }
        let cells = self.over_triangles().ok();
        let table = cells.and_then(|cells| cells.stored_albedos(Side::Both, true)).unwrap_or_default();
        table.chunks_exact(lambdas).nth(entry).map_or_else(|| vec![f32::NAN; lambdas], <[f32]>::to_vec)
    }

    fn flux(&self, entry: usize, row: &[f32], photometry: Option<&Photometry>) -> FluxReport {
        let (unit, total_unit) = units(self.unit());
        let is_whole = row.iter().all(|v| !v.is_nan());
        let total = match self.geometry().grid() {
            _ if !is_whole => None,
            Some(grid) if is_density(self.unit()) => Some(integral(grid, row)),
            None if row.len() == 1 => Some(f64::from(row[0])),
            _ => None,
        };
        let luminous = self.luminous(row, total, photometry);
        FluxReport {
            index: self.index_of(entry),
            spectral: row.iter().map(|v| (!v.is_nan()).then_some(f64::from(*v))).collect(),
            unit,
            total,
            total_unit: if self.geometry().grid().is_some() { total_unit } else { unit },
            reason: luminous.as_ref().err().cloned(),
            luminous: luminous.ok(),
        }
    }

    fn luminous(&self, row: &[f32], total: Option<f64>, photometry: Option<&Photometry>) -> Result<f64, String> {
        let unit = self.unit();
        if matches!(unit, Unit::Candela | Unit::CandelaPerKilolumen) {
            return total.ok_or_else(|| {
                "the intensity in candela depends on wavelength or is masked in every direction".to_owned()
            });
        }
        if unit.watts().is_none() {
            return Err(format!("the unit is {unit}, expected an intensity in cd, cd/klm or W/(sr nm)"));
        }
        let grid = self.geometry().grid().ok_or_else(|| "the intensity has no wavelengths".to_owned())?;
        Tristimulus::emission(grid).map_err(|error| error.to_string())?;
        let luminous = photometry.map_or(f64::NAN, |photometry| photometry.intensity(row));
        if luminous.is_nan() {
            Err("the intensity at a wavelength is masked in every direction".to_owned())
        } else {
            Ok(luminous)
        }
    }
}

fn integral(grid: &WavelengthGrid, row: &[f32]) -> f64 {
    grid.weights().iter().zip(row).map(|(weight, &v)| weight * f64::from(v)).sum()
}

/// Returns true if values in this unit are densities over wavelength.
fn is_density(unit: Unit) -> bool {
    unit.watts().is_some() || unit == Unit::RelativePerNanometre
}

/// Unit of the spectral flux of an intensity in a given unit, and unit of its total over wavelengths.
fn units(unit: Unit) -> (&'static str, &'static str) {
    let spectral = unit.over_directions();
    (spectral, spectral.strip_suffix("/nm").unwrap_or(spectral))
}
