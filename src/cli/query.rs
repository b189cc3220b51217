//! Parsers of queries: directions in degrees, indices, wavelengths.

use super::failure::Failure;
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::domain::{Direction, WavelengthGrid};
use crate::evaluate::{Material, luminaire_direction};

/// List that is the value of one command-line option. The option parser would take a bare `Vec` for a repeated option.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct List<T>(pub(crate) Vec<T>);

/// Outgoing direction of a luminaire by its photometric angles.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub(crate) struct LuminaireArgs {
    /// Azimuth C of the outgoing direction of a luminaire in degrees, counter-clockwise seen from above; with --gamma
    /// instead of --wo (phi = C)
    #[arg(long, value_name = "DEGREES", requires = "gamma", conflicts_with = "wo", allow_hyphen_values = true)]
    c: Option<f64>,
    /// Angle of the outgoing direction of a luminaire from straight down, 0 to 180 degrees; with --c instead of --wo
    /// (theta = 180 - gamma)
    #[arg(long, value_name = "DEGREES", requires = "c", conflicts_with = "wo", allow_hyphen_values = true)]
    gamma: Option<f64>,
}

impl LuminaireArgs {
    /// Returns the outgoing direction of a query: `wo`, or the one with the given C and gamma.
    pub(crate) fn outgoing(self, wo: Option<Direction>, material: &Material) -> Result<Option<Direction>, Failure> {
        match (self.c, self.gamma) {
            (Some(c), Some(gamma)) => Ok(Some(luminaire_direction(material.quantity(), c, gamma)?)),
            _ => Ok(wo),
        }
    }
}

/// Parses `THETA,PHI`, the polar angle and the azimuth of a direction in degrees.
pub(crate) fn direction(text: &str) -> Result<Direction, String> {
    let refused = || format!("`{text}` is no direction, expected THETA,PHI in degrees with THETA from 0 to 180");
    let angles = text.split(',').map(|part| part.trim().parse::<f64>()).collect::<Result<Vec<_>, _>>();
    let angles = angles.map_err(|_| refused())?;
    match angles.as_slice() {
        &[theta, phi] if (0.0..=180.0).contains(&theta) && phi.is_finite() => Ok(Direction::from_degrees(theta, phi)),
        _ => Err(refused()),
    }
}

/// Parses the positions, counted from 0, at which a material is queried on its leading index axes (columns of a table,
/// positions of a scan): `3` for one axis, `3,4` for two.
pub(crate) fn index(text: &str) -> Result<List<usize>, String> {
    let entries = text.split(',').map(|part| part.trim().parse()).collect::<Result<_, _>>();
    entries
        .map(List)
        .map_err(|_| format!("`{text}` is no index, expected whole numbers, none negative, with commas between them"))
}

/// Parses `0.5,-2`: one factor for each material.
pub(crate) fn weights(text: &str) -> Result<List<f64>, String> {
    let refused = || format!("`{text}` is no list of factors, expected finite numbers with commas between them");
    let values = text.split(',').map(|part| part.trim().parse()).collect::<Result<Vec<f64>, _>>();
    let values = values.map_err(|_| refused())?;
    if values.iter().all(|v| v.is_finite()) { Ok(List(values)) } else { Err(refused()) }
}

/// Parses `START:STOP:STEP`, or a list of wavelengths with commas, in nm.
pub(crate) fn wavelengths(text: &str) -> Result<List<f64>, String> {
    if text.contains(':') {
        return WavelengthGrid::parse_range(text).map(|grid| List(grid.values())).map_err(|error| error.to_string());
    }
    let refused = || format!("`{text}` is no list of wavelengths, expected START:STOP:STEP or A,B,C in nm");
    let values = text.split(',').map(|part| part.trim().parse()).collect::<Result<Vec<f64>, _>>();
    let values = values.map_err(|_| refused())?;
    let fits = values.len() <= MAX_WAVELENGTHS && values.iter().all(|v| v.is_finite() && *v > 0.0);
    if fits { Ok(List(values)) } else { Err(refused()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_degrees() {
        assert_eq!(direction("0,0").unwrap().xyz(), [0.0, 0.0, 1.0]);
        assert_eq!(direction("90, -90").unwrap().xyz(), [0.0, -1.0, 0.0]);
        for bad in ["", "30", "30,40,50", "181,0", "-1,0", "nan,0", "30,inf", "x,y"] {
            assert!(direction(bad).unwrap_err().contains("expected THETA,PHI"), "{bad}");
        }
    }

    #[test]
    fn wavelengths_are_a_range_or_a_list() {
        assert_eq!(wavelengths("400:420:10").unwrap().0, [400.0, 410.0, 420.0]);
        assert_eq!(wavelengths("550, 400").unwrap().0, [550.0, 400.0]);
        for bad in ["", "400:300:5", "a", "400,", "-400", "nan"] {
            assert!(wavelengths(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn weights_are_finite_numbers() {
        assert_eq!(weights("0.5, -2").unwrap().0, [0.5, -2.0]);
        assert!(weights("").is_err() && weights("1,nan").is_err() && weights("inf").is_err());
    }

    #[test]
    fn indices_are_numbers_from_zero() {
        assert_eq!(index("3").unwrap().0, [3]);
        assert_eq!(index("3,0").unwrap().0, [3, 0]);
        assert!(index("-1").is_err() && index("").is_err());
    }
}
