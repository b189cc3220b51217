//! The smooth model of scattering (see `chart`) on the kept rows of a grid: the pyramid codes what it misses.

use super::super::chart::{Chart, ChartKind, GRID_ROWS};
use super::planes::Planes;
use crate::codec::{BitCoder, CodecError, Reader};
use std::ops::Range;

/// Place of the model's kind in the first byte of a grid chunk, and of its bits.
const AT: u8 = 4;
const KINDS: u8 = 3;

/// A model of the planes of a grid.
pub(super) struct GridModel {
    chart: Chart,
    /// Incoming entries and leaves of each.
    shape: [usize; 2],
}

impl GridModel {
    /// `None` where the grid lacks the directions that the model needs.
    pub(super) fn new(kind: ChartKind, planes: &Planes) -> Option<Self> {
        let [incoming, outgoing] = planes.lattice().directions()?;
        (kind != ChartKind::Zonal).then_some(())?;
        let shape = [incoming.len(), outgoing.len()];
        Some(Self { chart: Chart::new(kind, incoming, outgoing, GRID_ROWS), shape })
    }

    /// Ready to be fitted to the leaves that have a weight in some plane.
    pub(super) fn prepared(self, live: Vec<bool>) -> Self {
        Self { chart: self.chart.prepared(Some(live)), ..self }
    }

    /// The model's part of the first byte of a grid chunk.
    pub(super) fn form(model: Option<&Self>) -> u8 {
        model.map_or(0, |model| (model.chart.kind() as u8) << AT)
    }

    /// The kind that the first byte of a grid chunk names.
    pub(super) fn kind_of(form: u8, r: &Reader<'_>) -> Result<Option<ChartKind>, CodecError> {
        match form >> AT & KINDS {
            0 => Ok(None),
            code => match ChartKind::from_code(code) {
                Some(kind) if kind != ChartKind::Zonal => Ok(Some(kind)),
                _ => Err(r.malformed(format!("model {code} of a grid chunk is unknown"))),
            },
        }
    }

    /// Codes the model at `step`: an encoder is given planes of all units; both return the model's coefficients.
    pub(super) fn code<C: BitCoder>(
        &self,
        coder: &mut C,
        step: f32,
        vectors: usize,
        planes: Option<(&[f32], usize)>,
        kept: &mut u64,
    ) -> Vec<f64> {
        let planes = planes.map(|(planes, streams)| self.turned(planes, (vectors, streams > 1)));
        self.chart.code(coder, step, vectors, planes.as_deref(), kept)
    }

    /// The model's planes of all units, of one stream or of a stream for each incoming entry.
    pub(super) fn all(&self, coefficients: &[f64], vectors: usize, streams: usize) -> Vec<f32> {
        let planes = self.entries(coefficients, vectors, 0..self.shape[0]);
        self.turned_back(planes, (vectors, streams > 1))
    }

    /// The model's planes `[entries, vectors, leaves]` of some incoming entries.
    pub(super) fn entries(&self, coefficients: &[f64], vectors: usize, entries: Range<usize>) -> Vec<f32> {
        self.chart.evaluate(coefficients.to_vec(), vectors, entries)
    }

    /// `[vectors, incoming, leaves]` of one stream as `[incoming, vectors, leaves]`.
    fn turned(&self, planes: &[f32], (vectors, is_turned): (usize, bool)) -> Vec<f32> {
        if is_turned { planes.to_vec() } else { exchanged(planes, [vectors, self.shape[0], self.shape[1]]) }
    }

    fn turned_back(&self, planes: Vec<f32>, (vectors, is_turned): (usize, bool)) -> Vec<f32> {
        if is_turned { planes } else { exchanged(&planes, [self.shape[0], vectors, self.shape[1]]) }
    }
}

/// `[a, b, length]` as `[b, a, length]`.
fn exchanged(values: &[f32], [a, b, length]: [usize; 3]) -> Vec<f32> {
    let row = |at: usize| &values[at * length..][..length];
    (0..b).flat_map(|j| (0..a).flat_map(move |i| row(i * b + j))).copied().collect()
}
