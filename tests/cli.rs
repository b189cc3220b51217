//! The program as a user runs it: every command, its JSON, its exit codes and its one-line refusals.

#![allow(clippy::unwrap_used, reason = "a test's helper fails by panicking, like the test")]

use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use tempfile::TempDir;

const INCOMING: usize = 4;
const OUTGOING: usize = 16;
const LAMBDAS: usize = 5;
const MANIFEST: &str = r#"{"quantity":"brdf","axes":["hemi:0","hemi:1","lambda:400:50:5"]}"#;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn data(name: &str) -> String {
    root().join("data").join(name).display().to_string()
}

fn wavelume(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_wavelume")).args(args).stdin(Stdio::null()).output().unwrap()
}

/// Stdout of a run that must be done.
fn done(args: &[&str]) -> String {
    let output = wavelume(args);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{args:?}: {stderr}");
    String::from_utf8(output.stdout).unwrap()
}

fn json(args: &[&str]) -> Value {
    let text = done(args);
    assert_eq!(text.lines().count(), 1, "{args:?}: JSON is one line");
    serde_json::from_str(&text).unwrap()
}

/// The line on stderr of a run that must be refused with `code`.
fn refused(code: i32, args: &[&str]) -> String {
    let output = wavelume(args);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {stderr}");
    assert!(output.stdout.is_empty(), "{args:?}: {:?}", String::from_utf8_lossy(&output.stdout));
    assert_eq!(stderr.lines().count(), 1, "{args:?}: {stderr}");
    assert!(stderr.starts_with("wavelume: "), "{args:?}: {stderr}");
    stderr
}

fn npy(shape: &[usize], samples: &[f32]) -> Vec<u8> {
    let shape = shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(",") + ",";
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}");
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(samples.iter().flat_map(|s| s.to_le_bytes()));
    bytes
}

/// Shape text and samples of a float32 array.
fn read_npy(path: &Path) -> (String, Vec<f32>) {
    let bytes = fs::read(path).unwrap();
    assert!(bytes.starts_with(b"\x93NUMPY\x01\x00"), "{}", path.display());
    let header = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let text = std::str::from_utf8(&bytes[10..10 + header]).unwrap();
    assert!(text.contains("'<f4'") && text.contains("False"), "{text}");
    let shape = text.split_once('(').unwrap().1.split_once(')').unwrap().0.to_owned();
    let samples = bytes[10 + header..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    (shape, samples)
}

/// A smooth BRDF, masked at one pair of directions.
fn samples() -> Vec<f32> {
    let mut samples = Vec::new();
    for i in 0..INCOMING {
        for o in 0..OUTGOING {
            for l in 0..LAMBDAS {
                let value = 0.2 + 0.05 * (o as f32 * 0.4 + i as f32).sin() + 0.02 * l as f32;
                samples.push(if (i, o) == (1, 7) { f32::NAN } else { value });
            }
        }
    }
    samples
}

/// A directory with `brdf.npy` and its side-car.
fn workshop() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("brdf.npy"), npy(&[INCOMING, OUTGOING, LAMBDAS], &samples())).unwrap();
    fs::write(dir.path().join("brdf.axes.json"), MANIFEST).unwrap();
    dir
}

fn at(dir: &TempDir, name: &str) -> String {
    dir.path().join(name).display().to_string()
}

/// `brdf.wlm` of a workshop.
fn material(dir: &TempDir) -> String {
    let out = at(dir, "brdf.wlm");
    done(&["compress", &at(dir, "brdf.npy"), "-o", &out]);
    out
}

fn er_l2(original: &[f32], decoded: &[f32]) -> f64 {
    let scored = original.iter().zip(decoded).filter(|(s, _)| **s > 0.0);
    let relative: Vec<f64> = scored.map(|(s, d)| f64::from(d - s) / f64::from(*s)).collect();
    (relative.iter().map(|r| r * r).sum::<f64>() / relative.len() as f64).sqrt()
}

#[test]
fn the_first_bytes_of_a_material_decode_to_a_coarser_level() {
    let dir = workshop();
    let (made, cut, array) = (at(&dir, "brdf.wlm"), at(&dir, "cut.wlm"), at(&dir, "coarse.npy"));
    done(&["compress", &at(&dir, "brdf.npy"), "-o", &made, "--basis", "klt"]);
    let levels = json(&["inspect", &made, "--json"])["levels"].clone();
    let levels = levels.as_array().unwrap();
    assert!(levels.len() > 1 && done(&["inspect", &made]).contains("levels"), "{levels:?}");
    let bytes = fs::read(&made).unwrap();
    for level in levels {
        fs::write(&cut, &bytes[..level["bytes"].as_u64().unwrap() as usize]).unwrap();
        let number = level["level"].to_string();
        let report = json(&["decode", &cut, "--level", &number, "-o", &array, "--json"]);
        let cells = 4_usize << (2 * level["level"].as_u64().unwrap());
        assert_eq!(report["shape"], serde_json::json!([INCOMING, cells, LAMBDAS]));
        assert!(level["er_l2"].as_f64().unwrap() < 1.0);
    }
    refused(1, &["decode", &made, "--level", "9", "-o", &array]);
    fs::write(&cut, &bytes[..levels[0]["bytes"].as_u64().unwrap() as usize - 1]).unwrap();
    assert!(refused(1, &["decode", &cut, "--level", "0", "-o", &array]).contains("the file ends"));
}

#[test]
fn a_slice_of_a_material_is_that_of_the_whole() {
    let dir = workshop();
    let (made, array, whole) = (at(&dir, "brdf.wlm"), at(&dir, "slice.npy"), at(&dir, "whole.npy"));
    let body = |path: &str| {
        let bytes = fs::read(path).unwrap();
        let header = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        bytes[10 + header..].to_vec()
    };
    for options in [&["--random-access"][..], &[]] {
        done(&[&["compress", &at(&dir, "brdf.npy"), "-o", &made][..], options].concat());
        let levels = json(&["inspect", &made, "--json"])["levels"].as_array().unwrap().len();
        assert!(options.is_empty() || levels == 1);
        done(&["decode", &made, "-o", &whole]);
        let all = body(&whole);
        for incoming in 0..INCOMING {
            let report = json(&["decode", &made, "--incoming", &incoming.to_string(), "-o", &array, "--json"]);
            assert_eq!(report["shape"], serde_json::json!([OUTGOING, LAMBDAS]));
            assert_eq!(body(&array), all[incoming * OUTGOING * LAMBDAS * 4..][..OUTGOING * LAMBDAS * 4]);
        }
        let beyond = INCOMING.to_string();
        let refusal = refused(1, &["decode", &made, "--incoming", &beyond, "-o", &array]);
        assert!(refusal.contains("there is no incoming entry"), "{refusal}");
        refused(2, &["decode", &made, "--incoming", "0", "--level", "0", "-o", &array]);
    }
    let refusal =
        refused(2, &["compress", &at(&dir, "brdf.npy"), "-o", &made, "--random-access", "--policy", "conventional"]);
    assert!(refusal.contains("random_access: found policy conventional"), "{refusal}");
}

#[test]
fn compress_reports_every_field_of_the_contract() {
    let dir = workshop();
    let out = at(&dir, "m.wlm");
    let report = json(&["compress", &at(&dir, "brdf.npy"), "-o", &out, "--er-l2", "0.02", "--json"]);
    for field in [
        "bytes",
        "samples",
        "kept_coefficients",
        "ratio_coefficients",
        "ratio_bytes",
        "er_l1",
        "er_l2",
        "relative_rmse",
        "max_relative_error",
        "zero_samples",
        "masked_samples",
        "seconds",
        "digest",
        "payload_digest",
        "quantity",
        "unit",
        "axes",
        "policy",
        "basis",
        "noise",
        "coverage",
        "notes",
        "levels",
    ] {
        assert!(report.get(field).is_some(), "no {field} in {report}");
    }
    let bytes = fs::read(&out).unwrap();
    assert_eq!(report["bytes"], bytes.len());
    assert_eq!(report["digest"], format!("b3-{}", blake3::hash(&bytes).to_hex()));
    assert_eq!(report["samples"], INCOMING * OUTGOING * LAMBDAS);
    assert_eq!(report["masked_samples"], LAMBDAS);
    assert!(report["er_l2"].as_f64().unwrap() <= 0.02);
    assert!(report["noise"].is_null(), "meshes too coarse to tell: {report}");
}

#[test]
fn a_promise_below_the_noise_is_kept_and_warned_of() {
    let dir = workshop();
    let mut state = 1_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    // The sum of twelve uniform deviates has variance 1.
    let samples: Vec<f32> = (0..512 * 20)
        .map(|i| {
            let noise = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            ((1.0 + 0.1 * f64::from(i % 20)) * (1.0 + 0.01 * noise)) as f32
        })
        .collect();
    let (input, out) = (at(&dir, "noisy.npy"), at(&dir, "noisy.wlm"));
    fs::write(&input, npy(&[512, 20], &samples)).unwrap();
    let manifest = r#"{"quantity":"edf","axes":["sphere:3","lambda:400:10:20"]}"#;
    fs::write(at(&dir, "noisy.axes.json"), manifest).unwrap();
    let warning = |report: &Value| {
        let notes = report["notes"].as_array().unwrap();
        notes.iter().any(|note| note["kind"] == "warning" && note["message"].as_str().unwrap().contains("noise"))
    };
    for (target, warned) in [("0.002", true), ("0.02", false)] {
        let report = json(&["compress", &input, "-o", &out, "--er-l2", target, "--json"]);
        let sigma = report["noise"]["relative"].as_f64().unwrap();
        assert!((sigma - 0.01).abs() < 0.001, "{report}");
        assert_eq!(warning(&report), warned, "{report}");
    }
    let text = done(&["compress", &input, "-o", &out, "--max-relative-error", "0.01"]);
    assert!(text.contains("from sample to sample"), "{text}");
    assert!(text.contains("max_relative_error 0.01 lies below the noise"), "{text}");
}

#[test]
fn every_promise_is_kept_on_the_decoded_file() {
    let dir = workshop();
    let (input, out, tensor) = (at(&dir, "brdf.npy"), at(&dir, "m.wlm"), at(&dir, "t.npy"));
    for promise in [
        &["--er-l2", "0.001"][..],
        &["--er-l1", "0.003"],
        &["--max-absolute-error", "0.002"],
        &["--relative-rmse", "0.003"],
        &["--max-relative-error", "0.01"],
        &["--ratio", "4"],
        &["--bytes", "2000"],
        &["--lossless"],
        &["--policy", "conventional", "--er-l2", "0.02"],
        &[],
    ] {
        let report = json(&[&["compress", &input, "-o", &out, "--json"], promise].concat());
        done(&["decode", &out, "-o", &tensor]);
        let (shape, decoded) = read_npy(Path::new(&tensor));
        assert_eq!(shape.replace(' ', "").trim_end_matches(','), "4,16,5", "{promise:?}");
        let original = samples();
        assert!(original.iter().zip(&decoded).all(|(s, d)| s.is_nan() == d.is_nan()), "{promise:?}: mask");
        let error = er_l2(&original, &decoded);
        let largest = original.iter().zip(&decoded).filter(|(s, _)| **s > 0.0);
        let largest = largest.map(|(s, d)| (f64::from(*d) - f64::from(*s)).abs() / f64::from(*s)).fold(0.0, f64::max);
        match promise {
            [] => assert!(error <= 0.01),
            ["--max-relative-error", _] => assert!(largest <= 0.01, "{largest}"),
            ["--er-l1", _] => {
                let scored = original.iter().zip(&decoded).filter(|(s, _)| **s > 0.0);
                let errors: Vec<f64> = scored.map(|(s, d)| f64::from((d - s).abs()) / f64::from(*s)).collect();
                let mean = errors.iter().sum::<f64>() / errors.len() as f64;
                assert!(mean <= 0.003, "{mean}");
            }
            ["--max-absolute-error", _] => {
                let both = original.iter().zip(&decoded).filter(|(s, _)| !s.is_nan());
                assert!(both.into_iter().all(|(s, d)| (f64::from(*d) - f64::from(*s)).abs() <= 0.002));
            }
            ["--relative-rmse", _] => assert!(report["relative_rmse"].as_f64().unwrap() <= 0.003),
            ["--ratio", _] => assert!(report["ratio_coefficients"].as_f64().unwrap() >= 4.0),
            ["--bytes", _] => assert!(report["bytes"].as_u64().unwrap() <= 2000),
            ["--lossless"] => {
                assert!(original.iter().zip(&decoded).all(|(s, d)| s.is_nan() || s.to_bits() == d.to_bits()));
            }
            [.., limit] => assert!(error <= limit.parse().unwrap(), "{promise:?}: {error}"),
        }
        let reported = report["er_l2"].as_f64().unwrap();
        assert!((reported - error).abs() <= 1e-6 * error + 1e-9, "{promise:?}: reports {reported}, measured {error}");
    }
}

#[test]
fn colours_are_promised_and_reported() {
    let dir = workshop();
    let out = at(&dir, "checker.wlm");
    let checker = data("colorchecker_n_ohta.csv");
    let line = ["compress", &checker, "-o", &out, "--quantity", "reflectance", "--delta-e", "0.5"];
    let report = json(&[&line[..], &["--json"]].concat());
    let colour = &report["delta_e"];
    assert!(colour["largest"].as_f64().unwrap() <= 0.5 && colour["mean"].as_f64() <= colour["largest"].as_f64());
    assert_eq!(
        (&colour["illuminant"], &colour["spectra"], &colour["unscored_spectra"]),
        (&"D65".into(), &24.into(), &0.into())
    );
    let incandescent = json(&[&line[..], &["--illuminant", "A", "--json"]].concat());
    assert_eq!(incandescent["delta_e"]["illuminant"], "A");
    let sheet = done(&[&line[..], &["--illuminant", "F11"]].concat());
    assert!(sheet.contains("CIEDE2000 largest 0.") && sheet.contains("illuminant F11"), "{sheet}");
    let plain = json(&["compress", &checker, "-o", &out, "--quantity", "reflectance", "--json"]);
    assert!(plain["delta_e"].is_null());

    let lamp = data("aerolamp.csv");
    let refusal = refused(2, &["compress", &lamp, "-o", &out, "--delta-e", "1"]);
    assert!(
        refusal.contains("delta_e: wavelengths from 199.9") && refusal.contains("at least 400 to 700 nm"),
        "{refusal}"
    );
    let refusal = refused(2, &[&line[..], &["--policy", "conventional"]].concat());
    assert!(refusal.contains("expected policy rd"), "{refusal}");
}

#[test]
fn the_bytes_do_not_depend_on_threads_runs_or_paths() {
    let dir = workshop();
    let other = workshop();
    for (input, options) in [(at(&dir, "brdf.npy"), &[][..]), (data("aerolamp.ies"), &["--outgoing-level", "2"])] {
        let make = |out: &str, threads: &str| {
            done(&[&["compress", &input, "-o", out, "--threads", threads], options].concat());
            fs::read(out).unwrap()
        };
        let first = make(&at(&dir, "1.wlm"), "1");
        assert_eq!(first, make(&at(&dir, "2.wlm"), "2"));
        assert_eq!(first, make(&at(&other, "elsewhere.wlm"), "3"));
    }
}

#[test]
fn without_metadata_only_the_provenance_is_gone() {
    let dir = workshop();
    let (whole, bare) = (at(&dir, "whole.wlm"), at(&dir, "bare.wlm"));
    let a = json(&["compress", &at(&dir, "brdf.npy"), "-o", &whole, "--json"]);
    let b = json(&["compress", &at(&dir, "brdf.npy"), "-o", &bare, "--no-metadata", "--json"]);
    assert_eq!(a["payload_digest"], b["payload_digest"]);
    assert!(a["bytes"].as_u64() > b["bytes"].as_u64());
    assert_eq!(json(&["inspect", &bare, "--json"])["provenance"], Value::Null);
    let provenance = json(&["inspect", &whole, "--json"])["provenance"].to_string();
    assert!(!provenance.contains(dir.path().to_str().unwrap()), "{provenance}");
}

#[test]
fn inspect_tells_measurements_from_materials() {
    let dir = workshop();
    let measured = json(&["inspect", &at(&dir, "brdf.npy"), "--json"]);
    assert_eq!(measured["kind"], "measurement");
    assert_eq!(measured["quantity"], "brdf");
    assert_eq!(measured["shape"], serde_json::json!([INCOMING, OUTGOING, LAMBDAS]));
    assert_eq!(measured["masked_samples"], LAMBDAS);
    let made = material(&dir);
    let material = json(&["inspect", &made, "--json"]);
    assert_eq!(material["kind"], "material");
    assert_eq!(material["shape"], measured["shape"]);
    assert!(material["er_l2"].as_f64().unwrap() <= 0.01);
    assert!(done(&["inspect", &made]).contains("er(L2)"));
    let lamp = done(&["inspect", &data("aerolamp.ies")]);
    assert!(lamp.contains("LM-63") && lamp.contains("coverage"), "{lamp}");
}

#[test]
fn projected_and_exported_arrays_can_be_read_again() {
    let dir = workshop();
    let tensor = at(&dir, "t.npy");
    done(&["project", &at(&dir, "brdf.npy"), "-o", &tensor]);
    let (_, projected) = read_npy(Path::new(&tensor));
    let same = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| a == b || (a.is_nan() && b.is_nan()));
    assert!(same(&projected, &samples()));
    let manifest: Value = serde_json::from_slice(&fs::read(dir.path().join("t.axes.json")).unwrap()).unwrap();
    assert_eq!(manifest["quantity"], "brdf");
    let (again, exported) = (at(&dir, "again.npy"), at(&dir, "exported.npy"));
    done(&["project", &tensor, "-o", &again]);
    assert_eq!(fs::read(&tensor).unwrap(), fs::read(&again).unwrap());
    let made = material(&dir);
    let answer = json(&["export", &made, "--format", "npy", "-o", &exported, "--json"]);
    assert_eq!(answer["shape"], serde_json::json!([INCOMING, OUTGOING, LAMBDAS]));
    assert_eq!((&answer["format"], &answer["error"]["er_l2"]), (&"npy".into(), &0.0.into()));
    done(&["compress", &exported, "-o", &at(&dir, "again.wlm"), "--lossless"]);
    let lamp = at(&dir, "lamp.npy");
    done(&["project", &data("aerolamp.ies"), "-o", &lamp, "--outgoing-level", "1"]);
    assert_eq!(read_npy(Path::new(&lamp)).1.len(), 32);
}

#[test]
fn exports_state_their_error_and_refusals_name_what_fits() {
    let dir = workshop();
    let (made, out) = (material(&dir), at(&dir, "m.bsdf"));
    let rgl = ["export", &made, "--format", "rgl", "-o", &out, "--side", "8", "--step", "45"];
    let answer = json(&[&rgl[..], &["--json"]].concat());
    assert_eq!(answer["resolution"], "9 × 3 incident directions, 8 × 8 nodes");
    assert_eq!(answer["bytes"], fs::metadata(&out).unwrap().len());
    let error = answer["error"]["er_l2"].as_f64().unwrap();
    assert!(error > 0.0 && error < 0.5 && answer["error"]["pairs"] == 10_000, "{answer}");
    let shown = done(&rgl);
    assert!(shown.contains("error added  er(L2) ") && shown.contains("the spectrum at 10,000 pairs"), "{shown}");
    let again = json(&["inspect", &out, "--json"]);
    assert_eq!((&again["format"], &again["quantity"]), (&"rgl".into(), &"brdf".into()));
    let refusal = refused(2, &["export", &made, "--format", "merl", "-o", &out]);
    assert!(refusal.trim_end().ends_with("it can be written as rgl or npy"), "{refusal}");
    assert!(refused(2, &["export", &made, "--format", "axf", "-o", &out]).contains("expected one of rgl, merl"));
    assert!(
        refused(2, &["export", &made, "--format", "npy", "-o", &at(&dir, "none/x.npy"), "--side"]).contains("side")
    );
    refused(2, &["export", &made, "--format", "rgl", "-o", &out, "--side", "1"]);

    let lamp = at(&dir, "lamp.wlm");
    done(&["compress", &data("aerolamp.ies"), "-o", &lamp, "--outgoing-level", "3"]);
    let answer = json(&["export", &lamp, "--format", "ies", "-o", &at(&dir, "lamp.ies"), "--json"]);
    assert_eq!((&answer["format"], &answer["unit"]), (&"lm63".into(), &"mW/sr".into()));
    assert!(answer["flux_error"].as_f64().unwrap().abs() < 0.005, "{answer}");
    let light = at(&dir, "light.wlm");
    done(&["compress", &data("illuminant_D65.csv"), "-o", &light]);
    done(&["export", &light, "--format", "spd", "-o", &at(&dir, "light.spd")]);
    let text = fs::read_to_string(dir.path().join("light.spd")).unwrap();
    assert!(text.lines().filter(|line| !line.starts_with('#')).all(|line| line.split(' ').count() == 2), "{text}");
}

#[test]
fn an_array_needs_its_manifest() {
    let dir = workshop();
    let (bare, out) = (at(&dir, "bare.npy"), at(&dir, "m.wlm"));
    fs::copy(dir.path().join("brdf.npy"), &bare).unwrap();
    refused(2, &["compress", &bare, "-o", &out]);
    done(&["compress", &bare, "-o", &out, "--axes", &at(&dir, "brdf.axes.json")]);
    fs::write(dir.path().join("bare.axes.json"), r#"{"axes":["hemi:0","hemi:1","lambda"]}"#).unwrap();
    refused(2, &["compress", &bare, "-o", &out, "--quantity", "brdf"]);
    refused(2, &["compress", &bare, "-o", &out, "--wavelengths", "400:600:50"]);
    done(&["compress", &bare, "-o", &out, "--quantity", "brdf", "--wavelengths", "400:600:50"]);
    fs::write(dir.path().join("bare.axes.json"), "{").unwrap();
    let line = refused(1, &["compress", &bare, "-o", &out]);
    assert!(line.contains("bare.axes.json: manifest: "), "{line}");
}

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
    for (command, name) in [("bases", "bior4.4"), ("formats", "npy")] {
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
fn wrong_usage_is_exit_code_2_and_one_line() {
    let dir = workshop();
    let (input, out) = (at(&dir, "brdf.npy"), at(&dir, "m.wlm"));
    for line in [
        &[][..],
        &["compres"],
        &["compress", &input],
        &["compress", "-o", &out],
        &["compress", &input, "-o", &out, "--er-l2", "0.01", "--ratio", "64"],
        &["compress", &input, "-o", &out, "--lossless", "--bytes", "100"],
        &["compress", &input, "-o", &out, "--er-l2", "-1"],
        &["compress", &input, "-o", &out, "--er-l2", "one"],
        &["compress", &input, "-o", &out, "--basis", "none-such"],
        &["compress", &input, "-o", &out, "--policy", "none-such"],
        &["compress", &input, "-o", &out, "--quantity", "brd"],
        &["compress", &input, "-o", &out, "--threads", "0"],
        &["compress", &input, "-o", &out, "--floor", "2"],
        &["compress", &input, "-o", &out, "--wavelengths", "400:300:5"],
        &["evaluate", &input, "--wi", "30", "--wo", "20,0"],
        &["export", &input, "-o", &out],
        &["serve", "--listen", "nowhere"],
    ] {
        refused(2, line);
    }
    assert!(!Path::new(&out).exists());
}

#[test]
fn malformed_files_are_exit_code_1_and_one_line() {
    let dir = workshop();
    let out = at(&dir, "m.wlm");
    let broken = |name: &str, bytes: &[u8]| {
        fs::write(dir.path().join(name), bytes).unwrap();
        at(&dir, name)
    };
    let infinite = [1.0, f32::INFINITY, 2.0, 3.0, 4.0];
    fs::write(dir.path().join("infinite.axes.json"), r#"{"quantity":"spectrum","axes":["lambda:400:50:5"]}"#).unwrap();
    fs::copy(dir.path().join("brdf.axes.json"), dir.path().join("huge.axes.json")).unwrap();
    for path in [
        broken("empty", b""),
        broken("prose.txt", b"no measurement at all\n"),
        broken("zeros.bin", &[0; 1000]),
        broken("magic.wlm", b"\x89WLM"),
        broken("infinite.npy", &npy(&[5], &infinite)),
        broken("huge.npy", &npy(&[100_000_000_000, 16, 5], &[])),
        broken("lamp.ies", b"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 1 1 2 0 0 0\n1 1 0\n0 45 90\n0\n1 2\n"),
        dir.path().display().to_string(),
        at(&dir, "missing.ies"),
    ] {
        refused(1, &["inspect", &path]);
        refused(1, &["compress", &path, "-o", &out]);
    }
    refused(1, &["decode", &at(&dir, "brdf.npy"), "-o", &out]);
    refused(1, &["evaluate", &at(&dir, "brdf.npy"), "--wo", "0,0"]);
    assert!(!Path::new(&out).exists());
}

#[test]
fn a_truncated_material_is_refused_wherever_it_is_cut() {
    let dir = workshop();
    let bytes = fs::read(material(&dir)).unwrap();
    let cut = at(&dir, "cut.wlm");
    for i in 0..50 {
        fs::write(&cut, &bytes[..bytes.len() * i / 50]).unwrap();
        refused(1, &["decode", &cut, "-o", &at(&dir, "t.npy")]);
    }
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 0x10;
    fs::write(&cut, flipped).unwrap();
    refused(1, &["decode", &cut, "-o", &at(&dir, "t.npy")]);
}

#[test]
fn a_failed_run_leaves_the_old_file_and_nothing_else() {
    let dir = workshop();
    let before = fs::read_dir(dir.path()).unwrap().count();
    let out = at(&dir, "brdf.wlm");
    fs::write(&out, "old").unwrap();
    refused(1, &["compress", &at(&dir, "brdf.npy"), "-o", &out, "--bytes", "1"]);
    assert_eq!(fs::read(&out).unwrap(), b"old");
    done(&["compress", &at(&dir, "brdf.npy"), "-o", &out]);
    assert_ne!(fs::read(&out).unwrap(), b"old");
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), before + 1);
    refused(1, &["compress", &at(&dir, "brdf.npy"), "-o", &at(&dir, "none/brdf.wlm")]);
    refused(1, &["compress", &at(&dir, "brdf.npy"), "-o", dir.path().to_str().unwrap()]);
}

#[test]
fn materials_are_combined_and_multiplied() {
    let dir = workshop();
    let compress = |name: &str, options: &[&str]| {
        let out = at(&dir, name);
        done(&[&["compress", &at(&dir, "brdf.npy"), "-o", &out], options].concat());
        out
    };
    let linear = ["--policy", "conventional", "--basis", "bior4.4", "--er-l2", "0.02"];
    let (a, b) = (compress("a.wlm", &linear), compress("b.wlm", &[&linear[..5], &["0.05"]].concat()));
    let rd = compress("rd.wlm", &[]);
    let decoded = |path: &str| {
        let out = at(&dir, "decoded.npy");
        done(&["decode", path, "-o", &out]);
        read_npy(Path::new(&out)).1
    };
    let out = at(&dir, "sum.wlm");
    let report = json(&["combine", &a, &b, "--weights", "0.5,-2", "-o", &out, "--json"]);
    assert_eq!((&report["method"], &report["policy"]), (&"coefficients".into(), &"conventional".into()));
    assert_eq!(report["operands"][1]["weight"], -2.0);
    assert!(report["inherited_absolute_error"].as_f64().unwrap() > 0.0);
    let (x, y, sum) = (decoded(&a), decoded(&b), decoded(&out));
    for ((x, y), sum) in x.iter().zip(&y).zip(&sum) {
        assert_eq!(x.is_nan(), sum.is_nan());
        assert!(x.is_nan() || (0.5 * x - 2.0 * y - sum).abs() < 1e-5, "{x} {y} {sum}");
    }
    let shown = done(&["combine", &a, &b, "-o", &out]);
    assert!(shown.contains("coefficients added") && shown.contains("error added"), "{shown}");
    let report = json(&["combine", &a, &rd, "-o", &out, "--json"]);
    assert_eq!((&report["method"], &report["policy"]), (&"samples".into(), &"rd".into()));
    assert!(report["er_l2"].as_f64().unwrap() <= 0.01);
    let again = json(&["combine", &a, &b, "--er-l1", "0.03", "--policy", "generic", "-o", &out, "--json"]);
    assert_eq!((&again["method"], &again["policy"]), (&"samples".into(), &"generic".into()));
    assert!(again["er_l1"].as_f64().unwrap() <= 0.03);

    let answer = json(&["dot", &a, &b]);
    let expected: f64 = x.iter().zip(&y).filter(|(x, _)| !x.is_nan()).map(|(&x, &y)| f64::from(x) * f64::from(y)).sum();
    assert!((answer["dot"].as_f64().unwrap() / expected - 1.0).abs() < 1e-5, "{answer} {expected}");
    assert_eq!((&answer["masked_samples"], &answer["units"][0]), (&LAMBDAS.into(), &"1/sr".into()));

    refused(2, &["combine", &a, &b, "--weights", "1", "-o", &out]);
    refused(2, &["combine", &a, "--weights", "x", "-o", &out]);
    refused(2, &["combine", "-o", &out]);
    let lamp = at(&dir, "lamp.wlm");
    done(&["compress", &data("illuminant_D65.csv"), "-o", &lamp]);
    let unlike = refused(2, &["combine", &a, &lamp, "-o", &out]);
    assert!(unlike.contains("material 2: quantity spectrum"), "{unlike}");
    refused(2, &["dot", &a, &lamp]);
    refused(1, &["dot", &a, &at(&dir, "brdf.npy")]);
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

/// A service that is stopped with the test.
struct Service {
    child: Child,
    address: String,
}

impl Service {
    fn start(data: &str) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_wavelume"))
            .args(["serve", "--data", data, "--listen", "127.0.0.1:0"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("listening on http://").unwrap().to_owned();
        Self { child, address }
    }

    fn signal(mut self, name: &str) -> Option<i32> {
        let sent = Command::new("kill").args([name, &self.child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        self.child.wait().unwrap().code()
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        // Ended already unless the test failed.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn serve_listens_is_healthy_and_drains_on_a_signal() {
    let dir = tempfile::tempdir().unwrap();
    let service = Service::start(&at(&dir, "data"));
    done(&["health", "--listen", &service.address]);
    done(&["health", &format!("http://{}", service.address)]);
    let taken = refused(1, &["serve", "--data", &at(&dir, "other"), "--listen", &service.address]);
    assert!(taken.contains("already taken") && taken.contains("--listen"), "{taken}");
    let address = service.address.clone();
    assert_eq!(service.signal("-TERM"), Some(0));
    refused(1, &["health", "--listen", &address]);
    assert_eq!(Service::start(&at(&dir, "data")).signal("-INT"), Some(0));
}

#[test]
fn a_data_directory_is_looked_after() {
    let dir = tempfile::tempdir().unwrap();
    let data = at(&dir, "data");
    refused(1, &["gc", "--data", &data]);
    refused(1, &["fsck", "--data", &data]);
    assert!(done(&["migrate", "--data", &data]).contains("applied"));
    assert_eq!(done(&["migrate", "--data", &data]), "up to date\n");
    assert_eq!(json(&["gc", "--data", &data, "--json"])["removed_blobs"], 0);
    assert_eq!(json(&["fsck", "--data", &data, "--json"])["faults"], serde_json::json!([]));
    done(&["gc", "--data", &data]);
    done(&["fsck", "--data", &data]);
}

#[test]
fn the_demo_compresses_real_measurements_and_uses_them_again() {
    let dir = tempfile::tempdir().unwrap();
    let demo = ["demo", "--once", "--data", &at(&dir, "data"), "--listen", "127.0.0.1:0"].map(str::to_owned);
    let demo: Vec<&str> = demo.iter().map(String::as_str).collect();
    let first = done(&demo);
    assert!(first.contains("er(L2)") && first.contains("curl") && first.contains("/content"), "{first}");
    assert!(!first.contains("used again"), "{first}");
    let second = done(&demo);
    assert!(second.contains("4 of 4 materials were in the data directory already"), "{second}");
}
