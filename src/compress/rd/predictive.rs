//! The first layer that predicts: planes on the data's own spectral basis, folded by the symmetries that hold, each a
//! pyramid of triangles predicted in closed loop.
//!
//! ```text
//! pyramid chunk   levels, as in `levels`; varint m + 4 · a + 8 · s + 16 · g; then
//!                 s = 0: the range-coded coefficients of the model, and the pyramid
//!                 s = 1: the model and the pyramid of each coded block as streams of their own, as in `streams`
//!
//! m               the kind of the model, 0 if there is none
//! a               1 if there is no pyramid behind the model: all its details are 0
//! s               1 if every block is decoded by itself
//! g               generators: digits to base n + 1, the first lowest: 1 + the number of a symmetry, of the n of the last
//!                 triangle axis' domain
//! ```

mod decode;

pub(crate) use decode::{decode, decode_block, is_random};

use super::super::SpectralBasis;
use super::chart::{Chart, ChartKind};
use super::layer::{Fineness, FirstLayer};
use super::pyramid::Pyramid;
use super::spectrum::{Basis, components};
use super::streams::Streams;
use super::symmetry::{Group, Member, Representative};
use crate::codec::{ChunkKind, Class, CodecError, Encoder, Reader, Writer};
use crate::domain::{Axis, Symmetry, TriangleMesh};
use crate::transform::{AxisTransform, Klt};
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};

/// Samples of the spectra whose principal components are found, at most.
const ANALYSED: usize = 1 << 23;
/// Rows compared with their images when symmetries are looked for.
const MOST_COMPARED: usize = 1 << 15;

/// How a tensor is seen as planes: blocks of all other axes, leaves of the last triangle axis, rows of the last axis.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    axes: Vec<Axis>,
    mesh: TriangleMesh,
    /// The axes of the blocks.
    block_axes: Vec<Axis>,
    /// Blocks of axes after the triangles.
    inner: usize,
    /// Samples of a row; 1 if the triangles are the last axis.
    length: usize,
}

impl Shape {
    /// `None` where there are no triangles.
    pub(crate) fn of(axes: &[Axis]) -> Option<Self> {
        let at = axes.iter().rposition(|axis| matches!(axis, Axis::Triangles(_)))?;
        let Axis::Triangles(mesh) = axes[at] else { return None };
        let last = axes.len() - 1;
        let spectral = at < last;
        let between = &axes[at + 1..if spectral { last } else { at + 1 }];
        let block_axes = axes[..at].iter().chain(between).cloned().collect();
        Some(Self {
            axes: axes.to_vec(),
            mesh,
            block_axes,
            inner: between.iter().map(Axis::len).product(),
            length: if spectral { axes[last].len() } else { 1 },
        })
    }

    pub(super) fn mesh(&self) -> TriangleMesh {
        self.mesh
    }

    pub(crate) fn block_axes(&self) -> &[Axis] {
        &self.block_axes
    }

    /// Whether a model of `kind` makes sense.
    pub(super) fn has_chart(&self, kind: ChartKind) -> bool {
        super::chart::incoming(self, kind).is_some()
    }

    fn blocks(&self) -> usize {
        self.block_axes.iter().map(Axis::len).product()
    }

    fn rows(&self) -> usize {
        self.blocks() * self.mesh.len()
    }

    /// The row of leaf `leaf` in block `block`.
    fn row(&self, block: usize, leaf: usize) -> usize {
        ((block / self.inner) * self.mesh.len() + leaf) * self.inner + block % self.inner
    }

    fn group(&self, generators: &[Symmetry]) -> Option<Group> {
        Group::new(&closure(generators), &self.block_axes, self.mesh)
    }
}

/// All products of the generators, in the order of the domain's symmetries.
fn closure(generators: &[Symmetry]) -> Vec<Symmetry> {
    let mut all = vec![Symmetry::IDENTITY];
    let mut next = 0;
    while next < all.len() {
        for generator in generators {
            let product = generator.after(all[next]);
            if !all.contains(&product) {
                all.push(product);
            }
        }
        next += 1;
    }
    all.sort();
    all
}

/// Rows folded by a group of symmetries, and their principal components: what every model starts from.
pub(crate) struct Folded {
    shape: Shape,
    /// As they are written.
    generators: u64,
    group: Group,
    representatives: Vec<Representative>,
    pyramid: Pyramid,
    /// Of rows longer than one sample.
    klt: Option<Klt>,
    /// `[representatives, leaves, length]`
    rows: Vec<f32>,
}

impl Folded {
    pub(crate) fn new(
        shape: &Shape,
        classes: Option<&[Class]>,
        logs: &[f32],
        generators: &[Symmetry],
    ) -> Result<Self, String> {
        let group = shape.group(generators).ok_or("a symmetry of another domain")?;
        let representatives = group.representatives();
        let rows = fold_rows(shape, &group, &representatives, logs);
        let live = live_leaves(shape, &group, &representatives, classes);
        let klt = (shape.length > 1).then(|| {
            let spectra = spectra(shape, &group, &representatives, &rows, live.as_deref());
            components(&spectra, shape.length)
        });
        let pyramid = Pyramid::new(shape.mesh, &group, &representatives, live.as_deref());
        let klt = klt.transpose()?;
        Ok(Self {
            shape: shape.clone(),
            generators: number_of(shape, generators),
            group,
            representatives,
            pyramid,
            klt,
            rows,
        })
    }
}

impl Folded {
    /// Whether nothing is folded.
    pub(crate) fn is_trivial(&self) -> bool {
        self.generators == 0
    }
}

/// Folded rows behind a model or none.
pub(crate) struct PredictiveLayer {
    folded: Arc<Folded>,
    transforms: Vec<AxisTransform>,
    chart: Option<Chart>,
    /// Whether every block is a stream of its own.
    random: bool,
    /// What was coded last: a size and an error are asked for one after the other.
    last: Mutex<Option<(Fineness, Arc<Coded>)>>,
}

/// A layer at one fineness.
struct Coded {
    basis: Option<Basis>,
    chunks: Vec<(ChunkKind, Vec<u8>)>,
    planes: Vec<f32>,
    kept: u64,
}

impl PredictiveLayer {
    pub(crate) fn new(folded: Arc<Folded>, chart: Option<ChartKind>, random: bool) -> Result<Self, String> {
        let chart = match chart {
            Some(kind) => {
                let chart = Chart::new(kind, &folded.shape, &folded.representatives);
                Some(chart.ok_or("a model that makes no sense here")?.prepared())
            }
            None => None,
        };
        let transforms = vec![AxisTransform::Identity; folded.shape.axes.len()];
        Ok(Self { folded, transforms, chart, random, last: Mutex::new(None) })
    }

    fn coded(&self, fineness: Fineness) -> Arc<Coded> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        match &*last {
            Some((known, coded)) if *known == fineness => Arc::clone(coded),
            _ => {
                let coded = Arc::new(self.code(fineness));
                *last = Some((fineness, Arc::clone(&coded)));
                coded
            }
        }
    }

    fn code(&self, fineness: Fineness) -> Coded {
        let folded = &*self.folded;
        let (step, leaves) = (fineness.step, folded.shape.mesh.len());
        let mut chunks = Vec::new();
        let basis = folded.klt.as_ref().map(|klt| {
            let (basis, chunk) = Basis::encode(klt, &folded.shape.axes, folded.shape.rows(), fineness);
            chunks.push((ChunkKind::Basis, chunk));
            basis
        });
        let vectors = basis.as_ref().map_or(1, Basis::rank);
        let coefficients = basis.as_ref().map_or_else(|| folded.rows.clone(), |basis| basis.analyse(&folded.rows));
        let mut planes = transposed(&coefficients, leaves, vectors);
        let mut encoder = Encoder::default();
        // The basis itself is part of what is kept.
        let mut kept = basis.as_ref().map_or(0, |basis| basis.entries() as u64);
        let model = self.chart.as_ref().map(|chart| {
            let coefficients = chart.code(&mut encoder, step, vectors, Some(&planes), &mut kept);
            chart.evaluate(coefficients, vectors, chart.all())
        });
        if let Some(model) = &model {
            planes.iter_mut().zip(model).for_each(|(x, m)| *x -= m);
        }
        let model_alone = encoder.clone();
        let pyramid = &folded.pyramid;
        let (mut decoded, details, coded) = if self.random {
            let (decoded, details, blocks) = code_blocks(pyramid, (step, vectors), &planes);
            let model = self.chart.is_some().then(|| model_alone.finish());
            let blocks = if details == 0 { &[] } else { blocks.as_slice() };
            (decoded, details, Streams::write(model.as_deref(), blocks))
        } else {
            let (decoded, details) =
                pyramid.code(&mut encoder, (step, vectors), pyramid.all(), Some(planes), usize::MAX);
            (decoded, details, if details == 0 { model_alone } else { encoder }.finish())
        };
        let mut w = Writer::default();
        let model_code = self.chart.as_ref().map_or(0, |chart| chart.kind() as u64);
        w.varint(model_code | u64::from(details == 0) << 2 | u64::from(self.random) << 3 | folded.generators << 4);
        w.raw(&coded);
        chunks.push((ChunkKind::Pyramid, w.into_bytes()));
        if let Some(model) = &model {
            decoded.iter_mut().zip(model).for_each(|(x, m)| *x += m);
        }
        Coded { basis, chunks, planes: decoded, kept: kept + details }
    }
}

impl FirstLayer for PredictiveLayer {
    fn approximate(&self, fineness: Fineness, logs: &mut [f32]) {
        let coded = self.coded(fineness);
        let folded = &*self.folded;
        synthesise(&folded.shape, &folded.group, &folded.representatives, coded.basis.as_ref(), &coded.planes, logs);
    }

    fn chunks(&self, fineness: Fineness) -> Vec<(ChunkKind, Vec<u8>)> {
        self.coded(fineness).chunks.clone()
    }

    fn kept(&self, fineness: Fineness) -> u64 {
        self.coded(fineness).kept
    }

    fn transforms(&self) -> &[AxisTransform] {
        &self.transforms
    }

    fn basis(&self) -> SpectralBasis {
        if self.folded.klt.is_some() { SpectralBasis::Klt } else { SpectralBasis::Identity }
    }

    fn is_predicted(&self) -> bool {
        true
    }
}

/// Codes the planes of every representative by themselves: what a decoder has, the details that are not 0, the streams.
fn code_blocks(pyramid: &Pyramid, (step, vectors): (f32, usize), planes: &[f32]) -> (Vec<f32>, u64, Vec<Vec<u8>>) {
    let block = planes.len() / pyramid.all().len();
    let coded: Vec<(Vec<f32>, u64, Vec<u8>)> = planes
        .par_chunks(block)
        .enumerate()
        .map(|(k, planes)| {
            let mut encoder = Encoder::default();
            let (decoded, details) =
                pyramid.code(&mut encoder, (step, vectors), k..k + 1, Some(planes.to_vec()), usize::MAX);
            (decoded, details, encoder.finish())
        })
        .collect();
    let details = coded.iter().map(|(_, details, _)| details).sum();
    let mut decoded = Vec::with_capacity(planes.len());
    let mut streams = Vec::with_capacity(coded.len());
    for (planes, _, stream) in coded {
        decoded.extend(planes);
        streams.push(stream);
    }
    (decoded, details, streams)
}

/// By block: the number of the representative that stands for it.
pub(crate) fn orbits(axes: &[Axis], coded: &[u8]) -> Result<Vec<u32>, CodecError> {
    let no_triangles = || CodecError::Malformed { at: 0, reason: "a pyramid without a triangle axis".to_owned() };
    let shape = Shape::of(axes).ok_or_else(no_triangles)?;
    let group = Plan::read(&shape, &mut Reader::new(coded, 0))?.group;
    let mut orbits = vec![0; shape.blocks()];
    for (i, representative) in group.representatives().iter().enumerate() {
        for member in group.members() {
            orbits[member.blocks[representative.block] as usize] = i as u32;
        }
    }
    Ok(orbits)
}

/// Generators as one number; none is 0.
fn number_of(shape: &Shape, generators: &[Symmetry]) -> u64 {
    let known = Symmetry::of(shape.mesh.domain());
    let digits = generators.iter().rev().filter_map(|g| known.iter().position(|k| k == g));
    digits.fold(0, |number, digit| number * (known.len() as u64 + 1) + digit as u64 + 1)
}

/// What a pyramid's first number says.
struct Plan {
    model: Option<ChartKind>,
    alone: bool,
    random: bool,
    group: Group,
}

impl Plan {
    fn read(shape: &Shape, r: &mut Reader<'_>) -> Result<Self, CodecError> {
        let known = Symmetry::of(shape.mesh.domain());
        let base = known.len() as u64 + 1;
        let first = r.varint("model and symmetries")?;
        let mut number = first >> 4;
        let mut generators = Vec::new();
        while number > 0 {
            let digit = (number % base).checked_sub(1).map(|digit| known[digit as usize]);
            generators.push(digit.ok_or_else(|| r.malformed("symmetries with a digit 0"))?);
            number /= base;
        }
        let group = shape.group(&generators).ok_or_else(|| r.malformed("a symmetry of another domain"))?;
        let (alone, random) = (first >> 2 & 1 == 1, first >> 3 & 1 == 1);
        Ok(Self { model: ChartKind::from_code((first & 3) as u8), alone, random, group })
    }
}

/// Planes `[representatives, vectors, leaves]` to logarithms.
fn synthesise(
    shape: &Shape,
    group: &Group,
    representatives: &[Representative],
    basis: Option<&Basis>,
    planes: &[f32],
    logs: &mut [f32],
) {
    let vectors = basis.map_or(1, Basis::rank);
    let rows = transposed(planes, vectors, shape.mesh.len());
    let mut all = vec![0.0; shape.rows() * vectors];
    unfold_rows(shape, group, representatives, vectors, &rows, &mut all);
    match basis {
        Some(basis) => basis.synthesise(&all, logs),
        None => logs.copy_from_slice(&all),
    }
}

/// Blocks of `rows × columns` turned into `columns × rows`.
fn transposed(values: &[f32], rows: usize, columns: usize) -> Vec<f32> {
    if columns == 1 || rows == 1 {
        return values.to_vec();
    }
    let mut turned = vec![0.0; values.len()];
    let block = rows * columns;
    turned.par_chunks_mut(block).zip(values.par_chunks(block)).for_each(|(turned, values)| {
        for (i, row) in values.chunks_exact(columns).enumerate() {
            for (j, &value) in row.iter().enumerate() {
                turned[j * rows + i] = value;
            }
        }
    });
    turned
}

/// The means of rows over orbits: `[representatives, leaves, length]`.
fn fold_rows(shape: &Shape, group: &Group, representatives: &[Representative], logs: &[f32]) -> Vec<f32> {
    let (n, leaves) = (shape.length, shape.mesh.len());
    let mut folded = vec![0.0; representatives.len() * leaves * n];
    let share = 1.0 / group.members().len() as f64;
    folded.par_chunks_mut(leaves * n).zip(representatives).for_each(|(block, representative)| {
        let mut sums = vec![0.0_f64; n];
        for (leaf, target) in block.chunks_exact_mut(n).enumerate() {
            sums.fill(0.0);
            for member in group.members() {
                let row = shape.row(member.blocks[representative.block] as usize, member.leaves[leaf] as usize);
                sums.iter_mut().zip(&logs[row * n..][..n]).for_each(|(sum, &x)| *sum += f64::from(x));
            }
            target.iter_mut().zip(&sums).for_each(|(x, sum)| *x = (sum * share) as f32);
        }
    });
    folded
}

/// Rows of `width` from `[representatives, leaves, width]` to every place they stand for.
fn unfold_rows(
    shape: &Shape,
    group: &Group,
    representatives: &[Representative],
    width: usize,
    folded: &[f32],
    all: &mut [f32],
) {
    let leaves = shape.mesh.len();
    for (representative, block) in representatives.iter().zip(folded.chunks_exact(leaves * width)) {
        for member in group.members() {
            let target = member.blocks[representative.block] as usize;
            for (source, &leaf) in block.chunks_exact(width).zip(&member.leaves) {
                let row = shape.row(target, leaf as usize);
                all[row * width..][..width].copy_from_slice(source);
            }
        }
    }
}

/// The rows whose principal components are wanted: each as often as it stands for, none without a sample of its own,
/// because what fills it is no spectrum, and every so many of very many.
fn spectra(
    shape: &Shape,
    group: &Group,
    representatives: &[Representative],
    rows: &[f32],
    live: Option<&[bool]>,
) -> Vec<f32> {
    let (n, leaves) = (shape.length, shape.mesh.len());
    // Odd, so that all places among siblings have their turn.
    let stride = (shape.rows() * n).div_ceil(ANALYSED) | 1;
    let mut spectra = Vec::new();
    for (k, representative) in representatives.iter().enumerate() {
        let times = group.members().len() / representative.stabiliser.len();
        for leaf in (k * leaves..(k + 1) * leaves).step_by(stride) {
            if live.is_none_or(|live| live[leaf]) {
                for _ in 0..times {
                    spectra.extend_from_slice(&rows[leaf * n..][..n]);
                }
            }
        }
    }
    if spectra.is_empty() { rows[..n].to_vec() } else { spectra }
}

/// By representative and leaf: whether any sample that it stands for has a logarithm; `None` if all have.
fn live_leaves(
    shape: &Shape,
    group: &Group,
    representatives: &[Representative],
    classes: Option<&[Class]>,
) -> Option<Vec<bool>> {
    let classes = classes?;
    let is_live = |class: &Class| matches!(class, Class::Positive | Class::Negative);
    let rows: Vec<bool> = classes.chunks_exact(shape.length).map(|row| row.iter().any(is_live)).collect();
    if rows.iter().all(|&live| live) {
        return None;
    }
    let mut live = Vec::with_capacity(representatives.len() * shape.mesh.len());
    for representative in representatives {
        for leaf in 0..shape.mesh.len() {
            live.push(group.members().iter().any(|member| {
                rows[shape.row(member.blocks[representative.block] as usize, member.leaves[leaf] as usize)]
            }));
        }
    }
    Some(live)
}

/// Symmetries that hold.
#[derive(Clone, Debug, Default)]
pub(crate) struct Found {
    /// Generators of their group.
    pub(crate) generators: Vec<Symmetry>,
    /// Members of their group.
    pub(crate) order: usize,
    /// The largest deviation under a generator.
    pub(crate) deviation: f64,
}

/// The largest group found under which the logarithms differ by at most `tolerance`, root mean square.
///
/// The deviation is that of one entry from its orbit's mean if entries differed by independent noise.
pub(crate) fn symmetries(shape: &Shape, logs: &[f32], classes: Option<&[Class]>, tolerance: f64) -> Found {
    let mut accepted: Vec<(f64, Symmetry)> = Symmetry::of(shape.mesh.domain())
        .into_par_iter()
        .filter(|&s| s != Symmetry::IDENTITY)
        .filter_map(|symmetry| {
            let group = Group::new(&[symmetry], &shape.block_axes, shape.mesh)?;
            let deviation = deviation(shape, &group.members()[0], logs, classes);
            (deviation <= tolerance).then_some((deviation, symmetry))
        })
        .collect();
    accepted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut generators: Vec<Symmetry> = Vec::new();
    let mut largest = 0.0;
    for &(deviation, symmetry) in &accepted {
        if closure(&generators).contains(&symmetry) {
            continue;
        }
        generators.push(symmetry);
        let all = closure(&generators);
        if all.iter().all(|s| *s == Symmetry::IDENTITY || accepted.iter().any(|(_, known)| known == s)) {
            largest = deviation;
        } else {
            generators.pop();
        }
    }
    Found { order: closure(&generators).len(), generators, deviation: largest }
}

/// Root mean square of the difference between rows and their images, divided by √2.
fn deviation(shape: &Shape, member: &Member, logs: &[f32], classes: Option<&[Class]>) -> f64 {
    let n = shape.length;
    let stride = shape.rows().div_ceil(MOST_COMPARED);
    let (mut sum, mut count) = (0.0_f64, 0_u64);
    for at in (0..shape.rows()).step_by(stride) {
        let (block, leaf) = (at / shape.mesh.len(), at % shape.mesh.len());
        let own = shape.row(block, leaf) * n;
        let other = shape.row(member.blocks[block] as usize, member.leaves[leaf] as usize) * n;
        if own == other {
            continue;
        }
        for k in 0..n {
            let live = |at: usize| classes.is_none_or(|c| matches!(c[at], Class::Positive | Class::Negative));
            if live(own + k) && live(other + k) {
                let difference = f64::from(logs[own + k]) - f64::from(logs[other + k]);
                sum += difference * difference;
                count += 1;
            }
        }
    }
    if count == 0 { f64::INFINITY } else { (sum / count as f64 / 2.0).sqrt() }
}
