//! What physics asks of a material: energy, flux, normalisation, reciprocity; reports, and functions that keep to it.
//!
//! Nothing is repaired unless it is asked for: [`super::Material::energy`] and [`super::Material::reciprocity`] only say, [`Preparation`]
//! changes samples before a material is used and counts what it changed, [`super::Material::symmetric_spectrum`] is another
//! function than [`super::Material::evaluate`].

mod energy;
mod flux;
mod preparation;
mod reciprocity;
mod reflectance;
mod spot;
mod symmetric;
#[cfg(test)]
mod tests;

pub use energy::{AlbedoReport, Allowance, EnergyReport, NormalisationReport, Verdict};
pub use flux::FluxReport;
pub use preparation::{Preparation, Prepared};
pub use reciprocity::{ReciprocityReport, WorstPair};
pub use spot::Spot;
pub use symmetric::Mean;
