//! Guard of what a command writes: no file that it reads, and none whose name says another kind of file.

use super::failure::Failure;
use crate::formats::formats;
use crate::jobs::Identity;
use clap::ArgMatches;
use std::fs::{File, Metadata};
use std::io;
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use wavelume_formats::manifest_beside;

/// Id of the option `--output`; the value of any other option or argument that takes a path is read.
const OUTPUT: &str = "output";

/// Suffixes of pictures, of which PNG and SVG are written.
const PICTURES: [&str; 14] =
    ["png", "svg", "jpg", "jpeg", "gif", "bmp", "tif", "tiff", "webp", "avif", "exr", "hdr", "pdf", "eps"];

/// Suffixes of the files of this program that no reader of measurements takes.
const OURS: [&str; 2] = ["wlm", "f32"];

/// Returns the paths of all files that a command line names to be read, and those of manifests beside arrays among
/// them.
pub(super) fn inputs(matches: &ArgMatches) -> Vec<PathBuf> {
    let Some((_, matches)) = matches.subcommand() else { return Vec::new() };
    let names = matches.ids().map(clap::Id::as_str).filter(|id| *id != OUTPUT);
    let paths = names.filter_map(|id| matches.try_get_many::<PathBuf>(id).ok().flatten()).flatten();
    paths.flat_map(|path| [Some(path.clone()), manifest_beside(path)]).flatten().collect()
}

/// Files that a command writes.
#[derive(Debug)]
pub(super) struct Outputs {
    /// Kind of the file that `--output` names, such as `a material`.
    pub(super) kind: &'static str,
    /// Suffixes that fit the kind, the usual one first.
    pub(super) suffixes: Vec<&'static str>,
    /// Path of `--output`, and those of the files that are written beside it.
    pub(super) paths: Vec<PathBuf>,
}

impl Outputs {
    /// Returns the output of a command that writes a material.
    pub(super) fn material(path: &Path) -> Self {
        Self { kind: "a material", suffixes: vec!["wlm"], paths: vec![path.to_owned()] }
    }

    /// Returns the outputs of a command that writes an array, with a manifest and perhaps marks of filled cells beside.
    pub(super) fn array(path: &Path) -> Self {
        let paths = vec![path.to_owned(), manifest_of_array(path), marks_of_array(path)];
        Self { kind: "a NumPy array", suffixes: vec!["npy"], paths }
    }

    /// Refuses outputs that are also read, under whatever name, because they would be lost, and a name that says
    /// another kind of file. Devices and pipes are not lost.
    pub(super) fn check(&self, inputs: &[PathBuf]) -> Result<(), Failure> {
        let there = |path: &PathBuf| path.metadata().ok().filter(Metadata::is_file);
        for (output, found) in self.paths.iter().filter_map(|output| Some((output, there(output)?))) {
            let is_same = |input: &&PathBuf| metadata(input).is_ok_and(|it| Identity::of(&it) == Identity::of(&found));
            if let Some(input) = inputs.iter().find(is_same) {
                let what = if input == output {
                    "is input and output at once".to_owned()
                } else {
                    format!("would be written, and is the same file as the input {}", shown(input))
                };
                return Err(Failure::usage(format!("{what}: choose another --output")).about(output));
            }
        }
        self.check_suffix()
    }

    fn check_suffix(&self) -> Result<(), Failure> {
        let Some(path) = self.paths.first() else { return Ok(()) };
        let found = path.extension().map(|suffix| suffix.to_string_lossy().to_lowercase()).unwrap_or_default();
        let is_of_others = PICTURES.contains(&found.as_str())
            || OURS.contains(&found.as_str())
            || formats().iter().any(|format| format.extensions.contains(&found.as_str()));
        match self.suffixes.as_slice() {
            [usual, ..] if is_of_others && !self.suffixes.contains(&found.as_str()) => {
                let kind = self.kind;
                let message = format!("{kind} is written, but .{found} is another kind of file: name it .{usual}");
                Err(Failure::usage(message).about(path))
            }
            _ => Ok(()),
        }
    }
}

/// Returns the path of the manifest that is written beside an array.
pub(super) fn manifest_of_array(array: &Path) -> PathBuf {
    array.with_extension("axes.json")
}

/// Returns the path of the marks of filled cells that are written beside an array.
pub(super) fn marks_of_array(array: &Path) -> PathBuf {
    array.with_extension("filled.npy")
}

/// Returns the metadata of an input file; `-` is standard input.
fn metadata(path: &Path) -> io::Result<Metadata> {
    if path == Path::new("-") {
        return File::from(io::stdin().as_fd().try_clone_to_owned()?).metadata();
    }
    path.metadata()
}

fn shown(path: &Path) -> String {
    if path == Path::new("-") { "on stdin".to_owned() } else { path.display().to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_compared_by_what_they_are() {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        std::fs::write(path("a.ldt"), "a").unwrap();
        std::fs::write(path("b.ldt"), "a").unwrap();
        std::fs::hard_link(path("a.ldt"), path("A.LDT")).unwrap();
        std::os::unix::fs::symlink("a.ldt", path("link")).unwrap();
        std::os::unix::fs::symlink("link", path("further")).unwrap();
        std::os::unix::fs::symlink("nowhere", path("dangling")).unwrap();
        let check = |input: &str, output: &str| {
            let outputs = Outputs { paths: vec![path("new"), path(output)], ..Outputs::material(Path::new("")) };
            outputs.check(&[path("b.ldt"), path(input)])
        };
        for (input, output) in [("a.ldt", "A.LDT"), ("a.ldt", "link"), ("link", "a.ldt"), ("link", "further")] {
            let refused = check(input, output).unwrap_err();
            assert_eq!(refused.exit_code(), 2);
            let message = refused.to_string();
            let named = [format!("{output}: "), format!("same file as the input {}", path(input).display())];
            assert!(named.iter().all(|part| message.contains(part)), "{message}");
        }
        let same = check("a.ldt", "./a.ldt").unwrap_err().to_string();
        assert!(same.ends_with("a.ldt: is input and output at once: choose another --output"), "{same}");
        for (input, output) in [("a.ldt", "new"), ("a.ldt", "dangling"), ("absent", "a.ldt"), ("a.ldt", "")] {
            assert_eq!(check(input, output), Ok(()), "{input} {output}");
        }
        let device = PathBuf::from("/dev/null");
        assert_eq!(Outputs::material(&device).check(&[device]), Ok(()));
    }

    #[test]
    fn exports_have_suffixes_of_formats_that_are_written() {
        for export in crate::export::ExportFormat::ALL {
            let mut written = formats().into_iter().filter(|format| format.writes);
            assert!(written.any(|format| format.extensions.contains(&export.extension())), "{export}");
        }
    }

    #[test]
    fn names_of_other_kinds_of_files_are_refused() {
        let check = |outputs: Outputs| outputs.check(&[]).map_err(|failure| failure.to_string());
        let refused = check(Outputs::array(Path::new("t.CSV"))).unwrap_err();
        assert_eq!(refused, "t.CSV: a NumPy array is written, but .csv is another kind of file: name it .npy");
        for known in formats().iter().flat_map(|format| format.extensions).chain(&PICTURES).chain(&["npy", "f32"]) {
            let refused = check(Outputs::material(&PathBuf::from(format!("a.{known}")))).unwrap_err();
            assert!(refused.ends_with("name it .wlm"), "{refused}");
        }
        for name in ["m.wlm", "m.WLM", "m", "m.", ".wlm", "lamp.v2", "m.ies.backup", "ies", "/dev/stdout"] {
            assert_eq!(check(Outputs::material(Path::new(name))), Ok(()), "{name}");
        }
    }
}
