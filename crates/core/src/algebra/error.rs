//! The error type of the compressed-domain algebra.

use crate::compress::{CompressError, DecodeError};

/// Reasons why arithmetic on compressed spectra or on compressed materials fails.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AlgebraError {
    /// No basis can be built for one-dimensional signals of this length.
    #[error("no basis for a signal of {length} samples: {reason}")]
    Basis {
        /// Number of samples of the signal.
        length: usize,
        /// Reason why the signal has no basis in which it can be expanded, and what was expected.
        reason: String,
    },
    /// A signal has more samples than allowed for a table that arithmetic on spectra needs, such as a Gram matrix.
    #[error("too large: {what} for {found} samples, expected at most {most} samples")]
    TooLong {
        /// Name of the table that is refused, because the signal has too many samples for it, for example `a Gram
        /// matrix`.
        what: &'static str,
        /// Number of samples of the signal.
        found: usize,
        /// Largest number of samples of a signal for which a table such as its Gram matrix is computed.
        most: usize,
    },
    /// The table of coupling coefficients (factors with which products of basis functions are expanded) would be too
    /// large.
    #[error(
        "products of signals of {length} samples need more than {most} coupling coefficients, expected a shorter signal"
    )]
    TooManyCouplings {
        /// Number of samples of the signal.
        length: usize,
        /// Largest number of coupling coefficients (factors with which products of basis functions are expanded)
        /// allowed.
        most: usize,
    },
    /// The number of values in a list differs from the number of samples of the signal.
    #[error("found {found} {what}, expected {expected}, one for each sample of the signal")]
    Length {
        /// Name of the numbers in a list that should have one for each sample of the signal, for example `weights`.
        what: &'static str,
        /// Count of the numbers in a list that should have one for each sample of the signal.
        found: usize,
        /// Number of samples of the signal.
        expected: usize,
    },
    /// A weight or sample is NaN or infinite.
    #[error("{what} {index} is {found}, expected a finite number")]
    NotFinite {
        /// Name of the number that is not finite, for example `weight`.
        what: &'static str,
        /// Position of the sample or weight that is not finite. Samples of a signal count from 0; weights of the
        /// materials in a weighted sum count from 1.
        index: usize,
        /// Value of the sample or weight that is not finite: NaN or infinite.
        found: f64,
    },
    /// A coefficient of a sparse spectrum has an index out of range, is given twice or is not finite.
    #[error("coefficient {index} of a spectrum: {reason}")]
    Entry {
        /// Index, in the basis, of the invalid coefficient of a sparse spectrum; from 0.
        index: u32,
        /// Fault of the coefficient of the sparse spectrum (index out of range, given twice or not finite), and what
        /// was expected.
        reason: String,
    },
    /// Two spectra to be added or multiplied are in different bases.
    #[error("a spectrum in basis {found} and one in basis {expected}, expected two spectra in the same basis")]
    OtherBasis {
        /// Name of the basis of the second of the two spectra to be added or multiplied.
        found: String,
        /// Name of the basis of the first of the two spectra to be added or multiplied.
        expected: String,
    },
    /// The list of materials to combine is empty.
    #[error("the list of materials to be summed is empty, expected at least one material")]
    Empty,
    /// A material differs from the first material of a sum in quantity, unit, sampling or axes.
    #[error("material {at}: {what} {found}, expected {what} {expected} as in the first material")]
    Unlike {
        /// Position of the material in the list of operands, from 1.
        at: usize,
        /// Name of the property in which the refused material differs from the first material in the sum, for example
        /// `unit`.
        what: &'static str,
        /// Property of the refused material, such as its unit, that differs from that of the first material in the sum.
        found: String,
        /// Property of the first material in the sum, such as its unit, that the refused material does not share.
        expected: String,
    },
    /// The bytes of an operand (one of the files to be added) are not a valid material.
    #[error("material {at}: {source}")]
    Decode {
        /// Position of the material in the list of operands, from 1.
        at: usize,
        /// Reason why the bytes of the operand are not a valid material, as the decoder of materials reports it.
        source: DecodeError,
    },
    /// A material stores an analytic reflection lobe in addition to its samples, which sums and products cannot
    /// represent.
    #[error(
        "material {at} has an analytic lobe beside its samples, which sums and products of materials do not support; \
         combine the measurements before they are compressed"
    )]
    Lobe {
        /// Position of the material in the list of operands, from 1.
        at: usize,
    },
    /// A sample of a weighted sum of materials exceeds the range of f32.
    #[error("sample {index} of the weighted sum is {found}, expected a number in the range of f32")]
    Overflow {
        /// Index of the sample in row-major order, from 0.
        index: usize,
        /// Value of one sample of a weighted sum of materials: a number beyond the range of f32.
        found: f64,
    },
    /// Compressing the weighted sum of materials failed.
    #[error(transparent)]
    Compress(#[from] CompressError),
}
