//! Refusals of the command line: one line, the exit code of their kind, and no data lost.

use super::{at, done, material, npy, refused, workshop};
use std::fs;
use std::path::Path;

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
    assert!(line.contains("bare.axes.json: the manifest is not valid JSON: "), "{line}");
}

#[test]
fn wrong_usage_is_exit_code_2_and_one_line() {
    let dir = workshop();
    let (input, out) = (at(&dir, "brdf.npy"), at(&dir, "m.wlm"));
    for line in [
        &["compres"][..],
        &["compress", &input, &input, "-o", &out],
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
    refused(1, &["decode", &at(&dir, "brdf.npy"), "-o", &at(&dir, "t.npy")]);
    refused(1, &["dot", &at(&dir, "brdf.npy"), &at(&dir, "brdf.npy")]);
    refused(1, &["evaluate", &at(&dir, "prose.txt"), "--wo", "0,0"]);
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
    refused(1, &["decode", &out, "-o", dir.path().to_str().unwrap()]);
}
