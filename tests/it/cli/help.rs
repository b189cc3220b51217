//! Help, version, completions and manual pages of the program; files from standard input, and several at once.

use super::{at, data, done, json, refused, wavelume};
use std::fs;
use std::io::Write;
use std::process::{Command, Stdio};

/// Runs the program with `input` as its standard input; it must succeed. Returns stdout.
fn piped(args: &[&str], input: &[u8]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_wavelume"));
    let command = command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    child.stdin.take().unwrap().write_all(input).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_help_is_shown_on_request_and_without_a_command() {
    let help = done(&["help"]);
    for heading in ["Files:", "Pictures and figures:", "Service:", "Administration:", "Help:"] {
        assert!(help.contains(&format!("\n{heading}\n")), "{help}");
    }
    assert!(!help.contains("compute-job"), "{help}");
    assert!(done(&["help", "compress"]).contains("--er-l2"));
    let bare = wavelume(&[]);
    assert_eq!((bare.status.code(), bare.stdout.len()), (Some(2), 0));
    let shown = String::from_utf8(bare.stderr).unwrap();
    assert!(shown.contains("\nFiles:\n") && !shown.starts_with("wavelume:"), "{shown}");
    let misspelt = refused(2, &["helth"]);
    assert!(misspelt.contains("health"), "{misspelt}");
}

#[test]
fn the_version_may_name_a_commit() {
    let version = done(&["--version"]);
    let rest = version.strip_prefix(concat!("wavelume ", env!("CARGO_PKG_VERSION"))).unwrap().trim_end();
    // A build for tests has no commit, unless WAVELUME_COMMIT states it.
    assert!(rest.is_empty() || rest.starts_with(" (commit "), "{version}");
}

#[test]
fn shells_and_the_manual_get_their_files() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = done(&["completions", shell]);
        assert!(script.contains("wavelume") && script.contains("er-l2"), "{shell}");
    }
    let dir = tempfile::tempdir().unwrap();
    done(&["man", "-o", &at(&dir, "man1")]);
    let page = |name: &str| fs::read_to_string(dir.path().join("man1").join(name)).unwrap();
    assert!(page("wavelume.1").contains(".TH wavelume 1") && page("wavelume.1").contains("wavelume\\-compress(1)"));
    assert!(page("wavelume-compress.1").contains("er\\-l2") && page("wavelume-jobs-list.1").contains("state"));
    assert!(!dir.path().join("man1/wavelume-compute-job.1").exists());
    assert_eq!(done(&["man", "compress"]), page("wavelume-compress.1"));
    assert!(refused(2, &["man", "compres"]).contains("wavelume help"));
}

#[test]
fn standard_input_is_a_file() {
    let dir = tempfile::tempdir().unwrap();
    let (file, material) = (data("illuminant_D65.csv"), at(&dir, "d65.wlm"));
    let bytes = fs::read(&file).unwrap();
    let told = piped(&["inspect", "-", "--json"], &bytes);
    assert!(told.contains("\"format\":\"spectral-table\""), "{told}");
    piped(&["compress", "-", "-o", &material], &bytes);
    let other = at(&dir, "other.wlm");
    done(&["compress", &file, "-o", &other]);
    let written = fs::read(&material).unwrap();
    assert_eq!(written, fs::read(&other).unwrap());
    assert_eq!(
        piped(&["evaluate", "-", "--wavelengths", "550"], &written),
        done(&["evaluate", &other, "--wavelengths", "550"])
    );
    assert!(refused(2, &["compress", "-"]).contains("-o OUT"));
}

#[test]
fn several_files_are_compressed_at_once() {
    let dir = tempfile::tempdir().unwrap();
    let copied = ["illuminant_D65.csv", "illuminant_A.csv"].map(|name| {
        fs::copy(data(name), dir.path().join(name)).unwrap();
        at(&dir, name)
    });
    let [one, other] = &copied;
    done(&["compress", one, other]);
    assert!(dir.path().join("illuminant_D65.wlm").exists() && dir.path().join("illuminant_A.wlm").exists());
    done(&["compress", one, other, "-o", &at(&dir, "made/")]);
    assert_eq!(fs::read(at(&dir, "made/illuminant_A.wlm")).unwrap(), fs::read(at(&dir, "illuminant_A.wlm")).unwrap());
    assert!(refused(2, &["compress", one, other, "-o", &at(&dir, "x.wlm")]).contains("directory"));
    // A file at fault is named, and the others are compressed.
    let broken = at(&dir, "broken.csv");
    fs::write(&broken, "no measurement\n").unwrap();
    fs::remove_file(at(&dir, "illuminant_A.wlm")).unwrap();
    let output = wavelume(&["compress", &broken, other]);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("broken.csv") && stderr.ends_with("1 of 2 files were not compressed\n"), "{stderr}");
    assert!(dir.path().join("illuminant_A.wlm").exists());
}

#[test]
fn every_command_that_computes_takes_a_number_of_threads() {
    let dir = tempfile::tempdir().unwrap();
    let (file, material) = (data("nukit_lantern.ies"), at(&dir, "lantern.wlm"));
    done(&["compress", &file, "-o", &material, "--er-l2", "0.05", "--threads", "1"]);
    done(&["inspect", &material, "--threads", "1"]);
    done(&["physics", &material, "--threads", "1"]);
    done(&["dot", &material, &material, "--threads", "1"]);
    done(&["sample", &material, "-n", "1", "--threads", "1"]);
    done(&["paper", "--help"]).find("--threads").unwrap();
    done(&["reflectance", "--help"]).find("--threads").unwrap();
    let drawn = json(&["sample", &material, "-n", "1"]);
    assert_eq!(drawn["weight_unit"], "mW");
    let spectrum = at(&dir, "d65.wlm");
    done(&["compress", &data("illuminant_D65.csv"), "-o", &spectrum]);
    done(&["color", &spectrum, "--threads", "1"]);
}

#[test]
fn a_warning_is_said_once() {
    let dir = tempfile::tempdir().unwrap();
    let out = at(&dir, "lamp.wlm");
    let warning = "near-field photometry";
    let output = wavelume(&["compress", &data("aerolamp.ies"), "-o", &out]);
    let (stdout, stderr) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert_eq!((stdout.matches(warning).count(), stderr.as_str()), (1, ""));
    let output = wavelume(&["compress", &data("aerolamp.ies"), "-o", &out, "--json"]);
    assert_eq!(String::from_utf8(output.stderr).unwrap().matches(warning).count(), 1);
}

#[test]
fn messages_name_options_as_they_are_typed() {
    let dir = tempfile::tempdir().unwrap();
    let out = at(&dir, "m.wlm");
    let spectrum = data("illuminant_D65.csv");
    let told = refused(2, &["compress", &spectrum, "-o", &out, "--albedo-error", "0.01"]);
    assert!(told.contains("--albedo-error") && !told.contains("albedo_error"), "{told}");
    let coarse = done(&["compress", &data("aerolamp.ies"), "--domain", "triangles", "-o", &out]);
    assert!(coarse.contains("give a finer --outgoing-level (or --incoming-level)"), "{coarse}");
    assert!(
        coarse.contains("\n  light         flux at most ") && coarse.contains("the largest flux is 98.3 mW"),
        "{coarse}"
    );
}
