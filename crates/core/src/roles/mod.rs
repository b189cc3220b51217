//! Materials by what they are in a scene: a surface, a light, a medium, a spectrum.
//!
//! [`Material`](crate::evaluate::Material) answers any query about any quantity and refuses what does not fit. A view of one
//! role has the arguments of that role alone: [`Bsdf`], [`Emitter`], [`Phase`], [`Spectrum`]. What does not fit is refused when
//! the view is made. The views of directions evaluate whole spectra into new memory, or into memory that is given; `at`
//! chooses the wavelengths of a path once and returns a view ([`BsdfAt`], [`EmitterAt`], [`PhaseAt`]) whose queries do not
//! allocate. The first sample or density of a material builds its sampling trees
//! ([`Material::prepare_sampling`](crate::evaluate::Material::prepare_sampling) does so beforehand).
//!
//! * The smooth form is evaluated and sampled ([`crate::evaluate`] has its rules). Albedo, flux and integral are those that are
//!   stored for measured cells: of the piecewise constant form, averaged between incoming directions.
//! * `wi` points to where light comes from, `wo` to where it goes, both away from the surface or scattering point.
//! * Outside the domain of a direction the function is 0, its density is 0, and nothing is drawn.
//! * Where the whole spectrum is masked (nothing was measured) values are NaN, the density is 0, and nothing is drawn. Where some
//!   wavelengths are masked, values are NaN and weights 0 at those.
//! * [`Sample`] has a weight f · |cos θo| / pdf (BSDFs) or f / pdf, and a density in sr⁻¹.
//! * Where data have negative values so have `eval` and the weights at chosen wavelengths; a weight by the mean is then 0.
//!   [`Preparation::clamp`](crate::evaluate::physics::Preparation::clamp) removes them beforehand.
//!
//! # Paths from the camera
//! Only `wo` is drawn. A path that starts at the camera knows the direction to the viewer and wants the one to the light: pass
//! the viewer's as `wi` and take the drawn `wo` as the light's, with the cosine of the direction that was drawn. That takes the
//! function as reciprocal, which measured data are not quite ([`crate::evaluate::physics`] reports by how much), and which a BTDF
//! is not: from the side of its `wo` it is dark. Use one order throughout a renderer.

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
