//! Partial synthesis: the function of one coefficient, the coefficients of one sample, one direction, level or
//! wavelength.
//!
//! Only the required part of the transform is inverted. A sample depends on few coefficients of each axis: 3 per level
//! on triangles, a filter length per level on a line. The spectrum of one direction costs as many row additions
//! (Claustres, Paulin & Boucher 2006, section 3: first the sphere for the requested direction, then the spectrum).

use super::plan::{Operator, Plan};
use super::rows::Pass;
use std::ops::Range;

/// Part of the samples along one axis of a tensor that an inverse wavelet transform reconstructs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Part {
    /// Selects all samples along the axis, reconstructed from all wavelet coefficients of the axis.
    All,
    /// Selects the samples at one index of the axis; the reconstructed tensor does not have this axis.
    At(usize),
    /// Selects all samples along the axis, reconstructed only from the wavelet coefficients of a range of levels (0 is
    /// the smooth level, 1 the coarsest details).
    Levels(Range<usize>),
}

impl Plan {
    /// Returns the synthesis function of coefficient `index` along axis `axis`, as pairs of sample index and weight, by
    /// sample index.
    ///
    /// # Panics
    /// If `axis` or `index` is out of range.
    pub fn footprint(&self, axis: usize, index: usize) -> Vec<(u32, f64)> {
        match self.operator(axis, index) {
            Operator::Identity => vec![(index as u32, 1.0)],
            Operator::Line(line) => line.footprint(index).0.entries(),
            Operator::Sphere(tables) => tables.footprint(index),
        }
    }

    /// Returns the sample indices and weights from which coefficient `index` along axis `axis` is computed, by sample
    /// index.
    ///
    /// # Panics
    /// If `axis` or `index` is out of range.
    pub fn analysis_row(&self, axis: usize, index: usize) -> Vec<(u32, f64)> {
        match self.operator(axis, index) {
            Operator::Identity => vec![(index as u32, 1.0)],
            Operator::Line(line) => line.analysis_row(index).entries(),
            Operator::Sphere(tables) => tables.analysis_row(index),
        }
    }

    /// Returns the coefficient indices and weights from which sample `index` along axis `axis` is computed, by
    /// coefficient index. It is the transpose of [`Plan::footprint`].
    ///
    /// # Panics
    /// If `axis` or `index` is out of range.
    pub fn synthesis_row(&self, axis: usize, index: usize) -> Vec<(u32, f64)> {
        match self.operator(axis, index) {
            Operator::Identity => vec![(index as u32, 1.0)],
            Operator::Line(line) => line.synthesis_row(index),
            Operator::Sphere(tables) => tables.synthesis_row(index),
        }
    }

    /// Reconstructs from coefficients the samples at the given index of each axis; `None` reconstructs all samples of
    /// the axis. The result is row-major over the axes without an index.
    ///
    /// # Panics
    /// As [`Plan::reconstruct`].
    pub fn reconstruct_at(&self, coefficients: &[f32], at: &[Option<usize>]) -> Vec<f32> {
        let parts: Vec<Part> = at.iter().map(|at| at.map_or(Part::All, Part::At)).collect();
        self.reconstruct(coefficients, &parts)
    }

    /// Reconstructs from wavelet coefficients, along each axis, all samples, one sample, or the contribution of a range
    /// of wavelet levels to all samples. The result is row-major over the axes not reduced to one sample.
    ///
    /// An axis that is reduced to one sample is summed in f64.
    ///
    /// # Panics
    /// If the number of coefficients is not that of the axes' entries, the number of parts is not that of
    /// axes, or an index is out of range.
    pub fn reconstruct(&self, coefficients: &[f32], parts: &[Part]) -> Vec<f32> {
        assert_eq!(coefficients.len(), self.samples(), "as many coefficients as the plan's axes have entries");
        assert_eq!(parts.len(), self.axes(), "one part for each of the plan's axes");
        let mut shape: Vec<usize> = (0..self.axes()).map(|axis| self.length(axis)).collect();
        let mut data: Option<Vec<f32>> = None;
        for (axis, part) in parts.iter().enumerate() {
            if let Part::At(index) = part {
                let inner = shape[axis + 1..].iter().product();
                let row = self.synthesis_row(axis, *index);
                let source = data.as_deref().unwrap_or(coefficients);
                data = Some(contracted(source, shape[axis], inner, &row));
                shape[axis] = 1;
            }
        }
        let mut data = data.unwrap_or_else(|| coefficients.to_vec());
        for (axis, part) in parts.iter().enumerate() {
            if let Part::Levels(levels) = part {
                let inner: usize = shape[axis + 1..].iter().product();
                let level = &self.tree(axis).level;
                for (row, values) in data.chunks_exact_mut(inner).enumerate() {
                    if !levels.contains(&usize::from(level[row % shape[axis]])) {
                        values.fill(0.0);
                    }
                }
            }
        }
        for (axis, part) in parts.iter().enumerate().rev() {
            if !matches!(part, Part::At(_)) {
                self.pass_axis(axis, &mut data, shape[axis + 1..].iter().product(), Pass::Inverse);
            }
        }
        data
    }
}

/// Sums `data` over one axis of `n` entries, with `weights` as pairs of entry and weight. The axes after it have
/// `inner` values in total.
fn contracted(data: &[f32], n: usize, inner: usize, weights: &[(u32, f64)]) -> Vec<f32> {
    let mut result = Vec::with_capacity(data.len() / n);
    let mut sums = vec![0.0_f64; inner];
    for slab in data.chunks_exact(n * inner) {
        sums.fill(0.0);
        for &(row, w) in weights {
            for (sum, &x) in sums.iter_mut().zip(&slab[row as usize * inner..][..inner]) {
                *sum += w * f64::from(x);
            }
        }
        result.extend(sums.iter().map(|&sum| sum as f32));
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Axis, Domain, TriangleMesh};
    use crate::transform::{AxisTransform, Boundary, LineBasis, SphereBasis, Weights};

    fn index(count: usize) -> Axis {
        Axis::Index { count, labels: vec![] }
    }

    fn triangles(level: u8) -> Axis {
        Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, level).unwrap())
    }

    /// Returns axes of every kind with transforms of every kind, for tests.
    fn cases() -> Vec<(Axis, AxisTransform)> {
        let lines = ["haar", "db3", "coif1", "bior3.3", "bior4.4", "rbio2.6", "adelson9"];
        let lines = lines.iter().flat_map(|name| {
            let basis: LineBasis = name.parse().unwrap();
            Boundary::ALL.iter().map(move |&boundary| (index(23), AxisTransform::Line { basis, boundary }))
        });
        let spheres = SphereBasis::ALL
            .iter()
            .flat_map(|&basis| (0..4).map(move |l| (triangles(l), AxisTransform::Sphere(basis))));
        lines.chain(spheres).chain([(index(5), AxisTransform::Identity)]).collect()
    }

    fn dense(entries: Vec<(u32, f64)>, n: usize) -> Vec<f64> {
        let mut row = vec![0.0; n];
        for (i, w) in entries {
            row[i as usize] += w;
        }
        row
    }

    #[test]
    fn footprints_are_the_columns_of_the_inverse_and_rows_those_of_the_forward_transform() {
        for (axis, transform) in cases() {
            let n = axis.len();
            let plan = Plan::new(std::slice::from_ref(&axis), &[transform]).unwrap();
            for i in 0..n {
                let mut unit = vec![0.0; n];
                unit[i] = 1.0;
                let mut column = unit.clone();
                plan.inverse(&mut column);
                let mut row = unit;
                plan.forward_transposed(&mut row);
                let mut across = vec![0.0; n];
                across[i] = 1.0;
                plan.inverse_transposed(&mut across);
                for (found, expected) in [
                    (dense(plan.footprint(0, i), n), column),
                    (dense(plan.analysis_row(0, i), n), row),
                    (dense(plan.synthesis_row(0, i), n), across),
                ] {
                    for (found, expected) in found.iter().zip(expected) {
                        let close = (found - f64::from(expected)).abs() < 5e-6 * f64::from(expected.abs()).max(1.0);
                        assert!(close, "{plan} {transform:?} {i}: {found} {expected}");
                    }
                }
            }
        }
    }

    fn several() -> (Plan, Vec<f32>, Vec<f32>) {
        let axes = [triangles(1), triangles(2), index(11)];
        let transforms = [
            AxisTransform::Sphere(SphereBasis::BioHaar),
            AxisTransform::Sphere(SphereBasis::Orthonormal(Weights::Area)),
            AxisTransform::line("db2".parse().unwrap()),
        ];
        let plan = Plan::new(&axes, &transforms).unwrap();
        let samples: Vec<f32> = (0..16 * 64 * 11_u32).map(|i| ((i * i * 7) % 31) as f32 - 15.0).collect();
        let mut coefficients = samples.clone();
        plan.forward(&mut coefficients);
        (plan, samples, coefficients)
    }

    fn close(found: &[f32], expected: impl IntoIterator<Item = f32>) {
        let mut count = 0;
        for (&found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 3e-5, "{found} {expected}");
            count += 1;
        }
        assert_eq!(count, found.len());
    }

    #[test]
    fn one_direction_one_wavelength_and_one_sample_are_those_of_the_whole() {
        let (plan, samples, coefficients) = several();
        let at = |i: usize, j: usize, k: usize| samples[(i * 64 + j) * 11 + k];
        close(&plan.reconstruct_at(&coefficients, &[Some(5), Some(40), None]), (0..11).map(|k| at(5, 40, k)));
        let slice = (0..16).flat_map(|i| (0..64).map(move |j| (i, j)));
        close(&plan.reconstruct_at(&coefficients, &[None, None, Some(7)]), slice.map(|(i, j)| at(i, j, 7)));
        close(&plan.reconstruct_at(&coefficients, &[Some(3), None, Some(7)]), (0..64).map(|j| at(3, j, 7)));
        close(&plan.reconstruct_at(&coefficients, &[Some(15), Some(63), Some(10)]), [at(15, 63, 10)]);
        close(&plan.reconstruct_at(&coefficients, &[None; 3]), samples);
    }

    #[test]
    fn levels_add_up() {
        let (plan, samples, coefficients) = several();
        let mut sum = vec![0.0; samples.len()];
        for level in 0..plan.tree(1).levels() {
            let part = plan.reconstruct(&coefficients, &[Part::All, Part::Levels(level..level + 1), Part::All]);
            sum.iter_mut().zip(part).for_each(|(s, p)| *s += p);
        }
        close(&sum, samples.iter().copied());
        // The smooth level of bio-Haar is the mean over each octant, here at one direction and wavelength.
        let smooth = plan.reconstruct(&coefficients, &[Part::Levels(0..1), Part::At(9), Part::At(2)]);
        assert!(smooth.chunks(4).all(|octant| octant.iter().all(|x| (x - octant[0]).abs() < 1e-4)));
    }

    #[test]
    #[should_panic(expected = "one part for each")]
    fn parts_must_be_as_many_as_axes() {
        let (plan, _, coefficients) = several();
        plan.reconstruct(&coefficients, &[Part::All]);
    }
}
