//! Names of the columns of a table, in the lines before its rows: names, units beneath them, labels above them.

use super::cells::{Delimiter, name_of};
use super::layout::Layout;
use crate::formats::text::Token;
use std::collections::HashSet;

/// Names of the columns of a table.
pub(in crate::formats) struct Header {
    /// Name of each column with its unit; empty for a blank cell.
    pub(in crate::formats) names: Vec<String>,
    /// Label of each column in a line above its name, such as that of a sample; empty without one.
    pub(in crate::formats) labels: Vec<String>,
    /// Number of lines before the rows that contain names, units or labels.
    pub(in crate::formats) lines: usize,
    /// True if the names have another separator than the rows, as prose with as many commas would.
    pub(in crate::formats) is_split_otherwise: bool,
}

/// Returns the names in the last of the lines before the rows of a table, with units beneath or labels above them;
/// `None` unless the last line has as many cells as the rows.
pub(in crate::formats) fn of(before: &[Token<'_>], layout: &Layout) -> Option<Header> {
    let marks = before.iter().rev().take_while(|line| is_mark(line.text)).count();
    let mut above = before[..before.len() - marks].iter().rev().map(|line| cells(*line, layout));
    let mut names = above.next()??;
    let is_split_otherwise = layout.delimiter.cells(before[before.len() - marks - 1]).len() != names.len();
    let (mut lines, mut next) = (1, above.next().flatten());
    let is_name = |name: &String| !name.starts_with(|c: char| c.is_ascii_digit());
    if names.iter().all(|name| is_unit(name))
        && let Some(over) = next.take_if(|over| over.iter().all(is_name))
    {
        names = over.iter().zip(names).map(|(name, unit)| format!("{name} {unit}").trim().to_owned()).collect();
        lines += 1;
        next = above.next().flatten();
    }
    // A line above says which of the columns of one name is which.
    let mut seen = HashSet::new();
    let repeated = names.iter().filter(|name| !name.is_empty()).any(|name| !seen.insert(name));
    let is_label = |labels: &Vec<String>| labels.iter().filter(|label| !label.is_empty()).count() >= 2;
    let labels = next.filter(|labels| repeated && is_label(labels));
    lines += usize::from(labels.is_some());
    let labels = labels.map_or_else(|| vec![String::new(); names.len()], spread);
    Some(Header { names, labels, lines: lines + marks, is_split_otherwise })
}

/// Returns true for a line between names and rows that is neither: a ruler, or a mark such as `XYDATA`.
fn is_mark(line: &str) -> bool {
    const MARKS: [&str; 6] = ["data", "xydata", "spectraldata", "begindata", "beginspectraldata", "rawdata"];
    let letters: String = line.chars().filter(|c| c.is_alphanumeric()).collect();
    let is_ruler = !line.is_empty() && line.chars().all(|c| c.is_whitespace() || "-=_*~+|<>".contains(c));
    is_ruler || MARKS.contains(&letters.to_lowercase().as_str())
}

/// Repeats each label in the blank cells after it: spreadsheets write the label of several columns once.
fn spread(mut labels: Vec<String>) -> Vec<String> {
    for i in 1..labels.len() {
        if labels[i].is_empty() {
            let (before, after) = labels.split_at_mut(i);
            after[0].clone_from(&before[i - 1]);
        }
    }
    labels
}

/// Returns the cells of a line of names if there are as many as columns. The line may have another separator than the
/// rows, lack the cell over the names or numbers of the rows, or have names with blanks between columns of blanks. A
/// line that states a unit of all values has none.
fn cells(line: Token<'_>, layout: &Layout) -> Option<Vec<String>> {
    const STATED: [&str; 3] = ["xunit", "yunit", "wavelength unit"];
    let lower = line.text.to_lowercase().replace("x unit", "xunit").replace("y unit", "yunit");
    if STATED.iter().any(|stated| lower.contains(stated)) {
        return None;
    }
    let width = layout.width;
    let split = |delimiter: Delimiter| {
        let mut names: Vec<String> = delimiter.cells(line).iter().map(|cell| name_of(cell.text)).collect();
        while names.len() > width && names.last().is_some_and(String::is_empty) {
            names.pop();
        }
        // Spreadsheets leave out the last of blank cells.
        if names.len() + 1 == width && names.iter().any(String::is_empty) {
            names.push(String::new());
        }
        if names.len() + 1 == width && layout.begins_with_row_names() && names.iter().all(|name| !name.is_empty()) {
            names.insert(0, String::new());
        }
        (names.len() == width && names.iter().any(|name| !name.is_empty())).then_some(names)
    };
    let own = split(layout.delimiter);
    let others = || Delimiter::ALL.into_iter().filter(|other| *other != Delimiter::Blank).find_map(split);
    own.or_else(others).or_else(|| wide_blanks(line, width))
}

/// Splits a line at two blanks or more if that gives `width` cells.
fn wide_blanks(line: Token<'_>, width: usize) -> Option<Vec<String>> {
    let cells: Vec<String> = line.text.trim().split("  ").map(name_of).filter(|name| !name.is_empty()).collect();
    (cells.len() == width).then_some(cells)
}

/// Returns true for a cell that belongs to a row of units such as `[nm]`, `(%)` or `counts`, or is blank.
pub(in crate::formats) fn is_unit(cell: &str) -> bool {
    const BARE: [&str; 20] = [
        "nm", "um", "µm", "cm-1", "1/cm", "%", "-", "1", "a.u.", "counts", "dn", "w", "w/nm", "mw/nm", "w/m2/nm",
        "sr-1", "1/sr", "deg", "°", "cd",
    ];
    let bracketed = |open, close| cell.starts_with(open) && cell.ends_with(close);
    let cell_is_bare = BARE.contains(&cell.to_lowercase().as_str());
    cell.is_empty() || bracketed('[', ']') || bracketed('(', ')') || cell_is_bare
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::text::Source;
    use crate::formats::text_table::layout::find;
    use crate::formats::text_table::lines::contents;

    fn header(text: &str) -> Option<(Vec<String>, Vec<String>, usize)> {
        let source = Source::decode(text.as_bytes(), "t");
        let lines: Vec<Token<'_>> = contents(&source).collect();
        let layout = find(&lines).unwrap();
        of(&lines[..layout.before], &layout).map(|header| (header.names, header.labels, header.lines))
    }

    #[test]
    fn names_units_and_labels_belong_to_columns() {
        let list = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
        for (text, names, labels, lines) in [
            ("title\nnm,R\n400,1\n", &["nm", "R"][..], &["", ""][..], 1),
            ("Wave ;R\n[nm] ;[%]\n\n400;1\n", &["Wave [nm]", "R [%]"], &["", ""], 2),
            ("A,,B,\nnm,R,nm,R\n400,1,400,2\n", &["nm", "R", "nm", "R"], &["A", "A", "B", "B"], 2),
            // Two cells of a title are no labels of names that differ.
            ("Sample,leaf\nnm,R\n400,1\n", &["nm", "R"], &["", ""], 1),
            ("Wavelength (nm), R (%)\n400 1\n", &["Wavelength (nm)", "R (%)"], &["", ""], 1),
            ("Wavelength (nm)   R (%)\n400 1\n", &["Wavelength (nm)", "R (%)"], &["", ""], 1),
            ("nm;R;;\n400;1;2\n", &["nm", "R", ""], &["", "", ""], 1),
        ] {
            assert_eq!(header(text), Some((list(names), list(labels), lines)), "{text}");
        }
        assert_eq!(header("some text, with a comma, and more\n400,1\n"), None);
        assert_eq!(header("400,1\n"), None);
    }
}
