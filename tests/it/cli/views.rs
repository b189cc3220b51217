//! `wavelume color` and `wavelume preview`: answers, pictures, one-line refusals.

use super::{at, data, done, json, refused};
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;

/// Compresses the chart of patches without loss.
fn checker(dir: &TempDir) -> String {
    let out = at(dir, "checker.wlm");
    done(&["compress", &data("colorchecker_n_ohta.csv"), "--quantity", "reflectance", "--lossless", "-o", &out]);
    out
}

#[test]
fn colours_are_told_under_names_and_files() {
    let dir = tempfile::tempdir().unwrap();
    let checker = checker(&dir);
    let golden: Value = serde_json::from_str(include_str!("../../golden/colour_science.json")).unwrap();
    let lab = |answer: &Value| -> Vec<f64> {
        answer["colours"][0]["lab"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
    };
    let near = |a: &[f64], b: &[f64], off: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() < off);
    let table = data("illuminant_F11.csv");
    let wanted: Vec<f64> =
        golden["patches"]["F11"][4]["lab"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    for light in ["F11", &table] {
        let found = json(&["color", &checker, "--index", "4", "--illuminant", light]);
        assert!(near(&lab(&found), &wanted, 1e-4), "{light}: {found}");
        assert_eq!(found["illuminant"], *Path::new(light).file_name().unwrap().to_str().unwrap());
        assert_eq!(found["colours"][0]["label"], "blue flower");
    }
    let compressed = at(&dir, "light.wlm");
    done(&["compress", &table, "--lossless", "-o", &compressed]);
    let found = json(&["color", &checker, "--index", "4", "--illuminant", &compressed]);
    assert!(near(&lab(&found), &wanted, 1e-4), "{found}");
    let functions = data("cmfs_CIE_1964_10_Degree_Standard_Observer.csv");
    let known = json(&["color", &checker, "--index", "4", "--observer", "1964"]);
    let own = json(&["color", &checker, "--index", "4", "--observer", &functions]);
    assert!(near(&lab(&known), &lab(&own), 1e-4), "{own}");
    assert_eq!(json(&["color", &checker])["colours"].as_array().unwrap().len(), 24);
    // The spectrum of a patch may serve as an illuminant.
    let column = json(&["color", &checker, "--index", "4", "--illuminant", &checker, "--illuminant-column", "red"]);
    assert_eq!(column["illuminant"], "checker.wlm, red");

    for (code, line, says) in [
        (
            2,
            &["--illuminant", "D93"][..],
            "unknown illuminant `D93`, expected one of A, B, C, D50, D65, F11, E, or a file",
        ),
        (2, &["--observer", "1932"], "unknown observer `1932`, expected one of 1931, 1964, or a file"),
        (2, &["--observer", &table], "1 columns over wavelength, expected 3"),
        (2, &["--illuminant", &checker], "24 columns, expected one"),
        (2, &["--illuminant", "A", "--illuminant-column", "1"], "A is no table"),
        (2, &["--illuminant", &data("aerolamp.ies")], "expected a spectral table"),
        (2, &["--illuminant", &data("aerolamp.csv")], "expected at least 400 to 700 nm"),
        (2, &["--wi", "30,0"], "does not depend on an incoming direction"),
        (2, &["--index", "24"], "expected 0 to 23"),
        (1, &["--illuminant", env!("CARGO_MANIFEST_DIR")], "is a directory"),
    ] {
        let stderr = refused(code, &[&["color", &checker], line].concat());
        assert!(stderr.contains(says), "{line:?}: {stderr}");
    }
}

#[test]
fn pictures_are_written_whole_and_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let checker = checker(&dir);
    let lamp = at(&dir, "lamp.wlm");
    done(&["compress", &data("aerolamp.ies"), "-o", &lamp]);
    for material in [&checker, &lamp] {
        let mut pictures = Vec::new();
        for threads in ["1", "2"] {
            let out = at(&dir, "picture.png");
            assert_eq!(done(&["preview", material, "-o", &out, "--size", "100", "--threads", threads]), "");
            pictures.push(std::fs::read(out).unwrap());
        }
        assert!(pictures[0].starts_with(b"\x89PNG\r\n\x1a\n") && pictures[0] == pictures[1]);
        assert_eq!(pictures[0][16..24], [0, 0, 0, 100, 0, 0, 0, 100]);
    }
    let out = at(&dir, "none.png");
    for (line, says) in [
        (&["--size", "63"][..], "expected 64 to 2048 pixels"),
        (&["--size", "2049"], "expected 64 to 2048 pixels"),
        (&["--style", "grey"], "possible values: dark, light"),
        (&["--illuminant", "D93"], "unknown illuminant `D93`"),
        (&["--index", "0,0"], "index [0, 0], expected"),
    ] {
        let stderr = refused(2, &[&["preview", &checker, "-o", &out], line].concat());
        assert!(stderr.contains(says), "{line:?}: {stderr}");
    }
    assert!(!Path::new(&out).exists());
}

#[test]
fn incoming_directions_too_sparse_for_the_lobe_are_warned_of() {
    let dir = tempfile::tempdir().unwrap();
    let (input, out) = (at(&dir, "virtual.json"), at(&dir, "m.wlm"));
    let gloss = r#"{"ggx": {"alpha": {"isotropic": 0.16}, "fresnel": "mirror"}}"#;
    for (model, warned) in [(gloss, true), (r#"{"lambert": {"reflectance": 0.5}}"#, false)] {
        let document = format!(
            r#"{{"wavelume": "virtual", "quantity": "brdf", "model": {model}, "axes": ["hemi:1", "hemi:4", "lambda:500:50:3"]}}"#
        );
        std::fs::write(&input, document).unwrap();
        let says = |text: &str| text.contains("incoming directions are too sparse for the lobe");
        let report = json(&["compress", &input, "-o", &out, "--json"]);
        let warnings = |report: &Value, name: &str| -> Vec<Value> {
            let notes = report[name].as_array().unwrap();
            notes.iter().filter(|note| note["kind"] == "warning").cloned().collect()
        };
        assert_eq!(says(&format!("{:?}", warnings(&report, "notes"))), warned, "{report}");
        assert_eq!(says(&done(&["compress", &input, "-o", &out])), warned);
        let report = json(&["inspect", &out, "--json"]);
        assert_eq!((warnings(&report, "notes").len(), says(&report.to_string())), (usize::from(warned), warned));
        assert_eq!(says(&done(&["inspect", &out])), warned);
        let report = json(&["inspect", &input, "--json"]);
        assert_eq!(says(&format!("{:?}", warnings(&report, "warnings"))), warned, "{report}");
    }
}
