//! Metadata of a file: the text of its chunk, and the labels of index axes, which are stored only there.

use super::header::Header;
use super::metadata_chunk::{metadata_kind, read_metadata};
use crate::codec::{CodecError, Container};
use crate::domain::Axis;

/// Adds the labels of index axes to the metadata, the only place where a file stores them: `"labels": {"0": [...]}`.
pub(super) fn metadata_with_labels(axes: &[Axis], metadata: Option<&str>) -> Option<String> {
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

/// Returns the text of the metadata chunk, and the axes with the labels that the text holds.
pub(super) fn metadata_of(
    header: &Header,
    container: &Container<'_>,
) -> Result<(Option<String>, Vec<Axis>), CodecError> {
    let mut axes = header.axes.clone();
    let Some(chunk) = container.get(metadata_kind(&axes)) else { return Ok((None, axes)) };
    let malformed = |reason: &str| CodecError::Malformed { at: chunk.offset, reason: reason.to_owned() };
    let text = read_metadata(&chunk)?;
    let json: serde_json::Value = serde_json::from_str(&text).map_err(|_| malformed("metadata is no JSON"))?;
    for (i, axis) in axes.iter_mut().enumerate() {
        if let Axis::Index { count, labels } = axis {
            let stored = json["labels"][i.to_string()].as_array().filter(|stored| stored.len() == *count);
            *labels = stored.into_iter().flatten().map(|label| label.as_str().unwrap_or("").to_owned()).collect();
        }
    }
    Ok((Some(text), axes))
}
