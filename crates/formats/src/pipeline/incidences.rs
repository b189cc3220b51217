//! Report on the interpolation between incident directions, and its error estimated by leaving out incidences.

use crate::compress::{Between, Noise};
use crate::domain::Note;
use crate::evaluate::{LeftOut, Material};
use serde::{Deserialize, Serialize};

/// Upper bound on the number of wavelengths that are averaged before leave-one-out errors are computed, as in
/// [`Material::left_out`]. Averaging n of them lowers independent noise by √n.
const MEAN_OF: f64 = 3.0;

/// Method and errors of the interpolation between incident directions. All numbers are relative: 0.01 is 1 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct IncidenceReport {
    /// Method of interpolation between incident directions, chosen at compression.
    pub interpolation: Between,
    /// Leave-one-out error er(L2): each inner incident direction is predicted from those around it. Only outgoing
    /// directions within 80° of the normal count.
    pub left_out_er_l2: f64,
    /// Expected error er(L2) between the measured incident directions: a quarter of the leave-one-out error, without
    /// the noise of the samples.
    pub estimated_er_l2: f64,
    /// Largest fraction of the reflected light that interpolation between two incident directions is expected to send
    /// in a wrong direction.
    pub estimated_moved: f64,
}

impl IncidenceReport {
    /// Creates the report on interpolation between the incident directions of an opened material. Returns `None` if no
    /// incident direction lies between others.
    pub(super) fn of(material: &Material, noise: Option<Noise>) -> Option<Self> {
        let noise = noise.map_or(0.0, |noise| {
            let spectral = (material.lambdas() as f64).min(MEAN_OF);
            (noise.relative * noise.relative / spectral + noise.common * noise.common).sqrt()
        });
        let LeftOut { er_l2, between, moved } = material.left_out(noise)?;
        Some(Self {
            interpolation: material.summary().map_or_else(Between::default, |summary| summary.between),
            left_out_er_l2: er_l2,
            estimated_er_l2: between,
            estimated_moved: moved,
        })
    }

    /// Returns a warning if the expected error between the incident directions far exceeds `promised`, the error at
    /// these directions.
    pub(super) fn warning(&self, promised: f64) -> Option<Note> {
        let left_out =
            LeftOut { er_l2: self.left_out_er_l2, between: self.estimated_er_l2, moved: self.estimated_moved };
        left_out.warning(promised)
    }
}
