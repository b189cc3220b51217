//! Table as written: wavelengths, named columns of values, and the text around them.

use super::about::NAME;
use super::holds::Holds;
use super::library::Library;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::text::snippet;

/// Table of spectra as written: wavelengths with their byte offsets, and values row by row.
pub(in crate::formats) struct Table {
    pub(in crate::formats) wavelengths: Vec<(f64, usize)>,
    /// Values of the table, `[row, column]` with one row per wavelength; NaN = missing.
    pub(in crate::formats) values: Vec<f32>,
    /// Name of each column of values, without that of the wavelengths.
    pub(in crate::formats) names: Vec<String>,
    /// Content of each column of values, as its name states it.
    pub(super) holds: Vec<Holds>,
    /// True for each column of values whose name says percent.
    pub(super) percent: Vec<bool>,
    /// Name of the column of wavelengths, if there is a header.
    pub(super) wavelength_name: Option<String>,
    /// Text around the table except its row of column names, in lower case.
    pub(super) prose: String,
    /// Row of names of a table with one spectrum in each row, in lower case; empty for other tables.
    pub(super) heading: String,
    /// Labels of the file, if it is from a spectral library.
    pub(super) library: Option<Library>,
    pub(in crate::formats) dialect: &'static str,
}

impl Table {
    /// Creates a table of columns whose reader knows what they hold; `values` are `[row, column]`.
    pub(in crate::formats) fn of_columns(
        names: Vec<String>,
        wavelengths: Vec<(f64, usize)>,
        values: Vec<f32>,
        dialect: &'static str,
    ) -> Self {
        let columns = names.len();
        Self {
            wavelengths,
            values,
            names,
            holds: vec![Holds::Unstated; columns],
            percent: vec![false; columns],
            wavelength_name: None,
            prose: String::new(),
            heading: String::new(),
            library: None,
            dialect,
        }
    }

    /// Applies the test `said` to the names of columns and to the text around the table, in lower case. Returns true if
    /// one of them passes.
    pub(in crate::formats) fn says(&self, said: impl Fn(&str) -> bool) -> bool {
        said(&self.prose) || said(&self.heading) || self.names.iter().any(|name| said(&name.to_lowercase()))
    }

    /// Returns the lines of text around the table, in lower case.
    pub(super) fn lines(&self) -> impl Iterator<Item = &str> + Clone {
        self.heading.lines().chain(self.prose.lines())
    }

    /// Returns the lowest and the highest value of each column; the lowest is above the highest without any.
    pub(super) fn extremes(&self) -> Vec<(f32, f32)> {
        let mut extremes = vec![(f32::MAX, f32::MIN); self.names.len()];
        for row in self.values.chunks_exact(extremes.len()) {
            for ((low, high), &value) in extremes.iter_mut().zip(row) {
                (*low, *high) = (low.min(value), high.max(value));
            }
        }
        extremes
    }

    /// Keeps one column of values, chosen by its name or by its number from 1.
    pub(super) fn pick(&mut self, wanted: &str) -> Result<(), FormatError> {
        let picked = position(&self.names, wanted)?;
        self.keep(&[picked]);
        Ok(())
    }

    /// Keeps the columns of values at these positions.
    pub(super) fn keep(&mut self, columns: &[usize]) {
        let all = self.names.len();
        if columns.len() < all {
            self.values = self.values.chunks_exact(all).flat_map(|row| columns.iter().map(|&i| row[i])).collect();
            self.names = columns.iter().map(|&i| self.names[i].clone()).collect();
            self.holds = columns.iter().map(|&i| self.holds[i]).collect();
            self.percent = columns.iter().map(|&i| self.percent[i]).collect();
        }
    }

    /// Returns the names of the first columns of values, for messages.
    pub(in crate::formats) fn column_list(&self) -> String {
        listed(&self.names)
    }
}

/// Returns the position of a column of values, chosen by its name or by its number from 1.
pub(in crate::formats) fn position(names: &[String], wanted: &str) -> Result<usize, FormatError> {
    let wanted = wanted.trim();
    let columns = names.len();
    let by_name = |same: fn(&str, &str) -> bool| names.iter().position(|name| same(name, wanted));
    let by_number = || wanted.parse().ok().filter(|n| (1..=columns).contains(n)).map(|n: usize| n - 1);
    by_name(|a, b| a == b).or_else(|| by_name(str::eq_ignore_ascii_case)).or_else(by_number).ok_or_else(|| {
        let message = format!(
            "no column {}, expected a number from 1 to {columns} or one of: {}",
            snippet(wanted),
            listed(names)
        );
        FormatError::new(FormatErrorKind::NeedsOption, NAME, message)
    })
}

/// Returns the first of these names, for messages.
fn listed(names: &[String]) -> String {
    const SHOWN: usize = 8;
    let mut list = names.iter().take(SHOWN).map(|name| snippet(name)).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN {
        list.push_str(", …");
    }
    list
}
