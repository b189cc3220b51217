//! Keys of the configuration file (names of settings, no access keys), derived from the options of the commands that
//! read it.

use super::settings;
use crate::catalog::without_password;
use clap::error::{ContextKind, ContextValue};
use clap::{Arg, Command};
use std::error::Error;

/// Id of the option that names the configuration file; the commands that have it read the file.
pub(super) const CONFIG: &str = "config";

/// Beginning of the names of all environment variables of settings.
const PREFIX: &str = "WAVELUME_";

/// A key of the configuration file, and the option that it sets.
pub(super) struct Key {
    /// Section (TOML table) that holds the key: the first word of the option's help heading, in lower case. Empty for
    /// keys before the first section.
    pub(super) section: String,
    /// Name of the key: that of the environment variable without its prefix, in lower case.
    pub(super) name: String,
    /// Option of the command line whose value this key of the configuration file states.
    pub(super) option: Arg,
    /// Commands whose default for this key differs from that of `option`, each with its default.
    pub(super) other_defaults: Vec<(String, String)>,
}

/// Kind of TOML value that a key of the configuration file takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A whole number without a unit, such as a count.
    Count,
    /// A size or a time: a text with a unit, or a whole number of bytes or seconds.
    Amount,
    /// A single text, such as a path.
    Text,
    /// A list of texts, such as host names.
    List,
}

/// Returns all keys of the configuration file: the options of `wavelume config` that have an environment variable.
pub(super) fn keys(program: &Command) -> Vec<Key> {
    let readers: Vec<&Command> = program.get_subcommands().filter(|command| reads_file(command)).collect();
    let config = readers.iter().find(|command| command.get_name() == "config");
    let options = program.get_arguments().chain(config.into_iter().flat_map(|config| config.get_arguments()));
    let key = |option: &Arg| {
        let name = name(option)?;
        let differing = readers.iter().filter_map(|command| {
            let default = shown_default(command.get_arguments().find(|other| other.get_id() == option.get_id())?);
            (default != shown_default(option)).then(|| (command.get_name().to_owned(), default))
        });
        let other_defaults = differing.collect();
        Some(Key { section: section(option), name, option: option.clone(), other_defaults })
    };
    let mut keys: Vec<Key> = options.filter_map(key).collect();
    // In TOML, keys without a section stand first, and a section stands once.
    let mut sections: Vec<String> = vec![String::new()];
    for key in &keys {
        if !sections.contains(&key.section) {
            sections.push(key.section.clone());
        }
    }
    keys.sort_by_key(|key| sections.iter().position(|section| *section == key.section));
    keys
}

/// Returns true if a command reads the configuration file.
pub(super) fn reads_file(command: &Command) -> bool {
    command.get_arguments().any(|option| option.get_id() == CONFIG)
}

/// Returns the name of the key of the configuration file that sets an option; `None` if no key does.
pub(super) fn name(option: &Arg) -> Option<String> {
    let variable = option.get_env()?.to_str()?;
    (option.get_id() != CONFIG).then(|| variable.trim_start_matches(PREFIX).to_lowercase())
}

/// Returns the section of the key that sets an option; empty for keys before the first section.
pub(super) fn section(option: &Arg) -> String {
    option.get_help_heading().and_then(|heading| heading.split(' ').next()).unwrap_or_default().to_lowercase()
}

fn shown_default(option: &Arg) -> String {
    option.get_default_values().iter().map(|value| value.to_string_lossy()).collect::<Vec<_>>().join(",")
}

impl Key {
    /// Name of the option on the command line, and id of its value.
    pub(super) fn id(&self) -> &str {
        self.option.get_id().as_str()
    }

    /// Returns the full name of the key: `work.lease`.
    pub(super) fn full_name(&self) -> String {
        if self.section.is_empty() { self.name.clone() } else { format!("{}.{}", self.section, self.name) }
    }

    /// Returns the kind of TOML value that this key of the configuration file takes.
    pub(super) fn kind(&self) -> Kind {
        match settings::unit(self.id()) {
            _ if self.option.get_value_delimiter().is_some() => Kind::List,
            Some(unit) if unit.is_count() => Kind::Count,
            Some(_) => Kind::Amount,
            None => Kind::Text,
        }
    }

    /// Returns the description of a value that the key takes, for messages.
    pub(super) fn expected(&self) -> &'static str {
        match (self.kind(), settings::unit(self.id())) {
            (Kind::List, _) => "a list of texts",
            (_, Some(unit)) => unit.expected(),
            (_, None) => "a text in quotes",
        }
    }

    /// Checks a text as a value of the option. The error says what was found and expected.
    pub(super) fn check(&self, text: &str) -> Result<(), String> {
        let found = format!("found `{}`", without_password(text));
        if self.option.get_value_delimiter().is_some_and(|delimiter| text.contains(delimiter)) {
            return Err(format!("{found}, expected a text of its own for each"));
        }
        let flag = self.option.get_long().unwrap_or_default();
        let command = Command::new("wavelume").no_binary_name(true).arg(self.option.clone());
        let Err(error) = command.try_get_matches_from([format!("--{flag}={text}")]) else { return Ok(()) };
        if let Some(reason) = error.source().map(ToString::to_string) {
            // Some parsers say what they found, without a password.
            return Err(if reason.starts_with("found") { reason } else { format!("{found}, {reason}") });
        }
        Err(match error.get(ContextKind::ValidValue) {
            Some(ContextValue::Strings(valid)) if !valid.is_empty() => {
                format!("{found}, expected one of {}", valid.join(", "))
            }
            _ => format!("{found}, expected a text that is not empty"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::Cli;
    use super::*;
    use clap::CommandFactory;
    use std::collections::BTreeSet;

    /// Collects in `found` all commands that read the configuration file: `command` itself and all commands below it.
    fn readers(command: &Command, found: &mut Vec<Command>) {
        if reads_file(command) {
            found.push(command.clone());
        }
        command.get_subcommands().for_each(|below| readers(below, found));
    }

    #[test]
    fn every_variable_of_a_command_that_reads_the_file_is_a_key_once() {
        let program = Cli::command();
        let keys = keys(&program);
        let names: BTreeSet<&str> = keys.iter().map(|key| key.name.as_str()).collect();
        assert_eq!(names.len(), keys.len());
        let mut commands = Vec::new();
        readers(&program, &mut commands);
        let read: Vec<_> = commands.iter().map(Command::get_name).collect();
        for command in ["serve", "worker", "migrate", "gc", "fsck", "config", "list", "retry"] {
            assert!(read.contains(&command), "{read:?}");
        }
        for option in commands.iter().flat_map(Command::get_arguments) {
            assert!(name(option).is_none_or(|name| names.contains(name.as_str())), "{}", option.get_id());
        }
        let full: Vec<_> = keys.iter().map(Key::full_name).collect();
        for name in ["database", "log_format", "server.names", "work.lease", "work.metrics", "uploads.upload_bytes"] {
            assert!(full.iter().any(|full| full == name), "{full:?}");
        }
        let drain = keys.iter().find(|key| key.name == "drain").unwrap();
        assert_eq!(drain.other_defaults, [("worker".to_owned(), "10min".to_owned())]);
    }
}
