//! Many directions as arrays of coordinates, and pairs of them.

use super::error::{EvaluateError, unfit};
use super::kernel::{BLOCK, Vectors, set_vector, vector_of};
use super::place::Place;
use crate::domain::vector::{norm, scale};
use crate::domain::{Direction, wide};

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

    /// How many there are, after a look at their coordinates and at the room for `lambdas` samples each.
    pub(super) fn check(self, room: usize, lambdas: usize) -> Result<usize, EvaluateError> {
        let count = self.wo.or(self.wi).map_or(1, |directions| directions.len());
        for (name, directions) in [("wi", self.wi), ("wo", self.wo)] {
            directions.map_or(Ok(()), |directions| directions.check(name, count))?;
        }
        if count.checked_mul(lambdas) != Some(room) {
            return unfit(format!("room for {room} samples, expected {count} spectra of {lambdas}"));
        }
        Ok(count)
    }
}
