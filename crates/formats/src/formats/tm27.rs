//! IES TM-27 spectra (`.spdx`): one spectrum as XML, with one element per wavelength and value.
//!
//! Element names are matched without their namespace, which writers choose freely; wavelengths are in nm (IES
//! TM-27-14). Nothing outside the file is read: document types and custom entities are refused.

use super::acquisition::{Acquisition, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::foreign;
use super::instrument::Instrument;
use super::interpretation::Interpretation;
use super::reader::{Format, Reader, Sample};
use super::text::{Brief, Source, number, snippet};
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::domain::{Axis, Quantity, Sampling, Tensor, Unit, WavelengthGrid};
use crate::notes::{Quoted, SpectrumNote, TextNote, ValueNote};
use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};

const NAME: &str = "tm-27";

pub(super) const READER: Reader = Reader {
    about: Format {
        name: NAME,
        description: "IES TM-27 spectrum (.spdx, XML)",
        extensions: &["spdx"],
        reads: true,
        writes: false,
    },
    options: &[],
    probe: |sample: &Sample<'_>| match foreign::xml_root(&sample.head) {
        Some(root) if root.starts_with(ROOT) => 100,
        _ => 0,
    },
    read,
};

/// Prefix of the root element's name in a TM-27 file; two digits of the revision follow.
const ROOT: &str = "IESTM27";
/// Upper bound on the nesting depth of XML elements; TM-27 files have three. Raising it accepts deeper files.
const MAX_DEPTH: usize = 16;
/// Upper bounds on the bytes of text in an XML element, and on the number of header elements. Raising them keeps more
/// and uses more memory.
const MAX_TEXT: usize = 4096;
const MAX_FIELDS: usize = 1000;

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    if let Some(encoding) = source.odd_encoding() {
        report.note(TextNote::DecodedAs { encoding });
    }
    let mut document = Document::new(&source);
    document.read()?;
    let Document { quantity, points, fields, .. } = document;
    report.metadata = fields;
    if points.is_empty() {
        return Err(source.malformed(source.text().len(), "no element SpectralData, expected wavelengths and values"));
    }
    let (quantity, unit) = meaning(quantity.as_deref(), how, &mut report)?;
    let (wavelengths, values) = ordered(points, &source, &mut report)?;
    let negative = values.iter().filter(|v| **v < 0.0).count();
    if negative > 0 {
        let lowest = values.iter().copied().fold(0.0, f32::min);
        report.note(ValueNote::Negative { values: negative, lowest });
    }
    let largest = values.iter().copied().fold(0.0, f32::max);
    if quantity == Quantity::Reflectance && largest > 1.5 {
        report.note(SpectrumNote::LargeRatio { largest });
    }
    let grid = WavelengthGrid::listed(wavelengths).map_err(|e| source.malformed(0, e.to_string()))?;
    let dialect = format!("TM-27, {} wavelengths", grid.len());
    let tensor = Tensor::new(vec![Axis::Wavelength(grid)], values)
        .map_err(|e| FormatError::new(FormatErrorKind::OverLimit, NAME, e.to_string()))?;
    let samples = Samples::OnAxes { tensor, sampling: Sampling::default() };
    Ok(Acquisition {
        format: NAME,
        dialect,
        quantity,
        unit,
        samples,
        spectral_factor: None,
        instrument: Instrument::default(),
        report,
    })
}

/// Returns the quantity and unit of a TM-27 file from the text of its element `SpectralQuantity`; all units are
/// densities per nm except ratios.
fn meaning(
    stated: Option<&str>,
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<(Quantity, Unit), FormatError> {
    let name = stated.unwrap_or_default().to_lowercase();
    let (quantity, unit) = match name.as_str() {
        "reflectance" | "transmittance" | "r-factor" | "t-factor" => (Quantity::Reflectance, Unit::One),
        "intensity" => (Quantity::Spectrum, Unit::WattPerSteradianNanometre),
        "relative" => (Quantity::Spectrum, Unit::Relative),
        _ => {
            report.note(match stated {
                None => SpectrumNote::SpectralQuantityNotStated,
                Some(stated) => SpectrumNote::SpectralQuantityUnknown { stated: Quoted::of(stated) },
            });
            (Quantity::Spectrum, Unit::Relative)
        }
    };
    match how.quantity() {
        None => Ok((quantity, how.unit.unwrap_or(unit))),
        Some(asked @ (Quantity::Spectrum | Quantity::Reflectance)) => {
            if asked != quantity {
                report.note(SpectrumNote::QuantityAsAsked { asked: asked.to_string(), held: quantity.to_string() });
            }
            let unit = if asked == quantity { unit } else { asked.default_unit() };
            Ok((asked, how.unit.unwrap_or(unit)))
        }
        Some(other) => Err(FormatError::new(
            FormatErrorKind::NeedsOption,
            NAME,
            format!("quantity {other} was asked for, expected spectrum or reflectance: the file holds one spectrum"),
        )),
    }
}

/// Point of a spectrum: a wavelength in nm and the value there, with the byte offset of its XML element in the file.
struct Point {
    wavelength: f64,
    value: f32,
    offset: usize,
}

/// Sorts the points of a spectrum by increasing wavelength and refuses repeated wavelengths.
fn ordered(
    mut points: Vec<Point>,
    source: &Source,
    report: &mut ParseReport,
) -> Result<(Vec<f64>, Vec<f32>), FormatError> {
    if !points.is_sorted_by(|a, b| a.wavelength < b.wavelength) {
        points.sort_by(|a, b| a.wavelength.total_cmp(&b.wavelength));
        report.note(SpectrumNote::WavelengthsSorted);
    }
    if let Some([_, twice]) = points.array_windows().find(|[a, b]| a.wavelength == b.wavelength) {
        let message = format!("wavelength {} twice, expected each once", Brief(twice.wavelength));
        return Err(source.malformed(twice.offset, message));
    }
    Ok(points.into_iter().map(|point| (point.wavelength, point.value)).unzip())
}

/// Parser state of a TM-27 document: the parts that were read so far.
struct Document<'a> {
    source: &'a Source,
    /// XML elements that are open at the parser's position, by local name, each with its text so far.
    stack: Vec<Open>,
    quantity: Option<String>,
    points: Vec<Point>,
    fields: Vec<(String, String)>,
    distributions: usize,
    rooted: bool,
    /// String buffer that is reused for the text of XML elements.
    spare: String,
}

/// Name of the XML element that holds one value of the spectrum.
const DATA: &str = "SpectralData";

/// XML element that is not closed yet.
struct Open {
    /// Name of an open XML element without its namespace prefix; left empty for a `SpectralData` element, which is
    /// recognised by its wavelength.
    name: String,
    text: String,
    /// Wavelength in nm of the value in a `SpectralData` element; `None` for other elements.
    wavelength: Option<f64>,
    offset: usize,
}

impl<'a> Document<'a> {
    fn new(source: &'a Source) -> Self {
        Self {
            source,
            stack: Vec::new(),
            quantity: None,
            points: Vec::new(),
            fields: Vec::new(),
            distributions: 0,
            rooted: false,
            spare: String::new(),
        }
    }

    fn malformed(&self, offset: usize, message: impl Into<String>) -> FormatError {
        self.source.malformed(offset, message)
    }

    fn read(&mut self) -> Result<(), FormatError> {
        let mut xml = quick_xml::Reader::from_str(self.source.text());
        loop {
            let offset = usize::try_from(xml.buffer_position()).unwrap_or(usize::MAX);
            let event = xml.read_event().map_err(|error| {
                let at = usize::try_from(xml.error_position()).unwrap_or(offset);
                let message: String = error.to_string().chars().take(120).collect();
                self.malformed(at, format!("XML that is not well formed, expected elements that end: {message}"))
            })?;
            match event {
                Event::Start(element) => self.open(&element, offset)?,
                Event::Empty(element) => {
                    self.open(&element, offset)?;
                    self.close()?;
                }
                Event::End(_) => self.close()?,
                Event::Text(text) => self.text(&text, offset)?,
                Event::CData(text) => self.text(&text, offset)?,
                Event::GeneralRef(reference) => {
                    let character = reference.resolve_char_ref().ok().flatten();
                    let known = character
                        .map(String::from)
                        .or_else(|| quick_xml::escape::resolve_predefined_entity(&reference).map(str::to_owned));
                    let Some(known) = known else {
                        let message =
                            format!("entity {}, expected amp, lt, gt, quot, apos or a number", snippet(&reference));
                        return Err(self.malformed(offset, message));
                    };
                    self.text(&known, offset)?;
                }
                Event::DocType(_) => {
                    let message = "a document type, expected none: it can name other files";
                    return Err(self.source.error(FormatErrorKind::Unsupported, offset, message));
                }
                Event::Decl(_) | Event::PI(_) | Event::Comment(_) => {}
                Event::Eof => break,
            }
        }
        match self.stack.last() {
            None if self.rooted => Ok(()),
            None => Err(self.malformed(0, format!("no element, expected {ROOT}14"))),
            Some(open) => {
                let name = if open.wavelength.is_some() { DATA } else { &open.name };
                let message = format!("the file ends inside the element {}, expected its end", snippet(name));
                Err(self.malformed(self.source.text().len(), message))
            }
        }
    }

    fn open(&mut self, element: &BytesStart<'_>, offset: usize) -> Result<(), FormatError> {
        let name = element.local_name();
        let name = name.as_ref();
        if self.stack.is_empty() {
            if self.rooted || !name.starts_with(ROOT) {
                let message = format!("the element {}, expected one {ROOT}14", snippet(name));
                return Err(self.malformed(offset, message));
            }
            self.rooted = true;
        }
        if self.stack.len() >= MAX_DEPTH {
            let message =
                format!("an XML element inside {MAX_DEPTH} others, expected at most {MAX_DEPTH} nested elements");
            return Err(self.source.error(FormatErrorKind::OverLimit, offset, message));
        }
        let mut wavelength = None;
        if name == "SpectralDistribution" {
            self.distributions += 1;
            if self.distributions > 1 {
                let message = "a second SpectralDistribution, expected one";
                return Err(self.source.error(FormatErrorKind::Unsupported, offset, message));
            }
        } else if name == DATA {
            let attribute = element.try_get_attribute("wavelength").ok().flatten();
            let written = attribute.as_ref().and_then(|a| a.normalized_value(XmlVersion::Implicit1_0).ok());
            let written = written.unwrap_or_default();
            wavelength = number(written.trim()).filter(|&nm| nm > 0.0);
            if wavelength.is_none() {
                let message = format!("wavelength {}, expected a positive number of nm", snippet(&written));
                return Err(self.malformed(offset, message));
            }
        }
        let name = if wavelength.is_some() { String::new() } else { name.to_owned() };
        self.stack.push(Open { name, text: std::mem::take(&mut self.spare), wavelength, offset });
        Ok(())
    }

    fn text(&mut self, text: &str, offset: usize) -> Result<(), FormatError> {
        let over = match self.stack.last_mut() {
            // Metadata are truncated; a number is never this long.
            Some(open) if open.text.len() + text.len() <= MAX_TEXT => {
                open.text.push_str(text);
                false
            }
            Some(open) => open.wavelength.is_some(),
            None => !text.trim().is_empty(),
        };
        if over {
            Err(self.malformed(offset, format!("found {}, expected an element", snippet(text.trim()))))
        } else {
            Ok(())
        }
    }

    fn close(&mut self) -> Result<(), FormatError> {
        let Some(Open { name, text: mut written, wavelength, offset }) = self.stack.pop() else { return Ok(()) };
        let text = written.trim();
        if let Some(wavelength) = wavelength {
            let value = number(text).map(|value| value as f32).filter(|value| value.is_finite());
            let value = value.ok_or_else(|| {
                self.malformed(offset, format!("found {}, expected a value at {} nm", snippet(text), Brief(wavelength)))
            })?;
            if self.points.len() >= MAX_WAVELENGTHS {
                let message = format!("more than {MAX_WAVELENGTHS} wavelengths");
                return Err(self.source.error(FormatErrorKind::OverLimit, offset, message));
            }
            self.points.push(Point { wavelength, value, offset });
        } else if !text.is_empty() && self.fields.len() < MAX_FIELDS {
            if name == "SpectralQuantity" {
                self.quantity = Some(text.to_owned());
            }
            self.fields.push((name.chars().take(80).collect(), text.to_owned()));
        }
        written.clear();
        self.spare = written;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document(quantity: &str, data: &str) -> String {
        format!(
            "<?xml version=\"1.0\"?>\n<IESTM2714 xmlns=\"iestm2714\" version=\"1.0\"><Header><Manufacturer>A &amp; B</Manufacturer>\
             </Header><SpectralDistribution><SpectralQuantity>{quantity}</SpectralQuantity>{data}</SpectralDistribution></IESTM2714>"
        )
    }

    fn datum(wavelength: &str, value: &str) -> String {
        format!("<SpectralData wavelength=\"{wavelength}\">{value}</SpectralData>\n")
    }

    fn plain(text: &str) -> Result<Acquisition, FormatError> {
        crate::formats::read(text.as_bytes(), &Interpretation::default())
    }

    fn spectrum(acquisition: &Acquisition) -> (Vec<f64>, Vec<f32>) {
        let Samples::OnAxes { tensor, .. } = &acquisition.samples else { panic!("on axes") };
        let [Axis::Wavelength(grid)] = tensor.axes() else { panic!("wavelengths") };
        (grid.values(), tensor.samples().to_vec())
    }

    #[test]
    fn wavelengths_and_values_stay_together() {
        let data = [datum("403.1", "0.037"), datum(" 405.5 ", " 1e-2 "), datum("400", "<![CDATA[2]]>")].concat();
        let read = plain(&document("relative", &data)).unwrap();
        assert_eq!(spectrum(&read), (vec![400.0, 403.1, 405.5], vec![2.0, 0.037, 0.01]));
        assert_eq!((read.quantity, read.unit), (Quantity::Spectrum, Unit::Relative));
        assert_eq!(read.report.metadata[0], ("Manufacturer".to_owned(), "A & B".to_owned()));
        assert!(read.report.notes.iter().any(|note| note.message.contains("sorted")));
        let prefixed = document("relative", &data).replace("<Spec", "<t:Spec").replace("</Spec", "</t:Spec");
        let prefixed = prefixed.replace("IESTM2714 xmlns=", "t:IESTM2714 xmlns:t=").replace("</IES", "</t:IES");
        assert_eq!(spectrum(&plain(&prefixed).unwrap()), spectrum(&read));
    }

    #[test]
    fn quantities_are_told_apart() {
        for (name, quantity, unit) in [
            ("Transmittance", Quantity::Reflectance, Unit::One),
            ("R-Factor", Quantity::Reflectance, Unit::One),
            ("intensity", Quantity::Spectrum, Unit::WattPerSteradianNanometre),
            ("irradiance", Quantity::Spectrum, Unit::Relative),
        ] {
            let read = plain(&document(name, &datum("500", "0.5"))).unwrap();
            assert_eq!((read.quantity, read.unit), (quantity, unit));
        }
        let how = Interpretation { quantity: Some(Quantity::Edf.into()), ..Interpretation::default() };
        let text = document("relative", &datum("500", "0.5"));
        assert_eq!(crate::formats::read(text.as_bytes(), &how).unwrap_err().kind, FormatErrorKind::NeedsOption);
    }

    #[test]
    fn refusals_say_where_and_what() {
        use FormatErrorKind::{Malformed, OverLimit, Unsupported};
        let good = document("relative", &datum("500", "0.5"));
        for (text, kind, word) in [
            (document("relative", ""), Malformed, "no element SpectralData"),
            (document("relative", &datum("500", "")), Malformed, "expected a value at 500 nm"),
            (document("relative", &datum("500", "NaN")), Malformed, "found `NaN`"),
            (document("relative", &datum("500", "1e39")), Malformed, "found `1e39`"),
            (document("relative", &datum("-1", "1")), Malformed, "wavelength `-1`"),
            (document("relative", "<SpectralData>1</SpectralData>"), Malformed, "wavelength nothing"),
            (document("relative", "<SpectralData wavelength=\"500\"/>"), Malformed, "found nothing"),
            (document("relative", &datum("500", "1").repeat(2)), Malformed, "500 twice"),
            (document("&lol;", &datum("500", "1")), Malformed, "entity `lol`"),
            (document("relative", &datum("500", &"1".repeat(5000))), Malformed, "expected an element"),
            (good.replace("</SpectralQuantity>", "</Spectral>"), Malformed, "not well formed"),
            (good.replace("?>", "?><!DOCTYPE IESTM2714 SYSTEM \"x.dtd\">"), Unsupported, "document type"),
            (document("relative", "</SpectralDistribution><SpectralDistribution>"), Unsupported, "a second"),
            (document("relative", &format!("{}{}", "<a>".repeat(20), "</a>".repeat(20))), OverLimit, "nested elements"),
            (format!("{good}<IESTM2714/>"), Malformed, "expected one"),
        ] {
            let error = plain(&text).unwrap_err();
            assert_eq!((error.kind, error.format), (kind, NAME), "{error}");
            assert!(error.position.is_some() && error.message.contains(word), "{word}: {error}");
        }
        let many: String = (0..=MAX_WAVELENGTHS).map(|i| datum(&format!("{}", 1 + i), "1")).collect();
        assert_eq!(plain(&document("relative", &many)).unwrap_err().kind, OverLimit);
    }

    #[test]
    fn no_length_and_no_field_makes_it_panic() {
        let text = document("relative", &[datum("500", "0.5"), datum("501", "0.6")].concat());
        for cut in 0..text.len() {
            assert!(plain(&text[..cut]).is_err(), "cut at {cut}");
        }
        for hostile in ["NaN", "-1", "9223372036854775808", "&#0;", "&#x110000;", "<", "\"", "]]>"] {
            for field in ["500", "0.5", "relative", "iestm2714", "SpectralData", "1.0"] {
                let _ = plain(&text.replacen(field, hostile, 1));
            }
        }
    }
}
