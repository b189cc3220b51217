//! Lobe of reflected light that is too narrow for cells: its function, importance sampling and integrals.

mod around;
mod centre;
mod function;
mod integrals;
mod microfacets;
mod parameters;
mod profile;
#[cfg(test)]
mod tests;
mod under;

pub use centre::{CENTRES, LobeCentre};
pub use function::Lobe;
#[doc(hidden)]
pub use microfacets::{ROUGHNESS_OF_WIDTH, microfacets};
pub use parameters::{LobeError, LobeParameters};
pub use under::LobeUnder;
