//! Kinds of scattering models, by their coordinates.

/// Coordinates in which a scattering model is smooth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum ChartKind {
    /// Half-vector coordinates that do not change if the surface is rotated about its normal, for isotropic surfaces.
    Isotropic = 1,
    /// Half-vector coordinates relative to the surface's tangent frame, for anisotropic surfaces.
    Anisotropic = 2,
    /// Scattering angle between incoming and outgoing direction, for phase functions.
    Zonal = 3,
}

impl ChartKind {
    pub(crate) const ALL: [Self; 3] = [Self::Isotropic, Self::Anisotropic, Self::Zonal];

    pub(crate) fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u8 == code)
    }
}
