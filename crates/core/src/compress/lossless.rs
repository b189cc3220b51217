//! Lossless policy: every bit of every sample, or of the numbers that give the samples times one factor. No transform;
//! masked samples are filled with values that cost few bits.

use super::classes::classes_chunk;
use super::compressed::Compressed;
use super::decode::scaled;
use super::error::CompressError;
use super::fill::fill;
use super::finish::finish;
use super::header::Header;
use super::parts::Parts;
use super::policy::Policy;
use super::rows::lanes;
use super::settings::Settings;
use crate::codec::{ChunkKind, Class, Encoder, code_exact};
use crate::domain::{Measurement, Progress};

/// Numbers that a measured file states, one for each sample, and the common factor that turns them into samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers<'a> {
    /// One number for each sample, as the measured file writes it, without the common factor that turns it into a
    /// sample; NaN if masked.
    pub values: &'a [f32],
    /// Common factor that turns the numbers of the measured file into samples: each sample is `factor` × number,
    /// rounded to f32.
    pub factor: f64,
}

impl Numbers<'_> {
    /// Returns true if the common factor times the number that the measured file states for a sample, rounded to f32,
    /// equals the sample bit for bit, for all samples.
    fn stand_for(&self, samples: &[f32]) -> bool {
        let is_same = |(&number, &sample): (&f32, &f32)| {
            number.is_nan() && sample.is_nan() || scaled(number, self.factor).to_bits() == sample.to_bits()
        };
        self.factor > 0.0
            && self.factor.is_finite()
            && self.values.len() == samples.len()
            && self.values.iter().zip(samples).all(is_same)
    }
}

pub(crate) fn compress(
    measurement: &Measurement,
    numbers: Option<Numbers<'_>>,
    settings: &Settings,
    floor: f32,
    progress: &dyn Progress,
) -> Result<Compressed, CompressError> {
    let axes = measurement.tensor.axes();
    let numbers = numbers.filter(|numbers| numbers.stand_for(measurement.tensor.samples()));
    let (values, factor) =
        numbers.map_or((measurement.tensor.samples(), 1.0), |numbers| (numbers.values, numbers.factor));
    let mut samples = values.to_vec();
    let mut classes: Vec<Class> =
        samples.iter().map(|s| if s.is_nan() { Class::Masked } else { Class::Positive }).collect();
    let classes = classes_chunk(axes, &mut classes);
    fill(axes, &mut samples);
    progress.step(0.1)?;
    let mut encoder = Encoder::default();
    code_exact(&mut encoder, lanes(axes), &mut samples);
    drop(samples);
    progress.step(0.6)?;
    let header = Header {
        classes: classes.as_ref().map(|(kind, _)| *kind),
        floor,
        factor,
        ..Header::of(measurement, Policy::Lossless).stating(settings)
    };
    let chunks = classes.into_iter().chain([(ChunkKind::Exact, encoder.finish())]).collect();
    finish(Parts { header, chunks }, measurement, settings.metadata.as_deref())
}
