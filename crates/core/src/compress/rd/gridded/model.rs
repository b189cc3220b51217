//! Smooth model of scattering (see `chart`) on the kept rows of a grid; the pyramid codes its residual.

use super::super::chart::{Chart, ChartKind, GRID_ROWS, Rows};
use super::planes::Planes;
use crate::codec::{BitCoder, CodecError, Reader};
use std::ops::Range;

/// Position and mask, in the first byte of a grid chunk, of the bits that hold the kind of scattering model.
const AT: u8 = 4;
const KINDS: u8 = 3;
/// Number of incoming directions whose values are evaluated together. Raising it takes memory.
const TOGETHER: usize = 16;

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
        let values = planes.map(|(planes, streams)| match streams {
            0 | 1 => Rows::by_channel(planes, self.shape[0]),
            _ => Rows::by_block(planes, vectors),
        });
        self.chart.code(coder, step, vectors, values, kept)
    }

    /// Evaluates the scattering model for all incoming directions, and calls `each(first, values)` for the outgoing
    /// directions of each of them in each channel; `first` is the place of the first value among all channels. They
    /// have the layout of one byte stream or of a byte stream for each incoming direction.
    ///
    /// The values of a few incoming directions are held at a time, as all together take as much memory as all samples.
    pub(super) fn visit(
        &self,
        coefficients: &[f64],
        (vectors, streams): (usize, usize),
        mut each: impl FnMut(usize, &[f32]),
    ) {
        let [incoming, outgoing] = self.shape;
        for first in (0..incoming).step_by(TOGETHER) {
            let entries = self.entries(coefficients, vectors, first..(first + TOGETHER).min(incoming));
            for (row, model) in entries.chunks_exact(outgoing).enumerate() {
                let (entry, vector) = (first + row / vectors, row % vectors);
                let at = if streams > 1 { entry * vectors + vector } else { vector * incoming + entry };
                each(at * outgoing, model);
            }
        }
    }

    /// Evaluates the scattering model for all incoming directions, and calls `change(value, model)` for each value of
    /// `planes`, in the layout of [`GridModel::visit`].
    pub(super) fn apply(
        &self,
        coefficients: &[f64],
        layout: (usize, usize),
        planes: &mut [f32],
        change: impl Fn(&mut f32, f32),
    ) {
        self.visit(coefficients, layout, |first, model| {
            planes[first..].iter_mut().zip(model).for_each(|(value, &model)| change(value, model));
        });
    }

    /// Evaluates the scattering model for a range of incoming directions. Returns values `[incoming, channel,
    /// outgoing]`. There are `vectors` channels: wavelengths, or coefficients of a spectral basis.
    pub(super) fn entries(&self, coefficients: &[f64], vectors: usize, entries: Range<usize>) -> Vec<f32> {
        self.chart.evaluate(coefficients.to_vec(), vectors, entries)
    }
}
