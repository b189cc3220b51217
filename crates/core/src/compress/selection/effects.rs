//! Effect of each coefficient on a weighted error: √Σ (weight·ψ)², the weighted norm of its synthesis function.

use crate::domain::Axis;
use crate::transform::{AxisTransform, Plan, PlanError};
use rayon::prelude::*;

/// For every coefficient c of a tensor on `axes`, computes the norm √Σ (w·ψ)² of its synthesis function ψ, with the
/// weights w of the n samples. If w is 1/sample, dropping c alone gives the relative RMS error er(L2) = |c| · norm /
/// √n.
///
/// The squared norm is a product over the axes, so each axis costs its sparse synthesis matrix.
pub fn effects(axes: &[Axis], transforms: &[AxisTransform], weights: &[f32]) -> Result<Vec<f32>, PlanError> {
    let mut sums: Vec<f32> = weights.iter().map(|w| w * w).collect();
    for (a, (axis, &transform)) in axes.iter().zip(transforms).enumerate() {
        if transform == AxisTransform::Identity {
            continue;
        }
        let columns = squared_synthesis(axis, transform)?;
        let inner: usize = axes[a + 1..].iter().map(Axis::len).product();
        let mut out = vec![0.0_f32; sums.len()];
        let slab = axis.len() * inner;
        out.par_chunks_mut(slab).zip(sums.par_chunks(slab)).for_each(|(out, sums)| {
            out.par_chunks_mut(inner).zip(&columns).for_each(|(out, column)| {
                for &(sample, square) in column {
                    let row = &sums[sample as usize * inner..][..inner];
                    out.iter_mut().zip(row).for_each(|(o, s)| *o += square * s);
                }
            });
        });
        sums = out;
    }
    for sum in &mut sums {
        *sum = sum.sqrt();
    }
    Ok(sums)
}

/// For each coefficient of one axis, lists the samples at which its synthesis function is not 0, with the function's
/// squared value there.
fn squared_synthesis(axis: &Axis, transform: AxisTransform) -> Result<Vec<Vec<(u32, f32)>>, PlanError> {
    const UNITS: usize = 256;
    let n = axis.len();
    let mut columns = vec![Vec::new(); n];
    for first in (0..n).step_by(UNITS) {
        let width = UNITS.min(n - first);
        let index = Axis::Index { count: width, labels: Vec::new() };
        let plan = Plan::new(&[axis.clone(), index], &[transform, AxisTransform::Identity])?;
        let mut units = vec![0.0_f32; n * width];
        for k in 0..width {
            units[(first + k) * width + k] = 1.0;
        }
        plan.inverse(&mut units);
        for (sample, row) in units.chunks(width).enumerate() {
            for (k, &value) in row.iter().enumerate() {
                if value != 0.0 {
                    columns[first + k].push((sample as u32, value * value));
                }
            }
        }
    }
    Ok(columns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Domain, TriangleMesh};
    use crate::transform::{LineBasis, SphereBasis, Weights};

    #[test]
    fn effects_are_the_norms_of_weighted_synthesis_functions() {
        let mesh = Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, 1).unwrap());
        let axes = [mesh, Axis::Index { count: 7, labels: Vec::new() }];
        let weights: Vec<f32> = (0..16 * 7).map(|i| 0.5 + (i % 13) as f32 * 0.2).collect();
        for &sphere in SphereBasis::ALL {
            let transforms = [AxisTransform::Sphere(sphere), AxisTransform::line(LineBasis::BIOR44)];
            let plan = Plan::new(&axes, &transforms).unwrap();
            let found = effects(&axes, &transforms, &weights).unwrap();
            for k in 0..16 * 7 {
                let mut unit = vec![0.0; 16 * 7];
                unit[k] = 1.0;
                plan.inverse(&mut unit);
                let square: f64 = unit.iter().zip(&weights).map(|(u, w)| f64::from(u * w).powi(2)).sum();
                assert!((f64::from(found[k]) - square.sqrt()).abs() < 1e-5 * square.sqrt(), "{sphere:?} {k}");
            }
        }
    }

    #[test]
    fn without_weights_they_are_the_plans_norms() {
        let axes = [Axis::Triangles(TriangleMesh::new(Domain::Sphere, 3).unwrap())];
        let transforms = [AxisTransform::Sphere(SphereBasis::BioHaar)];
        let plan = Plan::new(&axes, &transforms).unwrap();
        let found = effects(&axes, &transforms, &vec![1.0; 512]).unwrap();
        for (a, b) in found.iter().zip(plan.norms(0, Weights::Count)) {
            assert!((f64::from(*a) - b).abs() < 1e-5 * b);
        }
    }
}
