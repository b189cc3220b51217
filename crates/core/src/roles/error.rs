//! Error type of the views of materials.

use crate::domain::Quantity;
use crate::evaluate::EvaluateError;

/// Reasons why a material cannot be viewed as a surface, light source, medium or spectrum.
///
/// ```
/// use wavelume_core::domain::Quantity;
/// use wavelume_core::roles::RoleError;
/// let lamp = wavelume_core::open_bytes(include_bytes!("../../examples/materials/led.wlm"))?;
/// match lamp.bsdf() {
///     Err(RoleError::Quantity { found, expected }) => {
///         assert_eq!((found, expected), (Quantity::Edf, "a brdf, btdf or bsdf"));
///     }
///     _ => panic!("a lamp reflects nothing"),
/// }
/// # Ok::<(), wavelume_core::evaluate::EvaluateError>(())
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RoleError {
    /// The radiometric quantity of the material does not suit the requested use as a surface, light source, phase
    /// function or spectrum.
    #[error("this material is of quantity {found}, expected {expected}")]
    Quantity {
        /// Radiometric quantity of the material.
        found: Quantity,
        /// Radiometric quantities that a material needs to serve as the requested surface, light source or phase
        /// function.
        expected: &'static str,
    },
    /// The material lacks incoming or outgoing directions that its requested use as a surface, light source, phase
    /// function or spectrum needs. Or it has directions that this use does not allow.
    #[error("kinds of directions (incoming, outgoing) of this {quantity}: found {found}, expected {expected}")]
    Directions {
        /// Radiometric quantity of the material.
        quantity: Quantity,
        /// Description of the directions that the material has.
        found: &'static str,
        /// Description of the directions that a material needs to serve as the requested surface, light source, phase
        /// function or spectrum.
        expected: &'static str,
    },
    /// The requested entry of the index axes (axes of numbered entries) or the requested wavelengths do not fit the
    /// material, or too few of its directions were measured.
    #[error(transparent)]
    Query(#[from] EvaluateError),
}
