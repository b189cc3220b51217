//! Reasons why a material cannot answer a query.

use crate::compress::DecodeError;
use crate::domain::limits::MAX_LEVEL;
use crate::domain::{AxisError, Domain, Quantity, TensorError};

/// Failures to open or query a material: damaged bytes, or a query that does not fit it.
///
/// ```
/// use wavelume_core::domain::Direction;
/// use wavelume_core::evaluate::{EvaluateError, Interpolation, Place, QueryError};
/// let material = wavelume_core::open_bytes(include_bytes!("../../examples/materials/plastic.wlm"))?;
/// let place = Place { index: &[], wi: None, wo: Some(Direction::from_degrees(0.0, 0.0)) };
/// let refused = material.evaluate(place, Interpolation::Smooth, &mut vec![0.0; material.lambdas()]);
/// assert!(matches!(refused, Err(EvaluateError::Query(QueryError::MissingDirection { .. }))));
/// # Ok::<(), EvaluateError>(())
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EvaluateError {
    /// The bytes are not a material.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// The axes do not fit the quantity.
    #[error(transparent)]
    Axes(#[from] AxisError),
    /// The samples do not form a tensor.
    #[error(transparent)]
    Tensor(#[from] TensorError),
    /// The query does not fit the material.
    #[error(transparent)]
    Query(#[from] QueryError),
}

/// Queries that do not fit a material.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum QueryError {
    /// Wrong number of indices: one is needed for each index axis.
    #[error("{found} indices, expected {expected}: one for each index axis")]
    Indices {
        /// Number of indices given.
        found: usize,
        /// Number of index axes.
        expected: usize,
    },
    /// An index beyond the end of its axis.
    #[error("index {found} on axis {axis} of {length} entries, expected 0 to {}", length - 1)]
    Index {
        /// The index given.
        found: usize,
        /// Position of the axis among the index axes, from 0.
        axis: usize,
        /// Number of entries of the axis.
        length: usize,
    },
    /// A direction is missing.
    #[error("no {argument} was given, but this {quantity} has an {} axis", argument.axis())]
    MissingDirection {
        /// The missing direction.
        argument: Argument,
        /// Quantity of the material.
        quantity: Quantity,
    },
    /// A direction is given for an axis that the data do not have.
    #[error("{argument} was given, but this {quantity} has no {} axis", argument.axis())]
    UnexpectedDirection {
        /// The direction given.
        argument: Argument,
        /// Quantity of the material.
        quantity: Quantity,
    },
    /// A `wi` outside the incoming domain.
    #[error("wi has theta = {theta:.3} degrees, outside the incoming domain `{domain}`")]
    Outside {
        /// Angle between `wi` and the z axis in degrees.
        theta: f64,
        /// Domain of the incoming axis.
        domain: Domain,
    },
    /// A `wi` outside a grid of incoming directions.
    #[error("wi has theta = {theta:.3} and phi = {phi:.3} degrees, outside the incoming directions that were measured")]
    Unmeasured {
        /// Angle between `wi` and the z axis in degrees.
        theta: f64,
        /// Azimuth of `wi` in degrees.
        phi: f64,
    },
    /// A direction of a batch that cannot be normalised.
    #[error("direction {index} is ({}, {}, {}), expected finite coordinates that are not all 0", found[0], found[1], found[2])]
    Direction {
        /// Position in the batch, from 0.
        index: usize,
        /// Coordinates x, y and z.
        found: [f32; 3],
    },
    /// Coordinate arrays of unequal lengths.
    #[error("{argument} has {}, {} and {} coordinates, expected {expected} of each", found[0], found[1], found[2])]
    Coordinates {
        /// Directions concerned.
        argument: Argument,
        /// Numbers of x, y and z coordinates.
        found: [usize; 3],
        /// Number of directions of the batch.
        expected: usize,
    },
    /// Number of unit vectors that differs from the rest of the batch.
    #[error("{argument} has {found} directions, expected {expected}")]
    Count {
        /// Directions concerned.
        argument: Argument,
        /// Number of unit vectors.
        found: usize,
        /// Number of directions of the batch.
        expected: usize,
    },
    /// Buffer of the wrong length.
    #[error("{}", buffer.refusal(*found, *expected))]
    Length {
        /// Buffer concerned.
        buffer: Buffer,
        /// Actual length of the buffer.
        found: usize,
        /// Required length of the buffer.
        expected: usize,
    },
    /// Buffers of unequal lengths for a batch of draws.
    #[error(
        "{} and {} coordinates of points, room for {directions} directions and {weights} weights, expected as many of each \
         and {expected} weights", points[0], points[1]
    )]
    Drawings {
        /// Numbers of first and second coordinates of points.
        points: [usize; 2],
        /// Length of the buffer of densities.
        directions: usize,
        /// Length of the buffer of weights.
        weights: usize,
        /// Required number of weights: chosen wavelengths times points.
        expected: usize,
    },
    /// Wavelengths are requested, but the data are RGB or of a single channel.
    #[error("wavelengths were asked for, but this {quantity} has none")]
    NoWavelengths {
        /// Quantity of the material.
        quantity: Quantity,
    },
    /// Too many wavelengths at once.
    #[error("{found} wavelengths, expected at most {most}")]
    TooManyWavelengths {
        /// Number of wavelengths given.
        found: usize,
        /// Maximum number of wavelengths.
        most: usize,
    },
    /// Wavelength outside the measured range.
    #[error("{found} nm is outside the measured wavelengths")]
    Wavelength {
        /// Wavelength in nm.
        found: f64,
    },
    /// The request needs an outgoing axis, which the data do not have.
    #[error("{}", need.refusal(*quantity))]
    NoOutgoing {
        /// Request concerned.
        need: Need,
        /// Quantity of the material.
        quantity: Quantity,
    },
    /// The quantity has no reflected and transmitted side.
    #[error("this {quantity} has no reflected and transmitted side")]
    NoSides {
        /// Quantity of the material.
        quantity: Quantity,
    },
    /// The quantity has no reflectance.
    #[error("this {quantity} has no reflectance, expected a brdf, btdf or bsdf")]
    NoReflectance {
        /// Quantity of the material.
        quantity: Quantity,
    },
    /// The quantity has no reciprocity that its data can show.
    #[error("a {quantity} {}", match quantity {
        Quantity::Btdf => "is reciprocal only with a factor of the refractive indices, which it does not hold",
        _ => "has no reciprocity, expected a brdf, bsdf or phase function",
    })]
    NoReciprocity {
        /// Quantity of the material.
        quantity: Quantity,
    },
    /// The data have no pair of directions to exchange.
    #[error("this {quantity} has no axes of directions to exchange")]
    NoExchange {
        /// Quantity of the material.
        quantity: Quantity,
    },
    /// The integral of the quantity over directions need not be 1.
    #[error("normalisation was asked for, but this is a {quantity}, expected a phase function")]
    NotNormalised {
        /// Quantity of the material.
        quantity: Quantity,
    },
    /// Subdivision level above the limit.
    #[error("integration at level {found}, expected at most {MAX_LEVEL}")]
    Level {
        /// Level given.
        found: u8,
    },
    /// Sample point outside the unit square.
    #[error("u = [{}, {}], expected a point of the unit square", u[0], u[1])]
    Point {
        /// Coordinates of the point.
        u: [f64; 2],
    },
    /// Defensive fraction outside 0 ≤ δ < 1.
    #[error("a defensive part of {found}, expected 0 or more and less than 1")]
    Defensive {
        /// Defensive fraction of all samples.
        found: f64,
    },
}

/// Direction arguments of a query.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Argument {
    /// Incoming direction.
    Wi,
    /// Outgoing direction.
    Wo,
}

impl Argument {
    fn axis(self) -> &'static str {
        match self {
            Self::Wi => "incoming",
            Self::Wo => "outgoing",
        }
    }
}

impl std::fmt::Display for Argument {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Wi => "wi",
            Self::Wo => "wo",
        })
    }
}

/// Buffers that a caller passes to a query.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Buffer {
    /// One spectrum.
    Spectrum,
    /// One value for each wavelength.
    Wavelengths,
    /// The spectra of a batch.
    Spectra {
        /// Number of spectra.
        count: usize,
        /// Samples of each spectrum.
        lambdas: usize,
    },
    /// Scratch space.
    Scratch,
    /// Weights of the samples of a spectrum.
    Weights,
    /// One sample for each point of the unit square.
    Samples,
}

impl Buffer {
    /// Fails if a buffer does not have the expected length.
    #[inline]
    pub(super) fn check(self, found: usize, expected: usize) -> Result<(), EvaluateError> {
        if found == expected { Ok(()) } else { unfit(QueryError::Length { buffer: self, found, expected }) }
    }

    fn refusal(self, found: usize, expected: usize) -> String {
        match self {
            Self::Spectrum => format!("room for {found} samples, expected {expected}"),
            Self::Wavelengths => format!("room for {found} samples, expected {expected}: one a wavelength"),
            Self::Spectra { count, lambdas } => {
                format!("room for {found} samples, expected {count} spectra of {lambdas}")
            }
            Self::Scratch => format!("scratch of {found} samples, expected {expected}: as many as room"),
            Self::Weights => format!("{found} weights, expected {expected}: one a sample"),
            Self::Samples => format!("{expected} points, room for {found} samples, expected as many"),
        }
    }
}

/// Requests that need an outgoing axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Need {
    /// Importance sampling.
    Sampling,
    /// Integration over outgoing directions.
    Integration,
    /// Normalisation of a phase function.
    Normalisation,
    /// Reflectance or transmittance.
    Reflectance,
    /// Energy report.
    Energy,
    /// Reciprocity report.
    Reciprocity,
}

impl Need {
    fn refusal(self, quantity: Quantity) -> String {
        let report = |what| format!("this {quantity} has no outgoing axis: there is no {what} to report");
        match self {
            Self::Sampling => format!("this {quantity} has no outgoing axis to sample"),
            Self::Integration => format!("this {quantity} has no outgoing axis to integrate over"),
            Self::Normalisation => {
                "normalisation was asked for, but this phase function has no outgoing axis to integrate over".to_owned()
            }
            Self::Reflectance => report("reflectance"),
            Self::Energy => report("energy"),
            Self::Reciprocity => report("reciprocity"),
        }
    }
}

/// Wraps a query error in a failed result.
#[cold]
pub(super) fn unfit<T>(error: QueryError) -> Result<T, EvaluateError> {
    Err(EvaluateError::Query(error))
}
