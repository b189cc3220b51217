//! Identities of energy, flux, normalisation and reciprocity; the horizon; changes on request, and every refusal.

use super::{Mean, Preparation, Verdict};
use crate::compress::{self, Settings, Target};
use crate::domain::vector::{Vector, add, dot, norm};
use crate::domain::{
    Axis, Direction, Domain, Measurement, Quantity, Sampling, Silent, Tensor, TriangleMesh, Unit, WavelengthGrid,
};
use crate::evaluate::{Density, EvaluateError, Interpolation, Material, Place, SampleOptions, Side};
use rand::RngExt;
use rand_pcg::Pcg32;
use std::f64::consts::{PI, TAU};

const BOTH_WAYS: [Interpolation; 2] = [Interpolation::Constant, Interpolation::Smooth];

fn mesh(domain: Domain, level: u8) -> TriangleMesh {
    TriangleMesh::new(domain, level).unwrap()
}

fn triangles(domain: Domain, level: u8) -> Axis {
    Axis::Triangles(mesh(domain, level))
}

fn lambda(start: f64, step: f64, count: usize) -> Axis {
    Axis::Wavelength(WavelengthGrid::even(start, step, count).unwrap())
}

fn angles(theta: f64, phi: f64) -> Direction {
    Direction::from_degrees(theta, phi)
}

fn place(wi: Direction, wo: Direction) -> Place<'static> {
    Place { index: &[], wi: Some(wi), wo: Some(wo) }
}

fn directions(axis: &Axis) -> Vec<Direction> {
    match axis {
        Axis::Triangles(mesh) => (0..mesh.len()).map(|i| mesh.centroid(i)).collect(),
        Axis::Elevation(values) => values.iter().map(|&theta| angles(theta, 0.0)).collect(),
        _ => panic!("no directions"),
    }
}

/// Test function f(wi, wo, number of the wavelength), averaged over outgoing triangles, at the sampled incoming
/// directions.
fn two(
    quantity: Quantity,
    incoming: Axis,
    outgoing: TriangleMesh,
    spectral: Axis,
    f: impl Fn(Vector, Vector, usize) -> f64,
) -> Measurement {
    let fine = TriangleMesh::new(outgoing.domain(), outgoing.level() + 2).unwrap();
    let points: Vec<(Vector, f64)> =
        (0..fine.len()).map(|i| (fine.centroid(i).xyz(), fine.projected_solid_angle(i).max(1e-12))).collect();
    let mut samples = Vec::new();
    for wi in directions(&incoming) {
        for cell in points.chunks(16) {
            let total: f64 = cell.iter().map(|(_, weight)| weight).sum();
            for l in 0..spectral.len() {
                let sum: f64 = cell.iter().map(|(wo, weight)| weight * f(wi.xyz(), *wo, l)).sum();
                samples.push((sum / total) as f32);
            }
        }
    }
    let axes = vec![incoming, Axis::Triangles(outgoing), spectral];
    let tensor = Tensor::new(axes, samples).unwrap();
    Measurement::new(quantity, Unit::PerSteradian, Sampling::Average, tensor).unwrap()
}

fn emission(unit: Unit, axes: Vec<Axis>, value: impl Fn(usize) -> f32) -> Material {
    let n = axes.iter().map(Axis::len).product();
    let tensor = Tensor::new(axes, (0..n).map(value).collect()).unwrap();
    Material::of(Measurement::new(Quantity::Edf, unit, Sampling::Average, tensor).unwrap()).unwrap()
}

fn lambert(rho: f64) -> Measurement {
    let axes = (triangles(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 3), lambda(400.0, 100.0, 3));
    two(Quantity::Brdf, axes.0, axes.1, axes.2, |_, _, l| rho * (1.0 - 0.25 * l as f64) / PI)
}

/// Microfacets that reflect all light, so that only masking loses some (Walter et al. 2007, height-correlated).
fn white_ggx(alpha: f64, wi: Vector, wo: Vector) -> f64 {
    let h = add(wi, wo);
    let ch = h[2] / norm(h);
    let aa = alpha * alpha;
    let d = aa / (PI * (ch * ch * (aa - 1.0) + 1.0).powi(2));
    let shadow = |c: f64| 0.5 * ((1.0 + aa * (1.0 / (c * c) - 1.0)).sqrt() - 1.0);
    let (ci, co) = (wi[2].max(1e-6), wo[2].max(1e-6));
    d / (1.0 + shadow(ci) + shadow(co)) / (4.0 * ci * co)
}

fn ggx(alpha: f64, incoming: Axis) -> Measurement {
    let spectral = lambda(400.0, 100.0, 4);
    two(Quantity::Brdf, incoming, mesh(Domain::Hemisphere, 4), spectral, |wi, wo, _| white_ggx(alpha, wi, wo))
}

fn phase(g: f64) -> Measurement {
    let spectral = lambda(500.0, 100.0, 2);
    let f = |wi: Vector, wo: Vector, l: usize| {
        let g = g * (1.0 - 0.5 * l as f64);
        (1.0 - g * g) / (4.0 * PI * (1.0 + g * g + 2.0 * g * dot(wi, wo)).powf(1.5))
    };
    let mut measurement = two(Quantity::Phase, triangles(Domain::Sphere, 2), mesh(Domain::Sphere, 3), spectral, f);
    // Averages over solid angle, not projected solid angle, integrate to 1. Normalised here, as this is not under test.
    measurement = Preparation { normalise: true, clamp: false }.of(measurement).unwrap().0;
    measurement
}

/// Test BSDF that reflects half of the light and transmits a quarter.
fn bsdf(incoming: Domain) -> Measurement {
    let f = |wi: Vector, wo: Vector, _| if wi[2] * wo[2] > 0.0 { 0.5 / PI } else { 0.25 / PI };
    two(Quantity::Bsdf, triangles(incoming, 1), mesh(Domain::Sphere, 2), lambda(500.0, 10.0, 2), f)
}

fn btdf() -> Measurement {
    let axes = (triangles(Domain::Hemisphere, 1), mesh(Domain::Lower, 3), lambda(500.0, 10.0, 2));
    two(Quantity::Btdf, axes.0, axes.1, axes.2, |wi, wo, _| 0.2 * (1.0 + wi[2] * wo[2].abs()) / PI)
}

/// Test samples that vary irregularly with `i`: about one in ten is 0, the others are positive.
fn rough(i: usize) -> f32 {
    let x = (i.wrapping_mul(2_654_435_761) >> 7) % 61;
    if x < 6 { 0.0 } else { x as f32 / 30.0 }
}

fn rough_measurement(quantity: Quantity, axes: Vec<Axis>, value: impl Fn(usize) -> f32) -> Measurement {
    let n = axes.iter().map(Axis::len).product();
    let tensor = Tensor::new(axes, (0..n).map(value).collect()).unwrap();
    Measurement::new(quantity, Unit::PerSteradian, Sampling::Average, tensor).unwrap()
}

fn spectrum(m: &Material, at: Place<'_>, how: Interpolation) -> Vec<f32> {
    let mut out = vec![-1.0; m.lambdas()];
    m.evaluate(at, how, &mut out).unwrap();
    out
}

fn albedo(m: &Material, side: Side, wi: Option<Direction>, how: Interpolation) -> Vec<f32> {
    let mut out = vec![-1.0; m.lambdas()];
    m.albedo_of(side, &[], wi, how, &mut out).unwrap();
    out
}

fn integrated(m: &Material, side: Side, wi: Option<Direction>, how: Interpolation, finer: u8) -> Vec<f32> {
    let mut out = vec![-1.0; m.lambdas()];
    m.integrated(side, &[], wi, how, finer, &mut out).unwrap();
    out
}

fn compressed(measurement: &Measurement, er_l2: f64) -> Vec<u8> {
    let settings = Settings { target: Target::ErL2(er_l2), ..Settings::default() };
    compress::compress(measurement, &settings, &Silent).unwrap().bytes
}

fn is_unfit<T: std::fmt::Debug>(result: Result<T, EvaluateError>, part: &str) {
    match result {
        Err(EvaluateError::Query(error)) => assert!(error.to_string().contains(part), "{error}"),
        other => panic!("expected a refusal `{part}`, found {other:?}"),
    }
}

fn is_near(found: &[f32], expected: f64, tolerance: f64) {
    assert!(found.iter().all(|&v| (f64::from(v) - expected).abs() <= tolerance), "{found:?}, expected {expected}");
}

#[test]
fn a_lambertian_albedo_is_its_reflectance() {
    let m = Material::of(lambert(0.8)).unwrap();
    let report = m.energy().unwrap().albedo.unwrap();
    let largest = report.largest.unwrap();
    assert!((largest.value - 0.8).abs() < 1e-6 && largest.wavelength == Some(400.0));
    assert_eq!((report.verdict, report.excess, report.negative), (Verdict::Holds, 0.0, 0));
    assert!((report.mean - 0.6).abs() < 1e-6);
    assert!(report.entries.len() == 16 && report.entries.iter().all(|spot| (spot.value - 0.8).abs() < 1e-6));
    assert!(report.reflected.is_none() && report.transmitted.is_none());
    for (wi, how) in [(angles(10.0, 20.0), BOTH_WAYS[0]), (angles(85.0, 200.0), BOTH_WAYS[1])] {
        let (stored, summed) = (albedo(&m, Side::Both, Some(wi), how), integrated(&m, Side::Both, Some(wi), how, 1));
        for (l, rho) in [0.8, 0.6, 0.4].into_iter().enumerate() {
            is_near(&[stored[l], summed[l]], rho, 2e-6);
        }
        assert_eq!(albedo(&m, Side::Reflected, Some(wi), how), stored);
        assert_eq!(albedo(&m, Side::Transmitted, Some(wi), how), [0.0; 3]);
        assert_eq!(integrated(&m, Side::Transmitted, Some(wi), how, 0), [0.0; 3]);
    }
}

/// White microfacets lose light to masking only: the albedo is at most 1, and after compression exceeds it by no more
/// than the error that the file states.
#[test]
fn the_furnace_gives_no_energy() {
    for alpha in [0.2, 0.5] {
        let measurement = ggx(alpha, triangles(Domain::Hemisphere, 1));
        let report = Material::of(measurement.clone()).unwrap().energy().unwrap().albedo.unwrap();
        let largest = report.largest.unwrap().value;
        // The averages over the cells are sums over 16 points of each, exact to 0.2 %.
        assert!(largest <= 1.002 && largest > 0.7, "{alpha}: {largest}");
        let bytes = compressed(&measurement, 0.01);
        let material = Material::open(&bytes).unwrap();
        let report = material.energy().unwrap().albedo.unwrap();
        let errors = material.summary().unwrap().errors;
        assert!(report.allowance.er_l2 <= 0.0101 && report.allowance.bound >= errors.max_relative_error);
        assert!(report.largest.unwrap().value <= largest * (1.0 + report.allowance.bound), "{alpha}");
        assert!(report.excess <= 0.002 + report.allowance.bound);
        assert_ne!(report.verdict, Verdict::Broken);
    }
}

#[test]
fn too_bright_a_measurement_is_named() {
    let m = Material::of(lambert(1.2)).unwrap();
    let report = m.energy().unwrap().albedo.unwrap();
    assert!((report.excess - 0.2).abs() < 1e-6);
    assert_eq!(report.verdict, Verdict::Broken);
    let within = Material::open(&compressed(&lambert(1.0), 0.01)).unwrap().energy().unwrap().albedo.unwrap();
    assert_ne!(within.verdict, Verdict::Broken, "{within:?}");
}

/// Tests that interpolation over outgoing directions changes the albedo at the sampled incoming directions by less than
/// a tolerance.
#[test]
fn the_smooth_form_has_the_albedo_of_the_constant_one() {
    for (alpha, incoming, tolerance) in [
        (0.5, triangles(Domain::Hemisphere, 1), 0.01),
        (0.2, triangles(Domain::Hemisphere, 1), 0.03),
        (0.2, Axis::Elevation(vec![0.0, 30.0, 60.0]), 0.03),
    ] {
        let wis = directions(&incoming);
        let m = Material::of(ggx(alpha, incoming)).unwrap();
        for wi in wis {
            let stored = albedo(&m, Side::Both, Some(wi), Interpolation::Constant);
            let constant = integrated(&m, Side::Both, Some(wi), Interpolation::Constant, 0);
            let smooth = integrated(&m, Side::Both, Some(wi), Interpolation::Smooth, 2);
            for l in 0..stored.len() {
                assert!((constant[l] / stored[l] - 1.0).abs() < 1e-3, "{} {}", constant[l], stored[l]);
                let off = f64::from(smooth[l] / stored[l] - 1.0).abs();
                assert!(off < tolerance, "alpha {alpha}, theta {:.1}: {off}", wi.theta_degrees());
            }
        }
    }
}

#[test]
fn a_btdf_sends_its_light_below() {
    let m = Material::of(btdf()).unwrap();
    let direction = mesh(Domain::Hemisphere, 1).centroid(3);
    let wi = Some(direction);
    let both = albedo(&m, Side::Both, wi, Interpolation::Constant);
    assert_eq!(albedo(&m, Side::Transmitted, wi, Interpolation::Constant), both);
    assert_eq!(albedo(&m, Side::Reflected, wi, Interpolation::Constant), [0.0; 2]);
    // ∫ 0.2 (1 + ci co)/π co dω = 0.2 (1 + 2/3 ci).
    let expected = 0.2 * (1.0 + 2.0 / 3.0 * direction.cos_theta());
    is_near(&both, expected, 2e-4);
    is_near(&integrated(&m, Side::Transmitted, wi, Interpolation::Smooth, 2), expected, 1e-3);
    for k in 0..50 {
        let sample = m.sample(&[], wi, [f64::from(k) / 50.0, 0.7], None::<u8>).unwrap().unwrap();
        assert!(sample.direction.cos_theta() < 0.0);
    }
    let transmittance = m.reflectance(Side::Transmitted).unwrap();
    assert_eq!(transmittance, m.reflectance(Side::Both).unwrap());
}

#[test]
fn the_sides_of_a_bsdf_add_up() {
    for domain in [Domain::Hemisphere, Domain::Sphere] {
        let m = Material::of(bsdf(domain)).unwrap();
        for wi in [angles(20.0, 70.0), angles(160.0, 10.0)] {
            if domain == Domain::Hemisphere && wi.cos_theta() < 0.0 {
                continue;
            }
            let of = |side| albedo(&m, side, Some(wi), Interpolation::Constant);
            is_near(&of(Side::Reflected), 0.5, 1e-6);
            is_near(&of(Side::Transmitted), 0.25, 1e-6);
            is_near(&of(Side::Both), 0.75, 1e-6);
            is_near(&integrated(&m, Side::Reflected, Some(wi), Interpolation::Constant, 0), 0.5, 1e-6);
        }
        let report = m.energy().unwrap().albedo.unwrap();
        let value = |spot: Option<super::Spot>| spot.unwrap().value;
        assert!((value(report.reflected) - 0.5).abs() < 1e-6 && (value(report.transmitted) - 0.25).abs() < 1e-6);
        assert!((value(report.largest) - 0.75).abs() < 1e-6);
    }
}

#[test]
fn phase_functions_integrate_to_one_or_are_made_to() {
    for bytes in [None, Some(compressed(&phase(0.5), 0.01))] {
        let m = bytes.map_or_else(|| Material::of(phase(0.5)), |bytes| Material::open(&bytes)).unwrap();
        let report = m.energy().unwrap().normalisation.unwrap();
        assert_ne!(report.verdict, Verdict::Broken, "{report:?}");
        let smooth = integrated(&m, Side::Both, Some(angles(130.0, 20.0)), Interpolation::Smooth, 1);
        is_near(&smooth, 1.0, 0.02);
    }
    let mut twice = phase(0.5);
    let samples = twice.tensor.samples().iter().map(|s| 2.0 * s).collect();
    twice.tensor = Tensor::new(twice.tensor.axes().to_vec(), samples).unwrap();
    let report = Material::of(twice.clone()).unwrap().energy().unwrap().normalisation.unwrap();
    assert!(report.verdict == Verdict::Broken && (report.deviation - 1.0).abs() < 1e-5);
    let (m, done) = Material::of_prepared(twice, Preparation { normalise: true, clamp: false }).unwrap();
    let report = m.energy().unwrap().normalisation.unwrap();
    assert!(report.verdict == Verdict::Holds && report.deviation < 1e-6, "{report:?}");
    assert_eq!((done.normalised, done.not_normalised, done.clamped), (2 * 128, 0, 0));
    let (least, largest) = done.integrals.unwrap();
    assert!((least - 2.0).abs() < 1e-5 && (largest - 2.0).abs() < 1e-5);
}

#[test]
fn an_isotropic_source_has_four_pi_times_its_intensity() {
    let axes = || vec![triangles(Domain::Sphere, 2)];
    let flux = |m: &Material| m.energy().unwrap().flux.unwrap().remove(0);
    let report = flux(&emission(Unit::Candela, axes(), |_| 100.0));
    assert!((report.luminous.unwrap() - 400.0 * PI).abs() < 1e-3 && report.unit == "lm" && report.reason.is_none());
    assert_eq!(report.total, report.luminous);
    // 1 mW/sr/nm at every wavelength.
    let spectral = |unit| emission(unit, [axes(), vec![lambda(380.0, 5.0, 81)]].concat(), |_| 1.0);
    let report = flux(&spectral(Unit::MilliwattPerSteradianNanometre));
    assert!((report.total.unwrap() - 4.0 * PI * 400.0).abs() < 1e-2 && report.total_unit == "mW");
    assert!(report.spectral.iter().all(|v| (v.unwrap() - 4.0 * PI).abs() < 1e-5));
    // ∫ V dλ = 106.857 nm for the CIE 1931 observer.
    let expected = 683.0 * 4.0 * PI * 106.857 * 1e-3;
    assert!((report.luminous.unwrap() / expected - 1.0).abs() < 1e-4, "{:?} {expected}", report.luminous);
    let relative = flux(&spectral(Unit::Relative));
    assert!(relative.luminous.is_none() && relative.total.is_none());
    assert!(relative.reason.unwrap().contains("the unit is relative"));
    let narrow = emission(Unit::WattPerSteradianNanometre, [axes(), vec![lambda(500.0, 5.0, 3)]].concat(), |_| 1.0);
    assert!(flux(&narrow).reason.unwrap().contains("expected at least 400 to 700 nm"));
    // Two lamps in one tensor; the second is dark in half of its directions.
    let two = vec![Axis::Index { count: 2, labels: vec![] }, triangles(Domain::Sphere, 2)];
    let m = emission(Unit::CandelaPerKilolumen, two, |i| if i < 192 { 1.0 } else { 0.0 });
    let reports = m.energy().unwrap().flux.unwrap();
    assert_eq!((&*reports[1].index, reports[1].unit), (&[1][..], "lm/klm"));
    assert!((reports[0].total.unwrap() - 2.0 * reports[1].total.unwrap()).abs() < 1e-5);
    // Masked directions add nothing; one wavelength masked everywhere leaves no total.
    let holes =
        emission(Unit::WattPerSteradianNanometre, vec![triangles(Domain::Sphere, 1), lambda(400.0, 10.0, 31)], |i| {
            if i % 31 == 3 { f32::NAN } else { 1.0 }
        });
    let report = flux(&holes);
    assert!(report.spectral[3].is_none() && report.total.is_none() && report.luminous.is_none());
    assert!(report.reason.unwrap().contains("masked"));
}

#[test]
fn positive_data_never_give_negative_values() {
    let hemisphere = |level| triangles(Domain::Hemisphere, level);
    let sphere = |level| triangles(Domain::Sphere, level);
    let wavelengths = || lambda(400.0, 10.0, 3);
    let of = |quantity, axes| rough_measurement(quantity, axes, rough);
    // From planes, and with partly dark spectra from samples.
    let measurements = [
        of(Quantity::Brdf, vec![hemisphere(1), hemisphere(3), wavelengths()]),
        of(Quantity::Brdf, vec![Axis::Elevation(vec![0.0, 30.0, 60.0]), hemisphere(2), wavelengths()]),
        of(Quantity::Btdf, vec![hemisphere(1), triangles(Domain::Lower, 2), wavelengths()]),
        of(Quantity::Bsdf, vec![sphere(1), sphere(2), wavelengths()]),
        of(Quantity::Phase, vec![sphere(1), sphere(2), wavelengths()]),
        of(Quantity::Edf, vec![sphere(3), wavelengths()]),
        of(Quantity::Reflectance, vec![hemisphere(2), wavelengths()]),
    ];
    let sparse = |m: &Measurement| {
        let lambdas = m.tensor.shape().last().copied().unwrap();
        let whole = |i: usize| if (i / lambdas).is_multiple_of(3) { 0.0 } else { 1e-3 * 1000_f32.powf(rough(i)) };
        rough_measurement(m.quantity, m.tensor.axes().to_vec(), whole)
    };
    let mut rng = Pcg32::new(11, 1);
    for m in measurements.iter().cloned().chain(measurements.iter().map(sparse)) {
        let (quantity, domains) = (m.quantity, m.tensor.axes().to_vec());
        let m = Material::of(m).unwrap();
        let draw = |rng: &mut Pcg32, axis: &Axis| {
            let z = match axis {
                Axis::Triangles(mesh) if mesh.domain() == Domain::Sphere => 2.0 * rng.random::<f64>() - 1.0,
                Axis::Triangles(mesh) if mesh.domain() == Domain::Lower => -rng.random::<f64>(),
                _ => rng.random::<f64>(),
            };
            Direction::from_radians(z.acos(), TAU * rng.random::<f64>())
        };
        for _ in 0..2000 {
            let one = Some(draw(&mut rng, &domains[0]));
            let (wi, wo) = match quantity {
                Quantity::Edf => (None, one),
                Quantity::Reflectance => (one, None),
                _ => (one, Some(draw(&mut rng, &domains[1]))),
            };
            for how in BOTH_WAYS {
                let found = spectrum(&m, Place { index: &[], wi, wo }, how);
                assert!(found.iter().all(|v| *v >= 0.0 && v.is_finite()), "{quantity} {how:?}: {found:?}");
            }
            if quantity != Quantity::Reflectance {
                is_positive(&albedo(&m, Side::Both, wi, Interpolation::Smooth));
                assert!(m.pdf(&[], wi, wo.unwrap(), None::<u8>).unwrap() >= 0.0);
                let u = [rng.random(), rng.random()];
                let sample = m.sample(&[], wi, u, None::<u8>).unwrap().unwrap();
                assert!(sample.weight >= 0.0 && sample.weight.is_finite() && sample.pdf > 0.0);
            }
        }
    }
}

fn is_positive(values: &[f32]) {
    assert!(values.iter().all(|v| *v >= 0.0 && v.is_finite()), "{values:?}");
}

#[test]
fn negative_samples_are_given_or_clamped_as_asked() {
    let axes = vec![triangles(Domain::Hemisphere, 0), triangles(Domain::Hemisphere, 2), lambda(400.0, 10.0, 2)];
    let noisy = rough_measurement(Quantity::Brdf, axes, |i| if i % 5 == 0 { -0.25 } else { 0.3 });
    let wi = mesh(Domain::Hemisphere, 0).centroid(1);
    let wo = mesh(Domain::Hemisphere, 2).centroid(0);
    let as_it_is = Material::of(noisy.clone()).unwrap();
    let expected = noisy.tensor.samples()[128];
    assert!((spectrum(&as_it_is, place(wi, wo), Interpolation::Constant)[0] - expected).abs() < 1e-6);
    let lowest = as_it_is.measurement().unwrap().tensor.range().unwrap().0;
    assert!((lowest + 0.25).abs() < 1e-4);
    let negative = noisy.tensor.samples().iter().filter(|s| **s < 0.0).count() as u64;
    let bytes =
        compress::compress(&noisy, &Settings { target: Target::Lossless, ..lossless() }, &Silent).unwrap().bytes;
    let clamp = Preparation { clamp: true, normalise: false };
    for (m, done) in [Material::of_prepared(noisy, clamp).unwrap(), Material::open_prepared(&bytes, clamp).unwrap()] {
        assert_eq!((done.clamped, done.most_negative, done.integrals), (negative, -0.25, None));
        assert_eq!(m.measurement().unwrap().tensor.range().unwrap().0, 0.0);
        let mut rng = Pcg32::new(5, 1);
        for _ in 0..500 {
            let mut direction = || angles(90.0 * rng.random::<f64>(), 360.0 * rng.random::<f64>());
            is_positive(&spectrum(&m, place(direction(), direction()), Interpolation::Smooth));
        }
        assert_eq!(m.energy().unwrap().albedo.unwrap().negative, 0);
    }
    let dark = rough_measurement(Quantity::Edf, vec![triangles(Domain::Sphere, 0), lambda(400.0, 10.0, 2)], |i| {
        if i % 2 == 0 { -1.0 } else { 1.0 }
    });
    let (m, done) = Material::of_prepared(dark, Preparation::default()).unwrap();
    assert_eq!(done, super::Prepared::default());
    assert!((m.energy().unwrap().flux.unwrap()[0].spectral[0].unwrap() + 4.0 * PI).abs() < 1e-5);
}

fn lossless() -> Settings {
    Settings { policy: compress::Policy::Lossless, ..Settings::default() }
}

#[test]
fn lambertian_and_analytic_lobes_are_reciprocal() {
    let report = Material::of(lambert(0.5)).unwrap().reciprocity().unwrap();
    assert!(report.mean < 1e-6 && report.light < 1e-6 && report.largest.unwrap().difference < 1e-5);
    assert_eq!((report.pairs, report.left_out, report.step), (16 * 256, 0, 1));
    let m = Material::of(ggx(0.5, triangles(Domain::Hemisphere, 2))).unwrap();
    let report = m.reciprocity().unwrap();
    // Interpolation between 64 incoming directions is the only error, and the report's own estimate of it has the same
    // size.
    assert!(report.light < 0.05 && report.mean < 0.05 && report.p90 < 0.12, "{report:?}");
    assert!(report.left_out_error.is_some() && report.p90 >= report.mean * 0.5);
    let isotropic = Material::of(ggx(0.5, Axis::Elevation((0..=8).map(|i| 10.0 * f64::from(i)).collect()))).unwrap();
    let report = isotropic.reciprocity().unwrap();
    assert!(report.light < 0.05 && report.left_out > 0, "{report:?}");
    // One direction of scattering differs by the wavelength, both ways alike.
    let report = Material::of(phase(0.4)).unwrap().reciprocity().unwrap();
    assert!(report.light < 0.02 && report.left_out == 0, "{report:?}");
    // The sides of a BSDF: half of the pairs are transmitted.
    let report = Material::of(bsdf(Domain::Sphere)).unwrap().reciprocity().unwrap();
    assert_eq!(report.pairs, report.left_out);
}

#[test]
fn what_is_not_reciprocal_is_found() {
    // f = (1 + cos θi)/π: twice as bright one way as the other at the worst.
    let axes = (triangles(Domain::Hemisphere, 2), mesh(Domain::Hemisphere, 2), lambda(500.0, 10.0, 2));
    let m = Material::of(two(Quantity::Brdf, axes.0, axes.1, axes.2, |wi, _, _| (1.0 + wi[2]) / PI)).unwrap();
    let report = m.reciprocity().unwrap();
    let worst = report.largest.unwrap();
    assert!(worst.difference > 0.45 && worst.difference < 2.0 / 3.0, "{worst:?}");
    assert!((worst.wi[0] - worst.wo[0]).abs() > 60.0);
    assert!((worst.there - worst.back).abs() > 0.1 && worst.wavelength.is_some());
    assert!(report.mean > 0.05 && report.mean <= report.p90 && report.p90 <= worst.difference);
}

#[test]
fn the_symmetric_function_is_exactly_reciprocal() {
    let mut rng = Pcg32::new(8, 1);
    let materials = [
        (ggx(0.3, triangles(Domain::Hemisphere, 1)), false),
        (ggx(0.3, Axis::Elevation(vec![0.0, 25.0, 50.0, 75.0])), false),
        (phase(0.6), true),
        (bsdf(Domain::Sphere), true),
    ];
    for (measurement, whole) in materials {
        let m = Material::of(measurement).unwrap();
        let value = |wi, wo, how, mean| {
            let (mut scratch, mut out) = (vec![0.0; m.lambdas()], vec![0.0; m.lambdas()]);
            m.symmetric_spectrum(place(wi, wo), how, mean, &mut scratch, &mut out).unwrap();
            out
        };
        for _ in 0..500 {
            let mut direction =
                || angles(if whole { 180.0 } else { 90.0 } * rng.random::<f64>(), 360.0 * rng.random::<f64>());
            let (wi, wo) = (direction(), direction());
            for how in BOTH_WAYS {
                let (there, back) = (spectrum(&m, place(wi, wo), how), spectrum(&m, place(wo, wi), how));
                let arithmetic = value(wi, wo, how, Mean::Arithmetic);
                let geometric = value(wi, wo, how, Mean::Geometric);
                if m.is_transmitted(wi, wo) {
                    assert_eq!(arithmetic, there);
                    continue;
                }
                assert_eq!(arithmetic, value(wo, wi, how, Mean::Arithmetic));
                assert_eq!(geometric, value(wo, wi, how, Mean::Geometric));
                for l in 0..there.len() {
                    assert!((arithmetic[l] - 0.5 * (there[l] + back[l])).abs() <= 1e-6 * arithmetic[l]);
                    assert!(geometric[l] <= arithmetic[l] * 1.000_001);
                }
            }
        }
    }
}

/// Checks that the albedo of the arithmetic mean of f(wi, wo) and f(wo, wi), summed over outgoing triangles, is within
/// 10 % of the stored albedo and below 1.05.
#[test]
fn the_symmetric_function_keeps_to_energy() {
    let m = Material::of(ggx(0.3, triangles(Domain::Hemisphere, 2))).unwrap();
    let outgoing = mesh(Domain::Hemisphere, 4);
    for entry in [0, 20, 41, 63] {
        let wi = mesh(Domain::Hemisphere, 2).centroid(entry);
        let (mut scratch, mut out) = ([0.0; 4], [0.0; 4]);
        let mut light = 0.0;
        for o in 0..outgoing.len() {
            let at = place(wi, outgoing.centroid(o));
            m.symmetric_spectrum(at, Interpolation::Smooth, Mean::Arithmetic, &mut scratch, &mut out).unwrap();
            light += f64::from(out[0]) * outgoing.projected_solid_angle(o);
        }
        let stored = f64::from(albedo(&m, Side::Both, Some(wi), Interpolation::Constant)[0]);
        assert!((light / stored - 1.0).abs() < 0.1 && light < 1.05, "{entry}: {light} {stored}");
    }
}

#[test]
fn one_sided_pairs_take_the_side_there_is() {
    // A BSDF lit from above only: directions below cannot be exchanged.
    let m = Material::of(bsdf(Domain::Hemisphere)).unwrap();
    let (mut scratch, mut out) = ([0.0; 2], [0.0; 2]);
    let mut symmetric = |m: &Material, wi, wo| {
        m.symmetric_spectrum(place(wi, wo), Interpolation::Constant, Mean::Arithmetic, &mut scratch, &mut out)
            .map(|()| out)
    };
    let (up, down) = (angles(20.0, 40.0), angles(150.0, 10.0));
    assert_eq!(symmetric(&m, up, down).unwrap()[0], spectrum(&m, place(up, down), Interpolation::Constant)[0]);
    is_unfit(symmetric(&m, down, up), "outside the incoming domain");
    // A BRDF: below the horizon no light is sent either way; both directions below fails.
    let m = Material::of(ggx(0.4, triangles(Domain::Hemisphere, 0))).unwrap();
    let (mut scratch, mut out) = ([0.0; 4], [0.0; 4]);
    let mut symmetric = |wi, wo| {
        m.symmetric_spectrum(place(wi, wo), Interpolation::Smooth, Mean::Arithmetic, &mut scratch, &mut out)
            .map(|()| out)
    };
    assert_eq!((symmetric(up, down).unwrap(), symmetric(down, up).unwrap()), ([0.0; 4], [0.0; 4]));
    is_unfit(symmetric(down, down), "outside the incoming domain");
    // Masked one way: the other value counts.
    let axes = vec![triangles(Domain::Hemisphere, 0), triangles(Domain::Hemisphere, 0), lambda(500.0, 10.0, 2)];
    let m = Material::of(rough_measurement(Quantity::Brdf, axes, |i| match i / 2 {
        4 => 0.25,
        1 | 2 | 8 => f32::NAN,
        _ => 1.0,
    }))
    .unwrap();
    let cell = |i| mesh(Domain::Hemisphere, 0).centroid(i);
    let (mut scratch, mut out) = ([0.0; 2], [0.0; 2]);
    for mean in [Mean::Arithmetic, Mean::Geometric] {
        for (a, b) in [(0, 1), (1, 0)] {
            m.symmetric_spectrum(place(cell(a), cell(b)), Interpolation::Constant, mean, &mut scratch, &mut out)
                .unwrap();
            is_near(&out, 0.25, 1e-5);
        }
        m.symmetric_spectrum(place(cell(0), cell(2)), Interpolation::Constant, mean, &mut scratch, &mut out).unwrap();
        assert!(out[0].is_nan());
    }
}

#[test]
fn the_reflectance_is_a_measurement_that_compresses() {
    for incoming in [triangles(Domain::Hemisphere, 2), Axis::Elevation(vec![0.0, 30.0, 60.0, 80.0])] {
        let wis = directions(&incoming);
        let spectral = lambda(400.0, 20.0, 16);
        let colour =
            |wi: Vector, wo: Vector, l: usize| (0.2 + 0.03 * l as f64) * (0.3 / PI + 0.5 * white_ggx(0.5, wi, wo));
        let brdf = two(Quantity::Brdf, incoming.clone(), mesh(Domain::Hemisphere, 3), spectral.clone(), colour);
        let m = Material::of(brdf).unwrap();
        let reflectance = m.reflectance(Side::Both).unwrap();
        assert_eq!((reflectance.quantity, reflectance.unit), (Quantity::Reflectance, Unit::One));
        assert_eq!(reflectance.tensor.axes(), [incoming, spectral]);
        let stored = Material::open(&compressed(&reflectance, 0.005)).unwrap();
        for wi in wis {
            let expected = albedo(&m, Side::Both, Some(wi), Interpolation::Constant);
            let found = spectrum(&stored, Place { index: &[], wi: Some(wi), wo: None }, Interpolation::Constant);
            let bound = stored.summary().unwrap().errors.max_relative_error as f32 + 1e-3;
            assert!(found.iter().zip(&expected).all(|(a, b)| (a / b - 1.0).abs() < bound), "{found:?} {expected:?}");
        }
    }
    let sides = Material::of(bsdf(Domain::Sphere)).unwrap();
    for (side, value) in [(Side::Both, 0.75), (Side::Reflected, 0.5), (Side::Transmitted, 0.25)] {
        is_near(sides.reflectance(side).unwrap().tensor.samples(), value, 1e-6);
    }
}

#[test]
fn the_horizon_is_defined() {
    let brdf = Material::of(ggx(0.3, triangles(Domain::Hemisphere, 1))).unwrap();
    let isotropic = Material::of(ggx(0.3, Axis::Elevation(vec![0.0, 45.0, 90.0]))).unwrap();
    let (btdf, bsdf) = (Material::of(btdf()).unwrap(), Material::of(bsdf(Domain::Sphere)).unwrap());
    let up = angles(30.0, 50.0);
    for how in BOTH_WAYS {
        for phi in [0.0, 17.0, 90.0, 180.0, 269.5, 270.0, 359.9] {
            let (horizon, above, below) = (angles(90.0, phi), angles(89.99, phi), angles(90.01, phi));
            assert_eq!(horizon.cos_theta(), 0.0);
            // The horizon belongs to every domain that it bounds, with the value of the adjacent cells.
            for m in [&brdf, &isotropic] {
                is_positive(&spectrum(m, place(up, horizon), how));
                is_positive(&spectrum(m, place(horizon, horizon), how));
                is_positive(&spectrum(m, place(horizon, angles(90.0, phi + 180.0)), how));
                is_positive(&spectrum(m, place(horizon, up), how));
                is_positive(&albedo(m, Side::Both, Some(horizon), how));
                assert_eq!(spectrum(m, place(up, below), how), [0.0; 4]);
                assert_eq!(m.pdf(&[], Some(up), below, None::<u8>).unwrap(), 0.0);
                // Densities include the cosine: they may be 0 there, unless drawn defensively.
                let defensive = SampleOptions { defensive: 0.1, density: Density::Uniform, level: None };
                assert!(m.pdf(&[], Some(up), horizon, None::<u8>).unwrap() >= 0.0);
                assert!(m.pdf(&[], Some(up), horizon, defensive).unwrap().is_finite());
                let mut out = [0.0; 4];
                is_unfit(m.evaluate(place(below, up), how, &mut out), "outside the incoming domain");
                let [at, beside] = [horizon, above].map(|wo| spectrum(m, place(up, wo), how)[0]);
                assert!((at / beside - 1.0).abs() < 0.02, "{phi} {how:?}: {at} {beside}");
            }
            // Transmission ends there as well.
            assert!(spectrum(&btdf, place(up, horizon), how)[0] > 0.0);
            assert_eq!(spectrum(&btdf, place(up, above), how), [0.0; 2]);
            // A BSDF has both sides; the horizon itself is above.
            if how == Interpolation::Constant {
                let value = |wo| f64::from(spectrum(&bsdf, place(up, wo), how)[0]) * PI;
                assert!((value(horizon) - 0.5).abs() < 1e-6 && (value(above) - 0.5).abs() < 1e-6);
                assert!((value(below) - 0.25).abs() < 1e-6);
                is_near(&albedo(&bsdf, Side::Reflected, Some(horizon), how), 0.5, 1e-6);
            }
        }
    }
    // Weights of samples are finite, however low the directions are.
    let mut rng = Pcg32::new(9, 1);
    for _ in 0..2000 {
        for m in [&brdf, &isotropic] {
            let wi = Some(angles(90.0, 360.0 * rng.random::<f64>()));
            let sample = m.sample(&[], wi, [rng.random(), rng.random()], None::<u8>).unwrap().unwrap();
            assert!(sample.weight.is_finite() && sample.weight >= 0.0 && sample.direction.cos_theta() >= 0.0);
        }
    }
}

#[test]
fn refusals_name_their_reason() {
    let edf = emission(Unit::Candela, vec![triangles(Domain::Sphere, 0)], |_| 1.0);
    let reflectance = Material::of(Material::of(lambert(0.5)).unwrap().reflectance(Side::Both).unwrap()).unwrap();
    let transmission = Material::of(btdf()).unwrap();
    is_unfit(reflectance.energy(), "this reflectance has no outgoing axis: there is no energy to report");
    is_unfit(edf.reciprocity(), "this edf has no reciprocity");
    is_unfit(reflectance.reciprocity(), "this reflectance has no reciprocity");
    is_unfit(transmission.reciprocity(), "this btdf is reciprocal only with");
    is_unfit(edf.reflectance(Side::Both), "this edf has no reflectance");
    is_unfit(Material::of(phase(0.1)).unwrap().reflectance(Side::Both), "this phase has no reflectance");
    is_unfit(
        edf.albedo_of(Side::Reflected, &[], None, Interpolation::Smooth, &mut [0.0]),
        "no reflected and transmitted side",
    );
    is_unfit(edf.integrated(Side::Both, &[], None, Interpolation::Smooth, 9, &mut [0.0]), "integration at level 9");
    is_unfit(edf.integrated(Side::Both, &[], None, Interpolation::Smooth, 1, &mut [0.0; 2]), "room for 2 samples");
    let normalise = Preparation { normalise: true, clamp: false };
    is_unfit(normalise.of(lambert(0.5)), "this is a brdf, expected a phase function");
    let index = |count| Axis::Index { count, labels: vec![] };
    let scan = rough_measurement(Quantity::Phase, vec![index(3), lambda(400.0, 10.0, 2)], rough);
    is_unfit(normalise.of(scan.clone()), "no outgoing axis to integrate over");
    let scan = Material::of(scan).unwrap();
    is_unfit(scan.reciprocity(), "this phase has no axes of directions to exchange");
    let brdf = Material::of(lambert(0.5)).unwrap();
    let up = angles(10.0, 10.0);
    let symmetric = |place, scratch: usize| {
        brdf.symmetric_spectrum(place, Interpolation::Smooth, Mean::Arithmetic, &mut vec![0.0; scratch], &mut [0.0; 3])
    };
    is_unfit(symmetric(place(up, up), 2), "scratch space of 2 samples, expected 3");
    is_unfit(symmetric(Place { wo: Some(up), ..Place::default() }, 3), "no wi was given");
    is_unfit(symmetric(Place { wi: Some(up), ..Place::default() }, 3), "no wo was given");
    let broken = Material::open_prepared(b"nothing", Preparation::default());
    assert!(matches!(broken, Err(EvaluateError::Decode(_))));
}
