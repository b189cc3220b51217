//! Side of the plane of incidence on which positive angles of the detector lie.

use crate::domain::named;

/// Side of the plane of incidence on which a positive `theta_o` lies where the azimuth is 0, or where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum InPlaneSign {
    /// Side of the mirror direction; negative angles lie on the side of the source.
    Mirror,
    /// Side of the source; negative angles lie on the side of the mirror direction.
    Source,
}
named!(InPlaneSign, "in_plane_sign", { Mirror = "mirror", Source = "source" });
