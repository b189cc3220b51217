//! Surfaces of which too few directions were measured: no albedo, no picture of a ball, no file that needs them all.

use std::f64::consts::PI;
use std::fmt::Write as _;
use wavelume_core::domain::Direction;
use wavelume_core::evaluate::{EvaluateError, Interpolation, Material, Place, QueryError};
use wavelume_formats::export::{ExportError, ExportFormat, ExportOptions, export, fitting};
use wavelume_formats::formats::Interpretation;
use wavelume_formats::pipeline::{Input, OnGrid, Outcome, PipelineError, Request, Source, export_on_grid, read};
use wavelume_formats::preview::{Look, Viewing, picture};

/// GGX of roughness 0.2 (Smith masking, Schlick's Fresnel of n = 1.5) over a Lambertian base of 0.1, 0.25 and 0.35.
fn glossy(theta_i: f64, theta_o: f64, phi_o: f64) -> [f64; 3] {
    const ALPHA: f64 = 0.2;
    let wi = Direction::from_degrees(theta_i, 0.0).xyz();
    let wo = Direction::from_degrees(theta_o, phi_o).xyz();
    let sum = [0, 1, 2].map(|k| wi[k] + wo[k]);
    let length = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
    let h = sum.map(|x| x / length);
    let cosine = (0..3).map(|k| wi[k] * h[k]).sum::<f64>();
    let square = ALPHA * ALPHA;
    let d = 1.0 / (PI * square * ((h[0] * h[0] + h[1] * h[1]) / square + h[2] * h[2]).powi(2));
    let shadow = |z: f64| 0.5 * ((1.0 + square * (1.0 - z * z) / (z * z)).sqrt() - 1.0);
    let fresnel = 0.04 + 0.96 * (1.0 - cosine).powi(5);
    let specular = d * fresnel / (1.0 + shadow(wi[2]) + shadow(wo[2])) / (4.0 * wi[2] * wo[2]);
    [0.1, 0.25, 0.35].map(|base| specular + base / PI)
}

const HEAD: &str = "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n\
                    # angle_unit: deg\n# wavelength_unit: nm\n# isotropic: true\n";

/// A file of the surface with rows of the angles `columns`; each of `rows` has the angles, then those of the function.
fn file(columns: &str, rows: impl IntoIterator<Item = (Vec<f64>, [f64; 3])>) -> Source {
    let mut text = format!("{HEAD}{columns},v450,v550,v650\n");
    for (angles, at) in rows {
        for number in angles.into_iter().chain(glossy(at[0], at[1], at[2])) {
            write!(text, "{number:.6},").unwrap();
        }
        text.pop();
        text.push('\n');
    }
    let interpretation = Interpretation::default();
    read(&Input { bytes: text.as_bytes(), spectrum: None, interpretation: &interpretation }).unwrap()
}

const INCIDENCES: [f64; 5] = [5.0, 20.0, 35.0, 50.0, 65.0];

fn pairs(outgoing: &[f64]) -> impl Iterator<Item = (f64, f64)> {
    INCIDENCES.into_iter().flat_map(move |theta_i| outgoing.iter().map(move |&theta_o| (theta_i, theta_o)))
}

fn every(step: f64, last: f64) -> Vec<f64> {
    (0..=360).map(|i| step * f64::from(i)).take_while(|angle| *angle <= last).collect()
}

/// A scan in the plane of incidence with signed angles, one on the mirror's side, and one without azimuths.
fn scans() -> [(&'static str, Source); 3] {
    let signed: Vec<f64> = every(2.0, 160.0).into_iter().map(|theta| theta - 80.0).collect();
    let signed = pairs(&signed).map(|(theta_i, theta_o)| {
        (vec![theta_i, theta_o], [theta_i, theta_o.abs(), if theta_o < 0.0 { 0.0 } else { 180.0 }])
    });
    let outgoing = every(5.0, 85.0);
    let half = pairs(&outgoing).map(|(theta_i, theta_o)| (vec![theta_i, theta_o, 180.0], [theta_i, theta_o, 180.0]));
    let none = pairs(&outgoing).map(|(theta_i, theta_o)| (vec![theta_i, theta_o], [theta_i, theta_o, 180.0]));
    [
        ("in the plane of incidence only", file("theta_i,theta_o", signed)),
        ("plane of incidence only", file("theta_i,theta_o,phi_o", half)),
        ("half of the plane of incidence only", file("theta_i,theta_o", none)),
    ]
}

/// A scan of a cap around the normal, up to the polar angle `last`.
fn cap(last: f64) -> Source {
    let outgoing = every(5.0, last);
    let rows = pairs(&outgoing).flat_map(|(theta_i, theta_o)| {
        every(10.0, 180.0).into_iter().map(move |phi| (vec![theta_i, theta_o, phi], [theta_i, theta_o, phi]))
    });
    file("theta_i,theta_o,phi_o", rows)
}

fn opened(outcome: &Outcome) -> Material {
    Material::open(&outcome.bytes).unwrap()
}

fn value(material: &Material, [theta_i, theta_o, phi_o]: [f64; 3]) -> [f32; 3] {
    let directions = [(theta_i, 0.0), (theta_o, phi_o)].map(|(theta, phi)| Some(Direction::from_degrees(theta, phi)));
    let mut out = [0.0; 3];
    let place = Place { index: &[], wi: directions[0], wo: directions[1] };
    material.evaluate(place, Interpolation::Smooth, &mut out).unwrap();
    out
}

fn is_partly(error: &EvaluateError) -> bool {
    matches!(error, EvaluateError::Query(QueryError::PartlyMeasured { .. }))
}

fn assert_nothing_needs_the_rest(words: &str, outcome: &Outcome) {
    let report = &outcome.report;
    let about = report.notes.iter().find(|note| note.code == "material-partly-measured").unwrap();
    assert!(about.message.contains(words) && about.message.contains("there is no albedo"), "{}", about.message);
    assert!(report.light.is_none() && report.light_at_samples.iter().all(|light| !light.by_area));
    let stated = wavelume_formats::pipeline::sparse(&outcome.bytes).unwrap();
    assert!(stated.iter().any(|note| note.code == "material-partly-measured"), "{stated:?}");
    let material = opened(outcome);
    let energy = material.energy().unwrap();
    assert!(energy.albedo.is_none() && energy.reason.unwrap().contains(words));
    let refusal = picture(&material, None, &Viewing::default(), Look::default()).unwrap_err().to_string();
    assert!(refusal.starts_with("no picture of a ball: measured ") && refusal.contains(words), "{refusal}");
    for format in [ExportFormat::Rgl, ExportFormat::Merl, ExportFormat::Mbsdf] {
        let options = ExportOptions::default();
        let made = match export_on_grid(&outcome.bytes, format, &options) {
            Ok(OnGrid::Resample(_)) => export(&material, format, &options).map(drop),
            other => other.map(drop),
        };
        assert!(matches!(&made, Err(ExportError::Evaluate(error)) if is_partly(error)), "{format:?} {made:?}");
    }
    assert!(fitting(&material).iter().all(|format| matches!(format, ExportFormat::Npy)), "{:?}", fitting(&material));
}

#[test]
fn a_scan_in_one_plane_has_no_albedo_and_no_values_beside_the_plane() {
    for (words, source) in scans() {
        let outcome = source.compress(&Request::er_l2(0.01)).unwrap();
        assert_nothing_needs_the_rest(words, &outcome);
        let material = opened(&outcome);
        for theta_i in [20.0, 35.0] {
            for phi in [60.0, 90.0, 120.0, 240.0, 270.0] {
                assert!(value(&material, [theta_i, 40.0, phi]).iter().all(|value| value.is_nan()), "{words} {phi}");
            }
        }
        let bounded = source.compress(&Request { albedo_error: Some(0.01), ..Request::er_l2(0.01) });
        assert!(matches!(&bounded, Err(PipelineError::Unbounded(error)) if is_partly(error)), "{words}");
    }
}

#[test]
fn a_cap_of_three_quarters_has_no_albedo_and_one_of_nine_tenths_has() {
    let narrow = cap(60.0).compress(&Request::er_l2(0.01)).unwrap();
    assert_nothing_needs_the_rest("measured in 75 % of the hemisphere", &narrow);
    let wide = cap(85.0).compress(&Request::er_l2(0.01)).unwrap();
    assert!(
        wide.report.light.is_some() && wide.report.notes.iter().all(|note| note.code != "material-partly-measured")
    );
    let material = opened(&wide);
    assert!(fitting(&material).contains(&ExportFormat::Rgl) && material.bsdf().is_ok());
    // Directional albedos of the formula at 650 nm, by quadrature, without the 0.8 % of light beyond 85 degrees.
    let albedo = material.energy().unwrap().albedo.unwrap();
    for spot in &albedo.entries {
        assert!((0.36..0.47).contains(&spot.value), "{spot:?}");
    }
}
