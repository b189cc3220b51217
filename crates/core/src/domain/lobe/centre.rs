//! Directions that a lobe stays with.

use serde::{Deserialize, Serialize};

/// Direction about which a lobe is centred, relative to the incoming direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum LobeCentre {
    /// Mirror direction; distances are angles from it.
    Mirror,
    /// Mirror direction; distances are slopes of the half vector, as for microfacet surfaces.
    HalfVector,
    /// Direction back to the source; distances are angles from it.
    Source,
}

/// All centres.
pub const CENTRES: [LobeCentre; 3] = [LobeCentre::Mirror, LobeCentre::HalfVector, LobeCentre::Source];
