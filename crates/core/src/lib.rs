//! Core library of wavelume, for use in renderers: radiometric measurements, wavelet transforms, compression, and
//! evaluation and sampling of compressed materials.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use wavelume_core::Direction;
//! # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/materials/plastic.wlm");
//! let material = wavelume_core::open(path)?;
//! let bsdf = material.bsdf()?.at([450.0, 550.0, 650.0])?;
//! let wi = Direction::from_degrees(30.0, 0.0);
//! let f: [f32; 3] = bsdf.eval(wi, Direction::from_degrees(45.0, 180.0));
//! if let Some(sample) = bsdf.sample(wi, [0.3, 0.6]) {
//!     println!("f = {f:?} 1/sr, drawn {:?} with density {} 1/sr", sample.wo.xyz(), sample.pdf);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! [`open`] and [`open_bytes`] return a [`Material`]. It can be viewed as a surface, a light source, a medium or a
//! spectrum ([`roles`]), or queried directly ([`evaluate`]).
//!
//! Modules depend only on those before them in the order of the data flow:
//! tensor ([`domain`]) → [`transform`] → `codec` → [`compress`] → [`algebra`] and [`evaluate`] → [`roles`].

pub mod algebra;
mod codec;
pub mod compress;
pub mod domain;
pub mod evaluate;
#[doc(hidden)]
pub mod numeric;
mod open;
pub mod roles;
pub mod transform;

pub use domain::Direction;
pub use evaluate::{EvaluateError, Material};
pub use open::{OpenError, open, open_bytes};
pub use roles::{Bsdf, BsdfAt, Emitter, EmitterAt, Phase, PhaseAt, RoleError, Sample, Spectrum};
