//! Axes that a user requests.

use super::error::{DomainError, ProjectionError};
use crate::domain::{WavelengthGrid, named};

/// Domain of the directions after projection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum DirectionDomain {
    /// The polar angles and azimuths of the file, if it has a grid of them.
    Grid,
    /// The triangles of a subdivided octahedron, over which samples are averaged.
    Triangles,
}
named!(DirectionDomain, "domain of directions", { Grid = "grid", Triangles = "triangles" });

/// Domain of sources with a grid if the request gives neither a domain nor a level.
const DEFAULT: DirectionDomain = DirectionDomain::Grid;

/// Requested axes; everything omitted is chosen from the density of the data.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AxesRequest {
    /// Domain of directions: the grid of the file, or triangles. A level also selects triangles.
    pub domain: Option<DirectionDomain>,
    /// Subdivision level of the incoming triangles.
    pub incoming_level: Option<u8>,
    /// Subdivision level of the outgoing triangles.
    pub outgoing_level: Option<u8>,
    /// Wavelengths to resample to.
    pub wavelengths: Option<WavelengthGrid>,
    /// Additional subdivisions of the outgoing triangles of scattered samples, beyond the level that fits their
    /// spacing. Used if no level is given; fewer if the tensor would become too large.
    pub finer: u8,
    /// Relative error promised by the later compression: 0.01 is 1 %, also the default.
    pub target: Option<f64>,
}

/// Relative error promised if the request gives none: 0.01 is 1 %.
const TARGET: f64 = 0.01;

impl AxesRequest {
    /// Returns what the directions of a file with a grid of angles are projected onto: its grid, or triangles.
    pub(super) fn domain(&self) -> Result<DirectionDomain, ProjectionError> {
        let has_level = self.incoming_level.is_some() || self.outgoing_level.is_some();
        match (self.domain, has_level) {
            (Some(DirectionDomain::Grid), true) => Err(DomainError::Level.into()),
            (_, true) => Ok(DirectionDomain::Triangles),
            (named, false) => Ok(named.unwrap_or(DEFAULT)),
        }
    }

    /// Returns the promised relative error.
    pub(super) fn target(&self) -> f64 {
        self.target.unwrap_or(TARGET)
    }
}
