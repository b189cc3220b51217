//! Surfaces of known truth, measured at a few incidences and evaluated between them.

use super::*;
use crate::domain::vector::{Vector, dot, unit};
use crate::domain::{Axis, Direction, Domain, Measurement, Quantity, Sampling, Tensor, TriangleMesh, Unit};
use std::f64::consts::{PI, TAU};

/// Value of a BRDF without the cosine.
pub(super) type Surface = fn(Vector, Vector) -> f64;

/// Cosines below this count as this in the models.
const LEAST_COSINE: f64 = 1e-3;

fn half(wi: Vector, wo: Vector) -> Vector {
    unit([wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]])
}

/// GGX with height-correlated masking and Schlick's Fresnel factor.
fn ggx(alpha: f64, f0: f64, wi: Vector, wo: Vector) -> f64 {
    let h = half(wi, wo);
    let (ci, co) = (wi[2].max(LEAST_COSINE), wo[2].max(LEAST_COSINE));
    let aa = alpha * alpha;
    let spread = h[0] * h[0] + h[1] * h[1] + aa * h[2] * h[2];
    let d = aa / (PI * spread * spread);
    let masking = |c: f64| 0.5 * ((1.0 + aa * (1.0 / (c * c) - 1.0)).sqrt() - 1.0);
    let fresnel = f0 + (1.0 - f0) * (1.0 - dot(wi, h)).powi(5);
    d * fresnel / (1.0 + masking(ci) + masking(co)) / (4.0 * ci * co)
}

fn ward(wi: Vector, wo: Vector) -> f64 {
    let (alpha, h) = (0.15_f64, half(wi, wo));
    let slope = 1.0 / h[2].max(LEAST_COSINE).powi(2) - 1.0;
    let cosines = wi[2].max(LEAST_COSINE) * wo[2].max(LEAST_COSINE);
    (-slope / (alpha * alpha)).exp() / (4.0 * PI * alpha * alpha * cosines.sqrt()) + 0.05
}

fn phong(wi: Vector, wo: Vector) -> f64 {
    let c = (wi[2] * wo[2] - wi[0] * wo[0] - wi[1] * wo[1]).max(0.0);
    62.0 / TAU * c.powi(60) + 0.02
}

/// GGX with the Fresnel equations of a conductor.
fn conductor(wi: Vector, wo: Vector) -> f64 {
    let (n, k) = (0.2_f64, 3.5_f64);
    let c = dot(wi, half(wi, wo)).clamp(0.0, 1.0);
    let ss = 1.0 - c * c;
    let t = n * n - k * k - ss;
    let ab = (t * t + 4.0 * n * n * k * k).sqrt();
    let a = (0.5 * (ab + t)).max(0.0).sqrt();
    let rs = (ab + c * c - 2.0 * a * c) / (ab + c * c + 2.0 * a * c);
    let rp = rs * (c * c * ab + ss * ss - 2.0 * a * c * ss) / (c * c * ab + ss * ss + 2.0 * a * c * ss);
    ggx(0.15, 1.0, wi, wo) * 0.5 * (rs + rp)
}

fn two_lobes(wi: Vector, wo: Vector) -> f64 {
    ggx(0.08, 0.3, wi, wo) + ggx(0.4, 0.3, wi, wo)
}

/// A lobe about the direction back to the source, over a base.
fn retro(wi: Vector, wo: Vector) -> f64 {
    0.05 + 0.4 * (-(1.0 - dot(wi, wo)) / 0.02).exp()
}

pub(super) const SURFACES: [(&str, Surface); 11] = [
    ("metal 0.05", |wi, wo| ggx(0.05, 0.9, wi, wo)),
    ("metal 0.15", |wi, wo| ggx(0.15, 0.9, wi, wo)),
    ("metal 0.3", |wi, wo| ggx(0.3, 0.9, wi, wo)),
    ("dielectric 0.05", |wi, wo| ggx(0.05, 0.04, wi, wo) + 0.3 / PI),
    ("dielectric 0.15", |wi, wo| ggx(0.15, 0.04, wi, wo) + 0.3 / PI),
    ("dielectric 0.3", |wi, wo| ggx(0.3, 0.04, wi, wo) + 0.3 / PI),
    ("ward", ward),
    ("phong 60", phong),
    ("conductor", conductor),
    ("two lobes", two_lobes),
    ("retro", retro),
];

/// Eight incidences as in the RGL database, in degrees.
pub(super) fn rgl() -> Vec<f64> {
    (0..8).map(|i| 90.0 * (0.95 * f64::from(i) / 7.0).powi(2)).collect()
}

/// Elevations from 0 to 80° in steps of 10°.
pub(super) fn tens() -> Vec<f64> {
    (0..9).map(|i| 10.0 * f64::from(i)).collect()
}

/// Elevations between those of [`rgl`], equal in the cosine from 1 to 0.17.
fn between_rgl() -> Vec<f64> {
    (0..24).map(|k| (1.0 - 0.83 * (f64::from(k) + 0.5) / 24.0).acos().to_degrees()).collect()
}

/// Averages over outgoing triangles of this level at incidences in degrees.
pub(super) fn measured(elevations: &[f64], level: u8, surface: Surface) -> Measurement {
    let fine = TriangleMesh::new(Domain::Hemisphere, level + 2).unwrap();
    let parts: Vec<(Vector, f64)> = (0..fine.len()).map(|i| (fine.centroid(i).xyz(), fine.solid_angle(i))).collect();
    let mut samples = Vec::new();
    for &elevation in elevations {
        let wi = Direction::from_degrees(elevation, 0.0).xyz();
        samples.extend(parts.chunks_exact(16).map(|cell| {
            let sums = cell.iter().fold([0.0; 2], |[sum, area], &(wo, da)| [sum + da * surface(wi, wo), area + da]);
            (sums[0] / sums[1]) as f32
        }));
    }
    let outgoing = TriangleMesh::new(Domain::Hemisphere, level).unwrap();
    let axes = vec![Axis::Elevation(elevations.to_vec()), Axis::Triangles(outgoing)];
    let tensor = Tensor::new(axes, samples).unwrap();
    Measurement::new(Quantity::Brdf, Unit::PerSteradian, Sampling::Average, tensor).unwrap()
}

/// Low-discrepancy point of the unit square (Roberts 2018).
fn point(i: usize) -> [f64; 2] {
    [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (0.5 + i as f64 * step).fract())
}

/// Direction at this cosine and azimuth from `axis`, which lies in the plane of azimuth 0.
fn around(axis: Vector, cosine: f64, azimuth: f64) -> Vector {
    let sine = (1.0 - cosine * cosine).sqrt();
    let (x, y) = (sine * azimuth.cos(), sine * azimuth.sin());
    [x * axis[2] + cosine * axis[0], y, cosine * axis[2] - x * axis[0]]
}

/// er(L2) in % at incidences in degrees: within 20° of the mirror direction, and over all directions to 80°.
pub(super) fn errors(material: &Material, surface: Surface, elevations: &[f64]) -> [f64; 2] {
    let lowest = 80.0_f64.to_radians().cos();
    let mut sums = [[0.0; 2]; 2];
    for &elevation in elevations {
        let incoming = Direction::from_degrees(elevation, 0.0);
        let wi = incoming.xyz();
        let mirror = [-wi[0], 0.0, wi[2]];
        let cap = 1.0 - 20.0_f64.to_radians().cos();
        for i in 0..1500 {
            let [u, v] = point(i);
            let near = around(mirror, 1.0 - cap * u, TAU * v);
            let all = around([0.0, 0.0, 1.0], 1.0 - (1.0 - lowest) * u, TAU * v);
            for (sums, wo) in sums.iter_mut().zip([near, all]).filter(|(_, wo)| wo[2] >= lowest) {
                let place = Place { index: &[], wi: Some(incoming), wo: Direction::new(wo[0], wo[1], wo[2]) };
                let mut value = [0.0];
                material.evaluate(place, Interpolation::Smooth, &mut value).unwrap();
                let error = f64::from(value[0]) / surface(wi, wo) - 1.0;
                sums[0] += error * error;
                sums[1] += 1.0;
            }
        }
    }
    sums.map(|[sum, count]| 100.0 * (sum / count).sqrt())
}

/// Elevations half way between neighbours.
pub(super) fn halfway(elevations: &[f64]) -> Vec<f64> {
    elevations.array_windows().map(|[a, b]| 0.5 * (a + b)).collect()
}

#[test]
fn figures_between_incidences() {
    let level = std::env::var("WAVELUME_BETWEEN_LEVEL").ok().and_then(|level| level.parse().ok()).unwrap_or(5);
    for (set, nodes, asked) in [("rgl", rgl(), between_rgl()), ("tens", tens(), halfway(&tens()))] {
        for (name, surface) in SURFACES {
            let today = Material::of(measured(&nodes, level, surface)).unwrap();
            let [near, all] = errors(&today, surface, &asked);
            println!("{set:5} {name:16} near the mirror {near:6.2} %, all {all:6.2} %");
            assert!(near < 80.0 && all < 80.0, "{set} {name}: {near} {all}");
        }
    }
}
