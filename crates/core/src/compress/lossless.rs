//! Every bit of every sample, or of the numbers of which samples are a multiple: no transform, the masked samples filled so that they cost little.

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

/// Numbers as a file states them, each beside its sample, and what samples are times them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers<'a> {
    /// The numbers, NaN = masked.
    pub values: &'a [f32],
    /// A sample is `factor` times its number, rounded to f32.
    pub factor: f64,
}

impl Numbers<'_> {
    /// Returns true where the factor makes just these samples of the numbers.
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
        has_classes: classes.is_some(),
        floor,
        factor,
        straight_lines: settings.straight_lines,
        between: settings.between.stated(),
        has_lobe: settings.lobe.is_some(),
        lobe: settings.lobe.clone(),
        ..Header::of(measurement, Policy::Lossless)
    };
    let chunks = classes.into_iter().chain([(ChunkKind::Exact, encoder.finish())]).collect();
    finish(Parts { header, chunks }, measurement, settings.metadata.as_deref())
}
