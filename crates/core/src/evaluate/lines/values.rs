//! Samples of a grid in the form in which they are interpolated: logarithms if no sample is negative, one value for
//! each place.

use crate::numeric::number::Number;
use rayon::prelude::*;

/// Multiple of samples to which a stored spectrum is padded, for vectorised loops over wavelengths.
const SIDE: usize = 4;

/// Samples prepared for interpolation, `[combination of indices][incoming][outgoing][wavelength]`: the samples
/// themselves or their logarithms (-inf for 0). NaN means masked.
#[derive(Debug)]
pub(super) struct Values {
    numbers: Vec<f32>,
    /// Distance between the starts of consecutive stored spectra, in numbers: wavelengths and padding.
    stride: usize,
    lambdas: usize,
    incoming: usize,
    outgoing: usize,
    is_logarithmic: bool,
    is_whole: bool,
}

/// Directions of an axis, and the groups of directions that coincide, such as all azimuths at a pole. The table of
/// samples has the group's mean at each of its directions. After all directions it has the original samples, group by
/// group.
pub(super) struct Places<'a> {
    pub(super) own: usize,
    pub(super) same: &'a [Vec<u32>],
}

impl Places<'_> {
    fn count(&self) -> usize {
        self.own + self.same.iter().map(Vec::len).sum::<usize>()
    }

    /// For each stored sample of the axis, the indices of the measured directions whose samples it averages.
    fn entries(&self) -> Vec<Vec<usize>> {
        let mut entries: Vec<Vec<usize>> = (0..self.own).map(|entry| vec![entry]).collect();
        for same in self.same {
            let all: Vec<usize> = same.iter().map(|&entry| entry as usize).collect();
            for &entry in &all {
                entries[entry].clone_from(&all);
            }
            entries.extend(all.into_iter().map(|entry| vec![entry]));
        }
        entries
    }
}

impl Values {
    /// Prepares samples `[combination of indices][incoming][outgoing][wavelength]` for interpolation.
    pub(super) fn new(samples: &[f32], lambdas: usize, incoming: &Places<'_>, outgoing: &Places<'_>) -> Self {
        let is_logarithmic = !samples.iter().any(|&sample| sample < 0.0);
        let stride = if lambdas == 1 { 1 } else { lambdas.next_multiple_of(SIDE) };
        let (n_in, n_out) = (incoming.count(), outgoing.count());
        let block = incoming.own * outgoing.own * lambdas;
        let tables = samples.len() / block * n_in;
        let mut numbers = vec![0.0; tables * n_out * stride];
        let groups = [incoming, outgoing].map(Places::entries);
        numbers.par_chunks_mut(n_out * stride).enumerate().for_each(|(table, numbers)| {
            let samples = &samples[table / n_in * block..][..block];
            for (row, of_place) in numbers.chunks_exact_mut(stride).zip(&groups[1]) {
                for (lambda, number) in row.iter_mut().enumerate().take(lambdas) {
                    let cells = groups[0][table % n_in].iter().flat_map(|i| of_place.iter().map(move |o| (i, o)));
                    let sample = mean(cells.map(|(i, o)| samples[(i * outgoing.own + o) * lambdas + lambda]));
                    *number = if is_logarithmic { libm::log(sample) as f32 } else { sample as f32 };
                }
            }
        });
        let is_whole = numbers.par_iter().all(|number| number.is_finite());
        Self { numbers, stride, lambdas, incoming: n_in, outgoing: n_out, is_logarithmic, is_whole }
    }

    /// Returns true if the stored numbers are logarithms of samples.
    pub(super) fn is_logarithmic(&self) -> bool {
        self.is_logarithmic
    }

    /// Returns true if no sample is masked and, if logarithms are stored, none is 0.
    pub(super) fn is_whole(&self) -> bool {
        self.is_whole
    }

    pub(super) fn lambdas(&self) -> usize {
        self.lambdas
    }

    /// Distance between the starts of consecutive stored spectra, in numbers: wavelengths and padding.
    pub(super) fn stride(&self) -> usize {
        self.stride
    }

    /// Number of incoming directions for which samples are stored. Grid directions that coincide are stored twice: each
    /// with the mean of their samples, then each with its original samples.
    pub(super) fn incoming(&self) -> usize {
        self.incoming
    }

    /// Reads a sample from the table of samples, at wavelength number `lambda` or at four wavelengths from there on. If
    /// no sample of the data is negative, the table holds natural logarithms.
    #[inline(always)]
    pub(super) fn numbers<T: Number>(&self, table: usize, place: u32, lambda: usize) -> T {
        T::read(&self.numbers, (table * self.outgoing + place as usize) * self.stride + lambda)
    }

    /// Converts a stored number (or each of four) to a sample: takes the exponential of a logarithm.
    #[inline(always)]
    pub(super) fn sample<T: Number>(&self, number: T) -> T {
        if self.is_logarithmic { number.exp() } else { number }
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.numbers)
    }
}

/// Returns the mean of the samples that are not masked; NaN if all samples are masked.
fn mean(samples: impl Iterator<Item = f32>) -> f64 {
    let (sum, count) = samples
        .filter(|sample| !sample.is_nan())
        .fold((0.0, 0_u32), |(sum, count), sample| (sum + f64::from(sample), count + 1));
    if count == 0 { f64::NAN } else { sum / f64::from(count) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_hold_samples_and_their_means() {
        let samples: Vec<f32> = (1..=24).map(|i| i as f32).collect();
        // Two entries of two incoming directions, three outgoing ones, two wavelengths.
        let incoming = Places { own: 2, same: &[vec![0, 1]] };
        let outgoing = Places { own: 3, same: &[vec![0, 2]] };
        let values = Values::new(&samples, 2, &incoming, &outgoing);
        assert!(values.is_logarithmic() && values.is_whole());
        let at =
            |table: usize, place: u32| [0, 1].map(|lambda| values.sample(values.numbers::<f32>(table, place, lambda)));
        let is_near = |found: [f32; 2], expected: [f32; 2]| {
            assert!(found.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < 1e-6), "{found:?} {expected:?}");
        };
        // Tables: both directions' mean twice, then each as stated. Places alike, except the second one.
        is_near(at(2, 1), [3.0, 4.0]);
        is_near(at(7, 4), [23.0, 24.0]);
        for place in [0, 2] {
            is_near(at(2, place), [3.0, 4.0]);
            is_near(at(0, place), [6.0, 7.0]);
            is_near(at(5, place), [18.0, 19.0]);
        }
        is_near(at(0, 1), [6.0, 7.0]);
        is_near(at(2, 3), [1.0, 2.0]);
    }

    #[test]
    fn masked_samples_are_no_part_of_a_mean() {
        let one = Places { own: 1, same: &[] };
        let at = |samples: &[f32], same: &[Vec<u32>]| {
            let values = Values::new(samples, 1, &one, &Places { own: 4, same });
            [0, 1, 2, 3].map(|place| values.numbers::<f32>(0, place, 0))
        };
        let samples = [2.0, f32::NAN, 0.0, -4.0];
        assert_eq!(at(&samples, &[vec![0, 1]])[..2], [2.0, 2.0]);
        assert_eq!(at(&samples, &[vec![1, 2]])[1..], [0.0, 0.0, -4.0]);
        assert!(at(&samples, &[])[1].is_nan());
        let values = Values::new(&samples, 1, &one, &Places { own: 4, same: &[] });
        assert!(!values.is_logarithmic() && !values.is_whole());
        let values = Values::new(&[2.0, 0.0, 1.0, 4.0], 1, &one, &Places { own: 4, same: &[] });
        assert_eq!(values.numbers::<f32>(0, 1, 0), f32::NEG_INFINITY);
        assert!(values.is_logarithmic() && !values.is_whole());
    }
}
