//! Notes on the fits to samples at scattered directions.

use crate::domain::Domain;

wavelume_core::declare_notes! {
    /// Remarks for the user on fitting cells (triangles of directions) to samples at scattered directions.
    FitNote {
        Chosen Elevations { elevations: usize, is_measured: bool } => "incoming: {elevations} elevation{s} (isotropic), {origin}",
            s = if elevations == 1 { "" } else { "s" },
            origin = if is_measured { "measured" } else { "even elevations, samples between them" };
        Chosen Quadratic { role: &'static str, neighbours: usize, is_by_slopes: bool, is_by_uncertainty: bool } =>
            "{role} cells are averages of robust quadratic fits in {coordinates} to the {neighbours} nearest \
             samples{weights}; of logarithms where all of these are positive",
            coordinates = if is_by_slopes { "slopes of the half vector" } else { "tangent coordinates" },
            weights = if is_by_uncertainty { ", by nearness and stated uncertainty" } else { ", by nearness" };
        Assumed OneSideMirrored =>
            "samples on one side of the plane of incidence only: the other is taken as its mirror image";
        Skipped SamplesBeyond { samples: usize, domain: Domain } => "{samples} samples beyond the {domain} were left out";
        Skipped Missing { values: u64 } => "{values} values are missing and left out of the fits";
        Warning Negative { values: u64, share_percent: f64 } =>
            "{values} values ({share_percent:.2} % of all) are negative and kept: fits around them are of values, not of \
             logarithms";
        Filled FromMirrorImages { cells: usize } =>
            "{cells} cells are filled from mirror images in the plane of incidence: withheld samples are predicted as well \
             from there as from their own side";
        Filled FromReciprocity { cells: usize, difference_percent: f64 } =>
            "{cells} cells are filled by reciprocity: where both were measured, values of exchanged directions differ by \
             {difference_percent:.1} % in the middle";
        Filled Continued { cells: u64 } =>
            "{cells} cells without samples in or around them are filled and marked as such; without another rule they \
             continue the fit of the samples around";
        Skipped FarFromSamples { cells: u64 } => "{cells} cells are too far from any sample: masked";
    }
}
