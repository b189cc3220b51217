//! Notes on surfaces: BRDFs, BTDFs and their angles.

use super::display::{are, either, s};
use super::{Brief, Quoted};

wavelume_core::declare_notes! {
    /// Remarks for the user (warnings, assumptions) on measurements of surfaces: BRDFs, BTDFs and their angles.
    ScatteringNote {
        Assumed LinearSrgb => "the channels are taken as linear sRGB";
        Assumed ThreeValuesAsSrgb => "three values a row: taken as the channels of linear sRGB";
        Assumed ReflectanceFactors => "reflectance factors, divided by π: a BRDF in 1/sr";
        Assumed OutputNotStated => "#PARAM_OUT is not stated: values in 1/sr without the cosine, as asked";
        Assumed CosineNotStated =>
            "`cosine_included` is not stated, taken as false: the values do not hold |cos theta_o|";
        Assumed CosineDivided { source: &'static str } =>
            "values hold the cosine, as the {source} says: divided by |cos theta_o|";
        Warning GrazingMasked { values: usize } => "{values} value{s} at theta_o of 90 degrees {hold} a cosine of 0: masked",
            s = s(values), hold = either(values, "holds", "hold");
        Skipped RowsBelowHorizon { rows: usize } => "{rows} row{s} with a direction below the horizon", s = s(rows);
        Skipped ConfidenceLimits { rows: usize } => "confidence limits of {rows} row{s}", s = s(rows);

        // Columns under the names of laboratories.
        Assumed ColumnsByName { columns: String } => "columns taken by their names: {columns}";
        Assumed ReflectanceAsFactor { name: Quoted } =>
            "{name} over two directions is taken for a reflectance factor (relative to a perfect diffuser): divided by π \
             (`--quantity brdf` keeps the values as they are)";
        Assumed AngleOfIncidenceStated { degrees: Brief } =>
            "theta_i is {degrees} degrees in all rows, as a line before the table says";
        Assumed BandStated { wavelength_nm: Brief } =>
            "the wavelength is {wavelength_nm} nm, as a line before the table says";
        Assumed BandNotStated => "no wavelength is stated: values of one band";
        Assumed InPlane =>
            "theta_o without azimuths, in the plane of incidence: positive angles are on the mirror's side, negative ones on the \
             source's (`--in-plane-sign source` turns them round)";
        Assumed InPlaneAsAsked { positive: &'static str } =>
            "positive theta_o at azimuth 0 is on the {positive}'s side, as asked";
        Assumed AzimuthsFromSource =>
            "azimuths are taken as 0 on the source's side and 180 on the mirror's (`--in-plane-sign mirror` turns them round)";
        Warning LobeOnSourceSide { incidences: usize, of: usize, times: Brief } =>
            "at {incidences} of {of} incidences the largest values are on the source's side of the plane of incidence, up to \
             {times} times those on the mirror's side: a retro-reflector, or the angles \
             are counted the other way (`--in-plane-sign`)";

        // Azimuths.
        Assumed IsotropicWithoutAzimuth => "no column phi_i: isotropic, phi_o is relative to the incoming azimuth";
        Warning RepeatedAzimuthDiffers {
            angles: String, first_degrees: Brief, last_degrees: Brief, difference_percent: f64,
        } => "{angles}: values at {first_degrees}° and {last_degrees}° differ by up to {difference_percent:.2} %, averaged";
        Assumed AzimuthsMirrored { angles: String } =>
            "{angles}: isotropic, azimuths 0° to 180° taken as mirrored (else state the extent sector)";
        Assumed AzimuthSector { angles: String, first_degrees: Brief, last_degrees: Brief } =>
            "{angles}: azimuths {first_degrees}° to {last_degrees}° taken as all there is, the rest of the circle is masked";
        Filled PolesFilled { samples: usize } =>
            "{samples} missing sample{s} at a pole, where all azimuths are one direction: mean of the others there",
            s = s(samples);

        // Analytic models.
        Assumed WavelengthNotStated { wavelength_nm: f64 } => "no wavelength stated, taken as {wavelength_nm} nm";
        Assumed CellsAveraged { incoming_points: usize, outgoing_points: usize } =>
            "cells are averages over {incoming_points} × {outgoing_points} points";
        Warning MoreLightThanArrives { albedo: f64, theta_degrees: f64, wavelength_nm: f64 } =>
            "the model reflects {albedo:.3} of the light from theta {theta_degrees}° at {wavelength_nm} nm, more than arrives";

        // MBSDF.
        Assumed PolarAnglesEven => "polar angles at i · 90°/n from the normal, held from the last one to 90°";
        Filled HorizonRowsRepeated =>
            "reflection and transmission at the horizon repeat their nearest polar angle, so that the two do not mix";
        Assumed SidesLinear =>
            "reflection and transmission have different angles: each is interpolated linearly at those of the other";

        // MERL.
        Assumed BigEndian => "big-endian numbers, expected little-endian; swapped";
        Assumed WholeTurn { cells: usize } => "the {cells} cells along phi_d are taken as a whole turn";
        Skipped NegativeMasked { values: usize, of: usize, lowest: f64 } =>
            "{values} of {of} numbers {are} negative, down to {lowest}: masked", are = are(values);

        // Zemax.
        Skipped BehindSurface { samples: usize, of: usize } =>
            "{samples} of {of} values, at directions about the specular ray that lie behind the surface";
        Assumed RotationIsAzimuth =>
            "sample rotations are taken as azimuths of the light, counter-clockwise seen from outside, as libbsdf takes them";
        Assumed OneRotation { rotation_degrees: Brief } =>
            "the only sample rotation, {rotation_degrees}°, is taken to hold for all: isotropic";
        Assumed ThroughAtIncidence =>
            "the ray straight through is taken to leave at the angle of incidence, as through a plane sheet";
        Assumed AzimuthsAgainstRay =>
            "scatter azimuths are taken as counter-clockwise, seen against the specular ray, from the side of the normal";
        Warning TotalScatterDiffers { percent: f64 } =>
            "the values make {percent:.0} % of the total integrated scatter that the file states, in the table where they \
             are farthest from it; kept as they stand";
        // WINDOW.
        Assumed SideOfLight { side: &'static str } =>
            "light comes from the {side}, to which +z points; seen from there +y points up and +x to the right, while WINDOW \
             counts azimuths as seen from indoors and names light by where it goes";
        Skipped OtherFunctionsHeld { functions: String } =>
            "other functions of the file, which quantity, side and band choose: {functions}";
        Skipped ChromaticitiesBesideBsdf { functions: usize } =>
            "{functions} function{s} of chromaticity (CIE-u, CIE-v), no BSDF", s = s(functions);
        Skipped DirectionsOfDataUnknown { names: String } => "functions of unknown directions: {names}";
        Skipped GeometryBesideBsdf => "the geometry of the layer";
        Assumed BasisByName { basis: Quoted, patches: usize } =>
            "the rings of {basis} are not in the file: {patches} patches as Radiance and WINDOW define them";
        Warning BasisUnlikeItsName { basis: Quoted } =>
            "the file defines other rings of {basis} than Radiance, which goes by the name: read as the file defines them";
        Assumed PatchesAsSteps {
            narrowest_degrees: Brief, widest_degrees: Brief, polar_angles: usize, azimuths: usize,
        } => "values are constant over patches {narrowest_degrees}° to {widest_degrees}° wide: a grid of {polar_angles} polar \
              angles × {azimuths} azimuths with steps at their borders";
        Assumed IncidentPatches { patches: usize, directions: usize } =>
            "{patches} incident patches stand for the light at their centres: {directions} directions, interpolated where a \
             ring has no centre at an azimuth of another";
        Assumed CellsOfTree { values: usize, narrowest_degrees: Brief, widest_degrees: Brief } =>
            "{values} values are constant over cells {narrowest_degrees}° to {widest_degrees}° wide about the normal, wider \
             towards the horizon";

        // RGL.
        Assumed TwoAzimuthsIsotropic => "two incident azimuths are an isotropic material, evaluated at azimuth 0";
        Skipped RgbBesideSpectra => "the field `rgb` beside the spectra";
        Skipped OtherFields { names: String } => "fields without influence on the values: {names}";
        Assumed ElevationsHeld { last_degrees: f64 } =>
            "incident elevations end at {last_degrees}°: values there are taken to hold up to 90°";
        Assumed HalfTurnSymmetry { first_degrees: f64, last_degrees: f64 } =>
            "incident azimuths from {first_degrees}° to {last_degrees}°: surface taken as symmetric under \
             rotation by 180°";
        Assumed MirrorSymmetry { first_degrees: f64, last_degrees: f64 } =>
            "incident azimuths from {first_degrees}° to {last_degrees}°: surface taken as mirror-symmetric \
             along x and along y";
        Assumed AzimuthEndsHeld { first_degrees: f64, last_degrees: f64 } =>
            "incident azimuths from {first_degrees}° to {last_degrees}°: values at the first and the last are \
             taken to hold beyond";
        Warning MissingMasked { values: usize, of: usize } =>
            "{values} of {of} numbers {are} missing (NaN); what would be interpolated from them is masked", are = are(values);
        Warning NegativeKept { values: usize, of: usize, lowest: f32 } =>
            "{values} of {of} numbers {are} negative, down to {lowest:e}; kept as {they_are}",
            are = are(values), they_are = either(values, "it is", "they are");
    }
}
