//! Table as data: title, source, and each computed number beside the published one.

use serde::Serialize;

/// Reproduced table of the paper by Claustres et al. (2006): each number computed by this program beside the published
/// one. Numbers are errors in per cent unless a column says otherwise.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(as = PaperTable))]
pub struct Table {
    /// Table number in the paper by Claustres et al. (2006), 1 to 7.
    pub number: u8,
    /// Title of the table reproduced from the paper by Claustres et al. (2006); it says what the numbers are.
    pub title: String,
    /// Text that names the data that this program compressed, and says how they differ from those of Claustres et al.
    /// (2006).
    pub data: String,
    /// Descriptions of how each method selects wavelet coefficients, one sentence for each method.
    pub methods: Vec<String>,
    /// Column headings of the table reproduced from the paper by Claustres et al. (2006).
    pub columns: Vec<String>,
    /// Rows of the reproduced table, one for each combination of subject (spectrum, material) and method.
    pub rows: Vec<Row>,
    /// For each compression method, statistics of the ratios of errors computed by this program to those published in
    /// the reproduced table. Cells without a published error do not count.
    pub figures: Vec<Figures>,
}

/// Row of a reproduced table: the errors of one subject (spectrum, material) compressed by one method.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(as = PaperRow))]
pub struct Row {
    /// Name of the compressed subject, such as a colour patch or a material.
    pub label: String,
    /// Name of the compression method of this row of a reproduced table; empty if all rows have the same method.
    pub method: String,
    /// Cells of the row, one for each column of the table.
    pub cells: Vec<Cell>,
    /// Wavelet bases that the compression method chose, or thresholds below which it drops coefficients, as text.
    pub detail: String,
}

/// Cell of a reproduced table: a number computed by this program beside the one published in the paper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(as = PaperCell))]
pub struct Cell {
    /// Number computed by this program for one cell of a reproduced table: an error in per cent unless the column says
    /// otherwise.
    pub ours: f64,
    /// Number that Claustres et al. (2006) published for one cell of the reproduced table: an error in per cent unless
    /// the column says otherwise. `None` if they published none.
    pub paper: Option<f64>,
    /// Ratio of this program's number for one cell of a reproduced table to that of Claustres et al. (2006); `None` if
    /// they published no positive number.
    pub ratio: Option<f64>,
}

/// Statistics of one compression method over a reproduced table: ratios of errors computed by this program to those
/// published in the paper.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(as = PaperFigures))]
pub struct Figures {
    /// Name of the compression method whose errors, computed by this program, are compared with published ones.
    pub method: String,
    /// Number of cells of a reproduced table with a positive published error; the ratios of computed to published
    /// errors in these cells make the statistics.
    pub cells: usize,
    /// Geometric mean of the ratios of compression errors computed by this program to those published in the reproduced
    /// table.
    pub geometric_mean: f64,
    /// Median of the ratios of compression errors computed by this program to those published in the reproduced table.
    pub median: f64,
    /// Largest ratio of a compression error computed by this program to the one published in the reproduced table.
    pub largest: f64,
}

impl Cell {
    /// Creates a table cell from a computed number and the number published in the paper, if there is one.
    pub(super) fn new(ours: f64, paper: Option<f64>) -> Self {
        let ratio = paper.filter(|p| *p > 0.0).map(|p| ours / p);
        Self { ours, paper, ratio }
    }
}

impl Table {
    /// Completes a table reproduced from the paper by Claustres et al. (2006) with statistics, for each compression
    /// method, of the ratios of computed to published errors. Methods keep the order of their first appearance.
    pub(super) fn summarised(mut self) -> Self {
        let mut methods: Vec<&str> = Vec::new();
        for row in &self.rows {
            if !methods.contains(&row.method.as_str()) {
                methods.push(&row.method);
            }
        }
        let figures = methods.into_iter().filter_map(|method| {
            let rows = self.rows.iter().filter(|row| row.method == method);
            let mut ratios: Vec<f64> = rows.flat_map(|row| row.cells.iter().filter_map(|cell| cell.ratio)).collect();
            ratios.sort_by(f64::total_cmp);
            let logs: f64 = ratios.iter().map(|r| libm::log(r.max(1e-12))).sum();
            (!ratios.is_empty()).then(|| Figures {
                method: method.to_owned(),
                cells: ratios.len(),
                geometric_mean: libm::exp(logs / ratios.len() as f64),
                median: 0.5 * (ratios[(ratios.len() - 1) / 2] + ratios[ratios.len() / 2]),
                largest: ratios[ratios.len() - 1],
            })
        });
        self.figures = figures.collect();
        self
    }
}
