//! Opens a compressed BRDF, evaluates it for a pair of directions, and samples a direction from it.
//!
//! `cargo run --release -p wavelume-core --example open -- crates/core/examples/materials/plastic.wlm`

#![allow(clippy::print_stdout, reason = "a program that prints what it finds")]

use std::error::Error;
use wavelume_core::domain::Direction;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("found no argument, expected the path of a compressed BRDF (.wlm)")?;
    let material = wavelume_core::open(path)?;
    let bsdf = material.bsdf()?.at([450.0, 550.0, 650.0])?;
    let wi = Direction::from_degrees(30.0, 0.0);
    let f = bsdf.eval(wi, Direction::from_degrees(45.0, 180.0));
    println!("f at {:?} nm: {f:?} 1/sr", bsdf.wavelengths());

    match bsdf.sample(wi, [0.3, 0.6]) {
        Some(sample) => {
            let [theta, phi] = [sample.wo.theta_degrees(), sample.wo.phi_degrees()];
            println!(
                "drawn: theta {theta:.1}°, phi {phi:.1}°, pdf {:.4} 1/sr, weights {:?}",
                sample.pdf, sample.weight
            );
        }
        None => println!("nothing is drawn: no light is reflected for this incoming direction"),
    }
    Ok(())
}
