//! Selection of the coefficients to keep: the paper's policies, K-term selection, greedy selection, refitting, and the
//! best basis.
//!
//! * [`Dictionary`]: dense matrices of a basis on a line, for exhaustive selection on spectra of a few dozen samples.
//! * [`GenericTransform`]: a tensor's coefficients with the norms of each space, for the policies of \[CPB06\] section
//!   4.2.
//! * `effects`: effect of each coefficient on the relative error. `refit`: best values of the kept coefficients.

mod best_basis;
mod dictionary;
mod effects;
mod generic;
mod k_term;
mod refit;

pub use best_basis::{Choice, Ranked, best_basis, line_dictionaries};
pub use dictionary::Dictionary;
pub use effects::effects;
pub use generic::{GenericTransform, Rule, Search};
pub use k_term::{Approximation, Constraint, RelativeErrors};
pub use refit::refit;
