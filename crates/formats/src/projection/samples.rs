//! Errors of a tensor at the original samples of the file.

use super::angles::{check, sample_directions};
use super::error::Role;
use super::planes;
use super::request::{AxesRequest, DirectionDomain};
use super::resampling::Channels;
use super::spectral;
use crate::domain::{Axis, Direction, ErrorAccumulator, ErrorReport, Layout, Measurement, Note};
use crate::formats::{Acquisition, Angles, Samples, SpectralFactor};
use crate::notes::ProjectionNote;
use rayon::prelude::*;

/// Number of samples compared with a tensor at a time: memory is needed for two arrays of this length.
const PIECE: usize = 1 << 20;

/// Index of a direction in the file, and index of the position on the tensor axis that contains it.
type Pair = (usize, usize);

/// Assignment of the measured values of a file, `[index, incoming, outgoing, spectral]`, to the positions in a
/// resampled tensor with which they are compared.
struct Pairing<'a> {
    values: &'a [f32],
    /// Sizes of the sample array of the file: incoming directions, outgoing directions and channels.
    shape: (usize, usize, usize),
    outer: usize,
    incoming: Vec<Pair>,
    outgoing: Vec<Pair>,
    channels: Channels,
}

/// Measures the errors of `measurement`, projected or decoded, at the original samples of the file. The tensor is taken
/// as piecewise constant in direction; the samples are resampled to its wavelengths.
///
/// Returns `None` if the directions of the samples are those of the tensor, or if the tensor does not belong to this
/// file. Also returns `None` for samples at scattered directions, which are compared with an evaluated material
/// ([`ScatteredSamples`]).
///
/// A sample on the boundary of the measured range is looked up a millionth of a degree inside. A sample without
/// azimuth represents its ring and is compared at 16 azimuths. Samples outside the tensor's directions are skipped.
///
/// [`ScatteredSamples`]: super::ScatteredSamples
pub fn error_at_samples(acquisition: &Acquisition, measurement: &Measurement) -> Option<ErrorReport> {
    let instead = planes::instead(acquisition, DirectionDomain::Triangles);
    let samples = instead.as_ref().map_or(&acquisition.samples, |(samples, _)| samples);
    let pairing = pair(acquisition, samples, measurement)?;
    let tensor = measurement.tensor.samples();
    let layout = measurement.layout().ok()?;
    let length = |axis: Option<usize>| axis.map_or(1, |i| measurement.tensor.axes()[i].len());
    let shape = (length(layout.incoming), length(layout.outgoing), length(layout.spectral));
    let (n_in, n_out, width) = (pairing.incoming.len(), pairing.outgoing.len(), pairing.channels.to());
    let directions = pairing.outer * n_in * n_out;
    if directions == 0 || width == 0 {
        return Some(ErrorReport::default());
    }

    let rows = (PIECE / width).clamp(1, directions);
    let (mut original, mut found) = (vec![0.0_f32; rows * width], vec![0.0_f32; rows * width]);
    let mut errors = ErrorAccumulator::default();
    for first in (0..directions).step_by(rows) {
        let length = rows.min(directions - first) * width;
        let (original, found) = (&mut original[..length], &mut found[..length]);
        let rows = original.par_chunks_mut(width).zip(found.par_chunks_mut(width)).enumerate();
        rows.for_each_init(Vec::new, |wide, (row, (s, d))| {
            let direction = first + row;
            let (outer, i, o) = (direction / (n_in * n_out), direction / n_out % n_in, direction % n_out);
            let ((sample_in, cell_in), (sample_out, cell_out)) = (pairing.incoming[i], pairing.outgoing[o]);
            let from = pairing.shape;
            let source = &pairing.values[((outer * from.0 + sample_in) * from.1 + sample_out) * from.2..][..from.2];
            let target = &tensor[((outer * shape.0 + cell_in) * shape.1 + cell_out) * shape.2..][..shape.2];
            wide.clear();
            wide.extend(source.iter().map(|&value| f64::from(value)));
            pairing.channels.write(wide, s);
            d.copy_from_slice(target);
        });
        errors.add(original, found, 0.0);
    }
    Some(errors.finish())
}

/// Returns a note if triangles of automatically chosen levels miss the samples of a grid by more than half the target
/// error.
pub(super) fn coarseness(acquisition: &Acquisition, measurement: &Measurement, request: &AxesRequest) -> Option<Note> {
    if request.incoming_level.is_some() || request.outgoing_level.is_some() {
        return None;
    }
    let (target, found) = (request.target(), error_at_samples(acquisition, measurement)?.er_l2);
    (found > 0.5 * target)
        .then(|| ProjectionNote::CellsCoarse { error_percent: 100.0 * found, target_percent: 100.0 * target }.into())
}

fn pair<'a>(acquisition: &Acquisition, samples: &'a Samples, measurement: &Measurement) -> Option<Pairing<'a>> {
    let layout = measurement.layout().ok()?;
    let axes = measurement.tensor.axes();
    let role = |axis: Option<usize>| axis.map(|i| &axes[i]);
    let factor = acquisition.spectral_factor.as_ref();
    let outer: usize = axes[..layout.indices].iter().map(Axis::len).product();
    match samples {
        Samples::Grid(grid) => {
            let same_indices = grid.index.iter().map(Axis::len).eq(axes[..layout.indices].iter().map(Axis::len));
            let incoming = angle_pairs(grid.incoming.as_ref(), role(layout.incoming))?;
            let outgoing = angle_pairs(grid.outgoing.as_ref(), role(layout.outgoing))?;
            let channels = channels(grid.spectral.as_ref(), factor, role(layout.spectral))?;
            let count = |angles: Option<&Angles>| angles.map_or(1, super::angles::count);
            let shape = (count(grid.incoming.as_ref()), count(grid.outgoing.as_ref()), channels.from());
            let whole = outer * shape.0 * shape.1 * shape.2 == grid.values.len();
            (same_indices && whole).then_some(Pairing {
                values: &grid.values,
                shape,
                outer,
                incoming,
                outgoing,
                channels,
            })
        }
        // A function has no samples of its own.
        Samples::Function(_) | Samples::Scattered(_) => None,
        Samples::OnAxes { tensor, .. } => {
            let own = Layout::of(acquisition.quantity, tensor.axes()).ok()?;
            let own_role = |axis: Option<usize>| axis.map(|i| &tensor.axes()[i]);
            let same_indices = tensor.axes()[..own.indices] == axes[..layout.indices];
            let directions_kept =
                own_role(own.incoming) == role(layout.incoming) && own_role(own.outgoing) == role(layout.outgoing);
            if !same_indices || directions_kept {
                return None;
            }
            let incoming = axis_pairs(own_role(own.incoming), role(layout.incoming))?;
            let outgoing = axis_pairs(own_role(own.outgoing), role(layout.outgoing))?;
            let channels = channels(own_role(own.spectral), factor, role(layout.spectral))?;
            let length = |axis: Option<usize>| axis.map_or(1, |i| tensor.axes()[i].len());
            let shape = (length(own.incoming), length(own.outgoing), channels.from());
            Some(Pairing { values: tensor.samples(), shape, outer, incoming, outgoing, channels })
        }
    }
}

/// Returns the conversion of the file's channels to those on the spectral `axis` of a tensor; `None` if the tensor does
/// not belong to this file.
fn channels(own: Option<&Axis>, factor: Option<&SpectralFactor>, axis: Option<&Axis>) -> Option<Channels> {
    let wanted = if let Some(Axis::Wavelength(grid)) = axis { Some(grid) } else { None };
    let spectral = spectral::plan(own, factor, wanted).ok()?;
    let is_same = match (&spectral.axis, axis) {
        (Some(Axis::Wavelength(a)), Some(Axis::Wavelength(b))) => spectral::same(a, b),
        (a, b) => a.as_ref() == b,
    };
    is_same.then_some(spectral.channels)
}

fn angle_pairs(angles: Option<&Angles>, axis: Option<&Axis>) -> Option<Vec<Pair>> {
    match (angles, axis) {
        (None, None) => Some(vec![(0, 0)]),
        (Some(angles), Some(Axis::Elevation(values))) if angles.theta == *values => {
            Some((0..values.len()).map(|i| (i, i)).collect())
        }
        (Some(angles), Some(Axis::Triangles(mesh))) => {
            check(Role::Incoming, angles).ok()?;
            let cell = |(sample, direction): (usize, Direction)| Some((sample, mesh.locate(direction)?));
            Some(sample_directions(angles).into_iter().filter_map(cell).collect())
        }
        _ => None,
    }
}

fn axis_pairs(own: Option<&Axis>, axis: Option<&Axis>) -> Option<Vec<Pair>> {
    match (own, axis) {
        (None, None) => Some(vec![(0, 0)]),
        (Some(Axis::Triangles(fine)), Some(Axis::Triangles(coarse))) if fine.domain() == coarse.domain() => {
            let depth = fine.level().checked_sub(coarse.level())?;
            Some((0..fine.len()).map(|i| (i, i >> (2 * u32::from(depth)))).collect())
        }
        (Some(own), Some(axis)) if own == axis => Some((0..own.len()).map(|i| (i, i)).collect()),
        _ => None,
    }
}
