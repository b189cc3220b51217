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
use wavelume::evaluate::{
    Alignment, Beyond, Density, Directions, Interpolation, Material, Pairs, Place, SampleOptions,
};

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

/// Errors at and between measured incoming directions.
fn accuracy(grid: &WavelengthGrid) {
    println!(
        "er(L2) in % at 4,000 fresh outgoing directions down to 80 degrees, and of those within 20 degrees of the mirror's"
    );
    println!("| material | incoming | alignment | constant | mirror | smooth | mirror | smooth between | mirror |");
    println!("|---|---|---|--:|--:|--:|--:|--:|--:|");
    let triangles = Axis::Triangles(mesh(Domain::Hemisphere, 1));
    let elevations = Axis::Elevation(vec![0.0, 15.0, 35.0, 55.0, 75.0]);
    let centroids: Vec<Vector> = (0..16).map(|i| mesh(Domain::Hemisphere, 1).centroid(i).xyz()).collect();
    let around: Vec<Vector> = (0..24).map(|i| uniform(i, 0.4)).collect();
    let at: Vec<Vector> = [15.0, 35.0, 55.0].map(|t| Direction::from_degrees(t, 0.0).xyz()).to_vec();
    let gap: Vec<Vector> =
        (0..20).map(|i| Direction::from_degrees(15.5 + f64::from(i), 18.0 * f64::from(i)).xyz()).collect();
    for alpha in [0.15, 0.3] {
        let f = |wi, wo, lambda| gloss(alpha, 0.3, wi, wo, lambda);
        for (name, axis, measured_at, between) in
            [("16 triangles", &triangles, &centroids, &around), ("elevations, 15-35", &elevations, &at, &gap)]
        {
            for level in [4, 5] {
                let measured = measurement(axis.clone(), level, grid, f);
                let own = open(measured.clone(), None).report().alignment;
                for alignment in [Alignment::None, Alignment::HalfVector, Alignment::TurnedHalfVector] {
                    if name != "16 triangles" && alignment == Alignment::TurnedHalfVector {
                        continue;
                    }
                    let material = open(measured.clone(), Some(alignment));
                    let show = |(all, peak): (f64, f64)| format!("{all:.2} | {peak:.2}");
                    println!(
                        "| GGX {alpha}, level {level} | {name} | {alignment:?}{} | {} | {} | {} |",
                        if alignment == own { " (found)" } else { "" },
                        show(error(&material, Interpolation::Constant, measured_at, 0.17, f)),
                        show(error(&material, Interpolation::Smooth, measured_at, 0.17, f)),
                        show(error(&material, Interpolation::Smooth, between, 0.17, f)),
                    );
                }
            }
        }
    }
}

fn open(measurement: Measurement, alignment: Option<Alignment>) -> Material {
    let opened = match alignment {
        None => Material::of(measurement),
        Some(alignment) => Material::with_alignment(measurement, alignment),
    };
    opened.unwrap_or_else(|e| unreachable!("{e}"))
}

fn compressed(measurement: &Measurement) -> Vec<u8> {
    compress(measurement, &Settings::default(), &Silent).unwrap_or_else(|e| unreachable!("{e}")).bytes
}

/// The best of many runs over `count` calls, in ns a call.
fn time(name: &str, count: usize, mut work: impl FnMut(usize) -> f32) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..100 {
        let start = Instant::now();
        let mut sum = 0.0;
        for i in 0..count {
            sum += work(i);
        }
        black_box(sum);
        best = best.min(start.elapsed().as_secs_f64() * 1e9 / count as f64);
    }
    println!("| {name} | {best:.0} |");
    best
}

fn speed() {
    let grid = WavelengthGrid::even(380.0, 5.0, 75).unwrap_or_else(|e| unreachable!("{e}"));
    let f = |wi, wo, lambda| gloss(0.2, 0.5, wi, wo, lambda);
    let measured = measurement(Axis::Triangles(mesh(Domain::Hemisphere, 1)), 4, &grid, f);
    let bytes = compressed(&measured);
    let start = Instant::now();
    let material = Material::open(&bytes).unwrap_or_else(|e| unreachable!("{e}"));
    println!(
        "\nBRDF 16 x 1024 x 75 in {} bytes, opened in {:.0} ms: {:?}\n",
        bytes.len(),
        start.elapsed().as_secs_f64() * 1e3,
        material.report()
    );
    let count = 1024;
    let direction = |v: Vector| Direction::new(v[0], v[1], v[2]);
    let pairs: Vec<(Option<Direction>, Option<Direction>)> =
        (0..count).map(|i| (direction(uniform(i * 7 + 3, 0.1)), direction(uniform(i, 0.0)))).collect();
    let place = |i: usize| Place { index: &[], wi: pairs[i].0, wo: pairs[i].1 };
    println!("| one call, one thread, material in cache | ns |\n|---|--:|");
    let mut out = vec![0.0; 75];
    let mut four = [0.0; 4];
    let lambdas = [412.3, 503.1, 555.5, 641.9];
    let copied: Vec<f32> = (0..1 << 19).map(|i| i as f32).collect();
    time("copy of 75 samples from 2 MiB of float32", count, |i| {
        out.copy_from_slice(&copied[(i * 7919 * 75) % (copied.len() - 75)..][..75]);
        out[7]
    });
    let mut brdf = f64::INFINITY;
    for how in [Interpolation::Constant, Interpolation::Smooth] {
        let ns = time(&format!("BRDF, spectrum of 75, {how:?}"), count, |i| {
            material.spectrum(place(i), how, &mut out).map_or(0.0, |()| out[7])
        });
        brdf = brdf.min(ns);
        time(&format!("BRDF, 4 wavelengths, {how:?}"), count, |i| {
            material.at_wavelengths(place(i), how, Beyond::Nearest, &lambdas, &mut four).map_or(0.0, |()| four[0])
        });
    }
    for density in [Density::Uniform, Density::Linear] {
        let options = SampleOptions { density, ..SampleOptions::default() };
        time(&format!("pdf, {density:?}"), count, |i| {
            place(i).wo.and_then(|wo| material.pdf(&[], place(i).wi, wo, options).ok()).unwrap_or(0.0) as f32
        });
        let how = if density == Density::Uniform { Interpolation::Constant } else { Interpolation::Smooth };
        time(&format!("sample, pdf and 4 wavelengths, {density:?}"), count, |i| {
            let drawn = material.draw(&[], place(i).wi, point(i), options).ok().flatten();
            let Some((wo, pdf)) = drawn else { return 0.0 };
            let at = Place { index: &[], wi: place(i).wi, wo: Some(wo) };
            let found = material.at_wavelengths(at, how, Beyond::Nearest, &lambdas, &mut four);
            found.map_or(0.0, |()| four[0] * wo.cos_theta() as f32 / pdf as f32)
        });
    }
    let coordinates = |wi: bool, k: usize| -> Vec<f32> {
        let of = |pair: &(Option<Direction>, Option<Direction>)| if wi { pair.0 } else { pair.1 };
        pairs.iter().filter_map(of).map(|d| d.xyz()[k] as f32).collect()
    };
    let [wx, wy, wz] = [0, 1, 2].map(|k| coordinates(true, k));
    let [ox, oy, oz] = [0, 1, 2].map(|k| coordinates(false, k));
    let batch = Pairs {
        index: &[],
        wi: Some(Directions { x: &wx, y: &wy, z: &wz }),
        wo: Some(Directions { x: &ox, y: &oy, z: &oz }),
    };
    let mut all = vec![0.0; 75 * count];
    let each = time("1,024 spectra in a batch, Smooth", 1, |_| {
        material.spectra(batch, Interpolation::Smooth, &mut all).map_or(0.0, |()| all[7])
    });
    println!("| of which one | {:.0} |", each / count as f64);

    let sphere = mesh(Domain::Sphere, 4);
    let lamp = |i: usize| (1.1 + sphere.centroid(i / 91).cos_theta()) * (1.0 + 0.5 * ((i % 91) as f64 / 9.0).sin());
    let axes = vec![
        Axis::Triangles(sphere),
        Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, 91).unwrap_or_else(|e| unreachable!("{e}"))),
    ];
    let tensor =
        Tensor::new(axes, (0..2048 * 91).map(|i| lamp(i) as f32).collect()).unwrap_or_else(|e| unreachable!("{e}"));
    let edf = Measurement::new(Quantity::Edf, Unit::Relative, Sampling::Average, tensor)
        .unwrap_or_else(|e| unreachable!("{e}"));
    let edf = Material::open(&compressed(&edf)).unwrap_or_else(|e| unreachable!("{e}"));
    let mut out = vec![0.0; 91];
    let mut emission = f64::INFINITY;
    for how in [Interpolation::Constant, Interpolation::Smooth] {
        emission = emission.min(time(&format!("EDF, spectrum of 91, {how:?}"), count, |i| {
            let place = Place { index: &[], wi: None, wo: pairs[i].1 };
            edf.spectrum(place, how, &mut out).map_or(0.0, |()| out[7])
        }));
    }
    let axes = vec![Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, 91).unwrap_or_else(|e| unreachable!("{e}")))];
    let tensor = Tensor::new(axes, (0..91).map(|i| lamp(i) as f32).collect()).unwrap_or_else(|e| unreachable!("{e}"));
    let spd = Measurement::new(Quantity::Spectrum, Unit::Relative, Sampling::Average, tensor)
        .unwrap_or_else(|e| unreachable!("{e}"));
    let spd = Material::open(&compressed(&spd)).unwrap_or_else(|e| unreachable!("{e}"));
    let spectrum = time("SPD, spectrum of 91", count, |_| {
        spd.spectrum(black_box(Place::default()), Interpolation::Smooth, &mut out).map_or(0.0, |()| out[7])
    });
    println!("\n[CPB06] table 8, one spectrum (theirs on an Athlon XP 1800+, 90 wavelengths):\n");
    println!("| | paper, us | here, us | paper / here |\n|---|--:|--:|--:|");
    for (name, paper, ns) in [("SPD", 23.0, spectrum), ("EDF", 72.0, emission), ("BRDF", 117.0, brdf)] {
        println!("| {name} | {paper} | {:.3} | {:.0} |", ns / 1e3, paper * 1e3 / ns);
    }
}

fn main() {
    let grid = WavelengthGrid::even(400.0, 50.0, 7).unwrap_or_else(|e| unreachable!("{e}"));
    accuracy(&grid);
    speed();
}
