//! Tests of narrow lobes beside cells: light, colours, and scans without a lobe.

use super::candidates::candidate;
use super::choose::{Found, best};
use super::drawn::{BASE, Random, spiral};
use super::near::Near;
use super::random_scans::{kept, light, microfacets};
use super::scan::Scan;
use super::shape::{NUMBERS, Shape};
use crate::domain::{Axis, CENTRES, Direction, Lobe, LobeCentre, LobeParameters, Quantity, WavelengthGrid};
use crate::formats::Scattered;
use crate::projection::scattered::incidences::incidences;
use crate::projection::scattered::plan::Plan;
use crate::projection::scattered::rows::Rows;
use crate::projection::scattered::tests::acquisition;
use crate::projection::{AxesRequest, Projected, project};
use std::borrow::Cow;

const ELEVATIONS: [f64; 8] = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0];

/// Test BRDF: a lobe that is `width` degrees wide at half its maximum and reflects 0.3 of the light at each incoming
/// polar angle.
fn truth(centre: LobeCentre, width: f64, tail: f64) -> impl Fn(Direction, Direction) -> f64 + Copy {
    let half = width.to_radians() * if centre == LobeCentre::HalfVector { 0.25 } else { 0.5 };
    let widths = [half, half];
    move |wi: Direction, wo: Direction| {
        let parameters =
            LobeParameters { centre, peak: [0.0; 3], range: [0.0, 2.0], widths, angle: 0.0, tail, colours: vec![] };
        let under = Lobe::new(parameters).unwrap().under(wi).unwrap();
        // Light lost below the horizon is not compensated.
        let whole = std::f64::consts::PI
            * half
            * half
            * if tail == 0.0 { 1.0 / 2_f64.ln() } else { tail / ((2_f64.powf(tail) - 1.0) * (1.0 - tail)) };
        let cos = wi.cos_theta();
        let light = whole * if centre == LobeCentre::HalfVector { 4.0 * cos * cos } else { cos };
        0.3 / light * under.shape(wo)
    }
}

fn found(scattered: &Scattered) -> Option<Found> {
    let rows = Rows::new(Cow::Borrowed(&scattered.values), None, 1);
    let plan = Plan::new(Quantity::Brdf, scattered, &rows, &AxesRequest::default(), 1).unwrap();
    let incidences = incidences(Quantity::Brdf, &plan, true);
    let scan = Scan::new(&plan, &rows, &incidences);
    [LobeCentre::Mirror, LobeCentre::Source]
        .into_iter()
        .filter_map(|centre| best(&scan, &candidate(&scan, centre)?))
        .max_by(|a, b| a.gain.total_cmp(&b.gain))
}

fn projected(scattered: Scattered) -> Projected {
    project(&acquisition(Quantity::Brdf, scattered), &AxesRequest::default()).unwrap()
}

/// Returns the ratio of the albedo of the fitted lobe to the true albedo, under each incoming polar angle.
fn ratios(found: &Found, lobe: impl Fn(Direction, Direction) -> f64) -> Vec<f64> {
    let carried = Lobe::new(found.shape.parameters(found.near.mean_t, found.near.range())).unwrap();
    let of = |&theta: &f64| carried.under(Direction::from_degrees(theta, 0.0)).unwrap().light() / light(&lobe, theta);
    ELEVATIONS.iter().map(of).collect()
}

#[test]
fn the_light_of_a_lobe_is_kept_in_its_coordinate() {
    for (centre, tail) in [(LobeCentre::Mirror, 0.0), (LobeCentre::HalfVector, 0.5)] {
        for (width, seed) in [(1.0, 31), (2.0, 32), (4.0, 33)] {
            let lobe = truth(centre, width, tail);
            let found = found(&spiral(|wi, wo| BASE + lobe(wi, wo), &ELEVATIONS, 0.01, seed)).unwrap();
            assert_eq!(found.shape.centre, centre, "{width}");
            let ratios = ratios(&found, lobe);
            let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
            let (mean_limit, limit) = if width < 3.0 { (0.05, 0.2) } else { (0.03, 0.03) };
            assert!((mean - 1.0).abs() < mean_limit, "{centre:?} {width}: {ratios:?}");
            assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < limit), "{centre:?} {width}: {ratios:?}");
        }
    }
}

#[test]
fn cells_and_lobe_have_all_light() {
    let lobe = truth(LobeCentre::Mirror, 3.0, 0.0);
    let gaussian = move |wi: Direction, wo: Direction| BASE + lobe(wi, wo);
    let gloss = microfacets(3.0, 0.4);
    for (truth, elevations) in [(&gaussian as &dyn Fn(_, _) -> _, &ELEVATIONS[2..6]), (&gloss, &ELEVATIONS[..4])] {
        let projected = projected(spiral(truth, elevations, 0.01, 5));
        let carried = projected.lobe.as_ref().unwrap();
        assert!(carried.is_resolved && carried.warning().is_none(), "{}", carried.note());
        for (found, &theta) in kept(&projected, elevations).iter().zip(elevations) {
            let expected = light(truth, theta);
            assert!((found / expected - 1.0).abs() < 0.02, "{theta}: {found} of {expected}, {}", carried.note());
        }
        // Cells represent the base, and samples of the lobe are not rejected.
        let report = projected.coverage.scatter.as_ref().unwrap();
        assert!(report.rejected.values == 0 && report.lobe > 20, "{report:?}");
        let cells = projected.measurement.tensor.samples().iter().filter(|cell| !cell.is_nan());
        assert!(
            cells.clone().all(|&cell| (f64::from(cell) / BASE - 1.0).abs() < 0.15),
            "{:?}",
            cells.fold(0.0, |m: f32, c| m.max(*c))
        );
    }
}

#[test]
fn a_lobe_that_few_samples_see_is_warned_of() {
    let lobe = truth(LobeCentre::Mirror, 0.5, 0.0);
    let projected = projected(spiral(|wi, wo| BASE + lobe(wi, wo), &ELEVATIONS, 0.01, 8));
    let carried = projected.lobe.unwrap();
    let warning = carried.warning().unwrap();
    assert!(!carried.is_resolved && warning.message.contains("narrower than the scan resolves"), "{warning}");
    let true_light = ELEVATIONS.iter().map(|&theta| light(&lobe, theta)).sum::<f64>() / 8.0;
    assert!(carried.light > 0.0 && carried.light < 2.0 * true_light, "{} of {true_light}", carried.light);
    let [low, high] = carried.light_range.unwrap();
    assert!(low <= true_light && true_light <= high && low < carried.light, "{low} {true_light} {high}");
}

#[test]
fn smooth_scans_and_outliers_have_no_lobe() {
    let gloss = |roughness: f64| {
        move |wi: Direction, wo: Direction| {
            let [[a, b, c], [x, y, z]] = [wi.xyz(), wo.xyz()];
            let h = Direction::new(a + x, b + y, c + z).unwrap();
            let (square, cosine) = (roughness * roughness, h.cos_theta().powi(2));
            BASE + 0.1 * square / (std::f64::consts::PI * (cosine * (square - 1.0) + 1.0).powi(2))
        }
    };
    let cosine = |_: Direction, _: Direction| BASE;
    let blind = |wi: Direction, wo: Direction| if wi.dot(wo) > 0.9962 { f64::NAN } else { BASE };
    for (name, truth) in
        [("cosine", &cosine as &dyn Fn(_, _) -> _), ("0.2", &gloss(0.2)), ("0.5", &gloss(0.5)), ("blind", &blind)]
    {
        for outliers in [false, true] {
            let mut data = spiral(truth, &ELEVATIONS, 0.01, 21);
            let mut random = Random(3);
            if outliers {
                data.values.iter_mut().filter(|_| random.even() < 0.005).for_each(|value| *value *= 10.0);
            }
            assert!(found(&data).is_none(), "{name}, {outliers}");
        }
    }
}

#[test]
fn one_incidence_and_the_direction_back_are_enough() {
    let lobe = truth(LobeCentre::Mirror, 2.5, 0.0);
    let one = found(&spiral(|wi, wo| BASE + lobe(wi, wo), &ELEVATIONS[3..4], 0.01, 4)).unwrap();
    let carried = Lobe::new(one.shape.parameters(one.near.mean_t, one.near.range())).unwrap();
    let off = carried.under(Direction::from_degrees(30.0, 0.0)).unwrap().light() / light(&lobe, 30.0) - 1.0;
    assert!(off.abs() < 0.05, "{off} {carried}");
    let lobe = truth(LobeCentre::Source, 2.0, 0.2);
    let back = found(&spiral(|wi, wo| BASE + lobe(wi, wo), &ELEVATIONS[1..6], 0.01, 4)).unwrap();
    assert_eq!(back.shape.centre, LobeCentre::Source);
    let peak = back.shape.numbers[0];
    assert!(peak.is_finite() && (back.shape.width().to_degrees() - 1.0).abs() < 0.05, "{:?}", back.shape);
}

/// A lobe that falls off about as slowly as a GGX lobe contributes to every sample, so that no sample shows the
/// background beneath it alone.
#[test]
fn colours_of_lobe_and_base_are_told_apart_beneath_a_long_tail() {
    for (tail, missing_under) in [(0.5, None), (0.3, None), (0.5, Some(20.0))] {
        let lobe = truth(LobeCentre::HalfVector, 3.0, tail);
        let mut data = spiral(|wi, wo| BASE + 1e-9 * lobe(wi, wo), &ELEVATIONS[1..6], 0.0, 17);
        data.spectral = Some(Axis::Wavelength(WavelengthGrid::even(400.0, 100.0, 3).unwrap()));
        let mut random = Random(31);
        let pairs: Vec<_> = data.incoming.iter().copied().zip(data.outgoing.iter().copied()).collect();
        data.values.clear();
        for (wi, wo) in pairs {
            let shape = lobe(Direction::from_degrees(wi[0], wi[1]), Direction::from_degrees(wo[0], wo[1]));
            let noise = 1.0 + 0.01 * random.normal();
            let row = [1.5 * BASE + shape, 0.5 * BASE + 0.6 * shape, 0.15 * BASE + 0.4 * shape];
            let is_missing = |band: usize| band == 1 && missing_under == Some(wi[0]);
            let value = |band: usize| if is_missing(band) { f32::NAN } else { (row[band] * noise) as f32 };
            data.values.extend((0..3).map(value));
        }
        let carried = projected(data).lobe.unwrap();
        let colours = carried.lobe.colours();
        for (&found, expected) in colours.iter().zip([1.0, 0.6, 0.4]) {
            assert!((f64::from(found) * (2.0 / 3.0) / expected - 1.0).abs() < 0.02, "{tail}: {colours:?}");
        }
        let wi = Direction::from_degrees(20.0, 0.0);
        let ratio = carried.lobe.under(wi).unwrap().light() * f64::from(colours[0]) / light(&lobe, 20.0);
        assert!((ratio - 1.0).abs() < 0.03, "{tail} {missing_under:?}: {ratio}");
    }
}

#[test]
fn bands_have_their_own_colours() {
    let lobe = truth(LobeCentre::HalfVector, 2.0, 0.3);
    let mut data = spiral(|wi, wo| BASE + 1e-9 * lobe(wi, wo), &ELEVATIONS[1..5], 0.0, 6);
    data.spectral = Some(Axis::Wavelength(WavelengthGrid::even(400.0, 100.0, 3).unwrap()));
    let mut random = Random(9);
    let pairs: Vec<([f64; 2], [f64; 2])> = data.incoming.iter().copied().zip(data.outgoing.iter().copied()).collect();
    let of = |(i, &(wi, wo)): (usize, &([f64; 2], [f64; 2]))| {
        let shape = lobe(Direction::from_degrees(wi[0], wi[1]), Direction::from_degrees(wo[0], wo[1]));
        let noise = 1.0 + 0.01 * random.normal();
        // Every third row lacks the last band.
        let last = if i % 3 == 0 { f64::NAN } else { 2.0 * BASE + 0.2 * shape };
        [BASE + shape, 0.5 * BASE + 0.6 * shape, last].map(|value| (value * noise) as f32)
    };
    data.values = pairs.iter().enumerate().flat_map(of).collect();
    let projected = projected(data);
    let carried = projected.lobe.unwrap();
    let colours = carried.lobe.colours();
    for (&found, expected) in colours.iter().zip([1.0, 0.6, 0.2]) {
        assert!((f64::from(found) / (expected / 0.6) - 1.0).abs() < 0.02, "{colours:?}");
    }
    let (wi, mirror) = (Direction::from_degrees(20.0, 0.0), Direction::from_degrees(20.0, 180.0));
    let ratio = carried.lobe.shape(wi, mirror) * f64::from(colours[0]) / lobe(wi, mirror);
    assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
}

#[test]
fn a_lobe_that_turns_with_the_surface_has_two_widths() {
    let truth = Lobe::new(LobeParameters {
        centre: LobeCentre::HalfVector,
        peak: [3.5, 0.5, 0.0],
        range: [0.0, 1.0],
        widths: [0.01, 0.03],
        angle: 0.6,
        tail: 0.1,
        colours: vec![1.0],
    })
    .unwrap();
    let mut data = spiral(|_, _| BASE, &[0.0], 0.0, 6);
    let outgoing = std::mem::take(&mut data.outgoing);
    (data.isotropic, data.incoming, data.values) = (false, Vec::new(), Vec::new());
    let mut random = Random(12);
    for theta in [5.0, 20.0, 35.0] {
        for phi in [10.0, 80.0, 150.0, 220.0, 290.0] {
            for &wo in outgoing.iter().skip(data.incoming.len() % 2).step_by(2) {
                let shape = truth.shape(Direction::from_degrees(theta, phi), Direction::from_degrees(wo[0], wo[1]));
                data.incoming.push([theta, phi]);
                data.outgoing.push(wo);
                data.values.push(((BASE + shape) * (1.0 + 0.01 * random.normal())) as f32);
            }
        }
    }
    let found = found(&data).unwrap();
    let [a, b] = found.shape.widths();
    assert!((a.min(b) / 0.01 - 1.0).abs() < 0.05 && (a.max(b) / 0.03 - 1.0).abs() < 0.05, "{:?}", found.shape);
    let carried = Lobe::new(found.shape.parameters(found.near.mean_t, found.near.range())).unwrap();
    for (theta, phi) in [(20.0, 80.0), (35.0, 290.0)] {
        let wi = Direction::from_degrees(theta, phi);
        let ratio = carried.under(wi).unwrap().light() / truth.under(wi).unwrap().light();
        assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    }
}

#[test]
fn threads_change_no_bit() {
    let lobe = truth(LobeCentre::HalfVector, 1.0, 0.5);
    let data = spiral(|wi, wo| BASE + lobe(wi, wo), &ELEVATIONS[..3], 0.01, 2);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let found = pool.install(|| projected(data.clone()));
        let bits: Vec<u32> = found.measurement.tensor.samples().iter().map(|cell| cell.to_bits()).collect();
        (bits, found.lobe.unwrap().lobe)
    };
    assert_eq!(with(1), with(4));
}

#[test]
fn the_fitted_function_is_the_lobe_and_has_its_derivatives() {
    let data = spiral(|_, _| BASE, &[25.0, 60.0], 0.0, 6);
    let rows = Rows::new(Cow::Borrowed(&data.values), None, 1);
    let plan = Plan::new(Quantity::Brdf, &data, &rows, &AxesRequest::default(), 1).unwrap();
    let incidences = incidences(Quantity::Brdf, &plan, true);
    let scan = Scan::new(&plan, &rows, &incidences);
    for centre in CENTRES {
        let near = Near::new(&scan, centre, 0.3);
        let stretch = if centre == LobeCentre::HalfVector { 0.3 } else { 0.0 };
        let shape = Shape { centre, numbers: [2.0, 0.7, -0.2, -3.0, 0.2, stretch, 0.4] };
        let lobe = Lobe::new(shape.parameters(near.mean_t, near.range())).unwrap();
        for sample in near.all().step_by(17) {
            let value = shape.prepared().at(sample);
            let (wi, wo) = plan.directions[sample.row as usize];
            let expected = lobe.shape(Direction::from_unit(wi), Direction::from_unit(wo)).ln();
            assert!(
                (value.log - expected).abs() < 1e-3 * (1.0 + expected.abs()),
                "{centre:?} {} {expected}",
                value.log
            );
            for i in 0..NUMBERS {
                if centre != LobeCentre::HalfVector && i > 4 {
                    continue;
                }
                let moved = |by: f64| {
                    let mut numbers = shape.numbers;
                    numbers[i] += by;
                    Shape { centre, numbers }.prepared().at(sample).log
                };
                let slope = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                assert!(
                    (slope - value.slopes[i]).abs() < 0.02 * (1.0 + slope.abs()),
                    "{centre:?} {i}: {slope} {:?}",
                    value.slopes
                );
            }
        }
    }
}
