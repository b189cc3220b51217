//! Reasons why a measurement cannot be put on the requested axes.

use crate::domain::limits::MAX_LEVEL;
use crate::domain::{Axis, AxisError, Domain, Quantity, TensorError, TriangleMesh, readable};
use crate::formats::{AzimuthExtent, StatedGridError};

/// Reason why a measurement cannot be resampled to the requested axes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProjectionError {
    /// The requested subdivision level of triangles does not fit the data.
    #[error("{role}_level does not fit the data: {}", level.refusal(*role))]
    Level {
        /// Direction axis (incoming or outgoing) for which the requested subdivision level of triangles does not fit
        /// the data.
        role: Role,
        /// Reason for which the subdivision level is refused.
        level: LevelError,
    },
    /// The polar angles and azimuths of the samples form no grid.
    #[error("the {role} polar angles and azimuths form no usable grid: {reason}", reason = angles)]
    Angles {
        /// Direction axis (incoming or outgoing) whose polar angles and azimuths in the file are refused.
        role: Role,
        /// Reason for which the polar angles and azimuths of the file are refused.
        angles: AnglesError,
    },
    /// The list of samples at scattered directions is empty or too long, or its directions are incomplete or out of
    /// range.
    #[error("unusable samples at scattered directions: {0}")]
    Scattered(#[from] ScatteredError),
    /// The requested wavelengths, or the spectrum by which the data are to be multiplied, do not fit the data.
    #[error(transparent)]
    Spectral(#[from] SpectralError),
    /// The requested domain of directions (grid or triangles) does not fit the data.
    #[error("the requested domain of directions (grid or triangles) does not fit the data: {0}")]
    Domain(#[from] DomainError),
    /// The measurement cannot be made reciprocal, with f(ωi, ωo) = f(ωo, ωi).
    #[error("cannot make the measurement reciprocal: {0}")]
    Reciprocal(#[from] ReciprocalError),
    /// The grid of directions in the file cannot become an axis of the projected measurement.
    #[error("the file's grid of directions cannot become an axis: {0}")]
    Grid(#[from] StatedGridError),
    /// The axes onto which the measurement is projected are invalid or make more samples than the limit.
    #[error(transparent)]
    Axes(#[from] AxisError),
    /// The tensor of the projected measurement cannot be created, for example because a sample is infinite.
    #[error("on the axes of the material, {0}")]
    Tensor(#[from] TensorError),
}

/// Reasons why a requested domain of directions (grid or triangles) does not fit the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DomainError {
    /// The request combines the domain `grid` with a subdivision level of triangles.
    #[error("found the domain `grid` and a level of triangles, expected only one of them; leave one out")]
    Level,
    /// The request demands the domain `grid` for a file that has no grid of directions.
    #[error(
        "found `grid` for a file without a grid of directions, expected `triangles`; leave the domain out or change it"
    )]
    NoGrid,
    /// The request demands triangles for an array that already has a grid of directions as an axis, which is always
    /// kept.
    #[error(
        "found the domain `triangles` for an array with a grid of directions, which is always kept; leave the domain \
         of directions out"
    )]
    Final,
}

/// Reasons why a measurement cannot be averaged with its values at exchanged directions, f(ωo, ωi).
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ReciprocalError {
    /// The physical quantity is not one that reciprocity applies to.
    #[error("found {found}, expected a brdf, the only quantity that can be made reciprocal")]
    Quantity {
        /// Physical quantity of the measurement.
        found: Quantity,
    },
    /// The grid lacks some exchanged pairs of directions: f(ωo, ωi) for a stored f(ωi, ωo).
    #[error(
        "the grid does not hold every exchanged pair of directions, expected outgoing angles that are the incoming ones \
         (and azimuths of 0 to 180 degrees where there is no incoming one), on the file's own grid"
    )]
    Grid,
}

/// Role of a direction axis: incoming or outgoing light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Directions from which light arrives.
    Incoming,
    /// Directions into which light leaves.
    Outgoing,
}

impl Role {
    /// Returns the word for the light whose directions an axis holds: `incoming` for arriving, `outgoing` for leaving
    /// light.
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

/// Reasons why a requested subdivision level of triangles does not fit the data.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum LevelError {
    /// The requested subdivision level is above the limit.
    AboveLimit {
        /// Requested subdivision level of the triangle mesh of directions.
        found: u8,
    },
    /// The request gives a subdivision level for incoming or outgoing triangles, but the data have no such directions.
    NoDirections,
    /// The data are isotropic: their incoming directions are polar angles, not triangles.
    Isotropic {
        /// Number of incoming polar angles of the data.
        elevations: usize,
    },
    /// The direction axis of the data does not consist of triangles.
    NoTriangles {
        /// Axis of incoming or outgoing directions of the data, which does not consist of triangles.
        axis: Box<Axis>,
    },
    /// The requested subdivision level is finer than the triangles of the data.
    TooFine {
        /// Requested subdivision level of the triangle mesh of directions.
        found: u8,
        /// Triangle mesh of the incoming or outgoing directions in the data; the requested level is finer.
        mesh: TriangleMesh,
    },
}

impl LevelError {
    fn refusal(&self, role: Role) -> String {
        match self {
            Self::AboveLimit { found } => format!("level {found} is above the limit of {MAX_LEVEL}"),
            Self::NoDirections => format!("the data have no {role} directions to choose a level for"),
            Self::Isotropic { elevations } => {
                let s = if *elevations == 1 { "" } else { "s" };
                format!("the data are isotropic ({elevations} elevation{s}), no {role} triangles to choose a level for")
            }
            Self::NoTriangles { axis } => format!("the {role} axis is {}, expected triangles", axis.describe()),
            Self::TooFine { found, mesh } => {
                let own = Axis::Triangles(*mesh).describe();
                format!("level {found} was requested, expected at most {}, that of the data ({own})", mesh.level())
            }
        }
    }
}

/// Reasons why polar angles and azimuths, in degrees, form no valid grid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AnglesError {
    /// The list of polar angles or of azimuths is empty.
    #[error("no {angle} angles, expected at least one")]
    Empty {
        /// Angle (theta or phi) whose list is empty.
        angle: Angle,
    },
    /// A polar angle or azimuth is out of its range.
    #[error("found {angle} {found}, expected {}", match angle {
        Angle::Theta => "0 to 180 degrees",
        Angle::Phi => "degrees of one turn",
    })]
    Range {
        /// Angle (theta or phi) that is out of its range.
        angle: Angle,
        /// Value of the angle that is out of its range, in degrees.
        found: f64,
    },
    /// The polar angles or azimuths do not increase strictly.
    #[error(
        "found {angle} {found} after {before} degrees in a grid of directions, expected strictly increasing angles"
    )]
    Order {
        /// Angle (theta or phi) whose values do not increase.
        angle: Angle,
        /// Polar angle or azimuth, in degrees, that is not larger than the one before it in the list.
        found: f64,
        /// Polar angle or azimuth, in degrees, after which the list fails to increase.
        before: f64,
    },
    /// The range of theta that the file says it covers excludes some of the samples.
    #[error(
        "the grid covers theta {low} to {high} degrees, expected a range that contains its angles {first} to {last}"
    )]
    Covers {
        /// Start, in degrees, of the range of theta that the grid of the file covers.
        low: f64,
        /// End, in degrees, of the range of theta that the grid of the file covers.
        high: f64,
        /// Smallest polar angle of the grid, in degrees.
        first: f64,
        /// Largest polar angle of the grid, in degrees.
        last: f64,
    },
    /// The azimuths lie outside the extent that they should have: a full circle, a mirrored half (0 to 180°), or a
    /// sector.
    #[error("found azimuths phi {first} to {last} degrees, expected {}", match extent {
        AzimuthExtent::Circle => "a range of less than 360 degrees",
        AzimuthExtent::Mirrored => "0 to 180 degrees for mirrored azimuths",
        AzimuthExtent::Sector => "a range of at most 360 degrees",
    })]
    Extent {
        /// Extent that the azimuths should have: a full circle, a mirrored half (0 to 180°), or a sector.
        extent: AzimuthExtent,
        /// Smallest azimuth of the grid, in degrees.
        first: f64,
        /// Largest azimuth of the grid, in degrees.
        last: f64,
    },
    /// The grid has a single polar angle, which covers no area to average over.
    #[error("found a single theta ({theta} degrees), which covers no area, expected two or more")]
    OneTheta {
        /// The only polar angle, in degrees, of the grid of directions in the file.
        theta: f64,
    },
    /// The grid is a sector with a single azimuth, which covers no area to average over.
    #[error(
        "found a sector of a single azimuth ({phi} degrees), which covers no area, expected two or more, or no azimuth \
         for values that hold at all azimuths"
    )]
    OneAzimuth {
        /// The only azimuth, in degrees, of the grid of directions in the file.
        phi: f64,
    },
    /// The outgoing directions of a surface have no azimuths although light comes in obliquely: they lie in one plane.
    #[error(
        "found no azimuths under oblique incidence, so that the directions lie in one plane, which covers no area: keep the \
         grid of the file"
    )]
    NoAzimuths,
    /// The range of theta that the grid of the file covers lies outside the directions for which the quantity is
    /// defined.
    #[error("theta {low} to {high} degrees does not reach into the {domain} of directions of a {quantity}")]
    Beside {
        /// Start, in degrees, of the range of theta that the grid of the file covers.
        low: f64,
        /// End, in degrees, of the range of theta that the grid of the file covers.
        high: f64,
        /// Part of the sphere on which the quantity is defined.
        domain: Domain,
        /// Physical quantity of the measurement.
        quantity: Quantity,
    },
}

/// One of the two spherical angles of a direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Angle {
    /// Polar angle θ, from the surface normal or the axis of the luminaire.
    Theta,
    /// Azimuth φ of a direction.
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

/// Reasons why samples at scattered directions are invalid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ScatteredError {
    /// The file contains no sample.
    #[error("the file contains no sample, expected at least one")]
    Empty,
    /// The file lists a number of incoming or outgoing directions that is neither 0 nor the number of samples.
    #[error("{found} {role} directions, expected {expected} or none: one for each sample")]
    Count {
        /// Role of the directions whose number is wrong: incoming or outgoing.
        role: Role,
        /// Number of incoming or of outgoing directions that the file lists.
        found: usize,
        /// Number of samples, which is the expected number of incoming or of outgoing directions.
        expected: usize,
    },
    /// The polar angle or azimuth of a sample direction is out of its range.
    #[error(
        "found {role} theta {theta}, phi {phi} degrees of sample {index}, expected theta 0 to 180, phi -720 to 720 degrees"
    )]
    Direction {
        /// Role (incoming or outgoing) of the direction at fault.
        role: Role,
        /// Position, counted from 0, of the sample with the direction at fault.
        index: usize,
        /// Polar angle of the direction at fault, in degrees.
        theta: f64,
        /// Azimuth of the direction at fault, in degrees.
        phi: f64,
    },
    /// The file contains more samples than 32-bit indices can number.
    #[error("found {found} samples in the file, expected at most {}", u32::MAX)]
    TooMany {
        /// Number of samples in the file.
        found: usize,
    },
    /// No sample lies in the part of the sphere on which the quantity is defined.
    #[error("no sample of the {count} lies on the {domain} of directions of a {quantity}")]
    Beside {
        /// Number of samples of the file.
        count: usize,
        /// Part of the sphere on which the quantity is defined.
        domain: Domain,
        /// Physical quantity of the measurement.
        quantity: Quantity,
    },
}

/// Reasons why requested wavelengths, or a spectrum by which the data are to be multiplied, do not fit the data.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpectralError {
    /// The data are to be multiplied by a spectrum, but already have a spectral axis.
    #[error("spectrum: cannot be joined with these samples, which already have the spectral axis {}", axis.describe())]
    OwnAxis {
        /// Spectral axis that the data already have.
        axis: Box<Axis>,
    },
    /// The spectrum by which the data are to be multiplied has another number of values than of wavelengths.
    #[error("spectrum: found {found} factors for {expected} wavelengths, expected one for each")]
    Factors {
        /// Number of values of the spectrum by which the data are to be multiplied.
        found: usize,
        /// Number of wavelengths of the spectrum by which the data are to be multiplied.
        expected: usize,
    },
    /// Wavelengths are requested, but the data have colour channels.
    #[error("wavelengths: cannot resample data with colour channels ({}) instead of wavelengths", axis.describe())]
    Channels {
        /// Spectral axis of the data, made of colour channels.
        axis: Box<Axis>,
    },
    /// Wavelengths are requested, but the data have none.
    #[error("wavelengths: the data have no wavelengths to resample; join a spectrum with the data")]
    NoWavelengths,
    /// All requested wavelengths lie outside the measured range.
    #[error(
        "wavelengths: {} to {} nm requested, measured {} to {} nm",
        readable(requested.0), readable(requested.1), readable(measured.0), readable(measured.1)
    )]
    Outside {
        /// First and last requested wavelength, in nm.
        requested: (f64, f64),
        /// First and last measured wavelength, in nm.
        measured: (f64, f64),
    },
}
