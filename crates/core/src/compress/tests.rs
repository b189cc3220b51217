//! Tests that promises are kept on synthetic measurements of every shape, by every policy, on the decoded bytes.

use super::*;
use crate::domain::{Axis, Domain, ErrorReport, Quantity, Sampling, Silent, Tensor, TriangleMesh, WavelengthGrid};
use crate::numeric::cases::one_in;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

mod damage;
mod extremes;
mod sizes;
mod targets;

pub(super) fn mesh(domain: Domain, level: u8) -> Axis {
    Axis::Triangles(TriangleMesh::new(domain, level).unwrap())
}

pub(super) fn wavelengths(count: usize) -> Axis {
    Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, count).unwrap())
}

pub(super) fn index(count: usize) -> Axis {
    Axis::Index { count, labels: (0..count).map(|i| format!("patch {i}")).collect() }
}

/// Test measurement: a smooth positive function of every axis, with a little seeded noise.
pub(super) fn measurement(quantity: Quantity, axes: Vec<Axis>, noise: f64) -> Measurement {
    let mut rng = Pcg64::seed_from_u64(7);
    let shape: Vec<usize> = axes.iter().map(Axis::len).collect();
    let count: usize = shape.iter().product();
    let samples = (0..count)
        .map(|flat| {
            let mut rest = flat;
            let mut value: f64 = 0.3;
            for (axis, n) in axes.iter().zip(&shape).rev() {
                let i = rest % n;
                rest /= n;
                value *= match axis {
                    Axis::Triangles(mesh) => 1.2 + mesh.centroid(i).xyz()[0] * 0.7,
                    _ => 1.0 + 0.5 * (i as f64 / *n as f64 * 3.0).sin(),
                };
            }
            (value * (1.0 + noise * (rng.random::<f64>() - 0.5))) as f32
        })
        .collect();
    let tensor = Tensor::new(axes, samples).unwrap();
    Measurement::new(quantity, quantity.default_unit(), Sampling::Average, tensor).unwrap()
}

pub(super) fn shapes() -> Vec<Measurement> {
    let elevations = Axis::Elevation((0..9).map(|i| f64::from(i) * 10.0).collect());
    vec![
        measurement(Quantity::Spectrum, vec![wavelengths(1)], 0.0),
        measurement(Quantity::Spectrum, vec![wavelengths(71)], 0.02),
        measurement(Quantity::Reflectance, vec![index(5), wavelengths(80)], 0.01),
        measurement(Quantity::Edf, vec![mesh(Domain::Sphere, 3)], 0.01),
        measurement(Quantity::Edf, vec![mesh(Domain::Sphere, 2), wavelengths(91)], 0.01),
        measurement(
            Quantity::Brdf,
            vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 2), wavelengths(13)],
            0.01,
        ),
        measurement(Quantity::Brdf, vec![elevations, mesh(Domain::Hemisphere, 2), Axis::Rgb], 0.05),
        measurement(Quantity::Btdf, vec![mesh(Domain::Hemisphere, 0), mesh(Domain::Lower, 2)], 0.01),
        measurement(Quantity::Phase, vec![mesh(Domain::Sphere, 1), mesh(Domain::Sphere, 2)], 0.0),
        measurement(Quantity::Brdf, vec![index(3), index(7), wavelengths(11)], 0.01),
    ]
}

/// Puts negative, zero and masked samples into a measurement.
pub(super) fn hurt(mut m: Measurement) -> Measurement {
    let axes = m.tensor.axes().to_vec();
    let mut samples = m.tensor.clone().into_samples();
    for (i, s) in samples.iter_mut().enumerate() {
        match i % 17 {
            3 => *s = -*s * 0.1,
            5 | 6 => *s = 0.0,
            11 => *s = f32::NAN,
            _ => {}
        }
    }
    m.tensor = Tensor::new(axes, samples).unwrap();
    m
}

pub(super) fn settings(target: Target, policy: Policy) -> Settings {
    Settings {
        straight_lines: 0,
        between: Between::default(),
        lobe: None,
        target,
        policy,
        basis: "auto".to_owned(),
        floor: None,
        albedo_error: None,
        metadata: Some("{}".to_owned()),
        random_access: false,
    }
}

/// Compresses a measurement, decodes the file, checks the reported errors against an independent computation, and
/// returns the file.
fn check_file(m: &Measurement, settings: &Settings) -> Compressed {
    let compressed = compress(m, settings, &Silent).unwrap();
    let decoded = decode(&compressed.bytes).unwrap();
    assert_eq!((decoded.measurement.quantity, decoded.measurement.unit), (m.quantity, m.unit));
    assert_eq!(decoded.measurement.tensor.axes(), m.tensor.axes());
    let bits = |m: &Measurement| m.tensor.samples().iter().map(|sample| sample.to_bits()).collect::<Vec<_>>();
    assert!(settings.policy != Policy::Rd || settings.floor.is_some() || compressed.decoded.is_some());
    let at_hand = compressed.clone().take_decoded().unwrap().measurement;
    assert_eq!((bits(&at_hand), at_hand.unit), (bits(&decoded.measurement), decoded.measurement.unit));
    let floor = compressed.summary.floor;
    let errors = ErrorReport::measure(m.tensor.samples(), decoded.measurement.tensor.samples(), floor);
    assert_eq!(errors, compressed.summary.errors);
    assert_eq!(errors.mask_mismatches, 0);
    let inspected = inspect(&compressed.bytes).unwrap();
    assert_eq!(inspected.kept_coefficients, compressed.summary.kept_coefficients);
    assert!(inspected.errors.er_l2 >= errors.er_l2 && inspected.errors.er_l2 <= errors.er_l2 * 1.000_07 + 1e-30);
    if let Target::ErL2(wanted) = settings.target {
        assert!(inspected.errors.er_l2 <= wanted, "what the file states is within the promise");
    }
    if let Target::MaxRelativeError(wanted) = settings.target {
        assert!(inspected.errors.max_relative_error <= wanted);
    }
    compressed
}

#[test]
fn er_l2_is_kept_by_every_policy_on_every_shape() {
    for (number, m) in shapes().into_iter().flat_map(|m| [m.clone(), hurt(m)]).enumerate() {
        let policies = [Policy::Rd, Policy::Conventional, Policy::Generic, Policy::Adaptive];
        for policy in one_in(2, number / 2 % 2, policies) {
            let targets: &[f64] = if policy == Policy::Rd { &[0.001, 0.01, 0.05] } else { &[0.01, 0.05] };
            for &target in targets {
                let compressed = check_file(&m, &settings(Target::ErL2(target), policy));
                let errors = compressed.summary.errors;
                assert!(errors.er_l2 <= target, "{:?} {policy} {target}: {}", m.tensor.shape(), errors.er_l2);
            }
        }
    }
}

#[test]
fn zeros_decode_to_zero_and_signs_are_kept() {
    for m in shapes().into_iter().map(hurt) {
        for target in [Target::ErL2(0.02), Target::MaxRelativeError(0.02), Target::Lossless] {
            let compressed = check_file(&m, &settings(target, Policy::Rd));
            let decoded = decode(&compressed.bytes).unwrap();
            for (s, d) in m.tensor.samples().iter().zip(decoded.measurement.tensor.samples()) {
                assert!(s.is_nan() && d.is_nan() || s.partial_cmp(&0.0) == d.partial_cmp(&0.0), "{s} {d}");
            }
        }
    }
}

#[test]
fn every_sample_keeps_a_pointwise_bound() {
    for m in shapes().into_iter().flat_map(|m| [m.clone(), hurt(m)]) {
        for bound in [1e-4, 0.01, 0.1] {
            let compressed = check_file(&m, &settings(Target::MaxRelativeError(bound), Policy::Rd));
            assert!(compressed.summary.errors.max_relative_error <= bound);
        }
        check_file(&m, &settings(Target::MaxRelativeError(0.05), Policy::Conventional));
    }
}

#[test]
fn ratios_count_coefficients_and_bytes_are_kept() {
    for (i, m) in shapes().into_iter().enumerate() {
        for policy in one_in(4, i % 4, [Policy::Rd, Policy::Conventional, Policy::Generic, Policy::Adaptive]) {
            let n = m.tensor.len() as f64;
            if policy == Policy::Adaptive && m.tensor.len() == 1 {
                let result = compress(&m, &settings(Target::Ratio(8.0), policy), &Silent);
                assert!(matches!(result, Err(CompressError::Unreachable(_))));
                continue;
            }
            let compressed = check_file(&m, &settings(Target::Ratio(8.0), policy));
            let kept = compressed.summary.kept_coefficients.unwrap() as f64;
            assert!(
                kept <= n / 8.0,
                "{policy} {:?}: {kept} of {n}, basis {}",
                m.tensor.shape(),
                compressed.summary.basis
            );
            let bytes = 400 + m.tensor.len() as u64 / 8;
            let compressed = check_file(&m, &settings(Target::Bytes(bytes), policy));
            assert!(compressed.bytes.len() as u64 <= bytes, "{} of {bytes}", compressed.bytes.len());
        }
    }
}

#[test]
fn lossless_keeps_every_bit() {
    for m in shapes().into_iter().flat_map(|m| [m.clone(), hurt(m)]) {
        let compressed = check_file(&m, &settings(Target::Lossless, Policy::Rd));
        let decoded = decode(&compressed.bytes).unwrap();
        for (s, d) in m.tensor.samples().iter().zip(decoded.measurement.tensor.samples()) {
            assert!(s.is_nan() && d.is_nan() || s.to_bits() == d.to_bits());
        }
        assert_eq!(compressed.summary.policy, Policy::Lossless);
    }
}

#[test]
fn the_floor_bounds_what_it_leaves_out() {
    let m = hurt(measurement(Quantity::Edf, vec![mesh(Domain::Sphere, 3), wavelengths(21)], 0.01));
    let floored = Settings { floor: Some(0.2), ..settings(Target::ErL2(0.01), Policy::Rd) };
    let compressed = check_file(&m, &floored);
    let errors = compressed.summary.errors;
    assert!(errors.below_floor_samples > 0 && errors.er_l2 <= 0.01);
    assert!(errors.max_absolute_error_unscored <= compressed.summary.floor);
    let plain = check_file(&m, &settings(Target::ErL2(0.01), Policy::Rd));
    assert!(compressed.bytes.len() < plain.bytes.len());
}

#[test]
fn signed_data_without_a_positive_sample_keep_their_error_too() {
    let positive = measurement(Quantity::Spectrum, vec![wavelengths(80)], 0.05);
    let samples = positive.tensor.samples().iter().map(|s| -s).collect();
    let tensor = Tensor::new(positive.tensor.axes().to_vec(), samples).unwrap();
    let m = Measurement { tensor, ..positive };
    let compressed = check_file(&m, &settings(Target::ErL2(0.01), Policy::Rd));
    assert!(compressed.summary.errors.relative_rmse <= 0.02);
}

#[test]
fn threads_and_metadata_do_not_change_the_payload() {
    let m = hurt(measurement(
        Quantity::Brdf,
        vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 3), wavelengths(13)],
        0.01,
    ));
    let with = settings(Target::ErL2(0.01), Policy::Rd);
    let without = Settings { metadata: None, ..with.clone() };
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let one = pool(1).install(|| compress(&m, &with, &Silent).unwrap().bytes);
    let two = pool(2).install(|| compress(&m, &with, &Silent).unwrap().bytes);
    assert_eq!(one, two);
    let bare = compress(&m, &without, &Silent).unwrap().bytes;
    assert_eq!(payload_digest(&one).unwrap(), blake3::hash(&bare));
}

#[test]
fn a_basis_of_the_data_is_stored_with_the_material() {
    let axes = vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 3), wavelengths(31)];
    let plain = measurement(Quantity::Brdf, axes, 0.003);
    for (m, is_hurt) in [(plain.clone(), false), (hurt(plain), true)] {
        let targets = [Target::ErL2(0.01), Target::MaxRelativeError(0.02), Target::Ratio(8.0), Target::Bytes(9_000)];
        for target in one_in(2, usize::from(is_hurt), targets) {
            let klt = Settings { basis: "klt".to_owned(), ..settings(target, Policy::Rd) };
            let compressed = check_file(&m, &klt);
            assert_eq!(compressed.summary.basis, "klt");
            let bytes = &compressed.bytes;
            for at in one_in(6, 0, (0..bytes.len()).step_by(7)) {
                let mut flipped = bytes.clone();
                flipped[at] ^= 0x10;
                assert!(decode(&flipped).is_err());
            }
        }
        let identity = Settings { basis: "identity".to_owned(), ..settings(Target::ErL2(0.01), Policy::Rd) };
        assert_eq!(check_file(&m, &identity).summary.basis, "identity");
    }
    let spectrum = measurement(Quantity::Spectrum, vec![wavelengths(40)], 0.01);
    check_file(&spectrum, &Settings { basis: "klt".to_owned(), ..settings(Target::ErL2(0.01), Policy::Rd) });
}

#[test]
fn every_basis_competes_at_a_wanted_ratio_and_the_ranking_is_the_same_on_any_threads() {
    let m = measurement(Quantity::Spectrum, vec![wavelengths(71)], 0.02);
    for policy in [Policy::Rd, Policy::Conventional] {
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| compress(&m, &settings(Target::Ratio(8.0), policy), &Silent).unwrap())
        };
        let (one, two) = (run(1), run(2));
        assert_eq!((&one.bytes, &one.ranking), (&two.bytes, &two.ranking));
        let tried = if policy == Policy::Rd { 40 } else { 90 };
        assert!(one.ranking.len() > tried, "{}", one.ranking.len());
        assert_eq!(one.ranking[0].basis, one.summary.basis);
        assert!(one.ranking.is_sorted_by(|a, b| a.er_l2 <= b.er_l2));
        let named = Settings { basis: "bior4.4".to_owned(), ..settings(Target::Ratio(8.0), policy) };
        assert!(one.summary.errors.er_l2 <= compress(&m, &named, &Silent).unwrap().summary.errors.er_l2 * 1.000_001);
    }
}

#[test]
fn labels_travel_in_the_metadata() {
    let m = measurement(Quantity::Reflectance, vec![index(5), wavelengths(80)], 0.01);
    let compressed = check_file(&m, &settings(Target::ErL2(0.01), Policy::Rd));
    let axes = inspect(&compressed.bytes).unwrap().axes;
    assert!(matches!(&axes[0], Axis::Index { labels, .. } if labels[4] == "patch 4"));
}

#[test]
fn settings_out_of_range_are_refused() {
    let m = &shapes()[1];
    let good = settings(Target::ErL2(0.01), Policy::Rd);
    for bad in [
        Settings { target: Target::ErL2(0.0), ..good.clone() },
        Settings { target: Target::ErL2(f64::NAN), ..good.clone() },
        Settings { target: Target::MaxRelativeError(-1.0), ..good.clone() },
        Settings { target: Target::Ratio(0.5), ..good.clone() },
        Settings { basis: "db99".to_owned(), ..good.clone() },
        Settings { floor: Some(1.0), ..good.clone() },
        Settings { metadata: Some("[]".to_owned()), ..good.clone() },
        Settings { metadata: Some(format!("{{\"long\":\"{}\"}}", "x".repeat(1 << 24))), ..good.clone() },
        Settings { policy: Policy::Lossless, ..good.clone() },
    ] {
        assert!(matches!(compress(m, &bad, &Silent), Err(CompressError::Setting(_))), "{bad:?}");
    }
}

#[test]
fn unreachable_targets_say_so() {
    let m = &shapes()[4];
    let unstateable = Target::ErL2(f64::MIN_POSITIVE);
    for target in [Target::Bytes(10), Target::ErL2(1e-12), Target::MaxRelativeError(1e-9), unstateable] {
        let result = compress(m, &settings(target, Policy::Rd), &Silent);
        assert!(matches!(result, Err(CompressError::Unreachable(_))), "{target:?}: {result:?}");
    }
}

struct Impatient;

impl Progress for Impatient {
    fn report(&self, _fraction: f64) {}
    fn is_cancelled(&self) -> bool {
        true
    }
}

#[test]
fn work_stops_when_asked() {
    for policy in [Policy::Rd, Policy::Conventional] {
        let result = compress(&shapes()[4], &settings(Target::ErL2(0.01), policy), &Impatient);
        assert!(matches!(result, Err(CompressError::Cancelled(_))));
    }
}

#[test]
fn every_truncation_but_in_front_of_metadata_and_every_flipped_byte_is_an_error() {
    let m = hurt(measurement(Quantity::Edf, vec![mesh(Domain::Sphere, 1), wavelengths(9)], 0.01));
    for (target, policy) in [
        (Target::ErL2(0.01), Policy::Rd),
        (Target::MaxRelativeError(0.01), Policy::Rd),
        (Target::Lossless, Policy::Rd),
        (Target::ErL2(0.05), Policy::Generic),
    ] {
        let bytes = compress(&m, &settings(target, policy), &Silent).unwrap().bytes;
        let in_front_of_metadata = compress(&m, &Settings { metadata: None, ..settings(target, policy) }, &Silent);
        let in_front_of_metadata = in_front_of_metadata.unwrap().bytes.len();
        for end in 0..bytes.len() {
            let cut = &bytes[..end];
            assert_eq!(decode(cut).is_ok(), end == in_front_of_metadata, "cut at {end}");
            assert_eq!(inspect(cut).is_ok(), end == in_front_of_metadata);
            assert_eq!(payload_digest(cut).is_ok(), end == in_front_of_metadata);
        }
        for i in 0..bytes.len() {
            let mut flipped = bytes.clone();
            flipped[i] ^= 0x55;
            assert!(decode(&flipped).is_err(), "byte {i}");
        }
    }
}
