//! Rows that are zero outside one run of columns: synthesis functions and analysis rows, flat in memory.

use crate::numeric::dense::{add, dot_by_four};

/// Matrix whose rows are stored only from their first to their last nonzero entry.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Windows {
    values: Vec<f64>,
    /// First stored column of each matrix row, and position of its first value in `values`. One more entry marks the
    /// end.
    rows: Vec<(u32, u32)>,
}

impl Windows {
    /// Creates the matrix from one list of (column, number) per row; columns of a row may come in any order, each once.
    pub(super) fn new(rows: impl Iterator<Item = Vec<(u32, f64)>>) -> Self {
        let mut windows = Self::default();
        for row in rows {
            let live = row.into_iter().filter(|(_, w)| *w != 0.0);
            let live: Vec<(u32, f64)> = live.collect();
            let first = live.iter().map(|(column, _)| *column).min().unwrap_or(0);
            let start = windows.values.len();
            windows.rows.push((first, start as u32));
            let width = live.iter().map(|(column, _)| column - first + 1).max().unwrap_or(0);
            windows.values.resize(start + width as usize, 0.0);
            for (column, w) in live {
                windows.values[start + (column - first) as usize] += w;
            }
        }
        windows.rows.push((0, windows.values.len() as u32));
        windows
    }

    /// Returns the number of rows of the matrix.
    pub(super) fn len(&self) -> usize {
        self.rows.len() - 1
    }

    /// Returns the first stored column of a matrix row and its numbers from that column on.
    pub(super) fn row(&self, row: usize) -> (usize, &[f64]) {
        let (first, start) = self.rows[row];
        (first as usize, &self.values[start as usize..self.rows[row + 1].1 as usize])
    }

    /// Returns the dot product of a matrix row with the vector `columns`.
    pub(super) fn times(&self, row: usize, columns: &[f64]) -> f64 {
        let (first, values) = self.row(row);
        dot_by_four(values, &columns[first..first + values.len()])
    }

    /// Adds `factor` times a matrix row to the vector `columns`.
    pub(super) fn add(&self, row: usize, factor: f64, columns: &mut [f64]) {
        let (first, values) = self.row(row);
        add(&mut columns[first..first + values.len()], factor, values);
    }

    /// Returns the largest absolute difference between the entries of two matrices with equally many rows.
    pub(super) fn distance(&self, other: &Self) -> f64 {
        let mut largest = 0.0_f64;
        for row in 0..self.len() {
            let ((a, left), (b, right)) = (self.row(row), other.row(row));
            let at = |first: usize, values: &[f64], i: usize| {
                i.checked_sub(first).and_then(|k| values.get(k)).copied().unwrap_or(0.0)
            };
            for i in a.min(b)..(a + left.len()).max(b + right.len()) {
                largest = largest.max((at(a, left, i) - at(b, right, i)).abs());
            }
        }
        largest
    }

    /// Returns the size in memory of the matrix in bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.values.as_slice()) + size_of_val(self.rows.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_kept_from_first_to_last() {
        let windows = Windows::new([vec![(4, 2.0), (2, 1.0), (7, 0.0)], vec![], vec![(0, 3.0)]].into_iter());
        assert_eq!(windows.len(), 3);
        assert_eq!(windows.row(0), (2, &[1.0, 0.0, 2.0][..]));
        assert_eq!(windows.row(1), (0, &[][..]));
        assert_eq!(windows.times(0, &[1.0, 1.0, 2.0, 3.0, 4.0]), 10.0);
        let mut sum = [0.0; 5];
        windows.add(0, 2.0, &mut sum);
        assert_eq!(sum, [0.0, 0.0, 2.0, 0.0, 4.0]);
        assert_eq!(windows.distance(&windows), 0.0);
        assert_eq!(windows.distance(&Windows::new([vec![(1, 5.0)], vec![], vec![(0, 3.0)]].into_iter())), 5.0);
    }
}
