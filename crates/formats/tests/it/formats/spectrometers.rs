//! Files of spectrometers and light meters, compared with numbers written out here; `tests/formats/spectrometers.py`
//! made the files and compares every value.

use super::{file, fixture, has_note, metadata, tensor, wavelengths};
use wavelume_core::domain::{Quantity, Unit};
use wavelume_formats::formats::{Acquisition, FormatErrorKind, Interpretation, NoteKind, Overlap, read};

fn of(name: &str) -> Acquisition {
    fixture(&format!("tests/fixtures/spectrometers/{name}"))
}

fn value(found: &Acquisition, nm: f64) -> f32 {
    let at = wavelengths(found).iter().position(|&listed| listed == nm).unwrap();
    tensor(found).1[at]
}

#[test]
fn asd_files_give_the_target_over_the_white_reference() {
    let field = of("field.asd");
    assert_eq!((field.format, field.quantity, field.unit), ("asd", Quantity::Reflectance, Unit::One));
    assert_eq!(field.dialect, "version 7, 24 wavelengths, saved as reflectance");
    let nm = wavelengths(&field);
    assert_eq!((nm[0], nm[1], nm[23]), (350.0, 375.0, 925.0));
    // 1846 / 11536 and 10370 / 30500.
    assert_eq!((value(&field, 425.0), value(&field, 650.0)), ((1846.0 / 11536.0) as f32, 0.34));
    assert_eq!((metadata(&field, "description"), metadata(&field, "SWIR2 gain")), ("gravel, dry", "700"));
    assert!(has_note(&field, NoteKind::Skipped, "40 bytes after the spectra"));
    assert!(has_note(&field, NoteKind::Assumed, "relative to a white reference panel"));
    let raw = of("raw.asd");
    assert_eq!((raw.quantity, value(&raw, 650.0)), (Quantity::Reflectance, 0.34));
    assert!(has_note(&raw, NoteKind::Assumed, "raw counts, divided by those of the white reference"));
}

#[test]
fn signatures_are_joined_where_detectors_overlap() {
    let field = of("field.sig");
    assert_eq!((field.format, field.quantity, field.unit), ("svc", Quantity::Reflectance, Unit::One));
    assert_eq!((value(&field, 1004.0), value(&field, 1006.0)), (0.2208, 0.2512));
    assert!(has_note(&field, NoteKind::Assumed, "the ranges of two detectors overlap from 985 to 1004"));
    let how = Interpretation { overlap: Some(Overlap::Longer), ..Interpretation::default() };
    let longer = read(&file("tests/fixtures/spectrometers/field.sig"), &how).unwrap();
    assert_eq!((value(&longer, 980.0), value(&longer, 985.0)), (0.216, 0.247));
    let how = Interpretation { column: Some("target".to_owned()), ..Interpretation::default() };
    let target = read(&file("tests/fixtures/spectrometers/field.sig"), &how).unwrap();
    assert_eq!((target.quantity, value(&target, 900.0)), (Quantity::Spectrum, 380.0));
    // The option has no meaning for a file of one column.
    let error = read(&file("tests/fixtures/spectrometers/led.spectrum"), &how).unwrap_err();
    assert_eq!(error.kind, FormatErrorKind::NeedsOption);
}

#[test]
fn light_meters_and_speos_give_spectra_of_light() {
    let meter = of("meter.csv");
    assert_eq!((meter.format, meter.quantity, meter.unit), ("sekonic", Quantity::Spectrum, Unit::Relative));
    assert_eq!((wavelengths(&meter).len(), value(&meter, 392.0)), (21, 0.001));
    assert_eq!((metadata(&meter, "Tcp [K]"), metadata(&meter, "Title")), ("3000", "made up"));
    assert!(has_note(&meter, NoteKind::Skipped, "5 wavelengths beside a finer one of 21"));
    let led = of("led.spectrum");
    assert_eq!((led.format, led.quantity, value(&led, 600.0)), ("speos", Quantity::Spectrum, 97.26));
    assert!(has_note(&led, NoteKind::Assumed, "percent of a maximum"));
}
