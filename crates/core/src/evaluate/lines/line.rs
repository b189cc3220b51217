//! One line of a grid: the four entries around an angle, with the weights of a cubic and of a straight line between the middle two.

/// Bins of a line, in which a search for an angle starts.
const BINS: usize = 512;
/// Part of an interval within which a direction counts as a stated one.
const ROUNDING: f64 = 1e-7;
/// Degrees in a circle.
const CIRCLE: f64 = 360.0;

/// An entry of a line: its angle in degrees and the number it has on the axis. Mirror images have the number of their original.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Node {
    pub(super) angle: f64,
    pub(super) entry: u32,
}

/// Entries in the order of their angles.
#[derive(Debug)]
pub(super) struct Line {
    nodes: Vec<Node>,
    is_circle: bool,
    /// Bins in a degree, and by bin the last node at or below its start.
    per_degree: f64,
    bins: Vec<u32>,
}

/// The entries around an angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Around {
    /// The two before and the two after; an end stands for what is missing beyond it, with weight 0.
    pub(super) entries: [u32; 4],
    /// Weights of a cubic through the middle two whose slope there is that of the parabola through three entries
    /// (Catmull and Rom 1974, for uneven distances); at an end that of the secant.
    pub(super) cubic: [f32; 4],
    /// Weight of the third entry on the straight line between the second and the third.
    pub(super) t: f32,
}

impl Line {
    /// A line of at least one node, of strictly increasing angles; around a circle the last node is followed by the first.
    pub(super) fn new(nodes: Vec<Node>, is_circle: bool) -> Self {
        let (first, last) = (nodes[0].angle, nodes[nodes.len() - 1].angle);
        let length = if is_circle { CIRCLE } else { last - first };
        let per_degree = if length > 0.0 { BINS as f64 / length } else { 0.0 };
        let below = |bin: usize| {
            let start = first + bin as f64 * length / BINS as f64;
            nodes.partition_point(|node| node.angle <= start).saturating_sub(1) as u32
        };
        let bins = (0..BINS).map(below).collect();
        Self { nodes, is_circle, per_degree, bins }
    }

    /// The entries around `angle` in degrees; beyond an end, those around the end.
    pub(super) fn around(&self, angle: f64) -> Around {
        let count = self.nodes.len();
        let first = self.nodes[0].angle;
        if count == 1 {
            return Around { entries: [self.nodes[0].entry; 4], cubic: [0.0, 1.0, 0.0, 0.0], t: 0.0 };
        }
        let last = if self.is_circle { count - 1 } else { count - 2 };
        let angle =
            if self.is_circle { around_circle(angle, first) } else { angle.clamp(first, self.nodes[count - 1].angle) };
        let bin = ((angle - first) * self.per_degree) as usize;
        let mut below = self.bins.get(bin).map_or(last, |&below| (below as usize).min(last));
        // Rounding may have left the bin before or after its own.
        while below > 0 && self.nodes[below].angle > angle {
            below -= 1;
        }
        while below < last && self.nodes[below + 1].angle <= angle {
            below += 1;
        }
        let at = |step: isize| self.node(below as isize + step);
        let (one, two) = (at(0), at(1));
        let [one, two] = [one.unwrap_or(self.nodes[below]), two.unwrap_or(self.nodes[below])];
        let (before, after) = (at(-1), at(2));
        // At a stated angle the entry alone counts, whatever rounding made of the direction.
        let t = match (angle - one.angle) / (two.angle - one.angle) {
            t if t < ROUNDING => 0.0,
            t if t > 1.0 - ROUNDING => 1.0,
            t => t,
        };
        let distances = [before.map(|node| one.angle - node.angle), after.map(|node| node.angle - two.angle)];
        let entries = [before.unwrap_or(one), one, two, after.unwrap_or(two)].map(|node| node.entry);
        Around { entries, cubic: cubic(t, two.angle - one.angle, distances).map(|w| w as f32), t: t as f32 }
    }

    /// The node at a position that may be beyond the ends: turned by whole circles, or none.
    fn node(&self, position: isize) -> Option<Node> {
        let count = self.nodes.len() as isize;
        if !self.is_circle {
            return usize::try_from(position).ok().and_then(|position| self.nodes.get(position)).copied();
        }
        let Node { angle, entry } = self.nodes[position.rem_euclid(count) as usize];
        Some(Node { angle: angle + CIRCLE * position.div_euclid(count) as f64, entry })
    }

    /// The intervals between neighbouring nodes: their ends in degrees.
    pub(super) fn intervals(&self) -> Vec<[f64; 2]> {
        let count = self.nodes.len();
        let ends = self.nodes.array_windows().map(|[a, b]| [a.angle, b.angle]);
        let closing = self.is_circle.then(|| [self.nodes[count - 1].angle, self.nodes[0].angle + CIRCLE]);
        ends.chain(closing).collect()
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.bins)
    }
}

/// `angle` turned by whole circles into `first` up to a circle further.
fn around_circle(angle: f64, first: f64) -> f64 {
    let turned = angle - CIRCLE * libm::floor((angle - first) / CIRCLE);
    if turned - first < CIRCLE { turned.max(first) } else { first }
}

/// The weights of the four values around `t`, 0..=1, of an interval of this length; `distances` are those to the values
/// before and after it.
fn cubic(t: f64, length: f64, distances: [Option<f64>; 2]) -> [f64; 4] {
    let (square, cube) = (t * t, t * t * t);
    let mut weights = [0.0, 2.0 * cube - 3.0 * square + 1.0, 3.0 * square - 2.0 * cube, 0.0];
    // The slopes at both ends, times the length, by the values around.
    let slope = |distance: Option<f64>| match distance {
        None => [0.0, -1.0, 1.0],
        Some(other) => {
            let sum = other + length;
            [-length * length / (other * sum), (length - other) / other, other / sum]
        }
    };
    let (at_start, at_end) = (cube - 2.0 * square + t, cube - square);
    let [before, own, next] = slope(distances[0]);
    for (weight, part) in weights.iter_mut().zip([before, own, next]) {
        *weight += at_start * part;
    }
    let [after, own, previous] = slope(distances[1]).map(|part| -part);
    for (weight, part) in weights[1..].iter_mut().zip([previous, own, after]) {
        *weight += at_end * part;
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::drawn::{list, number};
    use arbtest::arbtest;

    fn line(angles: &[f64], is_circle: bool) -> Line {
        let nodes = angles.iter().zip(0..).map(|(&angle, entry)| Node { angle, entry }).collect();
        Line::new(nodes, is_circle)
    }

    fn value(line: &Line, angle: f64, of: impl Fn(u32) -> f64) -> f64 {
        let Around { entries, cubic, .. } = line.around(angle);
        entries.iter().zip(cubic).map(|(&entry, weight)| of(entry) * f64::from(weight)).sum()
    }

    #[test]
    fn at_an_entry_it_alone_counts() {
        for (angles, is_circle) in [
            (vec![0.0, 10.0, 15.0, 80.0], false),
            (vec![0.0, 10.0, 15.0, 80.0], true),
            (vec![-30.0, 300.0], true),
            (vec![5.0, 6.0], false),
            (vec![7.0], false),
            (vec![7.0], true),
        ] {
            let line = line(&angles, is_circle);
            for (entry, &angle) in angles.iter().enumerate() {
                let found = line.around(angle);
                let weight: f32 =
                    found.entries.iter().zip(found.cubic).filter(|(e, _)| **e == entry as u32).map(|(_, w)| w).sum();
                assert!((weight - 1.0).abs() < 1e-6, "{angles:?} {angle}: {found:?}");
                let at = if found.t > 0.5 { 2 } else { 1 };
                assert!(found.t.min(1.0 - found.t) < 1e-6 && found.entries[at] == entry as u32);
            }
        }
    }

    #[test]
    fn straight_lines_and_parabolas_are_exact() {
        arbtest(|u| {
            let (steps, at) = (list(u, 3..=11, |u| number(u, 0.5..20.0))?, number(u, 0.0..1.0)?);
            let angles: Vec<f64> = steps
                .iter()
                .scan(-10.0, |angle, step| {
                    *angle += step;
                    Some(*angle)
                })
                .collect();
            let line = line(&angles, false);
            let of = |entry: u32| angles[entry as usize];
            let (first, last) = (angles[0], angles[angles.len() - 1]);
            let angle = first + at * (last - first);
            assert!((value(&line, angle, of) - angle).abs() < 1e-4);
            // Inside, where both slopes are those of three entries.
            if angles.len() > 3 && angle >= angles[1] && angle <= angles[angles.len() - 2] {
                let found = value(&line, angle, |entry| of(entry) * of(entry));
                assert!((found - angle * angle).abs() < 1e-2, "{} {}", found, angle * angle);
            }
            Ok(())
        });
    }

    #[test]
    fn weights_add_up_to_one_anywhere() {
        arbtest(|u| {
            let (steps, at) = (list(u, 1..=8, |u| number(u, 0.01..80.0))?, number(u, -1000.0..1000.0)?);
            let angles: Vec<f64> = steps
                .iter()
                .scan(-60.0, |angle, step| {
                    *angle += step;
                    Some(*angle)
                })
                .collect();
            let closes = angles[angles.len() - 1] - angles[0] < 359.0;
            for is_circle in [false, closes] {
                let found = line(&angles, is_circle).around(at);
                assert!((found.cubic.iter().sum::<f32>() - 1.0).abs() < 1e-4);
                assert!((0.0..=1.0).contains(&found.t));
            }
            Ok(())
        });
    }
}
