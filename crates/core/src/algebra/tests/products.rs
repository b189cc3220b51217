//! Products by couplings equal decode–multiply–encode, in every basis, under every boundary rule, at every length.

use super::*;
use crate::algebra::{Accumulator, Couplings, Multiplier, SparseSpectrum};
use crate::transform::Klt;
use rayon::prelude::*;

/// Checks that spectra multiplied through their coefficients in one basis give the pointwise product of their samples,
/// whatever the order of the factors.
fn check(space: &Arc<LineSpace>, name: &str) {
    let couplings = Couplings::new(space).unwrap();
    let n = space.length();
    let (f, g) = (samples(n, 1), samples(n, 2));
    let whole = [space.analyse(&f).unwrap(), space.analyse(&g).unwrap()];
    let few = [SparseSpectrum::largest(space, &f, 9).unwrap(), SparseSpectrum::largest(space, &g, 6).unwrap()];
    for [a, b] in [&whole, &few] {
        let expected: Vec<f64> = a.samples().iter().zip(b.samples()).map(|(a, b)| a * b).collect();
        let product = couplings.product(a, b).unwrap();
        let off = distance(&product.samples(), &expected);
        assert!(off < 1e-5 * largest(&expected), "{name}: {off} of {}", largest(&expected));
        let by_samples = a.product(b).unwrap();
        assert!(distance(&product.samples(), &by_samples.samples()) < 1e-5 * largest(&expected), "{name}");
        assert_eq!(product.entries(), couplings.product(b, a).unwrap().entries(), "{name}: commutes to the last bit");
    }
}

#[test]
fn products_are_exact_in_every_basis_at_every_length() {
    let own: Vec<_> = LineBasis::distinct().flat_map(|basis| LENGTHS.map(|length| (basis, length))).collect();
    own.into_par_iter().for_each(|(basis, length)| {
        check(&space(basis, basis.boundary(), length), &format!("{basis} {length}"));
    });
}

#[test]
fn products_are_exact_under_every_rule_at_the_ends() {
    let cases = LineBasis::distinct().enumerate().flat_map(|(b, basis)| {
        let rules = Boundary::ALL.iter().flat_map(move |&boundary| {
            // The long line only for every few bases.
            let lengths = [2, 5, 8, 23, 75].into_iter().filter(move |&n| n < 75 || b % 5 == boundary as usize);
            lengths.map(move |length| (boundary, length))
        });
        rules.map(move |(boundary, length)| (basis, boundary, length))
    });
    cases.collect::<Vec<_>>().into_par_iter().for_each(|(basis, boundary, length)| {
        check(&space(basis, boundary, length), &format!("{basis} {boundary} {length}"));
    });
}

#[test]
fn couplings_are_the_analysis_of_products_of_functions() {
    for name in ["haar", "db3", "bior4.4"] {
        let space = own(name, 13);
        let couplings = Couplings::new(&space).unwrap();
        let function = |k: usize| {
            let entry = crate::algebra::Entry { index: k as u32, value: 1.0 };
            SparseSpectrum::new(&space, vec![entry]).unwrap().samples()
        };
        for i in 0..13 {
            for j in 0..13 {
                let product: Vec<f64> = function(i).iter().zip(function(j)).map(|(a, b)| a * b).collect();
                let mut expected = vec![0.0; 13];
                space.analyse_into(&product, &mut expected);
                for (k, expected) in expected.iter().enumerate() {
                    assert!((couplings.at(k, i, j) - expected).abs() < 1e-13, "{name} {k}; {i}, {j}");
                }
            }
        }
    }
}

#[test]
fn products_are_bilinear() {
    for name in ["haar", "db4", "bior4.4", "rbio2.6"] {
        let space = own(name, 75);
        let couplings = Couplings::new(&space).unwrap();
        let [a, b, c] = [1, 2, 3].map(|seed| SparseSpectrum::largest(&space, &samples(75, seed), 8).unwrap());
        let left = couplings.product(&a.axpy(0.3, &b).unwrap(), &c).unwrap();
        let mut sum = Accumulator::new(&space);
        couplings.product_into(1.0, &a, &c, &mut sum).unwrap();
        couplings.product_into(0.3, &b, &c, &mut sum).unwrap();
        assert!(distance(&left.samples(), &sum.spectrum().samples()) < 1e-12 * largest(&left.samples()), "{name}");
    }
}

#[test]
fn one_is_the_neutral_factor() {
    for basis in LineBasis::distinct().step_by(7) {
        let space = space(basis, basis.boundary(), 40);
        let couplings = Couplings::new(&space).unwrap();
        let one = space.analyse(&[1.0; 40]).unwrap();
        let a = SparseSpectrum::largest(&space, &samples(40, 1), 5).unwrap();
        let product = couplings.product(&a, &one).unwrap();
        assert!(distance(&product.samples(), &a.samples()) < 1e-7 * largest(&a.samples()), "{basis}");
    }
}

/// Checks that products of two Haar basis functions have few coefficients C(k; i, j) in the basis. With a power of two
/// samples, a fine function j meets only a constant part of any coarser function i, so that only k = j is nonzero.
#[test]
fn couplings_of_haar_are_few() {
    let length = 64;
    let couplings = Couplings::new(&own("haar", length)).unwrap();
    let functions = length - 1;
    let ancestors: usize = (1..length).map(|i| 6 - i.trailing_zeros() as usize).sum();
    // The mean with itself and each function; each function with those it lies in, and its square: those again and the
    // mean (its own mean is 0 on the halves where its square is constant).
    let expected = 1 + functions + (ancestors - functions) + ancestors;
    assert_eq!(couplings.len(), expected);
    assert!(!couplings.is_empty() && couplings.bytes() < 40 * expected);
    let dense = Couplings::new(&own("db4", length)).unwrap();
    assert!(dense.len() > 20 * couplings.len(), "{}", dense.len());
}

#[test]
fn multipliers_are_products_with_one_factor() {
    for name in ["haar", "db4", "bior4.4", "bior3.1"] {
        for length in [1, 5, 75] {
            let space = own(name, length);
            let factor = samples(length, 1);
            let b = SparseSpectrum::largest(&space, &samples(length, 2), 8).unwrap();
            let expected: Vec<f64> = factor.iter().zip(b.samples()).map(|(a, b)| a * b).collect();
            let found = Multiplier::new(&space, &factor).unwrap().product(&b).unwrap();
            assert!(distance(&found.samples(), &expected) < 1e-9 * largest(&expected), "{name} {length}");
        }
    }
}

/// Checks pointwise products of spectra in the Karhunen-Loève basis of the data: exact if the basis is complete,
/// otherwise projected on the span of the basis.
#[test]
fn products_in_the_datas_own_basis() {
    let rows: Vec<f32> = (0..60).flat_map(|seed| samples(20, seed)).map(|x| x as f32).collect();
    let klt = Klt::of(&rows, 20).unwrap();
    let whole = LineSpace::orthonormal("klt", &klt.vectors).unwrap();
    assert_eq!((whole.coefficients(), whole.name()), (20, "klt[20]"));
    check(&whole, "klt");
    let few = LineSpace::orthonormal("klt", &klt.vectors[..3]).unwrap();
    let [a, b] = [1, 2].map(|seed| few.analyse(&samples(20, seed)).unwrap());
    let product = Couplings::new(&few).unwrap().product(&a, &b).unwrap();
    let exact: Vec<f64> = a.samples().iter().zip(b.samples()).map(|(a, b)| a * b).collect();
    let projected = few.analyse(&exact).unwrap();
    assert!(distance(&product.samples(), &projected.samples()) < 1e-10 * largest(&exact));
}
