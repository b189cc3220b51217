//! Spectra and samples of materials on the command line, and lists of known formats and bases.

use super::{LAMBDAS, at, data, done, json, material, npy, read_npy, refused, workshop};
use std::fmt::Write as _;
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
fn luminaires_are_asked_by_c_and_gamma() {
    let dir = tempfile::tempdir().unwrap();
    let out = at(&dir, "lamp.wlm");
    done(&["compress", &data("aerolamp.ies"), "-o", &out]);
    let found = json(&["evaluate", &out, "--c", "-20", "--gamma", "35.5"]);
    assert_eq!(found, json(&["evaluate", &out, "--wo", "144.5,-20"]));
    let drawn = json(&["sample", &out, "-n", "20"]);
    let directions = drawn["directions"].as_array().unwrap().iter().zip(drawn["c_gamma"].as_array().unwrap());
    for (direction, angles) in directions {
        let [theta, phi] = [0, 1].map(|i| direction[i].as_f64().unwrap());
        let [c, gamma] = [0, 1].map(|i| angles[i].as_f64().unwrap());
        assert!((180.0 - theta - gamma).abs() < 1e-9 && (phi - c).abs() < 1e-9, "{direction} {angles}");
    }
    assert!(refused(2, &["evaluate", &out, "--c", "0", "--gamma", "190"]).contains("gamma from 0"));
    for wrong in [&["--c", "0"][..], &["--gamma", "0"], &["--c", "0", "--gamma", "0", "--wo", "0,0"]] {
        refused(2, &[&["evaluate", &out], wrong].concat());
    }
    let dir = workshop();
    let surface = material(&dir);
    let refusal = refused(2, &["evaluate", &surface, "--wi", "0,0", "--c", "0", "--gamma", "0"]);
    assert!(refusal.contains("C and gamma are angles of a luminaire, but this is a brdf"), "{refusal}");
    assert!(json(&["sample", &surface, "--wi", "0,0", "-n", "1"]).get("c_gamma").is_none());
}

#[test]
fn answers_beyond_the_measured_angles_say_so() {
    let dir = tempfile::tempdir().unwrap();
    let (table, out) = (at(&dir, "brdf.csv"), at(&dir, "brdf.wlm"));
    let mut text = "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n\
                    # angle_unit: deg\n# isotropic: true\n# phi_o_extent: mirrored\n# theta_o_covers: 0 90\n\
                    theta_i,theta_o,phi_o,value\n"
        .to_owned();
    for (incoming, outgoing, azimuth) in [0, 30, 60].iter().flat_map(|i| {
        let azimuths = move |o: &'static i32| [0, 90, 180].iter().map(move |a| (*i, *o, *a));
        [0, 20, 40, 60].iter().flat_map(azimuths)
    }) {
        writeln!(text, "{incoming},{outgoing},{azimuth},0.2").unwrap();
    }
    std::fs::write(&table, text).unwrap();
    done(&["compress", &table, "-o", &out]);
    let is_extrapolated =
        |wi: &str, wo: &str| json(&["evaluate", &out, "--wi", wi, "--wo", wo]).get("extrapolated").is_some();
    assert!(!is_extrapolated("60,0", "60,0") && is_extrapolated("61,0", "20,0") && is_extrapolated("0,0", "60.5,0"));
    let rows = b"theta_i,phi_i,theta_o,phi_o\n60,0,60,0\n61,0,20,0\n0,0,75,40\n";
    let shown = String::from_utf8(piped(&["evaluate", &out, "--directions", "-"], rows)).unwrap();
    let flags: Vec<&str> = shown.lines().map(|line| line.rsplit(',').next().unwrap()).collect();
    assert_eq!(flags, ["extrapolated", "0", "1", "1"]);
    let pairs = at(&dir, "pairs.csv");
    std::fs::write(&pairs, rows).unwrap();
    let output = super::wavelume(&["evaluate", &out, "--directions", &pairs, "-o", &at(&dir, "out.npy")]);
    let warning = String::from_utf8(output.stderr).unwrap();
    assert!(warning.contains("2 of 3 queries lie beyond the measured angles"), "{warning}");
    assert_eq!(json(&["sample", &out, "--wi", "70,0", "-n", "1"])["extrapolated"], true);
}

#[test]
fn a_lamp_is_interpolated_as_its_file_says() {
    let dir = tempfile::tempdir().unwrap();
    let [cubic, linear] = ["cubic", "linear"].map(|curve| {
        let out = at(&dir, &format!("{curve}.wlm"));
        done(&["compress", &data("ushio_b1.ies"), "-o", &out, "--interpolation", curve]);
        out
    });
    let value = |made: &str, theta: &str, how: &str| {
        let found = json(&["evaluate", made, "--wo", &format!("{theta},22.5"), "--interpolation", how]);
        found["values"][0].as_f64().unwrap()
    };
    // Rows of the file are 2.5 degrees apart: between two of them the line is their mean, the cubic is not.
    for made in [&cubic, &linear] {
        let stated = [value(made, "140", "smooth"), value(made, "137.5", "smooth")];
        let between = value(made, "138.75", "smooth");
        let is_mean = (between / (0.5 * (stated[0] + stated[1])) - 1.0).abs() < 1e-6;
        assert_eq!(is_mean, made == &linear, "{made}: {stated:?} {between}");
        assert_eq!(value(made, "138", "constant"), value(made, "137.5", "constant"));
        assert!((value(made, "137.5", "constant") / stated[1] - 1.0).abs() < 1e-5);
    }
    // Interpolation between the samples does not change the samples.
    assert!((value(&cubic, "140", "smooth") / value(&linear, "140", "smooth") - 1.0).abs() < 1e-5);
    assert!(done(&["inspect", &linear]).contains("straight lines"));
    assert!(done(&["inspect", &cubic]).contains("cubics of logarithms"));
    let out = at(&dir, "cells.wlm");
    let lamp = data("ushio_b1.ies");
    let refusal = refused(2, &["compress", &lamp, "-o", &out, "--interpolation", "linear", "--domain", "triangles"]);
    assert!(refusal.contains("no grid of outgoing angles"), "{refusal}");
    let refusal = refused(2, &["compress", &lamp, "-o", &out, "--random-access"]);
    assert!(refusal.contains("found neither incoming directions") && !refusal.contains("triangle"), "{refusal}");
    assert!(refused(2, &["compress", &lamp, "-o", &out, "--interpolation", "smooth"]).contains("cubic, linear"));
}

#[test]
fn a_sector_of_a_lamp_has_a_value_at_its_pole() {
    let dir = tempfile::tempdir().unwrap();
    let mut text =
        "# radiometric-csv: 1\n# quantity: emission\n# value_unit: cd\n# angle_unit: deg\nc,gamma,value\n".to_owned();
    for (c, gamma) in [10, 45, 80].into_iter().flat_map(|c| [0, 30, 60, 90].map(|gamma| (c, gamma))) {
        text.extend([format!("{c},{gamma},{}\n", 100 - gamma)]);
    }
    let (table, out) = (at(&dir, "sector.csv"), at(&dir, "sector.wlm"));
    std::fs::write(&table, text).unwrap();
    done(&["compress", &table, "-o", &out, "--lossless"]);
    let value = |wo: &str| json(&["evaluate", &out, "--wo", wo])["values"][0].clone();
    assert!((value("180,0").as_f64().unwrap() - 100.0).abs() < 1e-3);
    assert!((value("150,45").as_f64().unwrap() - 70.0).abs() < 1e-3);
    assert!(value("150,0").is_null(), "nothing is known beside a sector");
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

/// Stdout of a run with something on stdin.
fn piped(args: &[&str], input: &[u8]) -> Vec<u8> {
    use std::io::Write as _;
    let mut child = Command::new(env!("CARGO_BIN_EXE_wavelume"))
        .args(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(input).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{args:?}");
    output.stdout
}

#[test]
fn a_table_of_directions_gets_a_row_each() {
    let dir = workshop();
    let made = material(&dir);
    let table = at(&dir, "table.csv");
    let text =
        "# two places, columns in any order\nphi_o, theta_o, theta_i, phi_i, note\n-170,20,30,40,a\n\n0,10.5,0,0,b\n";
    std::fs::write(&table, text).unwrap();
    let single = json(&["evaluate", &made, "--wi", "30,40", "--wo", "20,-170"]);
    let shown = done(&["evaluate", &made, "--directions", &table]);
    let lines: Vec<&str> = shown.lines().collect();
    assert_eq!((lines.len(), lines[0]), (3, "v400,v450,v500,v550,v600,extrapolated"));
    let first: Vec<f64> = lines[1].split(',').map(|number| number.parse().unwrap()).collect();
    for (found, wanted) in first.iter().zip(single["values"].as_array().unwrap()) {
        assert!((found / wanted.as_f64().unwrap() - 1.0).abs() < 1e-5, "{shown}");
    }

    // Equal answers from an array, as an array and as bare numbers, and through pipes.
    let places = [30.0, 40.0, 20.0, -170.0, 0.0, 0.0, 10.5, 0.0];
    let (array, out) = (at(&dir, "table.npy"), at(&dir, "out.npy"));
    std::fs::write(&array, npy(&[2, 4], &places)).unwrap();
    assert!(done(&["evaluate", &made, "--directions", &array, "-o", &out]).is_empty());
    let (shape, values) = read_npy(std::path::Path::new(&out));
    assert_eq!((&shape[..], values.len()), ("2, 5", 2 * LAMBDAS));
    let bare = piped(&["evaluate", &made, "--directions", "-", "--format", "f32"], &npy(&[2, 4], &places));
    let packed: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    assert_eq!(bare, packed);
    let chosen = piped(&["evaluate", &made, "--directions", "-", "--wavelengths", "425,600"], text.as_bytes());
    assert!(chosen.starts_with(b"v425,v600,extrapolated\n"));

    // More rows than a block has.
    let many: Vec<f32> = (0..40_000).flat_map(|i| [30.0, 40.0, (i % 90) as f32, 5.0]).collect();
    std::fs::write(&array, npy(&[40_000, 4], &many)).unwrap();
    done(&["evaluate", &made, "--directions", &array, "-o", &out, "--threads", "2"]);
    let (shape, values) = read_npy(std::path::Path::new(&out));
    assert_eq!((&shape[..], &values[..LAMBDAS]), ("40000, 5", &values[90 * LAMBDAS..91 * LAMBDAS]));

    for (text, word) in [
        ("theta_i,phi_i,theta_o\n", "has no column phi_o"),
        ("theta_i,phi_i,theta_o,phi_o,phi_o\n", "names phi_o twice"),
        ("theta_i,phi_i,theta_o,phi_o\n1,2,3,4\n1,2,3\n", "row 2, column phi_o: found ``, expected a number"),
        ("theta_i,phi_i,theta_o,phi_o\n1,2,200,4\n", "row 1, column theta_o: found 200, expected 0 to 180 degrees"),
        ("theta_i,phi_i,theta_o,phi_o\n1,x,2,4\n", "row 1, column phi_i: found `x`"),
    ] {
        std::fs::write(&table, text).unwrap();
        let refusal = refused(1, &["evaluate", &made, "--directions", &table, "-o", &at(&dir, "none.csv")]);
        assert!(refusal.contains(word), "{refusal}");
        assert!(!dir.path().join("none.csv").exists());
    }
    std::fs::write(&array, &npy(&[2, 4], &places)[..140]).unwrap();
    assert!(refused(1, &["evaluate", &made, "--directions", &array, "-o", &out]).contains("ends after 0 of 2 rows"));
    std::fs::write(&array, npy(&[4, 2], &places)).unwrap();
    assert!(refused(1, &["evaluate", &made, "--directions", &array]).contains("2 columns, expected 4: theta_i, phi_i"));
    refused(2, &["evaluate", &made, "--directions", &array, "--wi", "0,0"]);
    refused(2, &["evaluate", &made, "--wi", "0,0", "--wo", "0,0", "-o", &out]);
    std::fs::write(&array, npy(&[2, 4], &places)).unwrap();
    assert!(refused(2, &["evaluate", &made, "--directions", &array, "--format", "npy"]).contains("needs --output"));
}

#[test]
fn a_table_of_points_draws_a_direction_each() {
    let dir = workshop();
    let made = material(&dir);
    let table = at(&dir, "points.csv");
    std::fs::write(&table, "theta_i,phi_i,u1,u2\n30,40,0.25,0.75\n30,40,0.5,0.125\n").unwrap();
    let shown = done(&["sample", &made, "--directions", &table]);
    let lines: Vec<&str> = shown.lines().collect();
    assert_eq!((lines.len(), lines[0]), (3, "theta_o,phi_o,pdf,weight,extrapolated"));
    let numbers: Vec<f64> = lines[1].split(',').map(|number| number.parse().unwrap()).collect();
    assert!((0.0..=90.0).contains(&numbers[0]) && numbers[2] > 0.0 && numbers[3] > 0.0, "{shown}");
    std::fs::write(&table, "theta_i,phi_i,u1,u2\n30,40,0.25,1\n").unwrap();
    let refusal = refused(1, &["sample", &made, "--directions", &table]);
    assert!(refusal.contains("row 1, column u2: found 1, expected 0 to less than 1"), "{refusal}");
    // A luminaire needs no incoming direction.
    let lamp = at(&dir, "lamp.wlm");
    done(&["compress", &data("aerolamp.ies"), "-o", &lamp, "--domain", "grid"]);
    let drawn = piped(&["sample", &lamp, "--directions", "-"], b"u1,u2\n0.1,0.9\n");
    assert_eq!(String::from_utf8(drawn).unwrap().lines().count(), 2);
    let found = piped(&["evaluate", &lamp, "--directions", "-"], b"theta_o,phi_o\n180,0\n91,45\n");
    assert!(found.starts_with(b"value,extrapolated\n"));
    // Photometric angles name these places, too.
    let asked = piped(&["evaluate", &lamp, "--directions", "-"], b"c,gamma\n0,0\n45,89\n");
    assert_eq!(asked, found);
    assert!(refused(1, &["evaluate", &made, "--directions", &table]).contains("has no column theta_o"));
}
