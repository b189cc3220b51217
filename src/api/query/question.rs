//! The question that a batch asks about a material, for each of its records.

use super::super::problem::{Kind, Problem};
use super::places::Directions;
use crate::domain::Layout;
use crate::evaluate::{Beyond, Interpolation, Material};

/// Operation that a batch asks for, applied to each of its queries.
#[derive(Clone, Debug)]
pub(super) enum Question {
    /// Evaluation of a spectrum for a pair of directions, at `wavelengths` or at the material's own.
    Evaluate { index: Vec<usize>, how: Interpolation, beyond: Beyond, wavelengths: Option<Vec<f64>> },
    /// Probability density with which `Sample` draws the outgoing direction.
    Pdf { index: Vec<usize>, level: Option<u8> },
    /// Random outgoing direction for an incoming direction. Query k of a batch uses the random numbers 2k and 2k + 1 of
    /// the seed.
    Sample { index: Vec<usize>, level: Option<u8>, seed: u64 },
    /// Directional albedo for an incoming direction.
    Albedo { index: Vec<usize>, how: Interpolation },
}

impl Question {
    /// Drops from the question a list of wavelengths that equals the material's own: evaluation without a list is
    /// faster.
    pub(super) fn simplified(mut self, material: &Material) -> Self {
        if let Self::Evaluate { wavelengths, .. } = &mut self
            && *wavelengths == material.wavelengths()
        {
            *wavelengths = None;
        }
        self
    }

    /// Returns the number of values in the answer to one query.
    pub(super) fn width(&self, material: &Material) -> usize {
        match self {
            Self::Evaluate { wavelengths: Some(wavelengths), .. } => wavelengths.len(),
            Self::Evaluate { .. } | Self::Albedo { .. } => material.lambdas(),
            Self::Pdf { .. } => 1,
            Self::Sample { .. } => 4,
        }
    }

    /// Returns the directions that a binary query record contains, as far as `material` depends on them. Evaluations
    /// and densities need the incoming and the outgoing direction, random directions and albedos the incoming one.
    pub(super) fn directions(&self, material: &Material) -> Result<Directions, Problem> {
        let layout = Layout::of(material.quantity(), material.axes()).map_err(|error| Problem::internal(&error))?;
        let (wi, wo) = (layout.incoming.is_some(), layout.outgoing.is_some());
        let directions = match self {
            Self::Evaluate { .. } | Self::Pdf { .. } => Directions { wi, wo },
            Self::Sample { .. } | Self::Albedo { .. } => Directions { wi, wo: false },
        };
        if directions.bytes() == 0 {
            let quantity = material.quantity();
            let detail =
                format!("queries of a {quantity} without directions have no f32 records, expected a JSON body");
            return Err(Problem::new(Kind::UnfitQuery, detail));
        }
        Ok(directions)
    }
}
