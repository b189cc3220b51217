//! `wavelume compress`: a measurement → a material and its report.

use super::declared::as_typed;
use super::destination::{destinations, make_directory};
use super::failure::Failure;
use super::guard::Outputs;
use super::input::Loaded;
use super::output::{complain, print, print_json, warn, write_file};
use super::reading::ReadingArgs;
use super::report::compressed_sheet;
use super::request::{RequestArgs, ThreadsArgs};
use crate::domain::Progress;
use crate::formats::NoteKind;
use crate::pipeline::{self, Report};
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Input files in any format that `wavelume formats` lists; the content decides the format, not the name; - is
    /// stdin
    #[arg(value_name = "IN", required = true)]
    inputs: Vec<PathBuf>,
    #[command(flatten)]
    reading: ReadingArgs,
    /// Material (compressed measurement) to write, or a directory for NAME.wlm of each input file; an existing file is
    /// replaced as a whole [default: NAME.wlm beside each input file]
    #[arg(short, long, value_name = "OUT.wlm|DIR/")]
    output: Option<PathBuf>,
    #[command(flatten)]
    request: RequestArgs,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// Print the report as one line of JSON
    #[arg(long)]
    json: bool,
}

/// JSON report on a compression: sizes and errors as the library reports them, and the elapsed time.
#[derive(serde::Serialize)]
struct Answer<'a> {
    #[serde(flatten)]
    report: &'a Report,
    seconds: f64,
}

impl Args {
    pub(super) fn outputs(&self) -> Outputs {
        // Two inputs with one destination are refused by the command itself.
        let paths = destinations(&self.inputs, self.output.as_deref()).unwrap_or_default();
        Outputs { paths, ..Outputs::material(Path::new("")) }
    }
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let outputs = destinations(&args.inputs, args.output.as_deref())?;
    make_directory(args.output.as_deref())?;
    if let ([input], [output]) = (&args.inputs[..], &outputs[..]) {
        return one(args, input, output);
    }
    // A file at fault does not keep the others from being compressed.
    let mut failed = 0;
    for (input, output) in args.inputs.iter().zip(&outputs) {
        match one(args, input, output) {
            Ok(()) => {}
            Err(Failure::Closed) => return Err(Failure::Closed),
            Err(failure) => {
                complain(&failure);
                failed += 1;
            }
        }
    }
    match failed {
        0 => Ok(()),
        n => Err(Failure::failed(format!("{n} of {} files were not compressed", outputs.len()))),
    }
}

/// Compresses one measurement file to a material and reports on it.
fn one(args: &Args, input: &Path, output: &Path) -> Result<(), Failure> {
    let request = args.request.request();
    let loaded = Loaded::of(input, &args.reading, request.wavelengths.clone())?;
    let file_bytes = loaded.bytes().len() as u64;
    let start = Instant::now();
    let bar = Bar::new();
    let outcome = args.threads.run(|| {
        let source = pipeline::read(&loaded.input())?;
        // The file's bytes are not needed any more, and may be as large as the tensor.
        drop(loaded);
        pipeline::compress(&source, &request, &bar)
    })?;
    bar.finish();
    let outcome = outcome.map_err(|error| Failure::from(error).about(input))?;
    let seconds = start.elapsed().as_secs_f64();
    write_file(output, &outcome.bytes)?;
    // The report in words has them already.
    if args.json {
        for note in outcome.report.notes.iter().filter(|note| note.kind == NoteKind::Warning) {
            warn(&as_typed(&note.message));
        }
    }
    if args.json {
        return print_json(&Answer { report: &outcome.report, seconds });
    }
    let heading = format!("{} -> {}", input.display(), output.display());
    let mut sheet = compressed_sheet(&outcome.report, file_bytes);
    sheet.line("seconds", format!("{seconds:.2}"));
    print(&sheet.render(&heading))
}

/// Progress bar, shown on a terminal and hidden elsewhere.
struct Bar(ProgressBar);

/// Number of steps of the progress bar. Raising it moves the bar more smoothly.
const STEPS: u64 = 1000;

impl Bar {
    fn new() -> Self {
        let bar = ProgressBar::new(STEPS);
        if let Ok(style) = ProgressStyle::with_template("{bar:40} {percent:>3} %  {elapsed}") {
            bar.set_style(style);
        }
        Self(bar)
    }

    fn finish(&self) {
        self.0.finish_and_clear();
    }
}

impl Progress for Bar {
    fn report(&self, fraction: f64) {
        self.0.set_position((fraction.clamp(0.0, 1.0) * STEPS as f64) as u64);
    }
}
