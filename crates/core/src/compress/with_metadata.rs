//! Replaces the metadata chunk of a material, for provenance that is known only after the file was measured.

use super::decode::open;
use super::metadata::{metadata_of, metadata_with_labels};
use super::metadata_chunk::{MAX_METADATA, metadata_chunk};
use crate::codec::{CodecError, write_chunk};

/// Returns the file `bytes` of a material with its metadata replaced by `metadata`, a JSON object; labels of index axes
/// stay. Samples and payload digest do not change.
pub fn with_metadata(bytes: &[u8], metadata: &str) -> Result<Vec<u8>, CodecError> {
    let (header, container) = open(bytes)?;
    let (_, axes) = metadata_of(&header, &container)?;
    let end = container.payload_end().min(bytes.len());
    let malformed = |reason: &str| CodecError::Malformed { at: end, reason: reason.to_owned() };
    let text = metadata_with_labels(&axes, Some(metadata)).ok_or_else(|| malformed("metadata is no JSON object"))?;
    if text.len() > MAX_METADATA {
        return Err(malformed(&format!("{} bytes of metadata, expected at most {MAX_METADATA}", text.len())));
    }
    let mut whole = bytes[..end].to_vec();
    let (kind, payload) = metadata_chunk(&header.axes, &text);
    whole.extend(write_chunk(kind, &payload));
    Ok(whole)
}

#[cfg(test)]
mod tests {
    use super::super::tests::settings;
    use super::super::{Policy, Settings, Target, compress, inspect, payload_digest};
    use super::*;
    use crate::domain::{Axis, Measurement, Quantity, Sampling, Silent, Tensor, Unit};

    #[test]
    fn another_text_leaves_samples_and_labels() {
        let axes = vec![Axis::Index { count: 2, labels: vec!["a".to_owned(), "b".to_owned()] }];
        let tensor = Tensor::new(axes.clone(), vec![1.0, 2.0]).unwrap();
        let measurement = Measurement::new(Quantity::Spectrum, Unit::One, Sampling::Point, tensor).unwrap();
        let settings =
            Settings { metadata: Some("{\"a\":1}".to_owned()), ..settings(Target::Lossless, Policy::Lossless) };
        let file = compress(&measurement, &settings, &Silent).unwrap().bytes;
        let other = with_metadata(&file, "{\"b\":[2.5]}").unwrap();
        assert_eq!(payload_digest(&other), payload_digest(&file));
        let summary = inspect(&other).unwrap();
        assert!(summary.axes == axes && summary.metadata.unwrap().contains("\"b\":[2.5]"));
        assert_eq!(with_metadata(&other, "{\"a\":1}").unwrap(), file);
        assert!(matches!(with_metadata(&file, "[1]"), Err(CodecError::Malformed { .. })));
        assert!(with_metadata(&file[..9], "{}").is_err());
    }
}
