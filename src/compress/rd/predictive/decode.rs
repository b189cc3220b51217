//! Pyramid chunks → logarithms, of the whole or of one block.

use super::super::super::values::Values;
use super::super::chart::Chart;
use super::super::folding::{live_leaves, synthesise, synthesise_rows};
use super::super::pyramid::Pyramid;
use super::super::shape::Shape;
use super::super::spectrum::Basis;
use super::super::streams::Streams;
use super::super::symmetry::Representatives;
use super::Opening;
use crate::codec::{Class, CodecError, Decoder, Reader};
use crate::domain::Axis;
use rayon::prelude::*;
use std::ops::Range;

/// The logarithms that a basis chunk and a pyramid chunk behind its levels stand for, without details below level `finest`;
/// and how many bytes of the latter they depend on. With `finish` they become magnitudes.
pub(crate) fn decode(
    axes: &[Axis],
    classes: Option<&[Class]>,
    step: f32,
    chunks: (Option<&[u8]>, &[u8]),
    finest: usize,
    finish: Option<Values>,
) -> Result<(Vec<f32>, usize), CodecError> {
    let mut opened = Opened::new(axes, step, chunks)?;
    let (fineness, count) = ((step, opened.vectors()), opened.representatives.len());
    let plane = opened.shape.leaves();
    let no_details = || vec![0.0; count * fineness.1 * plane];
    let (coefficients, mut decoded, end) = if opened.opening.random {
        if finest < usize::from(opened.shape.mesh().level()) {
            return Err(opened.r.malformed("blocks decoded by themselves have no coarser levels"));
        }
        let streams = opened.streams()?;
        let coefficients = opened.coefficients(&mut Decoder::new(streams.model()), step);
        let decoded = if opened.opening.alone {
            no_details()
        } else {
            let pyramid = opened.pyramid(classes, 0..count);
            let block = |k: usize| pyramid.code(&mut streams.block(k), fineness, k..k + 1, None, finest).0;
            (0..count).into_par_iter().flat_map_iter(block).collect()
        };
        (coefficients, decoded, opened.r.offset())
    } else {
        let start = opened.r.offset();
        let mut decoder = Decoder::new(opened.r.take(opened.r.remaining(), "pyramid")?);
        let coefficients = opened.coefficients(&mut decoder, step);
        let decoded = if opened.opening.alone {
            no_details()
        } else {
            opened.pyramid(classes, 0..count).code(&mut decoder, fineness, 0..count, None, finest).0
        };
        (coefficients, decoded, start + decoder.position())
    };
    add_model(&mut decoded, opened.model(coefficients, 0..count));
    let mut logs = vec![0.0; axes.iter().map(Axis::len).product()];
    let Opened { shape, opening, representatives, basis, .. } = &opened;
    synthesise(shape, &opening.group, representatives, (basis.as_ref(), &decoded), finish, &mut logs);
    Ok((logs, end))
}

/// The logarithms of one block, bit for bit those that [`decode`] has: `[leaves, length]`; nothing else is decoded but the
/// basis and the model.
pub(crate) fn decode_block(
    axes: &[Axis],
    classes: Option<&[Class]>,
    step: f32,
    chunks: (Option<&[u8]>, &[u8]),
    block: usize,
) -> Result<Vec<f32>, CodecError> {
    let mut opened = Opened::new(axes, step, chunks)?;
    if !opened.opening.random {
        return Err(opened.r.malformed("blocks that are not decoded by themselves"));
    }
    let streams = opened.streams()?;
    let group = &opened.opening.group;
    let found = if block < opened.shape.blocks() { opened.representatives.of_block(group, block) } else { None };
    let (k, member) = found.ok_or_else(|| opened.r.malformed(format!("there is no block {block}")))?;
    let (vectors, leaves, n) = (opened.vectors(), opened.shape.leaves(), opened.shape.length());
    let coefficients = opened.coefficients(&mut Decoder::new(streams.model()), step);
    let mut decoded = if opened.opening.alone {
        vec![0.0; vectors * leaves]
    } else {
        let pyramid = opened.pyramid(classes, k..k + 1);
        pyramid.code(&mut streams.block(k), (step, vectors), 0..1, None, usize::MAX).0
    };
    add_model(&mut decoded, opened.model(coefficients, k..k + 1));
    let mut rows = vec![0.0; leaves * n];
    synthesise_rows(opened.basis.as_ref(), leaves, &decoded, &mut rows);
    let mut logs = vec![0.0; rows.len()];
    for (leaf, row) in rows.chunks_exact(n).enumerate() {
        logs[opened.opening.group.leaf(member, leaf) * n..][..n].copy_from_slice(row);
    }
    Ok(logs)
}

/// Whether every block of a pyramid is decoded by itself.
pub(crate) fn is_random(axes: &[Axis], coded: &[u8]) -> Result<bool, CodecError> {
    let no_triangles = || CodecError::Malformed { at: 0, reason: "a pyramid without a triangle axis".to_owned() };
    let shape = Shape::of(axes).ok_or_else(no_triangles)?;
    Ok(Opening::read(&shape, &mut Reader::new(coded, 0))?.random)
}

/// What is decoded before any pyramid.
struct Opened<'a> {
    shape: Shape,
    opening: Opening,
    basis: Option<Basis>,
    representatives: Representatives,
    chart: Option<Chart>,
    r: Reader<'a>,
}

impl<'a> Opened<'a> {
    fn new(axes: &[Axis], step: f32, (basis, coded): (Option<&[u8]>, &'a [u8])) -> Result<Self, CodecError> {
        let malformed = |reason: &str| CodecError::Malformed { at: 0, reason: reason.to_owned() };
        let shape = Shape::of(axes).ok_or_else(|| malformed("a pyramid without a triangle axis"))?;
        let basis = match basis {
            Some(chunk) if shape.length() > 1 => Some(Basis::decode(chunk, axes, shape.rows(), step)?),
            None if shape.length() == 1 => None,
            _ => return Err(malformed("a basis chunk without a spectral axis, or none with one")),
        };
        let mut r = Reader::new(coded, 0);
        let opening = Opening::read(&shape, &mut r)?;
        let representatives = opening.group.representatives();
        let chart = match opening.model {
            None => None,
            Some(kind) => {
                let chart = Chart::new(kind, &shape, &representatives);
                Some(chart.ok_or_else(|| malformed("a model that makes no sense here"))?)
            }
        };
        Ok(Self { shape, opening, basis, representatives, chart, r })
    }

    fn vectors(&self) -> usize {
        self.basis.as_ref().map_or(1, Basis::rank)
    }

    /// The streams of a pyramid whose blocks are decoded by themselves.
    fn streams(&mut self) -> Result<Streams<'a>, CodecError> {
        let blocks = if self.opening.alone { 0 } else { self.representatives.len() };
        Streams::read(&mut self.r, self.chart.is_some(), blocks)
    }

    /// The model's planes of some representatives.
    fn model(&self, coefficients: Vec<f64>, representatives: Range<usize>) -> Option<Vec<f32>> {
        self.chart.as_ref().map(|chart| chart.evaluate(coefficients, self.vectors(), representatives))
    }

    /// The model's coefficients.
    fn coefficients(&self, decoder: &mut Decoder<'_>, step: f32) -> Vec<f64> {
        self.chart.as_ref().map_or_else(Vec::new, |chart| chart.code(decoder, step, self.vectors(), None, &mut 0))
    }

    /// The pyramids of some representatives.
    fn pyramid(&self, classes: Option<&[Class]>, representatives: Range<usize>) -> Pyramid {
        let (group, all) = (&self.opening.group, &self.representatives);
        let live = live_leaves(&self.shape, group, all, representatives.clone(), classes);
        Pyramid::new(self.shape.mesh(), group, all, representatives, live.as_deref())
    }
}

/// Adds the model, if there is one.
fn add_model(decoded: &mut [f32], model: Option<Vec<f32>>) {
    if let Some(model) = model {
        decoded.iter_mut().zip(model).for_each(|(x, m)| *x += m);
    }
}
