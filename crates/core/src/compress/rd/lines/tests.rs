//! Tests of the pyramid of pairs: decoding is bit-exact, whatever the lengths, weights and values.

use super::*;
use crate::codec::{Decoder, Encoder};
use crate::numeric::drawn::{any_list, list, number};
use arbtest::arbitrary::{Result, Unstructured};
use arbtest::arbtest;
use std::borrow::Cow;

/// Encodes spectral channels on a grid, halved in the best order of axes; returns the bytes and the decoded values.
fn encoded(grid: &Grid, planes: &[f32], weights: &[u8], step: f64) -> (Vec<u8>, Vec<f32>) {
    let count = planes.len() / grid.lengths().iter().product::<usize>();
    let mut encoder = Encoder::default();
    let order = code_order(&mut encoder, grid, &order_of_halvings(grid, planes, (weights, 1), step).0);
    let pyramid = PairPyramid::new(grid, &order, weights, true);
    let source = pyramid.source(planes, count);
    let (values, _) = pyramid.code(
        &mut encoder,
        Quantiser { step, unit: 1.0, learns: true, dead_zone: 0.0 },
        (count, count),
        Some(Cow::Borrowed(&source)),
        0,
    );
    (encoder.finish(), values)
}

fn decoded(grid: &Grid, bytes: &[u8], (planes, weights): (usize, &[u8]), step: f64, left_out: usize) -> Vec<f32> {
    let mut decoder = Decoder::new(bytes);
    let order = code_order(&mut decoder, grid, &[]);
    let pyramid = PairPyramid::new(grid, &order, weights, true);
    pyramid
        .code(
            &mut decoder,
            Quantiser { step, unit: 1.0, learns: true, dead_zone: 0.0 },
            (planes, planes),
            None,
            left_out,
        )
        .0
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|x| x.to_bits()).collect()
}

/// Test function: a smooth lobe over 24 polar angles and 36 azimuths.
fn lobe() -> (Grid, Vec<f32>) {
    let value = |k: usize| {
        let (i, j) = ((k / 36) as f64, (k % 36) as f64);
        let (theta, phi) = (i * std::f64::consts::FRAC_PI_2 / 23.0, j * std::f64::consts::TAU / 36.0);
        let d = libm::sin(theta) * libm::cos(phi - 0.4) * libm::sin(0.6) + libm::cos(theta) * libm::cos(0.6);
        (3.0 * d + 2.0 / (1.0 + 60.0 * (1.0 - d)) - 0.2 * i / 24.0) as f32
    };
    (Grid::new(&[Line::even(24, false), Line::even(36, true)]), (0..24 * 36).map(value).collect())
}

#[test]
fn a_smooth_lobe_takes_the_bytes_of_the_prototype() {
    // Code lengths of the numerical reference, without the order of halvings and the end of the range coder.
    let (grid, lobe) = lobe();
    for (step, reference, error) in [(0.2, 60.3, 0.0268), (0.035, 147.3, 0.0072), (0.005, 324.9, 0.0013)] {
        let (bytes, values) = encoded(&grid, &lobe, &[1; 24 * 36], step);
        let squares = values.iter().zip(&lobe).map(|(a, b)| f64::from(a - b) * f64::from(a - b)).sum::<f64>();
        let found = (squares / lobe.len() as f64).sqrt();
        assert!((bytes.len() as f64) < reference, "{step}: {} bytes", bytes.len());
        assert!(found < 1.02 * error, "{step}: {found}");
    }
}

#[test]
fn bytes_and_values_stay_as_they_are() {
    let (grid, lobe) = lobe();
    let weights: Vec<u8> = (0..lobe.len()).map(|i| u8::from(i % 7 != 3)).collect();
    let planes: Vec<f32> = lobe.iter().copied().chain(lobe.iter().map(|x| x * x)).collect();
    let (bytes, values) = encoded(&grid, &planes, &weights, 0.03);
    let digest = |bytes: &[u8]| blake3::hash(bytes).to_hex()[..16].to_string();
    let values: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
    assert_eq!(
        (bytes.len(), digest(&bytes), digest(&values)),
        (706, "9762a78c79ed7d22".into(), "1b45b6a4b9dc7a58".into())
    );
}

#[test]
fn errors_of_details_are_errors_of_leaves() {
    let (grid, lobe) = lobe();
    let weights: Vec<u8> = (0..lobe.len()).map(|i| [4, 0, 10, 4, 1][i % 5]).collect();
    let step = 0.05;
    let (_, values) = encoded(&grid, &lobe, &weights, step);
    let order = order_of_halvings(&grid, &lobe, (&weights, 1), step).0;
    let pyramid = PairPyramid::new(&grid, &order, &weights, true);
    let [wanted, found] = [&lobe, &values].map(|planes| {
        let mut details = Vec::new();
        let mut all: Vec<f64> = planes.iter().map(|&x| f64::from(x)).collect();
        for (level, halving) in pyramid.halvings().all().iter().enumerate() {
            let at = (halving.children, halving.axis);
            super::pairs::halve(&mut all, &pyramid.halvings().weights_of((0, 1), level), at, |_, detail, weight| {
                details.push(weight.sqrt() * detail);
            });
        }
        let root = f64::from(pyramid.halvings().weight_of_all((0, 1))).sqrt() * all[0];
        details.push(root);
        details
    });
    let by_details: f64 = wanted.iter().zip(&found).map(|(a, b)| (a - b) * (a - b)).sum();
    let leaves = lobe.iter().zip(&values).zip(&weights);
    let by_leaves: f64 = leaves.map(|((a, b), w)| f64::from(*w) * f64::from(a - b) * f64::from(a - b)).sum();
    assert!((by_details / by_leaves - 1.0).abs() < 1e-4, "{by_details} {by_leaves}");
    // No detail is off by more than about half a step.
    assert!(wanted.iter().zip(&found).all(|(a, b)| (a - b).abs() < 1.01 * step));
}

#[test]
fn coarser_levels_are_means_of_blocks() {
    let (grid, lobe) = lobe();
    let weights = [1; 24 * 36];
    let (bytes, values) = encoded(&grid, &lobe, &weights, 0.01);
    let order = code_order(&mut Decoder::new(&bytes), &grid, &[]);
    let pyramid = PairPyramid::new(&grid, &order, &weights, true);
    for left_out in 0..=order.len() + 1 {
        let coarse = decoded(&grid, &bytes, (1, &weights), 0.01, left_out);
        let mut means: Vec<f64> = values.iter().map(|&x| f64::from(x)).collect();
        for (level, halving) in pyramid.halvings().all().iter().enumerate().take(left_out) {
            let at = (halving.children, halving.axis);
            super::pairs::halve(&mut means, &pyramid.halvings().weights_of((0, 1), level), at, |_, _, _| {});
        }
        assert_eq!(coarse.len(), means.len());
        assert!(coarse.iter().zip(&means).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-5), "{left_out}");
    }
}

#[test]
fn samples_without_weight_cost_nothing() {
    let (grid, lobe) = lobe();
    let (bytes, values) = encoded(&grid, &lobe, &[0; 24 * 36], 0.01);
    assert!(bytes.len() <= 2 && values.iter().all(|&x| x == 0.0));
    let mut weights = [1; 24 * 36];
    weights[36..72].fill(0);
    let mut other = lobe.clone();
    other[36..72].fill(1e9);
    assert_eq!(encoded(&grid, &lobe, &weights, 0.01).0, encoded(&grid, &other, &weights, 0.01).0);
}

fn grid(u: &mut Unstructured<'_>) -> Result<Grid> {
    let lines = list(u, 0..=4, |u| {
        let mut at = 0.0;
        let positions = list(u, 1..=9, |u| {
            at += number(u, 0.01..3.0)?;
            Ok(at)
        })?;
        let circle: bool = u.arbitrary()?;
        Ok(Line { period: circle.then_some(at - positions[0] + 0.5), positions })
    });
    Ok(Grid::new(&lines?))
}

#[test]
fn decoders_have_what_encoders_say() {
    arbtest(|u| {
        let (grid, planes, own_weights) = (grid(u)?, u.int_in_range(1..=3)?, u.arbitrary()?);
        let scale = *u.choose(&[0.0_f32, 1e-30, 1e-3, 1.0, 50.0, 1e15, 1e30])?;
        let step = *u.choose(&[1e-6_f64, 0.01, 0.3, 100.0])?;
        let mut state: u64 = u.arbitrary()?;
        let leaves = grid.lengths().iter().product::<usize>();
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / 16_777_216.0
        };
        let values: Vec<f32> = (0..planes * leaves).map(|_| scale * (next() - 0.5)).collect();
        let sets = if own_weights { planes } else { 1 };
        let weights: Vec<u8> = (0..sets * leaves).map(|_| (4.0 * next()) as u8).collect();
        let (bytes, had) = encoded(&grid, &values, &weights, step);
        let found = decoded(&grid, &bytes, (planes, &weights), step, 0);
        assert_eq!(bits(&found), bits(&had));
        assert!(found.iter().all(|x| x.is_finite()));
        Ok(())
    })
    .budget_ms(1000);
}

#[test]
fn any_bytes_decode_to_something() {
    arbtest(|u| {
        let (grid, bytes) = (grid(u)?, any_list::<u8>(u, 0..=599)?);
        let step = *u.choose(&[1e-30_f64, 0.01, 1e30])?;
        let leaves = grid.lengths().iter().product::<usize>();
        let found = decoded(&grid, &bytes, (3, &vec![1; leaves]), step, 0);
        assert_eq!(found.len(), 3 * leaves);
        Ok(())
    })
    .budget_ms(500);
}
