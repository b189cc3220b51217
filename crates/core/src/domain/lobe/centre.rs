//! Directions that a lobe stays with.

use serde::Serialize;

/// The direction that a lobe stays with, as the incoming direction moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LobeCentre {
    /// The mirror direction; distances are angles from it.
    Mirror,
    /// The mirror direction; distances are slopes of the half vector, as on surfaces of microfacets.
    HalfVector,
    /// The direction back to the source; distances are angles from it.
    Source,
}

/// All centres.
pub const CENTRES: [LobeCentre; 3] = [LobeCentre::Mirror, LobeCentre::HalfVector, LobeCentre::Source];
