//! Schemes of the first layer, and the selection of those that compete for a measurement.

use super::super::between::Divisor;
use super::super::error::CompressError;
use super::super::setting_error::SettingError;
use super::super::settings::{AUTO_BASIS, Settings};
use super::super::spectral_basis::SpectralBasis;
use super::super::target::Target;
use super::chart::{ChartKind, has_chart};
use super::class_plane::{ClassPlane, approximated};
use super::gridded::{Behind, Shape as GridShape};
use super::metric::root_mean_square;
use super::predictive::Folded;
use super::shape::Shape;
use super::symmetry_search::symmetries;
use crate::codec::Class;
use crate::domain::{Axis, Measurement};
use std::sync::Arc;

/// Largest length of a trailing index axis for which a basis of the data's own principal components is tried.
const MOST_INDICES: usize = 64;
/// Largest number of spectral channels (wavelengths or colours) of data on a grid of angles for which coding each
/// channel separately is tried.
const MOST_CHANNELS: usize = 8;
/// Largest number of direction pairs on grids of angles for which prediction by fixed filters alone is tried.
const FEW_ROWS: usize = 20_000;
/// Largest number of samples for which division by the function between incidences is tried. It doubles the schemes but
/// one, hence the time, and for large arrays the memory.
const MOST_DIVIDED: usize = 1 << 20;
/// Number of symmetries that map a hemisphere's triangle mesh to itself.
const ALL_SYMMETRIES: usize = 8;

/// Way to code the logarithms or samples of a tensor, before corrections of single samples.
#[derive(Clone)]
pub(super) enum Scheme {
    /// Transform by wavelets or other fixed bases along all axes, none of them computed from the data.
    Fixed(SpectralBasis),
    /// Transform to principal components of the data's own spectra, and by fixed bases along the other axes.
    Adaptive,
    /// Transform to principal components of the data's own spectra, after spectra that a symmetry group maps to each
    /// other are averaged. Values on triangles are then predicted from coarser triangles, with or without a scattering
    /// model.
    Predicted(Arc<Folded>, Option<ChartKind>),
    /// Samples on grids of angles, coded by prediction.
    Gridded {
        /// Layout of the tensor as axes of angles and spectra.
        shape: GridShape,
        /// True to code principal components of the spectra, false to code channel by channel.
        klt: bool,
        /// True to predict differences of neighbours by adaptive least squares in addition to the fixed filters.
        learns: bool,
        /// Scattering model that is subtracted before the residual is coded.
        model: Behind,
        /// Function of the interpolation between incoming directions by which samples are divided before they are
        /// coded; [`Divisor::None`] to code them as they are.
        divisor: Divisor,
        /// Quantiser step expected for the target; the coder chooses the scattering model and the order in which it
        /// merges neighbouring angles as if values were quantised with it.
        step: f64,
    },
}

impl Scheme {
    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Fixed(basis) => basis.name(),
            Self::Adaptive => SpectralBasis::Klt.name(),
            Self::Predicted(folded, None) if folded.is_trivial() => "predicted",
            Self::Predicted(_, None) => "predicted, folded",
            Self::Gridded { klt, divisor, model, .. } if *divisor != Divisor::None => match (klt, model) {
                (true, Behind::Model(ChartKind::Isotropic)) => "grid, klt, divided, isotropic model",
                (true, Behind::Model(_)) => "grid, klt, divided, anisotropic model",
                (true, _) => "grid, klt, divided",
                (false, Behind::Model(ChartKind::Isotropic)) => "grid, divided, isotropic model",
                (false, Behind::Model(_)) => "grid, divided, anisotropic model",
                (false, _) => "grid, divided",
            },
            Self::Gridded { klt: true, learns: true, model, .. } => match model {
                Behind::Model(ChartKind::Isotropic) => "grid, klt, isotropic model",
                Behind::Model(_) => "grid, klt, anisotropic model",
                _ => "grid, klt",
            },
            Self::Gridded { klt: false, learns: true, model, .. } => match model {
                Behind::Model(ChartKind::Isotropic) => "grid, isotropic model",
                Behind::Model(_) => "grid, anisotropic model",
                _ => "grid",
            },
            Self::Gridded { klt: true, learns: false, .. } => "grid, klt, fixed prediction",
            Self::Gridded { klt: false, learns: false, .. } => "grid, fixed prediction",
            Self::Predicted(_, Some(ChartKind::Isotropic)) => "predicted, isotropic model",
            Self::Predicted(_, Some(ChartKind::Anisotropic)) => "predicted, anisotropic model",
            Self::Predicted(_, Some(ChartKind::Zonal)) => "predicted, zonal model",
        }
    }
}

/// Returns the coding schemes that compete for a measurement. Samples on triangles are predicted from coarser triangles
/// if the spectral basis is the data's own principal components, or if there is no spectral axis.
pub(super) fn schemes(
    measurement: &Measurement,
    plane: ClassPlane<'_>,
    bases: &[SpectralBasis],
    settings: &Settings,
) -> Result<Vec<Scheme>, CompressError> {
    let axes = measurement.tensor.axes();
    let named = settings.basis != AUTO_BASIS;
    if let Some(shape) = GridShape::of(axes)
        && (!named || bases.contains(&SpectralBasis::Klt))
    {
        return Ok(gridded(&shape, bases, settings, plane));
    }
    let mut schemes = Vec::new();
    for &basis in bases {
        let own = basis == SpectralBasis::Klt;
        match Shape::of(axes) {
            // Without a spectral axis the data's own basis costs nothing or a few numbers.
            Some(shape) if schemes.is_empty() && (own || !named && short(axes)) => {
                let logs = approximated(measurement, plane);
                let classes = plane.coded.map(|_| plane.classes);
                schemes.extend(predicted(&shape, classes, &logs, settings.target, plane.noise)?);
            }
            None if own => schemes.push(Scheme::Adaptive),
            _ => {}
        }
        if !own {
            schemes.push(Scheme::Fixed(basis));
        }
    }
    Ok(schemes)
}

/// Returns the coding schemes for a measurement that none of those of [`schemes`] can follow, if the basis is chosen
/// automatically: each channel of a grid of angles by itself, and wavelets. They follow any spectra, such as those of
/// more noisy bands than a file can hold vectors. Empty if [`schemes`] has them already.
pub(super) fn fallbacks(
    measurement: &Measurement,
    noise: Option<f64>,
    bases: &[SpectralBasis],
    settings: &Settings,
) -> Vec<Scheme> {
    let shape = GridShape::of(measurement.tensor.axes()).filter(|shape| shape.length() > MOST_CHANNELS);
    let (Some(shape), true) = (shape, settings.basis == AUTO_BASIS) else { return Vec::new() };
    let channels = Scheme::Gridded {
        shape,
        klt: false,
        learns: true,
        model: Behind::Nothing,
        divisor: Divisor::None,
        step: expected_step(settings, noise),
    };
    let wavelets = bases.iter().filter(|basis| **basis != SpectralBasis::Klt && !settings.random_access);
    std::iter::once(channels).chain(wavelets.map(|&basis| Scheme::Fixed(basis))).collect()
}

/// Returns the quantiser step expected for the target of `settings`, given the relative `noise` of the samples.
fn expected_step(settings: &Settings, noise: Option<f64>) -> f64 {
    let tolerance = match settings.target {
        Target::ErL1(error) | Target::ErL2(error) | Target::RelativeRmse(error) => error,
        Target::MaxRelativeError(error) => 0.5 * error,
        Target::Auto => noise.unwrap_or(0.02),
        _ => 0.02,
    };
    // The error of a uniform quantiser is its step / √12.
    match settings.target {
        Target::Step(step) => step,
        _ => tolerance * libm::sqrt(12.0),
    }
}

/// Returns the competing coding schemes of a grid of angles: principal components for spectra, single channels for
/// colours, and both for few channels.
fn gridded(shape: &GridShape, bases: &[SpectralBasis], settings: &Settings, plane: ClassPlane<'_>) -> Vec<Scheme> {
    let step = expected_step(settings, plane.noise);
    let own = bases.contains(&SpectralBasis::Klt) && shape.length() > 1;
    let is_named = settings.basis == "klt";
    // Planes of few channels predict each other as well as a basis does.
    let forms: &[bool] = match shape.length() {
        _ if !own => &[false],
        0..=3 if !is_named => &[false],
        4..=MOST_CHANNELS if !is_named => &[true, false],
        _ => &[true],
    };
    let scheme =
        |klt, learns, model, divisor| Scheme::Gridded { shape: shape.clone(), klt, learns, model, divisor, step };
    // Lobes that the function between incidences explains need not be coded.
    let divisor = settings.between.stated().map_or(Divisor::None, |between| between.divisor);
    let is_tried = divisor != Divisor::None && !plane.values.is_linear() && plane.classes.len() <= MOST_DIVIDED;
    let divided = if is_tried { std::slice::from_ref(&divisor) } else { &[] };
    if shape.rows() > FEW_ROWS {
        let divisors = [Divisor::None].iter().chain(divided);
        return divisors
            .flat_map(|&divisor| forms.iter().map(move |&klt| (klt, divisor)))
            .map(|(klt, divisor)| scheme(klt, true, Behind::Judged, divisor))
            .collect();
    }
    // Fixed prediction wins only on small smooth arrays; the residual of a model is not smooth.
    let models = || shape.models().iter().map(|&kind| (true, Behind::Model(kind)));
    let ways = [(true, Behind::Nothing), (false, Behind::Nothing)].into_iter().chain(models());
    let plain = ways.map(|(learns, model)| (learns, model, Divisor::None));
    let divided = divided.iter().flat_map(|&divisor| {
        std::iter::once((true, Behind::Nothing)).chain(models()).map(move |(learns, model)| (learns, model, divisor))
    });
    let ways = plain.chain(divided);
    ways.flat_map(|way| forms.iter().map(move |&klt| (klt, way)))
        .map(|(klt, (learns, model, divisor))| scheme(klt, learns, model, divisor))
        .collect()
}

/// Returns true if principal components along the last axis of the tensor take few numbers or none: for triangles, a
/// grid of directions, colour channels or at most `MOST_INDICES` numbered entries. For wavelengths, polar angles and
/// more numbered entries they take many.
fn short(axes: &[Axis]) -> bool {
    axes.last().is_some_and(|axis| match axis {
        Axis::Triangles(_) | Axis::Grid(_) | Axis::Rgb => true,
        Axis::Index { count, .. } => *count <= MOST_INDICES,
        Axis::Wavelength(_) | Axis::Elevation(_) => false,
    })
}

/// Returns the coding schemes worth a trial that predict values on triangles from coarser triangles. The choice depends
/// on the symmetries that the data have.
fn predicted(
    shape: &Shape,
    classes: Option<&[Class]>,
    values: &[f32],
    target: Target,
    noise: Option<f64>,
) -> Result<Vec<Scheme>, SettingError> {
    let tolerance = match target {
        Target::ErL1(error) | Target::ErL2(error) => error,
        Target::RelativeRmse(error) => error * root_mean_square(values),
        Target::MaxAbsoluteError(error) | Target::MaxRelativeError(error) => 0.5 * error,
        // Entries that a symmetry makes equal differ by √2 times their noise, which is what is compared.
        Target::Auto => noise.map_or(0.05, |noise| 1.05 * noise),
        _ => 0.05,
    };
    let found = symmetries(shape, values, classes, tolerance);
    let mut schemes = Vec::new();
    let mut groups = vec![found.generators.as_slice()];
    // A symmetry that deviates by much less than the allowed error always pays off.
    if !found.generators.is_empty() && found.deviation > 0.5 * tolerance && target != Target::Auto {
        groups.push(&[]);
    }
    for (i, generators) in groups.into_iter().enumerate() {
        let folded = Arc::new(Folded::new(shape, classes, values, generators)?);
        if i == 0 {
            for kind in ChartKind::ALL.into_iter().filter(|&kind| has_chart(shape, kind)) {
                // Data with all symmetries of the mesh are practically isotropic.
                if kind != ChartKind::Anisotropic || found.order < ALL_SYMMETRIES {
                    schemes.push(Scheme::Predicted(Arc::clone(&folded), Some(kind)));
                }
            }
        }
        schemes.push(Scheme::Predicted(folded, None));
    }
    Ok(schemes)
}
