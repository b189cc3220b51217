//! Arguments of the command line, derived from declared options.

use crate::compress::Target;
use crate::domain::{Declared, Values};
use crate::evaluate::{BEYOND, INTERPOLATION};
use crate::export::ExportOptions;
use crate::formats::Interpretation;
use crate::pipeline::Request;
use clap::builder::ValueParser;
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches};
use serde_json::{Map, Value};
use std::path::PathBuf;

/// Returns the name of a declared option on the command line, without the two dashes.
fn long(declared: &Declared) -> String {
    let name = declared.name.replace('_', "-");
    if is_switched_off(declared) { format!("no-{name}") } else { name }
}

/// Returns true for a switch that is true by default, so that its option on the command line makes it false.
fn is_switched_off(declared: &Declared) -> bool {
    matches!(declared.values, Values::Switch) && (declared.default)() == true
}

/// Returns the help text of a declared option as the command line shows it, without its last full stop. The names that
/// the option accepts follow, unless they stand in the place of its value. For an option `--no-NAME` the text begins
/// with `Switches off`.
pub(super) fn help(declared: &Declared) -> String {
    let text = declared.help.trim().trim_end_matches('.');
    match declared.values {
        Values::Name { shown: Some(_), names } => format!("{text} [names: {}]", names().join(", ")),
        _ if is_switched_off(declared) => format!("Switches off: {text}"),
        _ => text.to_owned(),
    }
}

/// Returns the placeholder for the value of an option in its help text; `None` if the option takes no value.
fn placeholder(declared: &Declared) -> Option<String> {
    match declared.values {
        Values::Number { shown, .. }
        | Values::Whole { shown, .. }
        | Values::List { shown }
        | Values::Text { shown, .. }
        | Values::File { shown }
        | Values::Document { shown } => Some(shown.to_owned()),
        Values::Name { shown, names } => Some(shown.map_or_else(|| names().join("|"), str::to_owned)),
        _ => None,
    }
}

/// Returns the default value of an option as text of the command line; `None` without one.
fn default_text(declared: &Declared) -> Option<String> {
    match (declared.default)() {
        Value::Null => None,
        Value::String(text) => Some(text),
        other => Some(other.to_string()),
    }
}

/// Makes the command-line argument that sets a declared option.
pub(super) fn argument(declared: &'static Declared) -> Arg {
    let argument = Arg::new(declared.name).long(long(declared)).help(help(declared));
    let Some(shown) = placeholder(declared) else { return argument.action(ArgAction::SetTrue) };
    let argument = argument.value_name(shown);
    if matches!(declared.values, Values::File { .. } | Values::Document { .. }) {
        return argument.value_parser(clap::value_parser!(PathBuf));
    }
    let read = move |text: &str| declared.read(text);
    // A negative number is refused with the allowed range, not as an unknown option.
    argument.allow_negative_numbers(true).value_parser(ValueParser::new(read)).default_values(default_text(declared))
}

/// Returns the value that the user stated for an option on the command line. If the value is a file, it is `None`:
/// [`path`] returns the path.
pub(super) fn stated(matches: &ArgMatches, declared: &Declared) -> Option<Value> {
    if matches.value_source(declared.name) != Some(ValueSource::CommandLine) {
        return None;
    }
    match declared.values {
        Values::Switch => Some(Value::Bool(!is_switched_off(declared))),
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

/// Implements the traits of clap for a group of options that is made from declarations. The group's function
/// `arguments` adds the options to a command, and its function `read` reads what the user stated.
macro_rules! declared_args {
    ($type:ident) => {
        impl clap::Args for $type {
            fn augment_args(command: clap::Command) -> clap::Command {
                Self::arguments(command)
            }

            fn augment_args_for_update(command: clap::Command) -> clap::Command {
                Self::arguments(command)
            }
        }

        impl clap::FromArgMatches for $type {
            fn from_arg_matches(matches: &clap::ArgMatches) -> Result<Self, clap::Error> {
                Self::read(matches)
            }

            fn update_from_arg_matches(&mut self, matches: &clap::ArgMatches) -> Result<(), clap::Error> {
                *self = Self::read(matches)?;
                Ok(())
            }
        }
    };
}
pub(super) use declared_args;

/// Makes the usage error that rejects a value on the command line.
pub(super) fn refusal(error: impl std::fmt::Display) -> clap::Error {
    clap::Error::raw(ErrorKind::ValueValidation, as_typed(&error.to_string()))
}

/// Returns a message of the library with the names of options as the command line has them: `--albedo-error` for
/// `albedo_error`, `--member` for `the option member`. Quoted names of fields in files stay as they are.
pub(super) fn as_typed(message: &str) -> String {
    let lists = [Request::OPTIONS, Target::DECLARED, Interpretation::OPTIONS, ExportOptions::OPTIONS];
    let shared = [&INTERPOLATION, &BEYOND];
    let mut text = String::with_capacity(message.len());
    for word in message.split_inclusive(' ') {
        let name = word.trim_matches(|c: char| c.is_whitespace() || "`,;:.()".contains(c));
        let declared = lists.into_iter().flatten().chain(shared).find(|declared| declared.name == name);
        let before = text.strip_suffix("the option ").or_else(|| text.strip_suffix("option ")).map(str::len);
        let is_member = name.contains('_') && !word.contains('`');
        match declared.filter(|_| before.is_some() || is_member) {
            Some(declared) => {
                text.truncate(before.unwrap_or(text.len()));
                text.push_str(&word.replace('`', "").replace(name, &format!("--{}", long(declared))));
            }
            None => text.push_str(word),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_in_messages_are_named_as_they_are_typed() {
        for (message, typed) in [
            ("the option albedo_error cannot be used: x", "--albedo-error cannot be used: x"),
            ("leave albedo_error out", "leave --albedo-error out"),
            ("ask for er_l2 0.13 or more, or lossless", "ask for --er-l2 0.13 or more, or lossless"),
            ("give a finer outgoing_level (or incoming_level)", "give a finer --outgoing-level (or --incoming-level)"),
            ("expected the option member, the name of one: `a`", "expected --member, the name of one: `a`"),
            ("the field or the option `quantity`: brdf", "the field or --quantity: brdf"),
            ("option step: found 0", "--step: found 0"),
            ("`wavelength_unit` is not stated", "`wavelength_unit` is not stated"),
            ("/tmp/er_l2/a.ies: theta_o of quantity x", "/tmp/er_l2/a.ies: theta_o of quantity x"),
        ] {
            assert_eq!(as_typed(message), typed);
        }
    }
}
