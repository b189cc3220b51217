//! Why an operation is refused.

use crate::compress::{CompressError, DecodeError};

/// Why an operation is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AlgebraError {
    /// A basis that does not make functions on a line.
    #[error("no basis for a line of {length} samples: {reason}")]
    Basis {
        /// Samples on the line.
        length: usize,
        /// What was found and what was expected.
        reason: String,
    },
    /// More samples than a table of this kind takes.
    #[error("{what} of {found} samples, expected at most {most}")]
    TooLong {
        /// The table.
        what: &'static str,
        /// Samples on the line.
        found: usize,
        /// The limit.
        most: usize,
    },
    /// More coupling coefficients than are tabulated.
    #[error("couplings of {length} samples: more than {most} coefficients, expected a shorter line or a sparser basis")]
    TooManyCouplings {
        /// Samples on the line.
        length: usize,
        /// The limit.
        most: usize,
    },
    /// Not as many numbers as the line has samples.
    #[error("{found} {what} on a line of {expected} samples")]
    Length {
        /// What the numbers are.
        what: &'static str,
        /// How many were given.
        found: usize,
        /// The line's samples.
        expected: usize,
    },
    /// A number that is masked or infinite.
    #[error("{what} {index} is {found}, expected a finite number")]
    NotFinite {
        /// What the number is.
        what: &'static str,
        /// Its place.
        index: usize,
        /// The number.
        found: f64,
    },
    /// A coefficient outside the line, or given twice.
    #[error("coefficient {index}: {reason}")]
    Entry {
        /// Its index.
        index: u32,
        /// What was found and what was expected.
        reason: String,
    },
    /// Spectra of two bases.
    #[error("a spectrum in {found} with one in {expected}: both must be in the same basis")]
    OtherBasis {
        /// The basis of the second operand.
        found: String,
        /// The basis of the first.
        expected: String,
    },
    /// No operand.
    #[error("no material to combine, expected at least one")]
    Empty,
    /// Materials that are not functions of the same kind.
    #[error("material {at}: {what} {found}, expected that of the first, {expected}")]
    Unlike {
        /// The operand, from 1.
        at: usize,
        /// What differs.
        what: &'static str,
        /// That of the operand.
        found: String,
        /// That of the first operand.
        expected: String,
    },
    /// Bytes that are no material.
    #[error("material {at}: {source}")]
    Decode {
        /// The operand, from 1.
        at: usize,
        /// Why.
        source: DecodeError,
    },
    /// A material with a lobe beside its cells, which no combination of cells has.
    #[error(
        "material {at} has a lobe beside its cells, which is no part of sums and products of materials; combine the \
         measurements instead, or compress this one on directions without it"
    )]
    Lobe {
        /// Its number among the operands, from 1.
        at: usize,
    },
    /// A sum beyond what a sample holds.
    #[error("sample {index} of the combination is {found}, expected a number that an f32 holds")]
    Overflow {
        /// Its flat index.
        index: usize,
        /// The sum.
        found: f64,
    },
    /// The combination was not written.
    #[error(transparent)]
    Compress(#[from] CompressError),
}
