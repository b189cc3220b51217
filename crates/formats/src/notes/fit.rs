//! Notes on the fits to samples at scattered directions.

use super::display::{are, s};
use crate::domain::Domain;

wavelume_core::declare_notes! {
    /// Remarks for the user on fitting cells (triangles of directions) to samples at scattered directions.
    FitNote {
        Chosen Elevations { elevations: usize, is_measured: bool } => "incoming: {elevations} elevation{s} (isotropic), {origin}",
            s = s(elevations),
            origin = if is_measured { "measured" } else { "even elevations, samples between them" };
        Chosen Quadratic { role: &'static str, neighbours: usize, is_by_slopes: bool, is_by_uncertainty: bool } =>
            "{role} cells: a quadratic is fitted to the {neighbours} nearest samples in {coordinates}, and averaged over the \
             cell; {weights}, outliers less; where all of these samples are positive, their logarithms are fitted",
            coordinates = if is_by_slopes { "slopes of the half vector" } else { "tangent coordinates" },
            weights = if is_by_uncertainty { "near and certain samples weigh more" } else { "near samples weigh more" };
        Assumed OneSideMirrored =>
            "samples on one side of the plane of incidence only: the other is taken as its mirror image";
        Skipped SamplesBeyond { samples: usize, domain: Domain } => "{samples} sample{s} beyond the {domain} left out", s = s(samples);
        Skipped Missing { values: u64 } => "{values} value{s} {are} missing and left out of the fits",
            s = s(values), are = are(values);
        Warning Negative { values: u64, share_percent: f64 } =>
            "{values} value{s} ({share_percent:.2} % of all) {are} negative and kept: around them values are fitted instead of \
             logarithms", s = s(values), are = are(values);
        Filled FromMirrorImages { cells: usize } =>
            "{cells} cell{s} {are} filled from mirror images in the plane of incidence: withheld samples are predicted as well \
             from there as from their own side", s = s(cells), are = are(cells);
        Filled FromReciprocity { cells: usize, difference_percent: f64 } =>
            "{cells} cell{s} {are} filled by reciprocity: where both were measured, values of exchanged directions differ by \
             {difference_percent:.1} % (median)", s = s(cells), are = are(cells);
        Filled Continued { cells: u64 } =>
            "{cells} cell{s} without samples in or around {are} filled and marked as such; without another rule by \
             continuing the fit of the samples around", s = s(cells), are = are(cells);
        Skipped FarFromSamples { cells: u64 } => "{cells} cell{s} {are} too far from any sample: masked", s = s(cells), are = are(cells);
    }
}
