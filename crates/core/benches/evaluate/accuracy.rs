//! Errors of the constant and the smooth form against the formula, at and between measured incoming directions.

use super::surfaces::{Vector, direction, dot, gloss, measurement, mesh, uniform};
use wavelume_core::domain::{Axis, Direction, Domain, Measurement, WavelengthGrid};
use wavelume_core::evaluate::{Alignment, Interpolation, Material, Place};

/// Returns er(L2) over outgoing directions uniform in solid angle, and over those within the lobe.
fn error(
    material: &Material,
    how: Interpolation,
    incoming: &[Vector],
    lowest: f64,
    f: impl Fn(Vector, Vector, f64) -> f64,
) -> (f64, f64) {
    let lambdas = material.wavelengths().unwrap_or_default();
    let mut out = vec![0.0; lambdas.len()];
    let (mut all, mut peak) = ((0.0, 0.0), (0.0, 0.0));
    for &wi in incoming {
        let mirror = [-wi[0], -wi[1], wi[2]];
        for i in 0..4000 {
            let wo = uniform(i, lowest);
            let place = Place { index: &[], wi: direction(wi), wo: direction(wo) };
            material.evaluate(place, how, &mut out).unwrap_or_else(|e| unreachable!("{e}"));
            for (&value, &lambda) in out.iter().zip(&lambdas) {
                let truth = f(wi, wo, lambda);
                let e = ((f64::from(value) - truth) / truth).powi(2);
                all = (all.0 + e, all.1 + 1.0);
                if dot(wo, mirror) > 0.94 {
                    peak = (peak.0 + e, peak.1 + 1.0);
                }
            }
        }
    }
    let root = |(sum, count): (f64, f64)| 100.0 * (sum / count).sqrt();
    (root(all), root(peak))
}

/// Prints the errors at and between measured incoming directions.
pub(crate) fn accuracy(grid: &WavelengthGrid) {
    println!(
        "er(L2) in % at 4,000 fresh outgoing directions down to 80 degrees, and of those within 20 degrees of the mirror's"
    );
    println!("| material | incoming | alignment | constant | mirror | smooth | mirror | smooth between | mirror |");
    println!("|---|---|---|--:|--:|--:|--:|--:|--:|");
    let triangles = Axis::Triangles(mesh(Domain::Hemisphere, 1));
    let elevations = Axis::Elevation(vec![0.0, 15.0, 35.0, 55.0, 75.0]);
    let centroids: Vec<Vector> = (0..16).map(|i| mesh(Domain::Hemisphere, 1).centroid(i).xyz()).collect();
    let around: Vec<Vector> = (0..24).map(|i| uniform(i, 0.4)).collect();
    let at: Vec<Vector> = [15.0, 35.0, 55.0].map(|t| Direction::from_degrees(t, 0.0).xyz()).to_vec();
    let gap: Vec<Vector> =
        (0..20).map(|i| Direction::from_degrees(15.5 + f64::from(i), 18.0 * f64::from(i)).xyz()).collect();
    for alpha in [0.15, 0.3] {
        let f = |wi, wo, lambda| gloss(alpha, 0.3, wi, wo, lambda);
        for (name, axis, measured_at, between) in
            [("16 triangles", &triangles, &centroids, &around), ("elevations, 15-35", &elevations, &at, &gap)]
        {
            for level in [4, 5] {
                let measured = measurement(axis.clone(), level, grid, f);
                let own = open(measured.clone(), None).report().alignment;
                for alignment in [Alignment::None, Alignment::HalfVector, Alignment::TurnedHalfVector] {
                    if name != "16 triangles" && alignment == Alignment::TurnedHalfVector {
                        continue;
                    }
                    let material = open(measured.clone(), Some(alignment));
                    let show = |(all, peak): (f64, f64)| format!("{all:.2} | {peak:.2}");
                    println!(
                        "| GGX {alpha}, level {level} | {name} | {alignment:?}{} | {} | {} | {} |",
                        if alignment == own { " (found)" } else { "" },
                        show(error(&material, Interpolation::Constant, measured_at, 0.17, f)),
                        show(error(&material, Interpolation::Smooth, measured_at, 0.17, f)),
                        show(error(&material, Interpolation::Smooth, between, 0.17, f)),
                    );
                }
            }
        }
    }
}

fn open(measurement: Measurement, alignment: Option<Alignment>) -> Material {
    let opened = match alignment {
        None => Material::of(measurement),
        Some(alignment) => Material::with_alignment(measurement, alignment),
    };
    opened.unwrap_or_else(|e| unreachable!("{e}"))
}
