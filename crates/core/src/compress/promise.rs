//! Checks which promises can be made for a measurement, and that a finished file keeps its promise.

use super::compressed::Compressed;
use super::error::CompressError;
use super::header::ends_on_grid;
use super::light::Light;
use super::lobe_chunk;
use super::notes::CompressionNote;
use super::policy::Policy;
use super::rd::gridded::Shape as GridShape;
use super::rd::shape::Shape;
use super::setting_error::{AlbedoConflict, RandomAccessConflict, RdOption, SettingError};
use super::settings::{ALBEDO_ERROR, AUTO_BASIS, Settings};
use super::stated::rounded_down;
use super::target::{DeltaE, Target};
use super::unreachable_error::UnreachableError;
use crate::domain::colour::{ColourReport, SpectraColours};
use crate::domain::{Measurement, Note};

/// Rejects settings with a target or an option that this measurement, or the policy in the settings, cannot satisfy.
pub(crate) fn check(measurement: &Measurement, settings: &Settings) -> Result<(), SettingError> {
    let policy = settings.policy;
    if settings.target == Target::Auto && policy != Policy::Rd {
        return Err(SettingError::NeedsRd { option: RdOption::Auto, policy });
    }
    if matches!(settings.target, Target::Step(_)) && policy != Policy::Rd {
        return Err(SettingError::NeedsRd { option: RdOption::Step, policy });
    }
    if settings.straight_lines > 0 && !ends_on_grid(measurement.tensor.axes()) {
        return Err(SettingError::StraightLines);
    }
    if !settings.between.is_default() && !settings.between.fits(measurement.quantity, measurement.tensor.axes()) {
        return Err(SettingError::Between);
    }
    if let Some(lobe) = &settings.lobe
        && !lobe_chunk::fits(lobe, measurement.quantity, measurement.tensor.axes())
    {
        return Err(SettingError::Lobe);
    }
    if let Some(bound) = settings.albedo_error {
        check_albedo(measurement, settings, bound)?;
    }
    let Target::DeltaE(wanted) = settings.target else { return Ok(()) };
    if policy != Policy::Rd {
        return Err(SettingError::NeedsRd { option: RdOption::DeltaE, policy });
    }
    colours_of(measurement, wanted).map(|_| ())
}

fn check_albedo(measurement: &Measurement, settings: &Settings, bound: f64) -> Result<(), SettingError> {
    let refuse = |conflict| Err(SettingError::Albedo(conflict));
    if !ALBEDO_ERROR.allow(bound) {
        return Err(SettingError::Range { option: "albedo_error", found: bound, limits: ALBEDO_ERROR });
    }
    if settings.policy != Policy::Rd || settings.target == Target::Lossless {
        return refuse(AlbedoConflict::Uncorrected);
    }
    let bounded =
        matches!(settings.target, Target::MaxRelativeError(_) | Target::MaxAbsoluteError(_) | Target::RelativeRmse(_));
    if bounded {
        return refuse(AlbedoConflict::Bounded);
    }
    if Light::of(measurement.quantity, measurement.tensor.axes()).is_none() {
        return refuse(AlbedoConflict::NoDirections);
    }
    Ok(())
}

/// Rejects random access to single incoming directions where these cannot be coded independently.
pub(crate) fn check_random_access(measurement: &Measurement, settings: &Settings) -> Result<(), SettingError> {
    let axes = measurement.tensor.axes();
    let found = if settings.policy != Policy::Rd || settings.target == Target::Lossless {
        let policy = if settings.target == Target::Lossless { Policy::Lossless } else { settings.policy };
        RandomAccessConflict::Policy(policy)
    } else if !matches!(settings.basis.as_str(), AUTO_BASIS | "klt") {
        RandomAccessConflict::Basis(settings.basis.clone())
    } else if matches!(settings.target, Target::MaxRelativeError(_) | Target::MaxAbsoluteError(_)) {
        RandomAccessConflict::EverySample
    } else if Shape::of(axes).is_none_or(|shape| shape.block_axes().is_empty())
        && GridShape::of(axes).is_none_or(|shape| shape.is_single())
    {
        RandomAccessConflict::Axes(axes.to_vec())
    } else {
        return Ok(());
    };
    Err(SettingError::RandomAccess(found))
}

/// Tightens `target` so that its error, once rounded up in the header, still meets the original target.
pub(super) fn stateable(target: Target) -> Result<Target, UnreachableError> {
    let option = target.bound().map_or("the error", |bound| bound.name);
    let kept = |error: f64| match rounded_down(error) {
        kept if kept > 0.0 => Ok(kept),
        _ => Err(UnreachableError::BelowStated { option, wanted: error }),
    };
    Ok(match target {
        Target::ErL2(error) => Target::ErL2(kept(error)?),
        Target::ErL1(error) => Target::ErL1(kept(error)?),
        Target::MaxRelativeError(error) => Target::MaxRelativeError(kept(error)?),
        Target::MaxAbsoluteError(error) => Target::MaxAbsoluteError(kept(error)?),
        Target::RelativeRmse(error) => Target::RelativeRmse(kept(error)?),
        // A header states no colour differences.
        Target::DeltaE(_) | Target::Ratio(_) | Target::Bytes(_) | Target::Step(_) | Target::Auto | Target::Lossless => {
            target
        }
    })
}

/// Computes the colours of the measurement's spectra under the illuminant that a colour-difference target names.
pub(crate) fn colours_of(measurement: &Measurement, target: DeltaE) -> Result<SpectraColours, SettingError> {
    Ok(SpectraColours::of(measurement, target.illuminant)?)
}

/// Measures the colour differences of the decoded file; `None` if the target does not bound colours.
pub(crate) fn colour(
    measurement: &Measurement,
    target: Target,
    compressed: &mut Compressed,
) -> Result<Option<ColourReport>, CompressError> {
    let Target::DeltaE(wanted) = target else { return Ok(None) };
    let decoded = compressed.take_decoded().map_err(UnreachableError::Colours)?.measurement;
    let colours = colours_of(measurement, wanted)?.differences(decoded.tensor.samples());
    compressed.decoded = Some(decoded);
    Ok(Some(colours))
}

/// Rejects a file that misses its target, before it is returned to the caller.
pub(crate) fn keep(settings: &Settings, floor: f32, compressed: &Compressed) -> Result<(), UnreachableError> {
    let errors = &compressed.summary.errors;
    let missed = |option: &'static str, wanted: f64, found: f64| {
        Err(UnreachableError::Missed { option, wanted, found, basis: compressed.summary.basis.clone() })
    };
    if errors.mask_mismatches > 0 {
        let (policy, basis) = (compressed.summary.policy, compressed.summary.basis.clone());
        return Err(UnreachableError::Mask { policy, basis, count: errors.mask_mismatches });
    }
    if let (Some(wanted), Some(light)) = (settings.albedo_error, compressed.light)
        && light.largest > wanted
    {
        return missed("albedo_error", wanted, light.largest);
    }
    if let Some(bound) = settings.target.bound()
        && !bound.keeps(errors)
    {
        return missed(bound.name, bound.at_most, (bound.figure)(errors));
    }
    match settings.target {
        Target::Bytes(wanted) if compressed.bytes.len() as u64 > wanted => {
            return missed("bytes", wanted as f64, compressed.bytes.len() as f64);
        }
        Target::DeltaE(wanted) => {
            let found = compressed.colour.map_or(f64::INFINITY, |colour| colour.largest);
            if found.is_nan() || found > wanted.at_most {
                return missed("delta_e", wanted.at_most, found);
            }
        }
        _ => {}
    }
    if settings.policy == Policy::Rd && !compressed.below_floor.keeps(floor) {
        return Err(UnreachableError::Floor {
            wanted: settings.floor.unwrap_or_default(),
            floor: f64::from(floor),
            found: compressed.below_floor.small(),
        });
    }
    Ok(())
}

/// Returns a warning if a file falls short of a wanted ratio: samples per kept coefficient, or bytes of the float32
/// tensor per byte of the file. `None` for other targets, and if both ratios are reached.
pub fn shortfall(target: Target, samples: u64, compressed: &Compressed) -> Option<Note> {
    let Target::Ratio(wanted) = target else { return None };
    let kept = compressed.summary.kept_coefficients?;
    if samples as f64 / kept.max(1) as f64 <= wanted * (1.0 - 1e-12) {
        return Some(CompressionNote::RatioAboveSamples { wanted, samples, kept_coefficients: kept }.into());
    }
    let bytes = compressed.bytes.len();
    let found = 4.0 * samples as f64 / bytes as f64;
    (found < wanted).then(|| CompressionNote::RatioNotInBytes { wanted, bytes, found }.into())
}
