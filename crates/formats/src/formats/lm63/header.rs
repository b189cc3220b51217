//! Numbers of an LM-63 file before its angles, and the shape of the luminous opening.

use super::labels::Revision;
use super::native::Photometry;
use crate::formats::acquisition::ParseReport;
use crate::formats::text::Brief;
use crate::notes::LuminaireNote;

/// Numbers of an LM-63 file before its angles.
pub(super) struct Header {
    pub(super) lamps: usize,
    pub(super) lumens: f64,
    pub(super) multiplier: f64,
    pub(super) vertical: usize,
    pub(super) horizontal: usize,
    pub(super) photometry: Photometry,
    pub(super) feet: bool,
    /// Width (along Y), length (along X) and height of the luminous opening, in the unit of the file.
    pub(super) opening: [f64; 3],
    pub(super) ballast_factor: f64,
    pub(super) field_12: f64,
    pub(super) watts: f64,
}

impl Header {
    /// Adds the numbers that precede the angles in an LM-63 file to the report of the parser. `generation` is the text
    /// of the twelfth number, whose digits since LM-63-2019 encode how the file was generated.
    pub(super) fn describe(&self, revision: Revision, generation: &str, report: &mut ParseReport) {
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
            report.note(LuminaireNote::FluxNegative { flux_lm: Brief(self.lumens) });
        }
        if matches!(revision, Revision::Lm63_1995 | Revision::Lm63_2002) && self.field_12 != 1.0 {
            report.note(LuminaireNote::Field12NotOne { found: Brief(self.field_12), revision: revision.name() });
        }
    }
}

/// Returns the shape of the luminous opening from the signs of its width, length and height; a negative number is a
/// diameter.
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
