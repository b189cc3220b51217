//! Report on a material in the words of the trade: energy, flux and reciprocity, and the figures of luminaires.

use super::light_figures::{LightFigures, light_figures};
use super::product::Product;
use super::surface_figures::{SurfaceFigures, surface_figures};
use crate::domain::{Axis, DEFAULT_ERROR, Note, Quantity, Unit};
use crate::evaluate::physics::{EnergyReport, LuminaireReport, ReciprocityReport};
use crate::evaluate::{EvaluateError, Material};
use serde::Serialize;

/// Results of the physical checks on a material, and the figures by which its trade compares it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct PhysicsReport {
    /// Radiometric quantity of the material.
    pub quantity: Quantity,
    /// Unit of the values of the material.
    pub unit: Unit,
    /// Axes of the material described in words, outermost first.
    pub axes: Vec<String>,
    /// Energy that leaves the material: albedo, normalisation or flux; `None` for spectra without directions.
    pub energy: Option<EnergyReport>,
    /// Comparison of f(wi, wo) with f(wo, wi), for a BRDF, BSDF or phase function only.
    pub reciprocity: Option<ReciprocityReport>,
    /// Photometric figures of a luminaire, one entry for each combination of indices (positions on the axes before the
    /// directions); empty for other materials.
    pub luminaire: Vec<LuminaireFigures>,
    /// Figures of a surface (BRDF or BSDF), one entry for each combination of indices; empty for other materials.
    pub surface: Vec<SurfaceFigures>,
    /// Figures of the spectra of a light, or of the flux of a luminaire with wavelengths; empty for other materials.
    pub light: Vec<LightFigures>,
    /// Warning that incoming directions are too sparse to interpolate between them; absent if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warning: Option<Note>,
}

/// Photometric figures of a luminaire, with those that need facts from its source file.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct LuminaireFigures {
    /// Figures that follow from the intensities alone.
    #[serde(flatten)]
    pub figures: LuminaireReport,
    /// Electric power of the luminaire in W, as its file states it.
    pub watts: Option<f64>,
    /// Rated lumens of the lamps, as the file states them; `None` for absolute photometry.
    pub lamp_lumens: Option<f64>,
    /// Luminous efficacy in lm/W: the luminous flux divided by the watts; `None` if the file does not state these.
    pub efficacy: Option<f64>,
    /// Light output ratio as a fraction: the luminous flux divided by the lumens of the lamps; `None` if the file does
    /// not state these.
    pub light_output_ratio: Option<f64>,
}

impl PhysicsReport {
    /// Checks a material, and computes the figures of its trade.
    pub fn of(material: &Material) -> Result<Self, EvaluateError> {
        Self::beside(material, None)
    }

    /// Checks a material, and compares it with the measurement that it was made from, opened like the material.
    pub fn beside(material: &Material, source: Option<&Material>) -> Result<Self, EvaluateError> {
        let has_two_ways = matches!(material.quantity(), Quantity::Brdf | Quantity::Bsdf | Quantity::Phase);
        let summary = material.summary();
        let product = Product::of(summary.and_then(|summary| summary.metadata.as_deref()));
        let promised = summary.map_or(0.0, |summary| summary.errors.er_l2);
        let promised = if promised > 0.0 { promised } else { DEFAULT_ERROR };
        let energy = if material.quantity() == Quantity::Spectrum { None } else { Some(material.energy()?) };
        let fluxes = energy.as_ref().and_then(|energy| energy.flux.as_deref());
        Ok(Self {
            quantity: material.quantity(),
            unit: material.unit(),
            axes: material.axes().iter().map(Axis::describe).collect(),
            light: light_figures(material, fluxes)?,
            energy,
            reciprocity: if has_two_ways { Some(material.reciprocity()?) } else { None },
            luminaire: material
                .luminaire()
                .into_iter()
                .map(|figures| LuminaireFigures::of(figures, &product))
                .collect(),
            surface: surface_figures(material, source)?,
            warning: material.left_out(0.0).and_then(|left_out| left_out.warning(promised)),
        })
    }
}

impl LuminaireFigures {
    fn of(figures: LuminaireReport, product: &Product) -> Self {
        let Product { watts, lamp_lumens, .. } = *product;
        let ratio = match figures.unit {
            Unit::Candela => figures.flux.zip(lamp_lumens).map(|(flux, lamps)| flux / lamps),
            // Intensities for 1000 lm of the lamps.
            Unit::CandelaPerKilolumen => figures.flux.filter(|_| lamp_lumens.is_some()).map(|flux| flux / 1000.0),
            _ => None,
        };
        let lumens = match figures.unit {
            Unit::Candela => figures.flux,
            _ => ratio.zip(lamp_lumens).map(|(ratio, lamps)| ratio * lamps),
        };
        let efficacy = lumens.zip(watts).map(|(lumens, watts)| lumens / watts);
        Self { figures, watts, lamp_lumens, efficacy, light_output_ratio: ratio }
    }
}
