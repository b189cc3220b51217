//! Levels of a grid: coarser grids whose nodes lie at the mean of the entries that they merge.

use super::super::super::values::Values;
use super::decode::{Around, Opened};
use super::divided::DividedRows;
use super::index::{self, GridLevel};
use super::lattice::Shape;
use super::nodes::Nodes;
use super::planes::Weights;
use crate::codec::{CodecError, Reader, Writer};
use crate::domain::{Axis, AzimuthExtent, Azimuths, DirectionGrid, DirectionGridError};

/// Axes and samples of a measurement at a coarser resolution level.
type Coarse = (Vec<Axis>, Vec<f32>);

/// Decodes samples and axes of a coarser grid of angles, number `level` counted from the coarsest. `coded` is a grid
/// chunk of `length` bytes, or a prefix that contains the level.
pub(crate) fn decode_level(
    around: Around<'_>,
    chunks: (Option<&[u8]>, &[u8]),
    (length, level): (usize, usize),
    values: Values,
) -> Result<Coarse, CodecError> {
    let mut opened = Opened::new(around, chunks, (length, Some(level)))?;
    let left_out = opened.levels.get(level).map_or(0, |level| level.left_out);
    let weights = opened.planes.weights(around.classes);
    let pyramid = opened.planes.pyramid(&opened.order, &weights, 0);
    let (count, vectors) = (opened.planes.units() * opened.vectors(), opened.vectors());
    let nodes = pyramid.code(&mut opened.decoder, opened.quantiser, (count, vectors), None, left_out).0;
    // Freed before the samples take memory.
    drop(pyramid);
    let malformed = |error: DirectionGridError| CodecError::Malformed { at: 0, reason: error.to_string() };
    samples(&opened, around, &weights, (nodes, left_out), values).map_err(malformed)
}

/// Inserts a table of lower-resolution grids, which the first bytes suffice to decode, into a chunk of samples on a
/// grid of angles. The table leaves the errors of these grids unknown.
///
/// `None` if no such grid is listed, because it needs too few bytes or nearly all.
pub(crate) fn with_levels(
    around: Around<'_>,
    chunks: (Option<&[u8]>, &[u8]),
    values: Values,
) -> Result<Option<Vec<u8>>, CodecError> {
    let opened = Opened::new(around, chunks, (chunks.1.len(), None))?;
    if opened.streams.is_some() || !opened.levels.is_empty() {
        return Ok(None);
    }
    let head = if opened.negative_bound.is_some() { 5 } else { 1 };
    let stream = &chunks.1[head..];
    let weights = opened.planes.weights(around.classes);
    let pyramid = opened.planes.pyramid(&opened.order, &weights, 0);
    let (count, vectors) = (opened.planes.units() * opened.vectors(), opened.vectors());
    let mut levels: Vec<GridLevel> = Vec::new();
    for left_out in (1..=opened.order.len()).rev() {
        let mut decoder = opened.decoder.clone();
        let nodes = pyramid.code(&mut decoder, opened.quantiser, (count, vectors), None, left_out).0;
        // Beyond the end a decoder reads zeros, which are not in the file.
        let end = decoder.position().min(stream.len());
        if !index::is_stated(end, levels.last().map_or(0, |level| level.end), stream.len()) {
            continue;
        }
        // No azimuth stands for all of them where samples were divided by a function that depends on it.
        if opened.divided.is_some() && opened.planes.lattice().has_lost_azimuths(&opened.order[..left_out]) {
            continue;
        }
        // Skips levels with angles made equal by rounding, or with samples beyond float32.
        let is_whole = samples(&opened, around, &weights, (nodes, left_out), values)
            .is_ok_and(|(_, samples)| !samples.iter().any(|sample| sample.is_infinite()));
        if is_whole {
            levels.push(GridLevel { end, left_out, er_l2: f64::MAX });
        }
    }
    Ok((!levels.is_empty()).then(|| chunk_of(chunks.1, head, &levels, stream)))
}

/// Reads the table of lower-resolution grids, which the first bytes suffice to decode, in a chunk of samples on a grid
/// of angles. Also returns the offset from which these bytes are counted: that of the entropy-coded bytes behind the
/// table.
pub(crate) fn levels_of(mut r: Reader<'_>, end: usize) -> Result<(Vec<GridLevel>, usize), CodecError> {
    let levels = super::decode::Flags::read(&mut r)?.levels(&mut r, end)?;
    Ok((levels, r.offset()))
}

/// Replaces the errors that a chunk of samples on a grid of angles states for its lower-resolution grids by `errors`,
/// lowest resolution first. A chunk without such grids stays as it is.
pub(crate) fn with_errors(coded: &[u8], errors: &[f64]) -> Result<Vec<u8>, CodecError> {
    let mut r = Reader::new(coded, 0);
    let flags = super::decode::Flags::read(&mut r)?;
    let head = if flags.has_negative { 5 } else { 1 };
    let mut levels = flags.levels(&mut r, coded.len())?;
    for (level, &error) in levels.iter_mut().zip(errors) {
        level.er_l2 = error;
    }
    let stream = r.take(r.remaining(), "grid")?;
    Ok(if levels.is_empty() { coded.to_vec() } else { chunk_of(coded, head, &levels, stream) })
}

/// Assembles a chunk of samples on a grid of angles: the first `head` bytes of `coded`, a table of lower-resolution
/// grids, and the entropy-coded bytes `stream`. A flag in the first byte announces the table.
fn chunk_of(coded: &[u8], head: usize, levels: &[GridLevel], stream: &[u8]) -> Vec<u8> {
    let mut w = Writer::default();
    w.u8(coded[0] | super::decode::LEVELS);
    w.raw(&coded[1..head]);
    index::write(&mut w, levels);
    w.raw(stream);
    w.into_bytes()
}

/// Converts decoded means over blocks of directions to the axes and samples of a coarser grid.
fn samples(
    opened: &Opened<'_>,
    around: Around<'_>,
    weights: &Weights,
    (mut nodes, left_out): (Vec<f32>, usize),
    finish: Values,
) -> Result<Coarse, DirectionGridError> {
    let planes = &opened.planes;
    let lattice = planes.lattice();
    let lines = lattice.coarse_lines(&opened.order[..left_out]);
    let axes = coarse_axes(around.axes, &lines)?;
    let n = planes.length();
    let unit = lines.iter().map(|line| line.count).product();
    if let Some(means) = opened.means_of_model(weights, &lines) {
        nodes.iter_mut().zip(means).for_each(|(node, mean)| *node += mean);
    }
    let rows = lattice.coarse_rows(&lines);
    let mut samples = vec![0.0; rows.len() * n];
    planes.synthesise_rows(opened.basis.as_ref(), (&nodes, unit), |row| rows[row] as usize, &mut samples);
    drop(nodes);
    if opened.divided.is_some() {
        let divided = Shape::of(&axes).and_then(|shape| DividedRows::new(&shape, around.divisor));
        debug_assert!(divided.is_some(), "the axes of a level are those of the file, with fewer angles");
        if let Some(divided) = divided {
            divided.restore(&mut samples);
        }
    }
    finish.finish(&mut samples);
    if let Some(classes) = around.classes {
        // Magnitudes of negative samples are not coded; only their bound is known.
        let least = opened.negative_bound.map_or(f32::MIN, |bound| {
            let mut magnitude = [bound];
            finish.finish(&mut magnitude);
            -magnitude[0]
        });
        planes.visit_shares(classes, &lines, |lane, shares| {
            for (&row, samples) in rows.iter().zip(samples.chunks_exact_mut(n)) {
                let mean = samples[lane] * shares[row as usize];
                samples[lane] = if mean < least { least } else { mean };
            }
        });
    }
    Ok((axes, samples))
}

/// Replaces the angles of the last direction grid (usually outgoing), and of incoming directions on the axis before it,
/// by those of a lower-resolution grid. In that grid neighbouring angles are merged. Other axes stay.
fn coarse_axes(axes: &[Axis], lines: &[Nodes]) -> Result<Vec<Axis>, DirectionGridError> {
    let mut axes = axes.to_vec();
    let mut rest = lines;
    let first = axes.iter().rposition(|axis| matches!(axis, Axis::Grid(_))).unwrap_or(0).saturating_sub(1);
    for axis in &mut axes[first..] {
        match axis {
            Axis::Elevation(angles) => {
                if let [line, others @ ..] = rest {
                    angles.clone_from(&line.positions);
                    rest = others;
                }
            }
            Axis::Grid(grid) => {
                let has_azimuths = grid.azimuths().is_some_and(|azimuths| azimuths.angles.len() > 1);
                let (own, others) = rest.split_at((1 + usize::from(has_azimuths)).min(rest.len()));
                if let [polar, azimuths @ ..] = own {
                    *grid = coarse_grid(grid, polar, azimuths.first())?;
                }
                rest = others;
            }
            _ => {}
        }
    }
    Ok(axes)
}

/// Returns a grid of directions with coarser polar angles and azimuths that covers the same range of angles.
fn coarse_grid(
    grid: &DirectionGrid,
    polar: &Nodes,
    azimuth: Option<&Nodes>,
) -> Result<DirectionGrid, DirectionGridError> {
    let azimuths = match (grid.azimuths(), azimuth.filter(|nodes| nodes.halvings > 0)) {
        (Some(_), Some(nodes)) if nodes.count == 1 => None,
        (Some(own), Some(nodes)) => {
            let mut angles = nodes.positions.clone();
            if own.extent == AzimuthExtent::Sector
                && let ([first, .., last], [own_first, .., own_last]) = (angles.as_mut_slice(), own.angles.as_slice())
            {
                // Nothing is known outside a sector, so its ends stay where they are.
                (*first, *last) = (*own_first, *own_last);
            }
            let extent = if own.extent == AzimuthExtent::Closed { AzimuthExtent::Circle } else { own.extent };
            Some(Azimuths { angles, extent })
        }
        (own, _) => own.cloned(),
    };
    let (low, high) = grid.covers();
    let coarse = DirectionGrid::new(grid.frame(), polar.positions.clone(), azimuths)?;
    let coarse = if grid.is_polar_mirrored() { coarse.mirrored()? } else { coarse };
    Ok(coarse.covering(low, high)?.with_outside(grid.outside()))
}
