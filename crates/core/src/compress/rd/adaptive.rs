//! First layer in a spectral basis of the data's own, with fixed bases on the other axes.

use super::super::rows::{clear_uncoded, coding_order};
use super::super::scales::Scales;
use super::super::setting_error::SettingError;
use super::super::spectral_basis::SpectralBasis;
use super::layer::{FirstLayer, transform_of};
use super::spectrum::{Basis, MAX_RANK, components};
use super::steps::Fineness;
use crate::codec::{ChunkKind, Class, CodecError, Decoder, Encoder, Payload, Rows, code_coefficients};
use crate::domain::Axis;
use crate::transform::{AxisTransform, Klt, Plan, PlanError};
use std::cell::RefCell;
use std::rc::Rc;

/// Coder of logarithms by the principal components of their own spectra, with fixed bases on the other axes.
pub(crate) struct AdaptiveLayer<'a> {
    axes: Vec<Axis>,
    classes: Option<&'a [Class]>,
    transforms: Vec<AxisTransform>,
    klt: Klt,
    logs: Vec<f32>,
    /// Cache of the coefficients of the last quantiser setting, because a search asks for size and error of it one
    /// after the other.
    last: RefCell<Option<(Fineness, Rc<Coefficients>)>>,
}

/// Coefficients of the logarithms: projected on a quantised spectral basis, then transformed along the other axes.
struct Coefficients {
    basis: Basis,
    chunk: Vec<u8>,
    /// Transform along all axes but the spectral one, norms of its synthesis functions, coding order, and the
    /// transformed coefficients. `None` if no transform fits the axes, which the constructor of the coder has excluded.
    planes: Option<(Plan, Scales, Rows, Vec<f32>)>,
}

impl<'a> AdaptiveLayer<'a> {
    /// Computes the principal components of `logs` on `axes`, the last of which is spectral.
    pub(crate) fn new(axes: &[Axis], classes: Option<&'a [Class]>, logs: Vec<f32>) -> Result<Self, SettingError> {
        let length = axes.last().map_or(1, Axis::len);
        let klt = components(&logs, length, MAX_RANK)?;
        let transforms: Vec<_> = axes.iter().map(|axis| transform_of(axis, SpectralBasis::Klt)).collect();
        plan_of_planes(axes, &transforms, 1)?;
        Ok(Self { axes: axes.to_vec(), classes, transforms, klt, logs, last: RefCell::new(None) })
    }

    /// Returns the coefficients for a quantiser setting (step and number of spectral vectors), from the cache if the
    /// last call had the same setting.
    fn at(&self, fineness: Fineness) -> Rc<Coefficients> {
        if let Some((known, coefficients)) = &*self.last.borrow()
            && *known == fineness
        {
            return Rc::clone(coefficients);
        }
        let (basis, chunk) =
            Basis::encode(&self.klt, &self.axes, (self.logs.len() / self.klt.length(), MAX_RANK), fineness);
        let planes = self.planes(&basis).ok();
        let coefficients = Rc::new(Coefficients { basis, chunk, planes });
        self.last.replace(Some((fineness, Rc::clone(&coefficients))));
        coefficients
    }

    /// Projects the logarithms on the spectral basis, and transforms the projections along the other axes.
    fn planes(&self, basis: &Basis) -> Result<(Plan, Scales, Rows, Vec<f32>), PlanError> {
        let mut planes = basis.analyse(&self.logs);
        let (axes, plan) = plan_of_planes(&self.axes, &self.transforms, basis.rank())?;
        plan.forward(&mut planes);
        let rows = coding_order(&axes, &plan, plane_classes(&self.axes, self.classes, basis.rank()).as_deref());
        clear_uncoded(&rows, &mut planes);
        Ok((plan.clone(), Scales::new(&axes, &plan), rows, planes))
    }
}

impl FirstLayer for AdaptiveLayer<'_> {
    fn approximate(&self, fineness: Fineness, logs: &mut [f32]) {
        let at = self.at(fineness);
        if let Some((plan, scales, _, planes)) = &at.planes {
            let mut decoded = vec![0.0; planes.len()];
            scales.requantise(fineness.step, planes, &mut decoded);
            plan.inverse(&mut decoded);
            at.basis.synthesise(&decoded, logs);
        }
    }

    fn chunks(&self, fineness: Fineness) -> Vec<(ChunkKind, Vec<u8>)> {
        let at = self.at(fineness);
        let mut chunks = vec![(ChunkKind::Basis, at.chunk.clone())];
        if let Some((_, scales, rows, planes)) = &at.planes {
            let mut quantised = vec![0; planes.len()];
            scales.quantise(fineness.step, planes, &mut quantised);
            let mut encoder = Encoder::default();
            code_coefficients(&mut encoder, rows, Payload::Integer, &mut quantised);
            chunks.push((ChunkKind::Coefficients, encoder.finish()));
        }
        chunks
    }

    fn kept(&self, fineness: Fineness) -> u64 {
        let at = self.at(fineness);
        let planes = at.planes.as_ref().map_or(0, |(_, scales, _, planes)| scales.count_kept(fineness.step, planes));
        // The entries of the basis count as kept coefficients.
        planes + at.basis.entries() as u64
    }

    fn transforms(&self) -> &[AxisTransform] {
        &self.transforms
    }

    fn basis(&self) -> SpectralBasis {
        SpectralBasis::Klt
    }
}

/// Decodes the natural logarithms of the samples' magnitudes from two chunks: one with the vectors of the spectral
/// basis, one with the spectra's wavelet coefficients on these vectors.
pub(crate) fn decode(
    axes: &[Axis],
    transforms: &[AxisTransform],
    classes: Option<&[Class]>,
    step: f32,
    (basis, coded): (&[u8], &[u8]),
) -> Result<Vec<f32>, CodecError> {
    let count: usize = axes.iter().map(Axis::len).product();
    let length = axes.last().map_or(1, Axis::len);
    let basis = Basis::decode(basis, axes, (count / length, MAX_RANK), step)?;
    let rank = basis.rank();
    let (plane_axes, plan) =
        plan_of_planes(axes, transforms, rank).map_err(|e| CodecError::Malformed { at: 0, reason: e.to_string() })?;
    let mut quantised = vec![0; count / length * rank];
    let rows = coding_order(&plane_axes, &plan, plane_classes(axes, classes, rank).as_deref());
    code_coefficients(&mut Decoder::new(coded), &rows, Payload::Integer, &mut quantised);
    let mut planes = vec![0.0; quantised.len()];
    Scales::new(&plane_axes, &plan).dequantise(step, &quantised, &mut planes);
    drop(quantised);
    plan.inverse(&mut planes);
    let mut logs = vec![0.0; count];
    basis.synthesise(&planes, &mut logs);
    Ok(logs)
}

/// Returns the axes of a tensor in which each spectrum is replaced by its `rank` coefficients on a spectral basis. Also
/// returns the plan that transforms such a tensor along the other axes.
fn plan_of_planes(axes: &[Axis], transforms: &[AxisTransform], rank: usize) -> Result<(Vec<Axis>, Plan), PlanError> {
    let mut axes = axes.to_vec();
    let mut transforms = transforms.to_vec();
    if let (Some(axis), Some(transform)) = (axes.last_mut(), transforms.last_mut()) {
        *axis = Axis::Index { count: rank, labels: Vec::new() };
        *transform = AxisTransform::Identity;
    }
    let plan = Plan::new(&axes, &transforms)?;
    Ok((axes, plan))
}

/// Classes of the principal-component coefficients of every spectrum: positive if the spectrum has a nonzero, unmasked
/// sample, else masked. `None` if the samples have no classes, as all are positive.
fn plane_classes(axes: &[Axis], classes: Option<&[Class]>, rank: usize) -> Option<Vec<Class>> {
    let length = axes.last().map_or(1, Axis::len);
    let class_of = |row: &[Class]| {
        let live = row.iter().any(|class| matches!(class, Class::Positive | Class::Negative));
        if live { Class::Positive } else { Class::Masked }
    };
    classes
        .map(|classes| classes.chunks_exact(length).flat_map(|row| std::iter::repeat_n(class_of(row), rank)).collect())
}
