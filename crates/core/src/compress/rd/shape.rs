//! Division of a tensor into planes: blocks of all other axes, leaves of the last triangle axis, rows of the last axis.

use crate::domain::{Axis, TriangleMesh};

/// Layout of a tensor around its last triangle axis, usually the outgoing directions. One entry of all axes but this
/// and the last one is a block, usually an incoming direction.
///
/// A block has a leaf for each triangle, with a row of samples: a spectrum.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    axes: Vec<Axis>,
    mesh: TriangleMesh,
    /// Axes of the tensor without the last triangle axis and, if this does not come last, without the last axis. One
    /// entry on each of them selects a block of the tensor, usually an incoming direction.
    block_axes: Vec<Axis>,
    /// Product of the lengths of the axes between the last triangle axis and the last axis; 1 if there are none.
    inner: usize,
    /// Number of samples in a row, which runs along the last axis (such as wavelengths); 1 if the last axis consists of
    /// triangles.
    length: usize,
}

impl Shape {
    /// Returns the layout of a tensor around its last triangle axis; `None` without triangles.
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

    /// Number of triangles of the last triangle axis.
    pub(crate) fn leaves(&self) -> usize {
        self.mesh.len()
    }

    pub(crate) fn block_axes(&self) -> &[Axis] {
        &self.block_axes
    }

    /// Product of the lengths of the axes between the last triangle axis and the last axis; 1 if there are none.
    pub(crate) fn inner(&self) -> usize {
        self.inner
    }

    /// Number of samples in a row, usually the number of wavelengths.
    pub(crate) fn length(&self) -> usize {
        self.length
    }

    pub(crate) fn blocks(&self) -> usize {
        self.block_axes.iter().map(Axis::len).product()
    }

    pub(crate) fn rows(&self) -> usize {
        self.blocks() * self.mesh.len()
    }

    /// Number of the row (spectrum) of triangle `leaf` in block `block`, in the order of the tensor.
    pub(crate) fn row(&self, block: usize, leaf: usize) -> usize {
        ((block / self.inner) * self.mesh.len() + leaf) * self.inner + block % self.inner
    }
}
