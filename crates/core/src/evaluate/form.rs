//! Storage of a material's samples for queries: a few planes with smooth tables, or every sample.

use super::geometry::Geometry;
use super::incoming::Alignment;
use super::planes::Planes;
use super::reconstruct::Cells;
use super::samples::Samples;
use super::smooth::Smooth;
use crate::compress::Between;
use crate::domain::{Measurement, Quantity, Sampling};

/// Interpolation between incoming directions, as far as the user or the file specifies it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Course {
    /// Rule by which lobes move with the incoming direction in interpolation; `None` selects the best one for the data.
    pub(super) alignment: Option<Alignment>,
    pub(super) between: Between,
}

impl Course {
    /// Rules by which lobes may move with the incoming direction in interpolation. The best one for the data is
    /// selected.
    pub(super) fn candidates(&self, quantity: Quantity) -> Vec<Alignment> {
        match self.alignment {
            Some(alignment) => vec![alignment],
            None if self.between.retro => vec![Alignment::Rotation],
            None => candidates(quantity),
        }
    }
}

/// Storage of an opened material's samples for queries.
#[derive(Debug)]
pub(super) enum Form {
    /// A few coefficients on a common spectral basis for each pair of sampled directions, with tables for smooth
    /// interpolation.
    Planes { planes: Box<Planes>, smooth: Box<Smooth> },
    /// All samples as decoded, without a spectral basis.
    Samples(Samples),
}

impl Form {
    /// Builds the storage of a measurement: coefficients on a spectral basis if a few represent all spectra, otherwise
    /// all samples.
    pub(super) fn of(measurement: Measurement, geometry: &Geometry, course: Course) -> Self {
        if let Some((planes, smooth)) = planes(&measurement, geometry, course) {
            return Self::Planes { planes: Box::new(planes), smooth: Box::new(smooth) };
        }
        Self::Samples(Samples::new(measurement.tensor.into_samples(), geometry.shape()))
    }

    /// Tables for smooth interpolation; `None` if the storage holds all samples rather than spectral coefficients.
    #[inline]
    pub(super) fn smooth(&self) -> Option<&Smooth> {
        if let Self::Planes { smooth, .. } = self { Some(smooth) } else { None }
    }

    /// Heap memory of the stored samples and tables in bytes.
    pub(super) fn memory(&self) -> usize {
        match self {
            Self::Planes { planes, smooth } => planes.memory() + smooth.memory(),
            Self::Samples(samples) => size_of_val(samples.all()),
        }
    }
}

/// Rules by which lobes may move with the incoming direction in interpolation, if neither the user nor the file
/// specifies one.
fn candidates(quantity: Quantity) -> Vec<Alignment> {
    match quantity {
        Quantity::Brdf | Quantity::Bsdf => vec![Alignment::None, Alignment::HalfVector, Alignment::TurnedHalfVector],
        Quantity::Btdf | Quantity::Phase => vec![Alignment::None, Alignment::Rotation],
        _ => vec![Alignment::None],
    }
}

/// Spectral coefficients and tables for smooth interpolation; `None` if a few coefficients do not represent the
/// spectra.
fn planes(measurement: &Measurement, geometry: &Geometry, course: Course) -> Option<(Planes, Smooth)> {
    let lookup = geometry.mesh()?;
    let planes = Planes::of(measurement.tensor.samples(), geometry.lambdas())?;
    let cells = Cells::new(lookup.mesh(), measurement.sampling == Sampling::Average);
    let (nodes, entries) = (geometry.nodes(), geometry.entries());
    let candidates = course.candidates(measurement.quantity);
    let has_cosine = measurement.quantity.has_cosine();
    let smooth = Smooth::new(&planes, &cells, lookup, nodes, entries, (&candidates, &course.between), has_cosine)?;
    Some((planes, smooth))
}
