//! Nearest-neighbour search in a k-d tree with contiguous leaves (Bentley 1975, "Multidimensional binary search
//! trees").

use crate::numeric::wide;

/// Upper bound on the number of points of one leaf of the k-d tree. Raising it makes the tree smaller and compares more
/// points.
const LEAF: usize = 16;
/// Upper bound on the number of tree nodes that wait on the search stack: enough for repeated halves of `u32::MAX`
/// points.
const DEPTH: usize = 64;

/// K-d tree of points in `D` dimensions, split at medians along the widest extent and numbered from leaf to leaf. Equal
/// input gives an equal tree.
#[derive(Clone, Debug)]
pub(super) struct Tree<const D: usize> {
    /// Coordinates of the points, one column for each dimension, with padding for [`LEAF`] points.
    columns: [Vec<f64>; D],
    /// Nodes of the k-d tree, each before the nodes of its left and then of its right half.
    nodes: Vec<Node<D>>,
}

#[derive(Clone, Copy, Debug)]
struct Node<const D: usize> {
    /// Lower corner of the bounding box of the points in this node of the k-d tree: their smallest coordinate in each
    /// dimension.
    low: [f64; D],
    /// Upper corner of the bounding box of the points in this node of the k-d tree: their largest coordinate in each
    /// dimension.
    high: [f64; D],
    /// Index of this node's right child in the list of all nodes of the k-d tree; 0 for a leaf.
    right: u32,
    first: u32,
    count: u32,
}

/// Point that a search in a k-d tree finds: its squared distance from the place of the search, and its number in the
/// tree.
pub(super) type Found = (f64, u32);

/// Point to be inserted in a k-d tree: its coordinates, and its position in the list of points from which the tree is
/// built.
type Given<const D: usize> = ([f64; D], u32);

impl<const D: usize> Tree<D> {
    /// Creates a k-d tree. Also returns the input number of each point of the tree.
    pub(super) fn new(points: impl Iterator<Item = [f64; D]>) -> (Self, Vec<u32>) {
        let mut points: Vec<Given<D>> = points.zip(0..).collect();
        let mut nodes = Vec::with_capacity(points.len() / LEAF * 4 + 1);
        split(&mut points, 0, &mut nodes);
        let beyond = [0.0; LEAF];
        let columns = std::array::from_fn(|k| points.iter().map(|given| given.0[k]).chain(beyond).collect());
        (Self { columns, nodes }, points.into_iter().map(|given| given.1).collect())
    }

    pub(super) fn len(&self) -> usize {
        self.columns[0].len() - LEAF
    }

    /// Returns coordinate number `k` (0 to `D` − 1) of all points in the k-d tree, in the order of the tree.
    pub(super) fn column(&self, k: usize) -> &[f64] {
        &self.columns[k][..self.len()]
    }

    /// Returns the coordinates of one point of the k-d tree; points are numbered from leaf to leaf.
    pub(super) fn point(&self, item: u32) -> [f64; D] {
        std::array::from_fn(|k| self.columns[k][item as usize])
    }

    /// Adds to `found` all points that `wanted` accepts within distance √`square` of `centre`. Points in `found` are
    /// numbered from `first`.
    pub(super) fn within(
        &self,
        (centre, first): (&[f64; D], u32),
        square: f64,
        wanted: impl Fn(u32) -> bool,
        found: &mut Vec<Found>,
    ) {
        self.search((centre, first), square, wanted, found, |_, square| square);
    }

    /// Keeps in `found` the `count` points nearest to `centre`, of those already there and those that `wanted` accepts.
    /// Points are numbered from `first`; the lower number wins ties. The farthest point comes first, the others are
    /// unordered.
    pub(super) fn nearest(
        &self,
        (centre, first): (&[f64; D], u32),
        count: usize,
        wanted: impl Fn(u32) -> bool,
        found: &mut Vec<Found>,
    ) {
        let limit = if found.len() >= count { keep(found, count) } else { f64::INFINITY };
        self.search((centre, first), limit, wanted, found, |found, limit| {
            if limit.is_infinite() {
                let farthest = found.iter().fold(0.0, |most, near| if near.0 > most { near.0 } else { most });
                if found.len() >= count { farthest } else { limit }
            } else if found.len() >= 2 * count.max(LEAF) {
                keep(found, count)
            } else {
                limit
            }
        });
        keep(found, count);
    }

    /// Adds to `found` the points of the k-d tree within a squared distance `limit` of `centre`; nearer leaves are
    /// searched first. After each leaf, `lower` returns the limit for the next ones.
    fn search(
        &self,
        (centre, first): (&[f64; D], u32),
        mut limit: f64,
        wanted: impl Fn(u32) -> bool,
        found: &mut Vec<Found>,
        lower: impl Fn(&mut Vec<Found>, f64) -> f64,
    ) {
        // Nodes with the squared distances to their boxes.
        let mut stack = [(0.0, 0_u32); DEPTH];
        let mut depth = usize::from(self.len() > 0);
        wide(
            #[inline(always)]
            || {
                while depth > 0 {
                    depth -= 1;
                    let (square, at) = stack[depth];
                    if square > limit {
                        continue;
                    }
                    let node = &self.nodes[at as usize];
                    if node.right == 0 {
                        self.look(node, (centre, first), limit, &wanted, found);
                        limit = lower(found, limit);
                        continue;
                    }
                    let left = (self.nodes[at as usize + 1].distance(centre), at + 1);
                    let right = (self.nodes[node.right as usize].distance(centre), node.right);
                    // The nearer child goes on top.
                    (stack[depth], stack[depth + 1]) = if left.0 < right.0 { (right, left) } else { (left, right) };
                    depth += 2;
                }
            },
        );
    }

    /// Adds to `found` the points in one leaf of the k-d tree that lie within a squared distance `limit` of `centre`
    /// and that `wanted` accepts.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
    fn look(
        &self,
        leaf: &Node<D>,
        (centre, first): (&[f64; D], u32),
        limit: f64,
        wanted: &impl Fn(u32) -> bool,
        found: &mut Vec<Found>,
    ) {
        let mut squares = [0.0; LEAF];
        for (column, &centre) in self.columns.iter().zip(centre) {
            let Some(column) = column[leaf.first as usize..].first_chunk::<LEAF>() else { return };
            for (square, &x) in squares.iter_mut().zip(column) {
                *square += (x - centre) * (x - centre);
            }
        }
        let mut near = [(0.0, 0); LEAF];
        let mut count = 0;
        for (square, item) in squares.into_iter().zip(leaf.first..leaf.first + leaf.count) {
            near[count] = (square, first + item);
            count += usize::from(square <= limit);
        }
        for &near in &near[..count] {
            if wanted(near.1) {
                found.push(near);
            }
        }
    }
}

impl<const D: usize> Node<D> {
    /// Returns the squared distance from the point `centre` to the bounding box of this node of the k-d tree; 0 inside.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
    fn distance(&self, centre: &[f64; D]) -> f64 {
        let mut sum = 0.0;
        for ((&low, &high), &x) in self.low.iter().zip(&self.high).zip(centre) {
            let (below, above) = (low - x, x - high);
            let beyond = if below > above { below } else { above };
            let beyond = if beyond > 0.0 { beyond } else { 0.0 };
            sum += beyond * beyond;
        }
        sum
    }
}

/// Shortens `found` to the `count` points nearest to the place of the search, the farthest of them first. Returns the
/// squared distance of the farthest one.
fn keep(found: &mut Vec<Found>, count: usize) -> f64 {
    let Some(last) = count.min(found.len()).checked_sub(1) else {
        found.clear();
        return f64::INFINITY;
    };
    found.select_nth_unstable_by_key(last, nearness);
    found.truncate(last + 1);
    found.swap(0, last);
    found[0].0
}

/// Returns the sort key of a found point: by distance, then by number. Squared distances are not negative, so their
/// bits sort like the numbers.
#[inline]
pub(super) fn nearness(found: &Found) -> (u64, u32) {
    (found.0.to_bits(), found.1)
}

/// Returns the squared distance between two points.
#[inline]
pub(super) fn distance<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    let mut sum = 0.0;
    for k in 0..D {
        sum += (a[k] - b[k]) * (a[k] - b[k]);
    }
    sum
}

fn split<const D: usize>(points: &mut [Given<D>], first: u32, nodes: &mut Vec<Node<D>>) {
    let (mut low, mut high) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
    for (point, _) in &*points {
        for (k, &x) in point.iter().enumerate() {
            low[k] = if x < low[k] { x } else { low[k] };
            high[k] = if x > high[k] { x } else { high[k] };
        }
    }
    let at = nodes.len();
    nodes.push(Node { low, high, right: 0, first, count: points.len() as u32 });
    if points.len() <= LEAF {
        return;
    }
    let extent = |axis: usize| high[axis] - low[axis];
    let axis = (1..D).fold(0, |best, k| if extent(k) > extent(best) { k } else { best });
    let middle = points.len() / 2;
    points.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    let (left, right) = points.split_at_mut(middle);
    split(left, first, nodes);
    nodes[at].right = nodes.len() as u32;
    split(right, first + middle as u32, nodes);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud(n: usize) -> Vec<[f64; 3]> {
        let step = [0.754_877_666_246_693, 0.569_840_290_998_053, 0.438_579];
        (0..n).map(|i| step.map(|s| ((0.5 + i as f64 * s).fract() * 64.0).round() / 64.0)).collect()
    }

    #[test]
    fn the_nearest_are_those_of_a_full_search() {
        // Rounded coordinates: many points are equally far.
        let given = cloud(777);
        let (tree, order) = Tree::new(given.iter().copied());
        let points: Vec<[f64; 3]> = order.iter().map(|&place| given[place as usize]).collect();
        assert!(tree.len() == 777 && (0..).zip(&points).all(|(item, point)| tree.point(item) == *point));
        let (mut found, mut inside) = (Vec::new(), Vec::new());
        for centre in cloud(40).iter().chain(&[[2.0, -1.0, 0.5]]) {
            let mut all: Vec<Found> =
                (10..).zip(&points).map(|(i, p)| (distance(p, centre), i)).filter(|f| f.1 % 3 != 1).collect();
            all.sort_unstable_by_key(nearness);
            found.clear();
            tree.nearest((centre, 10), 50, |item| item % 3 != 1, &mut found);
            assert_eq!(found[0], all[49]);
            found.sort_unstable_by_key(nearness);
            assert_eq!(found, all[..50]);
            // Points found before are kept if they are nearer.
            let mut more = vec![(all[20].0, 9), (9.0, 8)];
            tree.nearest((centre, 10), 22, |item| item % 3 != 1, &mut more);
            more.sort_unstable_by_key(nearness);
            assert!(more.len() == 22 && more.contains(&(all[20].0, 9)) && more[21] == all[20]);
            inside.clear();
            tree.within((centre, 10), all[60].0, |item| item % 3 != 1, &mut inside);
            inside.sort_unstable_by_key(nearness);
            assert_eq!(inside, all[..all.iter().filter(|near| near.0 <= all[60].0).count()]);
        }
        found.clear();
        tree.nearest((&[0.0; 3], 0), 1000, |_| true, &mut found);
        assert_eq!(found.len(), 777);
    }

    #[test]
    fn one_place_and_no_place_are_trees() {
        let (tree, _) = Tree::new([[1.0, 2.0]; 100].into_iter());
        let mut found = Vec::new();
        tree.nearest((&[1.0, 2.0], 0), 3, |_| true, &mut found);
        found.sort_unstable_by_key(nearness);
        assert_eq!(found, [(0.0, 0), (0.0, 1), (0.0, 2)]);
        let (none, _) = Tree::<2>::new(std::iter::empty());
        found.clear();
        none.nearest((&[0.0; 2], 0), 3, |_| true, &mut found);
        none.within((&[0.0; 2], 0), 1.0, |_| true, &mut found);
        assert!(found.is_empty());
    }
}
