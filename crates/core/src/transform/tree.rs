//! Where the coefficients of one axis lie in their tree: level, parent, and the order from coarse to fine.

use super::basis::AxisTransform;
use crate::domain::TriangleMesh;

/// The tree of one axis' coefficients, by index along the axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AxisTree {
    /// 0 for smooth coefficients (everything, where the axis is not transformed), then 1 for the coarsest details, …
    pub level: Vec<u8>,
    /// The coefficient one level coarser whose support covers this one's place; `None` at level 0.
    ///
    /// On a line the j-th detail's parent is detail j / 2 of the level above; on triangles detail k of a node has detail
    /// k of the node's parent. Details of level 1 have the smooth coefficient over them.
    pub parent: Vec<Option<u32>>,
    /// All indices, by level, then by index.
    pub order: Vec<u32>,
    /// `order[starts[l]..starts[l + 1]]` are the indices of level `l`; one longer than there are levels.
    pub starts: Vec<usize>,
}

impl AxisTree {
    /// How many levels there are, the smooth one included.
    pub fn levels(&self) -> usize {
        self.starts.len() - 1
    }

    /// The indices of level `level`, in order.
    ///
    /// # Panics
    /// If there is no such level.
    pub fn at_level(&self, level: usize) -> &[u32] {
        &self.order[self.starts[level]..self.starts[level + 1]]
    }

    /// The tree of a transformed axis; on a line of `depth` levels.
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
            // The lowest digit to base 4 that is not 0 is the detail's k; how many follow it is its height.
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
                // The smooth coefficient to its left.
                i - (1 << height)
            } else {
                // Detail j of stride s lies at (2j + 1)s. The level above may have one detail fewer than j / 2 asks for.
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
                    // The parent's support holds the child's place.
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
