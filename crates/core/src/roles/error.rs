//! Why a material does not play a role.

use crate::domain::Quantity;
use crate::evaluate::EvaluateError;

/// Why a material cannot be viewed in a role.
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
    /// The material is of another quantity.
    #[error("this material is of quantity {found}, expected {expected}")]
    Quantity {
        /// What the material is.
        found: Quantity,
        /// The quantities that play the role.
        expected: &'static str,
    },
    /// The material has fewer directions, or more, than the role.
    #[error("this {quantity} has {found}, expected {expected}")]
    Directions {
        /// What the material is.
        quantity: Quantity,
        /// The directions that it has.
        found: &'static str,
        /// The directions of the role.
        expected: &'static str,
    },
    /// The entry of the index axes, or the wavelengths, do not fit the material.
    #[error(transparent)]
    Query(#[from] EvaluateError),
}
