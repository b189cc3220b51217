//! The bases by their usual names, their tables, and where the numbers come from.

use crate::domain::named;
use serde::Serialize;

/// A basis on a line (wavelength, elevation, or any ordered entries). All are critically sampled at every length, reach
/// down to one smooth coefficient, and have the sign and scale of PyWavelets (low-pass gain √2 at zero frequency).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum LineBasis {
    /// Haar; at odd lengths unbalanced, so that it stays orthonormal and a constant has no detail.
    Haar,
    /// Cohen–Daubechies–Feauveau 5/3 (of Le Gall and Tabatabai), by lifting with whole-sample symmetric extension.
    Bior22,
    /// Cohen–Daubechies–Feauveau 9/7 (Antonini, Brislawn), by lifting with whole-sample symmetric extension.
    Bior44,
}
named!(LineBasis, "basis on a line", { Haar = "haar", Bior22 = "bior2.2", Bior44 = "bior4.4" });

/// In which inner product triangles are measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Weights {
    /// By their solid angle.
    Area,
    /// Every one the same.
    Count,
}

/// A basis on the triangles of the sphere, per parent and its four children.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SphereBasis {
    /// Bio-Haar (Schröder & Sweldens 1995, section 4, without lifting to neighbours): the parent is the children's
    /// mean by area, the details are children 1, 2, 3 minus the parent; child 0 is implied. Smooth coefficients are means.
    BioHaar,
    /// Symmetric orthonormal Haar: the Householder reflection that takes √(w / Σw) to the first unit vector.
    /// The transform is orthonormal in the inner product `Σ w·f·g` of its weights: with `Area` a leaf enters as
    /// √area·value, with `Count` as the value itself, so every coefficient's synthesis function has norm 1 there.
    Orthonormal(Weights),
}

/// What happens to one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AxisTransform {
    /// Nothing.
    Identity,
    /// A wavelet on a line.
    Line(LineBasis),
    /// A wavelet on the sphere's triangles.
    Sphere(SphereBasis),
}

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
    /// Taps of the analysis low-pass filter; on the sphere the children it reads.
    pub analysis_length: usize,
    /// Taps of the synthesis low-pass filter; on the sphere the children it writes.
    pub synthesis_length: usize,
    /// Vanishing moments of the analysis wavelet: polynomials of lower degree have no details in the interior.
    pub vanishing_moments: usize,
    /// Whether the filters are symmetric.
    pub symmetric: bool,
    /// Whether it is orthonormal (on the sphere: in the inner product of its weights).
    pub orthogonal: bool,
    /// Where it comes from.
    pub source: &'static str,
}

/// How a line basis is computed between the even (smooth) and odd (detail) samples of one level.
#[derive(Clone, Copy, Debug)]
pub(super) enum Scheme {
    /// Each pair is reflected: `(α·a + β·b, β·a − α·b)` with α² + β² = 1 from how many samples each stands for.
    Pairs,
    /// Lifting steps, then even × `low`, odd × −1/`low`.
    Lifting {
        /// In order: which samples change, and by which multiple of the sum of their two neighbours.
        steps: &'static [(Parity, f32)],
        /// The scale of the smooth samples.
        low: f32,
    },
}

/// The even or the odd samples of a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parity {
    Even,
    Odd,
}

pub(super) struct Table {
    pub(super) scheme: Scheme,
    info: BasisInfo,
}

static HAAR: Table = Table {
    scheme: Scheme::Pairs,
    info: BasisInfo {
        name: "haar",
        space: Space::Line,
        family: "Daubechies",
        analysis_length: 2,
        synthesis_length: 2,
        vanishing_moments: 1,
        symmetric: true,
        orthogonal: true,
        source: "Haar 1910; odd lengths: Girardi & Sweldens 1997, A new class of unbalanced Haar wavelets",
    },
};

static BIOR22: Table = Table {
    scheme: Scheme::Lifting { steps: &[(Parity::Odd, -0.5), (Parity::Even, 0.25)], low: std::f32::consts::SQRT_2 },
    info: BasisInfo {
        name: "bior2.2",
        space: Space::Line,
        family: "Cohen-Daubechies-Feauveau",
        analysis_length: 5,
        synthesis_length: 3,
        vanishing_moments: 2,
        symmetric: true,
        orthogonal: false,
        source: "Cohen, Daubechies & Feauveau 1992; lifting: Daubechies & Sweldens 1998, section 7.5 (N = Ñ = 2)",
    },
};

static BIOR44: Table = Table {
    scheme: Scheme::Lifting {
        steps: &[
            (Parity::Odd, -1.586_134_3),
            (Parity::Even, -0.052_980_12),
            (Parity::Odd, 0.882_911_1),
            (Parity::Even, 0.443_506_85),
        ],
        // Daubechies & Sweldens' ζ, with which a constant grows by √2 a level.
        low: 1.149_604_4,
    },
    info: BasisInfo {
        name: "bior4.4",
        space: Space::Line,
        family: "Cohen-Daubechies-Feauveau",
        analysis_length: 9,
        synthesis_length: 7,
        vanishing_moments: 4,
        symmetric: true,
        orthogonal: false,
        source: "Cohen, Daubechies & Feauveau 1992; Antonini et al. 1992; lifting: Daubechies & Sweldens 1998, section 7.7",
    },
};

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

impl LineBasis {
    pub(super) fn table(self) -> &'static Table {
        match self {
            Self::Haar => &HAAR,
            Self::Bior22 => &BIOR22,
            Self::Bior44 => &BIOR44,
        }
    }

    /// What is known of it.
    pub fn info(self) -> &'static BasisInfo {
        &self.table().info
    }
}

impl SphereBasis {
    /// Every basis on the sphere.
    pub const ALL: &'static [Self] =
        &[Self::BioHaar, Self::Orthonormal(Weights::Area), Self::Orthonormal(Weights::Count)];

    /// What is known of it.
    pub fn info(self) -> &'static BasisInfo {
        match self {
            Self::BioHaar => &BIO_HAAR,
            Self::Orthonormal(Weights::Area) => &ORTHONORMAL_AREA,
            Self::Orthonormal(Weights::Count) => &ORTHONORMAL_COUNT,
        }
    }
}

impl AxisTransform {
    /// The name of its basis; `identity` where there is none.
    pub fn name(self) -> &'static str {
        match self {
            Self::Identity => "identity",
            Self::Line(basis) => basis.info().name,
            Self::Sphere(basis) => basis.info().name,
        }
    }
}

/// Every basis there is, lines first.
pub fn bases() -> Vec<BasisInfo> {
    let lines = LineBasis::ALL.iter().map(|basis| basis.info().clone());
    lines.chain(SphereBasis::ALL.iter().map(|basis| basis.info().clone())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_agree_and_are_unique() {
        for &basis in LineBasis::ALL {
            assert_eq!(basis.info().name, basis.name());
        }
        let mut names: Vec<_> = bases().iter().map(|basis| basis.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), LineBasis::ALL.len() + SphereBasis::ALL.len());
    }

    #[test]
    fn bases_serialise_as_a_list() {
        let json = serde_json::to_value(bases()).unwrap();
        assert_eq!(json[2]["name"], "bior4.4");
        assert_eq!(json[2]["analysis_length"], 9);
        assert_eq!(json[3]["space"], "sphere");
    }
}
