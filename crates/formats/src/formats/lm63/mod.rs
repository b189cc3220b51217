//! IES LM-63 luminaires (`.ies`), revisions 1986 to 2019, photometric types A, B and C.
//!
//! A stored intensity is `value · candela multiplier · ballast factor`, and up to 1991 also `· ballast-lamp photometric
//! factor`; the number and the lumens of the lamps do not enter (ANSI/IES LM-63-19; the comments of Radiance's
//! `ies2rad.c` describe all revisions). Outside the stated vertical angles the intensity is 0.

mod labels;
mod native;
mod write;

pub use write::write_lm63;

use super::acquisition::{Acquisition, NoteKind, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::text::{Brief, Source, Token, Tokens, listed, snippet};
use super::type_c::{Planes, Stated, flux, type_c};
use super::{Format, Interpretation, Reader, Sample};
use crate::domain::limits::{MAX_ENTRIES, MAX_SAMPLES};
use crate::domain::{Quantity, Unit};
use labels::{Labels, Revision};
use native::Photometry;

const NAME: &str = "lm-63";

pub(super) const READER: Reader = Reader {
    about: Format {
        name: NAME,
        description: "IES LM-63 luminaire (.ies)",
        extensions: &["ies"],
        reads: true,
        writes: true,
    },
    options: &[],
    probe,
    read,
};

fn probe(sample: &Sample<'_>) -> u8 {
    let first = sample.head.split(['\n', '\r']).find(|line| !line.trim().is_empty());
    if first.is_some_and(|line| Revision::of_tag(line).is_some()) {
        return 100;
    }
    if sample.head.split(['\n', '\r']).any(|line| labels::tilt(line).is_some()) { 90 } else { 0 }
}

/// The numbers before the angles.
struct Header {
    lamps: usize,
    lumens: f64,
    multiplier: f64,
    vertical: usize,
    horizontal: usize,
    photometry: Photometry,
    feet: bool,
    /// Width (along Y), length (along X), height.
    opening: [f64; 3],
    ballast_factor: f64,
    field_12: f64,
    watts: f64,
}

/// The stream of numbers after the TILT line.
struct Numbers<'a> {
    source: &'a Source,
    tokens: Tokens<'a>,
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    check_quantity(how)?;
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    if let Some(encoding) = source.odd_encoding() {
        report.note(NoteKind::Assumed, format!("text decoded as {encoding}"));
    }
    let labels = labels::read(&source, &mut report)?;
    let mut numbers = Numbers::new(&source, labels.numbers_at);
    if labels.tilt_included {
        numbers.tilt(&mut report)?;
    }
    let mut header = numbers.header(&labels, &mut report)?;
    let unit = unit(&labels, &header, how, &mut report)?;
    let stated = numbers.distribution(&header, &labels, &mut report)?;
    if labels.revision == Revision::Lm63_1986
        && header.photometry == Photometry::C
        && stated.vertical.iter().any(|&(angle, _)| angle < 0.0)
    {
        // In 1986 type 1 stood for both, and gamma is never negative.
        report.note(NoteKind::Assumed, "negative vertical angles in a 1986 file of type 1: taken as type A");
        header.photometry = Photometry::A;
    }
    let (grid, shape) = match header.photometry {
        Photometry::C => type_c(stated, Planes::ByAngles, &source, &mut report)?,
        photometry => native::convert(stated, photometry, &source, &mut report)?,
    };
    if header.lumens > 0.0 && unit == Unit::Candela {
        check_flux(flux(&grid), header.lamps as f64 * header.lumens, &mut report);
    }
    Ok(Acquisition {
        format: NAME,
        dialect: format!("{}, type {}, {shape}", labels.revision.name(), header.photometry.name()),
        quantity: Quantity::Edf,
        unit,
        samples: Samples::Grid(grid),
        spectral_factor: None,
        report,
    })
}

fn check_quantity(how: &Interpretation) -> Result<(), FormatError> {
    match how.quantity() {
        None | Some(Quantity::Edf) => Ok(()),
        Some(other) => Err(FormatError::new(
            FormatErrorKind::NeedsOption,
            NAME,
            format!("quantity {other} was asked for, expected edf: a luminaire is an emission distribution"),
        )),
    }
}

/// The unit as asked, as the file's text says, else candela.
fn unit(labels: &Labels, header: &Header, how: &Interpretation, report: &mut ParseReport) -> Result<Unit, FormatError> {
    if let Some(unit) = how.unit {
        let is_intensity = unit.per_nanometre().is_some() || matches!(unit, Unit::Candela | Unit::CandelaPerKilolumen);
        return if is_intensity {
            Ok(unit)
        } else {
            Err(FormatError::new(
                FormatErrorKind::NeedsOption,
                NAME,
                format!(
                    "unit {unit} was asked for, expected an intensity: cd, cd/klm, W/sr, mW/sr, uW/sr, umol/s/sr or relative"
                ),
            ))
        };
    }
    let unit = labels.unit(report);
    if unit == Unit::Candela && header.lumens == 0.0 {
        report.note(
            NoteKind::Warning,
            "0 lumens per lamp, expected -1 for absolute photometry; candela kept as they are",
        );
    } else if unit == Unit::Candela && header.lumens > 0.0 {
        report.note(
            NoteKind::Assumed,
            format!(
                "relative photometry: candela hold for {} lamp(s) of {} lm each",
                header.lamps,
                Brief(header.lumens)
            ),
        );
    }
    Ok(unit)
}

/// Relative photometry: the flux of the distribution over that of the lamps is the efficiency of the luminaire.
fn check_flux(flux: f64, lamp_lumens: f64, report: &mut ParseReport) {
    let efficiency = flux / lamp_lumens;
    if lamp_lumens > 0.0 && !(0.05..=1.05).contains(&efficiency) {
        report.note(
            NoteKind::Warning,
            format!(
                "the intensities make {} % of the {} lm of the lamps, expected 5 to 105 %",
                Brief((1000.0 * efficiency).round() / 10.0),
                Brief(lamp_lumens)
            ),
        );
    }
}

impl<'a> Numbers<'a> {
    fn new(source: &'a Source, at: usize) -> Self {
        Self { source, tokens: Tokens::new(source.text(), at) }
    }

    /// More numbers than this cannot follow: each takes a byte and one to separate it.
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

    /// A number and its place.
    #[inline]
    fn placed(&mut self, expected: &str) -> Result<(f64, usize), FormatError> {
        if let Some(number) = self.tokens.plain_number() {
            return Ok(number);
        }
        let token = self.token(expected)?;
        Ok((self.source.number(token, expected)?, token.offset))
    }

    /// A whole number in `low..=high`; `3.0` is one.
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

    /// A count of things that follow, each at least one token.
    fn count(&mut self, expected: &str) -> Result<usize, FormatError> {
        self.whole(expected, 1, self.most().clamp(1, MAX_ENTRIES))
    }

    /// The block of TILT=INCLUDE: how the whole luminaire dims when it is installed at an angle, not part of its shape.
    fn tilt(&mut self, report: &mut ParseReport) -> Result<(), FormatError> {
        let geometry = self.whole("the lamp-to-luminaire geometry", 1, 3)?;
        let n = self.count("the number of tilt angles")?;
        let mut list =
            |expected: &str| -> Result<Vec<f64>, FormatError> { (0..n).map(|_| self.number(expected)).collect() };
        let angles = list("a tilt angle")?;
        let factors = list("a tilt factor")?;
        report.metadata.push(("tilt_geometry".to_owned(), geometry.to_string()));
        report.metadata.push(("tilt_angles".to_owned(), listed(&angles)));
        report.metadata.push(("tilt_factors".to_owned(), listed(&factors)));
        report.note(NoteKind::Skipped, "tilt factors are kept as metadata, they do not enter the intensities");
        Ok(())
    }

    fn header(&mut self, labels: &Labels, report: &mut ParseReport) -> Result<Header, FormatError> {
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

    /// The angles and intensities, every multiplier applied; as many numbers as announced must follow.
    fn distribution(&self, header: &Header, labels: &Labels, report: &mut ParseReport) -> Result<Stated, FormatError> {
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
            report.note(
                NoteKind::Warning,
                format!("the multipliers of this file make {factor}, expected more than 0", factor = Brief(factor)),
            );
        }
        let mut numbers = Self { source: self.source, tokens: self.tokens.clone() };
        // A file that is too short says so, whatever else is wrong with it.
        let stated = numbers.stated(v, h, factor).map_err(|error| ends().unwrap_or(error))?;
        let negative = stated.values.iter().filter(|&&intensity| intensity < 0.0).count();
        if negative > 0 {
            let lowest = stated.values.iter().copied().fold(0.0, f32::min);
            report.note(
                NoteKind::Warning,
                format!("{negative} intensities are negative, down to {lowest}; kept as they are"),
            );
        }
        let trailing = numbers.tokens.count();
        if trailing > 0 {
            report.note(NoteKind::Warning, format!("{trailing} further tokens after the last intensity were not read"));
        }
        Ok(stated)
    }

    /// So many vertical and horizontal angles, and the intensities at them times `factor`.
    fn stated(&mut self, v: usize, h: usize, factor: f64) -> Result<Stated, FormatError> {
        let vertical = self.angles(v, "a vertical angle")?;
        let horizontal = self.angles(h, "a horizontal angle")?;
        let mut values = Vec::with_capacity(v * h);
        for _ in 0..v * h {
            let (value, offset) = self.placed("an intensity")?;
            let intensity = (value * factor) as f32;
            if !intensity.is_finite() {
                let found = Tokens::new(self.source.text(), offset).next().map_or("", |token| token.text);
                let message =
                    format!("intensity {} × {factor} is too large for float32", snippet(found), factor = Brief(factor));
                return Err(self.source.malformed(offset, message));
            }
            values.push(intensity);
        }
        Ok(Stated { vertical, horizontal, values })
    }

    fn angles(&mut self, count: usize, expected: &str) -> Result<Vec<(f64, usize)>, FormatError> {
        (0..count).map(|_| self.placed(expected)).collect()
    }
}

impl Header {
    /// Puts the numbers into the report; `generation` is field 12 as written, a code of digits since 2019.
    fn describe(&self, revision: Revision, generation: &str, report: &mut ParseReport) {
        let [width, length, height] = self.opening;
        let unit = if self.feet { "ft" } else { "m" };
        let mut add = |key: &str, value: String| report.metadata.push((key.to_owned(), value));
        add("lamps", self.lamps.to_string());
        add("lumens_per_lamp", Brief(self.lumens).to_string());
        add("candela_multiplier", Brief(self.multiplier).to_string());
        add("photometric_type", self.photometry.name().to_owned());
        add("luminous_opening", opening_shape(revision, self.opening).to_owned());
        add("luminous_width", format!("{} {unit}", Brief(width)));
        add("luminous_length", format!("{} {unit}", Brief(length)));
        add("luminous_height", format!("{} {unit}", Brief(height)));
        add("ballast_factor", Brief(self.ballast_factor).to_string());
        add(revision.field_12_name(), generation.chars().take(40).collect());
        add("input_watts", Brief(self.watts).to_string());
        if self.lumens < 0.0 && self.lumens != -1.0 {
            report.note(
                NoteKind::Warning,
                format!("{} lumens per lamp, taken as absolute photometry (which is written -1)", Brief(self.lumens)),
            );
        }
        if matches!(revision, Revision::Lm63_1995 | Revision::Lm63_2002) && self.field_12 != 1.0 {
            report.note(
                NoteKind::Warning,
                format!(
                    "field 12 is {}, expected 1 in {}; it does not enter the intensities",
                    Brief(self.field_12),
                    revision.name()
                ),
            );
        }
    }
}

/// The shape of the luminous opening by the signs of width, length and height; a negative number is a diameter.
fn opening_shape(revision: Revision, [width, length, height]: [f64; 3]) -> &'static str {
    let sign = |x: f64| {
        if x > 0.0 {
            '+'
        } else if x < 0.0 {
            '-'
        } else {
            '0'
        }
    };
    let round = width == length;
    let before_1995 = matches!(revision, Revision::Lm63_1986 | Revision::Lm63_1991);
    let before_2002 = before_1995 || revision == Revision::Lm63_1995;
    match (sign(width), sign(length), sign(height)) {
        ('0', '0', '0') => "point",
        ('+', '+', '0') => "rectangle",
        ('+', '+' | '0', '+') | ('0', '+', '+') => "box",
        ('-', '0', '0') => "disk",
        ('-', '-', '0') if round => "disk",
        ('-' | '+', '-', '0') | ('-', '+', '0') => "ellipse",
        ('-', '0', '+') => "vertical cylinder",
        ('-', '-', '+') if round => "vertical cylinder",
        ('-', '+', '+') | ('+', '-', '+') if before_1995 => "ellipsoid",
        ('-', '-' | '+', '+') | ('+', '-', '+') => "vertical elliptical cylinder",
        ('-', '0', '-') => "sphere",
        ('-', '-', '-') if round && length == height => "sphere",
        ('-', '-', '-') => "ellipsoid",
        ('-', '+', '-') | ('+', '-', '-') if before_2002 => "ellipsoid",
        ('-' | '0', '+', '-') => "horizontal cylinder along X",
        ('+', '-' | '0', '-') => "horizontal cylinder along Y",
        ('0', '-', '-') => "vertical disk facing X",
        _ => "unknown",
    }
}
