//! The axes that a user asks for.

use super::error::{DomainError, ProjectionError};
use crate::domain::{WavelengthGrid, named};

/// Domain of the directions after projection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum DirectionDomain {
    /// The polar angles and azimuths of the file, where it has a grid of them.
    Grid,
    /// The triangles of a subdivided octahedron, over which samples are averaged.
    Triangles,
}
named!(DirectionDomain, "domain of directions", { Grid = "grid", Triangles = "triangles" });

/// Domain of sources with a grid where neither it nor a level is named.
const DEFAULT: DirectionDomain = DirectionDomain::Grid;

/// The axes the user asks for; what is not given is chosen from the data's own density.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AxesRequest {
    /// Grid of the file or triangles; a level asks for triangles, too.
    pub domain: Option<DirectionDomain>,
    /// Subdivision level of the incoming triangles.
    pub incoming_level: Option<u8>,
    /// Subdivision level of the outgoing triangles.
    pub outgoing_level: Option<u8>,
    /// Wavelengths to resample to.
    pub wavelengths: Option<WavelengthGrid>,
    /// Subdivisions of the outgoing triangles of scattered samples beyond the level that fits their spacing, where no level is
    /// named; fewer where the tensor would be too large.
    pub finer: u8,
    /// The relative error that is promised later (1 % if none is named).
    pub target: Option<f64>,
}

/// Relative error that is promised if none is named.
const TARGET: f64 = 0.01;

impl AxesRequest {
    /// Returns the domain of sources with a grid.
    pub(super) fn domain(&self) -> Result<DirectionDomain, ProjectionError> {
        let has_level = self.incoming_level.is_some() || self.outgoing_level.is_some();
        match (self.domain, has_level) {
            (Some(DirectionDomain::Grid), true) => Err(DomainError::Level.into()),
            (_, true) => Ok(DirectionDomain::Triangles),
            (named, false) => Ok(named.unwrap_or(DEFAULT)),
        }
    }

    /// Returns the relative error that is promised.
    pub(super) fn target(&self) -> f64 {
        self.target.unwrap_or(TARGET)
    }
}
