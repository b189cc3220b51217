//! Directions that a lobe stays with.

use serde::{Deserialize, Serialize};

/// Direction about which a reflection lobe is centred, relative to the incoming direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum LobeCentre {
    /// Lobe about the mirror direction; distances from the centre are angles.
    Mirror,
    /// Lobe about the mirror direction; distances from the centre are slopes of the half vector, as for microfacet
    /// surfaces.
    HalfVector,
    /// Lobe about the direction back to the source (retro-reflection); distances from the centre are angles.
    Source,
}

/// List of all kinds of centre of a reflection lobe: mirror direction (by angle or by half vector), and back to the
/// source.
pub const CENTRES: [LobeCentre; 3] = [LobeCentre::Mirror, LobeCentre::HalfVector, LobeCentre::Source];
