//! Notes on tables of phase functions and volume scattering functions.

use super::Brief;
use super::display::{are, either, s};

wavelume_core::declare_notes! {
    /// Remarks for the user (warnings, assumptions) on tables of phase functions and volume scattering functions.
    PhaseNote {
        Warning Negative { values: usize, lowest: Brief } =>
            "{values} value{s} {are} negative, down to {lowest}; kept as {they_are}",
            s = s(values), are = are(values), they_are = either(values, "it is", "they are");
        Assumed FirstColumnRead { columns: usize, names: String } =>
            "{columns} columns of values ({names}): the first is read, the option column names another";
        Assumed CosinesInFirstColumn => "the first column is the cosine of the scattering angle, +1 = forward";
        Assumed DegreesInFirstColumn => "the first column is the scattering angle in degrees, 0 = forward";
        Assumed AnglesInRadians => "the scattering angle is in radians, as the header says: converted to degrees";
        Assumed EvenCosines => "one line of values: at cosines of the scattering angle in even steps from -1 to 1";
        Assumed MomentsFactored => "Legendre moments with the factor 2m + 1, as some are larger than 1";
        Assumed MomentsNotFactored => "Legendre moments without the factor 2m + 1, as none is larger than 1";
        Filled MomentsExpanded { angles: usize } => "the moments became a table of {angles} angles";
        Assumed CoarserDirections { outgoing_degrees: f64, incoming_degrees: f64, step_degrees: Brief } =>
            "triangles suit outgoing directions {outgoing_degrees} and incoming ones {incoming_degrees} degrees apart, \
             though the table has steps of {step_degrees} degrees: give outgoing_level and incoming_level for \
             finer ones";
        Assumed WavelengthsNormalised { wavelengths: usize } =>
            "each of {wavelengths} wavelengths is normalised separately; the figures below are for the first";
        Filled EndsHeld { first_degrees: Brief, last_degrees: Brief } =>
            "the table goes from {first_degrees} to {last_degrees} degrees: its first and last value hold beyond";
        Warning UncoveredMasked => "angles that the table does not cover are masked";
        Assumed NormalisedToOne { integral: f64 } => "normalised to 1 over the sphere (found {integral:.6})";
        Assumed NormalisedToFourPi { integral: f64 } =>
            "normalised to 4 pi over the sphere (found {integral:.6}): divided by it";
        Assumed VolumeScattering { scattering_coefficient: Brief } =>
            "a volume scattering function: divided by its integral, the scattering coefficient {scattering_coefficient}";
        Assumed RelativeNormalised { integral: f64 } =>
            "relative values: divided by their integral over the sphere, {integral:.6}";
        Warning IntegralContradicted { integral: f64, stated: f64 } =>
            "the values integrate to {integral:.6} over the sphere, not to {stated:.6} as was said: divided by what they make";
        Warning PeakNotResolved { light_percent: f64 } =>
            "{light_percent:.0} % of the light lies within the first step of the table: its peak is not resolved";
        Warning MostlyBackward { mean_cosine: f64 } =>
            "most light goes backward (mean cosine {mean_cosine:.3}): here +1 and 0 degrees are forward; is it the other way \
             round in the file?";
    }
}
