//! Tests of wanted sizes: the work they take compared with a wanted error, and the distance from the best file.

use super::*;
use crate::transform::LineBasis;

/// Test measurements: a spectrum of 40 samples, colour patches, and triangles with and without wavelengths.
fn various() -> Vec<Measurement> {
    vec![
        measurement(Quantity::Spectrum, vec![wavelengths(40)], 0.02),
        measurement(Quantity::Reflectance, vec![index(24), wavelengths(36)], 0.01),
        measurement(Quantity::Edf, vec![mesh(Domain::Sphere, 3), wavelengths(21)], 0.01),
        measurement(
            Quantity::Brdf,
            vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 3), wavelengths(17)],
            0.005,
        ),
    ]
}

fn file(m: &Measurement, target: Target, policy: Policy) -> Compressed {
    compress(m, &Settings { metadata: None, ..settings(target, policy) }, &Silent).unwrap()
}

#[test]
fn a_wanted_size_takes_at_most_four_times_the_trials_of_a_wanted_error() {
    let mut wrong = Vec::new();
    for policy in [Policy::Rd, Policy::Conventional, Policy::Generic] {
        for m in various().into_iter().filter(|m| policy != Policy::Generic || m.tensor.len() < 1000) {
            let of_error = file(&m, Target::ErL2(0.01), policy);
            let (size, kept) = (of_error.bytes.len() as u64, of_error.summary.kept_coefficients.unwrap());
            let sizes = [size, 40 + (size - 40) * 2 / 3, 3 * size].map(Target::Bytes);
            let ratios = [2.0, m.tensor.len() as f64 / kept as f64, 16.0].map(Target::Ratio);
            for target in one_in(3, 1, sizes.into_iter().chain(ratios)) {
                let of_size = file(&m, target, policy);
                let (found, limit) = (of_size.effort.samples, 4 * of_error.effort.samples);
                let label = format!("{policy} {target:?} of {:?}", m.tensor.shape());
                if found > limit || of_size.effort.trials == 0 {
                    wrong.push(format!("{label}: {:?}, of the error {:?}", of_size.effort, of_error.effort));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn files_fill_the_bytes_that_are_allowed_and_more_bytes_are_nearer() {
    for m in various() {
        let exact = file(&m, Target::Bytes(1 << 40), Policy::Rd).summary.errors.er_l2;
        assert!(exact < 2e-5, "{:?}: {exact} with any number of bytes", m.tensor.shape());
        let mut last = f64::INFINITY;
        for bytes in [80, 160, 320, 640, 1280, 2560] {
            let found = file(&m, Target::Bytes(bytes), Policy::Rd);
            let (size, error) = (found.bytes.len() as u64, found.summary.errors.er_l2);
            assert!(size <= bytes);
            // A lossless result leaves nothing to spend bytes on.
            assert!(size as f64 >= 0.97 * bytes as f64 || error < 1e-5, "{:?}: {size} of {bytes}", m.tensor.shape());
            assert!(error <= last * 1.02 || error < 1e-5, "{:?}: {error} at {bytes} after {last}", m.tensor.shape());
            last = last.min(error);
        }
    }
}

#[test]
fn the_wavelet_of_a_wanted_size_is_among_the_best_of_all() {
    let m = &various()[0];
    for target in [Target::Bytes(70), Target::Bytes(100), Target::Ratio(4.0)] {
        let chosen = file(m, target, Policy::Rd).summary.errors.er_l2;
        let named = |basis: LineBasis| {
            let settings = Settings { basis: basis.name().to_owned(), metadata: None, ..settings(target, Policy::Rd) };
            compress(m, &settings, &Silent).map_or(f64::INFINITY, |found| found.summary.errors.er_l2)
        };
        let mut all: Vec<f64> = LineBasis::distinct().map(named).collect();
        all.sort_by(f64::total_cmp);
        assert!(chosen <= 1.5 * all[0], "{target:?}: {chosen}, best {}", all[0]);
    }
}
