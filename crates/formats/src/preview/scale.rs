//! Round numbers for scales.

/// Returns the smallest step of axis labels (1, 2 or 5 × a power of ten) that divides 0 to `largest` into at most
/// `most` steps.
pub(super) fn step(largest: f64, most: usize) -> f64 {
    if !(largest.is_finite() && largest > 0.0) {
        return 1.0;
    }
    let mut power = libm::pow(10.0, libm::floor(libm::log10(largest / most as f64)));
    loop {
        for factor in [1.0, 2.0, 5.0] {
            if largest / (factor * power) <= most as f64 * (1.0 + 1e-9) {
                return factor * power;
            }
        }
        power *= 10.0;
    }
}

/// Formats a number for a label in few characters: `250`, `0.05`, `2e-7`.
pub(super) fn short(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || !size.is_finite() {
        return if size == 0.0 { "0".to_owned() } else { String::new() };
    }
    if (1e-3..1e5).contains(&size) {
        // At most three significant digits.
        let digits = (2.0 - libm::floor(libm::log10(size))).clamp(0.0, 5.0) as usize;
        let text = format!("{value:.digits$}");
        return if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text };
    }
    let exponent = libm::floor(libm::log10(size) + 1e-9);
    let mantissa = short(libm::round(value / libm::pow(10.0, exponent) * 100.0) / 100.0);
    format!("{mantissa}e{exponent}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_are_round() {
        for (largest, most, wanted) in [(1.0, 5, 0.2), (100.0, 4, 50.0), (730.0, 4, 200.0), (0.031, 5, 0.01)] {
            assert!((step(largest, most) - wanted).abs() < 1e-9 * wanted, "{largest}: {}", step(largest, most));
        }
        assert_eq!((step(0.0, 4), step(f64::NAN, 4)), (1.0, 1.0));
        let texts = [0.0, 250.0, 0.05, 2e-7, 1.5e6, -30.0, 12_345.0, 0.3].map(short);
        assert_eq!(texts, ["0", "250", "0.05", "2e-7", "1.5e6", "-30", "12345", "0.3"]);
    }
}
