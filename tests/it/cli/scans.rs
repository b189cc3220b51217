//! Scans without a grid as a user projects, compresses and inspects them: filled cells stay marked in every output.

use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Stdio};

fn json(directory: &Path, args: &[&str]) -> Value {
    let mut command = Command::new(env!("CARGO_BIN_EXE_wavelume"));
    let output = command.args(args).arg("--json").current_dir(directory).stdin(Stdio::null()).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Two incoming elevations, directions even in solid angle (R2, Roberts 2018) except 12 degrees around the lamp.
fn scan_with_a_blind_spot() -> String {
    let mut text =
        "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n# angle_unit: deg\n\
                    # isotropic: true\ntheta_i,theta_o,phi_o,value\n"
            .to_owned();
    for theta_i in [10.0_f64, 40.0] {
        for i in 0..900 {
            let [u, v] = [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (0.5 + f64::from(i) * step).fract());
            let (theta, phi) = ((1.0 - u).acos(), std::f64::consts::TAU * v);
            let lamp = theta_i.to_radians();
            let apart = theta.cos() * lamp.cos() + theta.sin() * lamp.sin() * phi.cos();
            if apart < 12.0_f64.to_radians().cos() {
                let value = 0.1 + 0.05 * theta.cos();
                writeln!(text, "{theta_i},{:.4},{:.4},{value:.6}", theta.to_degrees(), phi.to_degrees()).unwrap();
            }
        }
    }
    text
}

#[test]
fn filled_cells_are_marked_in_arrays_materials_and_reports() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    std::fs::write(at.join("scan.csv"), scan_with_a_blind_spot()).unwrap();
    let projected = json(at, &["project", "scan.csv", "-o", "scan.npy"]);
    let filled = projected["coverage"]["filled"].as_u64().unwrap();
    assert!(filled > 0, "{projected}");
    let notes = projected["coverage"]["notes"].as_array().unwrap();
    let continued = notes.iter().find(|note| note["code"] == "fit-continued");
    assert_eq!(
        continued.map(|note| (&note["kind"], &note["values"]["cells"])),
        Some((&json!("filled"), &json!(filled)))
    );
    assert_eq!(projected["filled"], "scan.filled.npy");

    // A header, then one float32 for each cell.
    let marks = std::fs::read(at.join("scan.filled.npy")).unwrap();
    let cells = projected["coverage"]["cells"].as_u64().unwrap();
    let (_, values) = marks.split_at(marks.len() - 4 * usize::try_from(cells).unwrap());
    let marked = values.chunks_exact(4).filter(|mark| **mark == 1.0_f32.to_le_bytes()).count();
    assert_eq!(marked as u64, filled);
    assert!(values.chunks_exact(4).all(|mark| mark == 1.0_f32.to_le_bytes() || mark == [0; 4]));

    json(at, &["compress", "scan.csv", "-o", "scan.wlm"]);
    let material = json(at, &["inspect", "scan.wlm"]);
    let provenance = &material["provenance"]["filled"];
    assert_eq!(provenance["cells"].as_u64(), Some(filled), "{material}");
    let runs: Vec<u64> = provenance["runs"].as_array().unwrap().iter().map(|run| run.as_u64().unwrap()).collect();
    assert_eq!(runs.iter().skip(1).step_by(2).sum::<u64>(), filled);
    let measured = json(at, &["inspect", "scan.csv"]);
    assert_eq!(measured["tensor"]["coverage"]["filled"].as_u64(), Some(filled), "{measured}");
}

/// A lobe over a base with noise of 1 % at directions even in solid angle, under one elevation.
pub(crate) fn noisy_lobe() -> String {
    let mut text =
        "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n# angle_unit: deg\n\
                    # isotropic: true\ntheta_i,theta_o,phi_o,value\n"
            .to_owned();
    let mut state = 1_u32;
    let mut even = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24)
    };
    for i in 0..2000 {
        let [u, v] = [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (0.5 + f64::from(i) * step).fract());
        let (theta, phi) = ((1.0 - u).acos(), std::f64::consts::TAU * v);
        // The direction 30 degrees from the normal, opposite to the light.
        let near = theta.cos() * 0.866_025 - theta.sin() * 0.5 * phi.cos();
        let noise = (0..12).map(|_| even()).sum::<f64>() - 6.0;
        let value = (0.1 + (20.0 * (near - 1.0)).exp()) * (1.0 + 0.01 * noise);
        writeln!(text, "30,{:.4},{:.4},{value:.6}", theta.to_degrees(), phi.to_degrees()).unwrap();
    }
    text
}

#[test]
fn what_a_material_adds_to_the_noise_is_stated_warned_of_and_refused() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    std::fs::write(at.join("lobe.csv"), noisy_lobe()).unwrap();
    let fit = json(at, &["compress", "lobe.csv", "-o", "lobe.wlm", "--strict"])["scattered"].clone();
    let number = |name: &str| fit[name].as_f64().unwrap();
    assert!((number("noise") - 0.01).abs() < 0.0025 && number("added") <= number("allowed"), "{fit}");
    assert_eq!((number("allowed"), &fit["rejected"]["values"]), (0.02, &Value::from(0)), "{fit}");
    let stated = json(at, &["inspect", "lobe.wlm"])["provenance"]["scattered"].clone();
    assert!((stated["fit"].as_f64().unwrap() / number("fit") - 1.0).abs() < 1e-3, "{stated}");

    let run = |args: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_wavelume"));
        let output = command.args(args).current_dir(at).stdin(Stdio::null()).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    let sheet = run(&["inspect", "lobe.wlm"]).1;
    assert!(sheet.contains("sample noise") && sheet.contains("no samples"), "{sheet}");
    let coarse = ["compress", "lobe.csv", "-o", "coarse.wlm", "--outgoing-level", "1"];
    let (code, sheet, warning) = run(&coarse);
    assert!(
        code == Some(0) && warning.is_empty() && sheet.contains("outgoing level 1 adds er(L2)"),
        "{sheet}{warning}"
    );
    assert!(sheet.contains("to their noise, at most 2.00 % is allowed"), "{sheet}");
    std::fs::remove_file(at.join("coarse.wlm")).unwrap();
    let (code, _, refusal) = run(&[&coarse[..], &["--strict"]].concat());
    assert!(code == Some(1) && refusal.contains("refused by --strict: outgoing level 1 adds er(L2)"), "{refusal}");
    assert!(!at.join("coarse.wlm").exists());
}

/// `noisy_lobe` with a stated uncertainty of this fraction of each value.
fn with_uncertainties(part: f64) -> String {
    let mut text = String::new();
    for line in noisy_lobe().lines() {
        let value = line.rsplit(',').next().and_then(|value| value.parse::<f64>().ok());
        match value {
            Some(value) => writeln!(text, "{line},{:.8}", part * value).unwrap(),
            None if line.starts_with('#') => writeln!(text, "{line}").unwrap(),
            None => writeln!(text, "{line},sigma").unwrap(),
        }
    }
    text
}

#[test]
fn stated_uncertainties_say_what_is_kept_and_where_auto_stops() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    let sheet = |args: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_wavelume"));
        let output = command.args(args).current_dir(at).stdin(Stdio::null()).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    // The noise is 1 %.
    std::fs::write(at.join("stated.csv"), with_uncertainties(0.01)).unwrap();
    let report = json(at, &["compress", "stated.csv", "-o", "stated.wlm"]);
    let within = report["within_2u"].as_f64().unwrap();
    // The promised error of 1 % comes on top of the noise.
    assert!((0.8..0.9).contains(&within), "{report}");
    assert_eq!(report["scattered"]["within_2u"], report["within_2u"]);
    assert!(report.get("auto").is_none(), "{report}");
    let stated = sheet(&["inspect", "stated.wlm"]);
    assert!(stated.contains("% of the values with a stated uncertainty u are kept within 2u"), "{stated}");

    let unsure = with_uncertainties(0.04).replace("# isotropic", "# detector_aperture: 3\n# isotropic");
    std::fs::write(at.join("unsure.csv"), unsure).unwrap();
    let report = json(at, &["compress", "unsure.csv", "-o", "unsure.wlm", "--er-l2", "auto"]);
    let auto = &report["auto"];
    assert_eq!(auto["stopped_at"], "uncertainty", "{report}");
    assert!((auto["uncertainty"].as_f64().unwrap() - 0.04).abs() < 1e-4, "{report}");
    assert!((auto["noise"].as_f64().unwrap() - 0.01).abs() < 0.0025, "{report}");
    let cells = report["er_l2_cells"].as_f64().unwrap();
    assert!(cells <= 0.04 && report["within_2u"].as_f64().unwrap() > 0.9, "{report}");
    let text = sheet(&["compress", "unsure.csv", "-o", "unsure.wlm", "--er-l2", "auto"]);
    let line =
        "stopped at the uncertainty of 4.00 % that the file states (relative root mean square), above the estimated";
    assert!(text.contains(line), "{text}");

    let without = json(at, &["compress", "unsure.csv", "-o", "fine.wlm"]);
    assert!(without["bytes"].as_u64().unwrap() > report["bytes"].as_u64().unwrap(), "{without} {report}");
    let material = json(at, &["inspect", "unsure.wlm"]);
    assert_eq!(material["provenance"]["source"]["instrument"]["detector_aperture"], 3.0, "{material}");
    let inspected = sheet(&["inspect", "unsure.csv"]);
    assert!(inspected.contains("the detector's aperture 3°"), "{inspected}");
    assert!(!inspected.contains("checked"), "there is nothing to say: {inspected}");
}
