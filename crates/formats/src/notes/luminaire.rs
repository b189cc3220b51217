//! Notes on luminaires: lamps, photometric planes and intensities.

use super::display::{are, either, s};
use super::{Brief, Quoted};
use crate::domain::{Unit, readable};

wavelume_core::declare_notes! {
    /// Remarks for the user (warnings, assumptions) on luminaires: lamps, photometric planes and intensities.
    LuminaireNote {
        // Intensities of any format.
        Warning NegativeIntensities { intensities: usize, lowest: f32 } =>
            "{intensities} {noun} negative, down to {lowest}; kept as {they_are}",
            noun = either(intensities, "intensity is", "intensities are"), they_are = either(intensities, "it is", "they are");
        Warning AnglesDecrease { angles: &'static str } => "{angles} angles decrease, expected increasing; turned round";
        Warning AnglesRepeated { repeated: usize, angles: &'static str } =>
            "{repeated} {angles} angle{s} {are} listed more than once, intensities averaged",
            s = s(repeated), are = are(repeated);

        // Planes of type C.
        Warning VerticalAnglesUnusual { first_degrees: Brief, last_degrees: Brief } =>
            "vertical angles {first_degrees}° to {last_degrees}°, the standard has 0–90, 90–180 or 0–180; \
             intensities outside are 0";
        Filled PolesAveraged { pole: &'static str, low: f32, high: f32, average: f32 } =>
            "the planes disagree at {pole} ({low} to {high}), where they meet: averaged to {average}";
        Assumed OnePlane { plane_degrees: Brief } => "one plane at C{plane_degrees}, taken to hold all round";
        Warning ClosingPlaneDiffers { first_degrees: Brief, last_degrees: Brief, difference_percent: f64 } =>
            "the planes C{first_degrees} and C{last_degrees} are one, but differ by up to {difference_percent:.2} %: averaged";
        Assumed PlanesDoNotClose { first_degrees: Brief, last_degrees: Brief } =>
            "the planes go from C{first_degrees} to C{last_degrees} without closing; C{last_degrees} taken to be followed by C{next}",
            next = Brief(first_degrees.0 + 360.0);

        // EULUMDAT.
        Assumed ConversionFactorNotStated => "no conversion factor of the intensities, taken as 1";
        Warning MeasuredWithTilt { tilt_degrees: Brief } =>
            "measured with a tilt of {tilt_degrees}°; the intensities are kept as they stand";
        Skipped WattsUnread { found: Quoted } => "the watts of the lamps: found {found}, which is not one number of watts";
        Assumed LampSetsByField => "the lamp sets are written field by field, not set by set";
        Assumed AlternativeLampSets { sets: usize } =>
            "{sets} lamp sets, which are alternatives: the intensities are those of the first";
        Assumed RelativePhotometryInAll { lamps: Brief, flux_lm: Brief } =>
            "relative photometry: intensities hold for {lamps} lamp{s} of {flux_lm} lm in all", s = s(lamps.0);
        Warning LampFluxNotStated { flux_lm: Option<Brief> } =>
            "{found}, expected the lumens of the lamps: intensities stay in cd per 1000 lm",
            found = flux_lm.map_or("no lamp set".to_owned(), |flux| format!("{flux} lm"));
        Warning FluxDiffers { flux_lm: f64, part_percent: f64, stated_lm: Brief } =>
            "the intensities make {flux_lm:.1} lm, {part_percent:.1} % of the {stated_lm} lm stated; kept as they are";
        Assumed SymmetryOfHalfPlanes => "symmetry 3: the planes stored are C270 over C0 to C90, as the format says";
        Warning LinesAfterIntensities { lines: usize, first: Quoted } =>
            "{lines} line{s} after the last intensity {were} not read, the first is {first}",
            s = s(lines), were = either(lines, "was", "were");
        Warning SymmetryContradicted { symmetry: &'static str, intensities: usize, planes: &'static str } =>
            "the file says {symmetry}, but has the {intensities} intensities of {planes}: read as {planes}";

        // LM-63.
        Warning FluxNegative { flux_lm: Brief } =>
            "{flux_lm} lumens per lamp, taken as absolute photometry (which is written -1)";
        Warning Field12NotOne { found: Brief, revision: &'static str } =>
            "field 12 is {found}, expected 1 in {revision}; it does not enter the intensities";
        Warning RevisionUnknown { tag: Quoted } => "unknown revision {tag}, read as LM-63-2002";
        Warning MoreContinuesNothing => "[MORE] follows no keyword to continue; kept as a keyword of its own";
        Skipped LongText { lines: usize, most_keywords: usize, most_bytes: usize } =>
            "{lines} line{s} of text beyond {most_keywords} or longer than {most_bytes} bytes", s = s(lines);
        Assumed NoVersionTag => "no version tag, read as LM-63-1986";
        Assumed DecimalCommas => "commas in numbers are decimal marks: otherwise there are more numbers than the header says";
        Skipped TiltFile { name: Quoted } =>
            "TILT names a file, {name}; files named inside a file are never opened";
        Skipped TiltFactors => "tilt factors are kept as metadata, they do not enter the intensities";
        Warning NearField => "near-field photometry: intensities hold at the distances of [NEARFIELD] only";
        Warning UnitUnknown { unit: Quoted } =>
            "[_INTENSITYUNITS] says {unit}, which is not known; taken as relative, name the unit to change that";
        Assumed UnitOfKeyword { unit: Unit, keyword: String } =>
            "values taken as {unit}, not candela: [{keyword}] says so";
        Warning UnitDoubtful { keyword: String, word: &'static str } =>
            "[{keyword}] mentions {word}: the values may not be candela; taken as relative, name the unit to change that";
        Assumed TypeAOfNegativeAngles => "negative vertical angles in a 1986 file of type 1: taken as type A";
        Warning FluxZero => "0 lumens per lamp, expected -1 for absolute photometry; candela kept as they are";
        Assumed RelativePhotometry { lamps: usize, flux_lm: Brief } =>
            "relative photometry: candela hold for {lamps} lamp{s} of {flux_lm} lm each", s = s(lamps);
        Warning EfficiencyImplausible { efficiency_percent: Brief, lamps_lm: Brief } =>
            "the intensities make {efficiency_percent} % of the {lamps_lm} lm of the lamps, expected 5 to 105 %";
        Filled ResampledToTypeC { photometry: &'static str, rows: usize, columns: usize, polar: usize, planes: usize } =>
            "type {photometry}: {rows} × {columns} intensities resampled to {polar} × {planes} of type C by bilinear interpolation in their own angles";
        Assumed SidesAlike => "horizontal angles start at 0: both sides taken as alike";
        Warning MultipliersNotPositive { factor: Brief } =>
            "the multipliers of this file make {factor}, expected more than 0";
        Warning FurtherTokens { tokens: usize } => "{tokens} further tokens after the last intensity were not read";

        // TM-33.
        Assumed GoniometerNotStated =>
            "no type of goniometer is stated, taken as type C: vertical angles from straight down, horizontal ones of C planes";
        Assumed AbsoluteNotStated { flux_lm: f64, rated_lm: Option<Brief> } =>
            "absolute or relative photometry is not stated: the intensities are taken as candela and make {flux_lm:.1} lm{rated}; \
             ask for the unit cd/klm if they hold for 1000 lm",
            rated = rated_lm.map_or(String::new(), |flux| format!(", the file rates {flux} lm"));
        Assumed RelativeToRated { flux_lm: f64, rated_lm: Option<Brief> } =>
            "relative photometry: the intensities make {flux_lm:.1} lm and are taken to hold for {rated}; ask for the unit \
             cd/klm if they hold for 1000 lm",
            rated = rated_lm.map_or("rated lumens that the file does not state".to_owned(), |flux| format!("{flux} rated lm"));
        Assumed RelativeNotLuminous { names: &'static str } =>
            "{names} are said to be relative, to what the file does not say: taken as they stand";
        Assumed EmittersTogether { quantity: Brief } =>
            "Quantity {quantity}: the intensities are taken as those of all {quantity} emitters together";
        Warning BallastFactorKept { factor: Brief } =>
            "BallastFactor {factor} is kept as a keyword, it does not enter the intensities";
        Warning SymmetryNotOfPlanes { stated: Quoted, found: &'static str } =>
            "the file says {stated}, but its planes say {found}: read as the planes say";
        Skipped DataNotRead { names: String } => "data beside the intensities: {names}";
        Assumed OnlyEmitter { number: usize, of: usize } => "emitter {number} of {of}, the only one with intensities";
        Warning OtherFluxDiffers { flux: f64, unit: &'static str, part_percent: f64, stated: Brief } =>
            "the intensities make {flux:.3} {unit}, {part_percent:.1} % of the {stated} {unit} stated; kept as they are";
        Assumed OneOfUnits { unit: Unit, units: String } =>
            "intensities in {unit}; the emitter has those in {units}, name the unit to read another";
        Assumed SpectrumOfFile { unit: Unit } =>
            "joined with the spectrum that the file lists; ask for the unit {unit} to leave it out";
        Skipped SpectrumLeftOut { reason: String } => "the spectrum that the file lists: {reason}";
        Assumed SpectrumCut { first_nm: Brief, last_nm: Brief } =>
            "the spectrum is cut to {first_nm} to {last_nm} nm, the range of the intensities",
            first_nm = readable(first_nm.0), last_nm = readable(last_nm.0);
    }
}
