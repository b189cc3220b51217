//! Adaptive probabilities mixed in the logistic domain, in integers (Mahoney 2005, *Adaptive weighing of context
//! models*).
//!
//! A decision is predicted in up to [`INPUTS`] contexts at once. The predictions are stretched to log-odds, weighted,
//! added and squashed back to a probability. The tables are computed with the pure Rust `libm`, so that they are
//! identical on every machine.

use super::range::BitCoder;
use std::sync::LazyLock;

/// Number of adaptive probabilities that together predict one binary decision.
pub(crate) const INPUTS: usize = 3;
/// Number of predictions that are mixed for one binary decision if the caller supplies log-odds in addition to the
/// adaptive probabilities.
const GUIDED: usize = INPUTS + 1;
/// Number of adaptive probabilities that together predict one binary decision in coders that know many neighbours.
pub(crate) const WIDE: usize = 5;

/// Number of bits of a stored probability; 16 of them are used for coding.
const PROBABILITY_BITS: u32 = 22;
const ONE: u32 = 1 << PROBABILITY_BITS;
/// Fixed-point scale of log-odds: 256 units are 1 in natural logarithms.
pub(crate) const LOG_ODDS: f64 = 256.0;
/// Fixed-point scale of tabulated log-odds: 8 fractional bits. Log-odds are limited to ±12 (a probability of 6e-6).
const STRETCH_SCALE: f64 = LOG_ODDS;
const STRETCH_LIMIT: i32 = 3072;
/// Upper limit of the update count of an adaptive probability. Raising it slows the adaptation after many updates,
/// whose slowest rate is about 1 / 255.
const COUNT_LIMIT: u8 = 254;

struct Tables {
    /// Table of log-odds ln(p / (1 − p)) in units of 1/256, indexed by the 12 high bits of the 22-bit probability p.
    stretch: [i16; 4096],
    /// Table of 16-bit probabilities, indexed by log-odds from −[`STRETCH_LIMIT`] on.
    squash: [u16; 2 * STRETCH_LIMIT as usize + 1],
    /// Table of adaptation rates 65536 / (count + 1.6), indexed by the update count of a probability.
    rate: [u32; COUNT_LIMIT as usize + 1],
}

static TABLES: LazyLock<Tables> = LazyLock::new(|| Tables {
    stretch: std::array::from_fn(|i| {
        let p = (i as f64 + 0.5) / 4096.0;
        libm::round(STRETCH_SCALE * libm::log(p / (1.0 - p))) as i16
    }),
    squash: std::array::from_fn(|i| {
        let x = i as i32 - STRETCH_LIMIT;
        let p = 65536.0 / (1.0 + libm::exp(-f64::from(x) / STRETCH_SCALE));
        libm::round(p).clamp(1.0, 65535.0) as u16
    }),
    rate: std::array::from_fn(|n| libm::round(65536.0 / (n as f64 + 1.6)) as u32),
});

/// Adaptive probability of a binary decision, with its number of updates.
#[derive(Clone, Copy, Debug)]
struct Slot {
    p: u32,
    count: u8,
}

/// Context-mixing model: adaptive probabilities (*slots*), and sets of weights that mix `N` predictions of one binary
/// decision.
pub(crate) struct Model<const N: usize = INPUTS> {
    slots: Vec<Slot>,
    /// Sets of weights with which the entropy coder mixes predicted probabilities of a bit, in 16.16 fixed point.
    weights: Vec<[i32; N]>,
    tables: &'static Tables,
}

impl Model {
    /// Creates a model with `slots` adaptive probabilities of one half and `sets` sets of weights that mix three.
    pub(crate) fn new(slots: usize, sets: usize) -> Self {
        Self::starting(slots, sets, [26_214; INPUTS])
    }
}

impl Model<WIDE> {
    /// Creates a model with `slots` adaptive probabilities of one half and `sets` sets of weights that mix five.
    pub(crate) fn wide(slots: usize, sets: usize) -> Self {
        Self::starting(slots, sets, [15_728; WIDE])
    }
}

impl Model<GUIDED> {
    /// Creates a model with `slots` adaptive probabilities of one half and `sets` sets of mixing weights, which
    /// initially use only the log-odds that the caller supplies.
    pub(crate) fn guided(slots: usize, sets: usize) -> Self {
        Self::starting(slots, sets, [1 << 16, 0, 0, 0])
    }

    /// Encodes or decodes one binary decision predicted by given log-odds (see [`LOG_ODDS`]) and three adaptive
    /// probabilities, mixed with weight set `set`.
    #[inline]
    pub(crate) fn code_guided<C: BitCoder>(
        &mut self,
        coder: &mut C,
        bit: bool,
        (odds, slots): (i32, [usize; INPUTS]),
        set: usize,
    ) -> bool {
        let [first, second, third] = slots;
        let stretched = [odds, self.odds_of(first), self.odds_of(second), self.odds_of(third)];
        let bit = self.mix(coder, bit, stretched, set);
        for slot in slots {
            self.update(slot, bit);
        }
        bit
    }
}

impl<const N: usize> Model<N> {
    /// Encodes or decodes one binary decision predicted by `N` adaptive probabilities, mixed with weight set `set`.
    #[inline]
    pub(crate) fn code<C: BitCoder>(&mut self, coder: &mut C, bit: bool, slots: [usize; N], set: usize) -> bool {
        let stretched = slots.map(|slot| self.odds_of(slot));
        let bit = self.mix(coder, bit, stretched, set);
        for slot in slots {
            self.update(slot, bit);
        }
        bit
    }

    fn starting(slots: usize, sets: usize, weights: [i32; N]) -> Self {
        Self { slots: vec![Slot { p: ONE / 2, count: 0 }; slots], weights: vec![weights; sets], tables: &TABLES }
    }

    #[inline]
    fn odds_of(&self, slot: usize) -> i32 {
        // A probability is below 2^22.
        i32::from(self.tables.stretch[(self.slots[slot].p >> 10 & 4095) as usize])
    }

    /// Sets the initial value of the adaptive probability number `slot`, in 1/65536.
    pub(crate) fn prior(&mut self, slot: usize, p1: u32) {
        self.slots[slot].p = p1.clamp(64, 65536 - 64) << (PROBABILITY_BITS - 16);
    }

    /// Encodes or decodes one binary decision predicted by a single adaptive probability.
    pub(crate) fn code_one<C: BitCoder>(&mut self, coder: &mut C, bit: bool, slot: usize) -> bool {
        let p1 = (self.slots[slot].p >> (PROBABILITY_BITS - 16)).clamp(1, 65535);
        let bit = coder.bit(bit, p1);
        self.update(slot, bit);
        bit
    }

    /// Encodes or decodes one binary decision predicted by several log-odds, mixed with weight set `set`, and updates
    /// the weights.
    #[inline]
    fn mix<C: BitCoder>(&mut self, coder: &mut C, bit: bool, stretched: [i32; N], set: usize) -> bool {
        let weights = &mut self.weights[set];
        let sum: i64 = stretched.iter().zip(weights.iter()).map(|(&s, &w)| i64::from(s) * i64::from(w)).sum();
        let odds = (sum >> 16).clamp(-i64::from(STRETCH_LIMIT), i64::from(STRETCH_LIMIT)) as i32;
        let p1 = u32::from(self.tables.squash[(odds + STRETCH_LIMIT) as usize]);
        let bit = coder.bit(bit, p1);
        let error = (i32::from(bit) << 16) - p1 as i32;
        for (weight, &s) in weights.iter_mut().zip(&stretched) {
            // Learning rate 0.02 in real units; |error · s · 5| < 2^30.
            let step = (error * s / 16 * 5) >> 12;
            *weight = weight.saturating_add(step).clamp(-(1 << 20), 1 << 20);
        }
        bit
    }

    #[inline]
    fn update(&mut self, slot: usize, bit: bool) {
        let slot = &mut self.slots[slot];
        let rate = u64::from(self.tables.rate[usize::from(slot.count)]);
        let target = if bit { ONE - 1 } else { 0 };
        if target > slot.p {
            slot.p += ((u64::from(target - slot.p) * rate) >> 16) as u32;
        } else {
            slot.p -= ((u64::from(slot.p - target) * rate) >> 16) as u32;
        }
        slot.count = slot.count.saturating_add(1).min(COUNT_LIMIT);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::range::{Decoder, Encoder};

    #[test]
    fn a_skewed_source_costs_its_entropy() {
        let bits: Vec<bool> = (0..40_000_u32).map(|i| i.wrapping_mul(2_654_435_761) >> 27 == 0).collect();
        let mut model = Model::new(3, 1);
        let mut encoder = Encoder::default();
        for &bit in &bits {
            model.code(&mut encoder, bit, [0, 1, 2], 0);
        }
        let bytes = encoder.finish();
        // Ones of probability 1/32 cost 0.2 bits per decision, 1003 bytes in all; adaptation costs less than a tenth
        // more.
        assert!(bytes.len() < 1100, "{}", bytes.len());
        let mut model = Model::new(3, 1);
        let mut decoder = Decoder::new(&bytes);
        for &bit in &bits {
            assert_eq!(model.code(&mut decoder, false, [0, 1, 2], 0), bit);
        }
    }

    #[test]
    fn a_sure_source_costs_almost_nothing() {
        let mut model = Model::new(3, 1);
        let mut encoder = Encoder::default();
        for _ in 0..1_000_000 {
            model.code(&mut encoder, false, [0, 1, 2], 0);
        }
        assert!(encoder.finish().len() < 32);
    }
}
