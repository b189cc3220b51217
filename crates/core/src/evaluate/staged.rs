//! Densities and draws of many places: block by block, and each block stage by stage.
//!
//! A block is located, drawn from the trees around its incoming directions, carried to those asked for, and looked up: what one
//! stage finds (the nodes around an incoming direction, the leaf that was drawn) the next ones need not search for.

use super::batch::{Directions, Pairs};
use super::carried::{CarriedBlock, Carry, Origins, STAYING};
use super::incoming::{Alignment, Around};
use super::kernel::{BLOCK, Block, Vectors, set_vector, vector_of};
use super::located::OUTSIDE;
use super::material::{Form, in_plane};
use super::mixture::{self, FEW, Shares, split};
use super::planes::Planes;
use super::sampling::check_point;
use super::smooth::{Mixed, SeenBlock, Smooth};
use super::trees::Trees;
use super::warp::{BELOW_ONE, Density, Draws, SampleOptions};
use super::{EvaluateError, Material, unfit};
use crate::domain::vector::turned;
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
        mixed: MixedBlock {
            shares: [Shares::NONE; BLOCK],
            defensive: [0.0; BLOCK],
            is_drawn: false,
            drawn: [[0.0; BLOCK]; 2],
            entry: 0,
        },
        carried: CarriedBlock::NOWHERE,
        seen: SeenBlock::NOTHING,
    };

    /// The densities of trees whose directions stay, in the leaves of `draws`.
    fn write_densities_in_leaves(&mut self, trees: &Trees, density: Density, count: usize) {
        let Self { draws, mixed, .. } = self;
        let (warps, first) = (trees.warps(), trees.tree(mixed.entry, 0));
        for i in 0..count {
            let (leaf, direction) = (draws.leaves[i] as usize, vector_of(&draws.directions, i));
            let Shares { nodes, parts: shares } = mixed.shares[i];
            draws.pdf[i] = match density {
                _ if draws.leaves[i] == OUTSIDE => 0.0,
                Density::Uniform => shares[0] * warps.uniform_density(first + nodes[0] as usize, leaf, direction),
                Density::Linear => {
                    let nodes = nodes.map(|node| first + node as usize);
                    warps.linear_densities(&nodes, &shares, leaf, direction)
                }
            };
        }
    }

    /// Mixes the densities of trees with those of defensive parts.
    fn defend(&mut self, trees: &Trees, density: Density, count: usize) {
        let Self { draws, mixed, .. } = self;
        for i in (0..count).filter(|&i| mixed.defensive[i] > 0.0) {
            let direction = Direction::from_unit(vector_of(&draws.directions, i));
            let background = trees.background().pdf(trees.warps(), (mixed.entry, density), direction);
            draws.pdf[i] = mixture::mixed(mixed.defensive[i], draws.pdf[i], background);
        }
    }
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
    /// True while directions are drawn, false where densities of given directions are asked for.
    is_drawn: bool,
    /// The density with which the tree of the first node drew each direction: in the first block of those that were carried from
    /// the node, in the second of those that stay; 0 elsewhere, as for directions of the defensive part.
    drawn: [Block; 2],
}

impl Material {
    /// Whether blocks are drawn stage by stage: to the leaves of trees, and alike on both sides of the horizon.
    pub(super) fn is_staged(&self, trees: &Trees, options: SampleOptions) -> bool {
        let is_alike = |(alignment, domain)| domain != Domain::Sphere || alignment == Alignment::Rotation;
        options.level.is_none()
            && matches!(self.form, Form::Planes { .. })
            && trees.carry(options.density).is_none_or(is_alike)
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
        let Some(directions) = wi else {
            return self.incoming_entries(Pairs { index: &[], wi, wo: None }, &mut to.entries[..count]);
        };
        directions.write_block(&mut to.wi)?;
        let needs_each = if let Some(lookup) = self.incoming_mesh() {
            lookup.locate_block(&to.wi, &mut to.entries);
            to.entries[..count].contains(&OUTSIDE)
        } else {
            smooth.is_none() || !self.is_isotropic() || to.wi[2].iter().any(|&z| z < 0.0)
        };
        if needs_each {
            // One by one, which tells what is wrong.
            self.incoming_entries(Pairs { index: &[], wi, wo: None }, &mut to.entries[..count])?;
        }
        if self.is_isotropic() {
            for i in 0..BLOCK {
                let (wi, [cos, sin]) = in_plane(vector_of(&to.wi, i));
                set_vector(&mut to.wi, i, wi);
                (to.turns[0][i], to.turns[1][i]) = (cos, sin);
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
        for i in 0..count {
            let shares = if smooth.is_some() {
                Shares::around(trees, entry, &arrived.around[i])
            } else {
                Shares::one(trees, entry, arrived.entries[i])
            };
            mixed.defensive[i] = trees.defensive(entry, options, shares.has_light());
            mixed.shares[i] = shares;
        }
        Ok(())
    }

    pub(super) fn smooth(&self) -> Option<&Smooth> {
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
        room.mixed.is_drawn = false;
        lookup.locate_block(&room.draws.directions, &mut room.draws.leaves);
        self.write_densities(trees, options, out.len(), room);
        for (i, out) in out.iter_mut().enumerate() {
            let is_held = lookup.holds(vector_of(&room.draws.directions, i));
            *out = if is_held { room.draws.pdf[i] as f32 } else { 0.0 };
        }
        Ok(())
    }

    /// Writes the densities of the mixtures at the directions of `draws`, into their `pdf`. Leaves are those of the
    /// directions, or those in which they were drawn.
    fn write_densities(&self, trees: &Trees, options: SampleOptions, count: usize, room: &mut Room) {
        if let Some(carry) = trees.carry(options.density) {
            self.write_carried_densities(trees, carry, count, room);
        } else {
            room.write_densities_in_leaves(trees, options.density, count);
        }
        room.defend(trees, options.density, count);
    }

    /// The densities of trees whose directions are carried.
    fn write_carried_densities(&self, trees: &Trees, carry: Carry, count: usize, room: &mut Room) {
        let Room { arrived, draws, mixed, carried, .. } = room;
        let (Some(lookup), warps) = (&self.outgoing, trees.warps()) else { return };
        let first = trees.tree(mixed.entry, 0);
        let sum = &mut draws.pdf;
        sum.fill(0.0);
        carried.set(carry, &arrived.wi);
        let mut own = draws.leaves;
        if mixed.is_drawn {
            lookup.locate_block(&draws.directions, &mut own);
        }
        for k in 0..FEW {
            if mixed.shares[..count].iter().all(|shares| shares.parts[k] == 0.0) {
                continue;
            }
            for i in 0..count {
                let node = mixed.shares[i].nodes[k] as usize;
                set_vector(&mut carried.from, i, self.node_direction(node));
            }
            let Origins { there, parts: mut carried_part, mut staying } = carried.origins(&draws.directions);
            let mut densities = [0.0; BLOCK];
            if k == 0 && mixed.is_drawn {
                let [carried, stayed] = &mixed.drawn;
                for i in 0..BLOCK {
                    densities[i] = carried_part[i] * carried[i] + staying[i] * stayed[i];
                    carried_part[i] = if carried[i] > 0.0 { 0.0 } else { carried_part[i] };
                    staying[i] = if stayed[i] > 0.0 { 0.0 } else { staying[i] };
                }
                for i in (0..count).filter(|&i| carried_part[i] > 0.0) {
                    draws.leaves[i] = lookup.locate_or_outside(vector_of(&there, i));
                }
            } else {
                lookup.locate_block(&there, &mut draws.leaves);
            }
            wide(
                #[inline(always)]
                || {
                    for (i, density) in densities.iter_mut().enumerate().take(count) {
                        let Shares { nodes, parts: shares } = mixed.shares[i];
                        let tree = first + nodes[k] as usize;
                        if carried_part[i] > 0.0 && draws.leaves[i] != OUTSIDE {
                            let leaf = draws.leaves[i] as usize;
                            *density += carried_part[i] * warps.linear_density(tree, leaf, vector_of(&there, i));
                        }
                        if staying[i] > 0.0 && own[i] != OUTSIDE {
                            let direction = vector_of(&draws.directions, i);
                            *density += staying[i] * warps.linear_density(tree, own[i] as usize, direction);
                        }
                        sum[i] += shares[k] * *density;
                    }
                },
            );
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
        let Some(lookup) = &self.outgoing else { return Ok(()) };
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
        let carry = trees.carry(options.density);
        for i in 0..count {
            (points[0][i], is_defensive[i]) = split(points[0][i], mixed.defensive[i]);
            if is_defensive[i] {
                points[1][i] = points[1][i].min(BELOW_ONE);
                continue;
            }
            let left = mixed.shares[i].choose(points[0][i]);
            let node = mixed.shares[i].nodes[0];
            chosen[i] += node;
            points[0][i] = left;
            if carry.is_some() {
                (points[0][i], may_stay[i]) = split(left, STAYING);
                set_vector(&mut carried.from, i, self.node_direction(node as usize));
            }
        }
        warps.draw_block(&chosen, &points, options.density, draws);
        // A tree without light draws nothing.
        let is_drawn = draws.pdf.map(|pdf| pdf > 0.0);
        if let Some(carry) = carry {
            carried.set(carry, &arrived.wi);
            let stays = carried.drawn(&mut draws.directions, &may_stay);
            mixed.is_drawn = true;
            for i in 0..BLOCK {
                let pdf = if is_drawn[i] && !is_defensive[i] { draws.pdf[i] } else { 0.0 };
                mixed.drawn[0][i] = if stays[i] { 0.0 } else { pdf };
                mixed.drawn[1][i] = if stays[i] { pdf } else { 0.0 };
            }
        }
        for i in (0..count).filter(|&i| is_defensive[i]) {
            let at = (mixed.entry, options.density);
            if let Some(direction) = trees.background().draw(warps, at, [points[0][i], points[1][i]]) {
                set_vector(&mut draws.directions, i, direction.xyz());
                draws.leaves[i] = lookup.locate_or_outside(direction.xyz());
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
        let to = turned(vector_of(directions, i), [cos[i], sin[i]]);
        set_vector(directions, i, to);
    }
}

/// The incoming direction of quantities without one.
const UP: Vectors = [[0.0; BLOCK], [0.0; BLOCK], [1.0; BLOCK]];
