//! How fast `radiometric-csv` is read, wide and long: `cargo bench --bench formats [-- MEGABYTES]`.

#![allow(clippy::print_stdout, reason = "a bench prints")]

use std::fmt::Write as _;
use std::time::Instant;
use wavelume::formats::{Interpretation, Samples, read};

const HEADER: &str = "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n\
                      # angle_unit: deg\n# wavelength_unit: nm\n";
const LAMBDAS: usize = 81;

/// The places of a grid of 10° × 5° × 2.5°, enough of them for `megabytes`, and a value of four digits at each.
fn file(wide: bool, megabytes: usize) -> String {
    let mut text = format!("{HEADER}theta_i,phi_i,theta_o,phi_o,");
    let columns: Vec<String> = (0..LAMBDAS).map(|l| format!("v{}", 380 + 5 * l)).collect();
    text.push_str(if wide { "" } else { "wavelength,value" });
    text.push_str(&if wide { columns.join(",") } else { String::new() });
    text.push('\n');
    let mut state = 1_u32;
    let mut place = 0_usize;
    while text.len() < megabytes << 20 {
        let angles = format!(
            "{},{},{},{}",
            place / 51_840 * 10,
            place / 2592 % 20 * 18,
            2.5 * (place / 72 % 36) as f64,
            place % 72 * 5
        );
        if wide {
            text.push_str(&angles);
        }
        for l in 0..LAMBDAS {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let value = f64::from(state >> 19) / 8192.0;
            let _ =
                if wide { write!(text, ",{value:.4}") } else { writeln!(text, "{angles},{},{value:.4}", 380 + 5 * l) };
        }
        if wide {
            text.push('\n');
        }
        place += 1;
    }
    text
}

fn main() {
    let megabytes = std::env::args().find_map(|word| word.parse().ok()).unwrap_or(64);
    for (name, wide) in [("wide", true), ("long", false)] {
        let text = file(wide, megabytes);
        let mut best = f64::INFINITY;
        let mut found = String::new();
        for _ in 0..5 {
            let start = Instant::now();
            let outcome = read(text.as_bytes(), &Interpretation::default());
            best = best.min(start.elapsed().as_secs_f64());
            found = match outcome.map(|acquisition| acquisition.samples) {
                Ok(Samples::Grid(grid)) => format!("a grid of {} samples", grid.values.len()),
                Ok(_) => "no grid".to_owned(),
                Err(error) => error.to_string(),
            };
        }
        let threads = std::env::var("RAYON_NUM_THREADS").unwrap_or_else(|_| "all".to_owned());
        println!(
            "{name}: {:.0} MB in {best:.3} s, {:.0} MB/s, {threads} threads: {found}",
            text.len() as f64 / 1e6,
            text.len() as f64 / 1e6 / best
        );
    }
}
