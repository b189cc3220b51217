//! Output formats of a table: aligned text, JSON, CSV.

use super::report::Table;
use std::fmt::Write as _;

impl Table {
    /// Renders a table as aligned text; each cell is `ours (paper)`, the computed figure and the printed one.
    pub fn text(&self) -> String {
        let mut out = String::new();
        let _ = writeln!(out, "Table {}. {}", self.number, self.title);
        wrapped(&mut out, &format!("Data: {}", self.data));
        for method in &self.methods {
            wrapped(&mut out, method);
        }
        let mut lines = vec![self.heads()];
        lines.extend(self.rows.iter().map(|row| {
            let cells = row.cells.iter().map(|cell| match cell.paper {
                Some(paper) => format!("{} ({})", figure(cell.ours), figure(paper)),
                None => figure(cell.ours),
            });
            [row.label.clone(), row.method.clone()].into_iter().chain(cells).collect()
        }));
        let widths: Vec<usize> = (0..lines[0].len())
            .map(|i| lines.iter().filter_map(|line| line.get(i)).map(|cell| cell.chars().count()).max().unwrap_or(0))
            .collect();
        for line in &lines {
            let mut text = String::new();
            for (i, (cell, width)) in line.iter().zip(&widths).enumerate() {
                let pad = " ".repeat(width - cell.chars().count());
                let _ = if i < 2 { write!(text, "{cell}{pad}  ") } else { write!(text, "{pad}{cell}  ") };
            }
            let _ = writeln!(out, "{}", text.trim_end());
        }
        for figures in &self.figures {
            let method = if figures.method.is_empty() { String::new() } else { format!("{}: ", figures.method) };
            let _ = writeln!(
                out,
                "{method}ours / paper over {} cells: geometric mean {:.3}, median {:.3}, largest {:.3}",
                figures.cells, figures.geometric_mean, figures.median, figures.largest
            );
        }
        out
    }

    /// Renders a table as CSV: a header line `table,label,method,column,ours,paper,ratio`, then one line for each cell.
    pub fn csv(&self) -> String {
        let mut out = "table,label,method,column,ours,paper,ratio\n".to_owned();
        for row in &self.rows {
            for (cell, column) in row.cells.iter().zip(&self.columns) {
                let optional = |value: Option<f64>| value.map(|v| v.to_string()).unwrap_or_default();
                let _ = writeln!(
                    out,
                    "{},{},{},{},{},{},{}",
                    self.number,
                    quoted(&row.label),
                    quoted(&row.method),
                    quoted(column),
                    cell.ours,
                    optional(cell.paper),
                    optional(cell.ratio)
                );
            }
        }
        out
    }

    /// Returns the reproduced table of Claustres et al. (2006) as JSON: title, columns, rows, and statistics of the
    /// ratios of computed to published errors.
    pub fn json(&self) -> serde_json::Value {
        serde_json::json!(self)
    }

    fn heads(&self) -> Vec<String> {
        [String::new(), String::new()].into_iter().chain(self.columns.iter().cloned()).collect()
    }
}

/// Formats a number with up to three significant digits, the most in the tables of Claustres et al. (2006). Numbers
/// from 100 on are rounded to integers.
fn figure(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        v if v < 1e-4 => format!("{value:.1e}"),
        v if v < 0.1 => format!("{value:.4}"),
        v if v < 1.0 => format!("{value:.3}"),
        v if v < 10.0 => format!("{value:.2}"),
        v if v < 100.0 => format!("{value:.1}"),
        _ => format!("{value:.0}"),
    }
}

const WIDTH: usize = 110;

fn wrapped(out: &mut String, text: &str) {
    let mut length = 0;
    for word in text.split_whitespace() {
        let size = word.chars().count();
        if length > 0 && length + 1 + size > WIDTH {
            out.push('\n');
            length = 0;
        }
        if length > 0 {
            out.push(' ');
            length += 1;
        }
        out.push_str(word);
        length += size;
    }
    out.push('\n');
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::super::{Cell, Row};
    use super::*;

    fn table() -> Table {
        Table {
            number: 9,
            title: "A title".to_owned(),
            data: "made up".to_owned(),
            methods: vec!["plain: as it is".to_owned()],
            columns: vec!["16 L1".to_owned(), "16, L2".to_owned()],
            rows: vec![Row {
                label: "Light Skin".to_owned(),
                method: "plain".to_owned(),
                cells: vec![Cell::new(0.5, Some(1.0)), Cell::new(4.0, Some(2.0))],
                detail: String::new(),
            }],
            figures: Vec::new(),
        }
        .summarised()
    }

    #[test]
    fn the_three_forms_hold_the_same_figures() {
        let table = table();
        assert!((table.figures[0].geometric_mean - 1.0).abs() < 1e-12 && table.figures[0].largest == 2.0);
        let text = table.text();
        assert!(
            text.contains("0.500 (1.00)") && text.contains("geometric mean 1.000, median 1.250, largest 2.000"),
            "{text}"
        );
        assert!(table.csv().ends_with("9,Light Skin,plain,16 L1,0.5,1,0.5\n9,Light Skin,plain,\"16, L2\",4,2,2\n"));
        assert_eq!(table.json()["rows"][0]["cells"][1]["ratio"], 2.0);
    }
}
