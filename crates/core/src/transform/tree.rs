//! Tree of the coefficients of one axis: level and parent of each, and the order from coarse to fine.

use super::basis::AxisTransform;
use crate::domain::TriangleMesh;

/// Tree of the wavelet coefficients along one axis: levels, parents and an order from coarse to fine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AxisTree {
    /// Level of the coefficient at each index: 0 for smooth coefficients (and for all, if the axis is not transformed),
    /// 1 for the coarsest details, and so on.
    pub level: Vec<u8>,
    /// Parent of the coefficient at each index: the coefficient one level coarser whose support covers it; `None` at
    /// level 0.
    ///
    /// On a line, the parent of detail j is detail j / 2 of the next coarser level. On triangles, the parent of detail
    /// k of a node is detail k of the parent node. The parents of details of level 1 are smooth coefficients.
    pub parent: Vec<Option<u32>>,
    /// Indices of all wavelet coefficients along the axis, sorted by wavelet level, then by index.
    pub order: Vec<u32>,
    /// Positions in `order` at which the wavelet levels start: `order[starts[l]..starts[l + 1]]` are the indices of the
    /// coefficients of level `l`. There is one entry more than levels.
    pub starts: Vec<usize>,
}

impl AxisTree {
    /// Returns the number of levels of the tree of wavelet coefficients: the levels of details, and one level of smooth
    /// coefficients.
    pub fn levels(&self) -> usize {
        self.starts.len() - 1
    }

    /// Returns the indices of the coefficients of level `level`, in increasing order.
    ///
    /// # Panics
    /// If `level` is out of range.
    pub fn at_level(&self, level: usize) -> &[u32] {
        &self.order[self.starts[level]..self.starts[level + 1]]
    }

    /// Creates the coefficient tree of a transformed axis; `depth` is the number of levels of details on an ordered
    /// axis.
    pub(super) fn new(length: usize, mesh: Option<TriangleMesh>, transform: AxisTransform, depth: u32) -> Self {
        let (level, parent) = match (transform, mesh) {
            (AxisTransform::Sphere(_), Some(mesh)) => sphere(mesh),
            (AxisTransform::Line { .. }, _) => on_line(length, depth),
            _ => (vec![0; length], vec![None; length]),
        };
        let levels = usize::from(level.iter().copied().max().unwrap_or(0)) + 1;
        let mut starts = vec![0; levels + 1];
        for &l in &level {
            starts[usize::from(l) + 1] += 1;
        }
        for l in 0..levels {
            starts[l + 1] += starts[l];
        }
        let mut order: Vec<u32> = (0..length as u32).collect();
        order.sort_by_key(|&i| level[i as usize]);
        Self { level, parent, order, starts }
    }
}

fn sphere(mesh: TriangleMesh) -> (Vec<u8>, Vec<Option<u32>>) {
    let finest = u32::from(mesh.level());
    let octant = 1_usize << (2 * finest);
    (0..mesh.len())
        .map(|i| {
            let within = i % octant;
            if within == 0 {
                return (0, None);
            }
            // In base 4, the lowest nonzero digit is the detail's k; the number of zeros after it is its height.
            let height = within.trailing_zeros() / 2;
            let level = finest - height;
            let place = 1_usize << (2 * height);
            let k = (within / place) % 4;
            let parent = if level == 1 {
                i - within
            } else {
                let grandparent = i / (16 * place) * (16 * place);
                grandparent + 4 * k * place
            };
            (level as u8, Some(parent as u32))
        })
        .unzip()
}

fn on_line(n: usize, depth: u32) -> (Vec<u8>, Vec<Option<u32>>) {
    (0..n)
        .map(|i| {
            let height = if i == 0 { depth } else { i.trailing_zeros().min(depth) };
            if height == depth {
                return (0, None);
            }
            let level = depth - height;
            let parent = if level == 1 {
                // The smooth coefficient to the left.
                i - (1 << height)
            } else {
                // Detail j of stride s lies at (2j + 1)s. The coarser level may have no detail j / 2; its last one is
                // used then.
                let stride = 2_usize << height;
                let details = n.div_ceil(stride) / 2;
                let j = (i >> (height + 1)) / 2;
                (2 * j.min(details - 1) + 1) * stride
            };
            (level as u8, Some(parent as u32))
        })
        .unzip()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Domain;
    use crate::transform::line;
    use crate::transform::{LineBasis, SphereBasis};

    fn checked(tree: &AxisTree, smooth: usize) {
        let n = tree.level.len();
        let mut seen = vec![false; n];
        for &i in &tree.order {
            assert!(!std::mem::replace(&mut seen[i as usize], true));
        }
        assert_eq!(tree.order.len(), n);
        assert_eq!(tree.at_level(0).len(), smooth);
        for i in 0..n {
            match tree.parent[i] {
                None => assert_eq!(tree.level[i], 0),
                Some(parent) => assert_eq!(tree.level[parent as usize] + 1, tree.level[i], "{i} of {n}"),
            }
        }
        for level in 0..tree.levels() {
            let at = tree.at_level(level);
            assert!(at.iter().all(|&i| usize::from(tree.level[i as usize]) == level));
            assert!(at.is_sorted());
        }
    }

    #[test]
    fn line_trees_end_in_one_smooth_coefficient() {
        for n in (1..140).chain([2101]) {
            let tree = AxisTree::new(n, None, AxisTransform::line(LineBasis::HAAR), line::levels(n));
            checked(&tree, 1);
            assert_eq!(tree.levels(), 1 + line::levels(n) as usize);
        }
    }

    #[test]
    fn line_trees_of_fewer_levels_end_in_more_smooth_coefficients() {
        for n in 1..80_usize {
            for depth in 0..=line::levels(n) {
                let tree = AxisTree::new(n, None, AxisTransform::line(LineBasis::HAAR), depth);
                checked(&tree, n.div_ceil(1 << depth));
                assert_eq!(tree.levels(), 1 + depth as usize);
            }
        }
    }

    #[test]
    fn sphere_trees_end_in_the_bases_and_have_four_children() {
        for &domain in Domain::ALL {
            for level in 0..=4 {
                let mesh = TriangleMesh::new(domain, level).unwrap();
                let tree = AxisTree::new(mesh.len(), Some(mesh), AxisTransform::Sphere(SphereBasis::BioHaar), 0);
                checked(&tree, mesh.bases());
                assert_eq!(tree.levels(), 1 + usize::from(level));
                for i in 0..mesh.len() {
                    if tree.level[i] > 0 && tree.level[i] < level {
                        assert_eq!(tree.parent.iter().filter(|p| **p == Some(i as u32)).count(), 4);
                    }
                    // The support of the parent contains the position of the child.
                    if let Some(parent) = tree.parent[i] {
                        let node = 1 << (2 * u32::from(level - tree.level[parent as usize]));
                        let group = if tree.level[parent as usize] == 0 { node } else { 4 * node };
                        assert_eq!(i / group, parent as usize / group);
                    }
                }
            }
        }
    }

    #[test]
    fn an_untransformed_axis_is_all_smooth() {
        checked(&AxisTree::new(7, None, AxisTransform::Identity, 0), 7);
    }
}
