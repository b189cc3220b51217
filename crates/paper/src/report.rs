//! Table as data: title, source, and each figure beside the printed one.

use serde::Serialize;

/// Reproduced table of the paper. Figures are in per cent unless a column says otherwise.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(as = PaperTable))]
pub struct Table {
    /// Number of the table in the paper.
    pub number: u8,
    /// Title.
    pub title: String,
    /// Data that the figures were computed on, and their differences from the paper's.
    pub data: String,
    /// Selection of coefficients by each method, one sentence each.
    pub methods: Vec<String>,
    /// Column headings.
    pub columns: Vec<String>,
    /// Rows, one for each subject and method.
    pub rows: Vec<Row>,
    /// Summary of the ratios of each method, over all cells with a printed figure.
    pub figures: Vec<Figures>,
}

/// Figures of one subject with one method.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(as = PaperRow))]
pub struct Row {
    /// Name of the subject: a patch, a material.
    pub label: String,
    /// Name of the method; empty if there is only one.
    pub method: String,
    /// Cells, one for each column.
    pub cells: Vec<Cell>,
    /// Bases or thresholds that were chosen.
    pub detail: String,
}

/// Our figure and the printed one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(as = PaperCell))]
pub struct Cell {
    /// Figure computed here.
    pub ours: f64,
    /// Figure printed in the paper; `None` if it has none.
    pub paper: Option<f64>,
    /// Ours / paper; `None` without a positive printed figure.
    pub ratio: Option<f64>,
}

/// Statistics of the ratios ours / paper of one method over the table.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(as = PaperFigures))]
pub struct Figures {
    /// Name of the method.
    pub method: String,
    /// Number of cells with a printed figure.
    pub cells: usize,
    /// Geometric mean of the ratios.
    pub geometric_mean: f64,
    /// Median of the ratios.
    pub median: f64,
    /// Largest ratio.
    pub largest: f64,
}

impl Cell {
    /// Creates a cell from a figure and its printed counterpart.
    pub(super) fn new(ours: f64, paper: Option<f64>) -> Self {
        let ratio = paper.filter(|p| *p > 0.0).map(|p| ours / p);
        Self { ours, paper, ratio }
    }
}

impl Table {
    /// Computes the ratio statistics of every method, in the order of first appearance.
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
