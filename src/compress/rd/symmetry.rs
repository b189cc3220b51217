//! The mesh symmetries of a tensor: which entries are equal but for noise, and which of them stand for all.

use crate::domain::{Axis, Symmetry, TriangleMesh};

/// Triangles of one axis moved together with those of another.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    /// The symmetries, the identity first.
    members: Vec<Member>,
}

/// A symmetry and what it does to blocks (all axes before) and to leaves.
#[derive(Clone, Debug)]
pub(crate) struct Member {
    pub(crate) blocks: Vec<u32>,
    pub(crate) leaves: Vec<u32>,
}

/// The blocks that are coded.
#[derive(Clone, Debug)]
pub(crate) struct Representative {
    /// The block.
    pub(crate) block: usize,
    /// Its stabiliser: numbers of the members that leave it where it is.
    pub(crate) stabiliser: Vec<usize>,
}

impl Group {
    /// The group of `symmetries` on blocks of `axes` (all but the last triangles and the spectral one) and `mesh`.
    pub(crate) fn new(symmetries: &[Symmetry], axes: &[Axis], mesh: TriangleMesh) -> Option<Self> {
        let members = symmetries.iter().map(|&symmetry| Member::new(symmetry, axes, mesh)).collect::<Option<_>>()?;
        Some(Self { members })
    }

    pub(crate) fn members(&self) -> &[Member] {
        &self.members
    }

    /// One block of every orbit, the first, in order.
    pub(crate) fn representatives(&self) -> Vec<Representative> {
        let blocks = self.members[0].blocks.len();
        (0..blocks)
            .filter(|&block| self.members.iter().all(|member| member.blocks[block] as usize >= block))
            .map(|block| Representative {
                block,
                stabiliser: (0..self.members.len())
                    .filter(|&m| self.members[m].blocks[block] as usize == block)
                    .collect(),
            })
            .collect()
    }
}

impl Member {
    fn new(symmetry: Symmetry, axes: &[Axis], mesh: TriangleMesh) -> Option<Self> {
        let mut blocks = vec![0_u32];
        for axis in axes {
            let n = axis.len() as u32;
            let moved = match axis {
                Axis::Triangles(own) => symmetry.permutation(*own)?,
                _ => (0..n).collect(),
            };
            blocks = blocks.iter().flat_map(|&outer| moved.iter().map(move |&i| outer * n + i)).collect();
        }
        Some(Self { blocks, leaves: symmetry.permutation(mesh)? })
    }
}
