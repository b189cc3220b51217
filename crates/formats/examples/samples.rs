//! Samples of a measured file as the library reads them: directions and values, one row each.
//!
//! `cargo run --release -p wavelume-formats --example samples -- FILE [unit=UNIT] [column=COLUMN] [member=NAME]` prints
//! CSV: `theta_i,phi_i,theta_o,phi_o` in degrees of the surface frame, blank where the quantity has none, then the
//! value, or one for each wavelength or channel. A spectrum that is joined with a luminaire multiplies its intensities.
//! Other programs compare the readers with their own by it.

mod common;

use std::error::Error;
use std::io::Write;
use std::process::ExitCode;
use wavelume_core::domain::Axis;
use wavelume_formats::formats::{Acquisition, Angles, Interpretation, Samples, read};

fn main() -> ExitCode {
    common::main("samples", |path, out| {
        let path = path.ok_or("expected a file")?;
        let how = options(std::env::args().skip(2))?;
        print(&read(&std::fs::read(path)?, &how)?, out)?;
        Ok(true)
    })
}

fn options(arguments: impl Iterator<Item = String>) -> Result<Interpretation, Box<dyn Error>> {
    let mut how = serde_json::Map::new();
    for argument in arguments {
        let (key, value) = argument.split_once('=').ok_or("expected options as key=value")?;
        how.insert(key.to_owned(), value.into());
    }
    Ok(serde_json::from_value(how.into())?)
}

/// Prints the samples of a file; fails for functions, which have none.
pub(crate) fn print(file: &Acquisition, out: &mut impl Write) -> Result<(), Box<dyn Error>> {
    let (incoming, outgoing, spectral, values) = match &file.samples {
        Samples::Grid(grid) if grid.index.is_empty() => {
            let sides = [&grid.incoming, &grid.outgoing].map(|side| side.as_ref().map_or(vec![None], directions));
            let [into, from] = &sides;
            let pairs = || into.iter().flat_map(|wi| from.iter().map(move |wo| (*wi, *wo)));
            (
                pairs().map(|pair| pair.0).collect(),
                pairs().map(|pair| pair.1).collect(),
                &grid.spectral,
                &grid.values[..],
            )
        }
        Samples::Scattered(found) => {
            let side = |angles: &[[f64; 2]]| -> Vec<Option<[f64; 2]>> {
                if angles.is_empty() {
                    vec![None; found.directions()]
                } else {
                    angles.iter().copied().map(Some).collect()
                }
            };
            (side(&found.incoming), side(&found.outgoing), &found.spectral, &found.values[..])
        }
        _ => return Err("the file has no samples at directions".into()),
    };
    let width = spectral.as_ref().map_or(1, Axis::len);
    let factors = file.spectral_factor.as_ref().map_or(&[1.0][..], |factor| &factor.factors);
    writeln!(out, "{},{},{}", file.format, file.quantity, file.unit)?;
    for ((wi, wo), row) in incoming.iter().zip(&outgoing).zip(values.chunks_exact(width)) {
        for side in [wi, wo] {
            match side {
                Some([theta, phi]) => write!(out, "{theta},{phi},")?,
                None => write!(out, ",,")?,
            }
        }
        let row = row.iter().flat_map(|value| factors.iter().map(move |factor| f64::from(*value) * factor));
        let row: Vec<String> = row.map(|value| value.to_string()).collect();
        writeln!(out, "{}", row.join(","))?;
    }
    Ok(())
}

/// Returns the directions of a grid of angles, `[theta, phi]` in degrees; phi is 0 where the grid has no azimuths.
fn directions(angles: &Angles) -> Vec<Option<[f64; 2]>> {
    let phi = angles.phi.as_ref().map_or(&[0.0][..], |azimuths| &azimuths.phi);
    angles.theta.iter().flat_map(|&theta| phi.iter().map(move |&phi| Some([theta, phi]))).collect()
}
