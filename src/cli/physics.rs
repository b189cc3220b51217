//! `wavelume physics`: the energy, flux and reciprocity of a material.

use super::failure::Failure;
use super::output::{Sheet, count, counted, per_cent, print, print_json, three_digits};
use super::query;
use super::report::axes_lines;
use super::request::ThreadsArgs;
use crate::domain::{Axis, DEFAULT_ERROR, Quantity, Unit, readable};
use crate::evaluate::physics::{
    AlbedoReport, Allowance, EnergyReport, FluxReport, NormalisationReport, ReciprocityReport, Spot, Verdict,
};
use crate::evaluate::{EvaluateError, Material};
use serde::Serialize;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Material (compressed measurement) to check
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// Print the report as one line of JSON, with the albedo of every incoming direction
    #[arg(long)]
    json: bool,
}

/// Results of the physical checks on a material; reciprocity is checked for a BRDF, BSDF or phase function only.
#[derive(Serialize)]
struct Answer {
    quantity: Quantity,
    unit: Unit,
    axes: Vec<String>,
    energy: EnergyReport,
    reciprocity: Option<ReciprocityReport>,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    args.threads.run(|| answer(args))?
}

fn answer(args: &Args) -> Result<(), Failure> {
    let material = query::open(&args.material)?;
    let answer = Answer::of(&material).map_err(|error| Failure::from(error).about(&args.material))?;
    if args.json {
        return print_json(&answer);
    }
    print(&answer.sheet(&material).render(&args.material.display().to_string()))
}

impl Answer {
    fn of(material: &Material) -> Result<Self, EvaluateError> {
        let has_two_ways = matches!(material.quantity(), Quantity::Brdf | Quantity::Bsdf | Quantity::Phase);
        Ok(Self {
            quantity: material.quantity(),
            unit: material.unit(),
            axes: material.axes().iter().map(Axis::describe).collect(),
            energy: material.energy()?,
            reciprocity: if has_two_ways { Some(material.reciprocity()?) } else { None },
        })
    }

    fn sheet(&self, material: &Material) -> Sheet {
        let mut sheet = Sheet::default();
        sheet.line("quantity", format!("{}, {}", self.quantity, self.unit));
        axes_lines(&mut sheet, &self.axes);
        if let Some(albedo) = &self.energy.albedo {
            albedo_lines(&mut sheet, albedo);
        }
        if let Some(normalisation) = &self.energy.normalisation {
            normalisation_lines(&mut sheet, normalisation);
        }
        for flux in self.energy.flux.iter().flatten() {
            flux_lines(&mut sheet, flux, material);
        }
        if let Some(reciprocity) = &self.reciprocity {
            reciprocity_lines(&mut sheet, reciprocity);
        }
        let promised = material.summary().map_or(0.0, |summary| summary.errors.er_l2);
        let promised = if promised > 0.0 { promised } else { DEFAULT_ERROR };
        if let Some(warning) = material.left_out(0.0).and_then(|left_out| left_out.warning(promised)) {
            sheet.line("warning", warning);
        }
        sheet
    }
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

fn flux_lines(sheet: &mut Sheet, flux: &FluxReport, material: &Material) {
    let entry = if flux.index.is_empty() { String::new() } else { format!(" of {:?}", flux.index) };
    let spectral = || flux.spectral.iter().enumerate().filter_map(|(lambda, v)| v.map(|v| (lambda, v)));
    let most = spectral().fold(None, |most: Option<(usize, f64)>, one| match most {
        Some(most) if most.1 >= one.1 => Some(most),
        _ => Some(one),
    });
    match (flux.total, most) {
        (Some(total), _) => sheet.line("flux", format!("{} {}{entry}", three_digits(total), flux.total_unit)),
        (None, Some(_)) => {
            sheet.line("flux", format!("known by wavelength only{entry}; the unit is {}", material.unit()))
        }
        (None, None) => sheet.line("flux", format!("masked{entry}")),
    };
    if let (Some((lambda, value)), Some(wavelengths)) = (most, material.wavelengths()) {
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
    use crate::pipeline;

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
        let answer = Answer::of(&material).unwrap();
        assert!(serde_json::to_string(&answer).unwrap().contains("\"energy\":{"));
        answer.sheet(&material).render("m.wlm")
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
