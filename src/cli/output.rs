//! Output of commands: files replaced whole, JSON on one line, human-readable tables.

use super::failure::{Failure, one_line};
use super::input::describe;
use serde::Serialize;
use std::fs::{File, Permissions};
use std::io::{ErrorKind, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// Replaces the file `path` as a whole: a reader sees the old file or the new one, never a part. The new file is on the
/// disk when this returns.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let refuse = |error: std::io::Error| Failure::Failed(format!("cannot write: {}", describe(&error))).about(path);
    // Through a link, the file it points to is replaced; a device or pipe is written to as it is.
    let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    match target.metadata() {
        Ok(metadata) if metadata.is_dir() => {
            Err(Failure::failed("cannot write: is a directory, expected a file").about(path))
        }
        Ok(metadata) if !metadata.is_file() => {
            File::options().write(true).open(&target).and_then(|mut f| f.write_all(bytes)).map_err(refuse)
        }
        Ok(metadata) => replace(&target, bytes, metadata.permissions()).map_err(refuse),
        // Reduced by the umask of the process.
        Err(_) => replace(&target, bytes, Permissions::from_mode(0o666)).map_err(refuse),
    }
}

fn replace(target: &Path, bytes: &[u8], permissions: Permissions) -> std::io::Result<()> {
    let mut stage = stage_for(target, permissions)?;
    stage.write_all(bytes)?;
    put(stage, target)
}

/// Creates an empty temporary file in the directory of `target`.
fn stage_for(target: &Path, permissions: Permissions) -> std::io::Result<tempfile::NamedTempFile> {
    tempfile::Builder::new().prefix(".wavelume-").permissions(permissions).tempfile_in(directory_of(target))
}

/// Replaces `target` by the complete temporary file `stage`. The new file is on the disk when this returns.
fn put(stage: tempfile::NamedTempFile, target: &Path) -> std::io::Result<()> {
    stage.as_file().sync_all()?;
    stage.persist(target).map_err(|error| error.error)?;
    File::open(directory_of(target))?.sync_all()
}

fn directory_of(target: &Path) -> PathBuf {
    match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// A file that is written part by part. It replaces its target once it is complete, and otherwise changes nothing.
pub(crate) enum Staged {
    /// Temporary file in the directory of the target that it will replace.
    Beside { stage: tempfile::NamedTempFile, target: PathBuf },
    /// Device or pipe, which is written to directly instead of being replaced.
    Through(File),
}

impl Staged {
    /// Starts a file that will replace `path`.
    pub(crate) fn new(path: &Path) -> Result<Self, Failure> {
        let refuse = |error: std::io::Error| Failure::Failed(format!("cannot write: {}", describe(&error))).about(path);
        let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let permissions = match target.metadata() {
            Ok(metadata) if metadata.is_dir() => {
                return Err(Failure::failed("cannot write: is a directory, expected a file").about(path));
            }
            Ok(metadata) if !metadata.is_file() => {
                return File::options().write(true).open(&target).map(Self::Through).map_err(refuse);
            }
            Ok(metadata) => metadata.permissions(),
            Err(_) => Permissions::from_mode(0o666),
        };
        let stage = stage_for(&target, permissions).map_err(refuse)?;
        Ok(Self::Beside { stage, target })
    }

    /// Replaces the target file by the temporary file, which is complete. A device or pipe was written to directly and
    /// is left as it is.
    pub(crate) fn finish(self) -> std::io::Result<()> {
        match self {
            Self::Beside { stage, target } => put(stage, &target),
            Self::Through(_) => Ok(()),
        }
    }
}

impl Write for Staged {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match self {
            Self::Beside { stage, .. } => stage.write(bytes),
            Self::Through(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        match self {
            Self::Beside { stage, .. } => stage.flush(),
            Self::Through(file) => file.flush(),
        }
    }
}

/// Prints `text` on stdout.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|error| match error.kind() {
        ErrorKind::BrokenPipe => Failure::Closed,
        _ => Failure::Failed(format!("cannot write to stdout: {}", describe(&error))),
    })
}

/// Prints a one-line warning on stderr. A closed stderr is ignored.
pub(crate) fn warn(message: &str) {
    let _ = writeln!(std::io::stderr(), "wavelume: warning: {}", one_line(message));
}

/// Prints a one-line note on stderr. A closed stderr is ignored.
pub(crate) fn note(message: &str) {
    let _ = writeln!(std::io::stderr(), "wavelume: note: {}", one_line(message));
}

/// Prints a failure as one line on stderr, where a command goes on after it. A closed stderr is ignored.
pub(crate) fn complain(failure: &Failure) {
    let _ = writeln!(std::io::stderr(), "wavelume: {failure}");
}

/// Prints `value` as one line of JSON.
pub(crate) fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    let mut text = serde_json::to_string(value).map_err(Failure::failed)?;
    text.push('\n');
    print(&text)
}

/// Human-readable labelled lines: the labels in one column, the values in the next.
#[derive(Debug, Default)]
pub(crate) struct Sheet {
    lines: Vec<(String, String)>,
}

impl Sheet {
    /// Adds a line to the labelled lines that are printed: a label in the first column, a value in the second.
    pub(crate) fn line(&mut self, label: &str, value: impl std::fmt::Display) -> &mut Self {
        self.lines.push((label.to_owned(), value.to_string()));
        self
    }

    /// Renders all labelled lines as text for the terminal, indented below the line `heading`.
    pub(crate) fn render(&self, heading: &str) -> String {
        let width = self.lines.iter().map(|(label, _)| label.chars().count()).max().unwrap_or(0);
        let mut text = format!("{heading}\n");
        let mut previous = "";
        for (label, value) in &self.lines {
            let shown = if label == previous { "" } else { label };
            text.push_str(format!("  {shown:<width$}  {value}").trim_end());
            text.push('\n');
            previous = label;
        }
        text
    }
}

/// Human-readable table with a heading for each column; columns of numbers are right-aligned.
#[derive(Debug)]
pub(crate) struct Table {
    rows: Vec<Vec<String>>,
    right: Vec<bool>,
}

impl Table {
    /// Creates a table with these column headings; a leading `>` right-aligns a column and is not shown.
    pub(crate) fn new(headings: &[&str]) -> Self {
        let right = headings.iter().map(|heading| heading.starts_with('>')).collect();
        Self { rows: vec![headings.iter().map(|h| h.trim_start_matches('>').to_owned()).collect()], right }
    }

    /// Adds a row of cells, one under each column heading, to the text table.
    pub(crate) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// Renders the table as text.
    pub(crate) fn render(&self) -> String {
        let width = |column: usize| {
            self.rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.right.len()).map(width).collect();
        let mut text = String::new();
        for row in &self.rows {
            let cells = row.iter().zip(&widths).zip(&self.right).map(|((cell, &width), right)| {
                if *right { format!("{cell:>width$}") } else { format!("{cell:<width$}") }
            });
            text.push_str(cells.collect::<Vec<_>>().join("  ").trim_end());
            text.push('\n');
        }
        text
    }
}

/// Formats a count with commas between the thousands: `1,228,800`.
pub(crate) fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// Formats a number of things with their regular plural: `1 cell`, `1,234 cells`.
pub(crate) fn counted(n: u64, thing: &str) -> String {
    format!("{} {thing}{}", count(n), if n == 1 { "" } else { "s" })
}

/// Formats a ratio as per cent with three significant digits: `0.998 %`.
pub(crate) fn per_cent(fraction: f64) -> String {
    format!("{} %", three_digits(100.0 * fraction))
}

/// Formats a number with three significant digits, without an exponent where that is readable.
pub(crate) fn three_digits(value: f64) -> String {
    let size = value.abs();
    match size {
        0.0 => "0".to_owned(),
        _ if !(1e-4..1e6).contains(&size) => format!("{value:.2e}"),
        _ if size >= 100.0 => format!("{value:.0}"),
        _ if size >= 10.0 => format!("{value:.1}"),
        _ if size >= 1.0 => format!("{value:.2}"),
        _ => {
            let places = 2 - size.log10().floor() as i32;
            format!("{value:.*}", places.max(0) as usize)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_readable() {
        assert_eq!((count(0), count(999), count(1000)), ("0".into(), "999".into(), "1,000".into()));
        assert_eq!(count(1_228_800), "1,228,800");
        assert_eq!([0, 1, 1000].map(|n| counted(n, "cell")), ["0 cells", "1 cell", "1,000 cells"]);
        let shown = [0.0, 0.00998, 0.0123, 0.5, 3.0, 1234.5, 1e-9].map(three_digits);
        assert_eq!(shown, ["0", "0.00998", "0.0123", "0.500", "3.00", "1234", "1.00e-9"]);
        assert_eq!(per_cent(0.00998), "0.998 %");
    }

    #[test]
    fn files_are_replaced_whole_and_leave_nothing_behind() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.wlm");
        write_file(&path, b"old").unwrap();
        std::fs::set_permissions(&path, Permissions::from_mode(0o640)).unwrap();
        write_file(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o640);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn links_stay_links_and_devices_stay_devices() {
        let dir = tempfile::tempdir().unwrap();
        let (real, link) = (dir.path().join("real"), dir.path().join("link"));
        std::fs::write(&real, b"old").unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        write_file(&link, b"new").unwrap();
        assert!(link.symlink_metadata().unwrap().is_symlink());
        assert_eq!(std::fs::read(&real).unwrap(), b"new");
        write_file(Path::new("/dev/null"), b"gone").unwrap();
        assert!(!Path::new("/dev/null").metadata().unwrap().is_file());
    }

    #[test]
    fn places_that_cannot_be_written_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let refused = write_file(dir.path(), b"").unwrap_err().to_string();
        assert!(refused.ends_with("cannot write: is a directory, expected a file"), "{refused}");
        let refused = write_file(&dir.path().join("none/a.wlm"), b"").unwrap_err().to_string();
        assert!(refused.ends_with("none/a.wlm: cannot write: no such file or directory"), "{refused}");
    }

    #[test]
    fn tables_line_up() {
        let mut table = Table::new(&["name", ">bytes"]);
        table.row(["a".to_owned(), "1,000".to_owned()]);
        table.row(["lamp".to_owned(), "7".to_owned()]);
        assert_eq!(table.render(), "name  bytes\na     1,000\nlamp      7\n");
        let mut sheet = Sheet::default();
        sheet.line("unit", "1/sr").line("assumed", "x").line("assumed", "y");
        assert_eq!(sheet.render("a.wlm"), "a.wlm\n  unit     1/sr\n  assumed  x\n           y\n");
    }
}
