//! Sums, dot products and functionals of coefficients equal those of the samples.

use super::*;
use crate::algebra::{Accumulator, Entry, Functional, Gram, SparseSpectrum, SpectrumPool};
use crate::domain::WavelengthGrid;
use crate::domain::colour::Tristimulus;
use rayon::prelude::*;

fn every_space() -> Vec<(LineBasis, Boundary, usize)> {
    let bases = LineBasis::distinct().flat_map(|basis| Boundary::ALL.iter().map(move |&boundary| (basis, boundary)));
    bases.flat_map(|(basis, boundary)| LENGTHS.map(|length| (basis, boundary, length))).collect()
}

/// Checks in every basis that a spectrum decodes to its samples, and that dot products of coefficients equal those of
/// samples. Tolerances are wide: rounding grows with the norms of basis functions, large for splines with short duals.
#[test]
fn samples_come_back_and_dot_products_are_theirs_in_every_basis() {
    every_space().into_par_iter().for_each(|(basis, boundary, length)| {
        let space = space(basis, boundary, length);
        let name = format!("{} {boundary}", space.name());
        let (f, g) = (samples(length, 1), samples(length, 2));
        let (a, b) = (space.analyse(&f).unwrap(), space.analyse(&g).unwrap());
        let off = distance(&a.samples(), &f);
        assert!(off < 1e-8 * largest(&f), "{name}: {off}");
        // Whole spectra, and a few coefficients of each.
        let few = [SparseSpectrum::largest(&space, &f, 6).unwrap(), SparseSpectrum::largest(&space, &g, 4).unwrap()];
        for (a, b) in [(&a, &b), (&few[0], &few[1])] {
            let (f, g) = (a.samples(), b.samples());
            let scale = plain(&f, &f).sqrt() * plain(&g, &g).sqrt();
            let dot = a.dot(b).unwrap();
            assert!((dot - plain(&f, &g)).abs() < 1e-7 * scale, "{name}: {dot} {}", plain(&f, &g));
            assert!((dot - b.dot(a).unwrap()).abs() < 1e-7 * scale, "{name}");
        }
    });
}

#[test]
fn orthonormal_bases_know_it_and_keep_the_sum_of_squares() {
    let mut count = 0;
    for basis in LineBasis::distinct() {
        let orthogonal = basis.info().orthogonal;
        let space = space(basis, basis.boundary(), 75);
        // The table of this one has eight digits only.
        if orthogonal && basis.name() != "vaidyanathan24" {
            assert!(space.is_orthonormal(), "{basis}");
        }
        if space.is_orthonormal() {
            count += 1;
            let f = samples(75, 3);
            let a = space.analyse(&f).unwrap();
            let squares: f64 = a.entries().iter().map(|entry| entry.value * entry.value).sum();
            let expected = plain(&f, &f);
            assert!((squares - expected).abs() < 1e-8 * expected, "{basis}: {squares} {expected}");
            assert!((0..75).all(|k| (space.norm(k) - 1.0).abs() < 1e-8), "{basis}");
        } else {
            let gram = Gram::new(&space, None).unwrap();
            let off = (0..75).any(|i| (0..75).any(|j| (gram.at(i, j) - f64::from(i == j)).abs() > 1e-10));
            assert!(off, "{basis}");
        }
    }
    assert!(count > 70, "{count}");
    assert!(!own("bior4.4", 75).is_orthonormal());
    assert!(LineSpace::new(AxisTransform::Identity, 5).unwrap().is_orthonormal());
}

#[test]
fn weights_enter_dot_products() {
    for name in ["haar", "bior4.4", "db4", "rbio3.1"] {
        for length in [1, 5, 75, 91] {
            let space = own(name, length);
            let (f, g, w) = (samples(length, 1), samples(length, 2), samples(length, 3));
            let (a, b) = (space.analyse(&f).unwrap(), space.analyse(&g).unwrap());
            let weighted: Vec<f64> = g.iter().zip(&w).map(|(g, w)| g * w).collect();
            let expected = plain(&f, &weighted);
            let gram = Gram::new(&space, Some(&w)).unwrap();
            for found in [
                gram.dot(&a, &b).unwrap(),
                gram.dot(&b, &a).unwrap(),
                Functional::new(&space, &weighted).unwrap().of(&a).unwrap(),
            ] {
                assert!((found - expected).abs() < 1e-9 * expected, "{name} {length}: {found} {expected}");
            }
        }
    }
}

#[test]
fn tristimulus_values_are_functionals() {
    let grid = WavelengthGrid::even(380.0, 5.0, 81).unwrap();
    let observer = Tristimulus::emission(&grid).unwrap();
    // The weights of the sum, one wavelength after the other.
    let units: Vec<_> = (0..81)
        .map(|i| {
            let mut unit = vec![0.0_f32; 81];
            unit[i] = 1.0;
            observer.xyz(&unit)
        })
        .collect();
    for name in ["bior4.4", "sym5"] {
        let space = own(name, 81);
        let spectrum = SparseSpectrum::largest(&space, &samples(81, 4), 12).unwrap();
        let decoded: Vec<f32> = spectrum.samples().iter().map(|&x| x as f32).collect();
        let expected = observer.xyz(&decoded);
        for (weights, expected) in [
            (units.iter().map(|xyz| xyz.x).collect::<Vec<_>>(), expected.x),
            (units.iter().map(|xyz| xyz.y).collect(), expected.y),
            (units.iter().map(|xyz| xyz.z).collect(), expected.z),
        ] {
            let found = Functional::new(&space, &weights).unwrap().of(&spectrum).unwrap();
            assert!((found - expected).abs() < 1e-6 * expected, "{name}: {found} {expected}");
        }
    }
}

#[test]
fn sums_are_unions_exact_to_rounding() {
    for name in ["haar", "bior4.4", "db4"] {
        let space = own(name, 75);
        let a = SparseSpectrum::largest(&space, &samples(75, 1), 9).unwrap();
        let b = SparseSpectrum::largest(&space, &samples(75, 2), 7).unwrap();
        let sum = a.axpy(-0.75, &b).unwrap();
        assert!(sum.len() <= 16 && sum.entries().is_sorted_by_key(|entry| entry.index));
        let at = |spectrum: &SparseSpectrum, index| {
            spectrum.entries().iter().find(|entry| entry.index == index).map_or(0.0, |entry| entry.value)
        };
        for index in 0..75 {
            assert_eq!(at(&sum, index), at(&a, index) - 0.75 * at(&b, index));
        }
        let (f, g) = (a.samples(), b.samples());
        let expected: Vec<f64> = f.iter().zip(&g).map(|(f, g)| f - 0.75 * g).collect();
        assert!(distance(&sum.samples(), &expected) < 1e-13 * largest(&f));
        assert_eq!(a.add(&b).unwrap().entries(), b.add(&a).unwrap().entries());
        assert!(a.axpy(-1.0, &a).unwrap().is_empty());
        let mut scaled = a.clone();
        scaled.scale(2.0);
        assert_eq!(scaled.entries(), a.add(&a).unwrap().entries());
        scaled.scale(0.0);
        assert!(scaled.is_empty() && scaled.norm() == 0.0);
    }
}

#[test]
fn gathered_photons_are_the_sum_of_their_samples() {
    for (name, k) in [("haar", 4), ("bior4.4", 8), ("villasenor6.10", 16)] {
        let space = own(name, 75);
        let mut pool = SpectrumPool::new(&space);
        let mut sum = Accumulator::new(&space);
        let mut decoded = vec![0.0; 75];
        let photons: Vec<_> =
            (0..200).map(|seed| SparseSpectrum::largest(&space, &samples(75, seed), k).unwrap()).collect();
        for (i, photon) in photons.iter().enumerate() {
            let weight = 0.1 + i as f64 / 200.0;
            assert_eq!(pool.push(photon), Ok(i));
            sum.axpy(weight, photon).unwrap();
            photon.add_samples(weight, &mut decoded);
        }
        let mut gathered = vec![0.0; 75];
        sum.samples_into(&mut gathered);
        assert!(distance(&gathered, &decoded) < 1e-12 * largest(&decoded), "{name}");
        assert!(distance(&sum.spectrum().samples(), &decoded) < 1e-12 * largest(&decoded), "{name}");
        // From the pool, whose coefficients are f32.
        sum.clear();
        assert!(sum.coefficients().iter().all(|&c| c == 0.0));
        pool.gather((0..pool.len()).map(|i| (i, 0.1 + i as f64 / 200.0)), &mut sum).unwrap();
        sum.samples_into(&mut gathered);
        assert!(distance(&gathered, &decoded) < 1e-6 * largest(&decoded), "{name}");
        assert_eq!((pool.len(), pool.is_empty(), pool.bytes()), (200, false, 200 * k * 6 + 201 * 8));
    }
}

#[test]
fn the_error_of_truncation_is_measured() {
    for name in ["db4", "bior2.2"] {
        let space = own(name, 91);
        let whole = space.analyse(&samples(91, 5)).unwrap();
        let mut last = f64::INFINITY;
        for k in [0, 4, 16, 91, 200] {
            let truncated = whole.truncated(k);
            assert_eq!(truncated.spectrum.len(), k.min(whole.len()));
            let off: Vec<f64> = whole.samples().iter().zip(truncated.spectrum.samples()).map(|(a, b)| a - b).collect();
            assert!((plain(&off, &off).sqrt() - truncated.error).abs() < 1e-12 * whole.norm());
            assert!((truncated.error / whole.norm() - truncated.relative_error).abs() < 1e-15);
            assert!(truncated.error <= last);
            last = truncated.error;
        }
        assert_eq!(last, 0.0);
    }
}

#[test]
fn long_lines_have_dot_products_without_a_table() {
    let space = own("bior4.4", 1644);
    let (a, b) = (space.analyse(&samples(1644, 1)).unwrap(), space.analyse(&samples(1644, 2)).unwrap());
    let expected = plain(&samples(1644, 1), &samples(1644, 2));
    assert!((a.dot(&b).unwrap() - expected).abs() < 1e-9 * expected);
}

#[test]
fn spectra_of_equal_bases_add_whoever_prepared_them() {
    let (one, other) = (own("db4", 20), own("db4", 20));
    let a = SparseSpectrum::new(&one, vec![Entry { index: 3, value: 1.0 }]).unwrap();
    let b = SparseSpectrum::new(&other, vec![Entry { index: 1, value: 2.0 }]).unwrap();
    assert_eq!(a.add(&b).unwrap().len(), 2);
}
