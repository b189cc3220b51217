//! Tests that promises other than relative ones are kept, with the error computed independently here.

use super::*;
use crate::domain::colour::{ColourError, Illuminant, Lab, SpectraColours, Tristimulus, ciede2000};

/// Test measurements: positive data, data with zeros, negatives and masks, negative data, and data of a high dynamic
/// range.
fn kinds() -> Vec<Measurement> {
    let positive = measurement(Quantity::Edf, vec![mesh(Domain::Sphere, 2), wavelengths(81)], 0.01);
    let brdf = vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 2), wavelengths(73)];
    let brdf = measurement(Quantity::Brdf, brdf, 0.02);
    let table = measurement(Quantity::Reflectance, vec![index(5), wavelengths(80)], 0.01);
    let map = |m: &Measurement, f: &dyn Fn(usize, f32) -> f32| {
        let samples = m.tensor.samples().iter().enumerate().map(|(i, &s)| f(i, s)).collect();
        Measurement { tensor: Tensor::new(m.tensor.axes().to_vec(), samples).unwrap(), ..m.clone() }
    };
    let negative = map(&table, &|_, s| -s);
    let dynamic = map(&positive, &|i, s| s * libm::pow(10.0, (i % 7) as f64 - 4.0) as f32);
    let zeros = map(&brdf, &|i, s| if i % 5 == 0 { 0.0 } else { s });
    vec![
        hurt(positive.clone()),
        positive,
        hurt(brdf.clone()),
        brdf,
        zeros,
        hurt(table.clone()),
        table,
        negative,
        dynamic,
    ]
}

fn pairs<'a>(m: &'a Measurement, decoded: &'a Decoded) -> impl Iterator<Item = (f64, f64)> + 'a {
    let both = m.tensor.samples().iter().zip(decoded.measurement.tensor.samples());
    both.filter(|(s, _)| !s.is_nan()).map(|(&s, &d)| (f64::from(s), f64::from(d)))
}

fn kept(m: &Measurement, target: Target, policy: Policy) -> (Compressed, Decoded) {
    let compressed = check_file(m, &settings(target, policy));
    let decoded = decode(&compressed.bytes).unwrap();
    (compressed, decoded)
}

/// Compression policies, each with the error bounds to try: two bounds for rate–distortion coding, one for each policy
/// that drops coefficients below thresholds.
const TRIALS: [(Policy, &[f64]); 4] = [
    (Policy::Rd, &[0.002, 0.03]),
    (Policy::Conventional, &[0.03]),
    (Policy::Generic, &[0.03]),
    (Policy::Adaptive, &[0.03]),
];

#[test]
fn er_l1_is_kept() {
    for m in one_in(3, 0, kinds()) {
        for (policy, bounds) in TRIALS {
            for &bound in bounds {
                let (compressed, decoded) = kept(&m, Target::ErL1(bound), policy);
                let errors: Vec<f64> =
                    pairs(&m, &decoded).filter(|(s, _)| *s > 0.0).map(|(s, d)| (d - s).abs() / s).collect();
                let er_l1 = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
                assert!(er_l1 <= bound * (1.0 + 1e-12), "{:?} {policy}: {er_l1}", m.tensor.shape());
                assert!((compressed.summary.errors.er_l1 - er_l1).abs() <= 1e-9);
            }
        }
    }
}

#[test]
fn er_l1_of_negative_data_is_that_of_their_magnitudes() {
    let m = &kinds()[7];
    assert!(m.tensor.samples().iter().all(|s| *s < 0.0));
    let (_, decoded) = kept(m, Target::ErL1(0.01), Policy::Rd);
    let n = m.tensor.len() as f64;
    let er_l1 = pairs(m, &decoded).map(|(s, d)| ((d - s) / s).abs()).sum::<f64>() / n;
    assert!(er_l1 <= 0.01, "{er_l1}");
}

#[test]
fn the_absolute_error_of_every_sample_is_kept() {
    for m in one_in(3, 1, kinds()) {
        let (low, high) = m.tensor.range().unwrap();
        let size = f64::from(low.abs().max(high.abs()));
        for (policy, bounds) in TRIALS {
            for bound in bounds.iter().map(|bound| bound * size) {
                let (compressed, decoded) = kept(&m, Target::MaxAbsoluteError(bound), policy);
                let largest = pairs(&m, &decoded).map(|(s, d)| (d - s).abs()).fold(0.0, f64::max);
                assert!(largest <= bound, "{:?} {policy}: {largest} of {bound}", m.tensor.shape());
                assert_eq!(compressed.summary.errors.max_absolute_error, largest);
            }
        }
    }
}

#[test]
fn the_relative_rmse_is_kept() {
    for m in one_in(3, 2, kinds()) {
        for (policy, bounds) in TRIALS {
            for &bound in bounds {
                let (_, decoded) = kept(&m, Target::RelativeRmse(bound), policy);
                let sums =
                    pairs(&m, &decoded).fold((0.0, 0.0), |sums, (s, d)| (sums.0 + (d - s).powi(2), sums.1 + s * s));
                let rmse = (sums.0 / sums.1).sqrt();
                assert!(rmse <= bound * (1.0 + 1e-12), "{:?} {policy}: {rmse}", m.tensor.shape());
            }
        }
    }
}

/// Colour differences of every spectrum, computed without the library's code: masked samples are filled and white is
/// computed here.
fn differences(m: &Measurement, decoded: &Decoded, illuminant: Illuminant) -> Vec<f64> {
    let Some(Axis::Wavelength(grid)) = m.tensor.axes().last() else { panic!("no wavelengths") };
    let lit = Tristimulus::reflectance(grid, illuminant).unwrap();
    let emits = m.quantity == Quantity::Edf;
    let weights = if emits { Tristimulus::emission(grid).unwrap() } else { lit.clone() };
    let filled = |spectrum: &[f32]| -> Vec<f32> {
        let known: Vec<usize> = (0..spectrum.len()).filter(|&i| !spectrum[i].is_nan()).collect();
        let at = |i: usize| {
            let below = known.iter().rev().find(|&&k| k <= i).or(known.first()).copied().unwrap();
            let above = known.iter().find(|&&k| k >= i).or(known.last()).copied().unwrap();
            let t = if above == below { 0.0 } else { (i - below) as f32 / (above - below) as f32 };
            spectrum[below] + t * (spectrum[above] - spectrum[below])
        };
        (0..spectrum.len()).map(at).collect()
    };
    let xyz = |samples: &[f32]| -> Vec<_> {
        let factor = if m.quantity == Quantity::Brdf { std::f64::consts::PI } else { 1.0 };
        samples.chunks(grid.len()).map(|spectrum| weights.xyz(&filled(spectrum)).scaled(factor)).collect()
    };
    let original = xyz(m.tensor.samples());
    let brightest = original.iter().map(|c| c.y).fold(0.0, f64::max);
    let white = lit.white().scaled(if emits { brightest / 100.0 } else { 1.0 });
    let found = xyz(decoded.measurement.tensor.samples());
    original.iter().zip(found).map(|(a, b)| ciede2000(Lab::of(*a, white), Lab::of(b, white))).collect()
}

#[test]
fn the_colour_of_every_spectrum_is_kept() {
    let kinds = kinds().into_iter().filter(|m| m.tensor.samples().iter().any(|s| *s > 0.0));
    for m in one_in(3, 0, kinds) {
        for (at_most, illuminant) in [(0.2, Illuminant::D65), (2.0, Illuminant::A)] {
            let (compressed, decoded) = kept(&m, Target::DeltaE(DeltaE { at_most, illuminant }), Policy::Rd);
            let report = compressed.colour.unwrap();
            let differences = differences(&m, &decoded, illuminant);
            let largest = differences.iter().copied().fold(0.0, f64::max);
            let mean = differences.iter().sum::<f64>() / differences.len() as f64;
            assert!(largest <= at_most + 1e-3, "{:?} {illuminant}: {largest} of {at_most}", m.tensor.shape());
            assert!(report.largest <= at_most && (report.largest - largest).abs() < 1e-3, "{report:?} {largest}");
            assert!((report.mean - mean).abs() < 1e-3 && report.illuminant == illuminant, "{report:?} {mean}");
            assert_eq!((report.spectra, report.unscored_spectra), (differences.len() as u64, 0));
        }
    }
}

#[test]
fn a_coarser_colour_is_a_smaller_file() {
    let m = &kinds()[3];
    let size = |at_most| {
        let target = Target::DeltaE(DeltaE { at_most, illuminant: Illuminant::D65 });
        kept(m, target, Policy::Rd).0.bytes.len()
    };
    let (fine, coarse) = (size(0.1), size(3.0));
    assert!(coarse < fine, "{coarse} {fine}");
    assert_eq!(kept(m, Target::ErL2(0.01), Policy::Rd).0.colour, None);
}

#[test]
fn colours_that_cannot_be_promised_are_refused() {
    let target = Target::DeltaE(DeltaE { at_most: 1.0, illuminant: Illuminant::D65 });
    let refused = |m: &Measurement, policy, reason: &str| {
        let error = compress(m, &settings(target, policy), &Silent).unwrap_err();
        assert!(
            matches!(&error, CompressError::Setting(error) if error.to_string().contains(reason)),
            "{error:?}, not {reason}"
        );
    };
    let brdf = &kinds()[3];
    for policy in [Policy::Conventional, Policy::Generic, Policy::Adaptive] {
        refused(brdf, policy, "use policy rd");
    }
    refused(&measurement(Quantity::Edf, vec![mesh(Domain::Sphere, 3)], 0.01), Policy::Rd, "no wavelength axis");
    refused(
        &measurement(Quantity::Spectrum, vec![wavelengths(20)], 0.0),
        Policy::Rd,
        "expected at least 400 to 700 nm",
    );
    let coarse = Axis::Wavelength(WavelengthGrid::even(380.0, 40.0, 11).unwrap());
    refused(&measurement(Quantity::Spectrum, vec![coarse], 0.0), Policy::Rd, "steps of at most 20 nm");
    let masked = Tensor::new(vec![wavelengths(81)], vec![f32::NAN; 81]).unwrap();
    let masked = Measurement { tensor: masked, ..measurement(Quantity::Spectrum, vec![wavelengths(81)], 0.0) };
    refused(&masked, Policy::Rd, "no spectrum has enough measured wavelengths");
    let dark = Tensor::new(vec![wavelengths(81)], vec![0.0; 81]).unwrap();
    let dark = Measurement { tensor: dark, ..masked };
    refused(&dark, Policy::Rd, "luminance");
    assert_eq!(SpectraColours::of(&dark, Illuminant::D65).unwrap_err(), ColourError::Dark);
}

#[test]
fn impossible_bounds_are_refused() {
    let m = &kinds()[1];
    let delta_e = |at_most| Target::DeltaE(DeltaE { at_most, illuminant: Illuminant::D65 });
    for target in [
        Target::ErL1(0.0),
        Target::ErL1(11.0),
        Target::MaxAbsoluteError(0.0),
        Target::MaxAbsoluteError(f64::INFINITY),
        Target::RelativeRmse(f64::NAN),
        delta_e(0.0),
        delta_e(101.0),
    ] {
        let result = compress(m, &settings(target, Policy::Rd), &Silent);
        assert!(matches!(result, Err(CompressError::Setting(_))), "{target:?}");
    }
    for target in [Target::ErL1(1e-12), Target::MaxAbsoluteError(1e-12), Target::RelativeRmse(1e-12), delta_e(1e-9)] {
        let result = compress(m, &settings(target, Policy::Rd), &Silent);
        assert!(matches!(result, Err(CompressError::Unreachable(_))), "{target:?}: {result:?}");
    }
}

#[test]
fn a_floor_counts_for_absolute_errors() {
    let m = hurt(measurement(Quantity::Edf, vec![mesh(Domain::Sphere, 2), wavelengths(21)], 0.01));
    let (_, high) = m.tensor.range().unwrap();
    let bound = 0.3 * f64::from(high);
    let floored = Settings { floor: Some(0.2), ..settings(Target::MaxAbsoluteError(bound), Policy::Rd) };
    let compressed = check_file(&m, &floored);
    assert!(compressed.summary.errors.max_absolute_error <= bound);
    // Samples carry their own signs in their own unit: a bound far below the floor is kept, too.
    let below = Settings { floor: Some(0.2), ..settings(Target::MaxAbsoluteError(0.001 * bound), Policy::Rd) };
    assert!(check_file(&m, &below).summary.errors.max_absolute_error <= 0.001 * bound);
}

#[test]
fn the_light_of_every_direction_and_wavelength_is_kept() {
    for m in kinds() {
        let Some(triangles) = m.tensor.axes().iter().rposition(|axis| matches!(axis, Axis::Triangles(_))) else {
            continue;
        };
        let Axis::Triangles(cells) = m.tensor.axes()[triangles] else { unreachable!() };
        let inner: usize = m.tensor.axes()[triangles + 1..].iter().map(Axis::len).product();
        for bound in [0.01, 0.002] {
            let wanted = Settings { albedo_error: Some(bound), ..settings(Target::ErL2(0.05), Policy::Rd) };
            let compressed = check_file(&m, &wanted);
            let decoded = decode(&compressed.bytes).unwrap();
            let light = |samples: &[f32], block: usize, k: usize| -> f64 {
                let weight = |cell| {
                    if m.quantity.has_cosine() { cells.projected_solid_angle(cell) } else { cells.solid_angle(cell) }
                };
                let sample = |cell: usize| f64::from(samples[(block * cells.len() + cell) * inner + k]);
                (0..cells.len()).filter(|&c| !sample(c).is_nan()).map(|c| weight(c) * sample(c)).sum()
            };
            for block in 0..m.tensor.len() / (cells.len() * inner) {
                for k in 0..inner {
                    let before = light(m.tensor.samples(), block, k);
                    let after = light(decoded.measurement.tensor.samples(), block, k);
                    if before > 0.0 {
                        assert!((after / before - 1.0).abs() <= bound, "{before} {after}");
                    }
                }
            }
            let reported = compressed.light.unwrap();
            assert!(reported.largest <= bound && reported.rms <= reported.largest);
        }
    }
}

#[test]
fn light_that_nothing_corrects_is_refused() {
    let m = &kinds()[3];
    let with = |target, policy, albedo_error| Settings { albedo_error: Some(albedo_error), ..settings(target, policy) };
    let refused = |m: &Measurement, settings: Settings| {
        assert!(
            matches!(compress(m, &settings, &Silent), Err(CompressError::Setting(error)) if error.to_string().contains("albedo_error"))
        );
    };
    refused(m, with(Target::ErL2(0.01), Policy::Rd, 0.0));
    refused(m, with(Target::ErL2(0.01), Policy::Conventional, 0.01));
    refused(m, with(Target::MaxRelativeError(0.01), Policy::Rd, 0.01));
    refused(m, with(Target::Lossless, Policy::Lossless, 0.01));
    refused(&kinds()[6], with(Target::ErL2(0.01), Policy::Rd, 0.01));
}

#[test]
fn nothing_positive_decodes_below_zero_in_its_own_unit() {
    for m in kinds() {
        let negative = m.tensor.samples().iter().any(|&s| s < 0.0);
        let (_, decoded) = kept(&m, Target::RelativeRmse(0.2), Policy::Rd);
        let below = decoded.measurement.tensor.samples().iter().any(|&s| s < 0.0);
        assert!(negative || !below);
    }
}

#[test]
fn differences_keep_their_signs_at_a_small_cost() {
    let axes = vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 3), wavelengths(21)];
    let m = measurement(Quantity::Brdf, axes.clone(), 0.0);
    let mean = m.tensor.samples().iter().map(|&s| f64::from(s)).sum::<f64>() / m.tensor.len() as f64;
    let samples = m.tensor.samples().iter().map(|&s| s - mean as f32).collect();
    let m = Measurement { tensor: Tensor::new(axes, samples).unwrap(), ..m };
    let (linear, decoded) = kept(&m, Target::RelativeRmse(0.01), Policy::Rd);
    let (logarithms, _) = kept(&m, Target::ErL2(0.5), Policy::Rd);
    assert!(3 * linear.bytes.len() < logarithms.bytes.len(), "{} {}", linear.bytes.len(), logarithms.bytes.len());
    let wrong = pairs(&m, &decoded).filter(|(s, d)| s * d < 0.0 && s.abs() > 0.05 * mean).count();
    assert_eq!(wrong, 0);
}

#[test]
fn auto_stops_at_the_noise_and_is_nearer_to_the_truth() {
    let axes = vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 4), wavelengths(31)];
    let truth = measurement(Quantity::Brdf, axes.clone(), 0.0);
    let mut random = Pcg64::seed_from_u64(5);
    let noisy = truth.tensor.samples().iter().map(|&s| s * (1.0 + 0.01 * random.random_range(-1.732..1.732_f32)));
    let m = Measurement { tensor: Tensor::new(axes, noisy.collect()).unwrap(), ..truth.clone() };
    let (compressed, decoded) = kept(&m, Target::Auto, Policy::Rd);
    let to_truth = ErrorReport::measure(truth.tensor.samples(), decoded.measurement.tensor.samples(), 0.0).er_l2;
    assert!(to_truth < 0.003, "{to_truth}");
    assert!((compressed.summary.errors.er_l2 - 0.01).abs() < 0.001);
    let clean = compress(&truth, &settings(Target::Auto, Policy::Rd), &Silent);
    assert!(matches!(clean, Err(CompressError::Setting(SettingError::NoNoise))));
}

#[test]
fn a_step_is_taken_as_it_is_and_errors_fall_with_it() {
    for m in kinds() {
        let at = |step: f64| check_file(&m, &settings(Target::Step(step), Policy::Rd));
        let (fine, coarse) = (at(0.01), at(0.3));
        assert!(fine.bytes.len() > coarse.bytes.len());
        assert!(fine.summary.errors.er_l1 <= coarse.summary.errors.er_l1);
        assert!(fine.summary.errors.relative_rmse < 0.05, "{:?}", fine.summary.errors);
    }
}

#[test]
fn a_step_needs_a_quantiser_and_a_size() {
    let m = measurement(Quantity::Reflectance, vec![index(3), wavelengths(40)], 0.01);
    for (target, policy) in [
        (Target::Step(0.1), Policy::Conventional),
        (Target::Step(0.1), Policy::Lossless),
        (Target::Step(0.0), Policy::Rd),
        (Target::Step(-1.0), Policy::Rd),
        (Target::Step(f64::NAN), Policy::Rd),
        (Target::Step(65.0), Policy::Rd),
    ] {
        let refused = compress(&m, &settings(target, policy), &Silent);
        assert!(matches!(refused, Err(CompressError::Setting(_))), "{target:?}");
    }
}
