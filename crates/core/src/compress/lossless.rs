//! Every bit of every sample: no transform, the masked samples filled so that they cost little.

use super::classes::classes_chunk;
use super::compressed::Compressed;
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

pub(crate) fn compress(
    measurement: &Measurement,
    settings: &Settings,
    floor: f32,
    progress: &dyn Progress,
) -> Result<Compressed, CompressError> {
    let axes = measurement.tensor.axes();
    let mut samples = measurement.tensor.samples().to_vec();
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
        straight_lines: settings.straight_lines,
        ..Header::of(measurement, Policy::Lossless)
    };
    let chunks = classes.into_iter().chain([(ChunkKind::Exact, encoder.finish())]).collect();
    finish(Parts { header, chunks }, measurement, settings.metadata.as_deref())
}
