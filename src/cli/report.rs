//! Human-readable reports: the same facts as `--json`, in labelled lines.

use super::declared::as_typed;
use super::output::{Sheet, count, counted, per_cent, three_digits};
use crate::compress::{LevelInfo, LightReport, Noise};
use crate::domain::colour::ColourReport;
use crate::domain::{ErrorReport, Quantity, Unit};
use crate::formats::Note;
use crate::pipeline::{AutoReport, FitReport, IncidenceReport, Report, SampleLight, StoppedAt};
use crate::projection::{Coverage, Rejected, ScatterReport};

/// Renders the report of a compression; `file_bytes` is the size of the input file.
pub(crate) fn compressed_sheet(report: &Report, file_bytes: u64) -> Sheet {
    let mut sheet = Sheet::default();
    sheet.line("format", labelled(&report.format, &report.dialect));
    sheet.line("quantity", format!("{}, {}", report.quantity, report.unit));
    axes_lines(&mut sheet, &report.axes);
    sample_lines(&mut sheet, &report.errors);
    coverage_lines(&mut sheet, &report.coverage);
    noise_line(&mut sheet, report.noise.as_ref());
    if let Some(auto) = &report.auto {
        sheet.line("auto", stopped_at(auto));
    }
    note_lines(&mut sheet, &report.notes);
    sheet.line("policy", format!("{}, basis {}", report.policy, report.basis));
    sheet.line(
        "size",
        format!(
            "{} bytes, {} : 1 of the float32 tensor; the input file has {}",
            count(report.bytes),
            three_digits(report.ratio_bytes),
            count(file_bytes)
        ),
    );
    coefficient_line(&mut sheet, report.kept_coefficients, report.ratio_coefficients);
    error_lines(&mut sheet, "error", &report.errors);
    if let Some(what) = &report.errors_at {
        sheet.line("error", format!("at {what}"));
    }
    if let Some(cells) = &report.cells {
        let [l1, l2, largest, rmse] =
            [cells.er_l1, cells.er_l2, cells.max_relative_error, cells.relative_rmse].map(per_cent);
        let text = format!("er(L1) {l1}, er(L2) {l2}, largest {largest}; relative RMSE {rmse}");
        sheet.line("of the cells", text);
    }
    if let Some(light) = &report.light {
        let text = light_of(report.quantity, report.unit, light);
        sheet.line(if report.fit.is_some() { "light of cells" } else { "light" }, text);
    }
    if let Some(incidences) = &report.incidences {
        incidence_lines(&mut sheet, incidences);
    }
    if let Some(colour) = &report.delta_e {
        colour_lines(&mut sheet, colour);
    }
    if let Some(fit) = &report.fit {
        fit_line(&mut sheet, fit);
    } else {
        uncertainty_line(&mut sheet, report.within_2u);
    }
    sheet.line("digest", &report.digest);
    sheet
}

/// Describes the error of the light that leaves the material, and its largest amount, for one incoming direction and
/// wavelength: a flux, a directional albedo or the integral of a phase function.
fn light_of(quantity: Quantity, unit: Unit, light: &LightReport) -> String {
    let (what, unit) = match (quantity, unit.over_directions()) {
        (Quantity::Phase, _) => ("integral over the sphere", String::new()),
        (Quantity::Edf, unit) => ("flux", format!(" {unit}")),
        _ => ("directional albedo", String::new()),
    };
    format!(
        "{what} at most {} off, {} rms; the largest {what} is {}{unit}",
        per_cent(light.largest),
        per_cent(light.rms),
        three_digits(light.brightest)
    )
}

/// Adds the report lines on the interpolation between incoming directions: its method, its leave-one-out error and its
/// estimated error.
fn incidence_lines(sheet: &mut Sheet, report: &IncidenceReport) {
    sheet.line("between incidences", report.interpolation);
    sheet.line("one incidence left out", format!("er(L2) {}", per_cent(report.left_out_er_l2)));
    let text = format!(
        "er(L2) {}, {} of the light in the wrong place",
        per_cent(report.estimated_er_l2),
        per_cent(report.estimated_moved)
    );
    sheet.line("between incidences, estimated", text);
}

/// Returns `name (detail)`, or `name` alone if there is no detail.
pub(crate) fn labelled(name: &str, detail: &str) -> String {
    if detail.is_empty() { name.to_owned() } else { format!("{name} ({detail})") }
}

/// Adds the report line on the axes of a tensor, outermost first.
pub(crate) fn axes_lines(sheet: &mut Sheet, axes: &[String]) {
    let axes = if axes.is_empty() { "none: one value".to_owned() } else { axes.join(" × ") };
    sheet.line("axes", axes);
}

/// Adds the report line on kept coefficients: their number `kept`, and the number of samples divided by it.
pub(crate) fn coefficient_line(sheet: &mut Sheet, kept: Option<u64>, ratio: Option<f64>) {
    if let (Some(kept), Some(ratio)) = (kept, ratio) {
        sheet.line("coefficients", format!("{} kept, {} samples each", count(kept), three_digits(ratio)));
    }
}

/// Adds the report line on samples: their number, and how many are masked, zero, negative, or positive but too small to
/// count in relative errors.
pub(crate) fn sample_lines(sheet: &mut Sheet, errors: &ErrorReport) {
    let special = [
        ("masked", errors.masked_samples),
        ("zero", errors.zero_samples),
        ("negative", errors.negative_samples),
        ("below the floor", errors.below_floor_samples),
    ];
    let special = special.iter().filter(|(_, n)| *n > 0).map(|(what, n)| format!(", {} {what}", count(*n)));
    sheet.line("samples", format!("{}{}", count(errors.samples), special.collect::<String>()));
}

/// Adds the report lines on the coarser levels that the first bytes of a file decode to, if there are several levels.
pub(crate) fn level_lines(sheet: &mut Sheet, levels: &[LevelInfo]) {
    for LevelInfo { level, bytes, er_l2 } in levels.iter().filter(|_| levels.len() > 1) {
        let text = format!("{level} in the first {} bytes, er(L2) {}", count(*bytes), per_cent(*er_l2));
        sheet.line("levels", text);
    }
}

/// Adds the report lines on errors; relative errors are in per cent.
pub(crate) fn error_lines(sheet: &mut Sheet, label: &str, errors: &ErrorReport) {
    sheet.line(
        label,
        format!(
            "er(L1) {}, er(L2) {}, largest {}; relative RMSE {}",
            per_cent(errors.er_l1),
            per_cent(errors.er_l2),
            per_cent(errors.max_relative_error),
            per_cent(errors.relative_rmse)
        ),
    );
    if errors.scored_samples < errors.samples - errors.masked_samples {
        let elsewhere = match errors.max_absolute_error_unscored {
            0.0 => "the other samples are exact".to_owned(),
            most => format!("the other samples are at most {} off", three_digits(most)),
        };
        sheet.line(
            label,
            format!("{} > 0 enter the relative errors; {elsewhere}", counted(errors.scored_samples, "sample")),
        );
    }
    if errors.mask_mismatches > 0 {
        sheet.line(
            label,
            format!(
                "{} have a value either before or after compression only",
                counted(errors.mask_mismatches, "sample")
            ),
        );
    }
}

/// Adds the report lines on the colour differences between decoded and original spectra.
fn colour_lines(sheet: &mut Sheet, colour: &ColourReport) {
    let (largest, mean) = (three_digits(colour.largest), three_digits(colour.mean));
    sheet.line("colour", format!("CIEDE2000 largest {largest}, mean {mean}, illuminant {}", colour.illuminant));
    if colour.unscored_spectra > 0 {
        let (scored, others) = (count(colour.spectra), count(colour.unscored_spectra));
        sheet.line("colour", format!("{scored} spectra compared; {others} more with too few measured wavelengths"));
    }
}

/// Adds the lines on coverage to the report on a resampled measurement: the numbers of direction cells that are
/// measured, interpolated, filled by a rule or empty.
pub(crate) fn coverage_lines(sheet: &mut Sheet, coverage: &Coverage) {
    let filled = if coverage.filled > 0 { format!("{} filled, ", count(coverage.filled)) } else { String::new() };
    sheet.line(
        "coverage",
        format!(
            "{}: {} measured, {} interpolated, {filled}{} empty",
            counted(coverage.cells, "cell"),
            count(coverage.measured),
            count(coverage.interpolated),
            count(coverage.empty)
        ),
    );
    for note in &coverage.notes {
        sheet.line("coverage", as_typed(&note.message));
    }
    if let Some(scatter) = &coverage.scatter {
        scatter_lines(sheet, scatter);
    }
}

/// Adds the report lines on samples at individual directions instead of a grid: their number, their noise and their
/// outliers.
fn scatter_lines(sheet: &mut Sheet, report: &ScatterReport) {
    let negative = if report.negative > 0 { format!(", {} negative", count(report.negative)) } else { String::new() };
    sheet.line(
        "scattered",
        format!("{} samples{negative}, {} neighbours to a fit", count(report.samples), report.neighbours),
    );
    scatter_noise_lines(sheet, report.noise, report.rejected, (Some(report.isolated), report.lobe));
}

/// Adds the report lines on the noise and the outliers of samples at individual directions instead of a grid.
/// `isolated` are the outliers without others near them; `lobe` counts values of a narrow lobe, which are no outliers.
fn scatter_noise_lines(
    sheet: &mut Sheet,
    noise: Option<f64>,
    rejected: Rejected,
    (isolated, lobe): (Option<Rejected>, u64),
) {
    let noise = noise.map_or_else(|| "unknown: too few samples".to_owned(), per_cent);
    sheet.line("sample noise", format!("{noise}, from differences between neighbours"));
    let values = match rejected.values {
        0 => "no samples".to_owned(),
        values => format!(
            "{} far from the neighbours: {} of the samples, {} of the light",
            counted(values, "value"),
            per_cent(rejected.samples),
            per_cent(rejected.light)
        ),
    };
    sheet.line("rejected", values);
    if let Some(isolated) = isolated.filter(|isolated| isolated.values < rejected.values) {
        let text = match isolated.values {
            0 => "none of the rejected values lies alone".to_owned(),
            values => format!(
                "{} of the rejected values lie alone: {} of the samples, {} of the light; the others lie together",
                count(values),
                per_cent(isolated.samples),
                per_cent(isolated.light)
            ),
        };
        sheet.line("rejected", text);
    }
    if lobe > 0 {
        let text =
            format!("{} far above the neighbours, together as a narrow lobe: not rejected", counted(lobe, "value"));
        sheet.line("narrow lobe", text);
    }
}

/// Adds the report lines on the errors of a material at scattered samples.
fn fit_line(sheet: &mut Sheet, fit: &FitReport) {
    let text = format!(
        "er(L2) {} at the samples that were not rejected; the material adds {} to their noise, at most {} is allowed",
        per_cent(fit.fit),
        per_cent(fit.added),
        per_cent(fit.allowed)
    );
    sheet.line("fit", text);
    if let Some(all) = fit.fit_all.filter(|_| fit.rejected.values > 0) {
        sheet.line("fit", format!("er(L2) {} with the rejected samples", per_cent(all)));
    }
    if let Some(light) = &fit.light {
        sheet.line("light at samples", light_at_samples(light, fit.rejected.values > 0));
    }
    uncertainty_line(sheet, fit.within_2u);
}

/// Adds the report line on the share of the values that the material keeps within twice their stated uncertainty.
fn uncertainty_line(sheet: &mut Sheet, within: Option<f64>) {
    if let Some(within) = within {
        let text = format!("{} of the values with a stated uncertainty u are kept within 2u", per_cent(within));
        sheet.line("uncertainty", text);
    }
}

/// Describes where a compression with the target `auto` stopped: at the estimated noise or at the stated uncertainty.
fn stopped_at(auto: &AutoReport) -> String {
    let uncertainty =
        |u: f64| format!("uncertainty of {} that the file states (relative root mean square)", per_cent(u));
    match (auto.stopped_at, auto.uncertainty, auto.noise) {
        (StoppedAt::Uncertainty, Some(u), Some(noise)) => {
            format!("stopped at the {}, above the estimated noise of {}", uncertainty(u), per_cent(noise))
        }
        (StoppedAt::Uncertainty, Some(u), None) => {
            format!("stopped at the {}; the noise of the samples cannot be estimated", uncertainty(u))
        }
        (_, Some(u), Some(noise)) => {
            format!("stopped at the estimated noise of {}, which is not below the {}", per_cent(noise), uncertainty(u))
        }
        (_, _, Some(noise)) => format!("stopped at the estimated noise of {}", per_cent(noise)),
        _ => "stopped at the estimated noise".to_owned(),
    }
}

/// Describes the largest relative differences between the values of a material and those of its samples, each summed
/// over outgoing directions.
fn light_at_samples(light: &SampleLight, is_any_rejected: bool) -> String {
    let signed = |off: f64| format!("{} {}", per_cent(off.abs()), if off > 0.0 { "too much" } else { "too little" });
    let stated = |off: Option<f64>| off.map_or_else(|| "unknown: no samples there".to_owned(), signed);
    let kept = format!("{} at worst, over incidences and groups of bands", stated(light.kept));
    if !is_any_rejected {
        return kept;
    }
    let (together, all) = (stated(light.together), stated(light.all));
    format!("{kept}; with the rejected samples that lie together {together}, with all rejected ones {all}")
}

/// Adds the report lines on samples at individual directions instead of a grid: their noise, their outliers, and the
/// errors of the material at them. The numbers come from the metadata of the material.
pub(crate) fn stated_fit_lines(sheet: &mut Sheet, fit: &FitReport) {
    scatter_noise_lines(sheet, fit.noise, fit.rejected, (fit.isolated, fit.lobe));
    fit_line(sheet, fit);
}

/// Adds the report line on the estimated noise of the samples.
fn noise_line(sheet: &mut Sheet, noise: Option<&Noise>) {
    let Some(noise) = noise else { return };
    let own = (noise.relative > 0.0).then(|| {
        format!("about {} from sample to sample (± {})", per_cent(noise.relative), per_cent(noise.uncertainty))
    });
    let common =
        (noise.common > 0.0).then(|| format!("about {} common to neighbouring wavelengths", per_cent(noise.common)));
    let both: Vec<String> = own.into_iter().chain(common).collect();
    sheet.line("noise", both.join(", "));
}

/// Adds one report line for each note of a file reader: a fact that it assumed, filled in, skipped or warns of.
pub(crate) fn note_lines(sheet: &mut Sheet, notes: &[Note]) {
    for note in notes {
        sheet.line(note.kind.name(), as_typed(&note.message));
    }
}
