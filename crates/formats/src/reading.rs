//! Reading of measurements from files and bytes in any known format.

use crate::formats::Interpretation;
use crate::pipeline::{self, Input, PipelineError, Source};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Upper bound on the size of a file that contains a measurement, in bytes; larger files are refused.
pub const MAX_FILE_BYTES: u64 = 2 << 30;
/// Upper bound on the size of a manifest (the JSON file that describes the axes of an array), in bytes.
pub const MAX_MANIFEST_BYTES: u64 = 16 << 20;

/// Reason why a file cannot be read as a measurement.
///
/// ```
/// use wavelume_formats::ReadError;
/// match wavelume_formats::read("no-such-file.csv") {
///     Err(ReadError::File { path, error }) => println!("{}: {error}", path.display()),
///     other => panic!("there is no such file: {:?}", other.map(|source| source.content_digest)),
/// }
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file cannot be read.
    #[error("{}: the file cannot be read: {error}", path.display())]
    File {
        /// Path of the measurement file or manifest that cannot be read.
        path: PathBuf,
        /// Error that the operating system returned on reading the file.
        error: io::Error,
    },
    /// The manifest beside an array is not valid JSON.
    #[error("{}: the manifest is not valid JSON: {error}", path.display())]
    Manifest {
        /// Path of the manifest, a JSON file `NAME.axes.json` that states how the array `NAME.npy` beside it is
        /// interpreted.
        path: PathBuf,
        /// Error message of the JSON parser, with the line and column in the manifest.
        error: String,
    },
    /// The file contains no measurement in a known format.
    #[error("{}: no measurement can be read: {error}", path.display())]
    Measurement {
        /// Path of the file that contains no measurement.
        path: PathBuf,
        /// Reason why the file was rejected, with the content that was found and its position if known.
        error: PipelineError,
    },
}

/// Reads a measurement in any known format ([`crate::formats`]) without further options. An array `NAME.npy` is
/// interpreted by the manifest `NAME.axes.json` beside it.
///
/// Use [`crate::pipeline::read`] to supply what the file does not state: a quantity, a unit, a spectrum to attach.
///
/// ```
/// # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/illuminant_D65.csv");
/// let source = wavelume_formats::read(path)?;
/// assert_eq!(source.acquisition.quantity.name(), "spectrum");
/// # Ok::<(), wavelume_formats::ReadError>(())
/// ```
pub fn read(path: impl AsRef<Path>) -> Result<Source, ReadError> {
    let path = path.as_ref();
    let bytes_of =
        |path: &Path, limit| read_within(path, limit).map_err(|error| ReadError::File { path: path.to_owned(), error });
    let bytes = bytes_of(path, MAX_FILE_BYTES)?;
    let manifest = manifest_beside(path).filter(|manifest| manifest.exists());
    let axes = manifest.map(|manifest| {
        let text = bytes_of(&manifest, MAX_MANIFEST_BYTES)?;
        serde_json::from_slice(&text).map_err(|error| ReadError::Manifest { path: manifest, error: error.to_string() })
    });
    let interpretation = Interpretation { axes: axes.transpose()?, ..Interpretation::default() };
    let read = pipeline::read(&Input { bytes: &bytes, spectrum: None, interpretation: &interpretation });
    read.map_err(|error| ReadError::Measurement { path: path.to_owned(), error })
}

/// Returns the path of the manifest that describes an array file: `NAME.axes.json` beside `NAME.npy`; `None` for other
/// files.
pub fn manifest_beside(array: &Path) -> Option<PathBuf> {
    let is_array = array.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npy"));
    is_array.then(|| array.with_extension("axes.json"))
}

/// Returns the content of a whole file or pipe; the size of a pipe is unknown beforehand. More than `limit` bytes are
/// an error.
pub fn read_within(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let metadata = file.metadata()?;
    if metadata.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "is a directory, expected a file"));
    }
    if metadata.len() > limit {
        return Err(too_large(&metadata.len().to_string(), limit));
    }
    // The size is only a hint: a pipe has none, and a file may grow while it is read.
    read_sized(file, metadata.len(), limit)
}

/// Returns everything that a stream has up to its end, such as standard input. More than `limit` bytes are an error.
pub fn read_stream_within(stream: impl Read, limit: u64) -> io::Result<Vec<u8>> {
    read_sized(stream, 0, limit)
}

fn read_sized(stream: impl Read, size: u64, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(size as usize);
    stream.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit { Err(too_large("its", limit)) } else { Ok(bytes) }
}

fn too_large(found: &str, limit: u64) -> io::Error {
    io::Error::new(io::ErrorKind::FileTooLarge, format!("{found} bytes are more than the limit of {limit}"))
}

/// Reads a measurement from the bytes of a file in any known format, as [`read`] does from a path.
pub fn read_bytes(bytes: &[u8]) -> Result<Source, PipelineError> {
    pipeline::read(&Input { bytes, spectrum: None, interpretation: &Interpretation::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_arrays_have_a_manifest_beside_them() {
        assert_eq!(manifest_beside(Path::new("a/b.npy")), Some(PathBuf::from("a/b.axes.json")));
        assert_eq!(manifest_beside(Path::new("a/b.v2.npy")), Some(PathBuf::from("a/b.v2.axes.json")));
        assert_eq!(manifest_beside(Path::new("lamp.ies")), None);
    }

    #[test]
    fn streams_are_read_within_a_limit() {
        assert_eq!(read_stream_within(&b"abc"[..], 3).unwrap(), b"abc");
        let refused = read_stream_within(&b"abcd"[..], 3).unwrap_err().to_string();
        assert_eq!(refused, "its bytes are more than the limit of 3");
    }

    #[test]
    fn an_array_is_read_with_the_manifest_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let array = folder.path().join("a.npy");
        std::fs::write(&array, crate::formats::write_npy(&[3], &[0.25, 0.5, 0.75])).unwrap();
        assert!(matches!(read(&array), Err(ReadError::Measurement { .. })));
        let manifest = folder.path().join("a.axes.json");
        std::fs::write(
            &manifest,
            r#"{"quantity": "spectrum", "value_unit": "relative", "axes": ["lambda:400:100:3"]}"#,
        )
        .unwrap();
        let source = read(&array).unwrap();
        assert_eq!(source.acquisition.quantity.name(), "spectrum");
        std::fs::write(&manifest, "{").unwrap();
        assert!(matches!(read(&array), Err(ReadError::Manifest { path, .. }) if path == manifest));
        assert!(matches!(read(folder.path()), Err(ReadError::File { .. })));
    }
}
