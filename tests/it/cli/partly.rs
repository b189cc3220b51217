//! Materials of which too few directions were measured: no albedo, no picture of a ball, no file of a renderer.

use super::{done, json, refused};

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
