//! JSON document of a virtual measurement; unknown fields are refused.

use super::spectra::Shape;
use crate::domain::{Quantity, Sampling, Unit};
use serde::Deserialize;
use serde_json::Value;

/// JSON document of a virtual measurement, computed from a model: `{"wavelume": "virtual", "quantity": …, "model": {…},
/// "axes": […], "sampling": …, "noise": {…}}`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Document {
    /// Field `wavelume` that marks the JSON document of a virtual measurement (computed from a model); always
    /// `virtual`.
    pub(super) wavelume: String,
    pub(super) quantity: Option<Quantity>,
    pub(super) unit: Option<Unit>,
    pub(super) model: Model,
    /// Axes of the virtual measurement, in the syntax of an array's manifest.
    pub(super) axes: Vec<Value>,
    pub(super) sampling: Option<Sampling>,
    pub(super) noise: Option<Noise>,
    /// Wavelength in nm at which a model without a wavelength axis is evaluated.
    pub(super) wavelength: Option<f64>,
    pub(super) name: Option<String>,
    pub(super) description: Option<String>,
}

/// Simulated measurement noise from a seed: `sample · (1 + relative·g₁) + absolute·g₂`, with independent g normal of
/// mean 0 and variance 1.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Noise {
    #[serde(default)]
    pub(super) relative: f64,
    #[serde(default)]
    pub(super) absolute: f64,
    pub(super) seed: u64,
}

/// Model of a virtual measurement: one lobe, or a weighted sum of lobes: `{"ggx": {…}}`, `"rayleigh"`, `{"sum":
/// [{"weight": …, "lobe": {…}}]}`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Model {
    /// Lambertian reflection with the BRDF reflectance / π.
    Lambert { reflectance: Shape },
    /// Lambertian transmission to the other side of the surface, with the BTDF transmittance / π.
    LambertTransmission { transmittance: Shape },
    /// Rough diffuse reflection (Oren & Nayar 1994, the qualitative model); `sigma` is the standard deviation of facet
    /// slopes in radians.
    OrenNayar { reflectance: Shape, sigma: f64 },
    /// Reflection by GGX microfacets (Walter et al. 2007; anisotropic: Burley 2012) with height-correlated masking
    /// (Heitz 2014).
    Ggx {
        /// GGX roughness: one number, or two along the x and y axes of the lobe's frame.
        alpha: Alpha,
        fresnel: Fresnel,
        #[serde(default)]
        frame: Frame,
    },
    /// Single scattering in a layer of fibres of optical depth `depth` that stand on the surface: velvet. Its phase
    /// function is `back·HG(g_back, cos) + (1 − back)·HG(g_forward, −cos)`, cos being the cosine of the angle between
    /// `wi` and `wo`.
    Asperity { albedo: Shape, depth: f64, back: f64, g_back: f64, g_forward: f64 },
    /// Rayleigh phase function 3/(16π)·(1 + cos²) of the scattering angle.
    Rayleigh,
    /// Phase function of Henyey & Greenstein (1941) with asymmetry `g`, HG(g).
    HenyeyGreenstein { g: f64 },
    /// Phase function with two lobes of Henyey & Greenstein: `weight·HG(g1) + (1 − weight)·HG(g2)`.
    DoubleHenyeyGreenstein { weight: f64, g1: f64, g2: f64 },
    /// Phase function `r·S(k1) + (1 − r)·S(k2)` with `S(k) = (1 − k²)/(4π(1 − k·cos)²)` (Blasi, Le Saëc & Schlick
    /// 1993).
    Schlick { r: f64, k1: f64, k2: f64 },
    /// Phase function of hazy Mie scattering: Schlick's with r 0.12, k −0.50 and 0.70 (recalled, not copied from the
    /// publication).
    Hazy,
    /// Phase function of murky Mie scattering: Schlick's with r 0.19, k −0.65 and 0.91 (recalled, not copied from the
    /// publication).
    Murky,
    /// Emission `max(0, cos)^exponent` of the angle from the direction `(theta, phi)` in degrees, theta from `+z`.
    CosinePower {
        theta: f64,
        #[serde(default)]
        phi: f64,
        exponent: f64,
    },
    /// Emission of constant 1 in every direction.
    Isotropic,
    /// Fresnel reflectance of an interface at the angle of incidence.
    Fresnel(Fresnel),
    /// Spectrum that depends on the wavelength alone, without directions.
    Spectrum(Shape),
    /// Weighted sum of several lobes.
    Sum(Vec<Term>),
}

/// One term of an analytic model that is a weighted sum of lobes: a lobe with its constant weight and its spectral
/// weight.
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

/// Roughness of a GGX lobe.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Alpha {
    Isotropic(f64),
    /// Different roughness along the x axis and along the y axis of the lobe's frame.
    Anisotropic(f64, f64),
}

/// Orientation of a lobe relative to the surface, in degrees. The lobe's normal is tilted by `tilt` towards azimuth
/// `toward`; its x axis is rotated by `turn` about the normal.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Frame {
    pub(super) turn: f64,
    pub(super) tilt: f64,
    pub(super) toward: f64,
}

/// Model for the Fresnel reflectance of an interface.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Fresnel {
    /// Refractive index by Cauchy's formula `n = A + B/λ² + C/λ⁴`, λ in µm.
    Cauchy {
        a: f64,
        #[serde(default)]
        b: f64,
        #[serde(default)]
        c: f64,
    },
    /// Refractive index by Sellmeier's formula `n² = 1 + Σ Bᵢλ²/(λ² − Cᵢ)`, λ in µm, C in µm².
    Sellmeier { b: Vec<f64>, c: Vec<f64> },
    /// Complex refractive index n + ik of a metal, by wavelength.
    Conductor { n: Shape, k: Shape },
    /// Schlick's approximation of Fresnel reflectance from the reflectance at normal incidence.
    Schlick { normal: Shape },
    /// Perfect mirror: all light is reflected.
    Mirror,
}
