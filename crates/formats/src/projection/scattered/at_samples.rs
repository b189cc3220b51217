//! Scattered samples for comparison with a material: at their own directions, on the wavelengths of the tensor.

use super::incidences::Incidence;
use super::noise::{Own, Rejection};
use crate::domain::vector::Vector;
use crate::domain::{Direction, Domain, Quantity};
use crate::formats::Scattered;
use crate::projection::resampling::Channels;

/// Scattered samples of a file at their own directions, with marks of the samples rejected as outliers.
#[derive(Clone, Debug)]
pub struct ScatteredSamples {
    pub(super) directions: Vec<(Vector, Vector)>,
    /// True if the file states incoming directions only, which are then stored in place of the outgoing directions.
    pub(super) is_turned: bool,
    pub(super) has_incoming: bool,
    pub(super) has_outgoing: bool,
    pub(super) domain: Domain,
    pub(super) channels: Channels,
    pub(super) quantity: Quantity,
    pub(super) incidences: Vec<Incidence>,
    /// Measured values rejected as outliers, in increasing order of their positions in the array `[sample, channel]` of
    /// measured values.
    pub(super) rejected: Vec<Rejection>,
}

impl ScatteredSamples {
    /// Returns the number of samples: directions, or pairs of incoming and outgoing directions.
    #[allow(clippy::len_without_is_empty, reason = "scattered samples without any are refused before")]
    pub fn len(&self) -> usize {
        self.directions.len()
    }

    /// Returns the number of values of a sample: the number of wavelengths of the tensor.
    pub fn width(&self) -> usize {
        self.channels.to()
    }

    /// Returns the number of values rejected as outliers. If a lamp spectrum multiplies the single value of a sample, a
    /// rejected value counts once for each wavelength of the tensor.
    pub fn rejected_values(&self) -> u64 {
        (self.rejected.len() * (self.width() / Own(&self.channels).width())) as u64
    }

    /// Returns the incoming directions of the samples `from..to`; `None` if the quantity has none. Those of isotropic
    /// data have azimuth 0.
    pub fn incoming(&self, from: usize, to: usize) -> Option<Vec<Direction>> {
        let of = |pair: &(Vector, Vector)| Direction::from_unit(if self.is_turned { pair.1 } else { pair.0 });
        self.has_incoming.then(|| self.directions[from..to].iter().map(of).collect())
    }

    /// Returns the outgoing directions of the samples `from..to`; `None` if the quantity has none.
    pub fn outgoing(&self, from: usize, to: usize) -> Option<Vec<Direction>> {
        let of = |pair: &(Vector, Vector)| Direction::from_unit(pair.1);
        self.has_outgoing.then(|| self.directions[from..to].iter().map(of).collect())
    }

    /// Returns the samples grouped by incoming direction, or as a single group if almost every sample has its own.
    pub fn incidences(&self) -> &[Incidence] {
        &self.incidences
    }

    /// Returns one weight for each sample under an incoming direction; the weighted sum of the values approximates the
    /// integral over outgoing directions. Also returns true if the weights are solid angles. They are not in a plane of
    /// incidence, nor if each sample has its own incoming direction.
    pub fn weights(&self, incidence: &Incidence) -> (Vec<f64>, bool) {
        incidence.weights(&self.directions, self.domain, self.quantity.has_cosine())
    }

    /// Yields the outliers among the samples `from..to`, as increasing positions in the array that
    /// [`write`](Self::write) fills for these samples. Each comes with true if other outliers lie close to it.
    pub fn rejected(&self, from: usize, to: usize) -> impl Iterator<Item = (usize, bool)> + '_ {
        let own = Own(&self.channels).width();
        let copies = self.width() / own;
        let at = |row: usize| self.rejected.partition_point(|rejection| rejection.position < row * own);
        let places = move |rejection: &Rejection| {
            let (first, is_together) = ((rejection.position - from * own) * copies, rejection.is_together);
            (first..first + copies).map(move |place| (place, is_together))
        };
        self.rejected[at(from)..at(to)].iter().flat_map(places)
    }

    /// Writes the values of the samples `from..to` into `out`, `[sample, wavelength]`. Missing values and samples
    /// outside the directions of the tensor become NaN.
    pub fn write(&self, scattered: &Scattered, from: usize, to: usize, out: &mut [f32]) {
        self.write_values(&scattered.values, from, to, out);
    }

    /// Writes the standard uncertainties of the samples `from..to` into `out`, `[sample, wavelength]`. Returns false if
    /// the file states no uncertainties.
    ///
    /// If a wavelength of `out` is the mean of several wavelengths of the file, it gets the mean of their
    /// uncertainties, as if errors were fully correlated. Samples outside the directions of the tensor become NaN.
    pub(crate) fn write_sigma(&self, scattered: &Scattered, from: usize, to: usize, out: &mut [f32]) -> bool {
        let sigma = scattered.sigma.as_ref();
        sigma.inspect(|sigma| self.write_values(sigma, from, to, out)).is_some()
    }

    fn write_values(&self, values: &[f32], from: usize, to: usize, out: &mut [f32]) {
        let own = Own(&self.channels);
        let (width, given) = (own.width(), self.channels.from());
        let (mut wide, mut row) = (Vec::new(), vec![0.0_f32; width]);
        for (number, out) in (from..to).zip(out.chunks_exact_mut(self.width())) {
            let is_beyond = match self.domain {
                Domain::Hemisphere => self.directions[number].1[2] < 0.0,
                Domain::Lower => self.directions[number].1[2] > 0.0,
                Domain::Sphere => false,
            };
            if is_beyond {
                row.fill(f32::NAN);
            } else {
                own.write(&values[number * given..][..given], &mut wide, &mut row);
            }
            match &self.channels {
                Channels::Multiplied(factors) => {
                    out.iter_mut().zip(factors).for_each(|(out, f)| *out = (f64::from(row[0]) * f) as f32);
                }
                _ => out.copy_from_slice(&row),
            }
        }
    }
}
