//! Evaluates many directions at once: first the angles of all, then the places around each.

use super::part::Sums;
use super::{AROUND, Kind, Lines, Nodes, elevation, nodes_between};
use crate::domain::Domain;
use crate::evaluate::carried::known;
use crate::evaluate::incoming::{Alignment, Origin, carried_to};
use crate::evaluate::kernel::{BLOCK, Block, Vectors, set_vector, vector_of};
use crate::numeric::number::Number;
use crate::numeric::wide;
use ::wide::f32x4;

impl Lines {
    /// Interpolates the spectra for a block of direction pairs (batch evaluated together) and writes them into `out`.
    /// Returns false, and writes nothing, if an incoming direction is outside the measured ones, if there is no
    /// outgoing axis, if a spectrum has more than four samples, or if interpolation uses a divisor (model divided out
    /// before interpolation) or a cubic.
    pub(in crate::evaluate) fn spectra(&self, entry: usize, wi: &Vectors, wo: &Vectors, out: &mut [f32]) -> bool {
        match self.values.lambdas() {
            // Divisors and cubics between incidences are evaluated one by one.
            _ if self.course.is_some() => false,
            1 => self.spectra_in::<f32>(entry, wi, wo, out),
            2..=4 => self.spectra_in::<f32x4>(entry, wi, wo, out),
            _ => false,
        }
    }

    fn spectra_in<T: Number>(&self, entry: usize, wi: &Vectors, wo: &Vectors, out: &mut [f32]) -> bool {
        let lambdas = self.values.lambdas();
        let count = out.len() / lambdas;
        let mut nodes = [Nodes::ONE; BLOCK];
        let Some(sphere) = self.outgoing.as_deref().filter(|_| self.nodes_of_block(wi, &mut nodes[..count])) else {
            return false;
        };
        let base = entry * self.values.incoming();
        let slots = match &self.incoming.0 {
            Kind::None => 1,
            Kind::Elevations(..) => 2,
            Kind::Grid(_) => AROUND,
        };
        let mut sums = [Sums::<T>::nothing(); BLOCK];
        let mut angles = [[0.0; BLOCK]; 2];
        if self.alignment == Alignment::None {
            sphere.angles(wo, &mut angles);
        }
        for slot in 0..slots {
            let mut worths = [1.0; BLOCK];
            if self.alignment != Alignment::None {
                let mut there = *wo;
                self.carried_block(slot, &nodes, wi, &mut there, &mut worths);
                sphere.angles(&there, &mut angles);
            }
            for (i, sums) in sums.iter_mut().enumerate().take(count) {
                let (place, weight) = (nodes[i].places[slot], nodes[i].weights[slot]);
                if weight > 0.0 {
                    let patch = sphere.patch_at([angles[0][i], angles[1][i]]);
                    let at = (base + place as usize, weight as f32 * worths[i]);
                    self.add(sums, self.straight, at, patch.as_ref(), 0);
                }
            }
        }
        for (sums, out) in sums.iter().zip(out.chunks_exact_mut(lambdas)) {
            self.settled(sums, self.straight).write_some(out);
        }
        true
    }

    /// Finds the measured incoming directions around each direction of a block; returns false if a direction is outside
    /// the measured ones.
    fn nodes_of_block(&self, wi: &Vectors, to: &mut [Nodes]) -> bool {
        if let Kind::Elevations(_, line) = &self.incoming.0 {
            let mut elevations: Block = [0.0; BLOCK];
            wide(
                #[inline(always)]
                || {
                    for (i, to) in elevations.iter_mut().enumerate() {
                        *to = elevation(vector_of(wi, i));
                    }
                },
            );
            to.iter_mut().zip(elevations).for_each(|(to, elevation)| *to = nodes_between(line, elevation));
            return true;
        }
        to.iter_mut().enumerate().all(|(i, to)| self.nodes(vector_of(wi, i)).map(|nodes| *to = nodes).is_some())
    }

    /// Moves a block of outgoing directions, in place, so that a lobe under each query's incoming direction falls onto
    /// the lobe under one of the measured incoming directions around it ([`Lines::carried`]). Queries whose incoming
    /// direction was measured itself are left in place.
    fn carried_block(
        &self,
        slot: usize,
        nodes: &[Nodes; BLOCK],
        wi: &Vectors,
        there: &mut Vectors,
        worths: &mut [f32; BLOCK],
    ) {
        if self.domain == Domain::Sphere {
            // The alignment depends on the side of the horizon.
            for (i, nodes) in nodes.iter().enumerate().filter(|(_, nodes)| nodes.weights[slot] < 1.0) {
                let (moved, worth) =
                    self.carried(&Origin::new(vector_of(wi, i)), nodes.places[slot], vector_of(there, i));
                set_vector(there, i, moved);
                worths[i] = worth;
            }
            return;
        }
        let mut origins = [[0.0_f32; BLOCK]; 5];
        for (i, nodes) in nodes.iter().enumerate() {
            let Origin { direction: [x, y, z], azimuth: [cos, sin] } = self.origins[nodes.places[slot] as usize];
            for (to, part) in origins.iter_mut().zip([x, y, z, cos, sin]) {
                to[i] = part;
            }
        }
        let stays: [bool; BLOCK] = std::array::from_fn(|i| nodes[i].weights[slot] == 1.0);
        let wo = *there;
        wide(
            #[inline(always)]
            || {
                known(
                    self.alignment,
                    #[inline(always)]
                    |alignment| {
                        for i in 0..BLOCK {
                            let [x, y, z, cos, sin] = [0, 1, 2, 3, 4].map(|k| origins[k][i]);
                            let to = Origin { direction: [x, y, z], azimuth: [cos, sin] };
                            let d = vector_of(&wo, i);
                            let from = Origin::new(vector_of(wi, i));
                            let (moved, worth) = carried_to(alignment, false, from, to, d.map(|x| x as f32));
                            let moved = [0, 1, 2].map(|k| if stays[i] { d[k] } else { f64::from(moved[k]) });
                            set_vector(there, i, moved);
                            worths[i] = if stays[i] { 1.0 } else { worth };
                        }
                    },
                );
            },
        );
    }
}
