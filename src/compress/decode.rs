//! Files → samples: the one place that says what a decoder computes for each sample.
//!
//! Every operation is specified, so that a reader in another language can be bit-exact: f32 additions and multiplications
//! in the order written here and in `transform`, and the `exponential` of this room in f64, rounded once to f32.

use super::exponential::{add_corrections, exponentiate};
use super::header::Header;
use super::rd::{adaptive, predictive};
use super::rows::{coding_order, lanes};
use super::scales::Scales;
use super::{Policy, Summary};
use crate::codec::{
    ChunkKind, Class, CodecError, Container, Decoder, Payload, Reader, code_classes, code_coefficients,
    code_corrections, code_exact, read_text,
};
use crate::domain::{Axis, Measurement, Tensor};
use crate::transform::Plan;

/// The largest metadata text, in bytes.
const MAX_METADATA: usize = 1 << 24;

/// A decoded material.
#[derive(Clone, Debug)]
pub struct Decoded {
    /// The samples.
    pub measurement: Measurement,
    /// The header.
    pub summary: Summary,
}

/// Reads the header of a material without decoding its samples; checks every chunk's checksum.
pub fn inspect(bytes: &[u8]) -> Result<Summary, CodecError> {
    let (header, container) = open(bytes)?;
    let (metadata, axes) = metadata_of(&header, &container)?;
    Ok(Summary { axes, ..header.summary(metadata) })
}

/// Decodes a material.
pub fn decode(bytes: &[u8]) -> Result<Decoded, CodecError> {
    let (header, container) = open(bytes)?;
    let (metadata, axes) = metadata_of(&header, &container)?;
    let samples = samples_of(&header, |kind| container.get(kind).map(|chunk| chunk.payload))?;
    let malformed = |reason: String| CodecError::Malformed { at: bytes.len(), reason };
    let tensor = Tensor::new(axes.clone(), samples).map_err(|e| malformed(e.to_string()))?;
    let measurement = Measurement::new(header.quantity, header.unit, header.sampling, tensor)
        .map_err(|e| malformed(e.to_string()))?;
    Ok(Decoded { measurement, summary: Summary { axes, ..header.summary(metadata) } })
}

/// The BLAKE3 digest of the file without its metadata chunk.
pub fn payload_digest(bytes: &[u8]) -> Result<blake3::Hash, CodecError> {
    Ok(open(bytes)?.1.payload_digest())
}

fn open(bytes: &[u8]) -> Result<(Header, Container<'_>), CodecError> {
    Container::read(bytes, announced)
}

/// The header and the chunks that follow it.
fn announced(r: &mut Reader<'_>) -> Result<(Header, Vec<ChunkKind>), CodecError> {
    let header = Header::read(r)?;
    let chunks = header.announced();
    Ok((header, chunks))
}

/// The metadata chunk's text, and the axes with the labels it holds.
fn metadata_of(header: &Header, container: &Container<'_>) -> Result<(Option<String>, Vec<Axis>), CodecError> {
    let mut axes = header.axes.clone();
    let Some(chunk) = container.get(ChunkKind::Metadata) else { return Ok((None, axes)) };
    let malformed = |reason: &str| CodecError::Malformed { at: chunk.offset, reason: reason.to_owned() };
    let text = read_text(&mut chunk.reader(), MAX_METADATA)?;
    let json: serde_json::Value = serde_json::from_str(&text).map_err(|_| malformed("metadata is no JSON"))?;
    for (i, axis) in axes.iter_mut().enumerate() {
        if let Axis::Index { count, labels } = axis {
            let stored = json["labels"][i.to_string()].as_array().filter(|stored| stored.len() == *count);
            *labels = stored.into_iter().flatten().map(|label| label.as_str().unwrap_or("").to_owned()).collect();
        }
    }
    Ok((Some(text), axes))
}

/// The samples that `header` and its chunks stand for; NaN = masked.
pub(crate) fn samples_of<'a>(
    header: &Header,
    chunk: impl Fn(ChunkKind) -> Option<&'a [u8]>,
) -> Result<Vec<f32>, CodecError> {
    let count = header.axes.iter().map(Axis::len).product();
    let payload = |kind| chunk(kind).unwrap_or_default();
    let classes = header.has_classes.then(|| {
        let mut classes = vec![Class::Positive; count];
        code_classes(&mut Decoder::new(payload(ChunkKind::Classes)), lanes(&header.axes), &mut classes);
        classes
    });
    let coefficients = payload(ChunkKind::Coefficients);
    let mut samples = match header.policy {
        Policy::Rd => {
            let mut logs = if header.predicted {
                let chunks = (chunk(ChunkKind::Basis), payload(ChunkKind::Pyramid));
                predictive::decode(&header.axes, classes.as_deref(), header.step, chunks)?
            } else if header.klt {
                let chunks = (payload(ChunkKind::Basis), coefficients);
                adaptive::decode(&header.axes, &header.transforms, classes.as_deref(), header.step, chunks)?
            } else {
                fixed_logs(header, classes.as_deref(), coefficients)?
            };
            if header.correction_step != 0.0 {
                let mut steps = vec![0_i32; count];
                let mut corrections = Decoder::new(payload(ChunkKind::Corrections));
                code_corrections(&mut corrections, lanes(&header.axes), &mut steps);
                add_corrections(header.correction_step, &steps, &mut logs);
            }
            exponentiate(&mut logs);
            logs
        }
        Policy::Conventional | Policy::Generic | Policy::Adaptive => {
            thresholded_samples(header, classes.as_deref(), coefficients)?
        }
        Policy::Lossless => {
            let mut samples = vec![0.0; count];
            code_exact(&mut Decoder::new(payload(ChunkKind::Exact)), lanes(&header.axes), &mut samples);
            samples
        }
    };
    if let Some(classes) = classes {
        apply_classes(&classes, &mut samples);
    } else if samples.iter().any(|s| s.is_nan()) {
        return Err(CodecError::Malformed { at: 0, reason: "a coefficient is not a number".to_owned() });
    }
    Ok(samples)
}

fn apply_classes(classes: &[Class], samples: &mut [f32]) {
    for (sample, class) in samples.iter_mut().zip(classes) {
        match class {
            Class::Positive => {}
            Class::Negative => *sample = -*sample,
            Class::Zero => *sample = 0.0,
            Class::Masked => *sample = f32::NAN,
        }
    }
}

fn plan_of(header: &Header) -> Result<Plan, CodecError> {
    Plan::new(&header.axes, &header.transforms).map_err(|e| CodecError::Malformed { at: 0, reason: e.to_string() })
}

/// The logarithms of a first layer in fixed bases.
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
    let plan = plan_of(header)?;
    let mut bits = vec![0_i32; header.axes.iter().map(Axis::len).product()];
    let rows = coding_order(&header.axes, &plan, classes);
    code_coefficients(&mut Decoder::new(coded), &rows, Payload::Float, &mut bits);
    let mut samples: Vec<f32> = bits.into_iter().map(|bits| f32::from_bits(bits as u32)).collect();
    plan.inverse(&mut samples);
    Ok(samples)
}
