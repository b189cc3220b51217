//! Tests of grids of angles: promises hold at the stated samples, with any repeated slices, whole and by incoming
//! entry.

use super::tests::{hurt, index, settings, wavelengths};
use super::*;
use crate::codec::{ChunkKind, CodecError, Container, write_container};
use crate::domain::{
    Axis, AzimuthExtent, Azimuths, Direction, DirectionGrid, ErrorReport, Frame, Measurement, Quantity, Sampling,
    Silent, Tensor,
};
use crate::numeric::cases::one_in;
use crate::numeric::random::half_open;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

fn every(step: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| i as f64 * step).collect()
}

fn grid(frame: Frame, polar: Vec<f64>, azimuths: Option<(Vec<f64>, AzimuthExtent)>) -> Axis {
    let azimuths = azimuths.map(|(angles, extent)| Azimuths { angles, extent });
    Axis::Grid(DirectionGrid::new(frame, polar, azimuths).unwrap())
}

/// Test measurement: a lobe over the angles of all axes, with some noise.
fn measured(quantity: Quantity, axes: &[Axis], noise: f64) -> Measurement {
    let lengths: Vec<usize> = axes.iter().map(Axis::len).collect();
    let mut state = 5_u64;
    let samples = (0..lengths.iter().product()).map(|flat: usize| {
        let (mut rest, mut log) = (flat, 0.0);
        for (axis, n) in axes.iter().zip(&lengths).rev() {
            let i = rest % n;
            rest /= n;
            log += match axis {
                Axis::Grid(grid) => {
                    let [x, y, z] = grid.direction(i).xyz();
                    2.0 * (0.6 * x + 0.2 * y + 0.5 * z.abs()) + 1.0 / (1.1 - 0.5 * x - 0.4 * z)
                }
                Axis::Elevation(values) => 0.01 * values[i],
                _ => 0.4 * libm::sin(3.0 * i as f64 / *n as f64),
            };
        }
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let random = (state >> 40) as f64 / 16_777_216.0 - 0.5;
        (libm::exp(log) * (1.0 + noise * random)) as f32
    });
    let tensor = Tensor::new(axes.to_vec(), samples.collect()).unwrap();
    Measurement::new(quantity, quantity.default_unit(), Sampling::Point, tensor).unwrap()
}

fn with_samples(m: &Measurement, of: impl Fn(&[f32]) -> Vec<f32>) -> Measurement {
    let tensor = Tensor::new(m.tensor.axes().to_vec(), of(m.tensor.samples())).unwrap();
    Measurement { tensor, ..m.clone() }
}

/// Makes some samples zero, negative or masked, but none at a pole, where the values of all azimuths are those of one
/// direction.
fn hurt_off_poles(m: &Measurement) -> Measurement {
    let axes = m.tensor.axes();
    let hurt = hurt(m.clone()).tensor.into_samples();
    let is_at_pole = |flat: usize| {
        let mut rest = flat;
        axes.iter().rev().any(|axis| {
            let entry = rest % axis.len();
            rest /= axis.len();
            matches!(axis, Axis::Grid(grid) if grid.is_pole(entry / grid.shape()[1]))
        })
    };
    with_samples(m, |s| (0..s.len()).map(|i| if is_at_pole(i) { s[i] } else { hurt[i] }).collect())
}

fn lamp(noise: f64) -> Measurement {
    let axis = grid(Frame::TypeC, every(5.0, 37), Some((every(15.0, 25), AzimuthExtent::Closed)));
    let m = measured(Quantity::Edf, &[axis], noise);
    // The seam is stated twice; nadir has one value, the other pole has several.
    with_samples(&m, |s| {
        (0..s.len()).map(|i| if i < 25 { s[0] } else { s[if i % 25 == 24 { i - 24 } else { i }] }).collect()
    })
}

/// Test BRDF: a gloss lobe on a diffuse base, narrower in the x direction than in the y direction by the square root of
/// `stretch`.
fn glossy(axes: &[Axis], stretch: f64) -> Measurement {
    let wi = |i: usize| match &axes[0] {
        Axis::Elevation(degrees) => Direction::from_degrees(degrees[i], 0.0).xyz(),
        Axis::Grid(grid) => grid.direction(i).xyz(),
        _ => unreachable!("no incoming directions"),
    };
    let Axis::Grid(outgoing) = &axes[1] else { unreachable!("no outgoing grid") };
    let lambdas = axes.get(2).map_or(1, Axis::len);
    let sample = |flat: usize| {
        let (pair, lambda) = (flat / lambdas, flat % lambdas);
        let (wi, wo) = (wi(pair / outgoing.len()), outgoing.direction(pair % outgoing.len()).xyz());
        let h = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
        let slope = (stretch * h[0] * h[0] + h[1] * h[1]) / (h[2] * h[2] + 1e-6);
        (0.2 + 0.1 * lambda as f64 + 3.0 / ((1.0 + 40.0 * slope) * (1.0 + 40.0 * slope))) as f32
    };
    let samples = (0..axes.iter().map(Axis::len).product()).map(sample).collect();
    let tensor = Tensor::new(axes.to_vec(), samples).unwrap();
    Measurement::new(Quantity::Brdf, Quantity::Brdf.default_unit(), Sampling::Point, tensor).unwrap()
}

/// Test materials whose lobes are coded as the residual of a model, with the code of the model: 1 isotropic, 2
/// anisotropic.
fn modelled() -> Vec<(Measurement, u8)> {
    let half = Some((every(15.0, 13), AzimuthExtent::Mirrored));
    let circle = |count: usize| Some((every(360.0 / count as f64, count), AzimuthExtent::Circle));
    let elevations = Axis::Elevation(every(15.0, 7));
    let incoming = grid(Frame::Surface, every(25.0, 4), circle(6));
    vec![
        (glossy(&[elevations, grid(Frame::Surface, every(10.0, 10), half), wavelengths(5)], 1.0), 1),
        (glossy(&[incoming, grid(Frame::Surface, every(10.0, 9), circle(24))], 0.2), 2),
    ]
}

/// Test BRDFs that are a microfacet model but for a colour and some noise, with an interpolation that states the model.
/// In the last one pairs of incoming directions have equal samples although the model differs between them, so that one
/// must not stand for the other.
fn polished() -> Vec<(Measurement, Between)> {
    let between = |roughness| {
        let divisor = Divisor::Model { roughness, reflectance: 0.05, base: 0.125 }.stated();
        Between { divisor, cubic: true, retro: false }
    };
    let polar = || every(7.5, 12);
    let half = Some((every(15.0, 13), AzimuthExtent::Mirrored));
    let circle = |count: usize| Some((every(360.0 / count as f64, count), AzimuthExtent::Circle));
    let closed = Some((every(30.0, 13), AzimuthExtent::Closed));
    let incoming = grid(Frame::Surface, vec![0.0, 35.0, 60.0], circle(4));
    let elevations = Axis::Elevation(every(15.0, 6));
    let cases = [
        (vec![elevations.clone(), grid(Frame::Surface, polar(), half.clone()), wavelengths(4)], 0.125),
        (vec![incoming, grid(Frame::Surface, every(10.0, 9), closed)], 0.25),
        (vec![index(2), elevations.clone(), grid(Frame::Surface, polar(), half)], 0.125),
        (vec![elevations, grid(Frame::Surface, polar(), circle(24))], 0.125),
    ];
    let cases = cases.into_iter().enumerate().map(|(case, (axes, roughness))| {
        let mut directions = axes.iter().filter(|axis| matches!(axis, Axis::Elevation(_) | Axis::Grid(_)));
        let (from, to) = (directions.next().unwrap(), directions.next().unwrap());
        let direction = |axis: &Axis, i: usize| match axis {
            Axis::Elevation(degrees) => Direction::from_degrees(degrees[i], 0.0).xyz(),
            Axis::Grid(grid) => grid.direction(i).xyz(),
            _ => unreachable!("no directions"),
        };
        let divided = Divided::by(between(roughness).divisor);
        let lambdas = axes.last().filter(|axis| matches!(axis, Axis::Wavelength(_))).map_or(1, Axis::len);
        let sample = |flat: usize| {
            let pair = flat / lambdas % (from.len() * to.len());
            let incoming = if case == 3 { (pair / to.len()) & !1 } else { pair / to.len() };
            let [wi, wo] = [direction(from, incoming), direction(to, pair % to.len())].map(|d| d.map(|x| x as f32));
            let noise = 0.002 * libm::sin(1e3 * pair as f64 * pair as f64);
            let colour = 1.0 + 0.1 * (flat % lambdas) as f64 + noise;
            (libm::exp(f64::from(divided.one(wi, wo))) * colour) as f32
        };
        let samples = (0..axes.iter().map(Axis::len).product()).map(sample).collect();
        let tensor = Tensor::new(axes.clone(), samples).unwrap();
        let m = Measurement::new(Quantity::Brdf, Quantity::Brdf.default_unit(), Sampling::Point, tensor).unwrap();
        (m, between(roughness))
    });
    cases.collect()
}

fn materials() -> Vec<Measurement> {
    let circle = |count: usize| Some((every(360.0 / count as f64, count), AzimuthExtent::Circle));
    let half = |count: usize| Some((every(180.0 / (count - 1) as f64, count), AzimuthExtent::Mirrored));
    let uneven = vec![0.0, 3.0, 4.0, 10.0, 25.0, 26.0, 50.0, 89.0];
    let surface = |polar, azimuths| grid(Frame::Surface, polar, azimuths);
    let elevations = Axis::Elevation(vec![0.0, 10.0, 20.0, 40.0, 70.0]);
    vec![
        lamp(0.002),
        measured(Quantity::Edf, &[grid(Frame::TypeC, every(5.0, 19), None)], 0.01),
        measured(Quantity::Edf, &[grid(Frame::TypeB, every(10.0, 9), half(7)), wavelengths(21)], 0.01),
        measured(Quantity::Brdf, &[elevations.clone(), surface(uneven.clone(), half(13)), Axis::Rgb], 0.02),
        measured(Quantity::Brdf, &[elevations, surface(uneven, half(5)), wavelengths(40)], 0.01),
        measured(Quantity::Brdf, &[surface(every(20.0, 4), circle(6)), surface(every(15.0, 6), circle(9))], 0.01),
        measured(Quantity::Edf, &[index(3), surface(every(30.0, 4), circle(5)), wavelengths(5)], 0.05),
        measured(Quantity::Edf, &[surface(vec![12.0], None)], 0.0),
    ]
}

fn check(m: &Measurement, settings: &Settings) -> Compressed {
    let file = compress(m, settings, &Silent).unwrap_or_else(|e| panic!("{:?} {settings:?}: {e}", m.tensor.shape()));
    let decoded = decode(&file.bytes).unwrap();
    assert_eq!(decoded.measurement.tensor.axes(), m.tensor.axes());
    let floor = file.summary.floor;
    let errors =
        ErrorReport::at_directions(m.tensor.axes(), m.tensor.samples(), decoded.measurement.tensor.samples(), floor);
    assert_eq!(errors, file.summary.errors);
    assert_eq!(errors.mask_mismatches, 0);
    // Signs are not promised if samples themselves are approximated.
    if !matches!(settings.target, Target::MaxAbsoluteError(_) | Target::RelativeRmse(_)) {
        let largest = m.tensor.samples().iter().fold(0.0_f32, |largest, &s| largest.max(-s));
        for (&s, &found) in m.tensor.samples().iter().zip(decoded.measurement.tensor.samples()) {
            assert!(s != 0.0 || found == 0.0, "{s} {found}");
            let is_bounded = found <= 0.0 && (s - found).abs() <= largest;
            assert!(s >= 0.0 || s.is_nan() || floor > 0.0 || is_bounded, "{s} {found}");
        }
    }
    file
}

#[test]
fn every_target_holds_on_every_grid() {
    for (number, m) in materials().iter().flat_map(|m| [m.clone(), hurt(m.clone())]).enumerate() {
        let targets = [
            (Target::ErL2(0.03), 0.03),
            (Target::ErL1(0.02), 0.02),
            (Target::MaxRelativeError(0.05), 0.05),
            (Target::MaxAbsoluteError(0.01), 0.01),
            (Target::RelativeRmse(0.02), 0.02),
            (Target::Step(0.1), 0.1),
            (Target::Lossless, 0.0),
        ];
        for (target, bound) in one_in(2, (number + number / 2) % 2, targets) {
            let e = check(&m, &settings(target, Policy::Rd)).summary.errors;
            let found = match target {
                Target::ErL1(_) => e.er_l1,
                Target::MaxRelativeError(_) => e.max_relative_error,
                Target::MaxAbsoluteError(_) => e.max_absolute_error,
                Target::RelativeRmse(_) => e.relative_rmse,
                _ => e.er_l2,
            };
            assert!(found <= bound, "{:?} {target:?}: {found}", m.tensor.shape());
        }
    }
}

#[test]
fn a_size_is_kept_and_a_floor_helps() {
    let m = lamp(0.002);
    let file = check(&m, &Settings { metadata: None, ..settings(Target::Bytes(250), Policy::Rd) });
    assert!(file.bytes.len() <= 250 && file.summary.errors.er_l2 < 0.05, "{:?}", file.summary.errors);
    for target in [Target::ErL2(0.01), Target::Bytes(400)] {
        let floored = Settings { floor: Some(0.05), ..settings(target, Policy::Rd) };
        // Negative samples of any size lie below the floor, too.
        let negative =
            with_samples(&m, |s| (0..s.len()).map(|i| if i % 7 == 3 { -0.6 * s[i] } else { s[i] }).collect());
        for m in [hurt(m.clone()), negative] {
            let file = check(&m, &floored);
            assert!(file.summary.errors.max_absolute_error_unscored <= file.summary.floor);
        }
    }
}

#[test]
fn what_lies_near_a_noisy_floor_stays_within_it() {
    let axes = [
        Axis::Elevation(every(15.0, 5)),
        grid(Frame::Surface, every(6.0, 15), Some((every(10.0, 36), AzimuthExtent::Circle))),
    ];
    for noise in [0.3, 1.5] {
        let m = with_samples(&measured(Quantity::Brdf, &axes, noise), |s| {
            s.iter().enumerate().map(|(i, &s)| if i % 97 == 5 { 0.0 } else { s - 0.5 }).collect()
        });
        let largest = m.tensor.range().unwrap().1;
        for (target, share) in [(Target::ErL2(0.05), 2.0), (Target::ErL2(0.01), 5.0), (Target::Bytes(1500), 3.0)] {
            let floored = Settings { floor: Some(f64::from(share / largest)), ..settings(target, Policy::Rd) };
            let file = check(&m, &floored);
            assert!(file.summary.errors.below_floor_samples > 200, "{}", file.summary.errors.below_floor_samples);
            assert!(file.summary.errors.max_absolute_error_unscored <= file.summary.floor);
            let decoded = decode(&file.bytes).unwrap().measurement;
            for (&s, &found) in m.tensor.samples().iter().zip(decoded.tensor.samples()) {
                assert!(if s <= 0.0 { found <= 0.0 } else { found >= 0.0 }, "{s} {found}");
                assert!(s != 0.0 || found == 0.0, "{found}");
            }
        }
    }
}

#[test]
fn what_repeats_costs_little() {
    let m = lamp(0.1);
    let bytes = |m: &Measurement| check(m, &settings(Target::ErL2(0.01), Policy::Rd)).bytes.len();
    let plain = bytes(&m);
    // Every second slice repeats the one before it.
    let doubled = with_samples(&m, |s| (0..s.len()).map(|i| s[i / 25 * 25 + (i % 25 / 2 * 2)]).collect());
    assert!(bytes(&doubled) < plain * 3 / 4, "{plain}");
    // Equal at all azimuths.
    let symmetric = with_samples(&m, |s| (0..s.len()).map(|i| s[i / 25 * 25]).collect());
    assert!(bytes(&symmetric) < plain / 3, "{plain}");
}

#[test]
fn many_noisy_bands_have_vectors_enough() {
    let elevations = Axis::Elevation(vec![0.0, 20.0, 45.0, 60.0]);
    let azimuths = Some((every(20.0, 10), AzimuthExtent::Mirrored));
    let m =
        measured(Quantity::Brdf, &[elevations, grid(Frame::Surface, every(12.0, 6), azimuths), wavelengths(200)], 0.06);
    let file = check(&m, &Settings { basis: "klt".to_owned(), ..settings(Target::ErL2(0.013), Policy::Rd) });
    assert!(file.summary.errors.er_l2 <= 0.013);
}

/// Test measurement: a leaf of 211 bands under three incidences, with additive noise of 0.003/sr, by which almost 1 %
/// of the samples are negative.
fn leaf() -> Measurement {
    let elevations = Axis::Elevation(vec![0.0, 30.0, 60.0]);
    let azimuths = Some((every(30.0, 7), AzimuthExtent::Mirrored));
    let outgoing = grid(Frame::Surface, every(10.0, 8), azimuths);
    let m = measured(Quantity::Brdf, &[elevations, outgoing, wavelengths(211)], 0.0);
    with_samples(&m, |samples| {
        let mut random = Pcg64Mcg::seed_from_u64(11);
        let edge = |band: usize| 0.006 + 0.12 / (1.0 + libm::exp((40.0 - band as f64) / 2.0));
        let noise = |random: &mut Pcg64Mcg| (0..12).map(|_| half_open(random)).sum::<f64>() - 6.0;
        let leaf = samples.iter().enumerate().map(|(at, &lobe)| {
            let signal = edge(at % 211) * (0.6 + 0.4 * f64::from(lobe).min(10.0) / 10.0);
            (signal + 0.003 * noise(&mut random)) as f32
        });
        leaf.collect()
    })
}

#[test]
fn auto_keeps_more_noisy_bands_than_there_are_vectors() {
    let m = leaf();
    let negative = m.tensor.samples().iter().filter(|&&s| s < 0.0).count() as f64 / m.tensor.len() as f64;
    assert!(negative > 0.002 && negative < 0.02, "{negative}");
    let basis = |basis: &str, target| Settings { basis: basis.to_owned(), ..settings(target, Policy::Rd) };
    let target = Target::ErL2(0.01);
    let refusal = compress(&m, &basis("klt", target), &Silent).map(|file| file.bytes.len()).unwrap_err().to_string();
    assert!(
        refusal.contains("at most 64 spectral vectors") && refusal.contains(", basis auto, or lossless"),
        "{refusal}"
    );
    let named = check(&m, &basis("bior4.4", target));
    let auto = check(&m, &settings(target, Policy::Rd));
    assert!(auto.summary.errors.er_l2 <= 0.01 && auto.bytes.len() <= named.bytes.len(), "{}", auto.summary.basis);
    assert!(!auto.ranking.is_empty() && auto.ranking.iter().all(|ranked| !ranked.basis.contains("klt")));
    // Each incoming entry can be decoded by itself, as with the basis of the data.
    let by_entry = check(&m, &Settings { random_access: true, ..settings(target, Policy::Rd) });
    assert!(by_entry.summary.errors.er_l2 <= 0.01 && decode_block(&by_entry.bytes, 1).is_ok());
    let er_l1 = check(&m, &settings(Target::ErL1(0.005), Policy::Rd));
    assert!(er_l1.summary.errors.er_l1 <= 0.005);
    // An error that no basis keeps is refused with the closest of all, and without a hint at the bases tried.
    let refusal = compress(&m, &settings(Target::ErL2(1e-9), Policy::Rd), &Silent).unwrap_err().to_string();
    assert!(!refusal.contains("auto") && !refusal.contains("klt"), "{refusal}");
}

#[test]
fn incoming_entries_decode_by_themselves() {
    let some = materials().into_iter().enumerate();
    for m in some.flat_map(|(number, m)| one_in(2, number % 2, [m.clone(), hurt(m)])) {
        let axes = m.tensor.axes();
        let at = axes.iter().rposition(|axis| matches!(axis, Axis::Grid(_))).unwrap();
        if at == 0 {
            continue;
        }
        let entries: usize = axes[..at].iter().map(Axis::len).product();
        let own = m.tensor.len() / entries;
        for random_access in [true, false] {
            let settings = Settings { random_access, ..settings(Target::ErL2(0.02), Policy::Rd) };
            let file = check(&m, &settings);
            let whole = decode(&file.bytes).unwrap().measurement.tensor.into_samples();
            for entry in 0..entries {
                let block = decode_block(&file.bytes, entry).unwrap();
                assert_eq!(block.tensor.axes(), &axes[at..]);
                let same = block.tensor.samples().iter().zip(&whole[entry * own..]);
                assert!(same.clone().all(|(a, b)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()), "{entry}");
            }
            assert!(decode_block(&file.bytes, entries).is_err());
        }
    }
}

#[test]
fn lobes_are_coded_behind_a_model_whole_by_entry_and_by_level() {
    for (number, (m, kind)) in modelled().into_iter().enumerate() {
        for random_access in [false, true] {
            let settings = Settings { random_access, ..settings(Target::ErL2(0.01), Policy::Rd) };
            for m in one_in(2, (number + usize::from(random_access)) % 2, [m.clone(), hurt_off_poles(&m)]) {
                let file = check(&m, &settings);
                assert!(file.summary.errors.er_l2 <= 0.01);
                let (_, container) = super::decode::open(&file.bytes).unwrap();
                let form = container.get(ChunkKind::Grid).unwrap().payload[0];
                assert_eq!(form >> 4, kind, "{:?}", m.tensor.shape());
                let whole = decode(&file.bytes).unwrap().measurement.tensor.into_samples();
                let own = whole.len() / m.tensor.axes()[0].len();
                for (entry, whole) in whole.chunks_exact(own).enumerate() {
                    let block = decode_block(&file.bytes, entry).unwrap();
                    let same = block.tensor.samples().iter().zip(whole);
                    assert!(
                        same.clone().all(|(a, b)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()),
                        "{entry}"
                    );
                }
            }
        }
    }
}

/// Bit of the first byte of a grid chunk that says that samples are divided by the function of chunk V.
const DIVIDED: u8 = 128;

fn chunk_of(file: &Compressed, kind: ChunkKind) -> Vec<u8> {
    let (_, container) = super::decode::open(&file.bytes).unwrap();
    container.get(kind).unwrap().payload.to_vec()
}

#[test]
fn what_the_function_between_incidences_has_is_not_coded_again() {
    for (case, (m, between)) in polished().into_iter().enumerate() {
        let ways = [(m.clone(), false), (m.clone(), true), (hurt_off_poles(&m), false)];
        for (m, random_access) in one_in(2, case % 2, ways) {
            let plain = Settings { random_access, ..settings(Target::ErL2(0.005), Policy::Rd) };
            let file = check(&m, &Settings { between, ..plain.clone() });
            assert!(file.summary.errors.er_l2 <= 0.005);
            assert_ne!(chunk_of(&file, ChunkKind::Grid)[0] & DIVIDED, 0, "{case} {random_access}");
            let without = check(&m, &plain);
            assert_eq!(chunk_of(&without, ChunkKind::Grid)[0] & DIVIDED, 0);
            let (bytes, before) = (file.bytes.len(), without.bytes.len());
            assert!(case == 3 || 4 * bytes < 3 * before, "{case} {random_access} {bytes} {before}");
            let whole = decode(&file.bytes).unwrap().measurement.tensor.into_samples();
            let at = m.tensor.axes().iter().rposition(|axis| matches!(axis, Axis::Grid(_))).unwrap();
            let own = m.tensor.axes()[at..].iter().map(Axis::len).product();
            for (entry, whole) in whole.chunks_exact(own).enumerate() {
                let block = decode_block(&file.bytes, entry).unwrap();
                let same = block.tensor.samples().iter().zip(whole);
                assert!(same.clone().all(|(a, b)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()), "{entry}");
            }
            for level in levels(&file.bytes).unwrap() {
                let coarse = decode_level(&file.bytes, level.level).unwrap().measurement;
                assert!(coarse.tensor.samples().iter().all(|sample| !sample.is_infinite()));
                let azimuths = |m: &Measurement| match &m.tensor.axes()[at] {
                    Axis::Grid(grid) => grid.azimuths().is_some(),
                    _ => false,
                };
                assert_eq!(azimuths(&coarse), azimuths(&m), "a level without azimuths");
            }
        }
    }
}

#[test]
fn samples_divided_by_a_function_that_no_chunk_states_are_refused() {
    let (m, between) = polished().swap_remove(0);
    let file = compress(&m, &Settings { between, ..settings(Target::ErL2(0.01), Policy::Rd) }, &Silent).unwrap();
    let kinds = [ChunkKind::Header, ChunkKind::Between, ChunkKind::Grid];
    let mut chunks: Vec<(ChunkKind, Vec<u8>)> = kinds.map(|kind| (kind, chunk_of(&file, kind))).to_vec();
    assert!(decode(&write_container(&chunks)).is_ok());
    // Cubics without a divisor.
    chunks[1].1 = vec![8];
    let refused = decode(&write_container(&chunks)).unwrap_err().to_string();
    assert!(refused.contains("divides its samples by a function"), "{refused}");
}

#[test]
fn any_grid_chunk_decodes_or_is_refused() {
    let (all, modelled, polished) = (materials(), modelled(), polished());
    let of = |m: &Measurement, random_access| (m.clone(), random_access, Between::default());
    let mut some = vec![of(&all[0], false), of(&all[3], true), of(&all[4], false), of(&all[5], true)];
    some.extend([of(&modelled[0].0, false), of(&modelled[1].0, true)]);
    some.extend(polished.into_iter().take(2).zip([false, true]).map(|((m, between), random)| (m, random, between)));
    for (m, random_access, between) in some {
        let m = hurt(m);
        let settings = Settings { random_access, between, ..settings(Target::ErL2(0.1), Policy::Rd) };
        let file = compress(&m, &settings, &Silent).unwrap();
        let (_, container) = super::decode::open(&file.bytes).unwrap();
        let kinds = [
            ChunkKind::Header,
            ChunkKind::Between,
            ChunkKind::Classes,
            ChunkKind::WideClasses,
            ChunkKind::Basis,
            ChunkKind::Grid,
            ChunkKind::Provenance,
        ];
        let chunks: Vec<(ChunkKind, Vec<u8>)> =
            kinds.iter().filter_map(|&kind| Some((kind, container.get(kind)?.payload.to_vec()))).collect();
        assert_eq!(write_container(&chunks), file.bytes);
        let grid = chunks.iter().position(|(kind, _)| *kind == ChunkKind::Grid).unwrap();
        let mut outcomes = [0, 0];
        for at in one_in(14, 0, 0..chunks[grid].1.len().min(120)) {
            for change in [0x01, 0x80, 0xFF] {
                let mut changed = chunks.clone();
                changed[grid].1[at] ^= change;
                let decoded = decode(&write_container(&changed));
                outcomes[usize::from(decoded.is_ok())] += 1;
            }
            let cut = [&chunks[..grid], &[(ChunkKind::Grid, chunks[grid].1[..at].to_vec())], &chunks[grid + 1..]];
            drop(decode(&write_container(&cut.concat())));
        }
        assert!(outcomes[0] > 0 && outcomes[1] > 0, "{outcomes:?}");
        assert!(matches!(Container::read(&file.bytes[..9], |_| Ok(((), vec![]))), Err(CodecError::Truncated { .. })));
    }
}

#[test]
fn any_wide_classes_decode_or_are_refused() {
    // Dark beyond a border that moves with incidence and lane and is as uneven at each, so that wide contexts take
    // fewer bytes.
    let around = (every(15.0, 24), AzimuthExtent::Circle);
    let axes = [Axis::Elevation(every(10.0, 8)), grid(Frame::Surface, every(5.0, 18), Some(around)), Axis::Rgb];
    let m = with_samples(&measured(Quantity::Brdf, &axes, 0.2), |samples| {
        let uneven = |at: usize| at.wrapping_mul(2_654_435_761) >> 7 & 7;
        let is_dark = |i: usize| i / 72 % 18 + uneven(i / 3 % 432) > 10 + i / 1296 / 2 + i % 3;
        samples.iter().enumerate().map(|(i, &s)| if is_dark(i) { 0.0 } else { s }).collect()
    });
    let file = compress(&m, &settings(Target::ErL2(0.1), Policy::Rd), &Silent).unwrap();
    let (header, container) = super::decode::open(&file.bytes).unwrap();
    assert_eq!(header.classes, Some(ChunkKind::WideClasses));
    let kinds = [ChunkKind::Header, ChunkKind::WideClasses, ChunkKind::Basis, ChunkKind::Grid, ChunkKind::Provenance];
    let chunks: Vec<(ChunkKind, Vec<u8>)> =
        kinds.iter().filter_map(|&kind| Some((kind, container.get(kind)?.payload.to_vec()))).collect();
    assert_eq!(write_container(&chunks), file.bytes);
    for at in 0..chunks[1].1.len() {
        let mut changed = chunks.clone();
        changed[1].1[at] ^= 0x55;
        if let Ok(decoded) = decode(&write_container(&changed)) {
            assert_eq!(decoded.measurement.tensor.samples().len(), m.tensor.samples().len());
        }
        let cut = (ChunkKind::WideClasses, chunks[1].1[..at].to_vec());
        drop(decode(&write_container(&[&chunks[..1], &[cut], &chunks[2..]].concat())));
    }
    // Both kinds of classes at once are refused.
    let mut both = chunks.clone();
    both[0].1[2] |= 4;
    both.insert(1, (ChunkKind::Classes, Vec::new()));
    let error = decode(&write_container(&both)).unwrap_err().to_string();
    assert!(error.contains("wide classes chunk, but no grid of angles, or a classes chunk as well"), "{error}");
}

#[test]
fn negative_samples_keep_to_the_largest_of_the_file_in_levels_and_under_a_bound_of_the_light() {
    let half = Some((every(15.0, 13), AzimuthExtent::Mirrored));
    let axes = [Axis::Elevation(every(10.0, 8)), grid(Frame::Surface, every(5.0, 18), half), Axis::Rgb];
    let m = with_samples(&measured(Quantity::Brdf, &axes, 0.2), |samples| {
        let mut size = 1_u32;
        let mut negative = || {
            size = size.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            -3e-4 * (size >> 8) as f32 / (1 << 24) as f32
        };
        samples.iter().enumerate().map(|(i, &s)| if i % 702 > 300 { negative() } else { 1e-3 * s }).collect()
    });
    let least = m.tensor.samples().iter().copied().fold(0.0, f32::min);
    for albedo_error in [None, Some(0.01)] {
        let settings = Settings { albedo_error, ..settings(Target::ErL2(0.01), Policy::Rd) };
        let file = check(&m, &settings);
        let levels = levels(&file.bytes).unwrap();
        assert!(levels.len() > 1);
        for level in levels {
            let coarse = decode_level(&file.bytes, level.level).unwrap().measurement.tensor;
            let found = coarse.samples().iter().copied().fold(0.0, f32::min);
            assert!((least..0.0).contains(&found), "level {}: {found}", level.level);
        }
        let light = file.light.unwrap().largest;
        assert_eq!(light <= 0.01, albedo_error.is_some(), "{light}");
    }
}

#[test]
fn a_level_that_leaves_out_more_halvings_than_there_are_is_refused() {
    let file = include_bytes!("../../../../tests/container/golden/spot.wlm");
    assert!(levels(file).unwrap().len() > 1);
    let (_, container) = super::decode::open(file).unwrap();
    let kinds = [ChunkKind::Header, ChunkKind::Classes, ChunkKind::Grid, ChunkKind::Provenance];
    let mut chunks: Vec<(ChunkKind, Vec<u8>)> =
        kinds.iter().filter_map(|&kind| Some((kind, container.get(kind)?.payload.to_vec()))).collect();
    assert_eq!(write_container(&chunks), file);
    let chunk = &mut chunks.iter_mut().find(|(kind, _)| *kind == ChunkKind::Grid).unwrap().1;
    // Form, number of levels, bytes of the first level in two bytes, number of halvings it leaves out.
    assert!(chunk[2] >= 0x80 && chunk[3] < 0x80);
    chunk[4] = 200;
    let damaged = write_container(&chunks);
    for refused in [decode(&damaged).map(drop), decode_level(&damaged, 0).map(drop)] {
        let message = refused.unwrap_err().to_string();
        assert!(message.contains("leaves out 200 halvings of the angle grid, expected at most all 12"), "{message}");
    }
}

#[test]
fn the_light_of_every_incoming_entry_is_kept() {
    for m in one_in(5, 1, materials().iter().flat_map(|m| [m.clone(), hurt(m.clone())])) {
        let has_incoming = m.tensor.axes().iter().position(|axis| matches!(axis, Axis::Grid(_))) > Some(0);
        for random_access in [false, true] {
            let plain = Settings { random_access, ..settings(Target::ErL2(0.1), Policy::Rd) };
            if random_access && !has_incoming {
                continue;
            }
            let without = check(&m, &plain).light.unwrap();
            for bound in [0.01, 0.002] {
                let wanted = Settings { albedo_error: Some(bound), ..plain.clone() };
                let file = check(&m, &wanted);
                let light = file.light.unwrap();
                assert!(light.largest <= bound && light.rms <= light.largest, "{:?} {light:?}", m.tensor.shape());
                assert!(without.largest >= light.largest || without.largest <= bound);
                if random_access {
                    let whole = decode(&file.bytes).unwrap().measurement.tensor.samples().to_vec();
                    let block = decode_block(&file.bytes, 1).unwrap().tensor.samples().to_vec();
                    let bits = |samples: &[f32]| samples.iter().map(|s| s.to_bits()).collect::<Vec<_>>();
                    assert_eq!(bits(&block), bits(&whole[block.len()..2 * block.len()]));
                }
            }
        }
    }
}

#[test]
fn noise_on_grids_is_found_and_left_out() {
    let azimuths = Some((every(10.0, 36), AzimuthExtent::Circle));
    let half = Some((every(9.0, 21), AzimuthExtent::Mirrored));
    let elevations = Axis::Elevation(every(10.0, 8));
    for noise in [0.03, 0.1] {
        // Uniform noise has a standard deviation of its width divided by √12.
        let sigma = noise / f64::sqrt(12.0);
        for m in [
            measured(Quantity::Edf, &[grid(Frame::TypeC, every(5.0, 37), azimuths.clone())], noise),
            measured(Quantity::Brdf, &[elevations.clone(), grid(Frame::Surface, every(4.0, 23), half.clone())], noise),
            measured(Quantity::Edf, &[grid(Frame::TypeC, every(9.0, 21), azimuths.clone()), wavelengths(31)], noise),
        ] {
            let found = estimate_noise(&m, 0.0).unwrap().relative;
            assert!((0.75..1.15).contains(&(found / sigma)), "{:?} {sigma} {found}", m.tensor.shape());
            let file = check(&m, &settings(Target::Auto, Policy::Rd));
            let er_l2 = file.summary.errors.er_l2;
            assert!((0.6..1.3).contains(&(er_l2 / sigma)), "{:?} {sigma} {er_l2}", m.tensor.shape());
        }
    }
    let smooth = measured(Quantity::Edf, &[grid(Frame::TypeC, every(5.0, 37), azimuths)], 0.0);
    let found = estimate_noise(&smooth, 0.0).map_or(0.0, |noise| noise.relative);
    assert!(found < 2e-3, "{found}");
}
