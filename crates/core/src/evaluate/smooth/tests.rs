//! The smooth form against analytic truth, between measured directions, and samples aligned with lobes.

use crate::domain::vector::{Vector, dot};
use crate::domain::{
    Axis, Direction, Domain, Measurement, Quantity, Sampling, Tensor, TriangleMesh, Unit, WavelengthGrid,
};
use crate::evaluate::{Alignment, Density, Interpolation, Material, Place, SampleOptions};

const LAMBDAS: usize = 7;

/// GGX lobe with Schlick's Fresnel factor over a coloured diffuse base.
fn gloss(alpha: f64, wi: Vector, wo: Vector, lambda: f64) -> f64 {
    let h = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
    let length = dot(h, h).sqrt();
    let (ch, cd) = (h[2] / length, dot(wi, h) / length);
    let aa = alpha * alpha;
    let d = aa / (std::f64::consts::PI * (ch * ch * (aa - 1.0) + 1.0).powi(2));
    let shadow = |c: f64| 0.5 * ((1.0 + aa * (1.0 / (c * c) - 1.0)).sqrt() - 1.0);
    let (ci, co) = (wi[2].max(1e-4), wo[2].max(1e-4));
    let f = 0.04 + 0.96 * (1.0 - cd).powi(5);
    let colour = 0.6 + 0.4 / (1.0 + (-(lambda - 520.0) / 30.0).exp());
    0.3 * colour / std::f64::consts::PI + d * f / (1.0 + shadow(ci) + shadow(co)) / (4.0 * ci * co)
}

fn grid() -> WavelengthGrid {
    WavelengthGrid::even(400.0, 50.0, LAMBDAS).unwrap()
}

/// Returns a test measurement of the function `f`: its averages over outgoing triangles, at the incoming directions of
/// the axis `incoming`.
fn measured(incoming: Axis, level: u8, f: impl Fn(Vector, Vector, f64) -> f64) -> Measurement {
    let directions: Vec<Vector> = match &incoming {
        Axis::Elevation(values) => values.iter().map(|&t| Direction::from_degrees(t, 0.0).xyz()).collect(),
        Axis::Triangles(mesh) => (0..mesh.len()).map(|i| mesh.centroid(i).xyz()).collect(),
        _ => panic!("an axis of directions"),
    };
    let out = TriangleMesh::new(Domain::Hemisphere, level).unwrap();
    let fine = TriangleMesh::new(Domain::Hemisphere, level + 2).unwrap();
    let parts: Vec<(Vector, f64)> = (0..fine.len()).map(|i| (fine.centroid(i).xyz(), fine.solid_angle(i))).collect();
    let mut samples = Vec::new();
    for &wi in &directions {
        for cell in parts.chunks_exact(16) {
            for lambda in grid().values() {
                let sum = |(s, a), &(wo, da): &(Vector, f64)| (s + da * f(wi, wo, lambda), a + da);
                let (sum, area) = cell.iter().fold((0.0, 0.0), sum);
                samples.push((sum / area) as f32);
            }
        }
    }
    let tensor = Tensor::new(vec![incoming, Axis::Triangles(out), Axis::Wavelength(grid())], samples).unwrap();
    Measurement::new(Quantity::Brdf, Unit::PerSteradian, Sampling::Average, tensor).unwrap()
}

fn gap() -> Measurement {
    let elevations = Axis::Elevation(vec![0.0, 15.0, 35.0, 55.0, 75.0]);
    measured(elevations, 4, |wi, wo, lambda| gloss(0.15, wi, wo, lambda))
}

/// Low-discrepancy point of the upper hemisphere, up to 80 degrees from the normal (Roberts 2018).
fn point(i: usize) -> Vector {
    let u = (0.5 + i as f64 * 0.754_877_666_246_693).fract();
    let phi = std::f64::consts::TAU * (0.5 + i as f64 * 0.569_840_290_998_053).fract();
    let z = 0.17 + 0.83 * u;
    let r = (1.0 - z * z).sqrt();
    [r * phi.cos(), r * phi.sin(), z]
}

fn direction(v: Vector) -> Option<Direction> {
    Direction::new(v[0], v[1], v[2])
}

/// Root mean square error er(L2), in %, of the material `m` relative to the exact glossy lobe, over 1,500 outgoing
/// directions under all directions `incoming` together.
fn error(m: &Material, how: Interpolation, incoming: &[Vector], alpha: f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    let mut out = [0.0; LAMBDAS];
    for &wi in incoming {
        for i in 0..1500 {
            let wo = point(i);
            let place = Place { index: &[], wi: direction(wi), wo: direction(wo) };
            m.evaluate(place, how, &mut out).unwrap();
            for (&value, lambda) in out.iter().zip(grid().values()) {
                let truth = gloss(alpha, wi, wo, lambda);
                sum += ((f64::from(value) - truth) / truth).powi(2);
                count += 1.0;
            }
        }
    }
    100.0 * f64::sqrt(sum / count)
}

#[test]
fn at_measured_directions_the_smooth_form_is_near_the_truth() {
    let mesh = TriangleMesh::new(Domain::Hemisphere, 0).unwrap();
    let m = Material::of(measured(Axis::Triangles(mesh), 4, |wi, wo, l| gloss(0.3, wi, wo, l))).unwrap();
    let at: Vec<Vector> = (0..4).map(|i| mesh.centroid(i).xyz()).collect();
    let (constant, smooth) = (error(&m, Interpolation::Constant, &at, 0.3), error(&m, Interpolation::Smooth, &at, 0.3));
    assert!(smooth < 0.2 && constant > 2.0, "{smooth} {constant}");
}

#[test]
fn between_incoming_directions_a_lobe_moves_and_does_not_fade() {
    let between: Vec<Vector> = (0..8).map(|i| Direction::from_degrees(16.0 + 2.5 * f64::from(i), 0.0).xyz()).collect();
    let error_with = |alignment| {
        let m = Material::with_alignment(gap(), alignment).unwrap();
        error(&m, Interpolation::Smooth, &between, 0.15)
    };
    let (moved, faded) = (error_with(Alignment::HalfVector), error_with(Alignment::None));
    assert!(moved < 0.5 * faded, "{moved} {faded}");
    // At the mirror direction half way between nodes, the unaligned lobe is far too low.
    let peak = |alignment| {
        let m = Material::with_alignment(gap(), alignment).unwrap();
        let (wi, wo) = (Direction::from_degrees(25.0, 0.0), Direction::from_degrees(25.0, 180.0));
        let mut out = [0.0; LAMBDAS];
        m.evaluate(Place { index: &[], wi: Some(wi), wo: Some(wo) }, Interpolation::Smooth, &mut out).unwrap();
        f64::from(out[3]) / gloss(0.15, wi.xyz(), wo.xyz(), 550.0)
    };
    let (moved, faded) = (peak(Alignment::HalfVector), peak(Alignment::None));
    assert!((moved - 1.0).abs() < 0.06 && faded < 0.9, "{moved} {faded}");
}

#[test]
fn the_alignment_is_found_and_sparse_incoming_directions_are_warned_of() {
    let report = Material::of(gap()).unwrap().report();
    assert!(matches!(report.alignment, Alignment::HalfVector | Alignment::TurnedHalfVector), "{report:?}");
    let elevations = || Axis::Elevation(vec![0.0, 15.0, 35.0, 55.0, 75.0]);
    let lambert = Material::of(measured(elevations(), 2, |_, _, _| 0.2)).unwrap();
    assert_eq!(lambert.report().alignment, Alignment::None);
    assert!(lambert.left_out(0.0).unwrap().warning(0.01).is_none());
    let sparse = Axis::Elevation(vec![0.0, 40.0, 80.0]);
    let mirror = Material::of(measured(sparse, 4, |wi, wo, l| gloss(0.05, wi, wo, l))).unwrap();
    assert!(mirror.left_out(0.0).unwrap().warning(0.01).is_some(), "{:?}", mirror.report());
}

#[test]
fn carried_densities_integrate_to_one_and_their_samples_have_the_smooth_albedo() {
    let mesh = TriangleMesh::new(Domain::Hemisphere, 0).unwrap();
    let axes = [Axis::Triangles(mesh), Axis::Elevation(vec![0.0, 30.0, 60.0])];
    let fine = TriangleMesh::new(Domain::Hemisphere, 7).unwrap();
    for (axis, alignment) in axes.into_iter().zip([Alignment::TurnedHalfVector, Alignment::HalfVector]) {
        let source = measured(axis, 3, |wi, wo, l| gloss(0.3, wi, wo, l));
        let m = Material::with_alignment(source, alignment).unwrap();
        for theta in [5.0, 40.0, 70.0] {
            let wi = Some(Direction::from_degrees(theta, 33.0));
            let mut out = [0.0; LAMBDAS];
            let mut mean = |wo: Direction| {
                m.evaluate(Place { index: &[], wi, wo: Some(wo) }, Interpolation::Smooth, &mut out).unwrap();
                f64::from(out.iter().sum::<f32>()) / LAMBDAS as f64
            };
            for defensive in [0.0, 0.1] {
                let options = SampleOptions { density: Density::Linear, defensive, ..SampleOptions::default() };
                let (mut total, mut albedo) = (0.0, 0.0);
                for i in 0..fine.len() {
                    let wo = fine.centroid(i);
                    total += fine.solid_angle(i) * m.pdf(&[], wi, wo, options).unwrap();
                    albedo += fine.solid_angle(i) * wo.cos_theta() * mean(wo);
                }
                assert!((total - 1.0).abs() < 2e-3, "{alignment:?} {theta} {total}");
                if defensive == 0.0 {
                    // Far from the measured directions, only the defensive part draws some parts of the smooth
                    // function.
                    continue;
                }
                let side = 64;
                let mut sum = 0.0;
                for k in 0..side * side {
                    let u = [k / side, k % side].map(|c| (f64::from(c) + 0.5) / f64::from(side));
                    let drawn = m.sample(&[], wi, u, options).unwrap().unwrap();
                    let pdf = m.pdf(&[], wi, drawn.direction, options).unwrap();
                    assert!((drawn.pdf - pdf).abs() < 1e-6 * pdf, "{} {pdf}", drawn.pdf);
                    sum += drawn.weight;
                }
                let estimate = sum / f64::from(side * side);
                assert!((estimate / albedo - 1.0).abs() < 0.06, "{alignment:?} {theta} {estimate} {albedo}");
            }
        }
    }
}

#[test]
fn carried_samples_go_back_to_where_they_came_from() {
    let m = Material::with_alignment(gap(), Alignment::HalfVector).unwrap();
    let wi = Some(Direction::from_degrees(24.0, 77.0));
    for i in 0..2000 {
        let u = [point(i)[2].fract(), (i as f64 * 0.618_033_988_749_895).fract()];
        let drawn = m.sample(&[], wi, u, SampleOptions::default()).unwrap().unwrap();
        // The trees of several nodes draw the direction, each from a point of its own.
        let found = m.invert(&[], wi, drawn.direction, SampleOptions::default()).unwrap().unwrap();
        let again = m.sample(&[], wi, found, SampleOptions::default()).unwrap().unwrap();
        let cosine = dot(drawn.direction.xyz(), again.direction.xyz());
        assert!(
            cosine > 1.0 - 1e-9 && (again.pdf / drawn.pdf - 1.0).abs() < 1e-4,
            "{u:?} {found:?} {drawn:?} {again:?}"
        );
    }
}

#[test]
fn phase_functions_have_no_horizon() {
    let g = 0.6;
    let forward = |wi: Vector, wo: Vector| {
        (1.0 - g * g) / (4.0 * std::f64::consts::PI * (1.0 + g * g + 2.0 * g * dot(wi, wo)).powf(1.5))
    };
    let [incoming, out] = [2, 4].map(|level| TriangleMesh::new(Domain::Sphere, level).unwrap());
    let mut samples = Vec::new();
    for wi in 0..incoming.len() {
        let wi = incoming.centroid(wi).xyz();
        samples.extend((0..out.len()).map(|wo| forward(wi, out.centroid(wo).xyz()) as f32));
    }
    let tensor = Tensor::new(vec![Axis::Triangles(incoming), Axis::Triangles(out)], samples).unwrap();
    let measurement = Measurement::new(Quantity::Phase, Unit::PerSteradian, Sampling::Average, tensor).unwrap();
    let material = Material::of(measurement).unwrap();
    assert_eq!(material.report().alignment, Alignment::Rotation);

    let mut value = [0.0];
    let spread = |k: u32| {
        let z = 1.0 - 2.0 * ((f64::from(k) + 0.5) * 0.618_034).fract();
        Direction::from_degrees(z.acos().to_degrees(), 137.5 * f64::from(k))
    };
    // Arbitrary directions, and ones opposite to a cell, where no rotation has an axis.
    let mut pairs: Vec<[Direction; 2]> = (0..200).map(|k| [spread(k), spread(3 * k + 1)]).collect();
    let cells = TriangleMesh::new(Domain::Sphere, 2).unwrap();
    for k in 0..cells.len() {
        let [x, y, z] = cells.centroid(k).xyz();
        let opposite = [Direction::new(-x, -y, -z), Direction::new(-x, 0.01 - y, 0.02 - z)];
        pairs.extend(opposite.into_iter().flatten().map(|wi| [wi, spread(k as u32)]));
    }
    for [wi, wo] in pairs {
        let mut at = |wi: Vector, wo: Vector| {
            let [wi, wo] = [wi, wo].map(|[x, y, z]| Direction::new(x, y, z));
            material.evaluate(Place { index: &[], wi, wo }, Interpolation::Smooth, &mut value).unwrap();
            f64::from(value[0])
        };
        let (wi, wo) = (wi.xyz(), wo.xyz());
        let found = at(wi, wo);
        let down = at([wi[0], wi[1], -wi[2]], [wo[0], wo[1], -wo[2]]);
        // The neighbours of an incoming direction are not mirror images.
        assert!((found - down).abs() < 0.01 * found, "{found}, upside down {down}");
        let truth = forward(wi, wo);
        assert!((found - truth).abs() < 0.05 * truth, "{found}, not {truth}");
    }
}
