//! Input files: the measurement, its spectrum and its manifest, read within a limit, and the user's reading options.

use super::failure::Failure;
use crate::domain::Unit;
use crate::formats::{Interpretation, Normalization, StatedQuantity};
use crate::pipeline::Input;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use wavelume_formats::{MAX_FILE_BYTES, MAX_MANIFEST_BYTES, manifest_beside};

/// A measurement file and the user's reading options.
#[derive(Debug, clap::Args)]
pub(crate) struct MeasurementArgs {
    /// The file: any format that `wavelume formats` lists; its content decides, not its name
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// Spectrum to join with a luminaire
    #[arg(long, value_name = "SPD")]
    spectrum: Option<PathBuf>,
    /// Quantity, if the file does not state it: spectrum, reflectance, edf, brdf, btdf, bsdf, phase, or
    /// reflectance-factor (BRF, HCRF: divided by pi, which makes it a BRDF in 1/sr)
    #[arg(long)]
    quantity: Option<StatedQuantity>,
    /// Unit of a value, e.g. 1/sr, cd, mW/sr
    #[arg(long)]
    unit: Option<Unit>,
    /// Unit of the wavelengths of a spectral table: nm, um, angstrom or 1/cm
    #[arg(long, value_name = "UNIT")]
    wavelength_unit: Option<String>,
    /// Column of a spectral table, by name or by number from 1
    #[arg(long)]
    column: Option<String>,
    /// Integral of the values of a phase table over the sphere: 1, 4pi, vsf (a volume scattering function) or relative
    #[arg(long, value_name = "1|4pi|vsf|relative")]
    normalization: Option<Normalization>,
    /// File of a zip archive, by name; `inspect` lists them
    #[arg(long, value_name = "NAME")]
    member: Option<String>,
    /// Manifest of an array's axes [default: NAME.axes.json beside NAME.npy]
    #[arg(long, value_name = "MANIFEST")]
    axes: Option<PathBuf>,
}

/// The bytes of a measurement, in memory.
pub(crate) struct Loaded {
    bytes: Vec<u8>,
    spectrum: Option<Vec<u8>>,
    interpretation: Interpretation,
}

impl MeasurementArgs {
    /// Reads the named files. `wavelengths` are those of an array whose manifest states only `"lambda"`.
    pub(crate) fn load(&self, wavelengths: Option<String>) -> Result<Loaded, Failure> {
        let bytes = read_file(&self.input)?;
        let spectrum = self.spectrum.as_deref().map(read_file).transpose()?;
        Ok(Loaded { bytes, spectrum, interpretation: self.interpretation(wavelengths)? })
    }

    /// Returns true if no file of an archive is selected, so that all are meant.
    pub(crate) fn names_no_member(&self) -> bool {
        self.member.is_none()
    }

    fn interpretation(&self, wavelengths: Option<String>) -> Result<Interpretation, Failure> {
        let manifest = match &self.axes {
            Some(path) => Some(path.clone()),
            None => manifest_beside(&self.input).filter(|path| path.exists()),
        };
        Ok(Interpretation {
            quantity: self.quantity,
            unit: self.unit,
            wavelength_unit: self.wavelength_unit.clone(),
            column: self.column.clone(),
            normalization: self.normalization,
            member: self.member.clone(),
            axes: manifest.as_deref().map(read_manifest).transpose()?,
            wavelengths,
        })
    }
}

impl Loaded {
    /// The file's bytes.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Returns the user's reading options.
    pub(crate) fn interpretation(&self) -> &Interpretation {
        &self.interpretation
    }

    /// Returns the input of the pipeline.
    pub(crate) fn input(&self) -> Input<'_> {
        Input { bytes: &self.bytes, spectrum: self.spectrum.as_deref(), interpretation: &self.interpretation }
    }
}

/// Reads a whole file within the limit.
pub(crate) fn read_file(path: &Path) -> Result<Vec<u8>, Failure> {
    read_within(path, MAX_FILE_BYTES)
}

fn read_manifest(path: &Path) -> Result<serde_json::Value, Failure> {
    let bytes = read_within(path, MAX_MANIFEST_BYTES)?;
    serde_json::from_slice(&bytes).map_err(|error| Failure::failed(format!("manifest: {error}")).about(path))
}

fn read_within(path: &Path, limit: u64) -> Result<Vec<u8>, Failure> {
    wavelume_formats::read_within(path, limit).map_err(|error| Failure::Failed(describe(&error)).about(path))
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
