//! Reasons why a measurement cannot be put on the axes asked for.

use crate::domain::{AxisError, TensorError};

/// Why a measurement cannot be put on the axes asked for.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProjectionError {
    /// A request that the data cannot answer.
    #[error("{0}")]
    Unfit(String),
    /// The axes are out of their limits.
    #[error(transparent)]
    Axes(#[from] AxisError),
    /// The tensor cannot be made.
    #[error(transparent)]
    Tensor(#[from] TensorError),
}
