//! Evaluates the function that a measured material is (an RGL `.bsdf`), as its file defines it, before any compression.
//!
//! `cargo run --release --no-default-features --example rgl -- M.bsdf < PAIRS`; a line of PAIRS is six numbers, the incoming
//! and the outgoing direction as `x y z`, of any length. For each line it prints f(wi, wo) in sr⁻¹, without the cosine, at
//! every wavelength or colour channel of the file.

mod common;

use std::error::Error;
use std::io::{BufRead, BufWriter, Write};
use std::process::ExitCode;
use wavelume::domain::{Axis, Direction};
use wavelume::formats::{Interpretation, Samples, read};

fn main() -> ExitCode {
    common::main("rgl", |path, out| {
        let path = path.ok_or("expected the file of a material")?;
        run(path, &mut std::io::stdin().lock(), &mut BufWriter::new(out))
    })
}

/// Prints the values of the material in `path` for every line of `pairs`.
pub(crate) fn run(path: &str, pairs: &mut impl BufRead, out: &mut impl Write) -> Result<bool, Box<dyn Error>> {
    let acquisition = read(&std::fs::read(path)?, &Interpretation::default())?;
    let Samples::Function(modelled) = &acquisition.samples else {
        return Err(format!("{path} holds samples, expected a function").into());
    };
    let mut values = vec![0.0; modelled.spectral.as_ref().map_or(1, Axis::len)];
    for (i, line) in pairs.lines().enumerate() {
        let line = line?;
        let (wi, wo) = pair(&line).ok_or_else(|| format!("line {}: expected six numbers, two directions", i + 1))?;
        modelled.function.evaluate(wi, wo, &mut values);
        let text: Vec<String> = values.iter().map(|value| format!("{value:e}")).collect();
        writeln!(out, "{}", text.join(" "))?;
    }
    out.flush()?;
    Ok(true)
}

fn pair(line: &str) -> Option<(Direction, Direction)> {
    let numbers: Vec<f64> = line.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    let &[a, b, c, d, e, f] = numbers.as_slice() else { return None };
    Some((Direction::new(a, b, c)?, Direction::new(d, e, f)?))
}
