//! Physical plausibility of a material: reports on energy, flux, normalisation and reciprocity, and functions that
//! enforce them.
//!
//! Repairs happen only on request. [`super::Material::energy`] and [`super::Material::reciprocity`] only report.
//! [`Preparation`] changes samples before a material is used, and counts its changes.
//! [`super::Material::symmetric_spectrum`] is a different function from [`super::Material::evaluate`].

mod energy;
mod flux;
mod gloss;
mod luminaire;
mod plane;
mod preparation;
mod reciprocity;
mod reflectance;
mod spot;
mod symmetric;
#[cfg(test)]
mod tests;

pub use energy::{AlbedoReport, Allowance, EnergyReport, NormalisationReport, Verdict};
pub use flux::FluxReport;
pub use gloss::GlossReport;
pub use luminaire::{IntensityAt, LuminaireReport, PlaneReport, ZoneReport};
pub use preparation::{Preparation, Prepared};
pub use reciprocity::{ReciprocityReport, WorstPair};
pub use spot::Spot;
pub use symmetric::Mean;
