//! Densities and draws of many places: block by block, and each block stage by stage.
//!
//! A block is located, drawn in the cells of its incoming directions, carried to those asked for, and looked up: what one
//! stage finds (the cell of an incoming direction, the leaf that was drawn) the next ones need not search for.

use super::batch::{Directions, Pairs};
use super::carried::CarriedBlock;
use super::kernel::{BLOCK, Vectors, set_vector, vector_of};
use super::located::OUTSIDE;
use super::planes::Planes;
use super::sampling::check_point;
use super::smooth::{Mixed, SeenBlock, Smooth};
use super::warp::{Density, Draws, SampleOptions, Warps};
use super::{EvaluateError, Material, unfit};

/// What the stages of a block write, kept from one block to the next.
pub(super) struct Room {
    pub(super) arrived: Arrived,
    pub(super) draws: Draws,
    carried: CarriedBlock,
    seen: SeenBlock,
}

impl Room {
    pub(super) const NEW: Self = Self {
        arrived: Arrived { wi: UP, entries: [0; BLOCK], cells: [0; BLOCK] },
        draws: Draws::NOTHING,
        carried: CarriedBlock::NOWHERE,
        seen: SeenBlock::NOTHING,
    };
}

/// The incoming side of a block of places.
pub(super) struct Arrived {
    /// As unit vectors; +z for quantities without.
    wi: Vectors,
    /// The entries of the incoming axis.
    pub(super) entries: [u32; BLOCK],
    /// The cells of the axes before the outgoing one.
    cells: [u32; BLOCK],
}

impl Material {
    /// Whether blocks are drawn stage by stage: by the tree alone, to its leaves, and nothing turned with the azimuth.
    pub(super) fn is_staged(&self, options: SampleOptions) -> bool {
        options == SampleOptions { density: options.density, ..SampleOptions::default() } && !self.is_isotropic()
    }

    /// Writes the incoming side of up to [`BLOCK`] places in `entry` of the opaque axes.
    pub(super) fn arrive(
        &self,
        entry: usize,
        wi: Option<Directions<'_>>,
        count: usize,
        to: &mut Arrived,
    ) -> Result<(), EvaluateError> {
        if let Some(wi) = wi {
            wi.write_block(&mut to.wi)?;
        }
        if let (Some(lookup), Some(_)) = (self.incoming_mesh(), wi) {
            lookup.locate_block(&to.wi, &mut to.entries);
        }
        if self.incoming_mesh().is_none() || wi.is_none() || to.entries.contains(&OUTSIDE) {
            // One by one, which tells what is wrong.
            self.incoming_entries(Pairs { index: &[], wi, wo: None }, &mut to.entries[..count])?;
        }
        let first = (entry * self.shape[0]) as u32;
        to.cells.iter_mut().zip(to.entries).for_each(|(cell, incoming)| *cell = first + incoming);
        Ok(())
    }

    /// Writes how directions drawn with a linear density are carried; `false` where they stay.
    fn carry_block(&self, arrived: &Arrived, density: Density, to: &mut CarriedBlock) -> bool {
        let Some((alignment, side)) = self.carries().filter(|_| density == Density::Linear) else { return false };
        (to.alignment, to.side, to.to) = (alignment, side, arrived.wi);
        for (i, &entry) in arrived.entries.iter().enumerate() {
            set_vector(&mut to.from, i, self.incoming_directions[entry as usize]);
        }
        true
    }

    /// The densities of up to [`BLOCK`] directions by the tree alone, linear in its leaves.
    pub(super) fn linear_densities(
        &self,
        warps: &Warps,
        wo: Directions<'_>,
        room: &mut Room,
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        let Room { arrived, draws, carried, seen } = room;
        let Some(lookup) = &self.outgoing else { return Ok(()) };
        wo.write_block(&mut seen.wo)?;
        let wo = &seen.wo;
        if self.carry_block(arrived, Density::Linear, carried) {
            carried.write_straight_origins(wo, &mut draws.directions, &mut draws.pdf);
            lookup.locate_block(&draws.directions, &mut draws.leaves);
            warps.scale_by_linear_density(&arrived.cells, draws);
            for i in (0..out.len()).filter(|&i| carried.has_more[i] != 0) {
                draws.pdf[i] += carried.other_densities(i, vector_of(wo, i), |there| {
                    warps.pdf(arrived.cells[i] as usize, there, &SampleOptions::default())
                });
            }
        } else {
            (draws.directions, draws.pdf) = (*wo, [1.0; BLOCK]);
            lookup.locate_block(wo, &mut draws.leaves);
            warps.scale_by_linear_density(&arrived.cells, draws);
        }
        for (i, out) in out.iter_mut().enumerate() {
            *out = if lookup.holds(vector_of(wo, i)) { draws.pdf[i] as f32 } else { 0.0 };
        }
        Ok(())
    }

    /// Draws for up to [`BLOCK`] points of the unit square.
    pub(super) fn draw_block(
        &self,
        warps: &Warps,
        u: [&[f32]; 2],
        density: Density,
        room: &mut Room,
    ) -> Result<(), EvaluateError> {
        let Room { arrived, draws, carried, .. } = room;
        let mut points = [[0.0; BLOCK]; 2];
        let mut is_outside = false;
        for (points, u) in points.iter_mut().zip(u) {
            for (point, &u) in points.iter_mut().zip(u) {
                *point = f64::from(u);
                is_outside |= !(0.0..=1.0).contains(&u);
            }
        }
        if is_outside {
            (0..u[0].len()).try_for_each(|i| check_point([points[0][i], points[1][i]]))?;
        }
        warps.draw_block(&arrived.cells, &points, density, draws);
        if self.carry_block(arrived, density, carried) {
            let own = SampleOptions::default();
            carried.out(&mut draws.directions, &mut draws.pdf, u[0].len(), |i, there| {
                warps.pdf(arrived.cells[i] as usize, there, &own)
            });
        }
        Ok(())
    }

    /// The rows of the smooth form at what was drawn, nothing where nothing was.
    pub(super) fn rows_at_draws(smooth: &Smooth, entry: usize, room: &mut Room, rows: &mut [Mixed]) {
        room.seen.wo = room.draws.directions;
        Self::smooth_rows(smooth, entry, &room.arrived, &mut room.seen, rows);
        for (row, _) in rows.iter_mut().zip(&room.draws.pdf).filter(|(_, pdf)| **pdf <= 0.0) {
            *row = Mixed::NOTHING;
        }
    }

    /// The rows of the smooth form at asked directions, nothing outside the outgoing domain.
    pub(super) fn smooth_rows_at(
        &self,
        smooth: &Smooth,
        entry: usize,
        wo: Option<Directions<'_>>,
        room: &mut Room,
        rows: &mut [Mixed],
    ) -> Result<(), EvaluateError> {
        let (Some(lookup), Some(wo)) = (&self.outgoing, wo) else {
            return unfit(format!("wo was given, but this {} has no outgoing axis", self.quantity()));
        };
        wo.write_block(&mut room.seen.wo)?;
        Self::smooth_rows(smooth, entry, &room.arrived, &mut room.seen, rows);
        for (i, row) in rows.iter_mut().enumerate() {
            if !lookup.holds(vector_of(&room.seen.wo, i)) {
                *row = Mixed::NOTHING;
            }
        }
        Ok(())
    }

    /// The rows of the smooth form at the outgoing directions of `seen`.
    fn smooth_rows(smooth: &Smooth, entry: usize, arrived: &Arrived, seen: &mut SeenBlock, rows: &mut [Mixed]) {
        seen.wi = arrived.wi;
        for i in 0..BLOCK {
            if let Some(around) = smooth.nodes.around_in(arrived.entries[i] as usize, vector_of(&seen.wi, i)) {
                seen.set_around(i, &around);
            }
        }
        smooth.at_block(entry, seen, rows);
    }

    /// The rows of the cells in which directions were drawn, nothing where none was.
    pub(super) fn rows_of_leaves(&self, planes: &Planes, room: &Room, rows: &mut [Mixed]) {
        for (i, row) in rows.iter_mut().enumerate() {
            let cell = room.arrived.cells[i] as usize * self.shape[1] + room.draws.leaves[i] as usize;
            *row = if room.draws.pdf[i] > 0.0 { planes.mixed(cell) } else { Mixed::NOTHING };
        }
    }
}

/// The incoming direction of quantities without one.
const UP: Vectors = [[0.0; BLOCK], [0.0; BLOCK], [1.0; BLOCK]];
