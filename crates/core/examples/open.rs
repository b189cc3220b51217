//! Opens a compressed BRDF, evaluates its spectrum for a pair of directions, and draws a direction from it.
//!
//! `cargo run --release -p wavelume-core --example open -- PLASTIC.wlm`

#![allow(clippy::print_stdout, reason = "a program that prints what it finds")]

use std::error::Error;
use wavelume_core::domain::Direction;
use wavelume_core::evaluate::{Interpolation, Material, Place, SampleOptions};

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("found no argument, expected the path of a compressed BRDF (.wlm)")?;
    let material = Material::open(&std::fs::read(path)?)?;
    let wi = Direction::from_degrees(30.0, 0.0);
    let place = Place { index: &[], wi: Some(wi), wo: Some(Direction::from_degrees(45.0, 180.0)) };
    let mut spectrum = vec![0.0; material.lambdas()];
    material.spectrum(place, Interpolation::Smooth, &mut spectrum)?;
    println!("f at {} wavelengths: {spectrum:?}", spectrum.len());

    match material.sample(&[], Some(wi), [0.3, 0.6], SampleOptions::default())? {
        Some(sample) => {
            let [theta, phi] = [sample.direction.theta(), sample.direction.phi()].map(f64::to_degrees);
            println!("drawn: theta {theta:.1}°, phi {phi:.1}°, pdf {:.4} 1/sr", sample.pdf);
        }
        None => println!("nothing is drawn: there is no light for this incoming direction"),
    }
    Ok(())
}
