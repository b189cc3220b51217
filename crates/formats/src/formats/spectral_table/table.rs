//! Table as written: wavelengths, named columns of values, and the text around them.

use super::about::NAME;
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
    /// Name of the column of wavelengths, if there is a header.
    pub(super) wavelength_name: Option<String>,
    /// Text around the table except its row of column names, in lower case.
    pub(super) prose: String,
    /// Row of column names of the table, in lower case.
    pub(super) heading: String,
    /// Labels of the file, if it is from a spectral library.
    pub(super) library: Option<Library>,
    pub(in crate::formats) dialect: &'static str,
}

impl Table {
    /// Applies the test `said` to the row of column names and to the text around the table, both in lower case. Returns
    /// true if one of them passes.
    pub(in crate::formats) fn says(&self, said: impl Fn(&str) -> bool) -> bool {
        said(&self.prose) || said(&self.heading)
    }

    pub(super) fn reverse(&mut self) {
        let columns = self.names.len();
        self.values = self.values.chunks_exact(columns).rev().flatten().copied().collect();
        self.wavelengths.reverse();
    }

    /// Keeps one column of values, chosen by its name or by its number from 1.
    pub(in crate::formats) fn pick(&mut self, wanted: &str) -> Result<(), FormatError> {
        let wanted = wanted.trim();
        let columns = self.names.len();
        let by_name = |same: fn(&str, &str) -> bool| self.names.iter().position(|name| same(name, wanted));
        let by_number = || wanted.parse().ok().filter(|n| (1..=columns).contains(n)).map(|n| n - 1);
        let picked = by_name(|a, b| a == b)
            .or_else(|| by_name(str::eq_ignore_ascii_case))
            .or_else(by_number)
            .ok_or_else(|| {
                let names = self.column_list();
                let message =
                    format!("no column {}, expected a number from 1 to {columns} or one of: {names}", snippet(wanted));
                FormatError::new(FormatErrorKind::NeedsOption, NAME, message)
            })?;
        self.values = self.values.chunks_exact(columns).map(|row| row[picked]).collect();
        self.names = vec![self.names.swap_remove(picked)];
        Ok(())
    }

    /// Returns the names of the first columns of values, for messages.
    pub(in crate::formats) fn column_list(&self) -> String {
        const SHOWN: usize = 8;
        let mut list = self.names.iter().take(SHOWN).map(|name| snippet(name)).collect::<Vec<_>>().join(", ");
        if self.names.len() > SHOWN {
            list.push_str(", …");
        }
        list
    }
}
