//! The error type of the compressed-domain algebra.

use crate::compress::{CompressError, DecodeError};

/// Reasons why an operation of the algebra fails.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AlgebraError {
    /// Transform without basis functions on a line, which products of coefficients need.
    #[error("no basis for a line of {length} samples: {reason}")]
    Basis {
        /// Number of samples on the line.
        length: usize,
        /// The value found and the one expected.
        reason: String,
    },
    /// The line has more samples than a table of this kind allows.
    #[error("{what} of {found} samples, expected at most {most}")]
    TooLong {
        /// Name of the table.
        what: &'static str,
        /// Number of samples on the line.
        found: usize,
        /// Largest number allowed.
        most: usize,
    },
    /// The line has more coupling coefficients than may be tabulated.
    #[error("couplings of {length} samples: more than {most} coefficients, expected a shorter line or a sparser basis")]
    TooManyCouplings {
        /// Number of samples on the line.
        length: usize,
        /// Largest number allowed.
        most: usize,
    },
    /// The number of values differs from the number of samples on the line.
    #[error("{found} {what} on a line of {expected} samples")]
    Length {
        /// Name of the values, for example `weights`.
        what: &'static str,
        /// Number of values given.
        found: usize,
        /// Number of samples on the line.
        expected: usize,
    },
    /// A number is NaN or infinite.
    #[error("{what} {index} is {found}, expected a finite number")]
    NotFinite {
        /// Name of the number, for example `weight`.
        what: &'static str,
        /// Position of the number: from 0 in a list of samples, from 1 for the weights of operands.
        index: usize,
        /// The number found.
        found: f64,
    },
    /// A coefficient is out of range, given twice or not finite.
    #[error("coefficient {index}: {reason}")]
    Entry {
        /// Index of the coefficient.
        index: u32,
        /// The value found and the one expected.
        reason: String,
    },
    /// Two spectra are in different bases.
    #[error("a spectrum in {found} with one in {expected}: both must be in the same basis")]
    OtherBasis {
        /// The basis of the second operand.
        found: String,
        /// The basis of the first.
        expected: String,
    },
    /// The list of operands is empty.
    #[error("no material to combine, expected at least one")]
    Empty,
    /// A material differs from the first in quantity, unit, sampling or axes.
    #[error("material {at}: {what} {found}, expected that of the first, {expected}")]
    Unlike {
        /// Number of the operand, from 1.
        at: usize,
        /// Name of the property that differs.
        what: &'static str,
        /// Value of the operand.
        found: String,
        /// Value of the first operand.
        expected: String,
    },
    /// The bytes of an operand are not a valid material.
    #[error("material {at}: {source}")]
    Decode {
        /// Number of the operand, from 1.
        at: usize,
        /// Cause reported by the decoder.
        source: DecodeError,
    },
    /// A material stores a lobe beside its cells, which sums and products of materials cannot represent.
    #[error(
        "material {at} has a lobe beside its cells, which sums and products of materials do not support; combine the \
         measurements before they are compressed"
    )]
    Lobe {
        /// Number of the operand, from 1.
        at: usize,
    },
    /// A combined sample exceeds the range of f32.
    #[error("sample {index} of the combination is {found}, expected a number that an f32 holds")]
    Overflow {
        /// Flat index of the sample.
        index: usize,
        /// The combined value.
        found: f64,
    },
    /// Compressing the combination failed.
    #[error(transparent)]
    Compress(#[from] CompressError),
}
