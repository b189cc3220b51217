//! The axes that a user asks for.

use crate::domain::WavelengthGrid;

/// The axes the user asks for; what is not given is chosen from the data's own density.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AxesRequest {
    /// Subdivision level of the incoming triangles.
    pub incoming_level: Option<u8>,
    /// Subdivision level of the outgoing triangles.
    pub outgoing_level: Option<u8>,
    /// Wavelengths to resample to.
    pub wavelengths: Option<WavelengthGrid>,
    /// The relative error that is promised later: levels for scattered directions represent what was measured to half of it
    /// (1 % if none is named).
    pub target: Option<f64>,
}

/// The relative error of which levels take half, if none is named.
const TARGET: f64 = 0.01;

impl AxesRequest {
    /// Returns the relative error that is promised.
    pub(super) fn target(&self) -> f64 {
        self.target.unwrap_or(TARGET)
    }
}
