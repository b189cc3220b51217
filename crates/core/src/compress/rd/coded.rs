//! A first layer coded at one fineness, kept until another is asked for; planes coded as streams of their own.

use super::spectrum::Basis;
use super::steps::Fineness;
use crate::codec::{ChunkKind, Encoder};
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};

/// A layer at one fineness.
pub(super) struct Coded {
    pub(super) basis: Option<Basis>,
    pub(super) chunks: Vec<(ChunkKind, Vec<u8>)>,
    /// Planes as a decoder has them, `[unit, vector, leaf]`.
    pub(super) planes: Vec<f32>,
    /// Integers that are not 0, those of the basis among them.
    pub(super) kept: u64,
}

/// The fineness coded last, with its result: a size and an error are asked for one after the other.
#[derive(Default)]
pub(super) struct LastCoded(Mutex<Option<(Fineness, Arc<Coded>)>>);

impl LastCoded {
    /// Returns the layer at `fineness`, coded by `code` unless it was coded last.
    pub(super) fn get(&self, fineness: Fineness, code: impl FnOnce() -> Coded) -> Arc<Coded> {
        let mut last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match &*last {
            Some((known, coded)) if *known == fineness => Arc::clone(coded),
            _ => {
                let coded = Arc::new(code());
                *last = Some((fineness, Arc::clone(&coded)));
                coded
            }
        }
    }
}

/// Codes `count` streams on all threads: `code(encoder, k)` returns the planes of stream k as a decoder has them, and their
/// integers that are not 0. Returns all planes one after another, the sum, and the streams.
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
