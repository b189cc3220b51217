//! How fast files are read, one row a format: `cargo bench --no-default-features --bench formats [-- MEGABYTES]`; with
//! `RAYON_NUM_THREADS=1` on one core.

#![allow(clippy::print_stdout, reason = "a bench prints")]

use std::fmt::Write as _;
use std::hint::black_box;
use std::time::Instant;
use wavelume::formats::{Interpretation, Samples, read, write_npy};

const HEADER: &str = "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n\
                      # angle_unit: deg\n# wavelength_unit: nm\n";
const LAMBDAS: usize = 81;
/// Runs of which the fastest counts: others may work beside it.
const RUNS: usize = 9;

/// Values of four digits.
struct Values(u32);

impl Values {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(self.0 >> 19) / 8192.0
    }
}

/// `[theta_i, phi_i, theta_o, phi_o]` of a grid of 10° × 18° × 2.5° × 5°.
fn angles(place: usize) -> [f64; 4] {
    [place / 51_840 * 10, place / 2592 % 20 * 18, place / 72 % 36, place % 72 * 5].map(|n| n as f64)
}

/// The grid as `radiometric-csv`; scattered: no two directions alike.
fn table(wide: bool, scattered: bool, megabytes: usize) -> Vec<u8> {
    let mut text = format!("{HEADER}theta_i,phi_i,theta_o,phi_o,");
    let columns: Vec<String> = (0..LAMBDAS).map(|l| format!("v{}", 380 + 5 * l)).collect();
    text.push_str(&if wide { columns.join(",") } else { "wavelength,value".to_owned() });
    text.push('\n');
    let mut values = Values(1);
    for place in 0.. {
        if text.len() >= megabytes << 20 {
            break;
        }
        let [theta_i, phi_i, theta_o, phi_o] = angles(place);
        let theta_o = 2.5 * theta_o + if scattered { values.next() } else { 0.0 };
        let angles = format!("{theta_i},{phi_i},{theta_o:.4},{phi_o}");
        if wide {
            text.push_str(&angles);
        }
        for l in 0..LAMBDAS {
            let value = values.next();
            let _ =
                if wide { write!(text, ",{value:.4}") } else { writeln!(text, "{angles},{},{value:.4}", 380 + 5 * l) };
        }
        if wide {
            text.push('\n');
        }
    }
    text.into_bytes()
}

/// A luminaire of as many planes as it takes.
fn luminaire(megabytes: usize, ldt: bool) -> Vec<u8> {
    const ANGLES: usize = 721;
    let planes = (megabytes << 20) / (7 * ANGLES);
    let mut values = Values(1);
    let step = 360.0 / planes as f64;
    let separator = if ldt { "\n" } else { " " };
    let mut text = if ldt {
        format!(
            "a\n1\n0\n{planes}\n0\n{ANGLES}\n0\nr\nn\n1\nf\nd\n1\n1\n1\n1\n1\n0\n0\n0\n0\n100\n100\n1\n0\n1\n-1\nl\n1000\nc\nr\n9\n{}",
            "0\n".repeat(10)
        )
    } else {
        format!("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 {ANGLES} {} 1 2 0 0 0 1 1 1\n", planes + 1)
    };
    let gammas: Vec<String> = (0..ANGLES).map(|i| (0.25 * i as f64).to_string()).collect();
    let mut circle: Vec<String> = (0..planes).map(|i| format!("{:.4}", step * i as f64)).collect();
    if ldt {
        let _ = write!(text, "{}\n{}\n", circle.join(separator), gammas.join(separator));
    } else {
        circle.push("360".to_owned());
        let _ = write!(text, "{}\n{}\n", gammas.join(separator), circle.join(separator));
    }
    for _ in 0..if ldt { planes } else { planes + 1 } {
        for _ in 0..ANGLES {
            let _ = write!(text, "{:.4}{separator}", values.next());
        }
    }
    text.into_bytes()
}

/// A table of spectra: many columns or two.
fn spectra(columns: usize, rows: usize) -> Vec<u8> {
    let mut values = Values(1);
    let mut text = String::from("nm");
    for i in 0..columns {
        let _ = write!(text, ",patch {i}");
    }
    for row in 0..rows {
        let _ = write!(text, "\n{:.3}", 380.0 + 0.01 * row as f64);
        for _ in 0..columns {
            let _ = write!(text, ",{:.4}", values.next());
        }
    }
    text.into_bytes()
}

/// An array of float32.
fn array(megabytes: usize) -> (Vec<u8>, Interpretation) {
    let rows = (megabytes << 20) / (4 * 64);
    let mut values = Values(1);
    let samples: Vec<f32> = (0..rows * 64).map(|_| values.next() as f32).collect();
    let axes = serde_json::json!({"quantity": "spectrum", "axes": ["index", {"kind": "wavelength", "start": 380, "step": 5, "count": 64}]});
    (write_npy(&[rows, 64], &samples), Interpretation { axes: Some(axes), ..Interpretation::default() })
}

fn measure(name: &str, bytes: &[u8], how: &Interpretation) {
    let mut best = f64::INFINITY;
    let mut found = String::new();
    for _ in 0..RUNS {
        let start = Instant::now();
        let outcome = black_box(read(black_box(bytes), how));
        best = best.min(start.elapsed().as_secs_f64());
        found = match outcome.map(|acquisition| acquisition.samples) {
            Ok(Samples::Grid(grid)) => format!("a grid of {} samples", grid.values.len()),
            Ok(Samples::OnAxes { tensor, .. }) => format!("{} samples", tensor.len()),
            Ok(Samples::Scattered(scattered)) => format!("{} directions", scattered.directions()),
            Ok(Samples::Function(modelled)) => format!("a function of {} numbers", modelled.numbers),
            Err(error) => error.to_string(),
        };
    }
    let threads = std::env::var("RAYON_NUM_THREADS").unwrap_or_else(|_| "all".to_owned());
    let megabytes = bytes.len() as f64 / 1e6;
    println!("{name}: {megabytes:.0} MB in {best:.3} s, {:.0} MB/s, {threads} threads: {found}", megabytes / best);
}

fn main() {
    let megabytes = std::env::args().find_map(|word| word.parse().ok()).unwrap_or(64);
    let plain = Interpretation::default();
    measure("radiometric-csv wide", &table(true, false, megabytes), &plain);
    measure("radiometric-csv wide, scattered", &table(true, true, megabytes), &plain);
    measure("radiometric-csv long", &table(false, false, megabytes), &plain);
    measure("lm-63", &luminaire(megabytes, false), &plain);
    measure("eulumdat", &luminaire(megabytes.min(20), true), &plain);
    measure("spectral-table, 200 columns", &spectra(200, megabytes * 700), &plain);
    measure("spectral-table, 2 columns", &spectra(1, 60_000), &plain);
    let (bytes, how) = array(megabytes);
    measure("npy", &bytes, &how);
    // A large stream of a lab: `WAVELUME_BENCH_FILE=measurement.arrow`.
    if let Ok(path) = std::env::var("WAVELUME_BENCH_FILE")
        && let Ok(bytes) = std::fs::read(&path)
    {
        measure(&path, &bytes, &plain);
    }
}
