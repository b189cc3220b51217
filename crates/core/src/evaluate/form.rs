//! Storage of a material's samples for queries: a few planes with smooth tables, or every sample.

use super::geometry::Geometry;
use super::incoming::Alignment;
use super::planes::Planes;
use super::reconstruct::Cells;
use super::samples::Samples;
use super::smooth::Smooth;
use crate::compress::Between;
use crate::domain::{Measurement, Quantity, Sampling};

/// Interpolation between incidences, as far as a user or a file specifies it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Course {
    /// Alignment; `None` selects the best one.
    pub(super) alignment: Option<Alignment>,
    pub(super) between: Between,
}

impl Course {
    /// Alignments to choose from.
    pub(super) fn candidates(&self, quantity: Quantity) -> Vec<Alignment> {
        match self.alignment {
            Some(alignment) => vec![alignment],
            None if self.between.retro => vec![Alignment::Rotation],
            None => candidates(quantity),
        }
    }
}

/// Storage of samples for queries.
#[derive(Debug)]
pub(super) enum Form {
    /// A few planes with smooth tables.
    Planes { planes: Box<Planes>, smooth: Box<Smooth> },
    /// Every sample.
    Samples(Samples),
}

impl Form {
    /// Builds the form of a measurement; planes if a few of them represent the samples.
    pub(super) fn of(measurement: Measurement, geometry: &Geometry, course: Course) -> Self {
        if let Some((planes, smooth)) = planes(&measurement, geometry, course) {
            return Self::Planes { planes: Box::new(planes), smooth: Box::new(smooth) };
        }
        Self::Samples(Samples::new(measurement.tensor.into_samples(), geometry.shape()))
    }

    /// Smooth tables; `None` if every sample is kept.
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

/// Alignments to choose from if neither the user nor the file specifies one.
fn candidates(quantity: Quantity) -> Vec<Alignment> {
    match quantity {
        Quantity::Brdf | Quantity::Bsdf => vec![Alignment::None, Alignment::HalfVector, Alignment::TurnedHalfVector],
        Quantity::Btdf | Quantity::Phase => vec![Alignment::None, Alignment::Rotation],
        _ => vec![Alignment::None],
    }
}

/// Planes and their smooth tables; `None` if a few planes do not represent the samples.
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
