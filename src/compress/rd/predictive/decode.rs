//! Pyramid chunks → logarithms, of the whole or of one block.

use super::super::chart::Chart;
use super::super::pyramid::Pyramid;
use super::super::spectrum::Basis;
use super::super::streams::Streams;
use super::super::symmetry::{Member, Representative};
use super::{Plan, Shape, live_leaves, synthesise, transposed};
use crate::codec::{Class, CodecError, Decoder, Reader};
use crate::domain::Axis;
use rayon::prelude::*;
use std::ops::Range;

/// The logarithms that a basis chunk and a pyramid chunk behind its levels stand for, without details below level `finest`;
/// and how many bytes of the latter they depend on.
pub(crate) fn decode(
    axes: &[Axis],
    classes: Option<&[Class]>,
    step: f32,
    chunks: (Option<&[u8]>, &[u8]),
    finest: usize,
) -> Result<(Vec<f32>, usize), CodecError> {
    let mut opened = Opened::new(axes, step, chunks)?;
    let (fineness, count) = ((step, opened.vectors()), opened.representatives.len());
    let plane = opened.shape.mesh.len();
    let no_details = || vec![0.0; count * fineness.1 * plane];
    let (coefficients, mut decoded, end) = if opened.plan.random {
        if finest < usize::from(opened.shape.mesh.level()) {
            return Err(opened.r.malformed("blocks decoded by themselves have no coarser levels"));
        }
        let streams = opened.streams()?;
        let coefficients = opened.coefficients(&mut Decoder::new(streams.model()), step);
        let decoded = if opened.plan.alone {
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
        let decoded = if opened.plan.alone {
            no_details()
        } else {
            opened.pyramid(classes, 0..count).code(&mut decoder, fineness, 0..count, None, finest).0
        };
        (coefficients, decoded, start + decoder.position())
    };
    add_model(&mut decoded, opened.model(coefficients, 0..count));
    let mut logs = vec![0.0; axes.iter().map(Axis::len).product()];
    let Opened { shape, plan, representatives, basis, .. } = &opened;
    synthesise(shape, &plan.group, representatives, basis.as_ref(), &decoded, &mut logs);
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
    if !opened.plan.random {
        return Err(opened.r.malformed("blocks that are not decoded by themselves"));
    }
    let streams = opened.streams()?;
    let stands_for = |member: &&Member, r: &Representative| member.blocks[r.block] as usize == block;
    let members = opened.plan.group.members();
    let found = opened.representatives.iter().position(|r| members.iter().any(|member| stands_for(&member, r)));
    let k = found.ok_or_else(|| opened.r.malformed(format!("there is no block {block}")))?;
    let (vectors, leaves) = (opened.vectors(), opened.shape.mesh.len());
    let coefficients = opened.coefficients(&mut Decoder::new(streams.model()), step);
    let mut decoded = if opened.plan.alone {
        vec![0.0; vectors * leaves]
    } else {
        let pyramid = opened.pyramid(classes, k..k + 1);
        pyramid.code(&mut streams.block(k), (step, vectors), 0..1, None, usize::MAX).0
    };
    add_model(&mut decoded, opened.model(coefficients, k..k + 1));
    let rows = transposed(&decoded, vectors, leaves);
    let mut own = vec![0.0; rows.len()];
    // Where several members lead here, the last has the say, as in the whole.
    for member in members.iter().filter(|member| stands_for(member, &opened.representatives[k])) {
        for (source, &leaf) in rows.chunks_exact(vectors).zip(&member.leaves) {
            own[leaf as usize * vectors..][..vectors].copy_from_slice(source);
        }
    }
    Ok(match &opened.basis {
        Some(basis) => {
            let mut logs = vec![0.0; leaves * opened.shape.length];
            basis.synthesise(&own, &mut logs);
            logs
        }
        None => own,
    })
}

/// Whether every block of a pyramid is decoded by itself.
pub(crate) fn is_random(axes: &[Axis], coded: &[u8]) -> Result<bool, CodecError> {
    let no_triangles = || CodecError::Malformed { at: 0, reason: "a pyramid without a triangle axis".to_owned() };
    let shape = Shape::of(axes).ok_or_else(no_triangles)?;
    Ok(Plan::read(&shape, &mut Reader::new(coded, 0))?.random)
}

/// What is decoded before any pyramid.
struct Opened<'a> {
    shape: Shape,
    plan: Plan,
    basis: Option<Basis>,
    representatives: Vec<Representative>,
    chart: Option<Chart>,
    r: Reader<'a>,
}

impl<'a> Opened<'a> {
    fn new(axes: &[Axis], step: f32, (basis, coded): (Option<&[u8]>, &'a [u8])) -> Result<Self, CodecError> {
        let malformed = |reason: &str| CodecError::Malformed { at: 0, reason: reason.to_owned() };
        let shape = Shape::of(axes).ok_or_else(|| malformed("a pyramid without a triangle axis"))?;
        let basis = match basis {
            Some(chunk) if shape.length > 1 => Some(Basis::decode(chunk, axes, shape.rows(), step)?),
            None if shape.length == 1 => None,
            _ => return Err(malformed("a basis chunk without a spectral axis, or none with one")),
        };
        let mut r = Reader::new(coded, 0);
        let plan = Plan::read(&shape, &mut r)?;
        let representatives = plan.group.representatives();
        let chart = match plan.model {
            None => None,
            Some(kind) => {
                let chart = Chart::new(kind, &shape, &representatives);
                Some(chart.ok_or_else(|| malformed("a model that makes no sense here"))?)
            }
        };
        Ok(Self { shape, plan, basis, representatives, chart, r })
    }

    fn vectors(&self) -> usize {
        self.basis.as_ref().map_or(1, Basis::rank)
    }

    /// The streams of a pyramid whose blocks are decoded by themselves.
    fn streams(&mut self) -> Result<Streams<'a>, CodecError> {
        let blocks = if self.plan.alone { 0 } else { self.representatives.len() };
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
        let representatives = &self.representatives[representatives];
        let live = live_leaves(&self.shape, &self.plan.group, representatives, classes);
        Pyramid::new(self.shape.mesh, &self.plan.group, representatives, live.as_deref())
    }
}

/// Adds the model, if there is one.
fn add_model(decoded: &mut [f32], model: Option<Vec<f32>>) {
    if let Some(model) = model {
        decoded.iter_mut().zip(model).for_each(|(x, m)| *x += m);
    }
}
