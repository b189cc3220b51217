//! Codes the exactly kept coefficients of the paper's policies into file parts, and decodes them.

use super::header::{Header, plan_of};
use super::parts::Parts;
use super::policy::Policy;
use super::rows::coding_order;
use crate::codec::{ChunkKind, Class, CodecError, Decoder, Encoder, Payload, Rows, code_coefficients};
use crate::domain::{Axis, ErrorReport, Measurement};
use crate::transform::{AxisTransform, Plan};

/// Builds the header and the chunks of a file that stores the kept coefficients exactly; a coefficient of 0 is a
/// dropped one.
pub(super) fn parts_of(
    measurement: &Measurement,
    (policy, transforms): (Policy, &[AxisTransform]),
    floor: f32,
    classes: Option<(ChunkKind, Vec<u8>)>,
    rows: &Rows,
    kept: Vec<f32>,
) -> Parts {
    let count = kept.iter().filter(|&&c| c != 0.0).count() as u64;
    let mut bits: Vec<i32> = kept.into_iter().map(|c| if c == 0.0 { 0 } else { c.to_bits() as i32 }).collect();
    let mut encoder = Encoder::default();
    code_coefficients(&mut encoder, rows, Payload::Float, &mut bits);
    let samples = measurement.tensor.samples();
    let header = Header {
        transforms: transforms.to_vec(),
        classes: classes.as_ref().map(|(kind, _)| *kind),
        floor,
        kept: count,
        errors: ErrorReport::measure(samples, samples, f64::from(floor)),
        ..Header::of(measurement, policy)
    };
    let chunks = classes.into_iter().chain([(ChunkKind::Coefficients, encoder.finish())]).collect();
    Parts { header, chunks }
}

/// Decodes the exactly kept coefficients of a file, row-major, and returns them with their transform plan.
pub(super) fn coefficients_of(
    header: &Header,
    classes: Option<&[Class]>,
    coded: &[u8],
) -> Result<(Plan, Vec<f32>), CodecError> {
    let plan = plan_of(header)?;
    let mut bits = vec![0_i32; header.axes.iter().map(Axis::len).product()];
    let rows = coding_order(&header.axes, &plan, classes);
    code_coefficients(&mut Decoder::new(coded), &rows, Payload::Float, &mut bits);
    Ok((plan, bits.into_iter().map(|bits| f32::from_bits(bits as u32)).collect()))
}
