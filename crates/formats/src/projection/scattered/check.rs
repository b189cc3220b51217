//! Refuses scattered samples that make no sense before anything is computed from them.

use crate::domain::{Axis, TensorError};
use crate::formats::Scattered;
use crate::projection::error::ProjectionError;

/// The number of bands of checked samples.
pub(super) fn check(scattered: &Scattered) -> Result<usize, ProjectionError> {
    let unfit = |reason: String| Err(ProjectionError::Unfit(format!("scattered directions: {reason}")));
    let count = scattered.directions();
    let width = scattered.spectral.as_ref().map_or(1, Axis::len);
    if count == 0 {
        return unfit("none, expected at least one".to_owned());
    }
    for (what, angles) in [("incoming", &scattered.incoming), ("outgoing", &scattered.outgoing)] {
        if !angles.is_empty() && angles.len() != count {
            return unfit(format!("{} {what} directions, expected {count} or none", angles.len()));
        }
        let bad = |[theta, phi]: &[f64; 2]| !(0.0..=180.0).contains(theta) || !(-720.0..=720.0).contains(phi);
        if let Some(at) = angles.iter().position(bad) {
            let [theta, phi] = angles[at];
            return unfit(format!(
                "{what} theta {theta}, phi {phi} of sample {at}, expected degrees: theta from 0 to 180, phi of one turn"
            ));
        }
    }
    let expected = count.saturating_mul(width);
    for values in [Some(&scattered.values), scattered.sigma.as_ref()].into_iter().flatten() {
        if values.len() != expected {
            return Err(TensorError::Count { found: values.len(), expected, shape: vec![count, width] }.into());
        }
    }
    if u32::try_from(count).is_err() {
        return unfit(format!("{count}, expected at most {}", u32::MAX));
    }
    match scattered.values.iter().position(|v| v.is_infinite()) {
        Some(index) => Err(TensorError::Infinite { index }.into()),
        None => Ok(width),
    }
}

/// Whether [`check`] has nothing to refuse.
pub(super) fn is_sound(scattered: &Scattered) -> bool {
    check(scattered).is_ok()
}
