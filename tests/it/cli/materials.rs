//! Materials as a user takes them apart and puts them together: slices, coarser levels, exports, sums.

use super::{INCOMING, LAMBDAS, OUTGOING, at, data, done, json, material, read_npy, refused, samples, workshop};
use serde_json::Value;
use std::fs;
use std::path::Path;

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
    assert!(refused(1, &["decode", &cut, "--level", "0", "-o", &array]).contains("the file is cut short"));
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
        assert!(refusal.contains("has no incoming direction number"), "{refusal}");
        refused(2, &["decode", &made, "--incoming", "0", "--level", "0", "-o", &array]);
    }
    let refusal =
        refused(2, &["compress", &at(&dir, "brdf.npy"), "-o", &made, "--random-access", "--policy", "conventional"]);
    assert!(refusal.contains("--random-access: policy conventional"), "{refusal}");
}

#[test]
fn inspect_tells_measurements_from_materials() {
    let dir = workshop();
    let measured = json(&["inspect", &at(&dir, "brdf.npy"), "--json"]);
    assert_eq!(measured["kind"], "measurement");
    assert_eq!(measured["quantity"], "brdf");
    assert_eq!(measured["tensor"]["shape"], serde_json::json!([INCOMING, OUTGOING, LAMBDAS]));
    assert_eq!(measured["tensor"]["masked_samples"], LAMBDAS);
    // The names of an upload over HTTP.
    assert_eq!(measured["axes"][2]["kind"], "wavelength");
    assert_eq!(measured["coverage"]["missing_samples"], LAMBDAS);
    let made = material(&dir);
    let material = json(&["inspect", &made, "--json"]);
    assert_eq!(material["kind"], "material");
    assert_eq!(material["shape"], measured["tensor"]["shape"]);
    // The names and values of the report of the compression.
    let report = json(&["compress", &at(&dir, "brdf.npy"), "-o", &made, "--json"]);
    for name in ["digest", "payload_digest", "axes", "policy", "basis", "bytes", "ratio_bytes", "levels", "samples"] {
        assert_eq!(material[name], report[name], "{name}");
    }
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
fn a_luminaire_comes_back_on_the_angles_of_its_file() {
    let dir = workshop();
    let (lamp, out) = (at(&dir, "lamp.wlm"), at(&dir, "lamp.ies"));
    for (target, promised) in [(&["--lossless"][..], 0.0), (&["--er-l2", "0.01"], 1.0)] {
        done(&[&["compress", &data("ushio_b1.ies"), "-o", &lamp, "--domain", "grid"], target].concat());
        let shown = done(&["export", &lamp, "--format", "ies", "-o", &out]);
        assert!(shown.contains("grid of 37 × 17") && shown.contains("as in the source"), "{shown}");
        let added = shown.split("error added  er(L2) ").nth(1).and_then(|rest| rest.split(' ').next());
        assert!(added.unwrap().parse::<f64>().unwrap() <= 0.1 * promised, "{shown}");
        assert!(shown.contains("luminaire    peak +0.0") && shown.contains("% of the peak, er(L2) "), "{shown}");
        let text = fs::read_to_string(&out).unwrap();
        let source = fs::read_to_string(data("ushio_b1.ies")).unwrap();
        let keyword = |text: &str, key: &str| text.lines().find(|line| line.starts_with(key)).unwrap().to_owned();
        assert_eq!(keyword(&text, "[MANUFAC]"), keyword(&source, "[MANUFAC]"));
        assert!(text.len() < source.len(), "{} {}", text.len(), source.len());
    }
    let answer = json(&["export", &lamp, "--format", "ies", "-o", &out, "--step", "5", "--json"]);
    assert!(answer["resolution"].as_str().unwrap().ends_with("gamma angles"), "{answer}");
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
    let refusal = refused(2, &["export", &made, "--format", "merl", "-o", &at(&dir, "m.binary")]);
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
    assert!(answer["lamp"]["peak"].as_f64().unwrap().abs() < 0.05, "{answer}");
    let light = at(&dir, "light.wlm");
    done(&["compress", &data("illuminant_D65.csv"), "-o", &light]);
    done(&["export", &light, "--format", "spd", "-o", &at(&dir, "light.spd")]);
    let text = fs::read_to_string(dir.path().join("light.spd")).unwrap();
    assert!(text.lines().filter(|line| !line.starts_with('#')).all(|line| line.split(' ').count() == 2), "{text}");
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
