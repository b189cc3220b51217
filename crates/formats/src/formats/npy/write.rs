//! Arrays of float32 as `NumPy` files, version 1.0.

use super::about::MAGIC;

/// Writes float32 samples as a `NumPy` array file of version 1.0: little-endian, row-major; NaN marks a masked sample.
///
/// # Panics
/// If the shape does not hold as many samples as there are.
pub fn write_npy(shape: &[usize], samples: &[f32]) -> Vec<u8> {
    assert_eq!(shape.iter().product::<usize>(), samples.len(), "an array holds the product of its shape");
    let mut bytes = npy_header(shape);
    bytes.reserve(4 * samples.len());
    for sample in samples {
        bytes.extend_from_slice(&sample.to_le_bytes());
    }
    bytes
}

/// Returns the header of a `NumPy` array file of float32 samples: 128 bytes for any shape of two axes.
pub fn npy_header(shape: &[usize]) -> Vec<u8> {
    let lengths = match shape {
        [only] => format!("({only},)"),
        _ => format!("({})", shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    };
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {lengths}, }}");
    // The data start at a multiple of 64 bytes: magic, two version bytes, a u16 length, the header, a line feed.
    let unpadded = MAGIC.len() + 4 + header.len() + 1;
    header.push_str(&" ".repeat(unpadded.next_multiple_of(64) - unpadded));
    header.push('\n');
    let mut bytes = Vec::with_capacity(MAGIC.len() + 4 + header.len());
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&[1, 0]);
    bytes.extend_from_slice(&(header.len() as u16).to_le_bytes());
    bytes.extend_from_slice(header.as_bytes());
    bytes
}
