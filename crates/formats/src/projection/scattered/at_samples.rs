//! The values of samples beside those of the cells that hold them.

use super::check::is_sound;
use super::cloud::directions;
use super::plan::entry_of;
use crate::domain::vector::Vector;
use crate::domain::{Axis, ErrorAccumulator, ErrorReport, Measurement};
use crate::formats::{Acquisition, Scattered};
use crate::projection::channels::channels;
use rayon::prelude::*;
use std::borrow::Cow;

/// Samples are compared with cells in pieces.
const PIECE: usize = 1 << 12;

/// The errors of `measurement` at the samples of `scattered`, each looked up in its cell (elevations: in the nearest).
pub(in crate::projection) fn errors(
    acquisition: &Acquisition,
    scattered: &Scattered,
    measurement: &Measurement,
) -> Option<ErrorReport> {
    let mut errors = ErrorAccumulator::default();
    let (mut original, mut decoded) = (Vec::new(), Vec::new());
    each_sample(acquisition, scattered, (measurement, None), |row, o, d| {
        original.extend_from_slice(o);
        decoded.extend_from_slice(d);
        if (row + 1).is_multiple_of(PIECE) {
            errors.add(&original, &decoded, 0.0);
            original.clear();
            decoded.clear();
        }
    })?;
    errors.add(&original, &decoded, 0.0);
    Some(errors.finish())
}

/// Calls `with` for every sample in the tensor's directions: its number, its values, and those of its cell. `None` if the
/// tensor is not one of this file. `known` are the cells `[incoming, outgoing]` of the samples, if someone has them.
pub(super) fn each_sample(
    acquisition: &Acquisition,
    scattered: &Scattered,
    (measurement, known): (&Measurement, Option<&[Option<usize>]>),
    mut with: impl FnMut(usize, &[f32], &[f32]),
) -> Option<()> {
    let layout = measurement.layout().ok()?;
    let axes = measurement.tensor.axes();
    let role = |axis: Option<usize>| axis.map(|i| &axes[i]);
    let factor = acquisition.spectral_factor.as_ref();
    let (width, channels) = channels(scattered.spectral.as_ref(), factor, role(layout.spectral))?;
    let isotropic = matches!(role(layout.incoming), Some(Axis::Elevation(_)));
    if layout.indices > 0 || scattered.directions() * width != scattered.values.len() {
        return None;
    }
    let length = |axis: Option<usize>| axis.map_or(1, |i| axes[i].len());
    let (n_out, out_width) = (length(layout.outgoing), length(layout.spectral));
    let (mut original, mut found) = (vec![0.0; channels.len()], vec![0.0; channels.len()]);
    let cells = match known {
        Some(known) => Cow::Borrowed(known),
        None => Cow::Owned(is_sound(scattered).then(|| {
            let at = |axis: Option<&Axis>, d: Vector, theta: f64| axis.map_or(Some(0), |axis| entry_of(axis, d, theta));
            let cell = |(row, &(wi, wo)): (usize, &(Vector, Vector))| {
                let theta = scattered.incoming.get(row).map_or(0.0, |wi| wi[0]);
                Some(at(role(layout.incoming), wi, theta)? * n_out + at(role(layout.outgoing), wo, theta)?)
            };
            directions(scattered, isotropic).par_iter().enumerate().map(cell).collect()
        })?),
    };
    for (row, &cell) in cells.iter().enumerate() {
        let Some(cell) = cell else { continue };
        let source = &scattered.values[row * width..][..width];
        let target = &measurement.tensor.samples()[cell * out_width..][..out_width];
        for ((original, found), channel) in original.iter_mut().zip(&mut found).zip(&channels) {
            (*original, *found) = channel.pair(source, target);
        }
        with(row, &original, &found);
    }
    Some(())
}
