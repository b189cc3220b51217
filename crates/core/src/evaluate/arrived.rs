//! The incoming side of a block of places: the axis entries that contain its directions, and the nodes around them.

use super::directions::{Directions, Pairs};
use super::error::EvaluateError;
use super::geometry::{Geometry, in_plane};
use super::incoming::Around;
use super::kernel::{BLOCK, Block, Vectors, set_vector, vector_of};
use super::located::OUTSIDE;
use super::smooth::Smooth;
use crate::domain::vector::turned;

/// Incoming directions of a block of queries (pairs of directions evaluated together), with the interpolation nodes
/// around them.
pub(super) struct Arrived {
    /// Incoming unit vectors; rotated to azimuth 0 for isotropic data, +z for quantities without an incoming direction.
    wi: Vectors,
    /// Cosines, then sines, of the azimuths of the incoming directions; set for isotropic data only.
    turns: [Block; 2],
    /// For each query of the block, number of the incoming sample (triangle or elevation) to which the incoming
    /// direction belongs.
    entries: [u32; BLOCK],
    /// For each query of the block, the interpolation nodes around its incoming direction.
    around: [Around; BLOCK],
}

impl Arrived {
    /// Initial scratch space for a block of incoming directions; every value is overwritten before it is read.
    pub(super) const NEW: Self =
        Self { wi: UP, turns: [[1.0; BLOCK], [0.0; BLOCK]], entries: [0; BLOCK], around: [Around::NOWHERE; BLOCK] };

    /// Looks up the incoming directions of up to [`BLOCK`] queries: the incoming triangle that contains each direction
    /// and, for smooth interpolation, the nodes around it. Isotropic data with smooth interpolation leave the triangles
    /// unset.
    pub(super) fn write(
        &mut self,
        geometry: &Geometry,
        smooth: Option<&Smooth>,
        wi: Option<Directions<'_>>,
        count: usize,
    ) -> Result<(), EvaluateError> {
        let Some(directions) = wi else {
            return geometry.incoming_entries(Pairs { index: &[], wi, wo: None }, &mut self.entries[..count]);
        };
        directions.write_block(&mut self.wi)?;
        let needs_each = if let Some(lookup) = geometry.incoming_mesh() {
            lookup.locate_block(&self.wi, &mut self.entries);
            self.entries[..count].contains(&OUTSIDE)
        } else {
            smooth.is_none() || !geometry.is_isotropic() || !self.wi[2].iter().all(|&z| z >= 0.0)
        };
        if needs_each {
            // Locates one by one, so that the error names the direction.
            geometry.incoming_entries(Pairs { index: &[], wi, wo: None }, &mut self.entries[..count])?;
        }
        if geometry.is_isotropic() {
            for i in 0..BLOCK {
                let (wi, [cos, sin]) = in_plane(vector_of(&self.wi, i));
                set_vector(&mut self.wi, i, wi);
                (self.turns[0][i], self.turns[1][i]) = (cos, sin);
            }
        }
        let Some(smooth) = smooth else { return Ok(()) };
        for (i, to_around) in self.around.iter_mut().enumerate().take(count) {
            if let Some(around) = smooth.nodes().around_in(self.entries[i] as usize, vector_of(&self.wi, i)) {
                *to_around = around;
            }
        }
        Ok(())
    }

    #[inline(always)]
    pub(super) fn wi(&self) -> &Vectors {
        &self.wi
    }

    /// Number of the incoming sample (triangle or elevation) to which the incoming direction of query `i` of the block
    /// belongs.
    #[inline(always)]
    pub(super) fn entry(&self, i: usize) -> u32 {
        self.entries[i]
    }

    /// Interpolation nodes around the incoming direction of each query of the block.
    #[inline(always)]
    pub(super) fn around(&self) -> &[Around; BLOCK] {
        &self.around
    }

    /// Rotates the outgoing direction of each query about the normal by the azimuth of the query's incoming direction
    /// `wi`. This leads from the frame of isotropic data, in which `wi` has azimuth 0, to the frame of the query.
    pub(super) fn turn(&self, directions: &mut Vectors) {
        turn_block(directions, &self.turns);
    }

    /// Rotates the outgoing direction of each query about the normal by minus the azimuth of the query's incoming
    /// direction `wi`. This leads to the frame of isotropic data, in which `wi` has azimuth 0.
    pub(super) fn turn_back(&self, directions: &mut Vectors) {
        let [cos, sin] = self.turns;
        turn_block(directions, &[cos, sin.map(|sin| -sin)]);
    }
}

/// Rotates each direction of a block about +z by the angle with the given cosine and sine.
fn turn_block(directions: &mut Vectors, [cos, sin]: &[Block; 2]) {
    for i in 0..BLOCK {
        let to = turned(vector_of(directions, i), [cos[i], sin[i]]);
        set_vector(directions, i, to);
    }
}

/// Placeholder incoming directions (+z) for a block of a quantity without an incoming direction.
const UP: Vectors = [[0.0; BLOCK], [0.0; BLOCK], [1.0; BLOCK]];
