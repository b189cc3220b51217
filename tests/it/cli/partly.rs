//! Materials of which too few directions were measured, measurements that contradict physics, and files that add more
//! error than a material promises: the program says so first, and `--strict` refuses.

use super::{done, json, refused};
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

/// A glossy surface, in the plane of incidence with signed angles of the detector, as a table of a goniometer.
pub(crate) fn in_plane_scan() -> String {
    let mut text =
        "Einfallswinkel [°];Ausfallswinkel [°];BRDF 400 nm [1/sr];BRDF 550 nm [1/sr];BRDF 700 nm [1/sr]\n".to_owned();
    for theta_i in [5, 20, 35, 50, 65] {
        for theta_o in (-80..=80).step_by(2) {
            let off = f64::from(theta_o - theta_i) / 12.0;
            let gloss = 0.6 * (-0.5 * off * off).exp();
            let row = format!("{theta_i};{theta_o};{:.5};{:.5};{:.5}\n", gloss + 0.03, gloss + 0.08, gloss + 0.11);
            text.push_str(&row.replace('.', ","));
        }
    }
    text
}

/// A diffuser measured all round, whose values are those of a reflectance of `reflectance`.
pub(crate) fn diffuser(reflectance: f64) -> String {
    let mut text = "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n\
                    # angle_unit: deg\n# isotropic: true\ntheta_i,theta_o,phi_o,value\n"
        .to_owned();
    for theta_i in [0, 30, 60] {
        for (theta_o, phi) in (0..=85).step_by(5).flat_map(|theta| (0..=180).step_by(15).map(move |phi| (theta, phi))) {
            let ripple = 1.0 + 0.02 * f64::from(theta_o + phi).to_radians().sin();
            writeln!(text, "{theta_i},{theta_o},{phi},{:.6}", reflectance * ripple / std::f64::consts::PI).unwrap();
        }
    }
    text
}

/// `diffuser(0.9)` with other values, made of the outgoing angles and each value.
fn changed(value_of: impl Fn([f64; 2], f64) -> f64) -> String {
    let line = |line: &str| {
        let cells: Vec<f64> = line.split(',').filter_map(|cell| cell.parse().ok()).collect();
        match cells[..] {
            [theta_i, theta_o, phi_o, value] => {
                format!("{theta_i},{theta_o},{phi_o},{:.6}\n", value_of([theta_o, phi_o], value))
            }
            _ => format!("{line}\n"),
        }
    };
    diffuser(0.9).lines().map(line).collect()
}

/// Exit code, stdout and stderr of a run in a directory.
fn run(at: &Path, args: &[&str]) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_wavelume"));
    let output = command.args(args).current_dir(at).stdin(Stdio::null()).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn a_scan_in_one_plane_has_no_albedo_ball_or_rgl_file() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name).display().to_string();
    let (scan, material) = (path("scan.csv"), path("scan.wlm"));
    std::fs::write(&scan, in_plane_scan()).unwrap();
    let report = json(&["compress", &scan, "-o", &material, "--json"]);
    let notes = report["notes"].as_array().unwrap();
    let about = notes.iter().find(|note| note["code"] == "material-partly-measured").unwrap();
    let message = about["message"].as_str().unwrap();
    assert!(message.starts_with("measured in the plane of incidence only: "), "{message}");
    assert!(report["light"].is_null(), "{report}");
    let sheet = done(&["physics", &material]);
    assert!(sheet.contains("energy       no albedo: measured in the plane of incidence only: "), "{sheet}");
    assert!(!sheet.contains("conserved") && !sheet.contains("at most"), "{sheet}");
    let physics = json(&["physics", &material, "--json"]);
    assert!(physics["energy"]["albedo"].is_null() && physics["energy"]["reason"].is_string(), "{physics}");
    assert!(done(&["inspect", &material]).contains("measured in the plane of incidence only"));
    for (args, asked) in [
        (&["preview", &material, "-o", &path("a.png")][..], "no picture of a ball"),
        (&["export", &material, "--format", "rgl", "-o", &path("a.bsdf")], "no rgl file"),
        (&["reflectance", &material, "-o", &path("a.npy")], "no reflectance"),
        (&["sample", &material, "--wi", "30,0", "-n", "2"], "no sample and no density (pdf)"),
    ] {
        let refusal = refused(2, args);
        assert!(refusal.contains(&format!("{asked}: measured in the plane of incidence only: ")), "{refusal}");
    }
    let files = std::fs::read_dir(&directory).unwrap().map(|file| file.unwrap().file_name());
    let mut files: Vec<_> = files.map(|name| name.into_string().unwrap()).collect();
    files.sort();
    assert_eq!(files, ["scan.csv", "scan.wlm"]);
    let at = |phi: &str| json(&["evaluate", &material, "--wi", "20,0", "--wo", &format!("30,{phi}")]);
    let text = at("90").to_string();
    assert!(text.contains("null"), "{text}");
    assert!(!at("180").to_string().contains("null") && !at("0").to_string().contains("null"));
    let refusal = refused(2, &["compress", &scan, "-o", &path("b.wlm"), "--albedo-error", "0.01"]);
    assert!(
        refusal.contains("cannot bound the error of the albedo or flux: no albedo: measured in the plane"),
        "{refusal}"
    );
    assert!(!directory.path().join("b.wlm").exists());
}

#[test]
fn a_measurement_that_contradicts_physics_is_warned_of_and_strict_refuses_it() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    let warnings = |file: &str, text: &str| -> (Vec<String>, String) {
        std::fs::write(at.join(file), text).unwrap();
        let (code, sheet, stderr) = run(at, &["compress", file, "-o", "m.wlm", "--json"]);
        assert_eq!(code, Some(0), "{stderr}");
        let lines = stderr.lines().map(|line| line.trim_start_matches("wavelume: warning: ").to_owned());
        let found: Vec<String> = lines.collect();
        assert!(found.iter().all(|warning| sheet.contains(warning)), "{sheet}");
        std::fs::remove_file(at.join("m.wlm")).unwrap();
        let (code, _, refusal) = run(at, &["compress", file, "-o", "m.wlm", "--strict"]);
        assert_eq!(
            (code, at.join("m.wlm").exists()),
            (Some(i32::from(!found.is_empty())), found.is_empty()),
            "{refusal}"
        );
        (found, refusal)
    };
    assert_eq!(warnings("paper.csv", &diffuser(0.9)).0, Vec::<String>::new());
    let (percent, refusal) = warnings("percent.csv", &diffuser(90.0));
    assert_eq!(percent.len(), 1, "{percent:?}");
    assert!(percent[0].starts_with("albedo above 1 under 3 of 3 incoming directions: 90."), "{percent:?}");
    assert!(
        percent[0].ends_with("values in per cent would have an albedo of 0.901 after division by 100"),
        "{percent:?}"
    );
    assert!(refusal.contains("refused by --strict: albedo above 1 under 3 of 3"), "{refusal}");
    let (bright, _) = warnings("bright.csv", &diffuser(1.2));
    assert!(bright[0].ends_with("the scale, the cosine or the reference may be wrong"), "{bright:?}");
    // The cosine is in the values, though the file says that it is not.
    let cosine = changed(|[theta_o, _], value| value * theta_o.to_radians().cos());
    let (unreciprocal, _) = warnings("cosine.csv", &cosine);
    assert!(
        unreciprocal[0].starts_with("f(wi, wo) and f(wo, wi), equal by reciprocity, differ by "),
        "{unreciprocal:?}"
    );
    let (negative, _) =
        warnings("negative.csv", &changed(|[_, phi_o], value| if phi_o == 15.0 { -value } else { value }));
    assert!(
        negative.iter().any(|warning| warning.contains("values (") && warning.contains("are negative")),
        "{negative:?}"
    );
}

#[test]
fn a_file_that_adds_more_error_than_promised_says_so_first_and_strict_refuses_it() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    std::fs::write(at.join("paper.csv"), diffuser(0.9)).unwrap();
    let (code, ..) = run(at, &["compress", "paper.csv", "-o", "m.wlm", "--er-l2", "0.0001"]);
    assert_eq!(code, Some(0));
    let rough = ["export", "m.wlm", "--format", "rgl", "--side", "2", "--step", "45", "-o", "rough.bsdf"];
    let (code, sheet, stderr) = run(at, &rough);
    assert!(code == Some(0) && stderr.is_empty(), "{stderr}");
    let (_, answer, warning) = run(at, &[&rough[..], &["--json"]].concat());
    let said = warning.trim_end().strip_prefix("wavelume: warning: ").unwrap();
    assert!(
        said.starts_with("the file adds er(L2) ") && said.ends_with("more than the 0.01 % that the material promises"),
        "{said}"
    );
    let first = sheet.lines().nth(1).unwrap();
    assert!(first.trim_start().starts_with("warning ") && first.ends_with(said), "{sheet}");
    let answer: Value = serde_json::from_str(&answer).unwrap();
    assert_eq!(answer["warning"], said, "{answer}");
    std::fs::remove_file(at.join("rough.bsdf")).unwrap();
    let (code, _, refusal) = run(at, &[&rough[..], &["--strict"]].concat());
    assert_eq!((code, at.join("rough.bsdf").exists()), (Some(1), false), "{refusal}");
    assert!(refusal.contains(&format!("refused by --strict: {said}")), "{refusal}");
    // An array adds nothing.
    let (code, sheet, stderr) = run(at, &["export", "m.wlm", "--format", "npy", "-o", "m.npy", "--strict"]);
    assert!(code == Some(0) && stderr.is_empty() && !sheet.contains("warning"), "{stderr}");
}
