//! Coarser materials inside a pyramid: the bytes that a level needs, its error, and the correction of its light.
//!
//! A pyramid is coded coarse to fine, so that its first bytes are a coarser material. Its samples are averages of the
//! samples themselves over the level's triangles, not of their logarithms, so that a level keeps the light.
//!
//! ```text
//! levels   for each level of the last triangle axis below its own, coarse first:
//!            varint  bytes after the index that the level needs, at most those present, less those of the level before
//!            u8 k    er(L2) of the level, rounded up to 2^((k − 140) / 8); 0 is 0, 255 more
//!          a first varint 0 ends the index: there are no coarser levels, because every block is decoded independently,
//!          or because their samples would exceed float32;
//!          then, if there are such levels: varint length, range-coded steps of the brightness: for each of these
//!          levels and each representative k, a factor of exp(0.015 k); no bytes if all are 0
//! ```
//! er(L2) is relative to the averages of the original samples. The factor brings the decoded light in all outgoing
//! directions and wavelengths within 1 % of the original, in the mean over the blocks of a representative. Light is
//! weighted by solid angle, projected for quantities that go with a cosine.

use super::super::classes::{apply_classes, classes_of};
use super::super::header::{Header, finish_of};
use super::super::light::weights;
use super::super::parts::Parts;
use super::{gridded, predictive};
use crate::codec::{ChunkKind, Class, CodecError, Decoder, Encoder, Reader, Writer, code_steps};
use crate::domain::{Axis, ErrorReport, Measurement, Quantity, TriangleMesh};
use crate::numeric::wide;
use rayon::prelude::*;

/// Step, in natural-log units, of the factor that brings the total light of a lower-resolution version of a material to
/// that of the original.
const BRIGHTNESS_STEP: f64 = 0.015;
/// Largest relative deviation of a coarser resolution level's total light from that of the measurement, on the same
/// triangles, that is left uncorrected.
const TOLERATED: f64 = 0.0098;
/// Upper bound on the number of steps, of 0.015 natural logarithms each, that correct the brightness of a coarser
/// resolution level; all of them together are a factor of e^75.
const MOST_STEPS: i32 = 5_000;
/// Code that stands for an error of 1, and number of codes to a doubling of the error.
const ONE: f64 = 140.0;
const DOUBLING: f64 = 8.0;

/// Table of the coarser resolution levels of samples on triangles: for each its size, its error and the correction of
/// its total light.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct LevelIndex<'a> {
    /// Size in bytes and error of each resolution level of the triangle mesh except the finest, coarsest level first.
    pub(crate) entries: Vec<LevelEntry>,
    /// Range-coded corrections of the total light of all coarser resolution levels. A correction is an integer k that
    /// stands for a factor of exp(0.015 k) on the samples.
    brightness: &'a [u8],
}

/// Lower-resolution version of samples on triangles: its error, and the number of bytes at the start of the coded
/// samples that suffice to decode it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LevelEntry {
    /// Bytes needed to decode this resolution level, counted from the end of the table of levels.
    pub(crate) end: usize,
    error: u8,
}

impl LevelEntry {
    /// Relative RMS error er(L2) of the resolution level, rounded up.
    pub(crate) fn er_l2(self) -> f64 {
        error_of(self.error)
    }
}

impl<'a> LevelIndex<'a> {
    /// Reads the table of coarser resolution levels (bytes, error and brightness correction of each) at the start of a
    /// payload of `length` bytes. `levels` is the number of levels below the finest.
    pub(crate) fn read(r: &mut Reader<'a>, levels: u8, length: usize) -> Result<Self, CodecError> {
        let start = r.offset();
        let mut entries: Vec<LevelEntry> = Vec::new();
        for _ in 0..levels {
            let before = entries.last().map_or(0, |entry| entry.end);
            let more = r.size(usize::MAX >> 1, "bytes of a level")?;
            // A level needs at least the first number of the pyramid.
            if entries.is_empty() && more == 0 {
                return Ok(Self { entries, brightness: &[] });
            }
            let error = r.u8("error of a level")?;
            entries.push(LevelEntry { end: before.saturating_add(more), error });
        }
        let brightness = if levels > 0 { r.size(usize::MAX >> 1, "bytes of the brightness")? } else { 0 };
        let brightness = r.take(brightness, "brightness of the levels")?;
        let behind = length.saturating_sub(r.offset() - start);
        match entries.last() {
            Some(last) if last.end > behind => Err(r.malformed(format!(
                "the coarser levels need {} bytes behind their table, but the pyramid chunk has {behind} there",
                last.end
            ))),
            _ => Ok(Self { entries, brightness }),
        }
    }

    fn write(&self) -> Vec<u8> {
        let mut w = Writer::default();
        let mut before = 0;
        for entry in &self.entries {
            w.varint((entry.end - before) as u64);
            w.u8(entry.error);
            before = entry.end;
        }
        if !self.entries.is_empty() {
            w.varint(self.brightness.len() as u64);
            w.raw(self.brightness);
        }
        w.into_bytes()
    }

    /// Decodes the corrections of the total light of one resolution level: for each coded incoming direction, an
    /// integer k that stands for a factor of exp(0.015 k) on its samples.
    fn steps(&self, level: usize, representatives: usize) -> Vec<i32> {
        let mut steps = vec![0; self.entries.len() * representatives];
        if !self.brightness.is_empty() {
            code_steps(&mut Decoder::new(self.brightness), representatives.max(1), &mut steps);
        }
        steps[level * representatives..][..representatives].to_vec()
    }
}

/// Typical number of bytes of the table of lower-resolution levels in the file of a measurement on triangles; 0 without
/// triangles.
pub(crate) fn usual_bytes(measurement: &Measurement) -> usize {
    let grid = Grid::of(measurement.tensor.axes());
    grid.map_or(0, |grid| 2 * usize::from(grid.mesh.level()) + 1)
}

/// Inserts the index of coarser resolution levels into a file whose samples on triangles or grids are coded from coarse
/// to fine; other files stay unchanged.
pub(crate) fn insert(parts: &mut Parts, measurement: &Measurement) -> Result<(), CodecError> {
    insert_and(parts, measurement, |_, _| ()).map(drop)
}

/// Inserts the index of coarser resolution levels into a file. Also returns the decoded values of the finest level if
/// they lie on triangles and are coded from coarse to fine, all incoming directions together; otherwise `None`.
pub(crate) fn insert_and_decode(parts: &mut Parts, measurement: &Measurement) -> Result<Option<Vec<f32>>, CodecError> {
    insert_and(parts, measurement, |header, levels| levels.decode(usize::MAX, finish_of(header)).0)
}

/// Inserts the table of lower-resolution levels into a file. For samples on triangles it also calls `more` with the
/// decoder that has served to make the table, and returns the result of `more`; otherwise `None`.
fn insert_and<T>(
    parts: &mut Parts,
    measurement: &Measurement,
    more: impl FnOnce(&Header, &predictive::Levels<'_>) -> T,
) -> Result<Option<T>, CodecError> {
    if parts.header.gridded {
        insert_in_grid(parts)?;
        return Ok(None);
    }
    let header = &parts.header;
    let (Some(coded), Some(finest)) = (parts.chunk(ChunkKind::Pyramid), Grid::of(&header.axes)) else {
        return Ok(None);
    };
    if predictive::is_random(&header.axes, coded)? {
        let none: &[u8] = if finest.mesh.level() > 0 { &[0] } else { &[] };
        let payload = [none, coded].concat();
        replace(parts, payload);
        return Ok(None);
    }
    let classes = classes_of(header, |kind| parts.chunk(kind));
    let chunks = (parts.chunk(ChunkKind::Basis), coded);
    let orbits = predictive::orbits(&header.axes, coded)?;
    let representatives = orbits.iter().max().map_or(0, |&last| last as usize + 1);
    let mut index = LevelIndex { entries: Vec::new(), brightness: &[] };
    let mut steps = Vec::new();
    let mut beyond = false;
    let levels = predictive::Levels::new(&header.axes, classes.as_deref(), header.step, chunks)?;
    for level in 0..finest.mesh.level() {
        let (mut decoded, end) = averages_at(header, classes.as_deref(), &levels, level);
        let original = finest.averages(measurement.tensor.samples(), level);
        let grid = finest.at(level);
        let wanted = grid.brightness(header.quantity, &original, &orbits, representatives);
        let found = grid.brightness(header.quantity, &decoded, &orbits, representatives);
        let mut here: Vec<i32> = wanted.iter().zip(&found).map(|(&wanted, &found)| step_of(wanted, found)).collect();
        let plain = decoded.clone();
        grid.brighten(&here, &orbits, &mut decoded);
        if decoded.iter().any(|s| s.is_infinite()) {
            // Near the float32 maximum the correction may overflow; such a level keeps its light uncorrected.
            decoded = plain;
            here.fill(0);
        }
        beyond |= decoded.iter().any(|s| s.is_infinite());
        let errors = ErrorReport::measure(&original, &decoded, f64::from(header.floor));
        // Beyond the end a decoder reads zeros, which are not in the file.
        index.entries.push(LevelEntry { end: end.min(coded.len()), error: error_code(errors.er_l2) });
        steps.extend(here);
    }
    let more = more(header, &levels);
    drop(levels);
    if beyond {
        // No reader accepts such a level, so the material is stored without coarser ones.
        let payload = [&[0], coded].concat();
        replace(parts, payload);
        return Ok(Some(more));
    }
    let mut brightness = Vec::new();
    if steps.iter().any(|&step| step != 0) {
        let mut encoder = Encoder::default();
        code_steps(&mut encoder, representatives.max(1), &mut steps);
        brightness = encoder.finish();
    }
    let mut payload = LevelIndex { brightness: &brightness, ..index }.write();
    payload.extend_from_slice(coded);
    replace(parts, payload);
    Ok(Some(more))
}

/// Inserts the table of coarser resolution levels into the chunk of samples on a grid of angles, without the errors of
/// these levels, which are not known yet.
fn insert_in_grid(parts: &mut Parts) -> Result<(), CodecError> {
    let header = &parts.header;
    let classes = classes_of(header, |kind| parts.chunk(kind));
    let chunks = (parts.chunk(ChunkKind::Basis), parts.chunk(ChunkKind::Grid).unwrap_or_default());
    let payload = gridded::with_levels(header.around_grid(classes.as_deref()), chunks, header.values())?;
    if let Some(payload) = payload {
        for (_, old) in parts.chunks.iter_mut().filter(|(kind, _)| *kind == ChunkKind::Grid) {
            old.clone_from(&payload);
        }
        parts.header.grid_levels = true;
    }
    Ok(())
}

fn replace(parts: &mut Parts, payload: Vec<u8>) {
    if let Some((_, old)) = parts.chunks.iter_mut().find(|(kind, _)| *kind == ChunkKind::Pyramid) {
        *old = payload;
    }
}

/// Decodes the samples at a resolution level below the finest. `chunks` holds the basis and the bytes after the level
/// index, at least up to the level's end.
pub(crate) fn level_samples(
    header: &Header,
    classes: Option<&[Class]>,
    chunks: (Option<&[u8]>, &[u8]),
    index: &LevelIndex<'_>,
    level: u8,
) -> Result<Vec<f32>, CodecError> {
    let levels = predictive::Levels::new(&header.axes, classes, header.step, chunks)?;
    let (mut samples, _) = averages_at(header, classes, &levels, level);
    if let Some(finest) = Grid::of(&header.axes) {
        let orbits = predictive::orbits(&header.axes, chunks.1)?;
        let representatives = orbits.iter().max().map_or(0, |&last| last as usize + 1);
        finest.at(level).brighten(&index.steps(usize::from(level), representatives), &orbits, &mut samples);
    }
    if classes.is_none() && samples.iter().any(|s| s.is_nan()) {
        return Err(CodecError::Malformed {
            at: 0,
            reason: "a decoded sample is not a number, although the file masks no samples".to_owned(),
        });
    }
    Ok(samples)
}

/// Replaces the mesh of the last triangle axis by the coarser one of `level`.
pub(crate) fn coarsen(axes: &mut [Axis], level: u8) {
    if let Some(Axis::Triangles(mesh)) = axes.iter_mut().rfind(|axis| matches!(axis, Axis::Triangles(_))) {
        *mesh = coarser(*mesh, level);
    }
}

fn coarser(mesh: TriangleMesh, level: u8) -> TriangleMesh {
    let mut mesh = mesh;
    while mesh.level() > level
        && let Some(next) = mesh.coarser()
    {
        mesh = next;
    }
    mesh
}

/// Decodes the averages of samples over the triangles of a coarser level; their brightness is not yet corrected. Also
/// returns the number of bytes, from the end of the table of levels in the file, that they depend on.
fn averages_at(
    header: &Header,
    classes: Option<&[Class]>,
    levels: &predictive::Levels<'_>,
    level: u8,
) -> (Vec<f32>, usize) {
    let (mut samples, end) = levels.decode(usize::from(level), Some(header.values()));
    if let Some(classes) = classes {
        apply_classes(classes, &mut samples);
    }
    let averages = Grid::of(&header.axes).map_or_else(Vec::new, |grid| grid.averages(&samples, level));
    (averages, end)
}

/// Layout of a tensor around its last triangle axis: mesh, product of the lengths of all axes between it and the last
/// axis, and length of the last axis.
#[derive(Clone, Copy)]
struct Grid {
    mesh: TriangleMesh,
    between: usize,
    length: usize,
}

impl Grid {
    fn of(axes: &[Axis]) -> Option<Self> {
        let at = axes.iter().rposition(|axis| matches!(axis, Axis::Triangles(_)))?;
        let Axis::Triangles(mesh) = axes[at] else { return None };
        let (between, length) = match &axes[at + 1..] {
            [] => (1, 1),
            [between @ .., last] => (between.iter().map(Axis::len).product(), last.len()),
        };
        Some(Self { mesh, between, length })
    }

    fn at(self, level: u8) -> Self {
        Self { mesh: coarser(self.mesh, level), ..self }
    }

    /// Means of unmasked samples over the triangles of a coarser level; masked (NaN) if all samples of a triangle are.
    fn averages(self, samples: &[f32], level: u8) -> Vec<f32> {
        let inner = self.between * self.length;
        let parts = 1 << (2 * u32::from(self.mesh.level() - level.min(self.mesh.level())));
        let mut averages = vec![f32::NAN; samples.len() / parts];
        averages.par_chunks_mut(inner).zip(samples.par_chunks(inner * parts)).with_min_len(64).for_each(
            |(averages, samples)| {
                let (mut sums, mut counts) = (vec![0.0_f64; inner], vec![0.0_f64; inner]);
                wide(
                    #[inline(always)]
                    || {
                        for row in samples.chunks_exact(inner) {
                            for ((sum, count), &s) in sums.iter_mut().zip(&mut counts).zip(row) {
                                let more = *sum + f64::from(s);
                                (*sum, *count) = if s.is_nan() { (*sum, *count) } else { (more, *count + 1.0) };
                            }
                        }
                        for ((average, sum), count) in averages.iter_mut().zip(&sums).zip(&counts) {
                            if *count > 0.0 {
                                *average = (sum / count) as f32;
                            }
                        }
                    },
                );
            },
        );
        averages
    }

    /// Light leaving all blocks (incoming directions) that a coded block represents by symmetry, summed with
    /// integration weights, up to a common factor.
    fn brightness(self, quantity: Quantity, samples: &[f32], orbits: &[u32], representatives: usize) -> Vec<f64> {
        let cells = self.mesh.len();
        let weights = weights(quantity, self.mesh);
        let mut sums = vec![0.0; representatives];
        for (row, samples) in samples.chunks_exact(self.length).enumerate() {
            let sum: f64 = samples.iter().filter(|s| !s.is_nan()).map(|&s| f64::from(s)).sum();
            sums[orbits[self.block(row)] as usize] += weights[row / self.between % cells] * sum;
        }
        sums
    }

    /// Multiplies every block (incoming direction) by the brightness correction of the coded block that represents it
    /// by symmetry.
    fn brighten(self, steps: &[i32], orbits: &[u32], samples: &mut [f32]) {
        let factor = |&step: &i32| libm::exp(f64::from(step.clamp(-MOST_STEPS, MOST_STEPS)) * BRIGHTNESS_STEP) as f32;
        let factors: Vec<f32> = steps.iter().map(factor).collect();
        for (row, samples) in samples.chunks_exact_mut(self.length).enumerate() {
            let representative = orbits[self.block(row)] as usize;
            if steps[representative] != 0 {
                for s in samples {
                    *s *= factors[representative];
                }
            }
        }
    }

    /// Number of the block (incoming direction) that contains a row of samples.
    fn block(self, row: usize) -> usize {
        row / (self.mesh.len() * self.between) * self.between + row % self.between
    }
}

/// Returns the number of brightness steps, factors of e^0.015, that brings the total light `found` of a resolution
/// level nearest to `wanted`; 0 if both nearly agree already.
fn step_of(wanted: f64, found: f64) -> i32 {
    let ratio = wanted / found;
    if !(wanted > 0.0 && found > 0.0 && ratio.is_finite()) || (ratio - 1.0).abs() <= TOLERATED {
        return 0;
    }
    let limit = f64::from(MOST_STEPS);
    libm::round(libm::log(ratio) / BRIGHTNESS_STEP).clamp(-limit, limit) as i32
}

/// Returns the smallest 8-bit code that stands for an er(L2) (relative RMS error) of at least `error`; codes are
/// logarithmic.
fn error_code(error: f64) -> u8 {
    (0..=u8::MAX).find(|&code| error_of(code) >= error).unwrap_or(u8::MAX)
}

fn error_of(code: u8) -> f64 {
    match code {
        0 => 0.0,
        u8::MAX => f64::MAX,
        _ => libm::exp2((f64::from(code) - ONE) / DOUBLING),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_stated_rounded_up_by_at_most_a_tenth() {
        for error in [1e-5, 1e-3, 0.01, 0.5, 1.0, 77.0, 15_000.0] {
            let stated = error_of(error_code(error));
            assert!(stated >= error && stated < error * 1.0906, "{error}: {stated}");
        }
        assert_eq!((error_of(error_code(0.0)), error_of(error_code(1e9))), (0.0, f64::MAX));
        assert!((0..u8::MAX).all(|code| error_of(code) < error_of(code + 1)));
    }

    #[test]
    fn brightness_is_left_within_one_percent() {
        for i in 1..4000 {
            let ratio = f64::from(i) / 1000.0;
            let corrected = libm::exp(f64::from(step_of(ratio, 1.0)) * BRIGHTNESS_STEP);
            assert!((corrected / ratio - 1.0).abs() < 0.0099, "{ratio}");
        }
        assert_eq!((step_of(1.009, 1.0), step_of(0.0, 1.0), step_of(1.0, 0.0), step_of(-1.0, 1.0)), (0, 0, 0, 0));
        assert_eq!(step_of(f64::MAX, f64::MIN_POSITIVE), 0);
    }

    #[test]
    fn an_index_is_read_as_it_was_written_and_cut_short_it_is_an_error() {
        let entries = vec![LevelEntry { end: 5, error: 150 }, LevelEntry { end: 200, error: 90 }];
        let index = LevelIndex { entries, brightness: &[1, 2, 3] };
        let bytes = index.write();
        assert_eq!(bytes.len(), 1 + 1 + 2 + 1 + 1 + 3);
        let read = |bytes, length| LevelIndex::read(&mut Reader::new(bytes, 0), 2, length).map(|read| read == index);
        assert_eq!(read(&bytes, bytes.len() + 200).ok(), Some(true));
        assert!(matches!(read(&bytes, bytes.len() + 199), Err(CodecError::Malformed { .. })));
        for end in 0..bytes.len() {
            assert!(read(&bytes[..end], bytes.len() + 200).is_err());
        }
        assert!(LevelIndex { entries: Vec::new(), brightness: &[] }.write().is_empty());
    }

    #[test]
    fn averages_count_what_is_measured() {
        let mesh = TriangleMesh::new(crate::domain::Domain::Hemisphere, 1).unwrap();
        let grid = Grid { mesh, between: 1, length: 2 };
        let mut samples: Vec<f32> = (0..32).map(|i| i as f32).collect();
        samples[0] = f32::NAN;
        samples[2] = f32::NAN;
        (8..16).step_by(2).for_each(|i| samples[i] = f32::NAN);
        let averages = grid.averages(&samples, 0);
        assert_eq!(averages.len(), 8);
        assert_eq!((averages[0], averages[1], averages[3]), (5.0, 4.0, 12.0));
        assert!(averages[2].is_nan());
    }
}
