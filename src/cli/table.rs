//! Answers row by row as CSV, a `NumPy` array or bare float32, into a file or on stdout.

use super::failure::Failure;
use super::input::describe;
use super::output::Staged;
use crate::formats::npy_header;
use std::fmt::Write as _;
use std::io::{BufWriter, ErrorKind, Seek, SeekFrom, Stdout, Write};
use std::path::{Path, PathBuf};

/// File formats of a table of computed values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum TableFormat {
    /// Text: a line of column names, then one line of numbers for each query; unknown values are nan. The last column,
    /// extrapolated, is 1 where a direction lies beyond the measured angles, else 0.
    Csv,
    /// NumPy array of float32 with one row for each query; unknown values are NaN.
    Npy,
    /// Little-endian float32 numbers, one query after the other, without a header; unknown values are NaN.
    F32,
}

impl TableFormat {
    /// Returns the format that the user states, or the one of the extension of the file `output`.
    pub(crate) fn of(output: Option<&Path>, stated: Option<Self>) -> Self {
        let has = |wanted: &str| {
            output.and_then(Path::extension).is_some_and(|extension| extension.eq_ignore_ascii_case(wanted))
        };
        match stated {
            Some(stated) => stated,
            None if has("npy") => Self::Npy,
            None if has("f32") => Self::F32,
            None => Self::Csv,
        }
    }
}

/// Table of computed values that is being written to a file or to standard output.
pub(crate) struct Table {
    sink: Sink,
    path: PathBuf,
    format: TableFormat,
    width: usize,
    rows: usize,
    /// Bytes that the output file starts with, before its first row (column names or array header); `None` once they
    /// are written.
    head: Option<Vec<u8>>,
    text: String,
}

enum Sink {
    Stdout(BufWriter<Stdout>),
    File(BufWriter<Staged>),
}

impl Table {
    /// Starts a table with the columns `names` in the file `output`, or on stdout. Without a format, the extension of
    /// the file decides. A CSV has a further column, `flag`.
    pub(crate) fn new(
        output: Option<&Path>,
        format: Option<TableFormat>,
        names: &[String],
        flag: &str,
    ) -> Result<Self, Failure> {
        let format = TableFormat::of(output, format);
        let sink = match output {
            None if format == TableFormat::Npy => {
                return Err(Failure::usage(
                    "an array needs --output: its header, which is written last, says how many rows it has",
                ));
            }
            None => Sink::Stdout(BufWriter::new(std::io::stdout())),
            Some(path) => {
                let staged = Staged::new(path)?;
                if format == TableFormat::Npy && matches!(staged, Staged::Through(_)) {
                    return Err(
                        Failure::usage("an array must be written to a file, this is a device or a pipe").about(path)
                    );
                }
                Sink::File(BufWriter::new(staged))
            }
        };
        let path = output.unwrap_or(Path::new("stdout")).to_owned();
        let head = match format {
            TableFormat::Csv => format!("{},{flag}\n", names.join(",")).into_bytes(),
            TableFormat::Npy => npy_header(&[0, names.len()]),
            TableFormat::F32 => Vec::new(),
        };
        Ok(Self { sink, path, format, width: names.len(), rows: 0, head: Some(head), text: String::new() })
    }

    /// Returns true if the format has a column for flags.
    pub(crate) fn has_flags(&self) -> bool {
        self.format == TableFormat::Csv
    }

    /// Appends rows to the table; `values` holds one row after the other, `flags` one flag for each row.
    pub(crate) fn write(&mut self, values: &[f32], flags: &[bool]) -> Result<(), Failure> {
        // The header is written with the first row: an early failure leaves stdout empty.
        if let Some(head) = self.head.take() {
            self.put(&head)?;
        }
        self.rows += values.len() / self.width.max(1);
        if self.format != TableFormat::Csv {
            let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
            return self.put(&bytes);
        }
        let mut text = std::mem::take(&mut self.text);
        text.clear();
        for (row, flag) in values.chunks_exact(self.width.max(1)).zip(flags) {
            for value in row {
                let _ = if value.is_nan() { write!(text, "nan,") } else { write!(text, "{value},") };
            }
            let _ = writeln!(text, "{}", u8::from(*flag));
        }
        let done = self.put(text.as_bytes());
        self.text = text;
        done
    }

    fn put(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        let done = match &mut self.sink {
            Sink::Stdout(out) => out.write_all(bytes),
            Sink::File(file) => file.write_all(bytes),
        };
        done.map_err(|error| failed(&self.path, &error))
    }

    /// Completes a table of computed values. If it goes to a file, an earlier file of that name is replaced only by
    /// this call.
    pub(crate) fn finish(mut self) -> Result<(), Failure> {
        self.write(&[], &[])?;
        let Self { sink, path, format, width, rows, .. } = self;
        let ended = match sink {
            Sink::Stdout(mut out) => out.flush(),
            Sink::File(file) => {
                file.into_inner().map_err(std::io::IntoInnerError::into_error).and_then(|mut staged| {
                    if let (TableFormat::Npy, Staged::Beside { stage, .. }) = (format, &mut staged) {
                        stage.as_file_mut().seek(SeekFrom::Start(0))?;
                        stage.write_all(&npy_header(&[rows, width]))?;
                    }
                    staged.finish()
                })
            }
        };
        ended.map_err(|error| failed(&path, &error))
    }
}

fn failed(path: &Path, error: &std::io::Error) -> Failure {
    match error.kind() {
        ErrorKind::BrokenPipe => Failure::Closed,
        _ => Failure::failed(format!("cannot write: {}", describe(error))).about(path),
    }
}
