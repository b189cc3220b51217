//! Options of reading on the command line, derived from their declarations.

use super::declared::{all_stated, argument, declared_args, path, refusal};
use crate::domain::{Declared, Values};
use crate::formats::Interpretation;
use clap::{ArgMatches, Command};
use std::path::{Path, PathBuf};

/// Options on the command line that say how to read a measurement file.
#[derive(Clone, Debug)]
pub(crate) struct ReadingArgs {
    /// Path of the file for each option that takes one, such as the spectrum, with the name of the option.
    files: Vec<(&'static str, PathBuf)>,
    stated: Interpretation,
}

impl ReadingArgs {
    /// Returns the path of the spectrum file that the command line names: a luminaire is multiplied by this spectrum.
    pub(super) fn spectrum(&self) -> Option<&Path> {
        self.file(Interpretation::SPECTRUM.name)
    }

    /// Returns the path of the manifest that the command line names, a file that describes the axes of an array.
    pub(super) fn axes(&self) -> Option<&Path> {
        self.file("axes")
    }

    /// Returns the options for reading a measurement whose values stand on the command line itself, not in a file.
    pub(super) fn stated(&self) -> &Interpretation {
        &self.stated
    }

    fn file(&self, option: &str) -> Option<&Path> {
        self.files.iter().find(|(name, _)| *name == option).map(|(_, path)| path.as_path())
    }
}

declared_args!(ReadingArgs);

impl ReadingArgs {
    fn arguments(command: Command) -> Command {
        command.args(Interpretation::OPTIONS.iter().map(argument))
    }

    fn read(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let has_file = |declared: &&Declared| matches!(declared.values, Values::File { .. } | Values::Document { .. });
        let files = Interpretation::OPTIONS.iter().filter(has_file);
        let files = files.filter_map(|declared| Some((declared.name, path(matches, declared)?))).collect();
        let stated = all_stated(matches, Interpretation::OPTIONS);
        Ok(Self { files, stated: serde_json::from_value(stated.into()).map_err(refusal)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        reading: ReadingArgs,
    }

    fn reading(line: &[&str]) -> Result<ReadingArgs, clap::Error> {
        Line::try_parse_from([&["inspect"], line].concat()).map(|line| line.reading)
    }

    #[test]
    fn options_and_files_are_read() {
        let read = reading(&["--wavelength-unit", "um", "--axes", "a.json", "--normalization", "4pi"]).unwrap();
        assert_eq!((read.axes(), read.spectrum()), (Some(Path::new("a.json")), None));
        let stated: Vec<_> = read.stated().stated().iter().map(|(name, value)| format!("{name}={value}")).collect();
        assert_eq!(stated, ["wavelength_unit=um", "normalization=4pi"]);
        let refusal = reading(&["--quantity", "light"]).unwrap_err().to_string();
        assert!(refusal.contains("expected one of spectrum, reflectance, edf"), "{refusal}");
    }
}
