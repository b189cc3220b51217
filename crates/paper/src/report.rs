//! A table as data: what it is, what it was made on, and each figure beside the printed one.

use serde::Serialize;

/// A table of the paper, made again. Figures are in per cent unless a column says otherwise.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Table {
    /// Its number in the paper.
    pub number: u8,
    /// What it shows.
    pub title: String,
    /// What it was made on, and where that differs from the paper.
    pub data: String,
    /// How the methods choose coefficients, one sentence each.
    pub methods: Vec<String>,
    /// The heads of the columns.
    pub columns: Vec<String>,
    /// One for each subject and method.
    pub rows: Vec<Row>,
    /// Over all cells with a printed figure, method by method.
    pub figures: Vec<Figures>,
}

/// One subject by one method.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The subject: a patch, a material.
    pub label: String,
    /// The method, or empty if there is only one.
    pub method: String,
    /// One a column.
    pub cells: Vec<Cell>,
    /// What was chosen: bases, thresholds.
    pub detail: String,
}

/// Our figure and the printed one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cell {
    /// What was measured here.
    pub ours: f64,
    /// What the paper has.
    pub paper: Option<f64>,
    /// Ours / paper.
    pub ratio: Option<f64>,
}

/// A method's ratios ours / paper over the table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// The method.
    pub method: String,
    /// How many cells have a printed figure.
    pub cells: usize,
    /// The geometric mean of their ratios.
    pub geometric_mean: f64,
    /// Their median.
    pub median: f64,
    /// The largest ratio.
    pub largest: f64,
}

impl Cell {
    /// A figure with its printed counterpart, if there is one.
    pub(super) fn new(ours: f64, paper: Option<f64>) -> Self {
        let ratio = paper.filter(|p| *p > 0.0).map(|p| ours / p);
        Self { ours, paper, ratio }
    }
}

impl Table {
    /// Adds up the ratios of every method, in the order of first appearance.
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
