//! Maps directions from the incoming direction of a node to the queried one, with their density; singly or in blocks.

use super::incoming::{Alignment, NEARLY_BACK, NO_HALF_VECTOR, azimuth};
use super::kernel::{BLOCK, Block, Vectors, set_vector, vector_of};
use crate::domain::vector::{Vector, add, cross, dot, scale, sub, turned, unit};
use crate::domain::{Direction, Domain};
use crate::numeric::wide;

/// Alignment that maps directions from a node to the queried incoming direction, and the outgoing domain.
pub(super) type Carry = (Alignment, Domain);

/// Mapping of directions from a node with incoming direction `from` to the incoming direction `to`, and its inverse.
pub(super) struct Carried {
    alignment: Alignment,
    /// Sign of z on the outgoing hemisphere; 0 on the sphere.
    side: f64,
    from: Vector,
    to: Vector,
    /// Cosine and sine of the rotation about the normal from the azimuth of `to` to that of `from`; identity unless
    /// lobes turn with the azimuth.
    turn: [f64; 2],
    /// `to` after that rotation.
    turned: Vector,
}

/// Image of a direction, the ratio of solid angles there to here, and a flag: true if the image exists on the right
/// side of the horizon.
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

    /// Mapping of the directions on the same side of the horizon as the height `z`.
    #[inline(always)]
    pub(super) fn over(alignment: Alignment, domain: Domain, z: f64, from: Vector, to: Vector) -> Self {
        let (alignment, side) = side_by(alignment, domain, z);
        Self::new(alignment, side, from, to)
    }

    /// Direction under the node that maps to `wo`.
    #[inline(always)]
    fn back(&self, wo: Vector) -> Way {
        match self.alignment {
            Alignment::None => self.way(wo, 1.0, true),
            Alignment::Rotation => self.way(rotated(self.to, self.from, wo), 1.0, true),
            // About one half vector a solid angle is 4 |w · h| times that of the half vector (Walter et al. 2007,
            // section 4.2); w · h is half the square of w + wo.
            Alignment::HalfVector | Alignment::TurnedHalfVector => {
                let (scale, h, is_there) = along(self.turned, turned(wo, self.turn), self.from);
                self.way(sub(h, self.from), scale, is_there)
            }
        }
    }

    /// Image of the node's direction `wo` under the queried incoming direction.
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

    /// Maps a direction drawn at the node; returns its position and true if it stays where it was drawn. It stays if
    /// its image does not exist or lies below the horizon. If `may_stay`, it also stays if no direction maps to it.
    #[inline(always)]
    pub(super) fn drawn(&self, wo: Vector, may_stay: bool) -> (Vector, bool) {
        let way = self.out(wo);
        let stays = !way.is_open | (may_stay & !self.back(wo).is_open);
        (if stays { wo } else { unit(way.there) }, stays)
    }

    /// Returns the node's direction that maps to `wo`, the factor on its density (0 if there is none), and the fraction
    /// of the node's density at `wo` itself that stays.
    #[inline(always)]
    pub(super) fn origin(&self, wo: Vector) -> (Vector, f64, f64) {
        let back = self.back(wo);
        let there = [0, 1, 2].map(|k| if back.is_open { back.there[k] } else { wo[k] });
        // `there` certainly maps to `wo`, which is open; but a draw may also have stayed.
        let carried = if self.back(there).is_open { 1.0 } else { 1.0 - STAYING };
        let part = if back.is_open { back.solid_angle * carried } else { 0.0 };
        let kept = if back.is_open { 0.0 } else { STAYING };
        (there, part, if self.out(wo).is_open { kept } else { 1.0 })
    }

    /// Density in sr⁻¹ at `wo`, for directions that the node draws with density `pdf`.
    #[inline(always)]
    pub(super) fn density(&self, wo: Vector, pdf: impl Fn(Direction) -> f64) -> f64 {
        let (there, part, staying) = self.origin(wo);
        let carried = if part > 0.0 { part * pdf(Direction::from_unit(there)) } else { 0.0 };
        if staying > 0.0 { carried + staying * pdf(Direction::from_unit(wo)) } else { carried }
    }
}

/// Alignment of directions on the same side of the horizon as the height `z`, and the sign of heights there (0 if there
/// is no horizon). On a whole sphere, transmitted light is rotated whatever alignment reflected light has.
#[inline(always)]
fn side_by(alignment: Alignment, domain: Domain, z: f64) -> (Alignment, f64) {
    match domain {
        Domain::Lower => (alignment, -1.0),
        Domain::Sphere if alignment == Alignment::Rotation => (alignment, 0.0),
        Domain::Sphere if z < 0.0 => (Alignment::Rotation, -1.0),
        Domain::Hemisphere | Domain::Sphere => (alignment, 1.0),
    }
}

/// Returns the factor of solid angles and the vector 2 (to · h) h, with h the unit half vector of `a` and `b`. The flag
/// is true if `to` is on the side of h. The vector minus `to` is `to` mirrored at h.
#[inline(always)]
#[allow(clippy::needless_bitwise_bool, reason = "loops over places without branches become vector code")]
fn along(a: Vector, b: Vector, to: Vector) -> (f64, Vector, bool) {
    let h = add(a, b);
    let (square, there) = (dot(h, h), dot(to, h));
    let is_there = (square > f64::from(NO_HALF_VECTOR)) & (there > 0.0);
    let factor = 2.0 * there / if is_there { square } else { 1.0 };
    (factor, scale(h, factor), is_there)
}

/// `d` after the rotation that takes `from` to `to`; mirrored where those are nearly opposite and the rotation has no
/// axis.
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

/// Fraction of the node's density that stays in place where a lobe is lifted from the horizon: no direction maps there,
/// yet the function is nonzero.
pub(super) const STAYING: f64 = 0.5;

/// Incoming directions of a block: that of one node for each place, and the queried ones.
pub(super) struct CarriedBlock {
    alignment: Alignment,
    /// Sign of z on the outgoing hemisphere; 0 on the sphere.
    side: f64,
    pub(super) from: Vectors,
    to: Vectors,
}

impl CarriedBlock {
    pub(super) const NOWHERE: Self =
        Self { alignment: Alignment::None, side: 0.0, from: [[0.0; BLOCK]; 3], to: [[0.0; BLOCK]; 3] };

    /// Sets the alignment and the queried incoming directions. On a whole sphere directions are rotated on both sides
    /// alike.
    pub(super) fn set(&mut self, (alignment, domain): Carry, to: &Vectors) {
        (self.alignment, self.side) = side_by(alignment, domain, 1.0);
        self.to = *to;
    }

    /// [`Carried::drawn`] of all directions; returns a flag for each that stays.
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

    /// [`Carried::origin`] of all directions. The result is a local value: without aliasing the loop is vectorised.
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

    /// Mapping of place `i`.
    #[inline(always)]
    fn at(&self, alignment: Alignment, i: usize) -> Carried {
        Carried::new(alignment, self.side, vector_of(&self.from, i), vector_of(&self.to, i))
    }
}

/// Origins of a block of directions: the nodes' directions that map there, the factors on their density, and the
/// fractions of the nodes' density at the directions themselves that stay.
pub(super) struct Origins {
    pub(super) there: Vectors,
    pub(super) parts: Block,
    pub(super) staying: Block,
}

impl Origins {
    const NOWHERE: Self = Self { there: [[0.0; BLOCK]; 3], parts: [0.0; BLOCK], staying: [0.0; BLOCK] };
}

/// Calls `work` with an alignment known at compile time.
#[inline(always)]
pub(super) fn known(alignment: Alignment, work: impl FnOnce(Alignment)) {
    match alignment {
        Alignment::None => work(Alignment::None),
        Alignment::HalfVector => work(Alignment::HalfVector),
        Alignment::TurnedHalfVector => work(Alignment::TurnedHalfVector),
        Alignment::Rotation => work(Alignment::Rotation),
    }
}
