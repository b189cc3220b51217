//! Conversation with the process of a job: length-prefixed JSON over its standard input and output.

use super::problem::JobProblem;
use crate::pipeline::Report;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::{self, Read, Write};

/// Upper bound in bytes on one message between a worker and the process of a job. Raising it admits longer reports, and
/// lets a faulty process take more memory of the worker.
const LIMIT: usize = 16 << 20;

/// First message to the process of a job: the computation that the process does, and the files that it reads and
/// writes.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Order<C> {
    /// Name of the computation, by which the process of a job chooses its code.
    pub(super) name: String,
    /// The computation, with its arguments.
    pub(super) computation: C,
    /// Names of the files that the process of the job reads, in its current directory.
    pub(super) files: Vec<String>,
    /// Name of the file that the process of the job creates for the result, in its current directory.
    pub(super) result: String,
    /// Number of threads that compute.
    pub(super) threads: usize,
    /// Upper bound in bytes on the memory of the process.
    pub(super) memory: Option<u64>,
}

/// Message from the process of a job. Every message except `Progress` is the last one.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Message {
    /// Fraction (0..=1) of the computation that is done.
    Progress(f64),
    /// The result was written to its file; a compression also has this report.
    Made(Option<Box<Report>>),
    /// The computation failed for good.
    Failed(JobProblem),
    /// The computation failed for a transient reason.
    Passing(String),
    /// The disk of the result has no space.
    NoSpace(String),
    /// Only a newer version understands the computation.
    Newer(String),
    /// The computation needs more memory than its limit.
    OutOfMemory,
}

/// Encodes a message between a worker and the process of a job: its length, then the message as JSON.
pub(super) fn encode(message: &impl Serialize) -> io::Result<Vec<u8>> {
    let mut bytes = vec![0; 4];
    serde_json::to_writer(&mut bytes, message)?;
    let length = bytes.len() - 4;
    if length > LIMIT {
        return Err(too_long(length));
    }
    bytes[..4].copy_from_slice(&(length as u32).to_le_bytes());
    Ok(bytes)
}

fn too_long(length: usize) -> io::Error {
    let message = format!("found a message of {length} bytes between the processes of a job, expected at most {LIMIT}");
    io::Error::new(io::ErrorKind::InvalidData, message)
}

/// Writes a message for the other process, worker or job. Blocks the thread.
pub(super) fn write(to: &mut impl Write, message: &impl Serialize) -> io::Result<()> {
    to.write_all(&encode(message)?)?;
    to.flush()
}

/// Reads a message of the other process, worker or job. Blocks the thread. Fails with [`io::ErrorKind::UnexpectedEof`]
/// if that process has ended.
pub(super) fn read<T: DeserializeOwned>(from: &mut impl Read) -> io::Result<T> {
    let mut prefix = [0; 4];
    from.read_exact(&mut prefix)?;
    let length = u32::from_le_bytes(prefix) as usize;
    if length > LIMIT {
        return Err(too_long(length));
    }
    let mut bytes = vec![0; length];
    from.read_exact(&mut bytes)?;
    // serde_json takes a text that ends too early for the end of the stream.
    serde_json::from_slice(&bytes).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_arrive_whole_and_within_the_limit() {
        let mut bytes = Vec::new();
        write(&mut bytes, &Message::Progress(0.1)).unwrap();
        write(&mut bytes, &Message::Newer("x".repeat(70_000))).unwrap();
        let mut from = bytes.as_slice();
        assert!(matches!(read(&mut from).unwrap(), Message::Progress(0.1)));
        assert!(matches!(read(&mut from).unwrap(), Message::Newer(text) if text.len() == 70_000));
        for (faulty, kind) in [
            (&[][..], io::ErrorKind::UnexpectedEof),
            (&[9, 0, 0, 0, b'{'], io::ErrorKind::UnexpectedEof),
            (&[0xff; 8], io::ErrorKind::InvalidData),
            (&[1, 0, 0, 0, b'{'], io::ErrorKind::InvalidData),
        ] {
            assert_eq!(read::<Message>(&mut &*faulty).unwrap_err().kind(), kind, "{faulty:?}");
        }
        assert!(write(&mut Vec::new(), &Message::Newer("x".repeat(LIMIT))).is_err());
    }
}
