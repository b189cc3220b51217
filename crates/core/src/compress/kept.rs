//! Reads and writes the coefficients kept by the paper's policies. They are linear in the samples, so that sums of
//! coefficients are sums of samples.

use super::between::Between;
use super::classes::{classes_chunk, classes_of};
use super::compressed::Compressed;
use super::decode::open;
use super::error::CompressError;
use super::fill::settle;
use super::finish::finish;
use super::header::Header;
use super::kept_coefficients::{coefficients_of, parts_of};
use super::policy::Policy;
use super::rows::{clear_uncoded, coding_order};
use super::setting_error::SettingError;
use super::unreachable_error::UnreachableError;
use crate::codec::{ChunkKind, Class, CodecError};
use crate::domain::Measurement;
use crate::transform::{AxisTransform, Plan, SphereBasis};

/// Coding parameters of a file that keeps coefficients above a threshold exactly: rule of their selection (policy),
/// axis transforms, and presence of masked samples.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Kept {
    pub(crate) policy: Policy,
    pub(crate) transforms: Vec<AxisTransform>,
    pub(crate) has_masks: bool,
}

impl Kept {
    /// Reads the coding of a file that keeps coefficients of its samples. `None` if its policy keeps none, or if its
    /// triangles use a basis other than bio-Haar.
    pub(crate) fn of(bytes: &[u8]) -> Result<Option<Self>, CodecError> {
        let (Header { policy, transforms, classes, .. }, _) = open(bytes)?;
        let linear = match policy {
            Policy::Conventional | Policy::Generic | Policy::Adaptive => true,
            Policy::Rd | Policy::Lossless => false,
        };
        let known = |transform: &AxisTransform| match transform {
            AxisTransform::Sphere(basis) => *basis == SphereBasis::BioHaar,
            AxisTransform::Identity | AxisTransform::Line { .. } => true,
        };
        let known = transforms.iter().all(known);
        Ok((linear && known).then_some(Self { policy, transforms, has_masks: classes.is_some() }))
    }

    /// Decodes the coefficients of a file of kept coefficients, row-major, 0 for dropped ones.
    pub(crate) fn coefficients(bytes: &[u8]) -> Result<Vec<f32>, CodecError> {
        let (header, container) = open(bytes)?;
        let chunk = |kind| container.get(kind).map(|chunk| chunk.payload);
        let classes = classes_of(&header, chunk);
        Ok(coefficients_of(&header, classes.as_deref(), chunk(ChunkKind::Coefficients).unwrap_or_default())?.1)
    }

    /// Writes a file of the given coefficients, with `between` as its interpolation between incoming directions. Masked
    /// samples of `measurement` become masked in the file, and errors are measured against `measurement`.
    pub(crate) fn write(
        &self,
        measurement: &Measurement,
        mut coefficients: Vec<f64>,
        between: Between,
        metadata: Option<&str>,
    ) -> Result<Compressed, CompressError> {
        let axes = measurement.tensor.axes();
        let plan = Plan::new(axes, &self.transforms).map_err(SettingError::from)?;
        let samples = measurement.tensor.samples();
        let mut classes: Vec<Class> =
            samples.iter().map(|s| if s.is_nan() { Class::Masked } else { Class::Positive }).collect();
        let chunk = classes_chunk(axes, &mut classes);
        let classes = chunk.is_some().then_some(classes);
        if let Some(classes) = &classes {
            settle(axes, classes, &mut coefficients);
        }
        let mut kept: Vec<f32> = coefficients.into_iter().map(|c| c as f32).collect();
        if let Some(index) = kept.iter().position(|c| !c.is_finite()) {
            return Err(UnreachableError::Coefficient { index, found: kept[index] }.into());
        }
        let rows = coding_order(axes, &plan, classes.as_deref());
        clear_uncoded(&rows, &mut kept);
        drop(classes);
        let mut parts = parts_of(measurement, (self.policy, &self.transforms), 0.0, chunk, &rows, kept);
        parts.header.between = between.stated();
        finish(parts, measurement, metadata)
    }
}
