//! Log on stderr: an event is one line of bounded length, in colour only on a terminal.

use std::fs::File;
use std::io::{self, IsTerminal, Write};
use std::os::fd::AsFd;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;
use tracing::{Level, Metadata};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::MakeWriter;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{fmt, registry};

/// Upper bound in bytes on a line of the log; the rest of a longer line is left out. Events of the service are far
/// shorter.
const LONGEST_LINE: usize = 8 << 10;

/// Longest time for which a line waits for others, to be written together with them. Raising it saves little, but more
/// lines are lost if the process is killed.
const GATHERED: Duration = Duration::from_millis(20);

/// Number of bytes of waiting log lines at which they are written without further waiting. Raising it takes memory;
/// lowering it writes more often under load.
const ROOM: usize = 32 << 10;

/// Destination of the log of this process, once the log is started.
static OUTPUT: OnceLock<Arc<Output>> = OnceLock::new();

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
    let to = Arc::clone(OUTPUT.get_or_init(Output::stderr));
    let writers = Writers { to, colours, is_json: format == LogFormat::Json };
    let events = fmt::layer().with_ansi(colours).with_writer(writers);
    match format {
        LogFormat::Human => log.with(events.with_target(false)).init(),
        LogFormat::Json => log.with(events.json()).init(),
    }
}

/// Writes the lines of the log that still wait to be written together. The process calls it before it ends.
pub fn end_log() {
    if let Some(output) = OUTPUT.get() {
        output.flush();
    }
}

/// Destination of the log. Lines of ordinary work wait a moment for others, because a write takes longer than all else
/// about a line; a warning or an error is written at once, after those that wait. On a terminal no line waits.
struct Output {
    to: Destination,
    waiting: Mutex<Vec<u8>>,
    /// Condition variable that signals a waiting line of the log.
    filled: Condvar,
    /// True if lines wait for others, because a thread writes them a moment later.
    gathers: AtomicBool,
}

/// Stderr as a file, without the lock of [`io::stderr`], for which threads that answer requests would wait.
enum Destination {
    Unlocked(File),
    /// Stderr with its lock, if the system cannot duplicate the file descriptor.
    Locked,
}

impl Output {
    fn stderr() -> Arc<Self> {
        let file = io::stderr().as_fd().try_clone_to_owned().map(File::from);
        Self::new(file.map_or(Destination::Locked, Destination::Unlocked), !io::stderr().is_terminal())
    }

    /// Creates the destination of the log. If `gathers`, lines of ordinary work wait for others, and a thread is
    /// started that writes them.
    fn new(to: Destination, gathers: bool) -> Arc<Self> {
        let output = Self { to, waiting: Mutex::default(), filled: Condvar::new(), gathers: AtomicBool::new(false) };
        let output = Arc::new(output);
        if gathers {
            let of_thread = Arc::clone(&output);
            let started = std::thread::Builder::new().name("log".to_owned()).spawn(move || of_thread.write_waiting());
            output.gathers.store(started.is_ok(), Relaxed);
        }
        output
    }

    /// Writes waiting lines of the log, each time a moment after the first of them came. Never returns.
    fn write_waiting(&self) {
        loop {
            let waiting = self.filled.wait_while(self.waiting(), |waiting| waiting.is_empty());
            drop(waiting);
            std::thread::sleep(GATHERED);
            self.flush();
        }
    }

    /// Takes lines of the log: writes them now if they are `urgent`, otherwise soon.
    fn take(&self, lines: &[u8], urgent: bool) {
        let mut waiting = self.waiting();
        let was_empty = waiting.is_empty();
        waiting.extend_from_slice(lines);
        if urgent || !self.gathers.load(Relaxed) || waiting.len() >= ROOM {
            self.write(&mut waiting);
        } else if was_empty {
            self.filled.notify_one();
        }
    }

    fn flush(&self) {
        self.write(&mut self.waiting());
    }

    /// Writes the waiting lines in one call, so that the system does not mix them with other output. An error is
    /// ignored, because there is no other place to report it.
    fn write(&self, waiting: &mut Vec<u8>) {
        let _ = match &self.to {
            Destination::Unlocked(file) => (&*file).write_all(waiting),
            Destination::Locked => io::stderr().write_all(waiting),
        };
        waiting.clear();
    }

    fn waiting(&self) -> MutexGuard<'_, Vec<u8>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Maker of the writers that put events into the log: one for each event, which knows if the event must be written at
/// once.
struct Writers {
    to: Arc<Output>,
    /// True if escape sequences are kept, because the log colours its text. Those inside logged values are escaped
    /// earlier.
    colours: bool,
    /// True if events are JSON objects, which escape control characters themselves and are invalid if they are cut.
    is_json: bool,
}

impl<'a> MakeWriter<'a> for Writers {
    type Writer = Line<'a>;

    fn make_writer(&'a self) -> Line<'a> {
        Line { log: self, urgent: true }
    }

    fn make_writer_for(&'a self, event: &Metadata<'_>) -> Line<'a> {
        Line { log: self, urgent: *event.level() <= Level::WARN }
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
struct Line<'a> {
    log: &'a Writers,
    urgent: bool,
}

impl Write for Line<'_> {
    /// Writes one event to the log as one line; `event` is the whole text of the event.
    fn write(&mut self, event: &[u8]) -> io::Result<usize> {
        let plain =
            event.strip_suffix(b"\n").is_some_and(|line| !line.iter().any(|b| b.is_ascii_control() || *b > 0x7e));
        if self.log.is_json || (plain && event.len() <= LONGEST_LINE) {
            self.log.to.take(event, self.urgent);
            return Ok(event.len());
        }
        let text = String::from_utf8_lossy(event);
        let mut line = String::with_capacity(text.len() + 1);
        for c in text.strip_suffix('\n').unwrap_or(&text).chars() {
            if line.len() > LONGEST_LINE {
                line.push_str(" …");
                break;
            }
            if c.is_control() && !(self.log.colours && c == '\u{1b}') {
                line.extend(c.escape_default());
            } else {
                line.push(c);
            }
        }
        line.push('\n');
        self.log.to.take(line.as_bytes(), self.urgent);
        Ok(event.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns an output of the log that writes to a new temporary file, and this file.
    fn output(gathers: bool) -> (Arc<Output>, tempfile::NamedTempFile) {
        let file = tempfile::NamedTempFile::new().unwrap();
        (Output::new(Destination::Unlocked(file.reopen().unwrap()), gathers), file)
    }

    fn written(event: &str, colours: bool) -> String {
        let (to, file) = output(false);
        Writers { to, colours, is_json: false }.make_writer().write_all(event.as_bytes()).unwrap();
        std::fs::read_to_string(file).unwrap()
    }

    #[test]
    fn ordinary_lines_wait_for_others_and_keep_their_order() {
        let (to, file) = output(true);
        let read = || std::fs::read_to_string(&file).unwrap();
        to.take(b"a\n", false);
        to.take(b"b\n", true);
        assert_eq!(read(), "a\nb\n", "a warning takes the others along");
        to.take(&vec![b'c'; ROOM], false);
        assert_eq!(read().len(), ROOM + 4, "and so do many");
        to.take(b"d\n", false);
        to.flush();
        assert!(read().ends_with("cd\n"));
        to.take(b"e\n", false);
        let late = std::time::Instant::now() + Duration::from_mins(1);
        while !read().ends_with("d\ne\n") && std::time::Instant::now() < late {
            std::thread::sleep(GATHERED);
        }
        assert!(read().ends_with("d\ne\n"), "a line waits for others for a moment only");
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
