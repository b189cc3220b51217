//! Streams written by another library, the same measurement three times; damage to every byte of them; refusals.

use super::*;
use crate::formats::{AngleGrid, Samples, read as read_any};

const WIDE: &[u8] = include_bytes!("../../../../../../tests/fixtures/arrow/wide.arrows");
const LONG: &[u8] = include_bytes!("../../../../../../tests/fixtures/arrow/long.arrows");
/// Arrow stream, written by another library, with samples at forty scattered directions and their uncertainties.
const UNCERTAIN: &[u8] = include_bytes!("../../../../../../tests/fixtures/arrow/uncertain.arrows");
const FILE_OF_LISTS: &[u8] = include_bytes!("../../../../../../tests/fixtures/arrow/lists.arrow");

fn plain(bytes: &[u8]) -> Result<Acquisition, FormatError> {
    read_any(bytes, &Interpretation::default())
}

fn grid(acquisition: Acquisition) -> AngleGrid {
    match acquisition.samples {
        Samples::Grid(grid) => grid,
        other => panic!("expected a grid, found {other:?}"),
    }
}

/// Returns the BRDF in sr⁻¹ of the test files at two polar angles in degrees (incoming, outgoing) and a wavelength in
/// nm. The script that wrote the files used this formula, and rounded to float32.
fn expected(theta_i: f64, theta_o: f64, lambda: f64) -> f32 {
    (0.1 + theta_i * 0.001 + theta_o * 0.002 + lambda * 1e-4) as f32
}

#[test]
fn columns_lists_and_rows_of_one_value_are_the_same_measurement() {
    let (wide, lists, long) = (plain(WIDE).unwrap(), plain(FILE_OF_LISTS).unwrap(), plain(LONG).unwrap());
    assert_eq!(wide.dialect, "wide form, 75 rows in 2 batches, a grid of directions");
    assert_eq!(lists.dialect, "wide form, 75 rows in 4 batches, a grid of directions");
    assert_eq!(long.dialect, "long form, 225 rows in 1 batches, a grid of directions");
    assert!(wide.report.metadata.contains(&("sample".to_owned(), "velvet-03".to_owned())));
    assert!(wide.report.notes.iter().any(|note| note.message.contains("`remark`")), "{:?}", wide.report.notes);
    for acquisition in [wide, lists, long] {
        assert_eq!((acquisition.quantity.name(), acquisition.unit.name()), ("brdf", "1/sr"));
        let grid = grid(acquisition);
        let (incoming, outgoing) = (grid.incoming.unwrap(), grid.outgoing.unwrap());
        assert_eq!(incoming.theta, [0.0, 30.0, 60.0]);
        assert_eq!(outgoing.theta, [0.0, 20.0, 40.0, 60.0, 80.0]);
        let lambda = [450.0, 550.0, 650.0];
        let mut values = grid.values.iter();
        for theta_i in incoming.theta {
            for &theta_o in &outgoing.theta {
                for _ in 0..5 {
                    for lambda in lambda {
                        let value = *values.next().unwrap();
                        let wanted = expected(theta_i, theta_o, lambda);
                        // One value of the long form is null, and filled at the pole from its neighbours.
                        assert!((value - wanted).abs() < 1e-6, "{theta_i} {theta_o} {lambda}: {value} {wanted}");
                    }
                }
            }
        }
    }
}

#[test]
fn uncertainties_stay_beside_their_values() {
    let found = plain(UNCERTAIN).unwrap();
    let Samples::Scattered(scattered) = &found.samples else { panic!("{:?}", found.samples) };
    let sigma = scattered.sigma.as_ref().unwrap();
    assert_eq!((scattered.values.len(), sigma.len()), (80, 80));
    for (k, (value, sigma)) in scattered.values.iter().zip(sigma).enumerate() {
        // Values grow by 0.01 from 0.1 and have 2 % each; the script left one out.
        let wanted = (0.1 + 0.01 * k as f64) as f32;
        assert!(
            (value - wanted).abs() < 1e-6 && (k == 7 || (sigma - 0.02 * wanted).abs() < 1e-6),
            "{k}: {value} {sigma}"
        );
    }
    assert!(sigma[7].is_nan());
}

#[test]
fn a_cut_stream_is_refused_wherever_it_is_cut() {
    for bytes in [WIDE, LONG] {
        for cut in (1..bytes.len()).step_by(13).chain(bytes.len() - 8..bytes.len()) {
            // The mark of the end is the last word but for the padding that some writers add.
            let error = plain(&bytes[..cut]).unwrap_err();
            assert!(matches!(error.kind, FormatErrorKind::Malformed | FormatErrorKind::Unrecognised), "{cut}: {error}");
        }
    }
}

#[test]
fn damage_to_any_byte_is_no_panic_and_no_huge_table() {
    for bytes in [WIDE, LONG, FILE_OF_LISTS] {
        for (at, with) in (0..bytes.len()).step_by(7).zip([0x01, 0xFF].into_iter().cycle()) {
            let mut damaged = bytes.to_vec();
            damaged[at] = with;
            if let Ok(acquisition) = plain(&damaged)
                && let Samples::Grid(grid) = acquisition.samples
            {
                assert!(grid.values.len() < 1 << 20);
            }
        }
    }
}

#[test]
fn every_word_of_eight_bytes_set_to_a_hostile_number_is_refused_or_read() {
    for bytes in [WIDE, LONG, FILE_OF_LISTS] {
        let hostile = [u64::MAX, 1 << 63, f64::NAN.to_bits(), 1 << 40].into_iter().cycle();
        for (at, hostile) in (0..bytes.len() - 8).step_by(8).zip(hostile) {
            let mut damaged = bytes.to_vec();
            damaged[at..at + 8].copy_from_slice(&hostile.to_le_bytes());
            let _ = plain(&damaged);
        }
    }
}

#[test]
fn refusals_name_the_place_and_what_was_expected() {
    let replaced = |bytes: &[u8], from: &[u8], to: &[u8]| {
        let at = bytes.windows(from.len()).position(|window| window == from).unwrap();
        let mut changed = bytes.to_vec();
        changed[at..at + to.len()].copy_from_slice(to);
        changed
    };
    let no_wavelengths = replaced(FILE_OF_LISTS, b"450 550 650", b"450 550    ");
    let no_wavelength = replaced(FILE_OF_LISTS, b"450 550 650", b"450 5x0 650");
    let quantity = replaced(WIDE, b"brdf", b"brda");
    let unknown_column = replaced(WIDE, b"theta_o", b"theta_x");
    let text_column = replaced(WIDE, b"remark", b"value ");
    let infinite = replaced(WIDE, &expected(0.0, 0.0, 650.0).to_le_bytes(), &f32::INFINITY.to_le_bytes());
    let steep = replaced(WIDE, &30_f32.to_le_bytes(), &99_f32.to_le_bytes());
    for (bytes, kind, words) in [
        (no_wavelengths, FormatErrorKind::Malformed, "2 wavelengths are stated"),
        (no_wavelength, FormatErrorKind::Malformed, "`5x0`"),
        (quantity, FormatErrorKind::Malformed, "expected spectrum"),
        (unknown_column, FormatErrorKind::Malformed, "theta_o"),
        (text_column, FormatErrorKind::Malformed, "both `value` and columns"),
        (infinite, FormatErrorKind::Malformed, "row 1, column `v650`: found inf"),
        (steep, FormatErrorKind::Malformed, "row 26, column `theta_i`: found 99, expected an angle from 0 to 90"),
        (CONTINUES.repeat(2), FormatErrorKind::OverLimit, "4294967295 bytes"),
        ([CONTINUES, &[0; 4]].concat(), FormatErrorKind::Malformed, "does not begin with a schema"),
        ([CONTINUES, &[16, 0, 0, 0], &[0xFF; 16]].concat(), FormatErrorKind::Malformed, "outside"),
    ] {
        let error = plain(&bytes).unwrap_err();
        assert_eq!((error.kind, error.format), (kind, NAME), "{error}");
        assert!(error.to_string().contains(words), "{error}");
    }
}

#[test]
fn wavelengths_of_float32_are_the_decimals_they_stand_for() {
    let mut values = [550.1_f32.into(), 550.1, 0.55_f32.into(), 400.0];
    decimal_wavelengths(&mut values);
    assert_eq!(values, [550.1, 550.1, 0.55, 400.0]);
}
