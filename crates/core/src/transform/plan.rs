//! Plan of a transform: the transform of each axis with its tables, and the four passes over a flat tensor.

use super::basis::{AxisTransform, Weights};
use super::line::{self, LinePlan};
use super::rows::{Pass, for_rows};
use super::sphere::{self, SphereTables};
use super::tree::AxisTree;
use crate::domain::{Axis, TriangleMesh};
use rayon::prelude::*;
use std::fmt;

/// Largest number of samples of a slab of the last axes, so that it fits the second-level cache (2 MiB). All its axes
/// are transformed slab by slab.
const CACHED: usize = 1 << 19;
/// Smaller slabs are grouped to about this number of samples per task.
const GROUPED: usize = 1 << 16;

/// Transforms of the axes of a tensor. Passes work in place on all samples, row-major, in `f32`. Results are identical
/// to the last bit on any number of threads. A NaN spreads to every coefficient computed from it, so fill masked
/// samples first.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    axes: Vec<AxisPlan>,
}

#[derive(Clone, Debug, PartialEq)]
struct AxisPlan {
    length: usize,
    mesh: Option<TriangleMesh>,
    transform: AxisTransform,
    tree: AxisTree,
    operator: Operator,
}

/// Precomputed tables of the transform of one axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Operator {
    Identity,
    Line(LinePlan),
    Sphere(SphereTables),
}

/// Reasons why axes and transforms do not fit together.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// The number of transforms differs from that of axes.
    #[error("{transforms} transforms for {axes} axes, expected one each")]
    Count {
        /// Number of axes.
        axes: usize,
        /// Number of transforms.
        transforms: usize,
    },
    /// An axis has no entries.
    #[error("axis {axis} has no entries, expected at least one")]
    Empty {
        /// Position of the axis, from 0.
        axis: usize,
    },
    /// A transform does not apply to this kind of axis.
    #[error("axis {axis}: `{transform}` on {found}, expected {expected}")]
    Unfit {
        /// Position of the axis, from 0.
        axis: usize,
        /// Name of the requested basis.
        transform: &'static str,
        /// Description of the axis.
        found: String,
        /// Kinds of axis to which the basis applies.
        expected: &'static str,
    },
}

impl Plan {
    /// Plans one transform per axis: sphere bases for triangles only, line bases for all other axes.
    pub fn new(axes: &[Axis], transforms: &[AxisTransform]) -> Result<Self, PlanError> {
        Self::with_levels(axes, transforms, &vec![None; axes.len()])
    }

    /// Like [`Plan::new`], but with at most the given number of levels on each line axis. The smooth coefficients then
    /// lie at the multiples of 2^levels.
    pub fn with_levels(axes: &[Axis], transforms: &[AxisTransform], levels: &[Option<u8>]) -> Result<Self, PlanError> {
        if axes.len() != transforms.len() || axes.len() != levels.len() {
            return Err(PlanError::Count { axes: axes.len(), transforms: transforms.len().min(levels.len()) });
        }
        let axes = axes.iter().zip(transforms).zip(levels).enumerate();
        let axes = axes.map(|(i, ((axis, &transform), &levels))| AxisPlan::new(i, axis, transform, levels));
        Ok(Self { axes: axes.collect::<Result<_, _>>()? })
    }

    /// Transforms samples to coefficients, first axis first.
    ///
    /// # Panics
    /// If the number of samples is not the product of the lengths of the axes.
    pub fn forward(&self, samples: &mut [f32]) {
        self.pass(samples, Pass::Forward);
    }

    /// Transforms coefficients to samples: the inverse of [`Plan::forward`], last axis first.
    ///
    /// # Panics
    /// If the number of coefficients is not the product of the lengths of the axes.
    pub fn inverse(&self, coefficients: &mut [f32]) {
        self.pass(coefficients, Pass::Inverse);
    }

    /// Applies the adjoint of [`Plan::forward`]: ⟨forward u, v⟩ = ⟨u, `forward_transposed` v⟩ in the plain sum over
    /// entries.
    ///
    /// # Panics
    /// If the number of coefficients is not the product of the lengths of the axes.
    pub fn forward_transposed(&self, coefficients: &mut [f32]) {
        self.pass(coefficients, Pass::ForwardTransposed);
    }

    /// Applies the adjoint of [`Plan::inverse`]: the results are the inner products of the samples with the synthesis
    /// functions.
    ///
    /// # Panics
    /// If the number of samples is not the product of the lengths of the axes.
    pub fn inverse_transposed(&self, samples: &mut [f32]) {
        self.pass(samples, Pass::InverseTransposed);
    }

    /// Returns the number of axes.
    pub fn axes(&self) -> usize {
        self.axes.len()
    }

    /// Returns the transform of axis `axis`.
    ///
    /// # Panics
    /// If `axis` is out of range.
    pub fn transform(&self, axis: usize) -> AxisTransform {
        self.axes[axis].transform
    }

    /// Returns the coefficient tree of axis `axis`.
    ///
    /// # Panics
    /// If `axis` is out of range.
    pub fn tree(&self, axis: usize) -> &AxisTree {
        &self.axes[axis].tree
    }

    /// Returns the L2 norm of the synthesis function of each index of axis `axis`. The norm of a coefficient over
    /// several axes is the product. `weights` applies to triangles only; on other axes each entry has weight 1.
    ///
    /// # Panics
    /// If `axis` is out of range.
    pub fn norms(&self, axis: usize, weights: Weights) -> Vec<f64> {
        let axis = &self.axes[axis];
        match (axis.transform, axis.mesh) {
            (AxisTransform::Sphere(basis), Some(mesh)) => sphere::norms(mesh, basis, weights),
            (_, Some(mesh)) if weights == Weights::Area => mesh.solid_angles().into_iter().map(libm::sqrt).collect(),
            _ => match &axis.operator {
                Operator::Line(line) => line.norms(),
                _ => vec![1.0; axis.length],
            },
        }
    }

    /// Returns the product of the lengths of the axes.
    pub(super) fn samples(&self) -> usize {
        self.axes.iter().map(|axis| axis.length).product()
    }

    pub(super) fn length(&self, axis: usize) -> usize {
        self.axes[axis].length
    }

    /// Returns the operator of axis `axis` after checking that `index` is in range.
    pub(super) fn operator(&self, axis: usize, index: usize) -> &Operator {
        let axis = &self.axes[axis];
        assert!(index < axis.length, "index {index} on an axis of {} entries", axis.length);
        &axis.operator
    }

    /// Applies one pass along one axis, whose rows have `inner` samples.
    pub(super) fn pass_axis(&self, axis: usize, data: &mut [f32], inner: usize, pass: Pass) {
        self.axes[axis].pass(data, inner, pass);
    }

    fn pass(&self, data: &mut [f32], pass: Pass) {
        assert_eq!(data.len(), self.samples(), "as many samples as the plan's axes have entries");
        // The last axes that together fit the cache are transformed slab by slab; each other axis over the whole
        // tensor.
        let inner = |axis: usize| -> usize { self.axes[axis..].iter().map(|axis| axis.length).product() };
        let split = (0..self.axes.len()).find(|&axis| inner(axis) <= CACHED).unwrap_or(self.axes.len());
        let slab = inner(split);
        let slabs = |data: &mut [f32], axes: &mut dyn Iterator<Item = usize>| {
            let axes: Vec<usize> = axes.collect();
            data.par_chunks_mut(slab * (GROUPED / slab).max(1)).for_each(|data| {
                for &axis in &axes {
                    self.axes[axis].pass(data, inner(axis + 1), pass);
                }
            });
        };
        if matches!(pass, Pass::Inverse | Pass::ForwardTransposed) {
            slabs(data, &mut (split..self.axes.len()).rev());
            for axis in (0..split).rev() {
                self.axes[axis].pass(data, inner(axis + 1), pass);
            }
        } else {
            for axis in 0..split {
                self.axes[axis].pass(data, inner(axis + 1), pass);
            }
            slabs(data, &mut (split..self.axes.len()));
        }
    }
}

impl AxisPlan {
    fn new(position: usize, axis: &Axis, transform: AxisTransform, levels: Option<u8>) -> Result<Self, PlanError> {
        let length = axis.len();
        if length == 0 {
            return Err(PlanError::Empty { axis: position });
        }
        let mesh = match axis {
            Axis::Triangles(mesh) => Some(*mesh),
            _ => None,
        };
        let unfit = |expected| PlanError::Unfit {
            axis: position,
            transform: transform.name(),
            found: axis.describe(),
            expected,
        };
        let operator = match (transform, mesh) {
            (_, Some(_)) if levels.is_some() => return Err(unfit("all levels on triangles")),
            (AxisTransform::Identity, _) => Operator::Identity,
            (AxisTransform::Sphere(basis), Some(mesh)) => Operator::Sphere(SphereTables::new(mesh, basis)),
            (AxisTransform::Sphere(_), None) => return Err(unfit("triangles")),
            (AxisTransform::Line { .. }, Some(_)) => {
                return Err(unfit("wavelengths, elevations, channels or indices"));
            }
            (AxisTransform::Line { basis, boundary }, None) => {
                let limit = levels.map_or(u32::MAX, u32::from).min(line::levels(length));
                Operator::Line(LinePlan::new(length, basis, boundary, limit))
            }
        };
        let depth = if let Operator::Line(line) = &operator { line.depth() } else { 0 };
        Ok(Self { length, mesh, transform, tree: AxisTree::new(length, mesh, transform, depth), operator })
    }

    fn pass(&self, data: &mut [f32], inner: usize, pass: Pass) {
        match &self.operator {
            Operator::Line(line) => for_rows(data, self.length, inner, |rows| line.transform(rows, pass)),
            Operator::Sphere(tables) => for_rows(data, self.length, inner, |rows| tables.transform(rows, pass)),
            Operator::Identity => {}
        }
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, axis) in self.axes.iter().enumerate() {
            let times = if i == 0 { "" } else { " × " };
            write!(f, "{times}{}", axis.transform.name())?;
            if let AxisTransform::Line { basis, boundary } = axis.transform
                && boundary != basis.boundary()
            {
                write!(f, " {boundary}")?;
            }
            write!(f, "[{}]", axis.length)?;
        }
        Ok(())
    }
}
