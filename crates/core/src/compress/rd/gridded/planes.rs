//! Planes of a lattice (leaves of units on vectors), from rows of a tensor and back.

use super::super::folding::transposed;
use super::super::lines::{Grid, PairPyramid, order_of_halvings};
use super::super::spectrum::Basis;
use super::divided::DividedRows;
use super::lattice::{Lattice, Shape};
use super::nodes::Nodes;
use super::repeats::Repeats;
use crate::codec::{BitCoder, Class};
use rayon::prelude::*;
use std::borrow::Cow;

/// Number of spectra that are converted together.
const BLOCK: usize = 1 << 10;

/// Weights with which samples count in means over neighbouring directions: 1 for positive samples, 0 for zero or masked
/// ones. Negative samples have 0, unless they are to be approximated as exactly as positive ones.
pub(super) struct Weights {
    /// Weight of each sample in means over neighbouring directions: `[slice, direction]`, or `[slice, channel,
    /// direction]` if weights differ between wavelengths.
    ///
    /// A slice is a part of the tensor that is averaged on its own, for example one incoming direction.
    pub(super) values: Vec<u8>,
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
    /// Which of the tensor's spectra are those of other direction pairs.
    repeats: Repeats,
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
        let repeats = Repeats::of(&lattice);
        let grid = lattice.grid(random);
        let unit = grid.lengths().iter().product();
        Self { lattice, grid, unit, random, klt, weighs_negative, repeats }
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
        self.repeats.leaves()
    }

    /// Number of spectra in the tensor, one for each direction pair.
    pub(super) fn rows(&self) -> usize {
        self.repeats.rows()
    }

    /// Number of samples in a spectrum.
    pub(super) fn length(&self) -> usize {
        self.lattice.shape().length()
    }

    /// Drops repeated spectra: from the spectra of all pairs of incoming and outgoing direction in a tensor, returns
    /// one for each distinct pair. If samples are to be divided by a function, they come back divided; `values` are
    /// logarithms then.
    pub(super) fn leaves_of(&self, values: Vec<f32>, divided: Option<&DividedRows>) -> Vec<f32> {
        let n = self.length();
        if divided.is_none() && !self.repeats.are_any() {
            return values;
        }
        let mut leaves = Vec::with_capacity(self.leaves() * n);
        for row in (0..self.leaves()).map(|leaf| self.repeats.first_row(leaf)) {
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
            let row = self.repeats.first_row(leaf);
            let live = |class: &Class| self.weighs(*class);
            self.repeats.is_own(leaf) && classes.is_none_or(|classes| classes[row * n..][..n].iter().any(live))
        };
        let found: Vec<f32> = (0..self.leaves())
            .step_by(stride)
            .filter(is_live)
            .flat_map(|leaf| &leaves[leaf * n..][..n])
            .copied()
            .collect();
        if found.is_empty() { leaves[..n].to_vec() } else { found }
    }

    /// Converts spectra `[direction, wavelength]` to the channels to be coded, `[slice, channel, direction]`:
    /// coefficients in `basis`, or one channel for each wavelength or colour.
    pub(super) fn channels<'a>(&self, leaves: &'a [f32], basis: Option<&Basis>) -> Cow<'a, [f32]> {
        let n = self.length();
        if let Some(basis) = basis {
            return Cow::Owned(transposed(&basis.analyse(leaves), self.unit, basis.rank()).into_owned());
        }
        if n == 1 {
            return Cow::Borrowed(leaves);
        }
        let lanes = self.lattice.shape().lanes();
        let mut channels = vec![0.0; leaves.len()];
        channels.par_chunks_mut(self.unit).enumerate().for_each(|(number, channel)| {
            let (slice, lane) = (number / n, lanes[number % n]);
            let spectra = leaves[slice * self.unit * n..].chunks_exact(n);
            channel.iter_mut().zip(spectra).for_each(|(value, spectrum)| *value = spectrum[lane]);
        });
        Cow::Owned(channels)
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
            let row = self.repeats.first_row(leaf);
            let is_own = self.repeats.is_own(leaf);
            let lives = classes.is_none_or(|classes| {
                let row = &classes[row * n..][..n];
                lane.map_or_else(|| row.iter().any(live), |lane| live(&row[lane]))
            });
            u8::from(is_own && lives)
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
            (0..self.unit).map(move |leaf| own[leaf..].iter().step_by(self.unit).all(|&weight| weight > 0))
        };
        (0..self.units()).flat_map(of_unit).collect()
    }

    /// Computes the means of `vectors` channels of a single slice over the directions that each node of a coarser grid
    /// merges. They are weighted, or unweighted if all weights are 0.
    ///
    /// `visit` passes runs of values with the place of the first. Each run lies in one channel, and the runs of a
    /// channel come in ascending order.
    pub(super) fn means(
        &self,
        weights: &Weights,
        lines: &[Nodes],
        vectors: usize,
        visit: impl FnOnce(&mut dyn FnMut(usize, &[f32])),
    ) -> Vec<f32> {
        let nodes = self.lattice.nodes_of_leaves(lines);
        let count: usize = lines.iter().map(|line| line.count).product();
        let sets = weights.values.len() / self.unit;
        let mut counts = vec![[0_u32; 2]; sets * count];
        for (set, weights) in weights.values.chunks_exact(self.unit).enumerate() {
            for (&node, &weight) in nodes.iter().zip(weights) {
                let [weighs, all] = &mut counts[set * count + node as usize];
                (*weighs, *all) = (*weighs + u32::from(weight > 0), *all + 1);
            }
        }
        let counts_of = |channel: usize, node: usize| counts[channel.min(sets - 1) * count + node];
        let mut sums = vec![0.0_f64; vectors * count];
        visit(&mut |first, values| {
            let (channel, leaf) = (first / self.unit, first % self.unit);
            let weights = &weights.values[channel.min(sets - 1) * self.unit + leaf..];
            for ((&node, &value), &weight) in nodes[leaf..].iter().zip(values).zip(weights) {
                let node = node as usize;
                let weight = if counts_of(channel, node)[0] > 0 { f64::from(weight) } else { 1.0 };
                sums[channel * count + node] += weight * f64::from(value);
            }
        });
        let mean = |(at, sum): (usize, f64)| {
            let [weighs, all] = counts_of(at / count, at % count);
            (sum / f64::from(if weighs > 0 { weighs } else { all })) as f32
        };
        sums.into_iter().enumerate().map(mean).collect()
    }

    /// Computes the fraction of positive minus that of negative samples among the measured ones, for each node of a
    /// coarser grid. NaN if none is measured. Copies of a direction at a pole are left out.
    ///
    /// `visit` gets the number of a wavelength and its fractions, one wavelength after the other. All fractions would
    /// take twice the memory of the coarser grid's samples.
    pub(super) fn visit_shares(&self, classes: &[Class], lines: &[Nodes], mut visit: impl FnMut(usize, &[f32])) {
        let n = self.length();
        let nodes = self.lattice.nodes_of_leaves(lines);
        let count = nodes.last().map_or(0, |&last| last as usize + 1);
        for lane in 0..n {
            let mut sums = vec![(0_i32, 0_u32); count];
            for (leaf, &node) in nodes.iter().enumerate().filter(|(leaf, _)| self.repeats.is_own(*leaf)) {
                let (sum, measured) = &mut sums[node as usize];
                match classes[self.repeats.first_row(leaf) * n + lane] {
                    Class::Positive => (*sum, *measured) = (*sum + 1, *measured + 1),
                    Class::Negative => (*sum, *measured) = (*sum - 1, *measured + 1),
                    Class::Zero => *measured += 1,
                    Class::Masked => {}
                }
            }
            let share = |(sum, measured): (i32, u32)| (f64::from(sum) / f64::from(measured)) as f32;
            visit(lane, &sums.into_iter().map(share).collect::<Vec<_>>());
        }
    }

    /// Finds the order of merging neighbouring angles in which coding `channels` with a quantiser step costs least, and
    /// estimates its bits.
    pub(super) fn order_of_halvings(&self, channels: &[f32], classes: Option<&[Class]>, step: f64) -> (Vec<u8>, f64) {
        let weights = self.weights(classes).values;
        order_of_halvings(&self.grid, channels, (&weights, channels.len() / weights.len()), step)
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
        let channels = (planes, self.unit);
        match basis {
            // A spectrum that several rows share is computed once.
            Some(_) if self.leaves() < self.rows() => {
                let n = self.length();
                let mut leaves = vec![0.0; self.leaves() * n];
                self.synthesise_rows(basis, channels, |leaf| leaf, &mut leaves);
                values.par_chunks_exact_mut(n).enumerate().with_min_len(BLOCK).for_each(|(row, spectrum)| {
                    spectrum.copy_from_slice(&leaves[self.repeats.leaf(row) * n..][..n]);
                });
            }
            _ => self.synthesise_rows(basis, channels, |row| self.repeats.leaf(row), values),
        }
    }

    /// Converts decoded channels to the values of some spectra. Spectrum i takes grid node number `node_of(i)`; a
    /// channel has `unit` nodes.
    pub(super) fn synthesise_rows(
        &self,
        basis: Option<&Basis>,
        (planes, unit): (&[f32], usize),
        node_of: impl Fn(usize) -> usize + Sync,
        values: &mut [f32],
    ) {
        let n = self.length();
        let vectors = basis.map_or(n, Basis::rank);
        let lanes = if basis.is_some() { (0..vectors).collect() } else { self.lattice.shape().lanes() };
        // Rearranges coefficients from `[slice, channel, node]` to one row for each spectrum.
        let gather = |first: usize, rows: &mut [f32]| {
            let count = rows.len() / vectors;
            let place = |node: usize| node / unit * vectors * unit + node % unit;
            let places: Vec<usize> = (first..first + count).map(|row| place(node_of(row))).collect();
            for (number, &lane) in lanes.iter().enumerate() {
                let channel = &planes[number * unit..];
                for (row, &place) in rows.chunks_exact_mut(vectors).zip(&places) {
                    row[lane] = channel[place];
                }
            }
        };
        values.par_chunks_mut(n * BLOCK).enumerate().for_each(|(block, values)| {
            let first = block * BLOCK;
            match basis {
                Some(basis) => {
                    let mut coefficients = vec![0.0; values.len() / n * vectors];
                    gather(first, &mut coefficients);
                    basis.synthesise(&coefficients, values);
                }
                None => gather(first, values),
            }
        });
    }
}
