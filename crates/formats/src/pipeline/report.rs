//! Report on a compression, measured on the decoded file.

use super::auto::AutoReport;
use super::digest::digest;
use super::error::PipelineError;
use super::fit::{AtSamples, FitReport, promised};
use super::incidences::IncidenceReport;
use super::light;
use super::measured;
use super::sample_light::IncidenceLight;
use super::sparse::has_lobes;
use crate::compress::{self, DecodeError as CodecError, LevelInfo, LightReport, Noise, Policy, Ranked, Target};
use crate::domain::colour::ColourReport;
use crate::domain::{Axis, ErrorReport, Quantity, Unit, WavelengthGrid};
use crate::evaluate::{Material, MeasuredShare};
use crate::formats::{self, Acquisition, Note};
use crate::projection::{CarriedLobe, Coverage};
use serde::{Deserialize, Serialize};

/// Report on a compression, with the field names of `compress --json`.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/illuminant_D65.csv");
/// use wavelume_formats::pipeline::Request;
/// let report = wavelume_formats::read(path)?.compress(&Request::er_l2(0.001))?.report;
/// // Errors are those of the decoded file.
/// assert!(report.errors.er_l2 <= 0.001 && report.ratio_bytes > 1.0);
/// assert!(report.digest.starts_with("b3-"));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Report {
    /// `b3-` and the BLAKE3 digest of the compressed file in hex.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub digest: String,
    /// `b3-` and the BLAKE3 digest, in hex, of the compressed file without its metadata chunk.
    pub payload_digest: String,
    /// Name of the format of the input file.
    pub format: String,
    /// Revision and flavour of the format of the input file.
    pub dialect: String,
    /// Radiometric quantity that was measured.
    pub quantity: Quantity,
    /// Unit of a sample.
    pub unit: Unit,
    /// Compression policy: the method that selects and codes the coefficients.
    pub policy: Policy,
    /// Name of the basis that transforms the wavelength axis.
    pub basis: String,
    /// Bases that competed for the wavelength axis, best first.
    #[serde(default)]
    pub basis_ranking: Vec<Ranked>,
    /// Human-readable descriptions of the axes of the compressed tensor.
    #[serde(default)]
    pub axes: Vec<String>,
    /// Size of the compressed file in bytes.
    pub bytes: u64,
    /// Number of nonzero transform coefficients in the file; `None` if the policy keeps no coefficients.
    pub kept_coefficients: Option<u64>,
    /// Number of samples divided by the number of kept coefficients; `None` if the policy keeps no coefficients.
    pub ratio_coefficients: Option<f64>,
    /// Quantiser step of the transform coefficients, in natural-log units or in the unit of a sample; `None` for
    /// policies other than `rd`.
    pub step: Option<f64>,
    /// Compression ratio: bytes of the samples as float32 divided by bytes of the compressed file.
    pub ratio_bytes: f64,
    /// Errors of the decoded file at the samples of the measurement. For scattered samples, errors of the evaluated
    /// material at all samples that were not rejected as outliers.
    #[serde(flatten)]
    pub errors: ErrorReport,
    /// Description of the values at which errors are measured, if these are not the numbers of the input file. Either
    /// values resampled to other wavelengths, or all pairs of a direction and a wavelength of a joined spectrum.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub errors_at: Option<String>,
    /// Errors of the decoded file against the values before compression, if these are averages of samples over
    /// triangles of directions.
    #[serde(flatten)]
    pub cells: Option<CellErrors>,
    /// Relative errors of the directional albedo or flux of the decoded file, over all directions and wavelengths.
    pub light: Option<LightReport>,
    /// Method and leave-one-out errors of the interpolation between incident directions. `None` if no incident
    /// direction lies between others, or if there are more than 262,144 pairs of stored incoming and outgoing
    /// directions.
    pub incidences: Option<IncidenceReport>,
    /// Colour differences between the decoded file and the values before compression, if the target bounds them.
    pub delta_e: Option<ColourReport>,
    /// Noise, fit errors and outliers of samples at scattered directions; `None` for other samples.
    #[serde(rename = "scattered", skip_serializing_if = "Option::is_none")]
    pub fit: Option<FitReport>,
    /// Narrow lobe that is stored as a formula beside the tensor; `None` if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lobe: Option<CarriedLobe>,
    /// Directional albedo or flux of the material compared with that of scattered samples, for each incident direction
    /// and group of wavelength bands; empty for other measurements.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub light_at_samples: Vec<IncidenceLight>,
    /// Fraction (0 to 1) of the values with a standard uncertainty u in the file from which the decoded values differ
    /// by at most 2u. `None` if the file states no uncertainty, or if its grid was averaged over triangles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub within_2u: Option<f64>,
    /// Error bound at which the target `auto` stopped; `None` for other targets.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub auto: Option<AutoReport>,
    /// Estimated noise of the compressed values. `None` if it cannot be estimated, and for triangles fitted to
    /// scattered samples.
    pub noise: Option<Noise>,
    /// Counts of measured, interpolated, filled and empty direction cells (triangles, grid directions, or pairs of
    /// them), and notes on the axes.
    pub coverage: Coverage,
    /// Notes on assumptions, fillings and omissions of the parser, and warnings. Warnings concern a missed compression
    /// ratio, a target below the noise, or incoming directions too sparse for the lobe.
    #[serde(default)]
    pub notes: Vec<Note>,
    /// Resolution levels that can be decoded from a beginning of the file, coarse first; at least the finest.
    #[serde(default)]
    pub levels: Vec<LevelInfo>,
}

/// Errors of the decoded file against the values before compression, which are averages over triangles; see
/// [`ErrorReport`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct CellErrors {
    /// Number of compared values: triangles (or pairs of them) times wavelengths.
    #[serde(rename = "samples_cells")]
    pub samples: u64,
    /// Mean relative error of the decoded values: 0.01 is 1 %.
    #[serde(rename = "er_l1_cells")]
    pub er_l1: f64,
    /// Root mean square of the relative error of the decoded values: 0.01 is 1 %.
    #[serde(rename = "er_l2_cells")]
    pub er_l2: f64,
    /// Largest relative error of a decoded value: 0.01 is 1 %.
    #[serde(rename = "max_relative_error_cells")]
    pub max_relative_error: f64,
    /// Relative root mean square error of the decoded values s', `√(Σ(s'−s)² / Σs²)`: 0.01 is 1 %.
    #[serde(rename = "relative_rmse_cells")]
    pub relative_rmse: f64,
}

impl CellErrors {
    fn of(errors: &ErrorReport) -> Self {
        let ErrorReport { samples, er_l1, er_l2, max_relative_error, relative_rmse, .. } = *errors;
        Self { samples, er_l1, er_l2, max_relative_error, relative_rmse }
    }
}

/// Errors of a decoded file at the samples of its measurement, and the material to evaluate further, for the report on
/// the compression.
pub(super) struct Measured<'a> {
    /// Errors of the decoded file at scattered samples; `None` for other samples.
    pub(super) fit: Option<(FitReport, AtSamples)>,
    /// Errors of the decoded file at the samples of a grid that was averaged over triangles; `None` for other samples.
    pub(super) at_cells: Option<ErrorReport>,
    /// Decoded material, for the report on interpolation between incident directions; `None` if none is needed.
    pub(super) material: Option<&'a Material>,
    /// Measured share of the outgoing directions; `None` for data without outgoing directions.
    pub(super) share: Option<MeasuredShare>,
}

/// Creates the report on a compressed file. `samples` is the number of samples of its tensor.
pub(super) fn report(
    acquisition: &Acquisition,
    target: Target,
    samples: usize,
    (coverage, lobe): (Coverage, Option<CarriedLobe>),
    Measured { fit: at_scattered, at_cells, material, share }: Measured<'_>,
    compressed: &compress::Compressed,
) -> Result<Report, PipelineError> {
    let summary = &compressed.summary;
    // Samples kept on their own grid are those of the tensor: its errors are known already.
    let on_grid = summary.axes.iter().any(|axis| matches!(axis, Axis::Grid(_)));
    // The noise of fitted cells is not that of the samples.
    let noise = compressed.noise.filter(|_| at_scattered.is_none());
    let opened = |error: CodecError| PipelineError::Opened(error.into());
    let material = material.filter(|_| has_lobes(&summary.axes));
    let incidences = material.and_then(|material| IncidenceReport::of(material, noise));
    let promised = promised(target, summary.errors.er_l2);
    // Sums over a part of the directions are no albedo and no flux.
    let is_whole = share.is_none_or(|share| share.is_whole());
    let light = compressed.light.filter(|_| is_whole);
    let warnings = [
        measured::warning(share),
        compress::shortfall(target, samples as u64, compressed),
        noise.and_then(|noise| noise.warning(target)),
        incidences.and_then(|incidences| incidences.warning(promised)),
        light::warning(&summary.axes, light.as_ref()),
    ];
    let samples = samples as f64;
    let at_samples = at_scattered.as_ref().map(|(_, found)| found.errors).or(at_cells);
    let (fit, light_at_samples) = at_scattered.map(|(fit, found)| (fit, found.light)).unzip();
    let mut light_at_samples = light_at_samples.unwrap_or_default();
    light_at_samples.retain(|light| is_whole || !light.by_area);
    Ok(Report {
        digest: digest(&compressed.bytes),
        payload_digest: format!("b3-{}", compress::payload_digest(&compressed.bytes).map_err(opened)?.to_hex()),
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
        ratio_coefficients: ratio_coefficients(summary.kept_coefficients, samples),
        step: summary.step,
        ratio_bytes: ratio_bytes(&compressed.bytes, samples),
        errors: at_samples.unwrap_or(summary.errors),
        errors_at: errors_at(acquisition, &summary.axes),
        cells: at_samples.map(|_| CellErrors::of(&summary.errors)),
        light,
        incidences,
        delta_e: compressed.colour,
        fit,
        lobe,
        light_at_samples,
        within_2u: fit.and_then(|fit| fit.within_2u),
        auto: None,
        noise,
        coverage,
        notes: acquisition.report.notes_of(on_grid).cloned().chain(warnings.into_iter().flatten()).collect(),
        levels: compress::levels(&compressed.bytes).map_err(opened)?,
    })
}

/// Returns the number of samples divided by that of kept coefficients; `None` if the policy keeps no coefficients.
pub(super) fn ratio_coefficients(kept: Option<u64>, samples: f64) -> Option<f64> {
    kept.map(|kept| samples / kept.max(1) as f64)
}

/// Returns the compression ratio of a file: bytes of its samples as float32 divided by its own.
pub(super) fn ratio_bytes(file: &[u8], samples: f64) -> f64 {
    4.0 * samples / file.len() as f64
}

/// Describes the values at which the errors of a material on `axes` are measured. Returns `None` if these are the
/// samples that were read.
fn errors_at(acquisition: &Acquisition, axes: &[Axis]) -> Option<String> {
    let Some(Axis::Wavelength(grid)) = axes.last() else { return None };
    let is_same = |own: &WavelengthGrid| own.len() == grid.len() && (0..grid.len()).all(|i| own.at(i) == grid.at(i));
    let resampled = || Axis::Wavelength(grid.clone()).describe();
    if let Some(factor) = &acquisition.spectral_factor {
        let spectrum = if is_same(&factor.grid) { String::new() } else { format!(", resampled to {}", resampled()) };
        return Some(format!("all pairs of a stated direction and a wavelength of the spectrum{spectrum}"));
    }
    let own = match &acquisition.samples {
        formats::Samples::Grid(grid) => grid.spectral.as_ref(),
        formats::Samples::Scattered(scattered) => scattered.spectral.as_ref(),
        formats::Samples::OnAxes { tensor, .. } => tensor.axes().last(),
        formats::Samples::Function(modelled) => modelled.spectral.as_ref(),
    };
    match own {
        Some(Axis::Wavelength(own)) if !is_same(own) => {
            Some(format!("the samples after resampling to {}", resampled()))
        }
        _ => None,
    }
}
