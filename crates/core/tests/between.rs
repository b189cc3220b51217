//! Analytic surfaces, measured at a few incidences and evaluated between them.

#![allow(clippy::unwrap_used, reason = "a test's helper fails by panicking, like the test")]

use std::f64::consts::{PI, TAU};
use wavelume_core::compress::{Between, Divisor, Settings, Target, compress, decode_level, inspect, levels};
use wavelume_core::domain::vector::{Vector, about_z, dot, unit};
use wavelume_core::domain::{
    Axis, AzimuthExtent, Azimuths, Direction, DirectionGrid, Domain, Frame, Measurement, Quantity, Sampling, Silent,
    Tensor, TriangleMesh, Unit,
};
use wavelume_core::evaluate::{Directions, Interpolation, Material, Pairs, Place, interpolation_between};

/// Value of a BRDF without the cosine.
type Surface = fn(Vector, Vector) -> f64;

/// Lower bound on cosines in the models.
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

/// Returns a lobe about the direction back to the source, over a constant base.
fn retro(wi: Vector, wo: Vector) -> f64 {
    0.05 + 0.4 * (-(1.0 - dot(wi, wo)) / 0.02).exp()
}

const SURFACES: [(&str, Surface); 11] = [
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
fn rgl() -> Vec<f64> {
    (0..8).map(|i| 90.0 * (0.95 * f64::from(i) / 7.0).powi(2)).collect()
}

/// Elevations from 0 to 80° in steps of 10°.
fn tens() -> Vec<f64> {
    (0..9).map(|i| 10.0 * f64::from(i)).collect()
}

/// Elevations between those of [`rgl`], equally spaced in the cosine from 1 to 0.17.
fn between_rgl() -> Vec<f64> {
    (0..24).map(|k| (1.0 - 0.83 * (f64::from(k) + 0.5) / 24.0).acos().to_degrees()).collect()
}

/// The directions of an incoming axis.
fn directions(axis: &Axis) -> Vec<Vector> {
    match axis {
        Axis::Elevation(angles) => angles.iter().map(|&angle| Direction::from_degrees(angle, 0.0).xyz()).collect(),
        Axis::Triangles(mesh) => (0..mesh.len()).map(|i| mesh.centroid(i).xyz()).collect(),
        _ => Vec::new(),
    }
}

fn measurement(axes: Vec<Axis>, sampling: Sampling, samples: Vec<f32>) -> Measurement {
    let tensor = Tensor::new(axes, samples).unwrap();
    Measurement::new(Quantity::Brdf, Unit::PerSteradian, sampling, tensor).unwrap()
}

/// Returns averages over outgoing triangles of this level, at the directions of an incoming axis.
fn on_triangles(incoming: Axis, level: u8, surface: Surface) -> Measurement {
    let fine = TriangleMesh::new(Domain::Hemisphere, level + 2).unwrap();
    let parts: Vec<(Vector, f64)> = (0..fine.len()).map(|i| (fine.centroid(i).xyz(), fine.solid_angle(i))).collect();
    let mut samples = Vec::new();
    for wi in directions(&incoming) {
        samples.extend(parts.chunks_exact(16).map(|cell| {
            let sums = cell.iter().fold([0.0; 2], |[sum, area], &(wo, da)| [sum + da * surface(wi, wo), area + da]);
            (sums[0] / sums[1]) as f32
        }));
    }
    let outgoing = TriangleMesh::new(Domain::Hemisphere, level).unwrap();
    measurement(vec![incoming, Axis::Triangles(outgoing)], Sampling::Average, samples)
}

/// Returns averages over outgoing triangles of this level, at incidences in degrees.
fn measured(elevations: &[f64], level: u8, surface: Surface) -> Measurement {
    on_triangles(Axis::Elevation(elevations.to_vec()), level, surface)
}

/// Returns values on a grid of outgoing angles in steps of `step` degrees, at incidences in degrees.
fn on_grid(elevations: &[f64], step: u32, surface: Surface) -> Measurement {
    let every = |to: u32| (0..=to / step).map(|i| f64::from(i * step)).collect::<Vec<f64>>();
    let azimuths = Azimuths { angles: every(180), extent: AzimuthExtent::Mirrored };
    let grid = DirectionGrid::new(Frame::Surface, every(88), Some(azimuths)).unwrap();
    let incoming = Axis::Elevation(elevations.to_vec());
    let values = directions(&incoming).into_iter().flat_map(|wi| {
        let grid = &grid;
        (0..grid.len()).map(move |entry| surface(wi, grid.direction(entry).xyz()) as f32)
    });
    let samples = values.collect();
    measurement(vec![incoming, Axis::Grid(grid)], Sampling::Point, samples)
}

/// Returns values on grids of incoming and outgoing angles: incidences in steps of 10° (polar) and 60° (azimuth),
/// outgoing directions in steps of `step` degrees.
fn on_two_grids(step: u32, surface: Surface) -> Measurement {
    let every = |to: u32, step: u32| (0..=to / step).map(|i| f64::from(i * step)).collect::<Vec<f64>>();
    let circle = |step: u32| Some(Azimuths { angles: every(359, step), extent: AzimuthExtent::Circle });
    let incoming = DirectionGrid::new(Frame::Surface, tens(), circle(60)).unwrap();
    let incoming = incoming.covering(0.0, 90.0).unwrap();
    let outgoing = DirectionGrid::new(Frame::Surface, every(88, step), circle(2 * step)).unwrap();
    let values = (0..incoming.len()).flat_map(|i| {
        let wi = incoming.direction(i).xyz();
        let outgoing = &outgoing;
        (0..outgoing.len()).map(move |o| surface(wi, outgoing.direction(o).xyz()) as f32)
    });
    let samples = values.collect();
    measurement(vec![Axis::Grid(incoming), Axis::Grid(outgoing)], Sampling::Point, samples)
}

/// Returns a low-discrepancy point of the unit square (Roberts 2018).
fn point(i: usize) -> [f64; 2] {
    [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (0.5 + i as f64 * step).fract())
}

/// Returns the direction at this cosine and azimuth from `axis`, which lies in the plane of azimuth 0.
fn around(axis: Vector, cosine: f64, azimuth: f64) -> Vector {
    let sine = (1.0 - cosine * cosine).sqrt();
    let (x, y) = (sine * azimuth.cos(), sine * azimuth.sin());
    [x * axis[2] + cosine * axis[0], y, cosine * axis[2] - x * axis[0]]
}

/// Returns er(L2) in % at incidences in degrees: within 20° of the mirror direction, and over all directions up to 80°.
fn errors(material: &Material, surface: Surface, elevations: &[f64]) -> [f64; 2] {
    let lowest = 80.0_f64.to_radians().cos();
    let mut sums = [[0.0; 2]; 2];
    for &elevation in elevations {
        let wi = Direction::from_degrees(elevation, 0.0).xyz();
        // Isotropic surfaces do not change under rotation, cells do.
        let turned = |d: Vector| Some(Direction::from_unit(about_z(d, 0.3)));
        let mirror = [-wi[0], 0.0, wi[2]];
        let cap = 1.0 - 20.0_f64.to_radians().cos();
        for i in 0..1500 {
            let [u, v] = point(i);
            let near = around(mirror, 1.0 - cap * u, TAU * v);
            let all = around([0.0, 0.0, 1.0], 1.0 - (1.0 - lowest) * u, TAU * v);
            for (sums, wo) in sums.iter_mut().zip([near, all]).filter(|(_, wo)| wo[2] >= lowest) {
                let place = Place { index: &[], wi: turned(wi), wo: turned(wo) };
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

/// Returns the elevations halfway between neighbours.
fn halfway(elevations: &[f64]) -> Vec<f64> {
    elevations.array_windows().map(|[a, b]| 0.5 * (a + b)).collect()
}

/// Prints the errors of every second surface with the default and with the chosen interpolation. The environment
/// variable `WAVELUME_BETWEEN_LEVEL` sets the outgoing level (6 for comparisons with other figures). If
/// `WAVELUME_BETWEEN_ALL` is set, all surfaces and all other interpolations are printed.
#[test]
fn figures_between_incidences() {
    let level = std::env::var("WAVELUME_BETWEEN_LEVEL").ok().and_then(|level| level.parse().ok()).unwrap_or(4);
    let shows_all = std::env::var_os("WAVELUME_BETWEEN_ALL").is_some();
    for (set, nodes, asked) in [("rgl", rgl(), between_rgl()), ("tens", tens(), halfway(&tens()))] {
        for (name, surface) in SURFACES.into_iter().step_by(if shows_all { 1 } else { 2 }) {
            let source = measured(&nodes, level, surface);
            let chosen = interpolation_between(&source).unwrap();
            let figures = |between| {
                let material = Material::with_between(source.clone(), between).unwrap();
                (errors(&material, surface, &asked), 100.0 * material.left_out(0.0).unwrap().er_l2)
            };
            let [at_nodes, _] = errors(&Material::of(source.clone()).unwrap(), surface, &nodes[..nodes.len() - 1]);
            let ([near, all], left_out) = figures(Between::default());
            let ([near_now, all_now], left_out_now) = figures(chosen);
            println!(
                "{set:5} {name:16} near the mirror {near:6.2} -> {near_now:6.2} %, all {all:6.2} -> {all_now:6.2} %, \
                 left out {left_out:6.2} -> {left_out_now:6.2} %, at incidences {at_nodes:5.2} %: {chosen}"
            );
            if shows_all {
                let roughness = match chosen.divisor {
                    Divisor::ProjectedAreas { roughness }
                    | Divisor::Masking { roughness }
                    | Divisor::Model { roughness, .. } => roughness,
                    _ => 0.15,
                };
                let divisors = [
                    Divisor::None,
                    Divisor::Cosines,
                    Divisor::ProjectedAreas { roughness },
                    Divisor::Masking { roughness },
                ];
                for (divisor, cubic) in divisors.into_iter().flat_map(|d| [(d, false), (d, true)]) {
                    let between = Between { divisor, cubic, retro: false };
                    let ([near, all], left_out) = figures(between);
                    println!("{:24} {near:6.2} {all:6.2} left out {left_out:6.2}: {between}", "");
                }
            }
            assert!(all_now < 1.1 * all + 0.2, "{set} {name}: {all} {all_now}");
        }
    }
}

/// Returns the errors with the default and with the chosen interpolation, and that interpolation.
fn before_and_now(source: Measurement, surface: Surface, asked: &[f64]) -> ([f64; 2], [f64; 2], Between) {
    let before = errors(&Material::of(source.clone()).unwrap(), surface, asked);
    let between = interpolation_between(&source).unwrap();
    let now = errors(&Material::with_between(source, between).unwrap(), surface, asked);
    (before, now, between)
}

#[test]
fn triangles_and_grids_have_what_elevations_have() {
    let mesh = TriangleMesh::new(Domain::Hemisphere, 1).unwrap();
    let (_, metal) = SURFACES[1];
    let asked: Vec<f64> = (0..12).map(|k| 6.0 * f64::from(k)).collect();
    let (before, now, _) = before_and_now(on_triangles(Axis::Triangles(mesh), 4, metal), metal, &asked);
    assert!(now[0] < 0.5 * before[0], "{before:?} {now:?}");
    for (_, surface) in [SURFACES[1], SURFACES[4]] {
        let (before, now, _) = before_and_now(on_grid(&tens(), 2, surface), surface, &halfway(&tens()));
        assert!(now[0] < 0.5 * before[0], "{before:?} {now:?}");
    }
}

/// Largest error in % of the reflected light and mean error in % of the averages over cells of this level, weighted by
/// them, at measured incidences in degrees.
fn light_and_averages(material: &Material, samples: &[f32], level: u8, surface: Surface, angles: &[f64]) -> [f64; 2] {
    let [mesh, fine] = [level, level + 2].map(|level| TriangleMesh::new(Domain::Hemisphere, level).unwrap());
    let (mut worst, mut astray, mut total) = (0.0_f64, 0.0, 0.0);
    for (&angle, averages) in angles.iter().zip(samples.chunks_exact(mesh.len())) {
        let wi = Direction::from_degrees(angle, 0.0);
        let (mut light, mut truth) = (0.0, 0.0);
        for (cell, &average) in averages.iter().enumerate() {
            let (mut sum, mut area) = (0.0, 0.0);
            for part in 16 * cell..16 * (cell + 1) {
                let (wo, solid_angle, mut value) = (fine.centroid(part), fine.solid_angle(part), [0.0]);
                let place = Place { index: &[], wi: Some(wi), wo: Some(wo) };
                material.evaluate(place, Interpolation::Smooth, &mut value).unwrap();
                light += solid_angle * f64::from(value[0]) * wo.xyz()[2];
                truth += solid_angle * surface(wi.xyz(), wo.xyz()) * wo.xyz()[2];
                sum += solid_angle * f64::from(value[0]);
                area += solid_angle;
            }
            astray += (sum - area * f64::from(average)).abs();
            total += area * f64::from(average);
        }
        worst = worst.max((light / truth - 1.0).abs());
    }
    [100.0 * worst, 100.0 * astray / total]
}

#[test]
fn lobes_as_narrow_as_a_cell_keep_light_shape_and_averages() {
    let (_, metal) = SURFACES[0];
    let source = measured(&rgl(), 5, metal);
    let between = interpolation_between(&source).unwrap();
    assert!(matches!(between.divisor, Divisor::Model { .. }), "{between}");
    let [plain, divided] = [Between::default(), between].map(|between| {
        let material = Material::with_between(source.clone(), between).unwrap();
        let [near, _] = errors(&material, metal, &rgl()[..7]);
        let [light, averages] = light_and_averages(&material, source.tensor.samples(), 5, metal, &rgl()[..7]);
        println!("near the mirror {near:.2} %, light {light:.2} %, averages of cells {averages:.2} %: {between}");
        [near, light, averages]
    });
    assert!(plain.iter().zip(divided).all(|(plain, divided)| divided < 0.25 * plain), "{plain:?} {divided:?}");
    assert!(divided.iter().all(|&percent| percent < 1.0), "{divided:?}");
}

#[test]
fn cubics_of_triangles_and_grids_are_nearer_than_straight_lines() {
    let mesh = Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, 2).unwrap());
    let (_, rough) = SURFACES[2];
    let asked: Vec<f64> = (0..20).map(|k| 3.0 * f64::from(k) + 1.0).collect();
    for (source, demand) in [(on_triangles(mesh, 4, rough), 0.95), (on_two_grids(5, rough), 0.7)] {
        let of = |cubic| {
            let between = Between { divisor: Divisor::None, cubic, retro: false };
            errors(&Material::with_between(source.clone(), between).unwrap(), rough, &asked)
        };
        let (linear, cubic) = (of(false), of(true));
        assert!(cubic[0] < demand * linear[0] && cubic[1] < linear[1], "{linear:?} {cubic:?}");
    }
}

#[test]
fn retro_reflectors_keep_the_direction_back_to_the_source() {
    let (_, surface) = SURFACES[10];
    let (before, now, between) = before_and_now(measured(&tens(), 5, surface), surface, &halfway(&tens()));
    assert!(between.retro && now[1] < 0.5 * before[1], "{before:?} {now:?}");
}

#[test]
fn few_incidences_and_signed_samples_have_none() {
    let (_, metal) = SURFACES[1];
    assert!(interpolation_between(&measured(&[0.0, 30.0, 60.0], 3, metal)).unwrap().is_default());
    let mut signed = measured(&tens(), 3, metal);
    let mut samples = signed.tensor.samples().to_vec();
    samples[7] = -1.0;
    signed.tensor = Tensor::new(signed.tensor.axes().to_vec(), samples).unwrap();
    assert!(interpolation_between(&signed).unwrap().is_default());
}

#[test]
fn surfaces_that_look_alike_from_everywhere_need_nothing() {
    let source = measured(&tens(), 3, |_, _| 0.5 / PI);
    assert!(interpolation_between(&source).unwrap().is_default());
    let mesh = Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, 1).unwrap());
    assert!(interpolation_between(&on_triangles(mesh, 3, |_, _| 0.5 / PI)).unwrap().is_default());
}

#[test]
fn files_state_it_and_their_levels_know_it() {
    let (_, dielectric) = SURFACES[5];
    let source = measured(&tens(), 4, dielectric);
    let between = interpolation_between(&source).unwrap();
    assert!(!between.is_default());
    let settings = Settings { between, target: Target::ErL2(0.002), ..Settings::default() };
    let bytes = compress(&source, &settings, &Silent).unwrap().bytes;
    let plain = compress(&source, &Settings { between: Between::default(), ..settings }, &Silent).unwrap().bytes;
    assert!(bytes.len() <= plain.len() + 13, "{} {}", bytes.len(), plain.len());
    assert_eq!(inspect(&bytes).unwrap().between, between);
    assert!(inspect(&plain).unwrap().between.is_default());
    let (asked, stated) = (halfway(&tens()), Material::with_between(source, between).unwrap());
    let [opened, plain] = [&bytes, &plain].map(|bytes| errors(&Material::open(bytes).unwrap(), dielectric, &asked));
    let stated = errors(&stated, dielectric, &asked);
    assert!(opened[0] < 1.2 * stated[0] + 0.3 && opened[0] < 0.7 * plain[0], "{opened:?} {stated:?} {plain:?}");
    let first = levels(&bytes).unwrap()[0];
    let level = decode_level(&bytes[..first.bytes as usize], first.level).unwrap();
    assert_eq!(level.summary.between, between);
}

#[test]
fn past_the_last_incidence_light_is_held_and_said_to_be_extrapolated() {
    for (name, surface) in SURFACES {
        for source in [measured(&tens(), 4, surface), on_grid(&tens(), 4, surface), on_two_grids(5, surface)] {
            let between = interpolation_between(&source).unwrap();
            let material = Material::with_between(source, between).unwrap();
            let largest = |theta: f64| {
                let wi = Some(Direction::from_degrees(theta, 0.0));
                let light = |(elevation, azimuth): (u32, u32)| {
                    let wo = Direction::from_degrees(f64::from(elevation), f64::from(azimuth));
                    let mut value = [0.0];
                    let place = Place { index: &[], wi, wo: Some(wo) };
                    material.evaluate(place, Interpolation::Smooth, &mut value).unwrap();
                    f64::from(value[0]) * wo.cos_theta()
                };
                let places = (0..90).step_by(2).flat_map(|elevation| (0..12).map(move |k| (elevation, 30 * k)));
                places.map(light).fold(0.0, f64::max)
            };
            let last = largest(80.0);
            for theta in [82.0, 86.0, 89.5] {
                let found = largest(theta);
                // If a lobe is narrower than the cells, its height depends on their position.
                assert!(between.is_default() || found < 1.6 * last, "{name} {theta}: {found} {last}, {between}");
            }
            let is_extrapolated = |theta| material.is_extrapolated(Some(Direction::from_degrees(theta, 10.0)), None);
            assert!(is_extrapolated(80.1) && !is_extrapolated(80.0) && !is_extrapolated(0.0));
        }
    }
}

#[test]
fn under_measured_incidences_grids_keep_their_values_and_cells_their_averages() {
    let smooth = [
        Divisor::None,
        Divisor::Cosines,
        Divisor::ProjectedAreas { roughness: 0.1 },
        Divisor::Masking { roughness: 0.1 },
    ];
    // Half as wide as the surface's lobe, and much brighter.
    let unlike = Divisor::Model { roughness: 0.1, reflectance: 0.5, base: 0.1 };
    let (_, surface) = SURFACES[4];
    let mesh = TriangleMesh::new(Domain::Hemisphere, 1).unwrap();
    let stated: Vec<Vector> = tens().into_iter().map(|wi| Direction::from_degrees(wi, 0.0).xyz()).collect();
    let turned: Vec<Vector> = stated.iter().map(|&wi| about_z(wi, PI / 3.0)).collect();
    let centroids = (0..mesh.len()).map(|i| mesh.centroid(i).xyz()).collect();
    // Divisors that hardly change within a cell hardly change the values there.
    for (source, incidences, most) in [
        (measured(&tens(), 4, surface), stated.clone(), 0.01),
        (on_grid(&tens(), 4, surface), stated, 1e-4),
        (on_two_grids(8, surface), turned, 1e-4),
        (on_triangles(Axis::Triangles(mesh), 5, surface), centroids, 0.01),
    ] {
        let plain = Material::of(source.clone()).unwrap();
        let is_grid = matches!(source.tensor.axes()[1], Axis::Grid(_));
        let divisors = smooth.into_iter().chain(is_grid.then_some(unlike));
        for (divisor, cubic) in divisors.flat_map(|divisor| [(divisor, false), (divisor, true)]) {
            let between = Between { divisor, cubic, retro: false };
            let material = Material::with_between(source.clone(), between).unwrap();
            for (k, &wi) in incidences.iter().flat_map(|wi| (0..40).map(move |k| (k, wi))) {
                let [u, v] = point(k);
                let wi = Some(Direction::from_unit(wi));
                let place = Place { index: &[], wi, wo: Some(Direction::from_degrees(85.0 * u, 360.0 * v)) };
                let [mut before, mut now] = [[0.0]; 2];
                plain.evaluate(place, Interpolation::Smooth, &mut before).unwrap();
                material.evaluate(place, Interpolation::Smooth, &mut now).unwrap();
                let change = f64::from(now[0] / before[0] - 1.0).abs();
                assert!(change < most, "{between} {place:?}: {before:?} {now:?}");
            }
        }
    }
    let source = measured(&tens(), 4, surface);
    let [plain, divided] = [Divisor::None, unlike].map(|divisor| {
        let material = Material::with_between(source.clone(), Between { divisor, ..Between::default() }).unwrap();
        light_and_averages(&material, source.tensor.samples(), 4, surface, &tens())
    });
    println!("light and averages of cells: {plain:?} % and {divided:?} % off");
    assert!(plain.iter().zip(divided).all(|(plain, divided)| divided < plain + 0.5), "{plain:?} {divided:?}");
}

/// Returns a surface that also transmits light, the same from all incidences.
fn through() -> Measurement {
    let mesh = TriangleMesh::new(Domain::Sphere, 2).unwrap();
    let light = |wo: Vector| if wo[2] < 0.0 { f64::exp(0.5 * wo[0]) } else { 0.3 };
    let of_one: Vec<f32> = (0..mesh.len()).map(|i| light(mesh.centroid(i).xyz()) as f32).collect();
    let axes = vec![Axis::Elevation(vec![0.0, 20.0, 40.0, 60.0]), Axis::Triangles(mesh)];
    let tensor = Tensor::new(axes, of_one.repeat(4)).unwrap();
    Measurement::new(Quantity::Bsdf, Unit::PerSteradian, Sampling::Average, tensor).unwrap()
}

#[test]
fn both_sides_of_a_surface_that_does_not_change_stay_where_they_are() {
    let source = through();
    for cubic in [false, true] {
        let between = Between { cubic, ..Between::default() };
        let material = Material::with_between(source.clone(), between).unwrap();
        let wo: Vec<Direction> =
            (0..400).map(point).map(|[u, v]| Direction::from_degrees(180.0 * u, 360.0 * v)).collect();
        let of = |theta: f64| {
            let wi = vec![Direction::from_degrees(theta, 0.0); wo.len()];
            let mut batch = vec![0.0; wo.len()];
            let pairs = Pairs { index: &[], wi: Some(Directions::of(&wi)), wo: Some(Directions::of(&wo)) };
            material.spectra(pairs, Interpolation::Smooth, &mut batch).unwrap();
            for ((&wi, &wo), found) in wi.iter().zip(&wo).zip(&batch) {
                let mut single = [0.0];
                let place = Place { index: &[], wi: Some(wi), wo: Some(wo) };
                material.evaluate(place, Interpolation::Smooth, &mut single).unwrap();
                assert!((found / single[0] - 1.0).abs() < 2e-5, "{cubic} {wi:?} {wo:?}: {found} {single:?}");
            }
            batch
        };
        for (between, at) in of(33.0).iter().zip(of(20.0)) {
            assert!((between / at - 1.0).abs() < 1e-4, "{cubic}: {between} {at}");
        }
    }
}

#[test]
fn batches_answer_as_single_calls_do() {
    let (_, surface) = SURFACES[4];
    let roughness = 0.15;
    let ways = [
        Between { divisor: Divisor::Masking { roughness }, cubic: false, retro: false },
        Between { divisor: Divisor::Cosines, cubic: true, retro: false },
        Between { divisor: Divisor::Model { roughness, reflectance: 0.04, base: 0.3 }, cubic: false, retro: true },
    ];
    let mesh = Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, 1).unwrap());
    let sources = [
        measured(&tens(), 3, surface),
        on_triangles(mesh, 3, surface),
        on_grid(&tens(), 6, surface),
        on_two_grids(6, surface),
    ];
    for (source, between) in sources.iter().flat_map(|source| ways.iter().map(move |way| (source, *way))) {
        let material = Material::with_between(source.clone(), between).unwrap();
        // Includes directions beyond the last elevation.
        let directions = |turn: f64| -> Vec<Direction> {
            let points = (0..300).map(point);
            points.map(|[u, v]| Direction::from_degrees(87.0 * u, 360.0 * v * turn)).collect()
        };
        let (wi, wo) = (directions(0.3), directions(2.0));
        let mut batch = vec![0.0; wi.len()];
        let pairs = Pairs { index: &[], wi: Some(Directions::of(&wi)), wo: Some(Directions::of(&wo)) };
        material.spectra(pairs, Interpolation::Smooth, &mut batch).unwrap();
        for ((&wi, &wo), found) in wi.iter().zip(&wo).zip(batch) {
            let mut single = [0.0];
            let place = Place { index: &[], wi: Some(wi), wo: Some(wo) };
            material.evaluate(place, Interpolation::Smooth, &mut single).unwrap();
            // The grid ends at 84°.
            let is_masked = single[0].is_nan() && found.is_nan() && wo.theta_degrees() > 84.0;
            assert!(is_masked || (found / single[0] - 1.0).abs() < 2e-5, "{between} {place:?}: {found} {single:?}");
        }
    }
}
