//! A plan: which transform each axis gets, as plain data with its tables, and the four passes over a flat tensor.

use super::basis::{AxisTransform, Weights};
use super::line::{self, LinePlan};
use super::rows::{Pass, for_rows};
use super::sphere::{self, SphereTables};
use super::tree::AxisTree;
use crate::domain::{Axis, TriangleMesh};
use rayon::prelude::*;
use std::fmt;

/// Samples that the second-level cache holds.
const CACHED: usize = 1 << 19;
/// Samples below which slabs are taken together.
const GROUPED: usize = 1 << 16;

/// The transforms of a tensor's axes. Passes work in place on all samples, row-major, in `f32`; the result is the same
/// to the last bit on any number of threads. A NaN spreads to every coefficient it meets: fill masked samples first.
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

/// What an axis' transform needs, worked out once.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Operator {
    Identity,
    Line(LinePlan),
    Sphere(SphereTables),
}

/// Why axes and transforms do not make a plan.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// Not one transform for each axis.
    #[error("{transforms} transforms for {axes} axes, expected one each")]
    Count {
        /// Axes given.
        axes: usize,
        /// Transforms given.
        transforms: usize,
    },
    /// An axis without entries.
    #[error("axis {axis} has no entries, expected at least one")]
    Empty {
        /// Its position, from 0.
        axis: usize,
    },
    /// A transform on an axis it is not made for.
    #[error("axis {axis}: `{transform}` on {found}, expected {expected}")]
    Unfit {
        /// Its position, from 0.
        axis: usize,
        /// The basis asked for.
        transform: &'static str,
        /// The axis found.
        found: String,
        /// The axes it is made for.
        expected: &'static str,
    },
}

impl Plan {
    /// Plans one transform for each axis: sphere bases on triangles only, line bases on everything else.
    pub fn new(axes: &[Axis], transforms: &[AxisTransform]) -> Result<Self, PlanError> {
        Self::with_levels(axes, transforms, &vec![None; axes.len()])
    }

    /// As [`Plan::new`], but each line axis with a number goes down that many levels only (or as many as it has). The smooth
    /// coefficients then lie at the multiples of 2^levels.
    pub fn with_levels(axes: &[Axis], transforms: &[AxisTransform], levels: &[Option<u8>]) -> Result<Self, PlanError> {
        if axes.len() != transforms.len() || axes.len() != levels.len() {
            return Err(PlanError::Count { axes: axes.len(), transforms: transforms.len().min(levels.len()) });
        }
        let axes = axes.iter().zip(transforms).zip(levels).enumerate();
        let axes = axes.map(|(i, ((axis, &transform), &levels))| AxisPlan::new(i, axis, transform, levels));
        Ok(Self { axes: axes.collect::<Result<_, _>>()? })
    }

    /// Samples to coefficients, first axis first.
    ///
    /// # Panics
    /// If there are not as many samples as the axes have entries.
    pub fn forward(&self, samples: &mut [f32]) {
        self.pass(samples, Pass::Forward);
    }

    /// Coefficients to samples: undoes [`Plan::forward`] in reverse order.
    ///
    /// # Panics
    /// If there are not as many coefficients as the axes have entries.
    pub fn inverse(&self, coefficients: &mut [f32]) {
        self.pass(coefficients, Pass::Inverse);
    }

    /// The adjoint of [`Plan::forward`]: ⟨forward u, v⟩ = ⟨u, `forward_transposed` v⟩ in the plain sum over entries.
    ///
    /// # Panics
    /// If there are not as many coefficients as the axes have entries.
    pub fn forward_transposed(&self, coefficients: &mut [f32]) {
        self.pass(coefficients, Pass::ForwardTransposed);
    }

    /// The adjoint of [`Plan::inverse`]: its entries are the inner products of the samples with the synthesis functions.
    ///
    /// # Panics
    /// If there are not as many samples as the axes have entries.
    pub fn inverse_transposed(&self, samples: &mut [f32]) {
        self.pass(samples, Pass::InverseTransposed);
    }

    /// How many axes there are.
    pub fn axes(&self) -> usize {
        self.axes.len()
    }

    /// The transform of axis `axis`.
    ///
    /// # Panics
    /// If there is no such axis.
    pub fn transform(&self, axis: usize) -> AxisTransform {
        self.axes[axis].transform
    }

    /// The coefficient tree of axis `axis`.
    ///
    /// # Panics
    /// If there is no such axis.
    pub fn tree(&self, axis: usize) -> &AxisTree {
        &self.axes[axis].tree
    }

    /// The L2 norm of the synthesis function of each index of axis `axis`; on several axes a coefficient's norm is the
    /// product. `weights` says how triangles are measured; on every other axis each entry weighs 1 either way.
    ///
    /// # Panics
    /// If there is no such axis.
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

    /// How many samples the axes have together.
    pub(super) fn samples(&self) -> usize {
        self.axes.iter().map(|axis| axis.length).product()
    }

    pub(super) fn length(&self, axis: usize) -> usize {
        self.axes[axis].length
    }

    /// The operator of axis `axis`, which has an entry `index`.
    pub(super) fn operator(&self, axis: usize, index: usize) -> &Operator {
        let axis = &self.axes[axis];
        assert!(index < axis.length, "index {index} on an axis of {} entries", axis.length);
        &axis.operator
    }

    /// One pass over one axis, of rows of `inner` samples.
    pub(super) fn pass_axis(&self, axis: usize, data: &mut [f32], inner: usize, pass: Pass) {
        self.axes[axis].pass(data, inner, pass);
    }

    fn pass(&self, data: &mut [f32], pass: Pass) {
        assert_eq!(data.len(), self.samples(), "as many samples as the plan's axes have entries");
        // The last axes, as many as a cache holds together, are done slab by slab; the others one by one over everything.
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
