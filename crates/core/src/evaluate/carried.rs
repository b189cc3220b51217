//! Directions carried from the incoming direction of a node to the one asked for, with their density: one, or a block.

use super::incoming::{Alignment, NEARLY_BACK, NO_HALF_VECTOR, azimuth};
use super::kernel::{BLOCK, Block, Vectors, set_vector, vector_of};
use crate::domain::vector::{Vector, add, cross, dot, scale, sub, turned, unit};
use crate::domain::{Direction, Domain};
use crate::numeric::wide;

/// The alignment by which directions are carried from a node to the incoming direction asked for, and the outgoing domain.
pub(super) type Carry = (Alignment, Domain);

/// The way of directions from a node, whose incoming direction is `from`, to the incoming direction `to`, and back.
pub(super) struct Carried {
    alignment: Alignment,
    /// The sign of z on the outgoing hemisphere; 0 on the sphere.
    side: f64,
    from: Vector,
    to: Vector,
    /// Cosine and sine of the turn about the normal from the azimuth of `to` to that of `from`, where lobes turn with it.
    turn: [f64; 2],
    /// `to` after that turn.
    turned: Vector,
}

/// Where a direction is carried, the solid angle there in parts of that here, and whether it is on the side of the horizon
/// that counts.
struct Way {
    there: Vector,
    solid_angle: f64,
    is_open: bool,
}

#[allow(clippy::needless_bitwise_bool, reason = "loops over places without branches become vector code")]
impl Carried {
    #[inline(always)]
    fn new(alignment: Alignment, side: f64, from: Vector, to: Vector) -> Self {
        let turn = if alignment == Alignment::TurnedHalfVector { turn_between(to, from) } else { [1.0, 0.0] };
        Self { alignment, side, from, to, turn, turned: turned(to, turn) }
    }

    /// Makes the way of those directions that are on the same side of the horizon as the height `z`.
    #[inline(always)]
    pub(super) fn over(alignment: Alignment, domain: Domain, z: f64, from: Vector, to: Vector) -> Self {
        let (alignment, side) = side_by(alignment, domain, z);
        Self::new(alignment, side, from, to)
    }

    /// Where the node has what is seen along `wo`.
    #[inline(always)]
    fn back(&self, wo: Vector) -> Way {
        match self.alignment {
            Alignment::None => self.way(wo, 1.0, true),
            Alignment::Rotation => self.way(rotated(self.to, self.from, wo), 1.0, true),
            // Around one half vector a solid angle is 4 |w · h| of its own (Walter et al. 2007, section 4.2); w · h is half of
            // the square of w + wo.
            Alignment::HalfVector | Alignment::TurnedHalfVector => {
                let (scale, h, is_there) = along(self.turned, turned(wo, self.turn), self.from);
                self.way(sub(h, self.from), scale, is_there)
            }
        }
    }

    /// Where what the node has along `wo` is seen.
    #[inline(always)]
    fn out(&self, wo: Vector) -> Way {
        match self.alignment {
            Alignment::None => self.way(wo, 1.0, true),
            Alignment::Rotation => self.way(rotated(self.from, self.to, wo), 1.0, true),
            Alignment::HalfVector | Alignment::TurnedHalfVector => {
                let (scale, h, is_there) = along(self.from, wo, self.turned);
                let [cos, sin] = self.turn;
                self.way(sub(turned(h, [cos, -sin]), self.to), scale, is_there)
            }
        }
    }

    #[inline(always)]
    fn way(&self, there: Vector, solid_angle: f64, is_there: bool) -> Way {
        Way { there, solid_angle, is_open: is_there & (self.side * there[2] >= 0.0) }
    }

    /// Carries a direction that the node drew; returns where it is then, and true if it stays where it was drawn. It stays if it
    /// would go below the horizon or nowhere; and, if it `may_stay`, if no direction is carried to where it was drawn.
    #[inline(always)]
    pub(super) fn drawn(&self, wo: Vector, may_stay: bool) -> (Vector, bool) {
        let way = self.out(wo);
        let stays = !way.is_open | (may_stay & !self.back(wo).is_open);
        (if stays { wo } else { unit(way.there) }, stays)
    }

    /// The node's direction that is carried to `wo`, the part of its density that comes from there, 0 where none does, and the
    /// part of that at `wo` itself that stays.
    #[inline(always)]
    pub(super) fn origin(&self, wo: Vector) -> (Vector, f64, f64) {
        let back = self.back(wo);
        let there = [0, 1, 2].map(|k| if back.is_open { back.there[k] } else { wo[k] });
        // That it is carried to `wo`, which is open, is certain; it may also have been kept.
        let carried = if self.back(there).is_open { 1.0 } else { 1.0 - STAYING };
        let part = if back.is_open { back.solid_angle * carried } else { 0.0 };
        let kept = if back.is_open { 0.0 } else { STAYING };
        (there, part, if self.out(wo).is_open { kept } else { 1.0 })
    }

    /// The density at `wo` of directions of the node's density `pdf`.
    #[inline(always)]
    pub(super) fn density(&self, wo: Vector, pdf: impl Fn(Direction) -> f64) -> f64 {
        let (there, part, staying) = self.origin(wo);
        let carried = if part > 0.0 { part * pdf(Direction::from_unit(there)) } else { 0.0 };
        if staying > 0.0 { carried + staying * pdf(Direction::from_unit(wo)) } else { carried }
    }
}

/// The alignment of directions on the same side of the horizon as the height `z`, and the sign of heights there, 0 where there is
/// no horizon. Over a whole sphere, light that goes through the surface turns, whatever reflected light does.
#[inline(always)]
fn side_by(alignment: Alignment, domain: Domain, z: f64) -> (Alignment, f64) {
    match domain {
        Domain::Lower => (alignment, -1.0),
        Domain::Sphere if alignment == Alignment::Rotation => (alignment, 0.0),
        Domain::Sphere if z < 0.0 => (Alignment::Rotation, -1.0),
        Domain::Hemisphere | Domain::Sphere => (alignment, 1.0),
    }
}

/// Returns the factor of solid angles, 2 (to · h) h for the unit half vector h of `a` and `b`, and whether `to` is on the side
/// of h. What is returned second, less `to`, is `to` mirrored at h.
#[inline(always)]
#[allow(clippy::needless_bitwise_bool, reason = "loops over places without branches become vector code")]
fn along(a: Vector, b: Vector, to: Vector) -> (f64, Vector, bool) {
    let h = add(a, b);
    let (square, there) = (dot(h, h), dot(to, h));
    let is_there = (square > f64::from(NO_HALF_VECTOR)) & (there > 0.0);
    let factor = 2.0 * there / if is_there { square } else { 1.0 };
    (factor, scale(h, factor), is_there)
}

/// `d` turned with what turns `from` to `to`; mirrored, where those are nearly opposite and a turn has no axis.
#[inline(always)]
fn rotated(from: Vector, to: Vector, d: Vector) -> Vector {
    let axis = cross(from, to);
    let cos = dot(from, to);
    let sign = if cos < f64::from(NEARLY_BACK) { -1.0 } else { 1.0 };
    let once = cross(axis, d);
    let twice = cross(axis, once);
    add(add(scale(d, sign), once), scale(twice, 1.0 / (sign + cos)))
}

/// Cosine and sine of the angle about the normal from the azimuth of `a` to that of `b`.
#[inline(always)]
fn turn_between(a: Vector, b: Vector) -> [f64; 2] {
    let ([cos_a, sin_a], [cos_b, sin_b]) = (azimuth(a), azimuth(b));
    [cos_a * cos_b + sin_a * sin_b, cos_a * sin_b - sin_a * cos_b]
}

/// Where a lobe is carried up from the horizon nothing is carried, and yet the function goes on: this part of what a node has
/// there stays.
pub(super) const STAYING: f64 = 0.5;

/// The incoming directions of a block: of one node of each place, and those asked for.
pub(super) struct CarriedBlock {
    alignment: Alignment,
    /// The sign of z on the outgoing hemisphere; 0 on the sphere.
    side: f64,
    pub(super) from: Vectors,
    to: Vectors,
}

impl CarriedBlock {
    pub(super) const NOWHERE: Self =
        Self { alignment: Alignment::None, side: 0.0, from: [[0.0; BLOCK]; 3], to: [[0.0; BLOCK]; 3] };

    /// For these incoming directions; over a whole sphere directions turn on both sides alike.
    pub(super) fn set(&mut self, (alignment, domain): Carry, to: &Vectors) {
        (self.alignment, self.side) = side_by(alignment, domain, 1.0);
        self.to = *to;
    }

    /// [`Carried::drawn`] of all directions; returns which of them stay.
    pub(super) fn drawn(&self, directions: &mut Vectors, may_stay: &[bool; BLOCK]) -> [bool; BLOCK] {
        let from = *directions;
        let (moved, stays) = wide(
            #[inline(always)]
            || {
                let (mut moved, mut stays) = ([[0.0; BLOCK]; 3], [false; BLOCK]);
                known(
                    self.alignment,
                    #[inline(always)]
                    |alignment| {
                        for (i, &may_stay) in may_stay.iter().enumerate() {
                            let (wo, is_staying) = self.at(alignment, i).drawn(vector_of(&from, i), may_stay);
                            set_vector(&mut moved, i, wo);
                            stays[i] = is_staying;
                        }
                    },
                );
                (moved, stays)
            },
        );
        *directions = moved;
        stays
    }

    /// [`Carried::origin`] of all directions. What is written is known to no one else, or the loop is no vector code.
    pub(super) fn origins(&self, wo: &Vectors) -> Origins {
        wide(
            #[inline(always)]
            || {
                let mut origins = Origins::NOWHERE;
                known(
                    self.alignment,
                    #[inline(always)]
                    |alignment| {
                        for i in 0..BLOCK {
                            let (there, part, staying) = self.at(alignment, i).origin(vector_of(wo, i));
                            set_vector(&mut origins.there, i, there);
                            origins.parts[i] = part;
                            origins.staying[i] = staying;
                        }
                    },
                );
                origins
            },
        )
    }

    /// The way of one place.
    #[inline(always)]
    fn at(&self, alignment: Alignment, i: usize) -> Carried {
        Carried::new(alignment, self.side, vector_of(&self.from, i), vector_of(&self.to, i))
    }
}

/// Where a block of directions comes from: the nodes' directions that are carried there, the part of their density that comes,
/// and the part of what the nodes have at the directions themselves that stays.
pub(super) struct Origins {
    pub(super) there: Vectors,
    pub(super) parts: Block,
    pub(super) staying: Block,
}

impl Origins {
    const NOWHERE: Self = Self { there: [[0.0; BLOCK]; 3], parts: [0.0; BLOCK], staying: [0.0; BLOCK] };
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
