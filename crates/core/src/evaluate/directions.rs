//! Batches of directions, as arrays of coordinates or as unit vectors, and pairs of them.

use super::error::{Argument, Buffer, EvaluateError, QueryError, unfit};
use super::kernel::{BLOCK, Vectors, set_vector, vector_of};
use super::place::Place;
use crate::domain::Direction;
use crate::domain::vector::{norm, scale};
use crate::numeric::wide;

/// Batch of directions: arrays of Cartesian coordinates, or unit vectors.
#[derive(Clone, Copy, Debug)]
pub struct Directions<'a> {
    source: Source<'a>,
    /// Number of directions of the whole batch that come before this part of it; error messages count from the batch's
    /// start.
    first: usize,
}

#[derive(Clone, Copy, Debug)]
enum Source<'a> {
    Coordinates([&'a [f32]; 3]),
    Units(&'a [Direction]),
}

impl<'a> Directions<'a> {
    /// Batch of directions from Cartesian coordinates: `x` towards the reference direction (azimuth 0), `z` along the
    /// normal, `y` perpendicular to both. Vectors are normalised.
    pub fn new(x: &'a [f32], y: &'a [f32], z: &'a [f32]) -> Self {
        Self { source: Source::Coordinates([x, y, z]), first: 0 }
    }

    /// Batch of directions given as unit vectors, which keep full f64 precision.
    pub fn of(directions: &'a [Direction]) -> Self {
        Self { source: Source::Units(directions), first: 0 }
    }

    /// Number of directions in the batch.
    #[allow(clippy::len_without_is_empty, reason = "an empty batch is no special case")]
    pub fn len(&self) -> usize {
        match self.source {
            Source::Coordinates([x, ..]) => x.len(),
            Source::Units(directions) => directions.len(),
        }
    }

    /// Arrays of x, y and z coordinates; `None` if the directions are given as unit vectors.
    #[inline]
    pub(super) fn coordinates(&self) -> Option<[&'a [f32]; 3]> {
        if let Source::Coordinates(arrays) = self.source { Some(arrays) } else { None }
    }

    #[inline]
    pub(super) fn at(&self, i: usize) -> Result<Direction, EvaluateError> {
        let [x, y, z] = match self.source {
            Source::Coordinates(arrays) => arrays.map(|coordinates| coordinates[i]),
            Source::Units(directions) => return Ok(directions[i]),
        };
        Direction::new(f64::from(x), f64::from(y), f64::from(z))
            .map_or_else(|| unfit(QueryError::Direction { index: self.first + i, found: [x, y, z] }), Ok)
    }

    pub(super) fn part(&self, from: usize, to: usize) -> Directions<'a> {
        let source = match self.source {
            Source::Coordinates(arrays) => Source::Coordinates(arrays.map(|coordinates| &coordinates[from..to])),
            Source::Units(directions) => Source::Units(&directions[from..to]),
        };
        Self { source, first: self.first + from }
    }

    /// Writes up to [`BLOCK`] directions of the batch as unit vectors to `to`. If there are fewer, the last direction
    /// fills the rest of `to`.
    pub(super) fn write_block(&self, to: &mut Vectors) -> Result<(), EvaluateError> {
        let arrays = match self.source {
            Source::Coordinates(arrays) => arrays,
            Source::Units(directions) => {
                let last = directions.last().map_or([0.0, 0.0, 1.0], |last| last.xyz());
                for i in 0..BLOCK {
                    set_vector(to, i, directions.get(i).map_or(last, |direction| direction.xyz()));
                }
                return Ok(());
            }
        };
        for (to, coordinates) in to.iter_mut().zip(arrays) {
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
            // Finds the bad direction, for the error.
            (0..self.len()).try_for_each(|i| self.at(i).map(|_| ()))?;
        }
        Ok(())
    }

    pub(super) fn check(&self, argument: Argument, count: usize) -> Result<(), EvaluateError> {
        match self.source {
            Source::Coordinates(arrays) => {
                let found = arrays.map(<[f32]>::len);
                if found == [count; 3] {
                    return Ok(());
                }
                unfit(QueryError::Coordinates { argument, found, expected: count })
            }
            Source::Units(directions) if directions.len() != count => {
                unfit(QueryError::Count { argument, found: directions.len(), expected: count })
            }
            Source::Units(_) => Ok(()),
        }
    }
}

/// Batch of direction pairs: the first of `wi` with the first of `wo`, and so on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pairs<'a> {
    /// Position on each index axis (axis of the samples before those of directions and wavelength), the same for all
    /// pairs of directions.
    pub index: &'a [usize],
    /// Incoming directions; `None` for quantities without an incoming direction.
    pub wi: Option<Directions<'a>>,
    /// Outgoing directions; `None` for quantities without an outgoing direction.
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

    /// Returns the number of direction pairs. Fails if `wi` and `wo` differ in number or if `room`, the length of the
    /// output, is not `lambdas` samples per pair.
    pub(super) fn check(self, room: usize, lambdas: usize) -> Result<usize, EvaluateError> {
        let count = self.wo.or(self.wi).map_or(1, |directions| directions.len());
        for (argument, directions) in [(Argument::Wi, self.wi), (Argument::Wo, self.wo)] {
            directions.map_or(Ok(()), |directions| directions.check(argument, count))?;
        }
        if count.checked_mul(lambdas) != Some(room) {
            let expected = count.saturating_mul(lambdas);
            return unfit(QueryError::Length { buffer: Buffer::Spectra { count, lambdas }, found: room, expected });
        }
        Ok(count)
    }
}
