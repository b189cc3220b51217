//! JSON document of a virtual measurement; unknown fields are refused.

use super::spectra::Shape;
use crate::domain::{Quantity, Sampling, Unit};
use serde::Deserialize;
use serde_json::Value;

/// `{"wavelume": "virtual", "quantity": …, "model": {…}, "axes": […], "sampling": …, "noise": {…}}`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Document {
    /// Always `virtual`.
    pub(super) wavelume: String,
    pub(super) quantity: Option<Quantity>,
    pub(super) unit: Option<Unit>,
    pub(super) model: Model,
    /// Axes in the syntax of an array's manifest.
    pub(super) axes: Vec<Value>,
    pub(super) sampling: Option<Sampling>,
    pub(super) noise: Option<Noise>,
    /// The wavelength in nm of data without a wavelength axis.
    pub(super) wavelength: Option<f64>,
    pub(super) name: Option<String>,
    pub(super) description: Option<String>,
}

/// Seeded measurement noise: `sample · (1 + relative·g₁) + absolute·g₂`, g normal with mean 0 and variance 1.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Noise {
    #[serde(default)]
    pub(super) relative: f64,
    #[serde(default)]
    pub(super) absolute: f64,
    pub(super) seed: u64,
}

/// One lobe, or a weighted sum of lobes: `{"ggx": {…}}`, `"rayleigh"`, `{"sum": [{"weight": …, "lobe": {…}}]}`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Model {
    /// Diffuse reflection: reflectance / π.
    Lambert { reflectance: Shape },
    /// Diffuse transmission to the other side: transmittance / π.
    LambertTransmission { transmittance: Shape },
    /// Oren & Nayar 1994, the qualitative model; `sigma` is the standard deviation of facet slopes in radians.
    OrenNayar { reflectance: Shape, sigma: f64 },
    /// Microfacets (Walter et al. 2007; anisotropic: Burley 2012) with height-correlated masking (Heitz 2014).
    Ggx {
        /// One roughness, or two along the x and y axes of the frame.
        alpha: Alpha,
        fresnel: Fresnel,
        #[serde(default)]
        frame: Frame,
    },
    /// Single scattering in a layer of fibres of optical depth `depth` that stand on the surface: velvet. Its phase
    /// function is `forward·HG(g_forward) + (1 − forward)·HG(g_back)` of the angle between `wi` and `−wo`.
    Asperity { albedo: Shape, depth: f64, back: f64, g_back: f64, g_forward: f64 },
    /// 3/(16π)·(1 + cos²).
    Rayleigh,
    /// Henyey & Greenstein 1941.
    HenyeyGreenstein { g: f64 },
    /// `weight·HG(g1) + (1 − weight)·HG(g2)`.
    DoubleHenyeyGreenstein { weight: f64, g1: f64, g2: f64 },
    /// `r·S(k1) + (1 − r)·S(k2)` with `S(k) = (1 − k²)/(4π(1 − k·cos)²)` (Blasi, Le Saëc & Schlick 1993).
    Schlick { r: f64, k1: f64, k2: f64 },
    /// Hazy Mie scattering: Schlick with r 0.12, k −0.50 and 0.70 (recalled, not copied from the publication).
    Hazy,
    /// Murky Mie scattering: Schlick with r 0.19, k −0.65 and 0.91 (recalled, not copied from the publication).
    Murky,
    /// `max(0, cos)^exponent` of the angle from the direction `(theta, phi)` in degrees, theta from `+z`.
    CosinePower {
        theta: f64,
        #[serde(default)]
        phi: f64,
        exponent: f64,
    },
    /// Constant 1 in every direction.
    Isotropic,
    /// Fresnel reflectance at the angle of incidence.
    Fresnel(Fresnel),
    /// A function of wavelength alone.
    Spectrum(Shape),
    /// Weighted sum of lobes.
    Sum(Vec<Term>),
}

/// Lobe of a sum with its weight.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Term {
    #[serde(default = "one")]
    pub(super) scale: f64,
    pub(super) weight: Option<Shape>,
    pub(super) lobe: Model,
}

fn one() -> f64 {
    1.0
}

/// Roughness.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Alpha {
    Isotropic(f64),
    /// Roughness along x and along y.
    Anisotropic(f64, f64),
}

/// Orientation of a lobe relative to the surface. The normal is tilted by `tilt` towards azimuth `toward`; the x axis
/// is rotated by `turn` about the normal. Degrees.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Frame {
    pub(super) turn: f64,
    pub(super) tilt: f64,
    pub(super) toward: f64,
}

/// Model of the Fresnel reflectance of an interface.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Fresnel {
    /// `n = A + B/λ² + C/λ⁴`, λ in µm.
    Cauchy {
        a: f64,
        #[serde(default)]
        b: f64,
        #[serde(default)]
        c: f64,
    },
    /// `n² = 1 + Σ Bᵢλ²/(λ² − Cᵢ)`, λ in µm, C in µm².
    Sellmeier { b: Vec<f64>, c: Vec<f64> },
    /// Complex index n + ik.
    Conductor { n: Shape, k: Shape },
    /// Schlick's approximation from the reflectance at normal incidence.
    Schlick { normal: Shape },
    /// All light is reflected.
    Mirror,
}
