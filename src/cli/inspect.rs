//! `wavelume inspect`: describes a measurement or material.

use super::contents::Contents;
use super::failure::Failure;
use super::input::{Loaded, MeasurementArgs};
use super::output::{Sheet, count, print, print_json, three_digits};
use super::report::{
    axes_lines, coefficient_line, coverage_lines, error_lines, labelled, level_lines, note_lines, sample_lines,
    stated_fit_lines,
};
use super::request::{AxesArgs, ThreadsArgs};
use crate::compress;
use crate::domain::{Axis, ErrorReport, Lobe, Measurement, Quantity, Sampling, Unit};
use crate::formats;
use crate::jobs::{AxisKind, Options, Understood, describe};
use crate::pipeline::{self, Product, Report, Request, Stated, StatedOrigin};
use crate::projection::Coverage;
use serde::Serialize;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    measurement: MeasurementArgs,
    #[command(flatten)]
    axes: AxesArgs,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// Print the description of the file as one line of JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    args.threads.run(|| answer(args))?
}

fn answer(args: &Args) -> Result<(), Failure> {
    let request = args.axes.request();
    let loaded = args.measurement.load(request.wavelengths.clone())?;
    let about = |failure: Failure| failure.about(&args.measurement.input);
    let name = args.measurement.input.display().to_string();
    if compress::is_material(loaded.bytes()) {
        let material = Material::read(loaded.bytes()).map_err(about)?;
        return if args.json { print_json(&material) } else { print(&material.sheet().render(&name)) };
    }
    if args.measurement.names_no_member() && formats::is_archive(loaded.bytes()) {
        let archive = Contents::read(&loaded).map_err(about)?;
        return if args.json { print_json(&archive) } else { print(&archive.render(&name)) };
    }
    let measurement = Measured::read(&loaded, &request).map_err(about)?;
    if args.json { print_json(&measurement) } else { print(&measurement.sheet().render(&name)) }
}

/// Description of a measurement file, with the field names that an upload over HTTP returns, and of the tensor that
/// `compress` would make of it.
#[derive(Serialize)]
struct Measured {
    kind: &'static str,
    content_digest: String,
    bytes: u64,
    #[serde(flatten)]
    understood: Understood,
    tensor: Prepared,
}

/// Description of the tensor that `compress` would make of a measurement file.
#[derive(Serialize)]
struct Prepared {
    quantity: Quantity,
    unit: Unit,
    sampling: Sampling,
    /// Axes of the tensor described in words, outermost first.
    axes: Vec<String>,
    shape: Vec<usize>,
    samples: u64,
    masked_samples: u64,
    zero_samples: u64,
    negative_samples: u64,
    /// Smallest and largest value of the tensor.
    range: Option<(f32, f32)>,
    coverage: Coverage,
    /// True if the tensor keeps the measured grid of angles as its axes.
    #[serde(skip)]
    on_grid: bool,
}

impl Prepared {
    fn of(measurement: &Measurement, coverage: Coverage) -> Self {
        let tensor = &measurement.tensor;
        let number = |wanted: fn(&f32) -> bool| tensor.samples().iter().filter(|s| wanted(s)).count() as u64;
        Self {
            quantity: measurement.quantity,
            unit: measurement.unit,
            sampling: measurement.sampling,
            axes: tensor.axes().iter().map(Axis::describe).collect(),
            shape: tensor.shape(),
            samples: tensor.len() as u64,
            masked_samples: tensor.masked() as u64,
            zero_samples: number(|s| *s == 0.0),
            negative_samples: number(|s| *s < 0.0),
            range: tensor.range(),
            coverage,
            on_grid: tensor.axes().iter().any(|axis| matches!(axis, Axis::Grid(_))),
        }
    }
}

impl Measured {
    fn read(loaded: &Loaded, request: &Request) -> Result<Self, Failure> {
        let source = pipeline::read(&loaded.input())?;
        let mut options = Options::from(loaded.interpretation().clone());
        options.spectrum = source.spectrum_digest.as_deref().map(str::parse).transpose().map_err(Failure::failed)?;
        let acquisition = source.acquisition;
        let mut understood = describe(&acquisition, &options);
        let projected = pipeline::project(&acquisition, request)?;
        let tensor = Prepared::of(&projected.measurement, projected.coverage);
        // Notes of the reader that do not hold on these axes make way for the warning about them.
        let notes = acquisition.report.notes_of(tensor.on_grid).cloned();
        let warning = pipeline::sparse_measurement(projected.measurement)?;
        understood.warnings.splice(..acquisition.report.notes.len(), notes.chain(warning));
        let bytes = loaded.bytes().len() as u64;
        Ok(Self { kind: "measurement", content_digest: source.content_digest, bytes, understood, tensor })
    }

    /// Returns the axes of the measurement file in words; `None` if they are those of the tensor.
    fn source_axes(&self) -> Option<String> {
        let (axes, tensor) = (&self.understood.axes, &self.tensor);
        // A list over the scattering angle keeps its angles.
        let is_list = tensor.on_grid && axes.iter().any(|axis| axis.kind == AxisKind::Outgoing);
        let words: Vec<&str> = axes.iter().map(|axis| axis.description.as_str()).collect();
        (!is_list && words != tensor.axes).then(|| words.join(" × "))
    }

    fn sheet(&self) -> Sheet {
        let Self { understood, tensor, .. } = self;
        let mut sheet = Sheet::default();
        sheet.line("format", labelled(&understood.format, understood.dialect.as_deref().unwrap_or_default()));
        sheet.line("quantity", format!("{}, {}", tensor.quantity, tensor.unit));
        if let Some(axes) = self.source_axes() {
            sheet.line("measured on", axes);
        }
        axes_lines(&mut sheet, &tensor.axes);
        sheet.line("sampling", tensor.sampling);
        let special = ErrorReport {
            samples: tensor.samples,
            masked_samples: tensor.masked_samples,
            zero_samples: tensor.zero_samples,
            negative_samples: tensor.negative_samples,
            ..ErrorReport::default()
        };
        sample_lines(&mut sheet, &special);
        if let Some((low, high)) = tensor.range {
            sheet.line("range", format!("{low} to {high}"));
        }
        for (name, angle) in understood.instrument.stated() {
            sheet.line("instrument", format!("{name} {angle}°"));
        }
        coverage_lines(&mut sheet, &tensor.coverage);
        note_lines(&mut sheet, &understood.warnings);
        for field in &understood.fields {
            sheet.line("keyword", format!("{}: {}", field.name, field.value));
        }
        sheet.line("size", format!("{} bytes", count(self.bytes)));
        sheet.line("digest", &self.content_digest);
        sheet
    }
}

/// Description of a compressed file, with the field names of the report of its compression, and further facts of its
/// header. Samples are decoded only to find warnings.
#[derive(Serialize)]
struct Material {
    kind: &'static str,
    #[serde(flatten)]
    report: Report,
    sampling: Sampling,
    shape: Vec<usize>,
    floor: f64,
    /// Share (0 to 1) of linear interpolation between the directions of a grid of angles; the rest is cubic. `null` if
    /// the directions make no such grid.
    straight_lines: Option<f64>,
    /// Interpolation between incoming directions.
    between: compress::Between,
    /// Narrow reflection lobe that the file stores as a formula beside the samples; absent if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    analytic_lobe: Option<Lobe>,
    /// Facts about the lamp or sample that the source file stated.
    product: Product,
    /// Provenance from the metadata of the file; `null` if there is none.
    provenance: Option<serde_json::Value>,
    #[serde(skip)]
    origin: StatedOrigin,
}

/// Describes in words the interpolation between the directions of a grid of angles. `straight_lines` is the weight of
/// linear interpolation, from 0 to 1; the rest is cubic.
fn interpolation(straight_lines: f64) -> String {
    match straight_lines {
        0.0 => "cubics of logarithms".to_owned(),
        1.0 => "straight lines".to_owned(),
        share => format!(
            "cubics of logarithms with {} % of straight lines, which keep the flux",
            three_digits(100.0 * share)
        ),
    }
}

impl Material {
    fn read(bytes: &[u8]) -> Result<Self, Failure> {
        let Stated { mut report, origin, summary } = pipeline::stated_in_header(bytes)?;
        report.notes.splice(..0, pipeline::sparse(bytes)?);
        let provenance = summary.metadata.as_deref().map(serde_json::from_str).transpose().map_err(Failure::failed)?;
        Ok(Self {
            kind: "material",
            report,
            sampling: summary.sampling,
            shape: summary.axes.iter().map(Axis::len).collect(),
            floor: summary.floor,
            straight_lines: summary.straight_lines,
            between: summary.between,
            analytic_lobe: summary.lobe,
            product: Product::of(summary.metadata.as_deref()),
            provenance,
            origin,
        })
    }

    fn sheet(&self) -> Sheet {
        let report = &self.report;
        let mut sheet = Sheet::default();
        sheet.line("format", "wavelume material");
        sheet.line("quantity", format!("{}, {}", report.quantity, report.unit));
        axes_lines(&mut sheet, &report.axes);
        sheet.line("sampling", self.sampling);
        sample_lines(&mut sheet, &report.errors);
        sheet.line("policy", format!("{}, basis {}", report.policy, report.basis));
        let ratio = three_digits(report.ratio_bytes);
        sheet.line("size", format!("{} bytes, {ratio} : 1 of the float32 tensor", count(report.bytes)));
        coefficient_line(&mut sheet, report.kept_coefficients, report.ratio_coefficients);
        if self.floor > 0.0 {
            sheet.line("floor", self.floor);
        }
        if let Some(share) = self.straight_lines {
            sheet.line("interpolation", interpolation(share));
        }
        if !self.between.is_default() {
            sheet.line("between incidences", self.between);
        }
        if let Some(lobe) = &self.analytic_lobe {
            sheet.line("lobe beside cells", lobe);
        }
        let label = if self.sampling == Sampling::Average { "error of the cells" } else { "error" };
        error_lines(&mut sheet, label, &report.errors);
        level_lines(&mut sheet, &report.levels);
        note_lines(&mut sheet, &report.notes);
        self.source_lines(&mut sheet);
        sheet.line("digest", &report.digest);
        sheet.line("payload digest", &report.payload_digest);
        sheet
    }

    fn source_lines(&self, sheet: &mut Sheet) {
        let Some(provenance) = &self.provenance else {
            sheet.line("provenance", "none in the file");
            return;
        };
        if let (Some(cells), Some(of)) = (provenance["filled"]["cells"].as_u64(), provenance["filled"]["of"].as_u64()) {
            sheet.line("filled", format!("{} of {} cells, not measured", count(cells), count(of)));
        }
        if let Some(fit) = &self.report.fit {
            stated_fit_lines(sheet, fit);
        }
        for (label, text) in self.product.lines() {
            sheet.line(label, text);
        }
        if !self.report.format.is_empty() {
            sheet.line("made from", labelled(&self.report.format, &self.report.dialect));
        }
        for (label, stated) in [
            ("source digest", &self.origin.content_digest),
            ("spectrum digest", &self.origin.spectrum_digest),
            ("generator", &self.origin.generator),
        ] {
            if let Some(text) = stated {
                sheet.line(label, text);
            }
        }
    }
}
