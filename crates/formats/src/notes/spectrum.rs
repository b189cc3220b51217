//! Notes on spectra and tables of spectra.

use super::{Brief, Quoted};

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
        Assumed PercentKept => "the header says percent; relative values are kept as they stand";
        Warning PercentDivided => "the header says percent: divided by 100";
        Warning PercentGuessed { largest: f32 } => "reflectance up to {largest} taken as percent: divided by 100";
        Warning LargeReflectance { largest: f32 } =>
            "reflectance up to {largest}, expected 0 to 1 or percent; kept as it is";
        Warning LargeRatio { largest: f32 } => "values up to {largest}, expected 0 to 1; kept as they are";
        Warning MissingMasked { values: usize } => "{values} missing values (blank, NaN or --) are masked";
        Assumed WavelengthUnitGuessed { first: Brief, last: Brief, unit: &'static str } =>
            "no wavelength unit stated, {first} to {last} taken as {unit}";

        // TM-27.
        Assumed SpectralQuantityNotStated => "no SpectralQuantity, taken as relative";
        Assumed SpectralQuantityUnknown { stated: Quoted } =>
            "SpectralQuantity {stated}: only the shape of the spectrum is kept";
        Warning QuantityAsAsked { asked: String, held: String } =>
            "quantity taken as {asked} as asked; the file holds a {held}";
        Warning WavelengthsSorted => "the wavelengths do not increase: sorted";

        // Spectrum joined with the intensities of a luminaire.
        Filled JoinedMaskedBridged { wavelengths: usize } =>
            "spectrum: {wavelengths} masked wavelengths left out, bridged by their neighbours";
        Warning JoinedNegative { values: usize } => "spectrum: {values} negative values enter as they are";
        Warning JoinedRangeNarrow { first_nm: Brief, last_nm: Brief } =>
            "the spectrum covers {first_nm} to {last_nm} nm only; light outside counts as none in the candela";
    }
}
