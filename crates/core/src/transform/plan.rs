//! Plan of a transform: the transform of each axis with its tables, and the four passes over a flat tensor.

use super::basis::{AxisTransform, Weights};
use super::line::{self, LinePlan};
use super::rows::{Pass, for_rows};
use super::sphere::{self, SphereTables};
use super::tree::AxisTree;
use crate::domain::{Axis, TriangleMesh};
use rayon::prelude::*;
use std::fmt;

/// Largest number of samples in a block of trailing axes that fits the second-level cache (2 MiB). All axes of such a
/// block are transformed before the next block.
const CACHED: usize = 1 << 19;
/// Largest number of samples for which several blocks of trailing axes form one parallel task; a larger block is a task
/// of its own. Raising it gives fewer, larger tasks.
const GROUPED: usize = 1 << 16;

/// Wavelet transforms of all axes of a tensor, one per axis. They work in place on all samples, row-major, in `f32`.
/// Results are identical to the last bit on any number of threads. A NaN spreads to every coefficient computed from it,
/// so fill masked samples first.
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

/// Precomputed tables of the wavelet transform of one axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Operator {
    Identity,
    Line(LinePlan),
    Sphere(SphereTables),
}

/// Reasons why axes and wavelet transforms do not fit together.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// The number of transforms differs from the number of axes.
    #[error("{transforms} transforms for {axes} axes, expected one transform per axis")]
    Count {
        /// Number of axes of the tensor.
        axes: usize,
        /// Number of wavelet transforms that the caller passed for the axes of the tensor.
        transforms: usize,
    },
    /// An axis of the tensor has no entries.
    #[error("axis {axis} has no entries, expected at least one")]
    Empty {
        /// Position of the axis without entries, from 0.
        axis: usize,
    },
    /// A wavelet transform does not apply to this kind of axis.
    #[error("axis {axis}: transform `{transform}` on {found}, expected {expected}")]
    Unfit {
        /// Position, from 0, of the axis of the tensor to which the requested wavelet basis does not apply.
        axis: usize,
        /// Name of the requested wavelet basis.
        transform: &'static str,
        /// Description, in words, of the axis to which the requested wavelet basis does not apply.
        found: String,
        /// Kinds of axis to which the wavelet basis applies.
        expected: &'static str,
    },
}

impl Plan {
    /// Prepares one wavelet transform per axis: bases on the sphere for triangles only, bases on ordered axes for all
    /// others.
    pub fn new(axes: &[Axis], transforms: &[AxisTransform]) -> Result<Self, PlanError> {
        Self::with_levels(axes, transforms, &vec![None; axes.len()])
    }

    /// Prepares transforms like [`Plan::new`], but with at most the given number of wavelet levels on each ordered
    /// axis. The smooth coefficients then lie at the indices that are multiples of 2^levels.
    pub fn with_levels(axes: &[Axis], transforms: &[AxisTransform], levels: &[Option<u8>]) -> Result<Self, PlanError> {
        if axes.len() != transforms.len() || axes.len() != levels.len() {
            return Err(PlanError::Count { axes: axes.len(), transforms: transforms.len().min(levels.len()) });
        }
        let axes = axes.iter().zip(transforms).zip(levels).enumerate();
        let axes = axes.map(|(i, ((axis, &transform), &levels))| AxisPlan::new(i, axis, transform, levels));
        Ok(Self { axes: axes.collect::<Result<_, _>>()? })
    }

    /// Transforms samples to wavelet coefficients in place, first axis first.
    ///
    /// # Panics
    /// If the number of samples is not the product of the lengths of the axes.
    pub fn forward(&self, samples: &mut [f32]) {
        self.pass(samples, Pass::Forward);
    }

    /// Transforms wavelet coefficients back to samples in place: the inverse of [`Plan::forward`], last axis first.
    ///
    /// # Panics
    /// If the number of coefficients is not the product of the lengths of the axes.
    pub fn inverse(&self, coefficients: &mut [f32]) {
        self.pass(coefficients, Pass::Inverse);
    }

    /// Applies the adjoint of the forward transform ([`Plan::forward`]): ⟨forward u, v⟩ = ⟨u, `forward_transposed` v⟩
    /// with unweighted sums over entries.
    ///
    /// # Panics
    /// If the number of coefficients is not the product of the lengths of the axes.
    pub fn forward_transposed(&self, coefficients: &mut [f32]) {
        self.pass(coefficients, Pass::ForwardTransposed);
    }

    /// Applies the adjoint of the inverse transform ([`Plan::inverse`]): the results are the inner products of the
    /// samples with the synthesis functions.
    ///
    /// # Panics
    /// If the number of samples is not the product of the lengths of the axes.
    pub fn inverse_transposed(&self, samples: &mut [f32]) {
        self.pass(samples, Pass::InverseTransposed);
    }

    /// Returns the number of axes of the tensor.
    pub fn axes(&self) -> usize {
        self.axes.len()
    }

    /// Returns the choice of wavelet transform along axis `axis`: wavelet basis and boundary rule, or no transform.
    ///
    /// # Panics
    /// If `axis` is out of range.
    pub fn transform(&self, axis: usize) -> AxisTransform {
        self.axes[axis].transform
    }

    /// Returns the tree of wavelet coefficients along axis `axis`.
    ///
    /// # Panics
    /// If `axis` is out of range.
    pub fn tree(&self, axis: usize) -> &AxisTree {
        &self.axes[axis].tree
    }

    /// Returns the L2 norms of all synthesis functions along axis `axis`. The norm of a coefficient over several axes
    /// is the product of such norms. `weights` applies to triangles only; on other axes each entry has weight 1.
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

    /// Returns the number of samples of the tensor: the product of the lengths of the axes.
    pub(super) fn samples(&self) -> usize {
        self.axes.iter().map(|axis| axis.length).product()
    }

    pub(super) fn length(&self, axis: usize) -> usize {
        self.axes[axis].length
    }

    /// Returns the precomputed transform of axis number `axis`, after checking that `index` is less than the number of
    /// entries on that axis.
    pub(super) fn operator(&self, axis: usize, index: usize) -> &Operator {
        let axis = &self.axes[axis];
        assert!(index < axis.length, "index {index} on an axis of {} entries", axis.length);
        &axis.operator
    }

    /// Applies the transform, its inverse or a transpose along one axis of `data`. Entries of the axis are `inner`
    /// samples apart.
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
