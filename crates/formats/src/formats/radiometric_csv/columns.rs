//! Row of column names: the role of each cell of a row as angle, wavelength, value, or ignored.

use super::header::Header;
use super::names::{self, Meaning, ValueName};
use super::problems::Problems;
use crate::domain::Quantity;
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::formats::acquisition::ParseReport;
use crate::formats::normalization::Normalization;
use crate::formats::number::decimal;
use crate::formats::text::{Brief, Token, number, snippet};
use crate::formats::text_table::cells::{Delimiter, name_of};
use crate::notes::{ScatteringNote, TextNote};

/// Expected contents of cells, as messages name them.
pub(super) const ANGLE: &str = "an angle";
pub(super) const WAVELENGTH: &str = "a positive wavelength";
pub(super) const VALUE: &str = "a number, or nothing where it is missing";
pub(super) const FINITE: &str = "a number within the range of float32";
pub(super) const NOT_NEGATIVE: &str = "an uncertainty, which is not negative";

/// Names of the angle columns, in the order in which a row's direction holds them.
pub(super) const ANGLES: [&str; 4] = ["theta_i", "phi_i", "theta_o", "phi_o"];

/// Range in nm of bare numbers in column names that are taken for wavelengths. A wider one takes azimuths for them.
const LIKELY: std::ops::RangeInclusive<f64> = 150.0..=3000.0;
/// Upper bound on the columns of wavelengths that a note on names lists.
const SHOWN: usize = 4;

/// Role of a cell in a row of a radiometric-csv file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cell {
    /// Cell with one of the angles that give the direction in a row of a radiometric-csv file: 0 is `theta_i`, 1 is
    /// `phi_i`, 2 is `theta_o`, 3 is `phi_o`.
    Angle(usize),
    /// Wavelength of the row in the long form (one value per row).
    Wavelength,
    /// Value at the wavelength with this index (wide form, one column per wavelength), or the single value of the row.
    Value(usize),
    /// Standard uncertainty of the value with this index in the row.
    Sigma(usize),
    /// Cell that the reader ignores, because it does not know the name of the cell's column.
    Ignored,
}

/// Unit and zero of the angles in a column, which give degrees of the surface frame, and their allowed range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Angle {
    pub(super) radians: bool,
    /// Allowed range, in degrees, of the angles in a column of the file, before they are converted to the surface
    /// frame.
    pub(super) range: (f64, f64),
    /// True for the luminaire angle gamma, measured from nadir: theta = 180° − gamma.
    pub(super) from_nadir: bool,
    /// True if the angle may be negative: on the other side of the normal, in the plane of incidence.
    pub(super) signed: bool,
}

impl Angle {
    /// Converts an angle as written to degrees of the surface frame; `None` if it is out of range. Radians are rounded
    /// to 0.0001°, within the precision of their digits.
    pub(super) fn degrees(self, written: f64) -> Option<f64> {
        const ROUNDING: f64 = 1e-3;
        let (low, high) = self.range;
        let mut degrees = written;
        if self.radians {
            degrees = (written.to_degrees() * 1e4).round() / 1e4;
            if (low - ROUNDING..=high + ROUNDING).contains(&degrees) {
                degrees = degrees.clamp(low, high);
            } else if self.signed && (low - ROUNDING..=high + ROUNDING).contains(&-degrees) {
                degrees = -(-degrees).clamp(low, high);
            }
        }
        if !(low..=high).contains(&degrees) {
            return (self.signed && (low..=high).contains(&-degrees)).then_some(degrees);
        }
        // Avoids negative zero: angles are compared by their bits.
        Some(if self.from_nadir { 180.0 - degrees } else { degrees + 0.0 })
    }
}

/// Meaning of the columns of a radiometric-csv file.
#[derive(Debug)]
pub(super) struct Columns {
    pub(super) cells: Vec<Cell>,
    /// Names of the file's columns as written there, for messages.
    pub(super) names: Vec<String>,
    /// Angle columns that are present, in the order of [`ANGLES`].
    pub(super) angles: [Option<Angle>; 4],
    /// Wavelengths in nm, increasing, of the wide form (one column per wavelength); empty in the long form.
    pub(super) wavelengths: Vec<f64>,
    /// True if a column gives the wavelength of each row.
    pub(super) has_wavelength: bool,
    /// True if there are columns of standard uncertainties.
    pub(super) has_sigma: bool,
}

impl Columns {
    /// Returns the number of values in a row of the file: one for each wavelength column, or 1 if there are none.
    pub(super) fn width(&self) -> usize {
        self.wavelengths.len().max(1)
    }

    pub(super) fn is_wide(&self) -> bool {
        !self.wavelengths.is_empty()
    }

    /// Returns the message on a cell with unexpected content.
    pub(super) fn refusal(&self, column: usize, found: &str, expected: &str) -> String {
        let name = &self.names[column];
        let angle = match self.cells[column] {
            Cell::Angle(k) if expected == ANGLE => self.angles[k],
            _ => None,
        };
        let Some(Angle { range: (low, high), signed, radians, .. }) = angle else {
            return format!("found {}, expected {expected} ({name})", snippet(found));
        };
        let written = number(found);
        // Which angles are negative is told only where one is.
        let low = if signed && written.is_some_and(|written| written < 0.0) { -high } else { low };
        let unit = if radians { "degrees, written in radians" } else { "degrees" };
        format!("found {}, expected an angle from {low} to {high} {unit} ({name})", snippet(found))
    }
}

/// Row of column names in a radiometric-csv file: each with its column, and the number of its line.
pub(super) struct Row {
    pub(super) cells: Vec<(String, usize)>,
    pub(super) line: usize,
    /// True if the names alone say that the table is one of directions, so that an angle in it may not be ignored.
    pub(super) alone: bool,
    /// True if the angle of incidence of all rows is stated before the table.
    pub(super) with_source: bool,
}

impl Row {
    /// Splits a line of names at the separator of the file.
    pub(super) fn of(text: &str, delimiter: Delimiter, line: usize) -> Self {
        let mut cells: Vec<(String, usize)> = if delimiter == Delimiter::Comma && !text.contains('"') {
            let mut at = 0;
            let split = text.split(',').map(|cell| {
                let blank = cell.len() - cell.trim_start().len();
                at += cell.len() + 1;
                (cell.trim().to_owned(), at - cell.len() - 1 + blank)
            });
            split.collect()
        } else {
            let cells = delimiter.cells(Token { text, offset: 0 });
            let mut named: Vec<(String, usize)> = Vec::with_capacity(cells.len());
            for cell in &cells {
                let is_unit = delimiter == Delimiter::Blank && cell.text.starts_with(['[', '(']);
                match named.last_mut().filter(|_| is_unit) {
                    // Between blanks a unit in brackets belongs to the name before it.
                    Some((name, _)) => *name = format!("{name} {}", cell.text),
                    None => named.push((name_of(cell.text), cell.offset)),
                }
            }
            named
        };
        // Byte offsets become columns, which are counted in characters.
        let (mut known, mut column) = (0, 1);
        for (_, at) in &mut cells {
            column += text.get(known..*at).map_or(0, |between| between.chars().count());
            known = known.max(*at);
            *at = column;
        }
        Self { cells, line, alone: false, with_source: false }
    }
}

/// Reads the column names; `theta_i` is an angle of incidence that the file states for all rows. Returns `None`, after
/// reporting at least one problem, if they do not form a table of the quantity.
pub(super) fn read(
    row: &Row,
    header: &Header,
    theta_i: Option<f64>,
    report: &mut ParseReport,
    problems: &mut Problems,
) -> Option<Columns> {
    let mut columns = Columns {
        cells: Vec::new(),
        names: Vec::new(),
        angles: [None; 4],
        wavelengths: Vec::new(),
        has_wavelength: false,
        has_sigma: false,
    };
    let (mut wide, mut value, mut unknown) = (Vec::new(), None, Vec::new());
    let (mut wide_sigma, mut sigma) = (Vec::new(), None);
    let mut from_nadir = None;
    let mut good = true;
    for (i, (cell, column)) in row.cells.iter().enumerate() {
        let written = cell.trim().trim_matches('"').trim();
        let name = written.to_lowercase();
        let mut problem = |message: String| {
            problems.add(row.line, *column, || message);
            good = false;
        };
        let is = match name.as_str() {
            "value" => {
                if value.replace(i).is_some() {
                    problem("a second column `value`, expected one".to_owned());
                }
                Cell::Value(0)
            }
            "wavelength" | "lambda" => {
                if columns.has_wavelength {
                    problem("a second column of wavelengths, expected one".to_owned());
                }
                columns.has_wavelength = true;
                Cell::Wavelength
            }
            _ => match (angle_of(&name, header.quantity), band(&name, b'v'), band(&name, b's')) {
                (Some((k, nadir)), ..) => {
                    if let Some(nadir) = nadir {
                        from_nadir = Some(nadir);
                    }
                    if columns.angles[k].is_some() {
                        problem(second_angle(written, k));
                    }
                    columns.angles[k] = Some(angle(k, k == 2 && nadir == Some(true), header));
                    Cell::Angle(k)
                }
                (_, Some(written), _) => {
                    let nanometres = header.wavelength_unit.to_nanometres(written);
                    if nanometres > 0.0 && nanometres.is_finite() {
                        wide.push((nanometres, i));
                    } else {
                        problem(format!("wavelength {}, expected a positive number", Brief(written)));
                    }
                    Cell::Value(0)
                }
                (_, _, Some(written)) => {
                    wide_sigma.push((header.wavelength_unit.to_nanometres(written), i));
                    Cell::Ignored
                }
                _ if name == "sigma" => {
                    if sigma.replace(i).is_some() {
                        problem("a second column `sigma`, expected one".to_owned());
                    }
                    Cell::Ignored
                }
                _ => {
                    unknown.push(i);
                    Cell::Ignored
                }
            },
        };
        columns.cells.push(is);
        columns.names.push(written.chars().take(40).collect());
    }
    let mut refuse = |message: String| {
        problems.add(row.line, 1, || message);
        good = false;
    };
    let mut found = Found { wide, value, wide_sigma, sigma, unknown };
    in_words(row, header, &mut columns, &mut found, report, &mut refuse);
    let Found { mut wide, value, wide_sigma, sigma, unknown } = found;
    check_forms(&mut wide, value.is_some(), columns.has_wavelength, &mut refuse);
    for (rank, &(nanometres, i)) in wide.iter().enumerate() {
        columns.cells[i] = Cell::Value(rank);
        columns.wavelengths.push(nanometres);
    }
    sigma_cells(&mut columns, &wide_sigma, sigma, &mut refuse);
    check_frame(header, from_nadir, &mut refuse);
    stated_incidence(theta_i, header, &mut columns, &mut refuse);
    check_directions(&columns, header, &mut refuse);
    if !unknown.is_empty() {
        let shown = unknown.iter().take(8).map(|&i| snippet(&columns.names[i])).collect::<Vec<_>>().join(", ");
        report.note(TextNote::UnknownColumns { columns: unknown.len(), first_names: shown });
    }
    good.then_some(columns)
}

/// Reports a problem if the columns are angles of another frame than the header states.
fn check_frame(header: &Header, from_nadir: Option<bool>, refuse: &mut impl FnMut(String)) {
    if let (Some(stated), Some(found)) = (header.luminaire, from_nadir)
        && stated != found
    {
        let name = if found { "luminaire" } else { "surface" };
        refuse(format!("the columns are angles of the {name}'s frame, but `frame` in the header states the other one"));
    }
}

/// Adds the angle of incidence that the file states for all rows, unless the rows have one.
fn stated_incidence(theta_i: Option<f64>, header: &Header, columns: &mut Columns, refuse: &mut impl FnMut(String)) {
    if let (Some(degrees), None) = (theta_i, columns.angles[0]) {
        let of_source = angle(0, false, header);
        if !(of_source.range.0..=of_source.range.1).contains(&degrees) {
            refuse(format!(
                "the angle of incidence stated before the table is {} degrees, expected 0 to 90",
                Brief(degrees)
            ));
        }
        columns.angles[0] = Some(Angle { radians: false, ..of_source });
    }
}

/// Columns of values and uncertainties found so far, and the columns that are not known, by their numbers.
struct Found {
    /// Wavelengths in nm with the columns of their values.
    wide: Vec<(f64, usize)>,
    value: Option<usize>,
    wide_sigma: Vec<(f64, usize)>,
    sigma: Option<usize>,
    unknown: Vec<usize>,
}

fn second_angle(name: &str, k: usize) -> String {
    format!("{} is the second column of {}, expected one", snippet(name), ANGLES[k])
}

/// Reads the names that are not those of radiometric-csv in the words of laboratories: `Einfallswinkel [°]` is
/// `theta_i`. Columns under their own names go before.
fn in_words(
    row: &Row,
    header: &Header,
    columns: &mut Columns,
    found: &mut Found,
    report: &mut ParseReport,
    refuse: &mut impl FnMut(String),
) {
    if found.unknown.is_empty() {
        return;
    }
    let meanings = names::meanings(&columns.names, row.with_source);
    let own = columns.angles;
    let (own_wavelength, own_values) = (columns.has_wavelength, found.value.is_some() || !found.wide.is_empty());
    let own_sigma = found.sigma.is_some() || !found.wide_sigma.is_empty();
    let over_directions = header.quantity.directions() == 2;
    let (mut values, mut numbers, mut named) = (Vec::new(), Vec::new(), Vec::new());
    let known = |i: usize, is: &str, named: &mut Vec<String>, columns: &Columns| {
        named.push(format!("{is} {}", snippet(&columns.names[i])));
    };
    let mut left = Vec::new();
    for i in std::mem::take(&mut found.unknown) {
        match &meanings[i] {
            Meaning::Angle { k, radians } if own[*k].is_none() && over_directions => {
                if columns.angles[*k].is_some() {
                    refuse(second_angle(&columns.names[i], *k));
                }
                let mut of_name = angle(*k, false, header);
                of_name.radians = radians.unwrap_or(of_name.radians);
                columns.angles[*k] = Some(of_name);
                columns.cells[i] = Cell::Angle(*k);
                known(i, ANGLES[*k], &mut named, columns);
            }
            Meaning::OddAngle if row.alone => refuse(format!(
                "{} is an angle whose zero or side is not known, expected names such as theta_i (source), theta_o (detector), \
                 phi_o (azimuth of the detector: 0 on the source's side, 180 opposite)",
                snippet(&columns.names[i])
            )),
            Meaning::Wavelength(_) if !own_wavelength => {
                if columns.has_wavelength {
                    refuse("a second column of wavelengths, expected one".to_owned());
                }
                columns.has_wavelength = true;
                columns.cells[i] = Cell::Wavelength;
                known(i, "wavelength", &mut named, columns);
            }
            Meaning::Value(value) if !own_values => values.push((i, *value)),
            Meaning::Number(number) if !own_values => numbers.push((i, *number)),
            Meaning::Sigma(band) if !own_sigma => match band {
                Some(band) => found.wide_sigma.push((band.nanometres, i)),
                None if found.sigma.is_none() => found.sigma = Some(i),
                None => left.push(i),
            },
            _ => left.push(i),
        }
    }
    found.unknown = left;
    choose_values(values, &numbers, row.alone && !own_values, (header, columns), found, refuse);
    if let Some(i) = found.value.filter(|_| !own_values) {
        columns.cells[i] = Cell::Value(0);
        known(i, "value", &mut named, columns);
    }
    let mut wide: Vec<&(f64, usize)> = found.wide.iter().filter(|_| !own_values).collect();
    wide.sort_by(|a, b| a.0.total_cmp(&b.0));
    for &&(nanometres, i) in wide.iter().take(SHOWN) {
        known(i, &format!("{} nm", Brief(nanometres)), &mut named, columns);
    }
    if wide.len() > SHOWN {
        named.push("…".to_owned());
    }
    found.unknown.sort_unstable();
    if !named.is_empty() {
        report.note(ScatteringNote::ColumnsByName { columns: named.join(", ") });
    }
}

/// Chooses the columns of values among those whose names say so: those with a wavelength, else one. `is_alone` is true
/// where one further column of any name holds them.
fn choose_values(
    values: Vec<(usize, ValueName)>,
    numbers: &[(usize, f64)],
    is_alone: bool,
    (header, columns): (&Header, &Columns),
    found: &mut Found,
    refuse: &mut impl FnMut(String),
) {
    if values.is_empty() {
        let listed: Vec<f64> =
            numbers.iter().map(|&(_, number)| header.wavelength_unit.to_nanometres(number)).collect();
        let likely = |nanometres: &f64| !header.wavelength_unit_assumed || LIKELY.contains(nanometres);
        if !listed.is_empty() && listed.iter().all(likely) {
            found.wide = listed.into_iter().zip(numbers).map(|(nanometres, &(i, _))| (nanometres, i)).collect();
        } else {
            found.unknown.extend(numbers.iter().map(|&(i, _)| i));
            // A table of directions with one further column: what it is called does not matter.
            if is_alone && found.unknown.len() == 1 {
                found.value = found.unknown.pop();
            }
        }
    } else {
        let with_band = values.iter().any(|(_, value)| value.band.is_some());
        let with_quantity = values.iter().any(|(_, value)| value.quantity.is_some() || value.is_reflectance);
        let counts = |value: &ValueName| {
            if with_band {
                value.band.is_some()
            } else {
                !with_quantity || value.quantity.is_some() || value.is_reflectance
            }
        };
        let (kept, others): (Vec<_>, Vec<_>) = values.into_iter().partition(|(_, value)| counts(value));
        found.unknown.extend(others.into_iter().map(|(i, _)| i).chain(numbers.iter().map(|&(i, _)| i)));
        if with_band {
            found.wide = kept.iter().filter_map(|(i, value)| Some((value.band?.nanometres, *i))).collect();
        } else if kept.len() == 1 {
            found.value = Some(kept[0].0);
        } else {
            let listed: Vec<String> = kept.iter().take(8).map(|(i, _)| snippet(&columns.names[*i])).collect();
            refuse(format!(
                "{} columns of values, {}, without their wavelengths: expected one column, or a wavelength in each name \
                 (`BRDF 550 nm`)",
                kept.len(),
                listed.join(", ")
            ));
            found.value = Some(kept[0].0);
        }
    }
}

/// Assigns each column of standard uncertainties to its column of values.
fn sigma_cells(columns: &mut Columns, wide: &[(f64, usize)], alone: Option<usize>, refuse: &mut impl FnMut(String)) {
    if let Some(i) = alone {
        if columns.is_wide() {
            refuse("a column `sigma` beside columns such as `v550`, expected one `s550` for each".to_owned());
        } else {
            columns.cells[i] = Cell::Sigma(0);
            columns.has_sigma = true;
        }
    }
    let mut known: Vec<usize> = Vec::new();
    for &(nanometres, i) in wide {
        match columns.wavelengths.iter().position(|&value| value == nanometres) {
            Some(rank) if !known.contains(&rank) => {
                known.push(rank);
                columns.cells[i] = Cell::Sigma(rank);
                columns.has_sigma = true;
            }
            Some(_) => refuse(format!("two columns of the uncertainty at {} nm, expected one", Brief(nanometres))),
            None => refuse(format!(
                "an uncertainty at {} nm, where there is no column of values, expected one",
                Brief(nanometres)
            )),
        }
    }
}

/// Reports a problem unless the values are in one column `value` or in one column per wavelength, not both. Sorts
/// columns by wavelength.
fn check_forms(wide: &mut [(f64, usize)], has_value: bool, has_wavelength: bool, refuse: &mut impl FnMut(String)) {
    if wide.len() > MAX_WAVELENGTHS {
        refuse(format!("{} columns of wavelengths, expected at most {MAX_WAVELENGTHS}", wide.len()));
    }
    match (has_value, wide.is_empty()) {
        (true, false) => refuse("both `value` and columns such as `v550`, expected one form".to_owned()),
        (false, true) => refuse("no column `value`, nor columns such as `v550`: expected values".to_owned()),
        (false, false) if has_wavelength => {
            refuse("a column of wavelengths beside columns such as `v550`, expected one form".to_owned());
        }
        _ => {}
    }
    wide.sort_by(|a, b| a.0.total_cmp(&b.0));
    for pair in wide.array_windows() {
        let [(a, _), (b, _)] = *pair;
        if a == b {
            refuse(format!("two columns of {} nm, expected each wavelength once", Brief(a)));
            break;
        }
    }
}

/// Returns the index, 0 to 3, of the angle (`theta_i`, `phi_i`, `theta_o`, `phi_o`) that a column name denotes. Also
/// returns true for names of luminaire angles (gamma, C), false for those of surface angles, `None` for a name that
/// serves both.
fn angle_of(name: &str, quantity: Quantity) -> Option<(usize, Option<bool>)> {
    let outgoing = quantity == Quantity::Edf;
    match name {
        "theta_i" => Some((0, None)),
        "phi_i" => Some((1, None)),
        "theta_o" => Some((2, None)),
        "phi_o" => Some((3, None)),
        "gamma" if outgoing => Some((2, Some(true))),
        "c" if outgoing => Some((3, Some(true))),
        "theta" if outgoing => Some((2, Some(false))),
        "phi" if outgoing => Some((3, Some(false))),
        // The scattering angle; it stands alone if there are no columns of wi.
        "theta" if quantity == Quantity::Phase => Some((2, None)),
        "theta" if quantity == Quantity::Reflectance => Some((0, None)),
        "phi" if quantity == Quantity::Reflectance => Some((1, None)),
        _ => None,
    }
}

/// Returns the wavelength in a column name such as `v550` or `v550.5`; `letter` is the letter before it.
fn band(name: &str, letter: u8) -> Option<f64> {
    let rest = name.as_bytes().strip_prefix(&[letter])?;
    let starts = rest.first().is_some_and(|byte| byte.is_ascii_digit() || *byte == b'.');
    let (value, end) = decimal(rest, 0)?;
    (starts && end == rest.len()).then_some(value)
}

fn angle(k: usize, from_nadir: bool, header: &Header) -> Angle {
    let range = match (k, header.quantity) {
        (1 | 3, _) => (-360.0, 720.0),
        (0, Quantity::Reflectance | Quantity::Brdf | Quantity::Btdf | Quantity::Bsdf) | (_, Quantity::Brdf) => {
            (0.0, 90.0)
        }
        (2, Quantity::Btdf) => (90.0, 180.0),
        _ => (0.0, 180.0),
    };
    let signed = k == 2 && header.quantity.directions() == 2 && header.quantity != Quantity::Phase;
    Angle { radians: header.radians, range, from_nadir, signed }
}

/// Reports a problem if the angle columns do not fit the quantity, or if an azimuth has no theta.
fn check_directions(columns: &Columns, header: &Header, refuse: &mut impl FnMut(String)) {
    let quantity = header.quantity;
    let [theta_i, phi_i, theta_o, phi_o] = columns.angles.map(|angle| angle.is_some());
    let expected = match quantity {
        Quantity::Spectrum => (false, false),
        Quantity::Reflectance => (theta_i, false),
        Quantity::Edf => (false, true),
        Quantity::Phase if !theta_i && !phi_o => (false, true),
        Quantity::Brdf | Quantity::Btdf | Quantity::Bsdf | Quantity::Phase => (true, true),
    };
    if (theta_i, theta_o) != expected || (phi_i && !theta_i) || (phi_o && !theta_o) {
        let names = match (quantity, expected) {
            (Quantity::Reflectance, _) => "none, or theta_i with or without phi_i",
            (_, (false, false)) => "none",
            (Quantity::Phase, (true, true)) => {
                "theta (the scattering angle) alone, or theta_i, theta_o and phi_o, and phi_i unless it is isotropic"
            }
            (_, (true, true)) => "theta_i, theta_o and phi_o, and phi_i unless it is isotropic",
            _ => "theta and phi, or gamma and c",
        };
        refuse(format!("the columns of angles of quantity {quantity}: expected {names}"));
    }
    if quantity == Quantity::Phase && theta_i && header.normalization == Some(Normalization::Vsf) {
        refuse(
            "a volume scattering function (1/m/sr) over two directions, expected it over theta, the scattering angle, alone"
                .to_owned(),
        );
    }
    let has_no_place = columns.angles.iter().all(Option::is_none) && !columns.has_wavelength && !columns.is_wide();
    if has_no_place {
        refuse("no column of angles or wavelengths, expected what the values are a function of".to_owned());
    }
}
