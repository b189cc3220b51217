//! Job arguments in the queue: a bincode frame as hexadecimal text. Only this module knows bincode.

use crate::catalog::Priority;
use crate::store::Digest;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Write;

/// Job to be queued: its arguments as text, its priority, and the measurement that it reads.
pub(crate) trait Queued {
    /// Returns the measurement that the job reads, if any.
    fn measurement(&self) -> Option<Digest>;

    /// Returns the lowest version of the arguments that a worker must understand.
    fn level(&self) -> i64;

    /// Returns the priority of the job.
    fn priority(&self) -> Priority;

    /// Returns the arguments of the job as the text that the job queue stores. The error describes the fault in the
    /// request.
    fn frame(&self) -> Result<String, String>;
}

/// Reason why this version cannot encode or decode the arguments of a job.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum FrameError {
    /// The bytes are well-formed, but hold content that this version does not know: a newer version wrote them.
    #[error("the arguments of a queued job cannot be decoded, because a newer version of the program wrote them: {0}")]
    Newer(String),
    /// The text of a job in the queue is damaged: no version of the program writes such text. Or the arguments of a job
    /// are too large to be queued.
    #[error("the arguments of a job cannot be encoded or decoded: {0}")]
    Damaged(String),
}

/// Upper bound in bytes on the encoded arguments of a job. Raising it admits larger requests.
const LIMIT: usize = 1 << 20;

/// Encodes the arguments of a job as text for the job queue.
pub(super) fn encode<T: Serialize>(frame: &T) -> Result<String, FrameError> {
    let bytes =
        bincode::serde::encode_to_vec(frame, config()).map_err(|error| FrameError::Damaged(error.to_string()))?;
    if bytes.len() > LIMIT {
        return Err(FrameError::Damaged(format!(
            "found {} bytes of encoded arguments, expected at most {LIMIT}",
            bytes.len()
        )));
    }
    let mut text = String::with_capacity(2 * bytes.len());
    for byte in bytes {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    Ok(text)
}

/// Decodes the arguments of a job from their text in the job queue.
pub(super) fn decode<T: DeserializeOwned>(text: &str) -> Result<T, FrameError> {
    if text.len() > 2 * LIMIT {
        return Err(FrameError::Damaged(format!(
            "found a text of {} characters, expected at most {}",
            text.len(),
            2 * LIMIT
        )));
    }
    let digit = |b: u8| char::from(b).to_digit(16).map(|digit| digit as u8);
    let bytes: Option<Vec<u8>> =
        text.as_bytes().chunks(2).map(|pair| Some(digit(pair[0])? << 4 | digit(*pair.get(1)?)?)).collect();
    let bytes = bytes.ok_or_else(|| FrameError::Damaged("not hexadecimal".to_owned()))?;
    let (frame, read) =
        bincode::serde::decode_from_slice(&bytes, config()).map_err(|error| FrameError::Newer(error.to_string()))?;
    if read == bytes.len() {
        Ok(frame)
    } else {
        Err(FrameError::Newer(format!("{} bytes too many", bytes.len() - read)))
    }
}

fn config() -> impl bincode::config::Config {
    bincode::config::legacy().with_limit::<LIMIT>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    /// Arguments of a job as the first version of the program queued them.
    #[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
    enum Frame {
        /// Compress a measurement.
        Compress {
            /// Request to compress, as JSON text. The binary format of the job queue can neither hold its fields of
            /// arbitrary JSON nor detect unknown fields.
            request: String,
        },
        /// Recompute tables that Claustres et al. (2006) published.
        Paper {
            /// Table numbers in the paper by Claustres et al. (2006), at least one.
            tables: Vec<u8>,
        },
    }

    #[test]
    fn frames_round_trip_and_keep_their_bytes() {
        let frame = Frame::Compress { request: "{}".to_owned() };
        let text = encode(&frame).unwrap();
        assert_eq!(text, "000000000200000000000000".to_owned() + "7b7d");
        assert_eq!(decode::<Frame>(&text), Ok(frame));
        let frame = Frame::Paper { tables: vec![1, 7] };
        let text = encode(&frame).unwrap();
        assert_eq!(text, "010000000200000000000000".to_owned() + "0107");
        assert_eq!(decode::<Frame>(&text), Ok(frame));
    }

    #[test]
    fn other_text_is_refused_without_allocating_its_sizes() {
        let lengthy = "00000000ffffffffffffff7f7b7d";
        for bad in ["", "0", "zz", "é0", "01000000", "02000000", lengthy, "0000000002000000000000007b7d00"] {
            assert!(decode::<Frame>(bad).is_err(), "{bad}");
        }
        assert!(encode(&Frame::Compress { request: "x".repeat(LIMIT) }).is_err());
    }

    #[test]
    fn what_a_newer_version_may_have_written_is_told_from_damage() {
        for newer in ["02000000", "0000000002000000000000007b7d00"] {
            assert!(matches!(decode::<Frame>(newer), Err(FrameError::Newer(_))), "{newer}");
        }
        for damaged in ["zz", "0"] {
            assert!(matches!(decode::<Frame>(damaged), Err(FrameError::Damaged(_))), "{damaged}");
        }
    }
}
