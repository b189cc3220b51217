//! Lossless coder of float32: bit patterns as ordered integers, predicted from the sample before and the row above; the
//! residuals are coded.

use super::model::Model;
use super::range::BitCoder;
use super::symbols::coarse;

/// Number of possible bit lengths (0..=33) of a prediction residual of a float32's bit pattern.
const LENGTHS: usize = 34;
const CONTEXTS: usize = LENGTHS * 6;
const BY_BOTH: usize = 0;
const BY_LEFT: usize = LENGTHS * CONTEXTS;
const BY_UP: usize = BY_LEFT + LENGTHS * LENGTHS;
const TOP: usize = BY_UP + LENGTHS * LENGTHS;
const SLOTS: usize = TOP + LENGTHS;

/// Maps the bits of a float to an unsigned integer, so that integers are ordered like the numbers.
fn ordered(bits: u32) -> u32 {
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

fn unordered(value: u32) -> u32 {
    if value >> 31 == 1 { value & !(1 << 31) } else { !value }
}

/// Encodes or decodes float32 samples without loss, in rows of `lanes` samples; a decoder overwrites them. Masked
/// samples (NaN) must be filled by the caller.
///
/// # Panics
/// If the number of samples is not a multiple of `lanes`.
pub(crate) fn code_exact<C: BitCoder>(coder: &mut C, lanes: usize, samples: &mut [f32]) {
    assert_eq!(samples.len() % lanes, 0, "samples come in rows");
    let mut model = Model::new(SLOTS, 1);
    let mut above: Vec<i64> = vec![0; lanes];
    let mut lengths_above = vec![0_usize; lanes];
    let mut first = true;
    for row in samples.chunks_exact_mut(lanes) {
        let (mut left, mut above_left, mut length) = (0_i64, 0_i64, 0_usize);
        for (j, sample) in row.iter_mut().enumerate() {
            let up = above[j];
            let guess = match (first, j) {
                (true, _) => left,
                (false, 0) => up,
                (false, _) => left + up - above_left,
            }
            .clamp(0, i64::from(u32::MAX));
            let actual = i64::from(ordered(sample.to_bits()));
            let residual = code_residual(coder, &mut model, actual - guess, length, lengths_above[j]);
            let value = (guess + residual).clamp(0, i64::from(u32::MAX));
            *sample = f32::from_bits(unordered(value as u32));
            length = bit_length(residual);
            lengths_above[j] = length;
            (left, above_left) = (value, up);
            above[j] = value;
        }
        first = false;
    }
}

fn bit_length(residual: i64) -> usize {
    64 - residual.unsigned_abs().leading_zeros() as usize
}

fn code_residual<C: BitCoder>(coder: &mut C, model: &mut Model, residual: i64, left: usize, up: usize) -> i64 {
    let length = bit_length(residual);
    let both = left * 6 + coarse(up.abs_diff(left) as u32);
    // Unary code of the bit length. Residuals keep their size, so the contexts make most decisions cheap.
    let slots = |at: usize| [BY_BOTH + at * CONTEXTS + both, BY_LEFT + at * LENGTHS + left, BY_UP + at * LENGTHS + up];
    let mut coded = 0;
    while coded < LENGTHS - 1 && model.code(coder, length > coded, slots(coded), 0) {
        coded += 1;
    }
    if coded == 0 {
        return 0;
    }
    let magnitude = residual.unsigned_abs();
    let negative = coder.even(residual < 0);
    let mut value = 1_u64;
    for shift in (0..coded - 1).rev() {
        let bit = magnitude >> shift & 1 == 1;
        let bit = if shift + 2 == coded { model.code_one(coder, bit, TOP + coded) } else { coder.even(bit) };
        value = value << 1 | u64::from(bit);
    }
    if negative { -(value as i64) } else { value as i64 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::range::{Decoder, Encoder};
    use crate::numeric::drawn::list;
    use arbtest::arbtest;

    fn round_trip(lanes: usize, samples: &[f32]) -> usize {
        let mut encoder = Encoder::default();
        code_exact(&mut encoder, lanes, &mut samples.to_vec());
        let bytes = encoder.finish();
        let mut decoded = vec![0.0; samples.len()];
        code_exact(&mut Decoder::new(&bytes), lanes, &mut decoded);
        assert!(samples.iter().zip(&decoded).all(|(a, b)| a.to_bits() == b.to_bits()));
        bytes.len()
    }

    #[test]
    fn every_bit_round_trips() {
        arbtest(|u| {
            let number = |v: f32| if v.is_nan() { 0.0 } else { v };
            let samples = list(u, 60..=60, |u| u.arbitrary().map(number))?;
            for lanes in [1, 5, 60] {
                round_trip(lanes, &samples);
            }
            Ok(())
        });
    }

    #[test]
    fn extremes_and_signed_zeros_round_trip() {
        round_trip(1, &[0.0, -0.0, f32::MAX, f32::MIN, f32::MIN_POSITIVE, -1e-45, 1.0, -1.0]);
    }

    #[test]
    fn smooth_data_shrink() {
        let samples: Vec<f32> = (0..75 * 200).map(|i| 1.0 + 0.001 * (i % 75) as f32 + 0.01 * (i / 75) as f32).collect();
        assert!(round_trip(75, &samples) < samples.len() * 2);
    }

    #[test]
    fn any_bytes_decode_without_panic() {
        for byte in 0..=255_u8 {
            code_exact(&mut Decoder::new(&[byte; 40]), 7, &mut [0.0; 70]);
        }
    }
}
