//! Points by nearness: a k-d tree whose leaves are contiguous (Bentley 1975, "Multidimensional binary search trees").

/// Points of one leaf at most.
const LEAF: usize = 16;

/// Points in `D` dimensions, split at medians along their widest extent; equal input gives the equal tree.
#[derive(Clone, Debug)]
pub(super) struct Tree<const D: usize> {
    points: Vec<[f64; D]>,
    /// The number that each point had.
    items: Vec<u32>,
    /// In preorder.
    nodes: Vec<Node>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    axis: u8,
    split: f64,
    /// The right child; 0 for a leaf.
    right: u32,
    first: u32,
    count: u32,
}

/// A point found: the square of its distance, and its number.
pub(super) type Found = (f64, u32);

impl<const D: usize> Tree<D> {
    pub(super) fn new(points: &[[f64; D]]) -> Self {
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        let mut nodes = Vec::with_capacity(points.len() / LEAF * 4 + 1);
        split(points, &mut order, 0, &mut nodes);
        let sorted = order.iter().map(|&item| points[item as usize]).collect();
        Self { points: sorted, items: order, nodes }
    }

    /// All points within the root of `square` of `centre`, in the order of the tree.
    pub(super) fn within(&self, centre: &[f64; D], square: f64, found: &mut Vec<Found>) {
        found.clear();
        let mut stack = [0_u32; 64];
        let mut depth = usize::from(!self.points.is_empty());
        let radius = square.sqrt();
        while depth > 0 {
            depth -= 1;
            let at = stack[depth];
            let node = self.nodes[at as usize];
            if node.right == 0 {
                for i in node.first as usize..(node.first + node.count) as usize {
                    let distance = distance(&self.points[i], centre);
                    if distance <= square {
                        found.push((distance, self.items[i]));
                    }
                }
                continue;
            }
            let offset = centre[usize::from(node.axis)] - node.split;
            if offset >= -radius {
                stack[depth] = node.right;
                depth += 1;
            }
            if offset <= radius {
                stack[depth] = at + 1;
                depth += 1;
            }
        }
    }

    /// The `count` points nearest to `centre` that `wanted` takes, of equally near ones those of lower number; the farthest first,
    /// the others in no order.
    pub(super) fn nearest(
        &self,
        centre: &[f64; D],
        count: usize,
        wanted: impl Fn(u32) -> bool,
        found: &mut Vec<Found>,
    ) {
        found.clear();
        if self.points.is_empty() || count == 0 {
            return;
        }
        let mut limit = f64::INFINITY;
        self.nearest_below(0, centre, count, &wanted, (found, &mut limit));
        keep(found, count);
    }

    /// Adds to `found` what is no farther than the root of `limit`, and lowers it as there is more than enough.
    fn nearest_below(
        &self,
        at: u32,
        centre: &[f64; D],
        count: usize,
        wanted: &impl Fn(u32) -> bool,
        (found, limit): (&mut Vec<Found>, &mut f64),
    ) {
        let node = self.nodes[at as usize];
        if node.right == 0 {
            for i in node.first as usize..(node.first + node.count) as usize {
                let distance = distance(&self.points[i], centre);
                if distance <= *limit && wanted(self.items[i]) {
                    found.push((distance, self.items[i]));
                }
            }
            if found.len() >= 2 * count.max(LEAF) || limit.is_infinite() && found.len() >= count {
                *limit = keep(found, count);
            }
            return;
        }
        let offset = centre[usize::from(node.axis)] - node.split;
        let (near, far) = if offset < 0.0 { (at + 1, node.right) } else { (node.right, at + 1) };
        self.nearest_below(near, centre, count, wanted, (found, limit));
        if offset * offset <= *limit {
            self.nearest_below(far, centre, count, wanted, (found, limit));
        }
    }
}

/// Keeps the nearest `count`, the farthest of them first; the square of its distance.
fn keep(found: &mut Vec<Found>, count: usize) -> f64 {
    let last = count.min(found.len()).saturating_sub(1);
    if found.is_empty() {
        return f64::INFINITY;
    }
    found.select_nth_unstable_by(last, by_distance);
    found.truncate(last + 1);
    found.swap(0, last);
    found[0].0
}

/// Nearest first, equally near ones by number.
pub(super) fn by_distance(a: &Found, b: &Found) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
}

#[inline]
pub(super) fn is_nearer(a: Found, b: Found) -> bool {
    a.0 < b.0 || a.0 == b.0 && a.1 < b.1
}

/// The square of the distance between two points.
#[inline]
pub(super) fn distance<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    let mut sum = 0.0;
    for k in 0..D {
        sum += (a[k] - b[k]) * (a[k] - b[k]);
    }
    sum
}

fn split<const D: usize>(points: &[[f64; D]], order: &mut [u32], first: u32, nodes: &mut Vec<Node>) {
    let at = nodes.len();
    nodes.push(Node { axis: 0, split: 0.0, right: 0, first, count: order.len() as u32 });
    if order.len() <= LEAF {
        return;
    }
    let (mut low, mut high) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
    for &item in &*order {
        for (k, &x) in points[item as usize].iter().enumerate() {
            low[k] = if x < low[k] { x } else { low[k] };
            high[k] = if x > high[k] { x } else { high[k] };
        }
    }
    let extent = |axis: usize| high[axis] - low[axis];
    let axis = (1..D).fold(0, |best, k| if extent(k) > extent(best) { k } else { best });
    let middle = order.len() / 2;
    let of = |item: u32| points[item as usize][axis];
    order.select_nth_unstable_by(middle, |&a, &b| of(a).total_cmp(&of(b)).then(a.cmp(&b)));
    nodes[at].axis = axis as u8;
    nodes[at].split = of(order[middle]);
    let (left, right) = order.split_at_mut(middle);
    split(points, left, first, nodes);
    nodes[at].right = nodes.len() as u32;
    split(points, right, first + middle as u32, nodes);
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
        // Rounded coordinates: many points are equally near.
        let points = cloud(777);
        let tree = Tree::new(&points);
        let (mut found, mut inside) = (Vec::new(), Vec::new());
        for centre in cloud(40).iter().chain(&[[2.0, -1.0, 0.5]]) {
            let mut all: Vec<Found> =
                (0..).zip(&points).map(|(i, p)| (distance(p, centre), i)).filter(|f| f.1 % 3 != 1).collect();
            all.sort_unstable_by(by_distance);
            tree.nearest(centre, 50, |item| item % 3 != 1, &mut found);
            assert_eq!(found[0], all[49]);
            found.sort_unstable_by(by_distance);
            assert_eq!(found, all[..50]);
            tree.within(centre, all[60].0, &mut inside);
            let expected = points.iter().filter(|p| distance(p, centre) <= all[60].0).count();
            assert_eq!(inside.len(), expected);
        }
        tree.nearest(&[0.0; 3], 1000, |_| true, &mut found);
        assert_eq!(found.len(), 777);
    }

    #[test]
    fn one_place_and_no_place_are_trees() {
        let tree = Tree::new(&[[1.0, 2.0]; 100]);
        let mut found = Vec::new();
        tree.nearest(&[1.0, 2.0], 3, |_| true, &mut found);
        found.sort_unstable_by(by_distance);
        assert_eq!(found, [(0.0, 0), (0.0, 1), (0.0, 2)]);
        let none = Tree::<2>::new(&[]);
        none.nearest(&[0.0; 2], 3, |_| true, &mut found);
        assert!(found.is_empty());
        none.within(&[0.0; 2], 1.0, &mut found);
        assert!(found.is_empty());
    }
}
