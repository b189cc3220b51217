//! Views of materials by their role in a scene: surface, light source, medium or spectrum.
//!
//! [`Material`](crate::evaluate::Material) answers any query about any quantity and returns an error for arguments that
//! do not fit. A view ([`Bsdf`], [`Emitter`], [`Phase`], [`Spectrum`]) takes only the arguments of its role, and is
//! checked once, on creation.
//!
//! Directional views evaluate whole spectra into new or given memory. Their method `at` fixes the wavelengths of a
//! light path and returns a view ([`BsdfAt`], [`EmitterAt`], [`PhaseAt`]) whose queries do not allocate. The first
//! sample or density of a material builds its sampling trees
//! ([`Material::prepare_sampling`](crate::evaluate::Material::prepare_sampling) builds them beforehand).
//!
//! * Views evaluate and sample the smooth form ([`crate::evaluate`] defines it). Albedo, flux and integral are those
//!   stored for measured cells: of the piecewise constant form, averaged between incoming directions.
//! * `wi` points to where light comes from, `wo` to where it goes, both away from the surface or scattering point.
//! * Outside the domain of a direction, values and densities are 0, and `sample` returns `None`.
//! * If a whole spectrum is masked (not measured), values are NaN, the density is 0, and `sample` returns `None`. If
//!   some wavelengths are masked, values there are NaN and weights 0.
//! * [`Sample`] has a weight f · |cos θo| / pdf (BSDFs) or f / pdf, and a density in sr⁻¹.
//! * Negative values in the data are returned by `eval` and in weights at chosen wavelengths; a weight by the mean over
//!   wavelengths is then 0. [`Preparation::clamp`](crate::evaluate::physics::Preparation::clamp) removes them
//!   beforehand.
//!
//! # Paths from the camera Only `wo` can be sampled. A path that starts at the camera knows the direction to the viewer
//! and needs the one to the light. Pass the direction to the viewer as `wi` and use the sampled `wo` as the direction
//! to the light, with the cosine of the sampled direction.
//!
//! This assumes a reciprocal function. Measured data are only approximately reciprocal ([`crate::evaluate::physics`]
//! reports the deviation), and a BTDF is not: it is 0 from the side of its `wo`. Use one order throughout a renderer.

mod bsdf;
mod emitter;
mod error;
mod phase;
mod sample;
mod spectrum;
mod view;

pub use bsdf::{Bsdf, BsdfAt};
pub use emitter::{Emitter, EmitterAt};
pub use error::RoleError;
pub use phase::{Phase, PhaseAt};
pub use sample::Sample;
pub use spectrum::Spectrum;

#[cfg(test)]
mod tests;
