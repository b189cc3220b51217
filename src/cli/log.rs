//! Log on stderr: an event is one line of bounded length, in colour only on a terminal.

use std::fs::File;
use std::io::{self, IsTerminal, Write};
use std::os::fd::AsFd;
use std::sync::Arc;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{fmt, registry};

/// Upper bound in bytes on a line of the log; the rest of a longer line is left out. Events of the service are far
/// shorter.
const LONGEST_LINE: usize = 8 << 10;

/// Format of the log on stderr.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum LogFormat {
    /// One human-readable line of text for each logged event.
    #[default]
    Human,
    /// One line with a JSON object for each logged event.
    Json,
}

/// Starts the log on stderr. `RUST_LOG` filters it (`warn` or `info,sqlx=debug`: a level for all modules, or by the
/// beginning of a module name). Without this variable, `level` is the lowest severity that is logged.
pub(super) fn start(format: LogFormat, level: LevelFilter) {
    let asked = std::env::var("RUST_LOG").ok().and_then(|levels| levels.parse::<Targets>().ok());
    // It logs what its caller, the command, reports on the same stderr.
    let usual = || Targets::new().with_default(level).with_target("rustls_platform_verifier", LevelFilter::OFF);
    let log = registry().with(asked.unwrap_or_else(usual));
    let colours = in_colour(io::stderr().is_terminal(), |name| std::env::var(name).ok());
    let events = fmt::layer().with_ansi(colours);
    let to = Output::stderr();
    match format {
        LogFormat::Human => {
            log.with(events.with_target(false).with_writer(move || Line { to: to.clone(), colours })).init();
        }
        // JSON escapes control characters itself, and half an object would be invalid.
        LogFormat::Json => log.with(events.json().with_writer(move || to.clone())).init(),
    }
}

/// Destination of the log: stderr as a file, without the lock of [`io::stderr`], for which threads that answer requests
/// would wait. An event is one write, which the system does not mix with others.
#[derive(Clone)]
enum Output {
    Unlocked(Arc<File>),
    /// Stderr with its lock, as the destination of the log if the system cannot duplicate the file descriptor.
    Locked,
}

impl Output {
    fn stderr() -> Self {
        let file = io::stderr().as_fd().try_clone_to_owned().map(File::from);
        file.map_or(Self::Locked, |file| Self::Unlocked(Arc::new(file)))
    }
}

impl Write for Output {
    fn write(&mut self, event: &[u8]) -> io::Result<usize> {
        match self {
            Self::Unlocked(file) => file.write(event),
            Self::Locked => io::stderr().write(event),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Returns true if the log is coloured: on a terminal that has colours, unless `NO_COLOR` is set and not empty
/// (<https://no-color.org>).
fn in_colour(terminal: bool, variable: impl Fn(&str) -> Option<String>) -> bool {
    terminal
        && variable("NO_COLOR").is_none_or(|value| value.is_empty())
        && variable("TERM").is_none_or(|term| term != "dumb")
}

/// Writer that puts one event of the log on one line.
struct Line<W> {
    to: W,
    /// True if escape sequences are kept, because the log colours its text. Those inside logged values are escaped
    /// earlier.
    colours: bool,
}

impl<W: Write> Write for Line<W> {
    /// Writes one event of the log; `event` is its whole text.
    fn write(&mut self, event: &[u8]) -> io::Result<usize> {
        let plain =
            event.strip_suffix(b"\n").is_some_and(|line| !line.iter().any(|b| b.is_ascii_control() || *b > 0x7e));
        if plain && event.len() <= LONGEST_LINE {
            self.to.write_all(event)?;
            return Ok(event.len());
        }
        let text = String::from_utf8_lossy(event);
        let mut line = String::with_capacity(text.len() + 1);
        for c in text.strip_suffix('\n').unwrap_or(&text).chars() {
            if line.len() > LONGEST_LINE {
                line.push_str(" …");
                break;
            }
            if c.is_control() && !(self.colours && c == '\u{1b}') {
                line.extend(c.escape_default());
            } else {
                line.push(c);
            }
        }
        line.push('\n');
        self.to.write_all(line.as_bytes())?;
        Ok(event.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(event: &str, colours: bool) -> String {
        let mut line = Line { to: Vec::new(), colours };
        line.write_all(event.as_bytes()).unwrap();
        String::from_utf8(line.to).unwrap()
    }

    #[test]
    fn an_event_is_one_bounded_line() {
        assert_eq!(written("INFO θ = 30°\n", false), "INFO θ = 30°\n");
        assert_eq!(written("a\nINFO forged\r\u{1b}[2J\n", false), "a\\nINFO forged\\r\\u{1b}[2J\n");
        assert_eq!(written("\u{1b}[32mINFO\u{1b}[0m a\nb\n", true), "\u{1b}[32mINFO\u{1b}[0m a\\nb\n");
        let long = written(&"ü".repeat(1 << 20), false);
        assert!(long.len() < LONGEST_LINE + 16 && long.ends_with(" …\n"), "{}", long.len());
    }

    #[test]
    fn colours_are_for_terminals() {
        let none = |_: &str| None;
        let set =
            |name: &'static str, value: &'static str| move |asked: &str| (asked == name).then(|| value.to_owned());
        assert!(in_colour(true, none) && in_colour(true, set("NO_COLOR", "")) && in_colour(true, set("TERM", "xterm")));
        assert!(
            !in_colour(false, none) && !in_colour(true, set("NO_COLOR", "1")) && !in_colour(true, set("TERM", "dumb"))
        );
    }
}
