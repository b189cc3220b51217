//! Options that say about a file what its bytes leave open, and what of them the user gave.

use super::normalization::Normalization;
use super::stated::StatedQuantity;
use crate::domain::{Quantity, Unit};
use serde::{Deserialize, Serialize};

/// What the user says about a file beyond its bytes; all optional.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Interpretation {
    /// The quantity, where the file does not say or says it wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantity: Option<StatedQuantity>,
    /// The unit of a value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// The unit of wavelengths in a spectral table: `nm`, `um`, `angstrom` or `1/cm`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wavelength_unit: Option<String>,
    /// The column of values of a spectral table, by name or by number from 1 (the wavelengths are not counted).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// What the values of a phase table integrate to over the sphere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normalization: Option<Normalization>,
    /// The file of an archive that is read, by its name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub member: Option<String>,
    /// The axes of an array, as the manifest that may lie beside it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axes: Option<serde_json::Value>,
    /// The wavelengths of an array whose manifest says only `"lambda"`: `START:STOP:STEP` in nm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wavelengths: Option<String>,
}

impl Interpretation {
    /// The quantity of the measurement that the user asks for.
    pub(super) fn quantity(&self) -> Option<Quantity> {
        self.quantity.map(StatedQuantity::quantity)
    }

    /// Returns true where the user calls the values reflectance factors.
    pub(super) fn is_factor(&self) -> bool {
        self.quantity.is_some_and(StatedQuantity::is_factor)
    }
}
