//! Neighbours of a node in a product of lines, as offsets into an array with one extra place for missing nodes.

use super::grid::AXES;

/// Offset of a missing node: added to other offsets it lies beyond every array.
const NOWHERE: u32 = 1 << 29;
/// Largest distance along an axis.
const REACH: usize = 2;
const DISTANCES: usize = 2 * REACH + 1;

/// Distance in nodes along each axis.
pub(super) type Distance = [i8; AXES];

/// Builds a distance from its components along axes.
pub(super) fn distance(parts: &[(usize, i8)]) -> Distance {
    let mut distance = [0; AXES];
    for &(axis, by) in parts {
        distance[axis] += by;
    }
    distance
}

/// Nodes of a product of lines, row-major.
#[derive(Debug)]
pub(super) struct Places {
    pub(super) lengths: [usize; AXES],
    /// Offsets of the node at a distance along an axis: `[axis][distance][coordinate]`.
    tables: [[Vec<u32>; DISTANCES]; AXES],
}

impl Places {
    /// Nodes of lines of these lengths; where an axis `wraps`, its last node is next to its first.
    pub(super) fn new(lengths: [usize; AXES], wraps: [bool; AXES]) -> Self {
        let tables = std::array::from_fn(|axis| {
            let n = lengths[axis] as isize;
            let stride = lengths[axis + 1..].iter().product::<usize>() as u32;
            std::array::from_fn(|d| {
                let by = d as isize - REACH as isize;
                let offset = |at: isize| {
                    if !wraps[axis] && !(0..n).contains(&at) { NOWHERE } else { at.rem_euclid(n) as u32 * stride }
                };
                (0..n).map(|q| offset(q + by)).collect()
            })
        });
        Self { lengths, tables }
    }

    /// Number of nodes, which is also the offset of the place for missing nodes.
    pub(super) fn count(&self) -> usize {
        self.lengths.iter().product()
    }

    /// Number of rows along the last axis.
    pub(super) fn rows(&self) -> usize {
        self.lengths[..AXES - 1].iter().product()
    }

    /// Coordinates of a row on all axes but the last.
    pub(super) fn coordinates(&self, row: usize) -> [usize; AXES - 1] {
        let mut rest = row;
        let mut coordinates = [0; AXES - 1];
        for axis in (0..AXES - 1).rev() {
            coordinates[axis] = rest % self.lengths[axis];
            rest /= self.lengths[axis];
        }
        coordinates
    }

    /// Nodes at a distance from the nodes of a row.
    pub(super) fn along(&self, coordinates: [usize; AXES - 1], distance: Distance) -> Along {
        let first = (0..AXES - 1).map(|axis| self.tables[axis][index(distance[axis])][coordinates[axis]]).sum();
        Along { first, last: index(distance[AXES - 1]) as u32 }
    }

    /// Offsets at each distance along the last axis, for each coordinate on it.
    pub(super) fn last_axis(&self) -> Vec<[u32; DISTANCES]> {
        let tables = &self.tables[AXES - 1];
        (0..self.lengths[AXES - 1]).map(|x| std::array::from_fn(|d| tables[d][x])).collect()
    }
}

fn index(distance: i8) -> usize {
    (isize::from(distance) + REACH as isize) as usize
}

/// Nodes at one distance from the nodes of a row.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Along {
    first: u32,
    last: u32,
}

impl Along {
    /// Index of the node with these offsets along the last axis; `nowhere` if it does not exist.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
    pub(super) fn at(self, offsets: &[u32; DISTANCES], nowhere: usize) -> usize {
        ((self.first + offsets[self.last as usize]) as usize).min(nowhere)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_exist_inside_and_around_circles() {
        let places = Places::new([1, 2, 3, 4], [false, false, true, false]);
        let last = places.last_axis();
        let at = |row: usize, x: usize, parts: &[(usize, i8)]| {
            places.along(places.coordinates(row), distance(parts)).at(&last[x], places.count())
        };
        assert_eq!((places.count(), places.rows()), (24, 6));
        for row in 0..6 {
            for x in 0..4 {
                assert_eq!(at(row, x, &[]), 4 * row + x);
                assert_eq!(at(row, x, &[(3, -1)]), if x == 0 { 24 } else { 4 * row + x - 1 });
                assert_eq!(at(row, x, &[(2, 1)]), row / 3 * 12 + (row + 1) % 3 * 4 + x);
                assert_eq!(at(row, x, &[(1, 2), (2, 1)]), 24);
            }
        }
        assert_eq!(at(0, 1, &[(1, 1), (3, 2)]), 12 + 3);
    }
}
