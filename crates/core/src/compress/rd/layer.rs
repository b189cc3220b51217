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

/// Coder that approximates the logarithms of a measurement with any quantiser step.
pub(crate) trait FirstLayer {
    /// Codes with this quantiser setting, if the result is kept for later calls. To be called before a list of decoded
    /// samples is made, so that the memory that coding takes is free by then.
    fn prepare(&self, _fineness: Fineness) {}
    /// Writes the logarithms that a decoder gets with this quantiser setting into `logs`.
    fn approximate(&self, fineness: Fineness, logs: &mut [f32]);
    /// Writes the magnitudes of samples that a decoder gets with this quantiser setting.
    fn magnitudes(&self, fineness: Fineness, values: Values, magnitudes: &mut [f32]) {
        self.approximate(fineness, magnitudes);
        values.finish(magnitudes);
    }
    /// Returns the file chunks coded with this quantiser setting, in the order of a file.
    fn chunks(&self, fineness: Fineness) -> Vec<(ChunkKind, Vec<u8>)>;
    /// Number of nonzero coefficients with this quantiser setting.
    fn kept(&self, fineness: Fineness) -> u64;
    /// Returns true if the number of nonzero coefficients can be counted without coding them.
    fn counts_alone(&self) -> bool {
        false
    }
    /// Basis change applied along each axis of the measurement: wavelets on a line, a basis on triangles, or the
    /// identity.
    fn transforms(&self) -> &[AxisTransform];
    /// Returns the basis in which samples are expanded along the wavelength axis.
    fn basis(&self) -> SpectralBasis;
    /// Returns true if samples on triangles are coded by prediction rather than by a transform.
    fn is_predicted(&self) -> bool {
        false
    }
    /// Returns true if samples on grids of angles are coded by prediction rather than by a transform.
    fn is_gridded(&self) -> bool {
        false
    }
    /// Upper bound on the logarithm of the magnitude to which a negative sample decodes. `None` if there are no
    /// negative samples, or if their magnitudes are approximated like those of positive ones.
    fn negative_bound(&self) -> Option<f32> {
        None
    }
}

/// Coder of the logarithms of samples by wavelets or other fixed bases on all axes.
pub(crate) struct FixedLayer {
    plan: Plan,
    basis: SpectralBasis,
    transforms: Vec<AxisTransform>,
    scales: Scales,
    rows: Rows,
    coefficients: Vec<f32>,
}

impl FixedLayer {
    /// Transforms `logs` on `axes` in fixed bases; `classes` marks samples without a logarithm, `None` if there are
    /// none.
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

/// Coder that counts its trials: one whenever the quantiser setting changes.
pub(crate) struct Counted<'a> {
    layer: Box<dyn FirstLayer + 'a>,
    tally: &'a Tally,
    samples: usize,
    last: Cell<Option<Fineness>>,
}

impl<'a> Counted<'a> {
    /// Wraps the coder `layer` so that `tally` counts its trial quantisations and, for each of them, the `samples`
    /// samples that it processes.
    pub(crate) fn new(layer: Box<dyn FirstLayer + 'a>, tally: &'a Tally, samples: usize) -> Self {
        Self { layer, tally, samples, last: Cell::new(None) }
    }

    /// Returns the wrapped coder, and counts a trial quantisation if `fineness` (the quantiser setting) differs from
    /// that of the previous call.
    fn tried(&self, fineness: Fineness) -> &(dyn FirstLayer + 'a) {
        if self.last.replace(Some(fineness)) != Some(fineness) {
            self.tally.add(self.samples);
        }
        &*self.layer
    }
}

impl FirstLayer for Counted<'_> {
    fn prepare(&self, fineness: Fineness) {
        self.tried(fineness).prepare(fineness);
    }

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

/// Transform of the logarithms of samples along `axis`: `basis` along wavelengths, and an orthonormal basis with
/// equally weighted triangles on a mesh. Each other kind of axis has a fixed transform.
pub(crate) fn transform_of(axis: &Axis, basis: SpectralBasis) -> AxisTransform {
    basis.transform_of(axis, SphereBasis::Orthonormal(Weights::Count))
}

/// Returns the number of bytes in the payloads of all given chunks together.
pub(super) fn chunk_bytes(chunks: &[(ChunkKind, Vec<u8>)]) -> usize {
    chunks.iter().map(|(_, payload)| payload.len()).sum()
}
