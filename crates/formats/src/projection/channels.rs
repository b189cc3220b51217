//! The channels of a file's samples, paired with the entries of the tensor's spectral axis.

use crate::domain::Axis;
use crate::formats::SpectralFactor;

/// One original channel and where it lies on the tensor's spectral axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Channel {
    sample: usize,
    factor: f64,
    entry: usize,
    /// The weight of the next entry.
    t: f64,
}

impl Channel {
    /// The value of a sample in its spectrum `source`, and that of the tensor's spectrum `target`.
    pub(super) fn pair(&self, source: &[f32], target: &[f32]) -> (f32, f32) {
        let found = if self.t == 0.0 {
            target[self.entry]
        } else {
            let (a, b) = (f64::from(target[self.entry]), f64::from(target[self.entry + 1]));
            (a + self.t * (b - a)) as f32
        };
        ((f64::from(source[self.sample]) * self.factor) as f32, found)
    }
}

/// How many channels a sample of the file has, and which of them (times the factor) lie on the tensor's axis.
pub(super) fn channels(
    own: Option<&Axis>,
    factor: Option<&SpectralFactor>,
    axis: Option<&Axis>,
) -> Option<(usize, Vec<Channel>)> {
    match (own, factor, axis) {
        (None, Some(joined), Some(Axis::Wavelength(to))) => {
            let found = joined.factors.iter().enumerate().filter_map(|(i, &factor)| {
                let (entry, t) = to.locate(joined.grid.at(i))?;
                Some(Channel { sample: 0, factor, entry, t })
            });
            (joined.factors.len() == joined.grid.len()).then(|| (1, found.collect()))
        }
        (Some(Axis::Wavelength(from)), None, Some(Axis::Wavelength(to))) => {
            let found = (0..from.len()).filter_map(|sample| {
                let (entry, t) = to.locate(from.at(sample))?;
                Some(Channel { sample, factor: 1.0, entry, t })
            });
            Some((from.len(), found.collect()))
        }
        (own, None, axis) if own == axis => {
            let width = own.map_or(1, Axis::len);
            Some((width, (0..width).map(|i| Channel { sample: i, factor: 1.0, entry: i, t: 0.0 }).collect()))
        }
        _ => None,
    }
}
