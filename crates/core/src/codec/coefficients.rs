//! Coder of a tensor of integers, coarse to fine, row by row, each value in the context of neighbours already coded.
//!
//! A *row* is the last axis (its entries are the *lanes*) at one index of all other axes. An all-zero row costs one
//! decision. In other rows each lane has a nonzero flag and, if it is set, a sign and a magnitude (or the bits of an
//! f32).
//!
//! Contexts are the same lane in up to three rows coded before (the parent along the last row axis, the row before it,
//! the parent along an earlier axis), the lane's parent and predecessor in the same row, and the lane's recent
//! activity.

use super::model::Model;
use super::range::BitCoder;
use super::symbols::{COARSE, FINE, LEVELS, MagnitudeSlots, NONZERO, coarse, code_magnitude, fine};

/// Index that marks a missing neighbour among the coefficients that serve as context of an entropy coder.
pub(crate) const NONE: u32 = u32::MAX;

/// Order in which the rows of a coefficient tensor (runs of its last axis) and the entries of each row (*lanes*) are
/// coded, and the neighbours that serve as context.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
    /// Indices of the rows of the coefficient tensor that are coded, in coding order; all values of other rows are 0.
    pub order: Vec<u32>,
    /// Wavelet level of each row of the coefficient tensor; 0 is the smooth part.
    pub level: Vec<u8>,
    /// Indices of up to three rows of the coefficient tensor that are coded before each row and serve as its context;
    /// [`NONE`] if missing.
    pub neighbours: Vec<[u32; 3]>,
    /// Indices of the entries that are coded in each row of the coefficient tensor, in coding order; all values of
    /// other entries are 0.
    pub lane_order: Vec<u32>,
    /// Wavelet level of each entry of a row of the coefficient tensor; 0 is the smooth part.
    pub lane_level: Vec<u8>,
    /// Indices of the two context entries of each entry of a row (a run of the last axis of the coefficient tensor):
    /// its parent in the wavelet tree, and the entry of the row coded before it. [`NONE`] stands for a missing one.
    pub lane_neighbours: Vec<[u32; 2]>,
}

/// Form in which a nonzero coefficient is coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Payload {
    /// Signed integer: sign and magnitude are coded.
    Integer,
    /// Coefficient as a nonzero float32: the exponent is entropy-coded, sign and mantissa are stored as plain bits.
    Float,
}

const ROW_ZERO: usize = 0;
const ROW_ZERO_SLOTS: usize = 3 * 27 * LEVELS;
const BY_ROWS: usize = ROW_ZERO + ROW_ZERO_SLOTS;
const BY_LANES: usize = BY_ROWS + FINE * LEVELS * LEVELS;
const BY_EACH: usize = BY_LANES + FINE * FINE;
const MAGNITUDE: usize = BY_EACH + COARSE * COARSE * COARSE;
const EXPONENT: usize = MAGNITUDE + MagnitudeSlots::COUNT;
const SLOTS: usize = EXPONENT + 256 * LEVELS;
const ZERO_SET: usize = LEVELS;
const MAGNITUDE_SET: usize = ZERO_SET + LEVELS;
const SETS: usize = MAGNITUDE_SET + MagnitudeSlots::SETS;

/// Encodes or decodes `values`, the coefficients of a tensor as integers: all rows of the tensor, in memory order. A
/// decoder overwrites them.
///
/// # Panics
/// If `rows` does not describe `values`.
pub(crate) fn code_coefficients<C: BitCoder>(coder: &mut C, rows: &Rows, payload: Payload, values: &mut [i32]) {
    let lanes = rows.lane_neighbours.len();
    assert_eq!(rows.neighbours.len() * lanes, values.len(), "rows and lanes describe the values");
    let mut state = State::new(lanes, payload);
    let mut row = vec![0_i32; lanes];
    let zeros = vec![0_i32; lanes];
    for &r in &rows.order {
        let at = |index: u32| (index as usize) * lanes..(index as usize + 1) * lanes;
        row.copy_from_slice(&values[at(r)]);
        let neighbours = rows.neighbours[r as usize].map(|n| if n == NONE { zeros.as_slice() } else { &values[at(n)] });
        state.code_row(coder, rows, rows.level[r as usize], neighbours, &mut row);
        if C::DECODES {
            values[at(r)].copy_from_slice(&row);
        }
    }
}

/// Encodes or decodes the corrections of samples that enforce a pointwise error bound, one integer for each sample: in
/// memory order, in rows of `lanes` samples.
pub(crate) fn code_corrections<C: BitCoder>(coder: &mut C, lanes: usize, values: &mut [i32]) {
    code_coefficients(coder, &Rows::natural(values.len() / lanes, lanes), Payload::Integer, values);
}

impl Rows {
    /// Creates the coding order of a plain table: the only context of each row, and of each entry of a row, is its
    /// predecessor.
    pub(crate) fn natural(rows: usize, lanes: usize) -> Self {
        let before = |i: usize| if i == 0 { NONE } else { i as u32 - 1 };
        Self {
            order: (0..rows as u32).collect(),
            level: vec![0; rows],
            neighbours: (0..rows).map(|i| [before(i), before(i.saturating_sub(1)), NONE]).collect(),
            lane_order: (0..lanes as u32).collect(),
            lane_level: vec![0; lanes],
            lane_neighbours: (0..lanes).map(|i| [before(i), before(i.saturating_sub(1))]).collect(),
        }
    }
}

struct State {
    model: Model,
    payload: Payload,
    /// Running mean of the coefficient magnitudes coded so far at each index of the last axis of the coefficient
    /// tensor. It is a fixed-point number: 256 stands for a magnitude of 1.
    activity: Vec<u32>,
}

impl State {
    fn new(lanes: usize, payload: Payload) -> Self {
        let mut model = Model::new(SLOTS, SETS);
        for (class, &nonzero) in NONZERO.iter().enumerate() {
            for level in 0..LEVELS * LEVELS {
                model.prior(BY_ROWS + level * FINE + class, nonzero);
            }
            for (other, &also) in NONZERO.iter().enumerate() {
                model.prior(BY_LANES + class * FINE + other, also.midpoint(nonzero));
            }
        }
        for each in 0..COARSE * COARSE * COARSE {
            let sum = each % COARSE + each / COARSE % COARSE + each / (COARSE * COARSE);
            model.prior(BY_EACH + each, NONZERO[(4 + sum).min(FINE - 1)]);
        }
        MagnitudeSlots::at(MAGNITUDE).set_priors(&mut model);
        Self { model, payload, activity: vec![256; lanes] }
    }

    fn code_row<C: BitCoder>(
        &mut self,
        coder: &mut C,
        rows: &Rows,
        level: u8,
        neighbours: [&[i32]; 3],
        row: &mut [i32],
    ) {
        let level = usize::from(level).min(LEVELS - 1);
        if row.len() > 1 && !self.code_row_flag(coder, level, neighbours, row) {
            row.fill(0);
            return;
        }
        for &lane in &rows.lane_order {
            let j = lane as usize;
            let [a, b, c] = neighbours;
            let [a, b, c] = [self.magnitude(a[j]), self.magnitude(b[j]), self.magnitude(c[j])];
            let beside = |n: u32| if n == NONE { 0 } else { self.magnitude(row[n as usize]) };
            let [up, before] = rows.lane_neighbours[j];
            let [up, before] = [beside(up), beside(before)];
            let lane_level = usize::from(rows.lane_level[j]).min(LEVELS - 1);
            // Magnitudes are capped so that the sums cannot overflow; classes saturate long before.
            let by_rows = fine(8 * a + 4 * b + 4 * c);
            let by_lanes = fine(6 * up + 10 * before);
            let active = fine(self.activity[j] >> 4);
            let contexts = [
                BY_ROWS + (level * LEVELS + lane_level) * FINE + by_rows,
                BY_LANES + active * FINE + by_lanes,
                BY_EACH + (coarse(a) * COARSE + coarse(b)) * COARSE + coarse(c),
            ];
            let value = if self.model.code(coder, row[j] != 0, contexts, ZERO_SET + level) {
                let expected = fine((8 * a + 4 * b + 4 * c).max(6 * up + 10 * before));
                self.code_payload(coder, row[j], (expected, active, level))
            } else {
                0
            };
            row[j] = value;
            let magnitude = self.magnitude(value) << 8;
            let activity = &mut self.activity[j];
            *activity = (*activity * 7 + magnitude) / 8;
        }
    }

    /// Encodes or decodes the flag of a row of the coefficient tensor (a run of its last axis) that says if the row has
    /// a nonzero value.
    fn code_row_flag<C: BitCoder>(
        &mut self,
        coder: &mut C,
        level: usize,
        neighbours: [&[i32]; 3],
        row: &[i32],
    ) -> bool {
        let state = |n: &[i32]| match n.iter().filter(|&&v| v != 0).take(3).count() {
            0 => 0,
            1 | 2 => 1,
            _ => 2,
        };
        let [a, b, c] = neighbours.map(state);
        let all = (a * 3 + b) * 3 + c;
        let slot = |kind: usize, context: usize| ROW_ZERO + (kind * 27 + context) * LEVELS + level;
        let nonzero = !C::DECODES && row.iter().any(|&v| v != 0);
        self.model.code(coder, nonzero, [slot(0, all), slot(1, a * 3 + b), slot(2, c * 3 + a)], level)
    }

    fn magnitude(&self, value: i32) -> u32 {
        match self.payload {
            Payload::Integer => value.unsigned_abs().min(1 << 16),
            Payload::Float => u32::from(value != 0),
        }
    }

    fn code_payload<C: BitCoder>(&mut self, coder: &mut C, value: i32, contexts: (usize, usize, usize)) -> i32 {
        match self.payload {
            Payload::Integer => {
                let negative = coder.even(value < 0);
                let slots = MagnitudeSlots::at(MAGNITUDE);
                let magnitude =
                    code_magnitude(coder, &mut self.model, slots, MAGNITUDE_SET, value.unsigned_abs(), contexts) as i32;
                if negative { -magnitude } else { magnitude }
            }
            Payload::Float => {
                let bits = value as u32;
                let sign = coder.bits(bits >> 31, 1);
                let tree = EXPONENT + contexts.2 * 256;
                let mut exponent = 1;
                for shift in (0..8).rev() {
                    let bit = self.model.code_one(coder, bits >> (23 + shift) & 1 == 1, tree + exponent);
                    exponent = exponent << 1 | usize::from(bit);
                }
                let mantissa = coder.bits(bits, 23);
                (sign << 31 | (exponent as u32 & 0xFF) << 23 | mantissa & 0x7F_FFFF) as i32
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::range::{Decoder, Encoder};
    use crate::numeric::drawn::list;
    use arbtest::arbtest;

    fn round_trip(rows: &Rows, payload: Payload, values: &[i32]) -> usize {
        let mut encoder = Encoder::default();
        code_coefficients(&mut encoder, rows, payload, &mut values.to_vec());
        let bytes = encoder.finish();
        let mut decoded = vec![0; values.len()];
        let mut decoder = Decoder::new(&bytes);
        code_coefficients(&mut decoder, rows, payload, &mut decoded);
        assert_eq!(decoded, values);
        assert!(decoder.is_exhausted());
        bytes.len()
    }

    #[test]
    fn integers_round_trip() {
        arbtest(|u| {
            let values: Vec<i32> = list(u, 60..=60, |u| {
                let most = *u.choose(&[0, 3, 100_000])?;
                u.int_in_range(-most..=most)
            })?;
            for (rows, lanes) in [(1, 60), (60, 1), (12, 5)] {
                round_trip(&Rows::natural(rows, lanes), Payload::Integer, &values);
            }
            Ok(())
        });
    }

    #[test]
    fn floats_round_trip() {
        arbtest(|u| {
            let bits: Vec<i32> = list(u, 60..=60, |u| if u.arbitrary()? { Ok(0) } else { u.arbitrary() })?;
            round_trip(&Rows::natural(12, 5), Payload::Float, &bits);
            Ok(())
        });
    }

    #[test]
    fn zeros_cost_next_to_nothing() {
        assert!(round_trip(&Rows::natural(16_384, 75), Payload::Integer, &vec![0; 16_384 * 75]) < 24);
        assert!(round_trip(&Rows::natural(1, 2048), Payload::Integer, &vec![0; 2048]) < 16);
    }

    #[test]
    fn any_bytes_decode_without_panic() {
        for byte in 0..=255_u8 {
            let mut values = vec![0; 600];
            let bytes = [byte, 255 - byte, byte ^ 0x5A, 7].repeat(20);
            code_coefficients(&mut Decoder::new(&bytes), &Rows::natural(20, 30), Payload::Integer, &mut values);
            code_coefficients(&mut Decoder::new(&bytes), &Rows::natural(20, 30), Payload::Float, &mut values);
        }
    }
}
