//! wavelume: acquired radiometric measurements, compressed with generic wavelet transforms to a promised error.
//!
//! Data flow downward; nothing imports upward:
//! file → [`formats`] → [`projection`] → tensor ([`domain`]) → [`transform`] → [`codec`] → [`compress`] → [`algebra`] → [`evaluate`].
//! [`preview`] says what an opened material looks like: its colours, and a picture; [`export`] writes it as files that others
//! open.
//! `paper` makes the tables of the paper again on the same rooms.
//! The service stands on these: `store` (bytes under their digest) → `catalog` (what is known of them) → `jobs` → `api`.

pub mod algebra;
#[cfg(feature = "service")]
pub mod api;
#[cfg(feature = "service")]
pub mod catalog;
#[cfg(feature = "service")]
pub mod cli;
pub mod codec;
pub mod compress;
pub mod domain;
pub mod evaluate;
pub mod export;
pub mod formats;
#[cfg(feature = "service")]
pub mod jobs;
pub mod paper;
pub mod pipeline;
pub mod preview;
pub mod projection;
#[cfg(feature = "service")]
pub mod store;
pub mod transform;
