//! Units of settings: the text of a number, read and shown the same way on every surface, and the field behind it.

use std::time::Duration;

/// Unit of a setting, which decides how its text is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unit {
    /// A setting that is a number without a unit.
    Count,
    /// A size in bytes: `4096`, `64KiB`, `256MiB`, `1GiB`.
    Bytes,
    /// A rate in bytes per second, written like a size in bytes.
    Rate,
    /// A time: `500ms`, `30s`, `15min`, `1h`, `7d`; a number alone counts seconds.
    Time,
}

/// Suffixes of sizes, each with the number of bytes that it stands for.
const BYTES: [(&str, u64); 7] = [
    ("GiB", 1 << 30),
    ("MiB", 1 << 20),
    ("KiB", 1 << 10),
    ("GB", 1_000_000_000),
    ("MB", 1_000_000),
    ("kB", 1000),
    ("B", 1),
];

/// Suffixes of times, each with its length in milliseconds. `ms` stands before `s`, so that `5ms` is not read as
/// seconds.
const TIMES: [(&str, u64); 5] = [("ms", 1), ("min", 60_000), ("h", 3_600_000), ("s", 1000), ("d", 86_400_000)];

impl Unit {
    /// Reads a number with this unit; times are in milliseconds. Returns `None` for any other text.
    pub(crate) fn parse(self, text: &str) -> Option<u64> {
        let (suffixes, alone): (&[_], u64) = match self {
            Self::Count => (&[], 1),
            Self::Bytes | Self::Rate => (&BYTES, 1),
            Self::Time => (&TIMES, 1000),
        };
        let found = suffixes.iter().find_map(|(name, factor)| Some((text.strip_suffix(name)?, *factor)));
        let (digits, factor) = found.unwrap_or((text, alone));
        let digits = digits.trim_end();
        // `u64::from_str` would take a sign.
        digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| digits.parse::<u64>().ok())??.checked_mul(factor)
    }

    /// Formats the value of a setting as text that [`Setting::parse`](super::Setting::parse) reads back: `4KiB`, `30s`.
    pub(crate) fn show(self, value: u64) -> String {
        let largest = |suffixes: &[(&str, u64)]| {
            let fits = suffixes.iter().find(|(_, factor)| value >= *factor && value.is_multiple_of(*factor));
            fits.map(|(name, factor)| format!("{}{name}", value / factor))
        };
        match self {
            Self::Count => value.to_string(),
            Self::Bytes | Self::Rate => largest(&BYTES[..3]).unwrap_or_else(|| value.to_string()),
            Self::Time => largest(&[TIMES[2], TIMES[1], TIMES[3], TIMES[0]]).unwrap_or_else(|| "0s".to_owned()),
        }
    }

    /// Returns the placeholder of a value in help texts: `N`, `BYTES`, `BYTES/S` or `TIME`.
    pub(crate) fn placeholder(self) -> &'static str {
        match self {
            Self::Count => "N",
            Self::Bytes => "BYTES",
            Self::Rate => "BYTES/S",
            Self::Time => "TIME",
        }
    }

    /// Returns true if values of this unit are plain numbers, without a unit in their text.
    pub(crate) fn is_count(self) -> bool {
        self == Self::Count
    }

    /// Returns the description of a value with this unit, for messages.
    pub(crate) fn expected(self) -> &'static str {
        match self {
            Self::Count => "a whole number",
            Self::Bytes => "bytes such as 4096, 64KiB or 1GiB",
            Self::Rate => "bytes per second such as 4096, 16KiB or 1MiB",
            Self::Time => "a time such as 500ms, 30s, 15min or 1h",
        }
    }
}

/// Conversion between the type of a configuration field and the integer of a setting; times are in milliseconds.
pub(super) trait Value: Sized {
    fn from_number(number: u64) -> Option<Self>;
    fn number(&self) -> u64;
}

impl Value for u64 {
    fn from_number(number: u64) -> Option<Self> {
        Some(number)
    }

    fn number(&self) -> u64 {
        *self
    }
}

impl Value for usize {
    fn from_number(number: u64) -> Option<Self> {
        number.try_into().ok()
    }

    fn number(&self) -> u64 {
        *self as u64
    }
}

impl Value for u32 {
    fn from_number(number: u64) -> Option<Self> {
        number.try_into().ok()
    }

    fn number(&self) -> u64 {
        u64::from(*self)
    }
}

impl Value for Duration {
    fn from_number(number: u64) -> Option<Self> {
        // Longer times overflow the clock when they are added to it.
        (number <= 10 * 366 * 24 * 3_600_000).then(|| Self::from_millis(number))
    }

    fn number(&self) -> u64 {
        self.as_millis() as u64
    }
}

/// Time of at most 15 minutes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Brief(pub Duration);

impl Value for Brief {
    fn from_number(number: u64) -> Option<Self> {
        (number <= 15 * 60_000).then(|| Self(Duration::from_millis(number)))
    }

    fn number(&self) -> u64 {
        self.0.number()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_with_their_units_and_shown_so_that_they_are_read_back() {
        for (unit, text, value, shown) in [
            (Unit::Count, "12", 12, "12"),
            (Unit::Bytes, "4096", 4096, "4KiB"),
            (Unit::Bytes, "1 GiB", 1 << 30, "1GiB"),
            (Unit::Bytes, "5MB", 5_000_000, "5000000"),
            (Unit::Rate, "16KiB", 16 << 10, "16KiB"),
            (Unit::Time, "500ms", 500, "500ms"),
            (Unit::Time, "90", 90_000, "90s"),
            (Unit::Time, "15min", 900_000, "15min"),
            (Unit::Time, "7d", 604_800_000, "168h"),
            (Unit::Time, "0s", 0, "0s"),
        ] {
            assert_eq!(unit.parse(text), Some(value), "{text}");
            assert_eq!(unit.show(value), shown);
            assert_eq!(unit.parse(shown), Some(value), "{shown}");
        }
        for (unit, text) in [
            (Unit::Count, "1s"),
            (Unit::Count, "-1"),
            (Unit::Count, "+1"),
            (Unit::Count, ""),
            (Unit::Bytes, "KiB"),
            (Unit::Bytes, "1.5GiB"),
            (Unit::Bytes, "99999999999GiB"),
            (Unit::Time, "1 fortnight"),
        ] {
            assert_eq!(unit.parse(text), None, "{text}");
        }
    }
}
