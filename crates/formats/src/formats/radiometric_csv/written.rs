//! Numbers as people and programs of several languages write them: decimal comma, groups of digits, `−`, `%` and `°`.

use crate::formats::text::number;
use std::borrow::Cow;

/// Decimal mark and other properties of the numbers of a table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Marks {
    /// True if the decimal mark is a comma, false if it is a point.
    pub(super) has_commas: bool,
    /// True if the other mark separates groups of three digits, as in `1.234,5`.
    pub(super) is_grouped: bool,
    /// True if a value has a percent sign.
    pub(super) has_percent: bool,
}

/// Counts of the numbers of a table by the marks in them.
#[derive(Default)]
pub(super) struct Count {
    comma_last: usize,
    point_last: usize,
    commas: usize,
    points: usize,
    /// Numbers with one kind of mark which can only be a decimal mark: not before a group of three digits.
    decimal_commas: usize,
    decimal_points: usize,
    percent: usize,
}

impl Count {
    /// Counts a cell of the table if it is a number.
    pub(super) fn add(&mut self, cell: &str) {
        let (cell, percent) = without_sign(cell);
        if !cell.bytes().next().is_some_and(|byte| byte.is_ascii_digit() || b"+-.,".contains(&byte)) {
            return;
        }
        self.percent += usize::from(percent == Some('%'));
        match (cell.rfind(','), cell.rfind('.')) {
            (Some(comma), Some(point)) if comma > point => self.comma_last += 1,
            (Some(_), Some(_)) => self.point_last += 1,
            (Some(_), None) => {
                self.commas += 1;
                self.decimal_commas += usize::from(!is_group(&cell, ','));
            }
            (None, Some(_)) => {
                self.points += 1;
                self.decimal_points += usize::from(!is_group(&cell, '.'));
            }
            (None, None) => {}
        }
    }

    /// Returns the marks of the numbers. Where they contradict each other, the numbers of one kind are refused later.
    pub(super) fn marks(&self) -> Marks {
        let has_commas = match (self.comma_last, self.point_last) {
            (0, 0) if self.commas == 0 || self.points == 0 => self.commas > 0,
            // The mark that cannot separate groups is the decimal mark.
            (0, 0) => self.decimal_commas > 0 && (self.decimal_points == 0 || self.commas > self.points),
            (commas, points) => commas >= points,
        };
        let groups_alone = if has_commas {
            self.points > 0 && self.decimal_points == 0
        } else {
            self.commas > 0 && self.decimal_commas == 0
        };
        let is_grouped = self.comma_last + self.point_last > 0 || groups_alone;
        Marks { has_commas, is_grouped, has_percent: self.percent > 0 }
    }
}

/// Returns true for digits in groups: `1,234` or `12,345,678`.
fn is_group(cell: &str, mark: char) -> bool {
    let digits = cell.trim_start_matches(['+', '-']);
    let mut parts = digits.split(mark);
    let first = parts.next().unwrap_or_default();
    let is_digits = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
    (1..=3).contains(&first.len())
        && is_digits(first)
        && !first.starts_with('0')
        && parts.all(|part| part.len() == 3 && is_digits(part))
}

/// Returns a cell without the sign of its unit, `%` or `°`, at its end, and that sign; a minus sign of typesetters
/// becomes the one of keyboards.
fn without_sign(cell: &str) -> (Cow<'_, str>, Option<char>) {
    let sign = cell.chars().last().filter(|last| matches!(last, '%' | '°'));
    let bare = sign.map_or(cell, |sign| cell[..cell.len() - sign.len_utf8()].trim_end());
    let text =
        if bare.contains(['−', '–']) { Cow::Owned(bare.replace(['−', '–'], "-")) } else { Cow::Borrowed(bare) };
    (text, sign)
}

impl Marks {
    /// Parses a cell as a number in these marks, with the sign of its unit, `%` or `°`, if it has one; `None` if it is
    /// no such number.
    pub(super) fn number(self, cell: &str) -> Option<(f64, Option<char>)> {
        if !self.has_commas
            && let Some(value) = number(cell)
        {
            return Some((value, None));
        }
        let (cell, sign) = without_sign(cell);
        self.bare(&cell).map(|value| (value, sign))
    }

    fn bare(self, cell: &str) -> Option<f64> {
        let (decimal, group) = if self.has_commas { (',', '.') } else { ('.', ',') };
        let end = cell.find([decimal, 'e', 'E']).unwrap_or(cell.len());
        let (whole, rest) = cell.split_at(end);
        let separates = |c: char| {
            matches!(c, ' ' | '\u{a0}' | '\u{202f}' | '\u{2009}' | '\'' | '’') || c == group && self.is_grouped
        };
        let mut text = String::with_capacity(cell.len());
        if whole.contains(separates) {
            for (i, part) in whole.split(separates).enumerate() {
                let digits = part.trim_start_matches(['+', '-']);
                let fits = if i == 0 { (1..=3).contains(&digits.len()) } else { part.len() == 3 };
                if !fits || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
                    return None;
                }
                text.push_str(part);
            }
        } else {
            text.push_str(whole);
        }
        if rest.contains(group) || !self.is_grouped && whole.contains(group) {
            return None;
        }
        match rest.strip_prefix(decimal) {
            Some(fraction) => {
                text.push('.');
                text.push_str(fraction);
            }
            None => text.push_str(rest),
        }
        number(&text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(cells: &[&str]) -> Vec<Option<f64>> {
        let mut count = Count::default();
        for cell in cells {
            count.add(cell);
        }
        let marks = count.marks();
        cells.iter().map(|cell| marks.number(cell).map(|(value, _)| value)).collect()
    }

    #[test]
    fn the_marks_of_a_table_are_those_of_all_its_numbers() {
        for (cells, expected) in [
            (&["0.5", "-1e-3", "10"][..], &[Some(0.5), Some(-1e-3), Some(10.0)][..]),
            (&["0,5", "−1,5E-03", "10"], &[Some(0.5), Some(-1.5e-3), Some(10.0)]),
            (&["1.234,5", "2.345", "0,1"], &[Some(1234.5), Some(2345.0), Some(0.1)]),
            (&["1,234.5", "2,345", "0.1"], &[Some(1234.5), Some(2345.0), Some(0.1)]),
            (&["1 234,5", "0,1"], &[Some(1234.5), Some(0.1)]),
            (&["1'234.5", "1\u{202f}000", "0.1"], &[Some(1234.5), Some(1000.0), Some(0.1)]),
            (&["12,5 %", "3%"], &[Some(12.5), Some(3.0)]),
            (&["-30°", "5 °"], &[Some(-30.0), Some(5.0)]),
            (&["1,234", "0.5"], &[Some(1234.0), Some(0.5)]),
            // A decimal comma, where nothing says otherwise.
            (&["1,234", "2,5"], &[Some(1.234), Some(2.5)]),
            // One of two decimal marks is refused.
            (&["0,5", "0,25", "0.5"], &[Some(0.5), Some(0.25), None]),
            (&["0.5", "0.25", "0,5"], &[Some(0.5), Some(0.25), None]),
            (&["1.23.4", "1,2,3", "12 34", "1 2345", "", "-", "x", "1e"], &[None; 8]),
        ] {
            assert_eq!(read(cells), expected, "{cells:?}");
        }
    }
}
