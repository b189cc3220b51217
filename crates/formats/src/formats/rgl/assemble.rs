//! Conversion of the checked fields of a tensor file to the material model and its spectral axis.

use super::about::NAME;
use super::container::{Field, Fields};
use super::limits::LARGEST;
use super::model::{Model, Reduction};
use super::refusal::{malformed, over_limit};
use super::warp::{Map, Warp};
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::domain::{Axis, WavelengthGrid};
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::turned::turn;
use crate::notes::ScatteringNote;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Tolerance in radians for angles that a tensor file stores as f32. Raising it accepts less exact angles.
const TOLERANCE: f64 = 1e-4;

/// Builds the BRDF model of an RGL file and the spectral axis of its values. The shape of each field is checked before
/// its numbers are read.
pub(super) fn model(fields: &Fields<'_>, report: &mut ParseReport) -> Result<(Model, Axis), FormatError> {
    let theta = angles(fields.require("theta_i")?)?;
    let phi = angles(fields.require("phi_i")?)?;
    check_elevations(fields.require("theta_i")?, &theta)?;
    let isotropic = phi.len() <= 2;
    let reduction = if isotropic { Reduction::None } else { reduction(fields.require("phi_i")?, &phi, report)? };
    if isotropic && phi.len() == 2 {
        report.note(ScatteringNote::TwoAzimuthsIsotropic);
    }

    let (values, spectral) = match (fields.get("spectra"), fields.get("rgb")) {
        (Some(spectra), rgb) => {
            if rgb.is_some() {
                report.note(ScatteringNote::RgbBesideSpectra);
            }
            (spectra, Axis::Wavelength(wavelengths(fields.require("wavelengths")?)?))
        }
        (None, Some(rgb)) => (rgb, Axis::Rgb),
        (None, None) => return Err(fields.missing("spectra` or `rgb")),
    };
    values.check("f32", 5)?;
    let side = values.shape[4];
    check_nodes(values, side)?;
    let why = "incident azimuths, elevations, channels, and a square of values";
    values.check_shape(&[phi.len(), theta.len(), spectral.len(), side, side], why)?;
    let luminance = fields.require("luminance")?;
    luminance.check("f32", 4)?;
    luminance.check_shape(&[phi.len(), theta.len(), side, side], "one map beside each square of values")?;

    let visible = fields.require("vndf")?;
    visible.check("f32", 4)?;
    let (rows, columns) = (visible.shape[2], visible.shape[3]);
    check_nodes(visible, rows.min(columns))?;
    visible.check_shape(&[phi.len(), theta.len(), rows, columns], "one density for each incident direction")?;
    let visible_values = densities(visible)?;
    let visible_warp = Warp::new(rows, columns, visible_values).map_err(|slice| {
        let message = format!("slice {slice} of `vndf` is 0 everywhere, expected a density");
        malformed(visible.at + 4 * slice * rows * columns, message)
    })?;

    let (normals, area) = (map(fields.require("ndf")?)?, map(fields.require("sigma")?)?);
    let microfacets = jacobian(fields.require("jacobian")?)?.then_some((normals, area));
    let (values, missing) = channels_last(values, side * side, spectral.len(), report)?;
    let model = Model {
        microfacets,
        visible: visible_warp,
        isotropic,
        reduction,
        side,
        channels: spectral.len(),
        values,
        missing,
        phi,
        theta,
    };
    Ok((model, spectral))
}

/// Reads a list of angles in radians, which must be finite and increasing.
fn angles(field: &Field<'_>) -> Result<Vec<f64>, FormatError> {
    field.check("f32", 1)?;
    let angles: Vec<f64> = field.floats().map(f64::from).collect();
    for (i, &angle) in angles.iter().enumerate() {
        let previous = i.checked_sub(1).map_or(f64::NEG_INFINITY, |before| angles[before]);
        if !(angle.is_finite() && angle.abs() <= TAU + TOLERANCE && angle > previous) {
            let message =
                format!("`{}`: angle {i} is {angle}, expected radians within a turn, strictly increasing", field.name);
            return Err(malformed(field.at + 4 * i, message));
        }
    }
    Ok(angles)
}

fn check_elevations(field: &Field<'_>, theta: &[f64]) -> Result<(), FormatError> {
    let Some(i) = theta.iter().position(|t| !(0.0..=FRAC_PI_2 + TOLERANCE).contains(t)) else { return Ok(()) };
    let message = format!("`theta_i`: elevation {i} is {}, expected 0 to π/2", theta[i]);
    Err(malformed(field.at + 4 * i, message))
}

/// Returns the symmetry of the measured surface, which follows from the range of incident azimuths stored in the file.
fn reduction(field: &Field<'_>, phi: &[f64], report: &mut ParseReport) -> Result<Reduction, FormatError> {
    let (first, last) = (phi[0], phi[phi.len() - 1]);
    let degrees = |radians: f64| libm::round(radians.to_degrees() * 100.0) / 100.0;
    let (first_degrees, last_degrees) = (degrees(first), degrees(last));
    let (reduction, end) = match libm::round(TAU / (last - first)) {
        1.0 => (Reduction::None, PI),
        2.0 => (Reduction::Half, 0.0),
        4.0 => (Reduction::Quarter, -FRAC_PI_2),
        _ => (Reduction::None, f64::NEG_INFINITY),
    };
    if first < -PI - TOLERANCE || last > end + TOLERANCE {
        let message = format!(
            "incident azimuths from {first_degrees}° to {last_degrees}°, expected -180° to 180°, -180° to 0° or -180° to -90°"
        );
        return Err(FormatError::at_byte(FormatErrorKind::Unsupported, NAME, field.at, message));
    }
    match reduction {
        Reduction::None => {}
        Reduction::Half => report.note(ScatteringNote::HalfTurnSymmetry { first_degrees, last_degrees }),
        Reduction::Quarter => {
            report.note(ScatteringNote::MirrorSymmetry { first_degrees, last_degrees });
        }
    }
    if first > -PI + TOLERANCE || last < end - TOLERANCE {
        report.note(ScatteringNote::AzimuthEndsHeld { first_degrees, last_degrees });
    }
    Ok(reduction)
}

fn wavelengths(field: &Field<'_>) -> Result<WavelengthGrid, FormatError> {
    field.check("f32", 1)?;
    if field.shape[0] > MAX_WAVELENGTHS {
        let message = format!("{} wavelengths are more than the limit of {MAX_WAVELENGTHS}", field.shape[0]);
        return Err(over_limit(field.entry, message));
    }
    let values = field.floats().map(f64::from).collect();
    WavelengthGrid::listed(values).map_err(|e| malformed(field.at, format!("`wavelengths`: {e}")))
}

fn check_nodes(field: &Field<'_>, least: usize) -> Result<(), FormatError> {
    if least >= 2 {
        return Ok(());
    }
    let message = format!("`{}` has the shape {:?}, expected at least 2 × 2 nodes", field.name, field.shape);
    Err(malformed(field.entry, message))
}

/// Returns the numbers of a field of an RGL file; refuses negative ones.
fn densities(field: &Field<'_>) -> Result<Vec<f32>, FormatError> {
    if let Some((i, value)) = field.floats().enumerate().find(|(_, v)| !(0.0..=LARGEST).contains(v)) {
        let message = format!("`{}`: number {i} is {value:e}, expected 0 to {LARGEST:e}", field.name);
        return Err(malformed(field.at + 4 * i, message));
    }
    Ok(field.floats().collect())
}

fn map(field: &Field<'_>) -> Result<Map, FormatError> {
    field.check("f32", 2)?;
    let (rows, columns) = (field.shape[0], field.shape[1]);
    check_nodes(field, rows.min(columns))?;
    Ok(Map::new(rows, columns, densities(field)?))
}

fn jacobian(field: &Field<'_>) -> Result<bool, FormatError> {
    match field.bytes()? {
        [0] => Ok(false),
        [1] => Ok(true),
        other => {
            let found = if other.len() == 1 { other[0].to_string() } else { format!("{} bytes", other.len()) };
            Err(malformed(field.at, format!("`jacobian` is {found}, expected one byte, 0 or 1")))
        }
    }
}

/// Reorders values `[slice, channel, node]` to `[slice, node, channel]`, because an evaluation needs all channels of a
/// few nodes. Also returns the number of missing values.
fn channels_last(
    field: &Field<'_>,
    nodes: usize,
    channels: usize,
    report: &mut ParseReport,
) -> Result<(Vec<f32>, usize), FormatError> {
    let (mut missing, mut negative, mut lowest, mut over) = (0_usize, 0_usize, 0.0_f32, false);
    let words = field.words();
    let mut values = vec![0.0_f32; words.len()];
    let slice = nodes * channels;
    for (words, target) in words.chunks_exact(slice).zip(values.chunks_exact_mut(slice)) {
        turn((target, channels), nodes, channels, |channel, node, piece| {
            // 32-bit counters vectorise; a piece has fewer than 2^28 numbers.
            let (mut missing_here, mut negative_here, mut over_here) = (0_u32, 0_u32, 0_u32);
            for (to, &word) in piece.iter_mut().zip(&words[channel * nodes + node..]) {
                let value = f32::from_le_bytes(word);
                missing_here += u32::from(value.is_nan());
                negative_here += u32::from(value < 0.0);
                over_here += u32::from(value.abs() > LARGEST);
                *to = value;
            }
            missing += missing_here as usize;
            negative += negative_here as usize;
            over |= over_here > 0;
            if negative_here > 0 {
                lowest = piece.iter().copied().fold(lowest, f32::min);
            }
        });
    }
    if over && let Some((i, value)) = field.floats().enumerate().find(|(_, value)| value.abs() > LARGEST) {
        let message = format!(
            "`{}`: number {i} is {value:e}, expected at most {LARGEST:e}, or NaN where nothing was measured",
            field.name
        );
        return Err(malformed(field.at + 4 * i, message));
    }
    let all = values.len();
    if missing > 0 {
        report.note(ScatteringNote::MissingMasked { values: missing, of: all });
    }
    if negative > 0 {
        report.note(ScatteringNote::NegativeKept { values: negative, of: all, lowest });
    }
    Ok((values, missing))
}
