//! `NumPy` arrays (`.npy`, versions 1 to 3) with a manifest of their axes, read and written.

pub(super) mod about;
mod array;
mod element;
mod header;
mod refusal;
mod rows;
mod write;

pub(super) use about::NAME;
pub use rows::ArrayRows;
pub use write::{npy_header, write_npy};

use super::acquisition::{Acquisition, ParseReport};
use super::error::{FormatError, FormatErrorKind};
use super::interpretation::Interpretation;
use super::manifest;
use super::reader::{FACTOR, Reader, Sample};
use about::{ABOUT, MAGIC};
use array::{Array, read_array};

pub(super) const READER: Reader = Reader {
    about: ABOUT,
    options: &["axes", FACTOR],
    probe: |sample: &Sample<'_>| if sample.bytes.starts_with(MAGIC) { 100 } else { 0 },
    read,
};

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let mut report = ParseReport::default();
    let Array { shape, samples } = read_array(bytes, &mut report)?;
    let Some(axes) = &how.axes else {
        return Err(FormatError::new(
            FormatErrorKind::NeedsOption,
            NAME,
            format!(
                "an array of shape {shape:?} says nothing about its axes, expected a manifest (`axes`, or \
                 NAME.axes.json beside it) such as {{\"quantity\": \"brdf\", \"axes\": [\"hemi:1\", \"hemi:4\", \
                 \"lambda:380:5:75\"]}}"
            ),
        ));
    };
    manifest::interpret(axes, &shape, samples, how, report)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::{Position, Samples};
    use serde_json::json;

    fn file(version: u8, header: &str, body: &[u8]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend_from_slice(&[version, 0]);
        if version == 1 {
            bytes.extend_from_slice(&(header.len() as u16).to_le_bytes());
        } else {
            bytes.extend_from_slice(&(header.len() as u32).to_le_bytes());
        }
        bytes.extend_from_slice(header.as_bytes());
        bytes.extend_from_slice(body);
        bytes
    }

    fn header(descr: &str, fortran: &str, shape: &str) -> String {
        format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n")
    }

    fn samples(bytes: &[u8]) -> Result<(Vec<usize>, Vec<f32>), FormatError> {
        read_array(bytes, &mut ParseReport::default()).map(|array| (array.shape, array.samples))
    }

    #[test]
    fn what_is_written_reads_back() {
        for shape in [vec![6], vec![2, 3], vec![1, 2, 1, 3]] {
            let values = [1.5, -2.0, f32::NAN, f32::MAX, f32::MIN_POSITIVE / 8.0, 0.0];
            let bytes = write_npy(&shape, &values);
            assert_eq!((bytes.len() - 24) % 64, 0);
            let (found_shape, found) = samples(&bytes).unwrap();
            assert_eq!(found_shape, shape);
            assert!(found.iter().zip(&values).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
    }

    #[test]
    fn every_number_type_reads_as_its_values() {
        let halves: [u16; 3] = [0x3C00, 0xC000, 0x0001];
        let all: Vec<(&str, Vec<u8>, Vec<f32>)> = vec![
            ("<f4", [1.0_f32, -2.5].iter().flat_map(|v| v.to_le_bytes()).collect(), vec![1.0, -2.5]),
            (">f4", [1.0_f32, -2.5].iter().flat_map(|v| v.to_be_bytes()).collect(), vec![1.0, -2.5]),
            ("<f8", [1.0_f64, -0.1].iter().flat_map(|v| v.to_le_bytes()).collect(), vec![1.0, -0.1]),
            (">f8", [1.0_f64, -0.1].iter().flat_map(|v| v.to_be_bytes()).collect(), vec![1.0, -0.1]),
            ("<f2", halves.iter().flat_map(|v| v.to_le_bytes()).collect(), vec![1.0, -2.0, 5.960_464_5e-8]),
            ("<i2", [-3_i16, 400].iter().flat_map(|v| v.to_le_bytes()).collect(), vec![-3.0, 400.0]),
            (">i4", [-3_i32, 70_000].iter().flat_map(|v| v.to_be_bytes()).collect(), vec![-3.0, 70_000.0]),
            ("<u4", u32::MAX.to_le_bytes().to_vec(), vec![4_294_967_296.0]),
            ("|u1", vec![0, 255], vec![0.0, 255.0]),
            ("|i1", vec![0, 255], vec![0.0, -1.0]),
            ("<i8", (-5_i64).to_le_bytes().to_vec(), vec![-5.0]),
        ];
        for (descr, body, values) in all {
            let bytes = file(1, &header(descr, "False", &format!("({},)", values.len())), &body);
            assert_eq!(samples(&bytes).unwrap().1, values, "{descr}");
        }
    }

    #[test]
    fn fortran_order_is_turned_to_row_major() {
        let body: Vec<u8> = (0..24).map(|i| i as u8).collect();
        let (_, found) = samples(&file(2, &header("|u1", "True", "(2, 3L, 4)"), &body)).unwrap();
        let expected: Vec<f32> =
            (0..24).map(|i| (i / 12, i / 4 % 3, i % 4)).map(|(a, b, c)| (a + 2 * (b + 3 * c)) as f32).collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn hostile_headers_are_refused_before_anything_is_allocated() {
        use FormatErrorKind::{Malformed, OverLimit, Unsupported};
        let v1 = |descr: &str, shape: &str| file(1, &header(descr, "False", shape), &[0; 1000]);
        let mut endless = file(2, &header("<f4", "False", "(1,)"), &[0; 4]);
        endless[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
        let raw = |text: &str| file(1, text, &[0; 4]);
        for (bytes, kind) in [
            (v1("<f4", "(100000000000,)"), OverLimit),
            (v1("<f4", "(18446744073709551615, 18446744073709551615)"), OverLimit),
            (v1("<f4", "(99999999999999999999999,)"), Malformed),
            (v1("<f4", "(1, 1, 1, 1, 1, 1, 1, 1, 1)"), OverLimit),
            (v1("<f4", "(1073741824,)"), OverLimit),
            (v1("<f4", "(251,)"), Malformed),
            (v1("<f4", "(249,)"), Malformed),
            (v1("<f4", "()"), Malformed),
            (v1("<f4", "(0,)"), Malformed),
            (v1("<f4", "(-1,)"), Malformed),
            (v1("|O", "(1,)"), Unsupported),
            (v1("<c8", "(1,)"), Unsupported),
            (v1("<U8", "(1,)"), Unsupported),
            (v1("\u{e9}", "(1,)"), Unsupported),
            (endless, OverLimit),
            (file(4, &header("<f4", "False", "(1,)"), &[0; 4]), Unsupported),
            (raw("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (1,)}"), Unsupported),
            (raw("{'descr': '<f4', 'fortran_order': False}"), Malformed),
            (raw("{'descr': '<f4', 'descr': '<f4', 'fortran_order': False, 'shape': (1,)}"), Malformed),
            (raw("{'descr': '<f4', 'fortran_order': Maybe, 'shape': (1,)}"), Malformed),
            (raw("{'descr': '<f4', 'fortran_order': False, 'shape': (1,)} x"), Malformed),
            (raw("{'other': 1}"), Malformed),
            (raw("'"), Malformed),
            (MAGIC.to_vec(), Malformed),
        ] {
            let error = samples(&bytes).unwrap_err();
            assert_eq!(error.kind, kind, "{error}");
        }
    }

    #[test]
    fn infinities_have_a_position_and_nan_is_masked() {
        let bytes = write_npy(&[3], &[f32::NAN, 1.0, 2.0]);
        assert!(samples(&bytes).unwrap().1[0].is_nan());
        let body: Vec<u8> = [1.0, f64::NEG_INFINITY].iter().flat_map(|v| v.to_le_bytes()).collect();
        let bytes = file(1, &header("<f8", "False", "(2,)"), &body);
        let error = samples(&bytes).unwrap_err();
        assert_eq!(error.position, Some(Position::Byte(bytes.len() - 8)));
        assert!(error.message.contains("sample 1 is -inf"), "{error}");
        // Finite as float64, not as float32.
        let bytes = file(1, &header("<f8", "False", "(1,)"), &1e39_f64.to_le_bytes());
        assert!(samples(&bytes).unwrap_err().message.contains("1e39"));
    }

    #[test]
    fn an_array_without_a_manifest_says_what_it_needs() {
        let bytes = write_npy(&[4, 3], &[0.0; 12]);
        let error = read(&bytes, &Interpretation::default()).unwrap_err();
        assert_eq!(error.kind, FormatErrorKind::NeedsOption);
        assert!(error.message.contains("[4, 3]") && error.message.contains("hemi:4"), "{error}");
        let axes = Some(json!({"quantity": "edf", "axes": ["hemi:0", "rgb"]}));
        let read = read(&bytes, &Interpretation { axes, ..Interpretation::default() }).unwrap();
        assert!(matches!(read.samples, Samples::OnAxes { .. }));
    }
}
