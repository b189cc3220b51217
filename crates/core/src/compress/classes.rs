//! Classes of samples (positive, negative, zero, masked): their chunk, and their effect on decoded magnitudes.

use super::header::Header;
use super::rd::gridded::Shape;
use super::rows::lanes;
use crate::codec::{ChunkKind, Class, Decoder, Encoder, code_classes, code_grid_classes, code_wide_classes};
use crate::domain::Axis;

/// Encodes the class (positive, negative, zero or masked) of every sample as a chunk; `None` if all are positive.
pub(super) fn classes_chunk(axes: &[Axis], classes: &mut [Class]) -> Option<(ChunkKind, Vec<u8>)> {
    if classes.iter().all(|&class| class == Class::Positive) {
        return None;
    }
    let mut encoder = Encoder::default();
    let Some(shape) = Shape::of(axes) else {
        code_classes(&mut encoder, lanes(axes), classes);
        return Some((ChunkKind::Classes, encoder.finish()));
    };
    // The narrow contexts have less to learn, and programs of before can read them.
    let (grid, mut wide) = (shape.class_grid(), Encoder::default());
    code_grid_classes(&mut encoder, &grid, classes);
    code_wide_classes(&mut wide, &grid, classes);
    let (narrow, wide) = (encoder.finish(), wide.finish());
    // The flag of the wide ones lengthens the header by a byte.
    Some(if wide.len() + 1 < narrow.len() { (ChunkKind::WideClasses, wide) } else { (ChunkKind::Classes, narrow) })
}

/// Decodes the class (positive, negative, zero or masked) of every sample; `None` if the file states that all are
/// positive.
pub(super) fn classes_of<'a>(header: &Header, chunk: impl Fn(ChunkKind) -> Option<&'a [u8]>) -> Option<Vec<Class>> {
    let kind = header.classes?;
    let mut classes = vec![Class::Positive; header.axes.iter().map(Axis::len).product()];
    let decoder = &mut Decoder::new(chunk(kind).unwrap_or_default());
    match Shape::of(&header.axes) {
        Some(shape) if kind == ChunkKind::WideClasses => code_wide_classes(decoder, &shape.class_grid(), &mut classes),
        Some(shape) => code_grid_classes(decoder, &shape.class_grid(), &mut classes),
        None => code_classes(decoder, lanes(&header.axes), &mut classes),
    }
    Some(classes)
}

/// Turns decoded magnitudes into samples by the class of each sample: positive ones stay, negative ones change sign,
/// zeros become 0 and masked ones NaN.
pub(super) fn apply_classes(classes: &[Class], samples: &mut [f32]) {
    for (sample, &class) in samples.iter_mut().zip(classes) {
        *sample = sample_of(class, *sample);
    }
}

/// Returns the sample of a decoded magnitude.
#[inline]
pub(super) fn sample_of(class: Class, magnitude: f32) -> f32 {
    match class {
        Class::Positive => magnitude,
        Class::Negative => -magnitude,
        Class::Zero => 0.0,
        Class::Masked => f32::NAN,
    }
}
