//! Spectra of Ansys Speos (`.spectrum`): a title line, a remark, the number of rows, then a wavelength in nm and a
//! percentage in each.

use super::acquisition::{Acquisition, ParseReport};
use super::error::{FormatError, FormatErrorKind};
use super::interpretation::Interpretation;
use super::reader::{Format, Reader, Sample};
use super::spectra::{Spectra, other_quantity};
use super::spectral_table::order;
use super::spectral_table::table::Table;
use super::stated::StatedQuantity;
use super::text::{Source, Token, Tokens, is_text, snippet};
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::notes::SpectrumNote;

const NAME: &str = "speos";

pub(super) const READER: Reader = Reader {
    about: Format {
        name: NAME,
        description: "spectrum of Ansys Speos, formerly OPTIS (.spectrum)",
        extensions: &["spectrum"],
        reads: true,
        writes: false,
    },
    options: &[],
    probe: |sample: &Sample<'_>| if sample.head.starts_with(TITLE) { 100 } else { 0 },
    read,
};

/// Beginning of the title line; some files misspell the rest of it.
const TITLE: &str = "OPTIS - Spectrum";

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    if !is_text(source.text()) {
        let message = "a spectrum that is not text (encrypted, or a later version), expected version 1 as text: export \
                       the spectrum without encryption";
        return Err(FormatError::new(FormatErrorKind::Unsupported, NAME, message));
    }
    report.note_encoding(&source);
    let mut lines = source.lines();
    let title = lines.next().map_or("", |line| line.text);
    report.metadata.push(("title".to_owned(), shortened(title)));
    let remark = lines.next().map_or("", |line| line.text.trim());
    if !remark.is_empty() {
        report.metadata.push(("remark".to_owned(), shortened(remark)));
    }
    let mut lines = lines.filter(|line| !line.text.trim().is_empty());
    let end = Token { text: "", offset: source.text().len() };
    let count = count(&source, lines.next().unwrap_or(end))?;
    let (quantity, of) = match how.quantity {
        None | Some(StatedQuantity::Spectrum) => {
            report.note(SpectrumNote::PercentOfWhole);
            (StatedQuantity::Spectrum, 1.0)
        }
        Some(StatedQuantity::Reflectance) => {
            report.note(SpectrumNote::PercentAsAsked);
            (StatedQuantity::Reflectance, 100.0)
        }
        Some(other) => return Err(other_quantity(other, "spectrum or reflectance: the file holds one spectrum", NAME)),
    };
    let (mut wavelengths, mut values) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for row in 0..count {
        let line = lines.next().unwrap_or(end);
        let mut numbers = Tokens::new(line.text, 0);
        let pair = numbers.plain_number().zip(numbers.plain_number());
        let is_pair = |((nm, _), (value, _)): &((f64, usize), (f64, usize))| *nm > 0.0 && (*value as f32).is_finite();
        let pair = pair.filter(is_pair).filter(|_| numbers.next().is_none());
        let ((nm, _), (value, _)) = pair.ok_or_else(|| {
            let (found, row) = (snippet(line.text), row + 1);
            let message =
                format!("found {found}, expected row {row} of {count}: a wavelength in nm and a value in percent");
            source.malformed(line.offset, message)
        })?;
        wavelengths.push((nm, line.offset));
        values.push((value / of) as f32);
    }
    if let Some(line) = lines.next() {
        let message = format!("found {}, expected the end after {count} rows", snippet(line.text));
        return Err(source.malformed(line.offset, message));
    }
    let mut table = Table::of_columns(vec!["value".to_owned()], wavelengths, values, NAME);
    order::restore(&mut table, None, true, &source, &mut report)?;
    let dialect = format!("version 1, {} wavelengths", table.wavelengths.len());
    Spectra::of_table(table, &source, NAME, dialect, quantity)?.acquisition(how, report)
}

/// Returns the number of rows that the third line states.
fn count(source: &Source, line: Token<'_>) -> Result<usize, FormatError> {
    match line.text.trim().parse::<usize>() {
        Ok(count @ 1..=MAX_WAVELENGTHS) => Ok(count),
        Ok(0) | Err(_) => {
            let message = format!("found {}, expected the number of wavelengths, 1 or more", snippet(line.text.trim()));
            Err(source.malformed(line.offset, message))
        }
        Ok(count) => {
            let message = format!("{count} wavelengths, expected at most {MAX_WAVELENGTHS}");
            Err(source.error(FormatErrorKind::OverLimit, line.offset, message))
        }
    }
}

fn shortened(text: &str) -> String {
    text.trim().chars().take(4096).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Quantity, Unit};
    use crate::formats::{Samples, read as read_any};

    fn plain(text: &str) -> Result<Acquisition, FormatError> {
        read_any(text.as_bytes(), &Interpretation::default())
    }

    fn values(found: &Acquisition) -> Vec<f32> {
        let Samples::OnAxes { tensor, .. } = &found.samples else { panic!("on axes") };
        tensor.samples().to_vec()
    }

    #[test]
    fn percent_stays_unless_a_reflectance_is_asked_for() {
        let text = "OPTIS - Spectrum fie v1.0\r\n\r\n3\r\n500\t25\r\n400\t50.5 \r\n\r\n600 1e1\r\n";
        let found = plain(text).unwrap();
        assert_eq!((found.format, found.quantity, found.unit), (NAME, Quantity::Spectrum, Unit::Relative));
        assert_eq!(values(&found), [50.5, 25.0, 10.0]);
        let how = Interpretation { quantity: Some(StatedQuantity::Reflectance), ..Interpretation::default() };
        let found = read_any(text.as_bytes(), &how).unwrap();
        assert_eq!((found.quantity, found.unit), (Quantity::Reflectance, Unit::One));
        assert_eq!(values(&found), [0.505, 0.25, 0.1]);
    }

    #[test]
    fn refusals_say_where_and_what() {
        use FormatErrorKind::{Malformed, NeedsOption, OverLimit, Unsupported};
        let title = "OPTIS - Spectrum file v1.0\nx\n";
        for (text, kind, words) in [
            (title.to_owned(), Malformed, "found nothing, expected the number of wavelengths"),
            (format!("{title}400\t1\n"), Malformed, "line 3, column 1: found `400\u{fffd}1`, expected the number"),
            (format!("{title}0\n"), Malformed, "1 or more"),
            (format!("{title}99999999\n"), OverLimit, "99999999 wavelengths"),
            (format!("{title}2\n400\t1\n"), Malformed, "expected row 2 of 2"),
            (
                format!("{title}1\n400\t1\n410\t1\n"),
                Malformed,
                "line 5, column 1: found `410\u{fffd}1`, expected the end",
            ),
            (format!("{title}1\n400\t1\t2\n"), Malformed, "a wavelength in nm and a value"),
            (format!("{title}1\n-400\t1\n"), Malformed, "a wavelength in nm and a value"),
            (format!("{title}1\n400\t1e39\n"), Malformed, "a wavelength in nm and a value"),
            (format!("{title}2\n400\t1\n400\t2\n"), Malformed, "400 twice"),
            (format!("{title}\u{1}\u{2}"), Unsupported, "encrypted"),
        ] {
            let error = plain(&text).unwrap_err();
            assert_eq!(error.kind, kind, "{error}");
            assert!(error.to_string().contains(words), "{words}: {error}");
        }
        let how = Interpretation { quantity: Some(StatedQuantity::Edf), ..Interpretation::default() };
        assert_eq!(read_any(format!("{title}1\n400\t1\n").as_bytes(), &how).unwrap_err().kind, NeedsOption);
    }
}
