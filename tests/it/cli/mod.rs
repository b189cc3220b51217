//! The program as a user runs it: every command, its JSON, its exit codes and its one-line refusals.

mod compress;
mod directories;
mod doctor;
mod evaluate;
mod guard;
mod help;
mod keys;
mod materials;
mod measured;
mod partly;
mod refusals;
mod scans;
mod service;
mod settings;
mod tls;
mod trade;
mod views;

pub(crate) use partly::{diffuser, in_plane_scan};
pub(crate) use scans::noisy_lobe;

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

const INCOMING: usize = 4;
const OUTGOING: usize = 16;
const LAMBDAS: usize = 5;
const MANIFEST: &str = r#"{"quantity":"brdf","axes":["hemi:0","hemi:1","lambda:400:50:5"]}"#;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn data(name: &str) -> String {
    root().join("data").join(name).display().to_string()
}

fn wavelume(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_wavelume")).args(args).stdin(Stdio::null()).output().unwrap()
}

/// Returns the stdout of a run that must succeed.
fn done(args: &[&str]) -> String {
    let output = wavelume(args);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{args:?}: {stderr}");
    String::from_utf8(output.stdout).unwrap()
}

fn json(args: &[&str]) -> Value {
    let text = done(args);
    assert_eq!(text.lines().count(), 1, "{args:?}: JSON is one line");
    serde_json::from_str(&text).unwrap()
}

/// Returns the one line on stderr of a run that must be refused with `code`.
fn refused(code: i32, args: &[&str]) -> String {
    let output = wavelume(args);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {stderr}");
    assert!(output.stdout.is_empty(), "{args:?}: {:?}", String::from_utf8_lossy(&output.stdout));
    assert_eq!(stderr.lines().count(), 1, "{args:?}: {stderr}");
    assert!(stderr.starts_with("wavelume: "), "{args:?}: {stderr}");
    stderr
}

fn npy(shape: &[usize], samples: &[f32]) -> Vec<u8> {
    let shape = shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(",") + ",";
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}");
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(samples.iter().flat_map(|s| s.to_le_bytes()));
    bytes
}

/// Shape text and samples of a float32 array.
fn read_npy(path: &Path) -> (String, Vec<f32>) {
    let bytes = fs::read(path).unwrap();
    assert!(bytes.starts_with(b"\x93NUMPY\x01\x00"), "{}", path.display());
    let header = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let text = std::str::from_utf8(&bytes[10..10 + header]).unwrap();
    assert!(text.contains("'<f4'") && text.contains("False"), "{text}");
    let shape = text.split_once('(').unwrap().1.split_once(')').unwrap().0.to_owned();
    let samples = bytes[10 + header..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    (shape, samples)
}

/// A smooth BRDF, masked at one pair of directions.
fn samples() -> Vec<f32> {
    let mut samples = Vec::new();
    for i in 0..INCOMING {
        for o in 0..OUTGOING {
            for l in 0..LAMBDAS {
                let value = 0.2 + 0.05 * (o as f32 * 0.4 + i as f32).sin() + 0.02 * l as f32;
                samples.push(if (i, o) == (1, 7) { f32::NAN } else { value });
            }
        }
    }
    samples
}

/// A directory with `brdf.npy` and its side-car.
fn workshop() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("brdf.npy"), npy(&[INCOMING, OUTGOING, LAMBDAS], &samples())).unwrap();
    fs::write(dir.path().join("brdf.axes.json"), MANIFEST).unwrap();
    dir
}

fn at(dir: &TempDir, name: &str) -> String {
    dir.path().join(name).display().to_string()
}

/// `brdf.wlm` of a workshop.
fn material(dir: &TempDir) -> String {
    let out = at(dir, "brdf.wlm");
    done(&["compress", &at(dir, "brdf.npy"), "-o", &out]);
    out
}

fn er_l2(original: &[f32], decoded: &[f32]) -> f64 {
    let scored = original.iter().zip(decoded).filter(|(s, _)| **s > 0.0);
    let relative: Vec<f64> = scored.map(|(s, d)| f64::from(d - s) / f64::from(*s)).collect();
    (relative.iter().map(|r| r * r).sum::<f64>() / relative.len() as f64).sqrt()
}
