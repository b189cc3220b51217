//! Commands that use a material and get a measurement: it is compressed in memory, and the answer says so.

use super::{at, data, done, noisy_lobe, refused, wavelume, workshop};
use serde_json::{Value, json};
use std::fs;

/// Returns the answer of a run that must succeed, and its notes and warnings.
fn answered(args: &[&str]) -> (Value, Vec<String>) {
    let output = wavelume(args);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{args:?}: {stderr}");
    let lines = stderr.lines().map(str::to_owned).collect();
    (serde_json::from_slice(&output.stdout).unwrap_or_default(), lines)
}

#[test]
fn a_measurement_answers_like_its_lossless_material() {
    let dir = workshop();
    let (lamp, light, array) = (data("aerolamp.ies"), data("illuminant_D65.csv"), at(&dir, "brdf.npy"));
    let [made, of_light, of_array] = ["lamp.wlm", "light.wlm", "brdf.wlm"].map(|name| at(&dir, name));
    for (measurement, material) in [(&lamp, &made), (&light, &of_light), (&array, &of_array)] {
        done(&["compress", measurement, "-o", material, "--lossless"]);
    }
    let out = at(&dir, "out");
    for (format, measurement, material, command) in [
        ("lm-63", &lamp, &made, &["evaluate", "--wo", "150,20"][..]),
        ("lm-63", &lamp, &made, &["sample", "-n", "3"]),
        ("lm-63", &lamp, &made, &["physics", "--json"]),
        ("lm-63", &lamp, &made, &["export", "--format", "ies", "-o", &out, "--json"]),
        ("npy", &array, &of_array, &["evaluate", "--wi", "20,0", "--wo", "30,180", "--wavelengths", "450,470"]),
        ("spectral-table", &light, &of_light, &["color"]),
        ("npy", &array, &of_array, &["export", "--format", "npy", "-o", &out, "--json"]),
    ] {
        let (mut found, said) = answered(&[&[command[0], measurement], &command[1..]].concat());
        let stated = found.as_object_mut().unwrap().remove("compressed_in_memory").unwrap();
        let bytes = fs::metadata(material).unwrap().len();
        let expected = json!({ "format": format, "target": "lossless", "er_l2": 0.0, "bytes": bytes });
        assert_eq!(stated, expected, "{command:?}");
        let note =
            format!("wavelume: note: {measurement}: a measurement ({format}), compressed in memory without loss");
        assert_eq!(said[0], note, "{command:?}");
        assert!(said[1..].iter().all(|line| line.starts_with("wavelume: warning: ")), "{said:?}");
        let (of_material, said) = answered(&[&[command[0], material], &command[1..]].concat());
        assert_eq!((found, said), (of_material, vec![]), "{command:?}");
    }
    let pictures = [&lamp, &made].map(|input| {
        answered(&["preview", input, "-o", &out]);
        fs::read(&out).unwrap()
    });
    assert!(pictures[0] == pictures[1] && pictures[0].starts_with(b"\x89PNG"));
}

#[test]
fn a_scan_is_compressed_to_the_default_error() {
    let dir = workshop();
    let scan = at(&dir, "lobe.csv");
    fs::write(&scan, noisy_lobe()).unwrap();
    let (found, said) = answered(&["evaluate", &scan, "--wi", "0,0", "--wo", "20,0"]);
    let stated = &found["compressed_in_memory"];
    assert_eq!(
        (&stated["target"], &stated["format"]),
        (&json!({ "er_l2": 0.01 }), &json!("radiometric-csv")),
        "{found}"
    );
    assert!(said[0].contains("compressed in memory with er(L2) "), "{said:?}");
    let out = at(&dir, "lobe.wlm");
    let compressed = wavelume(&["compress", &scan, "-o", &out]);
    let warnings: Vec<&str> = std::str::from_utf8(&compressed.stderr).unwrap().lines().collect();
    assert_eq!(said[1..], warnings, "those of the compression");
}

#[test]
fn a_measurement_that_needs_an_option_is_compressed_first() {
    let dir = workshop();
    let bare = at(&dir, "bare.npy");
    fs::copy(at(&dir, "brdf.npy"), &bare).unwrap();
    for command in [&["evaluate", &bare, "--wi", "0,0", "--wo", "0,0"][..], &["physics", &bare], &["color", &bare]] {
        let message = refused(2, command);
        assert!(message.contains("run `wavelume compress` with them first"), "{message}");
    }
}
