//! Options that supply information missing from a file's bytes.

use super::normalization::Normalization;
use super::stated::StatedQuantity;
use crate::domain::{Quantity, Unit};
use serde::{Deserialize, Serialize};

/// Interpretation of a file given by the user; every field is optional.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Interpretation {
    /// Quantity, if the file does not state it or states it wrongly.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantity: Option<StatedQuantity>,
    /// Unit of the values.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Unit of the wavelengths in a spectral table: `nm`, `um`, `angstrom` or `1/cm`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wavelength_unit: Option<String>,
    /// Column of values of a spectral table, by name or by number from 1 (wavelengths are not counted).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// Integral of the values of a phase table over the sphere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normalization: Option<Normalization>,
    /// Name of the archive member to read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub member: Option<String>,
    /// Axes of an array, in the form of the manifest that may accompany it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axes: Option<serde_json::Value>,
    /// Wavelengths of an array whose manifest states only `"lambda"`: `START:STOP:STEP` in nm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wavelengths: Option<String>,
}

impl Interpretation {
    /// Returns the quantity of the measurement that the user requests.
    pub(super) fn quantity(&self) -> Option<Quantity> {
        self.quantity.map(StatedQuantity::quantity)
    }

    /// Returns true if the user states that the values are reflectance factors.
    pub(super) fn is_factor(&self) -> bool {
        self.quantity.is_some_and(StatedQuantity::is_factor)
    }
}
