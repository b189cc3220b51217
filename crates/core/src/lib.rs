//! The crate that a renderer links: measurements on their domains, wavelet transforms, the codec, and compressed materials
//! that are evaluated and sampled.
//!
//! Data flow downward; nothing imports upward:
//! tensor ([`domain`]) → [`transform`] → [`codec`] → [`compress`] → [`algebra`] and [`evaluate`].

pub mod algebra;
pub mod codec;
pub mod compress;
pub mod domain;
pub mod evaluate;
pub mod transform;
