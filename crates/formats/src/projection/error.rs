//! Reasons why a measurement cannot be put on the requested axes.

use crate::domain::limits::MAX_LEVEL;
use crate::domain::{Axis, AxisError, Domain, Quantity, TensorError, TriangleMesh};
use crate::formats::{AzimuthExtent, StatedGridError};

/// Reason why a measurement cannot be put on the requested axes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProjectionError {
    /// The requested level does not fit the data.
    #[error("{role}_level: {}", level.refusal(*role))]
    Level {
        /// The axis concerned.
        role: Role,
        /// Reason for the refusal.
        level: LevelError,
    },
    /// The angles of the samples form no grid.
    #[error("{role} angles: {angles}")]
    Angles {
        /// The axis concerned.
        role: Role,
        /// Reason for the refusal.
        angles: AnglesError,
    },
    /// The samples at scattered directions are invalid.
    #[error("scattered directions: {0}")]
    Scattered(#[from] ScatteredError),
    /// A spectrum or wavelengths that do not fit the data.
    #[error(transparent)]
    Spectral(#[from] SpectralError),
    /// The requested domain does not fit the data.
    #[error("domain: {0}")]
    Domain(#[from] DomainError),
    /// The measurement cannot be made reciprocal.
    #[error("reciprocal: {0}")]
    Reciprocal(#[from] ReciprocalError),
    /// The grid of the file cannot become an axis of directions.
    #[error("grid of directions: {0}")]
    Grid(#[from] StatedGridError),
    /// The axes exceed their limits.
    #[error(transparent)]
    Axes(#[from] AxisError),
    /// The tensor cannot be created.
    #[error(transparent)]
    Tensor(#[from] TensorError),
}

/// Domains of directions that do not fit the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DomainError {
    /// The request combines the domain `grid` with a level of triangles.
    #[error("`grid` was asked for, and levels, which are those of triangles: leave one out")]
    Level,
    /// The request demands the domain `grid` of a source that has none.
    #[error("`grid` was asked for, but the file states no grid of directions: leave it out, or ask for `triangles`")]
    NoGrid,
    /// The request demands triangles of an array that is on its final grid.
    #[error("`triangles` was asked for, but the array holds directions on their final grid: leave it out")]
    Final,
}

/// Reasons why exchanged pairs of directions cannot be averaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ReciprocalError {
    /// A quantity that is not reciprocal.
    #[error("found {found}, expected a brdf")]
    Quantity {
        /// The quantity.
        found: Quantity,
    },
    /// A grid that lacks some exchanged pairs.
    #[error(
        "the grid does not hold every exchanged pair of directions, expected outgoing angles that are the incoming ones \
         (and azimuths of 0 to 180 degrees where there is no incoming one), on the file's own grid"
    )]
    Grid,
}

/// Role of an axis of directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Directions from which light arrives.
    Incoming,
    /// Directions into which light leaves.
    Outgoing,
}

impl Role {
    /// Returns the name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Incoming => "incoming",
            Self::Outgoing => "outgoing",
        }
    }
}

impl std::fmt::Display for Role {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// Reasons why a level does not fit the data.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum LevelError {
    /// A level above the limit.
    AboveLimit {
        /// The requested level.
        found: u8,
    },
    /// Data without directions of this role.
    NoDirections,
    /// Isotropic data, which have elevations and no triangles.
    Isotropic {
        /// Number of elevations.
        elevations: usize,
    },
    /// Data on an axis that is not made of triangles.
    NoTriangles {
        /// The axis found.
        axis: Box<Axis>,
    },
    /// A level finer than that of the data.
    TooFine {
        /// The requested level.
        found: u8,
        /// The triangles of the data.
        mesh: TriangleMesh,
    },
}

impl LevelError {
    fn refusal(&self, role: Role) -> String {
        match self {
            Self::AboveLimit { found } => format!("{found} is above the limit of {MAX_LEVEL}"),
            Self::NoDirections => format!("the data have no {role} directions to choose a level for"),
            Self::Isotropic { elevations } => {
                let s = if *elevations == 1 { "" } else { "s" };
                format!("the data are isotropic ({elevations} elevation{s}), no {role} triangles to choose a level for")
            }
            Self::NoTriangles { axis } => format!("the {role} axis is {}, no triangles", axis.describe()),
            Self::TooFine { found, mesh } => {
                let own = Axis::Triangles(*mesh).describe();
                format!("{found} requested, the data are at level {} ({own})", mesh.level())
            }
        }
    }
}

/// Reasons why angles, in degrees, form no grid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AnglesError {
    /// There is no angle at all.
    #[error("no {angle}, expected at least one")]
    Empty {
        /// The missing angle.
        angle: Angle,
    },
    /// An angle out of its range.
    #[error("{angle} {found}, expected {}", match angle {
        Angle::Theta => "0 to 180 degrees",
        Angle::Phi => "degrees of one turn",
    })]
    Range {
        /// The angle concerned.
        angle: Angle,
        /// The value in degrees.
        found: f64,
    },
    /// Angles that do not increase.
    #[error("{angle} {found} after {before}, expected strictly increasing")]
    Order {
        /// The angle concerned.
        angle: Angle,
        /// The value that is not larger than its predecessor.
        found: f64,
        /// The predecessor.
        before: f64,
    },
    /// The covered range excludes some of the samples.
    #[error("covers theta {low} to {high}, expected a range that holds {first} to {last}")]
    Covers {
        /// Start of the covered range.
        low: f64,
        /// End of the covered range.
        high: f64,
        /// The first theta.
        first: f64,
        /// The last theta.
        last: f64,
    },
    /// Azimuths that do not fit the stated extent.
    #[error("phi {first} to {last} {}", match extent {
        AzimuthExtent::Circle => "go round more than once, expected less than 360 degrees",
        AzimuthExtent::Mirrored => "are mirrored, expected 0 to 180 degrees",
        AzimuthExtent::Sector => "are more than a turn",
    })]
    Extent {
        /// The stated extent.
        extent: AzimuthExtent,
        /// The first azimuth.
        first: f64,
        /// The last azimuth.
        last: f64,
    },
    /// A single theta, which covers no area to average over.
    #[error("one theta ({theta} degrees) that stands for itself alone covers no area, expected two or more")]
    OneTheta {
        /// The theta.
        theta: f64,
    },
    /// A sector of a single azimuth, which covers no area to average over.
    #[error("a sector of one azimuth ({phi} degrees) covers no area, expected two or more, or none for all")]
    OneAzimuth {
        /// The azimuth.
        phi: f64,
    },
    /// A range outside the domain of the quantity.
    #[error("theta {low} to {high} does not reach into the {domain} of a {quantity}")]
    Beside {
        /// Start of the range.
        low: f64,
        /// End of the range.
        high: f64,
        /// The domain.
        domain: Domain,
        /// The quantity.
        quantity: Quantity,
    },
}

/// Angle of a direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Angle {
    /// Polar angle to the normal or axis.
    Theta,
    /// Azimuth.
    Phi,
}

impl std::fmt::Display for Angle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Theta => "theta",
            Self::Phi => "phi",
        })
    }
}

/// Reasons why scattered samples are invalid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ScatteredError {
    /// There is no sample.
    #[error("none, expected at least one")]
    Empty,
    /// The number of directions differs from the number of samples.
    #[error("{found} {role} directions, expected {expected} or none")]
    Count {
        /// The directions concerned.
        role: Role,
        /// Number of directions.
        found: usize,
        /// Number of samples.
        expected: usize,
    },
    /// A direction with an angle out of its range.
    #[error(
        "{role} theta {theta}, phi {phi} of sample {index}, expected degrees: theta from 0 to 180, phi of one turn"
    )]
    Direction {
        /// The directions concerned.
        role: Role,
        /// Position of the sample, from 0.
        index: usize,
        /// Theta of the direction in degrees.
        theta: f64,
        /// Azimuth of the direction in degrees.
        phi: f64,
    },
    /// More samples than can be numbered.
    #[error("{found}, expected at most {}", u32::MAX)]
    TooMany {
        /// Number of samples.
        found: usize,
    },
    /// No sample lies in the domain of the quantity.
    #[error("no sample of the {count} lies on the {domain} of a {quantity}")]
    Beside {
        /// Number of samples.
        count: usize,
        /// The domain.
        domain: Domain,
        /// The quantity.
        quantity: Quantity,
    },
}

/// Reasons why spectra and wavelengths do not fit the data.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpectralError {
    /// A spectrum to join, for data that already have a spectral axis.
    #[error("spectrum: the samples have a spectral axis of their own, {}", axis.describe())]
    OwnAxis {
        /// The spectral axis of the data.
        axis: Box<Axis>,
    },
    /// A spectrum whose number of factors differs from its number of wavelengths.
    #[error("spectrum: {found} factors for {expected} wavelengths")]
    Factors {
        /// Number of factors.
        found: usize,
        /// Number of wavelengths.
        expected: usize,
    },
    /// Requested wavelengths for data with colour channels.
    #[error("wavelengths: the data have colour channels ({}), no wavelengths", axis.describe())]
    Channels {
        /// The spectral axis of the data.
        axis: Box<Axis>,
    },
    /// Requested wavelengths for data without wavelengths.
    #[error("wavelengths: the data have no wavelengths to resample; join a spectrum with them")]
    NoWavelengths,
    /// Requested wavelengths that all lie outside the measured range.
    #[error("wavelengths: {} to {} nm requested, measured {} to {} nm", requested.0, requested.1, measured.0, measured.1)]
    Outside {
        /// The first and last requested wavelength, in nm.
        requested: (f64, f64),
        /// The first and last measured wavelength, in nm.
        measured: (f64, f64),
    },
}
