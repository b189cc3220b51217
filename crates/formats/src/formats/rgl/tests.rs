//! Tests of the reader: values of another implementation, symmetries, and every refusal.

use super::super::{FormatErrorKind, Position};
use super::*;
use crate::domain::Direction;
use FormatErrorKind::{Malformed, NeedsOption, OverLimit, Unsupported};

/// Fields of a tensor file for tests: name, code of the number type, shape, data.
#[derive(Clone)]
struct File(Vec<(String, u8, Vec<u64>, Vec<u8>)>);

impl File {
    /// Returns a test file with two incident elevations, two wavelengths, 2 × 2 values, and the identity as warp, so
    /// that its values are f · cos θo.
    fn plain() -> Self {
        let mut file = Self(Vec::new());
        file.set("description", 1, &[4], b"test".to_vec());
        file.floats("phi_i", &[1], &[0.0]);
        file.floats("theta_i", &[2], &[0.0, 1.0]);
        file.floats("wavelengths", &[2], &[400.0, 500.0]);
        file.floats("ndf", &[2, 2], &[4.0; 4]);
        file.floats("sigma", &[2, 2], &[1.0; 4]);
        file.floats("vndf", &[1, 2, 2, 2], &[1.0; 8]);
        file.floats("luminance", &[1, 2, 2, 2], &[1.0; 8]);
        file.floats("spectra", &[1, 2, 2, 2, 2], &(0..16).map(|i| i as f32).collect::<Vec<_>>());
        file.set("jacobian", 1, &[1], vec![1]);
        file
    }

    fn set(&mut self, name: &str, code: u8, shape: &[u64], data: Vec<u8>) {
        self.remove(name);
        self.0.push((name.to_owned(), code, shape.to_vec(), data));
    }

    fn floats(&mut self, name: &str, shape: &[u64], values: &[f32]) {
        self.set(name, 10, shape, values.iter().flat_map(|v| v.to_le_bytes()).collect());
    }

    fn remove(&mut self, name: &str) {
        self.0.retain(|field| field.0 != name);
    }

    /// Returns a test file in the RGL format whose incident directions have the azimuths `azimuths`, in radians.
    fn turned(azimuths: &[f32]) -> Self {
        let mut file = Self::plain();
        let n = azimuths.len();
        file.floats("phi_i", &[n as u64], azimuths);
        file.floats("vndf", &[n as u64, 2, 2, 2], &vec![1.0; 8 * n]);
        file.floats("luminance", &[n as u64, 2, 2, 2], &vec![1.0; 8 * n]);
        let values: Vec<f32> = (0..16 * n).map(|i| (i * i % 17) as f32).collect();
        file.floats("spectra", &[n as u64, 2, 2, 2, 2], &values);
        file
    }

    fn bytes(&self) -> Vec<u8> {
        let size = 18 + self.0.iter().map(|(name, _, shape, _)| 13 + name.len() + 8 * shape.len()).sum::<usize>();
        let mut table = b"tensor_file\0\x01\0".to_vec();
        table.extend((self.0.len() as u32).to_le_bytes());
        let mut body = Vec::new();
        for (name, code, shape, data) in &self.0 {
            table.extend((name.len() as u16).to_le_bytes());
            table.extend(name.as_bytes());
            table.extend((shape.len() as u16).to_le_bytes());
            table.push(*code);
            table.extend(((size + body.len()) as u64).to_le_bytes());
            table.extend(shape.iter().flat_map(|n| n.to_le_bytes()));
            body.extend(data);
        }
        assert_eq!(table.len(), size);
        [table, body].concat()
    }

    fn read(&self) -> Result<Acquisition, FormatError> {
        read(&self.bytes(), &Interpretation::default())
    }

    fn modelled(&self) -> Modelled {
        function(self.read().unwrap())
    }
}

fn function(acquisition: Acquisition) -> Modelled {
    match acquisition.samples {
        Samples::Function(modelled) => modelled,
        _ => panic!("expected a function"),
    }
}

fn at(modelled: &Modelled, wi: (f64, f64), wo: (f64, f64)) -> Vec<f64> {
    let mut values = vec![-1.0; modelled.spectral.as_ref().map_or(1, Axis::len)];
    let direction = |(theta, phi): (f64, f64)| Direction::from_degrees(theta, phi);
    modelled.function.evaluate(direction(wi), direction(wo), &mut values);
    values
}

/// Change to a test file that makes it invalid.
type Change = fn(&mut File);

fn refusal(file: &File) -> FormatError {
    match file.read() {
        Err(error) => error,
        Ok(read) => panic!("expected a refusal, read {}", read.dialect),
    }
}

#[test]
fn values_are_those_of_another_implementation() {
    let golden: serde_json::Value = serde_json::from_str(include_str!("../../../../../tests/golden/rgl.json")).unwrap();
    let numbers = |value: &serde_json::Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
    };
    let cases = golden["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 4);
    for case in cases {
        let name = case["file"].as_str().unwrap();
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/rgl").join(name);
        let modelled = function(read(&std::fs::read(path).unwrap(), &Interpretation::default()).unwrap());
        let pairs = case["pairs"].as_array().unwrap().iter().zip(case["brdf"].as_array().unwrap());
        for (pair, expected) in pairs {
            let (d, expected) = (numbers(pair), numbers(expected));
            let mut found = vec![0.0; expected.len()];
            let direction = |k: usize| Direction::new(d[k], d[k + 1], d[k + 2]).unwrap();
            modelled.function.evaluate(direction(0), direction(3), &mut found);
            for (f, e) in found.iter().zip(&expected) {
                // The other one computes in f32.
                assert!((f / e - 1.0).abs() < 1e-5, "{name}: {f} {e}");
            }
        }
    }
}

#[test]
fn an_identity_warp_holds_f_times_cosine() {
    let modelled = File::plain().modelled();
    // Along the normal m is the pole: column 0, half way up in azimuth; rows of channel 0 are (0, 1), (2, 3).
    let values = at(&modelled, (0.0, 0.0), (0.0, 0.0));
    assert!((values[0] - 1.0).abs() < 1e-12 && (values[1] - 5.0).abs() < 1e-12, "{values:?}");
    // m at 22.5° is half a column: u² = 1/4. 45° of elevation between 0 and 1 radian.
    let values = at(&modelled, (0.0, 0.0), (45.0, 0.0));
    assert!((values[0] - 1.5 * 2.0_f64.sqrt()).abs() < 1e-12, "{values:?}");
    let modelled = {
        let mut file = File::plain();
        file.set("jacobian", 1, &[1], vec![0]);
        file.floats("ndf", &[2, 2], &[400.0; 4]);
        file.modelled()
    };
    assert!((at(&modelled, (0.0, 0.0), (45.0, 0.0))[0] - 1.5 * 2.0_f64.sqrt()).abs() < 1e-12);
}

#[test]
fn one_elevation_holds_for_all() {
    let mut file = File::plain();
    file.floats("theta_i", &[1], &[0.0]);
    file.floats("vndf", &[1, 1, 2, 2], &[1.0; 4]);
    file.floats("luminance", &[1, 1, 2, 2], &[1.0; 4]);
    file.floats("spectra", &[1, 1, 2, 2, 2], &(0..8).map(|i| i as f32).collect::<Vec<_>>());
    let (one, two) = (file.modelled(), File::plain().modelled());
    assert_eq!(one.incoming.theta, [0.0]);
    assert_eq!(at(&one, (0.0, 0.0), (45.0, 30.0)), at(&two, (0.0, 0.0), (45.0, 30.0)));
    assert!(at(&one, (60.0, 0.0), (45.0, 30.0)).iter().all(|value| value.is_finite()));
}

#[test]
fn nothing_is_reflected_below_the_surface() {
    let modelled = File::plain().modelled();
    for (wi, wo) in [((91.0, 0.0), (0.0, 0.0)), ((0.0, 0.0), (91.0, 0.0)), ((0.0, 0.0), (90.0, 0.0))] {
        assert_eq!(at(&modelled, wi, wo), [0.0, 0.0]);
    }
    // Along the surface is the limit from above.
    let (grazing, near) = (at(&modelled, (90.0, 0.0), (30.0, 40.0)), at(&modelled, (89.999, 0.0), (30.0, 40.0)));
    assert!(grazing[0] > 0.0 && (grazing[0] / near[0] - 1.0).abs() < 1e-4);
}

#[test]
fn reduced_files_have_their_symmetry() {
    use std::f32::consts::{FRAC_PI_2, PI};
    let pairs = [((30.0, 20.0), (50.0, 100.0)), ((70.0, 200.0), (10.0, 300.0)), ((40.0, 120.0), (60.0, 210.0))];
    let half = File::turned(&[-PI, -2.0, 0.0]).modelled();
    let quarter = File::turned(&[-PI, -2.0, -FRAC_PI_2]).modelled();
    for ((ti, pi), (to, po)) in pairs {
        let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9 * a.abs());
        let (a, b) = (at(&half, (ti, pi), (to, po)), at(&half, (ti, pi + 180.0), (to, po + 180.0)));
        assert!(near(&a, &b), "{a:?} {b:?}");
        let a = at(&quarter, (ti, pi), (to, po));
        for (p, o) in [(-pi, -po), (180.0 - pi, 180.0 - po), (180.0 + pi, 180.0 + po)] {
            let b = at(&quarter, (ti, p), (to, o));
            assert!(near(&a, &b), "{a:?} {b:?}");
        }
    }
    // Isotropic data turn with the surface.
    let isotropic = File::plain().modelled();
    let (a, b) = (at(&isotropic, (30.0, 0.0), (50.0, 80.0)), at(&isotropic, (30.0, 77.0), (50.0, 157.0)));
    assert!((a[0] - b[0]).abs() < 1e-9 * a[0]);
}

#[test]
fn the_report_says_what_was_assumed() {
    let mut file = File::turned(&[-3.0, 3.0]);
    file.floats("valid", &[1], &[1.0]);
    let mut values: Vec<f32> = (0..32).map(|i| i as f32).collect();
    (values[3], values[5]) = (f32::NAN, -0.25);
    file.floats("spectra", &[2, 2, 2, 2, 2], &values);
    let read = file.read().unwrap();
    assert_eq!((read.format, read.quantity, read.unit), ("rgl", Quantity::Brdf, Unit::PerSteradian));
    assert_eq!(read.dialect, "isotropic, 2 elevations, 2 × 2 outgoing, 2 wavelengths");
    assert_eq!(read.report.metadata, [("description".to_owned(), "test".to_owned())]);
    let notes: Vec<&str> = read.report.notes.iter().map(|note| note.message.as_str()).collect();
    for words in ["`valid`", "two incident azimuths", "1 of 32 numbers is missing", "down to -2.5e-1", "up to 90°"] {
        assert!(notes.iter().any(|note| note.contains(words)), "{words}: {notes:?}");
    }
    let modelled = function(read);
    assert_eq!((modelled.numbers, modelled.missing), (32, 1));
    // Number 3 is the corner of slice 0 (azimuth −3) where m is at π/2 and turned by π: near it is masked.
    assert!(at(&modelled, (5.0, -3.0_f64.to_degrees()), (80.0, 20.0))[0].is_nan());

    let sector = File::turned(&[-2.9, 0.0, 2.9]).read().unwrap();
    assert!(sector.report.notes.iter().any(|note| note.message.contains("taken to hold beyond")));
    assert!(sector.dialect.starts_with("anisotropic, 3 × 2 incident"));
    let mut rgb = File::plain();
    rgb.remove("wavelengths");
    rgb.remove("spectra");
    rgb.floats("rgb", &[1, 2, 3, 2, 2], &[0.5; 24]);
    assert_eq!(rgb.modelled().spectral, Some(Axis::Rgb));
}

#[test]
fn the_container_is_checked_before_anything_is_allocated() {
    let good = File::plain().bytes();
    let patched = |at: usize, bytes: &[u8]| {
        let mut file = good.clone();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        read(&file, &Interpretation::default()).unwrap_err()
    };
    // The first entry is at 18: length 11, name, 2 dimensions at 31, type at 33, offset at 34, shape at 42.
    for (at, bytes, kind, position, words) in [
        (0, &b"tensor-file"[..], Malformed, 0, "`tensor-file"),
        (12, &[2], Unsupported, 12, "version 2.0"),
        (13, &[1], Unsupported, 12, "version 1.1"),
        (14, &[65, 0, 0, 0], OverLimit, 14, "65 fields"),
        (14, &[255, 255, 255, 255], OverLimit, 14, "4294967295 fields"),
        (18, &[255, 255], OverLimit, 18, "65535 bytes"),
        (20, &[0xFF], Malformed, 20, "not UTF-8"),
        (31, &[9, 0], OverLimit, 31, "9 dimensions"),
        (33, &[0], Malformed, 33, "type 0"),
        (33, &[12], Malformed, 33, "type 12"),
        (34, &[255; 8], Malformed, 18, "within the file"),
        (42, &[255; 8], Malformed, 18, "within the file"),
        (42, &[0, 0, 0, 0, 1], Malformed, 18, "[4294967296]"),
    ] {
        let error = patched(at, bytes);
        assert_eq!((error.kind, error.position), (kind, Some(Position::Byte(position))), "{error}");
        assert!(error.message.contains(words), "{error}");
    }
    let mut twice = File::plain();
    twice.0.push(twice.0[0].clone());
    assert!(refusal(&twice).message.contains("twice"));
    let mut many = File::plain();
    many.set("other", 11, &[1 << 31, 1 << 31, 1 << 31], Vec::new());
    assert_eq!(refusal(&many).kind, Malformed);
}

#[test]
fn every_cut_is_refused_with_its_place() {
    let bytes = File::plain().bytes();
    for cut in 1..bytes.len() {
        let error = read(&bytes[..cut], &Interpretation::default()).unwrap_err();
        assert_eq!(error.kind, Malformed, "{cut}: {error}");
        assert!(error.position.is_some_and(|p| matches!(p, Position::Byte(at) if at <= cut)), "{cut}: {error}");
    }
}

#[test]
fn fields_must_be_there_and_fit_each_other() {
    let names = File::plain().0.into_iter().map(|field| field.0);
    for name in names {
        let mut file = File::plain();
        file.remove(&name);
        let error = refusal(&file);
        assert!(error.kind == Malformed && error.message.contains(&format!("without `{name}")), "{error}");
    }
    let cases: &[(Change, &str)] = &[
        (|f| f.set("theta_i", 11, &[2], vec![0; 16]), "f64 with the shape [2], expected f32"),
        (|f| f.floats("theta_i", &[2, 1], &[0.0, 1.0]), "expected f32 with 1 dimensions"),
        (|f| f.floats("phi_i", &[0], &[]), "nothing in it"),
        (|f| f.floats("spectra", &[1, 2, 2, 2, 1], &[1.0; 8]), "at least 2 × 2"),
        (|f| f.floats("spectra", &[1, 2, 1, 2, 2], &[1.0; 8]), "expected [1, 2, 2, 2, 2]"),
        (|f| f.floats("spectra", &[1, 2, 2, 3, 2], &[1.0; 24]), "expected [1, 2, 2, 2, 2]"),
        (|f| f.floats("luminance", &[1, 2, 3, 3], &[1.0; 18]), "expected [1, 2, 2, 2]"),
        (|f| f.floats("vndf", &[1, 2, 1, 2], &[1.0; 4]), "at least 2 × 2"),
        (|f| f.floats("vndf", &[1, 1, 2, 2], &[1.0; 4]), "expected [1, 2, 2, 2]"),
        (|f| f.floats("ndf", &[1, 4], &[1.0; 4]), "at least 2 × 2"),
        (|f| f.floats("sigma", &[4], &[1.0; 4]), "expected f32 with 2 dimensions"),
        (|f| f.set("jacobian", 1, &[1], vec![2]), "`jacobian` is 2"),
        (|f| f.set("jacobian", 1, &[2], vec![1, 1]), "2 bytes"),
        (|f| f.set("jacobian", 2, &[1], vec![1]), "expected u8"),
        (|f| f.floats("description", &[1], &[1.0]), "expected u8"),
    ];
    for (change, words) in cases {
        let mut file = File::plain();
        change(&mut file);
        let error = refusal(&file);
        assert!(error.kind == Malformed && error.message.contains(words), "{words}: {error}");
        assert!(error.position.is_some(), "{error}");
    }
    let mut long = File::plain();
    long.set("description", 1, &[70_000], vec![b'x'; 70_000]);
    assert_eq!(refusal(&long).kind, OverLimit);
}

#[test]
fn numbers_that_cannot_be_are_refused_where_they_are() {
    let (nan, infinite) = (f32::NAN, f32::INFINITY);
    let cases: &[(&str, usize, f32, &str)] = &[
        ("theta_i", 0, -0.1, "expected 0 to π/2"),
        ("theta_i", 1, 1.6, "expected 0 to π/2"),
        ("theta_i", 1, 0.0, "strictly increasing"),
        ("theta_i", 1, nan, "strictly increasing"),
        ("phi_i", 0, 7.0, "within a turn"),
        ("phi_i", 0, infinite, "within a turn"),
        ("wavelengths", 1, 300.0, "`wavelengths`"),
        ("wavelengths", 0, nan, "`wavelengths`"),
        ("ndf", 3, nan, "expected 0 to 1e12"),
        ("ndf", 0, -1.0, "expected 0 to 1e12"),
        ("sigma", 2, infinite, "expected 0 to 1e12"),
        ("vndf", 7, -1e-3, "expected 0 to 1e12"),
        ("vndf", 6, 3e38, "expected 0 to 1e12"),
        ("spectra", 9, infinite, "expected at most 1e12"),
        ("spectra", 15, -3e38, "expected at most 1e12"),
    ];
    for &(name, index, value, words) in cases {
        let mut file = File::plain();
        let field = file.0.iter_mut().find(|field| field.0 == name).unwrap();
        field.3[4 * index..4 * index + 4].copy_from_slice(&value.to_le_bytes());
        let error = refusal(&file);
        assert!(error.kind == Malformed && error.message.contains(words), "{name} {value}: {error}");
        let data: usize = file.0.iter().rev().take_while(|field| field.0 != name).map(|field| field.3.len()).sum();
        let start = file.bytes().len() - data - file.0.iter().find(|field| field.0 == name).unwrap().3.len();
        let expected = if name == "wavelengths" { start } else { start + 4 * index };
        assert_eq!(error.position, Some(Position::Byte(expected)), "{error}");
    }
    let mut empty = File::plain();
    empty.floats("vndf", &[1, 2, 2, 2], &[1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    assert!(refusal(&empty).message.contains("slice 1 of `vndf`"));
    // σ of 0 says nothing about the surface there.
    let mut flat = File::plain();
    flat.floats("sigma", &[2, 2], &[0.0; 4]);
    assert!(at(&flat.modelled(), (20.0, 0.0), (30.0, 0.0))[0].is_nan());
}

#[test]
fn azimuths_that_readers_would_misplace_are_refused() {
    for azimuths in [&[0.0, 3.0, 6.2][..], &[0.0, 1.0, 3.1], &[-3.1, -2.0, -1.0], &[0.0, 0.1, 0.2], &[-1.5, -0.5, 0.0]]
    {
        let error = refusal(&File::turned(azimuths));
        assert_eq!(error.kind, Unsupported, "{azimuths:?}: {error}");
        assert!(error.message.contains("expected -180° to 180°"), "{error}");
    }
}

#[test]
fn options_that_do_not_fit_are_refused() {
    let bytes = File::plain().bytes();
    for how in [
        Interpretation { unit: Some(Unit::Candela), ..Interpretation::default() },
        Interpretation { quantity: Some(Quantity::Btdf.into()), ..Interpretation::default() },
    ] {
        let error = read(&bytes, &how).unwrap_err();
        assert!(error.kind == NeedsOption && error.message.contains("expected"), "{error}");
    }
    let mut other = File::plain();
    other.floats("M", &[1], &[1.0]);
    other.floats("wvls", &[1], &[1.0]);
    let error = refusal(&other);
    assert!(error.kind == Unsupported && error.message.contains("KAIST"), "{error}");
}
