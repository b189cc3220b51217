//! Errors as a header states them: 24-bit floats, rounded so that a promise is never overstated.

use crate::codec::{CodecError, Reader, Writer};

/// Number of low bits of an f32 that a header omits when it stores an error.
const STATED_SHIFT: u32 = 8;
/// Largest error that a header can store, as the bits of an f32.
const LARGEST_STATED: u32 = 0x7F7F_FF00;

/// Returns the smallest error not below `error` that a header can store.
pub(super) fn rounded_up(error: f64) -> f32 {
    let nearest = error.min(f64::from(f32::MAX)) as f32;
    let above = if f64::from(nearest) < error { nearest.next_up() } else { nearest };
    let left_out = (1 << STATED_SHIFT) - 1;
    f32::from_bits(((above.to_bits() + left_out) & !left_out).min(LARGEST_STATED))
}

/// Returns the largest error not above `target` that a header can store. An error rounded up is at most `target`
/// exactly if the error is at most this number.
pub(super) fn rounded_down(target: f64) -> f64 {
    let nearest = target.min(f64::from(f32::MAX)) as f32;
    let below = if f64::from(nearest) > target { nearest.next_down() } else { nearest };
    f64::from(f32::from_bits((below.to_bits() >> STATED_SHIFT << STATED_SHIFT).min(LARGEST_STATED)))
}

/// Writes `error` to a header, rounded up to 24 bits.
pub(super) fn write_error(w: &mut Writer, error: f64) {
    w.low_bytes(rounded_up(error).to_bits() >> STATED_SHIFT, 3);
}

/// Reads one of the 24-bit errors that a file states about its decoded samples (relative or absolute, `what` names it);
/// rejects negative and non-finite ones.
pub(super) fn read_error(r: &mut Reader<'_>, what: &'static str) -> Result<f64, CodecError> {
    let value = f32::from_bits(r.low_bytes(3, what)? << STATED_SHIFT);
    if value >= 0.0 && value.is_finite() {
        Ok(f64::from(value))
    } else {
        Err(r.malformed(format!("{what} is {value}, expected a finite number of at least 0")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_never_rounded_down_and_targets_never_up() {
        for error in [0.0, 1e-3, 0.01, 1.0 / 3.0, 1e-30, 12_345.678_9, 0.003_906_25] {
            let up = f64::from(rounded_up(error));
            assert!(up >= error && up <= error * (1.0 + 6.2e-5) + 1e-40);
            let down = rounded_down(error);
            assert!(down <= error && down >= error * (1.0 - 6.2e-5) - 1e-40);
            assert!(f64::from(rounded_up(down)) <= error, "what is stated of an error kept is within the target");
            assert!(error == down || f64::from(rounded_up(down * (1.0 + 1e-9))) > error || error == 0.0);
        }
        assert_eq!(rounded_up(f64::MAX).to_bits(), LARGEST_STATED);
        assert_eq!(rounded_down(f64::MAX), f64::from(f32::from_bits(LARGEST_STATED)));
    }
}
