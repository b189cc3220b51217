//! Evaluates a measured material (an RGL `.bsdf`, a MERL `.binary`) as its file defines it, before any compression, or
//! a compressed one (`.wlm`).
//!
//! `cargo run --release -p wavelume-formats --example rgl -- M.bsdf < PAIRS`; a line of PAIRS has six numbers, the
//! incoming and the outgoing direction as `x y z`, of any length. For each line it prints f(wi, wo) in sr⁻¹, without
//! the cosine, at every wavelength or colour channel of the file.

mod common;

use std::error::Error;
use std::io::{BufRead, BufWriter, Write};
use std::process::ExitCode;
use wavelume_core::compress::is_material;
use wavelume_core::domain::{Axis, Direction};
use wavelume_core::evaluate::{Interpolation, Material, Place};
use wavelume_formats::formats::{Interpretation, Samples, read};

fn main() -> ExitCode {
    common::main("rgl", |path, out| {
        let path = path.ok_or("expected the file of a material")?;
        run(path, &mut std::io::stdin().lock(), &mut BufWriter::new(out))
    })
}

/// Prints the values of the material in `path` for every line of `pairs`.
pub(crate) fn run(path: &str, pairs: &mut impl BufRead, out: &mut impl Write) -> Result<bool, Box<dyn Error>> {
    let bytes = std::fs::read(path)?;
    let (mut evaluate, channels) = if is_material(&bytes) { compressed(&bytes)? } else { measured(path, &bytes)? };
    let mut values = vec![0.0; channels];
    for (i, line) in pairs.lines().enumerate() {
        let line = line?;
        let (wi, wo) = pair(&line).ok_or_else(|| format!("line {}: expected six numbers, two directions", i + 1))?;
        evaluate(wi, wo, &mut values)?;
        let text: Vec<String> = values.iter().map(|value| format!("{value:e}")).collect();
        writeln!(out, "{}", text.join(" "))?;
    }
    out.flush()?;
    Ok(true)
}

/// Function of two directions, and the number of its channels.
type Evaluated = (Box<dyn FnMut(Direction, Direction, &mut [f64]) -> Result<(), Box<dyn Error>>>, usize);

fn measured(path: &str, bytes: &[u8]) -> Result<Evaluated, Box<dyn Error>> {
    let Samples::Function(modelled) = read(bytes, &Interpretation::default())?.samples else {
        return Err(format!("{path} holds samples, expected a function").into());
    };
    let channels = modelled.spectral.as_ref().map_or(1, Axis::len);
    let evaluate = move |wi: Direction, wo: Direction, values: &mut [f64]| {
        modelled.function.evaluate(wi, wo, values);
        Ok(())
    };
    Ok((Box::new(evaluate), channels))
}

fn compressed(bytes: &[u8]) -> Result<Evaluated, Box<dyn Error>> {
    let material = Material::open(bytes)?;
    let channels = material.lambdas();
    let mut spectrum = vec![0.0; channels];
    let evaluate = move |wi: Direction, wo: Direction, values: &mut [f64]| {
        let place = Place { index: &[], wi: Some(wi), wo: Some(wo) };
        material.evaluate(place, Interpolation::Smooth, &mut spectrum)?;
        values.iter_mut().zip(&spectrum).for_each(|(value, &sample)| *value = f64::from(sample));
        Ok(())
    };
    Ok((Box::new(evaluate), channels))
}

fn pair(line: &str) -> Option<(Direction, Direction)> {
    let numbers: Vec<f64> = line.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    let &[a, b, c, d, e, f] = numbers.as_slice() else { return None };
    Some((Direction::new(a, b, c)?, Direction::new(d, e, f)?))
}
