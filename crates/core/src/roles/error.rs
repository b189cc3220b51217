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
    /// The material has another quantity.
    #[error("this material is of quantity {found}, expected {expected}")]
    Quantity {
        /// Quantity of the material.
        found: Quantity,
        /// Quantities that the view accepts.
        expected: &'static str,
    },
    /// The directions of the material are not those of the view.
    #[error("this {quantity} has {found}, expected {expected}")]
    Directions {
        /// Quantity of the material.
        quantity: Quantity,
        /// Directions of the material.
        found: &'static str,
        /// Directions of the view.
        expected: &'static str,
    },
    /// The entry of the index axes or the wavelengths do not fit the material.
    #[error(transparent)]
    Query(#[from] EvaluateError),
}
