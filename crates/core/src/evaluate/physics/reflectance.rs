//! Albedo as a measurement of its own: the paper's reflectance, to be compressed and stored (\[CPB06\] section 6.1.3).

use crate::domain::{Axis, Measurement, Quantity, Tensor, Unit};
use crate::evaluate::albedo::Side;
use crate::evaluate::error::{EvaluateError, Need, QueryError, unfit};
use crate::evaluate::material::Material;

impl Material {
    /// Returns the directional–hemispherical reflectance a(wi, λ) = ∫ f · |cos θo| dωo of a BRDF, BTDF or BSDF; `side`
    /// selects reflected, transmitted or all light. For a BTDF it is the transmittance. The result has quantity
    /// [`Quantity::Reflectance`], unit 1 and the material's axes without the outgoing one:
    /// `[index…, incoming, lambda]`. Each value is an average or a point sample over incoming directions, as the
    /// material's samples are. It is masked if all outgoing directions are.
    pub fn reflectance(&self, side: Side) -> Result<Measurement, EvaluateError> {
        let quantity = self.quantity();
        if !quantity.has_cosine() {
            return unfit(QueryError::NoReflectance { quantity });
        }
        self.needs_whole("reflectance")?;
        let cells = self.over_triangles()?;
        cells.needs_outgoing(Need::Reflectance)?;
        let outgoing = cells.layout().outgoing;
        let axes = cells.axes().iter().enumerate().filter(|&(i, _)| outgoing != Some(i));
        let axes: Vec<Axis> = axes.map(|(_, axis)| axis.clone()).collect();
        let tensor = Tensor::new(axes, cells.side(side))?;
        Ok(Measurement::new(Quantity::Reflectance, Unit::One, cells.geometry().sampling(), tensor)?)
    }
}
