//! The stream of numbers after the TILT line of an LM-63 file: tilt factors, header, angles and intensities.

use super::header::Header;
use super::labels::Labels;
use super::native::Photometry;
use crate::domain::limits::{MAX_ENTRIES, MAX_SAMPLES};
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::intensities::{Intensities, Stated};
use crate::formats::text::{Brief, Source, Token, Tokens, listed, number, snippet};
use crate::notes::LuminaireNote;

/// Returns the text of an LM-63 file with points in the place of decimal commas behind byte `at`, where its numbers
/// start. Returns `None` unless the numbers are as many as their header says with decimal commas; as separators,
/// the commas make more of them.
pub(super) fn with_points(text: &str, at: usize) -> Option<String> {
    let (head, numbers) = text.split_at_checked(at)?;
    let is_mark = |word: &str| word.contains(',') && !word.starts_with(',') && !word.ends_with(',');
    // Most files have none at all.
    if !numbers.contains(',') || !numbers.split_whitespace().any(is_mark) {
        return None;
    }
    let pointed = numbers.replace(',', ".");
    let words: Vec<f64> = pointed.split_whitespace().map(number).collect::<Option<_>>()?;
    let count = |field: usize| words.get(field).filter(|n| (1.0..1e6).contains(*n) && n.fract() == 0.0);
    let (v, h) = (count(VERTICAL)?, count(VERTICAL + 1)?);
    (words.len() as f64 == HEADER + v + h + v * h).then(|| format!("{head}{pointed}"))
}

/// Count of the numbers of an LM-63 file before its angles.
const HEADER: f64 = 13.0;
/// Place of the number of vertical angles among the numbers of an LM-63 file, from 0; that of horizontal ones is next.
const VERTICAL: usize = 3;

/// Reader of the numbers after the TILT line of an LM-63 file.
pub(super) struct Numbers<'a> {
    source: &'a Source,
    tokens: Tokens<'a>,
}

impl<'a> Numbers<'a> {
    pub(super) fn new(source: &'a Source, at: usize) -> Self {
        Self { source, tokens: Tokens::new(source.text(), at) }
    }

    /// Returns an upper bound on the count of numbers left in the LM-63 file: each takes a byte and a separator.
    fn most(&self) -> usize {
        (self.source.text().len() - self.tokens.offset()).div_ceil(2)
    }

    fn token(&mut self, expected: &str) -> Result<Token<'a>, FormatError> {
        let end = self.source.text().len();
        self.tokens.next().ok_or_else(|| self.source.malformed(end, format!("the file ends, expected {expected}")))
    }

    fn number(&mut self, expected: &str) -> Result<f64, FormatError> {
        self.placed(expected).map(|(value, _)| value)
    }

    /// Returns the next number of the file and its byte offset.
    #[inline]
    fn placed(&mut self, expected: &str) -> Result<(f64, usize), FormatError> {
        if let Some(number) = self.tokens.plain_number() {
            return Ok(number);
        }
        let token = self.token(expected)?;
        Ok((self.source.number(token, expected)?, token.offset))
    }

    /// Returns the next number of the file, which must be a whole number in `low..=high`; `3.0` is accepted.
    fn whole(&mut self, expected: &str, low: usize, high: usize) -> Result<usize, FormatError> {
        let token = self.token(expected)?;
        let value = self.source.number(token, expected)?;
        if value.fract() == 0.0 && value >= low as f64 && value <= high as f64 {
            return Ok(value as usize);
        }
        let message =
            format!("found {}, expected {expected}, a whole number from {low} to {high}", snippet(token.text));
        Err(self.source.malformed(token.offset, message))
    }

    /// Returns the next number of an LM-63 file, which is a count of angles listed later. Refuses a count larger than
    /// the rest of the file can hold.
    fn count(&mut self, expected: &str) -> Result<usize, FormatError> {
        self.whole(expected, 1, self.most().clamp(1, MAX_ENTRIES))
    }

    /// Reads the tilt factors after TILT=INCLUDE into the metadata: the dimming of the whole luminaire when installed
    /// at an angle, which does not change the shape of its light.
    pub(super) fn tilt(&mut self, report: &mut ParseReport) -> Result<(), FormatError> {
        let geometry = self.whole("the lamp-to-luminaire geometry", 1, 3)?;
        let n = self.count("the number of tilt angles")?;
        let mut list =
            |expected: &str| -> Result<Vec<f64>, FormatError> { (0..n).map(|_| self.number(expected)).collect() };
        let angles = list("a tilt angle")?;
        let factors = list("a tilt factor")?;
        report.metadata.push(("tilt_geometry".to_owned(), geometry.to_string()));
        report.metadata.push(("tilt_angles".to_owned(), listed(&angles)));
        report.metadata.push(("tilt_factors".to_owned(), listed(&factors)));
        report.note(LuminaireNote::TiltFactors);
        Ok(())
    }

    pub(super) fn header(&mut self, labels: &Labels, report: &mut ParseReport) -> Result<Header, FormatError> {
        let lamps = self.whole("the number of lamps", 0, 1_000_000)?;
        let lumens = self.number("the lumens per lamp")?;
        let multiplier = self.number("the candela multiplier")?;
        let vertical = self.count("the number of vertical angles")?;
        let horizontal = self.count("the number of horizontal angles")?;
        let photometry = match self.whole("the photometric type", 1, 3)? {
            1 => Photometry::C,
            2 => Photometry::B,
            _ => Photometry::A,
        };
        let feet = self.whole("the units type", 1, 2)? == 1;
        let opening = [
            self.number("the luminous width")?,
            self.number("the luminous length")?,
            self.number("the luminous height")?,
        ];
        let ballast_factor = self.number("the ballast factor")?;
        let field_12 = self.token("field 12 (the number before the input watts)")?;
        let generation = field_12.text;
        let field_12 = self.source.number(field_12, "field 12 (the number before the input watts)")?;
        let watts = self.number("the input watts")?;
        let header = Header {
            lamps,
            lumens,
            multiplier,
            vertical,
            horizontal,
            photometry,
            feet,
            opening,
            ballast_factor,
            field_12,
            watts,
        };
        header.describe(labels.revision, generation, report);
        Ok(header)
    }

    /// Reads the angles and intensities of a luminaire and applies every multiplier. The count of numbers must match
    /// the header.
    pub(super) fn distribution(
        &self,
        header: &Header,
        labels: &Labels,
        report: &mut ParseReport,
    ) -> Result<Stated, FormatError> {
        let (v, h) = (header.vertical, header.horizontal);
        let announced = v.checked_mul(h).and_then(|n| n.checked_add(v)?.checked_add(h));
        let start = self.tokens.clone();
        let ends = || {
            let remaining = start.clone().count();
            announced.is_none_or(|n| n > remaining).then(|| {
                self.source.malformed(
                    self.source.text().len(),
                    format!(
                        "the file ends after {remaining} numbers, expected {} for {v} vertical and {h} horizontal angles and {v} × {h} intensities",
                        announced.map_or_else(|| "far more".to_owned(), |n| n.to_string())
                    ),
                )
            })
        };
        if announced.is_none_or(|n| n > self.most())
            && let Some(error) = ends()
        {
            return Err(error);
        }
        if v * h > MAX_SAMPLES / 4 {
            let message = format!("{v} × {h} intensities, expected at most {}", MAX_SAMPLES / 4);
            return Err(self.source.error(FormatErrorKind::OverLimit, self.tokens.offset(), message));
        }
        let mut factor = header.multiplier * header.ballast_factor;
        if labels.revision.field_12_multiplies() {
            factor *= header.field_12;
        }
        if factor <= 0.0 {
            report.note(LuminaireNote::MultipliersNotPositive { factor: Brief(factor) });
        }
        let mut numbers = Self { source: self.source, tokens: self.tokens.clone() };
        // A truncated file is reported as such before any other error.
        let stated = numbers.stated(v, h, factor).map_err(|error| ends().unwrap_or(error))?;
        let values = stated.intensities.values();
        let negative = values.iter().filter(|&&intensity| intensity < 0.0).count();
        if negative > 0 {
            let lowest = values.iter().copied().fold(0.0, f32::min);
            report.note(LuminaireNote::NegativeIntensities { intensities: negative, lowest });
        }
        let trailing = numbers.tokens.count();
        if trailing > 0 {
            report.note(LuminaireNote::FurtherTokens { tokens: trailing });
        }
        Ok(stated)
    }

    /// Reads `v` vertical and `h` horizontal angles, and `v` × `h` numbers that give intensities when multiplied by
    /// `factor`.
    fn stated(&mut self, v: usize, h: usize, factor: f64) -> Result<Stated, FormatError> {
        let vertical = self.angles(v, "a vertical angle")?;
        let horizontal = self.angles(h, "a horizontal angle")?;
        let mut intensities = Intensities::new(factor, v * h);
        for _ in 0..v * h {
            let (number, offset) = self.placed("an intensity")?;
            let intensity = intensities.push(number);
            if !intensity.is_finite() {
                let found = Tokens::new(self.source.text(), offset).next().map_or("", |token| token.text);
                let message =
                    format!("intensity {} × {factor} is too large for float32", snippet(found), factor = Brief(factor));
                return Err(self.source.malformed(offset, message));
            }
        }
        Ok(Stated { vertical, horizontal, intensities })
    }

    fn angles(&mut self, count: usize, expected: &str) -> Result<Vec<(f64, usize)>, FormatError> {
        (0..count).map(|_| self.placed(expected)).collect()
    }
}
