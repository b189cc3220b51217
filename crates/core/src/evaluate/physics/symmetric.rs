//! A reciprocal function made of one that need not be: the mean of f(wi, wo) and f(wo, wi).

use crate::domain::{Direction, Quantity};
use crate::evaluate::error::{Argument, Buffer, EvaluateError, QueryError, unfit};
use crate::evaluate::material::Material;
use crate::evaluate::place::{Interpolation, Place};

/// How the two directions of light are averaged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Mean {
    /// (a + b) / 2: keeps the energy of a pair.
    #[default]
    Arithmetic,
    /// √(a · b): keeps lobes narrow where the two disagree, never more than the arithmetic one; 0 where one is not positive.
    Geometric,
}

impl Material {
    /// The spectrum at `place` as [`Material::evaluate`] gives it, averaged with the one under exchanged directions: exactly
    /// the same for (wi, wo) and (wo, wi), bit by bit. Costs two evaluations; `scratch` is as long as `out`, and garbage
    /// afterwards.
    ///
    /// * Where one of the two is not in the material (its incoming direction outside the incoming domain, or its outgoing
    ///   one outside the outgoing domain) or masked, it is the other one; where neither is, 0 outside and NaN masked.
    ///   Refused if neither direction is in the incoming domain.
    /// * Transmission is reciprocal only with a factor of the refractive indices that a material does not hold: a BTDF is
    ///   refused, and where the directions of a BSDF lie on different sides, it is the spectrum as it is.
    /// * The albedo of the mean is no longer the stored one; [`Material::pdf`] and [`Material::sample`] stay those of the
    ///   function as it is: use them with the value of this one, divided by the pdf.
    pub fn symmetric_spectrum(
        &self,
        place: Place<'_>,
        how: Interpolation,
        mean: Mean,
        scratch: &mut [f32],
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        let (wi, wo) = self.pair(place)?;
        Buffer::Scratch.check(scratch.len(), out.len())?;
        if self.is_transmitted(wi, wo) {
            return self.evaluate(place, how, out);
        }
        let back = Place { index: place.index, wi: Some(wo), wo: Some(wi) };
        match (self.holds(wi, wo), self.holds(wo, wi)) {
            (true, true) => {
                self.evaluate(place, how, out)?;
                self.evaluate(back, how, scratch)?;
                for (a, &b) in out.iter_mut().zip(&*scratch) {
                    *a = average(*a, b, mean);
                }
                Ok(())
            }
            (false, true) => self.evaluate(back, how, out),
            // Refused there if wi is outside, unless wo is inside: then nothing is sent either way.
            (false, false) if !self.geometry().takes(wi) && self.geometry().takes(wo) => self.evaluate(back, how, out),
            _ => self.evaluate(place, how, out),
        }
    }

    /// The two directions of a quantity that has a reciprocity.
    pub(super) fn pair(&self, place: Place<'_>) -> Result<(Direction, Direction), EvaluateError> {
        let quantity = self.quantity();
        match quantity {
            Quantity::Brdf | Quantity::Bsdf | Quantity::Phase => {}
            _ => return unfit(QueryError::NoReciprocity { quantity }),
        }
        match (place.wi, place.wo) {
            (Some(wi), Some(wo)) if self.geometry().has_incoming() => Ok((wi, wo)),
            (None, _) if self.geometry().has_incoming() => self.geometry().refuse_incoming(None),
            (_, None) if self.geometry().has_incoming() => {
                unfit(QueryError::MissingDirection { argument: Argument::Wo, quantity })
            }
            _ => unfit(QueryError::NoExchange { quantity }),
        }
    }

    /// Whether light goes from one side of a surface to the other.
    pub(super) fn is_transmitted(&self, wi: Direction, wo: Direction) -> bool {
        self.quantity() == Quantity::Bsdf && (wi.cos_theta() >= 0.0) != (wo.cos_theta() >= 0.0)
    }

    /// Whether there is a value for `wi` and `wo`.
    pub(super) fn holds(&self, wi: Direction, wo: Direction) -> bool {
        self.geometry().takes(wi) && self.geometry().sends(wo)
    }
}

fn average(a: f32, b: f32, mean: Mean) -> f32 {
    match mean {
        _ if a.is_nan() => b,
        _ if b.is_nan() => a,
        // Halves are exact but for denormals, and cannot overflow where the sum would.
        Mean::Arithmetic => 0.5 * a + 0.5 * b,
        Mean::Geometric if a > 0.0 && b > 0.0 => (f64::from(a) * f64::from(b)).sqrt() as f32,
        Mean::Geometric => 0.0,
    }
}
