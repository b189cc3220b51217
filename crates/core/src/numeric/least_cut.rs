//! Labels of the nodes of a grid that disagree along the cheapest border: a minimum cut.
//!
//! The least cost of a cut is the greatest flow through a network of these costs (Ford and Fulkerson 1956). The flow is
//! found along shortest paths (Dinic 1970), in whole numbers, so that equal costs give equal labels on any machine.

use std::collections::VecDeque;

/// Number of axes of a grid.
pub(crate) const AXES: usize = 4;
/// Number of neighbours of a node: the next and the one before along each axis.
const SIDES: usize = 2 * AXES;
const UNREACHED: u32 = u32::MAX;
/// Largest number of steps for each node of a grid; borders that wind through half-decided noise take the most. Raising
/// it takes time.
const MOST_STEPS: u64 = 200;

/// Constraint on the label of a grid node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Node {
    /// No label: borders with this node cost nothing.
    Absent,
    /// Label that is given.
    Fixed(bool),
    /// Label that is chosen; true costs the stated amount by itself.
    Free(u32),
}

/// Calls `each(axis, a, b)` for every node `a` of a row-major grid and its next neighbour `b` along each axis.
pub(crate) fn for_each_pair(lengths: [usize; AXES], mut each: impl FnMut(usize, usize, usize)) {
    let count: usize = lengths.iter().product();
    for (axis, stride) in strides(lengths).into_iter().enumerate() {
        for a in (0..count).filter(|a| a / stride % lengths[axis] + 1 < lengths[axis]) {
            each(axis, a, a + stride);
        }
    }
}

/// Numbers of nodes from a node of a row-major grid to its next neighbour along each axis.
fn strides(lengths: [usize; AXES]) -> [usize; AXES] {
    std::array::from_fn(|axis| lengths[axis + 1..].iter().product())
}

/// Chooses the labels of the free nodes of a row-major grid so that their own costs and the costs of all borders
/// together are least. Between two neighbours along an axis with different labels there is a border, which costs the
/// entry of `borders` for the axis. Absent nodes get false, and so does a free one if both labels cost the same.
///
/// `None` if the search takes more than [`MOST_STEPS`] steps for each node.
pub(crate) fn least_cut(lengths: [usize; AXES], borders: [u32; AXES], nodes: &[Node]) -> Option<Vec<bool>> {
    let mut network = Network::new(lengths, borders, nodes);
    while network.find_distances() {
        network.push_shortest();
        if network.is_exhausted() {
            return None;
        }
    }
    let is_true = |(node, &distance): (&Node, &u32)| match node {
        Node::Absent => false,
        Node::Fixed(label) => *label,
        Node::Free(_) => distance != UNREACHED,
    };
    Some(nodes.iter().zip(&network.distances).map(is_true).collect())
}

/// Flow network of the free nodes. Given labels of their neighbours, and their own costs, are a source or a sink of
/// limited capacity at each node.
struct Network {
    strides: [usize; AXES],
    /// For each node, capacity that is left towards its next and its previous neighbour along each axis.
    left: Vec<[u32; SIDES]>,
    /// For each node, capacity that is left from the source (positive) or to the sink (negative).
    ends: Vec<i64>,
    /// Number of steps from the nearest node with capacity from the source; [`UNREACHED`] without a path.
    distances: Vec<u32>,
    /// First side of each node through which flow may still be pushed in this round.
    sides: Vec<u8>,
    /// Number of nodes visited so far.
    steps: u64,
}

impl Network {
    fn new(lengths: [usize; AXES], borders: [u32; AXES], nodes: &[Node]) -> Self {
        let mut left: Vec<[u32; SIDES]> = vec![[0; SIDES]; nodes.len()];
        let mut ends: Vec<i64> =
            nodes.iter().map(|node| if let Node::Free(cost) = node { -i64::from(*cost) } else { 0 }).collect();
        for_each_pair(lengths, |axis, a, b| {
            let border = borders[axis];
            let to = |label: bool| if label { i64::from(border) } else { -i64::from(border) };
            match (nodes[a], nodes[b]) {
                (Node::Free(_), Node::Free(_)) => {
                    left[a][2 * axis] = border;
                    left[b][2 * axis + 1] = border;
                }
                (Node::Free(_), Node::Fixed(label)) => ends[a] += to(label),
                (Node::Fixed(label), Node::Free(_)) => ends[b] += to(label),
                _ => {}
            }
        });
        let count = nodes.len();
        Self {
            strides: strides(lengths),
            left,
            ends,
            distances: vec![UNREACHED; count],
            sides: vec![0; count],
            steps: 0,
        }
    }

    fn is_exhausted(&self) -> bool {
        self.steps > MOST_STEPS * self.ends.len() as u64
    }

    fn neighbour(&self, node: usize, side: usize) -> usize {
        let stride = self.strides[side / 2];
        if side.is_multiple_of(2) { node + stride } else { node - stride }
    }

    /// Computes the distances of all nodes from the source; returns true if a path leads on to the sink.
    fn find_distances(&mut self) -> bool {
        let mut queue: VecDeque<usize> = (0..self.ends.len()).filter(|&node| self.ends[node] > 0).collect();
        self.steps += self.ends.len() as u64;
        self.distances.fill(UNREACHED);
        for &node in &queue {
            self.distances[node] = 0;
        }
        let mut reaches = false;
        while let Some(node) = queue.pop_front() {
            reaches |= self.ends[node] < 0;
            for side in 0..SIDES {
                if self.left[node][side] > 0 {
                    let next = self.neighbour(node, side);
                    if self.distances[next] == UNREACHED {
                        self.distances[next] = self.distances[node] + 1;
                        queue.push_back(next);
                    }
                }
            }
        }
        reaches
    }

    /// Pushes flow from the source to the sink along paths on which the distance grows at each step, until none is
    /// left.
    fn push_shortest(&mut self) {
        self.sides.fill(0);
        let mut path: Vec<(usize, usize)> = Vec::new();
        for first in 0..self.ends.len() {
            path.clear();
            let mut node = first;
            while self.ends[first] > 0 && !self.is_exhausted() {
                self.steps += 1;
                if self.ends[node] < 0 {
                    node = self.push(first, node, &mut path);
                    continue;
                }
                let ahead = (usize::from(self.sides[node])..SIDES).find(|&side| {
                    self.left[node][side] > 0
                        && self.distances[self.neighbour(node, side)] == self.distances[node].wrapping_add(1)
                });
                self.sides[node] = ahead.unwrap_or(SIDES) as u8;
                if let Some(side) = ahead {
                    path.push((node, side));
                    node = self.neighbour(node, side);
                } else if let Some((before, _)) = path.pop() {
                    // Nothing leads on from here: the path takes the next side of the node before.
                    self.sides[before] += 1;
                    node = before;
                } else {
                    break;
                }
            }
        }
    }

    /// Pushes as much flow as a path from `first` to `last` carries, and cuts the path off where no capacity is left.
    /// Returns its last node.
    fn push(&mut self, first: usize, last: usize, path: &mut Vec<(usize, usize)>) -> usize {
        let least = path.iter().map(|&(node, side)| i64::from(self.left[node][side])).min();
        self.steps += path.len() as u64;
        let flow = self.ends[first].min(-self.ends[last]).min(least.unwrap_or(i64::MAX));
        self.ends[first] -= flow;
        self.ends[last] += flow;
        let mut full = None;
        for (at, &(node, side)) in path.iter().enumerate() {
            let to = self.neighbour(node, side);
            self.left[node][side] -= flow as u32;
            self.left[to][side ^ 1] += flow as u32;
            if self.left[node][side] == 0 && full.is_none() {
                full = Some((at, node));
            }
        }
        if let Some((at, node)) = full {
            path.truncate(at);
            return node;
        }
        last
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::drawn::list;
    use arbtest::arbitrary::Unstructured;
    use arbtest::arbtest;

    /// Cost of labels: of the free nodes that are true, and of all borders.
    fn cost(lengths: [usize; AXES], borders: [u32; AXES], nodes: &[Node], labels: &[bool]) -> u64 {
        let own = nodes.iter().zip(labels).map(|(node, &label)| match node {
            Node::Free(cost) if label => u64::from(*cost),
            _ => 0,
        });
        let mut sum = own.sum();
        for_each_pair(lengths, |axis, a, b| {
            let both = nodes[a] != Node::Absent && nodes[b] != Node::Absent;
            sum += if both && labels[a] != labels[b] { u64::from(borders[axis]) } else { 0 };
        });
        sum
    }

    fn drawn(u: &mut Unstructured<'_>) -> arbtest::arbitrary::Result<Node> {
        Ok(match u.int_in_range(0..=7)? {
            0 => Node::Absent,
            1 | 2 => Node::Fixed(u.arbitrary()?),
            _ => Node::Free(u.int_in_range(0..=9)?),
        })
    }

    #[test]
    fn no_other_labels_cost_less() {
        arbtest(|u| {
            let lengths = *u.choose(&[[1, 1, 3, 4], [3, 1, 2, 2], [2, 2, 3, 1], [1, 1, 1, 9], [2, 2, 1, 3]])?;
            let borders: [u32; AXES] = [u.int_in_range(0..=6)?, u.int_in_range(0..=6)?, u.int_in_range(0..=6)?, 3];
            let count: usize = lengths.iter().product();
            let nodes = list(u, count..=count, drawn)?;
            let found = least_cut(lengths, borders, &nodes).unwrap();
            let fits = |labels: &[bool]| {
                nodes.iter().zip(labels).all(|(node, &label)| match node {
                    Node::Absent => !label,
                    Node::Fixed(fixed) => label == *fixed,
                    Node::Free(_) => true,
                })
            };
            assert!(fits(&found));
            let all = (0..1_u32 << count).map(|bits| (0..count).map(|k| bits >> k & 1 == 1).collect::<Vec<_>>());
            let least = all.filter(|labels| fits(labels)).map(|labels| cost(lengths, borders, &nodes, &labels)).min();
            assert_eq!(Some(cost(lengths, borders, &nodes, &found)), least);
            Ok(())
        });
    }

    #[test]
    fn a_notch_is_filled_and_a_spur_is_kept_short() {
        let row = |text: &str| {
            text.chars()
                .map(|c| match c {
                    '#' => Node::Fixed(true),
                    '.' => Node::Fixed(false),
                    _ => Node::Free(1),
                })
                .collect::<Vec<_>>()
        };
        let nodes = ["######", "##?###", "??????", "......"].map(row).concat();
        let labels = least_cut([1, 1, 4, 6], [4; AXES], &nodes).unwrap();
        let rows: Vec<String> =
            labels.chunks(6).map(|row| row.iter().map(|&label| if label { '#' } else { '.' }).collect()).collect();
        assert_eq!(rows, ["######", "######", "......", "......"]);
    }
}
