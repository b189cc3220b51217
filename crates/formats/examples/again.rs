//! Compresses a measurement again with the request that is stored in a material of it, and compares the bytes.
//!
//! `cargo run --release -p wavelume-formats --example again -- MEASUREMENT MATERIAL.wlm`; the manifest of an array lies
//! beside it. It fails (exit code 1) if a byte differs: equal measurements and requests give equal files with any build
//! of the program.

mod common;

use std::error::Error;
use std::io::Write;
use std::process::ExitCode;
use wavelume_core::compress::inspect;
use wavelume_core::domain::Silent;
use wavelume_formats::pipeline::{self, Request};

fn main() -> ExitCode {
    let material = std::env::args().nth(2);
    common::main("again", |measurement, out| {
        let expected = "expected the file of a measurement and that of its material";
        run(measurement.ok_or(expected)?, &material.ok_or(expected)?, out)
    })
}

/// Compresses `measurement` again and compares the result with the file `material`; returns true if they are equal.
pub(crate) fn run(measurement: &str, material: &str, out: &mut impl Write) -> Result<bool, Box<dyn Error>> {
    let before = std::fs::read(material)?;
    let stated = inspect(&before)?.metadata.ok_or_else(|| format!("{material} does not say what was asked for"))?;
    let stated: serde_json::Value = serde_json::from_str(&stated)?;
    let request: Request = serde_json::from_value(stated["request"].clone())?;
    let now = pipeline::compress(&wavelume_formats::read(measurement)?, &request, &Silent)?.bytes;
    let equal = before == now;
    let verdict = if equal { "the same" } else { "other bytes" };
    writeln!(out, "{material}: {} bytes, now {}: {verdict}", before.len(), now.len())?;
    Ok(equal)
}
