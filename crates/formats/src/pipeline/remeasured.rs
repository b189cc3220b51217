//! Errors of a finished material, measured again against the measurement that it was made from.

use super::error::PipelineError;
use super::fit::at_samples;
use super::outcome::project;
use super::request::Request;
use super::source::Source;
use crate::compress::decode;
use crate::domain::{Axis, ErrorReport, Measurement};
use crate::evaluate::Material;
use crate::formats::Samples;
use crate::projection;

/// Largest difference in nm or degrees between a coordinate stored in a material and that of its measurement. Files
/// round coordinates less than that; raising it accepts materials of neighbouring axes.
const COORDINATE: f64 = 1e-3;

/// Errors of a material at the values of a measurement, measured by [`remeasure`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Remeasured {
    /// Errors at the values before compression, which the header of the material states, too.
    pub errors: ErrorReport,
    /// Errors at the samples of the measurement, if the values before compression are averages of them or were fitted
    /// to them.
    pub at_samples: Option<ErrorReport>,
}

/// Reasons why a material cannot be compared with a measurement.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RemeasureError {
    /// The material cannot be decoded, or the measurement cannot be projected onto the axes of the material.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The material is of another quantity or unit, or lies on other axes than the measurement.
    #[error("the material holds {found}, the measurement gives {expected}")]
    Other {
        /// Quantity, unit and axes of the material.
        found: String,
        /// Quantity, unit and axes that the measurement gives for the same request.
        expected: String,
    },
}

/// Measures the errors of the material file `bytes` against the measurement that it was made from. `request` is the
/// request of its compression, as far as it is known; subdivision levels are those of the material.
pub fn remeasure(source: &Source, bytes: &[u8], request: &Request) -> Result<Remeasured, RemeasureError> {
    let decoded = decode(bytes).map_err(|error| PipelineError::Opened(error.into()))?;
    let acquisition = &source.acquisition;
    let axes = decoded.measurement.tensor.axes();
    let projected = project(acquisition, &at_levels_of(axes, request))?;
    let (found, expected) = (&decoded.measurement, &projected.measurement);
    let is_same = (found.quantity, found.unit) == (expected.quantity, expected.unit)
        && axes.len() == expected.tensor.axes().len()
        && axes.iter().zip(expected.tensor.axes()).all(|(found, expected)| are_same(found, expected));
    if !is_same {
        return Err(RemeasureError::Other { found: described(found), expected: described(expected) });
    }
    let floor = decoded.summary.floor;
    let errors = ErrorReport::measure(expected.tensor.samples(), found.tensor.samples(), floor);
    let on_grid = axes.iter().any(|axis| matches!(axis, Axis::Grid(_)));
    let is_averaged = !on_grid && matches!(acquisition.samples, Samples::Grid(_));
    let scattered = projected.scattered;
    drop(projected.measurement);
    let at_samples = match scattered {
        Some(scattered) => {
            let material = Material::decoded(decoded).map_err(PipelineError::Opened)?;
            Some(at_samples(acquisition, &scattered, &material, None).errors)
        }
        None if is_averaged => projection::error_at_samples(acquisition, &decoded.measurement),
        None => None,
    };
    Ok(Remeasured { errors, at_samples })
}

/// Returns `request` with the subdivision levels of the triangles among `axes`.
fn at_levels_of(axes: &[Axis], request: &Request) -> Request {
    let mut levels = axes.iter().rev().filter_map(|axis| match axis {
        Axis::Triangles(mesh) => Some(mesh.level()),
        _ => None,
    });
    let (outgoing, incoming) = (levels.next(), levels.next());
    Request {
        outgoing_level: outgoing.or(request.outgoing_level),
        incoming_level: incoming.or(request.incoming_level),
        ..request.clone()
    }
}

/// Returns true if two axes have the same entries, up to the rounding of their coordinates in a file. Labels are not
/// compared.
fn are_same(axis: &Axis, other: &Axis) -> bool {
    let close = |a: f64, b: f64| (a - b).abs() <= COORDINATE;
    let all = |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| close(*a, *b));
    match (axis, other) {
        (Axis::Wavelength(a), Axis::Wavelength(b)) => {
            a.len() == b.len() && (0..a.len()).all(|i| close(a.at(i), b.at(i)))
        }
        (Axis::Elevation(a), Axis::Elevation(b)) => all(a, b),
        (Axis::Index { count: a, .. }, Axis::Index { count: b, .. }) => a == b,
        (Axis::Grid(a), Axis::Grid(b)) => {
            let azimuths = match (a.azimuths(), b.azimuths()) {
                (Some(a), Some(b)) => all(&a.angles, &b.angles),
                (a, b) => a.is_none() && b.is_none(),
            };
            a.frame() == b.frame() && all(a.polar(), b.polar()) && azimuths
        }
        (a, b) => a == b,
    }
}

fn described(measurement: &Measurement) -> String {
    let axes: Vec<String> = measurement.tensor.axes().iter().map(Axis::describe).collect();
    format!("{} in {} on {}", measurement.quantity, measurement.unit, axes.join(" × "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::Interpretation;
    use crate::pipeline::{Input, read};

    fn data(name: &str) -> Source {
        let path = format!("{}/../../data/{name}", env!("CARGO_MANIFEST_DIR"));
        let (bytes, interpretation) = (std::fs::read(path).unwrap(), Interpretation::default());
        read(&Input { bytes: &bytes, spectrum: None, interpretation: &interpretation }).unwrap()
    }

    #[test]
    fn errors_are_found_again_and_another_measurement_is_told() {
        let (lamp, light) = (data("aerolamp.ies"), data("illuminant_D65.csv"));
        for (source, level) in [(&lamp, None), (&lamp, Some(3)), (&light, None)] {
            let request = Request { outgoing_level: level, ..Request::er_l2(0.02) };
            let made = source.compress(&request).unwrap();
            let again = remeasure(source, &made.bytes, &request).unwrap();
            let header = crate::compress::inspect(&made.bytes).unwrap().errors;
            assert!(again.errors.er_l2 <= header.er_l2 && again.errors.er_l2 > 0.99 * header.er_l2, "{again:?}");
            assert_eq!(again.at_samples.map(|errors| errors.er_l2), level.map(|_| made.report.errors.er_l2));
        }
        let made = lamp.compress(&Request::er_l2(0.02)).unwrap();
        let error = remeasure(&light, &made.bytes, &Request::er_l2(0.02)).unwrap_err();
        assert!(!error.to_string().is_empty());
    }
}
