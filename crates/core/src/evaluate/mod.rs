//! A material in use: spectra, pdf, importance samples and albedo; no allocation per query.
//!
//! # Rules
//! * **Piecewise constant** is what was measured: a sample holds over its whole triangle.
//! * **Smooth** is continuous over directions. Where a few planes hold all spectra (nearly always) it is made of quadratic
//!   elements over outgoing directions, through values that have the cells' averages, in logarithms where data are positive;
//!   over incoming directions it goes from one to the next with lobes moving along ([`Alignment`]). Otherwise (single
//!   samples masked or zero, spectra of high rank) a vertex value is the mean of the triangles around it by solid angle, and
//!   a direction lies barycentrically between three; that never leaves the range of the samples around.
//! * **Masked** cells are left out and the others weigh more; where all are masked the answer is NaN.
//! * **Outside**: `wi` outside the incoming domain is refused. `wo` outside the outgoing domain has value 0 and pdf 0: the
//!   material sends nothing there. Wavelengths outside the measured range are masked.
//! * **Isotropic** data (incoming elevations): the azimuth of `wi` is taken from `wo` too. Elevations beyond the ends of
//!   the axis take the value of its end.
//! * **The horizon** (z = 0 exactly) belongs to every domain it bounds: to the upper hemisphere, to the lower one, and on the
//!   whole sphere to the upper cells. Values there are those of the cells beside it, without a cosine, and finite; weights
//!   of samples and albedos have |cos θo| and go to 0 with it. Below it a `wo` is outside an upper outgoing axis (0), a
//!   `wi` outside an upper incoming one (refused). At grazing `wi` the function is that of the outermost cells: nothing
//!   is extrapolated beyond their centroids. What leaves on the side of `wi` is reflected, on the other transmitted; a
//!   direction on the horizon is above. Over a whole sphere the smooth form is continuous across the horizon, so that the
//!   two sides of a BSDF mix within a cell of it; the constant form keeps them apart.
//! * **Negative** values are given as they were measured: data with none never give any, in either form. Where data have
//!   some, sampling takes negative means over wavelengths as 0, and everything else has them unless
//!   [`physics::Preparation::clamp`] asks for 0.

#![allow(
    clippy::inline_always,
    reason = "queries and loops over places are compiled for the machine only where they are inlined, and a query waits for \
              what goes through memory between calls"
)]

mod albedo;
mod background;
mod batch;
mod carried;
mod chosen;
mod elements;
mod grid;
mod incoming;
mod kernel;
mod located;
mod lookup;
mod material;
mod mixture;
mod number;
pub mod physics;
mod planes;
mod reconstruct;
mod sampling;
mod smooth;
mod spectrum;
mod staged;
mod trees;
pub mod warp;

pub use albedo::Side;
pub use batch::{Directions, Pairs};
pub use chosen::{Chosen, ChosenSample, Drawings};
pub use incoming::Alignment;
pub use material::{Material, OpenedReport};
pub use sampling::WavelengthSampler;
pub use warp::{Density, SampleOptions};

use crate::compress::DecodeError;
use crate::domain::Direction;

/// Where in a material to look.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place<'a> {
    /// One entry for each leading opaque axis.
    pub index: &'a [usize],
    /// The incoming direction, for quantities that have one.
    pub wi: Option<Direction>,
    /// The outgoing direction, for quantities that have one.
    pub wo: Option<Direction>,
}

/// How samples become a function of direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// The value of the triangle that holds the direction, as the paper has it; of the nearest incoming elevation.
    Constant,
    /// Continuous over directions.
    #[default]
    Smooth,
}

/// What there is outside the measured range of wavelengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Beyond {
    /// Nothing is known: NaN.
    #[default]
    Masked,
    /// No light.
    Zero,
    /// The sample at the end of the range, as renderers do.
    Nearest,
}

/// One importance sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionSample {
    /// The direction drawn: `wo`.
    pub direction: Direction,
    /// Its probability density, sr⁻¹.
    pub pdf: f64,
    /// f · |cos θo| / pdf for a BRDF, BTDF or BSDF, f / pdf otherwise; f is the mean over wavelengths (of the samples that
    /// are not masked; 0 where that mean is negative): piecewise constant where the density is, otherwise smooth.
    pub weight: f64,
}

/// Why a material cannot answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EvaluateError {
    /// The bytes are no material.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// The query does not fit the material: a direction or index too few or too many, outside the domain.
    #[error("{0}")]
    Unfit(String),
}

fn unfit<T>(message: impl Into<String>) -> Result<T, EvaluateError> {
    Err(EvaluateError::Unfit(message.into()))
}

#[cfg(test)]
mod batch_tests;
#[cfg(test)]
mod mixture_tests;
#[cfg(test)]
mod tests;
