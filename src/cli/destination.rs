//! Destinations of the materials that one call of `compress` makes from its input files.

use super::failure::Failure;
use super::input::is_stdin;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Extension of materials.
const EXTENSION: &str = "wlm";

/// Returns the file to write for each input file: `output` for one input, else `NAME.wlm` in the directory `output`, or
/// beside the input without `output`. Refuses two inputs with one destination.
pub(crate) fn destinations(inputs: &[PathBuf], output: Option<&Path>) -> Result<Vec<PathBuf>, Failure> {
    let directory = output.filter(|path| is_directory(path));
    let all = match (output, directory, inputs) {
        (Some(file), None, [_]) => vec![file.to_owned()],
        (Some(file), None, _) => {
            let message = format!("{} input files need a directory as --output: -o {}/", inputs.len(), file.display());
            return Err(Failure::usage(message));
        }
        (_, directory, _) => inputs.iter().map(|input| named_after(input, directory)).collect::<Result<_, _>>()?,
    };
    let mut of: HashMap<&Path, &Path> = HashMap::new();
    for (input, path) in inputs.iter().zip(&all) {
        if let Some(other) = of.insert(path, input) {
            let (other, input, path) = (other.display(), input.display(), path.display());
            let message = format!("{other} and {input} would both become {path}: compress one of them with -o OUT");
            return Err(Failure::usage(message));
        }
    }
    Ok(all)
}

/// Makes the directory that `output` names by a `/` at its end.
pub(crate) fn make_directory(output: Option<&Path>) -> Result<(), Failure> {
    let Some(directory) = output.filter(|path| is_directory(path)) else { return Ok(()) };
    let refused = |error: std::io::Error| Failure::failed(super::input::describe(&error)).about(directory);
    std::fs::create_dir_all(directory).map_err(refused)
}

fn is_directory(path: &Path) -> bool {
    path.is_dir() || path.to_string_lossy().ends_with('/')
}

/// Returns the path of the material that is named after a measurement file, in a directory or else beside the file.
fn named_after(input: &Path, directory: Option<&Path>) -> Result<PathBuf, Failure> {
    let Some(name) = input.file_name().filter(|_| !is_stdin(input)) else {
        return Err(Failure::usage(format!("{} gives the material no name: name it with -o OUT", input.display())));
    };
    let path = directory.map_or_else(|| input.to_owned(), |directory| directory.join(name));
    Ok(path.with_extension(EXTENSION))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(inputs: &[&str], output: Option<&str>) -> Result<Vec<String>, String> {
        let inputs: Vec<PathBuf> = inputs.iter().map(PathBuf::from).collect();
        let found = destinations(&inputs, output.map(Path::new)).map_err(|failure| failure.to_string())?;
        Ok(found.iter().map(|path| path.display().to_string()).collect())
    }

    #[test]
    fn materials_are_named_after_their_files() {
        assert_eq!(of(&["a.ies"], Some("x.wlm")).unwrap(), ["x.wlm"]);
        assert_eq!(of(&["lab/a.ies", "b.v2.ldt"], None).unwrap(), ["lab/a.wlm", "b.v2.wlm"]);
        let dir = tempfile::tempdir().unwrap();
        let inside = |name: &str| dir.path().join(name).display().to_string();
        let there = dir.path().display().to_string();
        assert_eq!(of(&["lab/a.ies", "b.ldt"], Some(&there)).unwrap(), [inside("a.wlm"), inside("b.wlm")]);
        let new = format!("{}/", inside("new"));
        assert_eq!(of(&["a.ies"], Some(&new)).unwrap(), [inside("new/a.wlm")]);
        assert!(!dir.path().join("new").exists());
        make_directory(Some(Path::new(&new))).unwrap();
        assert!(dir.path().join("new").is_dir());
    }

    #[test]
    fn materials_without_a_place_of_their_own_are_refused() {
        let several = of(&["a.ies", "b.ldt"], Some("x.wlm")).unwrap_err();
        assert_eq!(several, "2 input files need a directory as --output: -o x.wlm/");
        let same = of(&["a.ies", "a.ldt"], None).unwrap_err();
        assert_eq!(same, "a.ies and a.ldt would both become a.wlm: compress one of them with -o OUT");
        assert_eq!(of(&["-"], None).unwrap_err(), "- gives the material no name: name it with -o OUT");
    }
}
