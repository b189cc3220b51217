//! Choice of the columns of a table: wavelengths by name, by unit, or by being the only ones that can be wavelengths;
//! the others hold values, or are left out.

use super::about::NAME;
use super::holds::{Holds, of_column};
use super::wavelength_unit::WavelengthUnit;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::text::snippet;
use crate::formats::text_table::layout::Layout;
use crate::formats::text_table::rows::Role;

/// Ranges of numbers that can be wavelengths in nm, in µm or in Å, or wavenumbers in 1/cm, where nothing says so.
const NANOMETRES: std::ops::RangeInclusive<f64> = 150.0..=4500.0;
const MICROMETRES: std::ops::RangeInclusive<f64> = 0.2..=50.0;
const OTHERS: std::ops::RangeInclusive<f64> = 400.0..=50_000.0;
/// Range of wavelengths in nm that a table has where its header states the unit, from soft X-rays to the far infrared.
const STATED_NANOMETRES: std::ops::RangeInclusive<f64> = 1.0..=1e6;
/// Largest ratio of two steps between neighbouring numbers that are still taken for a scale. Values that only happen to
/// rise differ more. Raising it finds more tables ambiguous.
const EVEN: f64 = 1.5;
/// Number of rows from which steps are compared; fewer numbers are even by chance.
const FEWEST_STEPS: usize = 4;
/// Number of columns whose names a message shows.
const SHOWN: usize = 12;

/// Columns of a table of spectra.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Columns {
    /// Role of each column, in the order of the file.
    pub(super) roles: Vec<Role>,
    /// For each column of values in the order of the file, the number of its column of wavelengths: 0 unless there are
    /// several.
    pub(super) scale: Vec<usize>,
    /// Names of numeric columns that only number the rows.
    pub(super) numbering: Vec<String>,
    /// True if nothing but the order of the columns says which holds wavelengths.
    pub(super) is_first_taken: bool,
    /// Names of columns of text.
    pub(super) texts: Vec<String>,
    /// Content of each column, as its name states it, in the order of the file.
    pub(super) holds: Vec<Holds>,
}

/// Chooses the columns of wavelengths and of values. `names` are those of all columns, empty where there is none;
/// `wanted` is the column of wavelengths that the user names; `unit_is_stated` is true if the user states the unit.
pub(super) fn choose(
    layout: &Layout,
    names: &[String],
    wanted: Option<&str>,
    unit_is_stated: bool,
) -> Result<Columns, FormatError> {
    let mut holds: Vec<Holds> =
        names.iter().zip(&layout.in_percent).map(|(name, in_percent)| of_column(name, *in_percent)).collect();
    let is_index = |wanted: &str| names.iter().position(|name| name.trim().eq_ignore_ascii_case(wanted));
    if let (Some(n), Some(k)) = (is_index("n"), is_index("k")) {
        (holds[n], holds[k]) = (Holds::Index, Holds::Index);
    }
    let has_names = names.iter().any(|name| !name.is_empty());
    let is_numeric = |i: &usize| !layout.is_text[*i];
    let table = Judged { layout, names, holds: &holds };
    let mut is_first_taken = false;
    let scales = if let Some(wanted) = wanted {
        vec![table.wanted(wanted)?]
    } else {
        let named: Vec<usize> =
            (0..layout.width).filter(is_numeric).filter(|&i| holds[i] == Holds::Wavelengths).collect();
        if named.is_empty() {
            table.by_numbers(unit_is_stated, &mut is_first_taken)?
        } else {
            table.without_copies(named)?
        }
    };
    let first_scale = scales[0];
    let mut columns = Columns { roles: vec![Role::Skip; layout.width], is_first_taken, ..Columns::default() };
    let copies = table.copies_of(first_scale);
    for i in 0..layout.width {
        let name = || if names[i].is_empty() { format!("column {}", i + 1) } else { names[i].clone() };
        let counts = || if has_names { layout.counts(i) } else { layout.is_numbering(i) };
        let is_nameless_numbering = i < first_scale && names[i].is_empty() && counts();
        if scales.contains(&i) {
            columns.roles[i] = Role::Key;
        } else if layout.is_text[i] {
            columns.texts.push(name());
        } else if holds[i] == Holds::Numbers || is_nameless_numbering || copies.contains(&i) {
            columns.numbering.push(name());
        } else {
            columns.roles[i] = Role::Value;
            // Each of several scales holds for the columns up to the next.
            let after = scales.iter().filter(|&&scale| scale < i).count();
            columns.scale.push(if scales.len() > 1 { after.saturating_sub(1) } else { 0 });
        }
    }
    if columns.scale.is_empty() {
        let message = format!("no column of values beside {}, expected one at least", table.list(&[first_scale]));
        return Err(FormatError::new(FormatErrorKind::Malformed, NAME, message));
    }
    columns.holds = holds;
    Ok(columns)
}

/// Returns false if the names cannot be those of the columns: the one with a unit of wavelengths stands over numbers
/// that are no wavelengths in this unit, while another column's are. A sentence with as many commas as the table has
/// columns looks like such names.
pub(super) fn fit(layout: &Layout, names: &[String]) -> bool {
    let is_scale = |i: usize| {
        let numbers = layout.numbers(i);
        is_ordered(&numbers) && numbers.iter().all(|value| NANOMETRES.contains(value))
    };
    let is_absurd = |(i, name): (usize, &String)| {
        let unit = WavelengthUnit::of_header(name).filter(|_| of_column(name, false) == Holds::Wavelengths);
        let outside = |value| !STATED_NANOMETRES.contains(&value);
        unit.is_some_and(|unit| layout.numbers(i).into_iter().any(|value| outside(unit.to_nanometres(value))))
            && (0..layout.width).any(|other| other != i && is_scale(other))
    };
    !names.iter().enumerate().any(is_absurd)
}

/// Table whose columns are judged by their names and their first rows.
struct Judged<'a> {
    layout: &'a Layout,
    names: &'a [String],
    holds: &'a [Holds],
}

impl Judged<'_> {
    fn numbers(&self, column: usize) -> Vec<f64> {
        self.layout.numbers(column)
    }

    /// Returns the names of columns for a message; a column without a name has its number.
    fn list(&self, columns: &[usize]) -> String {
        let name = |&i: &usize| match self.names[i].as_str() {
            "" => format!("column {}", i + 1),
            name => snippet(name),
        };
        let mut list = columns.iter().take(SHOWN).map(name).collect::<Vec<_>>().join(", ");
        if columns.len() > SHOWN {
            list.push_str(", …");
        }
        list
    }

    fn all(&self) -> String {
        self.list(&(0..self.layout.width).collect::<Vec<_>>())
    }

    /// Returns the column that the user names, by its name or its number from 1.
    fn wanted(&self, wanted: &str) -> Result<usize, FormatError> {
        let wanted = wanted.trim();
        let named = self.names.iter().position(|name| name.eq_ignore_ascii_case(wanted));
        let numbered = || wanted.parse().ok().filter(|n| (1..=self.layout.width).contains(n)).map(|n: usize| n - 1);
        named.or_else(numbered).filter(|&i| !self.layout.is_text[i]).ok_or_else(|| {
            needs(format!(
                "wavelength_column {}, expected a column of numbers, by name or by number from 1 to {}: {}",
                snippet(wanted),
                self.layout.width,
                self.all()
            ))
        })
    }

    /// Returns the columns that are named as wavelengths, without those that repeat another one in another unit.
    fn without_copies(&self, mut named: Vec<usize>) -> Result<Vec<usize>, FormatError> {
        let first = named[0];
        let copies = self.copies_of(first);
        named.retain(|i| !copies.contains(i));
        // Each needs values of its own: the columns up to the next one.
        let ends: Vec<usize> = named.iter().skip(1).copied().chain([self.layout.width]).collect();
        let has_values = |(&start, &end): (&usize, &usize)| (start + 1..end).any(|i| !self.layout.is_text[i]);
        if named.len() > 1 && !named.iter().zip(&ends).all(has_values) {
            return Err(needs(format!(
                "several columns of wavelengths ({}), expected one, or values after each of them: name it with \
                 wavelength_column",
                self.list(&named)
            )));
        }
        Ok(named)
    }

    /// Returns the columns named as wavelengths that repeat those of `column` in another unit.
    fn copies_of(&self, column: usize) -> Vec<usize> {
        let unit = |i: usize| WavelengthUnit::of_header(&self.names[i]);
        let Some(own) = unit(column) else { return Vec::new() };
        let nanometres = |i: usize, unit: WavelengthUnit| {
            self.numbers(i).into_iter().map(|value| unit.to_nanometres(value)).collect::<Vec<_>>()
        };
        let reference = nanometres(column, own);
        let repeats = |i: usize, other: WavelengthUnit| {
            let values = nanometres(i, other);
            // Both may be rounded.
            values.len() == reference.len()
                && values.iter().zip(&reference).all(|(a, b)| (a - b).abs() <= 2e-3 * b.abs())
        };
        (0..self.layout.width)
            .filter(|&i| i != column && self.holds[i] == Holds::Wavelengths && !self.layout.is_text[i])
            .filter(|&i| unit(i).is_some_and(|other| other != own && repeats(i, other)))
            .collect()
    }

    /// Returns the columns whose numbers can be wavelengths, if there is no doubt which. Sets `is_first_taken` if
    /// nothing but the order of the columns decides.
    fn by_numbers(&self, unit_is_stated: bool, is_first_taken: &mut bool) -> Result<Vec<usize>, FormatError> {
        let width = self.layout.width;
        let angles = (0..width).filter(|&i| names_angle(&self.names[i])).collect::<Vec<_>>();
        if !angles.is_empty() {
            return Err(self.over_directions(&angles));
        }
        // A name with another unit than one of wavelengths says that it holds none.
        let may_be = |&i: &usize| {
            let has_unit = self.names[i].trim_end().ends_with([')', ']']);
            let is_unstated = self.holds[i] == Holds::Unstated && !has_unit;
            is_unstated && !self.layout.is_text[i] && !self.layout.is_numbering(i)
        };
        let ordered: Vec<usize> = (0..width).filter(may_be).filter(|&i| is_ordered(&self.numbers(i))).collect();
        let within = |ranges: &[std::ops::RangeInclusive<f64>]| -> Vec<usize> {
            let fits = |&&i: &&usize| {
                let values = self.numbers(i);
                ranges.iter().any(|range| values.iter().all(|value| range.contains(value)))
            };
            ordered.iter().filter(fits).copied().collect()
        };
        let is_bare = self.names.iter().all(String::is_empty);
        for ranges in [&[NANOMETRES][..], &[MICROMETRES, OTHERS]] {
            let candidates = within(ranges);
            match candidates.as_slice() {
                [] => {}
                [one] => return Ok(vec![*one]),
                several => {
                    if let Some(scales) = self.alternating(several) {
                        return Ok(scales);
                    }
                    let even: Vec<usize> = several.iter().filter(|&&i| is_even(&self.numbers(i))).copied().collect();
                    if let [one] = even.as_slice() {
                        return Ok(vec![*one]);
                    }
                    // Numbers that are all alike hold values in some columns: those after the first, which is noted.
                    if width > 2 && several.len() == width && is_bare {
                        *is_first_taken = true;
                        return Ok(vec![0]);
                    }
                    return Err(needs(format!(
                        "{} can be wavelengths, by their numbers, expected one column: name it with wavelength_column",
                        self.list(several)
                    )));
                }
            }
        }
        // Nothing but the order of its rows is against the only column within the range of wavelengths in nm.
        let in_range = |&i: &usize| may_be(&i) && self.numbers(i).iter().all(|value| NANOMETRES.contains(value));
        if let [one] = (0..width).filter(in_range).collect::<Vec<_>>().as_slice()
            && is_bare
        {
            return Ok(vec![*one]);
        }
        // The user says that there are wavelengths, whatever their numbers.
        let is_scale =
            |&i: &usize| !self.layout.is_text[i] && self.holds[i] == Holds::Unstated && is_ordered(&self.numbers(i));
        match (0..width).find(is_scale) {
            Some(first) if unit_is_stated => Ok(vec![first]),
            _ => Err(self.no_wavelengths()),
        }
    }

    /// Returns the first column of each pair of a column of wavelengths and one of values, if the columns alternate so.
    fn alternating(&self, candidates: &[usize]) -> Option<Vec<usize>> {
        let width = self.layout.width;
        let firsts: Vec<usize> = (0..width).step_by(2).collect();
        let all = width.is_multiple_of(2) && firsts.len() >= 2 && firsts.iter().all(|i| candidates.contains(i));
        let first = self.numbers(0);
        let alike = |&i: &usize| {
            let values = self.numbers(i);
            values == first || values.len() >= FEWEST_STEPS && is_even(&values) && is_even(&first)
        };
        (all && self.layout.sample.len() >= FEWEST_STEPS && firsts.iter().all(alike)).then_some(firsts)
    }

    fn over_directions(&self, angles: &[usize]) -> FormatError {
        let message = format!(
            "a table over directions ({}), expected a spectrum: write it as radiometric-csv, whose lines `# quantity:`, \
             `# value_unit:` and `# angle_unit:` say what it holds (`wavelume formats --template radiometric-csv-wide` \
             prints one)",
            self.list(angles)
        );
        FormatError::new(FormatErrorKind::Unsupported, NAME, message)
    }

    fn no_wavelengths(&self) -> FormatError {
        let named = self.names.iter().any(|name| !name.is_empty());
        let index = (0..self.layout.width).filter(|&i| self.holds[i] == Holds::Index).collect::<Vec<_>>();
        if !index.is_empty() {
            let message = format!(
                "{} of a material: refractive indices are no spectrum of light, reflectance or transmittance, which are read",
                self.list(&index)
            );
            return FormatError::new(FormatErrorKind::Unsupported, NAME, message);
        }
        let ranges: Vec<String> = (0..self.layout.width)
            .filter(|&i| !self.layout.is_text[i])
            .take(SHOWN)
            .map(|i| {
                let values = self.numbers(i);
                let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(a, b), &v| (a.min(v), b.max(v)));
                format!("{} from {} to {}", self.list(&[i]), super::Brief(low), super::Brief(high))
            })
            .collect();
        let what = if named { "is named as wavelengths or can be wavelengths" } else { "can be wavelengths" };
        needs(format!(
            "no column {what} by its numbers ({}), expected one: if one holds wavelengths, name it with wavelength_column",
            ranges.join(", ")
        ))
    }
}

/// Returns true if the name of a column is that of an angle.
fn names_angle(name: &str) -> bool {
    const WORDS: [&str; 14] = [
        "theta",
        "phi",
        "gamma",
        "angle",
        "winkel",
        "aoi",
        "azimuth",
        "azimut",
        "zenith",
        "elevation",
        "incidence",
        "einfall",
        "θ",
        "φ",
    ];
    let lower = name.to_lowercase();
    let words = || lower.split(|c: char| !c.is_alphanumeric());
    WORDS.iter().any(|word| words().any(|found| found == *word || found.ends_with(word) && word.len() > 4))
}

fn needs(message: String) -> FormatError {
    FormatError::new(FormatErrorKind::NeedsOption, NAME, message)
}

/// Returns true if numbers rise, or fall, or do so but for a few of them.
pub(super) fn is_ordered(values: &[f64]) -> bool {
    let steps = values.len().saturating_sub(1);
    let rising = values.array_windows().filter(|[a, b]| a < b).count();
    let falling = values.array_windows().filter(|[a, b]| a > b).count();
    let equal = steps - rising - falling;
    // One or two rows may be exchanged, and the ranges of two or three detectors may follow each other.
    let most = steps - steps / 8;
    let run = |count: usize| count + equal >= most && 2 * count >= steps;
    !values.is_empty() && (run(rising) || run(falling))
}

/// Returns true if the steps between neighbouring numbers are alike.
fn is_even(values: &[f64]) -> bool {
    let steps = values.array_windows().map(|[a, b]| (b - a).abs());
    let (low, high) = steps.fold((f64::MAX, 0.0_f64), |(low, high), step| (low.min(step), high.max(step)));
    values.len() >= FEWEST_STEPS && low > 0.0 && high <= EVEN * low
}
