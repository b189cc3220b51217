//! Spectra with several pairs of wavelength and value per line, as renderers read them (`.spd` of pbrt).

use super::holds::Holds;
use super::table::Table;
use crate::formats::acquisition::ParseReport;
use crate::formats::text::{Source, Token, Tokens, number};
use crate::formats::text_table::lines::{contents, split_comment};

/// Plausible wavelengths in nm of spectra with several pairs of wavelength and value per line.
const PLAUSIBLE: std::ops::RangeInclusive<f64> = 150.0..=3000.0;

/// Pair of a spectrum: the wavelength in nm with the byte offset of its text, and the value at that wavelength.
type Pair = ((f64, usize), f32);

/// Returns the pairs of wavelength and value if every line has an even count of numbers, the first line at least four,
/// and wavelengths increase along and across lines. No other table has this form.
fn pairs<'a>(lines: impl Iterator<Item = Token<'a>>) -> Option<Vec<Pair>> {
    let mut pairs: Vec<Pair> = Vec::new();
    for line in lines {
        let before = pairs.len();
        let mut words = Tokens::new(line.text, 0);
        while let Some(word) = words.next() {
            let (wavelength, value) = (number(word.text)?, number(words.next()?.text)? as f32);
            let grows = pairs.last().is_none_or(|&((last, _), _)| last < wavelength);
            (PLAUSIBLE.contains(&wavelength) && grows && value.is_finite()).then_some(())?;
            pairs.push(((wavelength, line.offset + word.offset), value));
        }
        (pairs.len() >= before + if before == 0 { 2 } else { 1 }).then_some(())?;
    }
    (!pairs.is_empty()).then_some(pairs)
}

/// Returns true if every line of a text consists of pairs of wavelength and value, and the first line has two pairs or
/// more.
pub(in crate::formats) fn are_pairs<'a>(lines: impl Iterator<Item = Token<'a>>) -> bool {
    pairs(lines).is_some()
}

/// Returns the spectrum of a text of pairs of wavelength and value; `None` for any other text.
pub(super) fn read(source: &Source, report: &mut ParseReport) -> Option<Table> {
    let (wavelengths, values) = pairs(contents(source))?.into_iter().unzip();
    let mut prose = String::new();
    for comment in source.lines().filter_map(|line| split_comment(line).1) {
        prose.push_str(&comment.to_lowercase());
        prose.push('\n');
        if !comment.trim().is_empty() {
            report.metadata.push(("comment".to_owned(), comment.trim().chars().take(4096).collect()));
        }
    }
    let (names, dialect) = (vec!["1".to_owned()], "several pairs a line");
    let heading = String::new();
    let (holds, percent) = (vec![Holds::Unstated], vec![false]);
    let wavelength_name = None;
    Some(Table { wavelengths, values, names, holds, percent, wavelength_name, prose, heading, library: None, dialect })
}

#[cfg(test)]
mod tests {
    use crate::formats::{Interpretation, Samples, read};

    fn spectrum(text: &str) -> Option<(Vec<f64>, Vec<f32>)> {
        let acquisition = read(text.as_bytes(), &Interpretation::default()).ok()?;
        let Samples::OnAxes { tensor, .. } = acquisition.samples else { return None };
        let [crate::domain::Axis::Wavelength(grid)] = tensor.axes() else { return None };
        Some((grid.values(), tensor.samples().to_vec()))
    }

    #[test]
    fn several_pairs_a_line_are_one_spectrum() {
        let one = spectrum("# lamp\n400 1\n500 2\n600 3\n700 450\n");
        assert!(one.is_some());
        for text in
            ["# lamp\n400 1 500 2\n600 3 700 450\n", "400 1 500 2 600 3\n700 450\n", "400 1\t500 2 600 3 700 450"]
        {
            assert_eq!(spectrum(text), one, "{text}");
        }
    }

    #[test]
    fn columns_stay_columns() {
        for (text, columns) in [("400 1 2 3\n500 2 3 4\n", 3), ("400 1 6 3\n410 2 5 4\n", 3), ("400 1 2\n500 2 3\n", 2)]
        {
            let acquisition = read(text.as_bytes(), &Interpretation::default()).unwrap();
            assert!(acquisition.dialect.contains(&format!(", {columns} column")), "{}", acquisition.dialect);
        }
        // Either column can be wavelengths.
        let ambiguous = b"400 1 600 3\n410 5 590 4\n";
        let error = read(ambiguous, &Interpretation::default()).unwrap_err();
        assert!(error.to_string().contains("wavelength_column"), "{error}");
        let named = Interpretation { wavelength_column: Some("3".to_owned()), ..Default::default() };
        assert!(read(ambiguous, &named).unwrap().dialect.ends_with("3 columns"));
    }
}
