//! Facts about the lamp or sample that was measured, and how, as far as the source file stated them.

use super::keywords::{self, Keywords, fields};
use crate::formats::Instrument;
use serde::Serialize;
use serde_json::Value;

/// Largest number of characters that are shown of a text of the source file. Raising it lengthens descriptions.
const LONGEST: usize = 200;

/// Facts about the lamp or sample of a material, as its source file stated them. Nobody has checked them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Product {
    /// Maker of the luminaire or of the sample.
    pub maker: Option<String>,
    /// Name of the luminaire or of the sample.
    pub name: Option<String>,
    /// Number of the luminaire in the catalogue of its maker.
    pub catalogue_number: Option<String>,
    /// Lamp or emitter of the luminaire.
    pub lamp: Option<String>,
    /// Rated lumens of all lamps together; `None` for absolute photometry, in which the luminaire has been measured as
    /// a whole.
    pub lamp_lumens: Option<f64>,
    /// Electric power of the luminaire in W.
    pub watts: Option<f64>,
    /// Colour temperature or colour of the light, in the words of the file.
    pub colour: Option<String>,
    /// Colour rendering of the light, in the words of the file.
    pub colour_rendering: Option<String>,
    /// Laboratory that measured.
    pub laboratory: Option<String>,
    /// Number of the report of the measurement.
    pub report: Option<String>,
    /// Date of the measurement, in the words of the file.
    pub date: Option<String>,
    /// Instrument that measured.
    pub instrument: Option<String>,
    /// Angular resolution of the instrument.
    pub resolution: Instrument,
}

impl Product {
    /// Collects the facts from the provenance of a material, the text of [`crate::compress::Summary::metadata`]; none
    /// without it.
    pub fn of(provenance: Option<&str>) -> Self {
        let document: Value = provenance.and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default();
        let source = &document["source"];
        let metadata = fields(&source["metadata"]);
        let resolution = serde_json::from_value(source["instrument"].clone()).unwrap_or_default();
        Self { resolution, ..Self::stated(Keywords(&metadata)) }
    }

    fn stated(keywords: Keywords<'_>) -> Self {
        let text = |names| {
            let line = keywords.text(names).unwrap_or_default().replace(char::is_control, " ");
            Some(line.trim().chars().take(LONGEST).collect::<String>()).filter(|line| !line.is_empty())
        };
        let above_0 = |names| keywords.number(names).filter(|number| *number > 0.0);
        let lamps = keywords.number(keywords::LAMPS).unwrap_or(1.0);
        let each = above_0(keywords::LUMENS_PER_LAMP).map(|lumens| lumens * lamps);
        let is_whole_luminaire = lamps <= 0.0;
        Self {
            maker: text(keywords::MAKER),
            name: text(keywords::NAME),
            catalogue_number: text(keywords::CATALOGUE_NUMBER),
            lamp: text(keywords::LAMP),
            lamp_lumens: above_0(keywords::LUMENS).or(each).filter(|_| !is_whole_luminaire),
            watts: above_0(keywords::WATTS),
            colour: text(keywords::COLOUR),
            colour_rendering: text(keywords::COLOUR_RENDERING),
            laboratory: text(keywords::LABORATORY),
            report: text(keywords::REPORT),
            date: text(keywords::DATE),
            instrument: text(keywords::INSTRUMENT),
            resolution: Instrument::default(),
        }
    }

    /// Returns the facts that the file stated in words for people, each with its label.
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let number = |number: Option<f64>, unit: &str| number.map(|number| format!("{number} {unit}"));
        let named = [
            ("maker", self.maker.clone()),
            ("name", self.name.clone()),
            ("catalogue number", self.catalogue_number.clone()),
            ("lamp", self.lamp.clone()),
            ("lamp lumens", number(self.lamp_lumens, "lm")),
            ("power", number(self.watts, "W")),
            ("colour", self.colour.clone()),
            ("colour rendering", self.colour_rendering.clone()),
            ("laboratory", self.laboratory.clone()),
            ("report", self.report.clone()),
            ("date", self.date.clone()),
            ("instrument", self.instrument.clone()),
        ];
        let angles = self.resolution.stated().map(|(name, angle)| ("instrument", format!("{name} {angle}°")));
        named.into_iter().filter_map(|(label, text)| Some((label, text?))).chain(angles).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn product(metadata: &[[&str; 2]]) -> Product {
        Product::of(Some(&serde_json::json!({ "source": { "metadata": metadata } }).to_string()))
    }

    #[test]
    fn luminaires_of_both_formats_state_the_same_facts() {
        let ies = product(&[
            ["MANUFAC", "Maker"],
            ["LUMINAIRE", "Lamp 1"],
            ["TESTLAB", "not stated"],
            ["lamps", "2"],
            ["lumens_per_lamp", "500"],
            ["input_watts", "12.5"],
        ]);
        let ldt = product(&[
            ["company", "Maker"],
            ["luminaire", "Lamp 1"],
            ["set_1_lamps", "2"],
            ["set_1_lumens", "1000"],
            ["set_1_watts", "12.5"],
        ]);
        assert_eq!((&ies, ies.lamp_lumens, ies.watts), (&ldt, Some(1000.0), Some(12.5)));
        let lines = ies.lines();
        assert_eq!(lines[2..], [("lamp lumens", "1000 lm".to_owned()), ("power", "12.5 W".to_owned())]);
    }

    #[test]
    fn absolute_photometry_has_no_lamp_lumens() {
        assert_eq!(product(&[["lamps", "-1"], ["lumens", "1000"]]).lamp_lumens, None);
        assert_eq!(product(&[["lamps", "1"], ["lumens_per_lamp", "-1"], ["input_watts", "0"]]), Product::default());
        assert_eq!((Product::of(None), Product::of(Some("{}"))), (Product::default(), Product::default()));
    }

    #[test]
    fn samples_have_names_and_instruments_too() {
        let text = serde_json::json!({ "source": {
            "metadata": [["sample", "velvet-03"], ["instrument", "gonio\u{7}meter"]],
            "instrument": { "detector_aperture": 1.5 },
        }});
        let lines = Product::of(Some(&text.to_string())).lines();
        let expected =
            [("name", "velvet-03"), ("instrument", "gonio meter"), ("instrument", "the detector's aperture 1.5°")];
        assert_eq!(lines, expected.map(|(label, text)| (label, text.to_owned())));
    }
}
