//! Tests of the noise estimate: known noise on known signals is found within its tolerance, and none is reported
//! without noise.

use super::*;
use crate::domain::{Direction, Domain, Quantity, Sampling, Tensor, TriangleMesh, WavelengthGrid};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

fn mesh(domain: Domain, level: u8) -> Axis {
    Axis::Triangles(TriangleMesh::new(domain, level).unwrap())
}

fn lambda(count: usize) -> Axis {
    Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, count).unwrap())
}

fn index(count: usize) -> Axis {
    Axis::Index { count, labels: Vec::new() }
}

fn brdf_axes() -> Vec<Axis> {
    vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 4), lambda(31)]
}

/// Generator of standard normal deviates (Box & Muller 1958).
struct Normal(Pcg64);

impl Normal {
    fn next(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.0.random::<f64>())).sqrt();
        radius * libm::cos(std::f64::consts::TAU * self.0.random::<f64>())
    }
}

/// Test measurement: a signal with noise in every sample (`own`) and in every row of the last axis (`gain`).
fn measured(quantity: Quantity, axes: Vec<Axis>, signal: impl Fn(&[usize]) -> f64, own: f64, gain: f64) -> Measurement {
    let mut normal = Normal(Pcg64::seed_from_u64(11));
    let shape: Vec<usize> = axes.iter().map(Axis::len).collect();
    let count: usize = shape.iter().product();
    let mut row_gain = 1.0;
    let samples = (0..count)
        .map(|flat| {
            let mut rest = flat;
            let mut place = vec![0; shape.len()];
            for (p, n) in place.iter_mut().zip(&shape).rev() {
                *p = rest % n;
                rest /= n;
            }
            if place.last() == Some(&0) {
                row_gain = 1.0 + gain * normal.next();
            }
            (signal(&place) * row_gain * (1.0 + own * normal.next())) as f32
        })
        .collect();
    let tensor = Tensor::new(axes, samples).unwrap();
    Measurement::new(quantity, quantity.default_unit(), Sampling::Point, tensor).unwrap()
}

fn points(level: u8, domain: Domain) -> Vec<Direction> {
    let mesh = TriangleMesh::new(domain, level).unwrap();
    (0..mesh.len()).map(|i| mesh.centroid(i)).collect()
}

/// Test signal: a red diffuse surface with a GGX lobe of roughness `alpha` and a little dispersion.
fn glossy(alpha: f64) -> impl Fn(&[usize]) -> f64 {
    let (incoming, outgoing) = (points(1, Domain::Hemisphere), points(4, Domain::Hemisphere));
    move |place| {
        let (wi, wo) = (incoming[place[0]].xyz(), outgoing[place[1]].xyz());
        let h = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
        let cos2 = h[2] * h[2] / (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
        let a2 = alpha * alpha;
        let lobe = a2 / (cos2 * (a2 - 1.0) + 1.0).powi(2) / (4.0 * wi[2] * wo[2]);
        let t = place.get(2).map_or(0.5, |&l| l as f64 / 31.0);
        0.02 + 0.3 / (1.0 + (-12.0 * (t - 0.6)).exp()) + lobe * (0.04 + 0.004 * t * t)
    }
}

fn found(m: &Measurement) -> Noise {
    estimate(m, 0.0).expect("noise")
}

#[track_caller]
fn near(found: f64, sigma: f64, tolerance: f64) {
    assert!((found / sigma - 1.0).abs() <= tolerance, "found {found}, expected {sigma} within {tolerance}");
}

#[test]
fn noise_of_every_size_is_found_on_a_material() {
    for (sigma, tolerance) in [(0.0003, 0.05), (0.001, 0.05), (0.003, 0.05), (0.02, 0.05), (0.1, 0.05)] {
        let noise = found(&measured(Quantity::Brdf, brdf_axes(), glossy(0.15), sigma, 0.0));
        near(noise.relative, sigma, tolerance);
        assert!(noise.common < 0.3 * sigma, "{noise:?}");
        assert!((noise.relative - sigma).abs() < 4.0 * noise.uncertainty + 0.01 * sigma, "{noise:?}");
    }
}

#[test]
fn a_sharp_lobe_hides_no_noise_and_is_none() {
    let noise = found(&measured(Quantity::Brdf, brdf_axes(), glossy(0.1), 0.003, 0.0));
    near(noise.relative, 0.003, 0.05);
    for alpha in [0.1, 0.3] {
        let clean = estimate(&measured(Quantity::Brdf, brdf_axes(), glossy(alpha), 0.0, 0.0), 0.0);
        assert!(clean.is_none_or(|noise| noise.relative < 1e-5 && noise.common < 1e-3), "{alpha}: {clean:?}");
    }
}

#[test]
fn one_wavelength_alone_is_enough_for_what_its_lobes_leave() {
    let axes = || vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 4)];
    near(found(&measured(Quantity::Brdf, axes(), glossy(0.3), 0.02, 0.0)).relative, 0.02, 0.1);
    let clean = estimate(&measured(Quantity::Brdf, axes(), glossy(0.3), 0.0, 0.0), 0.0);
    assert!(clean.is_none_or(|noise| noise.relative < 2e-4), "{clean:?}");
}

#[test]
fn whole_spectra_that_scatter_are_told_from_samples_that_do() {
    let both = found(&measured(Quantity::Brdf, brdf_axes(), glossy(0.3), 0.003, 0.02));
    near(both.relative, 0.003, 0.05);
    near(both.common, 0.02, 0.1);
    let gains = found(&measured(Quantity::Brdf, brdf_axes(), glossy(0.3), 0.0, 0.02));
    assert!(gains.relative < 1e-4, "{gains:?}");
    near(gains.common, 0.02, 0.1);
}

#[test]
fn products_are_signal_however_spiky() {
    let directions = points(4, Domain::Sphere);
    let spiky = move |place: &[usize]| {
        let cut = (directions[place[0]].xyz()[2] + 0.3).max(0.0) * 4.0;
        cut.min(1.0) * (1.0 + ((place[1] * 2_654_435_761) % 97) as f64)
    };
    let axes = || vec![mesh(Domain::Sphere, 4), lambda(91)];
    assert_eq!(estimate(&measured(Quantity::Edf, axes(), &spiky, 0.0, 0.0), 0.0), None);
    near(found(&measured(Quantity::Edf, axes(), &spiky, 0.003, 0.0)).relative, 0.003, 0.05);
}

#[test]
fn phase_functions_without_noise_have_none() {
    let directions = points(3, Domain::Sphere);
    let forward = move |place: &[usize]| {
        let mu = directions[place[0]].dot(directions[place[1]]);
        0.2 / (1.0 + 0.5 * mu).powi(2) + 1.0 / (1.0 - 0.8 * mu).powi(2)
    };
    let axes = || vec![mesh(Domain::Sphere, 3), mesh(Domain::Sphere, 3)];
    let clean = estimate(&measured(Quantity::Phase, axes(), &forward, 0.0, 0.0), 0.0);
    assert!(clean.is_none_or(|noise| noise.relative < 1e-5), "{clean:?}");
    near(found(&measured(Quantity::Phase, axes(), &forward, 0.01, 0.0)).relative, 0.01, 0.05);
}

#[test]
fn kinks_of_interpolation_are_no_noise() {
    // Bilinear in elevation and azimuth, as luminaires are.
    let directions = points(5, Domain::Sphere);
    let table =
        |t: usize, p: usize| 2.0 + (t as f64 * 0.3).sin() + 0.5 * (p as f64 * 0.8).cos() * (t as f64 * 0.2).sin();
    let linear = move |place: &[usize]| {
        let d = directions[place[0]];
        let (t, p) = (d.theta_degrees() / 5.0, d.phi_degrees().rem_euclid(360.0) / 22.5);
        let (t0, p0) = (t as usize, p as usize);
        let (ft, fp) = (t - t0 as f64, p - p0 as f64);
        let row = |t| (1.0 - fp) * table(t, p0) + fp * table(t, (p0 + 1) % 16);
        (1.0 - ft) * row(t0) + ft * row(t0 + 1)
    };
    let clean = estimate(&measured(Quantity::Edf, vec![mesh(Domain::Sphere, 5)], linear, 0.0, 0.0), 0.0);
    assert!(clean.is_none_or(|noise| noise.relative < 0.003), "{clean:?}");
}

#[test]
fn colours_elevations_and_scans_are_measurements_too() {
    let smooth = |place: &[usize]| {
        place.iter().enumerate().fold(0.5, |value, (k, &i)| value * (1.3 + (0.02 * (k + 1) as f64 * i as f64).sin()))
    };
    let leaf = measured(Quantity::Reflectance, vec![index(11), index(41), lambda(71)], smooth, 0.01, 0.0);
    near(found(&leaf).relative, 0.01, 0.1);
    let outgoing = points(4, Domain::Hemisphere);
    let painted = move |place: &[usize]| 0.1 + (0.2 + 0.1 * place[2] as f64) * outgoing[place[1]].xyz()[2].powi(8);
    let elevations = Axis::Elevation((0..18).map(|i| f64::from(i) * 5.0).collect());
    let rgb = vec![elevations, mesh(Domain::Hemisphere, 4), Axis::Rgb];
    near(found(&measured(Quantity::Brdf, rgb, &painted, 0.05, 0.0)).relative, 0.05, 0.1);
    let coarse = vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 4), Axis::Rgb];
    near(found(&measured(Quantity::Brdf, coarse, &painted, 0.05, 0.0)).relative, 0.05, 0.1);
}

#[test]
fn zeros_masks_and_negatives_are_left_out() {
    let whole = measured(Quantity::Brdf, brdf_axes(), glossy(0.2), 0.01, 0.0);
    for (every, value) in [(29, 0.0), (23, f32::NAN), (31, -1.0), (12, 1e-9)] {
        let mut rng = Pcg64::seed_from_u64(5);
        let mut samples = whole.tensor.samples().to_vec();
        // A third of the directions is missing entirely, and scattered samples of others.
        for (i, sample) in samples.iter_mut().enumerate() {
            if (i / 31) % 1024 < 340 || rng.random_range(0..every) == 0 {
                *sample = value;
            }
        }
        let tensor = Tensor::new(whole.tensor.axes().to_vec(), samples).unwrap();
        let m = Measurement { tensor, ..whole.clone() };
        near(estimate(&m, 1e-6).unwrap().relative, 0.01, 0.1);
    }
}

#[test]
fn what_cannot_be_told_is_not_told() {
    let one = |_: &[usize]| 1.0;
    let none = [
        measured(Quantity::Spectrum, vec![lambda(75)], one, 0.01, 0.0),
        measured(Quantity::Spectrum, vec![lambda(1)], one, 0.01, 0.0),
        measured(Quantity::Brdf, vec![index(40), index(50)], one, 0.01, 0.0),
        measured(Quantity::Reflectance, vec![index(40), Axis::Rgb], one, 0.01, 0.0),
        measured(Quantity::Edf, vec![mesh(Domain::Sphere, 1)], one, 0.01, 0.0),
        measured(Quantity::Edf, vec![mesh(Domain::Sphere, 4), lambda(9)], |_| 0.0, 0.01, 0.0),
        measured(Quantity::Edf, vec![mesh(Domain::Sphere, 4), lambda(9)], |_| f64::NAN, 0.01, 0.0),
        measured(Quantity::Edf, vec![mesh(Domain::Sphere, 4), lambda(9)], one, 0.0, 0.0),
    ];
    for m in none {
        assert_eq!(estimate(&m, 0.0), None, "{:?}", m.tensor.axes());
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let m = measured(Quantity::Brdf, brdf_axes(), glossy(0.2), 0.004, 0.01);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| found(&m))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn strides_visit_everything_once() {
    for total in [1_usize, 2, 3, 4, 6, 12, 9216, 10_007] {
        let stride = scattering_stride(total);
        let mut seen = vec![false; total];
        for k in 0..total {
            assert!(!std::mem::replace(&mut seen[k * stride % total], true), "{total}");
        }
    }
}

#[test]
fn only_promises_below_the_noise_are_warned_of() {
    let noise = Noise { relative: 0.003, uncertainty: 1e-5, common: 0.0, coefficients: 1000 };
    let text = noise.warning(Target::ErL2(0.001)).unwrap().message;
    assert!(
        text.contains("er_l2 0.001 ") && text.contains("about 0.30 %:") && text.contains("er_l2 0.0032 "),
        "{text}"
    );
    assert_eq!(noise.warning(Target::ErL2(0.0031)), None);
    let text = noise.warning(Target::MaxRelativeError(0.008)).unwrap().message;
    assert!(text.contains("max_relative_error 0.015 or more"), "{text}");
    assert_eq!(noise.warning(Target::MaxRelativeError(0.01)), None);
    for target in [Target::Ratio(4.0), Target::Bytes(100), Target::Lossless] {
        assert_eq!(noise.warning(target), None);
    }
    let gains = Noise { relative: 0.0, common: 0.02, ..noise };
    assert!(gains.warning(Target::ErL2(0.01)).unwrap().message.contains("whole spectra"));
    assert_eq!(gains.warning(Target::ErL2(0.03)), None);
}

#[test]
fn two_digits_are_rounded_up() {
    for (value, up) in
        [(0.00315, 0.0032), (0.003, 0.003), (0.0123, 0.013), (12.3, 13.0), (0.0999, 0.1), (1234.0, 1300.0)]
    {
        assert_eq!(two_digits_up(value), up);
    }
}
