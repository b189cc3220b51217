//! Decodes grid chunks to logarithms, of the whole tensor or of one incoming entry.

use super::super::super::between::Divisor;
use super::super::super::values::Values;
use super::super::chart::ChartKind;
use super::super::lines::{Quantiser, code_order};
use super::super::spectrum::{Basis, MAX_GRID_RANK};
use super::super::streams::Streams;
use super::divided::DividedRows;
use super::index::{self, GridLevel};
use super::lattice::Shape;
use super::model::GridModel;
use super::nodes::Nodes;
use super::planes::{Planes, Weights};
use super::quantised::{bound_negative, quantiser};
use crate::codec::{Class, CodecError, Decoder, Reader};
use crate::domain::Axis;
use rayon::prelude::*;

/// Facts about the samples in a grid chunk that other parts of the file state.
#[derive(Clone, Copy)]
pub(crate) struct Around<'a> {
    pub(crate) axes: &'a [Axis],
    pub(crate) classes: Option<&'a [Class]>,
    /// Quantiser step of the values, and whether these are samples rather than logarithms of samples.
    pub(crate) step: f32,
    pub(crate) is_linear: bool,
    /// Function of the interpolation between incoming directions, by which a grid chunk may divide its samples.
    pub(crate) divisor: Divisor,
}

/// Decoded beginning of a chunk of samples on a grid of angles: everything in front of the coded means and details.
pub(super) struct Opened<'a> {
    pub(super) quantiser: Quantiser,
    /// Largest logarithm of a negative sample's magnitude that decodes; larger ones are lowered to it. `None` without
    /// such a bound.
    pub(super) negative_bound: Option<f32>,
    pub(super) planes: Planes,
    pub(super) basis: Option<Basis>,
    pub(super) order: Vec<u8>,
    /// Scattering model whose values are added to the decoded samples on the grid of angles, with its coefficients;
    /// `None` without a model.
    model: Option<(GridModel, Vec<f64>)>,
    /// Function by which the samples were divided before they were coded; `None` if they were not.
    pub(super) divided: Option<DividedRows>,
    /// Coarser grids of angles that a part of the file suffices to decode, coarsest first.
    pub(super) levels: Vec<GridLevel>,
    /// Entropy decoder placed where the coded details of a grid chunk begin, for a chunk of a single byte stream.
    pub(super) decoder: Decoder<'a>,
    pub(super) streams: Option<Streams<'a>>,
}

impl<'a> Opened<'a> {
    /// Decodes the start of a grid chunk of `length` bytes. For a coarser grid, a prefix of the chunk that contains it
    /// suffices.
    pub(super) fn new(
        around: Around<'_>,
        (basis, coded): (Option<&[u8]>, &'a [u8]),
        (length, level): (usize, Option<usize>),
    ) -> Result<Self, CodecError> {
        let Around { axes, step, is_linear, .. } = around;
        let malformed = |reason: &str| CodecError::Malformed { at: 0, reason: reason.to_owned() };
        let shape = Shape::of(axes)
            .ok_or_else(|| malformed("the file has a grid chunk, but its directions are on no grid of angles"))?;
        let rows = shape.rows();
        if basis.is_some() && shape.length() == 1 {
            return Err(malformed("the file has a basis chunk, but no axis behind the directions"));
        }
        let basis = basis.map(|chunk| Basis::decode(chunk, axes, (rows, MAX_GRID_RANK), step)).transpose()?;
        let mut r = Reader::new(coded, 0);
        let flags = Flags::read(&mut r)?;
        let Flags { random, has_negative, learns, model, .. } = flags;
        let quantiser = quantiser(step, is_linear, learns);
        let mut bound = r.clone();
        let negative_bound =
            if has_negative { Some(bound.f32("bound of the logarithms of negative samples")?) } else { None };
        let levels = flags.levels(&mut r, length)?;
        let form = (random, basis.is_some(), flags.weighs_negative);
        let divided = if flags.is_divided && !is_linear { DividedRows::new(&shape, around.divisor) } else { None };
        if divided.is_some() != flags.is_divided {
            return Err(malformed(
                "the grid chunk divides its samples by a function of the directions, but the file states no such \
                 function, or samples that have none",
            ));
        }
        let open = |decoder: &mut Decoder<'a>| {
            let planes = Planes::code(decoder, shape.clone(), form, None);
            let order = code_order(decoder, planes.grid(), &[]);
            // The coarsest comes first.
            if let Some(coarsest) = levels.first().filter(|level| level.left_out > order.len()) {
                let (stated, halvings) = (coarsest.left_out, order.len());
                let reason = format!(
                    "a coarser level leaves out {stated} halvings of the angle grid, expected at most all {halvings}"
                );
                return Err(malformed(&reason));
            }
            let vectors = basis.as_ref().map_or(planes.length(), Basis::rank);
            let model = model.map(|kind| {
                let model = GridModel::new(kind, &planes);
                let model = model.ok_or_else(|| {
                    malformed("the scattering model in the grid chunk does not suit the directions of the material")
                })?;
                let coefficients = model.code(decoder, step, vectors, None, &mut 0);
                Ok::<_, CodecError>((model, coefficients))
            });
            Ok::<_, CodecError>((planes, order, model.transpose()?))
        };
        let (opening, decoder, streams) = if random {
            let length = r.size(usize::MAX >> 1, "length of a stream")?;
            let opening = open(&mut Decoder::new(r.take(length, "opening of a grid")?))?;
            let streams = Streams::read(&mut r, false, opening.0.streams())?;
            (opening, Decoder::new(&[]), Some(streams))
        } else {
            let stream = match level {
                None => r.take(r.remaining(), "grid")?,
                Some(level) => {
                    let end = levels
                        .get(level)
                        .map(|level| level.end)
                        .ok_or_else(|| malformed("the grid chunk does not list the resolution level asked for"))?;
                    // A level is decoded from its own bytes only, however many follow.
                    let cut = CodecError::Truncated { at: r.offset() + r.remaining(), expected: "more of the level" };
                    r.take(end, "bytes of the level").map_err(|_| cut)?
                }
            };
            let mut decoder = Decoder::new(stream);
            (open(&mut decoder)?, decoder, None)
        };
        let (planes, order, model) = opening;
        Ok(Self { quantiser, negative_bound, planes, basis, order, model, divided, levels, decoder, streams })
    }

    /// Computes the means of the scattering model over the directions that each node of a coarser grid merges, for each
    /// channel; `None` without a model.
    pub(super) fn means_of_model(&self, weights: &Weights, lines: &[Nodes]) -> Option<Vec<f32>> {
        let (model, coefficients) = self.model.as_ref()?;
        let layout = (self.vectors(), self.planes.streams());
        Some(self.planes.means(weights, lines, layout.0, |each| model.visit(coefficients, layout, each)))
    }

    /// Adds the scattering model, if there is one, to the decoded channels of all incoming directions.
    fn add_model(&self, planes: &mut [f32]) {
        if let Some((model, coefficients)) = &self.model {
            let layout = (self.vectors(), self.planes.streams());
            model.apply(coefficients, layout, planes, |value, model| *value += model);
        }
    }

    pub(super) fn vectors(&self) -> usize {
        self.basis.as_ref().map_or(self.planes.length(), Basis::rank)
    }
}

/// Decodes the values of a grid chunk, with or without a basis chunk: logarithms, or samples if linear. With `finish`
/// they become magnitudes.
pub(crate) fn decode(
    around: Around<'_>,
    chunks: (Option<&[u8]>, &[u8]),
    finish: Option<Values>,
) -> Result<Vec<f32>, CodecError> {
    let Around { classes, .. } = around;
    let mut opened = Opened::new(around, chunks, (chunks.1.len(), None))?;
    let (vectors, quantiser) = (opened.vectors(), opened.quantiser);
    let planes = &opened.planes;
    let weights = planes.weights(classes);
    let mut decoded: Vec<f32> = if let Some(streams) = &opened.streams {
        let stream = |k: usize| {
            let pyramid = planes.pyramid(&opened.order, &weights, k);
            pyramid.code(&mut streams.block(k), quantiser, (vectors, vectors), None, 0).0
        };
        (0..planes.streams()).into_par_iter().flat_map_iter(stream).collect()
    } else {
        let pyramid = planes.pyramid(&opened.order, &weights, 0);
        let count = planes.units() * vectors;
        pyramid.code(&mut opened.decoder, quantiser, (count, vectors), None, 0).0
    };
    opened.add_model(&mut decoded);
    let mut values = vec![0.0; planes.rows() * planes.length()];
    planes.synthesise(opened.basis.as_ref(), &decoded, &mut values);
    if let Some(divided) = &opened.divided {
        divided.restore(&mut values);
    }
    bound_negative(opened.negative_bound, classes, &mut values);
    if let Some(finish) = finish {
        finish.finish(&mut values);
    }
    Ok(values)
}

fn add(planes: &mut [f32], model: &[f32]) {
    planes.iter_mut().zip(model).for_each(|(x, m)| *x += m);
}

/// Decodes the values of one incoming direction from a grid chunk, bit for bit as [`decode`] does: `[outgoing,
/// wavelength]`.
pub(crate) fn decode_block(
    around: Around<'_>,
    chunks: (Option<&[u8]>, &[u8]),
    entry: usize,
) -> Result<Vec<f32>, CodecError> {
    let Around { classes, .. } = around;
    let opened = Opened::new(around, chunks, (chunks.1.len(), None))?;
    let malformed = |reason: String| CodecError::Malformed { at: 0, reason };
    let Some(streams) = &opened.streams else {
        return Err(malformed(
            "the material allows no random access: it codes all incoming directions together".to_owned(),
        ));
    };
    let (planes, vectors) = (&opened.planes, opened.vectors());
    if entry >= planes.lattice().shape().incoming_entries() {
        return Err(malformed(format!("the material has no incoming direction number {entry}")));
    }
    let unit = planes.lattice().unit_of(entry);
    let pyramid = planes.pyramid(&opened.order, &planes.weights(classes), unit);
    let mut decoded = pyramid.code(&mut streams.block(unit), opened.quantiser, (vectors, vectors), None, 0).0;
    if let Some((model, coefficients)) = &opened.model {
        add(&mut decoded, &model.entries(coefficients, vectors, unit..unit + 1));
    }
    let rows = planes.lattice().outgoing_rows();
    let mut values = vec![0.0; rows.len() * planes.length()];
    planes.synthesise_rows(opened.basis.as_ref(), (&decoded, planes.unit()), |row| rows[row] as usize, &mut values);
    if let Some(divided) = &opened.divided {
        divided.restore_entry(entry, &mut values);
    }
    let own = classes.map(|classes| &classes[entry * values.len()..][..values.len()]);
    bound_negative(opened.negative_bound, own, &mut values);
    Ok(values)
}

/// Reads the largest logarithm of a negative sample's magnitude from a grid chunk; `None` if the chunk states none.
pub(crate) fn negative_bound(coded: &[u8]) -> Result<Option<f32>, CodecError> {
    let mut r = Reader::new(coded, 0);
    let flags = Flags::read(&mut r)?;
    if flags.has_negative { r.f32("bound of the logarithms of negative samples").map(Some) } else { Ok(None) }
}

/// Returns true if each incoming direction in a chunk of samples on a grid of angles can be decoded alone.
pub(crate) fn is_random(coded: &[u8]) -> Result<bool, CodecError> {
    Ok(Flags::read(&mut Reader::new(coded, 0))?.random)
}

/// Returns true if a chunk of samples on a grid of angles lists lower-resolution grids.
pub(crate) fn has_levels(coded: &[u8]) -> Result<bool, CodecError> {
    Ok(Flags::read(&mut Reader::new(coded, 0))?.has_levels)
}

/// Bit in the first byte of a chunk of samples on a grid of angles that is set if the chunk lists lower-resolution
/// grids.
pub(super) const LEVELS: u8 = 8;

/// Bit in the first byte of a chunk of samples on a grid of angles that is set if negative samples are approximated as
/// exactly as positive ones.
pub(super) const WEIGHS_NEGATIVE: u8 = 64;

/// Bit in the first byte of a chunk of samples on a grid of angles that is set if the samples were divided by the
/// function of the interpolation between incoming directions before they were coded.
pub(super) const DIVIDED: u8 = 128;

/// Options with which a chunk of samples on a grid of angles was coded; the first byte of the chunk states them.
#[derive(Clone, Copy)]
#[allow(clippy::struct_excessive_bools, reason = "each is a flag of the file")]
pub(super) struct Flags {
    random: bool,
    pub(super) has_negative: bool,
    learns: bool,
    has_levels: bool,
    weighs_negative: bool,
    is_divided: bool,
    model: Option<ChartKind>,
}

impl Flags {
    pub(super) fn read(r: &mut Reader<'_>) -> Result<Self, CodecError> {
        let form = r.u8("form of a grid chunk")?;
        let model = GridModel::kind_of(form, r)?;
        let has_both = |a: u8, b: u8| form & a != 0 && form & b != 0;
        if has_both(LEVELS, 1) || has_both(WEIGHS_NEGATIVE, 2) {
            return Err(r.malformed(format!("the form {form} of the grid chunk (its first byte) is unknown")));
        }
        Ok(Self {
            random: form & 1 != 0,
            has_negative: form & 2 != 0,
            learns: form & 4 == 0,
            has_levels: form & LEVELS != 0,
            weighs_negative: form & WEIGHS_NEGATIVE != 0,
            is_divided: form & DIVIDED != 0,
            model,
        })
    }

    /// Reads the fields between the first byte and the entropy-coded bytes of a chunk of samples on a grid of angles.
    /// Returns the table of lower-resolution grids. A bound on the logarithms of negative samples is read but not
    /// returned. `end` is the offset of the chunk's end.
    pub(super) fn levels(self, r: &mut Reader<'_>, end: usize) -> Result<Vec<GridLevel>, CodecError> {
        if self.has_negative {
            r.f32("bound of the logarithms of negative samples")?;
        }
        if self.has_levels { index::read(r, end) } else { Ok(Vec::new()) }
    }
}
