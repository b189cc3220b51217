//! Notes on the axes of a projection and the cells that represent samples.

use super::display::{are, s};
use crate::domain::{Domain, readable};

wavelume_core::declare_notes! {
    /// Remarks for the user on the projection of a measurement: the chosen axes, and the cells (triangles of
    /// directions) that represent samples.
    ProjectionNote {
        Chosen AsInFile => "the axes and samples of the file";
        Chosen AxisAsStated { role: &'static str, axis: String } => "{role}: {axis}, as the file states it";
        Chosen Elevations { role: &'static str, elevations: usize } =>
            "{role}: the {elevations} elevation{s} of the file (isotropic)", s = s(elevations);
        Chosen Level {
            role: &'static str, level: u8, domain: Domain, cell_degrees: f64, spacing: String,
            natural_level: u8, is_requested: bool,
        } => "{role} level {level} on the {domain}: cells of {cell_degrees:.1}° for samples every {spacing} ({reason})",
            reason = level_reason(level, natural_level, is_requested);
        Chosen LevelMeans { role: &'static str, level: u8, triangles: u32, file_level: u8 } =>
            "{role} level {level} as requested: means of {triangles} triangles of level {file_level}, by solid angle";
        Chosen CellsOfBilinear { role: &'static str, parts: u64 } =>
            "{role} cells are averages of the bilinear interpolant over {parts} parts each";
        Chosen CellsOfInterpolant { role: &'static str, parts: u64, is_by_cosine: bool } =>
            "{role} cells are averages of the file's own interpolant over {parts} parts each{weights}",
            weights =
                if is_by_cosine { ", weighted by the cosine, so that a cell keeps the light that it reflects" } else { "" };
        Warning CellsCoarse { error_percent: f64, target_percent: f64 } =>
            "projection alone costs er(L2) {error_percent:.3} % at the file's samples, more than half of the {target_percent} % \
             asked for: give a finer outgoing_level (or incoming_level)";
        Chosen MadeReciprocal { difference_percent: f64 } =>
            "reciprocal: each value is the mean with that of the exchanged pair of directions; in the file the two differ by \
             {difference_percent:.2} % (median)";

        // Angles that the file does not cover, or that the quantity does not have.
        Assumed OneAzimuthIsotropic => "incoming directions of one azimuth only: taken as isotropic";
        Assumed WithoutGrid =>
            "the angles are too far apart to interpolate between them (a single theta, or azimuths more than 90° apart): \
             treated as scattered directions";
        Assumed AzimuthGap { from_degrees: f64, to_degrees: f64 } =>
            "nothing is known between the azimuths of {from_degrees}° and {to_degrees}°, which are more than 90° apart: masked";
        Assumed RotationallySymmetric { role: &'static str } =>
            "{role} samples have no azimuth: taken as rotationally symmetric about z";
        Assumed OutsideTheta { role: &'static str, first_degrees: f64, last_degrees: f64, is_zero: bool } =>
            "{role} directions outside theta {first_degrees}° to {last_degrees}° are {rest}", rest = outside(is_zero);
        Assumed OutsidePhi { role: &'static str, first_degrees: f64, last_degrees: f64, is_zero: bool } =>
            "{role} directions outside phi {first_degrees}° to {last_degrees}° are {rest}", rest = outside(is_zero);
        Skipped SamplesBeyond { role: &'static str, domain: Domain } =>
            "{role} samples beyond the {domain} were left out";
        Skipped ElevationsBeyond { elevations: usize, of: usize, domain: Domain } =>
            "{elevations} of {of} outgoing elevations lie beyond the {domain}: left out";
        Warning MissingAveraged { samples: usize, of: usize } =>
            "{samples} of {of} samples {are} missing: cells are averages of what is there, masked where nothing is",
            are = are(samples);
        Warning MissingMasked { samples: usize, of: usize } => "{samples} of {of} samples {are} missing: masked", are = are(samples);

        // Wavelengths.
        Chosen WavelengthsResampled {
            wavelengths: usize, first_nm: f64, last_nm: f64, samples: usize, measured_first_nm: f64, measured_last_nm: f64,
        } => "{wavelengths} wavelengths from {first_nm} to {last_nm} nm as requested: averages over their bands of the \
              piecewise linear spectrum through {samples} samples from {measured_first_nm} to {measured_last_nm} nm",
            first_nm = readable(first_nm), last_nm = readable(last_nm),
            measured_first_nm = readable(measured_first_nm), measured_last_nm = readable(measured_last_nm);
        Skipped WavelengthsOutside { wavelengths: usize } =>
            "{wavelengths} requested wavelength{s} {are} outside the measured range and masked",
            s = s(wavelengths), are = are(wavelengths);
    }
}

/// Returns the reason, in words, for a subdivision level of the triangles of directions. `natural` is the level that
/// fits the spacing of the samples.
fn level_reason(level: u8, natural: u8, is_requested: bool) -> String {
    if is_requested {
        "as requested".to_owned()
    } else if level < natural {
        format!("level {natural} would fit the samples, but makes the tensor too large")
    } else if level > natural {
        format!("level {natural} would fit the spacing of the samples, but not represent their values")
    } else {
        "the level whose mean cell size is nearest to the finer spacing".to_owned()
    }
}

fn outside(is_zero: bool) -> &'static str {
    if is_zero { "0, as the format's standard says" } else { "masked" }
}
