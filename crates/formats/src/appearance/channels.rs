//! Conversion of a material's spectra to linear sRGB for pictures, with weights per wavelength computed once.
//!
//! Some wavelength grids are too coarse or too short for a standard colour but cover most of the visible range. Such
//! spectra are interpolated linearly. Elsewhere (ultraviolet lamps, a single wavelength) the result is grey.

use super::emission::emits;
use super::viewing::Viewing;
use crate::domain::colour::{self, ColourError, Tristimulus, Xyz, xyz_to_linear};
use crate::domain::{Axis, WavelengthGrid};
use crate::evaluate::{JOULES_PER_MICROMOLE, Material};

/// Weights for each wavelength that convert a spectrum to linear sRGB: Σ weight · sample. The perfect diffuser gives 1
/// in each channel.
#[derive(Clone, Debug)]
pub(crate) struct Channels {
    weights: Vec<[f32; 3]>,
    hue: Hue,
}

/// Accuracy of colours that are computed from the wavelengths of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hue {
    /// The wavelengths suffice for standard colours, or the samples are colours.
    Exact,
    /// The wavelengths are too few or too far apart for standard colours, but show the hue.
    Estimated,
    /// The wavelengths show no hue; values are shown in grey.
    Grey,
}

/// First and last wavelength in nm that a spectrum must cover, so that its colour can be approximated.
const MOST_OF_THE_VISIBLE: (f64, f64) = (480.0, 620.0);
/// Lower bound on the number of wavelengths between 400 and 700 nm from which a colour is approximated. Raising it
/// turns more sparse spectra grey.
const FEWEST: usize = 3;
/// Number of partial sums of weighted samples that are accumulated independently, so that the compiler can vectorise.
const LANES: usize = 8;

impl Channels {
    pub(crate) fn of(material: &Material, viewing: &Viewing) -> Result<Self, ColourError> {
        let grid = match material.axes().last() {
            Some(Axis::Wavelength(grid)) => grid,
            Some(Axis::Rgb) => {
                let weights = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                return Ok(Self { weights, hue: Hue::Exact });
            }
            _ => return Ok(Self { weights: vec![[1.0; 3]], hue: Hue::Grey }),
        };
        let light = emits(material.quantity());
        let Some((weights, white, hue)) = weights(grid, light, viewing)? else { return Ok(Self::grey(grid)) };
        let adaptation = Viewing::adaptation(white)?;
        let photons = material.unit().counts_photons();
        let weights = weights.into_iter().zip(grid.values()).map(|(xyz, lambda)| {
            let energy = if photons { JOULES_PER_MICROMOLE / lambda } else { 1.0 };
            xyz_to_linear(adaptation.apply(xyz)).map(|w| (energy * w) as f32)
        });
        Ok(Self { weights: weights.collect(), hue })
    }

    /// Returns true if the linear sRGB of a spectrum shows its hue, at least as an estimate.
    pub(crate) fn coloured(&self) -> bool {
        self.hue != Hue::Grey
    }

    /// Returns the remark for the user that spectra over these wavelengths have no exact colour; `None` if they have.
    pub(crate) fn remark(&self, grid: &WavelengthGrid) -> Option<String> {
        let given = || format!("the {} wavelengths from {}", grid.len(), grid.in_words());
        let (needed, gap) = (colour::NEEDED, colour::MOST_GAP);
        match self.hue {
            Hue::Exact => None,
            Hue::Estimated => Some(format!(
                "colours are estimated from {}; exact ones need {} to {} nm in steps of at most {gap} nm",
                given(),
                needed.0,
                needed.1
            )),
            Hue::Grey => Some(format!(
                "grey instead of colours, which {} do not show: expected at least {FEWEST} between {} and {} nm, from at \
                 most {} to at least {} nm",
                given(),
                needed.0,
                needed.1,
                MOST_OF_THE_VISIBLE.0,
                MOST_OF_THE_VISIBLE.1
            )),
        }
    }

    /// Returns the linear sRGB of a spectrum, unclipped: components outside 0..=1 are out of gamut. Masked samples are
    /// skipped and the remaining weights renormalised. A channel with no more than half of its weight measured is NaN.
    pub(crate) fn linear(&self, spectrum: &[f32]) -> [f32; 3] {
        // Independent partial sums, so that no addition waits for another.
        let mut sums = [[0.0_f32; 3]; LANES];
        let mut weights = self.weights.chunks_exact(LANES);
        let mut samples = spectrum.chunks_exact(LANES);
        for (weights, samples) in weights.by_ref().zip(samples.by_ref()) {
            for lane in 0..LANES {
                for k in 0..3 {
                    sums[lane][k] += weights[lane][k] * samples[lane];
                }
            }
        }
        for ((sum, weights), &sample) in sums.iter_mut().zip(weights.remainder()).zip(samples.remainder()) {
            for (sum, weight) in sum.iter_mut().zip(weights) {
                *sum += weight * sample;
            }
        }
        let sum = [0, 1, 2].map(|k| sums.iter().map(|sum| sum[k]).sum::<f32>());
        if sum.iter().all(|c| !c.is_nan()) { sum } else { self.masked(spectrum) }
    }

    #[cold]
    fn masked(&self, spectrum: &[f32]) -> [f32; 3] {
        let (mut sum, mut measured, mut all) = ([0.0_f32; 3], [0.0_f32; 3], [0.0_f32; 3]);
        for (weights, &sample) in self.weights.iter().zip(spectrum) {
            for k in 0..3 {
                all[k] += weights[k];
                if !sample.is_nan() {
                    sum[k] += weights[k] * sample;
                    measured[k] += weights[k];
                }
            }
        }
        // A channel with half or more of its weight masked is undefined.
        [0, 1, 2].map(|k| if measured[k] > 0.5 * all[k] { sum[k] * all[k] / measured[k] } else { f32::NAN })
    }

    fn grey(grid: &WavelengthGrid) -> Self {
        let weights = grid.weights();
        let total: f64 = weights.iter().sum();
        let weights = if total > 0.0 { weights } else { vec![1.0; grid.len()] };
        let total = if total > 0.0 { total } else { grid.len() as f64 };
        Self { weights: weights.into_iter().map(|w| [(w / total) as f32; 3]).collect(), hue: Hue::Grey }
    }
}

/// Returns the XYZ weights of the sample at each wavelength, the white point and the accuracy of the colours. `None` if
/// the wavelengths are too few for a colour.
fn weights(grid: &WavelengthGrid, light: bool, viewing: &Viewing) -> Result<Option<(Vec<Xyz>, Xyz, Hue)>, ColourError> {
    let of = |grid: &WavelengthGrid| if light { viewing.emission(grid) } else { viewing.reflectance(grid) };
    let as_xyz = |weights: &[[f64; 3]]| weights.iter().map(|&[x, y, z]| Xyz { x, y, z }).collect::<Vec<_>>();
    if let Ok(strict) = of(grid) {
        let white = if light { viewing.white()? } else { strict.white() };
        return Ok(Some((as_xyz(strict.weights()), white, Hue::Exact)));
    }
    let visible = grid.values().into_iter().filter(|l| (400.0..=700.0).contains(l)).count();
    let (first, last) = grid.range();
    let (low, high) = MOST_OF_THE_VISIBLE;
    if visible < FEWEST || first > low || last < high {
        return Ok(None);
    }
    // Integrates on a fine grid and distributes its weights to the coarse samples by linear interpolation.
    let Ok(fine) = WavelengthGrid::even(380.0, 5.0, 81) else { return Ok(None) };
    let strict: Tristimulus = of(&fine)?;
    let mut pulled = vec![[0.0; 3]; grid.len()];
    for (weights, lambda) in strict.weights().iter().zip(fine.values()) {
        let Some((below, t)) = grid.locate(lambda.clamp(first, last)) else { continue };
        for k in 0..3 {
            pulled[below][k] += (1.0 - t) * weights[k];
            if t > 0.0 {
                pulled[below + 1][k] += t * weights[k];
            }
        }
    }
    let white = if light { viewing.white()? } else { strict.white() };
    Ok(Some((as_xyz(&pulled), white, Hue::Estimated)))
}
