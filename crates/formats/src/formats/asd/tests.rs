//! Files of every version and kind of numbers, made here byte by byte, and files that are broken or no measurement.

use super::about::NAME;
use super::header::LENGTH;
use crate::domain::{Axis, Quantity, Unit};
use crate::formats::{
    Acquisition, FormatError, FormatErrorKind, Interpretation, Position, Samples, StatedQuantity, read,
};
use std::f32::consts::PI;

/// Values of the spectrum and of the white reference in the files of these tests.
const TARGET: [f64; 5] = [100.0, 300.0, 500.0, 0.0, -8.0];
const WHITE: [f64; 5] = [1000.0, 1200.0, 1000.0, 500.0, 0.0];

/// Returns the numbers as a file stores them.
fn stored(values: &[f64], element: u8) -> Vec<u8> {
    let number = |value: &f64| match element {
        0 => (*value as f32).to_le_bytes().to_vec(),
        1 => (*value as i32).to_le_bytes().to_vec(),
        _ => value.to_le_bytes().to_vec(),
    };
    values.iter().flat_map(number).collect()
}

/// Returns a file of a version, a kind of data and a format of numbers; from version 2 on with a white reference.
fn file(mark: [u8; 3], kind: u8, element: u8) -> Vec<u8> {
    let mut file = vec![0; LENGTH];
    file[..3].copy_from_slice(&mark);
    file[3..10].copy_from_slice(b"a panel");
    for (index, part) in [9_u16, 8, 7, 26, 10, 126].into_iter().enumerate() {
        file[160 + 2 * index..][..2].copy_from_slice(&part.to_le_bytes());
    }
    file[181] = 1;
    file[186] = kind;
    file[191..195].copy_from_slice(&350.0_f32.to_le_bytes());
    file[195..199].copy_from_slice(&1.5_f32.to_le_bytes());
    file[199] = element;
    file[204..206].copy_from_slice(&5_u16.to_le_bytes());
    file[390..394].copy_from_slice(&17_u32.to_le_bytes());
    file[400..402].copy_from_slice(&6005_u16.to_le_bytes());
    file[431] = 4;
    file.extend(stored(&TARGET, element));
    if mark != *b"ASD" {
        file.extend([0xff, 0xff]);
        file.extend([0; 16]);
        file.extend([3, 0]);
        file.extend(b"dry");
        file.extend(stored(&WHITE, element));
    }
    file
}

fn with(quantity: Option<StatedQuantity>) -> Interpretation {
    Interpretation { quantity, ..Interpretation::default() }
}

fn plain(file: &[u8]) -> Result<Acquisition, FormatError> {
    read(file, &with(None))
}

fn values(found: &Acquisition) -> Vec<f32> {
    let Samples::OnAxes { tensor, .. } = &found.samples else { panic!("on axes") };
    tensor.samples().to_vec()
}

fn notes(found: &Acquisition) -> String {
    found.report.notes.iter().map(|note| note.message.as_str()).collect::<Vec<_>>().join("; ")
}

#[test]
fn reflectance_is_the_quotient_of_the_target_and_the_white_reference() {
    for mark in [*b"as2", *b"as3", *b"as4", *b"as5", *b"as6", *b"as7", *b"as8"] {
        for element in 0..3 {
            for kind in [0, 1, 6] {
                let found = plain(&file(mark, kind, element)).unwrap();
                assert_eq!((found.format, found.quantity, found.unit), (NAME, Quantity::Reflectance, Unit::One));
                let values = values(&found);
                assert_eq!(&values[..4], [0.1, 0.25, 0.5, 0.0]);
                assert!(values[4].is_nan() && notes(&found).contains("1 wavelength at which the white reference is 0"));
                assert_eq!(notes(&found).contains("raw counts, divided"), kind == 0, "{}", notes(&found));
            }
        }
    }
    let found = plain(&file(*b"as7", 1, 2)).unwrap();
    let Samples::OnAxes { tensor, .. } = &found.samples else { panic!("on axes") };
    let [Axis::Wavelength(grid)] = tensor.axes() else { panic!("wavelengths") };
    assert_eq!(grid.values(), [350.0, 351.5, 353.0, 354.5, 356.0]);
    let fields: Vec<(&str, &str)> = found.report.metadata.iter().map(|(key, value)| (&key[..], &value[..])).collect();
    assert_eq!(
        fields,
        [
            ("comment", "a panel"),
            ("saved", "2026-11-26 07:08:09"),
            ("saved as", "reflectance"),
            ("instrument", "FSFR 6005"),
            ("integration time (ms)", "17"),
            ("description", "dry"),
        ]
    );
    let factor = read(&file(*b"as7", 1, 2), &with(Some(StatedQuantity::ReflectanceFactor))).unwrap();
    assert_eq!((factor.quantity, values(&factor)[2]), (Quantity::Brdf, 0.5 / PI));
}

#[test]
fn counts_are_kept_or_refused_and_light_is_told_from_counts() {
    // Version 1 holds the quotient itself.
    let old = plain(&file(*b"ASD", 1, 0)).unwrap();
    assert_eq!((old.quantity, values(&old)[1]), (Quantity::Reflectance, 300.0));
    for (file, quantity) in [(file(*b"ASD", 0, 0), None), (file(*b"ASD", 0, 0), Some(StatedQuantity::Reflectance))] {
        let error = read(&file, &with(quantity)).unwrap_err();
        assert_eq!(error.kind, FormatErrorKind::NeedsOption);
        assert!(error.message.contains("quantity spectrum"), "{error}");
    }
    let counts = read(&file(*b"as7", 0, 2), &with(Some(StatedQuantity::Spectrum))).unwrap();
    assert_eq!((counts.quantity, values(&counts)[4]), (Quantity::Spectrum, -8.0));
    assert!(notes(&counts).contains("raw signal"));
    for (kind, unit) in [(2, "radiance in W/m²/sr/nm"), (4, "irradiance in W/m²/nm")] {
        let error = plain(&file(*b"as7", kind, 2)).unwrap_err();
        assert_eq!(error.kind, FormatErrorKind::Unsupported, "{error}");
        assert!(error.message.contains("quantity reflectance divides"), "{error}");
        let ratio = read(&file(*b"as7", kind, 2), &with(Some(StatedQuantity::Reflectance))).unwrap();
        assert_eq!(values(&ratio)[1], 0.25);
        let mut light = file(*b"as7", kind, 2);
        light[LENGTH..LENGTH + 40].copy_from_slice(&stored(&[0.1, 0.2, 0.3, 0.25, 0.125], 2));
        let light = plain(&light).unwrap();
        assert_eq!((light.quantity, light.unit, values(&light)[4]), (Quantity::Spectrum, Unit::Relative, 0.125));
        assert!(notes(&light).contains(unit), "{}", notes(&light));
    }
    for kind in [3, 5, 7, 8] {
        let error = plain(&file(*b"as7", kind, 2)).unwrap_err();
        assert!(error.kind == FormatErrorKind::Unsupported && error.message.contains("saved as"), "{error}");
        assert_eq!(values(&read(&file(*b"as7", kind, 2), &with(Some(StatedQuantity::Spectrum))).unwrap())[1], 300.0);
    }
    let mut divided = file(*b"as7", 1, 2);
    divided[LENGTH..LENGTH + 40].copy_from_slice(&stored(&[0.1, 0.2, 0.3, 0.25, 0.125], 2));
    let error = plain(&divided).unwrap_err();
    assert!(error.message.contains("values up to 0.3 beside a white reference up to 1200"), "{error}");
}

#[test]
fn what_the_instrument_reports_is_a_warning() {
    let mut odd = file(*b"as8", 1, 2);
    odd[181] = 0;
    odd[422] = 0b101;
    odd[444..448].copy_from_slice(&351.5_f32.to_le_bytes());
    odd.extend([1, 2, 3]);
    let found = notes(&plain(&odd).unwrap());
    for words in [
        "the dark signal was not subtracted",
        "saturated detectors: VNIR, SWIR2",
        "3 bytes after the spectra",
        // 0.1, 0.25 | 0.5, 0: the slopes beside the step are 0.15 and -0.5, their mean -0.175; (0.25 + 0.175) / 0.375.
        "a step of 113.3 % from 351.5 to 353 nm",
    ] {
        assert!(found.contains(words), "{words}: {found}");
    }
}

#[test]
fn refusals_say_the_byte_and_what_was_expected() {
    let good = file(*b"as7", 1, 2);
    let changed = |at: usize, bytes: &[u8]| {
        let mut file = good.clone();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        file
    };
    let after = LENGTH + 40;
    for (file, byte, words) in [
        (good[..100].to_vec(), 100, "expected a header of 484"),
        (changed(186, &[9]), 186, "found 9 as the kind of data, expected 0 to 8"),
        (changed(199, &[3]), 199, "found 3 as the format of numbers"),
        (changed(204, &[0, 0]), 204, "found 0 as the number of channels"),
        (changed(204, &[0xff, 0xff]), good.len(), "expected the spectrum of 65535 numbers of 8 bytes from byte 484"),
        (changed(191, &f32::NAN.to_le_bytes()), 191, "first wavelength NaN"),
        (changed(195, &(-1.0_f32).to_le_bytes()), 195, "distance of wavelengths -1"),
        (changed(after, &[2, 0]), after, "found 0x0002, expected 0 or 0xffff"),
        (good[..after + 19].to_vec(), after + 19, "the file ends, expected 20 bytes from byte 524"),
        (good[..good.len() - 1].to_vec(), good.len() - 1, "expected the white reference of 5 numbers"),
        (changed(after + 18, &[0xff, 0xff]), good.len(), "expected the white reference"),
    ] {
        let error = plain(&file).unwrap_err();
        assert_eq!((error.kind, error.format), (FormatErrorKind::Malformed, NAME), "{error}");
        assert_eq!(error.position, Some(Position::Byte(byte)), "{error}");
        assert!(error.message.contains(words), "{words}: {error}");
    }
    let error = plain(&changed(after, &[0, 0])).unwrap_err();
    assert!(
        error.kind == FormatErrorKind::NeedsOption && error.message.contains("without a white reference"),
        "{error}"
    );
    let error = read(&good, &with(Some(StatedQuantity::Edf))).unwrap_err();
    assert!(error.kind == FormatErrorKind::NeedsOption && error.message.contains("quantity edf"), "{error}");
    let zeros = plain(&changed(after + 23, &[0; 40])).unwrap_err();
    assert!(zeros.message.contains("a white reference of zeros beside reflectance"), "{zeros}");
    let none = stored(&[f64::NAN; 5], 2);
    assert!(plain(&changed(LENGTH, &none)).unwrap_err().message.contains("values up to 0 beside"));
}

#[test]
fn no_length_and_no_byte_makes_it_panic() {
    for mark in [*b"ASD", *b"as8"] {
        let good = file(mark, 1, 2);
        for cut in 0..good.len() {
            let _ = plain(&good[..cut]);
        }
        for at in 0..good.len() {
            for byte in [1, 0xff] {
                let mut file = good.clone();
                file[at] = byte;
                let _ = plain(&file);
            }
        }
    }
}

#[test]
fn a_file_is_known_by_its_content_in_an_archive() {
    use std::io::Write;
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    zip.start_file("scans/gravel.000", zip::write::SimpleFileOptions::default()).unwrap();
    zip.write_all(&file(*b"as8", 1, 2)).unwrap();
    zip.start_file("readme.txt", zip::write::SimpleFileOptions::default()).unwrap();
    zip.write_all(b"gravel in the sun").unwrap();
    let found = plain(&zip.finish().unwrap().into_inner()).unwrap();
    assert_eq!((found.format, values(&found)[1]), (NAME, 0.25));
}

#[test]
fn text_that_begins_with_the_same_letters_is_text() {
    let rows: Vec<String> = (0..60).map(|i| format!("{}\t0.{:03}", 350 + i, 100 + i)).collect();
    let text = format!("ASD spectrum file\0\0\0\0\nWavelength\tReflectance\n{}\n", rows.join("\n"));
    assert!(text.len() > LENGTH);
    assert_eq!(plain(text.as_bytes()).unwrap().format, "spectral-table");
    assert!(plain(b"as9\0\0\0").is_err());
}
