//! Values that stand for a missing one in files of instruments and libraries, such as -1.23e34 or -9999.

use super::table::Table;
use crate::formats::acquisition::ParseReport;
use crate::notes::SpectrumNote;

/// Magnitudes of numbers that files use for missing values. Each is masked in a column where it stands apart from the
/// other values.
const FILLS: [f32; 20] = [
    99.0,
    99.9,
    99.99,
    999.0,
    999.25,
    999.9,
    999.99,
    8888.0,
    9999.0,
    9999.9,
    9999.99,
    32767.0,
    32768.0,
    65535.0,
    88888.0,
    99999.0,
    99999.9,
    999_999.0,
    9_999_999.0,
    99_999_999.0,
];
/// Magnitude from which a number is no measurement: -1.23e34, 1e30 and the limits of float32 stand for missing values.
const UNPHYSICAL: f32 = 9.99e19;
/// Ratio to the largest other value from which one listed number is masked. Raising it keeps more of them.
const APART: f32 = 100.0;
/// Number of equal values from which a listed number outside the range of the others is masked.
const REPEATED: usize = 2;

fn is_fill(value: f32) -> bool {
    value.abs() >= UNPHYSICAL || FILLS.contains(&value.abs())
}

/// Masks values that stand for missing ones: a listed number that lies outside the range of the other values of its
/// column and occurs repeatedly, or exceeds them by a factor of 100.
pub(super) fn mask(table: &mut Table, report: &mut ParseReport) {
    let columns = table.names.len();
    let mut masked: Vec<(f32, usize)> = Vec::new();
    // Masked numbers lie outside the range of the others.
    let extremes = table.extremes();
    for column in (0..columns).filter(|&column| is_fill(extremes[column].0) || is_fill(extremes[column].1)) {
        let of_column = table.values.iter().skip(column).step_by(columns).copied().filter(|value| !value.is_nan());
        let (mut fills, others): (Vec<f32>, Vec<f32>) = of_column.partition(|&value| is_fill(value));
        let range = others.iter().fold((f32::MAX, f32::MIN), |(low, high), &value| (low.min(value), high.max(value)));
        fills.sort_by(f32::total_cmp);
        for equal in fills.chunk_by(|a, b| a == b).filter(|equal| stands_apart(equal[0], equal.len(), range)) {
            masked.push((equal[0], equal.len()));
            for value in table.values.iter_mut().skip(column).step_by(columns).filter(|value| **value == equal[0]) {
                *value = f32::NAN;
            }
        }
    }
    masked.sort_by(|a, b| a.0.total_cmp(&b.0));
    for fills in masked.chunk_by(|a, b| a.0 == b.0) {
        let values = fills.iter().map(|(_, count)| count).sum();
        report.note(SpectrumNote::FillsMasked { values, fill: fills[0].0 });
    }
}

/// Returns true if a number that occurs `count` times stands apart from the others of its column, which lie between
/// `low` and `high`.
fn stands_apart(fill: f32, count: usize, (low, high): (f32, f32)) -> bool {
    let largest = low.abs().max(high.abs());
    // A positive number just above the others may be the largest of them.
    let is_repeated = count >= REPEATED && (fill < 0.0 && low >= 0.0 || fill.abs() > 2.0 * largest);
    low <= high && !(low..=high).contains(&fill) && (fill.abs() > APART * largest || is_repeated)
}

#[cfg(test)]
mod tests {
    use crate::formats::{Interpretation, Samples, read};

    fn values(rows: &[&str]) -> Vec<f32> {
        let rows: Vec<String> = rows.iter().enumerate().map(|(i, value)| format!("{},{value}", 400 + 10 * i)).collect();
        let found = read(format!("nm,v\n{}\n", rows.join("\n")).as_bytes(), &Interpretation::default()).unwrap();
        let Samples::OnAxes { tensor, .. } = found.samples else { panic!("on axes") };
        tensor.samples().to_vec()
    }

    #[test]
    fn numbers_that_stand_for_nothing_are_masked_and_no_others() {
        for (rows, masked) in [
            (&["0.1", "-1.23e34", "0.2"][..], 1),
            (&["0.1", "-1.2300000E+034", "0.2"], 1),
            (&["0.1", "-9999", "-9999", "0.2"], 2),
            (&["0.1", "9999", "0.2"], 1),
            (&["0.1", "1e30", "0.2"], 1),
            (&["0.1", "3.4028235e38", "-1e20"], 2),
            (&["0.1", "-9999", "-999", "0.2"], 2),
            (&["5", "-999", "7", "-999", "6"], 2),
            // The largest of counts, and a value among the others.
            (&["9000", "9998", "9999", "9999", "8000"], 0),
            (&["20000", "9999", "9999", "5"], 0),
            (&["-99", "-98", "-99", "-97"], 0),
            (&["50", "-99", "40"], 0),
        ] {
            let found = values(rows);
            assert_eq!(found.iter().filter(|value| value.is_nan()).count(), masked, "{rows:?}");
        }
    }
}
