//! Kinds of scattering models, by their coordinates.

/// Coordinates of a scattering model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum ChartKind {
    /// Half-vector coordinates of an isotropic surface.
    Isotropic = 1,
    /// Half-vector coordinates with the tangent frame.
    Anisotropic = 2,
    /// Scattering angle.
    Zonal = 3,
}

impl ChartKind {
    pub(crate) const ALL: [Self; 3] = [Self::Isotropic, Self::Anisotropic, Self::Zonal];

    pub(crate) fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u8 == code)
    }
}
