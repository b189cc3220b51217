//! Directions of the rows: the lattice that they form completely or nearly, or else the distinct directions.

use super::columns::Columns;
use super::header::Header;
use super::rows::{Numbered, Rows};
use std::collections::HashMap;

/// Directions `[theta_i, phi_i, theta_o, phi_o]` in a radiometric-csv file, in degrees. For each of the four angles, a
/// flag is true if the file has a column for it; that of `phi_i` is false for isotropic data.
pub(super) struct Directions {
    pub(super) written: Vec<[f64; 4]>,
    pub(super) present: [bool; 4],
    pub(super) isotropic: bool,
}

/// Grid of directions that combines every listed value of one angle with every value of the other angles.
#[derive(Clone)]
pub(super) struct Lattice {
    /// Increasing values in degrees of each angle, `[theta_i, phi_i, theta_o, phi_o]`; empty for an angle without a
    /// column.
    pub(super) angles: [Vec<f64>; 4],
    /// Number of distinct values of each angle in the grid, at least 1.
    pub(super) shape: [usize; 4],
    /// Index in the grid, in row-major order, of the direction in each row of the file.
    pub(super) places: Vec<usize>,
}

impl Lattice {
    /// Returns true if the grid contains a pole (theta 0 or 180) with several azimuths, which are all one direction.
    pub(super) fn has_poles(&self) -> bool {
        let is_pole = |&angle: &f64| angle == 0.0 || angle == 180.0;
        [(0, 1), (2, 3)].iter().any(|&(theta, phi)| self.shape[phi] > 1 && self.angles[theta].iter().any(is_pole))
    }
}

impl Directions {
    /// Creates the list of directions by moving them out of `rows`, the data rows of a file. Azimuths of isotropic data
    /// become relative to the incoming azimuth.
    pub(super) fn of(rows: &mut Rows, columns: &Columns, header: &Header) -> Self {
        let mut present = columns.angles.map(|angle| angle.is_some());
        let mut written = std::mem::take(&mut rows.directions);
        let isotropic = header.isotropic || header.quantity.directions() == 2 && !present[1];
        if isotropic && present[1] {
            for direction in &mut written {
                // Without a phi_o column there is no relative azimuth.
                if present[3] {
                    // Rounded, because the difference of two decimals has rounding errors.
                    let relative = ((direction[3] - direction[1]) * 1e9).round() / 1e9;
                    direction[3] = relative.rem_euclid(360.0);
                }
                direction[1] = 0.0;
            }
            present[1] = false;
        }
        // Removes the sign of negative zeros, so that both zeros are one angle.
        written.as_flattened_mut().iter_mut().for_each(|angle| *angle += 0.0);
        Self { written, present, isotropic }
    }

    /// Returns the grid that the directions form if it has at most `most` positions; `None` if they are scattered.
    pub(super) fn lattice(&self, most: usize) -> Option<Lattice> {
        let mut numbered: [Numbered; 4] = Default::default();
        let mut numbers: Vec<[u32; 4]> = Vec::with_capacity(self.written.len());
        let mut known = 0;
        for direction in &self.written {
            let mut row = [0; 4];
            for ((number, numbered), &angle) in row.iter_mut().zip(&mut numbered).zip(direction) {
                *number = numbered.number(angle);
            }
            numbers.push(row);
            let count: usize = numbered.iter().map(|numbered| numbered.values.len()).sum();
            if count > known {
                known = count;
                numbered
                    .iter()
                    .try_fold(1_usize, |n, angles| n.checked_mul(angles.values.len()))
                    .filter(|&n| n <= most)?;
            }
        }
        let ordered = numbered.map(|numbered| ranked(numbered.values.into_iter()));
        let shape = [0, 1, 2, 3].map(|k| ordered[k].0.len().max(1));
        let place = |row: [u32; 4]| {
            let ranks = row.iter().zip(&ordered).map(|(&number, (_, ranks))| ranks[number as usize] as usize);
            ranks.zip(shape).fold(0, |place, (rank, length)| place * length + rank)
        };
        let places = numbers.into_iter().map(place).collect();
        let mut angles = ordered.map(|(values, _)| values);
        for (values, present) in angles.iter_mut().zip(self.present) {
            if !present {
                values.clear();
            }
        }
        Some(Lattice { angles, shape, places })
    }

    /// Returns the distinct directions in order of appearance, and the index of each row's direction.
    pub(super) fn distinct(self) -> (Vec<[f64; 4]>, Vec<usize>) {
        if self.are_distinct() {
            let places = (0..self.written.len()).collect();
            return (self.written, places);
        }
        let mut known: HashMap<[u64; 4], usize> = HashMap::new();
        let mut distinct = Vec::new();
        let number = |direction: &[f64; 4]| {
            *known.entry(direction.map(f64::to_bits)).or_insert_with(|| {
                distinct.push(*direction);
                distinct.len() - 1
            })
        };
        let places = self.written.iter().map(number).collect();
        (distinct, places)
    }

    /// Returns true if no two directions are equal; a hash collision rarely gives false instead. Sorting hashes is
    /// faster than looking directions up.
    fn are_distinct(&self) -> bool {
        const ODD: u64 = 0x9E37_79B9_7F4A_7C15;
        let folded = |sum: u64, angle: &f64| {
            let product = u128::from(sum ^ angle.to_bits()) * u128::from(ODD);
            (product >> 64) as u64 ^ product as u64
        };
        let mut sums: Vec<u64> = self.written.iter().map(|direction| direction.iter().fold(ODD, folded)).collect();
        sums.sort_unstable();
        sums.array_windows().all(|[a, b]| a != b)
    }
}

/// Returns the distinct numbers in increasing order, and the index there of each given number.
pub(super) fn ranked(values: impl Iterator<Item = f64>) -> (Vec<f64>, Vec<u32>) {
    let values: Vec<f64> = values.collect();
    let mut sorted = values.clone();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    let ranks = values.iter().map(|v| sorted.partition_point(|s| s < v) as u32).collect();
    (sorted, ranks)
}
