//! Fixed prediction of details along a line: average interpolation (Donoho 1993) of means over unevenly spaced entries.
//!
//! A polynomial is fitted to the known means over the entries of a node and of its neighbours. The difference of its
//! means over the two children is the prediction. On even lines this is (P₊ − P₋) / 4 with one neighbour on each side
//! and (22·(P₊ − P₋) − 3·(P₊₊ − P₋₋)) / 64 with two.

use super::grid::Line;
use crate::numeric::dense;

/// Denominator of prediction filter coefficients: they are multiples of 2⁻¹⁶, so that the last digits of their
/// computation do not matter.
const UNITS: f64 = 65_536.0;
/// Upper bound on the summed magnitudes of a filter's four coefficients, with which the difference of two grid nodes is
/// predicted from the means of nodes around them. A filter with a larger sum is rejected as unstable.
///
/// The sum is 0.78 for evenly spaced angles.
const LARGEST_SUM: f64 = 1.5;
/// Factor on the coefficient of a prediction filter at the end of an axis, where a node has a neighbour on one side
/// only. It is below 1 because such predictions are less reliable.
const ONE_SIDED: f64 = 0.8;

/// Coefficients of a prediction filter, for the means of the next, previous, next but one and previous but one node,
/// each less the node's own.
pub(super) type Coefficients = [f64; 4];

/// Computes the prediction filter of each node of an axis after `halvings` merges of neighbours; `wraps` if the last
/// node is next to the first.
pub(super) fn coefficients(line: &Line, halvings: usize, wraps: bool) -> Vec<Coefficients> {
    let span = 1_usize << halvings;
    let nodes = line.positions.len().div_ceil(span);
    (0..nodes).map(|node| of_node(line, span, (node, nodes), wraps)).collect()
}

/// Positions (angles) of the axis entries merged into the node that lies `by` nodes away from `node`, and the multiple
/// of 360° to add to them where a circle was passed around. `None` beyond the end of an axis that is no circle.
fn entries(line: &Line, span: usize, node: usize, nodes: usize, by: isize, wraps: bool) -> Option<(&[f64], f64)> {
    let at = node as isize + by;
    let turns = at.div_euclid(nodes as isize);
    if turns != 0 && !wraps {
        return None;
    }
    let first = at.rem_euclid(nodes as isize) as usize * span;
    let last = (first + span).min(line.positions.len());
    Some((&line.positions[first..last], turns as f64 * line.period.unwrap_or(0.0)))
}

fn of_node(line: &Line, span: usize, (node, nodes): (usize, usize), wraps: bool) -> Coefficients {
    let around = |by| entries(line, span, node, nodes, by, wraps);
    let Some((own, _)) = around(0).filter(|(own, _)| own.len() > span / 2) else { return [0.0; 4] };
    let centre = own.iter().sum::<f64>() / own.len() as f64;
    let mean = |by| around(by).map(|(x, shift)| x.iter().sum::<f64>() / x.len() as f64 + shift);
    let (first, second) = own.split_at(span / 2);
    let children = second.iter().sum::<f64>() / second.len() as f64 - first.iter().sum::<f64>() / first.len() as f64;
    let one_sided = |distance: f64| rounded(ONE_SIDED * (children / distance).min(0.625));
    let (after, before) = match (mean(1), mean(-1)) {
        (Some(after), Some(before)) => (after, before),
        (Some(after), None) => return [one_sided(after - centre), 0.0, 0.0, 0.0],
        (None, Some(before)) => return [0.0, -one_sided(centre - before), 0.0, 0.0],
        (None, None) => return [0.0; 4],
    };
    let scale = 0.5 * (after - before);
    let moments = |(x, shift): (&[f64], f64)| {
        let mut sums = [0.0; 4];
        for x in x {
            let y = (x + shift - centre) / scale;
            let mut power = 1.0;
            for sum in &mut sums {
                power *= y;
                *sum += power;
            }
        }
        sums.map(|sum| sum / x.len() as f64)
    };
    let (own, first, second) = (moments((own, 0.0)), moments((first, 0.0)), moments((second, 0.0)));
    let wanted: [f64; 4] = std::array::from_fn(|k| second[k] - first[k]);
    let neighbours: Vec<[f64; 4]> = [1, -1, 2, -2].into_iter().filter_map(around).map(moments).collect();
    let usable = if nodes > 4 && neighbours.len() == 4 { [4, 2].as_slice() } else { &[2] };
    for &count in usable {
        // Column j holds the moments of neighbour j, less those of the node.
        let row = |k: usize| {
            neighbours[..count].iter().map(|moments| moments[k] - own[k]).chain([wanted[k]]).collect::<Vec<f64>>()
        };
        let found = dense::solve(&mut (0..count).map(row).collect::<Vec<_>>());
        if let Some(found) = found.filter(|c| c.iter().map(|c| c.abs()).sum::<f64>() <= LARGEST_SUM) {
            return std::array::from_fn(|k| found.get(k).map_or(0.0, |&c| rounded(c)));
        }
    }
    let slope = rounded((children / (after - before)).min(0.5));
    [slope, -slope, 0.0, 0.0]
}

fn rounded(c: f64) -> f64 {
    libm::round(c * UNITS) / UNITS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_lines_have_the_usual_filters() {
        let line = Line::even(64, false);
        for halvings in 1..4 {
            let found = coefficients(&line, halvings, false);
            assert_eq!(found[2], [22.0 / 64.0, -22.0 / 64.0, -3.0 / 64.0, 3.0 / 64.0], "{halvings}");
            assert_eq!(found[1], [0.25, -0.25, 0.0, 0.0]);
            assert_eq!(found[0], [rounded(0.4), 0.0, 0.0, 0.0]);
            assert_eq!(found.last(), Some(&[0.0, -rounded(0.4), 0.0, 0.0]));
        }
        let circle = coefficients(&Line::even(64, true), 1, true);
        assert!(circle.iter().all(|c| *c == circle[7]));
    }

    #[test]
    fn polynomials_are_predicted_exactly_on_uneven_lines() {
        let positions: Vec<f64> = (0..40).map(|i| f64::from(i) + 0.3 * libm::sin(f64::from(i))).collect();
        let line = Line { positions: positions.clone(), period: None };
        let f = |x: f64| 1.0 + 0.3 * x - 0.02 * x * x + 0.001 * x * x * x;
        let mean = |from: usize, to: usize| positions[from..to].iter().map(|&x| f(x)).sum::<f64>() / (to - from) as f64;
        let found = coefficients(&line, 2, false);
        for node in 2..8 {
            let p: Vec<f64> = (0..10).map(|i| mean(4 * i, 4 * i + 4)).collect();
            let at = |by: usize| p[node + by - 2] - p[node];
            let c = found[node];
            let predicted = c[0] * at(3) + c[1] * at(1) + c[2] * at(4) + c[3] * at(0);
            let truth = mean(4 * node + 2, 4 * node + 4) - mean(4 * node, 4 * node + 2);
            assert!((predicted - truth).abs() < 3e-3, "{node}: {predicted} {truth}");
        }
    }

    #[test]
    fn wild_positions_have_bounded_coefficients() {
        for seed in 1..200_u64 {
            let mut x = 0.0;
            let mut state = seed;
            let step = |state: &mut u64| {
                *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                libm::exp(((*state >> 40) as f64 / 16_777_216.0 - 0.5) * 12.0)
            };
            let positions: Vec<f64> = (0..11)
                .map(|_| {
                    x += step(&mut state);
                    x
                })
                .collect();
            for halvings in 1..=4 {
                for c in coefficients(&Line { positions: positions.clone(), period: None }, halvings, false) {
                    assert!(c.iter().all(|c| c.is_finite()) && c.iter().map(|c| c.abs()).sum::<f64>() <= 1.51, "{c:?}");
                }
            }
        }
    }
}
