//! Description of a basis for people and tools: name, family, filter lengths and properties.

use super::boundary::Boundary;
use serde::Serialize;

/// Kind of axis on which a wavelet basis is defined: an ordered axis, or triangles on the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Space {
    /// An ordered axis, such as wavelength.
    Line,
    /// The triangles of a mesh on the sphere.
    Sphere,
}

/// Description of a wavelet basis, as listed by `wavelume bases`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct BasisInfo {
    /// Usual name of the wavelet basis.
    pub name: &'static str,
    /// Kind of axis on which the wavelet basis is defined.
    pub space: Space,
    /// Family of wavelets to which the basis belongs.
    pub family: &'static str,
    /// Number of taps of the analysis low-pass filter. For a basis on the sphere it is the number of children of a
    /// triangle, for the Karhunen-Loève basis `klt` it is 0.
    pub analysis_length: usize,
    /// Number of taps of the synthesis low-pass filter. For a basis on the sphere it is the number of children of a
    /// triangle, for the Karhunen-Loève basis `klt` it is 0.
    pub synthesis_length: usize,
    /// Number of vanishing moments of the analysis wavelet: details of polynomials of lower degree are 0 away from the
    /// ends.
    pub vanishing_moments: usize,
    /// True if the filters of the basis are symmetric.
    pub symmetric: bool,
    /// True if the basis is orthonormal (on the sphere: in the inner product with its own triangle weights).
    pub orthogonal: bool,
    /// Deviation of the filters from perfect reconstruction: the largest difference between an inner product of filters
    /// and its ideal value, 0 or 1. Above 1e-9 the inverse is computed numerically, so that transforms are still
    /// inverted exactly.
    pub reconstruction_error: f64,
    /// Default boundary rule of the basis; `None` for bases on the sphere and for the Karhunen-Loève basis `klt`.
    pub boundary: Option<Boundary>,
    /// Publication from which the wavelet basis is taken.
    pub source: &'static str,
}
