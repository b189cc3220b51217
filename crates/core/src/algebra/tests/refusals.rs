//! Every error of spectra, by its variant.

use super::*;
use crate::algebra::{
    Accumulator, AlgebraError, Couplings, Entry, Functional, Gram, MAX_COUPLED, MAX_GRAM, MAX_LINE, Multiplier,
    SparseSpectrum, SpectrumPool,
};
use crate::transform::SphereBasis;

fn identity(length: usize) -> Arc<LineSpace> {
    LineSpace::new(AxisTransform::Identity, length).unwrap()
}

#[test]
fn lines_that_are_none() {
    let line = |transform, length| LineSpace::new(transform, length).unwrap_err();
    assert!(matches!(line(AxisTransform::Identity, 0), AlgebraError::Basis { length: 0, .. }));
    let sphere = AxisTransform::Sphere(SphereBasis::BioHaar);
    assert!(matches!(line(sphere, 8), AlgebraError::Basis { length: 8, .. }));
    let long = line(AxisTransform::Identity, MAX_LINE + 1);
    assert_eq!(long, AlgebraError::TooLong { what: "a line", found: MAX_LINE + 1, most: MAX_LINE });
    for vectors in [vec![], vec![vec![0.6, 0.7]], vec![vec![1.0, 0.0], vec![0.0]], vec![vec![1.0]; 2]] {
        assert!(matches!(LineSpace::orthonormal("own", &vectors), Err(AlgebraError::Basis { .. })), "{vectors:?}");
    }
    assert!(matches!(LineSpace::orthonormal("own", &[vec![f64::NAN]]), Err(AlgebraError::Basis { .. })));
}

#[test]
fn tables_that_are_too_long() {
    let (coupled, gram) = (identity(MAX_COUPLED + 1), identity(MAX_GRAM + 1));
    let refused = Couplings::new(&coupled).unwrap_err();
    assert_eq!(refused, AlgebraError::TooLong { what: "couplings", found: MAX_COUPLED + 1, most: MAX_COUPLED });
    assert!(matches!(Gram::new(&gram, None), Err(AlgebraError::TooLong { what: "a Gram matrix", .. })));
    let samples = vec![1.0; MAX_GRAM + 1];
    assert!(matches!(Multiplier::new(&gram, &samples), Err(AlgebraError::TooLong { what: "a multiplier", .. })));
    // Filters as long as the line: all functions overlap.
    let dense = own("db38", MAX_COUPLED);
    assert!(matches!(Couplings::new(&dense), Err(AlgebraError::TooManyCouplings { length: MAX_COUPLED, .. })));
    assert!(Couplings::new(&own("haar", MAX_COUPLED)).is_ok());
}

#[test]
fn numbers_that_do_not_fit() {
    let space = own("db4", 8);
    let short = AlgebraError::Length { what: "samples", found: 7, expected: 8 };
    assert_eq!(space.analyse(&[1.0; 7]).unwrap_err(), short);
    assert_eq!(Multiplier::new(&space, &[1.0; 7]).unwrap_err(), short);
    assert!(matches!(Functional::new(&space, &[1.0; 9]), Err(AlgebraError::Length { what: "weights", .. })));
    assert!(matches!(Gram::new(&space, Some(&[1.0; 9])), Err(AlgebraError::Length { what: "weights", .. })));
    let mut masked = [1.0; 8];
    masked[5] = f64::NAN;
    assert!(matches!(space.analyse(&masked), Err(AlgebraError::NotFinite { what: "samples", index: 5, .. })));
    assert!(matches!(
        SparseSpectrum::largest(&space, &masked, 3),
        Err(AlgebraError::NotFinite { what: "samples", index: 5, .. })
    ));
}

#[test]
fn entries_that_are_none() {
    let space = own("db4", 8);
    let of = |entries: &[(u32, f64)]| {
        SparseSpectrum::new(&space, entries.iter().map(|&(index, value)| Entry { index, value }).collect())
    };
    assert!(matches!(of(&[(8, 1.0)]), Err(AlgebraError::Entry { index: 8, .. })));
    assert!(matches!(of(&[(2, 1.0), (1, 1.0), (2, 0.0)]), Err(AlgebraError::Entry { index: 2, .. })));
    assert!(matches!(of(&[(2, f64::INFINITY)]), Err(AlgebraError::Entry { index: 2, .. })));
    let sorted = of(&[(5, 1.0), (0, 2.0), (3, 0.0)]).unwrap();
    assert_eq!(sorted.entries(), [Entry { index: 0, value: 2.0 }, Entry { index: 5, value: 1.0 }]);
    let huge = of(&[(4, 1e300)]).unwrap();
    assert!(matches!(SpectrumPool::new(&space).push(&huge), Err(AlgebraError::Entry { index: 4, .. })));
}

#[test]
fn two_bases_do_not_mix() {
    let (space, other) = (own("db4", 8), own("haar", 8));
    let (a, b) = (space.analyse(&[1.0; 8]).unwrap(), other.analyse(&[1.0; 8]).unwrap());
    let expected = AlgebraError::OtherBasis { found: "haar[8]".to_owned(), expected: "db4[8]".to_owned() };
    let is_refused = |result: Result<(), AlgebraError>| assert_eq!(result, Err(expected.clone()));
    is_refused(a.add(&b).map(|_| ()));
    is_refused(a.axpy(2.0, &b).map(|_| ()));
    is_refused(a.product(&b).map(|_| ()));
    is_refused(a.dot(&b).map(|_| ()));
    is_refused(Accumulator::new(&space).axpy(1.0, &b));
    is_refused(SpectrumPool::new(&space).push(&b).map(|_| ()));
    is_refused(SpectrumPool::new(&space).gather([], &mut Accumulator::new(&other)));
    is_refused(Gram::new(&space, None).unwrap().dot(&a, &b).map(|_| ()));
    is_refused(Functional::new(&space, &[1.0; 8]).unwrap().of(&b).map(|_| ()));
    is_refused(Couplings::new(&space).unwrap().product(&a, &b).map(|_| ()));
    is_refused(Multiplier::new(&space, &[1.0; 8]).unwrap().product(&b).map(|_| ()));
    // Vectors given by the caller match only within one object.
    let vectors = |angle: f64| LineSpace::orthonormal("own", &[vec![angle.cos(), angle.sin()]]).unwrap();
    let (one, two) = (vectors(0.0), vectors(1.0));
    let [one, two] = [one, two].map(|space| space.analyse(&[1.0, 2.0]).unwrap());
    assert!(matches!(one.add(&two), Err(AlgebraError::OtherBasis { .. })));
    assert!(one.add(&one).is_ok());
}
