//! Typed views of a flat tensor: the curried functions `S² → (S² → (ℝ → ℝ))` of the paper as slices, without copies
//! (\[CPB06\] section 4).

use super::tensor::Measurement;

/// Function of wavelength: contiguous samples of one spectrum, in the order of the spectral axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spectrum<'a> {
    samples: &'a [f32],
}

/// Function of one direction and wavelength, with samples in the order `[direction, lambda]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflectance<'a> {
    samples: &'a [f32],
    lambdas: usize,
}

/// Function of two directions and wavelength, with samples in the order `[incoming, outgoing, lambda]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brdf<'a> {
    samples: &'a [f32],
    outgoing: usize,
    lambdas: usize,
}

impl<'a> Spectrum<'a> {
    /// Returns the samples of the spectrum; NaN marks masked samples.
    pub fn samples(self) -> &'a [f32] {
        self.samples
    }
}

impl<'a> Reflectance<'a> {
    /// Returns the spectrum at direction number `index`.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn at(self, index: usize) -> Spectrum<'a> {
        Spectrum { samples: &self.samples[index * self.lambdas..][..self.lambdas] }
    }
}

impl<'a> Brdf<'a> {
    /// Returns the function of outgoing direction and wavelength at incoming direction number `index`.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn at(self, index: usize) -> Reflectance<'a> {
        let row = self.outgoing * self.lambdas;
        Reflectance { samples: &self.samples[index * row..][..row], lambdas: self.lambdas }
    }
}

impl Measurement {
    /// Returns the samples as one spectrum; `None` if the tensor has more than one axis.
    pub fn as_spectrum(&self) -> Option<Spectrum<'_>> {
        match self.tensor.shape().as_slice() {
            [_] => Some(Spectrum { samples: self.tensor.samples() }),
            _ => None,
        }
    }

    /// Returns the samples as a function of one direction and wavelength; `None` if the tensor has other axes. Spectra
    /// of monochromatic data have one sample.
    pub fn as_reflectance(&self) -> Option<Reflectance<'_>> {
        let layout = self.layout().ok()?;
        let directions = usize::from(layout.incoming.is_some()) + usize::from(layout.outgoing.is_some());
        (layout.indices == 0 && directions == 1)
            .then(|| Reflectance { samples: self.tensor.samples(), lambdas: self.lambdas() })
    }

    /// Returns the samples as a function of incoming and outgoing direction and wavelength; `None` if the tensor has
    /// other axes. Spectra of monochromatic data have one sample.
    pub fn as_brdf(&self) -> Option<Brdf<'_>> {
        let layout = self.layout().ok()?;
        let (_, outgoing) = (layout.incoming?, layout.outgoing?);
        (layout.indices == 0).then(|| Brdf {
            samples: self.tensor.samples(),
            outgoing: self.tensor.axes()[outgoing].len(),
            lambdas: self.lambdas(),
        })
    }

    /// Returns the number of samples per direction: the length of the spectral axis, or 1 if there is none.
    pub fn lambdas(&self) -> usize {
        self.tensor.axes().last().filter(|axis| axis.is_spectral()).map_or(1, super::axis::Axis::len)
    }
}

#[cfg(test)]
mod tests {
    use crate::domain::{Axis, Domain, Measurement, Quantity, Sampling, Tensor, TriangleMesh, Unit};

    #[test]
    fn currying_a_brdf_reaches_the_right_samples() {
        let hemisphere = |level| Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, level).unwrap());
        let samples = (0..4 * 16 * 3).map(|i| i as f32).collect();
        let tensor = Tensor::new(vec![hemisphere(0), hemisphere(1), Axis::Rgb], samples).unwrap();
        let m = Measurement::new(Quantity::Brdf, Unit::PerSteradian, Sampling::Average, tensor).unwrap();
        let brdf = m.as_brdf().unwrap();
        assert_eq!(brdf.at(2).at(5).samples(), &[111.0, 112.0, 113.0]);
        assert!(m.as_spectrum().is_none() && m.as_reflectance().is_none());
    }
}
