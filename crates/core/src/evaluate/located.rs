//! Locates many directions at once: the cells that contain them, in blocks or four lanes at a time.

use super::directions::Directions;
use super::kernel::{BLOCK, Vectors, set_vector, vector_of};
use super::lookup::MeshLookup;
use crate::domain::vector::Vector;
use crate::numeric::wide;
use std::hint::select_unpredictable;
use wide::f32x4;

/// Placeholder for a triangle's number where a direction lies outside the domain of a triangle mesh.
pub(super) const OUTSIDE: u32 = u32::MAX;

impl MeshLookup {
    /// Number of the triangle that contains the unit vector `d`, or [`OUTSIDE`].
    #[inline(always)]
    pub(super) fn locate_or_outside(&self, d: Vector) -> u32 {
        self.locate_vector(d).map_or(OUTSIDE, |triangle| triangle as u32)
    }

    /// Writes the numbers of the triangles that contain the unit vectors of a block, or [`OUTSIDE`]. Agrees with
    /// [`MeshLookup::locate_vector`].
    pub(super) fn locate_block(&self, d: &Vectors, to: &mut [u32; BLOCK]) {
        wide(
            #[inline(always)]
            || {
                let (mut folded, mut columns, mut heights) = (*d, [0; BLOCK], [0; BLOCK]);
                for i in 0..BLOCK {
                    let [x, y, z] = vector_of(d, i);
                    let [left, back, down] = [x, y, z].map(|c| (c.to_bits() >> 63) as u32);
                    let is_odd = left != back;
                    let (x, y) = (x.abs(), y.abs());
                    let octant = [if is_odd { y } else { x }, if is_odd { x } else { y }, z.abs()];
                    set_vector(&mut folded, i, octant);
                    let [across, along, height] = self.grid().cube(octant);
                    (columns[i], heights[i]) = (self.grid().column(across, along), height);
                    to[i] = self.triangle((left ^ back) + 2 * back, down);
                }
                for (i, to) in to.iter_mut().enumerate() {
                    *to += self.leaf_at(self.grid().place(columns[i], heights[i]), vector_of(&folded, i)) as u32;
                }
                for (i, to) in to.iter_mut().enumerate() {
                    *to = if self.holds(vector_of(d, i)) { *to } else { OUTSIDE };
                }
            },
        );
    }

    /// Writes the numbers of the triangles that contain directions, or [`OUTSIDE`]. Returns false if some coordinates
    /// are not a direction, or if the square of their length overflows or underflows f32.
    pub(super) fn locate_all(&self, d: Directions<'_>, to: &mut [u32]) -> bool {
        match d.coordinates() {
            Some(coordinates) => self.locate_coordinates(coordinates, to),
            None => self.locate_units(d, to),
        }
    }

    /// Finds the triangles of the mesh that contain the given unit vectors, block by block.
    fn locate_units(&self, d: Directions<'_>, to: &mut [u32]) -> bool {
        let (mut vectors, mut found) = ([[0.0; BLOCK]; 3], [0; BLOCK]);
        for (start, to) in (0..d.len()).step_by(BLOCK).zip(to.chunks_mut(BLOCK)) {
            if d.part(start, start + to.len()).write_block(&mut vectors).is_err() {
                return false;
            }
            self.locate_block(&vectors, &mut found);
            to.copy_from_slice(&found[..to.len()]);
        }
        true
    }

    /// Finds the triangles of the mesh that contain directions with f32 coordinates, four directions at a time.
    fn locate_coordinates(&self, coordinates: [&[f32]; 3], to: &mut [u32]) -> bool {
        let last = to.len().wrapping_sub(1);
        for start in (0..to.len()).step_by(4) {
            // Padded with the last direction if fewer than four remain.
            let lanes: [usize; 4] = std::array::from_fn(|k| (start + k).min(last));
            let [x, y, z] = coordinates.map(|numbers| f32x4::new(lanes.map(|lane| numbers[lane])));
            let square = x * x + y * y + z * z;
            let is_good = square.simd_gt(f32x4::splat(f32::MIN_POSITIVE)) & square.simd_lt(f32x4::splat(f32::INFINITY));
            if !is_good.all() {
                return false;
            }
            let share = f32x4::ONE / square.sqrt();
            let is_odd = x.is_sign_negative() ^ y.is_sign_negative();
            let folded = [is_odd.bitselect(y.abs(), x.abs()), is_odd.bitselect(x.abs(), y.abs()), z.abs()];
            let [columns, heights] = self.grid().columns_of_four(folded.map(|c| c * share));
            let folded = folded.map(f32x4::to_array);
            let [left, back, down] = [x, y, z].map(|c| c.is_sign_negative().to_bitmask());
            for (k, to) in to[start..].iter_mut().take(4).enumerate() {
                let [left, back, down] = [left, back, down].map(|mask| (mask >> k) & 1);
                let place = self.grid().place(columns[k] as u32, heights[k] as u32);
                let leaf = self.leaf_at(place, folded.map(|c| f64::from(c[k])));
                let held = self.triangle((left ^ back) + 2 * back, down) + leaf as u32;
                *to = select_unpredictable(self.holds([0.0, 0.0, f64::from(coordinates[2][lanes[k]])]), held, OUTSIDE);
            }
        }
        true
    }
}
