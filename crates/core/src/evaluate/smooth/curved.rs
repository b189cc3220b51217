//! Interpolation between incidences along curves, for one query or a block of them: cubics in the polar angle of
//! incidence, quadratics over triangles of incoming directions.

use super::course::{Course, Lanes};
use super::{Seen, SeenBlock, Smooth};
use crate::evaluate::between::{FOUR, held};
use crate::evaluate::carried::known;
use crate::evaluate::elements::{NODES, Patches};
use crate::evaluate::incoming::{Alignment, Origin, carried_to_four};
use crate::evaluate::kernel::BLOCK;
use crate::evaluate::mixed::{MOST_PLANES, Mixed};
use crate::numeric::wide;

/// Number of nodes over incoming directions through which a quadratic over a triangle passes.
const SIX: usize = 6;

/// Block of queries along curves, with what is found for each query and node over incoming directions.
struct CurvedBlock<const COUNT: usize> {
    lanes: [Lanes; BLOCK],
    /// Nodes and weights for interpolation at the outgoing direction of each query, in the table of each incoming node.
    patches: [Patches<BLOCK>; COUNT],
    /// Factor on the weight of each incoming node: 1, but nearly 0 where a lobe moves towards the horizon.
    worths: [[f32; BLOCK]; COUNT],
}

impl Smooth {
    /// Spectral coefficients for a pair of directions along the curve between incoming directions; those of a quotient
    /// if there is a divisor.
    #[inline(always)]
    pub(super) fn along_curve(&self, course: &Course, entry: usize, seen: &Seen) -> Mixed {
        match (self.width, course.is_wide()) {
            (4, false) => self.along_curve_in::<4, FOUR, 1>(course, entry, seen),
            (8, false) => self.along_curve_in::<8, FOUR, 1>(course, entry, seen),
            (12, false) => self.along_curve_in::<12, FOUR, 1>(course, entry, seen),
            (_, false) => self.along_curve_in::<MOST_PLANES, FOUR, 1>(course, entry, seen),
            (4, true) => self.along_curve_in::<4, SIX, 2>(course, entry, seen),
            (8, true) => self.along_curve_in::<8, SIX, 2>(course, entry, seen),
            (12, true) => self.along_curve_in::<12, SIX, 2>(course, entry, seen),
            (_, true) => self.along_curve_in::<MOST_PLANES, SIX, 2>(course, entry, seen),
        }
    }

    /// Interpolates spectral coefficients as [`Smooth::along_curve`] does, compiled for `WIDTH` coefficients and for
    /// `COUNT` interpolation nodes over incoming directions, in `GROUPS` groups of four.
    #[inline(always)]
    fn along_curve_in<const WIDTH: usize, const COUNT: usize, const GROUPS: usize>(
        &self,
        course: &Course,
        entry: usize,
        &Seen { around, wi, wo }: &Seen,
    ) -> Mixed {
        let lanes = course.lanes(&self.nodes, &around);
        let (mut patches, mut worths) = ([const { Patches::<FOUR>::NOWHERE }; GROUPS], [0.0; COUNT]);
        for (group, patches) in patches.iter_mut().enumerate() {
            let to: [Origin; FOUR] =
                std::array::from_fn(|k| self.origins[lanes.nodes[(group * FOUR + k).min(COUNT - 1)] as usize]);
            let (there, worth) = carried_to_four(self.alignment, self.domain, Origin::new(wi), to, wo);
            self.elements.write(there, patches, 0);
            worths.iter_mut().skip(group * FOUR).zip(worth.to_array()).for_each(|(to, worth)| *to = worth);
        }
        self.curved::<WIDTH, COUNT, FOUR>(entry, &lanes, worths, |k| (&patches[k / FOUR], k % FOUR))
    }

    /// Writes the spectral coefficients of the first `to.len()` queries of a block along the curve between incoming
    /// directions; those of quotients if there is a divisor. Not inlined, because each kind of query would compile its
    /// versions again.
    #[inline(never)]
    pub(super) fn block_along_curve(
        &self,
        alignment: Alignment,
        course: &Course,
        entry: usize,
        seen: &SeenBlock,
        to: &mut [Mixed],
    ) {
        wide(
            #[inline(always)]
            || {
                if course.is_wide() {
                    self.block_through::<SIX>(alignment, course, entry, seen, to);
                } else {
                    self.block_through::<FOUR>(alignment, course, entry, seen, to);
                }
            },
        );
    }

    /// Interpolates the queries of a block as [`Smooth::block_along_curve`] does, compiled for `COUNT` interpolation
    /// nodes over incoming directions.
    #[inline(always)]
    fn block_through<const COUNT: usize>(
        &self,
        alignment: Alignment,
        course: &Course,
        entry: usize,
        seen: &SeenBlock,
        to: &mut [Mixed],
    ) {
        let mut block = CurvedBlock::<COUNT> {
            lanes: std::array::from_fn(|i| course.lanes(&self.nodes, &seen.around(i))),
            patches: [const { Patches::NOWHERE }; COUNT],
            worths: [[0.0; BLOCK]; COUNT],
        };
        known(
            alignment,
            #[inline(always)]
            |alignment| self.look_up_curves(alignment, seen, &mut block),
        );
        match self.width {
            4 => self.curved_block::<4, COUNT>(entry, &block, to),
            8 => self.curved_block::<8, COUNT>(entry, &block, to),
            12 => self.curved_block::<12, COUNT>(entry, &block, to),
            _ => self.curved_block::<MOST_PLANES, COUNT>(entry, &block, to),
        }
    }

    /// For each query of a block and each incoming node of its curve: moves the outgoing direction with the lobe to
    /// that node and writes the interpolation patch there.
    #[inline(always)]
    fn look_up_curves<const COUNT: usize>(
        &self,
        alignment: Alignment,
        seen: &SeenBlock,
        CurvedBlock { lanes, patches, worths }: &mut CurvedBlock<COUNT>,
    ) {
        let origins = seen.origins();
        let wo = seen.wo.map(|numbers| numbers.map(|x| x as f32));
        for (k, (patches, worths)) in patches.iter_mut().zip(worths).enumerate() {
            self.carry_block(
                alignment,
                [&origins, &self.origins_of(alignment, |i| lanes[i].nodes[k])],
                &wo,
                #[inline(always)]
                |i, there, worth| {
                    self.elements.write(there, patches, i);
                    worths[i] = worth;
                },
            );
        }
    }

    /// Sums the spectral coefficients at the nodes of a block of queries, compiled for `WIDTH` coefficients.
    #[inline(always)]
    fn curved_block<const WIDTH: usize, const COUNT: usize>(
        &self,
        entry: usize,
        block: &CurvedBlock<COUNT>,
        to: &mut [Mixed],
    ) {
        for (i, to) in to.iter_mut().enumerate() {
            let worths = block.worths.each_ref().map(|worths| worths[i]);
            *to = self.curved::<WIDTH, COUNT, BLOCK>(entry, &block.lanes[i], worths, |k| (&block.patches[k], i));
        }
    }

    /// Spectral coefficients at the nodes of one query, mixed along the curve. `at(k)` returns the outgoing nodes
    /// and their weights in the table of incoming node `k`, and the SIMD lane that holds this query's. Linear
    /// interpolation takes the place of the curve where an incoming node loses weight or has no light.
    #[inline(always)]
    fn curved<'a, const WIDTH: usize, const COUNT: usize, const N: usize>(
        &self,
        entry: usize,
        lanes: &Lanes,
        worths: [f32; COUNT],
        at: impl Fn(usize) -> (&'a Patches<N>, usize),
    ) -> Mixed {
        let (mut rows, mut shares) = ([[0.0_f32; WIDTH]; COUNT], [1.0_f32; COUNT]);
        let (mut live, mut known) = (0.0, 0.0);
        for k in (0..COUNT).filter(|&k| lanes.is_used(k)) {
            let (patches, lane) = at(k);
            let base = (entry * self.node_count + lanes.nodes[k] as usize) * self.elements.len();
            let mut known_share = 1.0;
            if !self.presence.is_empty() {
                (shares[k], known_share) = self.presence_in(base, patches, lane);
            }
            rows[k] = self.row_in::<WIDTH, N>(base, patches, lane);
            let weight = lanes.linear[k] * worths[k];
            if known_share > 0.0 {
                known += weight;
                live += weight * shares[k];
            } else {
                shares[k] = 0.0;
            }
        }
        // Weights are small where all nodes lose weight: the threshold of a negligible one scales with them.
        let scale = 1.0 / (0..COUNT).map(|k| lanes.linear[k] * worths[k]).sum::<f32>();
        let mut row = [0.0; MOST_PLANES];
        let (mut low, mut high) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        for (k, values) in rows.iter().enumerate().filter(|&(k, _)| lanes.linear[k] > 0.0) {
            let weight = lanes.linear[k] * worths[k] * shares[k];
            for plane in 0..WIDTH {
                row[plane] += weight * values[plane];
                low[plane] = low[plane].min(values[plane]);
                high[plane] = high[plane].max(values[plane]);
            }
        }
        for value in &mut row[..WIDTH] {
            *value *= scale;
        }
        let mut mixed = Mixed::settled(row, live * scale, known * scale);
        let Some(weights) = lanes.curve else { return mixed };
        let mut curve = [0.0; WIDTH];
        for (values, weight) in rows.iter().zip(weights) {
            curve.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
        }
        let used = (0..COUNT).filter(|&k| weights[k] != 0.0);
        let worth = used.fold(1.0_f32, |least, k| least.min(worths[k]).min(shares[k]));
        for plane in 0..WIDTH {
            let value = &mut mixed.row[plane];
            *value += worth * (held(curve[plane], [low[plane], high[plane]]) - *value);
        }
        mixed
    }

    /// Spectral coefficients at one outgoing direction, interpolated in the table of one incoming direction. SIMD lane
    /// number `lane` of `patches` holds the six nodes around the outgoing direction and their weights.
    #[inline(always)]
    fn row_in<const WIDTH: usize, const N: usize>(
        &self,
        base: usize,
        patches: &Patches<N>,
        lane: usize,
    ) -> [f32; WIDTH] {
        let table = self.values.as_chunks::<WIDTH>().0;
        let mut row = [0.0; WIDTH];
        for node in 0..NODES {
            let weight = patches.weights[node][lane];
            let values = &table[base + patches.nodes[node][lane] as usize];
            row.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
        }
        row
    }
}
