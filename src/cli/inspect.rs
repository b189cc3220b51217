//! `wavelume inspect`: describes a measurement or material.

use super::contents::Contents;
use super::failure::Failure;
use super::input::{Loaded, MeasurementArgs};
use super::output::{Sheet, count, print, print_json, three_digits};
use super::report::{
    axes_lines, coefficient_line, coverage_lines, error_lines, labelled, level_lines, note_lines, sample_lines,
    stated_fit_lines,
};
use super::request::AxesArgs;
use crate::compress::{self, LevelInfo, Summary};
use crate::domain::{Axis, ErrorReport, Lobe, Quantity, Sampling, Unit};
use crate::formats::{self, Angles, AzimuthExtent, Instrument, Note, Samples};
use crate::pipeline::{self, Request};
use crate::projection::{self, Coverage};
use serde::Serialize;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    measurement: MeasurementArgs,
    #[command(flatten)]
    axes: AxesArgs,
    /// Print the description of the file as one line of JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
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

/// Description of a measurement, and of the tensor that `compress` would make of it.
#[derive(Serialize)]
struct Measured {
    kind: &'static str,
    content_digest: String,
    bytes: u64,
    format: String,
    dialect: String,
    quantity: Quantity,
    unit: Unit,
    sampling: Sampling,
    /// Axes on which the file states its values, described in words, outermost first.
    source_axes: Vec<String>,
    /// Axes of the tensor that would be compressed, described in words, outermost first.
    axes: Vec<String>,
    shape: Vec<usize>,
    samples: u64,
    masked_samples: u64,
    zero_samples: u64,
    negative_samples: u64,
    /// Smallest and largest value of the tensor that would be compressed.
    range: Option<(f32, f32)>,
    coverage: Coverage,
    /// Detector aperture and source divergence of the instrument in degrees, as far as the file states them.
    instrument: Instrument,
    notes: Vec<Note>,
    metadata: Vec<(String, String)>,
}

impl Measured {
    fn read(loaded: &Loaded, request: &Request) -> Result<Self, Failure> {
        let source = pipeline::read(&loaded.input())?;
        let acquisition = source.acquisition;
        let projected = pipeline::project(&acquisition, request)?;
        let remarks = projection::plausibility(&acquisition).remarks();
        let tensor = &projected.measurement.tensor;
        let on_grid = tensor.axes().iter().any(|axis| matches!(axis, Axis::Grid(_)));
        let axes: Vec<String> = tensor.axes().iter().map(Axis::describe).collect();
        let source_axes = match &acquisition.samples {
            // A list over the scattering angle.
            Samples::Function(_) if on_grid => axes.clone(),
            samples => measured_on(samples),
        };
        let number = |wanted: fn(&f32) -> bool| tensor.samples().iter().filter(|s| wanted(s)).count() as u64;
        let mut measured = Self {
            kind: "measurement",
            content_digest: source.content_digest,
            bytes: loaded.bytes().len() as u64,
            format: acquisition.format.to_owned(),
            quantity: projected.measurement.quantity,
            unit: projected.measurement.unit,
            sampling: projected.measurement.sampling,
            source_axes,
            axes,
            shape: tensor.shape(),
            samples: tensor.len() as u64,
            masked_samples: tensor.masked() as u64,
            zero_samples: number(|s| *s == 0.0),
            negative_samples: number(|s| *s < 0.0),
            range: tensor.range(),
            coverage: projected.coverage,
            instrument: acquisition.instrument,
            dialect: acquisition.dialect,
            notes: acquisition.report.notes_of(on_grid).cloned().collect(),
            metadata: acquisition.report.metadata,
        };
        // The tensor is no longer needed.
        let warning = pipeline::sparse_measurement(projected.measurement)?;
        measured.notes.extend(warning.into_iter().chain(remarks));
        Ok(measured)
    }

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
        sheet.line("format", labelled(&self.format, &self.dialect));
        sheet.line("quantity", format!("{}, {}", self.quantity, self.unit));
        if self.source_axes != self.axes {
            sheet.line("measured on", self.source_axes.join(" × "));
        }
        axes_lines(&mut sheet, &self.axes);
        sheet.line("sampling", self.sampling);
        let special = ErrorReport {
            samples: self.samples,
            masked_samples: self.masked_samples,
            zero_samples: self.zero_samples,
            negative_samples: self.negative_samples,
            ..ErrorReport::default()
        };
        sample_lines(&mut sheet, &special);
        if let Some((low, high)) = self.range {
            sheet.line("range", format!("{low} to {high}"));
        }
        for (name, angle) in self.instrument.stated() {
            sheet.line("instrument", format!("{name} {angle}°"));
        }
        coverage_lines(&mut sheet, &self.coverage);
        note_lines(&mut sheet, &self.notes);
        for (key, value) in &self.metadata {
            sheet.line("keyword", format!("{key}: {value}"));
        }
        sheet.line("size", format!("{} bytes", count(self.bytes)));
        sheet.line("digest", &self.content_digest);
        sheet
    }
}

/// Describes the axes that the samples of a file lie on.
fn measured_on(samples: &Samples) -> Vec<String> {
    match samples {
        Samples::OnAxes { tensor, .. } => tensor.axes().iter().map(Axis::describe).collect(),
        Samples::Grid(grid) => {
            let mut axes: Vec<String> = grid.index.iter().map(Axis::describe).collect();
            for (name, angles) in [("i", &grid.incoming), ("o", &grid.outgoing)] {
                if let Some(angles) = angles {
                    axes.extend(angle_axes(name, angles));
                }
            }
            axes.extend(grid.spectral.iter().map(Axis::describe));
            axes
        }
        Samples::Scattered(scattered) => {
            let directions = format!("{} scattered directions", scattered.directions());
            [directions].into_iter().chain(scattered.spectral.iter().map(Axis::describe)).collect()
        }
        Samples::Function(modelled) => {
            let mut axes = angle_axes("i", &modelled.incoming);
            // Two digits: the spacing is a mean.
            axes.push(format!("outgoing directions every {:.2} deg", modelled.outgoing_spacing));
            axes.extend(modelled.spectral.iter().map(Axis::describe));
            axes
        }
    }
}

fn angle_axes(name: &str, angles: &Angles) -> Vec<String> {
    let span = |values: &[f64]| match values {
        [] => String::new(),
        [only] => format!("{only}"),
        [first, .., last] => format!("{first}..{last}"),
    };
    let mut axes = vec![format!("theta_{name} {} deg ({})", span(&angles.theta), angles.theta.len())];
    if let Some(azimuths) = &angles.phi {
        let extent = match azimuths.extent {
            AzimuthExtent::Circle => "",
            AzimuthExtent::Mirrored => ", mirrored",
            AzimuthExtent::Sector => ", sector",
        };
        axes.push(format!("phi_{name} {} deg ({}{extent})", span(&azimuths.phi), azimuths.phi.len()));
    }
    axes
}

/// Description of a compressed file, from its header; samples are decoded only to find warnings.
#[derive(Serialize)]
struct Material {
    kind: &'static str,
    digest: String,
    payload_digest: String,
    bytes: u64,
    quantity: Quantity,
    unit: Unit,
    sampling: Sampling,
    axes: Vec<String>,
    shape: Vec<usize>,
    policy: compress::Policy,
    basis: String,
    kept_coefficients: Option<u64>,
    ratio_coefficients: Option<f64>,
    /// Quantiser step of the wavelet coefficients; `null` for coding policies other than `rd` (rate-distortion).
    step: Option<f64>,
    ratio_bytes: f64,
    floor: f64,
    /// Share (0 to 1) of linear interpolation between the directions of a grid of angles; the rest is cubic. `null` if
    /// the directions make no such grid.
    straight_lines: Option<f64>,
    /// Interpolation between incoming directions.
    between: compress::Between,
    /// Narrow reflection lobe that the file stores as a formula beside the samples; absent if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    lobe: Option<Lobe>,
    #[serde(flatten)]
    errors: ErrorReport,
    /// Coarser versions that can be decoded from the first bytes of the file, coarsest first; the last is the whole
    /// material.
    levels: Vec<LevelInfo>,
    /// Warnings about the material: that its incoming directions are too sparse to interpolate a lobe, and those that
    /// the metadata of the file states.
    warnings: Vec<String>,
    /// Provenance from the metadata of the file; `null` if there is none.
    provenance: Option<serde_json::Value>,
}

/// Describes in words the interpolation between the directions of a grid of angles. `straight_lines` is the share of
/// linear interpolation, from 0 to 1.
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
        let summary: Summary = compress::inspect(bytes)?;
        let shape: Vec<usize> = summary.axes.iter().map(Axis::len).collect();
        let samples = shape.iter().product::<usize>() as f64;
        // A metadata chunk that is not JSON is shown as text.
        let provenance =
            summary.metadata.map(|text| serde_json::from_str(&text).unwrap_or(serde_json::Value::String(text)));
        let stated = provenance.as_ref().and_then(|provenance| provenance["warnings"].as_array());
        let stated = stated.into_iter().flatten().filter_map(|warning| Some(warning.as_str()?.to_owned()));
        Ok(Self {
            kind: "material",
            digest: pipeline::digest(bytes),
            payload_digest: format!("b3-{}", compress::payload_digest(bytes)?.to_hex()),
            bytes: bytes.len() as u64,
            quantity: summary.quantity,
            unit: summary.unit,
            sampling: summary.sampling,
            axes: summary.axes.iter().map(Axis::describe).collect(),
            shape,
            policy: summary.policy,
            basis: summary.basis,
            kept_coefficients: summary.kept_coefficients,
            ratio_coefficients: summary.kept_coefficients.map(|kept| samples / kept.max(1) as f64),
            step: summary.step,
            ratio_bytes: 4.0 * samples / bytes.len() as f64,
            floor: summary.floor,
            straight_lines: summary.straight_lines,
            between: summary.between,
            lobe: summary.lobe,
            errors: summary.errors,
            levels: compress::levels(bytes)?,
            warnings: pipeline::sparse(bytes)?.map(|warning| warning.message).into_iter().chain(stated).collect(),
            provenance,
        })
    }

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
        sheet.line("format", "wavelume material");
        sheet.line("quantity", format!("{}, {}", self.quantity, self.unit));
        axes_lines(&mut sheet, &self.axes);
        sheet.line("sampling", self.sampling);
        sample_lines(&mut sheet, &self.errors);
        sheet.line("policy", format!("{}, basis {}", self.policy, self.basis));
        let ratio = three_digits(self.ratio_bytes);
        sheet.line("size", format!("{} bytes, {ratio} : 1 of the float32 tensor", count(self.bytes)));
        coefficient_line(&mut sheet, self.kept_coefficients, self.ratio_coefficients);
        if self.floor > 0.0 {
            sheet.line("floor", self.floor);
        }
        if let Some(share) = self.straight_lines {
            sheet.line("interpolation", interpolation(share));
        }
        if !self.between.is_default() {
            sheet.line("between incidences", self.between);
        }
        if let Some(lobe) = &self.lobe {
            sheet.line("lobe beside cells", lobe);
        }
        error_lines(
            &mut sheet,
            if self.sampling == Sampling::Average { "error of the cells" } else { "error" },
            &self.errors,
        );
        level_lines(&mut sheet, &self.levels);
        for warning in &self.warnings {
            sheet.line("warning", warning);
        }
        self.source_lines(&mut sheet);
        sheet.line("digest", &self.digest);
        sheet.line("payload digest", &self.payload_digest);
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
        if let Ok(fit) = serde_json::from_value(provenance["scattered"].clone()) {
            stated_fit_lines(sheet, &fit);
        }
        let source = &provenance["source"];
        if let (Some(format), Some(dialect)) = (source["format"].as_str(), source["dialect"].as_str()) {
            sheet.line("made from", labelled(format, dialect));
        }
        for (label, value) in [
            ("source digest", &source["content_digest"]),
            ("spectrum digest", &source["spectrum_digest"]),
            ("generator", &provenance["generator"]),
        ] {
            if let Some(text) = value.as_str() {
                sheet.line(label, text);
            }
        }
    }
}
