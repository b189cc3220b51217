//! `wavelume config`: prints the effective settings, each with its source, as a configuration file or as JSON.

use super::config_file::ConfigFile;
use super::failure::Failure;
use super::isolate::IsolateArgs;
use super::jobs::UrlArg;
use super::output::{print, print_json};
use super::serve::{AccessArgs, ReachArgs};
use super::setting_keys::{Key, Kind};
use super::settings::{self, Settings};
use super::site::PlaceArgs;
use super::tls::{TlsArgs, TrustArg};
use super::worker::MetricsArg;
use crate::catalog::without_password;
use clap::ArgMatches;
use clap::parser::ValueSource;
use serde_json::{Value, json};
use std::fmt::Write;

/// Every setting of the program: a setting that is missing here is no key of the configuration file.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    places: PlaceArgs,
    #[command(flatten)]
    url: UrlArg,
    #[command(flatten)]
    trust: TrustArg,
    #[command(flatten)]
    reach: ReachArgs,
    #[command(flatten)]
    access: AccessArgs,
    #[command(flatten)]
    tls: TlsArgs,
    #[command(flatten)]
    figures: MetricsArg,
    #[command(flatten)]
    isolation: IsolateArgs,
    #[command(flatten)]
    settings: Settings,
    /// Print the settings as one line of JSON
    #[arg(long)]
    json: bool,
    /// Effective settings of the service, from the command line, the environment and the configuration file. Set after
    /// all three were read.
    #[arg(skip)]
    effective: Effective,
}

/// Effective values of all settings, and the file that was read.
#[derive(Debug, Default)]
pub(super) struct Effective {
    file: Option<String>,
    values: Vec<Given>,
}

/// Effective value of one setting, without its password, and where it came from.
#[derive(Debug)]
struct Given {
    section: String,
    name: String,
    flag: String,
    variable: String,
    /// Effective value of the setting; `None` if it is not set and has no default.
    value: Option<Value>,
    has_password: bool,
    source: Source,
    /// Commands in which the setting has another default, each with that default, such as `worker: 10min`.
    other_defaults: String,
}

/// Origin of the effective value of a setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Default,
    /// The configuration file, on the line with this number.
    File(usize),
    Environment,
    Flag,
}

/// Upper bound on the column at which the comments of a printed configuration are aligned. A comment after a longer
/// value stands further right.
const COMMENTS: usize = 48;

impl Args {
    /// Takes the settings from what was given on the command line, in the environment and in the file.
    pub(super) fn fill_in(&mut self, matches: &ArgMatches, keys: &[Key], file: Option<&ConfigFile>) {
        self.effective = Effective {
            file: file.map(|file| file.path.display().to_string()),
            values: keys.iter().map(|key| given(key, matches, file)).collect(),
        };
    }
}

fn given(key: &Key, matches: &ArgMatches, file: Option<&ConfigFile>) -> Given {
    let source = match (matches.value_source(key.id()), file.and_then(|file| file.entry(key))) {
        (Some(ValueSource::CommandLine), _) => Source::Flag,
        (Some(ValueSource::EnvVariable), _) => Source::Environment,
        (_, Some(entry)) => Source::File(entry.line),
        (_, None) => Source::Default,
    };
    let texts: Vec<String> =
        matches.get_raw(key.id()).into_iter().flatten().map(|text| text.to_string_lossy().into_owned()).collect();
    let shown: Vec<String> = texts.iter().map(|text| without_password(text)).collect();
    let number = settings::unit(key.id()).zip(matches.try_get_one::<u64>(key.id()).ok().flatten());
    let value = match (key.kind(), number) {
        (Kind::List, _) => (source != Source::Default).then(|| json!(shown)),
        (Kind::Count, Some((_, number))) => Some(json!(number)),
        (_, Some((unit, number))) => Some(json!(unit.show(*number))),
        (_, None) => shown.first().map(|text| json!(text)),
    };
    let others: Vec<String> =
        key.other_defaults.iter().map(|(command, default)| format!("{command}: {default}")).collect();
    Given {
        section: key.section.clone(),
        name: key.name.clone(),
        flag: format!("--{}", key.option.get_long().unwrap_or_default()),
        variable: key.option.get_env().unwrap_or_default().to_string_lossy().into_owned(),
        value,
        has_password: shown != texts,
        source,
        other_defaults: others.join(", "),
    }
}

impl Given {
    /// Returns the line of the configuration file that gives this value. Defaults are commented out, so that the file
    /// does not outlive a change of the program's defaults.
    fn line(&self) -> String {
        match &self.value {
            None => format!("# {} =", self.name),
            Some(value) if self.source == Source::Default => format!("# {} = {}", self.name, toml(value)),
            Some(value) => format!("{} = {}", self.name, toml(value)),
        }
    }

    fn comment(&self, file: Option<&str>) -> String {
        let mut text = match self.source {
            Source::Default if self.value.is_none() => "not set".to_owned(),
            Source::Default if self.other_defaults.is_empty() => "default".to_owned(),
            Source::Default => format!("default ({})", self.other_defaults),
            Source::File(line) => format!("{}:{line}", file.unwrap_or_default()),
            Source::Environment => format!("environment {}", self.variable),
            Source::Flag => format!("flag {}", self.flag),
        };
        if self.has_password {
            text.push_str(", password left out");
        }
        text
    }

    fn json(&self) -> Value {
        let source = match self.source {
            Source::Default => "default",
            Source::File(_) => "file",
            Source::Environment => "environment",
            Source::Flag => "flag",
        };
        let mut object = json!({
            "section": self.section, "key": self.name, "flag": self.flag, "environment": self.variable,
            "value": self.value, "source": source,
        });
        if let Source::File(line) = self.source {
            object["line"] = json!(line);
        }
        if self.has_password {
            object["password"] = json!("left out");
        }
        object
    }
}

/// Writes a value as TOML; the escapes of JSON are those of TOML.
fn toml(value: &Value) -> String {
    match value {
        Value::Array(items) => format!("[{}]", items.iter().map(toml).collect::<Vec<_>>().join(", ")),
        other => other.to_string().replace('\u{7f}', "\\u007f"),
    }
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let Effective { file, values } = &args.effective;
    if args.json {
        let values: Vec<Value> = values.iter().map(Given::json).collect();
        return print_json(&json!({ "file": file, "settings": values }));
    }
    print(&rendered(file.as_deref(), values))
}

fn rendered(file: Option<&str>, values: &[Given]) -> String {
    let mut text =
        "# Effective settings: a flag wins over the environment, that over the file, and that over the default.\n\
                    # Saved to a file, this is a configuration for --config FILE.\n"
            .to_owned();
    if let Some(file) = file {
        // A name with a line break must not end the comment.
        let _ = writeln!(text, "# Read from {}", super::one_line(file));
    }
    let lines: Vec<String> = values.iter().map(Given::line).collect();
    let width = lines.iter().map(|line| line.chars().count()).filter(|width| *width <= COMMENTS).max().unwrap_or(0);
    let mut section = "";
    text.push('\n');
    for (given, line) in values.iter().zip(&lines) {
        if given.section != section {
            section = &given.section;
            let _ = writeln!(text, "\n[{section}]");
        }
        let _ = writeln!(text, "{line:<width$}  # {}", super::one_line(&given.comment(file)));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_written_so_that_they_are_read_back() {
        let odd = "a \"b\" \\ \t\n\u{1} \u{7f} é\u{2028}";
        let text = format!("x = {}\n", toml(&json!([odd, odd])));
        let table = toml::de::DeTable::parse(&text).unwrap();
        let list = table.get_ref().get("x").unwrap().get_ref().as_array().unwrap();
        assert!(list.iter().all(|item| item.get_ref().as_str() == Some(odd)));
    }
}
