//! Report on the interpolation between incidences: what was chosen, and how far off it is where one of them is left out.

use crate::compress::{Between, Noise};
use crate::evaluate::{LeftOut, Material};
use serde::Serialize;

/// Wavelengths whose mean is compared.
const MEAN_OF: f64 = 3.0;

/// Interpolation between incidences, and its errors; all numbers are relative: 0.01 is 1 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct IncidenceReport {
    /// What was chosen at compression.
    pub interpolation: Between,
    /// er(L2) of each inner incidence where it is left out and predicted from those around it, over outgoing directions to 80°
    /// from the normal.
    pub left_out_er_l2: f64,
    /// er(L2) that is expected between incidences: a quarter of it, without the noise of the samples.
    pub estimated_er_l2: f64,
    /// Largest share of an incidence's light that is expected in the wrong place between incidences.
    pub estimated_moved: f64,
}

impl IncidenceReport {
    /// The report on an opened material; `None` where no incidence stands between others.
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

    /// A warning where the error that is expected between incidences is far above the one that is promised at them.
    pub(super) fn warning(&self, promised: f64) -> Option<String> {
        let left_out =
            LeftOut { er_l2: self.left_out_er_l2, between: self.estimated_er_l2, moved: self.estimated_moved };
        left_out.warning(promised)
    }
}
