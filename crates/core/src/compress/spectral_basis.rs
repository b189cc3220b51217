//! Spectral bases by name, and as a transform of the wavelength axis.

use crate::domain::Axis;
use crate::transform::{AxisTransform, LineBasis, SphereBasis};

/// Transform along the wavelength axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SpectralBasis {
    /// A wavelet.
    Line(LineBasis),
    /// No transform.
    Identity,
    /// The data's own principal components, stored with the material (policy `rd`).
    Klt,
}

impl SpectralBasis {
    /// Name of the basis in settings and reports.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Line(basis) => basis.name(),
            Self::Identity => "identity",
            Self::Klt => "klt",
        }
    }

    /// Transform of an axis; triangles take `sphere`.
    pub(super) fn transform_of(self, axis: &Axis, sphere: SphereBasis) -> AxisTransform {
        match axis {
            Axis::Triangles(_) => AxisTransform::Sphere(sphere),
            Axis::Elevation(_) => AxisTransform::line(LineBasis::BIOR44),
            Axis::Wavelength(_) => match self {
                Self::Line(basis) => AxisTransform::line(basis),
                Self::Identity | Self::Klt => AxisTransform::Identity,
            },
            Axis::Rgb => AxisTransform::line(LineBasis::HAAR),
            Axis::Grid(_) | Axis::Index { .. } => AxisTransform::Identity,
        }
    }

    /// Basis with this name; `None` for `auto` and for unknown names.
    pub(super) fn named(name: &str) -> Option<Self> {
        match name {
            "klt" => Some(Self::Klt),
            "identity" => Some(Self::Identity),
            _ => name.parse().ok().map(Self::Line),
        }
    }
}

/// Name of the basis on the wavelength axis, `none` without such an axis.
pub(super) fn basis_of(axes: &[Axis], transforms: &[AxisTransform], klt: bool) -> String {
    let on_wavelength = axes.iter().zip(transforms).find(|(axis, _)| matches!(axis, Axis::Wavelength(_)));
    match on_wavelength {
        Some(_) if klt => "klt".to_owned(),
        Some((_, AxisTransform::Line { basis, .. })) => basis.name().to_owned(),
        Some((_, AxisTransform::Identity)) => "identity".to_owned(),
        _ => "none".to_owned(),
    }
}
