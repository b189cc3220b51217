//! From the trees of a plan to the coding order: coarse to fine, each row and lane with its neighbours already coded.

use crate::codec::{NONE, Rows};
use crate::domain::Axis;
use crate::transform::Plan;

/// The coding order of a tensor on `axes` transformed by `plan`: the last axis gives the lanes, all others the rows.
pub(crate) fn coding_order(axes: &[Axis], plan: &Plan) -> Rows {
    let Some(last) = axes.len().checked_sub(1) else { return Rows::natural(1, 1) };
    let lanes = AxisNeighbours::of(plan, last);
    let mut rows = Rows {
        order: vec![0],
        level: vec![0],
        neighbours: vec![[NONE; 3]],
        lane_level: plan.tree(last).level.clone(),
        lane_neighbours: lanes.parent.iter().zip(&lanes.before).map(|(&p, &b)| [p, b]).collect(),
        lane_order: lanes.order,
    };
    for axis in 0..last {
        rows = nest(rows, &AxisNeighbours::of(plan, axis), &plan.tree(axis).level);
    }
    rows
}

struct AxisNeighbours {
    order: Vec<u32>,
    parent: Vec<u32>,
    /// The predecessor in coding order at the same level.
    before: Vec<u32>,
}

impl AxisNeighbours {
    fn of(plan: &Plan, axis: usize) -> Self {
        let tree = plan.tree(axis);
        let mut before = vec![NONE; tree.order.len()];
        for &[a, b] in tree.order.array_windows() {
            if tree.level[a as usize] == tree.level[b as usize] {
                before[b as usize] = a;
            }
        }
        let parent = tree.parent.iter().map(|p| p.unwrap_or(NONE)).collect();
        Self { order: tree.order.clone(), parent, before }
    }
}

/// Rows of `outer × axis` from the rows of `outer`.
fn nest(outer: Rows, axis: &AxisNeighbours, level: &[u8]) -> Rows {
    let n = axis.order.len() as u32;
    let count = outer.order.len() * axis.order.len();
    let mut order = Vec::with_capacity(count);
    for &o in &outer.order {
        order.extend(axis.order.iter().map(|&i| o * n + i));
    }
    let mut levels = Vec::with_capacity(count);
    let mut neighbours = Vec::with_capacity(count);
    for (o, &outer_level) in (0..).zip(&outer.level) {
        let [before, parent, _] = outer.neighbours[o as usize];
        let earlier = if parent == NONE { before } else { parent };
        for i in 0..n {
            let same = |index: u32| if index == NONE { NONE } else { o * n + index };
            let other = if earlier == NONE { NONE } else { earlier * n + i };
            levels.push(level[i as usize].saturating_add(u8::from(outer_level > 0)));
            neighbours.push([same(axis.before[i as usize]), same(axis.parent[i as usize]), other]);
        }
    }
    Rows { order, level: levels, neighbours, ..outer }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Domain, TriangleMesh, WavelengthGrid};
    use crate::transform::{AxisTransform, LineBasis, SphereBasis, Weights};

    #[test]
    fn neighbours_are_coded_before_they_are_asked_for() {
        let mesh = |level| Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, level).unwrap());
        let axes = [mesh(1), mesh(2), Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, 11).unwrap())];
        let sphere = AxisTransform::Sphere(SphereBasis::Orthonormal(Weights::Count));
        let plan = Plan::new(&axes, &[sphere, sphere, AxisTransform::line(LineBasis::BIOR44)]).unwrap();
        let rows = coding_order(&axes, &plan);
        assert_eq!(rows.order.len(), 16 * 64);
        let mut rank = vec![0; rows.order.len()];
        for (k, &r) in rows.order.iter().enumerate() {
            rank[r as usize] = k;
        }
        for (r, neighbours) in rows.neighbours.iter().enumerate() {
            for &n in neighbours.iter().filter(|&&n| n != NONE) {
                assert!(rank[n as usize] < rank[r]);
            }
        }
        let mut lane_rank = vec![0; rows.lane_order.len()];
        for (k, &j) in rows.lane_order.iter().enumerate() {
            lane_rank[j as usize] = k;
        }
        for (j, neighbours) in rows.lane_neighbours.iter().enumerate() {
            assert!(neighbours.iter().all(|&n| n == NONE || lane_rank[n as usize] < lane_rank[j]));
        }
        let mut all = rows.order.clone();
        all.sort_unstable();
        assert!(all.iter().enumerate().all(|(i, &r)| i == r as usize));
    }

    #[test]
    fn a_tensor_without_axes_is_one_row() {
        let plan = Plan::new(&[], &[]).unwrap();
        assert_eq!(coding_order(&[], &plan).order, vec![0]);
    }
}
