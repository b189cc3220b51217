//! Materials with samples on a grid of angles: values, batches, samples, densities, integrals and refusals.

use super::*;
use crate::domain::vector::{add, unit};
use crate::domain::{
    Axis, AzimuthExtent, Azimuths, Direction, DirectionGrid, Domain, Frame, Measurement, Outside, Quantity, Sampling,
    Tensor, TriangleMesh, Unit, WavelengthGrid,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

fn every(step: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| step * i as f64).collect()
}

fn grid(frame: Frame, polar: Vec<f64>, azimuths: Option<(Vec<f64>, AzimuthExtent)>) -> DirectionGrid {
    let azimuths = azimuths.map(|(angles, extent)| Azimuths { angles, extent });
    DirectionGrid::new(frame, polar, azimuths).unwrap()
}

/// Lobe about the mirror direction over a coloured base.
fn gloss(wi: Direction, wo: Direction, lambda: usize) -> f32 {
    let h = unit(add(wi.xyz(), wo.xyz()));
    (0.05 + 0.02 * lambda as f64 + 2.0 * libm::exp(-40.0 * (1.0 - h[2]))) as f32
}

fn brdf(incoming: Axis, wis: &[Direction]) -> Material {
    let outgoing = grid(Frame::Surface, every(6.0, 16), Some((every(12.0, 16), AzimuthExtent::Mirrored)));
    let outgoing = if matches!(incoming, Axis::Grid(_)) {
        grid(Frame::Surface, every(6.0, 16), Some((every(12.0, 30), AzimuthExtent::Circle)))
    } else {
        outgoing
    };
    let samples = wis.iter().flat_map(|&wi| {
        let outgoing = &outgoing;
        (0..outgoing.len()).flat_map(move |o| (0..3).map(move |l| gloss(wi, outgoing.direction(o), l)))
    });
    let samples = samples.collect();
    let lambda = Axis::Wavelength(WavelengthGrid::even(400.0, 100.0, 3).unwrap());
    let tensor = Tensor::new(vec![incoming, Axis::Grid(outgoing), lambda], samples).unwrap();
    Material::of(Measurement::new(Quantity::Brdf, Unit::PerSteradian, Sampling::Point, tensor).unwrap()).unwrap()
}

fn isotropic() -> Material {
    let elevations = every(10.0, 8);
    let wis: Vec<Direction> = elevations.iter().map(|&theta| Direction::from_degrees(theta, 0.0)).collect();
    brdf(Axis::Elevation(elevations), &wis)
}

fn anisotropic() -> Material {
    let incoming = grid(Frame::Surface, every(15.0, 5), Some((every(45.0, 8), AzimuthExtent::Circle)));
    let wis: Vec<Direction> = (0..incoming.len()).map(|i| incoming.direction(i)).collect();
    brdf(Axis::Grid(incoming), &wis)
}

fn lamp() -> Material {
    let grid = grid(Frame::TypeC, every(5.0, 19), Some((every(22.5, 5), AzimuthExtent::Quadrant)));
    let samples = (0..grid.len()).map(|i| {
        let [x, _, z] = grid.direction(i).xyz();
        (100.0 * libm::exp(-3.0 * (1.0 + z)) * (1.0 + 0.5 * x * x)) as f32
    });
    let samples = samples.collect();
    let tensor = Tensor::new(vec![Axis::Grid(grid.with_outside(Outside::Dark))], samples).unwrap();
    Material::of(Measurement::new(Quantity::Edf, Unit::Candela, Sampling::Point, tensor).unwrap()).unwrap()
}

/// Random pairs of directions above the horizon to test evaluation: incoming directions up to 58° from the normal,
/// outgoing ones up to 89°, at any azimuth.
fn pairs(count: usize) -> (Vec<Direction>, Vec<Direction>) {
    let mut rng = Pcg64Mcg::seed_from_u64(11);
    let mut direction = |most: f64| Direction::from_degrees(most * rng.random::<f64>(), 360.0 * rng.random::<f64>());
    ((0..count).map(|_| direction(58.0)).collect(), (0..count).map(|_| direction(89.0)).collect())
}

#[test]
fn the_function_is_near_that_which_was_sampled() {
    for material in [isotropic(), anisotropic()] {
        let (wis, wos) = pairs(300);
        let mut worst = 0.0_f32;
        for (&wi, &wo) in wis.iter().zip(&wos) {
            let mut found = [0.0; 3];
            material
                .evaluate(Place { index: &[], wi: Some(wi), wo: Some(wo) }, Interpolation::Smooth, &mut found)
                .unwrap();
            for (lambda, value) in found.into_iter().enumerate() {
                worst = worst.max((value / gloss(wi, wo, lambda) - 1.0).abs());
            }
        }
        assert!(worst < 0.12, "{worst}");
        assert!(matches!(material.report().alignment, Alignment::HalfVector | Alignment::TurnedHalfVector));
    }
}

#[test]
fn batches_chosen_wavelengths_and_sums_are_those_of_single_calls() {
    for material in [isotropic(), anisotropic()] {
        let (wi, wo) = pairs(60);
        let pairs = Pairs { index: &[], wi: Some(Directions::of(&wi)), wo: Some(Directions::of(&wo)) };
        let mut all = vec![0.0; 180];
        material.spectra(pairs, Interpolation::Smooth, &mut all).unwrap();
        let mut parallel = vec![0.0; 180];
        material.par_spectra(pairs, Interpolation::Smooth, &mut parallel).unwrap();
        assert_eq!(all, parallel);
        let chosen = material.choose(&[400.0, 550.0], Beyond::Masked).unwrap();
        for (i, row) in all.chunks_exact(3).enumerate() {
            let place = Place { index: &[], wi: Some(wi[i]), wo: Some(wo[i]) };
            let mut one = [0.0; 3];
            material.evaluate(place, Interpolation::Smooth, &mut one).unwrap();
            assert_eq!(row, one);
            let [a, b, ..] = chosen.at(place, Interpolation::Smooth).unwrap();
            assert!(a == one[0] && (b - 0.5 * (one[1] + one[2])).abs() < 1e-5 * b);
            let sum = material.weighted(place, Interpolation::Smooth, &[1.0, 0.0, 2.0]).unwrap();
            assert!((sum - one[0] - 2.0 * one[2]).abs() < 1e-5 * sum);
        }
    }
}

/// Materials to test interpolation where samples are 0 or masked, which has no fast path: luminaires over the full
/// circle and over a mirrored sector, and BRDFs, one with negative samples.
fn with_holes() -> Vec<Material> {
    let of = |quantity, unit, axes: Vec<Axis>, least: f32| {
        let count = axes.iter().map(Axis::len).product();
        let samples = (0..count).map(|i: usize| match i.wrapping_mul(2_654_435_761) >> 9 & 31 {
            0..3 if least >= 0.0 => 0.0,
            3 => f32::NAN,
            k => k as f32 * 0.1 + least,
        });
        let tensor = Tensor::new(axes, samples.collect()).unwrap();
        Material::of(Measurement::new(quantity, unit, Sampling::Point, tensor).unwrap()).unwrap()
    };
    let closed = || (every(30.0, 13), AzimuthExtent::Closed);
    let lamp = || grid(Frame::TypeC, every(7.5, 17), Some(closed())).with_outside(Outside::Dark);
    let lateral = grid(Frame::TypeB, every(9.0, 9), Some((vec![-50.0, -20.0, 0.0, 35.0], AzimuthExtent::Sector)));
    let upper = || grid(Frame::Surface, every(6.0, 15), Some((every(12.0, 16), AzimuthExtent::Mirrored)));
    let elevations = || Axis::Elevation(every(13.0, 6));
    let around = grid(Frame::Surface, every(30.0, 4), Some((every(60.0, 6), AzimuthExtent::Circle)));
    let per_steradian = Unit::PerSteradian;
    vec![
        of(Quantity::Edf, Unit::Candela, vec![Axis::Grid(lamp())], 0.0),
        of(Quantity::Edf, Unit::Candela, vec![Axis::Grid(lamp())], 0.0).with_straight_lines(0.3),
        of(Quantity::Edf, Unit::Candela, vec![Axis::Grid(lamp())], 0.0).with_straight_lines(1.0),
        of(Quantity::Edf, Unit::Candela, vec![Axis::Grid(lateral.mirrored().unwrap()), Axis::Rgb], 0.0),
        of(Quantity::Brdf, per_steradian, vec![elevations(), Axis::Grid(upper()), Axis::Rgb], 0.0),
        of(Quantity::Brdf, per_steradian, vec![elevations(), Axis::Grid(upper()), Axis::Rgb], -0.7),
        of(Quantity::Brdf, per_steradian, vec![Axis::Grid(around), Axis::Grid(upper()), Axis::Rgb], 0.0),
    ]
}

#[test]
fn batches_have_the_bits_of_single_calls_where_samples_are_dark_masked_or_negative() {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    // On stated directions, at poles and seams, and anywhere.
    let mut directions = |most: f64| -> Vec<Direction> {
        let any = (0..300).map(|_| Direction::from_degrees(most * rng.random::<f64>(), 360.0 * rng.random::<f64>()));
        let any: Vec<Direction> = any.collect();
        let stated =
            (0..130).map(|i| Direction::from_degrees(most / 12.0 * f64::from(i % 13), 30.0 * f64::from(i % 12)));
        stated.chain(any).collect()
    };
    let (wi, wo) = (directions(78.0), directions(180.0));
    for (number, material) in with_holes().into_iter().enumerate() {
        let has_incoming = material.quantity() == Quantity::Brdf;
        let pairs = Pairs { index: &[], wi: has_incoming.then(|| Directions::of(&wi)), wo: Some(Directions::of(&wo)) };
        let mut all = vec![0.0; wo.len() * material.lambdas()];
        material.spectra(pairs, Interpolation::Smooth, &mut all).unwrap();
        let (mut masked, mut lit) = (0, 0);
        for (i, row) in all.chunks_exact(material.lambdas()).enumerate() {
            let place = Place { index: &[], wi: Some(wi[i]).filter(|_| has_incoming), wo: Some(wo[i]) };
            let mut one = vec![0.0; material.lambdas()];
            material.evaluate(place, Interpolation::Smooth, &mut one).unwrap();
            let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(row), bits(&one), "material {number}, direction {i}: {row:?} {one:?}");
            masked += usize::from(row[0].is_nan());
            lit += usize::from(row[0] != 0.0 && !row[0].is_nan());
        }
        assert!(masked > 0 && lit > 50, "material {number}: {masked} masked, {lit} lit");
    }
}

#[test]
fn densities_integrate_to_one_and_weights_have_the_right_mean() {
    for (material, wi) in [
        (isotropic(), Some(Direction::from_degrees(35.0, 77.0))),
        (anisotropic(), Some(Direction::from_degrees(35.0, 77.0))),
        (lamp(), None),
    ] {
        let domain = if wi.is_some() { crate::domain::Domain::Hemisphere } else { crate::domain::Domain::Sphere };
        let mesh = TriangleMesh::new(domain, 7).unwrap();
        let (mut density, mut light) = (0.0, 0.0);
        for i in 0..mesh.len() {
            let wo = mesh.centroid(i);
            let pdf = material.pdf(&[], wi, wo, SampleOptions::default()).unwrap();
            let place = Place { index: &[], wi, wo: Some(wo) };
            let weights = vec![1.0 / material.lambdas() as f32; material.lambdas()];
            let value = f64::from(material.weighted(place, Interpolation::Smooth, &weights).unwrap());
            assert!(value <= 0.0 || pdf > 0.0, "light without density at {wo:?}");
            density += pdf * mesh.solid_angle(i);
            light += value * if wi.is_some() { mesh.projected_solid_angle(i) } else { mesh.solid_angle(i) };
        }
        assert!((density - 1.0).abs() < 5e-3, "{density}");
        let (count, mut rng) = (60_000, Pcg64Mcg::seed_from_u64(3));
        let (mut mean, mut square) = (0.0, 0.0);
        for _ in 0..count {
            let u = [rng.random(), rng.random()];
            if let Some(drawn) = material.sample(&[], wi, u, SampleOptions::default()).unwrap() {
                let pdf = material.pdf(&[], wi, drawn.direction, SampleOptions::default()).unwrap();
                assert!((pdf / drawn.pdf - 1.0).abs() < 1e-6);
                mean += drawn.weight / f64::from(count);
                square += drawn.weight * drawn.weight / f64::from(count);
            }
        }
        let error = 4.0 * ((square - mean * mean) / f64::from(count)).sqrt();
        assert!((mean - light).abs() < error && error < 0.03 * light, "{mean} {light} {error}");
    }
}

#[test]
fn stored_integrals_are_those_of_the_function_at_stated_directions() {
    for (material, wi) in [
        (isotropic(), Some(Direction::from_degrees(30.0, 0.0))),
        (anisotropic(), Some(Direction::from_degrees(30.0, 45.0))),
        (lamp(), None),
    ] {
        let (mut stored, mut light) = (vec![0.0; material.lambdas()], vec![0.0; material.lambdas()]);
        material.albedo(&[], wi, Interpolation::Constant, &mut stored).unwrap();
        material.integrated(Side::Both, &[], wi, Interpolation::Smooth, 2, &mut light).unwrap();
        for (stored, light) in stored.into_iter().zip(light) {
            assert!((stored / light - 1.0).abs() < 0.02, "{stored} {light}");
        }
    }
}

#[test]
fn straight_lines_give_the_zonal_flux_of_the_samples() {
    let flux = |material: &Material| {
        let mut flux = [0.0];
        material.albedo(&[], None, Interpolation::Smooth, &mut flux).unwrap();
        f64::from(flux[0])
    };
    let curved = flux(&lamp());
    let material = lamp().with_straight_lines(1.0);
    let straight = flux(&material);
    // Whatever the interpolation, the flux of a report is zonal.
    let reported = lamp().energy().unwrap().flux.unwrap()[0].luminous.unwrap();
    // Linear in gamma and in C between 19 and 5 angles: by the trapezoids of the samples.
    let stated = material.measurement().unwrap();
    let at = |row: usize, column: usize| f64::from(stated.tensor.samples()[row * 5 + column]);
    let ring =
        |row: usize| (0..4).map(|c| 0.5 * (at(row, c) + at(row, c + 1)) * 22.5_f64.to_radians()).sum::<f64>() * 4.0;
    let zone = |row: usize| {
        let (a, b) = ((5.0 * (row - 1) as f64).to_radians(), (5.0 * row as f64).to_radians());
        let slope = (ring(row) - ring(row - 1)) / (b - a);
        ring(row - 1) * libm::cos(a) - ring(row) * libm::cos(b) + slope * (libm::sin(b) - libm::sin(a))
    };
    let zonal = (1..19).map(zone).sum::<f64>();
    assert!((straight / zonal - 1.0).abs() < 1e-5, "{straight} {zonal}");
    assert!((reported / zonal - 1.0).abs() < 1e-6, "{reported} {zonal}");
    assert!((curved / straight - 1.0).abs() < 5e-3, "{curved} {straight}");
}

#[test]
fn one_by_one_and_many_samples_are_the_same() {
    let material = isotropic();
    let (wi, _) = pairs(40);
    let u: Vec<[f64; 2]> = (0..40).map(|i| [f64::from(i) / 40.0, f64::from(i * 7 % 40) / 40.0]).collect();
    let mut many = vec![None; 40];
    material.samples(&[], Some(Directions::of(&wi)), &u, SampleOptions::default(), &mut many).unwrap();
    let at = material.sampler_at(500.0).unwrap();
    for i in 0..40 {
        let one = material.sample(&[], Some(wi[i]), u[i], SampleOptions::default()).unwrap();
        assert_eq!(one, many[i]);
        let Some(drawn) = at.sample(&[], Some(wi[i]), u[i], SampleOptions::default()).unwrap() else { continue };
        let mut value = [0.0];
        let place = Place { index: &[], wi: Some(wi[i]), wo: Some(drawn.direction) };
        material.at_wavelengths(place, Interpolation::Smooth, Beyond::Masked, &[500.0], &mut value).unwrap();
        let expected = f64::from(value[0]) * drawn.direction.cos_theta() / drawn.pdf;
        assert!((drawn.weight / expected - 1.0).abs() < 1e-5);
    }
}

#[test]
fn reports_are_those_of_the_averages() {
    let material = isotropic();
    let reciprocity = material.reciprocity().unwrap();
    assert!(reciprocity.pairs > 100 && reciprocity.mean < 0.05, "{}", reciprocity.mean);
    let energy = material.energy().unwrap();
    assert!(energy.albedo.is_some());
    let flux = &lamp().energy().unwrap().flux.unwrap()[0];
    assert!(flux.luminous.is_some_and(|lumens| lumens > 100.0));
    assert_eq!(material.reflectance(Side::Both).unwrap().tensor.axes().len(), 2);
}

#[test]
fn stated_samples_come_back_and_the_rest_is_refused() {
    let material = isotropic();
    let measurement = material.measurement().unwrap();
    assert_eq!(measurement.tensor.axes(), material.axes());
    let wo = Direction::from_degrees(42.0, 36.0);
    let mut found = [0.0; 3];
    for how in [Interpolation::Smooth, Interpolation::Constant] {
        let wi = Direction::from_degrees(20.0, 0.0);
        material.evaluate(Place { index: &[], wi: Some(wi), wo: Some(wo) }, how, &mut found).unwrap();
        for (lambda, value) in found.into_iter().enumerate() {
            assert!((value / gloss(wi, wo, lambda) - 1.0).abs() < 1e-5);
        }
    }
    let below = Direction::from_degrees(120.0, 0.0);
    let refused =
        material.evaluate(Place { index: &[], wi: Some(below), wo: Some(wo) }, Interpolation::Smooth, &mut found);
    assert!(matches!(refused, Err(EvaluateError::Query(QueryError::Outside { .. }))));
    let up = Direction::from_degrees(0.0, 0.0);
    material.evaluate(Place { index: &[], wi: Some(up), wo: Some(below) }, Interpolation::Smooth, &mut found).unwrap();
    assert_eq!(found, [0.0; 3]);
    let far = Place { index: &[], wi: Some(Direction::from_degrees(85.0, 10.0)), wo: Some(wo) };
    let refused = anisotropic().evaluate(far, Interpolation::Smooth, &mut found).unwrap_err();
    assert!(matches!(refused, EvaluateError::Query(QueryError::Unmeasured { .. })), "{refused}");
    let missing = lamp().evaluate(Place::default(), Interpolation::Smooth, &mut [0.0]);
    assert!(matches!(missing, Err(EvaluateError::Query(QueryError::MissingDirection { .. }))));
}

/// Phase function of Henyey and Greenstein with mean cosine 0.6, over the angle between `wi` and `wo`, in which forward
/// scattering is π.
fn scattered(between: f64) -> f64 {
    let g = 0.6;
    let cosine = -libm::cos(between);
    (1.0 - g * g) / (4.0 * std::f64::consts::PI * libm::pow(1.0 + g * g - 2.0 * g * cosine, 1.5))
}

fn cloud(steps: usize) -> Material {
    let directions = grid(Frame::Surface, every(180.0 / steps as f64, steps + 1), None);
    let samples = directions.polar().iter().map(|theta| scattered(theta.to_radians()) as f32).collect();
    let tensor = Tensor::new(vec![Axis::Elevation(vec![0.0]), Axis::Grid(directions)], samples).unwrap();
    Material::of(Measurement::new(Quantity::Phase, Unit::PerSteradian, Sampling::Point, tensor).unwrap()).unwrap()
}

#[test]
fn a_list_over_the_scattering_angle_holds_under_light_from_anywhere() {
    let material = cloud(72);
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let mut direction = || Direction::from_degrees(180.0 * rng.random::<f64>(), 360.0 * rng.random::<f64>());
    let mut worst = 0.0_f64;
    for _ in 0..500 {
        let (wi, wo) = (direction(), direction());
        let mut found = [0.0];
        let place = Place { index: &[], wi: Some(wi), wo: Some(wo) };
        material.evaluate(place, Interpolation::Smooth, &mut found).unwrap();
        let wanted = scattered(libm::acos(wi.dot(wo).clamp(-1.0, 1.0)));
        worst = worst.max((f64::from(found[0]) / wanted - 1.0).abs());
    }
    assert!(worst < 2e-3, "{worst}");
    // At a stated angle the value is the sample, wherever light comes from.
    for (wi, wo) in [((0.0, 0.0), (40.0, 77.0)), ((100.0, 30.0), (140.0, 30.0)), ((90.0, 10.0), (90.0, 50.0))] {
        let [wi, wo] = [wi, wo].map(|(theta, phi)| Some(Direction::from_degrees(theta, phi)));
        let mut found = [0.0];
        material.evaluate(Place { index: &[], wi, wo }, Interpolation::Smooth, &mut found).unwrap();
        assert!((f64::from(found[0]) / scattered(40.0_f64.to_radians()) - 1.0).abs() < 1e-5, "{found:?}");
    }
}

#[test]
fn directions_are_drawn_around_light_from_anywhere() {
    let material = cloud(30);
    let mut rng = Pcg64Mcg::seed_from_u64(6);
    for (theta, phi) in [(0.0, 0.0), (75.0, 200.0), (150.0, 20.0)] {
        let wi = Direction::from_degrees(theta, phi);
        let (mut sum, mut cosines, count) = (0.0, 0.0, 4000);
        for _ in 0..count {
            let u = [rng.random::<f64>(), rng.random::<f64>()];
            let Some(drawn) = material.sample(&[], Some(wi), u, None).unwrap() else { continue };
            sum += drawn.weight;
            cosines -= drawn.weight * wi.dot(drawn.direction);
            let pdf = material.pdf(&[], Some(wi), drawn.direction, None).unwrap();
            assert!((pdf / drawn.pdf - 1.0).abs() < 1e-6, "{pdf} {}", drawn.pdf);
        }
        // All sampling functions rotate with the light, and the density integrates to 1.
        let u = [[0.3, 0.6], [0.8, 0.1]];
        let mut batch = [None; 2];
        material.samples(&[], Some(Directions::of(&[wi, wi])), &u, None, &mut batch).unwrap();
        for (u, drawn) in u.into_iter().zip(batch) {
            assert_eq!(drawn, material.sample(&[], Some(wi), u, None).unwrap());
            let (direction, pdf) = material.draw(&[], Some(wi), u, None).unwrap().unwrap();
            assert_eq!(drawn.map(|drawn| (drawn.direction, drawn.pdf)), Some((direction, pdf)));
            let [a, b] = material.invert(&[], Some(wi), direction, None).unwrap().unwrap();
            let again = material.draw(&[], Some(wi), [a, b], None).unwrap().unwrap().0;
            assert!(again.dot(direction) > 1.0 - 1e-9, "{direction:?} {again:?}");
            let (from, to) = ([wi], [direction]);
            let pairs = Pairs { index: &[], wi: Some(Directions::of(&from)), wo: Some(Directions::of(&to)) };
            let mut densities = [0.0];
            material.pdfs(pairs, None, &mut densities).unwrap();
            assert!((densities[0] / pdf - 1.0).abs() < 1e-6);
        }
        let mesh = TriangleMesh::new(Domain::Sphere, 5).unwrap();
        let density = |i| mesh.solid_angle(i) * material.pdf(&[], Some(wi), mesh.centroid(i), None).unwrap();
        let whole: f64 = (0..mesh.len()).map(density).sum();
        assert!((whole - 1.0).abs() < 5e-3, "{theta}: {whole}");
        let mut albedo = [0.0];
        material.albedo(&[], Some(wi), Interpolation::Smooth, &mut albedo).unwrap();
        assert!((albedo[0] - 1.0).abs() < 5e-3, "{theta}: {}", albedo[0]);
        // Energy 1 and mean cosine 0.6: five standard errors of weights that spread by a few per cent.
        let (energy, cosine) = (sum / f64::from(count), cosines / f64::from(count));
        assert!((energy - 1.0).abs() < 0.02 && (cosine - 0.6).abs() < 0.03, "{theta}: {energy} {cosine}");
    }
}

#[test]
fn albedos_of_steps_are_sums_over_their_patches() {
    // 0.5/π up to 30° from the normal and half of that beyond, with steps of 2e-5°; below the surface half of both.
    // Four incoming directions scale it by 1/4 to 1.
    let polar = [0.0, 29.999_99, 30.000_01, 90.0, 90.000_001, 149.999_99, 150.000_01, 180.0];
    let outgoing = grid(Frame::Surface, polar.to_vec(), Some((vec![10.0, 100.0, 190.0, 280.0], AzimuthExtent::Circle)));
    let incoming = grid(Frame::Surface, vec![0.0, 45.0], Some((vec![0.0, 180.0], AzimuthExtent::Circle)));
    let value = |angle: f64, incoming: usize| {
        let side = if angle > 90.0 { 0.25 } else { 0.5 };
        let ring = if angle.min(180.0 - angle) < 30.0 { 1.0 } else { 0.5 };
        (side * ring * (1.0 + incoming as f64) / 4.0 / std::f64::consts::PI) as f32
    };
    let samples = (0..4).flat_map(|i| polar.iter().flat_map(move |&angle| [value(angle, i); 4])).collect();
    let tensor = Tensor::new(vec![Axis::Grid(incoming), Axis::Grid(outgoing)], samples).unwrap();
    let bsdf = Measurement::new(Quantity::Bsdf, Unit::PerSteradian, Sampling::Point, tensor).unwrap();
    let material = Material::of(bsdf).unwrap();
    let report = material.energy().unwrap().albedo.unwrap();
    assert_eq!(report.entries.len(), 4);
    for (i, entry) in report.entries.iter().enumerate() {
        // A quarter of the projected hemisphere lies below 30°.
        let expected = 0.75 * (0.25 + 0.75 * 0.5) * (1.0 + i as f64) / 4.0;
        assert!((entry.value / expected - 1.0).abs() < 1e-6, "{i}: {} {expected}", entry.value);
    }
    let [reflected, transmitted] = [report.reflected, report.transmitted].map(|spot| spot.unwrap().value);
    assert!((reflected / transmitted - 2.0).abs() < 1e-5, "{reflected} {transmitted}");
    assert!((report.entries[3].wi.unwrap()[0] - 45.0).abs() < 1e-9);
}

#[test]
fn values_beyond_the_measured_angles_are_extrapolated() {
    let at = |theta: f64| Some(Direction::from_degrees(theta, 30.0));
    let measured = grid(Frame::Surface, vec![5.0, 40.0, 80.0], Some((every(30.0, 7), AzimuthExtent::Mirrored)));
    for (covers, wo) in [((5.0, 80.0), [false; 4]), ((0.0, 90.0), [true, false, false, true])] {
        let outgoing = measured.clone().covering(covers.0, covers.1).unwrap();
        let samples = vec![1.0; 2 * outgoing.len()];
        let tensor = Tensor::new(vec![Axis::Elevation(vec![10.0, 60.0]), Axis::Grid(outgoing)], samples).unwrap();
        let brdf = Measurement::new(Quantity::Brdf, Unit::PerSteradian, Sampling::Point, tensor).unwrap();
        let material = Material::of(brdf).unwrap();
        // Without a value nothing is extrapolated.
        let found = [3.0, 5.0, 80.0, 85.0].map(|theta| material.is_extrapolated(at(20.0), at(theta)));
        assert_eq!(found, wo, "{covers:?}");
        let incoming = [5.0, 60.0, 61.0].map(|theta| material.is_extrapolated(at(theta), at(40.0)));
        assert_eq!(incoming, [false, false, true]);
    }
    // Beyond the angles of a luminaire its format defines darkness.
    let lamp = lamp();
    assert!([90.0, 120.0, 170.0].iter().all(|theta| !lamp.is_extrapolated(None, at(*theta))));
}

#[test]
fn directions_are_drawn_from_a_table_of_the_mean_however_many_wavelengths_there_are() {
    let lamp = |lambdas: usize| {
        let grid = grid(Frame::TypeC, every(10.0, 19), Some((every(30.0, 12), AzimuthExtent::Circle)));
        let lambda = Axis::Wavelength(WavelengthGrid::even(400.0, 1.0, lambdas).unwrap());
        let value = |i: usize| {
            let up = grid.direction(i / lambdas).cos_theta();
            let share = (i % lambdas) as f64 / lambdas as f64;
            // A masked wavelength does not count in the mean.
            if i % lambdas == 5 { f32::NAN } else { (2.0 - share) as f32 * (1.2 - up) as f32 }
        };
        let samples = (0..grid.len() * lambdas).map(value).collect();
        let tensor = Tensor::new(vec![Axis::Grid(grid.clone()), lambda], samples).unwrap();
        let unit = Unit::WattPerSteradianNanometre;
        Material::of(Measurement::new(Quantity::Edf, unit, Sampling::Point, tensor).unwrap()).unwrap()
    };
    let built = |material: &Material| {
        let before = material.memory();
        material.prepare_sampling().unwrap();
        material.memory() - before
    };
    let (few, many) = (lamp(8), lamp(300));
    assert_eq!(built(&few), built(&many));
    let mut spectrum = vec![0.0; 300];
    for u in [[0.2, 0.3], [0.9, 0.6], [0.5, 0.05]] {
        let drawn = many.sample(&[], None, u, None::<u8>).unwrap().unwrap();
        let place = Place { index: &[], wi: None, wo: Some(drawn.direction) };
        many.evaluate(place, Interpolation::Smooth, &mut spectrum).unwrap();
        let known: Vec<f64> = spectrum.iter().filter(|value| !value.is_nan()).map(|&value| f64::from(value)).collect();
        let mean = known.iter().sum::<f64>() / known.len() as f64;
        assert_eq!(known.len(), 299);
        assert!((drawn.weight * drawn.pdf / mean - 1.0).abs() < 1e-5, "{drawn:?}");
        let pdf = many.pdf(&[], None, drawn.direction, None::<u8>).unwrap();
        assert!((pdf / drawn.pdf - 1.0).abs() < 1e-6, "{pdf} {drawn:?}");
        let one = many.sampler_at(450.0).unwrap();
        assert!(one.sample(&[], None, u, None::<u8>).unwrap().unwrap().weight > 0.0);
    }
}
