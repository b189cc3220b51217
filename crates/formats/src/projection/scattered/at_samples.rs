//! Scattered samples as a material is compared with them: at their own directions, on the wavelengths of the tensor.

use super::noise::Own;
use crate::domain::vector::Vector;
use crate::domain::{Direction, Domain};
use crate::formats::Scattered;
use crate::projection::resampling::Channels;

/// Scattered samples at their own directions, without those that were rejected.
#[derive(Clone, Debug)]
pub struct ScatteredSamples {
    pub(super) directions: Vec<(Vector, Vector)>,
    /// The file states incoming directions only: they are kept where outgoing directions are otherwise.
    pub(super) is_turned: bool,
    pub(super) has_incoming: bool,
    pub(super) has_outgoing: bool,
    pub(super) domain: Domain,
    pub(super) channels: Channels,
    /// Positions `[row, own channel]`, in increasing order.
    pub(super) rejected: Vec<usize>,
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

    /// Writes the values of the samples `from..to` of `scattered` into `out`, `[sample, wavelength]`, NaN where they are
    /// missing, rejected, or beyond the directions of the tensor.
    pub fn write(&self, scattered: &Scattered, from: usize, to: usize, out: &mut [f32]) {
        let own = Own(&self.channels);
        let (width, given) = (own.width(), self.channels.from());
        let first = self.rejected.partition_point(|&position| position < from * width);
        let mut rejected = self.rejected[first..].iter().copied().peekable();
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
                own.write(&scattered.values[number * given..][..given], &mut wide, &mut row);
            }
            while let Some(position) = rejected.next_if(|&position| position < (number + 1) * width) {
                row[position - number * width] = f32::NAN;
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
