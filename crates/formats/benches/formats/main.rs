//! Speed of reading files, one row per format, beside a copy and a scan of the same bytes in the same run.
//!
//! `cargo bench -p wavelume-formats --bench formats [-- MEGABYTES] [NAME]`; with `RAYON_NUM_THREADS=1` on one core. A
//! large file of a lab: `WAVELUME_BENCH_FILE=measurement.arrow`.
#![allow(clippy::print_stdout, reason = "a bench prints its figures")]

mod binary;
mod text;
mod values;

use std::hint::black_box;
use std::time::Instant;
use wavelume_core::domain::Quantity;
use wavelume_formats::formats::{Interpretation, Normalization, Samples, read};

/// Number of runs, of which the fastest counts, because other programs may use the machine.
const RUNS: usize = 9;

/// Returns the speed in megabytes per second, and the result of the last run.
fn best<T>(bytes: &[u8], run: impl Fn(&[u8]) -> T) -> (f64, T) {
    let timed = || {
        let start = Instant::now();
        let found = black_box(run(black_box(bytes)));
        (bytes.len() as f64 / 1e6 / start.elapsed().as_secs_f64(), found)
    };
    let mut fastest = timed();
    for _ in 1..RUNS {
        let (speed, found) = timed();
        fastest = (speed.max(fastest.0), found);
    }
    fastest
}

fn measure(name: &str, bytes: &[u8], how: &Interpretation) {
    let (speed, outcome) = best(bytes, |bytes| read(bytes, how));
    let found = match outcome.map(|acquisition| acquisition.samples) {
        Ok(Samples::Grid(grid)) => format!("a grid of {} samples", grid.values.len()),
        Ok(Samples::OnAxes { tensor, .. }) => format!("{} samples", tensor.len()),
        Ok(Samples::Scattered(scattered)) => format!("{} directions", scattered.directions()),
        Ok(Samples::Function(modelled)) => format!("a function of {} numbers", modelled.numbers),
        Err(error) => error.to_string(),
    };
    let (copy, _) = best(bytes, <[u8]>::to_vec);
    let (scan, _) = best(bytes, |bytes| bytes.iter().fold(0_u8, |all, &byte| all ^ byte));
    let megabytes = bytes.len() as f64 / 1e6;
    println!("{name:36} {megabytes:6.1} MB {speed:7.0} MB/s, copied {copy:6.0}, scanned {scan:6.0}: {found}");
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let megabytes: usize = words.iter().find_map(|word| word.parse().ok()).unwrap_or(64);
    let wanted = words.iter().find(|word| word.parse::<usize>().is_err());
    let size = megabytes << 20;
    let plain = Interpretation::default();
    let row = |name: &str, how: &Interpretation, bytes: &dyn Fn() -> Vec<u8>| {
        if wanted.is_none_or(|wanted| name.contains(wanted.as_str())) {
            measure(name, &bytes(), how);
        }
    };
    println!("threads: {}", std::env::var("RAYON_NUM_THREADS").unwrap_or_else(|_| "all".to_owned()));
    row("radiometric-csv wide", &plain, &|| text::measurement(true, false, false, size));
    row("radiometric-csv wide scattered", &plain, &|| text::measurement(true, true, false, size));
    row("radiometric-csv wide with sigma", &plain, &|| text::measurement(true, true, true, size));
    row("radiometric-csv long", &plain, &|| text::measurement(false, false, false, size));
    row("spectral-table 200 columns", &plain, &|| text::spectra(200, size / 1600, ','));
    row("spectral-table 2 columns", &plain, &|| text::spectra(1, 65_536, ','));
    row("spectral-table blanks", &plain, &|| text::spectra(20, 65_536, ' '));
    row("lm-63", &plain, &|| text::luminaire(false, size));
    row("eulumdat", &plain, &|| text::luminaire(true, size));
    let quantity = Some(Quantity::Phase.into());
    let phase = Interpretation { quantity, normalization: Some(Normalization::Relative), ..plain.clone() };
    let columns = Interpretation { column: Some("1".to_owned()), ..phase.clone() };
    row("phase-table 2 columns", &phase, &|| text::phase(1, 65_536));
    row("phase-table 20 columns", &columns, &|| text::phase(20, 65_536));
    row("phase-table one line", &phase, &|| text::phase(0, 65_536));
    row("tm-27", &plain, &|| text::elements(65_536));
    let axes = serde_json::json!({"quantity": "spectrum", "axes": ["index", {"kind": "wavelength", "start": 380, "step": 5, "count": 64}]});
    let manifest = Interpretation { axes: Some(axes), ..plain.clone() };
    for (name, kind, fortran) in [
        ("npy float32", "<f4", false),
        ("npy float64", "<f8", false),
        ("npy float32 big-endian", ">f4", false),
        ("npy float32 fortran", "<f4", true),
    ] {
        row(name, &manifest, &|| binary::array(kind, fortran, size));
    }
    row("merl", &plain, &binary::merl);
    row("rgl", &plain, &|| binary::rgl(size));
    row("mbsdf", &plain, &|| binary::mbsdf(size));
    row("radiometric-arrow", &plain, &|| binary::arrow(false, size));
    row("radiometric-arrow scattered", &plain, &|| binary::arrow(true, size));
    if let Ok(path) = std::env::var("WAVELUME_BENCH_FILE")
        && let Ok(bytes) = std::fs::read(&path)
    {
        measure(&path, &bytes, &plain);
    }
}
