//! Axes that a user requests.

use super::error::{DomainError, ProjectionError};
use crate::domain::{DEFAULT_ERROR, WavelengthGrid, named};

/// Domain of directions onto which a measurement is resampled: a grid of angles or triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum DirectionDomain {
    /// The grid of polar angles and azimuths of the file, if it has one.
    Grid,
    /// The triangles of a subdivided octahedron, over which samples are averaged.
    Triangles,
}
named!(DirectionDomain, "domain of directions", { Grid = "grid", Triangles = "triangles" });

/// Domain of directions for files with a grid, if the request gives neither a domain nor a triangle level.
const DEFAULT: DirectionDomain = DirectionDomain::Grid;

/// Axes requested for a measurement; everything omitted is chosen from the density of the data.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AxesRequest {
    /// Domain of directions: the grid of the file, or triangles. Requesting a triangle level also selects triangles.
    pub domain: Option<DirectionDomain>,
    /// Subdivision level of the triangles of incoming directions.
    pub incoming_level: Option<u8>,
    /// Subdivision level of the triangles of outgoing directions.
    pub outgoing_level: Option<u8>,
    /// Wavelengths to which the spectra are resampled.
    pub wavelengths: Option<WavelengthGrid>,
    /// Number of additional subdivisions of the outgoing triangles for scattered samples, beyond the level that fits
    /// the sample spacing. Used if no level is requested; fewer if the tensor would become too large.
    pub finer: u8,
    /// Root mean square of the relative error that compression guarantees for the data resampled onto the requested
    /// axes: 0.01 is 1 %. `None` means [`DEFAULT_ERROR`].
    pub target: Option<f64>,
}

impl AxesRequest {
    /// Returns the domain onto which the directions of a file with a grid of angles are resampled: its grid, or
    /// triangles.
    pub(super) fn domain(&self) -> Result<DirectionDomain, ProjectionError> {
        let has_level = self.incoming_level.is_some() || self.outgoing_level.is_some();
        match (self.domain, has_level) {
            (Some(DirectionDomain::Grid), true) => Err(DomainError::Level.into()),
            (_, true) => Ok(DirectionDomain::Triangles),
            (named, false) => Ok(named.unwrap_or(DEFAULT)),
        }
    }

    /// Returns the root mean square of the relative error that compression guarantees for the data resampled onto the
    /// requested axes: the requested one, or the default one.
    pub(super) fn target(&self) -> f64 {
        self.target.unwrap_or(DEFAULT_ERROR)
    }
}
