//! Query options besides directions, from query strings and JSON alike.

use super::super::problem::{Kind, Problem};
use super::super::schemas::{IndexText, WavelengthsText};
use super::places::{Angles, check};
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::domain::{Direction, WavelengthGrid};
use crate::evaluate::{Beyond, Interpolation, Material, luminaire_direction};
use serde::Deserialize;
use utoipa::IntoParams;

/// Query options for evaluating spectra for a stream of pairs of directions.
#[derive(Debug, Default, PartialEq, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct EvaluateOptions {
    /// Wavelengths, `A,B,C` or `START:STOP:STEP` in nm; default: the material's own. For NDJSON and f32 bodies only.
    #[param(value_type = Option<WavelengthsText>)]
    pub(super) wavelengths: Option<String>,
    /// Interpolation over directions. For NDJSON and f32 bodies only.
    pub(super) interpolation: Option<Interpolation>,
    /// Rule for values at wavelengths outside the measured range. For NDJSON and f32 bodies only.
    pub(super) beyond: Option<Beyond>,
    /// Zero-based position on each index axis (tensor axis before the directions), as `I,J`. For NDJSON and f32 bodies
    /// only.
    #[param(value_type = Option<IndexText>)]
    pub(super) index: Option<String>,
}

/// Query options for evaluating the sampling densities for a stream of pairs of directions.
#[derive(Debug, Default, PartialEq, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct PdfOptions {
    /// Subdivision level of the triangles from which directions are drawn; default: the material's own. For NDJSON and
    /// f32 bodies only.
    #[param(maximum = 255)]
    pub(super) level: Option<u8>,
    /// Zero-based position on each index axis (tensor axis before the directions), as `I,J`. For NDJSON and f32 bodies
    /// only.
    #[param(value_type = Option<IndexText>)]
    pub(super) index: Option<String>,
}

/// Query options for drawing one outgoing direction for each of a stream of incoming directions.
#[derive(Debug, Default, PartialEq, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct SampleOptions {
    /// Seed of the random numbers; equal seeds give equal directions on every machine; default: 0. For NDJSON and f32
    /// bodies only.
    #[param(maximum = 18_446_744_073_709_551_615_usize)]
    pub(super) seed: Option<u64>,
    /// Subdivision level of the triangles from which directions are drawn; default: the material's own. For NDJSON and
    /// f32 bodies only.
    #[param(maximum = 255)]
    pub(super) level: Option<u8>,
    /// Zero-based position on each index axis (tensor axis before the directions), as `I,J`. For NDJSON and f32 bodies
    /// only.
    #[param(value_type = Option<IndexText>)]
    pub(super) index: Option<String>,
}

/// Query options for integrating over outgoing directions for a stream of incoming directions.
#[derive(Debug, Default, PartialEq, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct AlbedoOptions {
    /// Interpolation over directions. For NDJSON and f32 bodies only.
    pub(super) interpolation: Option<Interpolation>,
    /// Zero-based position on each index axis (tensor axis before the directions), as `I,J`. For NDJSON and f32 bodies
    /// only.
    #[param(value_type = Option<IndexText>)]
    pub(super) index: Option<String>,
}

/// Parses an optional parameter of the query string with the function `read`.
pub(in crate::api) fn read<T>(
    text: Option<&str>,
    read: impl FnOnce(&str) -> Result<T, String>,
) -> Result<Option<T>, Problem> {
    text.map(read).transpose().map_err(|detail| Problem::new(Kind::BadQuery, detail))
}

/// Parses a direction `THETA,PHI` in degrees. The error names the parameter `what`.
pub(in crate::api) fn direction(what: &str, text: &str) -> Result<Direction, String> {
    let refused = || {
        let shown: String = text.chars().take(80).collect();
        format!("{what}: found `{shown}`, expected THETA,PHI in degrees with THETA from 0 to 180")
    };
    let angles: Vec<f64> = numbers(text).ok_or_else(refused)?;
    let angles: Angles = angles.try_into().map_err(|_| refused())?;
    check(what, angles)
}

/// Returns the outgoing direction of a query: `wo`, or the one with the angles C and gamma of a luminaire.
pub(in crate::api) fn outgoing(
    wo: Option<Direction>,
    angles: (Option<f64>, Option<f64>),
    material: &Material,
) -> Result<Option<Direction>, Problem> {
    match (wo, angles) {
        (wo, (None, None)) => Ok(wo),
        (None, (Some(c), Some(gamma))) => Ok(Some(luminaire_direction(material.quantity(), c, gamma)?)),
        _ => Err(Problem::new(Kind::BadQuery, "found a part of wo, c and gamma, expected wo, or c and gamma together")),
    }
}

/// Parses wavelengths in nm, as `A,B,C` or `START:STOP:STEP`.
pub(super) fn wavelengths(text: &str) -> Result<Vec<f64>, String> {
    if text.contains(':') {
        return WavelengthGrid::parse_range(text).map(|grid| grid.values()).map_err(|e| format!("wavelengths: {e}"));
    }
    let refused = || "wavelengths: expected A,B,C or START:STOP:STEP in nm".to_owned();
    let values = numbers(text).ok_or_else(refused)?;
    check_wavelengths(&values)?;
    Ok(values)
}

/// Checks the number and the values of requested wavelengths.
pub(super) fn check_wavelengths(values: &[f64]) -> Result<(), String> {
    if values.is_empty() || values.len() > MAX_WAVELENGTHS {
        return Err(format!("wavelengths: found {}, expected 1 to {MAX_WAVELENGTHS}", values.len()));
    }
    match values.iter().find(|v| !(v.is_finite() && **v > 0.0)) {
        Some(bad) => Err(format!("wavelengths: found {bad}, expected positive numbers of nm")),
        None => Ok(()),
    }
}

/// Parses positions, counted from 0, on the index axes of a material, such as columns of a table: `I,J`.
pub(in crate::api) fn indices(text: &str) -> Result<Vec<usize>, String> {
    numbers(text).ok_or_else(|| "index: expected whole numbers, none negative, with commas between them".to_owned())
}

fn numbers<T: std::str::FromStr>(text: &str) -> Option<Vec<T>> {
    text.split(',').map(|part| part.trim().parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_queries_are_checked() {
        assert!(direction("wi", "30,90").is_ok() && direction("wi", " 30 , -90 ").is_ok());
        for bad in ["", "30", "30,90,1", "x,y", "-1,0", "nan,0", "0,inf"] {
            assert!(direction("wi", bad).unwrap_err().contains("expected"), "{bad}");
        }
        assert_eq!(wavelengths("400:420:10").unwrap(), [400.0, 410.0, 420.0]);
        assert_eq!(wavelengths("550,400").unwrap(), [550.0, 400.0]);
        for bad in ["", "0", "-5", "nan", "400:", "1:1e12:1"] {
            assert!(wavelengths(bad).is_err(), "{bad}");
        }
        assert_eq!(indices("3,0").unwrap(), [3, 0]);
        assert!(indices("-1").is_err());
    }
}
