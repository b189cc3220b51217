//! First layer for directions on grids: planes on the product of all lines of angles, each a pyramid of pairs predicted
//! in closed loop.
//!
//! ```text
//! grid chunk   u8 s + 2 · n + 4 · f + 8 · l + 16 · m + 64 · w + 128 · v: f without least squares; n: f32 the largest
//!              logarithm of a negative sample; l: coarser levels, as in `index`; m the kind of the model, 0 without
//!              one; v: samples are divided by the function of chunk V; then
//!              s = 0: one range-coded stream: what repeats, as in `lattice`; the order of halvings; the model's
//!                     coefficients; the pyramid of what the model misses
//!              s = 1: varint length, and the first three as a stream of their own; then the pyramid of every incoming
//!                     entry that is kept, in order, as in `streams`
//! ```
//! Planes are coefficients in the data's own basis if there is a basis chunk. Otherwise they are the entries of the
//! last axis; three entries are coded as second, third, first. Negative samples cost no bits: they take the predicted
//! value, at most the largest of them (n). If samples below a floor must stay within it, negative samples count like
//! positive ones (w).

mod coarser;
mod decode;
mod divided;
mod index;
mod lattice;
mod model;
mod nodes;
mod outline;
mod planes;
mod quantised;
mod repeats;

pub(crate) use coarser::{decode_level, levels_of, with_errors, with_levels};
pub(crate) use decode::{Around, decode, decode_block, has_levels, is_random, negative_bound};
pub(crate) use lattice::Shape;
pub(crate) use outline::{Spent, outlined};

use super::super::between::Divisor;
use super::super::setting_error::SettingError;
use super::super::spectral_basis::SpectralBasis;
use super::chart::ChartKind;
use super::coded::{Coded, LastCoded, code_streams};
use super::layer::{FirstLayer, chunk_bytes};
use super::lines::{PairPyramid, Quantiser, Source, code_order};
use super::spectrum::{ANALYSED, Basis, MAX_GRID_RANK, components};
use super::steps::Fineness;
use super::streams::Streams;
use crate::codec::{ChunkKind, Class, Encoder, Writer};
use crate::domain::Axis;
use crate::transform::{AxisTransform, Klt};
use divided::DividedRows;
use model::GridModel;
use planes::Planes;
use quantised::{bound_negative, quantiser};
use rayon::prelude::*;
use std::borrow::Cow;
use std::mem::replace;

/// Returns the largest natural logarithm of a negative sample's magnitude, lowered by two f32 steps; `None` without
/// negative samples.
fn largest_negative(classes: &[Class], values: &[f32]) -> Option<f32> {
    let negative = classes.iter().zip(values).filter(|(class, _)| **class == Class::Negative);
    negative.map(|(_, &value)| value).reduce(f32::max).map(|largest| largest.next_down().next_down())
}

/// Fraction of the estimated bits that must at most remain after subtraction of a scattering model for it to be tried.
/// The estimate ignores the coder's gain from neighbouring details. Raising it tries more models.
const WORTH_A_TRIAL: f64 = 0.97;

/// Choice of the scattering model that is subtracted from the values on a grid of angles before the residual is coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Behind {
    /// No scattering model is subtracted from the values before they are coded.
    Nothing,
    /// A scattering model of the stated kind is subtracted from the values before they are coded.
    Model(ChartKind),
    /// Scattering models, and coding without one, are compared at a typical quantiser step; the smallest file wins.
    Judged,
}

/// Options of coding samples on a grid of angles.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::struct_excessive_bools, reason = "each is a choice of its own")]
pub(super) struct Form {
    /// True to code principal components of spectra, false to code each wavelength or colour channel.
    pub(super) klt: bool,
    /// True to approximate samples, false to approximate their logarithms.
    pub(super) is_linear: bool,
    /// True to code every incoming direction as a byte stream of its own, which can be decoded alone.
    pub(super) random: bool,
    /// True to approximate negative samples as exactly as positive ones, false to give them a predicted magnitude that
    /// is at most the largest magnitude of a negative sample.
    pub(super) weighs_negative: bool,
    /// True to predict details (differences of merged neighbours) by adaptive least squares in addition to the fixed
    /// filters.
    pub(super) learns: bool,
    pub(super) model: Behind,
    /// Function by which samples are divided before they are coded; [`Divisor::None`] to code them as they are.
    pub(super) divisor: Divisor,
    /// Typical quantiser step of the values (natural logarithms or samples) at which the costs of coding are compared,
    /// to choose the order in which the angle axes are halved.
    pub(super) step: f64,
}

/// Largest number of samples whose values are kept from one trial to the next. Raising it takes memory.
const KEPT: usize = 1 << 20;

/// Values (logarithms or samples) to be coded.
enum Given<'a> {
    /// Values of all distinct directions of a grid, `[directions, length of a spectrum]`.
    Kept(Vec<f32>),
    /// Function that computes the values of all directions anew. Those of a large table take as much memory as its
    /// samples, and little time beside a trial.
    Made(Box<dyn Fn() -> Vec<f32> + Sync + 'a>),
    /// No values: means and details made of them are coded at any quantiser step.
    Sources,
}

/// Samples on a grid of angles, prepared for coding at any quantiser step.
pub(crate) struct GridLayer<'a> {
    axes: Vec<Axis>,
    classes: Option<&'a [Class]>,
    /// Largest logarithm of a negative sample's magnitude that decodes; larger ones are lowered to it. `None` without
    /// such a bound.
    negative_bound: Option<f32>,
    form: Form,
    planes: Planes,
    transforms: Vec<AxisTransform>,
    klt: Option<Klt>,
    given: Given<'a>,
    /// Axes along which neighbouring angles are merged in pairs, one after another.
    order: Vec<u8>,
    pyramids: Vec<PairPyramid>,
    model: Option<GridModel>,
    divided: Option<DividedRows>,
    /// Beginning of the coded stream, equal for all quantiser steps: which angles repeat the samples of others, and the
    /// order in which the angle axes are halved.
    opening: Encoder,
    /// Original means and details that each byte stream codes, if these do not depend on the quantiser step.
    sources: Option<Vec<Source>>,
    last: LastCoded,
}

impl<'a> GridLayer<'a> {
    /// Prepares values (logarithms or samples), which `given` computes, for coding. The last direction axis in `axes`
    /// is a grid of angles, usually of outgoing directions. `classes` tells which samples are positive, negative, zero
    /// or masked; `None` if all are positive.
    pub(super) fn new(
        axes: &[Axis],
        shape: Shape,
        classes: Option<&'a [Class]>,
        given: impl Fn() -> Vec<f32> + Sync + 'a,
        form: Form,
    ) -> Result<Self, SettingError> {
        let values = given();
        let length = shape.length();
        let divided = DividedRows::new(&shape, form.divisor).filter(DividedRows::is_usable);
        let same = |a: usize, b: usize| {
            let [one, two] = [a, b].map(|at| {
                let class = classes.map_or(Class::Positive, |classes| classes[at]);
                let weighs = class == Class::Positive || form.weighs_negative && class == Class::Negative;
                (class, if weighs { values[at].to_bits() } else { 0 })
            });
            // Equal samples of two directions come back equal only if both are divided by the same number.
            let divisor = |at: usize| divided.as_ref().map_or(0.0, |divided| divided.of_row(at / length)).to_bits();
            one == two && divisor(a) == divisor(b)
        };
        let mut opening = Encoder::default();
        let planes = Planes::code(&mut opening, shape, (form.random, form.klt, form.weighs_negative), Some(&same));
        let negative_bound =
            classes.filter(|_| !form.weighs_negative).and_then(|classes| largest_negative(classes, &values));
        let is_large = values.len() > KEPT;
        let kept = planes.leaves_of(values, divided.as_ref());
        let spectra = form.klt.then(|| planes.spectra(classes, &kept, ANALYSED));
        let klt = spectra.map(|spectra| components(&spectra, length, MAX_GRID_RANK)).transpose()?;
        let typical = klt.as_ref().map(|klt| {
            let fineness = Fineness::of(form.step as f32);
            Basis::encode(klt, axes, (planes.rows(), MAX_GRID_RANK), fineness).0
        });
        let typical = typical.as_ref();
        let (order, bits) = planes.order_of_halvings(&planes.channels(&kept, typical), classes, form.step);
        let given = if is_large {
            drop(kept);
            Given::Made(Box::new(given))
        } else {
            Given::Kept(kept)
        };
        let repeats = opening.clone();
        let order = code_order(&mut opening, planes.grid(), &order);
        let mut layer = Self {
            axes: axes.to_vec(),
            classes,
            negative_bound,
            transforms: vec![AxisTransform::Identity; axes.len()],
            sources: None,
            last: LastCoded::default(),
            form,
            pyramids: planes.pyramids(&order, &planes.weights(classes)),
            order,
            planes,
            klt,
            given,
            model: None,
            divided,
            opening,
        };
        layer.try_models(typical, (&repeats, bits));
        if layer.klt.is_none() && layer.model.is_none() {
            layer.sources = Some(layer.sources_of(&layer.planes.channels(&layer.values(), None), length));
            // Freed, as only the sources are coded.
            layer.given = Given::Sources;
        }
        Ok(layer)
    }

    /// Tries the scattering models that the layer's form asks for at the typical quantiser step, where `typical` is the
    /// basis of spectra, and adopts the best.
    ///
    /// `plain` holds the coded stream up to the order of merging angles, and the estimate of the bits without a model.
    fn try_models(&mut self, typical: Option<&Basis>, plain: (&Encoder, f64)) {
        let vectors = typical.map_or(self.planes.length(), Basis::rank);
        let (Form { step, model, .. }, streams) = (self.form, self.planes.streams());
        let kinds = match &model {
            Behind::Nothing => &[],
            Behind::Model(kind) => std::slice::from_ref(kind),
            Behind::Judged => self.planes.lattice().shape().models(),
        };
        let is_judged = model == Behind::Judged;
        for &kind in kinds {
            let Some(model) = GridModel::new(kind, &self.planes) else { continue };
            let model = model.prepared(self.planes.live_leaves(&self.planes.weights(self.classes)));
            let mut channels = self.planes.channels(&self.values(), typical).into_owned();
            let all = Some((&*channels, streams));
            let coefficients = model.code(&mut Encoder::default(), step as f32, vectors, all, &mut 0);
            model.apply(&coefficients, (vectors, streams), &mut channels, |value, model| *value -= model);
            let (order, left) = self.planes.order_of_halvings(&channels, self.classes, step);
            drop(channels);
            let (repeats, bits) = plain;
            if !is_judged || left < WORTH_A_TRIAL * bits {
                let mut opening = repeats.clone();
                let order = code_order(&mut opening, self.planes.grid(), &order);
                self.take_model((model, is_judged), opening, order);
            }
        }
    }

    /// Adopts a scattering model that is subtracted from the values before coding, and the order of merging angles that
    /// suits the residual. With `is_judged`, a model that makes the file at a typical quantiser step larger is
    /// discarded again.
    fn take_model(&mut self, (model, is_judged): (GridModel, bool), opening: Encoder, order: Vec<u8>) {
        let bytes = |layer: &Self| {
            if is_judged { chunk_bytes(&layer.code(Fineness::of(layer.form.step as f32)).chunks) } else { 0 }
        };
        let before = bytes(self);
        let model = self.model.replace(model);
        let (opening, order) = (replace(&mut self.opening, opening), replace(&mut self.order, order));
        self.make_pyramids();
        if bytes(self) > before {
            (self.model, self.opening, self.order) = (model, opening, order);
            self.make_pyramids();
        }
    }

    /// Makes the coders of means over ever larger blocks anew, after the order of merging angles has changed.
    fn make_pyramids(&mut self) {
        // Freed before others take as much memory.
        self.pyramids = Vec::new();
        self.pyramids = self.planes.pyramids(&self.order, &self.planes.weights(self.classes));
    }

    /// Values of all distinct directions of the grid, `[directions, length of a spectrum]`.
    fn values(&self) -> Cow<'_, [f32]> {
        match &self.given {
            Given::Kept(values) => Cow::Borrowed(values),
            Given::Sources => Cow::Borrowed(&[]),
            Given::Made(given) => Cow::Owned(self.planes.leaves_of(given(), self.divided.as_ref())),
        }
    }

    fn sources_of(&self, planes: &[f32], vectors: usize) -> Vec<Source> {
        let streams = planes.par_chunks(planes.len() / self.planes.streams()).enumerate();
        streams.map(|(k, planes)| self.pyramid(k).source(planes, vectors)).collect()
    }

    fn pyramid(&self, stream: usize) -> &PairPyramid {
        &self.pyramids[stream.min(self.pyramids.len() - 1)]
    }

    fn with_coded<T>(&self, fineness: Fineness, read: impl FnOnce(&mut Coded) -> T) -> T {
        self.last.with(fineness, || self.code(fineness), read)
    }

    fn code(&self, fineness: Fineness) -> Coded {
        let mut chunks = Vec::new();
        let basis = self.klt.as_ref().map(|klt| {
            let (basis, chunk) = Basis::encode(klt, &self.axes, (self.planes.rows(), MAX_GRID_RANK), fineness);
            chunks.push((ChunkKind::Basis, chunk));
            basis
        });
        let vectors = basis.as_ref().map_or(self.planes.length(), Basis::rank);
        let (mut opening, mut kept, mut coefficients) = (self.opening.clone(), 0, None);
        let layout = (vectors, self.planes.streams());
        let own = self.sources.is_none().then(|| {
            let values = self.values();
            let mut channels = self.planes.channels(&values, basis.as_ref());
            if let Some(model) = &self.model {
                let all = Some((&*channels, layout.1));
                let fitted = model.code(&mut opening, fineness.step, vectors, all, &mut kept);
                model.apply(&fitted, layout, channels.to_mut(), |value, model| *value -= model);
                coefficients = Some(fitted);
            }
            self.sources_of(&channels, vectors)
        });
        let count = self.planes.units() / self.planes.streams() * vectors;
        let quantiser = Quantiser {
            dead_zone: f64::from(fineness.dead_zone) / 16.0,
            ..quantiser(fineness.step, self.form.is_linear, self.form.learns)
        };
        let code = |encoder: &mut Encoder, k: usize, source: Option<Cow<'_, Source>>| {
            self.pyramid(k).code(encoder, quantiser, (count, vectors), source, 0)
        };
        let mut w = Writer::default();
        let flags = [self.form.random, self.negative_bound.is_some(), !self.form.learns];
        let flags = flags.iter().rev().fold(0, |form, &flag| form << 1 | u8::from(flag));
        let weighs = if self.form.weighs_negative { decode::WEIGHS_NEGATIVE } else { 0 };
        let divided = if self.divided.is_some() { decode::DIVIDED } else { 0 };
        w.u8(flags | GridModel::form(self.model.as_ref()) | weighs | divided);
        if let Some(largest) = self.negative_bound {
            w.f32(largest);
        }
        let (planes, details) = if self.form.random {
            let sources = own.as_deref().or(self.sources.as_deref()).unwrap_or_default();
            let code = |encoder: &mut Encoder, k: usize| code(encoder, k, sources.get(k).map(Cow::Borrowed));
            let (planes, details, streams) = code_streams(self.planes.streams(), code);
            let opening = opening.finish();
            w.varint(opening.len() as u64);
            w.raw(&opening);
            w.raw(&Streams::write(None, &streams));
            (planes, details)
        } else {
            let mut encoder = opening;
            let kept = self.sources.as_deref().and_then(<[Source]>::first).map(Cow::Borrowed);
            let source = own.and_then(|mut own| own.pop()).map(Cow::Owned).or(kept);
            let coded = code(&mut encoder, 0, source);
            w.raw(&encoder.finish());
            coded
        };
        chunks.push((ChunkKind::Grid, w.into_bytes()));
        // The entries of the basis count as kept coefficients.
        let kept = kept + details + basis.as_ref().map_or(0, |basis| basis.entries() as u64);
        Coded { basis, chunks, planes, model: coefficients, kept }
    }
}

impl FirstLayer for GridLayer<'_> {
    fn prepare(&self, fineness: Fineness) {
        self.with_coded(fineness, |_| ());
    }

    fn approximate(&self, fineness: Fineness, logs: &mut [f32]) {
        self.with_coded(fineness, |Coded { basis, planes, model, .. }| {
            if let (Some(of), Some(coefficients)) = (&self.model, model.take()) {
                let vectors = basis.as_ref().map_or(self.planes.length(), Basis::rank);
                let layout = (vectors, self.planes.streams());
                of.apply(&coefficients, layout, planes, |value, model| *value += model);
            }
            self.planes.synthesise(basis.as_ref(), planes, logs);
        });
        if let Some(divided) = &self.divided {
            divided.restore(logs);
        }
        bound_negative(self.negative_bound, self.classes, logs);
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
        if self.klt.is_some() { SpectralBasis::Klt } else { SpectralBasis::Identity }
    }

    fn is_gridded(&self) -> bool {
        true
    }

    fn negative_bound(&self) -> Option<f32> {
        self.negative_bound
    }
}
