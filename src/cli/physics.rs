//! `wavelume physics`: the energy, flux and reciprocity of a material, and the figures of its trade.

use super::failure::Failure;
use super::input::read_file;
use super::opened::{Made, Opened};
use super::output::{Sheet, count, counted, per_cent, print, print_json, three_digits};
use super::report::axes_lines;
use super::request::ThreadsArgs;
use crate::domain::{DEFAULT_ERROR, Unit, readable};
use crate::evaluate::Material;
use crate::evaluate::physics::{
    AlbedoReport, Allowance, FluxReport, IntensityAt, NormalisationReport, ReciprocityReport, Spot, Verdict,
};
use crate::formats::Interpretation;
use crate::pipeline::{self, LightFigures, LuminaireFigures, PhysicsReport, SurfaceFigures};
use serde::Serialize;
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Material (compressed measurement) to check, or a measurement, which is compressed in memory
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    /// Measurement from which the material of a surface was made: adds the colour differences between the two under
    /// light at 45 degrees
    #[arg(long, value_name = "FILE")]
    source: Option<PathBuf>,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// Print the report as one line of JSON, with the albedo of every incoming direction
    #[arg(long)]
    json: bool,
}

/// Report on a material, and how it was made if a measurement was given.
#[derive(Serialize)]
struct Answer {
    #[serde(flatten)]
    report: PhysicsReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    compressed_in_memory: Option<Made>,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    args.threads.run(|| answer(args))?
}

fn answer(args: &Args) -> Result<(), Failure> {
    let Opened { bytes, made: compressed_in_memory } = Opened::read(&args.material)?;
    let material = Material::open(&bytes).map_err(|error| Failure::from(error).about(&args.material))?;
    let source = args.source.as_deref().map(|path| source(path, &bytes, &args.material)).transpose()?;
    let report = PhysicsReport::beside(&material, source.as_ref());
    let report = report.map_err(|error| Failure::from(error).about(&args.material))?;
    if args.json {
        return print_json(&Answer { report, compressed_in_memory });
    }
    print(&sheet(&report, material.wavelengths().as_deref()).render(&args.material.display().to_string()))
}

/// Opens the measurement in the file `path` like the material in `made`, which the file `material` holds.
fn source(path: &Path, made: &[u8], material: &Path) -> Result<Material, Failure> {
    let bytes = read_file(path)?;
    let stated = pipeline::stated_in_header(made).map_err(|error| Failure::from(error).about(material))?.origin;
    let interpretation = Interpretation::default();
    let input = pipeline::Input { bytes: &bytes, spectrum: None, interpretation: &interpretation };
    let request = stated.request.unwrap_or_else(|| pipeline::Request::er_l2(DEFAULT_ERROR));
    let opened = pipeline::open_source(&input, made, &request);
    opened.map_err(|error| Failure::failed(error).about(path))
}

/// Makes the lines of the report; `wavelengths` are those of the material in nm.
fn sheet(report: &PhysicsReport, wavelengths: Option<&[f64]>) -> Sheet {
    let mut sheet = Sheet::default();
    sheet.line("quantity", format!("{}, {}", report.quantity, report.unit));
    axes_lines(&mut sheet, &report.axes);
    if let Some(energy) = &report.energy {
        if let Some(reason) = &energy.reason {
            sheet.line("energy", reason);
        }
        if let Some(albedo) = &energy.albedo {
            albedo_lines(&mut sheet, albedo);
        }
        if let Some(normalisation) = &energy.normalisation {
            normalisation_lines(&mut sheet, normalisation);
        }
        for flux in energy.flux.iter().flatten() {
            flux_lines(&mut sheet, flux, report.unit, wavelengths);
        }
    }
    for figures in &report.luminaire {
        luminaire_lines(&mut sheet, figures);
    }
    for figures in &report.surface {
        surface_lines(&mut sheet, figures);
    }
    for figures in &report.light {
        light_lines(&mut sheet, figures);
    }
    if let Some(reciprocity) = &report.reciprocity {
        reciprocity_lines(&mut sheet, reciprocity);
    }
    if let Some(warning) = &report.warning {
        sheet.line("warning", warning);
    }
    sheet
}

fn albedo_lines(sheet: &mut Sheet, albedo: &AlbedoReport) {
    let sides = [("", &albedo.largest), ("reflected ", &albedo.reflected), ("transmitted ", &albedo.transmitted)];
    for (side, spot) in sides {
        match spot {
            Some(spot) => sheet.line("albedo", format!("{side}at most {}", found(spot))),
            None if side.is_empty() => sheet.line("albedo", "masked"),
            None => sheet,
        };
    }
    sheet.line("albedo", format!("mean {}", three_digits(albedo.mean)));
    if albedo.negative > 0 {
        sheet.line("albedo", format!("{} below 0, because samples are negative", counted(albedo.negative, "albedo")));
    }
    sheet.line(
        "energy",
        match albedo.verdict {
            Verdict::Holds => "conserved: no albedo above 1".to_owned(),
            Verdict::WithinError => {
                format!(
                    "conserved within the error of the material: the largest albedo is {} above 1 ({})",
                    per_cent(albedo.excess),
                    allowed(&albedo.allowance)
                )
            }
            Verdict::Broken => {
                format!(
                    "not conserved: the largest albedo is {} above 1, too much for an error of the material ({})",
                    per_cent(albedo.excess),
                    allowed(&albedo.allowance)
                )
            }
        },
    );
}

fn normalisation_lines(sheet: &mut Sheet, report: &NormalisationReport) {
    for (which, spot) in [("least", &report.least), ("largest", &report.largest)] {
        if let Some(spot) = spot {
            sheet.line("integral", format!("{which} {}", found(spot)));
        }
    }
    sheet.line("integral", format!("mean {:.5}", report.mean));
    let off = per_cent(report.deviation);
    sheet.line(
        "normalisation",
        match report.verdict {
            Verdict::Holds => "holds: every integral of the phase function is 1".to_owned(),
            Verdict::WithinError => {
                format!(
                    "integrals differ from 1 by up to {off}, within the error of the material ({})",
                    allowed(&report.allowance)
                )
            }
            Verdict::Broken => format!(
                "integrals differ from 1 by up to {off}, too much for an error of the material ({})",
                allowed(&report.allowance)
            ),
        },
    );
}

fn flux_lines(sheet: &mut Sheet, flux: &FluxReport, unit: Unit, wavelengths: Option<&[f64]>) {
    let entry = entry_of(&flux.index);
    let spectral = || flux.spectral.iter().enumerate().filter_map(|(lambda, v)| v.map(|v| (lambda, v)));
    let most = spectral().fold(None, |most: Option<(usize, f64)>, one| match most {
        Some(most) if most.1 >= one.1 => Some(most),
        _ => Some(one),
    });
    match (flux.total, most) {
        (Some(total), _) => sheet.line("flux", format!("{} {}{entry}", three_digits(total), flux.total_unit)),
        (None, Some(_)) => sheet.line("flux", format!("known by wavelength only{entry}; the unit is {unit}")),
        (None, None) => sheet.line("flux", format!("masked{entry}")),
    };
    if let (Some((lambda, value)), Some(wavelengths)) = (most, wavelengths) {
        let at = wavelengths[lambda];
        sheet.line("flux", format!("at most {} {}, at {} nm", three_digits(value), flux.unit, readable(at)));
    }
    match (flux.luminous, &flux.reason) {
        (Some(luminous), _) => {
            let unit = if flux.unit == "lm/klm" { "lm/klm" } else { "lm" };
            sheet.line("luminous flux", format!("{} {unit}", three_digits(luminous)))
        }
        (None, reason) => sheet.line("luminous flux", format!("not known: {}", reason.as_deref().unwrap_or_default())),
    };
}

fn luminaire_lines(sheet: &mut Sheet, luminaire: &LuminaireFigures) {
    let figures = &luminaire.figures;
    let entry = entry_of(&figures.index);
    let at = |peak: &IntensityAt| {
        let [c, gamma] = [peak.c, peak.gamma].map(tenth);
        format!("{} {} at C {c}°, gamma {gamma}°", three_digits(peak.value), figures.unit)
    };
    sheet.line("peak", figures.peak.as_ref().map_or_else(|| "–".to_owned(), at) + &entry);
    for plane in &figures.planes {
        let Some(peak) = &plane.peak else {
            sheet.line(plane.plane, "–");
            continue;
        };
        let [beam, field] = [plane.beam, plane.field].map(|angle| angle.map_or("–".to_owned(), |a| tenth(a) + "°"));
        let largest = at(peak);
        sheet.line(plane.plane, format!("beam {beam} (50 %), field {field} (10 % of {largest})"));
    }
    for zone in &figures.zones {
        let share = zone.flux.zip(figures.flux).filter(|(_, flux)| *flux > 0.0);
        let text = share
            .map(|(zone, flux)| format!("{} {}, {}", three_digits(zone), figures.flux_unit, per_cent(zone / flux)));
        sheet.line("zones", format!("gamma {}–{}°: {}", zone.from, zone.to, text.unwrap_or_else(|| "–".to_owned())));
    }
    if let (Some(efficacy), Some(watts)) = (luminaire.efficacy, luminaire.watts) {
        sheet.line("efficacy", format!("{} lm/W with the {watts} W that the file states", three_digits(efficacy)));
    }
    if let (Some(ratio), Some(lumens)) = (luminaire.light_output_ratio, luminaire.lamp_lumens) {
        let stated = format!("of the {lumens} lm that the file states for the lamps");
        sheet.line("light output ratio", format!("{} {stated}", per_cent(ratio)));
    }
}

fn surface_lines(sheet: &mut Sheet, figures: &SurfaceFigures) {
    let entry = entry_of(&figures.index);
    let known = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), three_digits);
    if !figures.gloss.is_empty() {
        let gloss = figures.gloss.iter().map(|one| format!("{} at {}°", known(one.gloss), one.angle));
        sheet.line("gloss", format!("{}{entry} (100 is black glass, ISO 2813)", gloss.collect::<Vec<_>>().join(", ")));
    }
    for colour in &figures.colours {
        let lab = colour.lab.map(|lab| lab.map(|v| format!("{v:.2}")).join(", "));
        let text = lab.map_or_else(|| "–".to_owned(), |lab| format!("L*a*b* {lab}, Y {}", known(colour.y)));
        sheet.line("colour", format!("{}: {text}{entry}", colour.geometry));
    }
    if let Some(differences) = &figures.delta_e {
        let each = differences.iter().map(|one| format!("{} at {}°", known(one.delta_e), one.aspecular));
        sheet.line("CIEDE2000", format!("{}{entry}, aspecular under 45°", each.collect::<Vec<_>>().join(", ")));
    }
}

fn light_lines(sheet: &mut Sheet, figures: &LightFigures) {
    let entry = entry_of(&figures.index);
    let [x, y] = figures.xy;
    let temperature = match figures.cct.zip(figures.duv) {
        Some((cct, duv)) => format!("{cct:.0} K, Duv {duv:+.4}"),
        None => "no colour temperature: more than 0.05 from the Planckian locus".to_owned(),
    };
    let rendering = figures.rendering.map(|found| format!(", Ra {:.1}", found.general)).unwrap_or_default();
    sheet.line("light", format!("x {x:.4}, y {y:.4}, {temperature}{rendering}{entry}"));
}

/// Words for the entry of a report, its position on each index axis; empty without such axes.
fn entry_of(index: &[usize]) -> String {
    if index.is_empty() { String::new() } else { format!(" of {index:?}") }
}

/// Angle in degrees to a tenth; whole degrees without a decimal.
fn tenth(angle: f64) -> String {
    ((10.0 * angle).round() / 10.0).to_string()
}

fn reciprocity_lines(sheet: &mut Sheet, report: &ReciprocityReport) {
    let step = if report.step > 1 { format!(" (one of every {})", count(report.step)) } else { String::new() };
    sheet.line(
        "reciprocity",
        format!(
            "compared at {} of directions{step}; {} without a counterpart",
            counted(report.pairs, "pair"),
            counted(report.left_out, "pair")
        ),
    );
    let Some(worst) = &report.largest else { return };
    sheet.line(
        "reciprocity",
        format!(
            "f(wi, wo) and f(wo, wi) differ by {} of the light; mean over pairs {}, nine tenths of them below {}",
            per_cent(report.light),
            per_cent(report.mean),
            per_cent(report.p90)
        ),
    );
    let angles = |[theta, phi]: [f64; 2]| format!("({theta:.1}, {phi:.1})");
    let wavelength = worst.wavelength.map(|nm| format!(", {} nm", readable(nm))).unwrap_or_default();
    sheet.line(
        "reciprocity",
        format!(
            "largest difference {}: f(wi, wo) {}, f(wo, wi) {}, with wi {} and wo {}{wavelength}",
            per_cent(worst.difference),
            three_digits(worst.there),
            three_digits(worst.back),
            angles(worst.wi),
            angles(worst.wo)
        ),
    );
    if let Some(error) = report.left_out_error {
        sheet.line(
            "reciprocity",
            format!(
                "the differences include interpolation: a left-out incoming direction is predicted with an error of {}",
                per_cent(error)
            ),
        );
    }
}

fn found(spot: &Spot) -> String {
    let wi = spot.wi.map(|[theta, phi]| format!(", wi at ({theta:.1}, {phi:.1})"));
    let wavelength = spot.wavelength.map(|nm| format!(", {} nm", readable(nm)));
    let index = (!spot.index.is_empty()).then(|| format!(", index {:?}", spot.index));
    let places: String = [wi, wavelength, index].into_iter().flatten().collect();
    format!("{:.4}{places}", spot.value)
}

fn allowed(allowance: &Allowance) -> String {
    format!("its er(L2) is {}, its largest error {}", per_cent(allowance.er_l2), per_cent(allowance.bound))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_said_in_degrees_and_nanometres() {
        let mut spot =
            Spot { value: 0.98765, index: vec![], wi: Some([84.26, 12.0]), lambda: 3, wavelength: Some(700.0) };
        assert_eq!(found(&spot), "0.9877, wi at (84.3, 12.0), 700 nm");
        spot = Spot { index: vec![1, 2], wi: None, wavelength: None, ..spot };
        assert_eq!(found(&spot), "0.9877, index [1, 2]");
    }

    #[test]
    fn every_verdict_has_its_words() {
        let albedo = |verdict, excess| AlbedoReport {
            largest: None,
            reflected: None,
            transmitted: None,
            mean: 0.5,
            excess,
            allowance: Allowance { er_l2: 0.01, bound: 0.05 },
            verdict,
            negative: 2,
            entries: vec![],
        };
        let text = |verdict, excess| {
            let mut sheet = Sheet::default();
            albedo_lines(&mut sheet, &albedo(verdict, excess));
            sheet.render("m.wlm")
        };
        assert!(text(Verdict::Holds, 0.0).contains("energy  conserved: no albedo above 1\n"));
        let within =
            "conserved within the error of the material: the largest albedo is 0.500 % above 1 (its er(L2) is 1.00 %";
        assert!(text(Verdict::WithinError, 0.005).contains(within));
        assert!(
            text(Verdict::Broken, 0.2)
                .contains("not conserved: the largest albedo is 20.0 % above 1, too much for an error of the material")
        );
        assert!(text(Verdict::Broken, 0.2).contains("2 albedos below 0, because samples are negative"));
    }

    /// Renders the physics report of an analytic model that is sampled on `axes`, without compressing the samples.
    fn printed(quantity: &str, model: &str, axes: &str) -> String {
        let document =
            format!("{{\"wavelume\":\"virtual\",\"quantity\":\"{quantity}\",\"model\":{model},\"axes\":{axes}}}");
        let interpretation = crate::formats::Interpretation::default();
        let input = pipeline::Input { bytes: document.as_bytes(), spectrum: None, interpretation: &interpretation };
        let source = pipeline::read(&input).unwrap();
        let request = pipeline::Request::to(crate::compress::Target::Lossless);
        let measurement = pipeline::project(&source.acquisition, &request).unwrap().measurement;
        let material = Material::of(measurement).unwrap();
        let report = PhysicsReport::of(&material).unwrap();
        assert!(serde_json::to_string(&report).unwrap().contains("\"energy\":{"));
        sheet(&report, material.wavelengths().as_deref()).render("m.wlm")
    }

    #[test]
    fn every_quantity_has_its_report() {
        let lambert = "{\"lambert\":{\"reflectance\":0.7}}";
        let text = printed("brdf", lambert, "[\"hemi:1\",\"hemi:2\",\"lambda:400:100:4\"]");
        assert!(text.contains("albedo       at most 0.7000, wi at (") && text.contains("conserved"), "{text}");
        assert!(
            text.contains("reciprocity  compared at 1,024 pairs of directions; 0 pairs") && text.contains("left-out"),
            "{text}"
        );
        let both = format!(
            "{{\"sum\":[{{\"lobe\":{lambert}}},{{\"lobe\":{{\"lambert_transmission\":{{\"transmittance\":0.2}}}}}}]}}"
        );
        let text = printed("bsdf", &both, "[\"sphere:1\",\"sphere:2\",\"lambda:400:100:4\"]");
        assert!(text.contains("reflected at most 0.7000") && text.contains("transmitted at most 0.2000"), "{text}");
        let text = printed("phase", "\"rayleigh\"", "[\"sphere:1\",\"sphere:3\"]");
        assert!(text.contains("normalisation  ") && text.contains("integral       least "), "{text}");
        let text = printed("edf", "\"isotropic\"", "[\"sphere:2\",\"lambda:400:50:7\"]");
        assert!(text.contains("flux") && text.contains("not known: the unit is relative"), "{text}");
    }
}
