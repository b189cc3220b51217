//! An analytic surface: GGX with height-correlated Smith shadowing and Schlick's Fresnel term (F0 = 0.04) over a
//! coloured diffuse base.

use std::f64::consts::PI;

pub(crate) type Vector = [f64; 3];

pub(crate) struct Gloss {
    pub(crate) alpha: f64,
    /// Albedo of the base at long wavelengths.
    pub(crate) diffuse: f64,
}

impl Gloss {
    /// Returns f in sr⁻¹ at a wavelength in nm.
    #[allow(dead_code, reason = "some programs take the mean over wavelengths")]
    pub(crate) fn value(&self, wi: Vector, wo: Vector, lambda: f64) -> f64 {
        self.base(lambda) + self.lobe(wi, wo)
    }

    /// Returns the diffuse part, which is constant over directions.
    pub(crate) fn base(&self, lambda: f64) -> f64 {
        self.diffuse * (0.6 + 0.4 / (1.0 + (-(lambda - 520.0) / 30.0).exp())) / PI
    }

    /// Returns the specular lobe.
    pub(crate) fn lobe(&self, wi: Vector, wo: Vector) -> f64 {
        let h = [0, 1, 2].map(|k| wi[k] + wo[k]);
        let length = dot(h, h).sqrt();
        let (above, cosine) = (h[2] / length, dot(wi, h) / length);
        let square = self.alpha * self.alpha;
        let facets = square / (PI * (above * above * (square - 1.0) + 1.0).powi(2));
        let hidden = |c: f64| 0.5 * ((1.0 + square * (1.0 / (c * c) - 1.0)).sqrt() - 1.0);
        let (zi, zo) = (wi[2].max(1e-9), wo[2].max(1e-9));
        let shadowing = 1.0 / (1.0 + hidden(zi) + hidden(zo));
        facets * shadowing * (0.04 + 0.96 * (1.0 - cosine).powi(5)) / (4.0 * zi * zo)
    }
}

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
