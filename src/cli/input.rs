//! Input files: the measurement, its spectrum and its manifest, read within a limit, and the user's reading options.

use super::failure::Failure;
use super::reading::ReadingArgs;
use crate::formats::Interpretation;
use crate::pipeline::Input;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use wavelume_formats::{MAX_FILE_BYTES, MAX_MANIFEST_BYTES, manifest_beside};

/// Measurement file to read, and options for the facts that it does not state.
#[derive(Debug, clap::Args)]
pub(crate) struct MeasurementArgs {
    /// Input file in any format that `wavelume formats` lists; the content decides the format, not the name; - is
    /// stdin
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    #[command(flatten)]
    reading: ReadingArgs,
}

/// Bytes of a measurement file, bytes of a second file with the spectrum by which the measurement is multiplied, if
/// any, and the options for reading them.
pub(crate) struct Loaded {
    bytes: Vec<u8>,
    spectrum: Option<Vec<u8>>,
    interpretation: Interpretation,
}

impl MeasurementArgs {
    /// Reads the files that the command line names. `wavelengths` (`START:STOP:STEP` in nm) serve an array whose
    /// manifest names the wavelength axis `"lambda"` without values.
    pub(crate) fn load(&self, wavelengths: Option<String>) -> Result<Loaded, Failure> {
        Loaded::of(&self.input, &self.reading, wavelengths)
    }

    /// Returns true if the command line does not name a file to read from a zip archive.
    pub(crate) fn names_no_member(&self) -> bool {
        self.reading.stated().member.is_none()
    }
}

impl Loaded {
    /// Reads the measurement file `input` and the files that the reading options name; see [`MeasurementArgs::load`].
    pub(crate) fn of(input: &Path, reading: &ReadingArgs, wavelengths: Option<String>) -> Result<Self, Failure> {
        let bytes = read_file(input)?;
        let spectrum = reading.spectrum().map(read_file).transpose()?;
        let axes = match reading.axes() {
            Some(path) => Some(read_manifest(path)?),
            None => read_manifest_beside(input)?,
        };
        let interpretation = Interpretation { axes, wavelengths, ..reading.stated().clone() };
        Ok(Self { bytes, spectrum, interpretation })
    }

    /// Returns the bytes of the measurement file.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Returns the user's options for reading the measurement.
    pub(crate) fn interpretation(&self) -> &Interpretation {
        &self.interpretation
    }

    /// Returns the bytes of the measurement and of its separate spectrum file, if any, and the reading options, as the
    /// input of `pipeline::read`.
    pub(crate) fn input(&self) -> Input<'_> {
        Input { bytes: &self.bytes, spectrum: self.spectrum.as_deref(), interpretation: &self.interpretation }
    }
}

/// Reads a whole file. A file larger than [`MAX_FILE_BYTES`] is refused.
pub(crate) fn read_file(path: &Path) -> Result<Vec<u8>, Failure> {
    read_within(path, MAX_FILE_BYTES)
}

/// Reads the manifest beside an array; `None` for other files and for an array without one.
pub(crate) fn read_manifest_beside(array: &Path) -> Result<Option<serde_json::Value>, Failure> {
    manifest_beside(array).filter(|path| path.exists()).as_deref().map(read_manifest).transpose()
}

fn read_manifest(path: &Path) -> Result<serde_json::Value, Failure> {
    let bytes = read_within(path, MAX_MANIFEST_BYTES)?;
    serde_json::from_slice(&bytes)
        .map_err(|error| Failure::failed(format!("the manifest is not valid JSON: {error}")).about(path))
}

/// Path that stands for standard input.
const STDIN: &str = "-";

/// Returns true if a path stands for standard input.
pub(crate) fn is_stdin(path: &Path) -> bool {
    path.as_os_str() == STDIN
}

/// Reads a whole file, or standard input for the path `-`. More than `limit` bytes are refused.
pub(crate) fn read_within(path: &Path, limit: u64) -> Result<Vec<u8>, Failure> {
    let read = if is_stdin(path) {
        wavelume_formats::read_stream_within(std::io::stdin().lock(), limit)
    } else {
        wavelume_formats::read_within(path, limit)
    };
    read.map_err(|error| Failure::Failed(describe(&error)).about(path))
}

/// Describes an I/O error for a user.
pub(crate) fn describe(error: &std::io::Error) -> String {
    match error.kind() {
        ErrorKind::NotFound => "no such file or directory".to_owned(),
        ErrorKind::PermissionDenied => "permission denied".to_owned(),
        ErrorKind::IsADirectory => "is a directory, expected a file".to_owned(),
        ErrorKind::StorageFull => "no space left".to_owned(),
        _ => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_over_the_limit_are_refused_before_they_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("large");
        std::fs::write(&path, [0; 11]).unwrap();
        let refused = read_within(&path, 10).unwrap_err().to_string();
        assert!(refused.ends_with("large: 11 bytes are more than the limit of 10"), "{refused}");
        assert_eq!(read_within(&path, 11).unwrap().len(), 11);
    }

    #[test]
    fn missing_files_and_directories_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let missing = read_file(&dir.path().join("none.ies")).unwrap_err();
        assert!(missing.to_string().ends_with("none.ies: no such file or directory"));
        assert!(read_file(dir.path()).unwrap_err().to_string().ends_with("is a directory, expected a file"));
    }
}
