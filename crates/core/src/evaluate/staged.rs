//! Densities and draws of many places: block by block, and each block stage by stage.
//!
//! A block is located, drawn from the trees around its incoming directions, aligned to the queried ones, and looked up.
//! Later stages reuse what earlier ones found: the nodes around an incoming direction, the leaf of a draw.

use super::blocks::Places;
use super::carried::{CarriedBlock, Carry, Origins, STAYING};
use super::directions::{Directions, Pairs};
use super::error::{Argument, Buffer, EvaluateError};
use super::form::Form;
use super::incoming::Alignment;
use super::kernel::{BLOCK, Block, set_vector, vector_of};
use super::located::OUTSIDE;
use super::mixed::Mixed;
use super::mixture::{self, FEW, Shares, sampled_entry, split};
use super::place::Place;
use super::sampler::{DirectionSample, Sampler, check_point, form_of};
use super::trees::Trees;
use super::warp::{BELOW_ONE, Density, Draws, SampleOptions};
use crate::domain::{Direction, Domain};
use crate::numeric::wide;

/// Working memory for drawing a block of directions, reused from block to block.
struct Room {
    places: Places,
    draws: Draws,
    mixed: MixedBlock,
    carried: CarriedBlock,
}

impl Room {
    const NEW: Self = Self {
        places: Places::NEW,
        draws: Draws::NOTHING,
        mixed: MixedBlock {
            shares: [Shares::NONE; BLOCK],
            defensive: [0.0; BLOCK],
            is_drawn: false,
            drawn: [[0.0; BLOCK]; 2],
            entry: 0,
        },
        carried: CarriedBlock::NOWHERE,
    };

    /// Writes the probability densities with which sampling trees draw a block of directions, if these are used as
    /// drawn and not moved along with lobes. `draws` gives the leaf triangle of each direction.
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

    /// Mixes the densities of the sampling trees with the density of the defensive component.
    fn defend(&mut self, trees: &Trees, density: Density, count: usize) {
        let Self { draws, mixed, .. } = self;
        for i in (0..count).filter(|&i| mixed.defensive[i] > 0.0) {
            let direction = Direction::from_unit(vector_of(&draws.directions, i));
            let background = trees.background().pdf(trees.warps(), (mixed.entry, density), direction);
            draws.pdf[i] = mixture::mixed(mixed.defensive[i], draws.pdf[i], background);
        }
    }
}

/// Sampling mixtures of a block of queries: the probabilities of drawing from the trees, and the fractions of the
/// defensive component.
struct MixedBlock {
    entry: usize,
    shares: [Shares; BLOCK],
    defensive: Block,
    /// True while directions are drawn, false while densities of given directions are computed.
    is_drawn: bool,
    /// Probability density in sr⁻¹ with which a sampling tree drew direction `i` of the block: in `[0][i]` if the
    /// direction then moved with its lobe to the queried incoming direction, in `[1][i]` if it stayed in place. All
    /// other entries are 0.
    drawn: [Block; 2],
}

impl Sampler<'_> {
    /// Returns true if directions can be drawn many at a time, in blocks of [`BLOCK`]. That requires sampling down to
    /// the finest triangles, no added analytic lobe, spectral coefficients, and one rule above and below the horizon by
    /// which lobes move with the incoming direction.
    pub(super) fn is_staged(&self, options: SampleOptions) -> bool {
        let is_alike = |(alignment, domain)| domain != Domain::Sphere || alignment == Alignment::Rotation;
        options.level.is_none()
            && !self.has_lobe()
            && matches!(self.function().form(), Form::Planes { .. })
            && self.trees().carry(options.density).is_none_or(is_alike)
    }

    /// Looks up the incoming directions of a block of queries and sets up their sampling mixtures.
    fn arrive_for(
        &self,
        entry: usize,
        wi: Option<Directions<'_>>,
        options: SampleOptions,
        count: usize,
        room: &mut Room,
    ) -> Result<(), EvaluateError> {
        let (function, trees) = (self.function(), self.trees());
        let smooth = function.form().smooth().filter(|_| options.density == Density::Linear);
        let Room { places, mixed, .. } = room;
        let arrived = places.arrived_mut();
        arrived.write(function.geometry(), smooth, wi, count)?;
        mixed.entry = entry;
        for i in 0..count {
            let shares = if smooth.is_some() {
                Shares::around(trees, entry, &arrived.around()[i])
            } else {
                Shares::one(trees, entry, arrived.entry(i))
            };
            mixed.defensive[i] = trees.defensive(entry, options, shares.has_light());
            mixed.shares[i] = shares;
        }
        Ok(())
    }

    /// Writes the sampling densities in sr⁻¹ of up to [`BLOCK`] directions; 0 outside the outgoing domain.
    fn densities_at(
        &self,
        wo: Directions<'_>,
        options: SampleOptions,
        room: &mut Room,
        out: &mut [f64],
    ) -> Result<(), EvaluateError> {
        let geometry = self.function().geometry();
        let Some(lookup) = geometry.mesh() else { return Ok(()) };
        wo.write_block(&mut room.draws.directions)?;
        if geometry.is_isotropic() {
            room.places.arrived().turn_back(&mut room.draws.directions);
        }
        room.mixed.is_drawn = false;
        lookup.locate_block(&room.draws.directions, &mut room.draws.leaves);
        self.write_densities(options, out.len(), room);
        for (i, out) in out.iter_mut().enumerate() {
            let is_held = lookup.holds(vector_of(&room.draws.directions, i));
            *out = if is_held { room.draws.pdf[i] } else { 0.0 };
        }
        Ok(())
    }

    /// Writes the sampling densities in sr⁻¹ for the direction pairs `pairs` into `out`, on the calling thread. Does
    /// not allocate. Stops at the first invalid pair.
    pub(super) fn pdfs(&self, pairs: Pairs<'_>, options: SampleOptions, out: &mut [f64]) -> Result<(), EvaluateError> {
        let count = pairs.check(out.len(), 1)?;
        let (function, trees) = (self.function(), self.trees());
        let entry = sampled_entry(function, pairs.index, options)?;
        let (Some(wo), true) = (pairs.wo, self.is_staged(options)) else {
            return out.iter_mut().enumerate().try_for_each(|(i, out)| {
                let Place { index, wi, wo } = pairs.place(i)?;
                let Some(wo) = wo else { return function.geometry().outgoing(wi, wo).map(|_| ()) };
                *out = self.pdf(index, wi, wo, options)?;
                Ok(())
            });
        };
        let mut room = Room::NEW;
        for (start, out) in (0..count).step_by(BLOCK).zip(out.chunks_mut(BLOCK)) {
            let part = pairs.part(start, start + out.len());
            self.arrive_for(entry, part.wi, options, out.len(), &mut room)?;
            self.densities_at(wo.part(start, start + out.len()), options, &mut room, out)?;
            if trees.has_masked() {
                for (i, out) in out.iter_mut().enumerate().filter(|(_, pdf)| **pdf > 0.0) {
                    if !function.is_known(part.place(i)?, form_of(options))? {
                        *out = 0.0;
                    }
                }
            }
        }
        Ok(())
    }

    /// Writes the densities of the sampling mixtures at the directions of `draws` into their `pdf`. Expects in `draws`
    /// the leaf triangles that contain the directions, or those in which the directions were drawn.
    fn write_densities(&self, options: SampleOptions, count: usize, room: &mut Room) {
        let trees = self.trees();
        if let Some(carry) = trees.carry(options.density) {
            self.write_carried_densities(carry, count, room);
        } else {
            room.write_densities_in_leaves(trees, options.density, count);
        }
        room.defend(trees, options.density, count);
    }

    /// Writes the probability densities in sr⁻¹ of a block of directions, for sampling in which a direction drawn from
    /// a sampling tree then moves, together with the lobe around it, to the queried incoming direction.
    fn write_carried_densities(&self, carry: Carry, count: usize, room: &mut Room) {
        let (function, trees) = (self.function(), self.trees());
        let Room { places, draws, mixed, carried } = room;
        let (Some(lookup), warps) = (function.geometry().mesh(), trees.warps()) else { return };
        let first = trees.tree(mixed.entry, 0);
        let sum = &mut draws.pdf;
        sum.fill(0.0);
        carried.set(carry, places.arrived().wi());
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
                set_vector(&mut carried.from, i, function.node_direction(node));
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

    /// Runs [`Sampler::sample`] for each point `u` of the unit square, with the incoming direction of the same number
    /// in `pairs`, and writes the results into `out`.
    pub(super) fn samples(
        &self,
        pairs: Pairs<'_>,
        u: &[[f64; 2]],
        options: SampleOptions,
        out: &mut [Option<DirectionSample>],
    ) -> Result<(), EvaluateError> {
        Buffer::Samples.check(out.len(), u.len())?;
        pairs.wi.map_or(Ok(()), |wi| wi.check(Argument::Wi, u.len()))?;
        let (Form::Planes { planes, .. }, true) = (self.function().form(), self.is_staged(options)) else {
            return out.iter_mut().zip(u).enumerate().try_for_each(|(i, (out, &u))| {
                *out = self.sample(pairs.index, pairs.wi_at(i)?, u, options)?;
                Ok(())
            });
        };
        let (quantity, weights) = (self.function().geometry().quantity(), self.trees().weights());
        let mut values = [0.0; BLOCK];
        let point = |i: usize| u[i];
        self.draw_all(pairs, u.len(), point, options, |start, draws, rows| {
            planes.weighted_all(rows, weights, &mut values);
            for (i, out) in out[start..].iter_mut().take(rows.len()).enumerate() {
                let direction = Direction::from_unit(vector_of(&draws.directions, i));
                let sample = || DirectionSample::weighted(quantity, direction, draws.pdf[i], values[i]);
                *out = (draws.pdf[i] > 0.0).then(sample);
            }
        })
    }

    /// Draws an outgoing direction for each of `count` points of the unit square, block by block; `pairs` has the
    /// incoming directions. For each block, `work` receives the number of its first point, the directions (density 0
    /// where the function is masked) and the spectral coefficients there.
    ///
    /// Requires that [`Sampler::is_staged`] holds.
    pub(super) fn draw_all(
        &self,
        pairs: Pairs<'_>,
        count: usize,
        point: impl Fn(usize) -> [f64; 2],
        options: SampleOptions,
        mut work: impl FnMut(usize, &Draws, &[Mixed]),
    ) -> Result<(), EvaluateError> {
        let (function, trees) = (self.function(), self.trees());
        let entry = sampled_entry(function, pairs.index, options)?;
        let Form::Planes { planes, smooth } = function.form() else { return Ok(()) };
        let (mut room, mut rows, mut points) = (Room::NEW, [Mixed::NOTHING; BLOCK], [[0.0; 2]; BLOCK]);
        for start in (0..count).step_by(BLOCK) {
            let end = count.min(start + BLOCK);
            let (rows, points) = (&mut rows[..end - start], &mut points[..end - start]);
            points.iter_mut().zip(start..end).for_each(|(to, i)| *to = point(i));
            self.arrive_for(entry, pairs.wi.map(|wi| wi.part(start, end)), options, rows.len(), &mut room)?;
            self.draw_block(points, options, &mut room)?;
            let Room { places, draws, .. } = &mut room;
            match options.density {
                Density::Uniform => function.rows_of_leaves(planes, entry, places, draws, rows),
                Density::Linear => function.rows_at_draws(smooth, entry, places, draws, rows),
            }
            if trees.has_masked() {
                let masked = rows.iter().zip(&mut draws.pdf).filter(|(row, _)| row.presence.is_nan());
                masked.for_each(|(_, pdf)| *pdf = 0.0);
            }
            work(start, draws, rows);
        }
        Ok(())
    }

    /// Draws one random outgoing direction for each of up to [`BLOCK`] points, given in the unit square.
    fn draw_block(&self, u: &[[f64; 2]], options: SampleOptions, room: &mut Room) -> Result<(), EvaluateError> {
        let (function, trees) = (self.function(), self.trees());
        let Some(lookup) = function.geometry().mesh() else { return Ok(()) };
        let Room { places, draws, mixed, carried } = room;
        let count = u.len();
        u.iter().try_for_each(|&u| check_point(u))?;
        let mut points = [[0.0; BLOCK]; 2];
        for (i, &u) in u.iter().enumerate() {
            [points[0][i], points[1][i]] = u;
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
                set_vector(&mut carried.from, i, function.node_direction(node as usize));
            }
        }
        warps.draw_block(&chosen, &points, options.density, draws);
        // A tree without light has no draws.
        let is_drawn = draws.pdf.map(|pdf| pdf > 0.0);
        if let Some(carry) = carry {
            carried.set(carry, places.arrived().wi());
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
        self.write_densities(options, count, room);
        let Room { places, draws, .. } = room;
        for i in 0..count {
            if !is_drawn[i] && !is_defensive[i] {
                draws.pdf[i] = 0.0;
            }
        }
        if function.geometry().is_isotropic() {
            places.arrived().turn(&mut draws.directions);
        }
        Ok(())
    }
}
