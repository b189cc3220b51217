//! Report on the interpolation between incident directions, and its error estimated by leaving out incidences.

use crate::compress::{Between, Noise};
use crate::domain::Note;
use crate::evaluate::{LeftOut, Material};
use serde::{Deserialize, Serialize};

/// Upper bound on the number of wavelengths averaged before values are compared, as in [`Material::left_out`]. It
/// lowers the independent noise by its square root.
const MEAN_OF: f64 = 3.0;

/// Interpolation between incidences, and its errors. All numbers are relative: 0.01 is 1 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct IncidenceReport {
    /// Interpolation method chosen at compression.
    pub interpolation: Between,
    /// Leave-one-out er(L2): each inner incidence is predicted from those around it. Only outgoing directions within
    /// 80° of the normal count.
    pub left_out_er_l2: f64,
    /// Expected er(L2) between incidences: a quarter of the leave-one-out error, without the noise of the samples.
    pub estimated_er_l2: f64,
    /// Largest fraction of the light of one incidence that is expected in the wrong direction between incidences.
    pub estimated_moved: f64,
}

impl IncidenceReport {
    /// Creates the report on an opened material. Returns `None` if no incidence lies between others.
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

    /// Returns a warning if the expected error between incidences far exceeds `promised`, the error at the incidences.
    pub(super) fn warning(&self, promised: f64) -> Option<Note> {
        let left_out =
            LeftOut { er_l2: self.left_out_er_l2, between: self.estimated_er_l2, moved: self.estimated_moved };
        left_out.warning(promised)
    }
}
