//! Tests of lobes and outliers: which samples far from their neighbours belong to a lobe.

use super::super::{AxesRequest, ScatterReport, project};
use super::tests::{isotropic, noise, scattered, uniform};
use crate::domain::vector::{Vector, dot};
use crate::domain::{Axis, LobeCentre, WavelengthGrid};
use crate::formats::Acquisition;

const ELEVATIONS: [f64; 6] = [0.0, 12.0, 24.0, 36.0, 48.0, 60.0];
const SAMPLES: usize = 2000;

/// Test BRDF: a constant base, a Gaussian about the mirror direction, `width` degrees wide at half its maximum, and 1 %
/// noise.
fn scan(elevations: &[f64], width: f64) -> Acquisition {
    let mut acquired = isotropic(elevations, &uniform(SAMPLES, 88.0), |[x, y, z]: Vector, wo: Vector| {
        let off = dot([-x, -y, z], wo).clamp(-1.0, 1.0).acos().to_degrees() / width;
        0.1 + 300.0 * (-2.77 * off * off).exp()
    });
    let values = &mut scattered(&mut acquired).values;
    values.iter_mut().enumerate().for_each(|(i, value)| *value *= 1.0 + 0.01 * noise(i) as f32);
    acquired
}

/// Multiplies the `count` samples nearest to one sample of the second incoming polar angle by a factor, to create
/// outliers.
fn spiked(acquired: &mut Acquisition, (first, count): (usize, usize), factor: f32) {
    let directions = uniform(SAMPLES, 88.0);
    let at = |i: usize| crate::domain::Direction::from_degrees(directions[i][0], directions[i][1]);
    let mut order: Vec<usize> = (0..SAMPLES).collect();
    order.sort_by(|&a, &b| at(b).dot(at(first)).total_cmp(&at(a).dot(at(first))));
    let values = &mut scattered(acquired).values;
    let start = if values.len() > SAMPLES { SAMPLES } else { 0 };
    order[..count].iter().for_each(|i| values[start + i] *= factor);
}

fn report(acquired: &Acquisition) -> ScatterReport {
    let request = AxesRequest { outgoing_level: Some(3), ..AxesRequest::default() };
    *project(acquired, &request).unwrap().coverage.scatter.unwrap()
}

#[test]
fn a_lobe_that_all_incidences_show_together_is_not_rejected() {
    // Each incidence has one or two of its samples.
    let found = report(&scan(&ELEVATIONS, 1.5));
    assert!(found.lobe >= 6 && found.isolated.values == 0, "{found:?}");
    // A single incidence has too few of them.
    let found = report(&scan(&ELEVATIONS[2..3], 0.7));
    assert!(found.lobe == 0 && found.rejected.values <= 2, "{found:?}");
}

#[test]
fn a_spike_of_one_incidence_is_no_lobe_beside_others() {
    let smooth = scan(&ELEVATIONS, 1e-3);
    assert_eq!((report(&smooth).lobe, report(&smooth).rejected.values), (0, 0));
    // Two neighbours count as isolated if other incidences are smooth there, and if there is no other incidence.
    for mut acquired in [scan(&ELEVATIONS, 1e-3), scan(&ELEVATIONS[..1], 1e-3)] {
        spiked(&mut acquired, (700, 2), 10.0);
        let found = report(&acquired);
        assert_eq!((found.lobe, found.rejected.values, found.isolated.values), (0, 2, 2), "{found:?}");
    }
    // Single low samples are outliers, too.
    let mut acquired = scan(&ELEVATIONS, 1e-3);
    for first in [100, 500, 900] {
        spiked(&mut acquired, (first, 1), 0.1);
    }
    let found = report(&acquired);
    assert_eq!((found.lobe, found.rejected.values, found.isolated.values), (0, 3, 3), "{found:?}");
}

fn direction([theta, phi]: [f64; 2]) -> Vector {
    crate::domain::Direction::from_degrees(theta, phi).xyz()
}

fn mirror([x, y, z]: Vector) -> Vector {
    [-x, -y, z]
}

/// Returns all samples of a test scan as pairs (number of the incoming polar angle, number of the outgoing direction),
/// the nearest to a lobe centre first. `centre` returns that centre for an incoming direction.
fn nearest(elevations: &[f64], centre: fn(Vector) -> Vector) -> Vec<(usize, usize)> {
    let directions = uniform(SAMPLES, 88.0);
    let far = |&(elevation, i): &(usize, usize)| {
        -dot(direction(directions[i]), centre(direction([elevations[elevation], 0.0])))
    };
    let mut all: Vec<_> =
        (0..elevations.len()).flat_map(|elevation| (0..SAMPLES).map(move |i| (elevation, i))).collect();
    all.sort_by(|a, b| far(a).total_cmp(&far(b)));
    all
}

/// Returns the report of noise and outliers for simulated samples, some of which are multiplied by a factor to create
/// outliers.
fn raised(elevations: &[f64], samples: &[(usize, usize)], factor: f32) -> ScatterReport {
    let mut acquired = scan(elevations, 1e-3);
    let values = &mut scattered(&mut acquired).values;
    for (elevation, i) in samples {
        values[elevation * SAMPLES + i] *= factor;
    }
    report(&acquired)
}

#[test]
fn outliers_nearest_to_a_centre_at_two_incidences_suggest_a_lobe() {
    for (centre, is_back) in [(mirror as fn(Vector) -> Vector, false), (|wi| wi, true)] {
        // Elevations whose two nearest samples belong to one each.
        let apart = |pair: &&[f64]| {
            let order = nearest(pair, centre);
            pair[0] > 0.0 && order[0].0 != order[1].0
        };
        let elevations = ELEVATIONS.windows(2).find(apart).unwrap();
        let found = raised(elevations, &nearest(elevations, centre)[..2], 20.0);
        assert_eq!((found.lobe, found.isolated.values), (0, 2), "{found:?}");
        let lobe = found.unresolved.unwrap();
        assert_eq!((lobe.centre == LobeCentre::Source, lobe.values), (is_back, 2));
    }
}

#[test]
fn two_outliers_suggest_a_lobe_of_a_single_incidence() {
    let one = &ELEVATIONS[2..3];
    let order = nearest(one, mirror);
    let lobe = raised(one, &order[..2], 20.0).unresolved.unwrap();
    assert!(lobe.centre != LobeCentre::Source && lobe.values == 2, "{lobe:?}");
    assert_eq!(raised(one, &order[1..3], 20.0).unresolved, None);
}

#[test]
fn other_outliers_suggest_no_lobe() {
    let two = &ELEVATIONS[2..4];
    let order = nearest(two, mirror);
    let first = order.iter().position(|sample| sample.0 != order[0].0).unwrap() + 1;
    let next = first + order[first..].iter().position(|sample| sample.0 != order[first].0).unwrap();
    let of_one: Vec<_> = order.iter().copied().filter(|sample| sample.0 == 0).take(2).collect();
    let three = &ELEVATIONS[1..4];
    let smooth_between: Vec<_> = nearest(three, mirror).into_iter().filter(|sample| sample.0 != 1).collect();
    for (name, elevations, samples, factor) in [
        ("a single outlier", two, &order[..1], 20.0),
        ("outliers of one incidence", two, &of_one, 20.0),
        ("others are nearer", two, &[order[first], order[next]], 20.0),
        ("low samples", two, &order[..first], 0.05),
        ("an incidence between them is smooth", three, &[smooth_between[2], smooth_between[3]], 20.0),
        ("far from every centre", two, &[order[900], order[901], order[902], order[903]], 20.0),
    ] {
        let found = raised(elevations, samples, factor);
        assert_eq!((found.unresolved, found.rejected.values), (None, samples.len() as u64), "{name}: {found:?}");
    }
}

#[test]
fn bands_that_disagree_are_rejected_within_a_lobe() {
    let mut acquired = scan(&ELEVATIONS, 1.5);
    let of_one = report(&acquired);
    let data = scattered(&mut acquired);
    data.spectral = Some(Axis::Wavelength(WavelengthGrid::even(400.0, 100.0, 3).unwrap()));
    let one = std::mem::take(&mut data.values);
    data.values =
        one.iter().enumerate().flat_map(|(i, v)| [*v, if i % 500 == 77 { 10.0 * v } else { *v }, *v]).collect();
    let found = report(&acquired);
    assert_eq!(found.isolated.values, (one.len() / 500) as u64, "{found:?}");
    assert!(found.lobe >= 2 * of_one.lobe, "{found:?}, of one band {of_one:?}");
}
