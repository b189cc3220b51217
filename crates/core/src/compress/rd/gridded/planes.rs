//! Planes of a lattice (leaves of units on vectors), from rows of a tensor and back.

use super::super::folding::transposed;
use super::super::lines::{Grid, PairPyramid};
use super::super::spectrum::Basis;
use super::lattice::{Lattice, Shape};
use super::nodes::Nodes;
use crate::codec::{BitCoder, Class};
use rayon::prelude::*;
use std::borrow::Cow;

/// Weights of the leaves of all units.
pub(super) struct Weights {
    /// `[units, leaves]`, or `[units, planes, leaves]`.
    pub(super) values: Vec<f32>,
    by_plane: bool,
    /// True if one set of weights serves all units.
    are_alike: bool,
}

/// Lattice as planes `[units, vectors, leaves]`.
pub(super) struct Planes {
    lattice: Lattice,
    grid: Grid,
    /// Number of leaves of a unit.
    unit: usize,
    /// True if every incoming entry is a stream of its own.
    random: bool,
    /// True if vectors are those of a basis, not entries of rows.
    klt: bool,
    /// True if negative samples count like positive ones.
    weighs_negative: bool,
    /// Leaf that each row of the tensor equals.
    rows: Vec<u32>,
    /// First row that equals each leaf.
    first: Vec<u32>,
}

impl Planes {
    /// Codes which slices of a tensor repeat. `same` tells an encoder which samples are equal; a decoder passes `None`.
    pub(super) fn code<C: BitCoder>(
        coder: &mut C,
        shape: Shape,
        (random, klt, weighs_negative): (bool, bool, bool),
        same: Option<&dyn Fn(usize, usize) -> bool>,
    ) -> Self {
        let lattice = Lattice::code(coder, shape, same);
        let rows = lattice.rows();
        let first = lattice.first_rows(&rows);
        let grid = lattice.grid(random);
        let unit = grid.lengths().iter().product();
        Self { lattice, grid, unit, random, klt, weighs_negative, rows, first }
    }

    pub(super) fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    pub(super) fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Number of tensors that have planes of their own.
    pub(super) fn units(&self) -> usize {
        self.lattice.units(self.random)
    }

    /// Number of pyramids that are coded independently.
    pub(super) fn streams(&self) -> usize {
        if self.random { self.units() } else { 1 }
    }

    /// Number of leaves of one unit.
    pub(super) fn unit(&self) -> usize {
        self.unit
    }

    /// Number of leaves of all units.
    pub(super) fn leaves(&self) -> usize {
        self.first.len()
    }

    /// Number of rows of the tensor.
    pub(super) fn rows(&self) -> usize {
        self.rows.len()
    }

    /// Number of samples in a row.
    pub(super) fn length(&self) -> usize {
        self.lattice.shape().length()
    }

    /// Selects the rows of the leaves from the rows of the tensor.
    pub(super) fn leaves_of(&self, values: &[f32]) -> Vec<f32> {
        let n = self.length();
        self.first.iter().flat_map(|&row| &values[row as usize * n..][..n]).copied().collect()
    }

    /// Rows for the principal component analysis: leaves with a live sample, subsampled to at most about `most`
    /// samples.
    pub(super) fn spectra(&self, classes: Option<&[Class]>, leaves: &[f32], most: usize) -> Vec<f32> {
        let n = self.length();
        let stride = leaves.len().div_ceil(most) | 1;
        let is_live = |&leaf: &usize| {
            let row = self.first[leaf] as usize;
            let live = |class: &Class| self.weighs(*class);
            self.rows[row] as usize == leaf && classes.is_none_or(|classes| classes[row * n..][..n].iter().any(live))
        };
        let found: Vec<f32> = (0..self.leaves())
            .step_by(stride)
            .filter(is_live)
            .flat_map(|leaf| &leaves[leaf * n..][..n])
            .copied()
            .collect();
        if found.is_empty() { leaves[..n].to_vec() } else { found }
    }

    /// Converts coefficients `[leaves, vectors]` to planes.
    pub(super) fn of_coefficients<'a>(&self, coefficients: &'a [f32], vectors: usize) -> Cow<'a, [f32]> {
        transposed(coefficients, self.unit, vectors)
    }

    /// Converts the entries of rows `[leaves, length]` to planes.
    pub(super) fn of_lanes<'a>(&self, leaves: &'a [f32]) -> Cow<'a, [f32]> {
        let n = self.length();
        if n != 3 {
            return transposed(leaves, self.unit, n);
        }
        let turned: Vec<f32> = leaves.chunks_exact(3).flat_map(|row| [row[1], row[2], row[0]]).collect();
        Cow::Owned(transposed(&turned, self.unit, n).into_owned())
    }

    fn weighs(&self, class: Class) -> bool {
        class == Class::Positive || self.weighs_negative && class == Class::Negative
    }

    /// Weights of leaves: 1 where a sample is positive (or negative, if these count), else 0. Copies within a pole also
    /// have 0. A leaf of weight 0 takes the predicted value.
    pub(super) fn weights(&self, classes: Option<&[Class]>) -> Weights {
        let n = self.length();
        let live = |class: &Class| self.weighs(*class);
        let weight = |leaf: usize, lane: Option<usize>| {
            let row = self.first[leaf] as usize;
            let is_own = self.rows[row] as usize == leaf;
            let lives = classes.is_none_or(|classes| {
                let row = &classes[row * n..][..n];
                lane.map_or_else(|| row.iter().any(live), |lane| live(&row[lane]))
            });
            if is_own && lives { 1.0 } else { 0.0 }
        };
        let by_plane = !self.klt && classes.is_some();
        let lanes: Vec<Option<usize>> =
            if by_plane { self.lattice.shape().lanes().into_iter().map(Some).collect() } else { vec![None] };
        let are_alike = classes.is_none() && !(self.random && self.lattice.has_incoming_poles());
        let units = if are_alike { 1 } else { self.units() };
        let mut values = Vec::with_capacity(units * self.unit * lanes.len());
        for unit in 0..units {
            for &lane in &lanes {
                values.extend((unit * self.unit..(unit + 1) * self.unit).map(|leaf| weight(leaf, lane)));
            }
        }
        Weights { values, by_plane, are_alike }
    }

    /// Marks the leaves with a nonzero weight in every plane.
    pub(super) fn live_leaves(&self, weights: &Weights) -> Vec<bool> {
        let lanes = if weights.by_plane { self.length() } else { 1 };
        let of_unit = |unit: usize| {
            let unit = if weights.are_alike { 0 } else { unit };
            let own = &weights.values[unit * lanes * self.unit..][..lanes * self.unit];
            (0..self.unit).map(move |leaf| own[leaf..].iter().step_by(self.unit).all(|&weight| weight > 0.0))
        };
        (0..self.units()).flat_map(of_unit).collect()
    }

    /// Means of the planes of one stream over the leaves that each node of a level merges, as a pyramid computes them:
    /// weighted, or unweighted if all weights are 0.
    pub(super) fn means(&self, planes: &[f32], weights: &Weights, lines: &[Nodes]) -> Vec<f32> {
        let nodes = self.lattice.nodes_of_leaves(lines);
        let count = lines.iter().map(|line| line.count).product();
        let sets = weights.values.len() / self.unit;
        let mean_of = |(plane, values): (usize, &[f32])| {
            let weights = &weights.values[plane.min(sets - 1) * self.unit..][..self.unit];
            let mut sums = vec![[0.0_f64; 4]; count];
            for ((&node, &value), &weight) in nodes.iter().zip(values).zip(weights) {
                let (value, weight) = (f64::from(value), f64::from(weight));
                let [sum, weighs, all, number] = &mut sums[node as usize];
                (*sum, *weighs) = (*sum + weight * value, *weighs + weight);
                (*all, *number) = (*all + value, *number + 1.0);
            }
            let mean = |[sum, weighs, all, number]: [f64; 4]| if weighs > 0.0 { sum / weighs } else { all / number };
            sums.into_iter().map(mean).map(|mean| mean as f32).collect::<Vec<_>>()
        };
        planes.chunks_exact(self.unit).enumerate().flat_map(mean_of).collect()
    }

    /// Fraction of positive minus fraction of negative samples among the measured ones, for each node of a level and
    /// entry of a row. NaN if none is measured. Copies within a pole are left out.
    pub(super) fn shares(&self, classes: &[Class], lines: &[Nodes]) -> Vec<f32> {
        let n = self.length();
        let nodes = self.lattice.nodes_of_leaves(lines);
        let count = nodes.last().map_or(0, |&last| last as usize + 1);
        let mut sums = vec![(0_i64, 0_i64); count * n];
        for (leaf, &node) in nodes.iter().enumerate() {
            let row = self.first[leaf] as usize;
            if self.rows[row] as usize != leaf {
                continue;
            }
            for (lane, class) in classes[row * n..][..n].iter().enumerate() {
                let (sum, measured) = &mut sums[node as usize * n + lane];
                match class {
                    Class::Positive => (*sum, *measured) = (*sum + 1, *measured + 1),
                    Class::Negative => (*sum, *measured) = (*sum - 1, *measured + 1),
                    Class::Zero => *measured += 1,
                    Class::Masked => {}
                }
            }
        }
        sums.into_iter().map(|(sum, measured)| (sum as f64 / measured as f64) as f32).collect()
    }

    /// Builds the pyramids of all streams, only one if all streams are alike.
    pub(super) fn pyramids(&self, order: &[u8], weights: &Weights) -> Vec<PairPyramid> {
        let streams = if weights.are_alike { 1 } else { self.streams() };
        (0..streams).into_par_iter().map(|k| self.pyramid(order, weights, k)).collect()
    }

    /// Builds the pyramid of one stream.
    pub(super) fn pyramid(&self, order: &[u8], weights: &Weights, stream: usize) -> PairPyramid {
        let (stream, streams) = if weights.are_alike { (0, 1) } else { (stream, self.streams()) };
        let length = weights.values.len() / streams;
        PairPyramid::new(&self.grid, order, &weights.values[stream * length..][..length], weights.by_plane)
    }

    /// Converts planes of all units to the values of all samples.
    pub(super) fn synthesise(&self, basis: Option<&Basis>, planes: &[f32], values: &mut [f32]) {
        self.synthesise_rows(basis, (planes, self.unit), &self.rows, values);
    }

    /// Converts planes to the values of `rows`. Each row names the node that it equals, in units of `unit` nodes.
    pub(super) fn synthesise_rows(
        &self,
        basis: Option<&Basis>,
        (planes, unit): (&[f32], usize),
        rows: &[u32],
        values: &mut [f32],
    ) {
        let n = self.length();
        let vectors = basis.map_or(n, Basis::rank);
        let coefficients = transposed(planes, vectors, unit);
        let mut leaves = vec![0.0; coefficients.len() / vectors * n];
        if let Some(basis) = basis {
            basis.synthesise(&coefficients, &mut leaves);
        } else {
            let lanes = self.lattice.shape().lanes();
            for (leaf, row) in leaves.chunks_exact_mut(n).zip(coefficients.chunks_exact(n)) {
                lanes.iter().zip(row).for_each(|(&lane, &value)| leaf[lane] = value);
            }
        }
        values.par_chunks_mut(n << 10).zip(rows.par_chunks(1 << 10)).for_each(|(values, rows)| {
            for (value, &leaf) in values.chunks_exact_mut(n).zip(rows) {
                value.copy_from_slice(&leaves[leaf as usize * n..][..n]);
            }
        });
    }
}
