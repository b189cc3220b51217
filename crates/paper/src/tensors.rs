//! Common parts of the tables of tensors: transforms, K-term approximations in two domains, rows of figures.

use super::error::PaperError;
use super::report::Cell;
use crate::compress::selection::{effects, refit};
use crate::domain::{Axis, ErrorReport};
use crate::transform::{AxisTransform, LineBasis, Plan, SphereBasis, Weights};

/// Bio-Haar wavelet basis on the triangles of a sphere, which Claustres et al. (2006) use.
pub(super) const BIO_HAAR: SphereBasis = SphereBasis::BioHaar;
/// Wavelet basis on the triangles of a sphere that is orthonormal if all triangles have equal weights, as they have in
/// the mean relative error.
pub(super) const ORTHONORMAL: SphereBasis = SphereBasis::Orthonormal(Weights::Count);

/// Returns one transform for each axis: `sphere` for axes of triangles, the one-dimensional basis `line` for all other
/// axes.
pub(super) fn transforms(axes: &[Axis], sphere: SphereBasis, line: LineBasis) -> Vec<AxisTransform> {
    let of = |axis: &Axis| match axis {
        Axis::Triangles(_) => AxisTransform::Sphere(sphere),
        _ => AxisTransform::line(line),
    };
    axes.iter().map(of).collect()
}

pub(super) fn data_error(error: impl std::fmt::Display) -> PaperError {
    PaperError::Data(error.to_string())
}

/// Transforms the logarithms of the samples, and decodes from the largest coefficients, once for each number in
/// `counts`. Every sample must be positive.
pub(super) fn log_k_term(
    axes: &[Axis],
    transforms: &[AxisTransform],
    samples: &[f32],
    counts: &[usize],
) -> Result<Vec<Vec<f32>>, PaperError> {
    let plan = Plan::new(axes, transforms).map_err(data_error)?;
    if samples.iter().any(|s| s.is_nan() || *s <= 0.0) {
        return Err(PaperError::Data("found a sample that is not positive and so has no logarithm".to_owned()));
    }
    let mut coefficients: Vec<f32> = samples.iter().map(|&s| libm::logf(s)).collect();
    plan.forward(&mut coefficients);
    let norms = norms(axes, &plan);
    let magnitudes: Vec<f32> = coefficients.iter().zip(&norms).map(|(c, n)| c.abs() * n).collect();
    Ok(counts
        .iter()
        .map(|&count| {
            let mut decoded = largest(&coefficients, &magnitudes, count);
            plan.inverse(&mut decoded);
            for value in &mut decoded {
                *value = libm::expf(*value);
            }
            decoded
        })
        .collect())
}

/// Decodes from the coefficients with the largest effect on the relative error, once for each number in `counts`. Their
/// values are unchanged, or refitted in `refits` steps. Samples below `floor` are weighted as if they had that value.
pub(super) fn effect_k_term(
    axes: &[Axis],
    transforms: &[AxisTransform],
    samples: &[f32],
    counts: &[usize],
    floor: f32,
    refits: usize,
) -> Result<Vec<Vec<f32>>, PaperError> {
    let plan = Plan::new(axes, transforms).map_err(data_error)?;
    let weight = |level: f32| if level > 0.0 { 1.0 / level } else { 0.0 };
    let weights: Vec<f32> = samples.iter().map(|&s| weight(s.max(floor))).collect();
    let effects = effects(axes, transforms, &weights).map_err(data_error)?;
    let mut coefficients = samples.to_vec();
    plan.forward(&mut coefficients);
    let magnitudes: Vec<f32> = coefficients.iter().zip(&effects).map(|(c, e)| c.abs() * e).collect();
    Ok(counts
        .iter()
        .map(|&count| {
            let mut decoded = largest(&coefficients, &magnitudes, count);
            if refits > 0 {
                refit(&plan, samples, &weights, &effects, &mut decoded, refits);
            }
            plan.inverse(&mut decoded);
            decoded
        })
        .collect())
}

fn norms(axes: &[Axis], plan: &Plan) -> Vec<f32> {
    let product = (0..axes.len()).fold(vec![1.0_f64], |products, a| {
        let norms = plan.norms(a, Weights::Count);
        products.iter().flat_map(|product| norms.iter().map(move |norm| product * norm)).collect()
    });
    product.into_iter().map(|norm| norm as f32).collect()
}

fn largest(coefficients: &[f32], magnitudes: &[f32], count: usize) -> Vec<f32> {
    if count >= coefficients.len() {
        return coefficients.to_vec();
    }
    let mut sorted = magnitudes.to_vec();
    let (_, &mut threshold, _) = sorted.select_nth_unstable_by(count, |a, b| b.total_cmp(a));
    coefficients.iter().zip(magnitudes).map(|(&c, &m)| if m > threshold { c } else { 0.0 }).collect()
}

/// Returns two table cells, for L1 and L2: the computed compression error in per cent beside the one published in the
/// reproduced table.
pub(super) fn cells(errors: &ErrorReport, printed: Option<[f64; 2]>) -> [Cell; 2] {
    [Cell::new(100.0 * errors.er_l1, printed.map(|p| p[0])), Cell::new(100.0 * errors.er_l2, printed.map(|p| p[1]))]
}

/// Returns by how many per cent the errors `first` (L1 and L2) of one method exceed the errors `second` of a better
/// one: computed, and as published. These percentages do not count in the statistics of computed to published errors.
pub(super) fn gains(first: &[Cell; 2], second: &[Cell; 2]) -> [Cell; 2] {
    let gain = |a: f64, b: f64| 100.0 * (a / b - 1.0);
    [0, 1].map(|i| {
        let printed = first[i].paper.zip(second[i].paper).map(|(a, b)| gain(a, b));
        Cell { ours: gain(first[i].ours, second[i].ours), paper: printed, ratio: None }
    })
}

/// Returns the column headings `2:1 L1`, `2:1 L2`, … of a table by compression ratio.
pub(super) fn ratio_columns(ratios: &[usize]) -> Vec<String> {
    ratios.iter().flat_map(|ratio| ["L1", "L2"].map(|norm| format!("{ratio}:1 {norm}"))).collect()
}

/// Formats as text the thresholds below which a compression method of Claustres et al. (2006) drops wavelet
/// coefficients. They were chosen so that a wanted number of coefficients remains.
pub(super) fn thresholds(found: &[f64]) -> String {
    let shown: Vec<String> = found.iter().map(|t| format!("{t:.2e}")).collect();
    format!("({})", shown.join(", "))
}
