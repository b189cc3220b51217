//! Result of importance sampling.

use crate::domain::Direction;

/// Direction sampled from a surface, light source or phase function, with its weight and probability density.
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
    /// Direction drawn at random, with probability density `pdf`.
    pub wo: Direction,
    /// Weight of the sample in a renderer: f · |cos θo| / pdf for BSDFs, f / pdf for emitters and phase functions.
    /// Either one number from the mean over wavelengths (0 if that is negative), or one per chosen wavelength.
    pub weight: W,
    /// Probability density of the sampled direction, in sr⁻¹.
    pub pdf: f64,
}
