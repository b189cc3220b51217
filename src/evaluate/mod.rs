//! A material in use: spectra, pdf and importance samples; no allocation per query.

use crate::compress::{DecodeError, Summary};
use crate::domain::{Direction, Measurement};

/// Where in a material to look.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place<'a> {
    /// One entry for each leading opaque axis.
    pub index: &'a [usize],
    /// The incoming direction, for quantities that have one.
    pub wi: Option<Direction>,
    /// The outgoing direction, for quantities that have one.
    pub wo: Option<Direction>,
}

/// How samples become a function of direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// The value of the triangle that holds the direction, as the paper has it.
    Constant,
    /// Continuous over directions: barycentric between vertex means.
    #[default]
    Smooth,
}

/// One importance sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionSample {
    /// The direction drawn: `wo`.
    pub direction: Direction,
    /// Its probability density, sr⁻¹.
    pub pdf: f64,
    /// f · |cos θo| / pdf for a BRDF or BTDF, f / pdf otherwise; f piecewise constant, the mean over wavelengths.
    pub weight: f64,
}

/// Why a material cannot answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EvaluateError {
    /// The bytes are no material.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// The query does not fit the material: a direction or index too few or too many, outside the domain.
    #[error("{0}")]
    Unfit(String),
}

/// An opened material; cheap to share between threads.
#[derive(Debug)]
pub struct Material {
    #[allow(dead_code)]
    measurement: Measurement,
    #[allow(dead_code)]
    summary: Option<Summary>,
}

impl Material {
    /// Opens a compressed material.
    pub fn open(bytes: &[u8]) -> Result<Self, EvaluateError> {
        let _ = bytes;
        unimplemented!()
    }
    /// Uses a measurement as it is.
    pub fn of(measurement: Measurement) -> Result<Self, EvaluateError> {
        let _ = measurement;
        unimplemented!()
    }
    /// The decoded samples and what they are.
    pub fn measurement(&self) -> &Measurement {
        unimplemented!()
    }
    /// Samples in one spectrum.
    pub fn lambdas(&self) -> usize {
        unimplemented!()
    }
    /// The wavelengths in nm, if the spectral axis has any.
    pub fn wavelengths(&self) -> Option<Vec<f64>> {
        unimplemented!()
    }
    /// Memory of the opened form in bytes.
    pub fn memory(&self) -> usize {
        unimplemented!()
    }
    /// The whole spectrum at `place` into `out` (`lambdas()` long); NaN = masked.
    pub fn spectrum(&self, place: Place<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        let _ = (place, how, out);
        unimplemented!()
    }
    /// Values at arbitrary wavelengths in nm, linear between samples, 0... (documented rule) outside.
    pub fn at_wavelengths(
        &self,
        place: Place<'_>,
        how: Interpolation,
        wavelengths: &[f64],
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        let _ = (place, how, wavelengths, out);
        unimplemented!()
    }
    /// The density with which [`Material::sample`] draws `wo`.
    pub fn pdf(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        level: Option<u8>,
    ) -> Result<f64, EvaluateError> {
        let _ = (index, wi, wo, level);
        unimplemented!()
    }
    /// Draws an outgoing direction from the unit square's `u`; `None` where nothing is emitted or reflected.
    pub fn sample(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        level: Option<u8>,
    ) -> Result<Option<DirectionSample>, EvaluateError> {
        let _ = (index, wi, u, level);
        unimplemented!()
    }
}
