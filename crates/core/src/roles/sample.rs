//! A direction that was drawn.

use crate::domain::Direction;

/// A direction drawn by a role's `sample`, with what a renderer multiplies by.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use wavelume_core::domain::Direction;
/// let material = wavelume_core::open_bytes(include_bytes!("../../examples/materials/plastic.wlm"))?;
/// let bsdf = material.bsdf()?;
/// let wi = Direction::from_degrees(30.0, 0.0);
/// if let Some(sample) = bsdf.sample(wi, [0.3, 0.6]) {
///     // What the density says of the direction is what it was drawn with.
///     assert!((bsdf.pdf(wi, sample.wo) / sample.pdf - 1.0).abs() < 1e-6);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample<W> {
    /// The direction drawn.
    pub wo: Direction,
    /// f · |cos θo| / pdf for BSDFs, f / pdf for emitters and phase functions: one number by the mean over wavelengths
    /// (0 where that is negative), or one for each wavelength that was chosen.
    pub weight: W,
    /// The probability density of the direction, sr⁻¹.
    pub pdf: f64,
}
