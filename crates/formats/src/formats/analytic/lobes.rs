//! Evaluation of lobes: a function of two directions times a function of wavelength, or of both for Fresnel terms.

use crate::domain::Direction;
use crate::domain::vector::{Vector, add, cross, dot, norm, scale, sub, unit};
use std::f64::consts::PI;

/// Lobe prepared for evaluation: value(wi, wo, λ) = shape(wi, wo) · weight(λ) · fresnel(cos, λ).
pub(super) struct Lobe {
    pub(super) shape: Shape,
    /// Factor at each wavelength by which the lobe's function of the two directions is multiplied.
    pub(super) weight: Vec<f64>,
    pub(super) interface: Option<Interface>,
}

/// Part of a lobe that depends on the directions only.
pub(super) enum Shape {
    Lambert,
    LambertTransmission,
    OrenNayar {
        a: f64,
        b: f64,
    },
    Ggx {
        along: f64,
        across: f64,
        frame: Axes,
    },
    Asperity {
        depth: f64,
        back: f64,
        g_back: f64,
        g_forward: f64,
    },
    Rayleigh,
    HenyeyGreenstein {
        weight: f64,
        g1: f64,
        g2: f64,
    },
    Schlick {
        r: f64,
        k1: f64,
        k2: f64,
    },
    CosinePower {
        axis: Vector,
        exponent: f64,
    },
    /// Factor 1 for every pair of directions. It stands for isotropic emission, for spectra without directions, and for
    /// reflectances whose dependence on direction is in the Fresnel factor alone.
    Constant,
}

/// Optical constants of an interface at each wavelength: refractive index, complex index or normal reflectance.
pub(super) enum Interface {
    Dielectric(Vec<f64>),
    Conductor(Vec<(f64, f64)>),
    Schlick(Vec<f64>),
}

/// Orthonormal x, y and z axes of a lobe in the surface frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axes([Vector; 3]);

impl Axes {
    /// Creates the axes of a lobe whose normal is tilted by `tilt` towards azimuth `toward`, with the x axis rotated by
    /// `turn` about the normal; degrees.
    pub(super) fn new(turn: f64, tilt: f64, toward: f64) -> Self {
        let z = Direction::from_degrees(tilt, toward).xyz();
        let along = Direction::from_degrees(90.0, turn).xyz();
        let x = unit(sub(along, scale(z, dot(along, z))));
        Self([x, cross(z, x), z])
    }

    fn of(&self, v: Vector) -> Vector {
        [dot(v, self.0[0]), dot(v, self.0[1]), dot(v, self.0[2])]
    }
}

/// Lower bound on the cosines by which lobes divide. It keeps quotients defined at grazing angles, where they have a
/// finite limit but are 0/0.
const HORIZON: f64 = 1e-6;

impl Shape {
    /// Returns the part of a lobe that depends on `wi` and `wo`, and the cosine of incidence for Fresnel's equations.
    pub(super) fn at(&self, wi: Vector, wo: Vector) -> (f64, f64) {
        let same_side = wi[2] * wo[2] >= 0.0;
        match *self {
            Self::Lambert => (if same_side { 1.0 / PI } else { 0.0 }, 1.0),
            Self::LambertTransmission => (if same_side { 0.0 } else { 1.0 / PI }, 1.0),
            Self::OrenNayar { a, b } => (if same_side { oren_nayar(wi, wo, a, b) } else { 0.0 }, 1.0),
            Self::Ggx { along, across, ref frame } if same_side => ggx(wi, wo, (along, across), frame),
            Self::Asperity { depth, back, g_back, g_forward } if same_side => {
                let (ci, co) = (wi[2].abs().max(HORIZON), wo[2].abs().max(HORIZON));
                let cosine = dot(wi, wo);
                let phase =
                    back * henyey_greenstein(g_back, cosine) + (1.0 - back) * henyey_greenstein(g_forward, -cosine);
                (-libm::expm1(-depth * (1.0 / ci + 1.0 / co)) / (ci + co) * phase, 1.0)
            }
            Self::Ggx { .. } | Self::Asperity { .. } => (0.0, 1.0),
            Self::Rayleigh => {
                let cosine = dot(wi, wo);
                (3.0 / (16.0 * PI) * (1.0 + cosine * cosine), 1.0)
            }
            // wi points back to the source: unscattered light leaves at wo = −wi.
            Self::HenyeyGreenstein { weight, g1, g2 } => {
                let cosine = -dot(wi, wo);
                let second = if weight == 1.0 { 0.0 } else { (1.0 - weight) * henyey_greenstein(g2, cosine) };
                (weight * henyey_greenstein(g1, cosine) + second, 1.0)
            }
            Self::Schlick { r, k1, k2 } => {
                let cosine = -dot(wi, wo);
                (r * schlick(k1, cosine) + (1.0 - r) * schlick(k2, cosine), 1.0)
            }
            Self::CosinePower { axis, exponent } => {
                let cosine = dot(axis, wo);
                (if cosine > 0.0 { libm::pow(cosine, exponent) } else { 0.0 }, 1.0)
            }
            Self::Constant => (1.0, wi[2].abs()),
        }
    }
}

impl Interface {
    /// Returns the Fresnel reflectance of unpolarised light; `lambda` is the index of the wavelength, `cosine` that of
    /// incidence.
    pub(super) fn reflectance(&self, lambda: usize, cosine: f64) -> f64 {
        match self {
            Self::Dielectric(n) => dielectric(n[lambda], cosine),
            Self::Conductor(nk) => conductor(nk[lambda], cosine),
            Self::Schlick(normal) => {
                let t = 1.0 - cosine;
                let t2 = t * t;
                normal[lambda] + (1.0 - normal[lambda]) * t2 * t2 * t
            }
        }
    }
}

/// Returns the Oren–Nayar BRDF for a reflectance of 1; `a` and `b` follow from the roughness (Oren & Nayar 1994,
/// equation 30).
fn oren_nayar(wi: Vector, wo: Vector, a: f64, b: f64) -> f64 {
    let (ci, co) = (wi[2].abs(), wo[2].abs());
    let (si, so) = ((1.0 - ci * ci).max(0.0).sqrt(), (1.0 - co * co).max(0.0).sqrt());
    // cos(φi − φo)·sin α·tan β, where the sines of the two azimuth vectors cancel with those of the elevations.
    let azimuth = (wi[0] * wo[0] + wi[1] * wo[1]).max(0.0);
    let span = if si * so > 0.0 { azimuth / ci.max(co).max(HORIZON) } else { 0.0 };
    (a + b * span) / PI
}

/// Returns the GGX microfacet term D·G/(4 cos θi cos θo), and the cosine between `wi` and the half vector.
fn ggx(wi: Vector, wo: Vector, (ax, ay): (f64, f64), frame: &Axes) -> (f64, f64) {
    let sum = add(wi, wo);
    let length = norm(sum);
    if length < HORIZON {
        return (0.0, 0.0);
    }
    let half = scale(sum, 1.0 / length);
    let upward = if half[2] < 0.0 { scale(half, -1.0) } else { half };
    let [x, y, z] = frame.of(upward);
    let stretched = (x / ax) * (x / ax) + (y / ay) * (y / ay) + z * z;
    let d = 1.0 / (PI * ax * ay * stretched * stretched);
    let side = if wi[2] < 0.0 || wo[2] < 0.0 { -1.0 } else { 1.0 };
    let hidden = |w: Vector| {
        let [x, y, z] = frame.of(scale(w, side));
        // A direction below the horizon of a tilted frame is treated as grazing.
        let z = z.max(if frame.0[2][2] < 1.0 { 0.02 } else { HORIZON });
        0.5 * ((1.0 + ((ax * x) * (ax * x) + (ay * y) * (ay * y)) / (z * z)).sqrt() - 1.0)
    };
    let g = 1.0 / (1.0 + hidden(wi) + hidden(wo));
    let (ci, co) = (wi[2].abs().max(HORIZON), wo[2].abs().max(HORIZON));
    (d * g / (4.0 * ci * co), dot(wi, half).abs().min(1.0))
}

fn henyey_greenstein(g: f64, cosine: f64) -> f64 {
    let base = 1.0 + g * g - 2.0 * g * cosine;
    (1.0 - g * g) / (4.0 * PI * base * base.sqrt())
}

fn schlick(k: f64, cosine: f64) -> f64 {
    let base = 1.0 - k * cosine;
    (1.0 - k * k) / (4.0 * PI * base * base)
}

fn dielectric(n: f64, c: f64) -> f64 {
    // Cook & Torrance 1982; a negative radicand is total reflection.
    let radicand = n * n + c * c - 1.0;
    if radicand <= 0.0 {
        return 1.0;
    }
    let g = radicand.sqrt();
    let (minus, plus) = (g - c, g + c);
    let first = minus / plus;
    let second = (c * plus - 1.0) / (c * minus + 1.0);
    0.5 * first * first * (1.0 + second * second)
}

fn conductor((n, k): (f64, f64), c: f64) -> f64 {
    let (c2, s2) = (c * c, 1.0 - c * c);
    let difference = n * n - k * k - s2;
    let root = (difference * difference + 4.0 * n * n * k * k).sqrt();
    let a = (0.5 * (root + difference)).max(0.0).sqrt();
    let perpendicular = (root + c2 - 2.0 * a * c) / (root + c2 + 2.0 * a * c);
    let parallel = perpendicular * (c2 * root + s2 * s2 - 2.0 * a * c * s2) / (c2 * root + s2 * s2 + 2.0 * a * c * s2);
    0.5 * (perpendicular + parallel)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(theta: f64, phi: f64) -> Vector {
        Direction::from_degrees(theta, phi).xyz()
    }

    #[test]
    fn interfaces_have_their_known_reflectances() {
        assert!((dielectric(1.5, 1.0) - 0.04).abs() < 1e-15);
        assert!((dielectric(1.5, 0.0) - 1.0).abs() < 1e-12);
        // At Brewster's angle only the perpendicular half is reflected: ½((n² − 1)/(n² + 1))².
        let brewster = 1.0 / (1.0 + 1.5_f64 * 1.5).sqrt();
        let expected = 0.5 * (1.25_f64 / 3.25).powi(2);
        assert!((dielectric(1.5, brewster) - expected).abs() < 1e-12);
        for c in [0.05, 0.3, 0.8, 1.0] {
            assert!((conductor((1.5, 0.0), c) - dielectric(1.5, c)).abs() < 1e-12);
            let copper = conductor((0.2, 3.9), c);
            assert!(copper > 0.9 && copper <= 1.0);
        }
        // ((n − 1)² + k²)/((n + 1)² + k²).
        assert!((conductor((0.2, 3.9), 1.0) - (0.64 + 15.21) / (1.44 + 15.21)).abs() < 1e-12);
        assert_eq!(dielectric(0.5, 0.1), 1.0);
    }

    #[test]
    fn every_surface_lobe_is_reciprocal() {
        let shapes = [
            Shape::Lambert,
            Shape::OrenNayar { a: 0.8, b: 0.3 },
            Shape::Ggx { along: 0.2, across: 0.2, frame: Axes::new(0.0, 0.0, 0.0) },
            Shape::Ggx { along: 0.1, across: 0.3, frame: Axes::new(23.0, 4.0, 53.0) },
            Shape::Asperity { depth: 0.3, back: 0.6, g_back: 0.55, g_forward: 0.3 },
        ];
        for shape in &shapes {
            for (wi, wo) in
                [(at(10.0, 20.0), at(60.0, 250.0)), (at(85.0, 0.0), at(3.0, 99.0)), (at(0.0, 0.0), at(45.0, 7.0))]
            {
                let (there, back) = (shape.at(wi, wo), shape.at(wo, wi));
                assert!((there.0 - back.0).abs() <= 1e-12 * there.0 && (there.1 - back.1).abs() < 1e-12);
                assert!(there.0 > 0.0);
            }
        }
    }

    #[test]
    fn lobes_have_their_closed_forms() {
        let (up, slanted) = (at(0.0, 0.0), at(60.0, 0.0));
        // D at its peak is 1/(π α²), and nothing is hidden along the normal.
        let ggx = Shape::Ggx { along: 0.2, across: 0.2, frame: Axes::new(0.0, 0.0, 0.0) };
        assert!((ggx.at(up, up).0 - 1.0 / (4.0 * PI * 0.04)).abs() < 1e-10);
        let oren = Shape::OrenNayar { a: 0.8, b: 0.3 };
        assert!((oren.at(up, slanted).0 - 0.8 / PI).abs() < 1e-12);
        // sin 60°·tan 60° = 1.5.
        assert!((oren.at(slanted, slanted).0 - (0.8 + 0.45) / PI).abs() < 1e-12);
        assert!((oren.at(slanted, at(60.0, 180.0)).0 - 0.8 / PI).abs() < 1e-12);
        assert!((Shape::Rayleigh.at(up, up).0 - 3.0 / (8.0 * PI)).abs() < 1e-15);
        let forward = Shape::HenyeyGreenstein { weight: 1.0, g1: 0.9, g2: 0.0 };
        assert!(forward.at(up, at(180.0, 0.0)).0 > 1000.0 * forward.at(up, up).0);
        assert!((Shape::CosinePower { axis: up, exponent: 2.0 }.at(up, slanted).0 - 0.25).abs() < 1e-12);
        assert_eq!(Shape::Lambert.at(up, at(120.0, 0.0)).0, 0.0);
        assert_eq!(Shape::LambertTransmission.at(up, at(120.0, 0.0)).0, 1.0 / PI);
    }

    #[test]
    fn nothing_is_infinite_at_the_horizon() {
        let shapes = [
            Shape::OrenNayar { a: 0.8, b: 0.3 },
            Shape::Ggx { along: 0.2, across: 0.4, frame: Axes::new(10.0, 0.0, 0.0) },
            Shape::Asperity { depth: 0.3, back: 0.6, g_back: 0.55, g_forward: 0.3 },
        ];
        for shape in &shapes {
            for wo in [at(90.0, 0.0), at(90.0, 180.0), at(90.0, 45.0)] {
                assert!(shape.at(at(90.0, 0.0), wo).0.is_finite() && shape.at(at(20.0, 0.0), wo).0.is_finite());
            }
        }
    }
}
