//! A lobe of reflected light that is narrower than cells can hold: its function, what is drawn from it, and its integrals.

mod around;
mod centre;
mod function;
mod integrals;
mod parameters;
mod profile;
#[cfg(test)]
mod tests;
mod under;

pub use centre::{CENTRES, LobeCentre};
pub use function::Lobe;
pub use parameters::{LobeError, LobeParameters};
pub use under::LobeUnder;
