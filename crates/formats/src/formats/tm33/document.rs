//! Content of a TM-33 file as it is written: keywords, and for each emitter its distributions and spectra.

use super::distribution::{Distribution, Intensity, Metric};
use super::spectrum::Listed;
use super::words::{Placed, number_of};
use crate::domain::limits::{MAX_SAMPLES, MAX_WAVELENGTHS};
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::text::{Source, number, snippet};
use crate::formats::xml::{Element, Room, Visitor};

/// Upper bound on the bytes of text in an XML element other than a list. Raising it keeps longer keywords.
const MAX_TEXT: usize = 4096;
/// Upper bound on the bytes of a list of wavelengths or values in one XML element. Raising it accepts longer lists.
const MAX_LIST: usize = 32 * MAX_WAVELENGTHS;
/// Upper bound on the number of keywords that are kept of a file. Raising it keeps more and uses more memory.
const MAX_FIELDS: usize = 4096;
/// Upper bound on the number of intensities in a file.
const MAX_POINTS: usize = MAX_SAMPLES / 4;
/// Names of the elements whose content is not read.
const UNREAD: [&str; 6] = ["AngularSpectral", "AngularColor", "IllumData", "IrradData", "PFDData", "SpecIrradData"];
/// Name of the element of a light source, and of the one that identifies the file.
pub(super) const EMITTER: &str = "Emitter";
const HEADER: &str = "Header";

/// Light source of a luminaire.
#[derive(Default)]
pub(super) struct Emitter {
    /// Keywords of the emitter with their text, in the order of the file.
    pub(super) fields: Vec<(String, String)>,
    pub(super) distributions: Vec<Distribution>,
    pub(super) spectra: Vec<Listed>,
    /// Names of the elements whose content is not read.
    pub(super) unread: Vec<&'static str>,
}

impl Emitter {
    /// Returns the text of the emitter's keyword `name`.
    pub(super) fn field(&self, name: &str) -> Option<&str> {
        self.fields.iter().find(|(key, _)| key == name).map(|(_, text)| text.as_str())
    }

    /// Returns true if the emitter has intensities by direction.
    pub(super) fn has_intensities(&self) -> bool {
        self.distributions.iter().any(|distribution| !distribution.points.is_empty())
    }

    /// Returns the number in the text of the emitter's keyword `name`.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.field(name).and_then(number)
    }
}

/// Part of an emitter that an element belongs to.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    Distribution,
    Spectrum,
    Unread,
}

/// Parser state of a TM-33 file: what was read so far.
pub(super) struct Document<'a> {
    source: &'a Source,
    /// Names of the open elements, the root first.
    path: Vec<String>,
    /// Part of an emitter that is open, with the number of elements around it.
    part: Option<(Part, usize)>,
    /// Angles of each open intensity, or wavelength in nm of each open value of a spectrum.
    places: Vec<[f64; 2]>,
    points: usize,
    kept: usize,
    /// Name of the root element.
    pub(super) root: String,
    /// Keywords of the file with their text, in the order of the file; those of emitters are with them.
    pub(super) fields: Vec<(String, String)>,
    /// Type of the goniometer.
    pub(super) goniometer: Option<Placed<String>>,
    pub(super) emitters: Vec<Emitter>,
}

impl Visitor for Document<'_> {
    fn open(&mut self, element: &Element<'_>) -> Result<Room, FormatError> {
        let name = element.name;
        if self.path.len() == 1 && name == EMITTER {
            self.emitters.push(Emitter::default());
        }
        if self.path.is_empty() {
            name.clone_into(&mut self.root);
        }
        self.begin(name, element.offset);
        self.path.push(name.to_owned());
        let datum = self.datum(name);
        if let Some(names) = datum {
            let mut place = [0.0; 2];
            for (place, names) in place.iter_mut().zip(names) {
                *place = self.attribute(element, names)?;
            }
            self.places.push(place);
        }
        let bytes = if is_list(name) { MAX_LIST } else { MAX_TEXT };
        Ok(Room { bytes, is_strict: is_list(name) || datum.is_some() })
    }

    fn close(&mut self, name: &str, text: &str, offset: usize) -> Result<(), FormatError> {
        let is_datum = self.datum(name).is_some();
        self.path.pop();
        let part = self.part;
        if part.is_some_and(|(_, around)| around == self.path.len()) {
            self.part = None;
        }
        let part = part.map(|(part, _)| part);
        if !is_datum && !is_list(name) && part != Some(Part::Unread) {
            self.keep(name, text, offset);
        }
        let source = self.source;
        match (part, self.emitters.last_mut()) {
            (Some(Part::Distribution), Some(Emitter { distributions, .. })) => {
                let Some(found) = distributions.last_mut() else { return Ok(()) };
                if !is_datum {
                    return found.set(name, text, offset, source);
                }
                let Some([horizontal, vertical]) = self.places.pop() else { return Ok(()) };
                self.points += 1;
                if self.points > MAX_POINTS {
                    let message = format!("more than {MAX_POINTS} intensities");
                    return Err(source.error(FormatErrorKind::OverLimit, offset, message));
                }
                let value = number_of(text, "an intensity", offset, source)?;
                found.points.push(Intensity { horizontal, vertical, value, offset });
                Ok(())
            }
            (Some(Part::Spectrum), Some(Emitter { spectra, .. })) => {
                let Some(found) = spectra.last_mut() else { return Ok(()) };
                if !is_datum {
                    return found.set(name, text, offset, source);
                }
                let Some([wavelength, _]) = self.places.pop() else { return Ok(()) };
                found.push(wavelength, number_of(text, "a value of a spectrum", offset, source)?, offset, source)
            }
            _ => Ok(()),
        }
    }
}

/// Returns true for the name of an element that lists the wavelengths or the values of a spectrum.
fn is_list(name: &str) -> bool {
    matches!(name, "Wavelengths" | "Values")
}

impl<'a> Document<'a> {
    pub(super) fn new(source: &'a Source) -> Self {
        Self {
            source,
            path: Vec::new(),
            part: None,
            places: Vec::new(),
            points: 0,
            kept: 0,
            root: String::new(),
            fields: Vec::new(),
            goniometer: None,
            emitters: Vec::new(),
        }
    }

    /// Begins the part of an emitter that the element `name` holds, if any.
    fn begin(&mut self, name: &str, offset: usize) {
        let around = self.path.len();
        let is_inside = self.part.is_none() && self.path.get(1).is_some_and(|top| top == EMITTER);
        let Some(emitter) = self.emitters.last_mut().filter(|_| is_inside) else { return };
        let metric = match name {
            "LuminousData" | "IntensityDistribution" => Some(Metric::Luminous),
            "RadiantData" => Some(Metric::Radiant),
            "PhotonData" => Some(Metric::Photon),
            _ => None,
        };
        if let Some(metric) = metric {
            emitter.distributions.push(Distribution::new(metric, offset));
            self.part = Some((Part::Distribution, around));
        } else if matches!(name, "EmitterSpectral" | "SpectralDistribution") {
            emitter.spectra.push(Listed::new(offset));
            self.part = Some((Part::Spectrum, around));
        } else if let Some(&unread) = UNREAD.iter().find(|unread| **unread == name) {
            if !emitter.unread.contains(&unread) {
                emitter.unread.push(unread);
            }
            self.part = Some((Part::Unread, around));
        }
    }

    /// Returns the names of the attributes that place a number of a distribution or a spectrum, in the revisions of the
    /// format; `None` for elements that hold no such number.
    fn datum(&self, name: &str) -> Option<&'static [&'static [&'static str]]> {
        match (self.part?.0, name) {
            (Part::Distribution, "IntData" | "IntensityData") => {
                Some(&[&["h", "horz", "horizontal"], &["v", "vert", "vertical"]])
            }
            (Part::Spectrum, "PwrData" | "SpectralData") => Some(&[&["w", "wavelength"]]),
            _ => None,
        }
    }

    /// Returns the number in an attribute that has one of `names`.
    fn attribute(&self, element: &Element<'_>, names: &[&str]) -> Result<f64, FormatError> {
        let written = names.iter().find_map(|name| element.attribute(name));
        // Both zeros are one angle.
        written.as_deref().and_then(|text| number(text.trim())).map(|value| value + 0.0).ok_or_else(|| {
            let found = written.as_deref().map_or_else(|| "no attribute".to_owned(), snippet);
            let message = format!("{found} in {}, expected a number as the attribute {}", element.name, names[0]);
            self.source.malformed(element.offset, message)
        })
    }

    /// Keeps the text of an element as a keyword of the file or of its emitter. The names of the elements around it are
    /// part of the keyword, but for the root, the header and the emitter.
    fn keep(&mut self, name: &str, text: &str, offset: usize) {
        let top = self.path.get(1).map(String::as_str);
        let is_emitter = top == Some(EMITTER);
        if text.is_empty() {
            return;
        }
        let is_goniometer = self.path.last().is_some_and(|around| around.starts_with("Gonio"));
        if is_goniometer && matches!(name, "Type" | "GoniometerType") {
            self.goniometer = Some((text.to_owned(), offset));
        }
        if self.kept >= MAX_FIELDS {
            return;
        }
        self.kept += 1;
        let left_out = if is_emitter || top == Some(HEADER) { 2 } else { 1 };
        let around = self.path.get(left_out..).unwrap_or_default().iter().map(String::as_str);
        let key: Vec<&str> = around.chain([name]).collect();
        let field = (key.join("/").chars().take(120).collect(), text.to_owned());
        match self.emitters.last_mut().filter(|_| is_emitter) {
            Some(emitter) => emitter.fields.push(field),
            None => self.fields.push(field),
        }
    }
}
