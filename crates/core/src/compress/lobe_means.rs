//! Adds the lobe to a decoded tensor of cells: its mean over each of them.

use super::decode::{Decoded, DecodedBlock};
use crate::codec::CodecError;
use crate::domain::{Axis, Direction, Lobe, Measurement, Sampling, Tensor, TriangleMesh};
use rayon::prelude::*;

/// Number of triangles per parallel task when the lobe's means over them are computed.
const SHARE: usize = 256;

impl Decoded {
    /// Returns the samples with the analytic lobe added: its mean over each triangle, or its value at the centre for
    /// point samples. Without a lobe the samples stay as they are.
    pub fn whole(self) -> Result<Measurement, CodecError> {
        let Self { measurement, summary } = self;
        let Some(lobe) = &summary.lobe else { return Ok(measurement) };
        let Measurement { quantity, unit, sampling, tensor } = measurement;
        let axes = tensor.axes().to_vec();
        let mut samples = tensor.into_samples();
        add(lobe, (&axes, sampling), 0, &mut samples);
        Ok(Measurement { quantity, unit, sampling, tensor: tensor_of(axes, samples)? })
    }
}

impl DecodedBlock {
    /// Returns the samples of incoming direction number `block` with the analytic lobe added, as [`Decoded::whole`]
    /// does.
    pub fn whole(self, block: usize) -> Result<Tensor, CodecError> {
        let Self { tensor, summary } = self;
        let Some(lobe) = &summary.lobe else { return Ok(tensor) };
        let axes = tensor.axes().to_vec();
        let mut samples = tensor.into_samples();
        add(lobe, (&summary.axes, summary.sampling), block, &mut samples);
        tensor_of(axes, samples)
    }
}

fn tensor_of(axes: Vec<Axis>, samples: Vec<f32>) -> Result<Tensor, CodecError> {
    Tensor::new(axes, samples).map_err(|error| CodecError::Malformed { at: 0, reason: error.to_string() })
}

/// Adds the analytic lobe to the samples of consecutive incoming directions, starting at number `first`.
fn add(lobe: &Lobe, (axes, sampling): (&[Axis], Sampling), first: usize, samples: &mut [f32]) {
    let (Some(incoming), Some(Axis::Triangles(mesh))) = (axes.first(), axes.get(1)) else { return };
    for (entry, samples) in (first..).zip(samples.chunks_mut(mesh.len() * lobe.colours().len())) {
        if let Some(wi) = incoming.direction(entry) {
            lobe_means(lobe, wi, (*mesh, sampling), samples);
        }
    }
}

/// Adds the lobe of incoming direction `wi` to samples `[triangle, wavelength]`: to each sample the mean of the lobe
/// over its triangle or, for point samples, the value at the triangle's centre.
pub(crate) fn lobe_means(lobe: &Lobe, wi: Direction, (mesh, sampling): (TriangleMesh, Sampling), samples: &mut [f32]) {
    let Some(under) = lobe.under(wi) else { return };
    let lambdas = lobe.colours().len();
    samples.par_chunks_mut(SHARE * lambdas).enumerate().for_each(|(part, samples)| {
        for (cell, spectrum) in (part * SHARE..).zip(samples.chunks_mut(lambdas)) {
            let mean = match sampling {
                Sampling::Average => under.mean_over(mesh.vertices(cell)),
                Sampling::Point => under.shape(mesh.centroid(cell)),
            };
            for (sample, &colour) in spectrum.iter_mut().zip(lobe.colours()) {
                *sample += (mean * f64::from(colour)) as f32;
            }
        }
    });
}
