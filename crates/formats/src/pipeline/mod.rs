//! What a user asks for, whole: bytes of a measurement and a request in, a compressed material with its report out.

use crate::compress::{self, CompressError, LevelInfo, LightReport, Noise, Policy, Ranked, Settings, Target};
use crate::domain::colour::ColourReport;
use crate::domain::{Axis, ErrorReport, Measurement, Progress, Quantity, Unit, WavelengthError, WavelengthGrid};
use crate::evaluate::{EvaluateError, Material};
use crate::formats::{self, Acquisition, FormatError, Interpretation, Note, NoteKind};
use crate::projection::{self, AxesRequest, Coverage, Projected, ProjectionError};
use serde::{Deserialize, Serialize};

/// The bytes of a measurement and what the user says about them.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// The file.
    pub bytes: &'a [u8],
    /// A spectrum to join with a luminaire.
    pub spectrum: Option<&'a [u8]>,
    /// What the user says about the file.
    pub interpretation: &'a Interpretation,
}

/// How to compress, in the command line's names; everything but `target` has a default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// The promise.
    pub target: Target,
    /// The policy.
    #[serde(default)]
    pub policy: Policy,
    /// The spectral basis, or `auto`.
    #[serde(default = "auto")]
    pub basis: String,
    /// Relative floor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor: Option<f64>,
    /// The largest relative error of the light of any direction and wavelength.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub albedo_error: Option<f64>,
    /// Subdivision level of the incoming triangles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub incoming_level: Option<u8>,
    /// Subdivision level of the outgoing triangles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outgoing_level: Option<u8>,
    /// `START:STOP:STEP` in nm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wavelengths: Option<String>,
    /// Whether the file carries its provenance.
    #[serde(default = "yes")]
    pub metadata: bool,
    /// Whether one incoming direction is decoded without the others.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub random_access: bool,
}

fn auto() -> String {
    "auto".to_owned()
}

fn yes() -> bool {
    true
}

impl Request {
    /// A request with defaults for everything but the promise.
    pub fn to(target: Target) -> Self {
        Self {
            target,
            policy: Policy::Rd,
            basis: auto(),
            floor: None,
            albedo_error: None,
            incoming_level: None,
            outgoing_level: None,
            wavelengths: None,
            metadata: true,
            random_access: false,
        }
    }

    fn axes(&self) -> Result<AxesRequest, WavelengthError> {
        Ok(AxesRequest {
            incoming_level: self.incoming_level,
            outgoing_level: self.outgoing_level,
            wavelengths: self.wavelengths.as_deref().map(WavelengthGrid::parse_range).transpose()?,
            target: match self.target {
                Target::ErL1(error) | Target::ErL2(error) => Some(error),
                _ => None,
            },
        })
    }
}

/// Why a request was not fulfilled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PipelineError {
    /// The file was refused.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The spectrum to join was refused.
    #[error("spectrum: {0}")]
    Spectrum(FormatError),
    /// The wavelengths asked for are none.
    #[error("wavelengths: {0}")]
    Wavelengths(#[from] WavelengthError),
    /// The measurement cannot be put on the axes asked for.
    #[error(transparent)]
    Projection(#[from] ProjectionError),
    /// The measurement was not compressed.
    #[error(transparent)]
    Compress(#[from] CompressError),
}

/// A material and its report.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The file.
    pub bytes: Vec<u8>,
    /// What was achieved.
    pub report: Report,
}

/// What was achieved, in the names of `compress --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// `b3-` and the BLAKE3 digest of the file.
    pub digest: String,
    /// The same without the metadata chunk.
    pub payload_digest: String,
    /// The format of the input.
    pub format: String,
    /// Its revision and flavour.
    pub dialect: String,
    /// The quantity.
    pub quantity: Quantity,
    /// The unit of a sample.
    pub unit: Unit,
    /// The policy.
    pub policy: Policy,
    /// The spectral basis.
    pub basis: String,
    /// The bases that competed for the wavelength axis, best first.
    pub basis_ranking: Vec<Ranked>,
    /// The axes, for people.
    pub axes: Vec<String>,
    /// The size of the file.
    pub bytes: u64,
    /// Coefficients that are not zero.
    pub kept_coefficients: Option<u64>,
    /// Samples per kept coefficient.
    pub ratio_coefficients: Option<f64>,
    /// Bytes of the float32 tensor per byte of the file.
    pub ratio_bytes: f64,
    /// Errors of the decoded file against the tensor that was compressed.
    #[serde(flatten)]
    pub errors: ErrorReport,
    /// How much of the light of every direction and wavelength (directional albedo, flux) the decoded file keeps.
    pub light: Option<LightReport>,
    /// Colour differences of the decoded file against the tensor, where they were promised.
    pub delta_e: Option<ColourReport>,
    /// Errors of the decoded file at the original samples, where projection changed them.
    pub errors_at_samples: Option<ErrorReport>,
    /// The noise of the tensor that was compressed; `None` where none can be told.
    pub noise: Option<Noise>,
    /// What the cells stand on.
    pub coverage: Coverage,
    /// Everything a parser assumed, filled or skipped, and warnings: a ratio that the file falls short of, a target below the
    /// noise, incoming directions too sparse for the lobe.
    pub notes: Vec<Note>,
    /// The levels of the last triangle axis that the first bytes of the file hold, coarse first; at least the finest.
    pub levels: Vec<LevelInfo>,
}

/// A measurement that was read, with its own bytes no longer needed.
#[derive(Clone, Debug)]
pub struct Source {
    /// The samples and everything the parser has to say.
    pub acquisition: Acquisition,
    /// Digest of the file's bytes.
    pub content_digest: String,
    /// Digest of the joined spectrum's bytes.
    pub spectrum_digest: Option<String>,
}

/// Reads a measurement and joins its spectrum.
pub fn read(input: &Input<'_>) -> Result<Source, PipelineError> {
    let mut acquisition = formats::read(input.bytes, input.interpretation)?;
    if let Some(bytes) = input.spectrum {
        let spectrum = formats::read(bytes, &Interpretation::default()).map_err(PipelineError::Spectrum)?;
        formats::attach_spectrum(&mut acquisition, &spectrum).map_err(PipelineError::Spectrum)?;
    }
    Ok(Source { acquisition, content_digest: digest(input.bytes), spectrum_digest: input.spectrum.map(digest) })
}

/// Puts a measurement on the axes that `request` asks for.
pub fn project(acquisition: &Acquisition, request: &Request) -> Result<Projected, PipelineError> {
    Ok(projection::project(acquisition, &request.axes()?)?)
}

/// Projects and compresses a measurement that was read.
pub fn compress(source: &Source, request: &Request, progress: &dyn Progress) -> Result<Outcome, PipelineError> {
    let acquisition = &source.acquisition;
    let Projected { measurement, coverage, filled } = project(acquisition, request)?;
    let settings = Settings {
        target: request.target,
        policy: request.policy,
        basis: request.basis.clone(),
        floor: request.floor,
        albedo_error: request.albedo_error,
        metadata: request.metadata.then(|| provenance(source, request, &filled)),
        random_access: request.random_access,
    };
    let compressed = compress::compress(&measurement, &settings, progress)?;
    // The measurement is not needed any more, and decoding needs the memory.
    let samples = measurement.tensor.len();
    drop(measurement);
    let report = report(acquisition, request.target, samples, coverage, &compressed);
    Ok(Outcome { bytes: compressed.bytes, report })
}

/// Lengths of runs of cells that are not filled and that are, in turn; the last is left out.
pub fn runs(filled: &[bool]) -> Vec<usize> {
    let (mut runs, mut now, mut start) = (Vec::new(), false, 0);
    for (i, &is) in filled.iter().enumerate() {
        if is != now {
            runs.push(i - start);
            (now, start) = (is, i);
        }
    }
    if now {
        runs.push(filled.len() - start);
    }
    runs
}

/// Where a material comes from: no clock, path, host, timing or thread count, so that equal inputs give equal bytes.
fn provenance(source: &Source, request: &Request, filled: &[bool]) -> String {
    let acquisition = &source.acquisition;
    let mut document = serde_json::json!({
        "generator": concat!("wavelume ", env!("CARGO_PKG_VERSION")),
        "source": {
            "format": acquisition.format,
            "dialect": acquisition.dialect,
            "content_digest": source.content_digest,
            "spectrum_digest": source.spectrum_digest,
            "metadata": acquisition.report.metadata,
            "notes": acquisition.report.notes,
        },
        "request": request,
    });
    let count = filled.iter().filter(|filled| **filled).count();
    if count > 0 {
        document["filled"] = serde_json::json!({ "cells": count, "of": filled.len(), "runs": runs(filled) });
    }
    document.to_string()
}

/// Pairs of incoming and outgoing cells that are opened for a warning at most: opening this many takes a second or two.
const MOST_CELLS: usize = 1 << 17;

/// A warning where a material's incoming directions are too sparse to say what the lobe does between them. The material is
/// opened for it; one of more than 131,072 pairs of incoming and outgoing cells is not, and never warned of.
pub fn sparse(bytes: &[u8]) -> Result<Option<String>, EvaluateError> {
    let axes = compress::inspect(bytes)?.axes;
    if has_lobes(&axes) { Ok(Material::open(bytes)?.report().warning()) } else { Ok(None) }
}

/// As [`sparse`], for what is not compressed yet.
pub fn sparse_measurement(measurement: Measurement) -> Result<Option<String>, EvaluateError> {
    let opens = has_lobes(measurement.tensor.axes());
    if opens { Ok(Material::of(measurement)?.report().warning()) } else { Ok(None) }
}

/// Whether there are outgoing directions for several incoming ones, and few enough to open.
fn has_lobes(axes: &[Axis]) -> bool {
    let cells = axes.iter().filter(|axis| !axis.is_spectral()).try_fold(1_usize, |n, axis| n.checked_mul(axis.len()));
    axes.iter().filter(|axis| axis.is_directional()).count() > 1 && cells.is_some_and(|cells| cells <= MOST_CELLS)
}

/// `b3-` and the BLAKE3 digest in hex.
pub fn digest(bytes: &[u8]) -> String {
    format!("b3-{}", blake3::hash(bytes).to_hex())
}

fn report(
    acquisition: &Acquisition,
    target: Target,
    samples: usize,
    coverage: Coverage,
    compressed: &compress::Compressed,
) -> Report {
    let summary = &compressed.summary;
    // Samples on their final axes are the tensor's own: there is nothing more to measure.
    let projected = matches!(acquisition.samples, formats::Samples::Grid(_) | formats::Samples::Scattered(_));
    let warnings = [
        compress::shortfall(target, samples as u64, compressed),
        compressed.noise.and_then(|noise| noise.warning(target)),
        sparse(&compressed.bytes).ok().flatten(),
    ];
    let warnings = warnings.into_iter().flatten().map(|message| Note { kind: NoteKind::Warning, message });
    let samples = samples as f64;
    let decoded = projected.then(|| compress::decode(&compressed.bytes).ok()).flatten();
    Report {
        digest: digest(&compressed.bytes),
        payload_digest: compress::payload_digest(&compressed.bytes)
            .map_or_else(|_| String::new(), |hash| format!("b3-{}", hash.to_hex())),
        format: acquisition.format.to_owned(),
        dialect: acquisition.dialect.clone(),
        quantity: summary.quantity,
        unit: summary.unit,
        policy: summary.policy,
        basis: summary.basis.clone(),
        basis_ranking: compressed.ranking.clone(),
        axes: summary.axes.iter().map(Axis::describe).collect(),
        bytes: compressed.bytes.len() as u64,
        kept_coefficients: summary.kept_coefficients,
        ratio_coefficients: summary.kept_coefficients.map(|kept| samples / kept.max(1) as f64),
        ratio_bytes: 4.0 * samples / compressed.bytes.len() as f64,
        errors: summary.errors,
        light: compressed.light,
        delta_e: compressed.colour,
        errors_at_samples: decoded.and_then(|d| projection::error_at_samples(acquisition, &d.measurement)),
        noise: compressed.noise,
        coverage,
        notes: acquisition.report.notes.iter().cloned().chain(warnings).collect(),
        levels: compress::levels(&compressed.bytes).unwrap_or_default(),
    }
}
