//! Settings of the service as flags and environment variables, made from the one table that declares them.

use crate::jobs::{SETTINGS, Setting, Unit, WorkConfig};
use clap::{Arg, ArgMatches, Command};
use std::sync::LazyLock;

/// Values of all settings of a service, in the order of [`SETTINGS`].
pub(crate) type Settings = Chosen<ALL>;

/// Values of the settings of a worker, which serves nobody, in the order of [`SETTINGS`].
pub(crate) type WorkSettings = Chosen<WORK>;

/// Values of the settings on the time for which deleted data and ended jobs are kept, in the order of [`SETTINGS`].
pub(crate) type KeepSettings = Chosen<KEEP>;

/// Values of the settings on new access keys, in the order of [`SETTINGS`].
pub(crate) type AccessSettings = Chosen<ACCESS>;

const ALL: u8 = 0;
const WORK: u8 = 1;
const KEEP: u8 = 2;
const ACCESS: u8 = 3;

/// Values of settings of the service, given by flags and environment variables: of all settings, of those that a worker
/// needs, or of those for keeping data.
#[derive(Clone, Debug)]
pub(crate) struct Chosen<const CHOICE: u8>(Vec<u64>);

/// Help headings of the settings that a command accepts. The four lists are for a service, for a worker, for a command
/// that only removes old data and for one that makes keys; an empty list stands for all headings.
const HEADINGS: [&[&str]; 4] = [&[], &["Work", "Keeping", "Checking", "Stopping"], &["Keeping"], &["Access"]];

/// Time that a worker's running jobs have to end by default. A service has less, because clients wait for it.
const WORKER_DRAIN: &str = "10min";

/// Flag, environment variable, default and help text of one setting of the service.
struct Names {
    flag: String,
    variable: String,
    default: String,
    help: String,
}

static NAMES: LazyLock<Vec<Names>> = LazyLock::new(|| {
    let default = WorkConfig::new("");
    let names = |setting: &Setting| Names {
        flag: setting.field.replace('_', "-"),
        variable: format!("WAVELUME_{}", setting.field.to_uppercase()),
        default: setting.unit.show((setting.get)(&default)),
        help: setting.help.trim().trim_end_matches('.').to_owned(),
    };
    SETTINGS.iter().map(names).collect()
});

/// Names of the settings that the short help of `wavelume serve` lists; `--help` lists all.
const COMMON: [&str; 5] = ["workers", "threads", "connections_each", "upload_bytes", "drain"];

/// Returns the unit of the setting with this name; `None` if the option is no number.
pub(super) fn unit(field: &str) -> Option<Unit> {
    SETTINGS.iter().find(|setting| setting.field == field).map(|setting| setting.unit)
}

impl<const CHOICE: u8> Chosen<CHOICE> {
    fn settings() -> impl Iterator<Item = (&'static Setting, &'static Names)> {
        SETTINGS.iter().zip(NAMES.iter()).filter(|(setting, _)| {
            let headings = HEADINGS[usize::from(CHOICE)];
            headings.is_empty() || headings.contains(&setting.heading)
        })
    }

    /// Writes these values, read from flags and environment variables, into the configuration of the service.
    pub(crate) fn apply(&self, config: &mut WorkConfig) {
        for ((setting, _), value) in Self::settings().zip(&self.0) {
            // Every value was validated when it was parsed.
            let _ = (setting.set)(config, *value);
        }
    }
}

impl<const CHOICE: u8> clap::Args for Chosen<CHOICE> {
    fn augment_args(command: Command) -> Command {
        let arg = |(setting, names): (&'static Setting, &'static Names)| {
            Arg::new(setting.field)
                .long(names.flag.as_str())
                .env(names.variable.as_str())
                .hide_env_values(true)
                .value_name(setting.unit.placeholder())
                .default_value(if CHOICE == WORK && setting.field == "drain" {
                    WORKER_DRAIN
                } else {
                    names.default.as_str()
                })
                .help(names.help.as_str())
                .help_heading(setting.heading)
                .hide_short_help(!COMMON.contains(&setting.field))
                .value_parser(|text: &str| setting.parse(text))
        };
        command.args(Self::settings().map(arg))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<const CHOICE: u8> clap::FromArgMatches for Chosen<CHOICE> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let value = |(setting, _): (&Setting, _)| matches.get_one::<u64>(setting.field).copied();
        let missing = || clap::Error::new(clap::error::ErrorKind::MissingRequiredArgument);
        Self::settings().map(value).collect::<Option<Vec<_>>>().map(Self).ok_or_else(missing)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Cli, setting_keys};
    use super::*;
    use clap::CommandFactory;
    use std::fmt::Write;

    const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/settings.md");
    const BEGIN: &str = "<!-- settings: begin -->\n";
    const END: &str = "<!-- settings: end -->\n";

    /// Renders the tables of all settings in `docs/settings.md` from the declared command-line options.
    fn table() -> String {
        let program = Cli::command();
        let options = ["config", "serve"].map(|name| program.find_subcommand(name).unwrap().get_arguments());
        let mut groups: Vec<(&str, Vec<&Arg>)> = vec![("General", program.get_arguments().collect())];
        for option in
            options.into_iter().flatten().filter(|option| !["help", "json"].contains(&option.get_id().as_str()))
        {
            let heading = option.get_help_heading().unwrap_or("General");
            if !groups.iter().any(|(known, _)| *known == heading) {
                groups.push((heading, Vec::new()));
            }
            let group = &mut groups.iter_mut().find(|(known, _)| *known == heading).unwrap().1;
            if !group.iter().any(|known| known.get_id() == option.get_id()) {
                group.push(option);
            }
        }
        let mut text = String::new();
        for (heading, options) in groups {
            let section = setting_keys::section(options[0]);
            let place = if section.is_empty() { String::new() } else { format!(": `[{section}]`") };
            write!(
                text,
                "\n### {heading}{place}\n\n| flag | environment | key | default | meaning |\n|---|---|---|---|---|\n"
            )
            .unwrap();
            for option in options.into_iter().filter(|option| option.get_long().is_some()) {
                let flag = option.get_long().unwrap();
                let unit = option.get_value_names().and_then(|names| names.first()).map_or("", |name| name.as_str());
                let quoted = |text: Option<String>| text.map_or("–".to_owned(), |text| format!("`{text}`"));
                let variable = quoted(option.get_env().map(|name| name.to_str().unwrap().to_owned()));
                let key = quoted(setting_keys::name(option));
                let default: Vec<_> = option.get_default_values().iter().filter_map(|value| value.to_str()).collect();
                let default = quoted((!default.is_empty()).then(|| default.join(",")));
                let help = option.get_help().unwrap().to_string().replace('\n', " ");
                let flag = format!("--{flag} {unit}");
                writeln!(text, "| `{}` | {variable} | {key} | {default} | {help} |", flag.trim()).unwrap();
            }
        }
        text.push('\n');
        text
    }

    #[test]
    fn the_documented_settings_are_those_of_the_program() {
        let file = std::fs::read_to_string(FILE).unwrap();
        let (before, rest) = file.split_once(BEGIN).unwrap();
        let (documented, after) = rest.split_once(END).unwrap();
        let table = table();
        if std::env::var_os("UPDATE_SETTINGS").is_some() {
            std::fs::write(FILE, format!("{before}{BEGIN}{table}{END}{after}")).unwrap();
            return;
        }
        assert!(
            documented == table,
            "docs/settings.md is not what the program says: UPDATE_SETTINGS=1 cargo test documented_settings"
        );
    }

    #[test]
    fn every_setting_has_a_variable_a_group_and_reaches_the_configuration() {
        let command = clap::Command::new("serve");
        let command = <Settings as clap::Args>::augment_args(command);
        for setting in SETTINGS {
            let arg = command.get_arguments().find(|arg| arg.get_id() == setting.field).unwrap();
            assert!(arg.get_env().is_some() && arg.get_help_heading().is_some(), "{}", setting.field);
        }
        let line = ["serve", "--upload-bytes", "1GiB", "--idle", "5s", "--workers", "3", "--body-rate", "1KiB"];
        let matches = command.clone().try_get_matches_from(line).unwrap();
        let mut config = WorkConfig::new("");
        <Settings as clap::FromArgMatches>::from_arg_matches(&matches).unwrap().apply(&mut config);
        assert_eq!((config.limits.upload_bytes, config.limits.idle.as_secs()), (1 << 30, 5));
        assert_eq!((config.workers, config.limits.body_rate), (3, 1024));
        let wrong = command.try_get_matches_from(["serve", "--idle", "soon"]).unwrap_err().to_string();
        assert!(wrong.contains("--idle") && wrong.contains("30s"), "{wrong}");
    }
}
