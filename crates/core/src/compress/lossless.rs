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
use super::target::Target;
use crate::codec::{ChunkKind, Class, Encoder, code_exact};
use crate::domain::{Measurement, Progress, Silent};

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

/// Number of samples, for each byte of another file, that the lossless coder codes first to find out if its file is
/// larger. Noisy float32 samples take 2 to 3 bytes each. Raising it codes more samples of files that are not smaller,
/// and fewer files wholly.
const SAMPLES_PER_BYTE: f64 = 1.0 / 1.5;

/// Returns the size in bytes of the lossless file of a measurement if it is smaller than `bytes`, the size of another
/// file with equal `settings`. `numbers` are those that the measured file states.
///
/// Takes about as long as coding `bytes` / 1.5 samples, unless the lossless file is smaller or nearly so.
pub fn smaller_lossless(
    measurement: &Measurement,
    numbers: Option<Numbers<'_>>,
    settings: &Settings,
    bytes: usize,
) -> Result<Option<usize>, CompressError> {
    let samples = measurement.tensor.samples();
    let numbers = numbers.filter(|numbers| numbers.stand_for(samples));
    let samples = numbers.map_or(samples, |numbers| numbers.values);
    let lanes = lanes(measurement.tensor.axes());
    let first = ((bytes as f64 * SAMPLES_PER_BYTE) as usize).next_multiple_of(lanes.max(1));
    if let Some(first) = samples.get(..first) {
        // Masked samples are filled in the file; here one before stands in.
        let mut last = 0.0;
        let mut first: Vec<f32> = first.to_vec();
        for sample in &mut first {
            *sample = if sample.is_nan() { last } else { *sample };
            last = *sample;
        }
        let mut encoder = Encoder::default();
        code_exact(&mut encoder, lanes, &mut first);
        // The beginning of the samples is the beginning of the file's chunk.
        if encoder.finish().len() > bytes {
            return Ok(None);
        }
    }
    let settings =
        Settings { target: Target::Lossless, policy: Policy::Lossless, albedo_error: None, ..settings.clone() };
    let found = compress(measurement, numbers, &settings, 0.0, &Silent)?.bytes.len();
    Ok((found < bytes).then_some(found))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compress::{AUTO_BASIS, compress as compressed};
    use crate::domain::{Axis, Quantity, Sampling, Tensor, Unit, WavelengthGrid};
    use crate::numeric::random::half_open;
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    /// Spectra of equal values in runs of ten on average.
    fn runs() -> Measurement {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        let mut value = 0.5;
        let samples = (0..40 * 200).map(|_| {
            if half_open(&mut random) < 0.1 {
                value = 0.2 + 0.7 * half_open(&mut random);
            }
            value as f32
        });
        let samples: Vec<f32> = samples.collect();
        let axes = vec![
            Axis::Index { count: 40, labels: Vec::new() },
            Axis::Wavelength(WavelengthGrid::even(400.0, 2.0, 200).unwrap()),
        ];
        let tensor = Tensor::new(axes, samples).unwrap();
        Measurement::new(Quantity::Reflectance, Unit::Relative, Sampling::Average, tensor).unwrap()
    }

    #[test]
    fn a_lossless_file_that_is_smaller_is_found() {
        let m = runs();
        let of = |target| Settings { target, basis: AUTO_BASIS.to_owned(), ..Settings::default() };
        let lossless = compressed(&m, &of(Target::Lossless), &Silent).unwrap().bytes.len();
        let fine = of(Target::ErL2(1e-6));
        let lossy = compressed(&m, &fine, &Silent).unwrap().bytes.len();
        assert!(lossy > lossless, "{lossy} {lossless}");
        let found = |bytes| smaller_lossless(&m, None, &fine, bytes).unwrap();
        assert_eq!([lossy, lossless + 1].map(found), [Some(lossless); 2]);
        assert_eq!([lossless, lossless / 2, 100, 0].map(found), [None; 4]);
        // Masked samples and the numbers of a file count as in the file.
        let mut samples = m.tensor.samples().to_vec();
        samples[..900].fill(f32::NAN);
        let numbers: Vec<f32> = samples.iter().map(|sample| (sample * 1000.0).round()).collect();
        let samples = numbers.iter().map(|&number| scaled(number, 0.001)).collect();
        let m = Measurement { tensor: Tensor::new(m.tensor.axes().to_vec(), samples).unwrap(), ..m };
        let numbers = Numbers { values: &numbers, factor: 0.001 };
        let made = compress(&m, Some(numbers), &of(Target::Lossless), 0.0, &Silent).unwrap().bytes.len();
        assert_eq!(smaller_lossless(&m, Some(numbers), &fine, made + 1).unwrap(), Some(made));
        assert_eq!(smaller_lossless(&m, Some(numbers), &fine, made).unwrap(), None);
    }
}
