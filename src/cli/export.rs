//! `wavelume export`: a material in an exchange format.

use super::declared::{all_stated, argument, declared_args, refusal};
use super::failure::Failure;
use super::guard::{Outputs, manifest_of_array};
use super::opened::Opened;
use super::output::{Sheet, count, counted, per_cent, print, print_json, warn, write_file};
use super::request::ThreadsArgs;
use crate::compress::{self, Decoded};
use crate::domain::{Axis, Declared};
use crate::evaluate::Material;
use crate::export::{self, ExportFormat, ExportOptions, Exported, Summary};
use crate::formats::manifest_of;
use crate::pipeline::{OnGrid, export_on_grid};
use clap::{ArgMatches, Command};
use serde::Serialize;
use serde_json::{Value, json};
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Material (compressed measurement) to export, or a measurement, which is compressed in memory
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    #[arg(long, value_parser = format, help = export::format_help())]
    format: ExportFormat,
    /// File to write; an existing one is replaced as a whole
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    #[command(flatten)]
    options: OptionArgs,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// Print a report on the written file as one line of JSON
    #[arg(long)]
    json: bool,
}

/// JSON report on an exported file: what was written, and the error that the export adds.
#[derive(Serialize)]
struct Answer<'a> {
    #[serde(flatten)]
    answer: Value,
    #[serde(flatten)]
    summary: &'a Summary,
}

/// Command-line options of an export, derived from their shared declarations.
#[derive(Clone, Debug)]
struct OptionArgs(ExportOptions);

declared_args!(OptionArgs);

impl OptionArgs {
    fn arguments(command: Command) -> Command {
        let option = |declared: &'static Declared| {
            argument(declared).help(export::option_help(declared).trim_end_matches('.').to_owned())
        };
        command.args(ExportOptions::OPTIONS.iter().map(option))
    }

    fn read(matches: &ArgMatches) -> Result<Self, clap::Error> {
        ExportOptions::read(all_stated(matches, ExportOptions::OPTIONS)).map(Self).map_err(refusal)
    }
}

fn format(name: &str) -> Result<ExportFormat, String> {
    ExportFormat::of_name(name).map_err(|error| error.to_string())
}

impl Args {
    pub(super) fn outputs(&self) -> Outputs {
        if self.format.takes_samples() {
            return Outputs::array(&self.output);
        }
        // Any text may be named .txt.
        let suffixes = vec![self.format.extension(), "txt"];
        Outputs { kind: self.format.name(), suffixes, paths: vec![self.output.clone()] }
    }
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let options = &args.options.0;
    let about = |failure: Failure| failure.about(&args.material);
    let mut answer = json!({ "output": args.output.display().to_string() });
    let mut beside = None;
    let Opened { bytes, made } = args.threads.run(|| Opened::read(&args.material))??;
    if let Some(made) = made {
        answer["compressed_in_memory"] = json!(made);
    }
    let Exported { bytes, about: summary } = if args.format.takes_samples() {
        let decoded = args.threads.run(|| compress::decode(&bytes).and_then(Decoded::whole))?;
        let measurement = decoded.map_err(|error| about(error.into()))?;
        let exported = export::samples(&measurement, args.format, options).map_err(|error| about(error.into()))?;
        let axes = measurement.tensor.axes();
        answer["quantity"] = json!(measurement.quantity);
        answer["shape"] = json!(measurement.tensor.shape());
        answer["axes"] = axes.iter().map(Axis::describe).collect();
        answer["samples"] = json!(measurement.tensor.len());
        answer["masked_samples"] = json!(measurement.tensor.masked());
        beside = Some((manifest_of_array(&args.output), manifest_of(&measurement)));
        exported
    } else {
        let work = || {
            let reason = match export_on_grid(&bytes, args.format, options).map_err(Failure::from)? {
                OnGrid::File(file) => return Ok(*file),
                OnGrid::Resample(reason) => reason,
            };
            let material = Material::open(&bytes).map_err(Failure::from)?;
            let mut file = export::export(&material, args.format, options).map_err(Failure::from)?;
            file.about.lost.extend(reason);
            Ok(file)
        };
        args.threads.run(work)?.map_err(about)?
    };
    write_file(&args.output, &bytes)?;
    if let Some((path, manifest)) = &beside {
        write_file(path, format!("{manifest}\n").as_bytes())?;
        answer["manifest"] = json!(path.display().to_string());
    }
    if args.json {
        if let Some(warning) = &summary.warning {
            warn(warning);
        }
        answer["bytes"] = json!(bytes.len());
        return print_json(&Answer { answer, summary: &summary });
    }
    let mut sheet = sheet(&summary, bytes.len());
    if let Some((path, _)) = beside {
        sheet.line("manifest", path.display());
    }
    print(&sheet.render(&args.output.display().to_string()))
}

fn sheet(summary: &Summary, bytes: usize) -> Sheet {
    let mut sheet = Sheet::default();
    if let Some(warning) = &summary.warning {
        sheet.line("warning", warning);
    }
    sheet.line("format", summary.format);
    sheet.line("resolution", &summary.resolution);
    sheet.line("unit", &summary.unit);
    sheet.line("bytes", count(bytes as u64));
    for lost in &summary.lost {
        sheet.line("lost", lost);
    }
    if summary.filled > 0 {
        sheet.line("filled", format!("{} masked numbers are 0", count(summary.filled as u64)));
    }
    if summary.clipped > 0 {
        sheet.line("clipped", format!("{} negative numbers are 0", count(summary.clipped as u64)));
    }
    let error = &summary.error;
    sheet.line(
        "error added",
        format!(
            "er(L2) {}, er(L1) {}, at most {}; relative RMS {}",
            per_cent(error.er_l2),
            per_cent(error.er_l1),
            per_cent(error.max_relative_error),
            per_cent(error.relative_rmse)
        ),
    );
    if error.mask_mismatches > 0 {
        sheet.line(
            "error added",
            format!(
                "{} with a value in only one of the two, file and material",
                counted(error.mask_mismatches, "sample")
            ),
        );
    }
    let places = if error.pairs == export::PAIRS { "pairs of directions" } else { "places" };
    sheet.line("compared", format!("{} at {} {places}", error.compared, count(error.pairs as u64)));
    match (&summary.lamp, summary.flux_error) {
        (Some(lamp), _) => {
            let (peak, flux, rms) = (deviation(lamp.peak), deviation(lamp.flux), 100.0 * lamp.rms_of_peak);
            let bright = per_cent(lamp.er_l2_bright);
            let text =
                format!("peak {peak}, flux {flux}, rms {rms:.3} % of the peak, er(L2) {bright} above 1 % of the peak");
            sheet.line("luminaire", text);
        }
        (None, Some(flux)) => {
            sheet.line("flux", format!("{} of the material's", deviation(flux)));
        }
        (None, None) => {}
    }
    sheet
}

/// Formats a relative difference in signed per cent with three decimals; a rounded zero has no minus sign.
fn deviation(relative: f64) -> String {
    // Adding 0 turns a negative zero into 0.
    format!("{:+.3} %", (1e5 * relative).round() / 1e3 + 0.0)
}
