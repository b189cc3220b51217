//! Functions that a WINDOW file holds: band, side of the light, reflection or transmission, and the text of the values.

use super::super::acquisition::ParseReport;
use super::super::error::{FormatError, FormatErrorKind};
use super::super::lit_side::LitSide;
use super::super::text::{Source, snippet};
use super::basis::{Basis, stated_bases};
use super::element::Element;
use crate::notes::ScatteringNote;

/// Form in which a file writes its functions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Structure {
    /// Matrix with a column for each incident patch and a row for each outgoing one.
    Columns,
    /// Matrix with a row for each incident patch and a column for each outgoing one.
    Rows,
    /// Tree of three dimensions (isotropic) or four.
    Tree { rank: usize },
}

/// One function of a file.
#[derive(Debug)]
pub(super) struct Block<'a> {
    /// Name of the band: `Visible`, `Solar`, `550 nm`.
    pub(super) band: String,
    pub(super) side: LitSide,
    /// True for transmission, false for reflection.
    pub(super) transmits: bool,
    /// Element `WavelengthDataBlock`, with the names of the bases.
    pub(super) element: &'a Element,
    /// Element `ScatteringData`, whose content is the values.
    pub(super) data: &'a Element,
}

impl Block<'_> {
    /// Returns a description of the function for people: `Visible transmission front`.
    pub(super) fn describe(&self) -> String {
        format!("{} {} {}", self.band, kind(self.transmits), self.side)
    }
}

/// Returns the word for a function of reflected or of transmitted light.
pub(super) fn kind(transmits: bool) -> &'static str {
    if transmits { "transmission" } else { "reflection" }
}

/// Content of a file: the form of its functions, the bases that it defines, and the functions.
#[derive(Debug)]
pub(super) struct File<'a> {
    pub(super) structure: Structure,
    pub(super) bases: Vec<Basis>,
    pub(super) blocks: Vec<Block<'a>>,
}

/// Names of bands that hold chromaticities, which are no BSDF.
const CHROMATICITIES: [&str; 2] = ["CIE-u", "CIE-v"];
/// Name of the element whose texts are kept as metadata.
const MATERIAL: &str = "Material";
/// Upper bound on the number of keywords that are kept. Raising it keeps more.
const MAX_FIELDS: usize = 200;

impl<'a> File<'a> {
    /// Collects the functions of the document with this root.
    pub(super) fn of(root: &'a Element, source: &Source, report: &mut ParseReport) -> Result<Self, FormatError> {
        let layers = root.children_of("Optical").flat_map(|optical| optical.children_of("Layer"));
        let mut layers = layers.filter(|layer| layer.child("WavelengthData").is_some());
        let Some(layer) = layers.next() else {
            let message = "no element Optical/Layer with WavelengthData, expected the BSDF of one layer of WINDOW";
            return Err(source.malformed(root.offset, message));
        };
        if let Some(second) = layers.next() {
            let message = "a second Layer with WavelengthData, expected one layer: its system is one file of WINDOW";
            return Err(source.error(FormatErrorKind::Unsupported, second.offset, message));
        }
        for field in layer.child(MATERIAL).into_iter().flat_map(|material| &material.children).take(MAX_FIELDS) {
            if field.children.is_empty() && !field.text.is_empty() {
                let unit = if field.unit.is_empty() { String::new() } else { format!(" {}", field.unit) };
                report.metadata.push((field.name.clone(), format!("{}{unit}", field.text)));
            }
        }
        let geometry = [Some(root), Some(layer), layer.child(MATERIAL)].into_iter().flatten();
        let mut geometry = geometry.flat_map(|parent| parent.children_of("Geometry"));
        if geometry.any(|geometry| !geometry.content.is_empty()) {
            report.note(ScatteringNote::GeometryBesideBsdf);
        }
        let definition = layer.child("DataDefinition");
        let structure = structure(definition, layer, source)?;
        let bases = match (structure, definition) {
            (Structure::Columns | Structure::Rows, Some(definition)) => stated_bases(definition, source)?,
            _ => Vec::new(),
        };
        let blocks = blocks(layer, source, report)?;
        Ok(Self { structure, bases, blocks })
    }
}

fn structure(definition: Option<&Element>, layer: &Element, source: &Source) -> Result<Structure, FormatError> {
    let element = definition.and_then(|definition| definition.child("IncidentDataStructure"));
    let Some(element) = element else {
        let message =
            "no element DataDefinition/IncidentDataStructure, expected Columns, Rows, TensorTree3 or TensorTree4";
        return Err(source.malformed(layer.offset, message));
    };
    match element.text.to_ascii_lowercase().as_str() {
        "columns" => Ok(Structure::Columns),
        "rows" => Ok(Structure::Rows),
        "tensortree3" => Ok(Structure::Tree { rank: 3 }),
        "tensortree4" => Ok(Structure::Tree { rank: 4 }),
        _ => {
            let message = format!(
                "IncidentDataStructure {}, expected Columns, Rows, TensorTree3 or TensorTree4",
                snippet(&element.text)
            );
            Err(source.error(FormatErrorKind::Unsupported, element.offset, message))
        }
    }
}

fn blocks<'a>(layer: &'a Element, source: &Source, report: &mut ParseReport) -> Result<Vec<Block<'a>>, FormatError> {
    let mut blocks: Vec<Block<'a>> = Vec::new();
    let (mut chromaticities, mut unknown) = (0, Vec::new());
    for data in layer.children_of("WavelengthData") {
        let band = band(data, source)?;
        if CHROMATICITIES.iter().any(|name| name.eq_ignore_ascii_case(&band)) {
            chromaticities += data.children_of("WavelengthDataBlock").count();
            continue;
        }
        for element in data.children_of("WavelengthDataBlock") {
            let direction = element.text_of("WavelengthDataDirection");
            let Some((transmits, side)) = direction_of(direction) else {
                unknown.push(snippet(direction));
                continue;
            };
            let Some(values) = element.child("ScatteringData") else {
                return Err(
                    source.malformed(element.offset, "no element ScatteringData, expected the values of the BSDF")
                );
            };
            let block = Block { band: band.clone(), side, transmits, element, data: values };
            let is_same = |other: &Block<'_>| {
                other.side == side && other.transmits == transmits && other.band.eq_ignore_ascii_case(&block.band)
            };
            if blocks.iter().any(is_same) {
                let message = format!("{} a second time, expected each function once", block.describe());
                return Err(source.error(FormatErrorKind::Unsupported, element.offset, message));
            }
            blocks.push(block);
        }
        for name in ["SourceSpectrum", "DetectorSpectrum"] {
            let (key, text) = (format!("{name} ({band})"), data.text_of(name).to_owned());
            if !text.is_empty() && report.metadata.len() < MAX_FIELDS && report.metadata.iter().all(|(k, _)| *k != key)
            {
                report.metadata.push((key, text));
            }
        }
    }
    if chromaticities > 0 {
        report.note(ScatteringNote::ChromaticitiesBesideBsdf { functions: chromaticities });
    }
    unknown.truncate(3);
    if blocks.is_empty() {
        let of = if unknown.is_empty() { String::new() } else { format!(" ({})", unknown.join(", ")) };
        let message = format!(
            "no function of a known direction{of}, expected WavelengthDataDirection Reflection or Transmission, Front or Back"
        );
        return Err(source.malformed(layer.offset, message));
    }
    if !unknown.is_empty() {
        report.note(ScatteringNote::DirectionsOfDataUnknown { names: unknown.join(", ") });
    }
    Ok(blocks)
}

/// Returns the name of a band: the text of the element `Wavelength`, with its unit unless that is `Integral`.
fn band(data: &Element, source: &Source) -> Result<String, FormatError> {
    let wavelength = data.child("Wavelength").filter(|wavelength| !wavelength.text.is_empty());
    let Some(wavelength) = wavelength else {
        return Err(source.malformed(data.offset, "no element Wavelength, expected the band, such as Visible or Solar"));
    };
    let unit = wavelength.unit.trim();
    let text: String = wavelength.text.chars().take(80).collect();
    let is_number = super::super::text::number(&text).is_some();
    Ok(if is_number && !unit.is_empty() && !unit.eq_ignore_ascii_case("integral") {
        format!("{text} {unit}")
    } else {
        text
    })
}

/// Returns true for transmission and false for reflection, and the side of the light, by the text of
/// `WavelengthDataDirection`; `None` for other texts.
fn direction_of(text: &str) -> Option<(bool, LitSide)> {
    let words: Vec<String> = text.split_whitespace().map(str::to_ascii_lowercase).collect();
    let [kind, side] = words.as_slice() else { return None };
    let transmits = match kind.as_str() {
        "transmission" => true,
        "reflection" => false,
        _ => return None,
    };
    Some((transmits, side.parse().ok()?))
}
