//! Phase functions in every form, against the functions that they tabulate; normalisations; refusals.

use super::*;
use crate::domain::Direction;
use crate::formats::NoteKind;
use crate::formats::{FormatErrorKind, read as read_any};
use std::f64::consts::PI;
use std::fmt::Write as _;

const G: f64 = 0.6;

/// Returns Henyey and Greenstein's phase function at a cosine, which integrates to 1; its Legendre moments are powers
/// of G.
fn henyey_greenstein(mu: f64) -> f64 {
    (1.0 - G * G) / (4.0 * PI * libm::pow(1.0 + G * G - 2.0 * G * mu, 1.5))
}

fn cosine(degrees: f64) -> f64 {
    libm::cos(degrees.to_radians())
}

/// Returns a table of scattering angles and values of a phase function, in steps of half a degree.
fn angles(factor: f64) -> String {
    let mut text = String::new();
    for i in 0..=360 {
        let angle = 0.5 * f64::from(i);
        let _ = writeln!(text, "{angle} {:e}", factor * henyey_greenstein(cosine(angle)));
    }
    text
}

fn with(text: &str, normalization: Option<Normalization>) -> Result<Acquisition, FormatError> {
    read_any(text.as_bytes(), &Interpretation { normalization, ..Interpretation::default() })
}

/// Returns the phase function at a scattering angle, which does not depend on the incoming direction.
fn at(acquisition: &Acquisition, degrees: f64) -> f64 {
    let Samples::Function(modelled) = &acquisition.samples else { panic!("expected a function") };
    let wi = Direction::from_degrees(0.0, 0.0);
    let mut value = [0.0];
    modelled.function.evaluate(wi, Direction::from_degrees(180.0 - degrees, 77.0), &mut value);
    value[0]
}

fn is_henyey_greenstein(acquisition: &Acquisition, tolerance: f64) {
    assert_eq!((acquisition.quantity, acquisition.unit), (Quantity::Phase, Unit::PerSteradian));
    for degrees in [0.0, 1.0, 17.25, 90.0, 123.4, 180.0] {
        let (found, wanted) = (at(acquisition, degrees), henyey_greenstein(cosine(degrees)));
        assert!((found / wanted - 1.0).abs() < tolerance, "{degrees}: {found} {wanted}");
    }
    let mean = acquisition.report.metadata.iter().find(|(key, _)| key == "mean_cosine").unwrap();
    assert!((mean.1.parse::<f64>().unwrap() - G).abs() < tolerance, "{mean:?}");
}

#[test]
fn every_form_is_the_same_function() {
    let cosines: Vec<f64> = (0..=2000).map(|i| f64::from(i) / 1000.0 - 1.0).collect();
    let mut by_cosine = "# cos p\n".to_owned();
    for mu in cosines.iter().rev() {
        let _ = writeln!(by_cosine, "{mu}\t{:e}", 4.0 * PI * henyey_greenstein(*mu));
    }
    let list: Vec<String> = cosines.iter().map(|&mu| format!("{:e}", henyey_greenstein(mu))).collect();
    let moments = |factor: fn(i32) -> f64| {
        (0..60).fold(String::new(), |text, m| text + &format!("{:e}\n", factor(m) * G.powi(m)))
    };
    let header = format!("scattering angle,phase function\n{}", angles(1.0).replace(' ', ","));
    for (text, form, tolerance) in [
        (angles(1.0), "361 angles, blank separated", 1e-4),
        (header, "361 angles, comma separated", 1e-4),
        (by_cosine, "2001 cosines, tab separated", 1e-4),
        (format!("# tabphase\n{}", list.join(", ")), "2001 values over the cosine", 1e-4),
        (moments(|_| 1.0), "60 Legendre moments", 1e-3),
        (moments(|m| f64::from(2 * m + 1)), "60 Legendre moments", 1e-3),
    ] {
        let acquisition = with(&text, None).unwrap();
        assert_eq!((acquisition.format, acquisition.dialect.as_str()), (NAME, form));
        is_henyey_greenstein(&acquisition, tolerance);
    }
}

#[test]
fn what_the_values_integrate_to_is_inferred_or_asked_for() {
    use Normalization::{FourPi, One, Relative, Vsf};
    for (factor, said) in [
        (1.0, None),
        (1.03, None),
        (4.0 * PI, None),
        (1.0, Some(One)),
        (12.0, Some(FourPi)),
        (0.37, Some(Vsf)),
        (3.0, Some(Relative)),
    ] {
        let acquisition = with(&angles(factor), said).unwrap();
        is_henyey_greenstein(&acquisition, 1e-3);
    }
    let b = with(&angles(0.37), Some(Vsf)).unwrap().report.metadata;
    let b = b.iter().find(|(key, _)| key == "scattering_coefficient").unwrap();
    assert!((b.1.parse::<f64>().unwrap() - 0.37).abs() < 1e-4, "{b:?}");
    // A normalization that differs from the stated one brings a warning.
    let odd = with(&angles(2.0), Some(One)).unwrap();
    assert!(odd.report.notes.iter().any(|note| note.kind == NoteKind::Warning && note.message.contains("not to 1")));
    let error = with(&angles(2.0), None).unwrap_err();
    assert_eq!(error.kind, FormatErrorKind::NeedsOption);
    assert!(
        error.message.contains("neither 1 nor 4 pi") && error.message.contains("normalization=1, 4pi, vsf"),
        "{error}"
    );
    // The header of a volume scattering function says so.
    let vsf = with(&format!("# volume scattering function beta [1/m/sr]\n{}", angles(0.37)), None).unwrap();
    is_henyey_greenstein(&vsf, 1e-3);
    // To name the option, or a word that holds these letters, is not to say so.
    for remark in ["normalization=vsf or relative otherwise", "phase function, from avsfile"] {
        let phase = with(&format!("# {remark}\n# angle p\n{}", angles(1.0)), None).unwrap();
        let found = phase.report.notes.iter().any(|note| note.message.contains("volume scattering"));
        assert!(!found, "{remark}: {:?}", phase.report.notes);
    }
}

#[test]
fn ends_hold_a_little_way_and_gaps_are_masked() {
    let short = |first: f64, last: f64| {
        angles(1.0)
            .lines()
            .filter(|line| {
                let angle: f64 = line.split(' ').next().unwrap().parse().unwrap();
                (first..=last).contains(&angle)
            })
            .fold(String::new(), |text, line| text + line + "\n")
    };
    let phase = |text: &str, normalization| {
        let how = Interpretation { quantity: Some(Quantity::Phase.into()), normalization, ..Interpretation::default() };
        read_any(text.as_bytes(), &how)
    };
    let held = phase(&short(1.0, 175.0), None).unwrap();
    assert!((at(&held, 0.0) - at(&held, 1.0)).abs() < 1e-12 && (at(&held, 180.0) - at(&held, 175.0)).abs() < 1e-12);
    let error = phase(&short(20.0, 160.0), None).unwrap_err();
    assert!(error.kind == FormatErrorKind::NeedsOption && error.message.contains("does not cover"), "{error}");
    let part = phase(&short(20.0, 160.0), Some(Normalization::One)).unwrap();
    assert!(at(&part, 10.0).is_nan() && (at(&part, 90.0) / henyey_greenstein(0.0) - 1.0).abs() < 1e-6);
}

#[test]
fn peaks_that_the_table_does_not_resolve_and_backward_ones_are_pointed_out() {
    let warned = |text: &str, words: &str| {
        let acquisition = with(text, Some(Normalization::Relative)).unwrap();
        let found = acquisition.report.notes.iter().any(|n| n.kind == NoteKind::Warning && n.message.contains(words));
        assert!(found, "{words}: {:?}", acquisition.report.notes);
    };
    warned("# phase function\n0 1e5\n2 10\n90 0.1\n180 0.1\n", "its peak is not resolved");
    warned("# cos_theta p\n-1 9\n0 1\n1 0.5\n", "goes backward");
    warned("# phase function\n0 3\n90 -0.1\n180 1\n", "negative");
}

#[test]
fn refusals_name_the_place_and_what_was_expected() {
    use FormatErrorKind::{Malformed, NeedsOption, OverLimit};
    let long = |count: usize| (0..count).fold("1\n".to_owned(), |text, _| text + "0.1\n");
    for (text, kind, words) in [
        ("# phase function\n0 1\n190 1\n".to_owned(), Malformed, "line 3, column 1: found 190, expected an angle"),
        ("# phase function\n0 1\n90 x\n180 1\n".to_owned(), Malformed, "line 3, column 4: found `x`"),
        ("# phase function\n0 1\n90 1\n90 1\n180 1\n".to_owned(), Malformed, "90 after 90"),
        ("# phase function\n0 1\n90 1\n45 1\n180 1\n".to_owned(), Malformed, "45 after 90, expected increasing"),
        ("-1 1\n0 1\n-0.5 1\n1 1\n".to_owned(), Malformed, "-0.5 after 0, expected increasing"),
        ("# phase function\n0 0\n90 0\n180 0\n".to_owned(), Malformed, "integrate to 0"),
        ("# tabphase\n1, 2, x, 4\n".to_owned(), Malformed, ""),
        (long(5000), OverLimit, "5001 moments, expected at most 4096"),
        ("# phase function\n0 1\n90 1\n180 1\n".to_owned(), NeedsOption, ""),
    ] {
        let how = Interpretation { quantity: Some(Quantity::Phase.into()), ..Interpretation::default() };
        match read_any(text.as_bytes(), &how) {
            // 1 everywhere is 4 pi over the sphere.
            Ok(read) => assert_eq!(kind, NeedsOption, "{:?}", read.dialect),
            Err(error) => {
                assert_eq!((error.kind, error.format), (kind, NAME), "{error}");
                assert!(error.to_string().contains(words), "{error}");
            }
        }
    }
    let how = |quantity: Option<Quantity>, unit| Interpretation {
        quantity: quantity.map(Into::into),
        unit,
        ..Interpretation::default()
    };
    for how in [how(Some(Quantity::Brdf), None), how(None, Some(Unit::Candela))] {
        let error = read_any(angles(1.0).as_bytes(), &how).unwrap_err();
        assert!(error.kind == NeedsOption && error.message.contains("expected"), "{error}");
    }
    let spectrum = Interpretation { normalization: Some(Normalization::Vsf), ..Interpretation::default() };
    let error = read_any(b"nm,v\n400,1\n500,2\n", &spectrum).unwrap_err();
    assert!(error.kind == NeedsOption && error.message.contains("`normalization`"), "{error}");
}

#[test]
fn one_line_of_values_needs_no_word_that_says_what_it_is() {
    let values: Vec<f64> = (0..=2000).map(|i| henyey_greenstein(f64::from(i) / 1000.0 - 1.0)).collect();
    let written = String::from_utf8(crate::formats::write_tabphase(&values).unwrap()).unwrap();
    for text in [written.replace(',', ""), written] {
        let acquisition = with(&text, None).unwrap();
        assert_eq!((acquisition.format, acquisition.dialect.as_str()), (NAME, "2001 values over the cosine"));
        is_henyey_greenstein(&acquisition, 1e-3);
    }
    // A row is no spectrum at 1000 nm.
    let error = with("1, 2, 3, 4\n", None).unwrap_err();
    assert_eq!((error.kind, error.format), (FormatErrorKind::NeedsOption, NAME), "{error}");
}

#[test]
fn spectra_stay_spectra() {
    for text in [
        "400 1 500 2 600 3\n",
        "# wavelength a b\n550 1 2\n",
        "400 1\n500 2\n600 3\n",
        "nm,v\n0.4,1\n0.5,2\n0.6,3\n",
        "# lamp\n380\t0.1\n385\t0.2\n",
    ] {
        assert_eq!(with(text, None).unwrap().format, "spectral-table", "{text}");
    }
}

#[test]
fn angles_from_the_other_side_stay_decimals() {
    for tenths in 0..=1800_i32 {
        let angle: f64 = format!("{}.{}", tenths / 10, tenths % 10).parse().unwrap();
        assert_eq!(super::normalised::decimal(180.0 - angle), f64::from(1800 - tenths) / 10.0);
    }
    // An angle of a cosine is no decimal.
    let angle = libm::acos(0.3).to_degrees();
    assert_eq!(super::normalised::decimal(angle), angle);
}
