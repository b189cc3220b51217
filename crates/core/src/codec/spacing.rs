//! Lists of angles determined by two ends and a count: even steps that decimals cannot represent, and even steps of the
//! cosine.

/// Formula that gives all entries of a list of angles from its first entry, its last entry and its length, evaluated in
/// f64.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rule {
    /// Even steps, `start + i · (end − start) / (count − 1)`, in which the product is evaluated first. The last entry
    /// is exactly `end`. Reproduces lists of equal fractions of 180°.
    Divided,
    /// Even steps, `start + i · step` with `step = (end − start) / (count − 1)`; the last entry is exactly `end`.
    /// Reproduces lists of numpy's `linspace`.
    Stepped,
    /// Even steps of the cosine: the entries are angles in degrees, rounded to nine decimals, whose cosines are evenly
    /// spaced.
    Cosines,
}

/// List of numbers given by a formula and its first and last entry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spacing {
    pub(super) rule: Rule,
    pub(super) start: f64,
    pub(super) end: f64,
}

impl Rule {
    pub(super) const ALL: [Self; 3] = [Self::Divided, Self::Stepped, Self::Cosines];

    pub(super) fn code(self) -> u8 {
        self as u8
    }
}

impl Spacing {
    /// Finds the formula for even steps, of numbers or of cosines of angles, that gives exactly the list `values`;
    /// `None` if there is none.
    pub(super) fn of(values: &[f64]) -> Option<Self> {
        let [first, _, .., last] = *values else { return None };
        Rule::ALL.into_iter().find_map(|rule| {
            let end = |angle: f64| if rule == Rule::Cosines { rounded(libm::cos(angle.to_radians())) } else { angle };
            let spacing = Self { rule, start: end(first), end: end(last) };
            let is_same = |(i, &value): (usize, &f64)| spacing.at(i, values.len()).to_bits() == value.to_bits();
            values.iter().enumerate().all(is_same).then_some(spacing)
        })
    }

    /// Returns entry `i` of a list of `count` numbers that are evenly spaced, or have evenly spaced cosines, between
    /// the first and the last.
    pub(super) fn at(&self, i: usize, count: usize) -> f64 {
        let (start, end, last) = (self.start, self.end, count.saturating_sub(1).max(1));
        let divided = || if i == last { end } else { start + i as f64 * (end - start) / last as f64 };
        match self.rule {
            Rule::Divided => divided(),
            Rule::Stepped if i == last => end,
            Rule::Stepped => start + i as f64 * ((end - start) / last as f64),
            Rule::Cosines => rounded(libm::acos(divided()).to_degrees()),
        }
    }
}

/// Rounds a number to nine decimals.
fn rounded(x: f64) -> f64 {
    libm::round(x * 1e9) / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_found_again_and_others_are_not() {
        for count in [3, 4, 46, 90, 121, 361, 1001] {
            let list = |spacing: Spacing| (0..count).map(|i| spacing.at(i, count)).collect::<Vec<f64>>();
            for (start, end) in [(0.0, 180.0), (-17.5, 33.3), (0.1, 1.0 / 3.0)] {
                for rule in [Rule::Divided, Rule::Stepped] {
                    let values = list(Spacing { rule, start, end });
                    let found = Spacing::of(&values).unwrap();
                    assert_eq!(list(found), values);
                }
            }
            for (start, end) in [(1.0, -1.0), (1.0, 0.0), (0.9, -0.25)] {
                let values = list(Spacing { rule: Rule::Cosines, start, end });
                assert_eq!(list(Spacing::of(&values).unwrap()), values);
            }
            let mut values = list(Spacing { rule: Rule::Divided, start: 0.0, end: 180.0 });
            values[1] = values[1].next_up();
            assert!(Spacing::of(&values).is_none_or(|other| other.rule == Rule::Stepped));
            values[1] += 1e-3;
            assert_eq!(Spacing::of(&values), None);
        }
        assert_eq!(Spacing::of(&[1.0, 2.0]), None);
    }

    #[test]
    fn ends_without_an_angle_give_no_number() {
        assert!(Spacing { rule: Rule::Cosines, start: 2.0, end: 0.0 }.at(0, 3).is_nan());
        assert_eq!(Spacing { rule: Rule::Divided, start: 4.0, end: 5.0 }.at(0, 1), 4.0);
    }
}
