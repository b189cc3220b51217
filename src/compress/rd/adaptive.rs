//! The first layer in a spectral basis of the data's own: mean spectrum and principal components, stored with the material.
//!
//! ```text
//! basis chunk   varint r, then r × f32 the root mean square of each vector's coefficient,
//!               then the range-coded integers of the mean and of the r vectors, rows of the spectral axis in bior4.4
//! ```
//! The vectors are quantised so that their error in a sample stays well below the step's own, decoded, and made orthonormal
//! again (Gram–Schmidt in f64, in order): encoder and decoder project on the same decoded basis.

use super::super::SpectralBasis;
use super::super::rows::{clear_uncoded, coding_order};
use super::super::scales::Scales;
use super::layer::{FirstLayer, transform_of};
use crate::codec::{ChunkKind, Class, CodecError, Decoder, Encoder, Payload, Reader, Rows, Writer, code_coefficients};
use crate::domain::Axis;
use crate::transform::{AxisTransform, Klt, LineBasis, Plan, PlanError};
use rayon::prelude::*;

/// Vectors at most; spectra of one material are far fewer.
const MAX_RANK: usize = 24;
/// A vector whose coefficients are smaller than this part of the step would be quantised to nothing.
const WORTH_KEEPING: f64 = 0.35;
/// Rows approximated together.
const BLOCK: usize = 256;

/// A decoded basis.
#[derive(Clone, Debug)]
struct Basis {
    mean: Vec<f64>,
    vectors: Vec<Vec<f64>>,
}

/// Logarithms and their principal components.
pub(crate) struct AdaptiveLayer<'a> {
    axes: Vec<Axis>,
    classes: Option<&'a [Class]>,
    transforms: Vec<AxisTransform>,
    klt: Klt,
    logs: Vec<f32>,
}

impl<'a> AdaptiveLayer<'a> {
    /// Analyses `logs` on `axes`, the last of which is spectral.
    pub(crate) fn new(axes: &[Axis], classes: Option<&'a [Class]>, logs: Vec<f32>) -> Result<Self, String> {
        let length = axes.last().map_or(1, Axis::len);
        let mut klt = Klt::of(&logs, length).map_err(|e| format!("basis klt: {e}"))?;
        klt.truncate(MAX_RANK);
        let transforms = axes.iter().map(|axis| transform_of(axis, SpectralBasis::Klt)).collect();
        Ok(Self { axes: axes.to_vec(), classes, transforms, klt, logs })
    }

    /// The basis at `step` and its chunk.
    fn basis_at(&self, step: f32) -> (Basis, Vec<u8>) {
        let step64 = f64::from(step);
        let spreads: Vec<f64> = self.klt.variances.iter().map(|v| v.sqrt()).collect();
        let worth = spreads.iter().take_while(|&&spread| spread > WORTH_KEEPING * step64).count();
        let spreads: Vec<f32> = spreads[..worth.clamp(1, self.klt.rank())].iter().map(|&s| s as f32).collect();
        let count = self.logs.len() / self.klt.length();
        let coder = BasisCoder::new(&self.axes);
        let mut quantised = Vec::new();
        let rows = std::iter::once(&self.klt.mean).chain(&self.klt.vectors);
        for (row, step) in rows.zip(steps(step, count, &spreads)) {
            quantised.extend(coder.quantise(row, step));
        }
        let mut w = Writer::default();
        w.varint(spreads.len() as u64);
        for &spread in &spreads {
            w.f32(spread);
        }
        let mut encoder = Encoder::default();
        code_coefficients(&mut encoder, &coder.rows(spreads.len() + 1), Payload::Integer, &mut quantised);
        w.raw(&encoder.finish());
        (coder.basis(&quantised, &steps(step, count, &spreads)), w.into_bytes())
    }

    /// Coefficients on the basis, transformed on the other axes.
    fn planes(&self, basis: &Basis) -> Result<(Plan, Scales, Rows, Vec<f32>), PlanError> {
        let mut planes = basis.analyse(&self.logs);
        let (axes, plan) = plan_of_planes(&self.axes, &self.transforms, basis.vectors.len())?;
        plan.forward(&mut planes);
        let rows = coding_order(&axes, &plan, plane_classes(&self.axes, self.classes, basis.vectors.len()).as_deref());
        clear_uncoded(&rows, &mut planes);
        Ok((plan.clone(), Scales::new(&axes, &plan), rows, planes))
    }
}

impl FirstLayer for AdaptiveLayer<'_> {
    fn approximate(&self, step: f32, logs: &mut [f32]) {
        let (basis, _) = self.basis_at(step);
        if let Ok((plan, scales, _, planes)) = self.planes(&basis) {
            let mut decoded = vec![0.0; planes.len()];
            scales.requantise(step, &planes, &mut decoded);
            plan.inverse(&mut decoded);
            basis.synthesise(&decoded, logs);
        }
    }

    fn chunks(&self, step: f32) -> Vec<(ChunkKind, Vec<u8>)> {
        let (basis, chunk) = self.basis_at(step);
        let mut chunks = vec![(ChunkKind::Basis, chunk)];
        if let Ok((_, scales, rows, planes)) = self.planes(&basis) {
            let mut quantised = vec![0; planes.len()];
            scales.quantise(step, &planes, &mut quantised);
            let mut encoder = Encoder::default();
            code_coefficients(&mut encoder, &rows, Payload::Integer, &mut quantised);
            chunks.push((ChunkKind::Coefficients, encoder.finish()));
        }
        chunks
    }

    fn kept(&self, step: f32) -> u64 {
        let (basis, _) = self.basis_at(step);
        let planes = self.planes(&basis).map_or(0, |(_, scales, _, planes)| scales.count_kept(step, &planes));
        // The basis itself is part of what is kept.
        planes + (basis.mean.len() * (basis.vectors.len() + 1)) as u64
    }

    fn transforms(&self) -> &[AxisTransform] {
        &self.transforms
    }

    fn basis(&self) -> SpectralBasis {
        SpectralBasis::Klt
    }
}

/// The logarithms that a basis chunk and a coefficients chunk stand for.
pub(crate) fn decode(
    axes: &[Axis],
    transforms: &[AxisTransform],
    classes: Option<&[Class]>,
    step: f32,
    (basis, coded): (&[u8], &[u8]),
) -> Result<Vec<f32>, CodecError> {
    let count: usize = axes.iter().map(Axis::len).product();
    let length = axes.last().map_or(1, Axis::len);
    let mut r = Reader::new(basis, 0);
    let rank = r.size(MAX_RANK.min(length), "number of basis vectors")?;
    if rank == 0 {
        return Err(r.malformed("no basis vectors, expected at least one"));
    }
    let spreads = (0..rank).map(|_| r.f32("spread of a basis vector")).collect::<Result<Vec<_>, _>>()?;
    let rest = r.take(r.remaining(), "basis")?;
    let coder = BasisCoder::new(axes);
    let mut quantised = vec![0; (rank + 1) * length];
    code_coefficients(&mut Decoder::new(rest), &coder.rows(rank + 1), Payload::Integer, &mut quantised);
    let basis = coder.basis(&quantised, &steps(step, count / length, &spreads));

    let (plane_axes, plan) = plan_of_planes(axes, transforms, rank).map_err(|e| r.malformed(e.to_string()))?;
    let mut quantised = vec![0; count / length * rank];
    let rows = coding_order(&plane_axes, &plan, plane_classes(axes, classes, rank).as_deref());
    code_coefficients(&mut Decoder::new(coded), &rows, Payload::Integer, &mut quantised);
    let mut planes = vec![0.0; quantised.len()];
    Scales::new(&plane_axes, &plan).dequantise(step, &quantised, &mut planes);
    drop(quantised);
    plan.inverse(&mut planes);
    let mut logs = vec![0.0; count];
    basis.synthesise(&planes, &mut logs);
    Ok(logs)
}

/// The axes of coefficients on `rank` vectors, and their transform.
fn plan_of_planes(axes: &[Axis], transforms: &[AxisTransform], rank: usize) -> Result<(Vec<Axis>, Plan), PlanError> {
    let mut axes = axes.to_vec();
    let mut transforms = transforms.to_vec();
    if let (Some(axis), Some(transform)) = (axes.last_mut(), transforms.last_mut()) {
        *axis = Axis::Index { count: rank, labels: Vec::new() };
        *transform = AxisTransform::Identity;
    }
    let plan = Plan::new(&axes, &transforms)?;
    Ok((axes, plan))
}

/// Which coefficients are live: those of rows with a live sample.
fn plane_classes(axes: &[Axis], classes: Option<&[Class]>, rank: usize) -> Option<Vec<Class>> {
    let length = axes.last().map_or(1, Axis::len);
    let class_of = |row: &[Class]| {
        let live = row.iter().any(|class| matches!(class, Class::Positive | Class::Negative));
        if live { Class::Positive } else { Class::Masked }
    };
    classes
        .map(|classes| classes.chunks_exact(length).flat_map(|row| std::iter::repeat_n(class_of(row), rank)).collect())
}

/// The step of the mean and of each vector: their error in a sample is 6 / √rows of the quantiser's own.
fn steps(step: f32, rows: usize, spreads: &[f32]) -> Vec<f32> {
    let part = (6.0 / (rows as f64).sqrt()).min(1.0);
    let own = f64::from(step) * part;
    std::iter::once(own as f32)
        .chain(spreads.iter().map(|&spread| (own / f64::from(spread).max(1e-30)) as f32))
        .collect()
}

/// Rows of the spectral axis as quantised wavelet coefficients.
struct BasisCoder {
    plan: Option<Plan>,
    order: Rows,
    scales: Scales,
    length: usize,
}

impl BasisCoder {
    fn new(axes: &[Axis]) -> Self {
        let axis: Vec<Axis> = axes.last().cloned().into_iter().collect();
        let length = axes.last().map_or(1, Axis::len);
        let plan = Plan::new(&axis, &[AxisTransform::line(LineBasis::BIOR44)]).ok();
        let order = plan.as_ref().map_or_else(|| Rows::natural(1, length), |plan| coding_order(&axis, plan, None));
        let scales = plan.as_ref().map_or_else(|| Scales::uniform(length), |plan| Scales::new(&axis, plan));
        Self { plan, order, scales, length }
    }

    /// The coding order of `count` rows, one after another.
    fn rows(&self, count: usize) -> Rows {
        let natural = Rows::natural(count, self.length);
        Rows { order: natural.order, level: natural.level, neighbours: natural.neighbours, ..self.order.clone() }
    }

    fn quantise(&self, row: &[f64], step: f32) -> Vec<i32> {
        let mut row: Vec<f32> = row.iter().map(|&x| x as f32).collect();
        if let Some(plan) = &self.plan {
            plan.forward(&mut row);
        }
        let mut quantised = vec![0; row.len()];
        self.scales.quantise(step, &row, &mut quantised);
        quantised
    }

    /// The mean and the orthonormal vectors of their integers.
    fn basis(&self, quantised: &[i32], steps: &[f32]) -> Basis {
        let mut rows = quantised.chunks_exact(self.length).zip(steps).map(|(quantised, &step)| {
            let mut row = vec![0.0; self.length];
            self.scales.dequantise(step, quantised, &mut row);
            if let Some(plan) = &self.plan {
                plan.inverse(&mut row);
            }
            row.into_iter().map(f64::from).collect::<Vec<f64>>()
        });
        let mean = rows.next().unwrap_or_default();
        let mut vectors: Vec<Vec<f64>> = rows.collect();
        orthonormalise(&mut vectors);
        Basis { mean, vectors }
    }
}

/// Gram–Schmidt in order; a vector that depends on those before it becomes 0.
fn orthonormalise(vectors: &mut [Vec<f64>]) {
    for i in 0..vectors.len() {
        let (before, rest) = vectors.split_at_mut(i);
        let Some(vector) = rest.first_mut() else { return };
        for other in before.iter() {
            let product: f64 = vector.iter().zip(other).map(|(a, b)| a * b).sum();
            vector.iter_mut().zip(other).for_each(|(a, b)| *a -= product * b);
        }
        let size = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
        let scale = if size > 1e-6 { 1.0 / size } else { 0.0 };
        for x in vector.iter_mut() {
            *x *= scale;
        }
    }
}

impl Basis {
    /// ⟨row − mean, vector⟩ for every row and vector.
    fn analyse(&self, logs: &[f32]) -> Vec<f32> {
        let (n, r) = (self.mean.len(), self.vectors.len());
        let mut planes = vec![0.0; logs.len() / n * r];
        planes.par_chunks_mut(BLOCK * r).zip(logs.par_chunks(BLOCK * n)).for_each(|(planes, logs)| {
            for (plane, row) in planes.chunks_exact_mut(r).zip(logs.chunks_exact(n)) {
                for (coefficient, vector) in plane.iter_mut().zip(&self.vectors) {
                    let centred = row.iter().zip(&self.mean).map(|(&x, m)| f64::from(x) - m);
                    *coefficient = centred.zip(vector).map(|(x, v)| x * v).sum::<f64>() as f32;
                }
            }
        });
        planes
    }

    /// mean + Σ coefficient · vector, summed in f64 in the order of the vectors.
    fn synthesise(&self, planes: &[f32], logs: &mut [f32]) {
        let (n, r) = (self.mean.len(), self.vectors.len());
        logs.par_chunks_mut(BLOCK * n).zip(planes.par_chunks(BLOCK * r)).for_each(|(logs, planes)| {
            let mut sums = vec![0.0; n];
            for (row, plane) in logs.chunks_exact_mut(n).zip(planes.chunks_exact(r)) {
                sums.copy_from_slice(&self.mean);
                for (&coefficient, vector) in plane.iter().zip(&self.vectors) {
                    let c = f64::from(coefficient);
                    sums.iter_mut().zip(vector).for_each(|(sum, v)| *sum += c * v);
                }
                row.iter_mut().zip(&sums).for_each(|(x, &sum)| *x = sum as f32);
            }
        });
    }
}
