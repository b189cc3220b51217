//! Planes of triangles as a pyramid of means, each level predicted from the decoded one above it, in closed loop.
//!
//! The prediction error is transformed orthonormally among the children of a node, so that one step serves all levels.
//! An error of a mean is an error of all its leaves. Its step is therefore the leaves' step divided by the root of
//! their number.

use super::super::scales::{LARGEST, integer_of, steps_of};
use super::symmetry::{Group, Representatives};
use crate::codec::{BitCoder, DetailCoder, Surroundings};
use crate::domain::TriangleMesh;
use crate::transform::{Householder, Prediction};
use std::ops::Range;

/// Upper bound on magnitudes of details in coding contexts, so that sums cannot overflow.
const CAP: u32 = 1 << 16;

/// Coder of values on triangles, `[coded block, channel, triangle]`, as means over ever larger triangles (a pyramid). A
/// block is an incoming direction, a channel a spectral coefficient.
pub(crate) struct Pyramid {
    levels: usize,
    bases: usize,
    predictions: Vec<Prediction>,
    /// Number of the set of symmetries that map an incoming direction to itself, for each coded incoming direction.
    /// Several directions may share a set.
    fold_of: Vec<u8>,
    /// Triangles that have equal values by symmetry, on each level, for each set of symmetries that map an incoming
    /// direction to itself. The list is empty for a set that no coded incoming direction has.
    folds: Vec<Vec<LevelFold>>,
    /// Live (not entirely zero or masked) children of each triangle, as 4 bits, by level, coded incoming direction and
    /// triangle; empty if all are live.
    live: Vec<Vec<u8>>,
    householders: [Householder; 3],
}

/// Triangles of one subdivision level that have equal values, because symmetries that leave an incoming direction in
/// place map them to each other.
#[derive(Clone, Debug)]
struct LevelFold {
    /// For each triangle, the lowest-numbered triangle that it equals by symmetry, possibly itself.
    source: Vec<u32>,
    /// Children of each triangle (its four parts on the next finer level) by symmetry: child c has the values of child
    /// `children[c]` of the lowest-numbered triangle that equals this one.
    ///
    /// If this is the triangle itself, `children[c]` is the first of its children with these values.
    children: Vec<[u8; 4]>,
}

impl Pyramid {
    /// Builds the pyramids of means over triangles for the coded blocks (incoming directions) in `range`; `live` marks
    /// triangles with nonzero, unmasked samples, by block and triangle.
    pub(crate) fn new(
        mesh: TriangleMesh,
        group: &Group,
        representatives: &Representatives,
        range: Range<usize>,
        live: Option<&[bool]>,
    ) -> Self {
        let fold_of = representatives.kinds()[range].to_vec();
        let mut folds = vec![Vec::new(); representatives.stabilisers().len()];
        for (kind, (fold, stabiliser)) in folds.iter_mut().zip(representatives.stabilisers()).enumerate() {
            if fold_of.contains(&(kind as u8)) {
                *fold = level_folds(mesh, group, &stabiliser.members);
            }
        }
        Self {
            levels: usize::from(mesh.level()),
            bases: mesh.bases(),
            predictions: Prediction::levels(mesh),
            fold_of,
            folds,
            live: live.map_or_else(Vec::new, |live| live_levels(mesh, live)),
            householders: [Householder::new(2), Householder::new(3), Householder::new(4)],
        }
    }

    fn fold(&self, representative: usize) -> &[LevelFold] {
        &self.folds[usize::from(self.fold_of[representative])]
    }

    fn nodes(&self, level: usize) -> usize {
        self.bases << (2 * level)
    }

    /// Live (not entirely zero or masked) children of triangle `t`, as 4 bits, for one coded incoming direction.
    fn live(&self, representative: usize, level: usize, t: usize) -> u8 {
        self.live.get(level).map_or(15, |live| live[representative * self.nodes(level) + t])
    }

    /// Computes the means of values `[block, channel, triangle]` over the triangles of all levels, coarse first;
    /// `first` is the number of the first block. Triangles of only zero or masked samples do not count.
    fn means(&self, first: usize, planes: Vec<f32>, vectors: usize) -> Vec<Vec<f32>> {
        let mut levels = vec![planes];
        for level in (0..self.levels).rev() {
            let children = &levels[levels.len() - 1];
            let n = self.nodes(level);
            let means = children
                .chunks_exact(4)
                .enumerate()
                .map(|(i, c)| {
                    let live = self.live(first + i / (n * vectors), level, i % n);
                    let (mut sum, mut count) = (0.0, 0.0);
                    for (k, value) in c.iter().enumerate() {
                        if live >> k & 1 == 1 {
                            sum += value;
                            count += 1.0;
                        }
                    }
                    if count > 0.0 { sum / count } else { 0.0 }
                })
                .collect();
            levels.push(means);
        }
        levels.reverse();
        levels
    }

    /// Range of the indices of all coded blocks (incoming directions).
    pub(crate) fn all(&self) -> Range<usize> {
        0..self.fold_of.len()
    }

    /// Encodes or decodes the values `[block, channel, triangle]` of some coded blocks (incoming directions): means
    /// over the coarsest triangles, then details level by level. Only an encoder passes the values, `planes`.
    ///
    /// Returns the decoded values and the number of nonzero integers. Details at level `finest` and finer are 0 and
    /// take no bits.
    pub(crate) fn code<C: BitCoder>(
        &self,
        coder: &mut C,
        (step, vectors): (f32, usize),
        representatives: Range<usize>,
        planes: Option<Vec<f32>>,
        finest: usize,
    ) -> (Vec<f32>, u64) {
        let (first, count) = (representatives.start, representatives.len() * vectors);
        let source = planes.map(|planes| self.means(first, planes, vectors));
        let mut details = DetailCoder::default();
        let mut kept = 0;
        let roots = source.as_ref().map(|s| s[0].as_slice());
        let mut decoded = self.code_roots(coder, &mut details, (step, vectors), representatives, roots, &mut kept);
        let mut above: Vec<i32> = Vec::new();
        for level in 0..self.levels {
            let n = self.nodes(level);
            let mut children = vec![0.0; count * 4 * n];
            let mut quantised = vec![0_i32; count * 3 * n];
            for plane in 0..count {
                let (before, here) = quantised.split_at_mut(plane * 3 * n);
                let task = Plane {
                    pyramid: self,
                    level,
                    is_coded: level < finest,
                    representative: first + plane / vectors,
                    step: step_at(step, self.levels - level - 1),
                    source: source.as_ref().map(|s| &s[level + 1][plane * 4 * n..][..4 * n]),
                    means: &decoded[plane * n..][..n],
                    above: above.get(plane * 3 * (n / 4)..).unwrap_or_default(),
                    before: plane_before(plane, vectors).map(|p| &before[p * 3 * n..][..3 * n]),
                };
                kept += task.code(coder, &mut details, &mut here[..3 * n], &mut children[plane * 4 * n..][..4 * n]);
            }
            decoded = children;
            above = quantised;
        }
        (decoded, kept)
    }

    fn code_roots<C: BitCoder>(
        &self,
        coder: &mut C,
        details: &mut DetailCoder,
        (step, vectors): (f32, usize),
        representatives: Range<usize>,
        source: Option<&[f32]>,
        kept: &mut u64,
    ) -> Vec<f32> {
        let step = step_at(step, self.levels);
        let planes = representatives.len() * vectors;
        let mut decoded = vec![0.0; planes * self.bases];
        for plane in 0..planes {
            let representative = representatives.start + plane / vectors;
            let fold = self.fold(representative).first();
            let mut last = 0;
            for root in 0..self.bases {
                let at = plane * self.bases + root;
                let own = fold.map_or(root, |fold| fold.source[root] as usize);
                if own < root {
                    decoded[at] = decoded[plane * self.bases + own];
                    continue;
                }
                let wanted = source.map_or(0, |s| (s[at] / step).round().clamp(-LARGEST, LARGEST) as i32);
                let difference = details.code_root(coder, root == 0, wanted.wrapping_sub(last));
                last = last.wrapping_add(difference);
                *kept += u64::from(difference != 0);
                decoded[at] = last as f32 * step;
            }
        }
        decoded
    }
}

/// Returns the number of the spectral channel whose decoded details predict best how large those of channel `plane`
/// are.
fn plane_before(plane: usize, vectors: usize) -> Option<usize> {
    if plane.is_multiple_of(vectors) { plane.checked_sub(vectors) } else { Some(plane - 1) }
}

/// Quantiser step of means over 4^`below` triangles: the step of single triangles divided by 2^`below`.
fn step_at(step: f32, below: usize) -> f32 {
    step / (1_u32 << below) as f32
}

/// Inputs for coding the details (differences of triangles from their parents) of one pyramid level of one spectral
/// channel.
struct Plane<'a> {
    pyramid: &'a Pyramid,
    level: usize,
    is_coded: bool,
    representative: usize,
    step: f32,
    source: Option<&'a [f32]>,
    means: &'a [f32],
    above: &'a [i32],
    before: Option<&'a [i32]>,
}

impl Plane<'_> {
    fn code<C: BitCoder>(
        &self,
        coder: &mut C,
        details: &mut DetailCoder,
        quantised: &mut [i32],
        children: &mut [f32],
    ) -> u64 {
        let prediction = &self.pyramid.predictions[self.level];
        let fold = &self.pyramid.fold(self.representative)[self.level];
        let mut kept = 0;
        // Sum of the magnitudes of each node's details.
        let mut magnitudes = vec![0_u32; self.means.len()];
        for t in 0..self.means.len() {
            let own = fold.source[t] as usize;
            let same = fold.children[t];
            if own < t {
                for (c, &k) in same.iter().enumerate() {
                    children[4 * t + c] = children[4 * own + usize::from(k)];
                    if c < 3 && k < 3 {
                        quantised[3 * t + c] = quantised[3 * own + usize::from(k)];
                    }
                }
                magnitudes[t] = three(quantised, t);
                continue;
            }
            let live = self.pyramid.live(self.representative, self.level, t);
            let siblings = live.count_ones() as usize;
            if siblings < 2 {
                children[4 * t..4 * t + 4].fill(self.means[t]);
                continue;
            }
            let mut predicted = prediction.children(t, self.means);
            let order = live_first(live);
            let mut shift = 0.0;
            if siblings < 4 {
                for &c in &order[..siblings] {
                    shift += predicted[c];
                }
                shift /= siblings as f32;
            }
            predicted = order.map(|c| predicted[c] - shift);
            let householder = self.pyramid.householders[siblings - 2];
            let wanted = self.source.map_or([0.0; 3], |source| {
                householder.analyse(&std::array::from_fn(|k| source[4 * t + order[k]] - predicted[k]))
            });
            let mut residual = [0.0; 3];
            let mut around = self.surroundings(t, prediction, &magnitudes);
            for m in 0..householder.details() {
                let twin = if siblings == 4 { usize::from(same[m]) } else { m };
                let q = if twin < m {
                    quantised[3 * t + twin]
                } else if !self.is_coded {
                    0
                } else {
                    self.set_place(t, m, quantised, &mut around);
                    let q = details.code(coder, &around, integer_of(wanted[m] / self.step));
                    kept += u64::from(q != 0);
                    q
                };
                quantised[3 * t + m] = q;
                residual[m] = steps_of(q) * self.step;
            }
            magnitudes[t] = three(quantised, t);
            let deviations = householder.synthesise(&residual);
            for (k, &c) in order.iter().enumerate() {
                let deviation = if k < siblings { predicted[k] + deviations[k] } else { 0.0 };
                children[4 * t + c] = self.means[t] + deviation;
            }
        }
        kept
    }

    /// Coding context shared by all details of triangle `t`; `magnitudes` are the sums of the details of the triangles
    /// already coded.
    fn surroundings(&self, t: usize, prediction: &Prediction, magnitudes: &[u32]) -> Surroundings {
        if !self.is_coded {
            return Surroundings::default();
        }
        let (mut sum, mut count) = (0, 0);
        for &n in prediction.around(t) {
            if (n as usize) < t {
                sum += magnitudes[n as usize];
                count += 3;
            }
        }
        Surroundings {
            level: self.level as u8 + 1,
            parent: (self.level > 0).then(|| 16 * three(self.above, t / 4) / 3),
            neighbours: (count > 0).then(|| 16 * sum / count),
            ..Surroundings::default()
        }
    }

    /// Adds to the coding context `around` of triangle `t` what is known for its detail `m` (0 to 2): the magnitudes of
    /// its earlier details and of the details of this triangle in the spectral channel before.
    fn set_place(&self, t: usize, m: usize, quantised: &[i32], around: &mut Surroundings) {
        let known = &quantised[3 * t..3 * t + m];
        around.siblings = (m > 0).then(|| 16 * known.iter().map(|&q| magnitude(q)).sum::<u32>() / m as u32);
        around.before = self.before.map(|q| 16 * (2 * magnitude(q[3 * t + m]) + three(q, t)) / 5);
    }
}

fn magnitude(q: i32) -> u32 {
    q.unsigned_abs().min(CAP)
}

/// Sum of the magnitudes of a triangle's three details (transformed prediction errors of its children).
fn three(q: &[i32], node: usize) -> u32 {
    q[3 * node..][..3].iter().map(|&q| magnitude(q)).sum()
}

/// Numbers of a triangle's four children, live (not entirely zero or masked) ones first.
fn live_first(live: u8) -> [usize; 4] {
    if live == 15 {
        return [0, 1, 2, 3];
    }
    let mut order = [0; 4];
    let mut next = 0;
    for wanted in [1, 0] {
        for c in 0..4 {
            if live >> c & 1 == wanted {
                order[next] = c;
                next += 1;
            }
        }
    }
    order
}

/// Computes which children of each triangle are live (not entirely zero or masked), as 4 bits, by level, incoming
/// direction and triangle.
fn live_levels(mesh: TriangleMesh, leaves: &[bool]) -> Vec<Vec<u8>> {
    let mut levels: Vec<Vec<u8>> = Vec::new();
    for _ in 0..mesh.level() {
        let bits =
            |children: &mut dyn Iterator<Item = bool>| children.enumerate().map(|(k, live)| u8::from(live) << k).sum();
        let nodes = match levels.last() {
            None => leaves.chunks_exact(4).map(|c| bits(&mut c.iter().copied())).collect(),
            Some(finer) => finer.chunks_exact(4).map(|c| bits(&mut c.iter().map(|&live| live != 0))).collect(),
        };
        levels.push(nodes);
    }
    levels.reverse();
    levels
}

/// Computes for each level which triangles the symmetries `members` make equal.
fn level_folds(mesh: TriangleMesh, group: &Group, members: &[u8]) -> Vec<LevelFold> {
    let level = |level: u8| {
        let count = mesh.bases() << (2 * level);
        let mut fold = LevelFold { source: (0..count as u32).collect(), children: vec![[0, 1, 2, 3]; count] };
        for (t, (source, children)) in fold.source.iter_mut().zip(&mut fold.children).enumerate() {
            for &m in members {
                let (to, moved) = group.node(usize::from(m), level, t);
                if to < *source as usize {
                    (*source, *children) = (to as u32, moved);
                } else if to == t && *source as usize == t {
                    children.iter_mut().zip(moved).for_each(|(first, also)| *first = (*first).min(also));
                }
            }
        }
        fold
    };
    (0..mesh.level()).map(level).collect()
}
