//! Spectra of a tensor that repeat those of other directions.

use super::lattice::Lattice;

/// Which spectra of a tensor are equal. A row is the spectrum of any pair of an incoming and an outgoing direction, a
/// leaf one of those that are left after repeated angles are dropped.
pub(super) struct Repeats {
    rows: usize,
    leaves: usize,
    /// For each row the leaf that has its samples, and for each leaf the first row that has them. `None` if every row
    /// is the leaf of its number: both lists take as much memory as two samples of each spectrum.
    lists: Option<[Vec<u32>; 2]>,
}

impl Repeats {
    /// Finds which spectra the tensor of a lattice repeats.
    pub(super) fn of(lattice: &Lattice) -> Self {
        let of_rows = lattice.rows();
        let (rows, leaves) = (of_rows.len(), lattice.leaves());
        let has_none = rows == leaves && of_rows.iter().enumerate().all(|(row, &leaf)| leaf as usize == row);
        let lists = (!has_none).then(|| {
            let first = lattice.first_rows(&of_rows);
            [of_rows, first]
        });
        Self { rows, leaves, lists }
    }

    /// Returns true unless every row is the leaf of its number.
    pub(super) fn are_any(&self) -> bool {
        self.lists.is_some()
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    pub(super) fn leaves(&self) -> usize {
        self.leaves
    }

    /// Number of the leaf that has the samples of a row.
    pub(super) fn leaf(&self, row: usize) -> usize {
        self.lists.as_ref().map_or(row, |[leaves, _]| leaves[row] as usize)
    }

    /// Number of the first row that has the samples of a leaf. A copy within a pole has none and takes that of the leaf
    /// before it.
    pub(super) fn first_row(&self, leaf: usize) -> usize {
        self.lists.as_ref().map_or(leaf, |[_, rows]| rows[leaf] as usize)
    }

    /// Returns true unless a leaf is a copy within a pole, which no row takes.
    pub(super) fn is_own(&self, leaf: usize) -> bool {
        self.leaf(self.first_row(leaf)) == leaf
    }
}
