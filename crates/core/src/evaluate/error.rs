//! Reasons why a material cannot answer a query.

use super::measured_share::MeasuredShare;
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
    /// The bytes cannot be decoded as a compressed material.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// The axes of the data do not fit their quantity.
    #[error(transparent)]
    Axes(#[from] AxisError),
    /// The number of samples does not fit the axes.
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
    /// Wrong number of indices: one is needed for each index axis (axis of the samples before those of directions and
    /// wavelength).
    #[error(
        "the option index: found {found} numbers, expected {expected}, one for each axis of numbered entries (columns of a \
         table, scan positions)"
    )]
    Indices {
        /// Number of positions on index axes (axes of the samples before those of directions and wavelength) that the
        /// query gives.
        found: usize,
        /// Number of index axes of the material, each of which needs an index.
        expected: usize,
    },
    /// Index beyond the end of its axis.
    #[error("index {found} on axis {axis} of {length} entries, expected 0 to {}", length - 1)]
    Index {
        /// Index that the query gives, counted from 0, on an axis of the samples before those of directions and
        /// wavelength.
        found: usize,
        /// Position, counted from 0, of the axis concerned among the index axes (axes of the samples before those of
        /// directions and wavelength).
        axis: usize,
        /// Number of entries of the axis that is indexed.
        length: usize,
    },
    /// The query lacks a direction that the material depends on.
    #[error("no {argument} was given, but this {quantity} depends on the {} direction", argument.axis())]
    MissingDirection {
        /// Direction that the query lacks: incoming or outgoing.
        argument: Argument,
        /// Radiometric quantity of the material, such as `brdf`.
        quantity: Quantity,
    },
    /// The query gives a direction on which the material does not depend.
    #[error("{argument} was given, but this {quantity} does not depend on an {} direction", argument.axis())]
    UnexpectedDirection {
        /// Direction that the query gives although the material does not depend on it: incoming or outgoing.
        argument: Argument,
        /// Radiometric quantity of the material, such as `brdf`.
        quantity: Quantity,
    },
    /// Incoming direction outside the hemisphere or sphere that the incoming axis covers.
    #[error("wi has theta = {theta:.3} degrees, outside the incoming domain `{domain}`")]
    Outside {
        /// Angle between the incoming direction `wi` and the z axis, in degrees.
        theta: f64,
        /// Hemisphere or sphere that the incoming axis covers.
        domain: Domain,
    },
    /// Incoming direction outside the measured grid of incoming directions.
    #[error("wi has theta = {theta:.3} and phi = {phi:.3} degrees, outside the incoming directions that were measured")]
    Unmeasured {
        /// Angle between the incoming direction `wi` and the z axis, in degrees.
        theta: f64,
        /// Azimuth of the incoming direction `wi` in degrees.
        phi: f64,
    },
    /// Direction of a batch that cannot be normalised: a coordinate is not finite, or all are 0.
    #[error("direction {index} is ({}, {}, {}), expected finite coordinates that are not all 0", found[0], found[1], found[2])]
    Direction {
        /// Position of the invalid direction in the batch, counted from 0.
        index: usize,
        /// Coordinates x, y and z of the invalid direction.
        found: [f32; 3],
    },
    /// Arrays of x, y and z coordinates of unequal lengths.
    #[error("{argument} has {} x, {} y and {} z coordinates, expected {expected} each", found[0], found[1], found[2])]
    Coordinates {
        /// Directions whose arrays of coordinates have the wrong length: incoming or outgoing.
        argument: Argument,
        /// Numbers of elements in the arrays of x, of y and of z coordinates that the caller passes for a batch of
        /// directions.
        found: [usize; 3],
        /// Number of directions that the query needs: one for each direction pair or random point.
        expected: usize,
    },
    /// The batch has not as many unit vectors as pairs or points.
    #[error("{argument} has {found} directions, expected {expected}: as many as the rest of the batch")]
    Count {
        /// Directions of which the query gives the wrong number: incoming or outgoing.
        argument: Argument,
        /// Number of unit vectors that the caller passes to a query of a batch of directions.
        found: usize,
        /// Number of directions that the query needs: one for each direction pair or random point.
        expected: usize,
    },
    /// Array for results, scratch space or weights passed to a query with the wrong length.
    #[error(
        "found {found} elements in an array for results, scratch space or weights, expected {expected}: {lengths}",
        lengths = buffer.refusal(*found, *expected)
    )]
    Length {
        /// Purpose of the array whose length is wrong: results, scratch space or spectral weights.
        buffer: Buffer,
        /// Number of elements of the array that the caller passes for results, scratch space or spectral weights.
        found: usize,
        /// Number of elements that an array passed for results, scratch space or spectral weights must have.
        expected: usize,
    },
    /// Input and output buffers of unequal lengths in a call that draws a batch of directions.
    #[error(
        "{} first and {} second coordinates of points, room for {directions} directions and {weights} weights, \
         expected as many directions as coordinates of each kind, and {expected} weights", points[0], points[1]
    )]
    Drawings {
        /// Lengths of the arrays of first and of second coordinates of the points in the unit square from which
        /// directions are drawn.
        points: [usize; 2],
        /// First length, among the arrays of coordinates and densities, that differs from the number of points; that
        /// number if none does.
        directions: usize,
        /// Length of the output array for the weights f · |cos θo| / pdf of the drawn directions.
        weights: usize,
        /// Required length of the output array for weights f · |cos θo| / pdf: number of chosen wavelengths times
        /// number of points of the unit square.
        expected: usize,
    },
    /// Wavelengths are requested, but the data are RGB or of a single channel.
    #[error("wavelengths were asked for, but this {quantity} has none")]
    NoWavelengths {
        /// Radiometric quantity of the material, such as `brdf`.
        quantity: Quantity,
    },
    /// More wavelengths than can be evaluated at once.
    #[error("{found} wavelengths, expected at most {most} at once")]
    TooManyWavelengths {
        /// Number of wavelengths that the query gives.
        found: usize,
        /// Maximum number of wavelengths that can be evaluated at once.
        most: usize,
    },
    /// Wavelength outside the measured range of wavelengths.
    #[error("{found} nm is outside the measured wavelengths")]
    Wavelength {
        /// Wavelength in nm that the query gives.
        found: f64,
    },
    /// The request needs outgoing directions, which the data do not have.
    #[error("this request needs data over outgoing directions: {reason}", reason = need.refusal(*quantity))]
    NoOutgoing {
        /// Kind of the refused request, such as sampling or integration over outgoing directions, which the data lack.
        need: Need,
        /// Radiometric quantity of the material, such as `brdf`.
        quantity: Quantity,
    },
    /// The request needs all outgoing directions, of which too few were measured.
    #[error("no {asked}: {measured}, expected 80 % or more in solid angle{weight}", weight = measured.weight())]
    PartlyMeasured {
        /// Result that needs all outgoing directions, in words.
        asked: &'static str,
        /// Measured share of the outgoing directions.
        measured: MeasuredShare,
    },
    /// Reflected or transmitted light alone is requested of a quantity that does not distinguish the two.
    #[error("this {quantity} has no reflected and transmitted side, expected a brdf, btdf or bsdf")]
    NoSides {
        /// Radiometric quantity of the material, such as `brdf`.
        quantity: Quantity,
    },
    /// The angles C and gamma are given for a quantity other than an emission.
    #[error("C and gamma are angles of a luminaire, but this is a {quantity}: give the direction as theta and phi")]
    NoLuminaire {
        /// Radiometric quantity of the material, such as `brdf`.
        quantity: Quantity,
    },
    /// The angles C and gamma are no direction.
    #[error("found C {c} and gamma {gamma}, expected degrees with gamma from 0 (straight down) to 180")]
    LuminaireAngles {
        /// Azimuth C in degrees.
        c: f64,
        /// Angle gamma from straight down in degrees.
        gamma: f64,
    },
    /// A reflectance is requested of a quantity other than a BRDF, BTDF or BSDF.
    #[error("this {quantity} has no reflectance, expected a brdf, btdf or bsdf")]
    NoReflectance {
        /// Radiometric quantity of the material, such as `brdf`.
        quantity: Quantity,
    },
    /// Reciprocity is requested of a quantity whose data cannot show it.
    #[error("wi and wo cannot be exchanged, because this {quantity} {reason}", reason = match quantity {
        Quantity::Btdf => "is reciprocal only with a factor of the refractive indices, which the data lack",
        _ => "has no reciprocity, expected a brdf, bsdf or phase function",
    })]
    NoReciprocity {
        /// Radiometric quantity of the material, such as `brdf`.
        quantity: Quantity,
    },
    /// Reciprocity is requested of data without a pair of incoming and outgoing directions to exchange.
    #[error("this {quantity} has no axes of directions to exchange, expected incoming and outgoing ones")]
    NoExchange {
        /// Radiometric quantity of the material, such as `brdf`.
        quantity: Quantity,
    },
    /// Normalisation is requested of a quantity other than a phase function, whose integral over directions need not be
    /// 1.
    #[error("normalisation was asked for, but this is a {quantity}, expected a phase function")]
    NotNormalised {
        /// Radiometric quantity of the material, such as `brdf`.
        quantity: Quantity,
    },
    /// Request to integrate over triangles of a higher subdivision level than triangle meshes can have.
    #[error("integration at level {found} of triangle subdivision, expected at most {MAX_LEVEL}")]
    Level {
        /// Requested subdivision level of the triangles to integrate over.
        found: u8,
    },
    /// Point `u`, from which a query draws a direction, outside the unit square.
    #[error("u = [{}, {}], expected a point of the unit square", u[0], u[1])]
    Point {
        /// Coordinates of the point outside the unit square.
        u: [f64; 2],
    },
    /// Fraction δ of defensive samples (drawn independently of the function's values) outside 0 ≤ δ < 1.
    #[error(
        "the fraction of defensive samples (drawn independently of the function's values) is {found}, expected 0 or more \
         and less than 1"
    )]
    Defensive {
        /// Requested fraction of defensive samples (drawn independently of the function's values) among all samples.
        found: f64,
    },
}

/// Direction arguments of a query: incoming and outgoing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Argument {
    /// Incoming direction, the argument `wi` of a query.
    Wi,
    /// Outgoing direction, the argument `wo` of a query.
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

/// Arrays that a caller passes to an evaluation or sampling call: for results, scratch space or spectral weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Buffer {
    /// Output buffer for one spectrum.
    Spectrum,
    /// Output buffer with one value for each requested wavelength.
    Wavelengths,
    /// Output buffer for the spectra of a batch of queries.
    Spectra {
        /// Number of spectra in the batch.
        count: usize,
        /// Number of samples of each spectrum.
        lambdas: usize,
    },
    /// Scratch space of a query, as long as its output.
    Scratch,
    /// Weights of an inner product, one for each sample of a spectrum.
    Weights,
    /// Output buffer for drawn directions, one for each point of the unit square.
    Samples,
}

impl Buffer {
    /// Fails unless the caller's array for results, scratch space or weights has the expected number of elements.
    #[inline]
    pub(super) fn check(self, found: usize, expected: usize) -> Result<(), EvaluateError> {
        if found == expected { Ok(()) } else { unfit(QueryError::Length { buffer: self, found, expected }) }
    }

    fn refusal(self, found: usize, expected: usize) -> String {
        match self {
            Self::Spectrum => format!("room for {found} samples, expected {expected}, as many as in a spectrum"),
            Self::Wavelengths => format!("room for {found} samples, expected {expected}: one for each wavelength"),
            Self::Spectra { count, lambdas } => {
                format!("room for {found} samples, expected room for {count} spectra of {lambdas} samples")
            }
            Self::Scratch => format!("scratch space of {found} samples, expected {expected}: as many as in the output"),
            Self::Weights => format!("{found} weights, expected {expected}: one for each sample of a spectrum"),
            Self::Samples => {
                format!("{expected} points, room for {found} directions, expected one direction for each point")
            }
        }
    }
}

/// Requests that need an axis of outgoing directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Need {
    /// Request for importance sampling of outgoing directions.
    Sampling,
    /// Request for an integral of the material's function over outgoing directions.
    Integration,
    /// Request to scale a phase function so that its integral over outgoing directions is 1.
    Normalisation,
    /// Request for the reflectance or transmittance of a material.
    Reflectance,
    /// Request for a report on the energy that leaves a material.
    Energy,
    /// Request for a report on reciprocity (exchange of incoming and outgoing direction).
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

/// Returns a failed result that holds the reason why a query does not fit the material.
#[cold]
pub(super) fn unfit<T>(error: QueryError) -> Result<T, EvaluateError> {
    Err(EvaluateError::Query(error))
}
