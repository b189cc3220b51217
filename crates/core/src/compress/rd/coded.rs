//! Cache of a first layer coded at one fineness, and planes coded as separate streams.

use super::spectrum::Basis;
use super::steps::Fineness;
use crate::codec::{ChunkKind, Encoder};
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// Result of coding a measurement with one quantiser setting, before the decoded light (albedo, flux) or single samples
/// are corrected to keep their error bounds.
pub(super) struct Coded {
    pub(super) basis: Option<Basis>,
    pub(super) chunks: Vec<(ChunkKind, Vec<u8>)>,
    /// Decoded values `[unit, channel, direction]`, where a unit is an independently coded slice and a channel a
    /// spectral coefficient.
    pub(super) planes: Vec<f32>,
    /// Coefficients of the scattering model that is yet to be added to `planes`; most trials end before that.
    pub(super) model: Option<Vec<f64>>,
    /// Number of nonzero quantised integers, including those of the spectral basis.
    pub(super) kept: u64,
}

/// Cache of the last quantiser setting with its coded result, because a search asks for size and error of it one after
/// the other.
#[derive(Default)]
pub(super) struct LastCoded(Mutex<Option<(Fineness, Coded)>>);

impl LastCoded {
    /// Passes the measurement coded with the quantiser setting `fineness` (step, number of spectral vectors) to `read`.
    /// Reuses the result of the last call if the setting is the same, otherwise calls `code`.
    pub(super) fn with<T>(
        &self,
        fineness: Fineness,
        code: impl FnOnce() -> Coded,
        read: impl FnOnce(&mut Coded) -> T,
    ) -> T {
        let mut last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // Freed before the next result takes as much.
        let known = last.take().filter(|(known, _)| *known == fineness);
        let (_, coded) = last.insert(known.unwrap_or_else(|| (fineness, code())));
        read(coded)
    }
}

/// Codes `count` byte streams in parallel: `code(encoder, k)` returns the decoded values of stream k and the number of
/// nonzero integers. Returns all values in order, the total count, and the streams.
pub(super) fn code_streams(
    count: usize,
    code: impl Fn(&mut Encoder, usize) -> (Vec<f32>, u64) + Sync,
) -> (Vec<f32>, u64, Vec<Vec<u8>>) {
    let coded: Vec<(Vec<f32>, u64, Vec<u8>)> = (0..count)
        .into_par_iter()
        .map(|k| {
            let mut encoder = Encoder::default();
            let (planes, details) = code(&mut encoder, k);
            (planes, details, encoder.finish())
        })
        .collect();
    let details = coded.iter().map(|(_, details, _)| details).sum();
    let mut planes = Vec::with_capacity(coded.iter().map(|(planes, ..)| planes.len()).sum());
    let mut streams = Vec::with_capacity(count);
    for (own, _, stream) in coded {
        planes.extend(own);
        streams.push(stream);
    }
    (planes, details, streams)
}
