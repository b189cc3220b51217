//! Maps directions from the incoming direction of a node to the queried one, with their density; singly or in blocks.

use super::incoming::{Alignment, NEARLY_BACK, NO_HALF_VECTOR, azimuth};
use super::kernel::{BLOCK, Block, Vectors, set_vector, vector_of};
use crate::domain::vector::{Vector, add, cross, dot, scale, sub, turned, unit};
use crate::domain::{Direction, Domain};
use crate::numeric::wide;

/// Alignment of lobes (rule that maps outgoing directions from one incoming direction to another), and the outgoing
/// domain.
pub(super) type Carry = (Alignment, Domain);

/// Mapping of outgoing directions from the incoming direction `from` of an interpolation node to the queried one `to`,
/// and its inverse.
pub(super) struct Carried {
    alignment: Alignment,
    /// Sign of z on the hemisphere of the outgoing directions; 0 if they cover the whole sphere.
    side: f64,
    from: Vector,
    to: Vector,
    /// Cosine and sine of the rotation about the normal from the azimuth of the queried incoming direction, `to`, to
    /// that of the interpolation node, `from`. It is the identity except for [`Alignment::TurnedHalfVector`].
    turn: [f64; 2],
    /// Incoming direction `to`, rotated about the normal to the azimuth of `from`.
    turned: Vector,
}

/// Outgoing direction moved with the lobe around it from one incoming direction to another, with the ratio of solid
/// angles (moved to original). The flag is true if the moved direction exists and lies in the hemisphere of the
/// outgoing directions.
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

    /// Mapping that moves outgoing directions with their lobes from the incoming direction `from` to `to`. It holds on
    /// the side of the horizon on which an outgoing direction with z coordinate `z` lies.
    #[inline(always)]
    pub(super) fn over(alignment: Alignment, domain: Domain, z: f64, from: Vector, to: Vector) -> Self {
        let (alignment, side) = side_by(alignment, domain, z);
        Self::new(alignment, side, from, to)
    }

    /// Inverse mapping: outgoing direction under the incoming direction `from` that moves to `wo` when lobes follow the
    /// incoming direction from `from` to `to`.
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

    /// Outgoing direction to which `wo` moves when lobes follow the incoming direction from `from` (that of an
    /// interpolation node) to the queried one, `to`.
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

    /// Moves an outgoing direction, drawn under the incoming direction `from`, with its lobe to the incoming direction
    /// `to`. Returns the moved direction and false. If that does not exist or lies outside the outgoing hemisphere,
    /// returns `wo` as drawn and true.
    ///
    /// With `may_stay`, `wo` also stays as drawn if no outgoing direction under `from` moves to it.
    #[inline(always)]
    pub(super) fn drawn(&self, wo: Vector, may_stay: bool) -> (Vector, bool) {
        let way = self.out(wo);
        let stays = !way.is_open | (may_stay & !self.back(wo).is_open);
        (if stays { wo } else { unit(way.there) }, stays)
    }

    /// Finds the outgoing direction under the incoming direction `from` that moves to `wo` if its lobe follows the
    /// incoming direction to `to`. Returns this direction and two numbers. The first, times the sampling density at the
    /// direction, is the direction's contribution to the density at `wo` (0 without such a direction). The second is
    /// the fraction of directions drawn at `wo` that stay at `wo`.
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

    /// Sampling density in sr⁻¹ at `wo` under the incoming direction `to`, for directions that are drawn with density
    /// `pdf` under the incoming direction `from` and then moved with their lobes.
    #[inline(always)]
    pub(super) fn density(&self, wo: Vector, pdf: impl Fn(Direction) -> f64) -> f64 {
        let (there, part, staying) = self.origin(wo);
        let carried = if part > 0.0 { part * pdf(Direction::from_unit(there)) } else { 0.0 };
        if staying > 0.0 { carried + staying * pdf(Direction::from_unit(wo)) } else { carried }
    }
}

/// Rule that moves an outgoing direction, whose z coordinate is `z`, with its lobe from one incoming direction to
/// another. Also the sign of z on the hemisphere in which the direction stays, or 0 if it may move over the whole
/// sphere. On a whole sphere, transmitted light is always moved by rotation.
#[inline(always)]
fn side_by(alignment: Alignment, domain: Domain, z: f64) -> (Alignment, f64) {
    match domain {
        Domain::Lower => (alignment, -1.0),
        Domain::Sphere if alignment == Alignment::Rotation => (alignment, 0.0),
        Domain::Sphere if z < 0.0 => (Alignment::Rotation, -1.0),
        Domain::Hemisphere | Domain::Sphere => (alignment, 1.0),
    }
}

/// Returns k = 2 (to · h) / |h|² and the vector k h, where h = a + b; k h minus `to` is `to` mirrored at h. With `a`
/// and `to` fixed, k is the solid angle that the mirror image sweeps per solid angle of `b`. The flag is true if `to`
/// and h enclose less than 90°.
#[inline(always)]
#[allow(clippy::needless_bitwise_bool, reason = "loops over places without branches become vector code")]
fn along(a: Vector, b: Vector, to: Vector) -> (f64, Vector, bool) {
    let h = add(a, b);
    let (square, there) = (dot(h, h), dot(to, h));
    let is_there = (square > f64::from(NO_HALF_VECTOR)) & (there > 0.0);
    let factor = 2.0 * there / if is_there { square } else { 1.0 };
    (factor, scale(h, factor), is_there)
}

/// Direction `d` rotated as `from` must be rotated to reach `to`. If these are nearly opposite, the rotation axis is
/// ill-defined; `d` is then rotated from `from` to `-to` and negated.
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

/// Fraction of the directions drawn in a band near the horizon that are not moved with their lobe to the queried
/// incoming direction. If moves raise directions, none arrives in that band, yet the material's function is nonzero
/// there.
pub(super) const STAYING: f64 = 0.5;

/// Incoming directions for a block of queries (batch evaluated together): for each query, one at which values are
/// tabulated, `from`, and the queried one, `to`. Outgoing directions are mapped from the first to the second.
pub(super) struct CarriedBlock {
    alignment: Alignment,
    /// Sign of z on the hemisphere of the outgoing directions; 0 if they cover the whole sphere.
    side: f64,
    pub(super) from: Vectors,
    to: Vectors,
}

impl CarriedBlock {
    pub(super) const NOWHERE: Self =
        Self { alignment: Alignment::None, side: 0.0, from: [[0.0; BLOCK]; 3], to: [[0.0; BLOCK]; 3] };

    /// Sets the rule by which lobes move with the incoming direction, and the queried incoming directions of the block.
    /// One rule serves outgoing directions above and below the horizon.
    pub(super) fn set(&mut self, (alignment, domain): Carry, to: &Vectors) {
        (self.alignment, self.side) = side_by(alignment, domain, 1.0);
        self.to = *to;
    }

    /// Moves a block of drawn outgoing directions with their lobes to the queried incoming directions, each as
    /// [`Carried::drawn`] does. Returns, for each, true if the direction stays as it was drawn.
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

    /// Finds, for each query of a block (batch evaluated together), the outgoing direction under an interpolation
    /// node's incoming direction that moves to `wo` with its lobe. Also gives the factor on the sampling density there
    /// and the fraction of directions drawn at `wo` that stay at `wo`; see [`Carried::origin`].
    ///
    /// The result is a local value, because the loop is vectorised only without aliasing.
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

    /// Mapping that moves outgoing directions with their lobes from the incoming direction of an interpolation node to
    /// the queried one, for query `i` of a block of queries evaluated together.
    #[inline(always)]
    fn at(&self, alignment: Alignment, i: usize) -> Carried {
        Carried::new(alignment, self.side, vector_of(&self.from, i), vector_of(&self.to, i))
    }
}

/// Result of undoing, for a block of queries (batch evaluated together), the motion of outgoing directions with the
/// lobes from an interpolation node's incoming direction to the query's.
///
/// `there` holds the direction that moves to each outgoing direction, `parts` the factor by which this motion changes
/// the sampling density. `staying` is the fraction of the directions drawn at the outgoing direction that do not move
/// away.
pub(super) struct Origins {
    pub(super) there: Vectors,
    pub(super) parts: Block,
    pub(super) staying: Block,
}

impl Origins {
    const NOWHERE: Self = Self { there: [[0.0; BLOCK]; 3], parts: [0.0; BLOCK], staying: [0.0; BLOCK] };
}

/// Calls `work` with the alignment of lobes between incoming directions as a compile-time constant.
#[inline(always)]
pub(super) fn known(alignment: Alignment, work: impl FnOnce(Alignment)) {
    match alignment {
        Alignment::None => work(Alignment::None),
        Alignment::HalfVector => work(Alignment::HalfVector),
        Alignment::TurnedHalfVector => work(Alignment::TurnedHalfVector),
        Alignment::Rotation => work(Alignment::Rotation),
    }
}
