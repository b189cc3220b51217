//! Promises: which can be made of a measurement, and the last gate that a file passes before it is handed out.

use super::light::Light;
use super::rd::shape::Shape;
use super::{CompressError, Compressed, DeltaE, Policy, Settings, Target, decode};
use crate::domain::colour::{ColourReport, SpectraColours};
use crate::domain::{Axis, Measurement};

/// Refuses a promise that cannot be made of `measurement` in this way.
pub(crate) fn check(measurement: &Measurement, settings: &Settings) -> Result<(), CompressError> {
    if settings.target == Target::Auto && settings.policy != Policy::Rd {
        let text = format!("er_l2 auto: the {} policy does not weigh noise, expected policy rd", settings.policy);
        return Err(CompressError::Setting(text));
    }
    if let (Target::Step(_), policy) = (settings.target, settings.policy)
        && policy != Policy::Rd
    {
        return Err(CompressError::Setting(format!("step: the {policy} policy has no quantiser, expected policy rd")));
    }
    if let Some(bound) = settings.albedo_error {
        check_albedo(measurement, settings, bound).map_err(CompressError::Setting)?;
    }
    let Target::DeltaE(wanted) = settings.target else { return Ok(()) };
    if settings.policy != Policy::Rd {
        let text = format!("delta_e: the {} policy knows errors of samples only, expected policy rd", settings.policy);
        return Err(CompressError::Setting(text));
    }
    colours_of(measurement, wanted).map(|_| ())
}

fn check_albedo(measurement: &Measurement, settings: &Settings, bound: f64) -> Result<(), String> {
    if !(bound > 0.0 && bound <= 1.0) {
        return Err(format!("albedo_error is {bound}, expected more than 0 and at most 1 (0.01 is 1 %)"));
    }
    if settings.policy != Policy::Rd || settings.target == Target::Lossless {
        return Err("albedo_error: only the rd policy corrects light".to_owned());
    }
    let bounded =
        matches!(settings.target, Target::MaxRelativeError(_) | Target::MaxAbsoluteError(_) | Target::RelativeRmse(_));
    if bounded {
        return Err(
            "albedo_error: with a bound on every sample, or in the samples' own unit, light is bounded by that"
                .to_owned(),
        );
    }
    if Light::of(measurement.quantity, measurement.tensor.axes()).is_none() {
        return Err("albedo_error: there is no triangle axis to add light over".to_owned());
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
    let decoded =
        decode(bytes).map_err(|e| CompressError::Unreachable(format!("the file just written does not decode: {e}")))?;
    Ok(Some(colours_of(measurement, wanted)?.differences(decoded.measurement.tensor.samples())))
}

/// The last gate: a file that misses its target is never handed out.
pub(crate) fn keep(settings: &Settings, floor: f32, compressed: &Compressed) -> Result<(), CompressError> {
    let errors = &compressed.summary.errors;
    let missed = |what: &str, found: f64, wanted: f64| {
        Err(CompressError::Unreachable(format!("{what} {wanted} was not reached: the closest file has {found}")))
    };
    if errors.mask_mismatches > 0 {
        return missed("an exact mask: mismatches", errors.mask_mismatches as f64, 0.0);
    }
    if let (Some(wanted), Some(light)) = (settings.albedo_error, compressed.light)
        && light.largest > wanted
    {
        return missed("albedo_error", light.largest, wanted);
    }
    if let Some(bound) = settings.target.bound()
        && !bound.keeps(errors)
    {
        return missed(bound.name, (bound.figure)(errors), bound.at_most);
    }
    match settings.target {
        Target::Bytes(wanted) if compressed.bytes.len() as u64 > wanted => {
            return missed("bytes", compressed.bytes.len() as f64, wanted as f64);
        }
        Target::DeltaE(wanted) => {
            let found = compressed.colour.map_or(f64::INFINITY, |colour| colour.largest);
            if found.is_nan() || found > wanted.at_most {
                return missed("delta_e", found, wanted.at_most);
            }
        }
        _ => {}
    }
    let floored = errors.below_floor_samples > 0 && settings.policy == Policy::Rd;
    if floored && errors.max_absolute_error_unscored > f64::from(floor) {
        return missed("floor: largest error", errors.max_absolute_error_unscored, f64::from(floor));
    }
    Ok(())
}
