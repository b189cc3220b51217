//! Side of a window's layer from which light comes, and the azimuths as they are counted from there.

use crate::domain::named;

/// Side of a layer from which light comes, by the names of WINDOW.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum LitSide {
    /// Light from the front of the layer, which faces outdoors.
    Front,
    /// Light from the back of the layer, which faces indoors.
    Back,
}
named!(LitSide, "side", { Front = "front", Back = "back" });

/// Azimuths in degrees. WINDOW has one system of axes for both sides: +z points indoors, +y upwards, and +x to the
/// right as seen from indoors. Incident patches have the direction in which light travels. Here +z points to the light,
/// +y upwards, and +x to the right as seen from the light. Each function is its own inverse.
impl LitSide {
    /// Returns the azimuth from which light comes, of a patch that has this azimuth in WINDOW.
    pub(super) fn incident(self, azimuth: f64) -> f64 {
        within_turn(match self {
            Self::Front => -azimuth,
            Self::Back => azimuth + 180.0,
        })
    }

    /// Returns the azimuth to which light leaves, of a patch that has this azimuth in WINDOW.
    pub(super) fn leaving(self, azimuth: f64) -> f64 {
        within_turn(match self {
            Self::Front => 180.0 - azimuth,
            Self::Back => azimuth,
        })
    }
}

/// Returns the azimuth of the same direction from 0 to less than 360 degrees.
pub(super) fn within_turn(azimuth: f64) -> f64 {
    let turned = azimuth.rem_euclid(360.0);
    // A sum with 0 makes -0 positive.
    if turned < 360.0 { turned + 0.0 } else { 0.0 }
}
