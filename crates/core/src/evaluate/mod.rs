//! A material in use: spectra, pdf, importance samples and albedo. No query allocates, but the first that draws a direction
//! or asks for a density builds the sampling trees ([`Material::prepare_sampling`]).
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
//!   material sends nothing there. Wavelengths outside the measured range are as
//!   [`Beyond`] says: masked unless asked otherwise.
//! * **Isotropic** data (incoming elevations): the azimuth of `wi` is taken from `wo` too. Elevations beyond the ends of
//!   the axis take the value of its end.
//! * **The horizon** (z = 0 exactly) belongs to every domain it bounds: to the upper hemisphere, to the lower one, and on the
//!   whole sphere to the upper cells. Values there are those of the cells beside it, without a cosine, and finite; weights
//!   of samples and albedos have |cos θo| and go to 0 with it. Below it a `wo` is outside an upper outgoing axis (0), a
//!   `wi` outside an upper incoming one (refused). At grazing `wi` the function is that of the outermost cells: nothing
//!   is extrapolated beyond their centroids. What leaves on the side of `wi` is reflected, on the other transmitted; a
//!   direction on the horizon is above. Over a whole sphere the smooth form is continuous across the horizon, so that the
//!   two sides of a BSDF mix within a cell of it; the constant form keeps them apart.
//! * **Batches** ([`Pairs`]) are answered block by block. Where directions are unit vectors ([`Directions::of`]), an answer has
//!   the same bits however a batch is cut and whatever stands beside it. From the answer of a single call it differs by
//!   rounding, as sums stand in another order: by at most 2e-5 of a value or weight (of the largest sample, where data have
//!   negative values) and 1e-9 of a density. Coordinates are located in f32 for the constant form: within rounding of an
//!   edge the cell beyond it may be taken.
//! * **Negative** values are given as they were measured: data with none never give any, in either form. Where data have
//!   some, sampling takes negative means over wavelengths as 0, and everything else has them unless
//!   [`physics::Preparation::clamp`] asks for 0.

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
mod level_errors;
mod lines;
mod lobed;
mod located;
mod lookup;
mod material;
mod mixed;
mod mixture;
mod number;
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
pub use between::{LeftOut, interpolation_between};
pub use chosen::{Chosen, ChosenSample, Drawings};
pub use directions::{Directions, Pairs};
pub use error::{Argument, Buffer, EvaluateError, Need, QueryError};
pub use incoming::Alignment;
pub use level_errors::state_levels;
pub use material::Material;
pub use place::{Beyond, Interpolation, Place};
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
mod lobed_tests;
#[cfg(test)]
mod mixture_tests;
#[cfg(test)]
mod stated_tests;
#[cfg(test)]
mod tests;
