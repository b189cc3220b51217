//! Two-channel filter bank derived from one or two low-pass filters: all four filters, their symmetry and error.

use super::boundary::Boundary;

/// Low-pass filters of a wavelet basis; weights are listed by increasing sample index.
///
/// For coefficient o, a filter of even length 2r covers samples 2o + 1 − r to 2o + r; one of odd length 2r + 1 covers
/// 2o − r to 2o + r. PyWavelets' mode `periodization` uses the same positions.
#[derive(Clone, Copy, Debug)]
pub(super) enum Filters {
    /// One low-pass filter for both analysis and synthesis (orthogonal wavelets).
    Orthogonal(&'static [f64]),
    /// Different low-pass filters for analysis and synthesis (biorthogonal wavelets).
    Biorthogonal {
        /// Low-pass filter from samples to smooth coefficients.
        analysis: &'static [f64],
        /// Low-pass filter from smooth coefficients to samples.
        synthesis: &'static [f64],
    },
}

/// Weights of one filter of a wavelet level. For coefficient o, the first weight applies to sample 2o + `first`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Taps {
    pub(super) first: i64,
    pub(super) weights: Vec<f64>,
}

impl Taps {
    /// Returns the offset k of the last sample 2o + k that the filter of coefficient o covers.
    pub(super) fn last(&self) -> i64 {
        self.first + self.weights.len() as i64 - 1
    }

    /// Returns the filter weight of sample 2o + `k` in coefficient o.
    pub(super) fn at(&self, k: i64) -> f64 {
        usize::try_from(k - self.first).ok().and_then(|i| self.weights.get(i)).copied().unwrap_or(0.0)
    }

    /// Returns all pairs of offset k and weight of a filter, where the weight applies to sample 2o + k for coefficient
    /// o.
    pub(super) fn iter(&self) -> impl Iterator<Item = (i64, f64)> + '_ {
        (self.first..).zip(self.weights.iter().copied())
    }
}

/// Two-channel filter bank: the analysis filters and the synthesis filters, each `[low-pass, high-pass]`.
#[derive(Clone, Debug)]
pub(super) struct Bank {
    pub(super) analysis: [Taps; 2],
    pub(super) synthesis: [Taps; 2],
    /// Symmetric extension under which the filters give as many coefficients as samples; `None` if they are not
    /// symmetric.
    pub(super) symmetry: Option<Boundary>,
    /// True if analysis and synthesis use one and the same filters.
    pub(super) orthogonal: bool,
    /// Error of perfect reconstruction: the largest deviation of an inner product of analysis and shifted synthesis
    /// filter from its ideal value, 1 or 0.
    pub(super) error: f64,
}

/// Largest reconstruction error of a filter bank that is inverted by its own synthesis filters. For larger errors the
/// inverse is computed numerically.
pub(super) const PERFECT: f64 = 1e-9;

impl Bank {
    pub(super) fn new(filters: Filters) -> Self {
        let (analysis, synthesis, orthogonal) = match filters {
            Filters::Orthogonal(filter) => (filter, filter, true),
            Filters::Biorthogonal { analysis, synthesis } => (analysis, synthesis, false),
        };
        let longest = analysis.len().max(synthesis.len());
        // As in PyWavelets, signs alternate from the end of a filter padded to even length.
        let sign = if longest.div_ceil(2) % 2 == 1 { 1.0 } else { -1.0 };
        let (low, dual_low) = (placed(analysis), placed(synthesis));
        let error = biorthogonality_error(&low, &dual_low);
        let symmetry = match (palindrome(analysis) && palindrome(synthesis), analysis.len() % 2) {
            (false, _) => None,
            (true, 0) => Some(Boundary::HalfSample),
            (true, _) => Some(Boundary::WholeSample),
        };
        let (high, dual_high) = (modulated(&dual_low, sign), modulated(&low, sign));
        Self { analysis: [low, high], synthesis: [dual_low, dual_high], symmetry, orthogonal, error }
    }

    /// Returns the range of samples that the four filters (low-pass and high-pass, analysis and synthesis) cover
    /// together: first and last offset from sample 2o, for coefficient o of a level.
    pub(super) fn reach(&self) -> (i64, i64) {
        let taps = || self.analysis.iter().chain(&self.synthesis);
        let first = taps().map(|t| t.first).min().unwrap_or(0);
        let last = taps().map(Taps::last).max().unwrap_or(0);
        (first, last)
    }
}

fn placed(filter: &[f64]) -> Taps {
    let half = filter.len() as i64 / 2;
    let first = if filter.len().is_multiple_of(2) { 1 - half } else { -half };
    Taps { first, weights: filter.to_vec() }
}

/// Returns the high-pass filter with the weights `sign · (−1)^k · low[1 − k]`, derived from a low-pass filter.
fn modulated(low: &Taps, sign: f64) -> Taps {
    let first = 1 - low.last();
    let weights = (first..=1 - low.first).map(|k| if k % 2 == 0 { sign } else { -sign } * low.at(1 - k)).collect();
    Taps { first, weights }
}

fn palindrome(filter: &[f64]) -> bool {
    filter.iter().zip(filter.iter().rev()).all(|(a, b)| (a - b).abs() < 1e-12)
}

fn biorthogonality_error(analysis: &Taps, synthesis: &Taps) -> f64 {
    let shifts = (analysis.weights.len() + synthesis.weights.len()) as i64;
    (-shifts..=shifts)
        .map(|m| {
            let product: f64 = analysis.iter().map(|(k, w)| w * synthesis.at(k + 2 * m)).sum();
            (product - if m == 0 { 1.0 } else { 0.0 }).abs()
        })
        .fold(0.0, f64::max)
}
