//! `wavelume compress`: a measurement → a material and its report.

use super::failure::Failure;
use super::guard::Outputs;
use super::input::MeasurementArgs;
use super::output::{print, print_json, warn, write_file};
use super::report::compressed_sheet;
use super::request::{RequestArgs, ThreadsArgs};
use crate::domain::Progress;
use crate::formats::NoteKind;
use crate::pipeline::{self, Report};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::Instant;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    measurement: MeasurementArgs,
    /// Material (compressed measurement) to write; an existing file is replaced as a whole
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
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
        Outputs::material(&self.output)
    }
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let request = args.request.request();
    let loaded = args.measurement.load(request.wavelengths.clone())?;
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
    let outcome = outcome.map_err(|error| Failure::from(error).about(&args.measurement.input))?;
    let seconds = start.elapsed().as_secs_f64();
    write_file(&args.output, &outcome.bytes)?;
    // A terminal shows the notes of the report; other outputs need the warnings on stderr.
    if args.json || !std::io::stdout().is_terminal() {
        for note in outcome.report.notes.iter().filter(|note| note.kind == NoteKind::Warning) {
            warn(&note.message);
        }
    }
    if args.json {
        return print_json(&Answer { report: &outcome.report, seconds });
    }
    let heading = format!("{} -> {}", args.measurement.input.display(), args.output.display());
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
