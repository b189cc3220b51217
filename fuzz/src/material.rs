//! Queries of an opened material, with checks that hold for every material.

use wavelume_core::domain::{Axis, Direction};
use wavelume_core::evaluate::{Beyond, Interpolation, Material, Place};

/// Theta and phi in degrees: poles, horizon, edges and vertices of the mesh, and places between.
const DIRECTIONS: [(f64, f64); 12] = [
    (0.0, 0.0),
    (10.0, 20.0),
    (30.0, 135.0),
    (45.0, 45.0),
    (60.0, 300.0),
    (89.999, 180.0),
    (90.0, 0.0),
    (90.0, 45.0),
    (90.001, 270.0),
    (120.0, 10.0),
    (150.0, 225.0),
    (180.0, 0.0),
];
/// Points of the unit square.
const POINTS: [[f64; 2]; 5] = [[0.0, 0.0], [1.0, 1.0], [0.5, 0.5], [0.123, 0.876], [1.0, 0.0]];
/// Wavelengths in nm.
const WAVELENGTHS: [f64; 5] = [0.001, 380.0, 550.25, 780.0, 1e9];

/// Opens `bytes` and queries values, densities, samples and albedos at the first and last index.
pub fn use_material(bytes: &[u8]) {
    let Ok(material) = Material::open(bytes) else { return };
    assert!(material.memory() > 0);
    let axes = material.axes();
    let mut indices = vec![Vec::new(), Vec::new()];
    for axis in axes.iter().take_while(|axis| matches!(axis, Axis::Index { .. })) {
        indices[0].push(0);
        indices[1].push(axis.len() - 1);
    }
    let directions: Vec<Option<Direction>> =
        DIRECTIONS.iter().map(|&(theta, phi)| Some(Direction::from_degrees(theta, phi))).chain([None]).collect();
    for index in &indices {
        for &wi in &directions {
            for &wo in &directions {
                values(&material, Place { index, wi, wo });
            }
            samples(&material, index, wi);
        }
    }
}

fn values(material: &Material, place: Place<'_>) {
    let mut spectrum = vec![0.0; material.lambdas()];
    let mut between = [0.0; WAVELENGTHS.len()];
    for how in [Interpolation::Constant, Interpolation::Smooth] {
        let answered = material.evaluate(place, how, &mut spectrum).is_ok();
        let again = material.at_wavelengths(place, how, Beyond::Masked, &WAVELENGTHS, &mut between);
        assert!(again.is_err() || answered, "values at wavelengths, but no spectrum");
    }
    if let Some(wo) = place.wo
        && let Ok(pdf) = material.pdf(place.index, place.wi, wo, None::<u8>)
    {
        assert!(pdf.is_finite() && pdf >= 0.0, "pdf {pdf}");
    }
}

fn samples(material: &Material, index: &[usize], wi: Option<Direction>) {
    for u in POINTS {
        for level in [None, Some(0_u8), Some(1), Some(200)] {
            let Ok(Some(sample)) = material.sample(index, wi, u, level) else { continue };
            assert!(sample.pdf > 0.0 && sample.pdf.is_finite(), "pdf {} of a sample", sample.pdf);
            assert!(sample.weight >= 0.0, "weight {}", sample.weight);
        }
    }
    let mut albedo = vec![0.0; material.lambdas()];
    let _ = material.albedo(index, wi, Interpolation::Smooth, &mut albedo);
}
