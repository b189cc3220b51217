//! Phase functions as a table over the cosine of the scattering angle.

use super::error::{ExportError, OptionError, setting};
use super::exported::{Exported, Summary};
use super::fits::{incoming, is_on, outgoing};
use super::measure::{Draws, measure};
use super::options::{ExportOptions, check_size};
use super::resolution::{self, cell_axes};
use super::subject::{Subject, wavelengths};
use super::writer::{Write, Writer};
use crate::domain::vector::{Vector, add, cross, scale, unit};
use crate::domain::{Axis, Direction, Domain, Quantity};
use crate::evaluate::Material;
use crate::formats::{TabulatedPhase, write_tabphase};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Number of incident directions, and of azimuths around each of them, that are averaged for the value at one
/// scattering angle. Raising them costs time.
const MEANS: (usize, usize) = (16, 8);

/// Writer of the export format `tabphase`: a phase function as a table over the cosine of the scattering angle.
pub(super) const TABPHASE: Writer = Writer {
    name: "tabphase",
    other_names: &[],
    description: "a phase function over the cosine",
    extension: "txt",
    media_type: "text/plain",
    holds: "a phase function over the whole sphere",
    fits: |material| {
        material.quantity() == Quantity::Phase
            && incoming(material).is_some()
            && is_on(outgoing(material), &[Domain::Sphere])
            && !matches!(material.axes().last(), Some(Axis::Rgb))
    },
    whole: Some("table of the phase function"),
    options: &[("side", "cosines"), ("wavelength", "wavelength in nm")],
    write: Write::Entry(tabphase),
};

fn tabphase(material: &Material, options: &ExportOptions) -> Result<Exported, ExportError> {
    let count = resolution::cosines(material, options)?;
    check_size(count.checked_mul(16), options, "ask for a smaller side")?;
    let weights = weights(material, options)?;
    let subject = Subject::sum(material, options, weights);
    let incident = incident(material);
    let means: Vec<f64> = (0..count)
        .into_par_iter()
        .map(|i| {
            let cosine = 2.0 * i as f64 / (count - 1) as f64 - 1.0;
            mean(&subject, &incident, cosine)
        })
        .collect();
    let filled = means.iter().filter(|value| value.is_nan()).count();
    let clipped = means.iter().filter(|value| **value < 0.0).count();
    let values: Vec<f64> = means.into_iter().map(|value| value.max(0.0)).collect();
    let bytes = write_tabphase(&values)?;
    let table = TabulatedPhase::read(&bytes)?;
    let error = measure(
        "the phase function, of integral 1 in the file",
        Draws::Sphere,
        1,
        &|wi, wo, values: &mut [f64]| subject.at(wi, wo, values),
        &|wi, wo, values: &mut [f64]| values.fill(wi.map_or(f64::NAN, |wi| table.at(-wi.dot(wo)))),
    );
    let mut lost = vec!["any dependence on the incident direction itself".to_owned()];
    if let Some(grid) = wavelengths(material).filter(|grid| grid.len() > 1) {
        lost.push(match options.wavelength {
            Some(lambda) => format!("all but {lambda} nm of {} wavelengths", grid.len()),
            None => format!("the spectrum: only the mean over {} wavelengths is kept", grid.len()),
        });
    }
    let about = Summary {
        warning: None,
        format: TABPHASE.name,
        resolution: format!("{count} cosines"),
        unit: material.unit().to_string(),
        lost,
        filled,
        clipped,
        flux_error: None,
        lamp: None,
        error,
    };
    Ok(Exported { bytes, about })
}

/// Returns the weights of wavelengths that reduce the spectrum of a phase function to one number: its mean, or its
/// value at one wavelength.
fn weights(material: &Material, options: &ExportOptions) -> Result<Vec<f64>, ExportError> {
    let count = material.lambdas();
    match (wavelengths(material), options.wavelength) {
        (None, None) => Ok(vec![1.0 / count as f64; count]),
        (None, Some(_)) => setting(OptionError::UnusedWavelength),
        (Some(grid), Some(lambda)) => {
            let Some((below, t)) = grid.locate(lambda) else {
                let (first, last) = grid.range();
                return setting(OptionError::Wavelength { found: lambda, first, last });
            };
            let mut weights = vec![0.0; count];
            weights[below] = 1.0 - t;
            if t > 0.0 {
                weights[below + 1] = t;
            }
            Ok(weights)
        }
        (Some(grid), None) => {
            let weights = grid.weights();
            let total: f64 = weights.iter().sum();
            Ok(if total > 0.0 {
                weights.into_iter().map(|weight| weight / total).collect()
            } else {
                vec![1.0 / count as f64; count]
            })
        }
    }
}

/// Returns up to 16 incident directions, spread evenly over the incoming axis of a phase function. The exported values
/// are averages over them.
fn incident(material: &Material) -> Vec<Direction> {
    let pick = |length: usize, at: &dyn Fn(usize) -> Direction| {
        let count = MEANS.0.min(length);
        (0..count).map(|i| at((2 * i + 1) * length / (2 * count))).collect()
    };
    match material.layout().incoming.map(|axis| &cell_axes(material)[axis]) {
        Some(Axis::Triangles(mesh)) => pick(mesh.len(), &|i| mesh.centroid(i)),
        Some(Axis::Elevation(values)) => pick(values.len(), &|i| Direction::from_degrees(values[i], 0.0)),
        _ => Vec::new(),
    }
}

/// Returns the mean of a phase function over incident directions and azimuths at one scattering angle; masked values
/// are skipped.
fn mean(subject: &Subject<'_>, incident: &[Direction], cosine: f64) -> f64 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let (mut sum, mut found) = (0.0, 0_usize);
    for &wi in incident {
        // Unscattered light travels along −wi.
        let forward = scale(wi.xyz(), -1.0);
        let [u, v] = frame(forward);
        for turn in 0..MEANS.1 {
            let (sin, cos) = libm::sincos(TAU * (turn as f64 + 0.5) / MEANS.1 as f64);
            let aside = add(scale(u, sine * cos), scale(v, sine * sin));
            let wo = unit(add(scale(forward, cosine), aside));
            let mut value = [0.0];
            subject.at(Some(wi), Direction::from_unit(wo), &mut value);
            if !value[0].is_nan() {
                sum += value[0];
                found += 1;
            }
        }
    }
    if found > 0 { sum / found as f64 } else { f64::NAN }
}

/// Returns two unit vectors perpendicular to `axis` and to each other.
fn frame(axis: Vector) -> [Vector; 2] {
    let helper = if axis[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let u = unit(cross(helper, axis));
    [u, cross(axis, u)]
}
