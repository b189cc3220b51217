//! Algebra in the compressed domain: sums, scalings, dot and pointwise products of sparse coefficients, never decoded.
//!
//! * **Spectra** ([`SparseSpectrum`]): k of n coefficients in any basis on a line ([`LineSpace`]). Sums of many of them
//!   (photon gathering) go into an [`Accumulator`], from one flat [`SpectrumPool`] if they are stored as such.
//! * **Dot products** are sums over samples, `⟨a, b⟩ = aᵀ·G·b` with the [`Gram`] matrix of the synthesis functions; against
//!   a fixed function (a colour-matching curve) a [`Functional`] costs one multiplication a coefficient.
//! * **Pointwise products** by precomputed [`Couplings`], or by a [`Multiplier`] where one factor stays the same. The paper
//!   leaves them open but for Haar (\[CPB06\] section 6.1).
//! * **Materials** ([`combine`], [`dot`]): files in, a file out; coefficients are added where files hold those of the samples
//!   themselves.
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
mod error;
mod functional;
mod gram;
mod material;
mod pool;
mod product;
mod space;
mod sparse;
mod windows;

pub use accumulator::Accumulator;
pub use error::AlgebraError;
pub use functional::Functional;
pub use gram::Gram;
pub use material::{Combined, DotReport, Method, Operand, OperandReport, Recompress, combine, dot};
pub use pool::SpectrumPool;
pub use product::{Couplings, Multiplier};
pub use space::LineSpace;
pub use sparse::{Entry, SparseSpectrum, Truncated};

/// The longest line: the synthesis functions of all its coefficients are kept.
pub const MAX_LINE: usize = 4096;
/// The longest line whose Gram matrix is tabulated: n² numbers, 8 MiB at this length.
pub const MAX_GRAM: usize = 1024;
/// The longest line whose couplings are tabulated: n²/2 pairs, each with up to n numbers.
pub const MAX_COUPLED: usize = 512;
/// The most coupling coefficients that are tabulated (128 MiB). A basis whose functions all overlap reaches it at 322 samples.
pub const MAX_COUPLINGS: usize = 1 << 24;

#[cfg(test)]
mod tests;
