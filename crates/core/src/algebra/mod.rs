//! Algebra in the compressed domain: sums, scalings, dot and pointwise products of sparse coefficients, never decoded.
//!
//! * **Spectra** ([`SparseSpectrum`]): k of n coefficients in any basis on a line ([`LineSpace`]). Sums of many of them
//!   (photon gathering) go into an [`Accumulator`], from one flat [`SpectrumPool`] if they are stored as such.
//! * **Dot products** are sums over samples, `⟨a, b⟩ = aᵀ·G·b` with the [`Gram`] matrix of the synthesis functions.
//!   Against a fixed function (such as a colour-matching curve), a [`Functional`] costs one multiplication per
//!   coefficient.
//! * **Pointwise products** use precomputed [`Couplings`], or a [`Multiplier`] where one factor stays the same. The
//!   paper solves them for Haar only (\[CPB06\] section 6.1).
//! * **Materials** ([`combine`], [`dot`]): files in, a file out. Coefficients are added without decoding where the
//!   files store coefficients of the samples themselves, not of their logarithms.
//!
//! ```
//! use wavelume_core::algebra::{Accumulator, Functional, LineSpace, SparseSpectrum};
//! use wavelume_core::transform::{AxisTransform, LineBasis};
//!
//! let space = LineSpace::new(AxisTransform::line(LineBasis::BIOR44), 75)?;
//! let flux: Vec<f64> = (0..75).map(|i| 1.0 + (f64::from(i) * 0.1).sin()).collect();
//! let photon = SparseSpectrum::largest(&space, &flux, 8)?;
//! // Photons of a neighbourhood, each with its weight; then the reflectance; then a luminance: nothing is decoded.
//! let mut sum = Accumulator::new(&space);
//! for weight in [0.5, 0.25] {
//!     sum.axpy(weight, &photon)?;
//! }
//! let surface = wavelume_core::algebra::Multiplier::new(&space, &[0.4; 75])?;
//! let reflected = surface.product(&sum.spectrum())?;
//! let luminance = Functional::new(&space, &[1.0; 75])?.of(&reflected)?;
//! let expected: f64 = photon.samples().iter().map(|x| 0.75 * 0.4 * x).sum();
//! assert!((luminance - expected).abs() < 1e-9 * expected);
//! # Ok::<(), wavelume_core::algebra::AlgebraError>(())
//! ```

mod accumulator;
mod entry;
mod error;
mod functional;
mod gram;
mod inner_products;
mod limits;
mod material;
mod pool;
mod product;
mod space;
mod sparse;
mod windows;

pub use accumulator::Accumulator;
pub use entry::Entry;
pub use error::AlgebraError;
pub use functional::Functional;
pub use gram::Gram;
pub use limits::{MAX_COUPLED, MAX_COUPLINGS, MAX_GRAM, MAX_LINE};
pub use material::{Combined, DotReport, Method, Operand, OperandReport, Recompress, combine, dot};
pub use pool::SpectrumPool;
pub use product::{Couplings, Multiplier};
pub use space::LineSpace;
pub use sparse::{SparseSpectrum, Truncated};

#[cfg(test)]
mod tests;
