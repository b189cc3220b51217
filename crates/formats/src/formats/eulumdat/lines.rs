//! The lines of an EULUMDAT file in their order: texts, numbers with either decimal mark, and the block of lamp sets.

use super::about::NAME;
use crate::domain::limits::MAX_ENTRIES;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::number;
use crate::formats::text::{self, Source, Token, snippet};
use crate::notes::Quoted;

/// Number of lines of an EULUMDAT file before those of the lamp sets.
pub(super) const HEAD_LINES: usize = 26;
/// Upper bound on the number of lamp sets in an EULUMDAT file, more than any luminaire has alternatives.
const MAX_SETS: usize = 1000;
/// Upper bound on the number of lines with intensities in an EULUMDAT file: far more than 721 planes of 721 angles.
const MAX_LINES: usize = 1 << 21;
/// Upper bound on the number of lines of an EULUMDAT file up to the last set of lamps. These lines are collected first,
/// because the reader does not read them strictly in order.
const HEAD: usize = HEAD_LINES + 6 * MAX_SETS;
/// Upper bound on the characters that are kept of a text in an EULUMDAT file.
const MAX_TEXT: usize = 256;

/// Reader of the lines of an EULUMDAT file, from the current position on.
pub(super) struct Lines<'a> {
    source: &'a Source,
    head: Vec<Token<'a>>,
    /// Iterator over the lines of the EULUMDAT file after the first 6026. These first lines, which can contain sets of
    /// lamps, are stored instead, because the reader does not read them in order.
    body: text::Lines<'a>,
    next: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn of(source: &'a Source) -> Self {
        let mut body = source.lines();
        let head = body.by_ref().take(HEAD).collect();
        Self { source, head, body, next: 0 }
    }

    /// Returns the byte offset of the next line of the file.
    pub(super) fn at(&self) -> usize {
        self.head.get(self.next).map_or(self.body.offset(), |line| line.offset)
    }

    /// Returns an error that rejects the file at a byte offset of its text.
    pub(super) fn refused(&self, offset: usize, message: impl Into<String>) -> FormatError {
        self.source.malformed(offset, message)
    }

    /// Returns an upper bound on the number of lines left in the EULUMDAT file: each takes at least one byte.
    fn most(&self) -> usize {
        self.source.text().len() + 1 - self.at()
    }

    /// Passes the numbers on the next lines of an EULUMDAT file, one per line, to `take`, each with its byte offset.
    /// Stops at a line that is not a number, and returns the lines from that line on.
    pub(super) fn take_numbers(
        &self,
        mut take: impl FnMut(f64, usize) -> Result<(), FormatError>,
    ) -> Result<text::Lines<'a>, FormatError> {
        let bytes = self.source.text().as_bytes();
        let mut lines = self.source.lines();
        lines.skip_to(self.at());
        for _ in 0..=MAX_LINES {
            let at = lines.offset();
            let plain = number::decimal(bytes, at);
            // Most lines end with a single line feed; other line ends are searched for.
            if let Some((value, end)) = plain.filter(|&(_, end)| bytes.get(end) == Some(&b'\n')) {
                take(value, at)?;
                lines.skip_to(end + 1);
                continue;
            }
            let mut after = lines.clone();
            let Some((line, value)) =
                after.next().and_then(|line| Some((line, with_unit(line.text.trim(), INTENSITY)?)))
            else {
                return Ok(lines);
            };
            take(value, line.offset)?;
            lines = after;
        }
        let message = format!("more than {MAX_LINES} lines, expected fewer");
        Err(FormatError::new(FormatErrorKind::OverLimit, NAME, message))
    }

    fn line(&mut self, expected: &str) -> Result<Token<'a>, FormatError> {
        let line = self.head.get(self.next).copied().or_else(|| self.body.next());
        let Some(Token { text, offset }) = line else {
            return Err(self.refused(self.source.text().len(), format!("the file ends, expected {expected}")));
        };
        self.next += 1;
        let blanks = text.len() - text.trim_start().len();
        Ok(Token { text: text.trim(), offset: offset + blanks })
    }

    /// Returns the next line of an EULUMDAT file as free text.
    pub(super) fn text(&mut self, expected: &str) -> Result<String, FormatError> {
        Ok(self.line(expected)?.text.chars().filter(|c| !c.is_control()).take(MAX_TEXT).collect())
    }

    /// Returns an error for a line of an EULUMDAT file with an unexpected value. For one of the first 26 lines the
    /// error also gives the line's number, under which the description of the format lists it.
    fn mismatch(&self, line: Token<'_>, expected: &str) -> FormatError {
        let place = if self.next <= HEAD_LINES {
            format!(" (line {} of the format; is a line above it missing?)", self.next)
        } else {
            String::new()
        };
        self.refused(line.offset, format!("found {}, expected {expected}{place}", snippet(line.text)))
    }

    fn number(&mut self, expected: &str, units: Units) -> Result<f64, FormatError> {
        let line = self.line(expected)?;
        with_unit(line.text, units).ok_or_else(|| self.mismatch(line, expected))
    }

    /// Returns the number on the next line of an EULUMDAT file; `None` if the line is blank or says that the number is
    /// not known. Used for numbers that a file may leave out, such as dimensions.
    pub(super) fn optional(&mut self, expected: &str, units: Units) -> Result<Option<f64>, FormatError> {
        let line = self.line(expected)?;
        if line.text.is_empty() || UNKNOWN.iter().any(|word| word.eq_ignore_ascii_case(line.text)) {
            return Ok(None);
        }
        with_unit(line.text, units).map(Some).ok_or_else(|| self.mismatch(line, expected))
    }

    /// Returns the whole number in `low..=high` on the next line of an EULUMDAT file; `3.0` is accepted.
    pub(super) fn whole(&mut self, expected: &str, low: usize, high: usize) -> Result<usize, FormatError> {
        let line = self.line(expected)?;
        match with_unit(line.text, THINGS) {
            Some(value) if value.fract() == 0.0 && value >= low as f64 && value <= high as f64 => Ok(value as usize),
            _ => Err(self.mismatch(line, &format!("{expected}, a whole number from {low} to {high}"))),
        }
    }

    /// Returns the number on the next line of an EULUMDAT file, which counts items that follow, one per line.
    pub(super) fn count(&mut self, expected: &str) -> Result<usize, FormatError> {
        self.whole(expected, 1, self.most().clamp(1, MAX_ENTRIES))
    }

    /// Returns the numbers on the next `count` lines of an EULUMDAT file, each with its byte offset.
    pub(super) fn numbers(
        &mut self,
        count: usize,
        expected: &str,
        units: Units,
    ) -> Result<Vec<(f64, usize)>, FormatError> {
        (0..count)
            .map(|_| {
                let offset = self.at();
                Ok((self.number(expected, units)?, offset))
            })
            .collect()
    }
}

/// Parses a finite number with a point or a comma as its decimal mark.
pub(super) fn decimal(text: &str) -> Option<f64> {
    text::number(text).or_else(|| {
        let comma = !text.contains('.') && text.bytes().filter(|&b| b == b',').count() == 1;
        if comma { text::number(&text.replace(',', ".")) } else { None }
    })
}

/// Kind of a number in a field of EULUMDAT: the units that programs write behind it, each with its factor to the unit
/// in which the format wants the number.
pub(super) type Units = &'static [(&'static str, f64)];

/// Units of dimensions, which the format wants in mm.
pub(super) const LENGTH: Units =
    &[("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("in", 25.4), ("inch", 25.4), ("\"", 25.4), ("ft", 304.8)];
/// Units of angles, which the format wants in degrees.
pub(super) const ANGLE: Units = &[("°", 1.0), ("deg", 1.0), ("degree", 1.0), ("degrees", 1.0), ("grad", 1.0)];
/// Words for parts of a hundred.
pub(super) const PERCENT: Units = &[("%", 1.0), ("percent", 1.0)];
/// Units of a luminous flux, which the format wants in lm.
const FLUX: Units = &[("lm", 1.0), ("lumen", 1.0), ("lumens", 1.0), ("klm", 1000.0)];
/// Units of a power, which the format wants in W.
const POWER: Units = &[("w", 1.0), ("watt", 1.0), ("watts", 1.0), ("va", 1.0), ("kw", 1000.0), ("mw", 1e-3)];
/// Units of intensities; the lumens of the lamps say to which of them a number refers.
const INTENSITY: Units = &[("cd", 1.0), ("cd/klm", 1.0)];
/// Words behind a number of things.
const THINGS: Units =
    &[("x", 1.0), ("pc", 1.0), ("pcs", 1.0), ("stk", 1.0), ("lamp", 1.0), ("lamps", 1.0), ("set", 1.0), ("sets", 1.0)];
/// Units of a plain number, which has none.
pub(super) const NONE: Units = &[];

/// Texts that stand for a number that is not known.
const UNKNOWN: [&str; 12] = ["-", "--", "---", "?", "n/a", "n.a.", "na", "none", "unknown", "k.a.", "k. a.", "tbd"];

/// Parses a number of EULUMDAT behind which some programs write a unit (`20 W`, `60 cm`), or whose thousands they
/// separate by a blank or an apostrophe (`1 500`, `1'500`). A unit that is not listed is no unit.
fn with_unit(text: &str, units: Units) -> Option<f64> {
    // Nearly all numbers are plain.
    decimal(text).or_else(|| {
        let end = text.rfind(|c: char| c.is_ascii_digit())? + 1;
        let (number, unit) = (&text[..end], text[end..].trim().trim_end_matches('.'));
        let listed = units.iter().find(|(name, _)| name.eq_ignore_ascii_case(unit)).map(|(_, factor)| *factor);
        let factor = if unit.is_empty() { 1.0 } else { listed? };
        Some(factor * decimal(number).or_else(|| grouped(number))?)
    })
}

/// Parses a number whose thousands are separated by blanks or apostrophes.
fn grouped(number: &str) -> Option<f64> {
    let whole = number.split(['.', ',']).next()?;
    let mut groups = whole.split([' ', '\u{a0}', '\u{202f}', '\'', '’']);
    let first = groups.next()?;
    let is_group = |group: &str| group.len() == 3 && group.bytes().all(|byte| byte.is_ascii_digit());
    let rest: Vec<&str> = groups.collect();
    let is_first = (1..=3).contains(&first.len()) && first.bytes().all(|byte| byte.is_ascii_digit());
    let is_grouped = is_first && !rest.is_empty() && rest.iter().all(|group| is_group(group));
    if is_grouped { decimal(&format!("{first}{}{}", rest.concat(), &number[whole.len()..])) } else { None }
}

/// Returns the only number in a text with other words, such as `ca. 20 W`; `None` if there is none or more than one.
fn only_number(text: &str, units: Units) -> Option<f64> {
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | ',');
    let start = text.find(|c: char| c.is_ascii_digit())?;
    let end = start + text[start..].find(|c: char| !is_part(c)).unwrap_or(text.len() - start);
    if text[end..].contains(|c: char| c.is_ascii_digit()) {
        return None;
    }
    // A word may stand behind the unit.
    let unit = text[end..].split_whitespace().next().unwrap_or_default();
    with_unit(&format!("{} {unit}", text[start..end].trim_end_matches(['.', ','])), units)
}

/// Returns true if a text can be the field for the watts of a set of lamps: a power, or nothing.
fn is_power(text: &str) -> bool {
    text.is_empty() || with_unit(text, POWER).or_else(|| only_number(text, POWER)).is_some()
}

/// Set of lamps that fits the luminaire; several sets are alternatives.
pub(super) struct LampSet {
    /// Number of lamps in the set; a negative number means that the file states absolute intensities (candela).
    pub(super) count: f64,
    pub(super) kind: String,
    /// Luminous flux in lm of all lamps of the set together; of the whole luminaire if the number of lamps is negative.
    pub(super) lumens: f64,
    pub(super) colour: String,
    pub(super) rendering: String,
    pub(super) watts: Option<f64>,
    /// Text in the field for the watts that is not one number of watts. No intensity needs it.
    pub(super) odd_watts: Option<Quoted>,
}

/// Returns the lamp sets, and true if the file lists them field by field (six blocks of n lines), as some older files
/// do, instead of set by set. The order is the one in which the numeric fields can be parsed.
pub(super) fn lamp_sets(lines: &mut Lines<'_>) -> Result<(Vec<LampSet>, bool), FormatError> {
    let left = lines.head.len().saturating_sub(lines.next + 1) / 6;
    let n = lines.whole("the number of lamp sets", 0, left.min(MAX_SETS))?;
    let start = lines.next;
    let by_set = |set: usize, field: usize| start + 6 * set + field;
    let by_field = |set: usize, field: usize| start + n * field + set;
    let fits = |at: &dyn Fn(usize, usize) -> usize| {
        (0..n).all(|set| {
            [0, 2, 5].into_iter().all(|field| {
                let text = lines.head[at(set, field)].text.trim();
                let units = [(0, THINGS), (2, FLUX)].into_iter().find(|(of, _)| *of == field);
                units.map_or_else(|| is_power(text), |(_, units)| with_unit(text, units).is_some())
            })
        })
    };
    let blocks = n > 1 && !fits(&by_set) && fits(&by_field);
    let mut sets = Vec::with_capacity(n);
    for set in 0..n {
        let place = |field: usize| if blocks { by_field(set, field) } else { by_set(set, field) };
        lines.next = place(0);
        let line = lines.line("the number of lamps")?;
        let count = with_unit(line.text, THINGS).filter(|count| count.fract() == 0.0 && count.abs() <= 1e6);
        let count = count.ok_or_else(|| lines.mismatch(line, "the number of lamps, a whole number"))?;
        lines.next = place(1);
        let kind = lines.text("the type of lamp")?;
        lines.next = place(2);
        let lumens = lines.number("the lumens of the lamps", FLUX)?;
        lines.next = place(3);
        let colour = lines.text("the colour of the light")?;
        lines.next = place(4);
        let rendering = lines.text("the colour rendering")?;
        lines.next = place(5);
        let line = lines.line("the watts of the lamps")?;
        let watts = with_unit(line.text, POWER).or_else(|| only_number(line.text, POWER));
        let odd_watts = (watts.is_none() && !line.text.is_empty()).then(|| Quoted::of(line.text));
        sets.push(LampSet { count, kind, lumens, colour, rendering, watts, odd_watts });
    }
    lines.next = start + 6 * n;
    Ok((sets, blocks))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn either_decimal_mark_is_one_and_thousands_are_not_grouped() {
        for (text, value) in [("2,5", 2.5), ("2.5", 2.5), ("-1", -1.0), ("1e3", 1000.0), ("1,5e-1", 0.15)] {
            assert_eq!(decimal(text), Some(value));
        }
        for text in ["1.234,5", "1,234,567", "1,234.5", "", ",", "NaN", "inf", "1 2", "1e999"] {
            assert_eq!(decimal(text), None, "{text}");
        }
    }

    #[test]
    fn units_behind_numbers_are_those_of_their_field() {
        for (text, units, value) in [
            ("20 W", POWER, 20.0),
            ("0,02 kW", POWER, 20.0),
            ("20 Watt.", POWER, 20.0),
            ("1500 lm", FLUX, 1500.0),
            ("1.5 klm", FLUX, 1500.0),
            ("1 500", FLUX, 1500.0),
            ("1'500 lm", FLUX, 1500.0),
            ("1’234’567,5", FLUX, 1_234_567.5),
            ("100mm", LENGTH, 100.0),
            ("60 cm", LENGTH, 600.0),
            ("0.6 m", LENGTH, 600.0),
            ("10\"", LENGTH, 254.0),
            ("2,5 °", ANGLE, 2.5),
            ("85 %", PERCENT, 85.0),
            ("1e3", NONE, 1000.0),
            ("5.", NONE, 5.0),
            ("2 pcs", THINGS, 2.0),
            ("-1", THINGS, -1.0),
        ] {
            assert_eq!(with_unit(text, units), Some(value), "{text}");
        }
        for (text, units) in [
            ("W", POWER),
            ("1 5", FLUX),
            ("1 2 W", POWER),
            ("LED 20 W", POWER),
            ("2 x 18 W", POWER),
            ("20 W/m", POWER),
            ("100 lm/W", FLUX),
            ("20 W", FLUX),
            ("5 mm", ANGLE),
            ("1'50", FLUX),
            ("NaN", NONE),
            ("", NONE),
        ] {
            assert_eq!(with_unit(text, units), None, "{text}");
        }
        for (text, value) in
            [("ca. 20 W", Some(20.0)), ("~20,5", Some(20.5)), ("LED 20 W.", Some(20.0)), ("20 W (LED)", Some(20.0))]
        {
            assert_eq!(only_number(text, POWER), value, "{text}");
        }
        for text in ["2x18W", "20 W/25 W", "20 lm", "LED", ""] {
            assert_eq!(only_number(text, POWER), None, "{text}");
        }
    }
}
