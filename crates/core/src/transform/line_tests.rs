//! Every basis on a line: identities of its filters, then every basis × boundary rule × length.

use super::banded::{Banded, Window};
use super::filters::{Filters, PERFECT, Taps};
use super::line::LinePlan;
use super::rows::{Pass, for_rows};
use super::{AxisTransform, Boundary, LineBasis, Plan, lines};
use crate::domain::Axis;
use crate::numeric::cases::one_in;
use rayon::prelude::*;

/// Returns the tolerance that the number of published digits of a filter table allows.
fn tolerance(basis: LineBasis) -> f64 {
    match basis.name() {
        "brislawn10.10" => 5e-8,
        "adelson9" => 2e-8,
        "vaidyanathan24" => 1e-8,
        "sym20" => 2e-11,
        _ => 1e-11,
    }
}

/// Returns |Σ (−1)^k · (2k / length)^power · h[k]| for a synthesis low-pass filter h of `length` taps. It is 0 if the
/// analysis wavelet has a vanishing moment of order `power`.
fn moment(low: &Taps, power: i32) -> f64 {
    let half = low.weights.len() as f64 / 2.0;
    let term = |(k, w): (i64, f64)| if k % 2 == 0 { w } else { -w } * (k as f64 / half).powi(power);
    low.iter().map(term).sum::<f64>().abs()
}

#[test]
fn filters_reconstruct_as_far_as_they_claim() {
    for basis in LineBasis::all() {
        let (bank, info) = (basis.bank(), basis.info());
        let nearly = ["dmey", "adelson9", "battle-lemarie1", "battle-lemarie3", "battle-lemarie5"];
        if nearly.contains(&info.name) {
            assert!((1e-5..3e-3).contains(&bank.error), "{basis}: {}", bank.error);
            assert!(!info.orthogonal && info.symmetric, "{basis}");
        } else {
            assert!(bank.error < tolerance(basis), "{basis}: {}", bank.error);
        }
        for (a, analysis) in bank.analysis.iter().enumerate() {
            for (s, synthesis) in bank.synthesis.iter().enumerate() {
                for m in -100..=100 {
                    let product: f64 = analysis.iter().map(|(k, w)| w * synthesis.at(k + 2 * m)).sum();
                    let expected = if a == s && m == 0 { 1.0 } else { 0.0 };
                    assert!((product - expected).abs() <= bank.error + 1e-14, "{basis} {a} {s} {m}: {product}");
                }
            }
        }
    }
}

#[test]
fn low_pass_filters_grow_a_constant_by_the_root_of_two() {
    for basis in LineBasis::all() {
        for low in [&basis.bank().analysis[0], &basis.bank().synthesis[0]] {
            let gain: f64 = low.weights.iter().sum();
            assert!((gain - 2.0_f64.sqrt()).abs() < tolerance(basis), "{basis}: {gain}");
        }
    }
}

// Two-sided check: the claimed moments vanish to the digits of the table, and the next one does not. It must be at
// least twenty times as large as the last vanishing one (moments decrease with the order, to 1e-20 for coif17).
#[test]
fn as_many_moments_vanish_as_claimed() {
    for basis in LineBasis::all() {
        let low = &basis.bank().synthesis[0];
        let claimed = basis.info().vanishing_moments as i32;
        let mut last = 1e-30_f64;
        for power in 0..claimed {
            let found = moment(low, power);
            assert!(found < tolerance(basis), "{basis} moment {power}: {found}");
            last = if power >= claimed - 3 { last.max(found) } else { last };
        }
        // One more moment can vanish by symmetry about this origin, which is not the centre of the wavelet.
        let next = moment(low, claimed).max(moment(low, claimed + 1));
        assert!(next > 20.0 * last, "{basis} moment {claimed}: {next} after {last}");
    }
}

#[test]
fn symmetry_and_lengths_are_those_of_the_families() {
    let of = |name: &str| name.parse::<LineBasis>().unwrap().info();
    for (name, lengths, symmetric, orthogonal) in [
        ("db4", (8, 8), false, true),
        ("sym5", (10, 10), false, true),
        ("coif2", (12, 12), false, true),
        ("bior1.3", (6, 2), true, false),
        ("rbio4.4", (7, 9), true, false),
        ("villasenor18.10", (10, 18), true, false),
        ("villasenor2.6", (2, 6), true, false),
        ("brislawn10.10", (10, 10), true, false),
        ("battle-lemarie3", (41, 41), true, false),
    ] {
        let info = of(name);
        assert_eq!((info.analysis_length, info.synthesis_length), lengths, "{name}");
        assert_eq!((info.symmetric, info.orthogonal), (symmetric, orthogonal), "{name}");
    }
}

#[test]
fn a_new_basis_needs_its_table_only() {
    static TABLE: [f64; 2] = [std::f64::consts::FRAC_1_SQRT_2; 2];
    let bank = super::filters::Bank::new(Filters::Orthogonal(&TABLE));
    assert!(bank.error < PERFECT && bank.orthogonal);
    assert_eq!(bank.symmetry, Some(Boundary::HalfSample));
}

const LENGTHS: [usize; 26] =
    [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 31, 32, 33, 71, 75, 80, 91, 128, 2101];

fn distinct() -> Vec<LineBasis> {
    LineBasis::distinct().collect()
}

/// Checks all identities of the wavelet transform of one basis, boundary rule and length.
fn check(basis: LineBasis, boundary: Boundary, n: usize) {
    let plan = LinePlan::new(n, basis, boundary, u32::MAX);
    let name = format!("{basis} {boundary} {n}");
    plan.check_levels(&name);
    // Compares passes in f32 with each other; ill-conditioned splines (3.x with short duals) lose digits with each
    // level.
    let lanes = 3;
    let pass = |data: &[f32], pass: Pass| {
        let mut data = data.to_vec();
        for_rows(&mut data, n, lanes, |rows| plan.transform(rows, pass));
        data
    };
    let noise = |seed: u32| -> Vec<f32> {
        let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(12_345);
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 8_388_608.0 - 1.0
        };
        (0..n * lanes).map(|_| next()).collect()
    };
    let (u, v) = (noise(1), noise(2));
    let largest = |a: &[f32]| a.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    let coefficients = pass(&u, Pass::Forward);
    let back = pass(&coefficients, Pass::Inverse);
    let difference = u.iter().zip(&back).fold(0.0_f32, |m, (a, b)| m.max((a - b).abs()));
    assert!(difference < 1e-5 * largest(&coefficients).max(1.0) * plan.growth(), "{name}: {difference}");
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum::<f64>();
    for (there, transposed) in [(Pass::Forward, Pass::ForwardTransposed), (Pass::Inverse, Pass::InverseTransposed)] {
        let (image, dual) = (pass(&u, there), pass(&v, transposed));
        let (left, right) = (dot(&image, &v), dot(&u, &dual));
        let scale = dot(&image, &image).sqrt() * dot(&v, &v).sqrt() + dot(&u, &u).sqrt() * dot(&dual, &dual).sqrt();
        assert!((left - right).abs() < 1e-5 * scale.max(1.0), "{name}: {left} {right}");
    }
    if basis.info().orthogonal && boundary == basis.boundary() {
        let (before, after) = (dot(&u, &u), dot(&coefficients, &coefficients));
        assert!((before - after).abs() < 1e-5 * before, "{name}: {before} {after}");
    }
}

impl LinePlan {
    /// Checks in f64 that analysis and synthesis matrices of each level are inverse to each other.
    fn check_levels(&self, name: &str) {
        for (k, level) in self.levels().iter().enumerate() {
            let n = level.analysis.len();
            let places: Vec<usize> =
                if n > 300 { (0..100).chain(n / 2..n / 2 + 4).chain(n - 100..n).collect() } else { (0..n).collect() };
            let size = |matrix: &Banded, row: usize| Window::unit(row).through(matrix, |j| j).0;
            for &m in &places {
                // The analysis of synthesis function m is the unit vector e_m.
                let function = size(&level.synthesis_transposed, m);
                let (image, _) = function.through(&level.analysis_transposed, |j| j);
                let rest = image.plus(-1.0, &Window::unit(m));
                let scale = function.largest().max(1.0);
                assert!(rest.largest() < 1e-9 * scale, "{name}, level {k} of {n}, {m}: {}", rest.largest());
            }
        }
    }

    /// Returns the largest L2 norm of a synthesis function, at least 1.
    fn growth(&self) -> f32 {
        self.norms().into_iter().fold(1.0, f64::max) as f32
    }
}

#[test]
fn every_basis_rule_and_length_is_inverted_exactly() {
    let cases: Vec<_> = distinct()
        .into_iter()
        .enumerate()
        .flat_map(|(b, basis)| {
            Boundary::ALL.iter().flat_map(move |&boundary| {
                // The long length only for some pairs of basis and rule, each basis and each rule among them.
                let lengths = LENGTHS
                    .into_iter()
                    .filter(move |&n| n < 2101 || boundary == basis.boundary() || b % 20 == boundary as usize);
                lengths.map(move |n| (basis, boundary, n))
            })
        })
        .collect();
    let cases: Vec<_> = one_in(3, 0, cases).collect();
    cases.into_par_iter().for_each(|(basis, boundary, n)| check(basis, boundary, n));
}

/// Checks that details of constants vanish at any length, for a basis with a vanishing moment under its default rule.
/// With special filters at the ends, details of all preserved polynomials vanish.
#[test]
fn kept_polynomials_have_no_details() {
    for basis in distinct() {
        let moments = basis.info().vanishing_moments;
        for n in [2, 5, 16, 33, 75, 128] {
            for boundary in [basis.boundary(), Boundary::Fitted] {
                let plan = LinePlan::new(n, basis, boundary, u32::MAX);
                let degrees = if boundary == Boundary::Fitted { moments.min(4) } else { moments.min(1) };
                for degree in 0..degrees {
                    let t = |i: usize| (2 * i + 1) as f64 / n as f64 - 1.0;
                    for i in 1..n {
                        let row = plan.analysis_row(i);
                        let detail: f64 = row.iter().map(|(j, w)| w * t(j).powi(degree as i32)).sum();
                        let size: f64 = row.iter().map(|(_, w)| w.abs()).sum();
                        // A level preserves at most as many polynomials as it has smooth coefficients.
                        let kept = n.div_ceil(2 << i.trailing_zeros());
                        let vanishes = detail.abs() < 1e-7 * size.max(1.0);
                        assert!(vanishes || degree >= kept, "{basis} {boundary} {n}, degree {degree}, {i}: {detail}");
                    }
                }
            }
        }
    }
}

#[test]
fn synthesis_rows_are_transposed_footprints() {
    for basis in distinct().into_iter().step_by(3) {
        for n in [1, 7, 40, 75] {
            let plan = LinePlan::new(n, basis, basis.boundary(), u32::MAX);
            let footprints: Vec<Window> = (0..n).map(|i| plan.footprint(i).0).collect();
            for sample in 0..n {
                let expected = footprints.iter().map(|footprint| {
                    let at = sample.checked_sub(footprint.first);
                    at.and_then(|k| footprint.values.get(k)).copied().unwrap_or(0.0)
                });
                let mut row = vec![0.0; n];
                for (i, w) in plan.synthesis_row(sample) {
                    row[i as usize] = w;
                }
                for (found, expected) in row.iter().zip(expected) {
                    assert!((found - expected).abs() < 1e-11 * expected.abs().max(1.0), "{basis} {n} {sample}");
                }
            }
        }
    }
}

#[test]
fn lifting_is_its_filters() {
    for basis in LineBasis::all().filter(|basis| !matches!(basis.line().scheme, lines::Scheme::Filters)) {
        for n in LENGTHS.into_iter().filter(|&n| n < 200) {
            let plan = LinePlan::new(n, basis, basis.boundary(), u32::MAX);
            for i in 0..n {
                let mut unit = vec![0.0; n];
                unit[i] = 1.0;
                for_rows(&mut unit, n, 1, |rows| plan.transform(rows, Pass::Inverse));
                let (footprint, _) = plan.footprint(i);
                for (j, &found) in unit.iter().enumerate() {
                    let expected = j.checked_sub(footprint.first).and_then(|k| footprint.values.get(k)).copied();
                    assert!((f64::from(found) - expected.unwrap_or(0.0)).abs() < 3e-6, "{basis} {n}: {i} at {j}");
                }
            }
        }
    }
}

/// Returns reference coefficients computed by PyWavelets, see `tests/golden/pywavelets.py`.
fn golden() -> serde_json::Value {
    serde_json::from_str(include_str!("../../../../tests/golden/pywavelets.json")).unwrap()
}

/// Returns the test samples `(i*i*7) % 31 - 15` for i = 0, 1, 2, ….
fn squares(n: u32) -> Vec<f32> {
    (0..n).map(|i| ((i * i * 7) % 31) as f32 - 15.0).collect()
}

/// Returns the coefficient indices of an axis with `levels` wavelet levels in the order of PyWavelets: smooth ones,
/// then details from coarse to fine.
fn listed(n: usize, levels: u32) -> Vec<usize> {
    let smooth = (0..n).step_by(1 << levels);
    let details = (0..levels).rev().flat_map(|height| (1 << height..n).step_by(2 << height));
    smooth.chain(details).collect()
}

#[test]
fn periodic_coefficients_are_those_of_pywavelets() {
    let golden = golden();
    let names = golden["periodic"].as_object().unwrap();
    assert_eq!(names.len(), 106);
    for (name, expected) in names {
        let basis: LineBasis = name.parse().unwrap();
        let plan = LinePlan::new(96, basis, Boundary::Periodic, 5);
        let samples = squares(96);
        let mut found = samples.clone();
        for_rows(&mut found, 96, 1, |rows| plan.transform(rows, Pass::Forward));
        let expected: Vec<f64> = expected.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
        let largest = expected.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        for (&i, &expected) in listed(96, 5).iter().zip(&expected) {
            let exact: f64 = plan.analysis_row(i).iter().map(|(j, w)| w * f64::from(samples[j])).sum();
            assert!((exact - expected).abs() < 1e-9 * largest, "{name} {i}: {exact} {expected}");
            let found = f64::from(found[i]);
            assert!((found - expected).abs() < 1e-6 * largest, "{name} {i}: {found} {expected}");
        }
    }
}

#[test]
fn inner_coefficients_of_any_rule_are_those_of_pywavelets() {
    let golden = golden();
    for (name, expected) in golden["inner"].as_object().unwrap() {
        let basis: LineBasis = name.parse().unwrap();
        for boundary in [basis.boundary(), Boundary::Periodic, Boundary::Zero] {
            let plan = LinePlan::new(1021, basis, boundary, 3);
            let samples = squares(1021);
            let mut found = samples.clone();
            for_rows(&mut found, 1021, 1, |rows| plan.transform(rows, Pass::Forward));
            let expected = expected.as_array().unwrap();
            assert!(expected.len() >= 7, "{name}");
            for entry in expected {
                let height = entry[0].as_u64().unwrap() as usize - 1;
                let index = (2 * entry[1].as_u64().unwrap() as usize + 1) << height;
                let expected = entry[2].as_f64().unwrap();
                let row = plan.analysis_row(index);
                let exact: f64 = row.iter().map(|(j, w)| w * f64::from(samples[j])).sum();
                let scale = 15.0 * row.iter().map(|(_, w)| w.abs()).sum::<f64>();
                assert!((exact - expected).abs() < 1e-9 * scale, "{name} {boundary} {entry}: {exact}");
                assert!((f64::from(found[index]) - expected).abs() < 1e-6 * scale, "{name} {boundary} {entry}");
            }
        }
    }
}

#[test]
fn the_standard_decomposition_is_that_of_pywavelets() {
    let golden = &golden()["standard"];
    let numbers =
        |key: &str| -> Vec<u64> { golden[key].as_array().unwrap().iter().map(|x| x.as_u64().unwrap()).collect() };
    let (shape, levels) = (numbers("shape"), numbers("levels"));
    let axes: Vec<Axis> = shape.iter().map(|&n| Axis::Index { count: n as usize, labels: vec![] }).collect();
    let basis = |name: &serde_json::Value| name.as_str().unwrap().parse().unwrap();
    let transforms: Vec<_> = golden["bases"].as_array().unwrap().iter().map(basis).collect();
    let transforms: Vec<_> =
        transforms.into_iter().map(|basis| AxisTransform::Line { basis, boundary: Boundary::Periodic }).collect();
    let limits: Vec<_> = levels.iter().map(|&l| Some(l as u8)).collect();
    let plan = Plan::with_levels(&axes, &transforms, &limits).unwrap();
    let mut found = squares(16 * 12 * 24);
    plan.forward(&mut found);
    let places: Vec<Vec<usize>> = shape.iter().zip(&levels).map(|(&n, &l)| listed(n as usize, l as u32)).collect();
    let expected: Vec<f64> = golden["coefficients"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
    let largest = expected.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let mut expected = expected.into_iter();
    for &i in &places[0] {
        for &j in &places[1] {
            for &k in &places[2] {
                let (found, expected) = (f64::from(found[(i * 12 + j) * 24 + k]), expected.next().unwrap());
                assert!((found - expected).abs() < 1e-6 * largest, "{i} {j} {k}: {found} {expected}");
            }
        }
    }
}
