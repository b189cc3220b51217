//! Combinations of files, by coefficients and by samples, and their refusals.

use super::*;
use crate::algebra::{AlgebraError, Combined, Method, Operand, Recompress, combine, dot};
use crate::compress::{self, Between, CompressError, Divisor, Policy, Settings, Target, decode};
use crate::domain::{
    Axis, Cancelled, Domain, Lobe, LobeCentre, LobeParameters, Measurement, Progress, Quantity, Sampling, Silent,
    Tensor, TriangleMesh, Unit, WavelengthGrid,
};

fn settings(target: Target, policy: Policy, basis: &str) -> Settings {
    Settings {
        target,
        policy,
        basis: basis.to_owned(),
        floor: None,
        albedo_error: None,
        straight_lines: 0,
        between: Between::default(),
        lobe: None,
        metadata: Some("{}".to_owned()),
        random_access: false,
    }
}

fn mesh(level: u8) -> Axis {
    Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, level).unwrap())
}

fn wavelengths(count: usize) -> Axis {
    Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, count).unwrap())
}

/// Returns a measurement with positive test values that vary along every axis; each seed gives other values.
fn measurement(quantity: Quantity, axes: Vec<Axis>, seed: u64) -> Measurement {
    let mut rng = Pcg64::seed_from_u64(seed);
    let shape: Vec<usize> = axes.iter().map(Axis::len).collect();
    let phase = rng.random::<f64>() * 6.0;
    let samples = (0..shape.iter().product())
        .map(|flat: usize| {
            let mut rest = flat;
            let mut value: f64 = 0.4;
            for (axis, n) in axes.iter().zip(&shape).rev() {
                let i = rest % n;
                rest /= n;
                value *= match axis {
                    Axis::Triangles(mesh) => 1.3 + mesh.centroid(i).xyz()[0] * (phase * 1.3).cos(),
                    _ => 1.0 + 0.5 * (i as f64 / *n as f64 * 4.0 + phase).sin(),
                };
            }
            (value * (1.0 + 0.02 * rng.random::<f64>())) as f32
        })
        .collect();
    let tensor = Tensor::new(axes, samples).unwrap();
    Measurement::new(quantity, quantity.default_unit(), Sampling::Average, tensor).unwrap()
}

fn brdf(seed: u64) -> Measurement {
    measurement(Quantity::Brdf, vec![mesh(1), mesh(2), wavelengths(13)], seed)
}

fn spectrum(seed: u64) -> Measurement {
    measurement(Quantity::Spectrum, vec![wavelengths(75)], seed)
}

/// Returns the measurement with the samples masked whose flat index satisfies `is_masked`.
fn masked(m: &Measurement, is_masked: impl Fn(usize) -> bool) -> Measurement {
    let samples = m.tensor.samples().iter().enumerate().map(|(i, &s)| if is_masked(i) { f32::NAN } else { s });
    let tensor = Tensor::new(m.tensor.axes().to_vec(), samples.collect()).unwrap();
    Measurement { tensor, ..m.clone() }
}

fn file(m: &Measurement, settings: &Settings) -> Vec<u8> {
    compress::compress(m, settings, &Silent).unwrap().bytes
}

/// Compresses a measurement in wavelet basis bior4.4 by the given policy (rule by which coefficients are kept) to a
/// relative L2 error of 5 %.
fn kept(m: &Measurement, policy: Policy) -> Vec<u8> {
    file(m, &settings(Target::ErL2(0.05), policy, "bior4.4"))
}

fn operands<'a>(files: &'a [Vec<u8>], weights: &[f64]) -> Vec<Operand<'a>> {
    files.iter().zip(weights).map(|(bytes, &weight)| Operand { bytes, weight }).collect()
}

fn combined(files: &[Vec<u8>], weights: &[f64]) -> Combined {
    let settings = settings(Target::ErL2(0.01), Policy::Rd, "auto");
    combine(&operands(files, weights), &settings, Recompress::IfNeeded, &Silent).unwrap()
}

/// Returns the largest difference between a decoded sum of materials and the exact sum, relative to the largest sum of
/// magnitudes, and the number of masked samples.
fn off(files: &[Vec<u8>], weights: &[f64], result: &[u8]) -> (f64, usize) {
    let decoded: Vec<_> = files.iter().map(|bytes| decode(bytes).unwrap().measurement.tensor).collect();
    let found = decode(result).unwrap().measurement.tensor;
    let (mut off, mut scale) = (0.0_f64, 0.0_f64);
    for (i, &found) in found.samples().iter().enumerate() {
        let terms = decoded.iter().zip(weights).map(|(tensor, w)| w * f64::from(tensor.samples()[i]));
        let exact: f64 = terms.clone().sum();
        assert_eq!(exact.is_nan(), found.is_nan(), "masked in either is masked, {i}");
        if !exact.is_nan() {
            off = off.max((exact - f64::from(found)).abs());
            scale = scale.max(terms.map(f64::abs).sum());
        }
    }
    (off / scale, found.masked())
}

#[test]
fn coefficients_are_added_exact_to_rounding() {
    let shapes: [fn(u64) -> Measurement; 5] = [
        spectrum,
        brdf,
        |seed| {
            let elevations = Axis::Elevation(vec![0.0, 20.0, 50.0, 80.0]);
            measurement(Quantity::Brdf, vec![elevations, mesh(2), Axis::Rgb], seed)
        },
        |seed| measurement(Quantity::Edf, vec![mesh(3)], seed),
        |seed| {
            let index = Axis::Index { count: 3, labels: vec![] };
            measurement(Quantity::Reflectance, vec![index, wavelengths(31)], seed)
        },
    ];
    for make in shapes {
        for policy in [Policy::Conventional, Policy::Generic, Policy::Adaptive] {
            let files: Vec<_> = (1..=3).map(|seed| kept(&make(seed), policy)).collect();
            for weights in [[1.0, 1.0, 1.0], [0.25, 2.0, -0.5]] {
                let sum = combined(&files, &weights);
                assert_eq!((sum.method, sum.reason.as_deref()), (Method::Coefficients, None));
                assert_eq!(sum.compressed.summary.policy, policy);
                let (off, masked) = off(&files, &weights, &sum.compressed.bytes);
                assert!(off < 3e-6 && masked == 0, "{policy}: {off}");
                assert!(sum.added().relative_rmse < 3e-6, "{policy}: {:?}", sum.added());
                // A union of supports: only coefficients that an operand keeps.
                let most: u64 = files.iter().map(|f| compress::inspect(f).unwrap().kept_coefficients.unwrap()).sum();
                assert!(sum.compressed.summary.kept_coefficients.unwrap() <= most);
                let inherited: f64 = sum.operands.iter().map(|o| o.weight.abs() * o.max_absolute_error).sum();
                assert_eq!(sum.inherited_absolute_error, inherited);
            }
        }
    }
}

#[test]
fn what_is_inherited_bounds_the_error_against_the_measurements() {
    let measurements = [brdf(1), brdf(2)];
    let files: Vec<_> = measurements.iter().map(|m| kept(m, Policy::Conventional)).collect();
    let sum = combined(&files, &[0.5, 0.5]);
    let found = decode(&sum.compressed.bytes).unwrap().measurement.tensor;
    let [a, b] = &measurements;
    let mean = a.tensor.samples().iter().zip(b.tensor.samples()).map(|(a, b)| 0.5 * a + 0.5 * b);
    let off = found.samples().iter().zip(mean).fold(0.0_f32, |most, (found, mean)| most.max((found - mean).abs()));
    let bound = sum.inherited_absolute_error + sum.added().max_absolute_error + 1e-6;
    assert!(f64::from(off) <= bound && off > 0.0, "{off} {bound}");
}

#[test]
fn a_difference_with_itself_is_zero_and_one_operand_is_scaled() {
    let files = vec![kept(&brdf(1), Policy::Conventional); 2];
    let sum = combined(&files, &[1.5, -1.5]);
    assert_eq!(sum.compressed.summary.kept_coefficients, Some(0));
    assert!(decode(&sum.compressed.bytes).unwrap().measurement.tensor.samples().iter().all(|&s| s == 0.0));
    let doubled = combined(&files[..1], &[2.0]);
    let [single, double] = [&files[0], &doubled.compressed.bytes].map(|f| decode(f).unwrap().measurement.tensor);
    assert!(single.samples().iter().zip(double.samples()).all(|(a, b)| 2.0 * a == *b));
}

/// Checks sums of two materials of which one has masked samples. Files store no details of a triangle with at most one
/// unmasked child, so the details that the other material has there must pass into coarser coefficients.
#[test]
fn masked_in_either_is_masked_and_the_rest_stays_exact() {
    let row = 64 * 13;
    let masks: [&dyn Fn(usize) -> bool; 4] = [
        // Scattered samples; one outgoing direction; all but one child of some nodes; whole incoming and outgoing
        // nodes.
        &|i| i % 37 == 5,
        &|i| i / 13 % 64 == 9,
        &|i| matches!(i / 13 % 64, 1..=3 | 20..=22 | 32..=46),
        &|i| i / row < 7 || (i / row == 9) || (16..32).contains(&(i / 13 % 64)),
    ];
    for policy in [Policy::Conventional, Policy::Generic] {
        for mask in masks {
            let (hurt, whole) = (kept(&masked(&brdf(1), mask), policy), kept(&brdf(2), policy));
            let count = (0..16 * row).filter(|&i| mask(i)).count();
            for files in [vec![hurt.clone(), whole.clone()], vec![whole, hurt]] {
                let sum = combined(&files, &[0.75, 1.5]);
                assert_eq!(sum.method, Method::Coefficients);
                let (off, masked) = off(&files, &[0.75, 1.5], &sum.compressed.bytes);
                assert!(off < 5e-6, "{policy}: {off}");
                assert_eq!(masked, count);
                assert_eq!(sum.added().mask_mismatches, 0);
            }
        }
    }
}

#[test]
fn logarithms_lossless_and_other_bases_are_converted_and_the_error_reported() {
    let rd = |seed| file(&brdf(seed), &settings(Target::ErL2(0.01), Policy::Rd, "auto"));
    let linear = kept(&brdf(2), Policy::Generic);
    let lossless = file(&brdf(3), &settings(Target::Lossless, Policy::Rd, "auto"));
    let haar = file(&brdf(4), &settings(Target::ErL2(0.05), Policy::Conventional, "haar"));
    for (files, expected) in [
        (vec![rd(1), rd(2)], "the file of material 1 holds no coefficients"),
        (vec![linear.clone(), rd(1)], "the file of material 2 holds no coefficients"),
        (vec![linear.clone(), lossless], "the file of material 2 holds no coefficients"),
        (vec![linear, haar], "the coefficients of material 2 are in other bases"),
    ] {
        let sum = combined(&files, &[0.3, 0.7]);
        assert_eq!(sum.method, Method::Samples);
        assert!(sum.reason.as_deref().unwrap().starts_with(expected), "{:?}", sum.reason);
        assert_eq!(sum.compressed.summary.policy, Policy::Rd);
        assert!(sum.added().er_l2 <= 0.01 && sum.added().er_l2 > 0.0);
        let (off, _) = off(&files, &[0.3, 0.7], &sum.compressed.bytes);
        assert!(off < 0.2, "{off}");
    }
}

#[test]
fn a_named_promise_compresses_again() {
    let files: Vec<_> = [1, 2].map(|seed| kept(&brdf(seed), Policy::Generic)).to_vec();
    let settings = settings(Target::Ratio(32.0), Policy::Conventional, "bior4.4");
    let sum = combine(&operands(&files, &[1.0, 1.0]), &settings, Recompress::Always, &Silent).unwrap();
    assert_eq!((sum.method, sum.compressed.summary.policy), (Method::Samples, Policy::Conventional));
    assert!(sum.compressed.summary.kept_coefficients.unwrap() <= 16 * 64 * 13 / 32);
    assert_eq!(sum.reason.as_deref(), Some("compressed again, as asked"));
}

#[test]
fn files_name_their_operands_and_are_the_same_every_time() {
    let files: Vec<_> = [1, 2].map(|seed| kept(&spectrum(seed), Policy::Conventional)).to_vec();
    let sum = combined(&files, &[1.0, 0.5]);
    assert_eq!(sum.compressed.bytes, combined(&files, &[1.0, 0.5]).compressed.bytes);
    let text = compress::inspect(&sum.compressed.bytes).unwrap().metadata.unwrap();
    let metadata: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(metadata["combination"][1]["weight"], 0.5);
    assert_eq!(metadata["combination"][0]["policy"], "conventional");
    assert_eq!(metadata["combination"][1]["payload_digest"], sum.operands[1].payload_digest.as_str());
    let bare = Settings { metadata: None, ..settings(Target::ErL2(0.01), Policy::Rd, "auto") };
    let bare = combine(&operands(&files, &[1.0, 0.5]), &bare, Recompress::IfNeeded, &Silent).unwrap();
    assert_eq!(compress::inspect(&bare.compressed.bytes).unwrap().metadata, None);
}

#[test]
fn labels_are_kept_where_one_has_them_and_refused_where_they_differ() {
    let with = |labels: &[&str], seed| {
        let labels = labels.iter().map(|&l| l.to_owned()).collect();
        let axes = vec![Axis::Index { count: 2, labels }, wavelengths(9)];
        kept(&measurement(Quantity::Reflectance, axes, seed), Policy::Conventional)
    };
    let files = vec![with(&[], 1), with(&["a", "b"], 2)];
    let sum = combined(&files, &[1.0, 1.0]);
    let expected = Axis::Index { count: 2, labels: vec!["a".to_owned(), "b".to_owned()] };
    assert_eq!(decode(&sum.compressed.bytes).unwrap().measurement.tensor.axes()[0], expected);
    let differ = refusal(&[with(&["a", "b"], 1), with(&["a", "c"], 2)], &[1.0, 1.0]);
    assert!(matches!(differ, AlgebraError::Unlike { at: 2, what: "axes", .. }), "{differ}");
}

fn refusal(files: &[Vec<u8>], weights: &[f64]) -> AlgebraError {
    let settings = settings(Target::ErL2(0.01), Policy::Rd, "auto");
    combine(&operands(files, weights), &settings, Recompress::IfNeeded, &Silent).unwrap_err()
}

#[test]
fn materials_that_do_not_add_are_refused() {
    let plain = kept(&brdf(1), Policy::Conventional);
    let unlike = |other: &Measurement| match refusal(&[plain.clone(), kept(other, Policy::Conventional)], &[1.0; 2]) {
        AlgebraError::Unlike { at: 2, what, .. } => what,
        other => panic!("{other}"),
    };
    let mut bsdf = measurement(Quantity::Btdf, brdf(1).tensor.axes().to_vec(), 1);
    assert_eq!(unlike(&bsdf), "quantity");
    bsdf = Measurement { unit: Unit::Relative, ..brdf(2) };
    assert_eq!(unlike(&bsdf), "unit");
    bsdf = Measurement { sampling: Sampling::Point, ..brdf(2) };
    assert_eq!(unlike(&bsdf), "sampling");
    assert_eq!(unlike(&measurement(Quantity::Brdf, vec![mesh(1), mesh(2), wavelengths(12)], 1)), "axes");
    assert_eq!(unlike(&measurement(Quantity::Brdf, vec![mesh(1), mesh(2)], 1)), "axes");
    assert_eq!(refusal(&[], &[]), AlgebraError::Empty);
    assert!(matches!(refusal(&[plain.clone(), vec![1, 2, 3]], &[1.0; 2]), AlgebraError::Decode { at: 2, .. }));
    let weight = refusal(std::slice::from_ref(&plain), &[f64::NAN]);
    assert!(matches!(weight, AlgebraError::NotFinite { what: "weight", index: 1, .. }));
    assert!(matches!(refusal(std::slice::from_ref(&plain), &[1e39]), AlgebraError::Overflow { .. }));
    let no_object = Settings { metadata: Some("3".to_owned()), ..settings(Target::ErL2(0.01), Policy::Rd, "auto") };
    let files = [plain];
    let refused = combine(&operands(&files, &[1.0]), &no_object, Recompress::IfNeeded, &Silent).unwrap_err();
    assert!(matches!(refused, AlgebraError::Compress(CompressError::Setting(_))));
}

struct Impatient;

impl Progress for Impatient {
    fn report(&self, _: f64) {}

    fn is_cancelled(&self) -> bool {
        true
    }
}

#[test]
fn a_combination_can_be_cancelled() {
    let files = [kept(&spectrum(1), Policy::Conventional)];
    let settings = settings(Target::ErL2(0.01), Policy::Rd, "auto");
    let refused = combine(&operands(&files, &[1.0]), &settings, Recompress::IfNeeded, &Impatient).unwrap_err();
    assert_eq!(refused, AlgebraError::Compress(CompressError::Cancelled(Cancelled)));
}

#[test]
fn dot_products_are_those_of_the_samples() {
    let scattered = |i: usize| i % 11 == 3;
    let rd = |seed| file(&brdf(seed), &settings(Target::ErL2(0.02), Policy::Rd, "auto"));
    let (a, b) = (kept(&brdf(1), Policy::Conventional), kept(&brdf(2), Policy::Generic));
    let hurt = kept(&masked(&brdf(3), scattered), Policy::Generic);
    for (a, b, method) in [
        (&a, &b, Method::Coefficients),
        (&a, &a, Method::Coefficients),
        (&a, &hurt, Method::Samples),
        (&a, &rd(2), Method::Samples),
    ] {
        let report = dot(a, b).unwrap();
        let [x, y] = [a, b].map(|bytes| decode(bytes).unwrap().measurement.tensor);
        let terms = x.samples().iter().zip(y.samples()).filter(|(x, y)| !(x.is_nan() || y.is_nan()));
        let expected: f64 = terms.clone().map(|(&x, &y)| f64::from(x) * f64::from(y)).sum();
        assert!((report.dot - expected).abs() < 1e-5 * expected.abs(), "{} {expected}", report.dot);
        assert_eq!((report.method, report.samples), (method, terms.count() as u64));
        assert_eq!(report.samples + report.masked_samples, x.len() as u64);
        assert!((dot(b, a).unwrap().dot - report.dot).abs() < 1e-5 * expected.abs());
    }
    assert_eq!(dot(&a, &b).unwrap().units, [Unit::PerSteradian; 2]);
}

#[test]
fn dot_products_take_other_quantities_on_the_same_axes() {
    let light = kept(&spectrum(1), Policy::Conventional);
    let surface = measurement(Quantity::Reflectance, vec![wavelengths(75)], 2);
    let surface = kept(&surface, Policy::Conventional);
    assert!(dot(&light, &surface).unwrap().dot > 0.0);
    let other = kept(&measurement(Quantity::Spectrum, vec![wavelengths(74)], 1), Policy::Conventional);
    assert!(matches!(dot(&light, &other), Err(AlgebraError::Unlike { at: 2, what: "axes", .. })));
    assert!(matches!(dot(&[], &light), Err(AlgebraError::Decode { at: 1, .. })));
}

#[test]
fn the_interpolation_between_incidences_is_kept_where_operands_agree() {
    let between = Between { divisor: Divisor::Masking { roughness: 0.25 }, cubic: true, retro: false };
    let stating = |seed, policy, between| {
        file(&brdf(seed), &Settings { between, ..settings(Target::ErL2(0.05), policy, "bior4.4") })
    };
    for policy in [Policy::Rd, Policy::Conventional] {
        let files = [stating(1, policy, between), stating(2, policy, between), stating(3, policy, Between::default())];
        let of = |parts: &[(usize, f64)]| {
            let operands: Vec<Operand<'_>> =
                parts.iter().map(|&(k, weight)| Operand { bytes: &files[k], weight }).collect();
            let settings = settings(Target::ErL2(0.05), policy, "bior4.4");
            let combined = combine(&operands, &settings, Recompress::IfNeeded, &Silent).unwrap();
            compress::inspect(&combined.compressed.bytes).unwrap().between
        };
        assert_eq!(of(&[(0, 0.5)]), between, "{policy}");
        assert_eq!(of(&[(0, 1.0), (1, 2.0)]), between, "{policy}");
        assert!(of(&[(0, 1.0), (2, 1.0)]).is_default() && of(&[(0, 1.0), (1, -0.1)]).is_default(), "{policy}");
    }
}

#[test]
fn a_lobe_beside_the_cells_is_refused_by_name() {
    let measurement = brdf(1);
    let parameters = LobeParameters {
        centre: LobeCentre::Mirror,
        peak: [3.0, 0.0, 0.0],
        range: [0.0, 1.0],
        widths: [0.01, 0.01],
        angle: 0.0,
        tail: 0.0,
        colours: vec![1.0; 13],
    };
    for policy in [Policy::Rd, Policy::Conventional] {
        let plain = settings(Target::ErL2(0.05), policy, "auto");
        let beside = Settings { lobe: Some(Lobe::new(parameters.clone()).unwrap()), ..plain.clone() };
        let [plain, beside] =
            [plain, beside].map(|settings| compress::compress(&measurement, &settings, &Silent).unwrap().bytes);
        let refused = dot(&plain, &beside).unwrap_err();
        assert_eq!(refused, AlgebraError::Lobe { at: 2 });
        assert!(refused.to_string().starts_with("material 2 has an analytic lobe beside its samples"));
    }
}
