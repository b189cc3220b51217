//! Promises: which can be made of a measurement, and the last gate that a file passes before it is handed out.

use super::compressed::Compressed;
use super::decode::decode;
use super::error::CompressError;
use super::figures::{shown, two_digits_up};
use super::light::Light;
use super::policy::Policy;
use super::rd::shape::Shape;
use super::settings::Settings;
use super::stated::rounded_down;
use super::target::{DeltaE, Target};
use crate::domain::colour::{ColourReport, SpectraColours};
use crate::domain::{Axis, Measurement};

/// Refuses a promise that cannot be made of `measurement` in this way.
pub(crate) fn check(measurement: &Measurement, settings: &Settings) -> Result<(), CompressError> {
    if settings.target == Target::Auto && settings.policy != Policy::Rd {
        let text =
            format!("er_l2 auto: policy {} does not weigh noise; use policy rd, or name an error", settings.policy);
        return Err(CompressError::Setting(text));
    }
    if let (Target::Step(_), policy) = (settings.target, settings.policy)
        && policy != Policy::Rd
    {
        return Err(CompressError::Setting(format!(
            "step: policy {policy} has no quantiser; use policy rd, or another target"
        )));
    }
    if let Some(bound) = settings.albedo_error {
        check_albedo(measurement, settings, bound).map_err(CompressError::Setting)?;
    }
    let Target::DeltaE(wanted) = settings.target else { return Ok(()) };
    if settings.policy != Policy::Rd {
        let text =
            format!("delta_e: policy {} bounds errors of samples, not of colours; use policy rd", settings.policy);
        return Err(CompressError::Setting(text));
    }
    colours_of(measurement, wanted).map(|_| ())
}

fn check_albedo(measurement: &Measurement, settings: &Settings, bound: f64) -> Result<(), String> {
    if !(bound > 0.0 && bound <= 1.0) {
        return Err(format!("albedo_error is {bound}, expected more than 0 and at most 1 (0.01 is 1 %)"));
    }
    if settings.policy != Policy::Rd || settings.target == Target::Lossless {
        return Err(
            "albedo_error: only policy rd with an error to keep corrects light; use that, or leave albedo_error out"
                .to_owned(),
        );
    }
    let bounded =
        matches!(settings.target, Target::MaxRelativeError(_) | Target::MaxAbsoluteError(_) | Target::RelativeRmse(_));
    if bounded {
        return Err(
            "albedo_error: a bound on every sample, or in the unit of the samples, bounds the light already; leave \
             albedo_error out, or ask for er_l2 or er_l1"
                .to_owned(),
        );
    }
    if Light::of(measurement.quantity, measurement.tensor.axes()).is_none() {
        return Err("albedo_error: the axes have no triangles to add light over; leave albedo_error out".to_owned());
    }
    Ok(())
}

/// Refuses random access where blocks cannot be coded by themselves.
pub(crate) fn check_random_access(measurement: &Measurement, settings: &Settings) -> Result<(), CompressError> {
    let axes = measurement.tensor.axes();
    let found = if settings.policy != Policy::Rd || settings.target == Target::Lossless {
        let policy = if settings.target == Target::Lossless { Policy::Lossless } else { settings.policy };
        format!("policy {policy}")
    } else if !matches!(settings.basis.as_str(), "auto" | "klt") {
        format!("basis {}", settings.basis)
    } else if matches!(settings.target, Target::MaxRelativeError(_) | Target::MaxAbsoluteError(_)) {
        "a target that bounds every sample, whose corrections are coded for the whole".to_owned()
    } else if Shape::of(axes).is_none_or(|shape| shape.block_axes().is_empty()) {
        let axes = axes.iter().map(Axis::describe).collect::<Vec<_>>().join(", ");
        format!("nothing before outgoing triangles in [{axes}]")
    } else {
        return Ok(());
    };
    let expected = "policy rd with basis auto or klt, another target, and an incoming or index axis before triangles";
    Err(CompressError::Setting(format!("random_access: found {found}, expected {expected}")))
}

/// The target that the errors themselves must keep for the errors that a header states, rounded up, to keep `target`.
pub(super) fn stateable(target: Target) -> Result<Target, CompressError> {
    let kept = |error: f64| match rounded_down(error) {
        kept if kept > 0.0 => Ok(kept),
        _ => Err(CompressError::Unreachable(format!(
            "{} {error:e} is below 3.6e-43, the smallest error that a file can state; ask for a larger one, or lossless",
            target.bound().map_or("the error", |bound| bound.name)
        ))),
    };
    Ok(match target {
        Target::ErL2(error) => Target::ErL2(kept(error)?),
        Target::ErL1(error) => Target::ErL1(kept(error)?),
        Target::MaxRelativeError(error) => Target::MaxRelativeError(kept(error)?),
        Target::MaxAbsoluteError(error) => Target::MaxAbsoluteError(kept(error)?),
        Target::RelativeRmse(error) => Target::RelativeRmse(kept(error)?),
        // A header states no colours.
        Target::DeltaE(_) | Target::Ratio(_) | Target::Bytes(_) | Target::Step(_) | Target::Auto | Target::Lossless => {
            target
        }
    })
}

/// The colours that `target` promises to keep.
pub(crate) fn colours_of(measurement: &Measurement, target: DeltaE) -> Result<SpectraColours, CompressError> {
    SpectraColours::of(measurement, target.illuminant).map_err(|e| CompressError::Setting(format!("delta_e: {e}")))
}

/// The colours of the decoded file, where they are promised.
pub(crate) fn colour(
    measurement: &Measurement,
    target: Target,
    bytes: &[u8],
) -> Result<Option<ColourReport>, CompressError> {
    let Target::DeltaE(wanted) = target else { return Ok(None) };
    let decoded = decode(bytes)
        .map_err(|e| CompressError::Unreachable(format!("delta_e: the file does not decode ({e}); use lossless")))?;
    Ok(Some(colours_of(measurement, wanted)?.differences(decoded.measurement.tensor.samples())))
}

/// The last gate: a file that misses its target is never handed out.
pub(crate) fn keep(settings: &Settings, floor: f32, compressed: &Compressed) -> Result<(), CompressError> {
    let errors = &compressed.summary.errors;
    let missed = |option: &str, wanted: f64, found: f64| {
        let more = if found.is_finite() {
            format!("{option} {} or more", shown(two_digits_up(1.05 * found)))
        } else {
            "a larger one".to_owned()
        };
        let rounded = [wanted, found].map(shown);
        let [wanted, found] =
            if rounded[0] == rounded[1] { [wanted, found].map(|x| format!("{x:e}")) } else { rounded };
        let text = format!(
            "{option} {wanted}: the closest file found, with basis {}, has {found}; ask for {more}, another basis, or lossless",
            compressed.summary.basis
        );
        Err(CompressError::Unreachable(text))
    };
    if errors.mask_mismatches > 0 {
        let text = format!(
            "policy {}, basis {}: {} samples would decode as masked, or masked ones as numbers, because the samples leave the \
             range in which this transform works in float32; use lossless, or store the measurement in another unit",
            compressed.summary.policy, compressed.summary.basis, errors.mask_mismatches
        );
        return Err(CompressError::Unreachable(text));
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
    let floored = errors.below_floor_samples > 0 && settings.policy == Policy::Rd;
    if floored && errors.max_absolute_error_unscored > f64::from(floor) {
        let text = format!(
            "floor {}: samples below the floor of {} (in the unit of the samples) are to be kept within it, but the error asked \
             for lets one be off by {}; ask for a smaller error, a larger floor, or leave the floor out",
            shown(settings.floor.unwrap_or_default()),
            shown(f64::from(floor)),
            shown(errors.max_absolute_error_unscored)
        );
        return Err(CompressError::Unreachable(text));
    }
    Ok(())
}

/// Warning where a file falls short of a wanted ratio: samples per kept coefficient, or bytes of the float32 tensor per byte
/// of the file. `None` for other targets, and where both reach it.
pub fn shortfall(target: Target, samples: u64, compressed: &Compressed) -> Option<String> {
    let Target::Ratio(wanted) = target else { return None };
    let kept = compressed.summary.kept_coefficients?;
    if samples as f64 / kept.max(1) as f64 <= wanted * (1.0 - 1e-12) {
        return Some(format!(
            "ratio {} is more than the {samples} samples there are: {}; ask for ratio {} or less to keep one",
            shown(wanted),
            if kept == 0 { "no coefficient is kept".to_owned() } else { format!("{kept} coefficients are kept") },
            samples.max(1)
        ));
    }
    let bytes = compressed.bytes.len();
    let found = 4.0 * samples as f64 / bytes as f64;
    (found < wanted).then(|| {
        format!(
            "ratio {} is kept in samples per coefficient, not in bytes: the file of {bytes} bytes is {} : 1 of the float32 \
             tensor; use the option bytes to bound the size",
            shown(wanted),
            shown((found * 1000.0).round() / 1000.0),
        )
    })
}
