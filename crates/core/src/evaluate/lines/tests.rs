//! The interpolated function: stated directions, values between them, zeros, masks, negatives, incoming directions.

use super::*;
use crate::domain::{AzimuthExtent, Azimuths, Frame, Outside};

/// A grid without borders.
const OPEN: Borders = Borders { gaps: false, horizon: false };

fn grid(polar: Vec<f64>, azimuths: Option<(Vec<f64>, AzimuthExtent)>) -> DirectionGrid {
    let azimuths = azimuths.map(|(angles, extent)| Azimuths { angles, extent });
    DirectionGrid::new(Frame::Surface, polar, azimuths).unwrap()
}

fn every(step: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| step * i as f64).collect()
}

fn at(lines: &Lines, wi: Direction, wo: Direction) -> Vec<f32> {
    let mut out = vec![0.0; lines.values.lambdas()];
    lines.spectrum(&lines.smooth(0, wi.xyz(), wo.xyz()).unwrap(), &mut out);
    out
}

fn up() -> Direction {
    Direction::from_degrees(0.0, 0.0)
}

#[test]
fn at_stated_directions_it_is_the_sample() {
    let outgoing = grid(every(7.5, 13), Some((every(15.0, 13), AzimuthExtent::Mirrored)));
    let elevations = vec![0.0, 12.0, 30.0, 71.0];
    let (n, lambdas) = (outgoing.len(), 5);
    let samples: Vec<f32> = (0..elevations.len() * n * lambdas)
        .map(|i| match i % 97 {
            3 => 0.0,
            5 => f32::NAN,
            k => 1e-3 * 1.2_f32.powi(k as i32),
        })
        .collect();
    for alignment in [Alignment::None, Alignment::HalfVector] {
        let incoming = Incoming::elevations(&elevations);
        let lines = Lines::new(&samples, lambdas, incoming, Some((&outgoing, OPEN)), (Domain::Hemisphere, alignment));
        for (i, &theta) in elevations.iter().enumerate() {
            // At the pole there is one value for all azimuths.
            for o in 13..n {
                let wo = outgoing.direction(o);
                let found = at(&lines, Direction::from_degrees(theta, 0.0), wo);
                for (value, &sample) in found.iter().zip(&samples[(i * n + o) * lambdas..]) {
                    let is_same =
                        if sample.is_nan() { value.is_nan() } else { (value - sample).abs() <= 1e-5 * sample };
                    assert!(is_same, "{theta} {o}: {value} {sample}");
                }
            }
        }
    }
}

#[test]
fn several_values_of_one_direction_are_their_mean() {
    let outgoing = grid(every(45.0, 3), Some((vec![0.0, 120.0, 240.0, 360.0], AzimuthExtent::Closed)));
    let samples = [1.0, 2.0, 3.0, 6.0, 10.0, 20.0, 30.0, 40.0, 1.0, 1.0, 1.0, 1.0];
    let lines = Lines::new(&samples, 1, Incoming::NONE, Some((&outgoing, OPEN)), (Domain::Sphere, Alignment::None));
    assert!((at(&lines, up(), up())[0] - 3.0).abs() < 1e-5);
    for phi in [0.0, 360.0, -360.0] {
        assert!((at(&lines, up(), Direction::from_degrees(45.0, phi))[0] - 25.0).abs() < 1e-4);
    }
}

#[test]
fn the_pole_of_a_sector_has_a_value() {
    for azimuths in [vec![10.0, 80.0], vec![200.0]] {
        let outgoing = grid(vec![0.0, 40.0], Some((azimuths.clone(), AzimuthExtent::Sector)));
        let samples = vec![2.0; outgoing.len()];
        let lines = Lines::new(&samples, 1, Incoming::NONE, Some((&outgoing, OPEN)), (Domain::Sphere, Alignment::None));
        assert!((at(&lines, up(), up())[0] - 2.0).abs() < 1e-5);
        assert!((at(&lines, up(), Direction::from_degrees(40.0, azimuths[0]))[0] - 2.0).abs() < 1e-5);
        assert!(at(&lines, up(), Direction::from_degrees(40.0, 0.0))[0].is_nan());
    }
}

#[test]
fn between_stated_directions_a_lobe_is_followed() {
    let lobe = |d: Vector, k: f64| libm::exp(-k * (1.0 - d[2])) * (1.0 + 0.3 * d[0]);
    let outgoing = grid(every(5.0, 19), Some((every(10.0, 36), AzimuthExtent::Circle)));
    let samples: Vec<f32> = (0..outgoing.len()).map(|o| lobe(outgoing.direction(o).xyz(), 20.0) as f32).collect();
    let lines = Lines::new(&samples, 1, Incoming::NONE, Some((&outgoing, OPEN)), (Domain::Hemisphere, Alignment::None));
    for (theta, phi) in [(1.0, 222.0), (2.5, 5.0), (17.5, 45.0), (42.5, 185.0), (61.0, 359.0)] {
        let d = Direction::from_degrees(theta, phi);
        let (found, expected) = (f64::from(at(&lines, up(), d)[0]), lobe(d.xyz(), 20.0));
        assert!((found / expected - 1.0).abs() < 2e-3, "{theta} {phi}: {found} {expected}");
    }
}

#[test]
fn a_cliff_is_overshot_by_a_tenth_at_most() {
    let outgoing = grid(every(10.0, 10), None);
    let samples = [1.0, 1.0, 1.0, 1.0, 1.0, 100.0, 100.0, 100.0, 100.0, 100.0];
    let lines = Lines::new(&samples, 1, Incoming::NONE, Some((&outgoing, OPEN)), (Domain::Hemisphere, Alignment::None));
    for step in 0..=900 {
        let found = at(&lines, up(), Direction::from_degrees(f64::from(step) * 0.1, 0.0))[0];
        let room = 100.0_f32.powf(0.1);
        assert!(found >= 0.999 / room && found <= 100.1 * room, "{step} {found}");
        // Between two equal samples the value is constant.
        assert!(step > 400 || (found - 1.0).abs() < 1e-5, "{step} {found}");
    }
}

#[test]
fn zeros_masks_and_negatives_keep_their_sign_and_place() {
    let outgoing = grid(every(10.0, 5), None);
    let between = |samples: [f32; 5], theta: f64| {
        let lines =
            Lines::new(&samples, 1, Incoming::NONE, Some((&outgoing, OPEN)), (Domain::Hemisphere, Alignment::None));
        at(&lines, up(), Direction::from_degrees(theta, 0.0))[0]
    };
    // Light fades towards a zero; beside a mask the value is defined up to the mask.
    assert!((between([4.0, 4.0, 0.0, 4.0, 4.0], 15.0) - 2.0).abs() < 1e-4);
    assert!((between([4.0, 4.0, f32::NAN, 4.0, 4.0], 15.0) - 4.0).abs() < 1e-4);
    assert!(between([4.0, f32::NAN, f32::NAN, 4.0, 4.0], 15.0).is_nan());
    assert_eq!(between([4.0, 0.0, 0.0, 4.0, 4.0], 15.0), 0.0);
    assert!((between([4.0, -2.0, 1.0, 4.0, 4.0], 15.0) + 0.5).abs() < 1e-5);
    assert!((between([4.0, -2.0, 1.0, 4.0, 4.0], 10.0) + 2.0).abs() < 1e-5);
    // Beyond the grid the value is masked or dark.
    assert!(between([4.0; 5], 41.0).is_nan());
    let dark = outgoing.clone().with_outside(Outside::Dark);
    let lines = Lines::new(&[4.0; 5], 1, Incoming::NONE, Some((&dark, OPEN)), (Domain::Hemisphere, Alignment::None));
    assert_eq!(at(&lines, up(), Direction::from_degrees(41.0, 0.0)), [0.0]);
}

#[test]
fn between_incoming_directions_a_lobe_moves() {
    let outgoing = grid(every(3.0, 31), Some((every(6.0, 31), AzimuthExtent::Mirrored)));
    let elevations = every(10.0, 8);
    let lobe = |wi: Vector, wo: Vector| {
        let h = crate::domain::vector::unit(crate::domain::vector::add(wi, wo));
        0.05 + libm::exp(-60.0 * (1.0 - h[2]))
    };
    let samples: Vec<f32> = elevations
        .iter()
        .flat_map(|&theta| {
            let wi = Direction::from_degrees(theta, 0.0).xyz();
            (0..outgoing.len()).map(|o| lobe(wi, outgoing.direction(o).xyz()) as f32).collect::<Vec<_>>()
        })
        .collect();
    let worst = |alignment: Alignment| {
        let incoming = Incoming::elevations(&elevations);
        let lines = Lines::new(&samples, 1, incoming, Some((&outgoing, OPEN)), (Domain::Hemisphere, alignment));
        let wi = Direction::from_degrees(35.0, 0.0);
        let near = [(35.0, 180.0), (30.0, 170.0), (42.0, 185.0)];
        near.map(|(theta, phi)| {
            let wo = Direction::from_degrees(theta, phi);
            (f64::from(at(&lines, wi, wo)[0]) / lobe(wi.xyz(), wo.xyz()) - 1.0).abs()
        })
        .into_iter()
        .fold(0.0, f64::max)
    };
    assert!(worst(Alignment::HalfVector) < 5e-3, "{}", worst(Alignment::HalfVector));
    assert!(worst(Alignment::None) > 5.0 * worst(Alignment::HalfVector));
}

#[test]
fn incoming_directions_on_a_grid_meet_at_the_pole() {
    let outgoing = grid(every(30.0, 3), None);
    let incoming = grid(every(40.0, 3), Some((every(90.0, 4), AzimuthExtent::Circle)));
    let samples: Vec<f32> = (0..incoming.len())
        .flat_map(|i| [1.0, 2.0, 3.0].map(|v: f32| v * if i < 4 { i as f32 + 1.0 } else { 10.0 }))
        .collect();
    let sphere = Incoming::grid(&incoming, OPEN);
    let lines = Lines::new(&samples, 1, sphere, Some((&outgoing, OPEN)), (Domain::Hemisphere, Alignment::None));
    let wo = Direction::from_degrees(30.0, 0.0);
    // The mean of 2, 4, 6 and 8.
    assert!((at(&lines, up(), wo)[0] - 5.0).abs() < 1e-5);
    assert!((at(&lines, Direction::from_degrees(40.0, 45.0), wo)[0] - 20.0).abs() < 1e-4);
    let halfway = at(&lines, Direction::from_degrees(20.0, 200.0), wo)[0];
    assert!((halfway - 10.0).abs() < 1e-3, "{halfway}");
    assert!(lines.smooth(0, Direction::from_degrees(85.0, 0.0).xyz(), wo.xyz()).is_none());
    let mut nearest = [0.0];
    lines.spectrum(&lines.nearest(0, Direction::from_degrees(38.0, 46.0).xyz(), wo.xyz()).unwrap(), &mut nearest);
    assert!((nearest[0] - 20.0).abs() < 1e-4);
}

#[test]
fn integrals_are_those_of_functions_and_zonal_on_straight_lines() {
    let full = 4.0 * std::f64::consts::PI;
    for (frame, low) in [(Frame::Surface, 0.0), (Frame::TypeC, 0.0), (Frame::TypeB, -90.0), (Frame::TypeA, -90.0)] {
        for extent in [
            None,
            Some((vec![0.0, 45.0, 90.0], AzimuthExtent::Quadrant)),
            Some((every(30.0, 12), AzimuthExtent::Circle)),
        ] {
            let azimuths = extent.map(|(angles, extent)| Azimuths { angles, extent });
            let polar = (0..=18).map(|i| low + 10.0 * f64::from(i)).collect();
            let grid = DirectionGrid::new(frame, polar, azimuths).unwrap();
            let samples: Vec<f32> = (0..grid.len())
                .map(|i| {
                    let [x, y, z] = grid.direction(i).xyz();
                    // The mean over the sphere is 1 + (a + b + c) / 3.
                    (1.0 + 0.5 * x * x + 0.2 * y * y + 0.3 * z * z) as f32
                })
                .collect();
            let is_round = grid.azimuths().is_none();
            let constant = vec![2.0; grid.len()];
            for (samples, expected) in [(&constant, 2.0), (&samples, 4.0 / 3.0)] {
                if is_round && expected != 2.0 {
                    continue;
                }
                let lines =
                    Lines::new(samples, 1, Incoming::NONE, Some((&grid, OPEN)), (Domain::Sphere, Alignment::None));
                let mut found = [0.0];
                lines.integrate(0, lines.straight(), &mut found);
                assert!((found[0] / full / expected - 1.0).abs() < 2e-3, "{frame} {} {expected}", found[0] / full);
            }
        }
    }
    // A cosine with linear interpolation, interval by interval: the zonal flux that an LM-63 file states.
    let gamma = every(22.5, 5);
    let grid = DirectionGrid::new(Frame::TypeC, gamma.clone(), None).unwrap();
    let samples: Vec<f32> = gamma.iter().map(|g| libm::cos(g.to_radians()) as f32).collect();
    let lines = Lines::new(&samples, 1, Incoming::NONE, Some((&grid, OPEN)), (Domain::Sphere, Alignment::None));
    let mut found = [0.0];
    lines.integrate(0, 1.0, &mut found);
    let zone = |i: usize| {
        let (a, b) = (gamma[i - 1].to_radians(), gamma[i].to_radians());
        let (r, last) = (f64::from(samples[i - 1]), f64::from(samples[i]));
        let slope = (last - r) / (b - a);
        r * libm::cos(a) - last * libm::cos(b) + slope * (libm::sin(b) - libm::sin(a))
    };
    let expected = 2.0 * std::f64::consts::PI * (1..5).map(zone).sum::<f64>();
    assert!((found[0] / expected - 1.0).abs() < 1e-5, "{} {expected}", found[0]);
}

#[test]
fn straight_lines_are_those_between_samples() {
    let outgoing = grid(every(10.0, 3), Some((vec![0.0, 90.0, 180.0, 270.0], AzimuthExtent::Circle)));
    let mut samples: Vec<f32> = vec![3.0; 4];
    samples.extend([1.0, 2.0, 4.0, 8.0]);
    samples.extend([f32::NAN; 4]);
    let lines = Lines::new(&samples, 1, Incoming::NONE, Some((&outgoing, OPEN)), (Domain::Sphere, Alignment::None));
    let straight = lines.with_straight(1.0);
    let value = |theta: f64, phi: f64| at(&straight, up(), Direction::from_degrees(theta, phi))[0];
    assert!((value(10.0, 45.0) - 1.5).abs() < 1e-5);
    assert!((value(5.0, 45.0) - 2.25).abs() < 1e-5);
    assert!((value(10.0, 315.0) - 4.5).abs() < 1e-5);
    assert!((value(15.0, 90.0) - 2.0).abs() < 1e-5);
    assert!(value(20.0, 90.0).is_nan());
    let half = straight.with_straight(0.5);
    let mixed = at(&half, up(), Direction::from_degrees(10.0, 45.0))[0];
    assert!(mixed > 1.2 && mixed < 1.5, "{mixed}");
}
