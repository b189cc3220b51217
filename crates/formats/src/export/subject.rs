//! View of a material as the function that is exported: its spectra, their linear sRGB, or a weighted sum.

use super::error::ExportError;
use super::options::ExportOptions;
use crate::appearance::{Channels, Viewing};
use crate::domain::{Axis, Direction, WavelengthGrid};
use crate::evaluate::{Interpolation, Material, Place};
use crate::formats::DirectionalFunction;
use crate::preview::PreviewError;

/// Reduction of each spectrum of a material to the channels of an exported file.
#[derive(Debug)]
enum Made {
    Spectrum,
    Rgb(Channels),
    Sum(Vec<f64>),
}

/// Function that an export samples: it gives one value per channel at a pair of directions.
#[derive(Debug)]
pub(super) struct Subject<'a> {
    material: &'a Material,
    index: Vec<usize>,
    made: Made,
}

/// Returns the weights of wavelengths that give linear sRGB; `None` if the wavelengths allow no colour.
pub(super) fn colours(material: &Material) -> Option<Channels> {
    Channels::of(material, &Viewing::default()).ok().filter(Channels::coloured)
}

/// Returns the position, on each index axis, of the entry (spectrum or specimen) of a material that is exported; the
/// first entry by default.
pub(super) fn entry(material: &Material, options: &ExportOptions) -> Vec<usize> {
    options.index.clone().unwrap_or_else(|| vec![0; material.layout().indices])
}

pub(super) fn wavelengths(material: &Material) -> Option<&WavelengthGrid> {
    match material.axes().last() {
        Some(Axis::Wavelength(grid)) => Some(grid),
        _ => None,
    }
}

impl<'a> Subject<'a> {
    /// Creates a view of `material` that exports its spectra unchanged.
    pub(super) fn spectra(material: &'a Material, options: &ExportOptions) -> Self {
        Self { material, index: entry(material, options), made: Made::Spectrum }
    }

    /// Creates a view of `material` that exports its colours as three channels of linear sRGB.
    pub(super) fn rgb(material: &'a Material, options: &ExportOptions) -> Result<Self, ExportError> {
        let channels = Channels::of(material, &Viewing::default()).map_err(PreviewError::from)?;
        Ok(Self { material, index: entry(material, options), made: Made::Rgb(channels) })
    }

    /// Creates a view of `material` that exports one channel, a weighted sum over wavelengths: Σ weight · sample.
    pub(super) fn sum(material: &'a Material, options: &ExportOptions, weights: Vec<f64>) -> Self {
        Self { material, index: entry(material, options), made: Made::Sum(weights) }
    }

    /// Returns the number of exported channels.
    pub(super) fn channels(&self) -> usize {
        match &self.made {
            Made::Spectrum => self.material.lambdas(),
            Made::Rgb(_) => 3,
            Made::Sum(_) => 1,
        }
    }

    /// Writes the values to export at a pair of directions. Masked values, and directions that the material does not
    /// accept, give NaN.
    pub(super) fn at(&self, wi: Option<Direction>, wo: Direction, values: &mut [f64]) {
        let mut spectrum = vec![0.0_f32; self.material.lambdas()];
        let place = Place { index: &self.index, wi, wo: Some(wo) };
        if self.material.evaluate(place, Interpolation::Smooth, &mut spectrum).is_err() {
            values.fill(f64::NAN);
            return;
        }
        match &self.made {
            Made::Spectrum => values.iter_mut().zip(&spectrum).for_each(|(value, &s)| *value = f64::from(s)),
            Made::Rgb(channels) => {
                let linear = channels.linear(&spectrum).map(f64::from);
                values.iter_mut().zip(linear).for_each(|(value, c)| *value = c);
            }
            Made::Sum(weights) => {
                let sum = weights.iter().zip(&spectrum).map(|(weight, &s)| weight * f64::from(s)).sum();
                values.fill(sum);
            }
        }
    }
}

impl DirectionalFunction for Subject<'_> {
    fn evaluate(&self, wi: Direction, wo: Direction, values: &mut [f64]) {
        self.at(Some(wi), wo, values);
    }
}
