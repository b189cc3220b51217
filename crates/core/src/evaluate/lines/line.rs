//! One line of a grid: the four entries around an angle, with the weights of a cubic and of a straight line between the
//! middle two.

/// Size of the bin table that speeds up the search for an angle: its initial number of bins, then the maximum number of
/// bins for each interval and in all. More bins need more memory and leave fewer intervals to search.
const BINS: usize = 512;
const BINS_OF_INTERVAL: usize = 8;
const MOST_BINS: usize = 1 << 16;
/// Fraction of the distance between two neighbouring measured angles within which an angle counts as equal to the
/// nearer one.
const ROUNDING: f64 = 1e-7;
/// Degrees in a circle.
const CIRCLE: f64 = 360.0;
/// Degrees beyond a border within which an angle still counts as on it, free of rounding of the direction.
pub(super) const ON_BORDER: f64 = 1e-7;

/// Angle in degrees at which samples are known, with its index on the axis of measured angles. An angle added by mirror
/// symmetry has the index of the measured angle that it mirrors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::evaluate) struct Node {
    pub(in crate::evaluate) angle: f64,
    pub(in crate::evaluate) entry: u32,
}

/// Measured angles of one axis in increasing order, with tables for interpolation between them.
#[derive(Debug)]
pub(super) struct Line {
    first: f64,
    last: f64,
    is_circle: bool,
    /// Table over equal bins of angles, which speeds up the search for an interval between measured angles: number of
    /// bins per degree. Then, for each bin, the last interval that starts at or below all angles of the bin.
    per_degree: f64,
    bins: Vec<u32>,
    /// Start of each interval between measured angles in degrees, then infinity as a sentinel.
    starts: Vec<f64>,
    intervals: Vec<Interval>,
}

/// Interval between two neighbouring measured angles.
#[derive(Clone, Copy, Debug)]
struct Interval {
    start: f64,
    /// Reciprocal of the distance between two neighbouring measured angles, in 1/degree; 0 if there is only one
    /// measured angle.
    per_degree: f64,
    entries: [u32; 4],
    /// Slopes of the interpolating cubic at the start and the end of the interval, times its length, as weights of the
    /// four samples around the interval.
    slopes: [[f32; 4]; 2],
}

/// Interpolation weights of the samples around an angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Along {
    /// Weights of the four samples around an angle in a cubic through the middle two. The slope at each is that of the
    /// parabola through three samples (Catmull and Rom 1974, for uneven distances); at an end of the axis that of the
    /// secant.
    pub(super) cubic: [f32; 4],
    /// Weight of the third of four samples in linear interpolation between the second and the third; the second has the
    /// rest.
    pub(super) t: f32,
}

impl Along {
    /// Interpolation weights of four samples around an angle: 1 for the second sample, 0 for the others.
    pub(super) const START: Self = Self { cubic: [0.0, 1.0, 0.0, 0.0], t: 0.0 };
}

/// Numbers of the four samples around an angle, with their interpolation weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Around {
    /// Indices, on the axis, of the two samples before a queried angle and the two after it. A missing one is replaced
    /// by the sample at the end of the axis, with weight 0.
    pub(super) entries: [u32; 4],
    pub(super) along: Along,
}

impl Line {
    /// Builds an axis of angles from at least one measured angle, in strictly increasing order. If the angles cover the
    /// whole circle, another interval leads from the last one on to the first.
    pub(super) fn new(nodes: Vec<Node>, is_circle: bool) -> Self {
        Self::with_border(nodes, is_circle, f64::INFINITY)
    }

    /// Builds an axis of angles like [`Line::new`], on which nothing is interpolated across the angle `border`: the
    /// samples of the last angle up to the border hold as far as there, those of the first one beyond it from there on.
    pub(super) fn parted(nodes: Vec<Node>, border: f64) -> Self {
        Self::with_border(nodes, false, border)
    }

    fn with_border(mut nodes: Vec<Node>, is_circle: bool, border: f64) -> Self {
        if is_circle {
            let turns = libm::floor((nodes[0].angle + 0.5 * CIRCLE) / CIRCLE);
            for node in &mut nodes {
                node.angle -= CIRCLE * turns;
            }
        }
        let (first, last) = (nodes[0].angle, nodes[nodes.len() - 1].angle);
        let count = if nodes.len() == 1 || is_circle { nodes.len() } else { nodes.len() - 1 };
        let is_across =
            |below: usize| nodes[below].angle <= border && nodes.get(below + 1).is_some_and(|end| end.angle > border);
        let mut intervals = Vec::with_capacity(count + 1);
        for below in 0..count {
            if is_across(below) {
                let [start, end] = [nodes[below], nodes[below + 1]];
                let beyond = end.angle.min(border + ON_BORDER);
                intervals.extend([Interval::held(start), Interval::held(Node { angle: beyond, ..end })]);
            } else {
                intervals.push(Interval::new(&nodes, is_circle, border, below));
            }
        }
        let starts: Vec<f64> = intervals.iter().map(|interval| interval.start).chain([f64::INFINITY]).collect();
        let length = if is_circle { CIRCLE } else { last - first };
        let (bins, per_degree) = bins(&starts[..intervals.len()], length);
        Self { first, last, is_circle, per_degree, bins, starts, intervals }
    }

    /// Samples around `angle` in degrees, with weights; beyond an end of the axis, the samples around the end. On a
    /// circle, `angle` must be less than 360° below the first measured angle, or less than 720° above it.
    #[inline(always)]
    pub(super) fn around(&self, angle: f64) -> Around {
        let (interval, t) = self.find(angle);
        let t = t as f32;
        let rest = 1.0 - t;
        let second = t * t * (3.0 - 2.0 * t);
        let (at_start, at_end) = (t * rest * rest, -(t * t * rest));
        let plain = [0.0, 1.0 - second, second, 0.0];
        let [start, end] = &interval.slopes;
        let mut cubic = plain;
        for k in 0..4 {
            cubic[k] = plain[k] + at_start * start[k] + at_end * end[k];
        }
        Around { entries: interval.entries, along: Along { cubic, t } }
    }

    /// Numbers of the two measured angles on either side of `angle` (degrees), and the linear interpolation weight of
    /// the second. Beyond an end of the axis they are the two at the end. On a circle, `angle` must be less than 360°
    /// below the first measured angle, or less than 720° above it.
    #[inline(always)]
    pub(super) fn between(&self, angle: f64) -> ([u32; 2], f64) {
        let (Interval { entries: [_, one, two, _], .. }, t) = self.find(angle);
        ([*one, *two], t)
    }

    /// Returns the interval between measured angles that contains `angle`, and the position of `angle` in it, from 0 at
    /// the start to 1 at the end.
    #[inline(always)]
    fn find(&self, angle: f64) -> (&Interval, f64) {
        let angle = if self.is_circle {
            let angle = if angle < self.first { angle + CIRCLE } else { angle };
            if angle >= self.first + CIRCLE { angle - CIRCLE } else { angle }
        } else {
            angle.clamp(self.first, self.last)
        };
        let bin = ((angle - self.first) * self.per_degree) as usize;
        let mut below = self.bins[bin.min(self.bins.len() - 1)] as usize;
        // Nearly every bin has at most one start, so that this step is enough and needs no branch.
        below += usize::from(self.starts[below + 1] <= angle);
        while self.starts[below + 1] <= angle {
            below += 1;
        }
        let interval = &self.intervals[below];
        // At a stated angle the entry alone counts, free of rounding of the direction.
        let t = (angle - interval.start) * interval.per_degree;
        let t = if t < ROUNDING { 0.0 } else { t };
        (interval, if t > 1.0 - ROUNDING { 1.0 } else { t })
    }

    /// Intervals between neighbouring measured angles, each as its start and end in degrees.
    pub(super) fn intervals(&self) -> Vec<[f64; 2]> {
        let count = self.intervals.len();
        let end = if self.is_circle { self.first + CIRCLE } else { self.last };
        let ends = self.starts[..count].iter().skip(1).copied().chain([end]);
        let pairs = self.starts.iter().zip(ends).map(|(&start, end)| [start, end]);
        pairs.filter(|[start, end]| end > start).collect()
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.bins) + size_of_val(&*self.starts) + size_of_val(&*self.intervals)
    }
}

impl Interval {
    /// Interval from a measured angle on, in which its sample holds.
    fn held(start: Node) -> Self {
        Self { start: start.angle, per_degree: 0.0, entries: [start.entry; 4], slopes: [[0.0; 4]; 2] }
    }

    /// Prepares interpolation between measured angle number `below` of an axis, counted from 0, and the next larger
    /// one, which lies on the same side of `border`.
    fn new(nodes: &[Node], is_circle: bool, border: f64, below: usize) -> Self {
        let is_beyond = |node: &Node| node.angle > border;
        // Node at a position that may lie beyond the ends: shifted by whole circles, or none. None beyond the border,
        // either.
        let node = |position: isize| {
            let count = nodes.len() as isize;
            if !is_circle {
                let found = usize::try_from(position).ok().and_then(|position| nodes.get(position)).copied();
                return found.filter(|found| is_beyond(found) == is_beyond(&nodes[below]));
            }
            let Node { angle, entry } = nodes[position.rem_euclid(count) as usize];
            Some(Node { angle: angle + CIRCLE * position.div_euclid(count) as f64, entry })
        };
        let start = nodes[below];
        if nodes.len() == 1 {
            return Self::held(start);
        }
        let [before, end, after] = [-1, 1, 2].map(|step| node(below as isize + step));
        let end = end.unwrap_or(start);
        let length = end.angle - start.angle;
        // Slope at an end of the interval: weights of the value beyond it, at it, and at the other end.
        let slope = |distance: Option<f64>| match distance {
            None => [0.0, -1.0, 1.0],
            Some(other) => {
                let sum = other + length;
                [-length * length / (other * sum), (length - other) / other, other / sum]
            }
        };
        let [a, b, c] = slope(before.map(|node| start.angle - node.angle)).map(|part| part as f32);
        let [f, e, d] = slope(after.map(|node| node.angle - end.angle)).map(|part| -part as f32);
        let entries = [before.unwrap_or(start), start, end, after.unwrap_or(end)].map(|node| node.entry);
        let slopes = [[a, b, c, 0.0], [0.0, d, e, f]];
        Self { start: start.angle, per_degree: 1.0 / length, entries, slopes }
    }
}

/// Table over equal bins of angles, which speeds up the search for an interval between measured angles, and the number
/// of bins per degree. The axis is `length` degrees long, its intervals start at the angles `starts`. Bins are so fine
/// that few contain two starts.
fn bins(starts: &[f64], length: f64) -> (Vec<u32>, f64) {
    let mut count = BINS;
    loop {
        let per_degree = if length > 0.0 { count as f64 / length } else { 0.0 };
        // Same expression as in a search; rounding keeps the order.
        let bin_of: Vec<usize> = starts.iter().map(|start| ((start - starts[0]) * per_degree) as usize).collect();
        let is_fine = bin_of.array_windows().all(|[a, b]| a < b);
        if is_fine || count >= MOST_BINS.min(BINS_OF_INTERVAL * starts.len()) {
            let before = |bin: usize| bin_of.partition_point(|&of_start| of_start < bin).saturating_sub(1) as u32;
            return ((0..count).map(before).collect(), per_degree);
        }
        count *= 2;
    }
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

    /// Part of the samples, each times 1 + its absolute weight, by which the rounding of places and weights to `f32`
    /// may move an interpolated value. A narrow interval beside a wide one has weights of some thousands, which cancel.
    const ROUNDED: f64 = 4.0 * f32::EPSILON as f64;

    /// Checks that a cubic through samples of a function has the function's value at `angle`.
    fn assert_exact(line: &Line, angle: f64, of: impl Fn(f64) -> f64, angles: &[f64]) {
        let Around { entries, along: Along { cubic, .. } } = line.around(angle);
        let samples = entries.iter().map(|&entry| of(angles[entry as usize]));
        let (found, size) = samples.zip(cubic.map(f64::from)).fold((0.0, 0.0), |(sum, size), (sample, weight)| {
            (sum + sample * weight, size + sample.abs() * (1.0 + weight.abs()))
        });
        assert!((found - of(angle)).abs() <= ROUNDED * size, "{angles:?} {angle}: {found}");
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
                let weight: f32 = found
                    .entries
                    .iter()
                    .zip(found.along.cubic)
                    .filter(|(e, _)| **e == entry as u32)
                    .map(|(_, w)| w)
                    .sum();
                assert!((weight - 1.0).abs() < 1e-6, "{angles:?} {angle}: {found:?}");
                let t = found.along.t;
                let at = if t > 0.5 { 2 } else { 1 };
                assert!(t.min(1.0 - t) < 1e-6 && found.entries[at] == entry as u32);
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
            let (first, last) = (angles[0], angles[angles.len() - 1]);
            let angle = first + at * (last - first);
            assert_exact(&line, angle, |angle| angle, &angles);
            // Inner intervals, where both slopes are those of three entries.
            if angles.len() > 3 && angle >= angles[1] && angle <= angles[angles.len() - 2] {
                assert_exact(&line, angle, |angle| angle * angle, &angles);
            }
            Ok(())
        });
    }

    #[test]
    fn weights_add_up_to_one_anywhere() {
        arbtest(|u| {
            let (steps, at) = (list(u, 1..=8, |u| number(u, 0.01..80.0))?, number(u, -400.0..600.0)?);
            let angles: Vec<f64> = steps
                .iter()
                .scan(-60.0, |angle, step| {
                    *angle += step;
                    Some(*angle)
                })
                .collect();
            let closes = angles[angles.len() - 1] - angles[0] < 359.0;
            for is_circle in [false, closes] {
                let found = line(&angles, is_circle).around(at).along;
                let (sum, size) = found
                    .cubic
                    .iter()
                    .fold((0.0, 0.0), |(sum, size), &weight| (sum + f64::from(weight), size + f64::from(weight.abs())));
                assert!((sum - 1.0).abs() <= ROUNDED * size, "{angles:?} {at}: {found:?}");
                assert!((0.0..=1.0).contains(&found.t));
            }
            Ok(())
        });
    }
}
