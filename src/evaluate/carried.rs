//! Directions carried from the incoming direction of a cell to the one asked for, with their density: one, or a block.

use super::incoming::{Alignment, Carrier};
use super::kernel::{BLOCK, Block, Vectors, set_vector, vector_of};
use crate::domain::vector::{Vector, unit};
use crate::domain::{Direction, wide};

/// Where a cell's directions are seen under another incoming direction, and back.
pub(super) struct Carried {
    out: Carrier,
    back: Carrier,
    /// The sign of z on the outgoing hemisphere; 0 on the sphere.
    side: f64,
}

impl Carried {
    /// Of a cell of incoming direction `from`, to the incoming direction `to`.
    #[inline(always)]
    pub(super) fn new(alignment: Alignment, side: f64, from: Vector, to: Vector) -> Self {
        Self { out: Carrier::new(alignment, from, to), back: Carrier::new(alignment, to, from), side }
    }

    /// The direction of the cell's `wo` under the incoming direction asked for, and the part of its density that comes from
    /// there, for a density `pdf` at `wo`: what goes below the horizon comes up again, and what has no way stays.
    #[inline(always)]
    pub(super) fn out(&self, wo: Vector, pdf: f64) -> (Vector, f64, Way) {
        match self.out.carry(wo) {
            None => (wo, pdf, Way::Stayed),
            Some((moved, solid_angle)) if self.side * moved[2] < 0.0 => {
                ([moved[0], moved[1], -moved[2]], pdf / solid_angle, Way::Crossed)
            }
            Some((moved, solid_angle)) => (moved, pdf / solid_angle, Way::Straight),
        }
    }

    /// The cell's direction that is carried to `wo` that way, and its solid angle in parts of that at `wo`.
    #[inline(always)]
    pub(super) fn origin(&self, way: Way, wo: Vector) -> Option<(Vector, f64)> {
        let [x, y, z] = wo;
        let back = |wo: Vector| if self.back.carries_to(self.side, wo) { self.back.carry(wo) } else { None };
        match way {
            Way::Straight => back(wo),
            Way::Crossed if self.side == 0.0 => None,
            Way::Crossed => back([x, y, -z]),
            Way::Stayed => (!self.out.carries(wo)).then_some((wo, 1.0)),
        }
    }

    /// Whether directions come to `wo` over the horizon, or stay there.
    #[inline(always)]
    fn is_crossed_or_kept(&self, wo: Vector) -> bool {
        let [x, y, z] = wo;
        ((self.side != 0.0) & self.back.carries_to(self.side, [x, y, -z])) | !self.out.carries(wo)
    }

    /// The density at `wo` of directions of the cell's density `pdf` that came by any way but `known`.
    #[inline]
    pub(super) fn density(&self, wo: Vector, known: Option<Way>, pdf: impl Fn(Direction) -> f64) -> f64 {
        let mut sum = 0.0;
        for way in Way::ALL {
            if known != Some(way)
                && let Some((there, part)) = self.origin(way, wo)
            {
                sum += pdf(Direction::from_unit(unit(there))) * part;
            }
        }
        sum
    }
}

/// How a direction was carried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    Straight,
    /// Over the horizon and up again.
    Crossed,
    Stayed,
}

impl Way {
    pub(super) const ALL: [Self; 3] = [Self::Straight, Self::Crossed, Self::Stayed];
}

/// The incoming directions of a block: of the cells, and those asked for.
pub(super) struct CarriedBlock {
    pub(super) alignment: Alignment,
    pub(super) side: f64,
    pub(super) from: Vectors,
    pub(super) to: Vectors,
    /// Not 0 where directions may come by more than one way: written with what is carried.
    pub(super) has_more: [u32; BLOCK],
    /// What is carried, as it was.
    own: (Vectors, Block),
}

impl CarriedBlock {
    pub(super) const NOWHERE: Self = Self {
        alignment: Alignment::None,
        side: 0.0,
        from: [[0.0; BLOCK]; 3],
        to: [[0.0; BLOCK]; 3],
        has_more: [0; BLOCK],
        own: ([[0.0; BLOCK]; 3], [0.0; BLOCK]),
    };

    /// The way of one place.
    fn of(&self, i: usize) -> Carried {
        Carried::new(self.alignment, self.side, vector_of(&self.from, i), vector_of(&self.to, i))
    }

    /// [`Carried::out`] of `count` directions with their densities, brought to unit length. `pdf(i, there)` is the density of
    /// place `i` in its cell, for those to which directions come by more than one way.
    pub(super) fn out(
        &mut self,
        directions: &mut Vectors,
        densities: &mut Block,
        count: usize,
        pdf: impl Fn(usize, Direction) -> f64,
    ) {
        self.own = (*directions, *densities);
        let Self { side, from, to, has_more, own, .. } = self;
        wide(
            #[inline(always)]
            || {
                known(
                    self.alignment,
                    #[inline(always)]
                    |alignment| {
                        for i in 0..BLOCK {
                            let carried = Carried::new(alignment, *side, vector_of(from, i), vector_of(to, i));
                            let (moved, density, way) = carried.out(vector_of(&own.0, i), own.1[i]);
                            set_vector(directions, i, unit(moved));
                            densities[i] = density;
                            has_more[i] = u32::from((way != Way::Straight) | carried.is_crossed_or_kept(moved));
                        }
                    },
                );
            },
        );
        for i in (0..count).filter(|&i| self.has_more[i] != 0) {
            let carried = self.of(i);
            let (moved, density, way) = carried.out(vector_of(&self.own.0, i), self.own.1[i]);
            densities[i] = density + carried.density(moved, Some(way), |there| pdf(i, there));
        }
    }

    /// The density at `wo`, in place `i`, of directions that come by any way but straight.
    pub(super) fn other_densities(&self, i: usize, wo: Vector, pdf: impl Fn(Direction) -> f64) -> f64 {
        self.of(i).density(wo, Some(Way::Straight), pdf)
    }

    /// Writes the cells' directions that are carried to `wo` straight and their part, 0 where none is.
    pub(super) fn write_straight_origins(&mut self, wo: &Vectors, there: &mut Vectors, parts: &mut Block) {
        let Self { side, from, to, has_more, .. } = self;
        wide(
            #[inline(always)]
            || {
                known(
                    self.alignment,
                    #[inline(always)]
                    |alignment| {
                        for i in 0..BLOCK {
                            let carried = Carried::new(alignment, *side, vector_of(from, i), vector_of(to, i));
                            let wo = vector_of(wo, i);
                            let (origin, part) = carried.origin(Way::Straight, wo).unwrap_or((wo, 0.0));
                            set_vector(there, i, unit(origin));
                            parts[i] = part;
                            has_more[i] = u32::from(carried.is_crossed_or_kept(wo));
                        }
                    },
                );
            },
        );
    }
}

/// `work` with an alignment that its code knows.
#[inline(always)]
pub(super) fn known(alignment: Alignment, work: impl FnOnce(Alignment)) {
    match alignment {
        Alignment::None => work(Alignment::None),
        Alignment::HalfVector => work(Alignment::HalfVector),
        Alignment::TurnedHalfVector => work(Alignment::TurnedHalfVector),
        Alignment::Rotation => work(Alignment::Rotation),
    }
}
