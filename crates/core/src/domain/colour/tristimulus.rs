//! Spectra on any wavelength grid → XYZ, as weights computed once for the grid.
//!
//! A spectrum is the piecewise linear function through its samples, its end samples held to 380 and 780 nm (ASTM E308,
//! section 7.3: the weights of wavelengths that were not measured are added to those of the nearest measured one).
//! Its product with observer and illuminant, both linear between the entries of their tables, is summed over
//! nodes: every whole nm of 380..=780 and every wavelength of the grid and of the illuminant between them. A node stands for the interval to midway
//! of its neighbours, the first and the last one for half a nm beyond them. On grids of whole nm that is the
//! standard's summation at 1 nm; on finer ones no sample is passed over.
//!
//! The sum is linear in the samples, so a grid has three weights a sample, with k, illuminant, observer and Δλ inside.

use super::coverage::{ColourError, RANGE, check};
use super::tables::{Curve, Illuminant, Observer};
use super::xyz::Xyz;
use crate::domain::WavelengthGrid;

/// The maximum luminous efficacy, lm/W, as CIE 015:2018 rounds it (photometry's 683.002 is 3 ppm more).
const EFFICACY: f64 = 683.0;

/// The weights that make XYZ of samples on one grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Tristimulus {
    weights: Vec<[f64; 3]>,
}

impl Tristimulus {
    /// Of reflectance or radiance factors (1 = perfect reflector) under `illuminant`:
    /// `X = k Σ β S x̄ Δλ` with `k = 100 / Σ S ȳ Δλ`, so that the perfect reflector has Y = 100.
    pub fn reflectance(grid: &WavelengthGrid, illuminant: Illuminant) -> Result<Self, ColourError> {
        Self::reflectance_by(grid, illuminant.power(), Observer::cie_1931())
    }

    /// The same under any light, seen by any observer; a light without luminance is refused.
    pub fn reflectance_by(grid: &WavelengthGrid, power: &Curve, observer: &Observer) -> Result<Self, ColourError> {
        let mut it = Self::new(grid, power.lambdas(), |lambda| power.at(lambda), observer)?;
        let k = 100.0 / it.white().y;
        if !(k.is_finite() && k > 0.0) {
            return Err(ColourError::Dark);
        }
        it.weights.iter_mut().flatten().for_each(|w| *w *= k);
        Ok(it)
    }

    /// Of emitted spectra: `X = 683 lm/W Σ Φ x̄ Δλ`; Y is in lm/sr (cd) where samples are in W/sr/nm.
    pub fn emission(grid: &WavelengthGrid) -> Result<Self, ColourError> {
        Self::emission_by(grid, Observer::cie_1931())
    }

    /// The same, seen by any observer.
    pub fn emission_by(grid: &WavelengthGrid, observer: &Observer) -> Result<Self, ColourError> {
        Self::new(grid, &[], |_| EFFICACY, observer)
    }

    /// XYZ of a sample of 1 at each wavelength alone.
    pub fn weights(&self) -> &[[f64; 3]] {
        &self.weights
    }

    /// XYZ of one spectrum; terms are added in the order of the wavelengths.
    ///
    /// # Panics
    /// If there are not as many samples as wavelengths.
    pub fn xyz(&self, samples: &[f32]) -> Xyz {
        assert_eq!(samples.len(), self.weights.len(), "one sample for each wavelength");
        let mut sum = [0.0; 3];
        for (weights, &sample) in self.weights.iter().zip(samples) {
            for (sum, weight) in sum.iter_mut().zip(weights) {
                *sum += weight * f64::from(sample);
            }
        }
        Xyz { x: sum[0], y: sum[1], z: sum[2] }
    }

    /// XYZ of samples that are all 1: the perfect reflector, the equal-energy emitter.
    pub fn white(&self) -> Xyz {
        let [x, y, z] = self.weights.iter().fold([0.0; 3], |s, w| [s[0] + w[0], s[1] + w[1], s[2] + w[2]]);
        Xyz { x, y, z }
    }

    fn new(
        grid: &WavelengthGrid,
        lines: &[f64],
        factor: impl Fn(f64) -> f64,
        observer: &Observer,
    ) -> Result<Self, ColourError> {
        check(&grid.values())?;
        let mut weights = vec![[0.0; 3]; grid.len()];
        let nodes = nodes(grid, lines);
        let (first, last) = grid.range();
        for (n, &lambda) in nodes.iter().enumerate() {
            let low = n.checked_sub(1).map_or(lambda - 0.5, |before| 0.5 * (nodes[before] + lambda));
            let high = nodes.get(n + 1).map_or(lambda + 0.5, |after| 0.5 * (lambda + after));
            let scale = (high - low) * factor(lambda);
            let Some((i, t)) = grid.locate(lambda.clamp(first, last)) else { continue };
            for (k, curve) in [&observer.x, &observer.y, &observer.z].into_iter().enumerate() {
                let value = scale * curve.at(lambda);
                weights[i][k] += (1.0 - t) * value;
                if t > 0.0 {
                    weights[i + 1][k] += t * value;
                }
            }
        }
        Ok(Self { weights })
    }
}

/// Every whole nm of [`RANGE`] and every wavelength of the grid and of `lines` between them, once each.
fn nodes(grid: &WavelengthGrid, lines: &[f64]) -> Vec<f64> {
    let (low, high) = RANGE;
    let mut nodes: Vec<f64> = (0..=(high - low) as usize).map(|i| low + i as f64).collect();
    let more = grid.values().into_iter().chain(lines.iter().copied());
    nodes.extend(more.filter(|lambda| *lambda > low && *lambda < high));
    nodes.sort_by(f64::total_cmp);
    nodes.dedup();
    nodes
}
