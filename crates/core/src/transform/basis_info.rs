//! Description of a basis for people and tools: name, family, filter lengths and properties.

use super::boundary::Boundary;
use serde::Serialize;

/// Kind of axis on which a basis is defined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Space {
    /// An ordered axis.
    Line,
    /// The triangles of a mesh.
    Sphere,
}

/// Description of a basis, as listed by `wavelume bases`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct BasisInfo {
    /// Usual name of the basis.
    pub name: &'static str,
    /// Kind of axis on which the basis is defined.
    pub space: Space,
    /// Family of bases to which it belongs.
    pub family: &'static str,
    /// Number of taps of the analysis low-pass filter; on the sphere, the number of children; 0 for `klt`.
    pub analysis_length: usize,
    /// Number of taps of the synthesis low-pass filter; on the sphere, the number of children; 0 for `klt`.
    pub synthesis_length: usize,
    /// Number of vanishing moments of the analysis wavelet: polynomials of lower degree have no details in the
    /// interior.
    pub vanishing_moments: usize,
    /// True if the filters are symmetric.
    pub symmetric: bool,
    /// True if the basis is orthonormal (on the sphere: in the inner product of its weights).
    pub orthogonal: bool,
    /// Deviation of the filters from perfect reconstruction: the largest difference between an inner product of filters
    /// and 0 or 1. Above 1e-9 the inverse is computed numerically, so that transforms are still inverted exactly.
    pub reconstruction_error: f64,
    /// Default boundary rule; `None` on the sphere and for `klt`.
    pub boundary: Option<Boundary>,
    /// Publication from which the basis is taken.
    pub source: &'static str,
}
