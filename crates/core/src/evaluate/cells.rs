//! Input of the sampling trees: the function in cells, at vertices and under nodes, weighted over wavelengths.

use super::carried::Carry;
use super::form::Form;
use super::function::Function;
use super::incoming::Alignment;
use super::samples::known_sum;
use crate::domain::vector::Vector;
use crate::numeric::wide;

impl Function {
    /// Inner product of the spectrum of a cell (one incoming and one outgoing sample direction) with weights. Masked
    /// samples are skipped and the remaining weights renormalised. NaN for a fully masked cell of data on a spectral
    /// basis.
    pub(super) fn cell_value(&self, cell: usize, weights: &[f32]) -> f32 {
        match self.form() {
            Form::Planes { planes, .. } => wide(
                #[inline(always)]
                || planes.weighted(planes.row(cell), planes.presence(cell), weights),
            ),
            Form::Samples(samples) => {
                let row = samples.cell(cell);
                known_sum(weights, &|lambda| row[lambda])
            }
        }
    }

    /// Returns true if a cell (one incoming and one outgoing sample direction) has an unmasked nonzero sample.
    pub(super) fn is_lit_cell(&self, cell: usize) -> bool {
        match self.form() {
            Form::Planes { planes, .. } => planes.presence(cell) > 0.0,
            Form::Samples(samples) => samples.cell(cell).iter().any(|&sample| !sample.is_nan() && sample != 0.0),
        }
    }

    /// Returns true if any spectrum has masked samples.
    pub(super) fn has_masked(&self) -> bool {
        match self.form() {
            Form::Planes { planes, .. } => (0..self.geometry().cells()).any(|cell| planes.presence(cell).is_nan()),
            Form::Samples(samples) => samples.has_masked(),
        }
    }

    /// Sum over wavelengths of `weights` times the material's smoothly interpolated function at a mesh vertex (outgoing
    /// direction), under one sampled incoming direction. `cell` is the row-major number of the pair of a combination of
    /// indices (positions on the axes before the directions) and an incoming direction.
    pub(super) fn vertex_value(&self, cell: usize, vertex: u32, d: Vector, weights: &[f32]) -> f32 {
        let [n_in, n_out, _] = self.geometry().shape();
        let (entry, incoming) = (cell / n_in, cell % n_in);
        match (self.form(), self.geometry().mesh()) {
            (Form::Planes { planes, smooth }, _) => {
                let mixed = smooth.own(entry, incoming, self.geometry().incoming_direction(incoming), d);
                wide(
                    #[inline(always)]
                    || planes.weighted(&mixed.row, mixed.presence, weights),
                )
            }
            (Form::Samples(_), Some(lookup)) => {
                lookup.ring(vertex).map(|(leaf, share)| share * self.cell_value(cell * n_out + leaf, weights)).sum()
            }
            _ => 0.0,
        }
    }

    /// Sum over wavelengths of `weights` times the smooth function at the outgoing direction `d`, under one
    /// interpolation node over incoming directions.
    pub(super) fn node_value(&self, entry: usize, node: usize, d: Vector, weights: &[f32]) -> f32 {
        let Form::Planes { planes, smooth } = self.form() else { return 0.0 };
        let mixed = smooth.under(entry, node, d);
        wide(
            #[inline(always)]
            || planes.weighted(&mixed.row, mixed.presence, weights),
        )
    }

    /// Rule by which lobes follow the incoming direction in smooth interpolation, together with the domain of the
    /// outgoing directions. `None` if lobes stay in place or there is no incoming direction.
    pub(super) fn carry(&self) -> Option<Carry> {
        let smooth = self.form().smooth()?;
        let domain = self.geometry().mesh()?.mesh().domain();
        (smooth.alignment() != Alignment::None && self.geometry().has_incoming())
            .then_some((smooth.alignment(), domain))
    }

    /// Number of sampling trees for one combination of indices (positions on the axes before the directions): one for
    /// each sampled incoming direction. If these are interpolated between triangles, one more for each vertex of their
    /// mesh.
    pub(super) fn trees_of_entry(&self) -> usize {
        let [own, ..] = self.geometry().shape();
        match self.form() {
            Form::Planes { smooth, .. } => own.max(smooth.nodes().around_count()),
            Form::Samples(_) => own,
        }
    }
}
