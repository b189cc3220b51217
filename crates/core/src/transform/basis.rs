//! Transform of one axis, the bases on the sphere, and the list of all bases.

use super::basis_info::{BasisInfo, Space};
use super::boundary::Boundary;
use super::lines::LineBasis;

/// Weights of the triangles in the inner product of functions on the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Weights {
    /// In the inner product of functions on the sphere, each triangle is weighted by its solid angle.
    Area,
    /// In the inner product of functions on the sphere, all triangles have equal weights.
    Count,
}

/// Wavelet basis on a hierarchy of triangles on the sphere. It maps the values of the four children of a triangle to
/// one smooth value and three details.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SphereBasis {
    /// Bio-Haar basis (Schröder & Sweldens 1995, section 4, without lifting to neighbours). A parent is the
    /// area-weighted mean of its four children; the details are children 1, 2, 3 minus the parent, which determine
    /// child 0. Smooth coefficients are means.
    BioHaar,
    /// Symmetric orthonormal Haar basis: the Householder reflection that maps √(w / Σw) of the children's weights w to
    /// the first unit vector. It is orthonormal in the inner product `Σ w·f·g`, so that every synthesis function has
    /// norm 1. With `Area` a leaf enters as √area·value, with `Count` as the value itself.
    Orthonormal(Weights),
}

/// Wavelet transform applied along one axis of a tensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AxisTransform {
    /// No transform: samples are their own coefficients.
    Identity,
    /// Wavelet transform along an ordered axis.
    Line {
        /// Wavelet basis of the transform.
        basis: LineBasis,
        /// Boundary rule at both ends of the axis.
        boundary: Boundary,
    },
    /// Wavelet transform on the triangles of the sphere.
    Sphere(SphereBasis),
}

const fn sphere(name: &'static str, orthogonal: bool, source: &'static str) -> BasisInfo {
    BasisInfo {
        name,
        space: Space::Sphere,
        family: "Haar on triangles",
        analysis_length: 4,
        synthesis_length: 4,
        vanishing_moments: 1,
        symmetric: orthogonal,
        orthogonal,
        reconstruction_error: 0.0,
        boundary: None,
        source,
    }
}

static BIO_HAAR: BasisInfo = sphere("bio-haar", false, "Schröder & Sweldens 1995, Spherical wavelets, section 4");
static ORTHONORMAL_AREA: BasisInfo = sphere(
    "orthonormal-area",
    true,
    "Householder reflection by solid angle; after Lessig & Fiume 2008, SOHO: orthogonal and symmetric Haar wavelets",
);
static ORTHONORMAL_COUNT: BasisInfo = sphere(
    "orthonormal-count",
    true,
    "Householder reflection of (1/2, 1/2, 1/2, 1/2); after Lessig & Fiume 2008 with equal areas",
);

/// Spectral basis computed from the data instead of a filter table.
static KLT: BasisInfo = BasisInfo {
    name: "klt",
    space: Space::Line,
    family: "the data's own",
    analysis_length: 0,
    synthesis_length: 0,
    vanishing_moments: 0,
    symmetric: false,
    orthogonal: true,
    reconstruction_error: 0.0,
    boundary: None,
    source: "Karhunen–Loève: the mean and up to 24 principal components of the measurement's own spectra, stored with the \
             material; policy rd, wavelength axis",
};

impl SphereBasis {
    /// All wavelet bases on the triangles of the sphere.
    pub const ALL: &'static [Self] =
        &[Self::BioHaar, Self::Orthonormal(Weights::Area), Self::Orthonormal(Weights::Count)];

    /// Returns the description of the wavelet basis.
    pub fn info(self) -> &'static BasisInfo {
        match self {
            Self::BioHaar => &BIO_HAAR,
            Self::Orthonormal(Weights::Area) => &ORTHONORMAL_AREA,
            Self::Orthonormal(Weights::Count) => &ORTHONORMAL_COUNT,
        }
    }
}

impl AxisTransform {
    /// Returns the transform along an ordered axis in `basis`, with the default boundary rule of the basis.
    pub fn line(basis: LineBasis) -> Self {
        Self::Line { basis, boundary: basis.boundary() }
    }

    /// Returns the name of the wavelet basis, or `identity`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Identity => "identity",
            Self::Line { basis, .. } => basis.name(),
            Self::Sphere(basis) => basis.info().name,
        }
    }
}

/// Returns the descriptions of all bases: wavelets on ordered axes, the Karhunen-Loève basis of the data, and wavelets
/// on the sphere.
pub fn bases() -> Vec<BasisInfo> {
    let lines = LineBasis::all().map(|basis| basis.info().clone());
    lines.chain([KLT.clone()]).chain(SphereBasis::ALL.iter().map(|basis| basis.info().clone())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique() {
        let mut names: Vec<_> = bases().iter().map(|basis| basis.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), LineBasis::all().len() + 1 + SphereBasis::ALL.len());
    }

    #[test]
    fn bases_serialise_as_a_list() {
        let json = serde_json::to_value(bases()).unwrap();
        let named = |name: &str| json.as_array().unwrap().iter().find(|basis| basis["name"] == name).unwrap().clone();
        assert_eq!(named("bior4.4")["analysis_length"], 9);
        assert_eq!(named("bior4.4")["boundary"], "whole-sample");
        assert_eq!(named("bio-haar")["space"], "sphere");
        assert_eq!((&named("klt")["space"], &named("klt")["orthogonal"]), (&"line".into(), &true.into()));
        assert!(named("klt")["source"].as_str().unwrap().contains("principal components"));
    }
}
