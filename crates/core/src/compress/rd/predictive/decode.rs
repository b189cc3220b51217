//! Decodes pyramid chunks to logarithms, of the whole tensor or of one block.

use super::super::super::values::Values;
use super::super::chart::Chart;
use super::super::folding::{live_leaves, synthesise, synthesise_rows};
use super::super::pyramid::Pyramid;
use super::super::shape::Shape;
use super::super::spectrum::{Basis, MAX_RANK};
use super::super::streams::Streams;
use super::super::symmetry::Representatives;
use super::opening::Opening;
use crate::codec::{Class, CodecError, Decoder, Reader};
use crate::domain::Axis;
use rayon::prelude::*;
use std::ops::Range;

/// Decodes the logarithms of samples on triangles from two chunks: the spectral basis, and the values coded from coarse
/// to fine (without the table of levels at its start). Also returns how many bytes of the second chunk were needed.
///
/// Only details that divide triangles up to level `finest`, the number of divisions of the base triangles, are decoded;
/// finer ones are 0. With `finish`, logarithms are converted to magnitudes.
pub(crate) fn decode(
    axes: &[Axis],
    classes: Option<&[Class]>,
    step: f32,
    chunks: (Option<&[u8]>, &[u8]),
    finest: usize,
    finish: Option<Values>,
) -> Result<(Vec<f32>, usize), CodecError> {
    let opened = Opened::new(axes, step, chunks)?;
    if opened.opening.random {
        return Ok((decode_random(opened, classes, step, finest, finish)?, chunks.1.len()));
    }
    Ok(Levels::of(opened, classes, step)?.decode(finest, finish))
}

/// Decodes all blocks of a pyramid chunk in which each block is a byte stream of its own.
fn decode_random(
    mut opened: Opened<'_>,
    classes: Option<&[Class]>,
    step: f32,
    finest: usize,
    finish: Option<Values>,
) -> Result<Vec<f32>, CodecError> {
    if finest < usize::from(opened.shape.mesh().level()) {
        return Err(opened.r.malformed(
            "the material has no coarser resolution levels, because it codes every incoming direction on its own",
        ));
    }
    let (fineness, count) = ((step, opened.vectors()), opened.representatives.len());
    let streams = opened.streams()?;
    let coefficients = opened.coefficients(&mut Decoder::new(streams.model()), step);
    let mut decoded = if opened.opening.alone {
        opened.no_details()
    } else {
        let pyramid = opened.pyramid(classes, 0..count);
        let block = |k: usize| pyramid.code(&mut streams.block(k), fineness, k..k + 1, None, finest).0;
        (0..count).into_par_iter().flat_map_iter(block).collect()
    };
    if let Some(model) = opened.model(&coefficients, 0..count) {
        add_model(&mut decoded, &model);
    }
    Ok(opened.synthesise(&decoded, finish))
}

/// Chunk of samples on triangles, coded as one byte stream for all incoming directions, with everything decoded that
/// its resolution levels share.
pub(crate) struct Levels<'a> {
    opened: Opened<'a>,
    step: f32,
    /// Decoded coefficients of the scattering model.
    coefficients: Vec<f64>,
    /// Values of the scattering model, cached for decoding several resolution levels.
    model: Option<Vec<f32>>,
    pyramid: Option<Pyramid>,
    /// Entropy decoder, placed where the coded details of the triangles begin.
    decoder: Decoder<'a>,
    /// Offset of the entropy-coded stream from the end of the table of resolution levels in the chunk, in bytes.
    start: usize,
}

impl<'a> Levels<'a> {
    /// Reads the start of a chunk of samples on triangles, so that several resolution levels can be decoded from it.
    pub(crate) fn new(
        axes: &[Axis],
        classes: Option<&[Class]>,
        step: f32,
        chunks: (Option<&[u8]>, &'a [u8]),
    ) -> Result<Self, CodecError> {
        let opened = Opened::new(axes, step, chunks)?;
        if opened.opening.random {
            return Err(opened.r.malformed(
                "the material has no coarser resolution levels, because it codes every incoming direction on its own",
            ));
        }
        let mut levels = Self::of(opened, classes, step)?;
        levels.model = levels.opened.model(&levels.coefficients, 0..levels.opened.representatives.len());
        Ok(levels)
    }

    fn of(mut opened: Opened<'a>, classes: Option<&[Class]>, step: f32) -> Result<Self, CodecError> {
        let start = opened.r.offset();
        let mut decoder = Decoder::new(opened.r.take(opened.r.remaining(), "pyramid")?);
        let coefficients = opened.coefficients(&mut decoder, step);
        let all = 0..opened.representatives.len();
        let pyramid = (!opened.opening.alone).then(|| opened.pyramid(classes, all));
        Ok(Self { opened, step, coefficients, model: None, pyramid, decoder, start })
    }

    /// Decodes the logarithms of samples on triangles up to a resolution level: `finest` divisions of the base
    /// triangles; finer details are 0. Also returns the number of bytes of the chunk that were needed.
    pub(crate) fn decode(&self, finest: usize, finish: Option<Values>) -> (Vec<f32>, usize) {
        let opened = &self.opened;
        let (fineness, all) = ((self.step, opened.vectors()), 0..opened.representatives.len());
        let mut decoder = self.decoder.clone();
        let mut decoded = match &self.pyramid {
            Some(pyramid) => pyramid.code(&mut decoder, fineness, all.clone(), None, finest).0,
            None => opened.no_details(),
        };
        if let Some(model) = &self.model {
            add_model(&mut decoded, model);
        } else if let Some(model) = opened.model(&self.coefficients, all) {
            add_model(&mut decoded, &model);
        }
        (opened.synthesise(&decoded, finish), self.start + decoder.position())
    }
}

/// Decodes the logarithms of one block (incoming direction), bit for bit as [`decode`] does: `[triangle, wavelength]`.
/// Besides the block only the basis and the scattering model are decoded.
pub(crate) fn decode_block(
    axes: &[Axis],
    classes: Option<&[Class]>,
    step: f32,
    chunks: (Option<&[u8]>, &[u8]),
    block: usize,
) -> Result<Vec<f32>, CodecError> {
    let mut opened = Opened::new(axes, step, chunks)?;
    if !opened.opening.random {
        return Err(opened
            .r
            .malformed("the material allows no random access: it codes all incoming directions together"));
    }
    let streams = opened.streams()?;
    let group = &opened.opening.group;
    let found = if block < opened.shape.blocks() { opened.representatives.of_block(group, block) } else { None };
    let (k, member) =
        found.ok_or_else(|| opened.r.malformed(format!("the material has no incoming direction number {block}")))?;
    let (vectors, leaves, n) = (opened.vectors(), opened.shape.leaves(), opened.shape.length());
    let coefficients = opened.coefficients(&mut Decoder::new(streams.model()), step);
    let mut decoded = if opened.opening.alone {
        vec![0.0; vectors * leaves]
    } else {
        let pyramid = opened.pyramid(classes, k..k + 1);
        pyramid.code(&mut streams.block(k), (step, vectors), 0..1, None, usize::MAX).0
    };
    if let Some(model) = opened.model(&coefficients, k..k + 1) {
        add_model(&mut decoded, &model);
    }
    let mut rows = vec![0.0; leaves * n];
    synthesise_rows(opened.basis.as_ref(), leaves, &decoded, &mut rows);
    let mut logs = vec![0.0; rows.len()];
    for (leaf, row) in rows.chunks_exact(n).enumerate() {
        logs[opened.opening.group.leaf(member, leaf) * n..][..n].copy_from_slice(row);
    }
    Ok(logs)
}

/// Returns true if every block (incoming direction) of a pyramid chunk is a byte stream of its own.
pub(crate) fn is_random(axes: &[Axis], coded: &[u8]) -> Result<bool, CodecError> {
    let no_triangles =
        || CodecError::Malformed { at: 0, reason: "the file has a pyramid chunk, but no axis of triangles".to_owned() };
    let shape = Shape::of(axes).ok_or_else(no_triangles)?;
    Ok(Opening::read(&shape, &mut Reader::new(coded, 0))?.random)
}

/// For each block (incoming direction) of a tensor, number of the coded block that represents it by symmetry.
pub(crate) fn orbits(axes: &[Axis], coded: &[u8]) -> Result<Vec<u32>, CodecError> {
    let no_triangles =
        || CodecError::Malformed { at: 0, reason: "the file has a pyramid chunk, but no axis of triangles".to_owned() };
    let shape = Shape::of(axes).ok_or_else(no_triangles)?;
    let group = Opening::read(&shape, &mut Reader::new(coded, 0))?.group;
    let by_block = group.representatives().by_block(&group, shape.blocks());
    Ok(by_block.into_iter().map(|(k, _)| k).collect())
}

/// Decoded start of a chunk of samples on triangles: spectral basis, symmetries, and kind of the scattering model that
/// is added to the decoded values. The reader `r` is placed at the first byte after this start.
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
        let shape =
            Shape::of(axes).ok_or_else(|| malformed("the file has a pyramid chunk, but no axis of triangles"))?;
        let basis = match basis {
            Some(chunk) if shape.length() > 1 => Some(Basis::decode(chunk, axes, (shape.rows(), MAX_RANK), step)?),
            None if shape.length() == 1 => None,
            _ => {
                return Err(malformed(
                    "the file has a basis chunk but no spectral axis, or a spectral axis but no basis chunk",
                ));
            }
        };
        let mut r = Reader::new(coded, 0);
        let opening = Opening::read(&shape, &mut r)?;
        let representatives = opening.group.representatives();
        let chart = match opening.model {
            None => None,
            Some(kind) => {
                let chart = Chart::of_triangles(kind, &shape, &representatives);
                Some(chart.ok_or_else(|| {
                    malformed("the scattering model in the pyramid chunk does not suit the directions of the material")
                })?)
            }
        };
        Ok(Self { shape, opening, basis, representatives, chart, r })
    }

    fn vectors(&self) -> usize {
        self.basis.as_ref().map_or(1, Basis::rank)
    }

    /// Reads the byte streams of a chunk of samples on triangles in which each coded incoming direction has a stream of
    /// its own.
    fn streams(&mut self) -> Result<Streams<'a>, CodecError> {
        let blocks = if self.opening.alone { 0 } else { self.representatives.len() };
        Streams::read(&mut self.r, self.chart.is_some(), blocks)
    }

    /// Evaluates the scattering model for some coded blocks (incoming directions); `None` without a model.
    fn model(&self, coefficients: &[f64], representatives: Range<usize>) -> Option<Vec<f32>> {
        self.chart.as_ref().map(|chart| chart.evaluate(coefficients.to_vec(), self.vectors(), representatives))
    }

    /// Returns zeros as the values of all coded blocks (incoming directions), for a chunk in which the scattering model
    /// leaves no details.
    fn no_details(&self) -> Vec<f32> {
        vec![0.0; self.representatives.len() * self.vectors() * self.shape.leaves()]
    }

    /// Expands the decoded values of the coded blocks (incoming directions) to all logarithms of the tensor, or with
    /// `finish` to all magnitudes.
    fn synthesise(&self, planes: &[f32], finish: Option<Values>) -> Vec<f32> {
        let mut logs = vec![0.0; self.shape.rows() * self.shape.length()];
        let basis = self.basis.as_ref();
        synthesise(&self.shape, &self.opening.group, &self.representatives, (basis, planes), finish, &mut logs);
        logs
    }

    /// Decodes the coefficients of the scattering model.
    fn coefficients(&self, decoder: &mut Decoder<'_>, step: f32) -> Vec<f64> {
        self.chart.as_ref().map_or_else(Vec::new, |chart| chart.code(decoder, step, self.vectors(), None, &mut 0))
    }

    /// Builds the pyramids of means over triangles for some coded blocks (incoming directions).
    fn pyramid(&self, classes: Option<&[Class]>, representatives: Range<usize>) -> Pyramid {
        let (group, all) = (&self.opening.group, &self.representatives);
        let live = live_leaves(&self.shape, group, all, representatives.clone(), classes);
        Pyramid::new(self.shape.mesh(), group, all, representatives, live.as_deref())
    }
}

fn add_model(decoded: &mut [f32], model: &[f32]) {
    decoded.iter_mut().zip(model).for_each(|(x, m)| *x += m);
}
