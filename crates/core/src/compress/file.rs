//! Puts a material's file together, decodes it again, and writes the errors of what was decoded into its header.

use super::decode::{open, samples_behind};
use super::header::Header;
use super::light::Light;
use super::rd::levels;
use super::refusal;
use super::rows::lanes;
use super::{CompressError, Compressed, Effort, Ranked};
use crate::codec::{ChunkKind, Class, Encoder, code_classes, write_container, write_text};
use crate::domain::{Axis, ErrorReport, Measurement};

/// The chunks between header and metadata, and what the header says about them.
pub(crate) struct Parts {
    pub(crate) header: Header,
    pub(crate) chunks: Vec<(ChunkKind, Vec<u8>)>,
}

/// The classes chunk; `None` where every sample has the default class.
pub(crate) fn classes_chunk(axes: &[Axis], classes: &mut [Class]) -> Option<(ChunkKind, Vec<u8>)> {
    if classes.iter().all(|&class| class == Class::Positive) {
        return None;
    }
    let mut encoder = Encoder::default();
    code_classes(&mut encoder, lanes(axes), classes);
    Some((ChunkKind::Classes, encoder.finish()))
}

/// The file of `parts` with the errors its header holds now.
pub(crate) fn assemble(parts: &Parts, metadata: Option<&str>) -> Vec<u8> {
    let pyramid_length = parts.chunk(ChunkKind::Pyramid).map_or(0, <[u8]>::len);
    let header = Header { pyramid_length, ..parts.header.clone() };
    let mut chunks = vec![(ChunkKind::Header, header.write())];
    chunks.extend(parts.chunks.iter().cloned());
    if let Some(text) = metadata {
        chunks.push((ChunkKind::Metadata, write_text(text)));
    }
    write_container(&chunks)
}

/// Metadata with the labels of index axes, which have no other place: `"labels": {"0": [...]}`.
pub(crate) fn metadata_with_labels(axes: &[Axis], metadata: Option<&str>) -> Option<String> {
    let mut object: serde_json::Map<String, serde_json::Value> = serde_json::from_str(metadata?).ok()?;
    let labels: serde_json::Map<_, _> = axes
        .iter()
        .enumerate()
        .filter_map(|(i, axis)| match axis {
            Axis::Index { labels, .. } if !labels.is_empty() => Some((i.to_string(), labels.clone().into())),
            _ => None,
        })
        .collect();
    if !labels.is_empty() {
        object.insert("labels".to_owned(), labels.into());
    }
    Some(serde_json::Value::Object(object).to_string())
}

impl Parts {
    pub(crate) fn chunk(&self, kind: ChunkKind) -> Option<&[u8]> {
        self.chunks.iter().find(|(k, _)| *k == kind).map(|(_, payload)| payload.as_slice())
    }
}

/// Decodes `parts`, measures the errors, and writes the file that carries them. A file that no reader would take, because a
/// sample is beyond float32 or a number of the header is out of its range, is refused here.
pub(crate) fn finish(
    mut parts: Parts,
    measurement: &Measurement,
    metadata: Option<&str>,
) -> Result<Compressed, CompressError> {
    let decoded = levels::insert_and_decode(&mut parts, measurement)
        .and_then(|whole| samples_behind(&parts.header, |kind| parts.chunk(kind), whole))
        .map_err(|e| refusal::undecodable(&parts.header, &e.to_string()))?;
    if let Some(at) = decoded.iter().position(|sample| sample.is_infinite()) {
        return Err(refusal::beyond_float32(&parts.header, at, measurement.tensor.samples()[at]));
    }
    let floor = f64::from(parts.header.floor);
    parts.header.errors = ErrorReport::measure(measurement.tensor.samples(), &decoded, floor);
    let light = Light::of(measurement.quantity, measurement.tensor.axes());
    let light = light.map(|light| light.report(measurement.tensor.samples(), &decoded));
    drop(decoded);
    let metadata = metadata_with_labels(&parts.header.axes, metadata);
    let bytes = assemble(&parts, metadata.as_deref());
    open(&bytes).map_err(|e| refusal::undecodable(&parts.header, &e.to_string()))?;
    let mut summary = parts.header.summary(metadata);
    summary.axes = measurement.tensor.axes().to_vec();
    let ranking =
        vec![Ranked { basis: summary.basis.clone(), bytes: bytes.len() as u64, er_l2: Some(summary.errors.er_l2) }];
    Ok(Compressed { bytes, summary, light, colour: None, ranking, noise: None, effort: Effort::default() })
}
