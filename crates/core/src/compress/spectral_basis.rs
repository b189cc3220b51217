//! Spectral bases by name, and as a transform of the wavelength axis.

use crate::domain::Axis;
use crate::transform::{AxisTransform, LineBasis, SphereBasis};

/// Transform of the samples along the wavelength axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SpectralBasis {
    /// Wavelet transform along the wavelength axis, in this basis.
    Line(LineBasis),
    /// No transform: along the wavelength axis, samples (or their logarithms) are coded as they are.
    Identity,
    /// Principal components of the data's own spectra, stored in the file (policy `rd`).
    Klt,
}

impl SpectralBasis {
    /// Name of the spectral basis in settings and reports.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Line(basis) => basis.name(),
            Self::Identity => "identity",
            Self::Klt => "klt",
        }
    }

    /// Returns the transform of any axis under this spectral basis; triangle axes take the basis `sphere`.
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

    /// Returns the spectral basis with this name; `None` for `auto` and for unknown names.
    pub(super) fn named(name: &str) -> Option<Self> {
        match name {
            "klt" => Some(Self::Klt),
            "identity" => Some(Self::Identity),
            _ => name.parse().ok().map(Self::Line),
        }
    }
}

/// Name of the transform of the wavelength axis, `none` without such an axis.
pub(super) fn basis_of(axes: &[Axis], transforms: &[AxisTransform], klt: bool) -> String {
    let on_wavelength = axes.iter().zip(transforms).find(|(axis, _)| matches!(axis, Axis::Wavelength(_)));
    match on_wavelength {
        Some(_) if klt => "klt".to_owned(),
        Some((_, AxisTransform::Line { basis, .. })) => basis.name().to_owned(),
        Some((_, AxisTransform::Identity)) => "identity".to_owned(),
        _ => "none".to_owned(),
    }
}
