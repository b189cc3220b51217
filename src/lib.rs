//! wavelume: acquired radiometric measurements, compressed with generic wavelet transforms to a promised error.
//!
//! Data flow downward; nothing imports upward:
//! file → [`formats`] → [`projection`] → tensor ([`domain`]) → [`transform`] → `codec` → [`compress`] → [`evaluate`].

pub mod codec;
pub mod compress;
pub mod domain;
pub mod evaluate;
pub mod formats;
pub mod pipeline;
pub mod projection;
pub mod transform;
