//! Tabulated phase functions: angle (or its cosine) and value, a list over the cosine, Legendre moments, and volume
//! scattering functions; each becomes a function of two directions that integrates to 1 over the sphere.
//!
//! * Two columns or more: the scattering angle in degrees, 0 = forward, or its cosine, +1 = forward, where all numbers
//!   of the first column lie in -1..1 and some are negative; then values, of which the first column counts.
//! * One line of numbers: values at cosines in even steps from -1 to 1 (the plug-in `tabphase` of Mitsuba 3).
//! * One number a line, the first of them 1: moments k of `p(mu) = Σ (2m+1) k_m P_m(mu) / 4π`, with or without the
//!   factor 2m+1 (libRadtran, DISORT).
//!
//! What the values integrate to tells their normalisation: 1, 4π, or, as asked, anything (a volume scattering function
//! in m⁻¹ sr⁻¹ integrates to the scattering coefficient b).

mod function;
mod lists;
#[cfg(test)]
mod tests;

use super::acquisition::{Acquisition, Angles, AzimuthExtent, Azimuths, Modelled, NoteKind, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::spectral_table::rows;
use super::text::{Brief, Source, is_text, snippet};
use super::{Format, Interpretation, Reader, Sample};
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::domain::{Axis, Quantity, Unit};
use function::{Curve, Curves};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use std::sync::Arc;

const NAME: &str = "phase-table";

pub(super) const READER: Reader = Reader {
    about: Format {
        name: NAME,
        description: "phase function: angle or cosine and value, a list over the cosine, Legendre moments (.txt, .csv, .dat)",
        extensions: &["txt", "csv", "dat"],
        reads: true,
        writes: false,
    },
    options: &["column", "normalization"],
    probe,
    read,
};

/// What the values of a phase table integrate to over the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Normalization {
    /// 1.
    #[serde(rename = "1")]
    One,
    /// 4π.
    #[serde(rename = "4pi")]
    FourPi,
    /// The scattering coefficient: a volume scattering function.
    #[serde(rename = "vsf")]
    Vsf,
    /// Anything: only ratios of the values mean something.
    #[serde(rename = "relative")]
    Relative,
}

impl Normalization {
    const ALL: [(&'static str, Self); 4] =
        [("1", Self::One), ("4pi", Self::FourPi), ("vsf", Self::Vsf), ("relative", Self::Relative)];

    /// Its name: `1`, `4pi`, `vsf` or `relative`.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, known)| *known == self).map_or("relative", |(name, _)| name)
    }
}

impl std::str::FromStr for Normalization {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.iter().find(|(name, _)| *name == text).map(|&(_, known)| known);
        found.ok_or_else(|| format!("found {}, expected 1, 4pi, vsf or relative", snippet(text)))
    }
}

/// Words of a header that only phase functions have.
const WORDS: [&str; 7] =
    ["phase function", "phasefunction", "scattering angle", "scattering_angle", "legendre", "tabphase", "cos_theta"];
/// Numbers of tables over angles and wavelengths at most.
const MAX_VALUES: usize = 1 << 22;
/// How far the integral may be from 1 or 4π to be taken for it.
const TOLERANCE: f64 = 0.05;
/// Degrees at either end of a table over which its last values hold.
const HELD: f64 = 10.0;
/// The finest spacings, in degrees, for which levels are chosen: those of a megasample.
const OUTGOING_SPACING: f64 = 4.5;
const INCOMING_SPACING: f64 = 9.0;
/// Shares of the light within the first step of a table above which it is no peak that the table resolves.
const UNRESOLVED: f64 = 0.2;

/// Whether lower-case text calls the values a volume scattering function; to name the option of that name does not.
fn says_volume(prose: &str) -> bool {
    let words = |text: &str| text.split(|c: char| !c.is_alphanumeric()).any(|word| word == "vsf");
    prose.contains("volume scattering") || prose.lines().any(|line| !line.contains("normalization") && words(line))
}

fn probe(sample: &Sample<'_>) -> u8 {
    if !is_text(&sample.head) {
        return 0;
    }
    let table = rows::probe(&sample.head);
    // Before the name of a quantity or the probe of a spectral table, which says 30.
    if sample.quantity == Some(Quantity::Phase) && (table > 0 || lists::is_line(&sample.head)) {
        return 48;
    }
    if sample.quantity == Some(Quantity::Phase) && sample.head.contains(|c: char| c.is_ascii_digit()) {
        return 5;
    }
    let mut prose = String::new();
    for line in sample.head.lines().take(40).filter(|line| line.contains(char::is_alphabetic)) {
        prose.push_str(&line.to_lowercase());
        prose.push('\n');
    }
    let said = WORDS.iter().any(|word| prose.contains(word)) || says_volume(&prose);
    if (said && table > 0) || (table >= 30 && lists::is_angular(&sample.head)) {
        return 40;
    }
    // A single row is no spectrum, unless it is a row of pairs or its remarks speak of wavelengths.
    if lists::is_line(&sample.head) && (said || !lists::is_spectral(&sample.head, &prose)) {
        return 35;
    }
    if lists::is_moments(&sample.head) { 20 } else { 0 }
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    if let Some(other) = how.quantity().filter(|quantity| *quantity != Quantity::Phase) {
        return Err(needs(format!("quantity {other} was asked for, expected phase, which the file holds")));
    }
    if let Some(other) = how.unit.filter(|unit| *unit != Unit::PerSteradian) {
        return Err(needs(format!(
            "unit {other} was asked for, expected 1/sr, to which a phase function is brought (say what it integrates to: normalization)"
        )));
    }
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    if let Some(encoding) = source.odd_encoding() {
        report.note(NoteKind::Assumed, format!("text decoded as {encoding}"));
    }
    let (mut curve, form, vsf) = match lists::read(&source, how, &mut report)? {
        Some((curve, form)) => (curve, form, false),
        None => table(&source, how, &mut report)?,
    };
    let negative = curve.values.iter().filter(|v| **v < 0.0).count();
    if negative > 0 {
        let lowest = curve.values.iter().copied().fold(0.0, f64::min);
        report.note(
            NoteKind::Warning,
            format!("{negative} values are negative, down to {}; kept as they are", Brief(lowest)),
        );
    }
    normalise(&mut curve, how.normalization.or(vsf.then_some(Normalization::Vsf)), &mut report)?;
    Ok(Acquisition {
        format: NAME,
        dialect: form,
        quantity: Quantity::Phase,
        unit: Unit::PerSteradian,
        samples: Samples::Function(modelled(vec![curve], None, &mut report)),
        spectral_factor: None,
        report,
    })
}

/// A function of two directions from normalised tables over the same angles, one for each entry of `spectral`.
fn modelled(curves: Vec<Curve>, spectral: Option<Axis>, report: &mut ParseReport) -> Modelled {
    let numbers = curves.iter().map(|curve| curve.values.len()).sum();
    let missing = curves.iter().flat_map(|curve| &curve.values).filter(|v| v.is_nan()).count();
    let steps = curves.iter().take(1).flat_map(|curve| curve.angles.array_windows().map(|[a, b]| b - a));
    let finest = steps.fold(180.0, f64::min);
    // A function of one angle does not need all the pairs of directions that its table could tell apart.
    let spacing = finest.max(OUTGOING_SPACING);
    let steps = (180.0 / finest.max(INCOMING_SPACING)).round().max(2.0) as usize;
    let even = |count: usize, length: f64| (0..count).map(|i| length * i as f64 / count as f64).collect::<Vec<f64>>();
    let mut theta = even(steps, 180.0);
    theta.push(180.0);
    let phi = Some(Azimuths { phi: even(2 * steps, 360.0), extent: AzimuthExtent::Circle });
    if finest < OUTGOING_SPACING {
        report.note(
            NoteKind::Assumed,
            format!(
                "directions {OUTGOING_SPACING} degrees apart are enough, {INCOMING_SPACING} for incoming ones, though the \
                 table has steps of {} degrees: name the levels for more",
                Brief(finest)
            ),
        );
    }
    Modelled {
        incoming: Angles { theta, covers: (0.0, 180.0), phi },
        outgoing_spacing: spacing,
        spectral,
        numbers,
        missing,
        function: Arc::new(Curves(curves)),
    }
}

/// A function of two directions from `values` `[angle, wavelength]` over increasing scattering angles in degrees.
pub(super) fn tabulated(
    angles: &[f64],
    values: &[f32],
    spectral: Option<Axis>,
    said: Option<Normalization>,
    report: &mut ParseReport,
) -> Result<Modelled, FormatError> {
    let width = spectral.as_ref().map_or(1, Axis::len);
    if angles.len() < 2 {
        let message = "values at one scattering angle, expected a table from 0 to 180 degrees";
        return Err(FormatError::new(FormatErrorKind::Malformed, NAME, message));
    }
    if values.len() > MAX_VALUES {
        let message = format!("{} values of a phase function, expected at most {MAX_VALUES}", values.len());
        return Err(FormatError::new(FormatErrorKind::OverLimit, NAME, message));
    }
    let is_volume = said == Some(Normalization::Vsf);
    let mut curves = Vec::with_capacity(width);
    for band in 0..width {
        let values = values.iter().skip(band).step_by(width).map(|&value| f64::from(value)).collect();
        // The notes on the first wavelength stand for all.
        let mut others = ParseReport::default();
        let report = if band == 0 { &mut *report } else { &mut others };
        let mut curve = held(Curve::over_angles(angles.to_vec(), values, is_volume), report);
        normalise(&mut curve, said, report)?;
        curves.push(curve);
    }
    if width > 1 {
        let message = format!("each of {width} wavelengths is normalised by itself; what is said here is of the first");
        report.note(NoteKind::Assumed, message);
    }
    Ok(modelled(curves, spectral, report))
}

fn needs(message: String) -> FormatError {
    FormatError::new(FormatErrorKind::NeedsOption, NAME, message)
}

/// Two columns or more; and whether the header speaks of a volume scattering function.
fn table(
    source: &Source,
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<(Curve, String, bool), FormatError> {
    let renamed = |error: FormatError| FormatError { format: NAME, ..error };
    let mut table = rows::read(source, report).map_err(renamed)?;
    match &how.column {
        Some(column) => table.pick(column).map_err(renamed)?,
        None if table.names.len() > 1 => {
            let list = table.column_list();
            report.note(
                NoteKind::Assumed,
                format!(
                    "{} columns of values ({list}): the first is read, the option column names another",
                    table.names.len()
                ),
            );
            table.pick("1").map_err(renamed)?;
        }
        None => {}
    }
    let vsf = table.says(says_volume);
    if table.wavelengths.len() > MAX_WAVELENGTHS {
        let message = format!("{} angles, expected at most {MAX_WAVELENGTHS}", table.wavelengths.len());
        return Err(FormatError::new(FormatErrorKind::OverLimit, NAME, message));
    }
    let (low, high) = table.wavelengths.iter().fold((f64::MAX, f64::MIN), |(a, b), &(x, _)| (a.min(x), b.max(x)));
    let cosines = low >= -1.0 && high <= 1.0 && low < 0.0;
    let range = if cosines { (-1.0, 1.0) } else { (0.0, 180.0) };
    let what = if cosines { "a cosine from -1 to 1" } else { "an angle from 0 to 180 degrees" };
    if let Some(&(found, offset)) = table.wavelengths.iter().find(|(x, _)| !(range.0..=range.1).contains(x)) {
        return Err(source.malformed(offset, format!("found {}, expected {what}", Brief(found))));
    }
    let falling = table.wavelengths.len() > 1 && table.wavelengths[1].0 < table.wavelengths[0].0;
    for pair in table.wavelengths.array_windows() {
        let [(a, _), (b, offset)] = *pair;
        if a == b || (b < a) != falling {
            let expected = if falling { "decreasing" } else { "increasing" };
            return Err(source.malformed(
                offset,
                format!("{} after {}, expected {expected} numbers, each once", Brief(b), Brief(a)),
            ));
        }
    }
    let form = format!("{} {}, {}", table.values.len(), if cosines { "cosines" } else { "angles" }, table.dialect);
    if table.values.len() < 2 || table.values.iter().all(|v| v.is_nan()) {
        return Err(source.malformed(0, "fewer than two values, expected a table over the scattering angle"));
    }
    report.note(
        NoteKind::Assumed,
        if cosines {
            "the first column is the cosine of the scattering angle, +1 = forward".to_owned()
        } else {
            "the first column is the scattering angle in degrees, 0 = forward".to_owned()
        },
    );
    let (mut places, mut values): (Vec<f64>, Vec<f64>) =
        table.wavelengths.iter().zip(&table.values).map(|(&(x, _), &value)| (x, f64::from(value))).unzip();
    // Angles increase and cosines decrease, whatever the file counts in.
    if cosines != falling {
        places.reverse();
        values.reverse();
    }
    let curve = if cosines {
        Curve::over_cosines(places, values)
    } else {
        Curve::over_angles(places, values, vsf || how.normalization == Some(Normalization::Vsf))
    };
    Ok((held(curve, report), form, vsf))
}

/// The values at the ends hold to 0 and 180 degrees where that is not far.
fn held(mut curve: Curve, report: &mut ParseReport) -> Curve {
    let (first, last) = (curve.angles[0], curve.angles[curve.angles.len() - 1]);
    let gap = first.max(180.0 - last);
    // Cosines go through acos, whose last bits are no gap.
    if gap > 1e-6 && gap <= HELD {
        report.note(
            NoteKind::Filled,
            format!(
                "the table goes from {} to {} degrees: its first and last value hold beyond",
                Brief(first),
                Brief(last)
            ),
        );
    }
    curve.held = if gap <= HELD { gap } else { 0.0 };
    curve
}

/// Divides the values by what they integrate to, which must be what was said, or 1 or 4π if nothing was.
fn normalise(curve: &mut Curve, said: Option<Normalization>, report: &mut ParseReport) -> Result<(), FormatError> {
    let whole = curve.held > 0.0 || (curve.angles[0] <= 1e-6 && curve.angles[curve.angles.len() - 1] >= 180.0 - 1e-6);
    if !whole || curve.values.iter().any(|v| v.is_nan()) {
        let divisor = match said {
            Some(Normalization::One) => 1.0,
            Some(Normalization::FourPi) => 4.0 * PI,
            _ => {
                return Err(needs(
                    "the table does not cover 0 to 180 degrees, so that its integral is not known: expected the option \
                     normalization=1 or 4pi, what the whole function integrates to over the sphere"
                        .to_owned(),
                ));
            }
        };
        report.note(NoteKind::Warning, "angles that the table does not cover are masked");
        curve.values.iter_mut().for_each(|value| *value /= divisor);
        return Ok(());
    }
    let integrals = curve.integrals();
    let total = integrals.total;
    if !(total > 0.0 && total.is_finite()) {
        return Err(FormatError::new(
            FormatErrorKind::Malformed,
            NAME,
            format!("the values integrate to {} over the sphere, expected more than 0", Brief(total)),
        ));
    }
    let near = |expected: f64| (total / expected - 1.0).abs() <= TOLERANCE;
    let found = format!("{total:.6}");
    match said {
        None if near(1.0) => report.note(NoteKind::Assumed, format!("normalised to 1 over the sphere (found {found})")),
        None if near(4.0 * PI) => {
            report
                .note(NoteKind::Assumed, format!("normalised to 4 pi over the sphere (found {found}): divided by it"));
        }
        None => {
            return Err(needs(format!(
                "the values integrate to {found} over the sphere, which is neither 1 nor 4 pi within 5 %: expected the option \
                 normalization=1, 4pi, vsf (a volume scattering function in 1/m/sr) or relative"
            )));
        }
        Some(Normalization::Vsf) => {
            report.metadata.push(("scattering_coefficient".to_owned(), Brief(total).to_string()));
            report.note(
                NoteKind::Assumed,
                format!(
                    "a volume scattering function: divided by its integral, the scattering coefficient {}",
                    Brief(total)
                ),
            );
        }
        Some(Normalization::Relative) => {
            report.note(
                NoteKind::Assumed,
                format!("relative values: divided by their integral over the sphere, {found}"),
            );
        }
        Some(said) => {
            let expected = if said == Normalization::One { 1.0 } else { 4.0 * PI };
            if !near(expected) {
                report.note(
                    NoteKind::Warning,
                    format!("the values integrate to {found} over the sphere, not to {expected:.6} as was said: divided by what they make"),
                );
            }
        }
    }
    curve.values.iter_mut().for_each(|value| *value /= total);
    let (mean, share) = (integrals.cosine / total, integrals.first / total);
    report.metadata.push(("integral_over_the_sphere".to_owned(), Brief(total).to_string()));
    report.metadata.push(("mean_cosine".to_owned(), format!("{mean:.6}")));
    report.metadata.push(("share_of_the_first_step".to_owned(), format!("{share:.6}")));
    if share > UNRESOLVED && curve.angles[1] < 90.0 {
        report.note(
            NoteKind::Warning,
            format!(
                "{:.0} % of the light lies within the first step of the table: its peak is not resolved",
                100.0 * share
            ),
        );
    }
    if mean < -0.05 {
        report.note(
            NoteKind::Warning,
            format!("most light goes backward (mean cosine {mean:.3}): here +1 and 0 degrees are forward; is it the other way round in the file?"),
        );
    }
    Ok(())
}
