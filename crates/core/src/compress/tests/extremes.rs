//! Tests at the limits of float32: every file written decodes, and every refusal gives a reason.

use super::*;

/// Smallest positive float32.
const LEAST: f32 = f32::from_bits(1);

fn like(m: &Measurement, value: impl Fn(usize, f32) -> f32) -> Measurement {
    let samples = m.tensor.samples().iter().enumerate().map(|(i, &s)| value(i, s)).collect();
    Measurement { tensor: Tensor::new(m.tensor.axes().to_vec(), samples).unwrap(), ..m.clone() }
}

/// Small test measurements for every kind of coding: spectra alone, triangles alone, triangles with spectra, and a
/// spectral basis computed from the data.
fn small_shapes() -> Vec<Measurement> {
    vec![
        measurement(Quantity::Spectrum, vec![wavelengths(17)], 0.02),
        measurement(Quantity::Reflectance, vec![index(3), wavelengths(9)], 0.02),
        measurement(Quantity::Edf, vec![mesh(Domain::Sphere, 1)], 0.02),
        measurement(Quantity::Edf, vec![mesh(Domain::Sphere, 1), wavelengths(3)], 0.02),
        measurement(
            Quantity::Brdf,
            vec![mesh(Domain::Hemisphere, 0), mesh(Domain::Hemisphere, 1), wavelengths(2)],
            0.02,
        ),
    ]
}

/// Test measurements of extreme samples, with the axes of `m`, and their names.
fn extremes(m: &Measurement) -> Vec<(String, Measurement)> {
    let largest = m.tensor.range().unwrap().1;
    let mut all: Vec<(String, Measurement)> = [1e30_f32, 1e34, 1e36, 1e37, 1e38, 3.4e38]
        .into_iter()
        .map(|size| (format!("up to {size:e}"), like(m, |_, s| (s / largest) * size)))
        .collect();
    let mut add = |name: &str, value: &dyn Fn(usize, f32) -> f32| all.push((name.to_owned(), like(m, value)));
    add("the largest number alone", &|_, _| f32::MAX);
    add("the largest number and its negative", &|i, _| if i % 2 == 0 { f32::MAX } else { f32::MIN });
    add("huge and ordinary", &|i, s| if i % 7 == 3 { 3e38 } else { s });
    add("huge and tiny", &|i, _| if i % 3 == 0 { 3e38 } else { 1e-38 });
    add("38 decades up and down", &|i, s| s * libm::pow(10.0, (i * 37 % 76) as f64 - 38.0) as f32);
    add("denormal", &|i, s| (s + 0.1 * (i % 5) as f32) * 1e-42);
    add("the smallest number alone", &|_, _| LEAST);
    add("the smallest numbers", &|i, _| LEAST * (i % 3 + 1) as f32);
    add("tiny", &|_, s| s * 1e-37);
    add("zeros", &|_, _| 0.0);
    add("masked", &|_, _| f32::NAN);
    add("one in zeros", &|i, _| if i == 2 { 1e38 } else { 0.0 });
    add("one in masks", &|i, _| if i == 2 { 1e38 } else { f32::NAN });
    add("huge, negative", &|_, s| -s / largest * 3.3e38);
    add("huge with zeros and masks", &|i, s| match i % 6 {
        1 => 0.0,
        2 => f32::NAN,
        3 => -s * 1e37,
        _ => s * 3e37,
    });
    add("one masked wavelength", &|i, s| if i % 5 == 0 { f32::NAN } else { s * 1e38 });
    all
}

fn targets() -> Vec<Target> {
    vec![
        Target::ErL2(0.01),
        Target::ErL2(5.0),
        Target::ErL1(0.05),
        Target::MaxRelativeError(0.02),
        Target::MaxRelativeError(9.0),
        Target::MaxAbsoluteError(1e-3),
        Target::MaxAbsoluteError(1e37),
        Target::MaxAbsoluteError(1e300),
        Target::MaxAbsoluteError(1e-300),
        Target::RelativeRmse(0.05),
        Target::RelativeRmse(9.0),
        Target::DeltaE(DeltaE { at_most: 2.0, illuminant: crate::domain::colour::Illuminant::D65 }),
        Target::Ratio(1.0),
        Target::Ratio(4.0),
        Target::Ratio(32.0),
        Target::Ratio(1e9),
        Target::Bytes(1),
        Target::Bytes(90),
        Target::Bytes(150),
        Target::Bytes(400),
        Target::Bytes(1 << 40),
        Target::Step(1e-5),
        Target::Step(1.0),
        Target::Step(64.0),
        Target::Auto,
        Target::Lossless,
    ]
}

/// Compresses `m`, and checks that the errors stated in the file are true, or that the message suggests a remedy if
/// `settings` are refused.
fn holds(label: &str, m: &Measurement, settings: &Settings) {
    let compressed = match compress(m, settings, &Silent) {
        Ok(compressed) => compressed,
        Err(error) => {
            let text = error.to_string();
            let remedy =
                ["; ask for ", "; use ", "; give ", ", use ", "expected "].iter().any(|words| text.contains(words));
            assert!(remedy, "{label}: {text}");
            assert!(!text.contains("inf") && !text.contains("NaN"), "{label}: {text}");
            return;
        }
    };
    let decoded = decode(&compressed.bytes).unwrap_or_else(|error| panic!("{label}: {error}"));
    let (before, after) = (m.tensor.samples(), decoded.measurement.tensor.samples());
    let errors = ErrorReport::measure(before, after, compressed.summary.floor);
    assert_eq!(errors, compressed.summary.errors, "{label}");
    assert_eq!(errors.mask_mismatches, 0, "{label}");
    for level in levels(&compressed.bytes).unwrap() {
        assert!(decode_level(&compressed.bytes, level.level).is_ok(), "{label}: level {}", level.level);
    }
    match settings.target {
        Target::Bytes(most) => assert!(compressed.bytes.len() as u64 <= most, "{label}"),
        Target::Ratio(ratio) => {
            let kept = compressed.summary.kept_coefficients.unwrap() as f64;
            assert!(kept * ratio <= before.len() as f64 * (1.0 + 1e-12), "{label}: {kept}");
        }
        _ => {}
    }
}

/// Compresses every kind of extreme samples to every target, with shapes and policies in turn, and checks the files.
#[test]
fn whatever_is_written_comes_back_with_the_errors_that_are_stated() {
    let shapes: Vec<_> = small_shapes().iter().map(extremes).collect();
    let kinds = shapes[0].len();
    for (i, (kind, target)) in (0..kinds).flat_map(|kind| targets().into_iter().map(move |t| (kind, t))).enumerate() {
        let (name, m) = &shapes[i % shapes.len()][kind];
        let sized = matches!(target, Target::Ratio(_) | Target::Bytes(_));
        for (policy, basis) in [
            (Policy::Rd, ["bior4.4", "klt"][i / shapes.len() % 2]),
            ([Policy::Conventional, Policy::Generic, Policy::Adaptive][i % 3], "haar"),
        ] {
            let floor = (i % 2 == 0 && !sized).then_some(0.01);
            let label = format!("{:?} {name}: {target:?} {policy} {basis} {floor:?}", m.tensor.shape());
            holds(&label, m, &Settings { basis: basis.to_owned(), floor, ..settings(target, policy) });
        }
    }
}

/// Compresses the combinations of tensor shape, samples, target and basis that once failed when all combinations were
/// tried: the file did not decode, or the error message named no remedy.
#[test]
fn what_once_failed_does_not_fail_again() {
    let shapes = small_shapes();
    for (shape, name, target, basis) in [
        (2, "the largest number and its negative", Target::MaxAbsoluteError(1e37), "klt"),
        (2, "huge and ordinary", Target::MaxAbsoluteError(1e300), "klt"),
        (3, "up to 1e38", Target::MaxAbsoluteError(1e37), "bior4.4"),
        (3, "one masked wavelength", Target::MaxAbsoluteError(1e300), "bior4.4"),
        (4, "up to 3.4e38", Target::MaxAbsoluteError(1e300), "bior4.4"),
        (4, "huge, negative", Target::MaxAbsoluteError(1e37), "bior4.4"),
        (4, "one masked wavelength", Target::RelativeRmse(0.05), "klt"),
        (4, "one masked wavelength", Target::MaxAbsoluteError(1e-3), "klt"),
        (2, "up to 3.4e38", Target::ErL2(0.01), "klt"),
    ] {
        let (_, m) = extremes(&shapes[shape]).into_iter().find(|(known, _)| known == name).unwrap();
        let settings = Settings { basis: basis.to_owned(), ..settings(target, Policy::Rd) };
        holds(&format!("{:?} {name}: {target:?} {basis}", m.tensor.shape()), &m, &settings);
    }
}

#[test]
fn sizes_of_huge_samples_are_met_by_any_basis() {
    for shape in &small_shapes()[..1] {
        for (name, m) in
            extremes(shape).into_iter().filter(|(name, _)| name.contains("38") || name.contains("huge and"))
        {
            for target in [Target::Ratio(4.0), Target::Ratio(32.0), Target::Bytes(90), Target::Bytes(1 << 40)] {
                for policy in [Policy::Rd, Policy::Conventional] {
                    holds(&format!("{name}: {target:?} {policy}"), &m, &settings(target, policy));
                }
            }
        }
    }
}

#[test]
fn any_number_of_bytes_is_no_worse_than_few() {
    for m in small_shapes() {
        let error = |target| compress(&m, &settings(target, Policy::Rd), &Silent).unwrap().summary.errors.er_l2;
        let (few, any) = (error(Target::Bytes(150)), error(Target::Bytes(1 << 40)));
        assert!(any <= few && any < 1e-5, "{:?}: {few} {any}", m.tensor.shape());
    }
}

#[test]
fn a_size_with_negative_samples_counts_the_errors_that_its_header_states() {
    let m = like(&small_shapes()[0], |_, s| -s);
    for policy in [Policy::Rd, Policy::Generic] {
        let smallest = compress(&m, &settings(Target::Ratio(2.0), policy), &Silent).unwrap().bytes.len() as u64;
        for bytes in smallest..smallest + 12 {
            let found = compress(&m, &settings(Target::Bytes(bytes), policy), &Silent).unwrap();
            assert!(found.bytes.len() as u64 <= bytes);
        }
    }
}

#[test]
fn a_ratio_above_the_samples_keeps_nothing_and_says_so() {
    for m in small_shapes() {
        let n = m.tensor.len() as f64;
        let target = Target::Ratio(25.0 * n);
        let compressed = compress(&m, &settings(target, Policy::Rd), &Silent).unwrap();
        assert_eq!(compressed.summary.kept_coefficients, Some(0), "{:?}", m.tensor.shape());
        let said = shortfall(target, n as u64, &compressed).unwrap().message;
        assert!(said.contains("no coefficient is kept") && said.contains(&format!("ratio {n} or less")), "{said}");
    }
}

#[test]
fn large_relative_errors_are_reached_past_steps_that_keep_nothing() {
    let m = like(&small_shapes()[0], |i, s| if i % 3 == 0 { f32::NAN } else { 40.0 * s });
    for error in [0.9, 3.0, 9.0] {
        for target in [Target::ErL2(error), Target::ErL1(error)] {
            assert!(compress(&m, &settings(target, Policy::Rd), &Silent).is_ok(), "{target:?}");
        }
    }
}

#[test]
fn refusals_name_the_option_the_conflict_and_what_works() {
    let m = &small_shapes()[0];
    let klt = |target| Settings { basis: "klt".to_owned(), ..settings(target, Policy::Rd) };
    let floored = |target| Settings { floor: Some(0.9), ..settings(target, Policy::Rd) };
    let albedo = Settings { albedo_error: Some(0.01), ..settings(Target::ErL2(0.01), Policy::Rd) };
    let edge = &extremes(m).into_iter().find(|(name, _)| name == "the largest number alone").unwrap().1;
    for (m, settings, says) in [
        (m, klt(Target::ErL2(1e-9)), ["er_l2 1e-9", "basis klt", "24 spectral vectors", "or more"].as_slice()),
        (m, settings(Target::RelativeRmse(1e-12), Policy::Rd), &["relative_rmse 1e-12", "float32 samples", "or more"]),
        (m, settings(Target::ErL1(1e-60), Policy::Rd), &["er_l1 1e-60", "3.6e-43", "ask for a larger one"]),
        (m, settings(Target::MaxRelativeError(1e-9), Policy::Rd), &["max_relative_error 1e-9", "ask for 3e-5 or more"]),
        (
            m,
            settings(Target::MaxAbsoluteError(1e-12), Policy::Rd),
            &["max_absolute_error 1e-12", "samples as large as"],
        ),
        (m, settings(Target::Bytes(5), Policy::Rd), &["bytes 5", "smallest file", "or more"]),
        (m, settings(Target::Bytes(5), Policy::Conventional), &["bytes 5", "smallest file", "--no-metadata"]),
        (m, klt(Target::Ratio(10.0)), &["ratio 10", "basis klt keeps", "or less", "another basis"]),
        (m, settings(Target::Auto, Policy::Rd), &["er_l2 auto", "about a hundred samples", "er_l2 0.01"]),
        (m, settings(Target::Auto, Policy::Generic), &["er_l2 auto", "use policy rd"]),
        (m, floored(Target::ErL2(9.0)), &["floor 0.9", "below the floor of", "ask for a smaller error"]),
        (m, albedo, &["albedo_error", "no directions", "leave albedo_error out"]),
        (edge, settings(Target::Ratio(4.0), Policy::Conventional), &["policy conventional", "3.4e38", "use policy rd"]),
    ] {
        let error = compress(m, &settings, &Silent).map(|c| c.summary.errors).unwrap_err().to_string();
        assert!(says.iter().all(|words| error.contains(words)), "{error}, expected {says:?}");
    }
}

#[test]
fn an_absolute_error_above_all_samples_is_a_small_file() {
    for m in small_shapes() {
        for bound in [1e30, 1e300] {
            let compressed = compress(&m, &settings(Target::MaxAbsoluteError(bound), Policy::Rd), &Silent).unwrap();
            assert!(decode(&compressed.bytes).is_ok() && compressed.bytes.len() < 120, "{}", compressed.bytes.len());
        }
    }
}
