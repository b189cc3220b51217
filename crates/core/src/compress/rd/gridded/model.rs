//! Smooth model of scattering (see `chart`) on the kept rows of a grid; the pyramid codes its residual.

use super::super::chart::{Chart, ChartKind, GRID_ROWS};
use super::planes::Planes;
use crate::codec::{BitCoder, CodecError, Reader};
use std::ops::Range;

/// Bit position and mask of the model's kind in the first byte of a grid chunk.
const AT: u8 = 4;
const KINDS: u8 = 3;

/// Model of the planes of a grid.
pub(super) struct GridModel {
    chart: Chart,
    /// Number of incoming entries, and of leaves of each.
    shape: [usize; 2],
}

impl GridModel {
    /// Builds the model; `None` if the grid lacks the directions that it needs.
    pub(super) fn new(kind: ChartKind, planes: &Planes) -> Option<Self> {
        let [incoming, outgoing] = planes.lattice().directions()?;
        (kind != ChartKind::Zonal).then_some(())?;
        let shape = [incoming.len(), outgoing.len()];
        Some(Self { chart: Chart::new(kind, incoming, outgoing, GRID_ROWS), shape })
    }

    /// Prepares the model for fitting to the leaves `live`, those with a weight in every plane.
    pub(super) fn prepared(self, live: Vec<bool>) -> Self {
        Self { chart: self.chart.prepared(Some(live)), ..self }
    }

    /// Bits of the model's kind in the first byte of a grid chunk.
    pub(super) fn form(model: Option<&Self>) -> u8 {
        model.map_or(0, |model| (model.chart.kind() as u8) << AT)
    }

    /// Reads the model's kind from the first byte of a grid chunk.
    pub(super) fn kind_of(form: u8, r: &Reader<'_>) -> Result<Option<ChartKind>, CodecError> {
        match form >> AT & KINDS {
            0 => Ok(None),
            code => match ChartKind::from_code(code) {
                Some(kind) if kind != ChartKind::Zonal => Ok(Some(kind)),
                _ => Err(r.malformed(format!("model {code} of a grid chunk is unknown"))),
            },
        }
    }

    /// Codes the model at `step` and returns its coefficients. `planes`, those of all units, are given to an encoder
    /// only.
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

    /// Planes of the model for all units, in the layout of one stream or of a stream for each incoming entry.
    pub(super) fn all(&self, coefficients: &[f64], vectors: usize, streams: usize) -> Vec<f32> {
        let planes = self.entries(coefficients, vectors, 0..self.shape[0]);
        self.turned_back(planes, (vectors, streams > 1))
    }

    /// Planes of the model `[entries, vectors, leaves]` for some incoming entries.
    pub(super) fn entries(&self, coefficients: &[f64], vectors: usize, entries: Range<usize>) -> Vec<f32> {
        self.chart.evaluate(coefficients.to_vec(), vectors, entries)
    }

    /// Converts `[vectors, incoming, leaves]` of one stream to `[incoming, vectors, leaves]`.
    fn turned(&self, planes: &[f32], (vectors, is_turned): (usize, bool)) -> Vec<f32> {
        if is_turned { planes.to_vec() } else { exchanged(planes, [vectors, self.shape[0], self.shape[1]]) }
    }

    fn turned_back(&self, planes: Vec<f32>, (vectors, is_turned): (usize, bool)) -> Vec<f32> {
        if is_turned { planes } else { exchanged(&planes, [self.shape[0], vectors, self.shape[1]]) }
    }
}

/// Converts `[a, b, length]` to `[b, a, length]`.
fn exchanged(values: &[f32], [a, b, length]: [usize; 3]) -> Vec<f32> {
    let row = |at: usize| &values[at * length..][..length];
    (0..b).flat_map(|j| (0..a).flat_map(move |i| row(i * b + j))).copied().collect()
}
