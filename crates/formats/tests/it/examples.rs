//! The example programs do what they say, on materials of their own and on files.

#![allow(clippy::duplicate_mod, reason = "each program brings what the programs share")]

#[allow(dead_code, reason = "a program's main is not called by its test")]
#[path = "../../examples/furnace.rs"]
mod furnace;
#[allow(dead_code, reason = "a program's main is not called by its test")]
#[path = "../../examples/goniometer.rs"]
mod goniometer;
#[allow(dead_code, reason = "a program's main is not called by its test")]
#[path = "../../examples/lobes.rs"]
mod lobes;
#[allow(dead_code, reason = "a program's main is not called by its test")]
#[path = "../../examples/luminaire.rs"]
mod luminaire;
#[allow(dead_code, reason = "a program's main is not called by its test")]
#[path = "../../examples/samples.rs"]
mod samples;
#[allow(dead_code, reason = "a program's main is not called by its test")]
#[path = "../../examples/table9.rs"]
mod table9;

use wavelume_core::compress::Target;
use wavelume_core::domain::Silent;
use wavelume_formats::formats::Interpretation;
use wavelume_formats::pipeline::{self, Input, Request};

/// The material of a virtual measurement, in a file.
fn file(directory: &tempfile::TempDir, document: &str) -> String {
    let interpretation = Interpretation::default();
    let input = Input { bytes: document.as_bytes(), spectrum: None, interpretation: &interpretation };
    let source = pipeline::read(&input).unwrap();
    let bytes = pipeline::compress(&source, &Request::to(Target::ErL2(0.01)), &Silent).unwrap().bytes;
    let path = directory.path().join("m.wlm");
    std::fs::write(&path, bytes).unwrap();
    path.to_str().unwrap().to_owned()
}

fn furnace(path: Option<&str>) -> (bool, String) {
    let mut out = Vec::new();
    let agrees = furnace::run(path, &mut out).unwrap();
    (agrees, String::from_utf8(out).unwrap())
}

#[test]
fn the_furnace_agrees_with_what_is_stored() {
    let (agrees, text) = furnace(None);
    assert!(agrees, "{text}");
    assert!(text.contains("white GGX") && text.contains("furnace: albedo at most") && text.contains(" ± "));
}

#[test]
fn the_furnace_opens_files_of_both_sides() {
    let directory = tempfile::tempdir().unwrap();
    let document = |quantity: &str, model: &str, axes: &str| {
        format!("{{\"wavelume\":\"virtual\",\"quantity\":\"{quantity}\",\"model\":{model},\"axes\":{axes}}}")
    };
    let lambert = "{\"lambert\":{\"reflectance\":0.7}}";
    let through = "{\"lambert_transmission\":{\"transmittance\":0.4}}";
    let both = format!("{{\"sum\":[{{\"scale\":0.5,\"lobe\":{lambert}}},{{\"scale\":0.5,\"lobe\":{through}}}]}}");
    let elevations = "{\"kind\":\"elevation\",\"values\":[0,30,60]}";
    for (quantity, model, axes, light) in [
        ("brdf", lambert, format!("[{elevations},\"hemi:3\",\"lambda:400:100:3\"]"), 0.70),
        ("btdf", through, "[\"hemi:1\",\"lower:3\",\"lambda:400:100:3\"]".to_owned(), 0.40),
        ("bsdf", &both, "[\"sphere:1\",\"sphere:3\",\"lambda:400:100:3\"]".to_owned(), 0.55),
    ] {
        let path = file(&directory, &document(quantity, model, &axes));
        let (agrees, text) = furnace(Some(&path));
        let first: Vec<f64> = text.lines().nth(2).unwrap().split_whitespace().flat_map(str::parse).collect();
        // Elevation, wavelength, and what is stored, within the promise of the file.
        assert!(agrees && (first[2] - light).abs() < 0.01 * light, "{text}");
    }
}

#[test]
fn the_luminaire_has_its_flux() {
    let mut out = Vec::new();
    let agrees = luminaire::run(None, &mut out).unwrap();
    let text = String::from_utf8(out).unwrap();
    assert!(agrees && text.contains(" lm\n"), "{text}");
    // 5·2π/13 + 0.25·4π mW/nm over 320 nm, to the error of the file.
    let expected = 320.0 * (10.0 / 13.0 + 1.0) * std::f64::consts::PI;
    let total: f64 = text.lines().nth(1).unwrap().trim().trim_end_matches(" mW").parse().unwrap();
    assert!((total / expected - 1.0).abs() < 0.02, "{total} {expected}");
}

#[test]
fn what_is_no_such_material_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let phase =
        "{\"wavelume\":\"virtual\",\"quantity\":\"phase\",\"model\":\"rayleigh\",\"axes\":[\"sphere:0\",\"sphere:2\"]}";
    let path = file(&directory, phase);
    let refused = furnace::run(Some(&path), &mut Vec::new()).unwrap_err().to_string();
    assert_eq!(refused, "a phase has no albedo, expected a brdf, btdf or bsdf");
    let refused = luminaire::run(Some(&path), &mut Vec::new()).unwrap_err().to_string();
    assert_eq!(refused, "a phase has no flux, expected an edf");
    assert!(furnace::run(Some("none.wlm"), &mut Vec::new()).is_err());
}

#[test]
fn lobes_that_move_are_nearer_to_the_truth_than_lobes_that_fade() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("lobes.svg");
    let mut out = Vec::new();
    let better = lobes::run(path.to_str(), &mut out).unwrap();
    let text = String::from_utf8(out).unwrap();
    assert!(better && text.lines().filter(|line| line.starts_with("| ")).count() == 6, "{text}");
    // The picture of the documentation is the one that the program draws, but for the last digits of other machines.
    let drawn = std::fs::read_to_string(path).unwrap();
    let kept = include_str!("../../../../docs/lobes.svg");
    assert_eq!(drawn.lines().count(), kept.lines().count());
    assert!(drawn.len().abs_diff(kept.len()) < 200);
}

#[test]
fn table_9_has_its_rows() {
    let mut out = Vec::new();
    let holds = table9::run(4, 40, &mut out).unwrap();
    let text = String::from_utf8(out).unwrap();
    assert!(holds && text.contains("−87") && text.lines().count() == 7, "{text}");
}

#[test]
fn scattered_scans_become_materials_as_good_as_their_noise() {
    let mut out = Vec::new();
    let scan = goniometer::Scan { elevations: 3, outgoing: 8000, bands: 3, fresh: 400 };
    let good = goniometer::run(&scan, &mut out).unwrap();
    let text = String::from_utf8(out).unwrap();
    assert!(good, "{text}");
    assert!(text.contains("inside the blind spot") && text.contains("filled and marked"), "{text}");
}

#[test]
fn samples_are_printed_at_their_directions() {
    let file = |name: &str| std::fs::read(crate::root().join("tests/fixtures").join(name)).unwrap();
    let printed = |name: &str| {
        let mut out = Vec::new();
        let how = Interpretation { unit: None, ..Interpretation::default() };
        samples::print(&wavelume_formats::formats::read(&file(name), &how).unwrap(), &mut out).unwrap();
        String::from_utf8(out).unwrap()
    };
    let lamp = printed("tm33/street.xml");
    assert!(lamp.starts_with("tm-33,edf,cd\n,,90,0,") && lamp.contains("\n,,180,90,120\n"), "{lamp}");
    let paint = printed("zemax/satin.bsdf");
    assert!(
        paint.starts_with("zemax-bsdf,brdf,1/sr\n0,0,0,0,0.92") && paint.contains("\n30,0,30,180,1.4199999"),
        "{paint}"
    );
    let how = Interpretation::default();
    let document =
        wavelume_formats::formats::read(&std::fs::read(crate::root().join("data/virtual/plastic.json")).unwrap(), &how);
    assert!(samples::print(&document.unwrap(), &mut Vec::new()).is_err());
}
