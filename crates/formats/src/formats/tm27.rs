//! IES TM-27 spectra (`.spdx`): one spectrum as XML, with one element per wavelength and value.
//!
//! Wavelengths are in nm (IES TM-27-14).

use super::acquisition::{Acquisition, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::foreign;
use super::instrument::Instrument;
use super::interpretation::Interpretation;
use super::reader::{Format, Reader, Sample};
use super::text::{Brief, Source, number, snippet};
use super::xml::{Element, Room, Root, Visitor, walk};
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::domain::{Axis, Quantity, Sampling, Tensor, Unit, WavelengthGrid};
use crate::notes::{Quoted, SpectrumNote};

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
/// Upper bounds on the bytes of text in an XML element, and on the number of header elements. Raising them keeps more
/// and uses more memory.
const MAX_TEXT: usize = 4096;
const MAX_FIELDS: usize = 1000;

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    report.note_encoding(&source);
    let mut document = Document {
        source: &source,
        quantity: None,
        points: Vec::new(),
        fields: Vec::new(),
        distributions: 0,
        wavelengths: Vec::new(),
    };
    let root = Root { is: |name| name.starts_with(ROOT), expected: "IESTM2714" };
    walk(&source, &root, &mut report, &mut document)?;
    let Document { quantity, points, fields, .. } = document;
    report.metadata = fields;
    if points.is_empty() {
        return Err(source.malformed(source.text().len(), "no element SpectralData, expected wavelengths and values"));
    }
    let (quantity, unit) = meaning(quantity.as_deref(), how, &mut report)?;
    let (wavelengths, values) = ordered(points, &source, &mut report)?;
    report.note_negative(&values);
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
pub(super) struct Point {
    pub(super) wavelength: f64,
    pub(super) value: f32,
    pub(super) offset: usize,
}

/// Sorts the points of a spectrum by increasing wavelength and refuses repeated wavelengths.
pub(super) fn ordered(
    mut points: Vec<Point>,
    source: &Source,
    report: &mut ParseReport,
) -> Result<(Vec<f64>, Vec<f32>), FormatError> {
    if !points.is_sorted_by(|a, b| a.wavelength <= b.wavelength) {
        points.sort_by(|a, b| a.wavelength.total_cmp(&b.wavelength));
        report.note(SpectrumNote::WavelengthsSorted);
    }
    let all = points.len();
    points.dedup_by(|a, b| a.wavelength == b.wavelength && a.value == b.value);
    if points.len() < all {
        report.note(SpectrumNote::RowsRepeated { rows: all - points.len() });
    }
    if let Some([_, twice]) = points.array_windows().find(|[a, b]| a.wavelength == b.wavelength) {
        let message = format!("wavelength {} twice, expected each once", Brief(twice.wavelength));
        return Err(source.malformed(twice.offset, message));
    }
    Ok(points.into_iter().map(|point| (point.wavelength, point.value)).unzip())
}

/// Name of the XML element that holds one value of the spectrum.
const DATA: &str = "SpectralData";

/// Parser state of a TM-27 document: the parts that were read so far.
struct Document<'a> {
    source: &'a Source,
    quantity: Option<String>,
    points: Vec<Point>,
    fields: Vec<(String, String)>,
    distributions: usize,
    /// Wavelengths in nm of the `SpectralData` elements that are open.
    wavelengths: Vec<f64>,
}

impl Visitor for Document<'_> {
    fn open(&mut self, element: &Element<'_>) -> Result<Room, FormatError> {
        if element.name == "SpectralDistribution" {
            self.distributions += 1;
            if self.distributions > 1 {
                let message = "a second SpectralDistribution, expected one";
                return Err(self.source.error(FormatErrorKind::Unsupported, element.offset, message));
            }
        }
        let is_datum = element.name == DATA;
        if is_datum {
            let written = element.attribute("wavelength").unwrap_or_default();
            let Some(wavelength) = number(written.trim()).filter(|&nm| nm > 0.0) else {
                let message = format!("wavelength {}, expected a positive number of nm", snippet(&written));
                return Err(self.source.malformed(element.offset, message));
            };
            self.wavelengths.push(wavelength);
        }
        // Metadata are truncated; a number is never this long.
        Ok(Room { bytes: MAX_TEXT, is_strict: is_datum })
    }

    fn close(&mut self, name: &str, text: &str, offset: usize) -> Result<(), FormatError> {
        if name == DATA
            && let Some(wavelength) = self.wavelengths.pop()
        {
            let value = number(text).map(|value| value as f32).filter(|value| value.is_finite());
            let value = value.ok_or_else(|| {
                let message = format!("found {}, expected a value at {} nm", snippet(text), Brief(wavelength));
                self.source.malformed(offset, message)
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
    fn a_line_of_a_tool_before_the_declaration_is_left_out() {
        let text = document("relative", &(datum("500", "2") + &datum("510", "3")));
        let noted = plain(&format!("Written by <x>, 2 files\r\n{text}")).unwrap();
        assert_eq!(spectrum(&noted), spectrum(&plain(&text).unwrap()));
        assert!(noted.report.notes.iter().any(|note| note.message == "1 line of text before the data"));
        // Places count it.
        let error = plain(&format!("Written by <x>\n{}", text.replace(">3<", ">x<"))).unwrap_err();
        assert!(error.to_string().contains("line 4"), "{error}");
    }

    #[test]
    fn wavelengths_and_values_stay_together() {
        let data = [datum("403.1", "0.037"), datum(" 405.5 ", " 1e-2 "), datum("400", "<![CDATA[2]]>")].concat();
        let read = plain(&document("relative", &data)).unwrap();
        assert_eq!(spectrum(&read), (vec![400.0, 403.1, 405.5], vec![2.0, 0.037, 0.01]));
        assert_eq!((read.quantity, read.unit), (Quantity::Spectrum, Unit::Relative));
        assert_eq!(read.report.metadata[0], ("Manufacturer".to_owned(), "A & B".to_owned()));
        assert!(read.report.notes.iter().any(|note| note.message.contains("sorted")));
        let behind = format!("Recover using: x\n{}", document("relative", &data));
        assert_eq!(spectrum(&plain(&behind).unwrap()), spectrum(&read));
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
            (document("relative", &(datum("500", "1") + &datum("500", "2"))), Malformed, "500 twice"),
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
