//! Scattered samples as a material is compared with them: at their own directions, on the wavelengths of the tensor.

use super::incidences::Incidence;
use super::noise::{Own, Rejection};
use crate::domain::vector::Vector;
use crate::domain::{Direction, Domain, Quantity};
use crate::formats::Scattered;
use crate::projection::resampling::Channels;

/// Scattered samples at their own directions, and which of them were rejected.
#[derive(Clone, Debug)]
pub struct ScatteredSamples {
    pub(super) directions: Vec<(Vector, Vector)>,
    /// The file states incoming directions only: they are kept where outgoing directions are otherwise.
    pub(super) is_turned: bool,
    pub(super) has_incoming: bool,
    pub(super) has_outgoing: bool,
    pub(super) domain: Domain,
    pub(super) channels: Channels,
    pub(super) quantity: Quantity,
    pub(super) incidences: Vec<Incidence>,
    /// In increasing order of positions.
    pub(super) rejected: Vec<Rejection>,
}

impl ScatteredSamples {
    /// The number of directions, or of pairs of them.
    #[allow(clippy::len_without_is_empty, reason = "scattered samples without any are refused before")]
    pub fn len(&self) -> usize {
        self.directions.len()
    }

    /// Values of a sample on the wavelengths of the tensor.
    pub fn width(&self) -> usize {
        self.channels.to()
    }

    /// Values that were rejected, on the wavelengths of the tensor.
    pub fn rejected_values(&self) -> u64 {
        (self.rejected.len() * (self.width() / Own(&self.channels).width())) as u64
    }

    /// Incoming directions of the samples `from..to`; those of isotropic data lie above the x axis. `None` without any.
    pub fn incoming(&self, from: usize, to: usize) -> Option<Vec<Direction>> {
        let of = |pair: &(Vector, Vector)| Direction::from_unit(if self.is_turned { pair.1 } else { pair.0 });
        self.has_incoming.then(|| self.directions[from..to].iter().map(of).collect())
    }

    /// Outgoing directions of the samples `from..to`. `None` without any.
    pub fn outgoing(&self, from: usize, to: usize) -> Option<Vec<Direction>> {
        let of = |pair: &(Vector, Vector)| Direction::from_unit(pair.1);
        self.has_outgoing.then(|| self.directions[from..to].iter().map(of).collect())
    }

    /// The samples by incoming direction; over all, where each has its own.
    pub fn incidences(&self) -> &[Incidence] {
        &self.incidences
    }

    /// Weights that make the sum of the values under an incidence its light, and whether they are the areas that the samples
    /// stand for: they are not in a plane of incidence, nor where each sample has its own incidence.
    pub fn weights(&self, incidence: &Incidence) -> (Vec<f64>, bool) {
        incidence.weights(&self.directions, self.domain, self.quantity.has_cosine())
    }

    /// Rejected values of the samples `from..to`: their places in what [`write`](Self::write) writes, increasing, and whether
    /// they lie together with others.
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

    /// Writes the values of the samples `from..to` of `scattered` into `out`, `[sample, wavelength]`, NaN where they are
    /// missing or beyond the directions of the tensor.
    pub fn write(&self, scattered: &Scattered, from: usize, to: usize, out: &mut [f32]) {
        self.write_values(&scattered.values, from, to, out);
    }

    /// Writes the standard uncertainties of the values that [`write`](Self::write) writes, NaN where none is stated: of
    /// a mean over a band their mean, as if the errors of its values were common to them. False where the file states
    /// none.
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
