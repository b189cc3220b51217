//! Decodes files to samples; the only definition of the arithmetic that gives each sample.
//!
//! Every operation is specified, so that a reader in another language can be bit-exact: f32 additions and
//! multiplications in the order written here and in `transform`, and this module's `exponential` in f64, rounded once
//! to f32.

use super::between::Between;
use super::classes::{apply_classes, classes_of};
use super::exponential::add_corrections;
use super::header::{Header, finish_of, plan_of};
use super::kept_coefficients::coefficients_of;
use super::light::{Correcting, Light};
use super::lobe_chunk;
use super::metadata::metadata_of;
use super::metadata_chunk::metadata_kind;
use super::policy::Policy;
use super::rd::levels::{LevelIndex, coarsen, level_samples};
use super::rd::{adaptive, gridded, predictive};
use super::rows::{coding_order, lanes};
use super::scales::Scales;
use super::summary::Summary;
use crate::codec::{
    Announced, ChunkKind, Class, CodecError, Container, Decoder, Payload, Reader, code_coefficients, code_corrections,
    code_exact, code_steps,
};
use crate::domain::{Axis, Measurement, Tensor};

/// A decoded material: its samples and its header.
#[derive(Clone, Debug)]
pub struct Decoded {
    /// The decoded samples with quantity, unit and axes.
    pub measurement: Measurement,
    /// Content of the file's header.
    pub summary: Summary,
}

/// Reads the header of a material without decoding its samples; verifies the checksum of every chunk.
pub fn inspect(bytes: &[u8]) -> Result<Summary, CodecError> {
    let (header, container) = open(bytes)?;
    let (metadata, axes) = metadata_of(&header, &container)?;
    Ok(Summary { axes, ..header.summary(metadata) })
}

/// Decodes a material. If it has an analytic lobe beside its samples ([`Summary::lobe`]), the decoded samples lack the
/// lobe; [`Decoded::whole`] adds it.
pub fn decode(bytes: &[u8]) -> Result<Decoded, CodecError> {
    let (header, container) = open(bytes)?;
    let (metadata, axes) = metadata_of(&header, &container)?;
    let samples = samples_of(&header, |kind| container.get(kind).map(|chunk| chunk.payload))?;
    let measurement = measurement_of(&header, axes.clone(), samples, bytes.len())?;
    Ok(Decoded { measurement, summary: Summary { axes, ..header.summary(metadata) } })
}

/// Resolution level at which a file can be decoded: level of its last triangle axis, or a coarser grid of angles.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct LevelInfo {
    /// Number of the resolution level, 0 = coarsest.
    pub level: u8,
    /// Bytes needed to decode this resolution level, counted from the start of the file.
    pub bytes: u64,
    /// Relative RMS error er(L2) of this resolution level, rounded up. For triangles: against the averages of the
    /// original samples over the level's triangles. Below the finest level it is stated to 9 %, and is `f64::MAX` above
    /// 20 000. For grids of angles: the error of evaluating the level at the original samples, `f64::MAX` if not
    /// measured.
    pub er_l2: f64,
}

/// Lists the resolution levels of a material, coarse first; only the finest if the file has no coarser ones.
pub fn levels(bytes: &[u8]) -> Result<Vec<LevelInfo>, CodecError> {
    let (header, container) = open(bytes)?;
    let mut infos = Vec::new();
    if header.predicted {
        let chunk = container.require(ChunkKind::Pyramid)?;
        let mut r = chunk.reader();
        let index = LevelIndex::read(&mut r, header.finest_level(), chunk.length)?;
        infos.extend((0..).zip(&index.entries).map(|(level, entry)| LevelInfo {
            level,
            bytes: (r.offset() + entry.end) as u64,
            er_l2: entry.er_l2(),
        }));
    }
    if header.grid_levels {
        let chunk = container.require(ChunkKind::Grid)?;
        let (levels, start) = gridded::levels_of(chunk.reader(), chunk.offset + chunk.length)?;
        infos.extend((0..).zip(levels).map(|(level, entry)| LevelInfo {
            level,
            bytes: (start + entry.end) as u64,
            er_l2: entry.er_l2,
        }));
    }
    let finest = if header.gridded { infos.len() as u8 } else { header.finest_level() };
    let bytes = container.payload_end() as u64;
    infos.push(LevelInfo { level: finest, bytes, er_l2: header.errors.er_l2 });
    Ok(infos)
}

/// Decodes a material, or a long enough prefix of it, at a coarser resolution level. The samples are averages over
/// larger triangles, or means over blocks of the grid of angles, placed at the mean of their angles. The summary is
/// that of the whole file.
///
/// Complete chunks are verified; the chunk that the prefix cuts has no checksum. Labels are in the metadata at the end.
pub fn decode_level(bytes: &[u8], level: u8) -> Result<Decoded, CodecError> {
    let (mut header, container) = Container::prefix(bytes, announced)?;
    read_stated(&mut header, &container)?;
    let grid = if header.grid_levels { Some(container.require(ChunkKind::Grid)?) } else { None };
    let finest = match grid {
        Some(chunk) => gridded::levels_of(chunk.reader(), chunk.offset + chunk.length)?.0.len() as u8,
        None => header.finest_level(),
    };
    let is_whole = |kind| container.get(kind).is_some_and(|chunk| chunk.end() <= bytes.len());
    if level == finest {
        let end =
            if is_whole(metadata_kind(&header.axes)) { bytes.len() } else { container.payload_end().min(bytes.len()) };
        return decode(&bytes[..end]);
    }
    if level > finest || !(header.predicted || header.grid_levels) {
        let coarsest = if header.predicted || header.grid_levels { 0 } else { finest };
        let reason = format!("the material has no resolution level {level}, expected {coarsest} to {finest}");
        return Err(CodecError::Malformed { at: bytes.len(), reason });
    }
    if let Some(chunk) = grid {
        let payload = |kind| container.get(kind).map(|chunk| chunk.payload);
        let classes = classes_of(&header, payload);
        let chunks = (payload(ChunkKind::Basis), chunk.payload);
        let (around, at) = (header.around_grid(classes.as_deref()), (chunk.length, usize::from(level)));
        let (mut axes, samples) = gridded::decode_level(around, chunks, at, header.values())?;
        let mut metadata = None;
        if is_whole(metadata_kind(&header.axes)) {
            let (text, labelled) = metadata_of(&header, &container)?;
            metadata = text;
            for (axis, labelled) in axes.iter_mut().zip(labelled).filter(|(axis, _)| matches!(axis, Axis::Index { .. }))
            {
                *axis = labelled;
            }
        }
        let measurement = measurement_of(&header, axes, samples, bytes.len())?;
        return Ok(Decoded { measurement, summary: header.summary(metadata) });
    }
    let chunk = container.require(ChunkKind::Pyramid)?;
    let mut r = chunk.reader();
    let index = LevelIndex::read(&mut r, finest, chunk.length)?;
    let Some(entry) = index.entries.get(usize::from(level)) else {
        let reason = format!(
            "the material has no resolution level {level}: it allows random access, or has samples near the largest \
             float32; expected {finest}"
        );
        return Err(CodecError::Malformed { at: bytes.len(), reason });
    };
    // A level is decoded from its own bytes only, however many follow.
    let coded = r
        .take(entry.end, "bytes of the level")
        .map_err(|_| CodecError::Truncated { at: bytes.len(), expected: "more of the level" })?;
    let payload = |kind| container.get(kind).map(|chunk| chunk.payload);
    let classes = classes_of(&header, payload);
    let samples = level_samples(&header, classes.as_deref(), (payload(ChunkKind::Basis), coded), &index, level)?;
    let (metadata, mut axes) = if is_whole(metadata_kind(&header.axes)) {
        metadata_of(&header, &container)?
    } else {
        (None, header.axes.clone())
    };
    coarsen(&mut axes, level);
    let measurement = measurement_of(&header, axes, samples, bytes.len())?;
    Ok(Decoded { measurement, summary: header.summary(metadata) })
}

/// Slice of a material at one entry of the axes before the outgoing directions, usually one incoming direction.
#[derive(Clone, Debug)]
pub struct DecodedBlock {
    /// Samples of one incoming direction (one entry of all axes before the outgoing directions), as `[outgoing]` or
    /// `[outgoing, wavelength]`.
    pub tensor: Tensor,
    /// Content of the file's header: quantity, axes and errors of the whole material, all incoming directions included.
    pub summary: Summary,
}

/// Decodes the samples of one incoming direction of a compressed material. `block` counts the incoming directions: the
/// entries of all axes before the outgoing directions, in row-major order.
///
/// The samples equal those of [`decode`] bit for bit, without a lobe beside the cells ([`DecodedBlock::whole`] has
/// both). With random access only classes, basis and model are decoded besides the block. Any other material is decoded
/// whole.
pub fn decode_block(bytes: &[u8], block: usize) -> Result<DecodedBlock, CodecError> {
    let (header, container) = open(bytes)?;
    let malformed = |reason: String| CodecError::Malformed { at: bytes.len(), reason };
    let at = header.axes.iter().rposition(|axis| matches!(axis, Axis::Triangles(_) | Axis::Grid(_)));
    let at = at.ok_or_else(|| {
        malformed("the material has no directions, hence no slice of one incoming direction".to_owned())
    })?;
    let blocks: usize = header.axes[..at].iter().map(Axis::len).product();
    let length: usize = header.axes[at..].iter().map(Axis::len).product();
    if block >= blocks {
        return Err(malformed(format!(
            "the material has no incoming direction number {block}, expected 0 to {}",
            blocks - 1
        )));
    }
    let (metadata, axes) = metadata_of(&header, &container)?;
    let payload = |kind| container.get(kind).map(|chunk| chunk.payload);
    let own = block * length..(block + 1) * length;
    let samples = match random_pyramid(&header, payload(ChunkKind::Pyramid))? {
        Some(coded) => {
            let classes = classes_of(&header, payload);
            let chunks = (payload(ChunkKind::Basis), coded);
            let mut samples = predictive::decode_block(&header.axes, classes.as_deref(), header.step, chunks, block)?;
            if let Some((light, steps)) = light_of(&header, payload(ChunkKind::Light)) {
                let how = Correcting::new(header.light_step, None, None);
                light.add(how, &steps[block * light.inner()..][..light.inner()], &mut samples);
            }
            header.values().finish(&mut samples);
            finish_samples(classes.as_deref().map(|classes| &classes[own]), &mut samples)?;
            samples
        }
        None => match random_grid(&header, payload(ChunkKind::Grid))? {
            Some(coded) => {
                let classes = classes_of(&header, payload);
                let chunks = (payload(ChunkKind::Basis), coded);
                let around = header.around_grid(classes.as_deref());
                let mut samples = gridded::decode_block(around, chunks, block)?;
                let own = classes.as_deref().map(|classes| &classes[own]);
                if let Some((light, steps)) = light_of(&header, payload(ChunkKind::Light)) {
                    let how = Correcting::new(header.light_step, own, gridded::negative_bound(coded)?);
                    light.add(how, &steps[block * light.inner()..][..light.inner()], &mut samples);
                }
                header.values().finish(&mut samples);
                finish_samples(own, &mut samples)?;
                samples
            }
            None => samples_of(&header, payload)?[own].to_vec(),
        },
    };
    let tensor = Tensor::new(axes[at..].to_vec(), samples).map_err(|e| malformed(e.to_string()))?;
    Ok(DecodedBlock { tensor, summary: Summary { axes, ..header.summary(metadata) } })
}

/// Returns the part of the pyramid chunk (samples on triangles, coded from coarse to fine) behind its table of
/// lower-resolution levels.
///
/// `None` unless each incoming direction can be decoded alone, or if the file corrects the error of single samples.
fn random_pyramid<'a>(header: &Header, payload: Option<&'a [u8]>) -> Result<Option<&'a [u8]>, CodecError> {
    let Some(payload) = payload.filter(|_| header.predicted && header.correction_step == 0.0) else { return Ok(None) };
    let mut r = Reader::new(payload, 0);
    LevelIndex::read(&mut r, header.finest_level(), payload.len())?;
    let coded = r.take(r.remaining(), "pyramid")?;
    Ok(predictive::is_random(&header.axes, coded)?.then_some(coded))
}

/// Returns the grid chunk (coded samples on a grid of angles) if each incoming direction in it can be decoded alone.
/// `None` otherwise, or if the file corrects the error of single samples.
fn random_grid<'a>(header: &Header, payload: Option<&'a [u8]>) -> Result<Option<&'a [u8]>, CodecError> {
    let Some(payload) = payload.filter(|_| header.gridded && header.correction_step == 0.0) else { return Ok(None) };
    Ok(gridded::is_random(payload)?.then_some(payload))
}

fn measurement_of(header: &Header, axes: Vec<Axis>, samples: Vec<f32>, at: usize) -> Result<Measurement, CodecError> {
    let malformed = |reason: String| CodecError::Malformed { at, reason };
    let tensor = Tensor::new(axes, samples).map_err(|e| malformed(e.to_string()))?;
    Measurement::new(header.quantity, header.unit, header.sampling, tensor).map_err(|e| malformed(e.to_string()))
}

/// Replaces the errors that a file states for its coarser grids of angles by `errors`, coarse first. Files without
/// coarser grids stay as they are.
pub(crate) fn with_level_errors(bytes: &[u8], errors: &[f64]) -> Result<Vec<u8>, CodecError> {
    let (header, container) = open(bytes)?;
    if !header.grid_levels {
        return Ok(bytes.to_vec());
    }
    let payload = gridded::with_errors(container.require(ChunkKind::Grid)?.payload, errors)?;
    Ok(container.replaced(ChunkKind::Grid, &payload))
}

/// Decodes the numbers of a lossless material that stores numbers and one common factor ([`Summary::factor`]) instead
/// of samples, NaN = masked. `None` for any other material.
pub fn decode_numbers(bytes: &[u8]) -> Result<Option<Vec<f32>>, CodecError> {
    let (header, container) = open(bytes)?;
    if header.factor == 1.0 {
        return Ok(None);
    }
    samples_of(&Header { factor: 1.0, ..header }, |kind| container.get(kind).map(|chunk| chunk.payload)).map(Some)
}

/// Returns the BLAKE3 digest of the file without its metadata chunk.
pub fn payload_digest(bytes: &[u8]) -> Result<blake3::Hash, CodecError> {
    Ok(open(bytes)?.1.payload_digest())
}

pub(crate) fn open(bytes: &[u8]) -> Result<(Header, Container<'_>), CodecError> {
    let (mut header, container) = Container::read(bytes, announced)?;
    read_stated(&mut header, &container)?;
    Ok((header, container))
}

/// Reads the optional chunks of interpolation between incoming directions and of the analytic lobe into a header that
/// announces them.
fn read_stated(header: &mut Header, container: &Container<'_>) -> Result<(), CodecError> {
    if header.between.is_some() {
        let mut r = container.require(ChunkKind::Between)?.reader();
        let between = Between::read(&mut r)?;
        if !between.fits(header.quantity, &header.axes) {
            return Err(r.malformed(
                "the interpolation between incoming directions does not suit the quantity and axes of the material",
            ));
        }
        header.between = Some(between);
    }
    if header.has_lobe {
        let mut r = container.require(ChunkKind::Lobe)?.reader();
        header.lobe = Some(lobe_chunk::read(&mut r, header.quantity, &header.axes)?);
    }
    Ok(())
}

/// Reads the header of a file, and lists the chunks that the header announces.
fn announced(r: &mut Reader<'_>) -> Result<(Header, Vec<Announced>), CodecError> {
    let header = Header::read(r)?;
    let chunks = header.announced();
    Ok((header, chunks))
}

/// Decodes the corrections of the light (directional albedo or flux) of every incoming direction and wavelength, as the
/// integers that stand for them in the file; `None` without a light chunk.
fn light_of(header: &Header, coded: Option<&[u8]>) -> Option<(Light, Vec<i32>)> {
    let light = Light::of(header.quantity, &header.axes).filter(|_| header.light_step != 0.0)?;
    let mut steps = vec![0_i32; light.entries(header.axes.iter().map(Axis::len).product())];
    code_steps(&mut Decoder::new(coded?), light.inner(), &mut steps);
    Some((light, steps))
}

/// Decodes the samples that `header` and its chunks describe; NaN = masked.
pub(crate) fn samples_of<'a>(
    header: &Header,
    chunk: impl Fn(ChunkKind) -> Option<&'a [u8]>,
) -> Result<Vec<f32>, CodecError> {
    samples_behind(header, chunk, None)
}

/// Decodes the samples that `header` and its chunks describe; NaN = masked. `pyramid` holds the values of samples on
/// triangles (coded by prediction from coarse to fine) if the caller has already decoded them.
pub(crate) fn samples_behind<'a>(
    header: &Header,
    chunk: impl Fn(ChunkKind) -> Option<&'a [u8]>,
    pyramid: Option<Vec<f32>>,
) -> Result<Vec<f32>, CodecError> {
    let count = header.axes.iter().map(Axis::len).product();
    let payload = |kind| chunk(kind).unwrap_or_default();
    let classes = classes_of(header, &chunk);
    let coefficients = payload(ChunkKind::Coefficients);
    let mut samples = match header.policy {
        Policy::Rd => {
            let finish = finish_of(header);
            let mut logs = if header.predicted {
                let coded = payload(ChunkKind::Pyramid);
                let mut r = Reader::new(coded, 0);
                LevelIndex::read(&mut r, header.finest_level(), coded.len())?;
                let chunks = (chunk(ChunkKind::Basis), r.take(r.remaining(), "pyramid")?);
                if let Some(decoded) = pyramid {
                    decoded
                } else {
                    let classes = classes.as_deref();
                    predictive::decode(&header.axes, classes, header.step, chunks, usize::MAX, finish)?.0
                }
            } else if header.gridded {
                let chunks = (chunk(ChunkKind::Basis), payload(ChunkKind::Grid));
                if gridded::has_levels(chunks.1)? != header.grid_levels {
                    let reason = "a grid chunk and a header that differ on coarser levels".to_owned();
                    return Err(CodecError::Malformed { at: 0, reason });
                }
                gridded::decode(header.around_grid(classes.as_deref()), chunks, finish)?
            } else if header.klt {
                let chunks = (payload(ChunkKind::Basis), coefficients);
                adaptive::decode(&header.axes, &header.transforms, classes.as_deref(), header.step, chunks)?
            } else {
                fixed_logs(header, classes.as_deref(), coefficients)?
            };
            if let Some((light, steps)) = light_of(header, chunk(ChunkKind::Light)) {
                let bound = if header.gridded { gridded::negative_bound(payload(ChunkKind::Grid))? } else { None };
                let how = Correcting::new(header.light_step, classes.as_deref(), bound);
                light.add(how, &steps, &mut logs);
            }
            if header.correction_step != 0.0 {
                let mut steps = vec![0_i32; count];
                let mut corrections = Decoder::new(payload(ChunkKind::Corrections));
                code_corrections(&mut corrections, lanes(&header.axes), &mut steps);
                add_corrections(header.correction_step, &steps, &mut logs);
            }
            if finish.is_none() || !(header.predicted || header.gridded) {
                header.values().finish(&mut logs);
            }
            logs
        }
        Policy::Conventional | Policy::Generic | Policy::Adaptive => {
            thresholded_samples(header, classes.as_deref(), coefficients)?
        }
        Policy::Lossless => {
            let mut samples = vec![0.0; count];
            code_exact(&mut Decoder::new(payload(ChunkKind::Exact)), lanes(&header.axes), &mut samples);
            scale(header.factor, &mut samples);
            samples
        }
    };
    finish_samples(classes.as_deref(), &mut samples)?;
    Ok(samples)
}

/// Multiplies every stored number by the common factor of a lossless file; a factor of 1 changes no bit.
pub(super) fn scale(factor: f64, numbers: &mut [f32]) {
    if factor != 1.0 {
        for number in numbers.iter_mut() {
            *number = scaled(*number, factor);
        }
    }
}

/// Returns the sample that a number stored in a lossless file stands for: number × factor, rounded once to f32.
pub(super) fn scaled(number: f32, factor: f64) -> f32 {
    (f64::from(number) * factor) as f32
}

/// Applies the classes (sign, zero, masked) to decoded magnitudes. Without classes, a NaN among them is an error.
fn finish_samples(classes: Option<&[Class]>, samples: &mut [f32]) -> Result<(), CodecError> {
    if let Some(classes) = classes {
        apply_classes(classes, samples);
    } else if samples.iter().any(|s| s.is_nan()) {
        return Err(CodecError::Malformed {
            at: 0,
            reason: "a decoded sample is not a number, although the file masks no samples".to_owned(),
        });
    }
    Ok(())
}

/// Decodes the logarithms of samples that are coded as coefficients in fixed bases on all axes.
fn fixed_logs(header: &Header, classes: Option<&[Class]>, coded: &[u8]) -> Result<Vec<f32>, CodecError> {
    let plan = plan_of(header)?;
    let mut quantised = vec![0_i32; header.axes.iter().map(Axis::len).product()];
    let rows = coding_order(&header.axes, &plan, classes);
    code_coefficients(&mut Decoder::new(coded), &rows, Payload::Integer, &mut quantised);
    drop(rows);
    let mut logs = vec![0.0_f32; quantised.len()];
    Scales::new(&header.axes, &plan).dequantise(header.step, &quantised, &mut logs);
    drop(quantised);
    plan.inverse(&mut logs);
    Ok(logs)
}

fn thresholded_samples(header: &Header, classes: Option<&[Class]>, coded: &[u8]) -> Result<Vec<f32>, CodecError> {
    let (plan, mut samples) = coefficients_of(header, classes, coded)?;
    plan.inverse(&mut samples);
    Ok(samples)
}
