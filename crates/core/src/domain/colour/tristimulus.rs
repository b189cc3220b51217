//! Tristimulus values of spectra on any wavelength grid, by weights computed once per grid.
//!
//! A spectrum is the piecewise linear function through its samples, extended to 380 and 780 nm with the values of its
//! end samples. (ASTM E308, section 7.3: weights of wavelengths that were not measured are added to those of the
//! nearest measured one.)
//!
//! The product with observer and illuminant, both linear between their table entries, is summed over nodes. Nodes are
//! every whole nm of 380..=780, and every wavelength of the grid and of the illuminant in that range. A node represents
//! the interval between the midpoints to its neighbours; the first and last extend half a nm outwards. On grids of
//! whole nm this is the standard summation at 1 nm; on finer grids it uses every sample.
//!
//! The sum is linear in the samples, so a grid has three weights per sample, which include k, illuminant, observer and
//! Δλ.

use super::coverage::{ColourError, RANGE, check};
use super::tables::{Curve, Illuminant, Observer};
use super::xyz::Xyz;
use crate::domain::WavelengthGrid;

/// Maximum luminous efficacy in lm/W, as rounded in CIE 015:2018 (the 683.002 of photometry is 3 ppm more).
const EFFICACY: f64 = 683.0;

/// Weights that convert a spectrum on one grid of wavelengths to tristimulus values XYZ.
#[derive(Clone, Debug, PartialEq)]
pub struct Tristimulus {
    weights: Vec<[f64; 3]>,
}

impl Tristimulus {
    /// Computes the XYZ weights of reflectance or radiance factors β (1 = perfect reflector) under `illuminant`. They
    /// give `X = k Σ β S x̄ Δλ` with `k = 100 / Σ S ȳ Δλ`, so that the perfect reflector has Y = 100.
    pub fn reflectance(grid: &WavelengthGrid, illuminant: Illuminant) -> Result<Self, ColourError> {
        Self::reflectance_by(grid, illuminant.power(), Observer::cie_1931())
    }

    /// Computes the XYZ weights of reflectance or radiance factors like [`Self::reflectance`], but under any light and
    /// for any observer. Fails if the light has no luminance.
    pub fn reflectance_by(grid: &WavelengthGrid, power: &Curve, observer: &Observer) -> Result<Self, ColourError> {
        let mut it = Self::new(grid, power.lambdas(), |lambda| power.at(lambda), observer)?;
        let k = 100.0 / it.white().y;
        if !(k.is_finite() && k > 0.0) {
            return Err(ColourError::Dark);
        }
        it.weights.iter_mut().flatten().for_each(|w| *w *= k);
        Ok(it)
    }

    /// Computes the XYZ weights of emitted spectra Φ: `X = 683 lm/W Σ Φ x̄ Δλ`. Y is in lm/sr (cd) if samples are in
    /// W/sr/nm.
    pub fn emission(grid: &WavelengthGrid) -> Result<Self, ColourError> {
        Self::emission_by(grid, Observer::cie_1931())
    }

    /// Computes the XYZ weights of emitted spectra like [`Self::emission`], but for any observer.
    pub fn emission_by(grid: &WavelengthGrid, observer: &Observer) -> Result<Self, ColourError> {
        Self::new(grid, &[], |_| EFFICACY, observer)
    }

    /// Returns the tristimulus values XYZ that a sample of 1 at each wavelength contributes.
    pub fn weights(&self) -> &[[f64; 3]] {
        &self.weights
    }

    /// Returns the tristimulus values XYZ of one spectrum; terms are added in the order of the wavelengths.
    ///
    /// # Panics
    /// If the number of samples is not that of wavelengths.
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

    /// Returns the tristimulus values XYZ of a spectrum whose samples are all 1: the perfect reflector, or the
    /// equal-energy emitter.
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

/// Returns the quadrature nodes of the colour integrals in nm: every whole nm of [`RANGE`] and every wavelength of the
/// grid and of `lines` within it, each once.
fn nodes(grid: &WavelengthGrid, lines: &[f64]) -> Vec<f64> {
    let (low, high) = RANGE;
    let mut nodes: Vec<f64> = (0..=(high - low) as usize).map(|i| low + i as f64).collect();
    let more = grid.values().into_iter().chain(lines.iter().copied());
    nodes.extend(more.filter(|lambda| *lambda > low && *lambda < high));
    nodes.sort_by(f64::total_cmp);
    nodes.dedup();
    nodes
}
