//! Compression as a user runs it: targets met by the decoded bytes, the report, equal bytes everywhere.

use super::{INCOMING, LAMBDAS, OUTGOING, at, data, done, er_l2, json, npy, read_npy, refused, samples, workshop};
use serde_json::Value;
use std::fs;
use std::path::Path;

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
    let notes = report["coverage"]["notes"].as_array().unwrap();
    assert!(!notes.is_empty() && notes.iter().all(|note| note["code"].is_string()), "{report}");
    let inspected = json(&["inspect", &at(&dir, "brdf.npy"), "--json"]);
    assert_eq!(inspected["tensor"]["coverage"], report["coverage"]);
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
    assert!(text.contains("--max-relative-error 0.01 lies below the noise"), "{text}");
}

/// Writes an array with its manifest; returns its path.
fn array(dir: &tempfile::TempDir, name: &str, (quantity, axes): (&str, &str), samples: &[f32]) -> String {
    let input = at(dir, &format!("{name}.npy"));
    fs::write(&input, npy(&[samples.len()], samples)).unwrap();
    fs::write(
        at(dir, &format!("{name}.axes.json")),
        format!(r#"{{"quantity":"{quantity}","unit":"relative","axes":{axes}}}"#),
    )
    .unwrap();
    input
}

#[test]
fn huge_samples_come_back_or_are_refused_with_a_remedy() {
    let dir = workshop();
    let out = at(&dir, "huge.wlm");
    let samples: Vec<f32> = (0..40).map(|i| 10_f32.powf(30.0 + 0.2 * i as f32).min(3.4e38)).collect();
    let input = array(&dir, "huge", ("spectrum", r#"["lambda:380:10:40"]"#), &samples);
    for target in [["--ratio", "8"], ["--ratio", "100"], ["--bytes", "200"], ["--bytes", "1000000"], ["--step", "8"]] {
        for policy in ["rd", "conventional", "generic", "adaptive"] {
            let _ = fs::remove_file(&out);
            let line = [&["compress", &input, "-o", &out, "--no-metadata", "--policy", policy], &target[..]].concat();
            let run = super::wavelume(&line);
            if run.status.code() == Some(0) {
                done(&["decode", &out, "-o", &at(&dir, "back.npy")]);
            } else {
                let text = String::from_utf8(run.stderr).unwrap();
                assert!(text.contains("; use ") || text.contains("; ask for "), "{line:?}: {text}");
                assert!(!Path::new(&out).exists(), "{line:?}");
            }
        }
    }
    // Logarithms of samples this large resolve 1e-5 or so in float32; more bytes do no harm.
    let report = json(&["compress", &input, "-o", &out, "--json", "--bytes", "1000000"]);
    assert!(report["er_l2"].as_f64().unwrap() < 2e-5, "{report}");
    follow_the_advice(&input, &out, "--er-l2", "1e-6");
    done(&["compress", &input, "-o", &out, "--max-absolute-error", "1e300"]);
    done(&["decode", &out, "-o", &at(&dir, "back.npy")]);
}

/// Requests a refused target, then the target that the refusal suggests.
fn follow_the_advice(input: &str, out: &str, option: &str, asked: &str) {
    let refused = super::wavelume(&["compress", input, "-o", out, option, asked]);
    let text = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(1), "{option} {asked}: {text}");
    let (_, advice) = text.split_once("; ask for ").unwrap();
    let (advice, _) = advice.split_once(" or more").unwrap();
    let number = advice.split(' ').next_back().unwrap();
    done(&["compress", input, "-o", out, option, number]);
}

#[test]
fn what_a_refusal_says_to_ask_for_works() {
    let dir = workshop();
    let out = at(&dir, "m.wlm");
    let lamp = concat!(env!("CARGO_MANIFEST_DIR"), "/data/illuminant_D65.csv");
    follow_the_advice(lamp, &out, "--bytes", "9");
    // Reproducible numbers of both signs and many sizes.
    let random = |i: u32| f64::from(i.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24);
    for seed in 0..6 {
        let samples: Vec<f32> = (0..64)
            .map(|i| (10_f64.powf(4.0 * random(97 * seed + 3 * i)) * (random(31 * seed + i) - 0.4)) as f32)
            .collect();
        let input = array(&dir, &format!("signed{seed}"), ("spectrum", r#"["lambda:400:2:64"]"#), &samples);
        for (option, asked) in
            [("--er-l2", "1e-8"), ("--er-l1", "1e-8"), ("--relative-rmse", "1e-9"), ("--max-relative-error", "1e-7")]
        {
            follow_the_advice(&input, &out, option, asked);
        }
    }
    let input = array(&dir, "zeros", ("spectrum", r#"["lambda:400:2:4"]"#), &[0.0; 4]);
    done(&["compress", &input, "-o", &out, "--max-absolute-error", "1e-39"]);
}

#[test]
fn a_ratio_that_is_not_reached_is_said_once() {
    let dir = workshop();
    let out = at(&dir, "few.wlm");
    let samples: Vec<f32> = (0..40).map(|i| 1.0 + (i as f32 * 0.3).sin() * 0.5).collect();
    let input = array(&dir, "few", ("spectrum", r#"["lambda:380:10:40"]"#), &samples);
    for (ratio, says) in [("1000", "ratio 1000 is more than the 40 samples"), ("8", "ratio 8 is kept in samples")] {
        let line = ["compress", &input, "-o", &out, "--ratio", ratio];
        let run = super::wavelume(&line);
        let (report, warned) = (String::from_utf8(run.stdout).unwrap(), String::from_utf8(run.stderr).unwrap());
        assert_eq!((report.matches(says).count(), warned.matches(says).count()), (1, 0), "{report}{warned}");
        let run = super::wavelume(&[&line[..], &["--json"]].concat());
        let report: Value = serde_json::from_slice(&run.stdout).unwrap();
        assert_eq!(report["notes"].to_string().matches(says).count(), 1, "{report}");
        assert_eq!(String::from_utf8(run.stderr).unwrap().matches(says).count(), 1);
    }
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
        refusal.contains(
            "--delta-e: colour differences of this measurement cannot be computed: wavelengths from 199.998 to"
        ) && refusal.contains("at least 400 to 700 nm"),
        "{refusal}"
    );
    let refusal = refused(2, &[&line[..], &["--policy", "conventional"]].concat());
    assert!(refusal.contains("use policy rd"), "{refusal}");
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
fn a_brdf_is_made_reciprocal_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let (source, made) = (at(&dir, "brdf.npy"), at(&dir, "brdf.wlm"));
    let values: Vec<f32> = (0..12).map(|i| 0.1 + 0.01 * ((7 * i) % 12) as f32).collect();
    fs::write(&source, npy(&[2, 2, 3], &values)).unwrap();
    let manifest = r#"{"quantity":"brdf","axes":[{"name":"theta_i","values":[0,45]},{"name":"theta_o","values":[0,45]},
        {"name":"phi_o","values":[0,90,180]}]}"#;
    fs::write(dir.path().join("brdf.axes.json"), manifest).unwrap();
    let compress = ["compress", &source, "-o", &made, "--domain", "grid", "--reciprocal", "--lossless"];
    let shown = done(&compress);
    assert!(shown.contains("reciprocal: each value is the mean with that of the exchanged pair"), "{shown}");
    let array = at(&dir, "back.npy");
    done(&["decode", &made, "-o", &array]);
    let (_, back) = read_npy(Path::new(&array));
    for (i, o, azimuth) in [(0, 1, 0), (0, 1, 2), (1, 0, 1), (1, 1, 1)] {
        let at = |i: usize, o: usize| (i * 2 + o) * 3 + azimuth;
        let mean = 0.5 * (f64::from(values[at(i, o)]) + f64::from(values[at(o, i)]));
        assert_eq!(back[at(i, o)], mean as f32, "{i} {o} {azimuth}");
    }
    let lamp = data("aerolamp.ies");
    let refusal = refused(1, &["compress", &lamp, "-o", &made, "--domain", "grid", "--reciprocal"]);
    assert!(refusal.contains("reciprocal: found edf, expected a brdf"), "{refusal}");
}
