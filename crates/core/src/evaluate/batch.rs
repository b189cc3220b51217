//! Many places at once: directions as arrays of coordinates, values as rows.
//!
//! A block of places is first located, then gathered, then expanded: the gathers of different places do not wait for one
//! another, which hides most of the memory's latency where a material is larger than the caches.

use super::kernel::{BLOCK, Vectors, set_vector, vector_of};
use super::located::OUTSIDE;
use super::material::Form;
use super::planes::Planes;
use super::smooth::{Mixed, Smooth};
use super::staged::Room;
use super::{EvaluateError, Interpolation, Material, Place, unfit};
use crate::domain::vector::{norm, scale};
use crate::domain::{Direction, wide};
use rayon::prelude::*;

/// Places that a thread takes at a time.
const SHARE: usize = 4096;

/// Directions as arrays of their Cartesian coordinates; any length is normalised.
#[derive(Clone, Copy, Debug)]
pub struct Directions<'a> {
    /// Towards the reference direction.
    pub x: &'a [f32],
    /// At a right angle to both.
    pub y: &'a [f32],
    /// Along the normal.
    pub z: &'a [f32],
}

impl<'a> Directions<'a> {
    /// How many.
    #[allow(clippy::len_without_is_empty, reason = "an empty batch is no special case")]
    pub fn len(&self) -> usize {
        self.x.len()
    }

    #[inline]
    pub(super) fn at(&self, i: usize) -> Result<Direction, EvaluateError> {
        let [x, y, z] = [self.x[i], self.y[i], self.z[i]];
        Direction::new(f64::from(x), f64::from(y), f64::from(z)).map_or_else(
            || unfit(format!("direction {i} is ({x}, {y}, {z}), expected finite coordinates that are not all 0")),
            Ok,
        )
    }

    pub(super) fn part(&self, from: usize, to: usize) -> Directions<'a> {
        Directions { x: &self.x[from..to], y: &self.y[from..to], z: &self.z[from..to] }
    }

    /// Writes up to [`BLOCK`] of them as unit vectors, and the last one again in what is left.
    pub(super) fn write_block(&self, to: &mut Vectors) -> Result<(), EvaluateError> {
        for (to, coordinates) in to.iter_mut().zip([self.x, self.y, self.z]) {
            to.iter_mut().zip(coordinates).for_each(|(to, &coordinate)| *to = f64::from(coordinate));
            to[self.len()..].fill(coordinates.last().map_or(1.0, |&last| f64::from(last)));
        }
        let mut is_bad = 0;
        wide(
            #[inline(always)]
            || {
                for i in 0..BLOCK {
                    let d = vector_of(to, i);
                    let length = norm(d);
                    is_bad |=
                        u32::from(length <= 0.0) | u32::from(length.is_nan()) | u32::from(length == f64::INFINITY);
                    set_vector(to, i, scale(d, 1.0 / length));
                }
            },
        );
        if is_bad != 0 {
            // One of them tells what is wrong.
            (0..self.len()).try_for_each(|i| self.at(i).map(|_| ()))?;
        }
        Ok(())
    }

    pub(super) fn check(&self, name: &str, count: usize) -> Result<(), EvaluateError> {
        if [self.x.len(), self.y.len(), self.z.len()] != [count; 3] {
            return unfit(format!(
                "{name} has {}, {} and {} coordinates, expected {count} of each",
                self.x.len(),
                self.y.len(),
                self.z.len()
            ));
        }
        Ok(())
    }
}

/// Places side by side: the first of `wi` with the first of `wo`, and so on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pairs<'a> {
    /// One entry for each leading opaque axis, the same for all.
    pub index: &'a [usize],
    /// Incoming directions, for quantities that have them.
    pub wi: Option<Directions<'a>>,
    /// Outgoing directions, for quantities that have them.
    pub wo: Option<Directions<'a>>,
}

impl<'a> Pairs<'a> {
    #[inline]
    pub(super) fn place(&self, i: usize) -> Result<Place<'a>, EvaluateError> {
        let at = |directions: Option<Directions<'_>>| directions.map(|directions| directions.at(i)).transpose();
        Ok(Place { index: self.index, wi: at(self.wi)?, wo: at(self.wo)? })
    }

    pub(super) fn wi_at(&self, i: usize) -> Result<Option<Direction>, EvaluateError> {
        self.wi.map(|directions| directions.at(i)).transpose()
    }

    pub(super) fn part(&self, from: usize, to: usize) -> Self {
        let part = |directions: Option<Directions<'a>>| directions.map(|directions| directions.part(from, to));
        Self { index: self.index, wi: part(self.wi), wo: part(self.wo) }
    }
}

impl Material {
    /// The spectra at `pairs` into `out`, `[pair][lambda]`, on the calling thread, as [`Material::spectrum`] gives them;
    /// no allocation. The first pair that is refused ends it.
    pub fn spectra(&self, pairs: Pairs<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        let count = self.check_pairs(pairs, out)?;
        let lambdas = self.lambdas();
        let Form::Planes { planes, smooth } = &self.form else {
            let mut rows = out.chunks_exact_mut(lambdas).enumerate();
            return rows.try_for_each(|(i, out)| self.spectrum(pairs.place(i)?, how, out));
        };
        self.rows(planes, smooth, pairs, how, count, |start, rows| {
            planes.expand_all(rows, &mut out[start * lambdas..][..rows.len() * lambdas]);
        })
    }

    /// The rows of planes at `pairs`, block by block, with where each block starts.
    pub(super) fn rows(
        &self,
        planes: &Planes,
        smooth: &Smooth,
        pairs: Pairs<'_>,
        how: Interpolation,
        count: usize,
        mut work: impl FnMut(usize, &[Mixed]),
    ) -> Result<(), EvaluateError> {
        let entry = self.entry(pairs.index)?;
        let [n_in, n_out, _] = self.shape;
        let (mut incoming, mut outgoing) = ([0; BLOCK], [0; BLOCK]);
        let (mut room, mut mixed) = (Room::NEW, [Mixed::NOTHING; BLOCK]);
        for start in (0..count).step_by(BLOCK) {
            let length = BLOCK.min(count - start);
            let part = pairs.part(start, start + length);
            let (incoming, outgoing) = (&mut incoming[..length], &mut outgoing[..length]);
            match how {
                Interpolation::Constant => {
                    self.incoming_entries(part, incoming)?;
                    self.outgoing_entries(part, outgoing)?;
                    for (mixed, (wi, wo)) in mixed.iter_mut().zip(incoming.iter().zip(&*outgoing)) {
                        let cell = (entry * n_in + *wi as usize) * n_out + *wo as usize;
                        *mixed = if *wo == OUTSIDE { Mixed::NOTHING } else { planes.mixed(cell) };
                    }
                }
                Interpolation::Smooth if part.wo.is_some() => {
                    self.arrive(Some(smooth), part.wi, length, &mut room.arrived)?;
                    self.smooth_rows_at(smooth, entry, part.wo, &mut room, &mut mixed[..length])?;
                }
                Interpolation::Smooth => {
                    for (i, mixed) in mixed[..length].iter_mut().enumerate() {
                        let seen = self.seen(smooth, None, part.place(i)?)?;
                        *mixed = seen.map_or(Mixed::NOTHING, |seen| smooth.at(entry, &seen));
                    }
                }
            }
            work(start, &mixed[..length]);
        }
        Ok(())
    }

    /// [`Material::spectra`] on all threads.
    pub fn par_spectra(&self, pairs: Pairs<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        let count = self.check_pairs(pairs, out)?;
        out.par_chunks_mut(SHARE * self.lambdas()).enumerate().try_for_each(|(share, out)| {
            let from = share * SHARE;
            self.spectra(pairs.part(from, (from + SHARE).min(count)), how, out)
        })
    }

    fn check_pairs(&self, pairs: Pairs<'_>, out: &[f32]) -> Result<usize, EvaluateError> {
        pairs.check(out.len(), self.lambdas())
    }
}

impl Pairs<'_> {
    /// How many there are, after a look at their coordinates and at the room for `lambdas` samples each.
    pub(super) fn check(self, room: usize, lambdas: usize) -> Result<usize, EvaluateError> {
        let pairs = self;
        let count = pairs.wo.or(pairs.wi).map_or(1, |directions| directions.len());
        for (name, directions) in [("wi", pairs.wi), ("wo", pairs.wo)] {
            directions.map_or(Ok(()), |directions| directions.check(name, count))?;
        }
        if count.checked_mul(lambdas) != Some(room) {
            return unfit(format!("room for {room} samples, expected {count} spectra of {lambdas}"));
        }
        Ok(count)
    }
}
