//! Signature files of Spectra Vista's field spectrometers (`.sig`): lines `key= value`, then after `data=` a
//! wavelength, the signals of the white reference and of the target, and their ratio in percent.
//!
//! The ranges of the three detectors overlap in most files; they are joined by the rule of the option `overlap`.

use super::acquisition::{Acquisition, ParseReport};
use super::error::{FormatError, FormatErrorKind};
use super::interpretation::Interpretation;
use super::reader::{FACTOR, Format, Reader, Sample};
use super::spectra::{Spectra, other_quantity};
use super::spectral_table::order;
use super::spectral_table::table::{Table, position};
use super::stated::StatedQuantity;
use super::text::{Lines, Source, Token, is_text, snippet};
use super::text_table::cells::{Content, Delimiter};
use crate::domain::Quantity;
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::notes::{SpectrumNote, TextNote};

const NAME: &str = "svc";

pub(super) const READER: Reader = Reader {
    about: Format {
        name: NAME,
        description: "signature file of a Spectra Vista or GER field spectrometer (.sig)",
        extensions: &["sig"],
        reads: true,
        writes: false,
    },
    options: &["column", "overlap", FACTOR],
    probe: |sample: &Sample<'_>| {
        let head = sample.head.trim_start();
        if is_text(head) && TITLES.iter().any(|title| head.starts_with(title)) { 100 } else { 0 }
    },
    read,
};

/// Beginnings of the first line: of today's files, and of those of the earlier maker.
const TITLES: [&str; 2] = ["/*** Spectra Vista", "///GER SIGNATUR FILE"];
/// Names of the columns after the wavelength, in the order of the file.
const COLUMNS: [&str; 3] = ["reference", "target", "reflectance"];
/// Position of the ratio of target and reference among the columns.
const REFLECTANCE: usize = 2;
/// Upper bound on the header lines that are kept as metadata. Raising it keeps more.
const MAX_FIELDS: usize = 1000;

/// Content of the columns of the white reference and of the target, as the header states it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Signal {
    Counts,
    Radiance,
    Irradiance,
    Unstated,
}

impl Signal {
    fn of(words: &str) -> Self {
        match words.trim().to_lowercase().as_str() {
            "counts" | "dn" => Self::Counts,
            "radiance" => Self::Radiance,
            "irradiance" => Self::Irradiance,
            _ => Self::Unstated,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Counts => "counts",
            Self::Radiance => "radiance",
            Self::Irradiance => "irradiance",
            Self::Unstated => "a signal in a unit that is not stated",
        }
    }

    fn note(self) -> SpectrumNote {
        match self {
            Self::Counts => SpectrumNote::SignalKept,
            Self::Radiance => SpectrumNote::LightKept { what: "radiance in units of 1e-10 W/cm²/nm/sr" },
            Self::Irradiance => SpectrumNote::LightKept { what: "irradiance in units of 1e-10 W/cm²/nm" },
            Self::Unstated => SpectrumNote::QuantityNotStated,
        }
    }
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    report.note_encoding(&source);
    let mut lines = source.lines();
    header(&source, &mut lines, &mut report)?;
    let field = |key: &str| report.metadata.iter().find(|(found, _)| found == key).map(|(_, value)| value.clone());
    let units = field("units").unwrap_or_default();
    let instrument = field("instrument").unwrap_or_default();
    let mut signals = units.split(',').map(Signal::of);
    let signals = [(); 2].map(|()| signals.next().unwrap_or(Signal::Unstated));
    let column = column(how, signals)?;
    let quantity = quantity(column, signals, how, &mut report)?;
    let mut table = rows(&source, lines, column)?;
    order::restore(&mut table, how.overlap, true, &source, &mut report)?;
    let model = instrument.rsplit_once('(').and_then(|(_, model)| model.split(')').next()).unwrap_or("signature");
    let model: String = model.chars().take(40).collect();
    let dialect = format!("{model}, {} wavelengths, column {}", table.wavelengths.len(), COLUMNS[column]);
    Spectra::of_table(table, &source, NAME, dialect, quantity)?.acquisition(how, report)
}

/// Keeps the lines `key= value` of the header as metadata, up to the line `data=`.
fn header(source: &Source, lines: &mut Lines<'_>, report: &mut ParseReport) -> Result<(), FormatError> {
    let mut skipped = 0;
    for line in lines.skip_while(|line| line.text.trim().is_empty()).skip(1) {
        let Some((key, value)) = line.text.split_once('=') else {
            skipped += usize::from(!line.text.trim().is_empty());
            continue;
        };
        let (key, value) = (key.trim().to_lowercase(), value.trim());
        if key == "data" && value.is_empty() {
            if skipped > 0 {
                report.note(TextNote::LinesBeforeData { lines: skipped });
            }
            return Ok(());
        }
        if !value.is_empty() && report.metadata.len() < MAX_FIELDS {
            report.metadata.push((key.chars().take(80).collect(), value.chars().take(4096).collect()));
        }
    }
    Err(source.malformed(source.text().len(), "no line `data=`, expected it before the wavelengths"))
}

/// Returns the position of the column that is read: the one asked for, else the reflectance.
fn column(how: &Interpretation, signals: [Signal; 2]) -> Result<usize, FormatError> {
    if let Some(column) = &how.column {
        let names = COLUMNS.map(str::to_owned);
        return position(&names, column).map_err(|error| FormatError { format: NAME, ..error });
    }
    let needs = |message: String| Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
    let held = format!("1 `reference` ({}), 2 `target` ({})", signals[0].name(), signals[1].name());
    if how.quantity == Some(StatedQuantity::Spectrum) {
        return needs(format!("a spectrum was asked for, expected the column of one (column): {held}"));
    }
    if signals[0] != signals[1] {
        return needs(format!(
            "the white reference and the target are in two units, so that their ratio is no reflectance; expected the column \
             to read (column): {held}, 3 `reflectance` (their ratio in percent)"
        ));
    }
    Ok(REFLECTANCE)
}

/// Returns the quantity of a column, and notes what is assumed of it.
fn quantity(
    column: usize,
    signals: [Signal; 2],
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<StatedQuantity, FormatError> {
    use StatedQuantity::{Reflectance, ReflectanceFactor, Spectrum};
    if let Some(signal) = signals.get(column) {
        return match how.quantity {
            None | Some(Spectrum) => {
                report.note(signal.note());
                Ok(Spectrum)
            }
            Some(other) => {
                let expected = format!("spectrum: the column {} holds {}", COLUMNS[column], signal.name());
                Err(other_quantity(other, &expected, NAME))
            }
        };
    }
    let quantity = match how.quantity {
        None | Some(Reflectance) => Reflectance,
        Some(ReflectanceFactor) => ReflectanceFactor,
        Some(Spectrum) => Spectrum,
        Some(other) => {
            let expected = "reflectance, reflectance-factor or spectrum: the column holds one spectrum of reflectance";
            return Err(other_quantity(other, expected, NAME));
        }
    };
    if how.column.is_none() {
        report.note(SpectrumNote::ColumnsLeftOut { columns: COLUMNS[..REFLECTANCE].join(", ") });
    }
    report.note(SpectrumNote::RelativeToPanel);
    match (quantity, how.quantity) {
        (Reflectance, None) => report.note(SpectrumNote::FactorsKept),
        (ReflectanceFactor, _) => report.note(SpectrumNote::FactorsAsAsked),
        (Spectrum, _) => {
            let (asked, held) = (Quantity::Spectrum.to_string(), Quantity::Reflectance.to_string());
            report.note(SpectrumNote::QuantityAsAsked { asked, held });
        }
        _ => {}
    }
    Ok(quantity)
}

/// Reads the rows after the header: a wavelength in nm and three values, of which one column is kept, the reflectance
/// as a fraction.
fn rows(source: &Source, lines: Lines<'_>, column: usize) -> Result<Table, FormatError> {
    let (mut wavelengths, mut values) = (Vec::new(), Vec::new());
    for line in lines.filter(|line| !line.text.trim().is_empty()) {
        let cells = Delimiter::Blank.cells(line);
        let found = |expected: String, token: Token<'_>| {
            source.malformed(token.offset, format!("found {}, expected {expected}", snippet(token.text.trim())))
        };
        if cells.len() != 1 + COLUMNS.len() {
            let message = format!("{} numbers, a wavelength, {}", 1 + COLUMNS.len(), COLUMNS.join(", "));
            return Err(found(message, line));
        }
        let nm = Delimiter::Blank.number(cells[0].text).filter(|nm| *nm > 0.0);
        let nm = nm.ok_or_else(|| found("a wavelength in nm".to_owned(), cells[0]))?;
        let cell = cells[1 + column];
        let of = if column == REFLECTANCE { 100.0 } else { 1.0 };
        let value = value(cell.text, of).ok_or_else(|| found(format!("the {} at {nm} nm", COLUMNS[column]), cell))?;
        if wavelengths.len() >= MAX_WAVELENGTHS {
            let message = format!("more than {MAX_WAVELENGTHS} wavelengths");
            return Err(source.error(FormatErrorKind::OverLimit, line.offset, message));
        }
        wavelengths.push((nm, line.offset));
        values.push(value);
    }
    if wavelengths.is_empty() {
        return Err(source.malformed(source.text().len(), "no row after `data=`, expected wavelengths and values"));
    }
    Ok(Table::of_columns(vec![COLUMNS[column].to_owned()], wavelengths, values, NAME))
}

/// Returns the value in a cell divided by `of`, NaN where a division by zero was written.
fn value(cell: &str, of: f64) -> Option<f32> {
    match Delimiter::Blank.content(cell) {
        Content::Number(value) => Some((value / of) as f32).filter(|value| value.is_finite()),
        Content::Missing => Some(f32::NAN),
        Content::Text => {
            let unsigned = cell.trim_start_matches(['-', '+']).to_lowercase();
            ["inf", "infinity", "1.#inf", "∞"].contains(&unsigned.as_str()).then_some(f32::NAN)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Axis, Unit};
    use crate::formats::{Overlap, Samples, read as read_any};

    fn file(units: &str, rows: &str) -> String {
        format!(
            "/*** Spectra Vista SIG Data ***/\nname= a.sig\ninstrument= HI: 1 (HR-1024i)\nunits= {units}\ncomm= \ndata= \n{rows}"
        )
    }

    fn read_as(text: &str, how: &Interpretation) -> Result<Acquisition, FormatError> {
        read_any(text.as_bytes(), how)
    }

    fn pairs(found: &Acquisition) -> Vec<(f64, f32)> {
        let Samples::OnAxes { tensor, .. } = &found.samples else { panic!("on axes") };
        let [Axis::Wavelength(grid)] = tensor.axes() else { panic!("one axis") };
        grid.values().into_iter().zip(tensor.samples().iter().copied()).collect()
    }

    fn of_column(column: &str) -> Interpretation {
        Interpretation { column: Some(column.to_owned()), ..Interpretation::default() }
    }

    const ROWS: &str = "400.5  1000.00  250.00  25.00\n401.9  2000.00  1500.00  75.00\n";

    #[test]
    fn the_reflectance_is_read_unless_another_column_is_asked_for() {
        let text = file("Radiance, Radiance", ROWS);
        let found = read_as(&text, &Interpretation::default()).unwrap();
        assert_eq!((found.format, found.quantity, found.unit), (NAME, Quantity::Reflectance, Unit::One));
        assert_eq!(found.dialect, "HR-1024i, 2 wavelengths, column reflectance");
        assert_eq!(pairs(&found), [(400.5, 0.25), (401.9, 0.75)]);
        for (column, values, words) in [
            ("target", [250.0, 1500.0], "radiance in units of 1e-10 W/cm²/nm/sr"),
            ("1", [1000.0, 2000.0], "radiance in units of 1e-10 W/cm²/nm/sr"),
        ] {
            let found = read_as(&text, &of_column(column)).unwrap();
            assert_eq!((found.quantity, found.unit), (Quantity::Spectrum, Unit::Relative));
            assert_eq!(pairs(&found).iter().map(|(_, value)| *value).collect::<Vec<_>>(), values);
            assert!(found.report.notes.iter().any(|note| note.message.contains(words)), "{words}");
        }
        let counts = read_as(&file("Counts, Counts", ROWS), &of_column("target")).unwrap();
        assert!(counts.report.notes.iter().any(|note| note.message.contains("raw signal")));
        let how = Interpretation { quantity: Some(StatedQuantity::ReflectanceFactor), ..Interpretation::default() };
        let factor = read_as(&text, &how).unwrap();
        assert_eq!((factor.quantity, pairs(&factor)[0].1), (Quantity::Brdf, 0.079_577_47));
        let kept = Interpretation { quantity: Some(StatedQuantity::Spectrum), ..of_column("reflectance") };
        assert_eq!(pairs(&read_as(&text, &kept).unwrap())[0].1, 0.25);
        // Lines of others in the header, a decimal comma, divisions by zero, and the earlier maker's title.
        let odd = file("Radiance, Radiance", "400,5 0 1 1.#INF\n401,9 2 1 50,5\n403 2 -1 -1.#IND\n")
            .replace("comm= ", "ADDED\n\nADDED")
            .replace("/*** Spectra Vista SIG Data ***/", "///GER SIGNATUR FILE///");
        let odd = pairs(&read_as(&odd, &Interpretation::default()).unwrap());
        assert!(odd[0].1.is_nan() && odd[2].1.is_nan());
        assert_eq!((odd[1].0, odd[1].1), (401.9, 0.505));
    }

    #[test]
    fn ranges_of_three_detectors_are_joined_by_the_rule() {
        let row = |nm: u32, percent: u32| format!("{nm}.0  100.00  {percent}.00  {percent}.00\n");
        let range = |from: u32, step: u32, percent| (0..6).map(|i| row(from + i * step, percent)).collect::<String>();
        let text = file("Radiance, Radiance", &[range(900, 20, 10), range(960, 25, 20), range(1060, 20, 40)].concat());
        let joined =
            |overlap| pairs(&read_as(&text, &Interpretation { overlap, ..Interpretation::default() }).unwrap());
        let short = joined(None);
        assert_eq!(short, joined(Some(Overlap::Shorter)));
        let nm = |pairs: &[(f64, f32)]| pairs.iter().map(|(nm, _)| *nm).collect::<Vec<_>>();
        assert_eq!(
            nm(&short),
            [900.0, 920.0, 940.0, 960.0, 980.0, 1000.0, 1010.0, 1035.0, 1060.0, 1085.0, 1100.0, 1120.0, 1140.0, 1160.0]
        );
        assert_eq!((short[5].1, short[6].1, short[9].1, short[10].1), (0.1, 0.2, 0.2, 0.4));
        let long = joined(Some(Overlap::Longer));
        assert_eq!(
            nm(&long),
            [900.0, 920.0, 940.0, 960.0, 985.0, 1010.0, 1035.0, 1060.0, 1080.0, 1100.0, 1120.0, 1140.0, 1160.0]
        );
        assert_eq!((long[3].1, long[7].1), (0.2, 0.4));
        let mean = joined(Some(Overlap::Mean));
        assert_eq!((mean[3], mean[4]), ((960.0, 0.15), (980.0, 0.15)));
    }

    #[test]
    fn refusals_say_where_and_what() {
        use FormatErrorKind::{Malformed, NeedsOption, OverLimit};
        let plain = Interpretation::default();
        let as_quantity = |quantity| Interpretation { quantity: Some(quantity), ..plain.clone() };
        let good = file("Radiance, Radiance", ROWS);
        let many = (0..=MAX_WAVELENGTHS).map(|i| format!("{} 1 1 100\n", i + 1)).collect::<Vec<_>>().concat();
        for (text, how, kind, words) in [
            (good.replace("data= ", "date= 1"), plain.clone(), Malformed, "no line `data=`"),
            (file("Radiance, Radiance", ""), plain.clone(), Malformed, "no row after `data=`"),
            (good.replace("  75.00", ""), plain.clone(), Malformed, "line 8, column 1: found `401.9"),
            (
                good.replace("75.00", "x"),
                plain.clone(),
                Malformed,
                "line 8, column 26: found `x`, expected the reflectance",
            ),
            (good.replace("401.9", "-1"), plain.clone(), Malformed, "found `-1`, expected a wavelength in nm"),
            (good.replace("401.9", "400.5"), plain.clone(), Malformed, "400.5 twice"),
            (file("Counts, Counts", &many), plain.clone(), OverLimit, "more than 65536"),
            (file("Irradiance, Radiance", ROWS), plain.clone(), NeedsOption, "2 `target` (radiance)"),
            (good.clone(), as_quantity(StatedQuantity::Spectrum), NeedsOption, "1 `reference` (radiance)"),
            (good.clone(), as_quantity(StatedQuantity::Edf), NeedsOption, "quantity edf was asked for"),
            (good.clone(), of_column("4"), NeedsOption, "no column `4`"),
            (
                good.clone(),
                Interpretation { column: Some("target".to_owned()), ..as_quantity(StatedQuantity::Reflectance) },
                NeedsOption,
                "the column target holds radiance",
            ),
        ] {
            let error = read_as(&text, &how).unwrap_err();
            assert_eq!((error.kind, error.format), (kind, NAME), "{error}");
            assert!(error.to_string().contains(words), "{words}: {error}");
        }
    }
}
