//! Figures of surfaces: gloss, colour in two geometries, and colour differences of a source and its material.

use crate::domain::colour::{Lab, ciede2000};
use crate::domain::{Direction, Quantity};
use crate::evaluate::physics::GlossReport;
use crate::evaluate::{EvaluateError, Material};
use crate::preview::{Question, Viewing, colours};
use serde::Serialize;

/// Figures by which surfaces are compared, for one combination of indices (positions on the axes before the
/// directions).
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SurfaceFigures {
    /// Index on each index axis (leading axis other than directions and wavelength).
    pub index: Vec<usize>,
    /// Specular gloss at 20, 60 and 85 degrees (ISO 2813); empty for surfaces that only transmit.
    pub gloss: Vec<GlossReport>,
    /// Colours in the geometries 45°:0° and d:8° (CIE 015:2018), for illuminant D65 and the CIE 1931 observer.
    pub colours: Vec<GeometryColour>,
    /// Colour differences of the source from the material under light at 45 degrees (ASTM E2539); `None` without a
    /// source to compare with.
    pub delta_e: Option<Vec<AspecularDifference>>,
}

/// Colour of a surface in a geometry of illumination and viewing.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct GeometryColour {
    /// Geometry: `45:0`, light at 45 degrees seen from the normal, or `d:8`, diffuse light seen at 8 degrees, the
    /// specular part included. The latter is measured the other way round, as the albedo at 8 degrees (reciprocity).
    pub geometry: &'static str,
    /// CIE 1976 L*a*b* relative to the perfect diffuser; `None` if a direction or too many wavelengths were not
    /// measured.
    pub lab: Option<[f64; 3]>,
    /// Tristimulus value Y, 100 for the perfect diffuser; `None` like L*a*b*.
    pub y: Option<f64>,
}

/// Colour difference of a source and its material at one aspecular angle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct AspecularDifference {
    /// Angle in degrees from the mirror direction of light at 45 degrees, positive towards the light.
    pub aspecular: f64,
    /// Colour difference CIEDE2000; `None` if the direction was not measured.
    pub delta_e: Option<f64>,
}

/// Angle of incidence in degrees of the geometry 45°:0° and of aspecular angles.
const INCIDENCE: f64 = 45.0;
/// Viewing angle in degrees of the geometry d:8°.
const NEAR_NORMAL: f64 = 8.0;
/// Aspecular angles in degrees of ASTM E2539.
const ASPECULAR: [f64; 6] = [-15.0, 15.0, 25.0, 45.0, 75.0, 110.0];

/// Computes the figures of a surface, one entry for each combination of indices; empty for other materials. `source` is
/// the measurement that the material was made from, opened like it.
pub(super) fn surface_figures(
    material: &Material,
    source: Option<&Material>,
) -> Result<Vec<SurfaceFigures>, EvaluateError> {
    if !matches!(material.quantity(), Quantity::Brdf | Quantity::Bsdf) || material.layout().outgoing.is_none() {
        return Ok(Vec::new());
    }
    let counts = material.axes()[..material.layout().indices].iter();
    let entries = counts.map(crate::domain::Axis::len).product();
    let of_entry = |entry: usize| {
        let index = material.index_of(entry);
        let wi = Direction::from_degrees(INCIDENCE, 0.0);
        let at = |geometry, colour: Option<([f64; 3], f64)>| GeometryColour {
            geometry,
            lab: colour.map(|(lab, _)| lab),
            y: colour.map(|(_, y)| y),
        };
        let near_normal = Direction::from_degrees(NEAR_NORMAL, 0.0);
        let colours = vec![
            at("45:0", colour(material, &index, wi, Some(Direction::from_degrees(0.0, 0.0)))),
            at("d:8", colour(material, &index, near_normal, None)),
        ];
        let delta_e = source.map(|source| {
            let of_angle = |aspecular: f64| {
                let wo = aspecular_direction(aspecular);
                let both = colour(source, &index, wi, Some(wo)).zip(colour(material, &index, wi, Some(wo)));
                let lab = |[l, a, b]: [f64; 3]| Lab { l, a, b };
                let delta_e = both.map(|((stated, _), (found, _))| ciede2000(lab(stated), lab(found)));
                AspecularDifference { aspecular, delta_e }
            };
            ASPECULAR.map(of_angle).to_vec()
        });
        Ok(SurfaceFigures { gloss: material.gloss(&index)?, index, colours, delta_e })
    };
    (0..entries).map(of_entry).collect()
}

/// Direction at an angle in degrees from the mirror direction of light at 45 degrees and azimuth 0, towards the light.
fn aspecular_direction(aspecular: f64) -> Direction {
    let from_normal = INCIDENCE - aspecular;
    // The mirror direction is at azimuth 180.
    Direction::from_degrees(from_normal.abs(), if from_normal >= 0.0 { 180.0 } else { 0.0 })
}

/// L*a*b* and Y of a surface at a pair of directions, or of its albedo without `wo`; `None` where it was not measured.
fn colour(material: &Material, index: &[usize], wi: Direction, wo: Option<Direction>) -> Option<([f64; 3], f64)> {
    if !material.is_measured(Some(wi), wo) {
        return None;
    }
    let index = (!index.is_empty()).then_some(index);
    let found = colours(material, &Question { index, wi: Some(wi), wo }, &Viewing::default()).ok()?;
    let colour = found.colours.into_iter().next().flatten()?;
    Some((colour.lab, colour.xyz[1]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{
        Axis, AzimuthExtent, Azimuths, DirectionGrid, Frame, Measurement, Sampling, Tensor, Unit, WavelengthGrid,
    };

    fn surface(last: f64, value: impl Fn(Direction) -> f64) -> Material {
        let polar = (0..=(last / 5.0) as usize).map(|i| 5.0 * i as f64).collect();
        let azimuths = Azimuths { angles: vec![0.0, 90.0, 180.0], extent: AzimuthExtent::Mirrored };
        let outgoing = DirectionGrid::new(Frame::Surface, polar, Some(azimuths)).unwrap();
        let lambda = Axis::Wavelength(WavelengthGrid::even(400.0, 20.0, 16).unwrap());
        let incoming: Vec<f64> = vec![0.0, 10.0, 45.0, 60.0];
        let samples = incoming.iter().flat_map(|_| (0..outgoing.len()).map(|i| value(outgoing.direction(i))));
        let samples = samples.flat_map(|value| [value as f32; 16]).collect();
        let axes = vec![Axis::Elevation(incoming.clone()), Axis::Grid(outgoing.clone()), lambda];
        let tensor = Tensor::new(axes, samples).unwrap();
        Material::of(Measurement::new(Quantity::Brdf, Unit::PerSteradian, Sampling::Point, tensor).unwrap()).unwrap()
    }

    const WHITE: f64 = std::f64::consts::FRAC_1_PI;

    #[test]
    fn a_perfect_diffuser_is_white_in_both_geometries() {
        let found = surface_figures(&surface(90.0, |_| WHITE), None).unwrap();
        let [only] = &found[..] else { panic!("{found:?}") };
        for colour in &only.colours {
            let [l, a, b] = colour.lab.unwrap();
            assert!((l - 100.0).abs() < 0.02 && a.abs() < 0.02 && b.abs() < 0.02, "{colour:?}");
            assert!((colour.y.unwrap() - 100.0).abs() < 0.05, "{colour:?}");
        }
        assert_eq!((only.gloss.len(), only.delta_e.as_deref()), (3, None));
    }

    #[test]
    fn differences_are_null_where_nothing_was_measured() {
        // Brighter by 10 % towards the light, at azimuth 0.
        let towards = |wo: Direction| if wo.xyz()[0] > 0.1 { 1.1 * WHITE } else { WHITE };
        let found = surface_figures(&surface(60.0, |_| WHITE), Some(&surface(60.0, towards))).unwrap();
        let delta_e: Vec<Option<f64>> = found[0].delta_e.iter().flatten().map(|one| one.delta_e).collect();
        assert!(delta_e[..4].iter().all(|found| found.unwrap() < 1e-3), "{delta_e:?}");
        assert!(delta_e[4].unwrap() > 1.0 && delta_e[5].is_none(), "{delta_e:?}");
    }

    #[test]
    fn aspecular_angles_count_from_the_mirror_towards_the_light() {
        for (aspecular, theta, phi) in
            [(-15.0, 60.0, 180.0), (15.0, 30.0, 180.0), (25.0, 20.0, 180.0), (75.0, 30.0, 0.0), (110.0, 65.0, 0.0)]
        {
            let direction = aspecular_direction(aspecular);
            assert!((direction.theta_degrees() - theta).abs() < 1e-9 && (direction.phi_degrees() - phi).abs() < 1e-9);
        }
        assert!(aspecular_direction(45.0).cos_theta() == 1.0);
    }
}
