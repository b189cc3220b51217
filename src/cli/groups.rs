//! Help of the program: its commands in groups, each with a heading.

use super::completions;
use clap::Command;
use std::fmt::Write as _;

/// Commands by subject, in the order in which the help lists them.
const GROUPS: &[(&str, &[&str])] = &[
    (
        "Files",
        &[
            "compress",
            "inspect",
            "project",
            "decode",
            "evaluate",
            "sample",
            "reflectance",
            "combine",
            "dot",
            "export",
            "formats",
            "bases",
        ],
    ),
    ("Pictures and figures", &["preview", "color", "physics", "paper"]),
    ("Service", &["demo", "serve", "worker", "jobs", "link", "token", "health", "openapi"]),
    ("Administration", &["tenants", "keys", "migrate", "config", "doctor", "fsck", "gc", "backup", "restore", "move"]),
    ("Help", &["help", completions::NAME, "man"]),
];
/// Description of the command `help`, which the parser of the command line adds by itself.
const HELP: &str = "Print this list or the help of a command";
/// Width of the help in columns.
const WIDTH: usize = 100;

/// Returns the program's command with a help that lists its commands in groups.
pub(super) fn grouped(program: Command) -> Command {
    let text = list(&program);
    program
        .help_template(format!("{{about-with-newline}}\n{{usage-heading}} {{usage}}\n{text}\nOptions:\n{{options}}\n"))
}

/// Returns the list of all commands that are not hidden, with a heading for each group.
fn list(program: &Command) -> String {
    let widest = GROUPS.iter().flat_map(|(_, names)| names.iter()).map(|name| name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for (heading, names) in GROUPS {
        let _ = write!(text, "\n{heading}:\n");
        for name in *names {
            let about =
                program.find_subcommand(name).and_then(Command::get_about).map_or(HELP.to_owned(), ToString::to_string);
            let _ = writeln!(text, "  {name:<widest$}  {}", wrapped(&about, WIDTH - widest - 4, widest + 4));
        }
    }
    text
}

/// Breaks a text into lines of at most `width` characters; each but the first is indented.
fn wrapped(text: &str, width: usize, indent: usize) -> String {
    let (mut lines, mut length) = (String::new(), 0);
    for word in text.split_whitespace() {
        let letters = word.chars().count();
        if length > 0 && length + 1 + letters > width {
            let _ = write!(lines, "\n{:indent$}", "");
            length = 0;
        } else if length > 0 {
            lines.push(' ');
            length += 1;
        }
        lines.push_str(word);
        length += letters;
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::Cli;

    #[test]
    fn every_command_is_in_one_group_and_no_hidden_one() {
        let program = Cli::program();
        let shown = program.get_subcommands().filter(|command| !command.is_hide_set()).map(Command::get_name);
        let mut shown: Vec<&str> = shown.chain(["help"]).collect();
        let mut grouped: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| names.iter().copied()).collect();
        shown.sort_unstable();
        grouped.sort_unstable();
        assert_eq!(shown, grouped);
    }

    #[test]
    fn the_list_has_headings_and_fits_the_width() {
        let help = Cli::program().render_help().to_string();
        for (heading, names) in GROUPS {
            assert!(help.contains(&format!("\n{heading}:\n")), "{help}");
            assert!(names.iter().all(|name| help.contains(&format!("\n  {name} "))), "{help}");
        }
        let (list, _) = help.split_once("\nOptions:\n").unwrap();
        assert!(list.lines().all(|line| line.chars().count() <= WIDTH), "{help}");
        assert!(!help.contains(crate::jobs::COMPUTE_JOB) && help.contains("--log-format"), "{help}");
    }
}
