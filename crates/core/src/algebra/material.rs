//! Sums and dot products of compressed materials: files in, a file out.
//!
//! Policies `conventional`, `generic` and `adaptive` store f32 coefficients of the samples themselves. Coefficients of
//! a sum are sums of coefficients, each rounded once to f32. No thresholding or quantisation follows, so only f32
//! rounding separates the file from the exact sum of the decoded operands.
//!
//! Policy `rd` stores logarithms, and lossless files store samples. Such operands are decoded, combined and compressed
//! again, which adds an error.
//!
//! In both cases the added error is measured and written to the header of the result. It compares the decoded result
//! with the exact combination of the decoded operands, not with the original measurements.

use super::error::AlgebraError;
use crate::compress::{
    self, Between, CompressError, Compressed, Kept, Policy, SettingError, Settings, Summary, payload_digest,
};
use crate::domain::{Axis, ErrorReport, Measurement, Progress, Tensor, TensorError, Unit};
use crate::transform::Plan;
use serde::Serialize;
use serde_json::{Value, json};

/// A compressed material and its factor in a weighted sum.
#[derive(Clone, Copy, Debug)]
pub struct Operand<'a> {
    /// Bytes of the compressed file of the material.
    pub bytes: &'a [u8],
    /// Factor by which the samples of the material are multiplied.
    pub weight: f64,
}

/// Choice of when a weighted sum of materials is compressed anew from its samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recompress {
    /// New compression of the sum of materials only if their stored coefficients cannot be added directly.
    IfNeeded,
    /// New compression of the sum of materials from its samples in every case, so that it keeps the error bound of the
    /// settings given for the new file.
    Always,
}

/// Form of the data from which a sum or dot product of materials was computed: stored coefficients or decoded samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The sum or dot product of materials was computed from the coefficients stored in their files, without decoding
    /// them.
    Coefficients,
    /// The sum or dot product of materials was computed from their decoded samples.
    Samples,
}

/// Description of one material of a weighted sum, taken from its file header.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OperandReport {
    /// `b3-` followed by the BLAKE3 digest of the material's file without its metadata.
    pub payload_digest: String,
    /// Factor by which the samples of the material are multiplied.
    pub weight: f64,
    /// Compression policy (rule by which coefficients are kept) of the material's file.
    pub policy: Policy,
    /// Name of the spectral basis of the material's file.
    pub basis: String,
    /// Relative L2 error er(L2) of the material against its original measurement, from the file header.
    pub er_l2: f64,
    /// Largest absolute error of the material against its original measurement, from the file header; 0 for lossless
    /// files.
    pub max_absolute_error: f64,
}

/// Result of [`combine`]: the weighted sum of materials as a new file, with a report.
#[derive(Clone, Debug)]
pub struct Combined {
    /// New file with the weighted sum of the materials. Its summary gives only the errors that adding them caused, not
    /// the errors of the added materials.
    pub compressed: Compressed,
    /// Form of the data from which the weighted sum was computed: stored coefficients or decoded samples of the
    /// materials.
    pub method: Method,
    /// Reason why the weighted sum of the materials was computed from their decoded samples; `None` if their stored
    /// coefficients were added directly.
    pub reason: Option<String>,
    /// Descriptions of the materials that enter the weighted sum, in the order given.
    pub operands: Vec<OperandReport>,
    /// Bound `Σ |weight| · max_absolute_error` on the error that the sum inherits from the compression of its operands.
    /// The error caused by the addition is not included.
    pub inherited_absolute_error: f64,
}

/// Dot product of the samples of two materials, with a report on how it was computed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DotReport {
    /// Sum of the products of corresponding samples, with equal weights, over the samples masked in neither material.
    pub dot: f64,
    /// Number of sample pairs that entered the dot product.
    pub samples: u64,
    /// Number of samples left out because at least one material masks them.
    pub masked_samples: u64,
    /// Units of the two materials; the unit of the dot product is their product.
    pub units: [Unit; 2],
    /// Form of the data from which the dot product was computed: stored coefficients or decoded samples of the
    /// materials.
    pub method: Method,
}

/// Computes the weighted sum `Σ weight · material` of compressed materials, sample by sample. All must have the same
/// quantity, unit, sampling and axes. A sample is masked if any operand masks it.
///
/// If all operands store coefficients in the same bases, those are added. The file then has the policy of the first
/// operand, and only the metadata of `settings` are used. Otherwise, or with [`Recompress::Always`], the samples are
/// compressed with `settings`.
///
/// The interpolation between incidences is that of the operands if they agree and all weights are positive, else that
/// of `settings`. Metadata, if any, list the operands under `combination`.
pub fn combine(
    operands: &[Operand<'_>],
    settings: &Settings,
    recompress: Recompress,
    progress: &dyn Progress,
) -> Result<Combined, AlgebraError> {
    let (reports, summaries) = inspect(operands)?;
    let metadata = settings.metadata.as_deref().map(|text| with_operands(text, &reports)).transpose()?;
    let (kept, reason) = match (recompress, common(operands)?) {
        (Recompress::Always, _) => (None, Some("compressed again, as asked".to_owned())),
        (Recompress::IfNeeded, Ok(kept)) => (Some(kept), None),
        (Recompress::IfNeeded, Err(reason)) => (None, Some(reason)),
    };
    let measurement = exact(operands, &summaries, progress)?;
    let between = common_between(operands, &summaries).unwrap_or(settings.between);
    let compressed = if let Some(kept) = &kept {
        let mut sums = vec![0.0_f64; measurement.tensor.len()];
        for (operand, at) in operands.iter().zip(1..) {
            let coefficients = Kept::coefficients(operand.bytes).map_err(|e| undecoded(at, e))?;
            for (sum, c) in sums.iter_mut().zip(coefficients) {
                *sum += operand.weight * f64::from(c);
            }
        }
        kept.write(&measurement, sums, between, metadata.as_deref())?
    } else {
        compress::compress(&measurement, &Settings { metadata, between, ..settings.clone() }, progress)?
    };
    progress.report(1.0);
    let inherited = reports.iter().map(|report| report.weight.abs() * report.max_absolute_error).sum();
    Ok(Combined {
        compressed,
        method: if kept.is_some() { Method::Coefficients } else { Method::Samples },
        reason,
        operands: reports,
        inherited_absolute_error: inherited,
    })
}

/// Computes the dot product `Σ a·b` over the samples of two compressed materials on the same axes; their quantities and
/// units may differ.
///
/// If both store coefficients in the same bases and no sample is masked, the result is `aᵀ·(G·b)` over the kept
/// coefficients of `a`. G is the Gram matrix of the synthesis functions, applied as two passes of the transform over
/// `b`. Otherwise both are decoded.
pub fn dot(a: &[u8], b: &[u8]) -> Result<DotReport, AlgebraError> {
    let operands = [a, b].map(|bytes| Operand { bytes, weight: 1.0 });
    let (_, summaries) = read_headers(&operands)?;
    check_axes(&summaries)?;
    let units = [summaries[0].unit, summaries[1].unit];
    let samples = summaries[0].axes.iter().map(Axis::len).product::<usize>() as u64;
    if let Ok(kept) = common(&operands)?
        && !kept.has_masks
        && let Some(dot) = dot_of_coefficients(&kept, &summaries[0].axes, a, b)?
    {
        return Ok(DotReport { dot, samples, masked_samples: 0, units, method: Method::Coefficients });
    }
    let (left, right) = (decode(a, 1)?, decode(b, 2)?);
    let (mut dot, mut entered) = (0.0, 0_u64);
    for (&x, &y) in left.tensor.samples().iter().zip(right.tensor.samples()) {
        if !(x.is_nan() || y.is_nan()) {
            dot += f64::from(x) * f64::from(y);
            entered += 1;
        }
    }
    Ok(DotReport { dot, samples: entered, masked_samples: samples - entered, units, method: Method::Samples })
}

/// Computes the dot product of two materials from their stored coefficients; `None` if intermediate values exceed the
/// range of f32.
fn dot_of_coefficients(kept: &Kept, axes: &[Axis], a: &[u8], b: &[u8]) -> Result<Option<f64>, AlgebraError> {
    let plan = Plan::new(axes, &kept.transforms).map_err(|e| CompressError::Setting(e.into()))?;
    let left = Kept::coefficients(a).map_err(|e| undecoded(1, e))?;
    let mut right = Kept::coefficients(b).map_err(|e| undecoded(2, e))?;
    plan.inverse(&mut right);
    plan.inverse_transposed(&mut right);
    let dot: f64 =
        left.iter().zip(&right).filter(|(a, _)| **a != 0.0).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
    Ok(dot.is_finite().then_some(dot))
}

/// Reads the headers of all operands and checks that they agree in quantity, unit, sampling and axes.
fn inspect(operands: &[Operand<'_>]) -> Result<(Vec<OperandReport>, Vec<Summary>), AlgebraError> {
    let (reports, summaries) = read_headers(operands)?;
    let Some((first, others)) = summaries.split_first() else { return Err(AlgebraError::Empty) };
    for (other, at) in others.iter().zip(2..) {
        let unlike = |what, found: String, expected: String| Err(AlgebraError::Unlike { at, what, found, expected });
        if other.quantity != first.quantity {
            return unlike("quantity", other.quantity.to_string(), first.quantity.to_string());
        }
        if other.unit != first.unit {
            return unlike("unit", other.unit.to_string(), first.unit.to_string());
        }
        if other.sampling != first.sampling {
            return unlike("sampling", other.sampling.to_string(), first.sampling.to_string());
        }
    }
    check_axes(&summaries)?;
    Ok((reports, summaries))
}

fn read_headers(operands: &[Operand<'_>]) -> Result<(Vec<OperandReport>, Vec<Summary>), AlgebraError> {
    let mut reports = Vec::new();
    let mut summaries = Vec::new();
    for (operand, at) in operands.iter().zip(1..) {
        if !operand.weight.is_finite() {
            return Err(AlgebraError::NotFinite { what: "weight", index: at, found: operand.weight });
        }
        let summary = compress::inspect(operand.bytes).map_err(|e| undecoded(at, e))?;
        if summary.lobe.is_some() {
            return Err(AlgebraError::Lobe { at });
        }
        let digest = payload_digest(operand.bytes).map_err(|e| undecoded(at, e))?;
        reports.push(OperandReport {
            payload_digest: format!("b3-{}", digest.to_hex()),
            weight: operand.weight,
            policy: summary.policy,
            basis: summary.basis.clone(),
            er_l2: summary.errors.er_l2,
            max_absolute_error: summary.errors.max_absolute_error,
        });
        summaries.push(summary);
    }
    Ok((reports, summaries))
}

/// Checks that all materials have the same axes. Labels of an index axis (an axis of numbered entries) may be missing
/// in some of them.
fn check_axes(summaries: &[Summary]) -> Result<(), AlgebraError> {
    let Some((first, others)) = summaries.split_first() else { return Ok(()) };
    let describe = |axes: &[Axis]| axes.iter().map(Axis::describe).collect::<Vec<_>>().join(" × ");
    for (other, at) in others.iter().zip(2..) {
        let same = |(a, b): (&Axis, &Axis)| match (a, b) {
            (Axis::Index { count, labels }, Axis::Index { count: other, labels: others }) => {
                count == other && (labels == others || labels.is_empty() || others.is_empty())
            }
            _ => a == b,
        };
        if first.axes.len() == other.axes.len() && first.axes.iter().zip(&other.axes).all(same) {
            continue;
        }
        let (mut found, mut expected) = (describe(&other.axes), describe(&first.axes));
        if found == expected {
            // The short descriptions are equal: show all fields.
            (found, expected) = (format!("{:?}", other.axes), format!("{:?}", first.axes));
        }
        return Err(AlgebraError::Unlike { at, what: "axes", found, expected });
    }
    Ok(())
}

/// Returns the layout of stored coefficients that all operands share. The inner error gives the reason why they share
/// none.
///
/// `has_masks` is true if any operand has masked samples.
fn common(operands: &[Operand<'_>]) -> Result<Result<Kept, String>, AlgebraError> {
    let mut common: Option<Kept> = None;
    for (operand, at) in operands.iter().zip(1..) {
        let Some(kept) = Kept::of(operand.bytes).map_err(|e| undecoded(at, e))? else {
            return Ok(Err(format!(
                "the file of material {at} holds no coefficients to add (policy rd and lossless files hold \
                 logarithms or the samples)"
            )));
        };
        match &mut common {
            None => common = Some(kept),
            Some(first) if first.transforms == kept.transforms => first.has_masks |= kept.has_masks,
            Some(_) => {
                return Ok(Err(format!(
                    "the coefficients of material {at} are in other bases than those of material 1"
                )));
            }
        }
    }
    Ok(common.ok_or_else(|| "the list of materials to be summed is empty".to_owned()))
}

/// Returns the common rule for interpolation between incoming directions of the materials in a weighted sum. Returns
/// `None` if the rules differ or the weight of a material is not positive.
fn common_between(operands: &[Operand<'_>], summaries: &[Summary]) -> Option<Between> {
    let (first, others) = summaries.split_first()?;
    let is_common = others.iter().all(|other| other.between == first.between);
    (is_common && operands.iter().all(|operand| operand.weight > 0.0)).then_some(first.between)
}

/// Adds the decoded samples of all operands, times their weights, in f64, and rounds each sum once to f32.
fn exact(
    operands: &[Operand<'_>],
    summaries: &[Summary],
    progress: &dyn Progress,
) -> Result<Measurement, AlgebraError> {
    let Some(first) = summaries.first() else { return Err(AlgebraError::Empty) };
    let mut sums = vec![0.0_f64; first.axes.iter().map(Axis::len).product()];
    for (operand, at) in operands.iter().zip(1..) {
        if progress.is_cancelled() {
            return Err(CompressError::Cancelled(crate::domain::Cancelled).into());
        }
        let decoded = decode(operand.bytes, at)?;
        for (sum, &sample) in sums.iter_mut().zip(decoded.tensor.samples()) {
            *sum += operand.weight * f64::from(sample);
        }
    }
    let mut samples = Vec::with_capacity(sums.len());
    for (index, &sum) in sums.iter().enumerate() {
        let sample = sum as f32;
        if sample.is_infinite() {
            return Err(AlgebraError::Overflow { index, found: sum });
        }
        samples.push(sample);
    }
    let labelled = |at: usize| {
        let own = summaries.iter().map(|summary| &summary.axes[at]);
        let mut named = own.filter(|axis| matches!(axis, Axis::Index { labels, .. } if !labels.is_empty()));
        named.next().unwrap_or(&first.axes[at]).clone()
    };
    let axes = (0..first.axes.len()).map(labelled).collect();
    let unfit = |error: TensorError| CompressError::Setting(error.into());
    let tensor = Tensor::new(axes, samples).map_err(unfit)?;
    let measurement = Measurement::new(first.quantity, first.unit, first.sampling, tensor);
    Ok(measurement.map_err(|e| unfit(e.into()))?)
}

fn decode(bytes: &[u8], at: usize) -> Result<Measurement, AlgebraError> {
    Ok(compress::decode(bytes).map_err(|e| undecoded(at, e))?.measurement)
}

fn undecoded(at: usize, source: compress::DecodeError) -> AlgebraError {
    AlgebraError::Decode { at, source }
}

/// Inserts the descriptions of the operands into JSON metadata, as the property `combination`.
fn with_operands(text: &str, operands: &[OperandReport]) -> Result<String, AlgebraError> {
    let Ok(Value::Object(mut object)) = serde_json::from_str(text) else {
        return Err(CompressError::Setting(SettingError::MetadataObject).into());
    };
    object.insert("combination".to_owned(), json!(operands));
    Ok(Value::Object(object).to_string())
}

impl Combined {
    /// Returns the errors caused by the addition: of the decoded result against the exact weighted sum of the decoded
    /// operands.
    pub fn added(&self) -> &ErrorReport {
        &self.compressed.summary.errors
    }
}
