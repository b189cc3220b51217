//! `wavelume combine`: the weighted sum of materials, in the compressed domain where possible.

use super::failure::Failure;
use super::guard::Outputs;
use super::input::read_file;
use super::output::{Sheet, count, per_cent, print, print_json, three_digits, write_file};
use super::query::{self, List};
use super::report::{axes_lines, coefficient_line, error_lines, sample_lines};
use super::request::{SumArgs, ThreadsArgs};
use crate::algebra::{self, Combined, Method, Operand, OperandReport, Recompress};
use crate::compress::{Policy, Settings};
use crate::domain::{Axis, ErrorReport, Quantity, Silent, Unit};
use crate::pipeline::digest;
use serde::Serialize;
use serde_json::json;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "The sum is compressed anew where coefficients cannot be added, and always if a promise, --policy or --basis is stated"
)]
pub(crate) struct Args {
    /// Materials (compressed measurements) to add; all have the same quantity, unit and axes
    #[arg(value_name = "M.wlm", required = true)]
    materials: Vec<PathBuf>,
    /// Factor by which each material is multiplied before the materials are added [default: 1 each]
    #[arg(long, value_name = "W,...", value_parser = query::weights, allow_hyphen_values = true)]
    weights: Option<List<f64>>,
    /// File to write: the weighted sum of the given materials, as a material
    #[arg(short, long, value_name = "OUT.wlm")]
    output: PathBuf,
    #[command(flatten)]
    sum: SumArgs,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// Print the report as one line of JSON
    #[arg(long)]
    json: bool,
}

/// Report on a weighted sum of materials. `added` compares the stored sum with the exact sum of the decoded materials.
#[derive(Serialize)]
struct Answer<'a> {
    digest: String,
    quantity: Quantity,
    unit: Unit,
    axes: Vec<String>,
    policy: Policy,
    basis: &'a str,
    method: Method,
    reason: Option<&'a str>,
    operands: &'a [OperandReport],
    bytes: u64,
    kept_coefficients: Option<u64>,
    inherited_absolute_error: f64,
    #[serde(flatten)]
    added: &'a ErrorReport,
}

impl Args {
    pub(super) fn outputs(&self) -> Outputs {
        Outputs::material(&self.output)
    }
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let weights = match &args.weights {
        None => vec![1.0; args.materials.len()],
        Some(List(weights)) if weights.len() == args.materials.len() => weights.clone(),
        Some(List(weights)) => {
            let (found, expected) = (weights.len(), args.materials.len());
            return Err(Failure::Usage(format!("{found} weights for {expected} materials, expected one each")));
        }
    };
    let files = args.materials.iter().map(|path| read_file(path)).collect::<Result<Vec<_>, _>>()?;
    let operands: Vec<Operand<'_>> =
        files.iter().zip(weights).map(|(bytes, weight)| Operand { bytes, weight }).collect();
    let request = args.sum.request();
    let generator = json!({ "generator": concat!("wavelume ", env!("CARGO_PKG_VERSION")) });
    let settings = Settings { metadata: request.metadata.then(|| generator.to_string()), ..request.settings() };
    let recompress = if args.sum.is_stated() { Recompress::Always } else { Recompress::IfNeeded };
    let combined = args.threads.run(|| algebra::combine(&operands, &settings, recompress, &Silent))??;
    write_file(&args.output, &combined.compressed.bytes)?;
    let answer = Answer::of(&combined);
    if args.json { print_json(&answer) } else { print(&answer.sheet().render(&args.output.display().to_string())) }
}

impl<'a> Answer<'a> {
    fn of(combined: &'a Combined) -> Self {
        let summary = &combined.compressed.summary;
        Self {
            digest: digest(&combined.compressed.bytes),
            quantity: summary.quantity,
            unit: summary.unit,
            axes: summary.axes.iter().map(Axis::describe).collect(),
            policy: summary.policy,
            basis: &summary.basis,
            method: combined.method,
            reason: combined.reason.as_deref(),
            operands: &combined.operands,
            bytes: combined.compressed.bytes.len() as u64,
            kept_coefficients: summary.kept_coefficients,
            inherited_absolute_error: combined.inherited_absolute_error,
            added: combined.added(),
        }
    }

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
        for operand in self.operands {
            let text = format!(
                "{} × {} ({}, basis {}, er(L2) {})",
                operand.weight,
                operand.payload_digest,
                operand.policy,
                operand.basis,
                per_cent(operand.er_l2)
            );
            sheet.line("operand", text);
        }
        sheet.line("quantity", format!("{}, {}", self.quantity, self.unit));
        axes_lines(&mut sheet, &self.axes);
        sample_lines(&mut sheet, self.added);
        let method = match (self.method, self.reason) {
            (Method::Coefficients, _) => "coefficients added".to_owned(),
            (Method::Samples, reason) => format!("samples added and compressed again: {}", reason.unwrap_or_default()),
        };
        sheet.line("method", method);
        sheet.line("policy", format!("{}, basis {}", self.policy, self.basis));
        sheet.line("size", format!("{} bytes", count(self.bytes)));
        let ratio = self.kept_coefficients.map(|kept| self.added.samples as f64 / kept.max(1) as f64);
        coefficient_line(&mut sheet, self.kept_coefficients, ratio);
        error_lines(&mut sheet, "error added", self.added);
        let inherited =
            format!("at most {} off, by the operands' own errors", three_digits(self.inherited_absolute_error));
        sheet.line("error inherited", inherited);
        sheet.line("digest", &self.digest);
        sheet
    }
}
