//! Accuracy of evaluation against analytic truth, and its speed.
//!
//! `cargo bench --no-default-features --bench evaluate`. Best of several runs, everything in one process, so that ratios
//! are of the same moment.
#![allow(clippy::print_stdout, reason = "a bench prints its figures")]

use std::hint::black_box;
use std::time::Instant;
use wavelume::compress::{Settings, compress};
use wavelume::domain::{
    Axis, Direction, Domain, Measurement, Quantity, Sampling, Silent, Tensor, TriangleMesh, Unit, WavelengthGrid,
};
use wavelume::evaluate::{Alignment, Beyond, Interpolation, Material, Place};

type Vector = [f64; 3];

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// GGX with Schlick's Fresnel factor over a coloured diffuse base; sr⁻¹.
fn gloss(alpha: f64, diffuse: f64, wi: Vector, wo: Vector, lambda: f64) -> f64 {
    let h = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
    let length = dot(h, h).sqrt();
    let (ch, cd) = (h[2] / length, dot(wi, h) / length);
    let aa = alpha * alpha;
    let d = aa / (std::f64::consts::PI * (ch * ch * (aa - 1.0) + 1.0).powi(2));
    let shadow = |c: f64| 0.5 * ((1.0 + aa * (1.0 / (c * c) - 1.0)).sqrt() - 1.0);
    let (ci, co) = (wi[2].max(1e-4), wo[2].max(1e-4));
    let g = 1.0 / (1.0 + shadow(ci) + shadow(co));
    let f = 0.04 + 0.96 * (1.0 - cd).powi(5);
    let colour = 0.6 + 0.4 / (1.0 + (-(lambda - 520.0) / 30.0).exp());
    diffuse * colour / std::f64::consts::PI + d * f * g / (4.0 * ci * co)
}

fn mesh(domain: Domain, level: u8) -> TriangleMesh {
    TriangleMesh::new(domain, level).unwrap_or_else(|| unreachable!("level {level}"))
}

/// The leaves of the triangle `cell` of `mesh`, `below` levels finer.
fn parts(mesh: TriangleMesh, below: u8) -> Vec<(Vector, f64)> {
    let fine = TriangleMesh::new(mesh.domain(), mesh.level() + below).unwrap_or_else(|| unreachable!());
    (0..fine.len()).map(|i| (fine.centroid(i).xyz(), fine.solid_angle(i))).collect()
}

fn measurement(
    incoming: Axis,
    level: u8,
    lambdas: &WavelengthGrid,
    f: impl Fn(Vector, Vector, f64) -> f64,
) -> Measurement {
    let directions: Vec<Vector> = match &incoming {
        Axis::Elevation(values) => values.iter().map(|&t| Direction::from_degrees(t, 0.0).xyz()).collect(),
        Axis::Triangles(mesh) => (0..mesh.len()).map(|i| mesh.centroid(i).xyz()).collect(),
        _ => unreachable!("an axis of directions"),
    };
    let out = mesh(Domain::Hemisphere, level);
    let parts = parts(out, 2);
    let mut samples = Vec::new();
    for &wi in &directions {
        for cell in parts.chunks_exact(16) {
            for lambda in lambdas.values() {
                let (sum, area) =
                    cell.iter().fold((0.0, 0.0), |(s, a), &(wo, da)| (s + da * f(wi, wo, lambda), a + da));
                samples.push((sum / area) as f32);
            }
        }
    }
    let axes = vec![incoming, Axis::Triangles(out), Axis::Wavelength(lambdas.clone())];
    let tensor = Tensor::new(axes, samples).unwrap_or_else(|e| unreachable!("{e}"));
    Measurement::new(Quantity::Brdf, Unit::PerSteradian, Sampling::Average, tensor)
        .unwrap_or_else(|e| unreachable!("{e}"))
}

/// A sequence of points in the unit square (R2, Roberts 2018).
fn point(i: usize) -> [f64; 2] {
    [(0.5 + i as f64 * 0.754_877_666_246_693).fract(), (0.5 + i as f64 * 0.569_840_290_998_053).fract()]
}

fn uniform(i: usize, lowest: f64) -> Vector {
    let [u, v] = point(i);
    let z = lowest + (1.0 - lowest) * u;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let phi = std::f64::consts::TAU * v;
    [r * phi.cos(), r * phi.sin(), z]
}

/// er(L2) at outgoing directions uniform in solid angle, and over those where the lobe is.
fn error(
    material: &Material,
    how: Interpolation,
    incoming: &[Vector],
    lowest: f64,
    f: impl Fn(Vector, Vector, f64) -> f64,
) -> (f64, f64) {
    let lambdas = material.wavelengths().unwrap_or_default();
    let mut out = vec![0.0; lambdas.len()];
    let (mut all, mut peak) = ((0.0, 0.0), (0.0, 0.0));
    for &wi in incoming {
        let mirror = [-wi[0], -wi[1], wi[2]];
        let wi_direction = Direction::new(wi[0], wi[1], wi[2]);
        for i in 0..4000 {
            let wo = uniform(i, lowest);
            let place = Place { index: &[], wi: wi_direction, wo: Direction::new(wo[0], wo[1], wo[2]) };
            material.spectrum(place, how, &mut out).unwrap_or_else(|e| unreachable!("{e}"));
            for (&value, &lambda) in out.iter().zip(&lambdas) {
                let truth = f(wi, wo, lambda);
                let e = ((f64::from(value) - truth) / truth).powi(2);
                all = (all.0 + e, all.1 + 1.0);
                if dot(wo, mirror) > 0.94 {
                    peak = (peak.0 + e, peak.1 + 1.0);
                }
            }
        }
    }
    let root = |(sum, count): (f64, f64)| 100.0 * (sum / count).sqrt();
    (root(all), root(peak))
}

fn main() {
    let grid = WavelengthGrid::even(400.0, 50.0, 7).unwrap_or_else(|e| unreachable!("{e}"));
    println!(
        "er(L2) in % at 4,000 fresh outgoing directions (all to 80 degrees, within 20 degrees of the mirror direction)"
    );
    for alpha in [0.15] {
        for level in [4] {
            let f = |wi, wo, lambda| gloss(alpha, 0.3, wi, wo, lambda);
            let measured = measurement(Axis::Triangles(mesh(Domain::Hemisphere, 1)), level, &grid, f);
            let at: Vec<Vector> = (0..16).map(|i| mesh(Domain::Hemisphere, 1).centroid(i).xyz()).collect();
            let between: Vec<Vector> = (0..24).map(|i| uniform(i, 0.4)).collect();
            for alignment in [Alignment::None, Alignment::HalfVector, Alignment::TurnedHalfVector] {
                let material =
                    Material::with_alignment(measured.clone(), alignment).unwrap_or_else(|e| unreachable!("{e}"));
                let show = |(all, peak): (f64, f64)| format!("{all:7.3} {peak:7.3}");
                println!(
                    "alpha {alpha} level {level} {alignment:?}: constant at measured {} | smooth at measured {} | constant between {} | smooth between {} | {:?}",
                    show(error(&material, Interpolation::Constant, &at, 0.17, f)),
                    show(error(&material, Interpolation::Smooth, &at, 0.17, f)),
                    show(error(&material, Interpolation::Constant, &between, 0.17, f)),
                    show(error(&material, Interpolation::Smooth, &between, 0.17, f)),
                    material.report(),
                );
            }
        }
    }
    // A gap of 20 degrees between elevations.
    let f = |wi, wo, lambda| gloss(0.15, 0.3, wi, wo, lambda);
    let measured = measurement(Axis::Elevation(vec![0.0, 15.0, 35.0, 55.0, 75.0]), 5, &grid, f);
    let between: Vec<Vector> =
        (0..20).map(|i| Direction::from_degrees(15.5 + f64::from(i), 18.0 * f64::from(i)).xyz()).collect();
    for alignment in [Alignment::None, Alignment::HalfVector] {
        let material = Material::with_alignment(measured.clone(), alignment).unwrap_or_else(|e| unreachable!("{e}"));
        println!(
            "gap 15-35 {alignment:?}: {:?} {:?}",
            error(&material, Interpolation::Smooth, &between, 0.17, f),
            material.report().left_out_error
        );
    }
    for (name, axis) in [
        ("triangles", Axis::Triangles(mesh(Domain::Hemisphere, 1))),
        ("elevations", Axis::Elevation(vec![0.0, 15.0, 35.0, 55.0, 75.0])),
    ] {
        for (alpha, diffuse) in [(0.15, 0.3), (0.3, 0.3), (0.6, 0.5), (0.15, 0.001)] {
            let f = |wi, wo, lambda| gloss(alpha, diffuse, wi, wo, lambda);
            let material = Material::of(measurement(axis.clone(), 4, &grid, f)).unwrap_or_else(|e| unreachable!("{e}"));
            println!("{name} alpha {alpha} diffuse {diffuse}: {:?}", material.report());
        }
    }
    speed();
}

fn speed() {
    let grid = WavelengthGrid::even(380.0, 5.0, 75).unwrap_or_else(|e| unreachable!("{e}"));
    let f = |wi, wo, lambda| gloss(0.2, 0.5, wi, wo, lambda);
    let measured = measurement(Axis::Triangles(mesh(Domain::Hemisphere, 1)), 4, &grid, f);
    let compressed = compress(&measured, &Settings::default(), &Silent).unwrap_or_else(|e| unreachable!("{e}"));
    let start = Instant::now();
    let material = Material::open(&compressed.bytes).unwrap_or_else(|e| unreachable!("{e}"));
    println!(
        "{} bytes, opened in {:.1} ms, {:?}",
        compressed.bytes.len(),
        start.elapsed().as_secs_f64() * 1e3,
        material.report()
    );
    let count = 4096;
    let direction = |v: Vector| Direction::new(v[0], v[1], v[2]);
    let pairs: Vec<(Option<Direction>, Option<Direction>)> =
        (0..count).map(|i| (direction(uniform(i * 7 + 3, 0.1)), direction(uniform(i, 0.0)))).collect();
    let time = |name: &str, work: &mut dyn FnMut(Place<'_>) -> f32| {
        let mut best = f64::INFINITY;
        for _ in 0..60 {
            let start = Instant::now();
            let mut sum = 0.0;
            for &(wi, wo) in &pairs {
                sum += work(Place { index: &[], wi, wo });
            }
            black_box(sum);
            best = best.min(start.elapsed().as_secs_f64() * 1e9 / count as f64);
        }
        println!("{name:40} {best:8.1} ns");
    };
    let mut out = vec![0.0; 75];
    let mut four = [0.0; 4];
    let lambdas = [412.3, 503.1, 555.5, 641.9];
    for how in [Interpolation::Constant, Interpolation::Smooth] {
        time(&format!("spectrum {how:?}"), &mut |place| {
            material.spectrum(place, how, &mut out).map_or(0.0, |()| out[7])
        });
        time(&format!("4 wavelengths {how:?}"), &mut |place| {
            material.at_wavelengths(place, how, Beyond::Nearest, &lambdas, &mut four).map_or(0.0, |()| four[0])
        });
    }
    time("pdf", &mut |place| place.wo.and_then(|wo| material.pdf(&[], place.wi, wo, None).ok()).unwrap_or(0.0) as f32);
}
