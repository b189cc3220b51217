//! Notes on spectra and tables of spectra.

use super::display::{are, either, s};
use super::{Brief, Quoted};
use crate::domain::readable;

wavelume_core::declare_notes! {
    /// Remarks and warnings to the user about a spectrum, or a table of spectra, that was read from a file.
    SpectrumNote {
        Assumed QuantityNotStated => "the header names no quantity, taken as spectrum in relative values";
        Assumed FactorsAsAsked =>
            "reflectance factors, divided by π: a BRDF in 1/sr at one geometry that the file does not state";
        Assumed FactorsNamed =>
            "the header names reflectance factors: divided by π, a BRDF in 1/sr at one geometry that the file does not state \
             (`--quantity reflectance` keeps them as they are)";
        Assumed FactorsKept =>
            "reflectance factors of a geometry that the header does not name, kept as reflectances: `--quantity \
             reflectance-factor` reads those of one direction of view as a BRDF (divided by π)";
        Assumed BidirectionalKept =>
            "bidirectional reflectance, relative to a diffuse white, kept as a reflectance: \
             `--quantity reflectance-factor` reads it as a BRDF (divided by π)";
        Warning RowsDiffer { rows: usize, stated: String } => "{rows} rows, but `Number of X Values` says {stated}";
        Assumed RowsTurnedRound => "the rows were turned round, so that wavelengths increase";
        Warning RowsSorted => "the wavelengths do not increase from row to row: sorted";
        Warning RowsRepeated { rows: usize } => "{rows} row{s} {repeat} another one, value for value: counted once",
            s = s(rows), repeat = either(rows, "repeats", "repeat");
        Assumed DetectorsJoined { from: Brief, to: Brief, rule: &'static str } =>
            "the ranges of two detectors overlap from {from} to {to} in the unit of the file: joined by the rule {rule} \
             (`--overlap shorter`, the default, `longer` or `mean`)";
        Assumed FirstColumnTaken =>
            "no name says which column holds wavelengths, and each could: the first is taken (`--wavelength-column` names \
             another)";
        Skipped NumberingLeftOut { columns: String } => "left out, as it only numbers or repeats the rows: {columns}";
        Skipped TextLeftOut { columns: String } => "left out, as text: {columns}";
        Skipped ColumnsLeftOut { columns: String } =>
            "left out beside the calibrated columns: {columns} (`--column NAME` reads one of them)";
        Assumed SignalKept => "raw signal of a detector (counts), kept as a spectrum in relative values";
        Assumed LightNamed { name: Quoted } => "{name}: the shape is kept, as a spectrum in relative values";
        Assumed PercentKept => "the header says percent; relative values are kept as they stand";
        Warning PercentDivided => "the header says percent: divided by 100";
        Warning PercentGuessed { largest: f32 } => "reflectance up to {largest} taken as percent: divided by 100";
        Warning LargeReflectance { largest: f32 } =>
            "reflectance up to {largest}, expected 0 to 1 or percent; kept as it is";
        Warning LargeRatio { largest: f32 } => "values up to {largest}, expected 0 to 1; kept as they are";
        Filled FillsMasked { values: usize, fill: f32 } =>
            "{values} value{s} of {fill:e}, which {stand} for missing ones, {are} masked",
            s = s(values), stand = either(values, "stands", "stand"), are = are(values);
        Warning MissingMasked { values: usize } => "{values} missing value{s} (blank, NaN or --) {are} masked",
            s = s(values), are = are(values);
        Assumed WavelengthUnitGuessed { first: Brief, last: Brief, unit: &'static str } =>
            "no wavelength unit stated, {first} to {last} taken as {unit}";

        // TM-27.
        Assumed SpectralQuantityNotStated => "no SpectralQuantity, taken as relative";
        Assumed SpectralQuantityUnknown { stated: Quoted } =>
            "SpectralQuantity {stated}: only the shape of the spectrum is kept";
        Warning QuantityAsAsked { asked: String, held: String } =>
            "quantity taken as {asked} as asked; the file holds a {held}";
        Warning WavelengthsSorted => "the wavelengths do not increase: sorted";

        // Files of spectrometers and light meters.
        Assumed LightKept { what: &'static str } =>
            "{what}: the numbers are kept, as a spectrum in relative values";
        Assumed RelativeToPanel =>
            "reflectance relative to a white reference panel, whose own reflectance is taken as 1";
        Assumed CountsDivided =>
            "raw counts, divided by those of the white reference in the file; its integration time and gains hold for both \
             (`--quantity spectrum` keeps the counts)";
        Warning DarkNotSubtracted => "the dark signal was not subtracted, as the file says: it is part of the values";
        Warning DetectorsSaturated { detectors: String } => "the instrument reports saturated detectors: {detectors}";
        Warning DetectorStep { percent: Brief, from: Brief, to: Brief } =>
            "a step of {percent} % from {from} to {to} nm, where two detectors meet, is kept as it is";
        Filled ReferenceZero { values: usize } => "{values} wavelength{s} at which the white reference is 0 {are} masked",
            s = s(values), are = are(values);
        Skipped BytesAfterSpectra { bytes: usize } =>
            "{bytes} bytes after the spectra (classifiers, calibrations, an audit log)";
        Assumed PercentOfWhole =>
            "percent of a maximum that the file does not state: kept as they stand, as a spectrum in relative values \
             (`--quantity reflectance` divides them by 100)";
        Assumed PercentAsAsked => "percent, divided by 100, as a reflectance or transmittance was asked for";
        Skipped CoarserList { wavelengths: usize, of: usize } =>
            "a list of {wavelengths} wavelengths beside a finer one of {of}";

        // Spectrum joined with the intensities of a luminaire.
        Filled JoinedMaskedBridged { wavelengths: usize } =>
            "spectrum: {wavelengths} masked wavelength{s} left out, bridged by the neighbours", s = s(wavelengths);
        Warning JoinedNegative { values: usize } => "spectrum: {values} negative value{s} {enter}", s = s(values), enter = either(values, "enters as it is", "enter as they are");
        Warning JoinedRangeNarrow { first_nm: Brief, last_nm: Brief } =>
            "the spectrum covers {first_nm} to {last_nm} nm only; light outside counts as none in the candela",
            first_nm = readable(first_nm.0), last_nm = readable(last_nm.0);
    }
}
