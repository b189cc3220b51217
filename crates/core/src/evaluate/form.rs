//! How the samples of a material are kept for queries: as a few planes with smooth tables, or every sample.

use super::geometry::Geometry;
use super::incoming::Alignment;
use super::planes::Planes;
use super::reconstruct::Cells;
use super::samples::Samples;
use super::smooth::Smooth;
use crate::domain::{Measurement, Quantity, Sampling};

/// How samples are kept for queries.
#[derive(Debug)]
pub(super) enum Form {
    /// A few planes, and smooth tables.
    Planes { planes: Box<Planes>, smooth: Box<Smooth> },
    /// Every sample.
    Samples(Samples),
}

impl Form {
    /// The form of a measurement; without an alignment by name the best is found.
    pub(super) fn of(measurement: Measurement, geometry: &Geometry, alignment: Option<Alignment>) -> Self {
        let candidates = alignment.map_or_else(|| candidates(measurement.quantity), |alignment| vec![alignment]);
        if let Some((planes, smooth)) = planes(&measurement, geometry, &candidates) {
            return Self::Planes { planes: Box::new(planes), smooth: Box::new(smooth) };
        }
        Self::Samples(Samples::new(measurement.tensor.into_samples(), geometry.shape()))
    }

    /// The smooth tables, where a few planes hold the samples.
    #[inline]
    pub(super) fn smooth(&self) -> Option<&Smooth> {
        if let Self::Planes { smooth, .. } = self { Some(smooth) } else { None }
    }

    /// Memory in bytes, without the size of the type.
    pub(super) fn memory(&self) -> usize {
        match self {
            Self::Planes { planes, smooth } => planes.memory() + smooth.memory(),
            Self::Samples(samples) => size_of_val(samples.all()),
        }
    }
}

/// How lobes may go from one incoming direction to the next.
pub(super) fn candidates(quantity: Quantity) -> Vec<Alignment> {
    match quantity {
        Quantity::Brdf | Quantity::Bsdf => vec![Alignment::None, Alignment::HalfVector, Alignment::TurnedHalfVector],
        Quantity::Btdf | Quantity::Phase => vec![Alignment::None, Alignment::Rotation],
        _ => vec![Alignment::None],
    }
}

/// Planes and their smooth tables, where a few planes hold the samples.
fn planes(measurement: &Measurement, geometry: &Geometry, candidates: &[Alignment]) -> Option<(Planes, Smooth)> {
    let lookup = geometry.mesh()?;
    let planes = Planes::of(measurement.tensor.samples(), geometry.lambdas())?;
    let cells = Cells::new(lookup.mesh(), measurement.sampling == Sampling::Average);
    let (nodes, entries) = (geometry.nodes(), geometry.entries());
    let smooth = Smooth::new(&planes, &cells, lookup, nodes, entries, candidates, measurement.quantity.has_cosine())?;
    Some((planes, smooth))
}
