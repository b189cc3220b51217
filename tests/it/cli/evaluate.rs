//! Spectra and samples of materials on the command line, and lists of what is known.

use super::{LAMBDAS, at, data, done, json, material, refused, workshop};
use std::process::{Command, Stdio};

#[test]
fn evaluate_gives_spectra() {
    let dir = workshop();
    let made = material(&dir);
    let ask = |more: &[&str]| json(&[&["evaluate", &made, "--wi", "30,40", "--wo", "20,-170"], more].concat());
    let spectrum = ask(&[]);
    assert_eq!(spectrum["wavelengths"], serde_json::json!([400.0, 450.0, 500.0, 550.0, 600.0]));
    assert_eq!(spectrum["unit"], "1/sr");
    assert_eq!(spectrum["values"].as_array().unwrap().len(), LAMBDAS);
    assert!(spectrum["values"].as_array().unwrap().iter().all(|v| (0.1..0.4).contains(&v.as_f64().unwrap())));
    let chosen = ask(&["--wavelengths", "400,600", "--interpolation", "smooth"]);
    assert_eq!(chosen["values"][0], spectrum["values"][0]);
    assert_eq!(chosen["values"][1], spectrum["values"][4]);
    assert_eq!(ask(&["--wavelengths", "400:600:100", "--interpolation", "constant"])["wavelengths"][1], 500.0);
    refused(2, &["evaluate", &made, "--wo", "20,0"]);
    refused(2, &["evaluate", &made, "--wi", "200,0", "--wo", "20,0"]);
    refused(2, &["evaluate", &made, "--wi", "20,0", "--wo", "20,0", "--index", "3"]);
}

#[test]
fn a_lamp_needs_no_incoming_direction() {
    let dir = tempfile::tempdir().unwrap();
    let out = at(&dir, "lamp.wlm");
    done(&["compress", &data("aerolamp.ies"), "-o", &out, "--outgoing-level", "3"]);
    let down = json(&["evaluate", &out, "--wo", "180,0"]);
    assert!(down["values"][0].as_f64().unwrap() > 0.0, "{down}");
    let drawn = json(&["sample", &out, "-n", "10"]);
    assert_eq!(drawn["pdf"].as_array().unwrap().len(), 10);
}

#[test]
fn samples_are_drawn_from_the_seed() {
    let dir = workshop();
    let made = material(&dir);
    let draw = |seed: &str, level: &str| {
        json(&["sample", &made, "--wi", "30,40", "-n", "100", "--seed", seed, "--level", level])
    };
    let drawn = draw("7", "1");
    assert_eq!(drawn, draw("7", "1"));
    assert_ne!(drawn, draw("8", "1"));
    for name in ["directions", "pdf", "weight"] {
        assert_eq!(drawn[name].as_array().unwrap().len(), 100, "{name}");
    }
    for (direction, pdf) in drawn["directions"].as_array().unwrap().iter().zip(drawn["pdf"].as_array().unwrap()) {
        assert!((0.0..=90.0).contains(&direction[0].as_f64().unwrap()), "{direction}");
        assert!(pdf.as_f64().unwrap() > 0.0);
    }
    draw("7", "0");
    refused(2, &["sample", &made, "--wi", "30,40", "-n", "0"]);
    refused(2, &["sample", &made, "-n", "10"]);
}

#[test]
fn what_is_known_is_listed() {
    for (command, name) in [("bases", "bior4.4"), ("bases", "klt"), ("formats", "npy")] {
        let known = json(&[command, "--json"]);
        assert!(known.as_array().unwrap().iter().any(|one| one["name"] == name), "{known}");
        assert!(done(&[command]).contains(name));
    }
    let template = done(&["formats", "--template", "radiometric-csv-wide"]);
    assert!(template.starts_with("# radiometric-csv: 1\n") && template.ends_with("0.26\n"), "{template}");
    assert!(done(&["formats", "--template", "npy"]).contains("\"axes\""));
    assert!(refused(2, &["formats", "--template", "lm-63"]).contains("radiometric-csv-long"));
    assert!(done(&["openapi"]).starts_with("openapi:"));
    assert!(done(&["--version"]).starts_with("wavelume "));
    assert!(done(&["compress", "--help"]).contains("--max-relative-error"));
}

#[test]
fn a_closed_stdout_is_no_failure() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_wavelume"))
        .args(["formats"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
}
