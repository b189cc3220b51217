//! Last step of every policy: decodes the parts of a file again, and writes the measured errors into its header.

use super::below_floor::BelowFloor;
use super::compressed::{Compressed, Ranked};
use super::decode::{open, samples_behind};
use super::effort::Effort;
use super::error::CompressError;
use super::light::Light;
use super::metadata::metadata_with_labels;
use super::parts::{Parts, assemble};
use super::rd::levels;
use super::refusal;
use super::setting_error::SettingError;
use crate::domain::{ErrorReport, Measurement, Tensor};

/// Decodes the parts of a file again, measures the errors, and writes the file that states them. Rejects a file that no
/// reader accepts, because a sample exceeds float32 or a header number is out of range.
pub(super) fn finish(
    mut parts: Parts,
    measurement: &Measurement,
    metadata: Option<&str>,
) -> Result<Compressed, CompressError> {
    let decoded = levels::insert_and_decode(&mut parts, measurement)
        .and_then(|whole| samples_behind(&parts.header, |kind| parts.chunk(kind), whole))
        .map_err(|e| refusal::undecodable(&parts.header, e))?;
    if let Some(at) = decoded.iter().position(|sample| sample.is_infinite()) {
        return Err(refusal::beyond_float32(&parts.header, at, measurement.tensor.samples()[at]));
    }
    let floor = f64::from(parts.header.floor);
    parts.header.errors =
        ErrorReport::at_directions(measurement.tensor.axes(), measurement.tensor.samples(), &decoded, floor);
    let below_floor = BelowFloor::measure(measurement.tensor.samples(), &decoded, parts.header.floor);
    let light = Light::of(measurement.quantity, measurement.tensor.axes());
    let light = light.map(|light| light.report(measurement.tensor.samples(), &decoded));
    let decoded = Tensor::new(measurement.tensor.axes().to_vec(), decoded).map_err(SettingError::Tensor)?;
    let decoded = Some(Measurement { tensor: decoded, ..*measurement });
    let metadata = metadata_with_labels(&parts.header.axes, metadata);
    let bytes = assemble(&parts, metadata.as_deref());
    open(&bytes).map_err(|e| refusal::undecodable(&parts.header, e))?;
    let mut summary = parts.header.summary(metadata);
    summary.axes = measurement.tensor.axes().to_vec();
    let ranking =
        vec![Ranked { basis: summary.basis.clone(), bytes: bytes.len() as u64, er_l2: Some(summary.errors.er_l2) }];
    Ok(Compressed {
        bytes,
        decoded,
        summary,
        below_floor,
        light,
        colour: None,
        ranking,
        noise: None,
        effort: Effort::default(),
    })
}
