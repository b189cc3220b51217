//! Appearance of spectra: the conditions they are viewed under, and their linear sRGB under these.

mod channels;
mod emission;
mod viewing;

pub(crate) use channels::Channels;
pub(crate) use emission::emits;
pub use viewing::Viewing;
