//! Division of a tensor into planes: blocks of all other axes, leaves of the last triangle axis, rows of the last axis.

use crate::domain::{Axis, TriangleMesh};

/// Tensor as planes.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    axes: Vec<Axis>,
    mesh: TriangleMesh,
    /// Axes of the blocks.
    block_axes: Vec<Axis>,
    /// Number of blocks of axes after the triangles.
    inner: usize,
    /// Number of samples in a row; 1 if the triangles are the last axis.
    length: usize,
}

impl Shape {
    /// Returns the shape of a tensor; `None` without triangles.
    pub(crate) fn of(axes: &[Axis]) -> Option<Self> {
        let at = axes.iter().rposition(|axis| matches!(axis, Axis::Triangles(_)))?;
        let Axis::Triangles(mesh) = axes[at] else { return None };
        let last = axes.len() - 1;
        let spectral = at < last;
        let between = &axes[at + 1..if spectral { last } else { at + 1 }];
        let block_axes = axes[..at].iter().chain(between).cloned().collect();
        Some(Self {
            axes: axes.to_vec(),
            mesh,
            block_axes,
            inner: between.iter().map(Axis::len).product(),
            length: if spectral { axes[last].len() } else { 1 },
        })
    }

    pub(crate) fn axes(&self) -> &[Axis] {
        &self.axes
    }

    pub(crate) fn mesh(&self) -> TriangleMesh {
        self.mesh
    }

    /// Number of leaves of a plane.
    pub(crate) fn leaves(&self) -> usize {
        self.mesh.len()
    }

    pub(crate) fn block_axes(&self) -> &[Axis] {
        &self.block_axes
    }

    /// Number of blocks of axes after the triangles.
    pub(crate) fn inner(&self) -> usize {
        self.inner
    }

    /// Number of samples in a row.
    pub(crate) fn length(&self) -> usize {
        self.length
    }

    pub(crate) fn blocks(&self) -> usize {
        self.block_axes.iter().map(Axis::len).product()
    }

    pub(crate) fn rows(&self) -> usize {
        self.blocks() * self.mesh.len()
    }

    /// Row of leaf `leaf` in block `block`.
    pub(crate) fn row(&self, block: usize, leaf: usize) -> usize {
        ((block / self.inner) * self.mesh.len() + leaf) * self.inner + block % self.inner
    }
}
