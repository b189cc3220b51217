//! First number of a pyramid chunk after its levels: model, streams and symmetries.

use super::super::chart::ChartKind;
use super::super::shape::Shape;
use super::super::symmetry::Group;
use crate::codec::{CodecError, Reader};
use crate::domain::Symmetry;

/// Options with which samples on triangles were coded: scattering model, with or without coded details; symmetries; and
/// a single byte stream, or one for each incoming direction.
pub(super) struct Opening {
    pub(super) model: Option<ChartKind>,
    pub(super) alone: bool,
    pub(super) random: bool,
    pub(super) group: Group,
}

impl Opening {
    pub(super) fn read(shape: &Shape, r: &mut Reader<'_>) -> Result<Self, CodecError> {
        let known = Symmetry::of(shape.mesh().domain());
        let base = known.len() as u64 + 1;
        let first = r.varint("model and symmetries")?;
        let mut number = first >> 4;
        let mut generators = Vec::new();
        while number > 0 {
            let digit = (number % base).checked_sub(1).map(|digit| known[digit as usize]);
            generators.push(digit.ok_or_else(|| {
                r.malformed(
                    "the number that encodes the symmetries in the pyramid chunk has a digit 0, which stands for none",
                )
            })?);
            number /= base;
        }
        let group = Group::of(shape, &generators).ok_or_else(|| {
            r.malformed("a symmetry in the pyramid chunk maps directions of the material out of their domain")
        })?;
        let (alone, random) = (first >> 2 & 1 == 1, first >> 3 & 1 == 1);
        Ok(Self { model: ChartKind::from_code((first & 3) as u8), alone, random, group })
    }
}

/// Encodes the generators of a symmetry group as one number, whose digits are the generators' places in the list of all
/// symmetries; 0 without any.
pub(super) fn number_of(shape: &Shape, generators: &[Symmetry]) -> u64 {
    let known = Symmetry::of(shape.mesh().domain());
    let digits = generators.iter().rev().filter_map(|g| known.iter().position(|k| k == g));
    digits.fold(0, |number, digit| number * (known.len() as u64 + 1) + digit as u64 + 1)
}
