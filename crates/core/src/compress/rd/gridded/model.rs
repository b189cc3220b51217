//! Smooth model of scattering (see `chart`) on the kept rows of a grid; the pyramid codes its residual.

use super::super::chart::{Chart, ChartKind, GRID_ROWS};
use super::planes::Planes;
use crate::codec::{BitCoder, CodecError, Reader};
use std::ops::Range;

/// Position and mask, in the first byte of a grid chunk, of the bits that hold the kind of scattering model.
const AT: u8 = 4;
const KINDS: u8 = 3;
/// Number of incoming directions whose values are evaluated together, then reordered.
const TURNED: usize = 32;

/// Scattering model of the samples on grids of incoming and outgoing angles.
pub(super) struct GridModel {
    chart: Chart,
    /// Number of incoming directions, and number of outgoing directions for each.
    shape: [usize; 2],
}

impl GridModel {
    /// Builds the scattering model; `None` if the grid lacks the directions that it needs.
    pub(super) fn new(kind: ChartKind, planes: &Planes) -> Option<Self> {
        let [incoming, outgoing] = planes.lattice().directions()?;
        (kind != ChartKind::Zonal).then_some(())?;
        let shape = [incoming.len(), outgoing.len()];
        Some(Self { chart: Chart::new(kind, incoming, outgoing, GRID_ROWS), shape })
    }

    /// Prepares the scattering model for fitting to the direction pairs that `live` marks, those with a nonzero weight
    /// in every spectral channel.
    pub(super) fn prepared(self, live: Vec<bool>) -> Self {
        Self { chart: self.chart.prepared(Some(live)), ..self }
    }

    /// Returns the kind of scattering model as bits of the first byte of a grid chunk.
    pub(super) fn form(model: Option<&Self>) -> u8 {
        model.map_or(0, |model| (model.chart.kind() as u8) << AT)
    }

    /// Reads the kind of scattering model from the first byte of a grid chunk.
    pub(super) fn kind_of(form: u8, r: &Reader<'_>) -> Result<Option<ChartKind>, CodecError> {
        match form >> AT & KINDS {
            0 => Ok(None),
            code => match ChartKind::from_code(code) {
                Some(kind) if kind != ChartKind::Zonal => Ok(Some(kind)),
                _ => Err(r.malformed(format!("the code {code} of the scattering model in the grid chunk is unknown"))),
            },
        }
    }

    /// Encodes or decodes the coefficients of the scattering model, quantised with `step`, and returns them. Only an
    /// encoder passes `planes`: the values of all samples, to which it fits the model, and the number of byte streams
    /// that code them.
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

    /// Evaluates the scattering model for all incoming directions, in the layout of one byte stream or of a byte stream
    /// for each of them.
    pub(super) fn all(&self, coefficients: &[f64], vectors: usize, streams: usize) -> Vec<f32> {
        let [incoming, outgoing] = self.shape;
        if streams > 1 {
            return self.entries(coefficients, vectors, 0..incoming);
        }
        // From [incoming, channel, outgoing] to [channel, incoming, outgoing], some at a time, as a copy is large.
        let mut all = vec![0.0; vectors * incoming * outgoing];
        for first in (0..incoming).step_by(TURNED) {
            let entries = self.entries(coefficients, vectors, first..(first + TURNED).min(incoming));
            for (row, values) in entries.chunks_exact(outgoing).enumerate() {
                let (entry, vector) = (first + row / vectors, row % vectors);
                all[(vector * incoming + entry) * outgoing..][..outgoing].copy_from_slice(values);
            }
        }
        all
    }

    /// Evaluates the scattering model for a range of incoming directions. Returns values `[incoming, channel,
    /// outgoing]`. There are `vectors` channels: wavelengths, or coefficients of a spectral basis.
    pub(super) fn entries(&self, coefficients: &[f64], vectors: usize, entries: Range<usize>) -> Vec<f32> {
        self.chart.evaluate(coefficients.to_vec(), vectors, entries)
    }

    /// Reorders the values of all samples from `[channel, incoming, outgoing]` to `[incoming, channel, outgoing]` for
    /// the scattering model. They already have this order if each incoming direction is coded as a byte stream of its
    /// own (`is_turned`).
    fn turned(&self, planes: &[f32], (vectors, is_turned): (usize, bool)) -> Vec<f32> {
        if is_turned { planes.to_vec() } else { exchanged(planes, [vectors, self.shape[0], self.shape[1]]) }
    }
}

/// Exchanges the first two axes of an array of rows of `length` numbers, from `[a, b, length]` to `[b, a, length]`.
fn exchanged(values: &[f32], [a, b, length]: [usize; 3]) -> Vec<f32> {
    let mut exchanged = Vec::with_capacity(values.len());
    for row in (0..b).flat_map(|j| (0..a).map(move |i| i * b + j)) {
        exchanged.extend_from_slice(&values[row * length..][..length]);
    }
    exchanged
}
