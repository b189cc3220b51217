//! Job arguments in the queue: a bincode frame as hexadecimal text. Only this module knows bincode.

use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// Type of a job, and its arguments. Variants are only ever appended, so that new workers read old frames.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Frame {
    /// Compress a measurement.
    Compress {
        /// Request as JSON: its flexible parts (any JSON, refused unknown fields) do not survive a format that is not
        /// self-describing.
        request: String,
    },
    /// Make tables of the paper.
    Paper {
        /// Numbers of the tables, at least one.
        tables: Vec<u8>,
    },
}

/// A frame that this version cannot write or read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum FrameError {
    /// Well-formed bytes with content unknown to this version: a newer version wrote them.
    #[error("job arguments of a newer version: {0}")]
    Newer(String),
    /// Text that no version writes.
    #[error("job arguments: {0}")]
    Damaged(String),
}

/// Upper bound in bytes on a frame; a request is a small JSON object.
const LIMIT: usize = 1 << 20;

impl Frame {
    /// Encodes the frame as text for the queue.
    pub(crate) fn encode(&self) -> Result<String, FrameError> {
        let bytes =
            bincode::serde::encode_to_vec(self, config()).map_err(|error| FrameError::Damaged(error.to_string()))?;
        if bytes.len() > LIMIT {
            return Err(FrameError::Damaged(format!("{} bytes, the limit is {LIMIT}", bytes.len())));
        }
        let mut text = String::with_capacity(2 * bytes.len());
        for byte in bytes {
            // Writing to a string cannot fail.
            let _ = write!(text, "{byte:02x}");
        }
        Ok(text)
    }

    /// Decodes a text of the queue.
    pub(crate) fn decode(text: &str) -> Result<Self, FrameError> {
        if text.len() > 2 * LIMIT {
            return Err(FrameError::Damaged(format!("{} characters, the limit is {}", text.len(), 2 * LIMIT)));
        }
        let digit = |b: u8| char::from(b).to_digit(16).map(|digit| digit as u8);
        let bytes: Option<Vec<u8>> =
            text.as_bytes().chunks(2).map(|pair| Some(digit(pair[0])? << 4 | digit(*pair.get(1)?)?)).collect();
        let bytes = bytes.ok_or_else(|| FrameError::Damaged("not hexadecimal".to_owned()))?;
        let (frame, read) = bincode::serde::decode_from_slice(&bytes, config())
            .map_err(|error| FrameError::Newer(error.to_string()))?;
        if read == bytes.len() {
            Ok(frame)
        } else {
            Err(FrameError::Newer(format!("{} bytes too many", bytes.len() - read)))
        }
    }
}

fn config() -> impl bincode::config::Config {
    bincode::config::legacy().with_limit::<LIMIT>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_round_trip_and_keep_their_bytes() {
        let frame = Frame::Compress { request: "{}".to_owned() };
        let text = frame.encode().unwrap();
        assert_eq!(text, "000000000200000000000000".to_owned() + "7b7d");
        assert_eq!(Frame::decode(&text), Ok(frame));
        let frame = Frame::Paper { tables: vec![1, 7] };
        let text = frame.encode().unwrap();
        assert_eq!(text, "010000000200000000000000".to_owned() + "0107");
        assert_eq!(Frame::decode(&text), Ok(frame));
    }

    #[test]
    fn other_text_is_refused_without_allocating_its_sizes() {
        let lengthy = "00000000ffffffffffffff7f7b7d";
        for bad in ["", "0", "zz", "é0", "01000000", "02000000", lengthy, "0000000002000000000000007b7d00"] {
            assert!(Frame::decode(bad).is_err(), "{bad}");
        }
        assert!(Frame::Compress { request: "x".repeat(LIMIT) }.encode().is_err());
    }

    #[test]
    fn what_a_newer_version_may_have_written_is_told_from_damage() {
        for newer in ["02000000", "0000000002000000000000007b7d00"] {
            assert!(matches!(Frame::decode(newer), Err(FrameError::Newer(_))), "{newer}");
        }
        for damaged in ["zz", "0"] {
            assert!(matches!(Frame::decode(damaged), Err(FrameError::Damaged(_))), "{damaged}");
        }
    }
}
