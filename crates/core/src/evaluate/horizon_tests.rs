//! Tests of the horizon of surfaces: each side is a function of its own, in values, densities, integrals and levels.

use super::{Beyond, Directions, Interpolation, Material, Pairs, Place, Side};
use crate::domain::{
    Axis, AzimuthExtent, Azimuths, Direction, DirectionGrid, Domain, Frame, Measurement, Quantity, Sampling, Tensor,
    TriangleMesh, WavelengthGrid,
};
use std::f64::consts::PI;

const REFLECTED: f32 = 0.3;
const TRANSMITTED: f32 = 0.001;
const BOTH_WAYS: [Interpolation; 2] = [Interpolation::Smooth, Interpolation::Constant];

fn grid(polar: &[f64]) -> Axis {
    let angles = (0..12).map(|k| 30.0 * f64::from(k)).collect();
    let azimuths = Azimuths { angles, extent: AzimuthExtent::Circle };
    Axis::Grid(DirectionGrid::new(Frame::Surface, polar.to_vec(), Some(azimuths)).unwrap())
}

fn both_sides() -> Vec<f64> {
    (0..=18).map(|k| 10.0 * f64::from(k)).collect()
}

fn without(angle: f64) -> Vec<f64> {
    both_sides().into_iter().filter(|polar| *polar != angle).collect()
}

/// A sheet that reflects 0.3 and transmits 0.001 per steradian, from either side.
fn sheet(incoming: &Axis, outgoing: &Axis) -> Material {
    let lambdas = Axis::Wavelength(WavelengthGrid::even(500.0, 100.0, 2).unwrap());
    let is_above = |direction: Direction| direction.cos_theta() >= -1e-12;
    let direction = |axis: &Axis, entry| axis.direction(entry).unwrap();
    let value = |i: usize| {
        let (wi, wo) = (i / 2 / outgoing.len(), i / 2 % outgoing.len());
        let is_reflected = is_above(direction(incoming, wi)) == is_above(direction(outgoing, wo));
        if is_reflected { REFLECTED } else { TRANSMITTED }
    };
    let samples = (0..2 * incoming.len() * outgoing.len()).map(value).collect();
    let tensor = Tensor::new(vec![incoming.clone(), outgoing.clone(), lambdas], samples).unwrap();
    let unit = Quantity::Bsdf.default_unit();
    Material::of(Measurement::new(Quantity::Bsdf, unit, Sampling::Point, tensor).unwrap()).unwrap()
}

fn sheets() -> Vec<Material> {
    let mesh = |level| Axis::Triangles(TriangleMesh::new(Domain::Sphere, level).unwrap());
    let elevations = || Axis::Elevation(vec![0.0, 30.0, 60.0, 85.0]);
    vec![
        sheet(&elevations(), &grid(&both_sides())),
        sheet(&elevations(), &grid(&without(90.0))),
        sheet(&grid(&both_sides()), &grid(&both_sides())),
        sheet(&grid(&without(90.0)), &grid(&without(90.0))),
        sheet(&elevations(), &mesh(3)),
        sheet(&mesh(2), &mesh(3)),
    ]
}

fn values(material: &Material, wi: Direction, wo: Direction, how: Interpolation) -> [f32; 4] {
    let place = Place { index: &[], wi: Some(wi), wo: Some(wo) };
    let mut one = [0.0; 2];
    material.evaluate(place, how, &mut one).unwrap();
    let mut at = [0.0; 1];
    material.at_wavelengths(place, how, Beyond::Masked, &[550.0], &mut at).unwrap();
    let mut batch = [0.0; 2];
    let (wi, wo) = (Some(Directions::of(std::slice::from_ref(&wi))), Some(Directions::of(std::slice::from_ref(&wo))));
    material.spectra(Pairs { index: &[], wi, wo }, how, &mut batch).unwrap();
    [one[0], at[0], batch[0], material.weighted(place, how, &[0.5, 0.5]).unwrap()]
}

#[test]
fn nothing_is_interpolated_across_the_horizon() {
    for (number, material) in sheets().iter().enumerate() {
        let from_below = material.geometry().takes(Direction::from_degrees(120.0, 0.0));
        for theta_i in [0.0, 20.0, 45.0, 60.0, 88.0, 95.0, 130.0, 180.0].into_iter().filter(|t| *t < 90.0 || from_below)
        {
            for (theta_o, phi_o) in [80.0, 85.0, 89.9, 89.999_99, 90.000_01, 90.1, 95.0, 100.0, 170.0]
                .into_iter()
                .flat_map(|theta| [0.0, 14.0, 180.0, 291.0].map(|phi| (theta, phi)))
            {
                let is_reflected = (theta_i < 90.0) == (theta_o < 90.0);
                let expected = if is_reflected { REFLECTED } else { TRANSMITTED };
                let (wi, wo) = (Direction::from_degrees(theta_i, 40.0), Direction::from_degrees(theta_o, phi_o));
                for how in BOTH_WAYS {
                    for found in values(material, wi, wo, how) {
                        assert!(
                            (found / expected - 1.0).abs() < 1e-3,
                            "sheet {number} {how:?}: {theta_i}, {theta_o} {phi_o}: {found}"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn light_and_density_of_each_side_are_its_own() {
    for (number, material) in sheets().iter().enumerate() {
        for theta_i in [0.0, 45.0, 80.0] {
            let wi = Direction::from_degrees(theta_i, 40.0);
            for (side, expected) in [(Side::Reflected, REFLECTED), (Side::Transmitted, TRANSMITTED)] {
                for how in BOTH_WAYS {
                    let mut light = [0.0; 2];
                    material.integrated(side, &[], Some(wi), how, 0, &mut light).unwrap();
                    let expected = f64::from(expected) * PI;
                    assert!((f64::from(light[0]) / expected - 1.0).abs() < 2e-3, "sheet {number} {side:?}: {light:?}");
                }
            }
            for (theta_o, value) in [(60.0, REFLECTED), (89.0, REFLECTED), (91.0, TRANSMITTED), (120.0, TRANSMITTED)] {
                let wo = Direction::from_degrees(theta_o, 200.0);
                let pdf = material.pdf(&[], Some(wi), wo, None::<u8>).unwrap();
                let weight = f64::from(value) * wo.cos_theta().abs() / pdf;
                assert!(pdf > 0.0 && weight < 1.6 * PI * f64::from(REFLECTED), "sheet {number} {theta_o}: {weight}");
            }
        }
    }
}
