//! Reciprocal function derived from one that need not be: the mean of f(wi, wo) and f(wo, wi).

use crate::domain::{Direction, Quantity};
use crate::evaluate::error::{Argument, Buffer, EvaluateError, QueryError, unfit};
use crate::evaluate::material::Material;
use crate::evaluate::place::{Interpolation, Place};

/// Mean by which the values of f(wi, wo) and f(wo, wi) are combined into a reciprocal function.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Mean {
    /// Arithmetic mean (a + b) / 2 of f(wi, wo) and f(wo, wi): keeps their energy.
    #[default]
    Arithmetic,
    /// Geometric mean √(a · b) of f(wi, wo) and f(wo, wi): keeps lobes narrow where a and b disagree, and never exceeds
    /// the arithmetic mean. It is 0 if a or b is not positive.
    Geometric,
}

impl Material {
    /// Writes the spectrum of the mean of f(wi, wo) and f(wo, wi) at `place`, both evaluated by [`Material::evaluate`].
    /// The result is bit-identical for (wi, wo) and (wo, wi). Costs two evaluations; `scratch` has the length of `out`
    /// and is overwritten.
    ///
    /// * One of the two may be masked or outside the material, that is, its incoming or outgoing direction outside the
    ///   respective domain. The result is then the other one. If neither is available, it is 0 outside and NaN if
    ///   masked. Fails if neither direction is in the incoming domain.
    /// * Transmission is reciprocal only with a factor of the refractive indices, which a material does not store.
    ///   Hence it fails for a BTDF. If the directions of a BSDF lie on different sides, the spectrum is not averaged.
    /// * The stored albedo is not that of the mean. [`Material::pdf`] and [`Material::sample`] remain those of the
    ///   unaveraged function: use them with this value, divided by the pdf.
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
            // Fails if wi is outside, unless wo is inside: then no light leaves either way.
            (false, false) if !self.geometry().takes(wi) && self.geometry().takes(wo) => self.evaluate(back, how, out),
            _ => self.evaluate(place, how, out),
        }
    }

    /// Returns the incoming and the outgoing direction of a query; fails for a quantity without reciprocity.
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

    /// Returns true if `wi` and `wo` lie on different sides of a BSDF's surface.
    pub(super) fn is_transmitted(&self, wi: Direction, wo: Direction) -> bool {
        self.quantity() == Quantity::Bsdf && (wi.cos_theta() >= 0.0) != (wo.cos_theta() >= 0.0)
    }

    /// Returns true if `wi` is inside the domain of the incoming axis and `wo` inside that of the outgoing axis.
    pub(super) fn holds(&self, wi: Direction, wo: Direction) -> bool {
        self.geometry().takes(wi) && self.geometry().sends(wo)
    }
}

fn average(a: f32, b: f32, mean: Mean) -> f32 {
    match mean {
        _ if a.is_nan() => b,
        _ if b.is_nan() => a,
        // Halving each is exact except for denormals, and cannot overflow as the sum might.
        Mean::Arithmetic => 0.5 * a + 0.5 * b,
        Mean::Geometric if a > 0.0 && b > 0.0 => (f64::from(a) * f64::from(b)).sqrt() as f32,
        Mean::Geometric => 0.0,
    }
}
