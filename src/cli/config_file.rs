//! Configuration file: read within a limit, and checked key by key before any of it is used.

use super::failure::Failure;
use super::input::read_within;
use super::setting_keys::{Key, Kind, reads_file};
use clap::{Arg, Command};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

/// Upper bound in bytes on a configuration file. A file with every setting and its help text takes less than a tenth.
const LARGEST: u64 = 256 << 10;

/// Values of a configuration file, all of them valid.
#[derive(Debug)]
pub(super) struct ConfigFile {
    pub(super) path: PathBuf,
    entries: BTreeMap<String, Entry>,
}

/// Value of one key of the configuration file, as texts that the option of the command line takes.
#[derive(Debug)]
pub(super) struct Entry {
    texts: Vec<String>,
    /// Line of the configuration file that has the value, counted from 1.
    pub(super) line: usize,
}

/// Checker of a configuration file: the known keys, and the text of the file.
struct Reader<'a> {
    keys: &'a [Key],
    text: &'a str,
}

impl ConfigFile {
    /// Reads a configuration file. Every key must be one of `keys`, and every value one that its option takes.
    pub(super) fn read(path: &Path, keys: &[Key]) -> Result<Self, Failure> {
        let bytes = read_within(path, LARGEST)?;
        let text = std::str::from_utf8(&bytes).map_err(|error| {
            let line = lines(&bytes[..error.valid_up_to()]);
            Failure::usage(format!("line {line}: found bytes that are no UTF-8, expected a text file")).about(path)
        })?;
        let entries = Reader { keys, text }.read().map_err(|reason| Failure::Usage(reason).about(path))?;
        Ok(Self { path: path.to_owned(), entries })
    }

    /// Returns the entry of a configuration key, if the file has it.
    pub(super) fn entry(&self, key: &Key) -> Option<&Entry> {
        self.entries.get(&key.name)
    }

    /// Makes the values of the file the defaults of the options that they set, in all commands that read the file.
    pub(super) fn set_defaults(&self, program: Command, keys: &[Key]) -> Command {
        let is_root = program.get_arguments().any(Arg::is_global_set);
        let program = if is_root || reads_file(&program) {
            keys.iter().fold(program, |command, key| match self.entry(key) {
                Some(entry) if command.get_arguments().any(|option| option.get_id() == key.id()) => {
                    command.mut_arg(key.id(), |option| option.default_values(entry.texts.clone()))
                }
                _ => command,
            })
        } else {
            program
        };
        program.mut_subcommands(|command| self.set_defaults(command, keys))
    }
}

impl Reader<'_> {
    fn read(&self) -> Result<BTreeMap<String, Entry>, String> {
        let document = DeTable::parse(self.text).map_err(|error| {
            let place = error.span().map(|span| format!("{}: ", self.place(&span))).unwrap_or_default();
            format!("{place}{}", error.message())
        })?;
        let mut entries = BTreeMap::new();
        for (name, value) in document.get_ref() {
            let is_section = self.keys.iter().any(|key| key.section == name.get_ref().as_ref());
            match value.get_ref() {
                DeValue::Table(table) if is_section => {
                    for (key, value) in table {
                        self.enter(&mut entries, name.get_ref(), key, value)?;
                    }
                }
                // A name may be a key and a section, such as `connections`.
                _ if is_section && self.find("", name.get_ref()).is_none() => {
                    return Err(self.refuse(
                        &value.span(),
                        &found(value.get_ref()),
                        &format!("a section [{}]", name.get_ref()),
                    ));
                }
                _ => self.enter(&mut entries, "", name, value)?,
            }
        }
        Ok(entries)
    }

    fn find(&self, section: &str, name: &str) -> Option<&Key> {
        self.keys.iter().find(|key| key.section == section && key.name == name)
    }

    /// Checks one key of the configuration file and its value, and adds them to `entries`.
    fn enter(
        &self,
        entries: &mut BTreeMap<String, Entry>,
        section: &str,
        name: &Spanned<DeString<'_>>,
        value: &Spanned<DeValue<'_>>,
    ) -> Result<(), String> {
        let Some(key) = self.find(section, name.get_ref()) else {
            let is_table = value.get_ref().is_table();
            return Err(self.unknown(section, name, is_table));
        };
        let texts = self.texts(key, value)?;
        entries.insert(key.name.clone(), Entry { texts, line: self.line(&value.span()) });
        Ok(())
    }

    /// Converts a value of the configuration file to texts of the command line. Fails unless the option of the key
    /// accepts each text.
    fn texts(&self, key: &Key, value: &Spanned<DeValue<'_>>) -> Result<Vec<String>, String> {
        let wrong = || {
            self.refuse(&value.span(), &format!("{} for `{}`", found(value.get_ref()), key.full_name()), key.expected())
        };
        let text = match (key.kind(), value.get_ref()) {
            (Kind::Text | Kind::Amount, DeValue::String(text)) => text.to_string(),
            (Kind::Count | Kind::Amount, DeValue::Integer(number)) => {
                u64::from_str_radix(number.as_str(), number.radix())
                    .map_or_else(|_| number.as_str().to_owned(), |number| number.to_string())
            }
            (Kind::List, DeValue::Array(items)) => {
                let mut texts = Vec::new();
                for item in items {
                    let Some(text) = item.get_ref().as_str() else {
                        let found = format!("{} in `{}`", found(item.get_ref()), key.full_name());
                        return Err(self.refuse(&item.span(), &found, "texts in quotes"));
                    };
                    self.check(key, text, &item.span())?;
                    texts.push(text.to_owned());
                }
                return Ok(texts);
            }
            _ => return Err(wrong()),
        };
        self.check(key, &text, &value.span())?;
        Ok(vec![text])
    }

    fn check(&self, key: &Key, text: &str, span: &Range<usize>) -> Result<(), String> {
        key.check(text).map_err(|reason| format!("{}: `{}`: {reason}", self.place(span), key.full_name()))
    }

    /// Builds the error for a key or a section that does not exist, with the one that was probably meant.
    fn unknown(&self, section: &str, name: &Spanned<DeString<'_>>, is_table: bool) -> String {
        let found = name.get_ref().as_ref();
        let mut sections: Vec<&str> = self.keys.iter().map(|key| key.section.as_str()).collect();
        sections.dedup();
        let (what, known): (_, Vec<String>) = if section.is_empty() && is_table {
            let named = sections.iter().filter(|section| !section.is_empty());
            (format!("the section [{found}]"), named.map(|section| (*section).to_owned()).collect())
        } else {
            let within = self.keys.iter().filter(|key| key.section == section).map(|key| key.name.clone());
            (format!("the key `{found}`"), within.collect())
        };
        let what = if section.is_empty() { what } else { format!("{what} in [{section}]") };
        let elsewhere = self.keys.iter().find(|key| key.name == found.replace('-', "_"));
        let hint = match (elsewhere, nearest(found, &known)) {
            (Some(key), _) if key.section.is_empty() => {
                format!("; `{}` belongs before the first section", key.name)
            }
            (Some(key), _) => format!("; `{}` belongs in [{}]", key.name, key.section),
            (None, Some(near)) => format!("; did you mean `{near}`?"),
            (None, None) => String::new(),
        };
        self.refuse(&name.span(), &what, &format!("one of {}{hint}", known.join(", ")))
    }

    fn refuse(&self, span: &Range<usize>, found: &str, expected: &str) -> String {
        format!("{}: found {found}, expected {expected}", self.place(span))
    }

    fn line(&self, span: &Range<usize>) -> usize {
        lines(&self.text.as_bytes()[..span.start.min(self.text.len())])
    }

    /// Returns the line and the column of a part of the configuration file in words. A column counts characters from 1.
    fn place(&self, span: &Range<usize>) -> String {
        let before = self.text.get(..span.start).unwrap_or(self.text);
        let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
        format!("line {}, column {column}", self.line(span))
    }
}

/// Returns the number, counted from 1, of the line that follows the bytes `before` of a file.
fn lines(before: &[u8]) -> usize {
    before.split(|byte| *byte == b'\n').count()
}

/// Describes a value of a wrong type. Texts are left out, because they may hold a password.
fn found(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(_) => "a text".to_owned(),
        DeValue::Integer(number) => format!("the number {}", number.as_str()),
        DeValue::Float(number) => format!("the number {}", number.as_str()),
        DeValue::Boolean(value) => value.to_string(),
        DeValue::Datetime(_) => "a date or time".to_owned(),
        DeValue::Array(_) => "a list".to_owned(),
        DeValue::Table(_) => "a table".to_owned(),
    }
}

/// Returns the known name that is most like `name`, if one is like it.
fn nearest<'a>(name: &str, known: &'a [String]) -> Option<&'a String> {
    let far = |other: &&String| strsim::damerau_levenshtein(name, other);
    known.iter().min_by_key(far).filter(|other| far(other) <= (name.chars().count() / 3).max(1))
}

#[cfg(test)]
mod tests {
    use super::super::Cli;
    use super::super::setting_keys::keys;
    use super::*;
    use clap::CommandFactory;

    fn read(text: &str) -> Result<BTreeMap<String, Entry>, String> {
        Reader { keys: &keys(&Cli::command()), text }.read()
    }

    #[test]
    fn values_are_read_with_their_lines() {
        let entries = read(
            "database = 'postgres://w:secret@db/w'\n[server]\nlisten = \"[::]:80\"\nnames = [\n  \"a\",\n  \"b\" ]\n\
             [work]\nworkers = 0x3\nlease = \"45s\"\nbackoff = 5\n[connections]\nconnections = 1_000\n\
             uploads.upload_bytes = \"1GiB\"\n",
        );
        // The last line names a section within a section.
        let error = entries.unwrap_err();
        assert!(error.contains("line 13, column 1: found the key `uploads` in [connections]"), "{error}");
        let entries = read(
            "uploads.upload_bytes = 4096\n[server]\nnames = [ 'a', 'b' ]\n[work]\nworkers = 0x3\nlease = \"45s\"\n\
             [connections]\nconnections = 1_000\n",
        )
        .unwrap();
        let of = |name: &str| (entries[name].texts.join(","), entries[name].line);
        assert_eq!(of("names"), ("a,b".to_owned(), 3));
        assert_eq!(of("workers"), ("3".to_owned(), 5));
        assert_eq!(of("connections"), ("1000".to_owned(), 8));
        assert_eq!(of("upload_bytes"), ("4096".to_owned(), 1));
        assert!(read("").unwrap().is_empty());
    }

    #[test]
    fn each_fault_has_its_place_and_what_was_expected() {
        for (text, parts) in [
            ("[work]\nlesae = '1s'\n", &["line 2, column 1", "`lesae` in [work]", "did you mean `lease`?"][..]),
            ("[wrok]\n", &["line 1, column 2", "the section [wrok]", "did you mean `work`?"]),
            ("lease = '1s'\n", &["line 1, column 1", "the key `lease`", "belongs in [work]"]),
            ("[work]\nupload-bytes = 1\n", &["`upload_bytes` belongs in [uploads]"]),
            ("[server]\nstore = 'dir:/x'\n", &["`store` belongs before the first section"]),
            ("[work]\n  workers = '3'", &["line 2, column 13", "a text for `work.workers`", "expected a whole number"]),
            ("[work]\nworkers = -1", &["line 2, column 11", "`work.workers`: found `-1`", "expected a whole number"]),
            ("[work]\nattempts = 0", &["`work.attempts`: found `0`", "a whole number, at least 1"]),
            ("[work]\nattempts = 5000000000", &["and a smaller one"]),
            ("[work]\nlease = 'soon'", &["`work.lease`: found `soon`", "a time such as 500ms"]),
            ("[work]\nlease = 1.5", &["the number 1.5 for `work.lease`", "a time such as"]),
            ("[work]\nlease = 2026-01-01", &["a date or time for `work.lease`"]),
            ("[work]\nmetrics = 'here'", &["`work.metrics`: found `here`, invalid socket address"]),
            ("log_format = 'xml'", &["`log_format`: found `xml`, expected one of human, json"]),
            ("data = ''", &["`data`: found ``, expected a text that is not empty"]),
            ("work = 3", &["line 1, column 8", "found the number 3, expected a section [work]"]),
            ("[database]\nurl = 1", &["a table for `database`", "expected a text in quotes"]),
            ("[server]\nnames = 'a'", &["a text for `server.names`, expected a list of texts"]),
            ("[server]\nnames = ['a', true]", &["line 2, column 15", "true in `server.names`", "texts in quotes"]),
            ("[server]\nnames = ['a,b']", &["`server.names`: found `a,b`", "a text of its own for each"]),
            ("data = 'a'\ndata = 'b'", &["line 2, column 1: duplicate key"]),
            ("data = \n", &["line 1, column"]),
            ("é = 'ü' x", &["line 1, column 9"]),
            ("config = 'other.toml'", &["the key `config`"]),
            ("colour = 1", &["the key `colour`, expected one of log_format, data"]),
        ] {
            let error = read(text).unwrap_err();
            for part in parts {
                assert!(error.contains(part), "{text}: {error}");
            }
        }
        for text in
            ["database = 'postgers://w:secret@db/w'", "[work]\nlease = 'x://u:secret@h'", "store = 's3://k:secret@b'"]
        {
            let error = read(text).unwrap_err();
            assert!(!error.contains("secret") && error.contains("expected"), "{error}");
        }
        let deep = format!("data = {}{}", "[".repeat(20_000), "]".repeat(20_000));
        assert!(read(&deep).unwrap_err().contains("line 1"));
    }

    #[test]
    fn files_that_are_no_text_or_too_large_are_refused() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("wavelume.toml");
        let refused = |bytes: &[u8]| {
            std::fs::write(&file, bytes).unwrap();
            ConfigFile::read(&file, &[]).unwrap_err().to_string()
        };
        assert!(
            refused(b"\n\xff").ends_with("wavelume.toml: line 2: found bytes that are no UTF-8, expected a text file")
        );
        assert!(refused(&vec![b'#'; 300 << 10]).ends_with("307200 bytes are more than the limit of 262144"));
    }
}
