//! Reads and writes the codes of axis transforms in a header.

use crate::codec::{CodecError, Reader, Writer};
use crate::transform::{AxisTransform, Boundary, LineBasis, SphereBasis, Weights};

/// Numbers that stand for axis transforms in a file, for all but wavelets along an axis of ordered entries.
const FIXED: [(u64, AxisTransform); 4] = [
    (0, AxisTransform::Identity),
    (1, AxisTransform::Sphere(SphereBasis::BioHaar)),
    (2, AxisTransform::Sphere(SphereBasis::Orthonormal(Weights::Area))),
    (3, AxisTransform::Sphere(SphereBasis::Orthonormal(Weights::Count))),
];

/// Number that stands for the first wavelet basis on a line (axis of ordered entries such as wavelengths) in a file.
/// The one for the basis with code n is larger by n.
const FIRST_LINE: u64 = 16;

/// Writes the number that stands for an axis transform in a file.
pub(super) fn write_transform(w: &mut Writer, transform: AxisTransform) {
    if let AxisTransform::Line { basis, boundary } = transform {
        w.varint(FIRST_LINE + u64::from(basis.code()));
        w.u8(boundary.code());
    } else {
        w.varint(FIXED.iter().find(|(_, known)| *known == transform).map_or(0, |(code, _)| *code));
    }
}

/// Reads the number that stands for an axis transform in a file; rejects unknown ones.
pub(super) fn read_transform(r: &mut Reader<'_>) -> Result<AxisTransform, CodecError> {
    let code = r.varint("transform")?;
    if let Some((_, transform)) = FIXED.iter().find(|(known, _)| *known == code) {
        return Ok(*transform);
    }
    let number = code.checked_sub(FIRST_LINE).and_then(|number| u16::try_from(number).ok());
    let Some(basis) = number.and_then(LineBasis::from_code) else {
        return Err(r.malformed(format!("the code {code} of an axis transform is unknown")));
    };
    let rule = r.u8("boundary rule")?;
    let boundary = Boundary::from_code(rule)
        .ok_or_else(|| r.malformed(format!("the code {rule} of the boundary rule of a wavelet is unknown")))?;
    Ok(AxisTransform::Line { basis, boundary })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_transform_is_read_as_it_was_written() {
        let lines = LineBasis::all()
            .flat_map(|basis| Boundary::ALL.iter().map(move |&boundary| AxisTransform::Line { basis, boundary }));
        for transform in FIXED.into_iter().map(|(_, transform)| transform).chain(lines) {
            let mut w = Writer::default();
            write_transform(&mut w, transform);
            assert_eq!(read_transform(&mut Reader::new(&w.into_bytes(), 0)), Ok(transform));
        }
        for bytes in [[9, 0], [16, 5]] {
            assert!(matches!(read_transform(&mut Reader::new(&bytes, 0)), Err(CodecError::Malformed { .. })));
        }
    }
}
