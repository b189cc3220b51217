//! Header fields of a source file by their meaning, under the names that the readers of all formats keep them.

use serde_json::Value;

/// Names of header fields with one meaning in different formats, of which the first one that is stated counts.
pub(super) type Names = &'static [&'static str];

/// Maker of a luminaire or of a sample.
pub(super) const MAKER: Names = &["company", "MANUFAC", "Manufacturer", "manufacturer", "maker", "Hersteller"];
/// Name of a luminaire or of a sample.
pub(super) const NAME: Names = &[
    "luminaire",
    "LUMINAIRE",
    "Description",
    "sample",
    "sample_name",
    "Sample",
    "Sample Name",
    "name",
    "Name",
    "material",
    "title",
    "description",
];
/// Number of a luminaire in the catalogue of its maker.
pub(super) const CATALOGUE_NUMBER: Names = &["luminaire_number", "LUMCAT", "CatalogNumber"];
/// Lamp or emitter of a luminaire.
pub(super) const LAMP: Names = &["lamp", "set_1_lamp", "LAMP", "LAMPCAT", "Emitter/Description"];
/// Number of lamps to which the lumens belong; negative for absolute photometry in EULUMDAT.
pub(super) const LAMPS: Names = &["lamps", "set_1_lamps"];
/// Lumens of all lamps together.
pub(super) const LUMENS: Names = &["lumens", "set_1_lumens", "Emitter/RatedLumens"];
/// Lumens of each lamp; negative for absolute photometry in LM-63.
pub(super) const LUMENS_PER_LAMP: Names = &["lumens_per_lamp"];
/// Electric power of a luminaire in W.
pub(super) const WATTS: Names = &["watts", "set_1_watts", "input_watts", "Emitter/InputWattage", "Emitter/InputWatts"];
/// Colour temperature of the light of a luminaire.
pub(super) const COLOUR: Names = &[
    "colour",
    "set_1_colour",
    "COLORTEMP",
    "_CCT",
    "Emitter/ColorTemperature/FixedCCT",
    "Emitter/FixedCCT",
    "Emitter/CCT",
];
/// Colour rendering of the light of a luminaire.
pub(super) const COLOUR_RENDERING: Names = &[
    "colour_rendering",
    "set_1_colour_rendering",
    "CRI",
    "_CRI",
    "Emitter/ColorRendering/CIE_CRI/Ra",
    "Emitter/ColorRendering/Ra",
];
/// Laboratory that measured.
pub(super) const LABORATORY: Names = &["TESTLAB", "Laboratory", "laboratory"];
/// Number of the report of a measurement.
pub(super) const REPORT: Names = &["report", "TEST", "ReportNumber"];
/// Date of a measurement or of its file.
pub(super) const DATE: Names = &["date", "ISSUEDATE", "DATE", "ReportDate", "Date", "Datum"];
/// Instrument that measured.
pub(super) const INSTRUMENT: Names = &[
    "instrument",
    "Instrument",
    "instrument_type",
    "goniometer",
    "spectrometer",
    "Model",
    "Equipment/Gonioradiometer/Type",
];

/// Text that LM-63 has in fields that it requires and that nobody filled in.
const NOT_STATED: &str = "not stated";

/// Header fields of a source file, as its reader kept them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Keywords<'a>(pub(super) &'a [(String, String)]);

impl<'a> Keywords<'a> {
    /// Returns the text of the first of `names` that the file states; `None` if it is empty.
    pub(super) fn text(self, names: &[&str]) -> Option<&'a str> {
        let found = |name: &&str| self.0.iter().find(|(found, _)| found == name);
        let text = names.iter().find_map(found).map(|(_, text)| text.as_str());
        text.filter(|text| !text.is_empty() && *text != NOT_STATED)
    }

    /// Returns the number at the start of the text of the first of `names` that the file states.
    pub(super) fn number(self, names: &[&str]) -> Option<f64> {
        self.text(names)?.split_whitespace().next()?.parse().ok().filter(|number: &f64| number.is_finite())
    }
}

/// Returns the header fields of the source file from the provenance of a material, in the order of that file.
pub(super) fn fields(metadata: &Value) -> Vec<(String, String)> {
    let pair = |pair: &Value| Some((pair[0].as_str()?.to_owned(), pair[1].as_str()?.to_owned()));
    metadata.as_array().map(|pairs| pairs.iter().filter_map(pair).collect()).unwrap_or_default()
}
