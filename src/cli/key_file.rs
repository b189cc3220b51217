//! Access key from which commands make tokens and links: read from a file or the environment, never from an argument.

use super::failure::Failure;
use super::input::describe;
use crate::jobs::unix_seconds;
use crate::trust::{Key, LONGEST, MaterialId};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Name of the environment variable that holds an access key.
pub(crate) const VARIABLE: &str = "WAVELUME_KEY";

/// Upper bound in bytes on the file of a key, which has 65 characters and white space around them.
const LONGEST_FILE: u64 = 4096;

/// Source of an access key. An argument would stand in the list of processes and in the history of the shell.
#[derive(Debug, clap::Args)]
pub(crate) struct KeyArgs {
    /// File that holds the key; `-` is stdin. Without a file, the environment variable `WAVELUME_KEY` holds the key
    #[arg(long, value_name = "FILE")]
    key_file: Option<PathBuf>,
}

/// Time for which a token or link is valid.
#[derive(Debug, clap::Args)]
pub(crate) struct TimeArgs {
    /// Time from now for which the token or link is valid, at most 7d; revoking or expiry of its key ends it earlier
    #[arg(long, value_name = "TIME", default_value = "24h", value_parser = seconds)]
    expires: u64,
}

impl KeyArgs {
    /// Reads the access key. Error messages never contain what was read.
    pub(crate) fn read(&self) -> Result<Key, Failure> {
        let Some(path) = &self.key_file else {
            let text = std::env::var(VARIABLE).map_err(|_| {
                Failure::usage(format!(
                    "no key: set the environment variable {VARIABLE}, or name a file with --key-file"
                ))
            })?;
            return text.trim().parse::<Key>().map_err(|error| Failure::failed(format!("{VARIABLE}: {error}")));
        };
        let text = file(path).map_err(|error| Failure::failed(describe(&error)).about(path))?;
        text.trim().parse::<Key>().map_err(|error| Failure::failed(error).about(path))
    }
}

impl TimeArgs {
    /// Returns the current time in Unix seconds, and the number of seconds for which the token or link is valid.
    pub(crate) fn since_now(&self) -> (u64, u64) {
        (unix_seconds(), self.expires)
    }
}

fn file(path: &Path) -> std::io::Result<String> {
    let mut text = String::new();
    if path == Path::new("-") {
        std::io::stdin().lock().take(LONGEST_FILE).read_to_string(&mut text)?;
    } else {
        std::fs::File::open(path)?.take(LONGEST_FILE).read_to_string(&mut text)?;
    }
    Ok(text)
}

/// Parses a duration such as `12h` or `7d`, and returns it in whole seconds.
fn seconds(text: &str) -> Result<u64, String> {
    let expected = "expected a time of at least 1s and at most 7d, such as 30min, 12h or 7d";
    let seconds = crate::jobs::Unit::Time.parse(text).map(|milliseconds| milliseconds / 1000);
    seconds.filter(|seconds| (1..=LONGEST).contains(seconds)).ok_or_else(|| expected.to_owned())
}

/// Reads the id of a material.
pub(crate) fn material(text: &str) -> Result<MaterialId, String> {
    MaterialId::read(text)
        .ok_or_else(|| "expected the id of a material: `b3-` and 64 lower-case hexadecimal digits".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_units_and_end_within_a_week() {
        for (text, expected) in
            [("90s", 90), ("30min", 1800), ("24h", 86_400), ("7d", 604_800), ("168h", 604_800), ("5", 5)]
        {
            assert_eq!(seconds(text), Ok(expected), "{text}");
        }
        for text in ["", "0s", "999ms", "8d", "169h", "-1h", "1w", "99999999999999999999d"] {
            assert!(seconds(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_key_is_read_from_a_file_and_never_shown() {
        let key = Key::generate().unwrap();
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("key");
        let read = |text: &[u8]| {
            std::fs::write(&path, text).unwrap();
            KeyArgs { key_file: Some(path.clone()) }.read()
        };
        let text = key.reveal();
        assert_eq!(read(format!("{text}\n").as_bytes()).unwrap().id(), key.id());
        assert_eq!(read(format!("\t{text}\r\n").as_bytes()).unwrap().id(), key.id());
        for wrong in [b"".as_slice(), &text.as_bytes()[..64], b"\xff", "x".repeat(1 << 20).as_bytes()] {
            let message = read(wrong).unwrap_err().to_string();
            assert!(message.starts_with(path.to_str().unwrap()) && !message.contains(&text[15..40]), "{message}");
        }
        std::fs::remove_file(&path).unwrap();
        let message = KeyArgs { key_file: Some(path.clone()) }.read().unwrap_err().to_string();
        assert!(message.starts_with(path.to_str().unwrap()), "{message}");
    }
}
