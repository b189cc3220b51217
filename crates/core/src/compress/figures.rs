//! Numbers in messages: suggestions rounded up to two digits, and readable decimals.

/// Rounds an error up to two significant digits, for messages that suggest an achievable error.
pub(super) fn two_digits_up(value: f64) -> f64 {
    if !(value > 0.0 && value.is_finite()) {
        return value;
    }
    let places = 1 - libm::floor(libm::log10(value)) as i32;
    // For extreme exponents the power of ten itself would be rounded or infinite.
    if places.abs() > 22 {
        let text = format!("{value:.1e}");
        let near: f64 = text.parse().unwrap_or(value);
        return if near < value { near * 1.1 } else { near };
    }
    // A power of ten that is exact, so that the quotient is the f64 nearest to two decimal digits.
    let scale = (0..places.unsigned_abs()).fold(1.0, |scale: f64, _| scale * 10.0);
    // Values within 1e-9 above two digits count as those two digits.
    let up = |x: f64| libm::ceil(x - 1e-9);
    if places >= 0 { up(value * scale) / scale } else { up(value / scale) * scale }
}

/// Formats a number as a plain decimal, or with an exponent if it is far from 1.
pub(super) fn shown(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-4..1e6).contains(&size) {
        let text = format!("{value:.2e}");
        // 1.00e-9 becomes 1e-9.
        match text.split_once('e') {
            Some((digits, exponent)) if digits.contains('.') => {
                format!("{}e{exponent}", digits.trim_end_matches('0').trim_end_matches('.'))
            }
            _ => text,
        }
    } else {
        let text = format!("{value:.6}");
        let digits = text.trim_end_matches('0').trim_end_matches('.');
        digits.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_shown_as_people_write_them() {
        for (value, text) in [
            (0.01, "0.01"),
            (1e300, "1e300"),
            (1e-9, "1e-9"),
            (0.0, "0"),
            (40.0, "40"),
            (3.4e38, "3.4e38"),
            (1234.5, "1234.5"),
        ] {
            assert_eq!(shown(value), text);
        }
    }

    #[test]
    fn errors_to_ask_for_are_rounded_up_anywhere() {
        for value in [1.0e-300, 1e-30, 0.012_3, 0.5, 1.0, 99.5, 1e30, 3e300] {
            let up = two_digits_up(value);
            assert!(up >= value * (1.0 - 1e-9) && up <= 1.12 * value, "{value}: {up}");
        }
        assert_eq!((two_digits_up(0.0121), two_digits_up(0.02)), (0.013, 0.02));
    }
}
