//! Resampling of samples on their own axes to the axes of the tensor, in one pass over the output.

use super::averages::Averages;
use super::bands::Bands;
use rayon::prelude::*;

/// Number of values of the resampled tensor that one task computes at a time.
const BLOCK: usize = 1 << 12;

/// Resampling of an axis of directions. Data without directions count as having such an axis of length 1.
pub(super) enum Directions {
    Kept(usize),
    Averaged {
        /// Number of directions in the file, from which averages over triangles of directions are computed.
        from: usize,
        averages: Averages,
    },
}

/// Resampling of the spectral axis, which holds wavelengths or colour channels. Data without a spectral axis count as
/// having one of length 1.
#[derive(Clone, Debug)]
pub(super) enum Channels {
    Kept(usize),
    Banded {
        /// Number of wavelengths in the file, from which averages over the bands of the requested wavelengths are
        /// computed.
        from: usize,
        bands: Bands,
    },
    /// One factor for each wavelength: the single value of a direction, multiplied by them, becomes a spectrum.
    Multiplied(Vec<f64>),
}

/// Conversion of measured values, `[outer, incoming, outgoing, spectral]`, to the directions and wavelengths of a
/// tensor. The outer axis, the product of all index axes before the directions, stays as it is.
pub(super) struct Resampling {
    pub(super) outer: usize,
    pub(super) incoming: Directions,
    pub(super) outgoing: Directions,
    pub(super) channels: Channels,
}

impl Directions {
    pub(super) fn from(&self) -> usize {
        match self {
            Self::Kept(n) => *n,
            Self::Averaged { from, .. } => *from,
        }
    }

    pub(super) fn to(&self) -> usize {
        match self {
            Self::Kept(n) => *n,
            Self::Averaged { averages, .. } => averages.len(),
        }
    }

    /// Returns true if no sample contributes to position `index` on the resampled direction axis.
    pub(super) fn is_empty(&self, index: usize) -> bool {
        match self {
            Self::Kept(_) => false,
            Self::Averaged { averages, .. } => averages.is_empty(index),
        }
    }
}

impl Channels {
    pub(super) fn from(&self) -> usize {
        match self {
            Self::Kept(n) => *n,
            Self::Banded { from, .. } => *from,
            Self::Multiplied(_) => 1,
        }
    }

    pub(super) fn to(&self) -> usize {
        match self {
            Self::Kept(n) => *n,
            Self::Banded { bands, .. } => bands.len(),
            Self::Multiplied(factors) => factors.len(),
        }
    }

    pub(super) fn write(&self, row: &[f64], out: &mut [f32]) {
        match self {
            Self::Kept(_) => out.iter_mut().zip(row).for_each(|(o, &v)| *o = sample(v)),
            Self::Banded { bands, .. } => {
                out.iter_mut().enumerate().for_each(|(i, o)| *o = sample(bands.average(row, i)));
            }
            Self::Multiplied(factors) => out.iter_mut().zip(factors).for_each(|(o, f)| *o = sample(row[0] * f)),
        }
    }
}

impl Resampling {
    /// Returns true if the resampling leaves all samples unchanged.
    pub(super) fn is_identity(&self) -> bool {
        matches!(
            self,
            Self { incoming: Directions::Kept(_), outgoing: Directions::Kept(_), channels: Channels::Kept(_), .. }
        )
    }

    /// Resamples the measured `values`, `[outer, incoming, outgoing, spectral]`, to the requested directions and
    /// wavelengths; NaN marks a masked sample. `missing` is true if there may be NaN among `values`.
    ///
    /// Besides the output it needs memory for one plane `[outgoing, spectral]` of samples. One task sums each output
    /// value in the order of the samples, so that the bits do not depend on the number of threads.
    pub(super) fn apply(&self, values: &[f32], missing: bool) -> Vec<f32> {
        let plane = self.outgoing.from() * self.channels.from();
        let out_plane = self.outgoing.to() * self.channels.to();
        let mut out = vec![0.0_f32; self.outer * self.incoming.to() * out_plane];
        let sources = values.chunks(self.incoming.from() * plane);
        let targets = out.chunks_mut(self.incoming.to() * out_plane);
        for (source, target) in sources.zip(targets) {
            match &self.incoming {
                Directions::Kept(_) => {
                    for (source, target) in source.chunks(plane).zip(target.chunks_mut(out_plane)) {
                        self.outgoing(source, missing, target);
                    }
                }
                Directions::Averaged { averages, .. } => {
                    let mut mean = vec![0.0_f64; plane];
                    // An incoming cell outside the measured range is masked throughout.
                    let missing = missing || (0..averages.len()).any(|cell| averages.is_empty(cell));
                    for (cell, target) in target.chunks_mut(out_plane).enumerate() {
                        mean.par_chunks_mut(BLOCK).enumerate().for_each_init(Vec::new, |weights, (block, sums)| {
                            weights.resize(sums.len(), 0.0);
                            averages.average(cell, source, (block * BLOCK, plane), missing, sums, weights);
                        });
                        self.outgoing(&mean, missing, target);
                    }
                }
            }
        }
        out
    }

    fn outgoing<T: Copy + Into<f64> + Sync>(&self, plane: &[T], missing: bool, out: &mut [f32]) {
        let (width, out_width) = (self.channels.from(), self.channels.to());
        let rows = (BLOCK / width.max(out_width)).max(1);
        out.par_chunks_mut(rows * out_width).enumerate().for_each_init(
            || (vec![0.0; width], vec![0.0; width]),
            |(sums, weights), (block, out)| {
                for (i, out) in out.chunks_mut(out_width).enumerate() {
                    let cell = block * rows + i;
                    match &self.outgoing {
                        Directions::Averaged { averages, .. } => {
                            averages.average(cell, plane, (0, width), missing, sums, weights);
                        }
                        Directions::Kept(_) => {
                            let row = &plane[cell * width..][..width];
                            sums.iter_mut().zip(row).for_each(|(s, &v)| *s = v.into());
                        }
                    }
                    self.channels.write(sums, out);
                }
            },
        );
    }
}

/// Converts a sample value to float32; all masked samples get the same bit pattern of NaN.
fn sample(value: f64) -> f32 {
    if value.is_nan() { f32::NAN } else { value as f32 }
}
