//! Place and form of the rows of numbers in a text: separator, number of cells, columns of text.

use super::cells::{Content, Delimiter};
use crate::formats::text::Token;
use std::cmp::Reverse;

/// Upper bound on the lines before the first row of numbers. Raising it reads files with longer headers.
pub(in crate::formats) const MAX_PREAMBLE: usize = 1000;
/// Largest number of rows from which the columns are judged. Raising it takes longer.
pub(in crate::formats) const ROWS_LOOKED_AT: usize = 200;
/// Number of cells from which no further rows are judged. Raising it takes longer for tables of many columns.
const CELLS_LOOKED_AT: usize = 20_000;
/// Number of rows of words and numbers that are a table without names above. Raising it refuses short tables.
const FEWEST_WITH_TEXT: usize = 3;
/// Number of rows after which a table is no longer mistaken for numbers in a header. Raising it takes longer.
const ENOUGH: usize = 20;

/// Place and form of the rows of numbers in a text.
#[derive(Clone, Debug)]
pub(in crate::formats) struct Layout {
    pub(in crate::formats) delimiter: Delimiter,
    /// Number of cells in each row.
    pub(in crate::formats) width: usize,
    /// For each column, true if its cells are text instead of numbers.
    pub(in crate::formats) is_text: Vec<bool>,
    /// Number of the lines, among those that were searched, before the first row.
    #[cfg(test)]
    pub(in crate::formats) before: usize,
    /// Byte offset of the first row.
    pub(in crate::formats) start: usize,
    /// First rows of the table, `[row][column]`; NaN for a missing value or text.
    pub(in crate::formats) sample: Vec<Vec<f64>>,
    /// For each column, true if its numbers have a percent sign.
    pub(in crate::formats) in_percent: Vec<bool>,
    /// True if numbers of the first rows have a decimal point.
    pub(in crate::formats) has_points: bool,
}

impl Layout {
    /// Returns the numbers of a column in the first rows, without missing ones.
    pub(in crate::formats) fn numbers(&self, column: usize) -> Vec<f64> {
        self.sample.iter().map(|row| row[column]).filter(|value| !value.is_nan()).collect()
    }

    /// Returns true for a column of 0, 1, 2 … or 1, 2, 3 …
    pub(in crate::formats) fn is_numbering(&self, column: usize) -> bool {
        self.counts(column) && matches!(self.sample[0][column], 0.0 | 1.0)
    }

    /// Returns true for a column of numbers that each exceed the one before by 1.
    pub(in crate::formats) fn counts(&self, column: usize) -> bool {
        let values = self.numbers(column);
        values.len() > 1 && values.array_windows().all(|[a, b]| b - a == 1.0)
    }

    /// Returns true if the first column of several holds names or running numbers of the rows.
    pub(in crate::formats) fn begins_with_row_names(&self) -> bool {
        self.width > 2 && (self.is_text[0] || self.is_numbering(0))
    }
}

/// Content of the cells of a column in the rows found so far.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// All values are missing.
    Open,
    Number,
    Text,
}

/// Consecutive lines with equally many cells, and in each column numbers only or text only.
struct Run {
    delimiter: Delimiter,
    first: usize,
    rows: usize,
    kinds: Vec<Kind>,
}

impl Run {
    /// Extends the kinds of the columns by those of a further row, which fits.
    fn accept(&mut self, row: &[Content]) {
        for (kind, content) in self.kinds.iter_mut().zip(row) {
            match content {
                Content::Number(_) => *kind = Kind::Number,
                Content::Text => *kind = Kind::Text,
                Content::Missing => {}
            }
        }
        self.rows += 1;
    }

    fn count(&self, kind: Kind) -> usize {
        self.kinds.iter().filter(|&&found| found == kind).count()
    }

    /// Returns true if the lines are rows of numbers: two columns of numbers, or one beside missing values. Lines with
    /// several words between blanks are prose or a log, and so are few lines of words without names above, or of more
    /// words than numbers.
    fn is_table(&self) -> bool {
        let (numbers, texts) = (self.count(Kind::Number), self.count(Kind::Text));
        let is_prose = self.delimiter == Delimiter::Blank && texts > 1;
        let are_few =
            texts > 0 && self.first == 0 && self.rows < FEWEST_WITH_TEXT || texts > numbers && self.rows < ENOUGH;
        !is_prose && !are_few && (numbers >= 2 || numbers == 1 && self.kinds.len() >= 2 && texts == 0)
    }
}

/// Returns true if a row has as many cells as there are columns, with numbers and text where they were before.
fn fits(kinds: &[Kind], row: &[Content]) -> bool {
    kinds.len() == row.len()
        && kinds.iter().zip(row).all(|(kind, content)| match content {
            Content::Number(_) => *kind != Kind::Text,
            Content::Text => *kind != Kind::Number,
            Content::Missing => true,
        })
}

fn contents_of(delimiter: Delimiter, line: Token<'_>) -> Vec<Content> {
    delimiter.cells(line).iter().map(|cell| delimiter.content(cell.text)).collect()
}

/// Returns the rows of numbers among `lines`, which are without comments: the longest run of lines of one form, with
/// the separator that leaves the fewest columns of text, of equal ones that with the most rows.
pub(in crate::formats) fn find(lines: &[Token<'_>]) -> Option<Layout> {
    let mut searches = Delimiter::ALL.map(|delimiter| Search { delimiter, best: None, run: None });
    for (at, line) in lines.iter().enumerate() {
        let begins = at < MAX_PREAMBLE;
        let mut has_enough = false;
        for search in &mut searches {
            has_enough |= search.accept(at, *line, begins);
        }
        if has_enough || !begins && searches.iter().all(|search| search.run.is_none()) {
            break;
        }
    }
    let runs: Vec<Run> = searches.into_iter().filter_map(Search::longest).collect();
    let most = runs.iter().map(|run| run.rows).max()?;
    let best = runs
        .into_iter()
        .filter(|run| 2 * run.rows >= most)
        .min_by_key(|run| (run.count(Kind::Text), Reverse(run.rows)))?;
    Some(best.into_layout(lines))
}

/// Search for the longest run of lines of numbers under one separator.
struct Search {
    delimiter: Delimiter,
    best: Option<Run>,
    run: Option<Run>,
}

impl Search {
    /// Extends the run by line number `at`, or begins another one, unless that is too late. Returns true if the run has
    /// [`ENOUGH`] rows.
    fn accept(&mut self, at: usize, line: Token<'_>, begins: bool) -> bool {
        let row = contents_of(self.delimiter, line);
        if let Some(run) = self.run.as_mut().filter(|run| fits(&run.kinds, &row)) {
            run.accept(&row);
            return run.rows >= ENOUGH && run.is_table();
        }
        self.best = longer(self.best.take(), self.run.take());
        let has_number = row.iter().any(|content| matches!(content, Content::Number(_)));
        if begins && row.len() >= 2 && has_number {
            let mut run = Run { delimiter: self.delimiter, first: at, rows: 0, kinds: vec![Kind::Open; row.len()] };
            run.accept(&row);
            self.run = Some(run);
        }
        false
    }

    fn longest(self) -> Option<Run> {
        longer(self.best, self.run)
    }
}

fn longer(best: Option<Run>, run: Option<Run>) -> Option<Run> {
    match (best, run.filter(Run::is_table)) {
        (Some(best), Some(run)) => Some(if run.rows > best.rows { run } else { best }),
        (best, run) => best.or(run),
    }
}

impl Run {
    fn into_layout(self, lines: &[Token<'_>]) -> Layout {
        let Self { delimiter, first, kinds, .. } = self;
        // A row of the same form before these lines belongs to the table: what interrupts it is an error, not a header.
        let before = lines[..first]
            .iter()
            .position(|line| {
                let row = contents_of(delimiter, *line);
                let is_number =
                    |(kind, content): (&Kind, &Content)| *kind != Kind::Number || matches!(content, Content::Number(_));
                fits(&kinds, &row) && kinds.iter().zip(&row).all(is_number)
            })
            .unwrap_or(first);
        let before = before + usize::from(is_row_of_names(&kinds, delimiter, &lines[before..]));
        let rows_looked_at = ROWS_LOOKED_AT.min(ENOUGH.max(CELLS_LOOKED_AT / kinds.len()));
        let (mut sample, mut has_points, mut in_percent) = (Vec::new(), false, vec![false; kinds.len()]);
        for line in lines[before..].iter().take(rows_looked_at) {
            let cells = delimiter.cells(*line);
            if cells.len() != kinds.len() {
                continue;
            }
            let number = |(i, cell): (usize, &Token<'_>)| match (delimiter.content(cell.text), kinds[i]) {
                (Content::Number(number), Kind::Number) => {
                    has_points |= cell.text.contains('.');
                    in_percent[i] |= cell.text.ends_with('%');
                    number
                }
                _ => f64::NAN,
            };
            sample.push(cells.iter().enumerate().map(number).collect());
        }
        Layout {
            delimiter,
            width: kinds.len(),
            is_text: kinds.iter().map(|kind| *kind == Kind::Text).collect(),
            #[cfg(test)]
            before,
            start: lines.get(before).map_or(0, |line| line.offset),
            sample,
            in_percent,
            has_points,
        }
    }
}

/// Returns true if the first of `lines` names columns by numbers: its first cell is blank, above numbers.
fn is_row_of_names(kinds: &[Kind], delimiter: Delimiter, lines: &[Token<'_>]) -> bool {
    let [first, second, ..] = lines else { return false };
    let (names, row) = (contents_of(delimiter, *first), contents_of(delimiter, *second));
    let is_number = |content: &Content| matches!(content, Content::Number(_));
    names.len() == kinds.len()
        && names[0] == Content::Missing
        && names[1..].iter().all(is_number)
        && row.first().is_some_and(is_number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::text::Source;
    use crate::formats::text_table::lines::contents;

    fn found(text: &str) -> Option<(Delimiter, usize, usize, usize)> {
        let source = Source::decode(text.as_bytes(), "t");
        let lines: Vec<Token<'_>> = contents(&source).collect();
        find(&lines).map(|layout| {
            let texts = layout.is_text.iter().filter(|&&text| text).count();
            (layout.delimiter, layout.width, layout.before, texts)
        })
    }

    #[test]
    fn the_longest_run_of_rows_is_the_table() {
        for (text, expected) in [
            ("400 1\n410 2\n", Some((Delimiter::Blank, 2, 0, 0))),
            ("a,b\n400,1\n410,2\n", Some((Delimiter::Comma, 2, 1, 0))),
            ("380;0,5\n390;0,6\n", Some((Delimiter::Semicolon, 2, 0, 0))),
            ("380,5 0,5\n390,5 0,6\n", Some((Delimiter::Blank, 2, 0, 0))),
            ("Date;1;2;3\n\nnm;R\n400;1\n410;2\n420;3\n", Some((Delimiter::Semicolon, 2, 2, 0))),
            ("\"\",\"wl\",\"v\"\n\"1\",400,1\n\"2\",410,2\n", Some((Delimiter::Comma, 3, 1, 0))),
            ("name,nm,v\na,400,1\nb,410,2\n", Some((Delimiter::Comma, 3, 1, 1))),
            ("Integration time,5\nScans,10\n", None),
            ("one two\nthree four\n", None),
            ("400\n410\n", None),
            // Excitations of a fluorescent sample: a row of names that are numbers.
            ("  400\t 1 \n  410 \t2\n  420\t \t3\n", Some((Delimiter::Blank, 2, 0, 0))),
            (",380,390\n500,1,2\n510,2,3\n", Some((Delimiter::Comma, 3, 1, 0))),
            // The bad cell is an error within the table, which begins before it.
            ("400,1\n410,x\n420,1\n430,1\n", Some((Delimiter::Comma, 2, 0, 0))),
        ] {
            assert_eq!(found(text), expected, "{text}");
        }
    }
}
