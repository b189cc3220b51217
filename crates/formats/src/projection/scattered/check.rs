//! Validation of scattered samples.

use crate::domain::{Axis, TensorError};
use crate::formats::Scattered;
use crate::projection::error::{ProjectionError, Role, ScatteredError};

/// Checks that scattered samples are valid. Returns their number of spectral bands.
pub(super) fn check(scattered: &Scattered) -> Result<usize, ProjectionError> {
    let count = scattered.directions();
    let width = scattered.spectral.as_ref().map_or(1, Axis::len);
    if count == 0 {
        return Err(ScatteredError::Empty.into());
    }
    for (role, angles) in [(Role::Incoming, &scattered.incoming), (Role::Outgoing, &scattered.outgoing)] {
        if !angles.is_empty() && angles.len() != count {
            return Err(ScatteredError::Count { role, found: angles.len(), expected: count }.into());
        }
        let bad = |[theta, phi]: &[f64; 2]| !(0.0..=180.0).contains(theta) || !(-720.0..=720.0).contains(phi);
        if let Some(at) = angles.iter().position(bad) {
            let [theta, phi] = angles[at];
            return Err(ScatteredError::Direction { role, index: at, theta, phi }.into());
        }
    }
    let expected = count.saturating_mul(width);
    for values in [Some(&scattered.values), scattered.sigma.as_ref()].into_iter().flatten() {
        if values.len() != expected {
            return Err(TensorError::Count { found: values.len(), expected, shape: vec![count, width] }.into());
        }
    }
    if u32::try_from(count).is_err() {
        return Err(ScatteredError::TooMany { found: count }.into());
    }
    match scattered.values.iter().position(|v| v.is_infinite()) {
        Some(index) => Err(TensorError::Infinite { index }.into()),
        None => Ok(width),
    }
}
