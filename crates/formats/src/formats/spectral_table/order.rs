//! Order of the rows of a table: equal rows once, unsorted rows sorted, ranges of several detectors joined.

use super::columns::is_ordered;
use super::table::Table;
use crate::formats::Overlap;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::FormatError;
use crate::formats::text::{Brief, Source};
use crate::notes::SpectrumNote;
use std::ops::Range;

/// Upper bound on the detectors of an instrument whose ranges follow each other. Raising it takes more unsorted tables
/// for several detectors.
const MOST_DETECTORS: usize = 5;
/// Number of rows of each detector at least.
const FEWEST_ROWS: usize = 3;
/// Number of rows that each of two detectors has in their common range at least; fewer are rows out of order.
const FEWEST_SHARED: usize = 2;

/// Sorts the rows of a table by increasing wavelength, in its own unit. Equal rows count once; the common ranges of
/// several detectors are joined by the rule `overlap`. One wavelength twice with other values is an error, and so are
/// wavelengths without an order unless `is_named` says that a name or the user states them.
pub(in crate::formats) fn restore(
    table: &mut Table,
    overlap: Option<Overlap>,
    is_named: bool,
    source: &Source,
    report: &mut ParseReport,
) -> Result<(), FormatError> {
    let n = table.wavelengths.len();
    let strictly =
        |rising: bool| table.wavelengths.array_windows().all(|[a, b]| if rising { a.0 < b.0 } else { a.0 > b.0 });
    if strictly(true) {
        return Ok(());
    }
    if strictly(false) {
        table.reorder(&(0..n).rev().collect::<Vec<_>>());
        return Ok(());
    }
    if !is_named {
        refuse_disorder(table, source)?;
    }
    let rising = table.wavelengths.array_windows().filter(|[a, b]| a.0 < b.0).count();
    let falling = table.wavelengths.array_windows().filter(|[a, b]| a.0 > b.0).count();
    if falling > rising {
        table.reorder(&(0..n).rev().collect::<Vec<_>>());
    }
    let repeated = table.drop_repeated();
    if repeated > 0 {
        report.note(SpectrumNote::RowsRepeated { rows: repeated });
    }
    refuse_within_run(table, source)?;
    let runs = runs(table);
    if are_detectors(table, &runs) {
        let rule = overlap.unwrap_or_default();
        let mut joined = table.part(&runs[0]);
        for run in &runs[1..] {
            let next = table.part(run);
            let (from, to) = (next.wavelengths[0].0, joined.wavelengths[joined.wavelengths.len() - 1].0);
            if shares_range(table, &runs, run) {
                report.note(SpectrumNote::DetectorsJoined { from: Brief(from), to: Brief(to), rule: rule.name() });
                joined = join(&joined, &next, rule);
            } else {
                joined = merge(&joined, &next);
            }
        }
        (table.wavelengths, table.values) = (joined.wavelengths, joined.values);
        return refuse_within_run(table, source);
    }
    if runs.len() == 1 {
        return Ok(());
    }
    let mut order: Vec<usize> = (0..table.wavelengths.len()).collect();
    order.sort_by(|&a, &b| table.wavelengths[a].0.total_cmp(&table.wavelengths[b].0));
    table.reorder(&order);
    refuse_within_run(table, source)?;
    report.note(SpectrumNote::RowsSorted);
    Ok(())
}

/// Refuses numbers that run neither way, which may be no wavelengths.
fn refuse_disorder(table: &Table, source: &Source) -> Result<(), FormatError> {
    let wavelengths: Vec<f64> = table.wavelengths.iter().map(|&(wavelength, _)| wavelength).collect();
    let turns = || {
        let steps = table.wavelengths.array_windows().map(|[a, b]| b.0 > a.0).collect::<Vec<_>>();
        steps.array_windows().position(|[a, b]| a != b).map_or(1, |at| at + 2)
    };
    if is_ordered(&wavelengths) {
        return Ok(());
    }
    let at = turns();
    let message = format!(
        "wavelength {} after {}, expected increasing or decreasing ones: sort the rows, or name the column of wavelengths \
         with wavelength_column",
        Brief(wavelengths[at]),
        Brief(wavelengths[at - 1])
    );
    Err(source.malformed(table.wavelengths[at].1, message))
}

/// Refuses neighbouring rows with one wavelength and other values.
fn refuse_within_run(table: &Table, source: &Source) -> Result<(), FormatError> {
    let Some([(wavelength, first), (_, second)]) = table.wavelengths.array_windows().find(|[a, b]| a.0 == b.0) else {
        return Ok(());
    };
    let (first, second) = (first.min(second), first.max(second));
    let message = format!(
        "wavelength {} twice with other values, here and at {}, expected each once: remove one of the rows, or put spectra \
         that follow each other into columns",
        Brief(*wavelength),
        source.position(*first)
    );
    Err(source.malformed(*second, message))
}

/// Returns the ranges of rows in which wavelengths rise.
fn runs(table: &Table) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    let mut start = 0;
    for (i, [a, b]) in table.wavelengths.array_windows().enumerate() {
        if b.0 <= a.0 {
            runs.push(start..i + 1);
            start = i + 1;
        }
    }
    runs.push(start..table.wavelengths.len());
    runs
}

/// Returns true if runs of rising wavelengths are the ranges of detectors: each begins and ends later than the one
/// before, and some share a range.
fn are_detectors(table: &Table, runs: &[Range<usize>]) -> bool {
    let wavelength = |row: usize| table.wavelengths[row].0;
    (2..=MOST_DETECTORS).contains(&runs.len())
        && runs.iter().all(|run| run.len() >= FEWEST_ROWS)
        && runs
            .array_windows()
            .all(|[a, b]| wavelength(a.start) < wavelength(b.start) && wavelength(a.end - 1) < wavelength(b.end - 1))
        && runs[1..].iter().any(|run| shares_range(table, runs, run))
}

/// Returns true if a run and the one before it share a range in which both have several rows.
fn shares_range(table: &Table, runs: &[Range<usize>], run: &Range<usize>) -> bool {
    let Some(before) = runs.iter().find(|before| before.end == run.start) else { return false };
    let wavelength = |row: usize| table.wavelengths[row].0;
    let range = wavelength(run.start)..=wavelength(before.end - 1);
    let shared = |run: &Range<usize>| run.clone().filter(|&row| range.contains(&wavelength(row))).count();
    shared(before) >= FEWEST_SHARED && shared(run) >= FEWEST_SHARED
}

/// Part of the rows of a table.
struct Part {
    wavelengths: Vec<(f64, usize)>,
    values: Vec<f32>,
    columns: usize,
}

impl Part {
    fn row(&self, at: usize) -> &[f32] {
        &self.values[at * self.columns..(at + 1) * self.columns]
    }

    fn push(&mut self, from: &Self, at: usize) {
        self.wavelengths.push(from.wavelengths[at]);
        self.values.extend_from_slice(from.row(at));
    }

    /// Returns the value of a column at a wavelength within the range of the rows, interpolated linearly.
    fn at(&self, wavelength: f64, column: usize) -> f64 {
        let after = self.wavelengths.partition_point(|(other, _)| *other < wavelength).min(self.wavelengths.len() - 1);
        let before = after.saturating_sub(usize::from(self.wavelengths[after].0 > wavelength));
        let (a, b) = (self.wavelengths[before].0, self.wavelengths[after].0);
        let share = if b > a { (wavelength - a) / (b - a) } else { 0.0 };
        let value = |row: usize| f64::from(self.row(row)[column]);
        if share == 0.0 { value(before) } else { value(before) + share * (value(after) - value(before)) }
    }
}

/// Joins the rows of two detectors that share no range, or hardly one: all rows, sorted.
fn merge(shorter: &Part, longer: &Part) -> Part {
    let mut order: Vec<(f64, bool, usize)> = Vec::new();
    for (part, is_longer) in [(shorter, false), (longer, true)] {
        order.extend(part.wavelengths.iter().enumerate().map(|(row, (wavelength, _))| (*wavelength, is_longer, row)));
    }
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut merged = Part { wavelengths: Vec::new(), values: Vec::new(), columns: shorter.columns };
    for (_, is_longer, row) in order {
        merged.push(if is_longer { longer } else { shorter }, row);
    }
    merged
}

/// Joins the rows of two detectors, whose ranges overlap.
fn join(shorter: &Part, longer: &Part, rule: Overlap) -> Part {
    let mut joined = Part { wavelengths: Vec::new(), values: Vec::new(), columns: shorter.columns };
    let (from, to) = (longer.wavelengths[0].0, shorter.wavelengths[shorter.wavelengths.len() - 1].0);
    let (ends, begins) = match rule {
        Overlap::Shorter => (f64::MAX, to),
        Overlap::Longer | Overlap::Mean => (from, f64::MIN),
    };
    for at in (0..shorter.wavelengths.len()).filter(|&at| shorter.wavelengths[at].0 < ends) {
        joined.push(shorter, at);
    }
    if rule == Overlap::Mean {
        let shared =
            |part: &Part| part.wavelengths.iter().filter(|(w, _)| (from..=to).contains(w)).copied().collect::<Vec<_>>();
        let mut places = [shared(shorter), shared(longer)].concat();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        places.dedup_by(|a, b| a.0 == b.0);
        for place in places {
            joined.wavelengths.push(place);
            let mean = |column| f64::midpoint(shorter.at(place.0, column), longer.at(place.0, column)) as f32;
            joined.values.extend((0..shorter.columns).map(mean));
        }
    }
    let begins = if rule == Overlap::Mean { to } else { begins };
    for at in (0..longer.wavelengths.len()).filter(|&at| longer.wavelengths[at].0 > begins) {
        joined.push(longer, at);
    }
    joined
}

impl Table {
    fn row(&self, at: usize) -> &[f32] {
        let columns = self.names.len();
        &self.values[at * columns..(at + 1) * columns]
    }

    fn part(&self, rows: &Range<usize>) -> Part {
        let columns = self.names.len();
        Part {
            wavelengths: self.wavelengths[rows.clone()].to_vec(),
            values: self.values[rows.start * columns..rows.end * columns].to_vec(),
            columns,
        }
    }

    /// Puts the rows into another order.
    pub(super) fn reorder(&mut self, order: &[usize]) {
        let mut values = Vec::with_capacity(order.len() * self.names.len());
        for &row in order {
            values.extend_from_slice(self.row(row));
        }
        self.values = values;
        self.wavelengths = order.iter().map(|&row| self.wavelengths[row]).collect();
    }

    /// Removes rows that repeat the row before, value for value, and returns their number.
    fn drop_repeated(&mut self) -> usize {
        let same = |a: usize, b: usize| {
            let equal = |(x, y): (&f32, &f32)| x == y || x.is_nan() && y.is_nan();
            self.wavelengths[a].0 == self.wavelengths[b].0 && self.row(a).iter().zip(self.row(b)).all(equal)
        };
        let n = self.wavelengths.len();
        let mut by_wavelength: Vec<usize> = (0..n).collect();
        by_wavelength.sort_by(|&a, &b| self.wavelengths[a].0.total_cmp(&self.wavelengths[b].0).then(a.cmp(&b)));
        let mut kept = vec![true; n];
        for pair in by_wavelength.array_windows() {
            let [a, b] = *pair;
            kept[b] = !same(a, b);
        }
        let rows: Vec<usize> = (0..n).filter(|&row| kept[row]).collect();
        let dropped = n - rows.len();
        if dropped > 0 {
            self.reorder(&rows);
        }
        dropped
    }
}

#[cfg(test)]
mod tests {
    use crate::formats::{Acquisition, FormatError, Interpretation, Overlap, Samples, read};

    fn found(rows: &[(f64, f64)], overlap: Option<Overlap>) -> Result<Acquisition, FormatError> {
        let rows: Vec<String> = rows.iter().map(|(w, v)| format!("{w},{v}")).collect();
        read(format!("nm,v\n{}\n", rows.join("\n")).as_bytes(), &Interpretation { overlap, ..Default::default() })
    }

    fn pairs(rows: &[(f64, f64)], overlap: Option<Overlap>) -> Vec<(f64, f32)> {
        let acquisition = found(rows, overlap).unwrap();
        let Samples::OnAxes { tensor, .. } = acquisition.samples else { panic!("on axes") };
        let [crate::domain::Axis::Wavelength(grid)] = tensor.axes() else { panic!("one axis") };
        grid.values().into_iter().zip(tensor.samples().iter().copied()).collect()
    }

    #[test]
    fn equal_rows_count_once_and_unsorted_ones_are_sorted() {
        let expected = vec![(400.0, 1.0), (410.0, 2.0), (420.0, 3.0), (430.0, 4.0)];
        for rows in [
            &[(400.0, 1.0), (410.0, 2.0), (410.0, 2.0), (420.0, 3.0), (430.0, 4.0)][..],
            &[(410.0, 2.0), (400.0, 1.0), (420.0, 3.0), (430.0, 4.0)],
            &[(400.0, 1.0), (420.0, 3.0), (410.0, 2.0), (430.0, 4.0)],
            &[(430.0, 4.0), (420.0, 3.0), (410.0, 2.0), (400.0, 1.0)],
            &[(420.0, 3.0), (430.0, 4.0), (400.0, 1.0), (410.0, 2.0), (420.0, 3.0)],
        ] {
            assert_eq!(pairs(rows, None), expected, "{rows:?}");
        }
        let error = found(&[(400.0, 1.0), (410.0, 2.0), (410.0, 3.0), (420.0, 3.0)], None).unwrap_err().to_string();
        assert!(error.contains("line 4") && error.contains("line 3") && error.contains("410 twice"), "{error}");
        // Two spectra one after the other are no ranges of detectors.
        assert!(
            found(&[(400.0, 1.0), (410.0, 2.0), (420.0, 3.0), (400.0, 2.0), (410.0, 3.0), (420.0, 4.0)], None).is_err()
        );
    }

    #[test]
    fn ranges_of_detectors_are_joined_by_the_rule() {
        let rows = [
            (400.0, 1.0),
            (500.0, 1.0),
            (600.0, 1.0),
            (700.0, 1.0), // first
            (550.0, 3.0),
            (600.0, 3.0),
            (650.0, 3.0),
            (750.0, 3.0),
            (850.0, 3.0), // second
            (800.0, 5.0),
            (840.0, 5.0),
            (900.0, 5.0), // third
        ];
        let three = pairs(&rows, None);
        assert_eq!(&three[4..], [(750.0, 3.0), (800.0, 5.0), (840.0, 5.0), (850.0, 3.0), (900.0, 5.0)]);
        let two = &rows[..9];
        let short = vec![(400.0, 1.0), (500.0, 1.0), (600.0, 1.0), (700.0, 1.0), (750.0, 3.0), (850.0, 3.0)];
        assert_eq!(pairs(two, None), short);
        assert_eq!(pairs(two, Some(Overlap::Shorter)), short);
        assert_eq!(
            pairs(two, Some(Overlap::Longer)),
            [(400.0, 1.0), (500.0, 1.0), (550.0, 3.0), (600.0, 3.0), (650.0, 3.0), (750.0, 3.0), (850.0, 3.0)]
        );
        assert_eq!(
            pairs(two, Some(Overlap::Mean)),
            [
                (400.0, 1.0),
                (500.0, 1.0),
                (550.0, 2.0),
                (600.0, 2.0),
                (650.0, 2.0),
                (700.0, 2.0),
                (750.0, 3.0),
                (850.0, 3.0)
            ]
        );
    }
}
