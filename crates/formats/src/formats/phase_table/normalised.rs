//! Conversion of tables over the scattering angle to functions of two directions that integrate to 1 over the sphere.

use super::about::NAME;
use super::function::{Curve, Curves};
use super::refusal::needs;
use crate::domain::{Axis, DirectionGrid, Frame, Tensor};
use crate::formats::acquisition::{Angles, AzimuthExtent, Azimuths, Modelled, ParseReport};
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::normalization::Normalization;
use crate::formats::stated_grid::{Repeated, StatedGrid};
use crate::formats::text::Brief;
use crate::notes::PhaseNote;
use std::f64::consts::PI;
use std::sync::Arc;

/// Upper bound on the number of values in a table of phase functions over angles and wavelengths.
const MAX_VALUES: usize = 1 << 22;
/// Relative tolerance within which the integral of a phase function is recognised as 1 or 4π. Raising it accepts less
/// exact tables.
const TOLERANCE: f64 = 0.05;
/// Upper bound in degrees on the gap at either end of a phase function table that is filled with the nearest value.
/// Raising it fills wider gaps.
const HELD: f64 = 10.0;
/// Lower bounds in degrees on the spacings of outgoing and of incoming directions from which subdivision levels are
/// chosen; they give about a million samples. Lowering them makes larger tensors.
const OUTGOING_SPACING: f64 = 4.5;
const INCOMING_SPACING: f64 = 9.0;
/// Fraction of the light within the first step of a phase function table above which the forward peak counts as
/// unresolved. Raising it warns less often.
const UNRESOLVED: f64 = 0.2;

/// Returns the function of two directions that normalised phase functions define, one for each wavelength or channel of
/// `spectral`. All of them must be tables over the same list of scattering angles.
pub(super) fn modelled(curves: Vec<Curve>, spectral: Option<Axis>, report: &mut ParseReport) -> Modelled {
    let numbers = curves.iter().map(|curve| curve.values.len()).sum();
    let missing = curves.iter().flat_map(|curve| &curve.values).filter(|v| v.is_nan()).count();
    let steps = curves.iter().take(1).flat_map(|curve| curve.angles.array_windows().map(|[a, b]| b - a));
    let finest = steps.fold(180.0, f64::min);
    // A function of the scattering angle alone does not need the full directional resolution of its table.
    let spacing = finest.max(OUTGOING_SPACING);
    let steps = (180.0 / finest.max(INCOMING_SPACING)).round().max(2.0) as usize;
    let even = |count: usize, length: f64| (0..count).map(|i| length * i as f64 / count as f64).collect::<Vec<f64>>();
    let mut theta = even(steps, 180.0);
    theta.push(180.0);
    let phi = Some(Azimuths { phi: even(2 * steps, 360.0), extent: AzimuthExtent::Circle });
    if finest < OUTGOING_SPACING {
        report.note_unfolding(PhaseNote::CoarserDirections {
            outgoing_degrees: OUTGOING_SPACING,
            incoming_degrees: INCOMING_SPACING,
            step_degrees: Brief(finest),
        });
    }
    Modelled {
        stated: stated(&curves, spectral.as_ref()).map(Box::new),
        incoming: Angles { theta, covers: (0.0, 180.0), phi },
        outgoing_spacing: spacing,
        spectral,
        numbers,
        missing,
        function: Arc::new(Curves(curves)),
    }
}

/// Returns the listed phase functions as a grid of polar angles for light from `+z`; `None` if the file lists no
/// angles.
fn stated(curves: &[Curve], spectral: Option<&Axis>) -> Option<StatedGrid> {
    let first = curves.first().filter(|curve| curve.is_listed)?;
    let (nearest, farthest) = (first.angles[0], first.angles[first.angles.len() - 1]);
    let is_over_cosines = !first.cosines.is_empty();
    // Arc cosines have no short decimals; rounding to nine makes equal cosines give equal angles.
    let polar = |&angle: &f64| if is_over_cosines { rounded(180.0 - angle) } else { decimal(180.0 - angle) };
    let polar = first.angles.iter().rev().map(polar).collect();
    let covers = if first.held > 0.0 { (0.0, 180.0) } else { (decimal(180.0 - farthest), decimal(180.0 - nearest)) };
    let directions = DirectionGrid::new(Frame::Surface, polar, None).ok()?.covering(covers.0, covers.1).ok()?;
    let rows = (0..first.angles.len()).rev();
    let values = rows.flat_map(|row| curves.iter().map(move |curve| curve.values[row] as f32)).collect();
    let axes = [Axis::Elevation(vec![0.0]), Axis::Grid(directions)].into_iter().chain(spectral.cloned());
    let tensor = Tensor::new(axes.collect(), values).ok()?;
    Some(StatedGrid { tensor, factor: 1.0, repeated: Repeated::default() })
}

/// Returns the function of two directions that the phase function `values` `[angle, wavelength]` give, over increasing
/// scattering angles in degrees.
pub(in crate::formats) fn tabulated(
    angles: &[f64],
    values: &[f32],
    spectral: Option<Axis>,
    said: Option<Normalization>,
    report: &mut ParseReport,
) -> Result<Modelled, FormatError> {
    let width = spectral.as_ref().map_or(1, Axis::len);
    if angles.len() < 2 {
        let message = "values at one scattering angle, expected a table from 0 to 180 degrees";
        return Err(FormatError::new(FormatErrorKind::Malformed, NAME, message));
    }
    if values.len() > MAX_VALUES {
        let message = format!("{} values of a phase function, expected at most {MAX_VALUES}", values.len());
        return Err(FormatError::new(FormatErrorKind::OverLimit, NAME, message));
    }
    let is_volume = said == Some(Normalization::Vsf);
    let mut curves = Vec::with_capacity(width);
    for band in 0..width {
        let values = values.iter().skip(band).step_by(width).map(|&value| f64::from(value)).collect();
        // Notes are kept for the first wavelength only.
        let mut others = ParseReport::default();
        let report = if band == 0 { &mut *report } else { &mut others };
        let mut curve = held(Curve::over_angles(angles.to_vec(), values, is_volume), report);
        normalise(&mut curve, said, report)?;
        curves.push(curve);
    }
    if width > 1 {
        report.note(PhaseNote::WavelengthsNormalised { wavelengths: width });
    }
    Ok(modelled(curves, spectral, report))
}

/// Extends the first and the last value of a phase function to 0 and 180 degrees if the gaps are at most [`HELD`].
pub(super) fn held(mut curve: Curve, report: &mut ParseReport) -> Curve {
    let (first, last) = (curve.angles[0], curve.angles[curve.angles.len() - 1]);
    let gap = first.max(180.0 - last);
    // Rounding of acos is not a gap.
    if gap > 1e-6 && gap <= HELD {
        report.note(PhaseNote::EndsHeld { first_degrees: Brief(first), last_degrees: Brief(last) });
    }
    curve.held = if gap <= HELD { gap } else { 0.0 };
    curve
}

/// Divides the values of a phase function by its integral over the sphere. The integral must match the stated
/// normalisation, or be 1 or 4π if none is stated.
pub(super) fn normalise(
    curve: &mut Curve,
    said: Option<Normalization>,
    report: &mut ParseReport,
) -> Result<(), FormatError> {
    let whole = curve.held > 0.0 || (curve.angles[0] <= 1e-6 && curve.angles[curve.angles.len() - 1] >= 180.0 - 1e-6);
    if !whole || curve.values.iter().any(|v| v.is_nan()) {
        let divisor = match said {
            Some(Normalization::One) => 1.0,
            Some(Normalization::FourPi) => 4.0 * PI,
            _ => {
                return Err(needs(
                    "the table does not cover 0 to 180 degrees, so that its integral is not known: expected the option \
                     normalization=1 or 4pi, what the whole function integrates to over the sphere"
                        .to_owned(),
                ));
            }
        };
        report.note(PhaseNote::UncoveredMasked);
        curve.values.iter_mut().for_each(|value| *value /= divisor);
        return Ok(());
    }
    let integrals = curve.integrals();
    let total = integrals.total;
    if !(total > 0.0 && total.is_finite()) {
        return Err(FormatError::new(
            FormatErrorKind::Malformed,
            NAME,
            format!("the values integrate to {} over the sphere, expected more than 0", Brief(total)),
        ));
    }
    let near = |expected: f64| (total / expected - 1.0).abs() <= TOLERANCE;
    let found = format!("{total:.6}");
    match said {
        None if near(1.0) => report.note(PhaseNote::NormalisedToOne { integral: total }),
        None if near(4.0 * PI) => {
            report.note(PhaseNote::NormalisedToFourPi { integral: total });
        }
        None => {
            return Err(needs(format!(
                "the values integrate to {found} over the sphere, which is neither 1 nor 4 pi within 5 %: expected the option \
                 normalization=1, 4pi, vsf (a volume scattering function in 1/m/sr) or relative"
            )));
        }
        Some(Normalization::Vsf) => {
            report.metadata.push(("scattering_coefficient".to_owned(), Brief(total).to_string()));
            report.note(PhaseNote::VolumeScattering { scattering_coefficient: Brief(total) });
        }
        Some(Normalization::Relative) => {
            report.note(PhaseNote::RelativeNormalised { integral: total });
        }
        Some(said) => {
            let expected = if said == Normalization::One { 1.0 } else { 4.0 * PI };
            if !near(expected) {
                report.note(PhaseNote::IntegralContradicted { integral: total, stated: expected });
            }
        }
    }
    curve.values.iter_mut().for_each(|value| *value /= total);
    let (mean, share) = (integrals.cosine / total, integrals.first / total);
    report.metadata.push(("integral_over_the_sphere".to_owned(), Brief(total).to_string()));
    report.metadata.push(("mean_cosine".to_owned(), format!("{mean:.6}")));
    report.metadata.push(("share_of_the_first_step".to_owned(), format!("{share:.6}")));
    if share > UNRESOLVED && curve.angles[1] < 90.0 {
        report.note(PhaseNote::PeakNotResolved { light_percent: 100.0 * share });
    }
    if mean < -0.05 {
        report.note(PhaseNote::MostlyBackward { mean_cosine: mean });
    }
    Ok(())
}

/// Returns the decimal of nine places that differs from `angle` by rounding only, else `angle`. Decimals take a tenth
/// of the bytes when coded.
pub(super) fn decimal(angle: f64) -> f64 {
    let nearest = rounded(angle);
    if (nearest - angle).abs() < 1e-12 { nearest } else { angle }
}

/// Returns an angle rounded to nine decimals.
fn rounded(angle: f64) -> f64 {
    libm::round(angle * 1e9) / 1e9
}
