//! Colour of a lobe of known shape: one factor for each band.

use super::choose::Found;
use super::scan::Scan;
use super::solve::predicted;

/// Ratio of lobe to base below which a sample counts for the colour of the base.
const OF_BASE: f64 = 0.05;
/// Least number of such samples; with fewer, all samples count.
const FEWEST: usize = 8;
/// Number of rounds of reweighting, in which outliers lose weight.
const ROUNDS: usize = 8;
/// Least sum of squared lobe values, in units of the noise, for a colour of a band. Raising it leaves more bands
/// without a colour of their own.
const SEEN: f64 = 1.0;

/// Factors of the bands of a scan.
#[derive(Clone, Debug)]
pub(super) struct Colours {
    /// Value of the lobe in each band, relative to its grey value (mean over bands).
    pub(super) lobe: Vec<f64>,
    /// Value of the base for each incidence and band, relative to its grey value.
    pub(super) bases: Vec<Vec<f64>>,
    /// Number of bands without samples of the lobe.
    pub(super) unseen: usize,
}

/// Fits the colours of a lobe and of the base beneath it.
pub(super) fn colours(scan: &Scan<'_>, found: &Found) -> Colours {
    let width = scan.rows.width;
    if width == 1 {
        return Colours { lobe: vec![1.0], bases: vec![vec![1.0]; found.near.groups.len()], unseen: 0 };
    }
    let prepared = found.shape.prepared();
    // Row, base and lobe of the samples, by incidence.
    let groups: Vec<Vec<(u32, f64, f64)>> = (found.near.groups.iter().zip(&found.bases))
        .map(|(group, base)| {
            let of = |sample| {
                let at = predicted(sample, base, Some(&prepared));
                (sample.row, libm::exp(at.base), libm::exp(at.log) * at.share)
            };
            group.iter().map(of).collect()
        })
        .collect();
    let bases: Vec<Vec<f64>> = groups.iter().map(|group| base(scan, group, width)).collect();
    let found: Vec<Option<f64>> = (0..width).map(|band| factor(scan, &groups, &bases, band, found.noise)).collect();
    let unseen = found.iter().filter(|found| found.is_none()).count();
    let nearest = |band: usize| {
        let far = |other: &usize| (other.abs_diff(band), *other);
        (0..width).filter(|&other| found[other].is_some()).min_by_key(far).and_then(|other| found[other])
    };
    let lobe = (0..width).map(|band| found[band].or_else(|| nearest(band)).unwrap_or(1.0)).collect();
    Colours { lobe, bases, unseen }
}

/// Returns the base of one incidence in each band, relative to its grey value: the median over samples without the
/// lobe.
fn base(scan: &Scan<'_>, group: &[(u32, f64, f64)], width: usize) -> Vec<f64> {
    let plain: Vec<u32> = group.iter().filter(|at| at.2 < OF_BASE * at.1).map(|at| at.0).collect();
    let all: Vec<u32> = group.iter().map(|at| at.0).collect();
    let rows = if plain.len() >= FEWEST { plain } else { all };
    let mut parts = Vec::with_capacity(rows.len());
    let mut of = |band: usize| {
        parts.clear();
        parts.extend(rows.iter().filter_map(|&row| {
            let part = f64::from(scan.rows.row(row)[band]) / libm::exp(scan.logs[row as usize]);
            (!part.is_nan()).then_some(part)
        }));
        let middle = parts.len() / 2;
        if parts.is_empty() { 1.0 } else { *parts.select_nth_unstable_by(middle, f64::total_cmp).1 }
    };
    (0..width).map(&mut of).collect()
}

/// Fits the factor of one band by robust weighted least squares. Returns `None` if no sample of the band shows the
/// lobe.
fn factor(
    scan: &Scan<'_>,
    groups: &[Vec<(u32, f64, f64)>],
    bases: &[Vec<f64>],
    band: usize,
    noise: f64,
) -> Option<f64> {
    let mut factor = 1.0;
    for _ in 0..ROUNDS {
        let (mut product, mut square) = (0.0, 0.0);
        for (group, colour) in groups.iter().zip(bases) {
            for &(row, base, lobe) in group.iter().filter(|at| at.2 > 1e-3 * at.1) {
                let value = f64::from(scan.rows.row(row)[band]);
                if value.is_nan() {
                    continue;
                }
                let base = base * colour[band];
                let scale = noise * (base + lobe * factor).max(1e-3 * lobe).max(f64::MIN_POSITIVE);
                let residual = (value - base - lobe * factor) / scale;
                let weight = 1.0 / (scale * scale * (1.0 + residual * residual).sqrt());
                product += weight * lobe * (value - base);
                square += weight * lobe * lobe;
            }
        }
        if square < SEEN {
            return None;
        }
        factor = (product / square).max(1e-6);
    }
    Some(factor)
}
