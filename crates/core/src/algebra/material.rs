//! Sums and dot products of compressed materials: files in, a file out.
//!
//! Policies conventional, generic and adaptive keep coefficients of the samples themselves, each as it was computed (f32).
//! The coefficients of a sum are the sums of coefficients, each rounded once: nothing is thresholded or quantised again,
//! and the file differs from the exact sum of the decoded operands by the rounding of f32 alone. Policy `rd` keeps
//! logarithms, and lossless samples: those are decoded, combined and compressed again, which adds an error of its own. What
//! was added is measured either way, on the decoded bytes of the result against the exact combination, and stands in the
//! file's header: the truth that it is measured against are the decoded operands, not the measurements behind them.

use super::error::AlgebraError;
use crate::compress::{
    self, Between, CompressError, Compressed, Kept, Policy, SettingError, Settings, Summary, payload_digest,
};
use crate::domain::{Axis, ErrorReport, Measurement, Progress, Tensor, TensorError, Unit};
use crate::transform::Plan;
use serde::Serialize;
use serde_json::{Value, json};

/// A material and its factor.
#[derive(Clone, Copy, Debug)]
pub struct Operand<'a> {
    /// The file.
    pub bytes: &'a [u8],
    /// What its samples are multiplied with.
    pub weight: f64,
}

/// When a combination is compressed again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recompress {
    /// Where coefficients cannot be added.
    IfNeeded,
    /// In any case: the settings are a promise.
    Always,
}

/// What was combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Kept coefficients, without decoding.
    Coefficients,
    /// Decoded samples.
    Samples,
}

/// What is known of an operand.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OperandReport {
    /// `b3-` and the BLAKE3 digest of the file without its metadata.
    pub payload_digest: String,
    /// Its factor.
    pub weight: f64,
    /// Its policy.
    pub policy: Policy,
    /// Its spectral basis.
    pub basis: String,
    /// Its own er(L2), as its file states it.
    pub er_l2: f64,
    /// Its own largest absolute error, as its file states it; 0 of lossless ones.
    pub max_absolute_error: f64,
}

/// A combination.
#[derive(Clone, Debug)]
pub struct Combined {
    /// The file; its errors are those that combining added.
    pub compressed: Compressed,
    /// What was combined.
    pub method: Method,
    /// Why samples were, where they were.
    pub reason: Option<String>,
    /// The operands, in order.
    pub operands: Vec<OperandReport>,
    /// `Σ |weight| · largest absolute error` of the operands: how far the exact combination of the files can be from that of
    /// their measurements. The error that was added comes on top.
    pub inherited_absolute_error: f64,
}

/// The sum of products of two materials' samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DotReport {
    /// Σ a·b over the samples that neither has masked, all weighing the same.
    pub dot: f64,
    /// Samples that entered.
    pub samples: u64,
    /// Samples that one of the two has masked.
    pub masked_samples: u64,
    /// The units of both: the sum is in their product.
    pub units: [Unit; 2],
    /// How it was computed.
    pub method: Method,
}

/// `Σ weight · material`, sample by sample; masked where an operand is. All have the same quantity, unit, sampling and axes.
///
/// Coefficients are added where all operands hold such of the same bases. The file then has the policy of the first, and
/// of `settings` only the metadata counts. Otherwise, or if `recompress` says so, `settings` decide. The interpolation between
/// incidences is that of the operands where they agree and none is subtracted. A combination that carries metadata names its
/// operands in it.
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

/// Σ over samples of two materials on the same axes; their quantities and units may differ.
///
/// Where both hold coefficients of the same bases and nothing is masked it is `aᵀ·(G·b)` over the coefficients that a has
/// kept, with G the Gram matrix of the synthesis functions (by two passes of the transform over b); otherwise both are decoded.
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

/// `None` where intermediate values leave f32.
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

/// The headers of all operands, which must be functions of the same kind.
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

/// The same axes; the labels of an index axis may be missing in some.
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
            // They differ in what a description leaves out.
            (found, expected) = (format!("{:?}", other.axes), format!("{:?}", first.axes));
        }
        return Err(AlgebraError::Unlike { at, what: "axes", found, expected });
    }
    Ok(())
}

/// What all operands keep coefficients of, masked where any is; or why there is no such thing.
fn common(operands: &[Operand<'_>]) -> Result<Result<Kept, String>, AlgebraError> {
    let mut common: Option<Kept> = None;
    for (operand, at) in operands.iter().zip(1..) {
        let Some(kept) = Kept::of(operand.bytes).map_err(|e| undecoded(at, e))? else {
            return Ok(Err(format!("material {at} does not hold coefficients of the samples themselves")));
        };
        match &mut common {
            None => common = Some(kept),
            Some(first) if first.transforms == kept.transforms => first.has_masks |= kept.has_masks,
            Some(_) => return Ok(Err(format!("material {at} is in other bases than the first"))),
        }
    }
    Ok(common.ok_or_else(|| "there is no material".to_owned()))
}

/// The interpolation between incidences that all operands state; `None` where they differ, or where one is subtracted.
fn common_between(operands: &[Operand<'_>], summaries: &[Summary]) -> Option<Between> {
    let (first, others) = summaries.split_first()?;
    let is_common = others.iter().all(|other| other.between == first.between);
    (is_common && operands.iter().all(|operand| operand.weight > 0.0)).then_some(first.between)
}

/// The exact combination of the decoded operands, rounded once.
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

/// Metadata with the operands in it.
fn with_operands(text: &str, operands: &[OperandReport]) -> Result<String, AlgebraError> {
    let Ok(Value::Object(mut object)) = serde_json::from_str(text) else {
        return Err(CompressError::Setting(SettingError::MetadataObject).into());
    };
    object.insert("combination".to_owned(), json!(operands));
    Ok(Value::Object(object).to_string())
}

impl Combined {
    /// What combining added to the errors of the operands: the decoded result against the exact combination.
    pub fn added(&self) -> &ErrorReport {
        &self.compressed.summary.errors
    }
}
