//! Projection and compression of a measurement that was read.

use super::auto::AutoReport;
use super::error::PipelineError;
use super::fit::{AtSamples, FitReport, at_samples, promised, scatter_of};
use super::light;
use super::measured;
use super::provenance::provenance;
use super::refinement::{Refined, above_noise, refined, warning};
use super::report::{Measured, Report, report};
use super::request::{Curve, Request};
use super::sample_light::{self, LightSums, Scanned, Untold};
use super::source::Source;
use super::sparse::has_lobes;
use super::uncertainty::within_on_grid;
use crate::compress::{self, Between, Numbers, Policy, Settings, Summary, Target};
use crate::domain::{Axis, Measurement, Progress, Silent};
use crate::evaluate::{Material, interpolation_between, measured_share, state_levels, straight_lines_for_flux};
use crate::formats::{Acquisition, Note, Samples, not_wider};
use crate::notes::{MaterialNote, ProjectionNote};
use crate::projection::{self, CarriedLobe, Projected, ScatterReport};

/// Code of the note on a directional albedo above 1 of a measurement.
const ALBEDO_ABOVE_ONE: &str = "check-albedo-above-one";

/// Result of a compression: the compressed material and its report.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/illuminant_D65.csv");
/// use wavelume_formats::pipeline::Request;
/// let compressed = wavelume_formats::read(path)?.compress(&Request::er_l2(0.001))?;
/// let (bytes, report) = (compressed.bytes, compressed.report);
/// println!("{} bytes, {:.0} : 1, er(L2) {}", bytes.len(), report.ratio_bytes, report.errors.er_l2);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Bytes of the compressed file.
    pub bytes: Vec<u8>,
    /// Report on the compressed file: size, and the errors measured after decoding it, with warnings.
    pub report: Report,
}

/// Projects a measurement onto the axes of `request`. If no subdivision level is given, scattered samples get triangles
/// fine enough that the error of the fit is small against the noise.
pub fn project(acquisition: &Acquisition, request: &Request) -> Result<Projected, PipelineError> {
    with_reciprocity(refined(acquisition, request)?.projected, request)
}

/// Averages each value of the projected measurement with that of the exchanged pair of directions, if `request` demands
/// a reciprocal BRDF.
fn with_reciprocity(mut projected: Projected, request: &Request) -> Result<Projected, PipelineError> {
    if request.reciprocal {
        let made = projection::reciprocal(&projected.measurement)?;
        projected.measurement = made.measurement;
        projected.numbers = None;
        let difference = made.difference.map_or(0.0, |difference| 100.0 * difference);
        projected.coverage.notes.push(ProjectionNote::MadeReciprocal { difference_percent: difference }.into());
    }
    Ok(projected)
}

/// Returns the request to compress a measurement that is only to be used, not kept: lossless or, if its samples are
/// scattered, to the default error.
///
/// ```
/// # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/illuminant_D65.csv");
/// use wavelume_formats::pipeline::for_use;
/// let source = wavelume_formats::read(path)?;
/// let compressed = source.compress(&for_use(&source.acquisition))?;
/// assert_eq!(compressed.report.errors.er_l2, 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn for_use(acquisition: &Acquisition) -> Request {
    Request::to(match acquisition.samples {
        Samples::Scattered(_) => Target::default(),
        Samples::OnAxes { .. } | Samples::Grid(_) | Samples::Function(_) => Target::Lossless,
    })
}

/// Projects a measurement onto the axes of `request` and compresses it.
pub fn compress(source: &Source, request: &Request, progress: &dyn Progress) -> Result<Outcome, PipelineError> {
    let acquisition = &source.acquisition;
    let mut next = refined(acquisition, request)?;
    loop {
        let Refined { projected, tried } = next;
        let found = compressed(source, request, with_reciprocity(projected, request)?, progress)?;
        let is_kept = found.outcome.report.fit.is_none_or(|fit| fit.is_kept());
        let finer = if is_kept { None } else { tried.finer(acquisition, request)? };
        match finer {
            Some(finer) => next = finer,
            None => return judged(found, request),
        }
    }
}

/// Adds the warnings about scattered samples to the report of a compression. With the option `strict` they are errors
/// instead.
fn judged(Judged { mut outcome, mut warnings }: Judged, request: &Request) -> Result<Outcome, PipelineError> {
    let Report { quantity, light_at_samples, notes, .. } = &outcome.report;
    // The check of the cells says it already.
    let is_said = notes.iter().any(|note| note.code == ALBEDO_ABOVE_ONE);
    let albedo = sample_light::too_bright(light_at_samples).filter(|_| quantity.has_cosine() && !is_said);
    warnings.extend(albedo);
    if request.strict && !warnings.is_empty() {
        return Err(PipelineError::Strict(sentences(&warnings).join("; ")));
    }
    outcome.report.notes.extend(warnings);
    Ok(outcome)
}

fn sentences(notes: &[Note]) -> Vec<&str> {
    notes.iter().map(|note| note.message.as_str()).collect()
}

/// Returns warnings about a material of scattered samples: it adds too much error to their noise, differs from them in
/// total light, or has an unresolved lobe.
fn warnings_of(
    summary: &Summary,
    (fit, found): (&FitReport, &AtSamples),
    (scatter, lobe): (&ScatterReport, Option<&CarriedLobe>),
    is_named: bool,
) -> Vec<Note> {
    // A lobe carried beside the cells explains the values of a lobe.
    let untold = if lobe.is_some() { None } else { Untold::of(scatter) };
    let scanned = Scanned { quantity: summary.quantity, untold, reduced: lobe.and_then(|lobe| lobe.reduced) };
    let warnings = [
        warning(fit, &summary.axes, is_named),
        sample_light::warning(&found.light, scanned),
        lobe.and_then(CarriedLobe::warning),
    ];
    warnings.into_iter().flatten().collect()
}

/// A compressed material and the warnings about its scattered samples, which are not yet in its report.
struct Judged {
    outcome: Outcome,
    warnings: Vec<Note>,
}

/// Compresses a projected measurement. If the samples are at scattered directions, measures the errors of the decoded
/// file at these samples.
fn compressed(
    source: &Source,
    request: &Request,
    projected: Projected,
    progress: &dyn Progress,
) -> Result<Judged, PipelineError> {
    let acquisition = &source.acquisition;
    let scatter = scatter_of(&projected);
    let Projected { measurement, coverage, filled, scattered, numbers, lobe } = projected;
    let on_grid = measurement.tensor.axes().iter().any(|axis| matches!(axis, Axis::Grid(_)));
    let provenance = |fit: Option<(&FitReport, &[&str])>| provenance(source, request, &filled, (on_grid, fit));
    let opened = PipelineError::Opened;
    let mut settings = Settings {
        metadata: request.metadata.then(|| provenance(None)),
        straight_lines: match request.interpolation {
            Curve::Cubic => straight_lines_for_flux(&measurement).map_err(opened)?,
            Curve::Linear => u8::MAX,
        },
        between: match request.interpolation {
            Curve::Cubic => interpolation_between(&measurement).map_err(opened)?,
            Curve::Linear => Between::default(),
        },
        lobe: lobe.as_ref().map(|carried| carried.lobe.clone()),
        ..request.settings()
    };
    let measured = measured_share(&measurement, settings.metadata.as_deref());
    measured::check(measured, request.albedo_error)?;
    let implausible = projection::implausible(&measurement, promised(request.target, 0.0));
    if request.strict && !implausible.is_empty() {
        return Err(PipelineError::Strict(sentences(&implausible).join("; ")));
    }
    let auto = AutoReport::of(&settings, acquisition, &measurement, scatter.noise);
    settings.target = auto.map_or(settings.target, |auto| auto.target());
    let target = settings.target;
    let stated = numbers.as_ref().map(|found| Numbers { values: found.tensor.samples(), factor: found.factor });
    let mut compressed = light::compress(&measurement, stated, &settings, progress)?;
    if on_grid {
        if compress::levels(&compressed.bytes).is_ok_and(|levels| levels.len() > 1) {
            // Decoded again below: the errors of levels take as much memory.
            compressed = compressed.without_samples();
        }
        compressed.bytes = state_levels(std::mem::take(&mut compressed.bytes), &measurement).map_err(opened)?;
    }
    let is_larger = larger_than_lossless(&measurement, stated, &settings, compressed.bytes.len())?;
    // Frees the measurement: evaluation needs the memory.
    drop((measurement, numbers));
    let decoded = compressed.take_decoded().map_err(|error| PipelineError::Opened(error.into()))?;
    let samples = decoded.measurement.tensor.len();
    let within_2u = within_on_grid(acquisition, request, &decoded.measurement.tensor)?;
    let is_averaged = !on_grid && matches!(acquisition.samples, Samples::Grid(_));
    let at_cells = if is_averaged { projection::error_at_samples(acquisition, &decoded.measurement) } else { None };
    let is_opened = scattered.is_some() || has_lobes(decoded.measurement.tensor.axes());
    let material = if is_opened { Some(Material::decoded(decoded).map_err(PipelineError::Opened)?) } else { None };
    let (mut fit, mut warnings) = (None, Vec::new());
    if let (Some(scattered), Some(material)) = (scattered, &material) {
        let mut sums = LightSums::new(&scattered);
        let at_samples = at_samples(acquisition, &scattered, material, Some((&mut sums, scatter.noise)));
        let promised = promised(target, compressed.summary.errors.er_l2);
        let found = FitReport::new(&scatter, &at_samples, promised);
        let is_named = request.outgoing_level.is_some();
        let of_lobe = (&scatter, lobe.as_ref());
        warnings = warnings_of(&compressed.summary, (&found, &at_samples), of_lobe, is_named);
        let above_noise = above_noise(&found, promised);
        fit = Some((found, at_samples));
        if request.metadata {
            let whole = compress::with_metadata(&compressed.bytes, &provenance(Some((&found, &sentences(&warnings)))));
            let whole = whole.map_err(|error| PipelineError::Opened(error.into()))?;
            // A byte limit takes precedence over the report in the metadata.
            if !matches!(target, Target::Bytes(limit) if whole.len() as u64 > limit) {
                compressed.bytes = whole;
            }
        }
        // The numbers in the metadata say it, too.
        warnings.extend(above_noise);
    }
    let unresolved = match &lobe {
        Some(carried) => not_wider(&acquisition.instrument, carried.full_width[0].min(carried.full_width[1])),
        None => projection::unresolved_lobe(acquisition),
    };
    let found = Measured { fit, at_cells, material: material.as_ref(), share: measured };
    let mut report = report(acquisition, target, samples, (coverage, lobe), found, &compressed)?;
    report.auto = auto;
    report.notes.extend(unresolved.into_iter().chain(implausible).chain(is_larger));
    if report.within_2u.is_none() {
        report.within_2u = within_2u;
    }
    Ok(Judged { outcome: Outcome { bytes: compressed.bytes, report }, warnings })
}

/// Returns a warning if a file of `bytes` bytes is larger than the lossless one of a measurement with these settings.
fn larger_than_lossless(
    measurement: &Measurement,
    numbers: Option<Numbers<'_>>,
    settings: &Settings,
    bytes: usize,
) -> Result<Option<Note>, PipelineError> {
    if settings.target == Target::Lossless || settings.policy == Policy::Lossless {
        return Ok(None);
    }
    let smaller = compress::smaller_lossless(measurement, numbers, settings, bytes)?;
    Ok(smaller.map(|lossless_bytes| MaterialNote::LargerThanLossless { bytes, lossless_bytes }.into()))
}

impl Source {
    /// Projects the measurement onto the requested axes and compresses it to the error bound of the request. The errors
    /// in the report are measured on the decoded file.
    pub fn compress(&self, request: &Request) -> Result<Outcome, PipelineError> {
        compress(self, request, &Silent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::Interpretation;
    use crate::pipeline::{Input, read};

    #[test]
    fn a_file_larger_than_the_lossless_one_is_warned_of() {
        // Plateaus of uneven lengths, which wavelets cannot follow.
        let value = |at: u32| 0.1 + f64::from((at * at / 7 + at / 11) % 89 / 3) / 40.0;
        let rows = (0..4000).map(|at| format!("{},{:.6}\n", 300.0 + 0.25 * f64::from(at), value(at / 9)));
        let text: String = std::iter::once("wavelength_nm,reflectance\n".to_owned()).chain(rows).collect();
        let interpretation = Interpretation::default();
        let source = read(&Input { bytes: text.as_bytes(), spectrum: None, interpretation: &interpretation }).unwrap();
        let told = |request: &Request| {
            let Outcome { bytes, report } = source.compress(request).unwrap();
            let notes = report.notes.iter().filter(|note| note.code == "material-larger-than-lossless");
            (bytes.len(), notes.map(|note| note.message.clone()).collect::<Vec<_>>())
        };
        let lossless = Request { target: Target::Lossless, metadata: false, ..Request::er_l2(0.01) };
        let (least, notes) = told(&lossless);
        assert!(notes.is_empty());
        let fine = Request { metadata: false, ..Request::er_l2(1e-6) };
        let (bytes, notes) = told(&fine);
        let expected = format!(
            "the file has {bytes} bytes, and a lossless one of these samples {least}: use lossless, or ask for a larger error"
        );
        assert!(bytes > least && notes == [expected], "{bytes} {least} {notes:?}");
        let (bytes, notes) = told(&Request { metadata: false, ..Request::er_l2(0.1) });
        assert!(bytes < least && notes.is_empty(), "{bytes} {least} {notes:?}");
    }
}
