//! Evaluation of a material: spectra, pdf, importance samples and albedo. Queries do not allocate. The exception is the
//! first that draws a direction or returns a density: it builds the sampling trees ([`Material::prepare_sampling`]).
//!
//! # Rules
//! * **Piecewise constant** is the measured data: a sample holds over its whole triangle.
//! * **Smooth** is continuous over directions. If a few planes represent all spectra, which is nearly always so, it
//!   consists of quadratic elements over outgoing directions. They pass through values that have the cells' averages,
//!   in logarithms if data are positive. Over incoming directions it interpolates between neighbours whose lobes are
//!   aligned ([`Alignment`]). Otherwise (single samples masked or zero, spectra of high rank) a vertex value is the
//!   mean of the triangles around it by solid angle. A direction is then interpolated barycentrically between three
//!   vertices, which never leaves the range of the samples around.
//! * **Masked** cells are skipped and the remaining weights renormalised; if all are masked the answer is NaN.
//! * **Outside**: a `wi` outside the incoming domain is refused. A `wo` outside the outgoing domain has value 0 and pdf
//!   0, as the material sends no light there. [`Beyond`] decides about wavelengths outside the measured range; by
//!   default they are masked.
//! * **Isotropic** data (incoming elevations): `wo` is rotated by the azimuth of `wi`. Elevations beyond the ends of
//!   the axis have the value of its end.
//! * **The horizon** (z = 0 exactly) belongs to every domain it bounds: to the upper hemisphere, to the lower one, and
//!   on the whole sphere to the upper cells. Values there are those of the adjacent cells, without a cosine, and
//!   finite. Weights of samples and albedos have |cos θo| and go to 0 with it. Below the horizon a `wo` is outside an
//!   upper outgoing axis (0), a `wi` outside an upper incoming one (refused). At grazing `wi` the function is that of
//!   the outermost cells: nothing is extrapolated beyond their centroids. Light that leaves on the side of `wi` is
//!   reflected, on the other transmitted; a direction on the horizon counts as above. Over a whole sphere the smooth
//!   form is continuous across the horizon, so that the two sides of a BSDF mix within one cell of it. The constant
//!   form keeps them apart.
//! * **Batches** ([`Pairs`]) are evaluated block by block. For unit vectors ([`Directions::of`]) an answer is
//!   bit-identical however a batch is split and whatever else is in it. It differs from the answer of a single call by
//!   rounding, as sums are in another order. The difference is at most 2e-5 of a value or weight (of the largest
//!   sample, if data have negative values) and 1e-9 of a density. Coordinates are located in f32 for the constant form:
//!   within rounding of an edge, the neighbouring cell may be chosen.
//! * **Negative** values are returned as measured; data without them never yield any, in either form. Sampling treats
//!   negative means over wavelengths as 0. Everything else uses them, unless [`physics::Preparation::clamp`] sets them
//!   to 0.

#![allow(
    clippy::inline_always,
    reason = "queries and loops over places are compiled for the machine only where they are inlined, and a query waits for \
              what goes through memory between calls"
)]

mod albedo;
mod arrived;
mod background;
mod between;
mod blocks;
mod carried;
mod carrying;
mod cell_averages;
mod cells;
mod change;
mod chosen;
mod directions;
mod elements;
mod error;
mod form;
mod function;
mod geometry;
mod grid;
mod incoming;
mod integrals;
mod kernel;
mod known_directions;
mod level_errors;
mod lines;
mod lobed;
mod located;
mod lookup;
mod material;
mod measured_share;
mod mixed;
mod mixture;
mod photometry;
pub mod physics;
mod place;
mod planes;
mod reconstruct;
mod report;
mod sampler;
mod samples;
mod smooth;
mod spectrum;
mod staged;
mod stated;
mod straight;
mod trees;
mod turning;
mod warp;
mod wavelength_sampler;

pub use albedo::Side;
#[doc(hidden)]
pub use between::NOTES;
pub use between::{LeftOut, interpolation_between};
pub use chosen::{Chosen, ChosenSample, Drawings};
pub use directions::{Directions, Pairs};
pub use error::{Argument, Buffer, EvaluateError, Need, QueryError};
pub use incoming::Alignment;
pub use known_directions::measured_share;
pub use level_errors::state_levels;
pub use material::Material;
pub use measured_share::{MeasuredExtent, MeasuredShare};
pub use photometry::{JOULES_PER_MICROMOLE, Photometry, luminaire_direction};
pub use place::{BEYOND, Beyond, INTERPOLATION, Interpolation, Place};
pub use report::OpenedReport;
pub use sampler::DirectionSample;
pub use straight::straight_lines_for_flux;
pub use warp::{Density, SampleOptions};
#[doc(hidden)]
pub use warp::{Drawn, Measure, WarpMesh, Warps};
pub use wavelength_sampler::WavelengthSampler;

#[cfg(test)]
mod batch_tests;
#[cfg(test)]
mod horizon_tests;
#[cfg(test)]
mod lobed_tests;
#[cfg(test)]
mod measured_share_tests;
#[cfg(test)]
mod mixture_tests;
#[cfg(test)]
mod stated_tests;
#[cfg(test)]
mod tests;
