//! Materials by what they are in a scene: a surface, a light, a medium, a spectrum.
//!
//! [`Material`](crate::evaluate::Material) answers any query about any quantity and refuses what does not fit. A view of one
//! role has the arguments of that role alone, and nothing left to refuse: [`Bsdf`], [`Emitter`], [`Phase`], [`Spectrum`].
//! Each evaluates whole spectra into new memory, or into memory that is given; `at` chooses the wavelengths of a path once
//! and returns a view ([`BsdfAt`], [`EmitterAt`], [`PhaseAt`]) that allocates nothing.
//!
//! * The smooth form is evaluated ([`crate::evaluate`] has its rules).
//! * `wi` points to where light comes from, `wo` to where it goes, both away from the surface or scattering point.
//! * Outside the domain of a direction the function is 0, its density is 0, and nothing is drawn.
//! * Where nothing was measured a value is NaN (masked), the density is 0, and nothing is drawn.
//! * [`Sample`] has a weight f · |cos θo| / pdf (BSDFs) or f / pdf, and a density in sr⁻¹.

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
