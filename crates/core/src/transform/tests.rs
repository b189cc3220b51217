//! Identities of every basis, length and mesh, then golden numbers.

use super::{AxisTransform, Boundary, LineBasis, Plan, PlanError, SphereBasis, Weights};
use crate::domain::{Axis, Domain, TriangleMesh};
use std::f32::consts::FRAC_1_SQRT_2;

fn index(count: usize) -> Axis {
    Axis::Index { count, labels: vec![] }
}

fn triangles(domain: Domain, level: u8) -> Axis {
    Axis::Triangles(TriangleMesh::new(domain, level).unwrap())
}

/// Returns every axis and wavelet basis to test, with a name.
fn cases() -> Vec<(String, Axis, AxisTransform)> {
    let mut cases = vec![("identity 5".to_owned(), index(5), AxisTransform::Identity)];
    for basis in [LineBasis::HAAR, LineBasis::BIOR22, LineBasis::BIOR44] {
        for n in (1..=17).chain([31, 32, 33, 71, 75, 80, 91, 128, 2101]) {
            cases.push((format!("{basis} {n}"), index(n), AxisTransform::line(basis)));
        }
    }
    for &basis in SphereBasis::ALL {
        for &domain in Domain::ALL {
            for level in 0..=5 {
                let name = format!("{} {domain}:{level}", basis.info().name);
                cases.push((name, triangles(domain, level), AxisTransform::Sphere(basis)));
            }
        }
    }
    cases
}

/// Returns pseudo-random numbers in −1..1 that are the same in every run.
fn noise(n: usize, seed: u32) -> Vec<f32> {
    let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(12_345);
    (0..n)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 8_388_608.0 - 1.0
        })
        .collect()
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
}

type Map = fn(&Plan, &mut [f32]);

fn after(plan: Map, of: &Plan, samples: &[f32]) -> Vec<f32> {
    let mut data = samples.to_vec();
    plan(of, &mut data);
    data
}

fn largest_difference(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// Returns test transforms of one axis that lies between two untransformed axes, the last of which has 1, 3 or 40
/// entries.
fn plans() -> impl Iterator<Item = (String, Plan, usize)> {
    cases().into_iter().flat_map(|(name, axis, transform)| {
        let n = axis.len();
        let inner: &[usize] = if n > 600 { &[1] } else { &[1, 3, 40] };
        let one = inner.iter().map(move |&inner| {
            let axes = [index(2), axis.clone(), index(inner)];
            let transforms = [AxisTransform::Identity, transform, AxisTransform::Identity];
            (format!("{name} × {inner}"), Plan::new(&axes, &transforms).unwrap(), 2 * n * inner)
        });
        one.collect::<Vec<_>>()
    })
}

// Tolerances: values lie within ±1, and a pass has about 4 roundings of f32 (6e-8) in each of up to 12 levels.
#[test]
fn reconstruction_is_perfect_both_ways() {
    for (name, plan, n) in plans() {
        let samples = noise(n, 1);
        let there_and_back = after(Plan::inverse, &plan, &after(Plan::forward, &plan, &samples));
        assert!(largest_difference(&samples, &there_and_back) < 4e-6, "{name}");
        let transposed = after(Plan::forward_transposed, &plan, &after(Plan::inverse_transposed, &plan, &samples));
        assert!(largest_difference(&samples, &transposed) < 1e-5, "{name}");
    }
}

#[test]
fn transposes_are_adjoint() {
    for (name, plan, n) in plans() {
        let (u, v) = (noise(n, 2), noise(n, 3));
        let scale = dot(&u, &u);
        let pairs: [(Map, Map); 2] =
            [(Plan::forward, Plan::forward_transposed), (Plan::inverse, Plan::inverse_transposed)];
        for (map, adjoint) in pairs {
            let left = dot(&after(map, &plan, &u), &v);
            let right = dot(&u, &after(adjoint, &plan, &v));
            assert!((left - right).abs() < 2e-5 * scale, "{name}: {left} {right}");
        }
    }
}

#[test]
fn orthonormal_bases_keep_the_inner_product() {
    for (name, axis, transform) in cases() {
        let weights: Vec<f64> = match (transform, &axis) {
            (AxisTransform::Sphere(SphereBasis::Orthonormal(Weights::Area)), Axis::Triangles(mesh)) => {
                mesh.solid_angles()
            }
            (
                AxisTransform::Line { basis: LineBasis::HAAR, .. }
                | AxisTransform::Identity
                | AxisTransform::Sphere(SphereBasis::Orthonormal(Weights::Count)),
                _,
            ) => vec![1.0; axis.len()],
            _ => continue,
        };
        let plan = Plan::new(std::slice::from_ref(&axis), &[transform]).unwrap();
        let samples = noise(axis.len(), 4);
        let coefficients = after(Plan::forward, &plan, &samples);
        let energy: f64 = samples.iter().zip(&weights).map(|(&s, w)| w * f64::from(s) * f64::from(s)).sum();
        let found = dot(&coefficients, &coefficients);
        assert!((found - energy).abs() < 2e-6 * energy, "{name}: {found} {energy}");
    }
}

#[test]
fn constants_have_only_smooth_coefficients() {
    for (name, axis, transform) in cases() {
        let plan = Plan::new(std::slice::from_ref(&axis), &[transform]).unwrap();
        let coefficients = after(Plan::forward, &plan, &vec![3.0; axis.len()]);
        for (i, &level) in plan.tree(0).level.iter().enumerate() {
            let c = coefficients[i];
            if level > 0 {
                // Smooth values grow by √2 per level, and so does their rounding error.
                assert!(c.abs() < 3e-6 * (axis.len() as f32).sqrt(), "{name}: detail {i} is {c}");
            } else {
                assert!(c > 0.0, "{name}: smooth {i} is {c}");
            }
        }
    }
}

#[test]
fn polynomials_vanish_in_the_interior() {
    let n = 128;
    for (basis, degree) in [(LineBasis::HAAR, 0), (LineBasis::BIOR22, 1), (LineBasis::BIOR44, 3)] {
        assert_eq!(basis.info().vanishing_moments, degree as usize + 1);
        let plan = Plan::new(&[index(n)], &[AxisTransform::line(basis)]).unwrap();
        let finest = plan.tree(0).levels() - 1;
        for power in 0..=degree + 1 {
            let samples: Vec<f32> = (0..n).map(|i| (i as f32 / 64.0 - 1.0).powi(power)).collect();
            let coefficients = after(Plan::forward, &plan, &samples);
            let mut largest = 0.0_f32;
            for (level, margin) in [(finest, 6), (finest - 1, 18)] {
                for &i in plan.tree(0).at_level(level) {
                    if (margin..n - margin).contains(&(i as usize)) {
                        largest = largest.max(coefficients[i as usize].abs());
                    }
                }
            }
            assert_eq!(largest < 2e-6, power <= degree, "{basis}, power {power}: {largest}");
        }
    }
}

#[test]
fn norms_are_those_of_synthesised_unit_vectors() {
    for (name, axis, transform) in cases() {
        let n = axis.len();
        let areas = match &axis {
            Axis::Triangles(mesh) => mesh.solid_angles(),
            _ => vec![1.0; n],
        };
        let plan = Plan::new(&[axis], &[transform]).unwrap();
        let (count, area) = (plan.norms(0, Weights::Count), plan.norms(0, Weights::Area));
        for i in (0..n).step_by(1 + n / 300) {
            let mut unit = vec![0.0; n];
            unit[i] = 1.0;
            plan.inverse(&mut unit);
            let measured = |weights: &dyn Fn(usize) -> f64| -> f64 {
                unit.iter().enumerate().map(|(j, &x)| weights(j) * f64::from(x) * f64::from(x)).sum::<f64>().sqrt()
            };
            let (by_count, by_area) = (measured(&|_| 1.0), measured(&|j| areas[j]));
            assert!((count[i] - by_count).abs() < 3e-6 * by_count, "{name} {i}: {} {by_count}", count[i]);
            assert!((area[i] - by_area).abs() < 3e-6 * by_area, "{name} {i}: {} {by_area}", area[i]);
        }
    }
}

#[test]
fn several_axes_are_one_axis_after_another() {
    let axes = [triangles(Domain::Hemisphere, 1), triangles(Domain::Lower, 2), index(11)];
    let transforms = [
        AxisTransform::Sphere(SphereBasis::BioHaar),
        AxisTransform::Sphere(SphereBasis::Orthonormal(Weights::Area)),
        AxisTransform::line(LineBasis::BIOR44),
    ];
    let shape = [16, 64, 11];
    let samples = noise(16 * 64 * 11, 5);
    let mut by_hand = samples.clone();
    for axis in 0..3 {
        let alone = Plan::new(&axes[axis..=axis], &transforms[axis..=axis]).unwrap();
        let inner: usize = shape[axis + 1..].iter().product();
        for line in 0..samples.len() / shape[axis] {
            let at = |i: usize| line / inner * shape[axis] * inner + i * inner + line % inner;
            let mut values: Vec<f32> = (0..shape[axis]).map(|i| by_hand[at(i)]).collect();
            alone.forward(&mut values);
            for (i, value) in values.into_iter().enumerate() {
                by_hand[at(i)] = value;
            }
        }
    }
    let plan = Plan::new(&axes, &transforms).unwrap();
    assert_eq!(after(Plan::forward, &plan, &samples), by_hand);
    assert_eq!(plan.to_string(), "bio-haar[16] × orthonormal-area[64] × bior4.4[11]");
    assert_eq!((plan.axes(), plan.transform(2)), (3, AxisTransform::line(LineBasis::BIOR44)));
}

#[test]
fn threads_change_no_bit() {
    let axes = [triangles(Domain::Hemisphere, 1), triangles(Domain::Hemisphere, 3), index(75)];
    let transforms = [
        AxisTransform::Sphere(SphereBasis::Orthonormal(Weights::Count)),
        AxisTransform::Sphere(SphereBasis::BioHaar),
        AxisTransform::line(LineBasis::BIOR44),
    ];
    let samples = noise(16 * 256 * 75, 6);
    let on = |plan: &Plan, threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| after(Plan::forward, plan, &samples))
    };
    let plan = Plan::new(&axes, &transforms).unwrap();
    assert_eq!(on(&plan, 1), on(&plan, 3));
    let lines = ["db5", "dmey", "bior6.8"].map(|name| AxisTransform::line(name.parse().unwrap()));
    let plan = Plan::new(&[index(16), index(256), index(75)], &lines).unwrap();
    assert_eq!(on(&plan, 1), on(&plan, 3));
}

#[test]
fn norms_of_long_lines_are_quick_and_shift_invariant() {
    let plan = Plan::new(&[index(65_536)], &[AxisTransform::line(LineBasis::BIOR44)]).unwrap();
    let norms = plan.norms(0, Weights::Count);
    assert_eq!(norms[20_001], norms[40_001]);
    assert!((norms[1] - norms[20_001]).abs() > 1e-3);
}

fn close(found: &[f32], expected: &[f32]) {
    for (f, e) in found.iter().zip(expected) {
        assert!((f - e).abs() < 2e-5 * e.abs().max(1.0), "{found:?} {expected:?}");
    }
    assert_eq!(found.len(), expected.len());
}

fn squares(n: u32) -> Vec<f32> {
    (0..n).map(|i| ((i * i * 7) % 31) as f32 - 15.0).collect()
}

/// Checks details far from the ends against `pywt.wavedec([(i*i*7) % 31 - 15 for i in range(128)], name,
/// 'periodization', level=3)` of PyWavelets 1.9: 30..33 of the finest level, 15..18 of the next, 7..10 of the third.
#[test]
fn interior_details_are_those_of_pywavelets() {
    let golden: [(LineBasis, [f32; 9]); 3] = [
        (LineBasis::HAAR, [14.84924, -4.94975, 19.09188, 14.0, -5.0, -8.5, FRAC_1_SQRT_2, 13.78858, -6.01041]),
        (LineBasis::BIOR22, [4.94975, 4.94975, 15.9099, 24.125, -3.0, -1.0625, -7.03792, 13.85487, -0.18783]),
        (LineBasis::BIOR44, [3.47937, 3.47937, 19.70231, 21.29434, -4.17369, -0.09788, -4.03532, 7.32401, -2.34281]),
    ];
    for (basis, expected) in golden {
        let plan = Plan::new(&[index(128)], &[AxisTransform::line(basis)]).unwrap();
        let coefficients = after(Plan::forward, &plan, &squares(128));
        let tree = plan.tree(0);
        let at = |level: usize, j: usize| coefficients[tree.at_level(level)[j] as usize];
        let found: Vec<f32> = [(7, 30), (6, 15), (5, 7)]
            .iter()
            .flat_map(|&(l, j)| (j..j + 3).map(move |j| (l, j)))
            .map(|(l, j)| at(l, j))
            .collect();
        close(&found, &expected);
    }
}

/// Checks the bior2.2 and bior4.4 wavelet coefficients of 11 samples, `(i*i*7) % 31 - 15` for i = 0 to 10, against
/// lifting in NumPy in f64.
///
/// Lifting mirrors the samples at both ends, for example with `np.concatenate([s[1:], s[-1:]])`, on every level until
/// one smooth coefficient is left.
#[test]
fn an_odd_length_is_mirrored_at_both_ends() {
    let golden: [(LineBasis, [f32; 11]); 2] = [
        (
            LineBasis::BIOR22,
            [-12.84375, 4.94975, -14.625, 15.9099, -14.73876, -6.01041, 8.625, 4.94975, -11.0625, 4.94975, -4.0],
        ),
        (
            LineBasis::BIOR44,
            [-13.04272, 3.47937, -11.90189, 19.70231, -8.71708, -8.74215, 8.00632, 4.74074, -2.8788, 5.56847, -5.21517],
        ),
    ];
    for (basis, expected) in golden {
        let plan = Plan::new(&[index(11)], &[AxisTransform::line(basis)]).unwrap();
        close(&after(Plan::forward, &plan, &squares(11)), &expected);
    }
}

#[test]
fn fewer_levels_leave_the_coarser_ones_as_they_were() {
    let transform = AxisTransform::line("bior2.4".parse().unwrap());
    let samples = noise(75, 7);
    let full = after(Plan::forward, &Plan::new(&[index(75)], &[transform]).unwrap(), &samples);
    let plan = Plan::with_levels(&[index(75)], &[transform], &[Some(2)]).unwrap();
    let two = after(Plan::forward, &plan, &samples);
    assert_eq!(plan.tree(0).levels(), 3);
    for (i, (full, two)) in full.iter().zip(&two).enumerate() {
        assert!(i % 4 == 0 || full == two);
    }
    assert!(largest_difference(&after(Plan::inverse, &plan, &two), &samples) < 2e-6);
    let none = Plan::with_levels(&[index(75)], &[transform], &[Some(0)]).unwrap();
    assert_eq!(after(Plan::forward, &none, &samples), samples);
}

#[test]
fn plans_name_a_boundary_rule_that_is_not_the_basis_own() {
    let basis: LineBasis = "db4".parse().unwrap();
    let periodic = AxisTransform::Line { basis, boundary: Boundary::Periodic };
    let plan = Plan::new(&[index(8), index(9)], &[AxisTransform::line(basis), periodic]).unwrap();
    assert_eq!(plan.to_string(), "db4[8] × db4 periodic[9]");
}

/// Checks coefficients on the hemisphere at level 2 against NumPy in f64, for the values `(i*i*7) % 31 - 15`. Bio-Haar:
/// p = Σw·c/Σw and c − p for the children c of each parent. Haar: y − 2v(v·y)/(v·v) with v = √(w/Σw) − e₀ on y = √w·c
/// (area) or c (count). The lists hold the smooth coefficients of the four octants, the details of octant 0, then those
/// of its children 0 and 1.
#[test]
fn sphere_coefficients_are_those_of_the_formulas() {
    let golden: [(SphereBasis, [f32; 13]); 3] = [
        (
            SphereBasis::BioHaar,
            [
                -3.066_268, -3.891_667, -1.219_138, -4.656_148, -1.026_515, 0.673_079, 2.049_934, -1.961_752,
                19.038_248, -7.961_752, 9.092_783, -6.907_217, -8.907_217,
            ],
        ),
        (
            SphereBasis::Orthonormal(Weights::Area),
            [
                -3.842_997, -4.877_481, -1.527_963, -5.835_616, -2.105_051, -1.114_263, -0.396_896, -2.996_409,
                3.103_992, -4.947_749, 4.817_828, 0.328_608, -0.263_478,
            ],
        ),
        (
            SphereBasis::Orthonormal(Weights::Count),
            [-13.5, -13.5, -7.25, -18.0, -6.0, -3.0, -1.5, -11.0, 10.0, -17.0, 16.5, 0.5, -1.5],
        ),
    ];
    for (basis, expected) in golden {
        let plan = Plan::new(&[triangles(Domain::Hemisphere, 2)], &[AxisTransform::Sphere(basis)]).unwrap();
        let c = after(Plan::forward, &plan, &squares(64));
        let found = [0, 16, 32, 48, 4, 8, 12, 1, 2, 3, 5, 6, 7].map(|i| c[i]);
        close(&found, &expected);
    }
    let plan = Plan::new(&[triangles(Domain::Hemisphere, 2)], &[AxisTransform::Sphere(SphereBasis::BioHaar)]).unwrap();
    let norms = plan.norms(0, Weights::Area);
    close(&[0, 4, 1, 5, 7].map(|i| norms[i] as f32), &[1.253_314, 0.824_423, 0.417_644, 0.391_431, 0.438_414]);
}

#[test]
fn refusals_name_their_reason() {
    let line = AxisTransform::line(LineBasis::HAAR);
    let sphere = AxisTransform::Sphere(SphereBasis::BioHaar);
    assert_eq!(Plan::new(&[index(3)], &[]), Err(PlanError::Count { axes: 1, transforms: 0 }));
    assert_eq!(Plan::new(&[index(3), index(0)], &[line, line]), Err(PlanError::Empty { axis: 1 }));
    assert!(matches!(Plan::new(&[Axis::Rgb], &[sphere]), Err(PlanError::Unfit { axis: 0, transform: "bio-haar", .. })));
    let three = [Some(3)];
    let error = Plan::with_levels(&[triangles(Domain::Sphere, 3)], &[sphere], &three).unwrap_err();
    assert!(matches!(error, PlanError::Unfit { axis: 0, expected: "all levels on triangles", .. }));
    assert_eq!(Plan::with_levels(&[index(3)], &[line], &[]), Err(PlanError::Count { axes: 1, transforms: 0 }));
    let error = Plan::new(&[triangles(Domain::Sphere, 0)], &[line]).unwrap_err();
    assert!(error.to_string().starts_with("axis 0: transform `haar` on sphere:0 (8 triangles), expected wavelengths"));
}
