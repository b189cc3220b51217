//! First layer of a file: approximates the logarithms at a given step. Here also the layer with a fixed basis on every
//! axis.

use super::super::effort::Tally;
use super::super::rows::{clear_uncoded, coding_order};
use super::super::scales::Scales;
use super::super::spectral_basis::SpectralBasis;
use super::super::values::Values;
use super::steps::Fineness;
use crate::codec::{ChunkKind, Class, Encoder, Payload, Rows, code_coefficients};
use crate::domain::Axis;
use crate::transform::{AxisTransform, Plan, PlanError, SphereBasis, Weights};
use std::cell::Cell;

/// Layer that approximates the logarithms of a measurement at any step.
pub(crate) trait FirstLayer {
    /// Writes the values decoded at `fineness` into `logs`.
    fn approximate(&self, fineness: Fineness, logs: &mut [f32]);
    /// Like [`Self::approximate`], but writes magnitudes of samples.
    fn magnitudes(&self, fineness: Fineness, values: Values, magnitudes: &mut [f32]) {
        self.approximate(fineness, magnitudes);
        values.finish(magnitudes);
    }
    /// Returns the chunks at `fineness`, in the order of a file.
    fn chunks(&self, fineness: Fineness) -> Vec<(ChunkKind, Vec<u8>)>;
    /// Number of nonzero coefficients at `fineness`.
    fn kept(&self, fineness: Fineness) -> u64;
    /// Returns true if `kept` only counts; other layers must code to find the number.
    fn counts_alone(&self) -> bool {
        false
    }
    /// Transforms of the axes.
    fn transforms(&self) -> &[AxisTransform];
    /// Basis on the spectral axis.
    fn basis(&self) -> SpectralBasis;
    /// Returns true if triangles are predicted rather than transformed.
    fn is_predicted(&self) -> bool {
        false
    }
    /// Returns true if grids of angles are predicted.
    fn is_gridded(&self) -> bool {
        false
    }
    /// Largest logarithm that a decoder gives a negative sample; `None` without negative samples, or without a bound.
    fn negative_bound(&self) -> Option<f32> {
        None
    }
}

/// Coefficients in fixed bases on all axes.
pub(crate) struct FixedLayer {
    plan: Plan,
    basis: SpectralBasis,
    transforms: Vec<AxisTransform>,
    scales: Scales,
    rows: Rows,
    coefficients: Vec<f32>,
}

impl FixedLayer {
    /// Transforms `logs` on `axes`; `classes` if some samples have no logarithm.
    pub(crate) fn new(
        axes: &[Axis],
        classes: Option<&[Class]>,
        basis: SpectralBasis,
        mut logs: Vec<f32>,
    ) -> Result<Self, PlanError> {
        let transforms: Vec<_> = axes.iter().map(|axis| transform_of(axis, basis)).collect();
        let plan = Plan::new(axes, &transforms)?;
        plan.forward(&mut logs);
        let rows = coding_order(axes, &plan, classes);
        clear_uncoded(&rows, &mut logs);
        Ok(Self { scales: Scales::new(axes, &plan), plan, basis, transforms, rows, coefficients: logs })
    }
}

impl FirstLayer for FixedLayer {
    fn approximate(&self, fineness: Fineness, logs: &mut [f32]) {
        self.scales.requantise(fineness.step, &self.coefficients, logs);
        self.plan.inverse(logs);
    }

    fn chunks(&self, fineness: Fineness) -> Vec<(ChunkKind, Vec<u8>)> {
        let mut quantised = vec![0; self.coefficients.len()];
        self.scales.quantise(fineness.step, &self.coefficients, &mut quantised);
        let mut encoder = Encoder::default();
        code_coefficients(&mut encoder, &self.rows, Payload::Integer, &mut quantised);
        vec![(ChunkKind::Coefficients, encoder.finish())]
    }

    fn kept(&self, fineness: Fineness) -> u64 {
        self.scales.count_kept(fineness.step, &self.coefficients)
    }

    fn counts_alone(&self) -> bool {
        true
    }

    fn transforms(&self) -> &[AxisTransform] {
        &self.transforms
    }

    fn basis(&self) -> SpectralBasis {
        self.basis
    }
}

/// Layer that counts its trials: one for each change of the fineness.
pub(crate) struct Counted<'a> {
    layer: Box<dyn FirstLayer + 'a>,
    tally: &'a Tally,
    samples: usize,
    last: Cell<Option<Fineness>>,
}

impl<'a> Counted<'a> {
    /// Counts trials of `layer`, each of `samples` samples, in `tally`.
    pub(crate) fn new(layer: Box<dyn FirstLayer + 'a>, tally: &'a Tally, samples: usize) -> Self {
        Self { layer, tally, samples, last: Cell::new(None) }
    }

    /// Returns the layer, and counts a trial if `fineness` is new.
    fn tried(&self, fineness: Fineness) -> &(dyn FirstLayer + 'a) {
        if self.last.replace(Some(fineness)) != Some(fineness) {
            self.tally.add(self.samples);
        }
        &*self.layer
    }
}

impl FirstLayer for Counted<'_> {
    fn approximate(&self, fineness: Fineness, logs: &mut [f32]) {
        self.tried(fineness).approximate(fineness, logs);
    }

    fn magnitudes(&self, fineness: Fineness, values: Values, magnitudes: &mut [f32]) {
        self.tried(fineness).magnitudes(fineness, values, magnitudes);
    }

    fn chunks(&self, fineness: Fineness) -> Vec<(ChunkKind, Vec<u8>)> {
        self.tried(fineness).chunks(fineness)
    }

    fn kept(&self, fineness: Fineness) -> u64 {
        if self.counts_alone() { self.layer.kept(fineness) } else { self.tried(fineness).kept(fineness) }
    }

    fn counts_alone(&self) -> bool {
        self.layer.counts_alone()
    }

    fn transforms(&self) -> &[AxisTransform] {
        self.layer.transforms()
    }

    fn basis(&self) -> SpectralBasis {
        self.layer.basis()
    }

    fn is_predicted(&self) -> bool {
        self.layer.is_predicted()
    }

    fn is_gridded(&self) -> bool {
        self.layer.is_gridded()
    }

    fn negative_bound(&self) -> Option<f32> {
        self.layer.negative_bound()
    }
}

/// Transform of an axis that carries logarithms.
pub(crate) fn transform_of(axis: &Axis, basis: SpectralBasis) -> AxisTransform {
    basis.transform_of(axis, SphereBasis::Orthonormal(Weights::Count))
}

/// Total bytes of the chunks.
pub(super) fn chunk_bytes(chunks: &[(ChunkKind, Vec<u8>)]) -> usize {
    chunks.iter().map(|(_, payload)| payload.len()).sum()
}
