//! Colours of spectra: CIE tristimulus values, CIELAB, CIEDE2000 and sRGB.
//!
//! # Conventions
//! * In [`Xyz`] the perfect reflector (or the given white) has Y = 100; only [`Tristimulus::emission`] is absolute.
//! * The observer is the CIE 1931 2° observer unless another is given. No function adapts implicitly. CIELAB is
//!   relative to the given white. sRGB expects XYZ under D65; [`Adaptation`] converts from another white.
//! * Negative samples are summed unchanged, so XYZ may be negative; no formula here clips.
//!
//! # Sources
//! CIE 015:2018 *Colorimetry*; CIE 013.3-1995; ASTM E308-18 and E2022; IEC 61966-2-1:1999, amended. The tables are
//! those of the CIE (see `data/SOURCES.md`).

mod adaptation;
mod coverage;
mod difference;
mod gamut;
mod lab;
mod matrix;
mod rendering;
mod rendering_tables;
mod spectra;
mod srgb;
mod tables;
mod temperature;
mod tristimulus;
mod xyz;

pub use adaptation::Adaptation;
pub use coverage::{ColourError, MOST_GAP, NEEDED, RANGE};
pub use difference::ciede2000;
pub use gamut::{Oklab, in_gamut, map_to_gamut};
pub use lab::Lab;
pub use rendering::ColourRendering;
pub use spectra::xyz_of;
pub use spectra::{ColourReport, SpectraColours};
pub use srgb::{linear_to_bytes, linear_to_srgb, linear_to_xyz, srgb_to_linear, xyz_to_linear};
pub use tables::{Curve, Illuminant, Observer, StandardObserver, TableError};
pub use temperature::ColourTemperature;
pub use tristimulus::Tristimulus;
pub use xyz::Xyz;

#[cfg(test)]
mod display_tests;
#[cfg(test)]
mod tests;
