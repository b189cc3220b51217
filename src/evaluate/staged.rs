//! Densities and draws of many places: block by block, and each block stage by stage.
//!
//! A block is located, drawn from the trees around its incoming directions, carried to those asked for, and looked up: what one
//! stage finds (the nodes around an incoming direction, the leaf that was drawn) the next ones need not search for.

use super::batch::{Directions, Pairs};
use super::carried::{CarriedBlock, Origins};
use super::incoming::Around;
use super::kernel::{BLOCK, Block, Vectors, set_vector, vector_of};
use super::located::OUTSIDE;
use super::material::Form;
use super::mixture::{FEW, Shares, stays};
use super::planes::Planes;
use super::sampling::check_point;
use super::smooth::{Mixed, SeenBlock, Smooth};
use super::trees::Trees;
use super::warp::{BELOW_ONE, Density, Draws, SampleOptions};
use super::{EvaluateError, Material, unfit};
use crate::domain::{Direction, Domain, wide};

/// What the stages of a block write, kept from one block to the next.
pub(super) struct Room {
    pub(super) arrived: Arrived,
    pub(super) draws: Draws,
    mixed: MixedBlock,
    carried: CarriedBlock,
    seen: SeenBlock,
}

impl Room {
    pub(super) const NEW: Self = Self {
        arrived: Arrived {
            wi: UP,
            turns: [[1.0; BLOCK], [0.0; BLOCK]],
            entries: [0; BLOCK],
            around: [Around::NOWHERE; BLOCK],
        },
        draws: Draws::NOTHING,
        mixed: MixedBlock { shares: [Shares::NONE; BLOCK], defensive: [0.0; BLOCK], entry: 0 },
        carried: CarriedBlock::NOWHERE,
        seen: SeenBlock::NOTHING,
    };
}

/// The incoming side of a block of places.
pub(super) struct Arrived {
    /// As unit vectors, at azimuth 0 for isotropic data; +z for quantities without.
    wi: Vectors,
    /// Cosine and sine of the azimuth of isotropic data.
    turns: [Block; 2],
    /// The entries of the incoming axis.
    entries: [u32; BLOCK],
    /// The nodes.
    around: [Around; BLOCK],
}

/// The mixtures of a block of places: the trees' shares, and the defensive parts.
struct MixedBlock {
    entry: usize,
    shares: [Shares; BLOCK],
    defensive: Block,
}

impl Material {
    /// Whether blocks are drawn stage by stage: to the leaves of trees, and alike on both sides of the horizon.
    pub(super) fn is_staged(&self, trees: &Trees, options: SampleOptions) -> bool {
        let is_alike = |(alignment, domain)| {
            domain != Domain::Sphere || alignment == super::Alignment::Rotation || !trees.carries()
        };
        options.level.is_none()
            && matches!(self.form, Form::Planes { .. })
            && (options.density == Density::Uniform || self.aligned_domain().is_none_or(is_alike))
    }

    /// Writes the incoming side of up to [`BLOCK`] places: the entries that hold directions where they are asked for, and the
    /// nodes of a smooth form.
    pub(super) fn arrive(
        &self,
        smooth: Option<&Smooth>,
        wi: Option<Directions<'_>>,
        count: usize,
        to: &mut Arrived,
    ) -> Result<(), EvaluateError> {
        let entries = &mut to.entries[..count];
        let Some(directions) = wi else { return self.incoming_entries(Pairs { index: &[], wi, wo: None }, entries) };
        directions.write_block(&mut to.wi)?;
        if let Some(lookup) = self.incoming_mesh() {
            lookup.locate_block(&to.wi, &mut to.entries);
            if to.entries.contains(&OUTSIDE) {
                // One by one, which tells what is wrong.
                return self.incoming_entries(Pairs { index: &[], wi, wo: None }, &mut to.entries[..count]);
            }
        } else if smooth.is_none() || !self.is_isotropic() || to.wi[2].iter().any(|&z| z < 0.0) {
            self.incoming_entries(Pairs { index: &[], wi, wo: None }, entries)?;
        }
        if self.is_isotropic() {
            for i in 0..BLOCK {
                let [x, y, z] = vector_of(&to.wi, i);
                let length = (x * x + y * y).sqrt();
                let is_turned = length > 0.0;
                to.turns[0][i] = if is_turned { x / length } else { 1.0 };
                to.turns[1][i] = if is_turned { y / length } else { 0.0 };
                set_vector(&mut to.wi, i, [length, 0.0, z]);
            }
        }
        let Some(smooth) = smooth else { return Ok(()) };
        for (i, to_around) in to.around.iter_mut().enumerate().take(count) {
            if let Some(around) = smooth.nodes.around_in(to.entries[i] as usize, vector_of(&to.wi, i)) {
                *to_around = around;
            }
        }
        Ok(())
    }

    /// The incoming side of places for drawing, and their mixtures.
    pub(super) fn arrive_for(
        &self,
        trees: &Trees,
        entry: usize,
        wi: Option<Directions<'_>>,
        options: SampleOptions,
        count: usize,
        room: &mut Room,
    ) -> Result<(), EvaluateError> {
        let smooth = self.smooth().filter(|_| options.density == Density::Linear);
        self.arrive(smooth, wi, count, &mut room.arrived)?;
        let Room { arrived, mixed, .. } = room;
        mixed.entry = entry;
        let defensive = if trees.background().has_any(entry, options.density) { options.defensive } else { 0.0 };
        let in_the_dark = if defensive > 0.0 { 1.0 } else { 0.0 };
        for i in 0..count {
            let shares = if smooth.is_some() {
                let Around { nodes, weights, count } = arrived.around[i];
                Shares::new(trees, entry, nodes, weights.map(f64::from), count)
            } else {
                Shares::new(trees, entry, [arrived.entries[i], 0, 0], [1.0, 0.0, 0.0], 1)
            };
            mixed.defensive[i] = if shares.has_light() { defensive } else { in_the_dark };
            mixed.shares[i] = shares;
        }
        Ok(())
    }

    fn smooth(&self) -> Option<&Smooth> {
        if let Form::Planes { smooth, .. } = &self.form { Some(smooth) } else { None }
    }

    /// The densities of up to [`BLOCK`] directions; 0 outside the outgoing domain.
    pub(super) fn densities_at(
        &self,
        trees: &Trees,
        wo: Directions<'_>,
        options: SampleOptions,
        room: &mut Room,
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        let Some(lookup) = &self.outgoing else { return Ok(()) };
        wo.write_block(&mut room.draws.directions)?;
        if self.is_isotropic() {
            let [cos, sin] = room.arrived.turns;
            turn_block(&mut room.draws.directions, &[cos, sin.map(|sin| -sin)]);
        }
        self.write_densities(trees, options, out.len(), room);
        for (i, out) in out.iter_mut().enumerate() {
            let is_held = lookup.holds(vector_of(&room.draws.directions, i));
            *out = if is_held { room.draws.pdf[i] as f32 } else { 0.0 };
        }
        Ok(())
    }

    /// Writes the densities of the mixtures at the directions of `draws`.
    fn write_densities(&self, trees: &Trees, options: SampleOptions, count: usize, room: &mut Room) {
        let Room { arrived, draws, mixed, carried, .. } = room;
        let (Some(lookup), warps) = (&self.outgoing, trees.warps()) else { return };
        let first = trees.tree(mixed.entry, 0);
        let sum = &mut draws.pdf;
        sum.fill(0.0);
        let alignment = self.aligned_domain().filter(|_| trees.carries() && options.density == Density::Linear);
        if let Some((alignment, domain)) = alignment {
            carried.set(alignment, domain, &arrived.wi);
            let mut own = [0; BLOCK];
            lookup.locate_block(&draws.directions, &mut own);
            for k in 0..FEW {
                if mixed.shares[..count].iter().all(|shares| shares.parts[k] == 0.0) {
                    continue;
                }
                for i in 0..count {
                    let node = mixed.shares[i].nodes[k] as usize;
                    set_vector(&mut carried.from, i, self.node_direction(node));
                }
                let Origins { there, parts, staying } = carried.origins(&draws.directions);
                lookup.locate_block(&there, &mut draws.leaves);
                wide(
                    #[inline(always)]
                    || {
                        for i in 0..count {
                            let Shares { nodes, parts: shares, .. } = mixed.shares[i];
                            let tree = first + nodes[k] as usize;
                            let mut density = 0.0;
                            if draws.leaves[i] != OUTSIDE && parts[i] > 0.0 {
                                density = parts[i]
                                    * warps.linear_density(tree, draws.leaves[i] as usize, vector_of(&there, i));
                            }
                            if staying[i] > 0.0 && own[i] != OUTSIDE {
                                let direction = vector_of(&draws.directions, i);
                                density += staying[i] * warps.linear_density(tree, own[i] as usize, direction);
                            }
                            sum[i] += shares[k] * density;
                        }
                    },
                );
            }
        } else {
            lookup.locate_block(&draws.directions, &mut draws.leaves);
            for i in (0..count).filter(|&i| draws.leaves[i] != OUTSIDE) {
                let (leaf, direction) = (draws.leaves[i] as usize, vector_of(&draws.directions, i));
                let Shares { nodes, parts: shares, count } = mixed.shares[i];
                sum[i] = match options.density {
                    Density::Uniform => shares[0] * warps.uniform_density(first + nodes[0] as usize, leaf, direction),
                    Density::Linear => {
                        let nodes = nodes.map(|node| first + node as usize);
                        warps.linear_densities(&nodes[..count], &shares, leaf, direction)
                    }
                };
            }
        }
        if mixed.defensive[..count].iter().all(|&defensive| defensive == 0.0) {
            return;
        }
        for i in (0..count).filter(|&i| mixed.defensive[i] > 0.0) {
            let direction = Direction::from_unit(vector_of(&draws.directions, i));
            let background = trees.background().pdf(warps, (mixed.entry, options.density), direction);
            sum[i] = (1.0 - mixed.defensive[i]) * sum[i] + mixed.defensive[i] * background;
        }
    }

    /// Draws for up to [`BLOCK`] points of the unit square.
    pub(super) fn draw_block(
        &self,
        trees: &Trees,
        u: [&[f32]; 2],
        options: SampleOptions,
        room: &mut Room,
    ) -> Result<(), EvaluateError> {
        let Room { arrived, draws, mixed, carried, .. } = room;
        let count = u[0].len();
        let mut points = [[0.0; BLOCK]; 2];
        let mut is_outside = false;
        for (points, u) in points.iter_mut().zip(u) {
            for (point, &u) in points.iter_mut().zip(u) {
                *point = f64::from(u);
                is_outside |= !(0.0..=1.0).contains(&u);
            }
        }
        if is_outside {
            (0..count).try_for_each(|i| check_point([points[0][i], points[1][i]]))?;
        }
        let (warps, first) = (trees.warps(), trees.tree(mixed.entry, 0));
        let mut chosen = [first as u32; BLOCK];
        let (mut is_defensive, mut may_stay) = ([false; BLOCK], [false; BLOCK]);
        let alignment = self.aligned_domain().filter(|_| trees.carries() && options.density == Density::Linear);
        for i in 0..count {
            let by_trees = 1.0 - mixed.defensive[i];
            is_defensive[i] = points[0][i] >= by_trees && mixed.defensive[i] > 0.0;
            if is_defensive[i] {
                points[0][i] = ((points[0][i] - by_trees) / mixed.defensive[i]).min(BELOW_ONE);
                points[1][i] = points[1][i].min(BELOW_ONE);
            } else {
                let (node, left) = mixed.shares[i].choose((points[0][i] / by_trees).min(BELOW_ONE));
                chosen[i] += node;
                points[0][i] = left;
                if alignment.is_some() {
                    (points[0][i], may_stay[i]) = stays(left);
                }
                set_vector(&mut carried.from, i, self.node_direction(node as usize));
            }
        }
        warps.draw_block(&chosen, &points, options.density, draws);
        // A tree without light draws nothing.
        let is_drawn = draws.pdf.map(|pdf| pdf > 0.0);
        if let Some((alignment, domain)) = alignment {
            carried.set(alignment, domain, &arrived.wi);
            carried.drawn(&mut draws.directions, &may_stay);
        }
        for i in (0..count).filter(|&i| is_defensive[i]) {
            let at = (mixed.entry, options.density);
            if let Some(direction) = trees.background().draw(warps, at, [points[0][i], points[1][i]]) {
                set_vector(&mut draws.directions, i, direction.xyz());
            }
        }
        self.write_densities(trees, options, count, room);
        let Room { arrived, draws, .. } = room;
        for i in 0..count {
            if !is_drawn[i] && !is_defensive[i] {
                draws.pdf[i] = 0.0;
            }
        }
        if self.is_isotropic() {
            turn_block(&mut draws.directions, &arrived.turns);
        }
        Ok(())
    }

    /// The rows of the smooth form at what was drawn, nothing where nothing was.
    pub(super) fn rows_at_draws(&self, smooth: &Smooth, entry: usize, room: &mut Room, rows: &mut [Mixed]) {
        room.seen.wo = room.draws.directions;
        self.smooth_rows(smooth, entry, &room.arrived, &mut room.seen, rows);
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
        self.smooth_rows(smooth, entry, &room.arrived, &mut room.seen, rows);
        for (i, row) in rows.iter_mut().enumerate() {
            if !lookup.holds(vector_of(&room.seen.wo, i)) {
                *row = Mixed::NOTHING;
            }
        }
        Ok(())
    }

    /// The rows of the smooth form at the outgoing directions of `seen`.
    fn smooth_rows(&self, smooth: &Smooth, entry: usize, arrived: &Arrived, seen: &mut SeenBlock, rows: &mut [Mixed]) {
        seen.wi = arrived.wi;
        if self.is_isotropic() {
            let [cos, sin] = arrived.turns;
            turn_block(&mut seen.wo, &[cos, sin.map(|sin| -sin)]);
        }
        for (i, around) in arrived.around.iter().enumerate().take(rows.len()) {
            seen.set_around(i, around);
        }
        smooth.at_block(entry, seen, rows);
    }

    /// The rows of the cells in which directions were drawn, nothing where none was.
    pub(super) fn rows_of_leaves(&self, planes: &Planes, room: &Room, rows: &mut [Mixed]) {
        let [n_in, n_out, _] = self.shape;
        for (i, row) in rows.iter_mut().enumerate() {
            let incoming = room.mixed.entry * n_in + room.arrived.entries[i] as usize;
            let cell = incoming * n_out + room.draws.leaves[i] as usize;
            *row = if room.draws.pdf[i] > 0.0 { planes.mixed(cell) } else { Mixed::NOTHING };
        }
    }
}

/// Turns directions about +z by the angles with these cosines and sines.
fn turn_block(directions: &mut Vectors, [cos, sin]: &[Block; 2]) {
    for i in 0..BLOCK {
        let [x, y, z] = vector_of(directions, i);
        set_vector(directions, i, [cos[i] * x - sin[i] * y, sin[i] * x + cos[i] * y, z]);
    }
}

/// The incoming direction of quantities without one.
const UP: Vectors = [[0.0; BLOCK], [0.0; BLOCK], [1.0; BLOCK]];
