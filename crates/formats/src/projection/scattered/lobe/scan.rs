//! Scan prepared for the search of lobes: one grey value for each sample.

use crate::projection::scattered::incidences::Incidence;
use crate::projection::scattered::plan::Plan;
use crate::projection::scattered::rows::{Kind, Rows};

/// Samples of a scan, prepared for the search for narrow lobes.
pub(super) struct Scan<'a> {
    pub(super) plan: &'a Plan,
    pub(super) rows: &'a Rows<'a>,
    pub(super) incidences: &'a [Incidence],
    /// Natural logarithm of each sample's mean over bands (only over bands that no sample lacks, if there are any). NaN
    /// if the mean is not positive or there is no value.
    pub(super) logs: Vec<f64>,
}

impl<'a> Scan<'a> {
    pub(super) fn new(plan: &'a Plan, rows: &'a Rows<'a>, incidences: &'a [Incidence]) -> Self {
        let is_partial = rows.kinds.contains(&Kind::Partial);
        let complete = if is_partial { complete(rows) } else { Vec::new() };
        let usual = if is_partial && complete.is_empty() { usual(rows) } else { Vec::new() };
        let grey = |row: usize| match rows.kinds[row] {
            Kind::Missing => f64::NAN,
            _ if !complete.is_empty() => {
                let row = rows.row(row as u32);
                complete.iter().map(|&band| f64::from(row[band])).sum::<f64>() / complete.len() as f64
            }
            Kind::Partial => of_part(rows.row(row as u32), &usual),
            Kind::Positive | Kind::Whole => rows.light[row][1],
        };
        let log = |value: f64| if value > 0.0 { libm::log(value) } else { f64::NAN };
        let whole = |row: usize| if rows.width == 1 { rows.light[row][0] } else { log(grey(row)) };
        let logs = (0..rows.kinds.len()).map(whole).collect();
        Self { plan, rows, incidences, logs }
    }

    /// Returns the standard deviation of the natural logarithm of a sample's mean over bands, from the uncertainties in
    /// the measurement file; 0 if it states none.
    pub(super) fn stated(&self, row: u32) -> f64 {
        let certainty = self.rows.certainty.get(row as usize).map_or(0.0, |certainty| certainty[1]);
        if certainty > 0.0 { 1.0 / (certainty * self.rows.width as f64).sqrt() } else { 0.0 }
    }
}

/// Returns the spectral bands in which every sample has a value; samples without a value in any band do not count. A
/// mean over these bands mixes lobe and background in equal proportions in every sample.
fn complete(rows: &Rows<'_>) -> Vec<usize> {
    let mut is_complete = vec![true; rows.width];
    for row in (0..rows.kinds.len()).filter(|&row| !matches!(rows.kinds[row], Kind::Missing)) {
        is_complete.iter_mut().zip(rows.row(row as u32)).for_each(|(is, value)| *is &= !value.is_nan());
    }
    (0..rows.width).filter(|&band| is_complete[band]).collect()
}

/// Returns the geometric mean over samples of the positive values in each band.
fn usual(rows: &Rows<'_>) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0_f64); rows.width];
    for row in 0..rows.kinds.len() as u32 {
        for (sum, &value) in sums.iter_mut().zip(rows.row(row)).filter(|(_, value)| **value > 0.0) {
            *sum = (sum.0 + libm::log(f64::from(value)), sum.1 + 1.0);
        }
    }
    sums.into_iter().map(|(sum, count)| if count > 0.0 { libm::exp(sum / count) } else { 0.0 }).collect()
}

/// Returns the mean over all bands of a sample that lacks some of them. The missing values are assumed to follow
/// `usual`, the geometric mean spectrum of all samples.
fn of_part(row: &[f32], usual: &[f64]) -> f64 {
    let (mut sum, mut part, mut whole) = (0.0, 0.0, 0.0);
    for (&value, &usual) in row.iter().zip(usual) {
        whole += usual;
        if !value.is_nan() {
            sum += f64::from(value);
            part += usual;
        }
    }
    sum / part * (whole / row.len() as f64)
}
