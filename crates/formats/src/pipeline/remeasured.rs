//! Errors of a finished material, measured again against the measurement that it was made from.

use super::error::PipelineError;
use super::fit::at_samples;
use super::outcome::project;
use super::request::Request;
use super::source::{Input, Source, read};
use crate::compress::{Decoded, decode};
use crate::domain::{Axis, ErrorReport, Layout, Measurement, WavelengthGrid};
use crate::evaluate::Material;
use crate::formats::Samples;
use crate::projection::{self, DirectionDomain, Projected};

/// Largest difference in nm or degrees between a coordinate stored in a material and that of its measurement. Files
/// round coordinates less than that; raising it accepts materials of neighbouring axes.
const COORDINATE: f64 = 1e-3;

/// Errors of a material at the values of a measurement, measured by [`remeasure`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Remeasured {
    /// Errors of the material against the values before compression. The header of the material states the errors
    /// against the same values.
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

/// Measures the errors of the material file `bytes` against `input`, the measurement that it was made from. `request`
/// is the request of its compression, as far as it is known. It may come from the file, which anybody may have written,
/// so the domain and the subdivision levels of directions are those of the material, and other wavelengths than those
/// of the material are refused before the measurement is read.
pub fn remeasure(input: &Input<'_>, bytes: &[u8], request: &Request) -> Result<Remeasured, RemeasureError> {
    let decoded = decode(bytes).map_err(|error| PipelineError::Opened(error.into()))?;
    let (source, projected) = projected_like(input, &decoded, request)?;
    let (acquisition, found, expected) = (&source.acquisition, &decoded.measurement, &projected.measurement);
    let axes = found.tensor.axes();
    let floor = decoded.summary.floor;
    let errors = ErrorReport::at_directions(axes, expected.tensor.samples(), found.tensor.samples(), floor);
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

/// Opens `input`, the measurement from which the material file `bytes` was made, on the axes and with the interpolation
/// of the material, so that both can be compared. `request` is that of [`remeasure`].
pub fn open_source(input: &Input<'_>, bytes: &[u8], request: &Request) -> Result<Material, RemeasureError> {
    let decoded = decode(bytes).map_err(|error| PipelineError::Opened(error.into()))?;
    let (_, projected) = projected_like(input, &decoded, request)?;
    // A lobe beside the cells belongs to the material: the measurement has it, too.
    Ok(Material::decoded(Decoded { measurement: projected.measurement, ..decoded }).map_err(PipelineError::Opened)?)
}

/// Reads `input` and projects it onto the axes of a material that was made from it.
fn projected_like(
    input: &Input<'_>,
    decoded: &Decoded,
    request: &Request,
) -> Result<(Source, Projected), RemeasureError> {
    let axes = decoded.measurement.tensor.axes();
    if let Some(range) = &request.wavelengths {
        let wanted = WavelengthGrid::parse_range(range).map_err(PipelineError::from)?.len();
        let is_same = axes.iter().any(|axis| matches!(axis, Axis::Wavelength(grid) if grid.len() == wanted));
        if !is_same {
            let expected = format!("{wanted} wavelengths, {range} nm");
            return Err(RemeasureError::Other { found: described(&decoded.measurement), expected });
        }
    }
    let mut interpretation = input.interpretation.clone();
    interpretation.wavelengths.clone_from(&request.wavelengths);
    let source = read(&Input { interpretation: &interpretation, ..*input })?;
    let acquisition = &source.acquisition;
    // A projection keeps both, and needs not be made to find that they differ.
    let found = &decoded.measurement;
    if (found.quantity, found.unit) != (acquisition.quantity, acquisition.unit) {
        let expected = format!("{} in {}", acquisition.quantity, acquisition.unit);
        return Err(RemeasureError::Other { found: described(found), expected });
    }
    let projected = project(acquisition, &on_axes_of(found, request))?;
    let expected = &projected.measurement;
    let is_same = axes.len() == expected.tensor.axes().len()
        && axes.iter().zip(expected.tensor.axes()).all(|(found, expected)| are_same(found, expected));
    if !is_same {
        return Err(RemeasureError::Other { found: described(found), expected: described(expected) });
    }
    Ok((source, projected))
}

/// Returns `request` with the domain and the subdivision levels of the directions of `material`.
fn on_axes_of(material: &Measurement, request: &Request) -> Request {
    let axes = material.tensor.axes();
    // The decoder has refused axes that do not fit the quantity.
    let layout = Layout::of(material.quantity, axes);
    let (incoming, outgoing) = layout.map_or((None, None), |layout| (layout.incoming, layout.outgoing));
    let level = |axis: Option<usize>| match &axes[axis?] {
        Axis::Triangles(mesh) => Some(mesh.level()),
        _ => None,
    };
    let (incoming_level, outgoing_level) = (level(incoming), level(outgoing));
    let on_triangles = incoming_level.is_some() || outgoing_level.is_some();
    let on_grid = axes.iter().any(|axis| matches!(axis, Axis::Grid(_)));
    let domain = match (on_grid, on_triangles) {
        (true, false) => Some(DirectionDomain::Grid),
        (false, true) => Some(DirectionDomain::Triangles),
        // Levels name triangles already, and a material without either has no cells to choose.
        _ => None,
    };
    Request { domain, incoming_level, outgoing_level, ..request.clone() }
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

    fn data(name: &str) -> Vec<u8> {
        std::fs::read(format!("{}/../../data/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap()
    }

    #[test]
    fn errors_are_found_again_and_another_measurement_is_told() {
        let (lamp, light) = (data("aerolamp.ies"), data("illuminant_D65.csv"));
        let interpretation = Interpretation::default();
        let [lamp, light] =
            [&lamp, &light].map(|bytes| Input { bytes, spectrum: None, interpretation: &interpretation });
        for (input, level) in [(&lamp, None), (&lamp, Some(3)), (&light, None)] {
            let request = Request { outgoing_level: level, ..Request::er_l2(0.02) };
            let made = read(input).unwrap().compress(&request).unwrap();
            let again = remeasure(input, &made.bytes, &request).unwrap();
            let header = crate::compress::inspect(&made.bytes).unwrap().errors;
            assert!(again.errors.er_l2 <= header.er_l2 && again.errors.er_l2 > 0.99 * header.er_l2, "{again:?}");
            assert_eq!(again.at_samples.map(|errors| errors.er_l2), level.map(|_| made.report.errors.er_l2));
            // Levels that the request states do not choose the size of the projection.
            let finest = Request { outgoing_level: Some(8), ..request };
            assert_eq!(remeasure(input, &made.bytes, &finest).unwrap(), again);
        }
        let made = read(&lamp).unwrap().compress(&Request::er_l2(0.02)).unwrap();
        let error = remeasure(&light, &made.bytes, &Request::er_l2(0.02)).unwrap_err();
        assert!(!error.to_string().is_empty());
        // Other wavelengths are told before the measurement is read, which could not be read here.
        let many = Request { wavelengths: Some("400:700:0.1".to_owned()), ..Request::er_l2(0.02) };
        let unread = Input { bytes: b"", spectrum: None, interpretation: &interpretation };
        let error = remeasure(&unread, &made.bytes, &many).unwrap_err();
        assert!(matches!(&error, RemeasureError::Other { expected, .. } if expected.contains("3001 wave")), "{error}");
    }
}
