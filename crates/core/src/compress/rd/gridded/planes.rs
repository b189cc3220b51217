//! Planes of a lattice (leaves of units on vectors), from rows of a tensor and back.

use super::super::folding::transposed;
use super::super::lines::{Grid, PairPyramid};
use super::super::spectrum::Basis;
use super::divided::DividedRows;
use super::lattice::{Lattice, Shape};
use super::nodes::Nodes;
use crate::codec::{BitCoder, Class};
use rayon::prelude::*;
use std::borrow::Cow;

/// Weights with which samples count in means over neighbouring directions: 1 for positive samples, 0 for zero or masked
/// ones. Negative samples have 0, unless they are to be approximated as exactly as positive ones.
pub(super) struct Weights {
    /// Weight of each sample in means over neighbouring directions: `[slice, direction]`, or `[slice, channel,
    /// direction]` if weights differ between wavelengths.
    ///
    /// A slice is a part of the tensor that is averaged on its own, for example one incoming direction.
    pub(super) values: Vec<f32>,
    by_plane: bool,
    /// True if directions have the same weights, in means over neighbouring directions, in every slice of the tensor
    /// (for example each incoming direction). Only one set of weights is then stored.
    are_alike: bool,
}

/// Layout of a tensor on grids of angles as `[slice, channel, direction]`: independently coded slices, spectral
/// coefficients, distinct directions.
pub(super) struct Planes {
    lattice: Lattice,
    grid: Grid,
    /// Number of distinct directions in a part of the tensor that is coded on its own: pairs of incoming and outgoing
    /// direction, or the outgoing directions of one incoming one.
    unit: usize,
    /// True if every incoming direction is coded as a byte stream of its own.
    random: bool,
    /// True if the coded channels are coefficients of a spectral basis, false if they are single wavelengths or
    /// colours.
    klt: bool,
    /// True if negative samples are approximated as exactly as positive ones.
    weighs_negative: bool,
    /// For each direction pair of the tensor, number of the distinct direction pair whose samples it repeats.
    rows: Vec<u32>,
    /// For each distinct direction pair, number of the first direction pair of the tensor that has its samples.
    first: Vec<u32>,
}

impl Planes {
    /// Encodes or decodes which slices of a tensor repeat others. `same` tells an encoder which samples are equal; a
    /// decoder passes `None`.
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

    /// Number of slices in which the tensor is coded: one for each incoming direction if these are independent, else
    /// one for each entry of the axes before all directions.
    pub(super) fn units(&self) -> usize {
        self.lattice.units(self.random)
    }

    /// Number of byte streams that are coded independently: one for each distinct incoming direction, or one in all.
    pub(super) fn streams(&self) -> usize {
        if self.random { self.units() } else { 1 }
    }

    /// Number of distinct directions in a part of the tensor that is coded on its own: pairs of incoming and outgoing
    /// direction, or the outgoing directions of one incoming one.
    pub(super) fn unit(&self) -> usize {
        self.unit
    }

    /// Number of distinct pairs of incoming and outgoing direction in the whole tensor.
    pub(super) fn leaves(&self) -> usize {
        self.first.len()
    }

    /// Number of spectra in the tensor, one for each direction pair.
    pub(super) fn rows(&self) -> usize {
        self.rows.len()
    }

    /// Number of samples in a spectrum.
    pub(super) fn length(&self) -> usize {
        self.lattice.shape().length()
    }

    /// Drops repeated spectra: from the spectra of all pairs of incoming and outgoing direction in a tensor, returns
    /// one for each distinct pair. If samples are to be divided by a function, they come back divided; `values` are
    /// logarithms then.
    pub(super) fn leaves_of(&self, values: &[f32], divided: Option<&DividedRows>) -> Vec<f32> {
        let n = self.length();
        let mut leaves = Vec::with_capacity(self.leaves() * n);
        for row in self.first.iter().map(|&row| row as usize) {
            let divisor = divided.map_or(0.0, |divided| divided.of_row(row));
            leaves.extend(values[row * n..][..n].iter().map(|value| value - divisor));
        }
        leaves
    }

    /// Collects spectra for the principal component analysis: at most about `most` values, from directions spread
    /// evenly. Left out are spectra without a positive value, and without a negative one either if negative values are
    /// approximated as exactly as positive ones.
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

    /// Rearranges spectral coefficients from `[direction, channel]` to `[slice, channel, direction]`.
    pub(super) fn of_coefficients<'a>(&self, coefficients: &'a [f32], vectors: usize) -> Cow<'a, [f32]> {
        transposed(coefficients, self.unit, vectors)
    }

    /// Rearranges the samples of spectra from `[direction, wavelength]` to one channel for each wavelength or colour.
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

    /// Computes the weight with which each direction counts in means over neighbouring directions: 1 for a positive
    /// sample, also for a negative one if it is to be approximated as exactly; else 0.
    ///
    /// With principal components, one such sample in the direction's spectrum suffices.
    ///
    /// Copies of a direction at a pole have weight 0. Directions of weight 0 decode to values predicted from
    /// neighbours.
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

    /// Marks the directions whose samples count in means over neighbouring directions in every spectral channel.
    pub(super) fn live_leaves(&self, weights: &Weights) -> Vec<bool> {
        let lanes = if weights.by_plane { self.length() } else { 1 };
        let of_unit = |unit: usize| {
            let unit = if weights.are_alike { 0 } else { unit };
            let own = &weights.values[unit * lanes * self.unit..][..lanes * self.unit];
            (0..self.unit).map(move |leaf| own[leaf..].iter().step_by(self.unit).all(|&weight| weight > 0.0))
        };
        (0..self.units()).flat_map(of_unit).collect()
    }

    /// Computes the means of all channels over the directions that each node of a coarser grid merges. They are
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

    /// Computes the fraction of positive minus that of negative samples among the measured ones, for each node of a
    /// coarser grid and each wavelength. NaN if none is measured. Copies of a direction at a pole are left out.
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

    /// Builds the coders of sample values as means over ever larger blocks of directions (pyramids), one for each byte
    /// stream of the file. If samples weigh alike in the means of all streams, a single coder serves them.
    pub(super) fn pyramids(&self, order: &[u8], weights: &Weights) -> Vec<PairPyramid> {
        let streams = if weights.are_alike { 1 } else { self.streams() };
        (0..streams).into_par_iter().map(|k| self.pyramid(order, weights, k)).collect()
    }

    /// Builds the coder of sample values as means over ever larger blocks of directions (a pyramid), for one of the
    /// byte streams of the file. Each stream holds one incoming direction, or a single one holds all.
    pub(super) fn pyramid(&self, order: &[u8], weights: &Weights, stream: usize) -> PairPyramid {
        let (stream, streams) = if weights.are_alike { (0, 1) } else { (stream, self.streams()) };
        let length = weights.values.len() / streams;
        PairPyramid::new(&self.grid, order, &weights.values[stream * length..][..length], weights.by_plane)
    }

    /// Converts the decoded channels of all slices to the values of all samples of the tensor.
    pub(super) fn synthesise(&self, basis: Option<&Basis>, planes: &[f32], values: &mut [f32]) {
        self.synthesise_rows(basis, (planes, self.unit), &self.rows, values);
    }

    /// Converts decoded channels to the values of some spectra. Entry i of `rows` is the number of the grid node that
    /// spectrum i takes; a channel has `unit` nodes.
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
