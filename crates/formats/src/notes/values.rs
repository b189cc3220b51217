//! Notes on numbers, units and quantities of any format.

use super::Brief;
use super::display::{are, either, s};
use crate::domain::Unit;

wavelume_core::declare_notes! {
    /// Remarks for the user (warnings, assumptions) on numbers, units and quantities in files of any format.
    ValueNote {
        Warning Negative { values: usize, lowest: f32 } =>
            "{values} value{s} {are} negative, down to {lowest}; kept as {they_are}",
            s = s(values), are = are(values), they_are = either(values, "it is", "they are");
        Warning NegativeOf { values: usize, of: usize, lowest: f32 } =>
            "{values} of {of} values {are} negative, down to {lowest}; kept as {they_are}",
            are = are(values), they_are = either(values, "it is", "they are");
        Warning WithoutSample { missing: usize, of: usize, places: &'static str } =>
            "{missing} of {of} {places} {have} no sample: masked", have = either(missing, "has", "have");
        Warning MeasuredRepeatedly { samples: usize } => "{samples} sample{s} {were} measured more than once: averaged",
            s = s(samples), were = either(samples, "was", "were");
        Assumed RoundedToFloat32 { element: &'static str } => "{element} values were rounded to float32";
        Assumed AnglesRounded { stored_as: &'static str } => "angles in {stored_as} are rounded to 0.0001 degrees";
        Warning QuantityAsAsked { asked: String, stated: String, source: &'static str } =>
            "quantity taken as {asked} as asked; the {source} says {stated}";
        Assumed UnitNotStated { unit: Unit } => "no unit stated, taken as {unit}";
        Warning UnitAsAsked { asked: Unit, stated: Unit, source: &'static str } =>
            "unit taken as {asked} as asked; the {source} says {stated}";
        Assumed UnitForValueUnit => "`unit` is taken for `value_unit`";
        Assumed AngleUnitNotStated => "no unit of the angles is stated, taken as degrees";
        Warning PercentDivided => "values in percent: divided by 100";
        Assumed WavelengthUnitNotStated => "`wavelength_unit` is not stated, taken as nm";
        Warning WavelengthUnitAsAsked { asked: &'static str, stated: &'static str } =>
            "wavelengths taken in {asked} as asked; the file says {stated}";
        Warning ThetaLikelyInRadians { largest_degrees: Brief } =>
            "theta up to {largest_degrees} degrees only: if they are radians, add `angle_unit: rad`";
        Warning WavelengthsLikelyInMicrometres { largest_nm: Brief } =>
            "wavelengths up to {largest_nm} nm only: if they are micrometres, add `wavelength_unit: um`";
        Warning DirectionsRestated {
            poles_percent: Option<f64>, seam_percent: Option<f64>, repeated_angles_percent: Option<f64>,
            normal_incidence_percent: Option<f64>, cancelling: Option<u64>,
        } => "the file states several values for the same direction; their root mean square difference from their mean is \
              {parts}{cancelled}",
            parts = parts(&[
                ("at the poles", poles_percent),
                ("between the first and the last azimuth", seam_percent),
                ("at angles listed twice", repeated_angles_percent),
                ("between azimuths at normal incidence", normal_incidence_percent),
            ]),
            cancelled = cancelled(cancelling);
        Skipped ExtentsWithoutGrid => "the stated extents and covers of angles, because the directions make no grid";
        Skipped UncertaintiesWithoutDirections =>
            "the columns of sigma: uncertainties are used for data with directions only";
    }
}

/// Returns a list in words of the deviations between values that a file states for one direction: the place (such as
/// the poles) and percent of each. Deviations that are `None` are left out.
fn parts(percentages: &[(&str, Option<f64>)]) -> String {
    let known = percentages.iter().filter_map(|(name, percent)| Some(format!("{:.2} % {name}", (*percent)?)));
    known.collect::<Vec<_>>().join(", ")
}

/// Returns the remark on values of both signs that are stated for one direction and cancel; empty if there are none.
fn cancelled(samples: Option<u64>) -> String {
    samples.map_or_else(String::new, |n| {
        format!("; {n} values of both signs cancel, so no error is promised of their mean")
    })
}
