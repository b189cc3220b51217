//! Classes of samples (positive, negative, zero, masked): their chunk, and their effect on decoded magnitudes.

use super::header::Header;
use super::rd::gridded::Shape;
use super::rows::lanes;
use crate::codec::{BitCoder, ChunkKind, Class, Decoder, Encoder, code_classes, code_grid_classes};
use crate::domain::Axis;

/// Encodes the class (positive, negative, zero or masked) of every sample as a chunk; `None` if all are positive.
pub(super) fn classes_chunk(axes: &[Axis], classes: &mut [Class]) -> Option<(ChunkKind, Vec<u8>)> {
    if classes.iter().all(|&class| class == Class::Positive) {
        return None;
    }
    let mut encoder = Encoder::default();
    code(&mut encoder, axes, classes);
    Some((ChunkKind::Classes, encoder.finish()))
}

/// Decodes the class (positive, negative, zero or masked) of every sample; `None` if the file states that all are
/// positive.
pub(super) fn classes_of<'a>(header: &Header, chunk: impl Fn(ChunkKind) -> Option<&'a [u8]>) -> Option<Vec<Class>> {
    header.has_classes.then(|| {
        let mut classes = vec![Class::Positive; header.axes.iter().map(Axis::len).product()];
        let coded = chunk(ChunkKind::Classes).unwrap_or_default();
        code(&mut Decoder::new(coded), &header.axes, &mut classes);
        classes
    })
}

/// Codes the class (positive, negative, zero or masked) of every sample. On grids of angles the context is the
/// neighbours on every axis.
fn code<C: BitCoder>(coder: &mut C, axes: &[Axis], classes: &mut [Class]) {
    match Shape::of(axes) {
        Some(shape) => code_grid_classes(coder, &shape.class_grid(), classes),
        None => code_classes(coder, lanes(axes), classes),
    }
}

/// Turns decoded magnitudes into samples by the class of each sample: positive ones stay, negative ones change sign,
/// zeros become 0 and masked ones NaN.
pub(super) fn apply_classes(classes: &[Class], samples: &mut [f32]) {
    for (sample, class) in samples.iter_mut().zip(classes) {
        match class {
            Class::Positive => {}
            Class::Negative => *sample = -*sample,
            Class::Zero => *sample = 0.0,
            Class::Masked => *sample = f32::NAN,
        }
    }
}
