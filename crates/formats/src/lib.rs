//! Files of measurements: read, put on the axes of a tensor, compressed, shown, and written for others.
//!
//! file → [`formats`] → [`projection`] → tensor → `wavelume_core` → [`preview`] and [`export`]. [`pipeline`] is that way as
//! one call.

mod appearance;
pub mod export;
pub mod formats;
pub mod pipeline;
pub mod preview;
pub mod projection;

use wavelume_core::{compress, domain, evaluate};
