//! Colour of a lobe of known shape: one factor for each band.

use super::choose::Found;
use super::scan::Scan;
use super::solve::{predicted, robust};

/// Number of rounds of reweighting, in which outliers lose weight.
const ROUNDS: usize = 12;
/// Least factor of lobe and base.
const LEAST: f64 = 1e-6;
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
    let (prepared, noise) = (found.shape.prepared(), found.noise);
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
    let (mut bases, mut found) = (vec![vec![1.0; width]; groups.len()], Vec::with_capacity(width));
    for band in 0..width {
        let fitted = fitted(scan, &groups, band, noise);
        bases.iter_mut().zip(fitted.bases).for_each(|(bases, base)| bases[band] = base);
        found.push(fitted.lobe);
    }
    let unseen = found.iter().filter(|found| found.is_none()).count();
    let nearest = |band: usize| {
        let far = |other: &usize| (other.abs_diff(band), *other);
        (0..width).filter(|&other| found[other].is_some()).min_by_key(far).and_then(|other| found[other])
    };
    let lobe = (0..width).map(|band| found[band].or_else(|| nearest(band)).unwrap_or(1.0)).collect();
    Colours { lobe, bases, unseen }
}

/// Factors of one band.
struct Fitted {
    /// Factor of the lobe; `None` if no sample of the band shows it.
    lobe: Option<f64>,
    /// Factor of the base under each incidence.
    bases: Vec<f64>,
}

/// Sums of weighted products over the samples of one incidence.
#[derive(Clone, Copy, Default)]
struct Sums {
    base_base: f64,
    base_lobe: f64,
    lobe_lobe: f64,
    base_value: f64,
    lobe_value: f64,
}

/// Fits the factors of one band, that of the lobe and that of the base under each incidence, together by robust
/// weighted least squares. The tail of a lobe reaches as far as the samples do, so neither is known without the other.
fn fitted(scan: &Scan<'_>, groups: &[Vec<(u32, f64, f64)>], band: usize, noise: f64) -> Fitted {
    let (mut lobe, mut bases) = (1.0_f64, vec![1.0_f64; groups.len()]);
    let mut is_seen = true;
    for _ in 0..ROUNDS {
        let sums: Vec<Sums> = (groups.iter().zip(&bases))
            .map(|(group, colour)| sums(scan, group, band, (*colour, lobe, noise)))
            .collect();
        let (mut product, mut square) = (0.0, 0.0);
        for sums in sums.iter().filter(|sums| sums.base_base > 0.0) {
            product += sums.lobe_value - sums.base_lobe * sums.base_value / sums.base_base;
            square += sums.lobe_lobe - sums.base_lobe * sums.base_lobe / sums.base_base;
        }
        is_seen = square >= SEEN;
        lobe = if is_seen { (product / square).max(LEAST) } else { 1.0 };
        for (base, sums) in bases.iter_mut().zip(sums) {
            if sums.base_base > 0.0 {
                *base = ((sums.base_value - lobe * sums.base_lobe) / sums.base_base).max(LEAST);
            }
        }
    }
    Fitted { lobe: is_seen.then_some(lobe), bases }
}

/// Sums over the samples of one incidence, weighted by their noise about base and lobe with these factors.
fn sums(scan: &Scan<'_>, group: &[(u32, f64, f64)], band: usize, (colour, factor, noise): (f64, f64, f64)) -> Sums {
    let mut sums = Sums::default();
    for &(row, base, lobe) in group {
        let value = f64::from(scan.rows.row(row)[band]);
        if value.is_nan() {
            continue;
        }
        let expected = base * colour + lobe * factor;
        let scale = noise * expected.max(LEAST * (base + lobe)).max(f64::MIN_POSITIVE);
        let weight = 1.0 / (scale * scale * robust((value - expected) / scale).1);
        sums.base_base += weight * base * base;
        sums.base_lobe += weight * base * lobe;
        sums.lobe_lobe += weight * lobe * lobe;
        sums.base_value += weight * base * value;
        sums.lobe_value += weight * lobe * value;
    }
    sums
}
