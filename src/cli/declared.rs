//! Arguments of the command line, derived from declared options.

use crate::domain::{Declared, Values};
use clap::builder::ValueParser;
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches};
use serde_json::{Map, Value};
use std::path::PathBuf;

/// Returns the name of an option on the command line.
fn long(declared: &Declared) -> String {
    let name = declared.name.replace('_', "-");
    if matches!(declared.values, Values::SwitchOff) { format!("no-{name}") } else { name }
}

/// Returns a declared help text without its last full stop, as help texts of options are written.
pub(super) fn help(declared: &Declared) -> String {
    declared.help.trim().trim_end_matches('.').to_owned()
}

/// Makes the command-line argument that sets a declared option.
pub(super) fn argument(declared: &'static Declared) -> Arg {
    let argument = Arg::new(declared.name).long(long(declared)).help(help(declared));
    let (shown, default) = match declared.values {
        Values::Number { shown, .. } | Values::Whole { shown, .. } => (shown, None),
        Values::Name { shown, default, .. } | Values::Text { shown, default, .. } => (shown, default),
        Values::File { shown } | Values::Document { shown } => {
            return argument.value_name(shown).value_parser(clap::value_parser!(PathBuf));
        }
        _ => return argument.action(ArgAction::SetTrue),
    };
    let read = move |text: &str| declared.read(text);
    argument.value_name(shown).value_parser(ValueParser::new(read)).default_values(default)
}

/// Returns the value that the user stated for an option on the command line. If the value is a file, it is `None`:
/// [`path`] returns the path.
pub(super) fn stated(matches: &ArgMatches, declared: &Declared) -> Option<Value> {
    if matches.value_source(declared.name) != Some(ValueSource::CommandLine) {
        return None;
    }
    match declared.values {
        Values::Switch => Some(Value::Bool(true)),
        Values::SwitchOff => Some(Value::Bool(false)),
        Values::File { .. } | Values::Document { .. } => None,
        _ => matches.get_one::<Value>(declared.name).cloned(),
    }
}

/// Returns the values that the user stated on the command line for the given options, by the names of the options.
/// Options whose value is a file are left out.
pub(super) fn all_stated<'a>(
    matches: &ArgMatches,
    options: impl IntoIterator<Item = &'a Declared>,
) -> Map<String, Value> {
    let stated = options.into_iter().map(|declared| Some((declared.name.to_owned(), stated(matches, declared)?)));
    stated.flatten().collect()
}

/// Returns the path that the user stated on the command line for an option whose value is a file.
pub(super) fn path(matches: &ArgMatches, declared: &Declared) -> Option<PathBuf> {
    matches.get_one(declared.name).cloned()
}

/// Makes the usage error that rejects a value on the command line.
pub(super) fn refusal(error: impl std::fmt::Display) -> clap::Error {
    clap::Error::raw(ErrorKind::ValueValidation, error)
}
