//! Row of column names: the role of each cell of a row as angle, wavelength, value, or ignored.

use super::header::Header;
use super::problems::Problems;
use crate::domain::Quantity;
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::formats::acquisition::ParseReport;
use crate::formats::normalization::Normalization;
use crate::formats::number::decimal;
use crate::formats::text::{Brief, snippet};
use crate::notes::TextNote;

/// Names of the angle columns, in the order in which a row's direction holds them.
pub(super) const ANGLES: [&str; 4] = ["theta_i", "phi_i", "theta_o", "phi_o"];

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
            }
        }
        if !(low..=high).contains(&degrees) {
            return None;
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
}

/// Row of column names in a radiometric-csv file, and the number of its line.
pub(super) struct Row<'a> {
    pub(super) text: &'a str,
    pub(super) line: usize,
}

/// Reads the column names. Returns `None`, after reporting at least one problem, if they do not form a table of the
/// quantity.
pub(super) fn read(
    row: &Row<'_>,
    header: &Header,
    report: &mut ParseReport,
    problems: &mut Problems,
) -> Option<Columns> {
    check_separator(row, problems)?;
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
    let mut at = 1;
    let mut good = true;
    for (i, cell) in row.text.split(',').enumerate() {
        let column = at + (cell.chars().count() - cell.trim_start().chars().count());
        at += cell.chars().count() + 1;
        let written = cell.trim().trim_matches('"').trim();
        let name = written.to_lowercase();
        let mut problem = |message: String| {
            problems.add(row.line, column, || message);
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
                        problem(format!("{} is the second column of {}, expected one", snippet(written), ANGLES[k]));
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
                    unknown.push(snippet(written));
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
    check_forms(&mut wide, value.is_some(), columns.has_wavelength, &mut refuse);
    for (rank, &(nanometres, i)) in wide.iter().enumerate() {
        columns.cells[i] = Cell::Value(rank);
        columns.wavelengths.push(nanometres);
    }
    sigma_cells(&mut columns, &wide_sigma, sigma, &mut refuse);
    if let (Some(stated), Some(found)) = (header.luminaire, from_nadir)
        && stated != found
    {
        let name = if found { "luminaire" } else { "surface" };
        refuse(format!("the columns are angles of the {name}'s frame, but `frame` in the header states the other one"));
    }
    check_directions(&columns, header, &mut refuse);
    if !unknown.is_empty() {
        let shown = unknown.iter().take(8).cloned().collect::<Vec<_>>().join(", ");
        report.note(TextNote::UnknownColumns { columns: unknown.len(), first_names: shown });
    }
    good.then_some(columns)
}

/// Reports a separator other than `,` as a single problem of the file, instead of one problem per missing column.
fn check_separator(row: &Row<'_>, problems: &mut Problems) -> Option<()> {
    let names = row.text.trim_end_matches(',').trim();
    let known = [(';', "`;`"), ('\t', "tabs"), (' ', "blanks")];
    let other = known.into_iter().find(|(c, _)| row.line > 0 && !names.contains(',') && names.contains(*c));
    let Some((_, found)) = other else { return Some(()) };
    problems.add(row.line, 1, || format!("cells are separated by {found}, expected `,` (and `.` in numbers)"));
    None
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
    Angle { radians: header.radians, range, from_nadir }
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
