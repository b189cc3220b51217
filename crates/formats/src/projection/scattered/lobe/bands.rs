//! Colour of a lobe of known shape: one factor for each band.

use super::choose::Found;
use super::scan::Scan;
use super::solve::{predicted, robust};

/// Number of times that the spectral factors of a lobe and its background are fitted, each time with lower weights for
/// outliers. Raising it is slower.
const ROUNDS: usize = 12;
/// Lower bound on the value of a lobe, or of the background beneath it, in one spectral band, relative to its mean over
/// bands.
const LEAST: f64 = 1e-6;
/// Least sum over samples of (value of the lobe / noise)², in one spectral band, from which the brightness of the lobe
/// in this band is fitted. Below it, the lobe takes its relative brightness from the nearest fitted band. Raising it
/// fits fewer bands.
const SEEN: f64 = 1.0;

/// Spectral factors of a lobe and of the background beneath it.
#[derive(Clone, Debug)]
pub(super) struct Colours {
    /// Value of the lobe in each band, relative to its mean over bands.
    pub(super) lobe: Vec<f64>,
    /// Value of the background beneath the lobe (the measurement without the lobe) in each band, relative to its mean
    /// over bands; one list for each incoming direction.
    pub(super) bases: Vec<Vec<f64>>,
    /// Number of bands in which no sample shows the lobe.
    pub(super) unseen: usize,
}

/// Fits the spectral factors of a lobe of known shape and of the background beneath it.
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

/// Factors of lobe and background in one spectral band, relative to their means over bands.
struct Fitted {
    /// Factor of the lobe in one spectral band, relative to its mean over bands; `None` if no sample of the band shows
    /// the lobe.
    lobe: Option<f64>,
    /// Factor of the background beneath the lobe in one spectral band, relative to its mean over bands, for each
    /// incoming direction.
    bases: Vec<f64>,
}

/// Sums over the samples of one incoming direction, from which least squares determine the brightness of a lobe and of
/// the background beneath it in one spectral band. Summed are weighted products of background, lobe and measured value.
#[derive(Clone, Copy, Default)]
struct Sums {
    base_base: f64,
    base_lobe: f64,
    lobe_lobe: f64,
    base_value: f64,
    lobe_value: f64,
}

/// Fits the factor of the lobe in one band, and that of the background under each incoming direction, together by
/// robust weighted least squares. The tail of a lobe reaches as far as the samples do, so lobe and background cannot be
/// fitted separately.
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

/// Returns the weighted sums over the samples of one incoming direction from which least squares determine two factors
/// of a band: that of the lobe and that of its background. Each weight is the inverse variance of a sample from its
/// noise, lowered for outliers.
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
