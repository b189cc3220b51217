//! Wavelength resampling: the average of the piecewise linear spectrum over the band of each target.

use crate::domain::WavelengthGrid;

/// Relative tolerance for a target wavelength at the end of the measured range. Raising it accepts targets farther
/// outside.
const END_TOLERANCE: f64 = 1e-9;

/// Weights that turn samples on one wavelength grid into band averages on another.
///
/// The band of a target reaches half way to its neighbours and is cut at the measured range. The first and the last
/// band end at their own target. The trapezoidal integral over targets within the range therefore equals the integral
/// of the piecewise linear spectrum between the first and the last target: no energy between wavelengths is lost. A
/// target outside the measured range has no weights.
#[derive(Clone, Debug)]
pub(super) struct Bands {
    /// Weights for each target wavelength: the index of the first sample that contributes, and the weights of this
    /// sample and of those after it. They sum to 1; there are none for a wavelength outside the measured range.
    targets: Vec<(usize, Vec<f64>)>,
}

impl Bands {
    pub(super) fn new(from: &WavelengthGrid, to: &WavelengthGrid) -> Self {
        let targets = (0..to.len())
            .map(|i| {
                let centre = to.at(i);
                let low = if i > 0 { 0.5 * (to.at(i - 1) + centre) } else { centre };
                let high = if i + 1 < to.len() { 0.5 * (centre + to.at(i + 1)) } else { centre };
                band(from, centre, low, high)
            })
            .collect();
        Self { targets }
    }

    pub(super) fn len(&self) -> usize {
        self.targets.len()
    }

    /// Returns the number of target wavelengths outside the measured range.
    pub(super) fn outside(&self) -> usize {
        self.targets.iter().filter(|(_, weights)| weights.is_empty()).count()
    }

    /// Returns the average of a spectrum `row` over the band of target wavelength number `target`, without masked (NaN)
    /// values; NaN if no value is left.
    pub(super) fn average(&self, row: &[f64], target: usize) -> f64 {
        let (first, weights) = &self.targets[target];
        let (mut sum, mut total) = (0.0, 0.0);
        for (&value, &weight) in row[*first..].iter().zip(weights) {
            if !value.is_nan() {
                sum += weight * value;
                total += weight;
            }
        }
        if total > 0.0 { sum / total } else { f64::NAN }
    }
}

fn band(from: &WavelengthGrid, centre: f64, low: f64, high: f64) -> (usize, Vec<f64>) {
    let (first, last) = from.range();
    let slack = END_TOLERANCE * centre;
    if centre < first - slack || centre > last + slack {
        return (0, Vec::new());
    }
    let (low, high) = (low.max(first), high.min(last));
    let width = high - low;
    if width <= slack {
        return match from.locate(centre.clamp(first, last)) {
            Some((i, t)) if t > 0.0 => (i, vec![1.0 - t, t]),
            Some((i, _)) => (i, vec![1.0]),
            None => (0, Vec::new()),
        };
    }
    let Some((start, _)) = from.locate(low) else { return (0, Vec::new()) };
    let mut weights = vec![0.0];
    let mut k = start;
    while k + 1 < from.len() && from.at(k) < high {
        let (a, b) = (from.at(k), from.at(k + 1));
        let (p, q) = (a.max(low), b.min(high));
        // The midpoint rule is exact for a linear function.
        let (length, t) = ((q - p).max(0.0), (0.5 * (p + q) - a) / (b - a));
        weights[k - start] += length * (1.0 - t) / width;
        weights.push(length * t / width);
        k += 1;
    }
    (start, weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resample(from: &WavelengthGrid, to: &WavelengthGrid, row: &[f64]) -> Vec<f64> {
        let bands = Bands::new(from, to);
        (0..bands.len()).map(|i| bands.average(row, i)).collect()
    }

    fn integral(grid: &WavelengthGrid, row: &[f64]) -> f64 {
        grid.weights().iter().zip(row).map(|(w, v)| w * v).sum()
    }

    #[test]
    fn weights_sum_to_one_and_linear_spectra_stay_linear_inside() {
        let from = WavelengthGrid::listed(vec![380.0, 383.0, 391.5, 420.0, 500.0, 780.0]).unwrap();
        for to in ["380:780:1", "400:700:10", "380:780:200", "450:450:1"] {
            let to = WavelengthGrid::parse_range(to).unwrap();
            let bands = Bands::new(&from, &to);
            assert_eq!(bands.outside(), 0);
            for (_, weights) in &bands.targets {
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12 && weights.iter().all(|&w| w >= 0.0));
            }
            let row: Vec<f64> = from.values().iter().map(|l| 2.0 * l + 1.0).collect();
            let out = resample(&from, &to, &row);
            for (i, value) in out.iter().enumerate().take(to.len() - 1).skip(1) {
                assert!((value - (2.0 * to.at(i) + 1.0)).abs() < 1e-9, "{}", to.at(i));
            }
        }
    }

    #[test]
    fn integrals_are_conserved_even_for_lines_between_targets() {
        let from = WavelengthGrid::even(380.0, 1.0, 401).unwrap();
        let row: Vec<f64> = (0..401).map(|i| if i % 97 == 13 { 100.0 } else { (f64::from(i) * 0.7).sin() }).collect();
        for to in ["380:780:5", "380:780:50", "380:780:0.25", "380:780:400"] {
            let to = WavelengthGrid::parse_range(to).unwrap();
            let out = resample(&from, &to, &row);
            assert!((integral(&to, &out) - integral(&from, &row)).abs() < 1e-8, "{to:?}");
        }
    }

    #[test]
    fn outside_the_measured_range_there_is_nothing() {
        let from = WavelengthGrid::even(400.0, 10.0, 31).unwrap();
        let to = WavelengthGrid::parse_range("380:720:10").unwrap();
        let bands = Bands::new(&from, &to);
        assert_eq!(bands.outside(), 4);
        let out = resample(&from, &to, &[3.0; 31]);
        assert!(out[0].is_nan() && out[1].is_nan() && out[2] == 3.0 && out[32] == 3.0 && out[33].is_nan());
        let single = WavelengthGrid::even(550.0, 1.0, 1).unwrap();
        assert_eq!(Bands::new(&single, &to).outside(), 34);
    }

    #[test]
    fn masked_samples_are_left_out_of_the_average() {
        let from = WavelengthGrid::even(400.0, 1.0, 21).unwrap();
        let to = WavelengthGrid::even(400.0, 10.0, 3).unwrap();
        let mut row = vec![2.0; 21];
        row[9] = f64::NAN;
        assert_eq!(resample(&from, &to, &row), [2.0; 3]);
        let out = resample(&from, &to, &[f64::NAN; 21]);
        assert!(out.iter().all(|v| v.is_nan()));
    }
}
