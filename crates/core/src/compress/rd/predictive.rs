//! First layer that predicts: planes on the data's own spectral basis, folded by the symmetries of the data, each a
//! pyramid of triangles predicted in closed loop.
//!
//! ```text
//! pyramid chunk   levels, as in `levels`; varint m + 4 · a + 8 · s + 16 · g; then
//!                 s = 0: the range-coded coefficients of the model, and the pyramid
//!                 s = 1: the model and the pyramid of each coded block as streams of their own, as in `streams`
//!
//! m               the kind of the model, 0 if there is none
//! a               1 if there is no pyramid behind the model: all its details are 0
//! s               1 if every block is decoded independently
//! g               generators: digits to base n + 1, the first lowest: 1 + the number of a symmetry, of the n
//!                 symmetries of the last triangle axis' domain
//! ```

mod decode;
mod opening;

pub(crate) use decode::{Levels, decode, decode_block, is_random, orbits};

use super::super::setting_error::SettingError;
use super::super::spectral_basis::SpectralBasis;
use super::super::values::Values;
use super::chart::{Chart, ChartKind, Rows};
use super::coded::{Coded, LastCoded, code_streams};
use super::folding::{fold_rows, live_leaves, spectra, synthesise, transposed};
use super::layer::FirstLayer;
use super::pyramid::Pyramid;
use super::shape::Shape;
use super::spectrum::{ANALYSED, Basis, MAX_RANK, components};
use super::steps::Fineness;
use super::streams::Streams;
use super::symmetry::{Group, Representatives};
use crate::codec::{ChunkKind, Class, Encoder, Writer};
use crate::domain::Symmetry;
use crate::transform::{AxisTransform, Klt};
use opening::number_of;
use std::sync::Arc;

/// Spectra averaged over the symmetries of the data, and their principal components; common to all scattering models.
pub(crate) struct Folded {
    shape: Shape,
    /// Generators of the symmetry group, encoded as the one number that the file stores.
    generators: u64,
    group: Group,
    representatives: Representatives,
    pyramid: Pyramid,
    /// Principal components of the spectra; `None` if a spectrum is a single sample.
    klt: Option<Klt>,
    /// Spectra averaged over the symmetries of the data, as `[coded incoming direction, triangle, wavelength]`.
    rows: Vec<f32>,
}

impl Folded {
    pub(crate) fn new(
        shape: &Shape,
        classes: Option<&[Class]>,
        logs: &[f32],
        generators: &[Symmetry],
    ) -> Result<Self, SettingError> {
        let group = Group::of(shape, generators).ok_or(SettingError::Symmetry)?;
        let representatives = group.representatives();
        let rows = fold_rows(shape, &group, &representatives, logs);
        let all = 0..representatives.len();
        let live = live_leaves(shape, &group, &representatives, all.clone(), classes);
        let klt = (shape.length() > 1).then(|| {
            let spectra = spectra(shape, &group, &representatives, &rows, (live.as_deref(), ANALYSED));
            components(&spectra, shape.length(), MAX_RANK)
        });
        let pyramid = Pyramid::new(shape.mesh(), &group, &representatives, all, live.as_deref());
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
    /// Returns true if the symmetry group is trivial, so that no two blocks or triangles share a spectrum.
    pub(crate) fn is_trivial(&self) -> bool {
        self.generators == 0
    }
}

/// Coder of spectra on triangles as a predicted pyramid, with or without a scattering model.
pub(crate) struct PredictiveLayer {
    folded: Arc<Folded>,
    transforms: Vec<AxisTransform>,
    chart: Option<Chart>,
    /// True if every coded block (incoming direction) is a byte stream of its own, which can be decoded alone.
    random: bool,
    last: LastCoded,
}

impl PredictiveLayer {
    pub(crate) fn new(folded: Arc<Folded>, chart: Option<ChartKind>, random: bool) -> Result<Self, SettingError> {
        let chart = match chart {
            Some(kind) => {
                let chart = Chart::of_triangles(kind, &folded.shape, &folded.representatives);
                Some(chart.ok_or(SettingError::Model)?.prepared(None))
            }
            None => None,
        };
        let transforms = vec![AxisTransform::Identity; folded.shape.axes().len()];
        Ok(Self { folded, transforms, chart, random, last: LastCoded::default() })
    }

    fn with_coded<T>(&self, fineness: Fineness, read: impl FnOnce(&mut Coded) -> T) -> T {
        self.last.with(fineness, || self.code(fineness), read)
    }

    fn code(&self, fineness: Fineness) -> Coded {
        let folded = &*self.folded;
        let (step, leaves) = (fineness.step, folded.shape.leaves());
        let mut chunks = Vec::new();
        let basis = folded.klt.as_ref().map(|klt| {
            let (basis, chunk) = Basis::encode(klt, folded.shape.axes(), (folded.shape.rows(), MAX_RANK), fineness);
            chunks.push((ChunkKind::Basis, chunk));
            basis
        });
        let vectors = basis.as_ref().map_or(1, Basis::rank);
        let coefficients = basis.as_ref().map_or_else(|| folded.rows.clone(), |basis| basis.analyse(&folded.rows));
        let mut planes = transposed(&coefficients, leaves, vectors).into_owned();
        let mut encoder = Encoder::default();
        // The entries of the basis count as kept coefficients.
        let mut kept = basis.as_ref().map_or(0, |basis| basis.entries() as u64);
        let model = self.chart.as_ref().map(|chart| {
            let coefficients =
                chart.code(&mut encoder, step, vectors, Some(Rows::by_block(&planes, vectors)), &mut kept);
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
        Coded { basis, chunks, planes: decoded, model: None, kept: kept + details }
    }
}

impl PredictiveLayer {
    fn synthesise(&self, fineness: Fineness, finish: Option<Values>, logs: &mut [f32]) {
        let Folded { shape, group, representatives, .. } = &*self.folded;
        self.with_coded(fineness, |Coded { basis, planes, .. }| {
            synthesise(shape, group, representatives, (basis.as_ref(), planes), finish, logs);
        });
    }
}

impl FirstLayer for PredictiveLayer {
    fn approximate(&self, fineness: Fineness, logs: &mut [f32]) {
        self.synthesise(fineness, None, logs);
    }

    fn magnitudes(&self, fineness: Fineness, values: Values, magnitudes: &mut [f32]) {
        self.synthesise(fineness, Some(values), magnitudes);
    }

    fn chunks(&self, fineness: Fineness) -> Vec<(ChunkKind, Vec<u8>)> {
        self.with_coded(fineness, |coded| coded.chunks.clone())
    }

    fn kept(&self, fineness: Fineness) -> u64 {
        self.with_coded(fineness, |coded| coded.kept)
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

/// Codes every block (incoming direction) that represents others by symmetry as a byte stream of its own. Returns the
/// decoded values, the number of nonzero details, and the streams.
fn code_blocks(pyramid: &Pyramid, (step, vectors): (f32, usize), planes: &[f32]) -> (Vec<f32>, u64, Vec<Vec<u8>>) {
    let block = planes.len() / pyramid.all().len();
    code_streams(pyramid.all().len(), |encoder, k| {
        let planes = planes[k * block..][..block].to_vec();
        pyramid.code(encoder, (step, vectors), k..k + 1, Some(planes), usize::MAX)
    })
}
