//! Opening compressed materials from files and from bytes.

use crate::compress;
use crate::evaluate::{EvaluateError, Material};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Reasons why a file cannot be opened as a compressed material.
///
/// ```
/// use wavelume_core::OpenError;
/// match wavelume_core::open("no-such-file.wlm") {
///     Err(OpenError::Read { path, error }) => println!("{}: {error}", path.display()),
///     Err(OpenError::Material { error, .. }) => panic!("a file that is damaged, or of another kind: {error}"),
///     _ => panic!("there is no such file"),
/// }
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// The file of a material cannot be read.
    #[error("cannot read {}: {error}", path.display())]
    Read {
        /// Path of the file that cannot be read.
        path: PathBuf,
        /// Error that the operating system reported.
        error: io::Error,
    },
    /// The file does not contain a valid compressed material.
    #[error("cannot open {} as a material: {error}", path.display())]
    Material {
        /// Path of the file that is not a valid compressed material.
        path: PathBuf,
        /// Reason why the content of the file is not a valid material.
        error: EvaluateError,
    },
}

/// Opens a compressed material from a file (`.wlm`).
///
/// The first bytes are checked before the rest is read, so that a large file of another kind is rejected quickly.
///
/// ```
/// # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/materials/plastic.wlm");
/// let material = wavelume_core::open(path)?;
/// assert_eq!(material.quantity().name(), "brdf");
/// # Ok::<(), wavelume_core::OpenError>(())
/// ```
pub fn open(path: impl AsRef<Path>) -> Result<Material, OpenError> {
    let path = path.as_ref();
    let bytes = read(path).map_err(|error| OpenError::Read { path: path.to_owned(), error })?;
    open_bytes(&bytes).map_err(|error| OpenError::Material { path: path.to_owned(), error })
}

/// Opens a compressed material from bytes, such as the contents of a file or a memory map.
///
/// ```
/// # let bytes = include_bytes!("../examples/materials/hazy.wlm");
/// let material = wavelume_core::open_bytes(bytes)?;
/// assert_eq!(material.quantity().name(), "phase");
/// # Ok::<(), wavelume_core::evaluate::EvaluateError>(())
/// ```
pub fn open_bytes(bytes: &[u8]) -> Result<Material, EvaluateError> {
    Material::open(bytes)
}

/// Reads a whole file, or only its first bytes if they are not those of a compressed material.
fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut file = File::open(path)?;
    let mut bytes = Vec::new();
    file.by_ref().take(HEAD).read_to_end(&mut bytes)?;
    if compress::is_material(&bytes) {
        file.read_to_end(&mut bytes)?;
    }
    Ok(bytes)
}

/// Number of bytes at the start of a file that are read to recognise a compressed material.
const HEAD: u64 = 64;
