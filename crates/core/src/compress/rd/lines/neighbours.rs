//! Neighbours of a node in a product of lines, as offsets into an array with one extra place for missing nodes.

use super::grid::AXES;
use std::ops::Range;

/// Offset of a missing neighbour: added to other offsets it lies beyond every array.
const NOWHERE: u32 = 1 << 29;
/// Upper bound on the distance, in nodes along one axis, of the neighbours from which a grid node is predicted and
/// coded.
const REACH: usize = 2;
const DISTANCES: usize = 2 * REACH + 1;

/// Distance of a neighbour in nodes along each axis of a grid.
pub(super) type Distance = [i8; AXES];

/// Returns the distance from a grid node to a neighbour, in nodes along each axis. `parts` lists pairs of an axis and a
/// number of nodes along it; along the other axes the distance is 0.
pub(super) fn distance(parts: &[(usize, i8)]) -> Distance {
    let mut distance = [0; AXES];
    for &(axis, by) in parts {
        distance[axis] += by;
    }
    distance
}

/// Nodes of a grid in row-major order, with tables for finding their neighbours.
#[derive(Debug)]
pub(super) struct Places {
    /// Number of nodes along each axis, or of places if nodes take turns (see [`Recent`]).
    pub(super) lengths: [usize; AXES],
    /// Parts of the row-major index of a neighbouring grid node (direction or block of merged directions), one for each
    /// axis, which are added up.
    ///
    /// `[axis][distance][coordinate]` is for a node at this coordinate of the axis and a neighbour −2 … 2 nodes away
    /// along it.
    tables: [[Vec<u32>; DISTANCES]; AXES],
}

impl Places {
    /// Builds the nodes of a grid with these axis lengths; where an axis `wraps`, its last node is next to its first.
    pub(super) fn new(lengths: [usize; AXES], wraps: [bool; AXES]) -> Self {
        Self::taking_turns(lengths, wraps, lengths)
    }

    /// Builds the nodes of a grid, of which those that are `turns` nodes apart along an axis have the same place.
    fn taking_turns(lengths: [usize; AXES], wraps: [bool; AXES], turns: [usize; AXES]) -> Self {
        let tables = std::array::from_fn(|axis| {
            let n = lengths[axis] as isize;
            let stride = turns[axis + 1..].iter().product::<usize>() as u32;
            let place = |at: isize| at.rem_euclid(n) as u32 % turns[axis] as u32 * stride;
            std::array::from_fn(|d| {
                let by = d as isize - REACH as isize;
                let offset = |at: isize| if !wraps[axis] && !(0..n).contains(&at) { NOWHERE } else { place(at) };
                (0..n).map(|q| offset(q + by)).collect()
            })
        });
        Self { lengths: turns, tables }
    }

    /// Returns the number of grid nodes. An array by node has one more element, for missing neighbours, at this index.
    pub(super) fn count(&self) -> usize {
        self.lengths.iter().product()
    }

    /// Number of rows of grid nodes, each parallel to the last axis: the product of the lengths of all other axes.
    pub(super) fn rows(&self) -> usize {
        self.lengths[..AXES - 1].iter().product()
    }

    /// Returns the coordinates, on all axes but the last, that the nodes of row number `row` of the grid share.
    pub(super) fn coordinates(&self, row: usize) -> [usize; AXES - 1] {
        let mut rest = row;
        let mut coordinates = [0; AXES - 1];
        for axis in (0..AXES - 1).rev() {
            coordinates[axis] = rest % self.lengths[axis];
            rest /= self.lengths[axis];
        }
        coordinates
    }

    /// Neighbours at a given distance from each node of a row of grid nodes. The row runs along the last axis;
    /// `coordinates` are its place on the other axes.
    pub(super) fn along(&self, coordinates: [usize; AXES - 1], distance: Distance) -> Along {
        let first = (0..AXES - 1).map(|axis| self.tables[axis][index(distance[axis])][coordinates[axis]]).sum();
        Along { first, last: index(distance[AXES - 1]) as u32 }
    }

    /// Returns the parts of row-major indices that stand for neighbours −2 … 2 nodes away along the last axis, for each
    /// coordinate on it.
    pub(super) fn last_axis(&self) -> Vec<[u32; DISTANCES]> {
        let tables = &self.tables[AXES - 1];
        (0..self.lengths[AXES - 1]).map(|x| std::array::from_fn(|d| tables[d][x])).collect()
    }
}

/// Places of numbers by node that serve while a grid is passed in row-major order, and of which a node reads those of
/// its own slice and of the two slices before it. A slice holds the nodes with one coordinate on the grid's first axis
/// of more than one node.
///
/// If that axis is long, three slices have places, which all slices take in turn: the errors of predictions at all
/// nodes would take twice the memory of a channel's samples.
#[derive(Debug)]
pub(super) struct Recent {
    /// Places of the slices; its `rows` and `coordinates` do not apply to the grid.
    places: Places,
    /// Number of leading axes that tell slices apart; 0 if all nodes have places of their own.
    leading: usize,
}

impl Recent {
    /// Builds the places for a grid with these axis lengths, of which `first` is the first axis that had more than one
    /// node before any were merged; where an axis `wraps`, its last node is next to its first.
    pub(super) fn new(lengths: [usize; AXES], mut wraps: [bool; AXES], first: usize) -> Self {
        let mut turns = lengths;
        let mut leading = 0;
        // Rows run along the last axis. On a circle of one or two nodes, the node before another may be the same.
        if first < AXES - 1 && lengths[first] > 2 * REACH {
            // Before the first nodes of a circle lie its last ones, which are not coded yet.
            wraps[first] = false;
            turns[first] = REACH + 1;
            leading = first + 1;
        }
        Self { places: Places::taking_turns(lengths, wraps, turns), leading }
    }

    /// Returns the number of places. An array of numbers has one more element, for missing neighbours, at this index.
    pub(super) fn count(&self) -> usize {
        self.places.count()
    }

    /// Neighbours at a given distance from each node of a row of grid nodes, as in [`Places::along`].
    pub(super) fn along(&self, coordinates: [usize; AXES - 1], distance: Distance) -> Along {
        self.places.along(coordinates, distance)
    }

    /// Place of the first node of a row of grid nodes; `coordinates` are the row's place on all axes but the last.
    pub(super) fn row(&self, coordinates: [usize; AXES - 1]) -> usize {
        self.along(coordinates, [0; AXES]).first as usize
    }

    /// Returns the places to be cleared before a row of grid nodes is coded: those of a slice before its first row,
    /// `None` before its other rows.
    pub(super) fn cleared_before(&self, coordinates: [usize; AXES - 1]) -> Option<Range<usize>> {
        let is_first = coordinates[self.leading..].iter().all(|&at| at == 0);
        let count = self.places.lengths[self.leading..].iter().product::<usize>();
        is_first.then(|| self.row(coordinates)).map(|row| row..row + count)
    }
}

fn index(distance: i8) -> usize {
    (isize::from(distance) + REACH as isize) as usize
}

/// Neighbours of the nodes of one grid row, each at the same offset (in nodes along each axis) from its node.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Along {
    first: u32,
    last: u32,
}

impl Along {
    /// Row-major index of a neighbour of a grid node (direction or block of merged directions). It is `nowhere`, the
    /// number of nodes, if there is no such neighbour.
    ///
    /// `offsets` holds the parts of the index that depend on the last coordinate, for neighbours −2 … 2 nodes away.
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
    fn numbers_are_recent_where_nodes_before_them_have_places() {
        for (lengths, first) in [([1, 7, 3, 4], 1), ([9, 2, 1, 5], 0), ([1, 3, 6, 4], 1), ([1, 1, 1, 6], 3)] {
            let wraps = [true; AXES];
            let (all, recent) = (Places::new(lengths, wraps), Recent::new(lengths, wraps, first));
            let last = all.last_axis();
            let mut held = vec![0; recent.count() + 1];
            let mut known = Vec::new();
            // Twice, as for two channels one after the other.
            for number in (0..all.rows()).chain(0..all.rows()) {
                if number == 0 {
                    known = vec![0; all.count() + 1];
                }
                let coordinates = all.coordinates(number);
                if let Some(places) = recent.cleared_before(coordinates) {
                    held[places].fill(0);
                }
                for (x, offsets) in last.iter().enumerate() {
                    for parts in [[(first, -1), (3, 0)], [(first, -2), (3, 1)], [(2, 1), (3, -1)], [(2, -2), (3, 2)]] {
                        let distance = distance(&parts);
                        let one = known[all.along(coordinates, distance).at(offsets, all.count())];
                        let two = held[recent.along(coordinates, distance).at(offsets, recent.count())];
                        assert_eq!(one, two, "{lengths:?} {coordinates:?} {x} {parts:?}");
                    }
                    let node = number * last.len() + x;
                    known[node] = node + 1;
                    held[recent.row(coordinates) + x] = node + 1;
                }
            }
        }
    }

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
