//! Spectra of a virtual measurement: numbers, tables, a few parametric shapes, and the patches of the `ColorChecker`.

use crate::domain::WavelengthGrid;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;

/// Function of wavelength in a model: `0.5`, `"light skin"`, `{"planck": {"kelvin": 2856}}`, …
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shape(Kind);

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Kind {
    /// Spectrum that is constant over wavelength.
    Constant(f64),
    /// Reflectance of a patch of the `ColorChecker` (N. Ohta), by its name.
    Colorchecker(String),
    /// Spectrum that is linear between the tabulated values and constant outside them.
    Table { wavelengths: Vec<f64>, values: Vec<f64> },
    /// Blackbody spectrum by Planck's law per unit of wavelength, normalised to 1 at 560 nm.
    Planck { kelvin: f64 },
    /// Sum of Gaussian peaks, `base + Σ height·exp(−½((λ − at)/width)²)`, in nm.
    Gaussians {
        #[serde(default)]
        base: f64,
        peaks: Vec<Peak>,
    },
    /// Smooth step over wavelength from `low` to `high`, centred at `at`, over about 4 `width` nm.
    Sigmoid { low: f64, high: f64, at: f64, width: f64 },
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Peak {
    at: f64,
    width: f64,
    height: f64,
}

/// Second radiation constant hc/k in nm·K (CODATA 2018).
const SECOND_RADIATION: f64 = 1.438_776_877e7;
const REFERENCE_NM: f64 = 560.0;
const PATCHES: &str = include_str!("../../../../../data/colorchecker_n_ohta.csv");

impl Shape {
    /// Returns the values of the spectrum at the wavelengths `lambdas` (nm), or a message about an invalid description.
    pub(super) fn at(&self, lambdas: &[f64]) -> Result<Vec<f64>, String> {
        let values = self.evaluate(lambdas)?;
        match values.iter().zip(lambdas).find(|(value, _)| !value.is_finite()) {
            Some((value, lambda)) => Err(format!("is {value} at {lambda} nm, expected a finite number")),
            None => Ok(values),
        }
    }

    fn evaluate(&self, lambdas: &[f64]) -> Result<Vec<f64>, String> {
        let each = |f: &dyn Fn(f64) -> f64| lambdas.iter().map(|&lambda| f(lambda)).collect();
        match &self.0 {
            Kind::Constant(value) => Ok(each(&|_| *value)),
            Kind::Colorchecker(patch) => {
                let (wavelengths, values) = patch_of(patch)?;
                interpolate(&wavelengths, &values, lambdas)
            }
            Kind::Table { wavelengths, values } => interpolate(wavelengths, values, lambdas),
            &Kind::Planck { kelvin } => {
                if !(kelvin > 0.0 && kelvin.is_finite()) {
                    return Err(format!("planck: {kelvin} K, expected a positive temperature"));
                }
                let exponent = |lambda: f64| libm::expm1(SECOND_RADIATION / (lambda * kelvin));
                Ok(each(&|lambda| libm::pow(REFERENCE_NM / lambda, 5.0) * exponent(REFERENCE_NM) / exponent(lambda)))
            }
            Kind::Gaussians { base, peaks } => {
                if let Some(peak) = peaks.iter().find(|peak| peak.width.is_nan() || peak.width <= 0.0) {
                    return Err(format!("gaussians: width {}, expected more than 0 nm", peak.width));
                }
                Ok(each(&|lambda| {
                    peaks.iter().fold(*base, |sum, peak| {
                        let t = (lambda - peak.at) / peak.width;
                        sum + peak.height * libm::exp(-0.5 * t * t)
                    })
                }))
            }
            &Kind::Sigmoid { low, high, at, width } => {
                if width.is_nan() || width <= 0.0 {
                    return Err(format!("sigmoid: width {width}, expected more than 0 nm"));
                }
                Ok(each(&|lambda| low + (high - low) / (1.0 + libm::exp((at - lambda) / width))))
            }
        }
    }
}

fn interpolate(wavelengths: &[f64], values: &[f64], lambdas: &[f64]) -> Result<Vec<f64>, String> {
    if wavelengths.len() != values.len() {
        return Err(format!("table: {} wavelengths and {} values, expected as many", wavelengths.len(), values.len()));
    }
    let grid = WavelengthGrid::listed(wavelengths.to_vec()).map_err(|e| format!("table: {e}"))?;
    let (first, last) = grid.range();
    let at = |lambda: f64| match grid.locate(lambda.clamp(first, last)) {
        Some((i, t)) if t > 0.0 => (1.0 - t) * values[i] + t * values[i + 1],
        Some((i, _)) => values[i],
        None => f64::NAN,
    };
    Ok(lambdas.iter().map(|&lambda| at(lambda)).collect())
}

fn patch_of(name: &str) -> Result<(Vec<f64>, Vec<f64>), String> {
    let mut lines = PATCHES.lines();
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').skip(1).collect();
    let Some(column) = names.iter().position(|known| *known == name) else {
        let found = super::super::text::snippet(name);
        return Err(format!("colorchecker patch {found}, expected one of {}", names.join(", ")));
    };
    let cells = lines.filter_map(|line| {
        let mut cells = line.split(',').map(|cell| cell.trim().parse::<f64>().unwrap_or(f64::NAN));
        Some((cells.next()?, cells.nth(column)?))
    });
    Ok(cells.unzip())
}

impl<'de> Deserialize<'de> for Shape {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ShapeVisitor).map(Self)
    }
}

struct ShapeVisitor;

impl<'de> Visitor<'de> for ShapeVisitor {
    type Value = Kind;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, the name of a ColorChecker patch, or an object with one of constant, colorchecker, table, planck, gaussians, sigmoid")
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Kind, E> {
        Ok(Kind::Constant(value))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Kind, E> {
        Ok(Kind::Constant(value as f64))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Kind, E> {
        Ok(Kind::Constant(value as f64))
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<Kind, E> {
        Ok(Kind::Colorchecker(name.to_owned()))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Kind, A::Error> {
        Kind::deserialize(MapAccessDeserializer::new(map))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(json: &str, lambdas: &[f64]) -> Result<Vec<f64>, String> {
        serde_json::from_str::<Shape>(json).map_err(|e| e.to_string())?.at(lambdas)
    }

    #[test]
    fn shapes_have_their_known_values() {
        assert_eq!(shape("0.5", &[400.0, 700.0]), Ok(vec![0.5, 0.5]));
        assert_eq!(shape("\"red\"", &[380.0]), Ok(vec![0.052]));
        let table = "{\"table\": {\"wavelengths\": [400, 500], \"values\": [1, 3]}}";
        assert_eq!(shape(table, &[300.0, 425.0, 900.0]), Ok(vec![1.0, 1.5, 3.0]));
        let gauss = "{\"gaussians\": {\"base\": 1, \"peaks\": [{\"at\": 450, \"width\": 10, \"height\": 2}]}}";
        assert_eq!(shape(gauss, &[450.0]), Ok(vec![3.0]));
        // CIE 15, illuminant A, which is 100 at 560 nm (its radiation constants are older ones).
        let planck = shape("{\"planck\": {\"kelvin\": 2855.54}}", &[560.0, 380.0, 780.0]).unwrap();
        assert!((planck[0] - 1.0).abs() < 1e-12);
        assert!((planck[1] - 0.097_951).abs() < 2e-4 && (planck[2] - 2.414_67).abs() < 2e-3, "{planck:?}");
    }

    #[test]
    fn bad_shapes_are_named() {
        for (json, expected) in [
            ("\"mauve\"", "expected one of dark skin"),
            ("{\"planck\": {\"kelvin\": 0}}", "expected a positive temperature"),
            ("{\"planck\": {\"celsius\": 0}}", "unknown field `celsius`"),
            ("{\"rainbow\": {}}", "unknown variant `rainbow`"),
            ("{\"table\": {\"wavelengths\": [400], \"values\": []}}", "expected as many"),
            ("{\"table\": {\"wavelengths\": [400, 300], \"values\": [1, 2]}}", "strictly increasing"),
            ("{\"sigmoid\": {\"low\": 0, \"high\": 1, \"at\": 500, \"width\": 0}}", "expected more than 0 nm"),
            ("[1]", "expected a number, the name"),
        ] {
            let error = shape(json, &[500.0]).unwrap_err();
            assert!(error.contains(expected), "{json}: {error}");
        }
    }
}
