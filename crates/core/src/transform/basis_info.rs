//! The description of a basis for people and tools: its name, family, filter lengths and properties.

use super::boundary::Boundary;
use serde::Serialize;

/// What a basis lives on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Space {
    /// An ordered axis.
    Line,
    /// The triangles of a mesh.
    Sphere,
}

/// A basis for people and tools: `wavelume bases`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BasisInfo {
    /// Its usual name.
    pub name: &'static str,
    /// What it lives on.
    pub space: Space,
    /// Its family.
    pub family: &'static str,
    /// Taps of the analysis low-pass filter; on the sphere the children it reads; 0 for the data's own basis.
    pub analysis_length: usize,
    /// Taps of the synthesis low-pass filter; on the sphere the children it writes.
    pub synthesis_length: usize,
    /// Vanishing moments of the analysis wavelet: polynomials of lower degree have no details in the interior.
    pub vanishing_moments: usize,
    /// Whether the filters are symmetric.
    pub symmetric: bool,
    /// Whether it is orthonormal (on the sphere: in the inner product of its weights).
    pub orthogonal: bool,
    /// How far its filters are from perfect reconstruction (the largest deviation of an inner product of filters from 0
    /// or 1). Above 1e-9 the inverse is computed, so that transforms are inverted exactly all the same.
    pub reconstruction_error: f64,
    /// Its own rule at the ends; none on the sphere.
    pub boundary: Option<Boundary>,
    /// Where it comes from.
    pub source: &'static str,
}
