//! Values, masks and refusals; samples against their density.

use super::form::Form;
use super::planes::Cell;
use super::{Beyond, Density, DirectionSample, EvaluateError, Interpolation, Material, Place, SampleOptions};
use crate::domain::vector::dot;
use crate::domain::{
    Axis, Direction, Domain, Measurement, Quantity, Sampling, Tensor, TriangleMesh, Unit, WavelengthGrid,
};
use rand::RngExt;
use rand_pcg::Pcg32;

const CONSTANT: SampleOptions = SampleOptions { level: None, density: Density::Uniform, defensive: 0.0 };

pub(super) fn mesh(domain: Domain, level: u8) -> TriangleMesh {
    TriangleMesh::new(domain, level).unwrap()
}

fn triangles(domain: Domain, level: u8) -> Axis {
    Axis::Triangles(mesh(domain, level))
}

fn lambda(count: usize) -> Axis {
    Axis::Wavelength(WavelengthGrid::even(400.0, 10.0, count).unwrap())
}

fn material(quantity: Quantity, axes: Vec<Axis>, value: impl Fn(usize) -> f32) -> Material {
    let n = axes.iter().map(Axis::len).product();
    let tensor = Tensor::new(axes, (0..n).map(value).collect()).unwrap();
    Material::of(Measurement::new(quantity, Unit::Relative, Sampling::Average, tensor).unwrap()).unwrap()
}

/// Rough positive test samples: neighbours differ by up to a factor of 60, some are exactly 0.
fn rough(i: usize) -> f32 {
    let x = (i.wrapping_mul(2_654_435_761) >> 7) % 61;
    if x < 6 { 0.0 } else { x as f32 / 30.0 }
}

fn edf() -> Material {
    material(Quantity::Edf, vec![triangles(Domain::Sphere, 2), lambda(3)], rough)
}

fn brdf() -> Material {
    let axes = vec![triangles(Domain::Hemisphere, 1), triangles(Domain::Hemisphere, 3), lambda(2)];
    material(Quantity::Brdf, axes, rough)
}

fn isotropic() -> Material {
    let axes = vec![Axis::Elevation(vec![0.0, 30.0, 60.0]), triangles(Domain::Hemisphere, 2), lambda(2)];
    material(Quantity::Brdf, axes, rough)
}

fn phase() -> Material {
    material(Quantity::Phase, vec![triangles(Domain::Sphere, 1), triangles(Domain::Sphere, 2)], rough)
}

fn btdf() -> Material {
    let axes = vec![triangles(Domain::Hemisphere, 0), triangles(Domain::Lower, 2), Axis::Rgb];
    material(Quantity::Btdf, axes, rough)
}

fn bsdf() -> Material {
    let axes = vec![triangles(Domain::Sphere, 0), triangles(Domain::Sphere, 1), lambda(5)];
    material(Quantity::Bsdf, axes, rough)
}

fn at(wi: Option<Direction>, wo: Option<Direction>) -> Place<'static> {
    Place { index: &[], wi, wo }
}

/// Stored samples of a material whose spectra cannot be represented by a few spectral coefficients.
fn samples(m: &Material) -> &[f32] {
    let Form::Samples(samples) = m.function().unwrap().form() else { panic!("expected samples") };
    samples.all()
}

fn spectrum(m: &Material, place: Place<'_>, how: Interpolation) -> Vec<f32> {
    let mut out = vec![-1.0; m.lambdas()];
    m.evaluate(place, how, &mut out).unwrap();
    out
}

pub(super) fn angles(theta: f64, phi: f64) -> Direction {
    Direction::from_degrees(theta, phi)
}

fn is_unfit<T: std::fmt::Debug>(result: Result<T, EvaluateError>, start: &str) {
    match result {
        Err(EvaluateError::Query(error)) => assert!(error.to_string().starts_with(start), "{error}"),
        other => panic!("expected a refusal `{start}`, found {other:?}"),
    }
}

#[test]
fn constant_lookup_is_the_row_of_the_triangles() {
    let m = brdf();
    let (incoming, outgoing) = (mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 3));
    for i in 0..16 {
        for o in 0..256 {
            let place = at(Some(incoming.centroid(i)), Some(outgoing.centroid(o)));
            let row = &samples(&m)[(i * 256 + o) * 2..][..2];
            assert_eq!(spectrum(&m, place, Interpolation::Constant), row);
        }
    }
}

#[test]
fn smooth_reproduces_constants_even_between_masks() {
    let axes = || vec![triangles(Domain::Hemisphere, 1), triangles(Domain::Hemisphere, 3), lambda(100)];
    let whole = material(Quantity::Brdf, axes(), |_| 0.25);
    let holes = material(Quantity::Brdf, axes(), |i| if rough(i) < 0.5 { f32::NAN } else { 0.25 });
    let mut rng = Pcg32::new(3, 1);
    for _ in 0..300 {
        let mut direction = || angles(90.0 * rng.random::<f64>(), 360.0 * rng.random::<f64>());
        let place = at(Some(direction()), Some(direction()));
        for m in [&whole, &holes] {
            let found = spectrum(m, place, Interpolation::Smooth);
            assert!(found.iter().all(|v| (v - 0.25).abs() < 1e-6), "{found:?}");
        }
    }
}

#[test]
fn smooth_at_a_vertex_is_the_mean_around_it() {
    let m = edf();
    let sphere = mesh(Domain::Sphere, 2);
    for (i, k) in [(0, 0), (3, 1), (7, 2), (20, 0), (100, 1)] {
        let v = sphere.vertices(i)[k];
        let touches = |j: &usize| {
            sphere.vertices(*j).iter().any(|p| p.iter().zip(v).map(|(a, b)| (a - b).abs()).sum::<f64>() < 1e-12)
        };
        let around: Vec<usize> = (0..sphere.len()).filter(touches).collect();
        let total: f64 = around.iter().map(|&j| sphere.solid_angle(j)).sum();
        let found = spectrum(&m, at(None, Direction::new(v[0], v[1], v[2])), Interpolation::Smooth);
        for (l, value) in found.iter().enumerate() {
            let sample = |j: usize| f64::from(samples(&m)[3 * j + l]);
            let expected = around.iter().map(|&j| sphere.solid_angle(j) * sample(j)).sum::<f64>() / total;
            assert!((f64::from(*value) - expected).abs() < 1e-6, "{value} {expected}");
        }
    }
}

#[test]
fn smooth_is_continuous_and_constant_is_not() {
    // Across an edge in steps of at most 1e-8 rad; the smooth slope is about range / triangle size, 2 / 0.2.
    for m in [edf(), isotropic(), brdf()] {
        let mut largest = [0.0_f32; 2];
        for (which, how) in [Interpolation::Smooth, Interpolation::Constant].into_iter().enumerate() {
            let wi = |t: f64| (m.quantity() == Quantity::Brdf).then(|| angles(20.0 + t, 0.0));
            // Bisect to the crossing of an edge.
            let finest = mesh(Domain::Sphere, 3);
            let wo = |t: f64| angles(5.0 + 80.0 * t, 720.0 * t);
            for step in 0..200 {
                let (mut a, mut b) = (f64::from(step) / 200.0, f64::from(step + 1) / 200.0);
                let inside = finest.locate(wo(a));
                if inside == finest.locate(wo(b)) {
                    continue;
                }
                while b - a > 1e-9 {
                    let middle = 0.5 * (a + b);
                    if finest.locate(wo(middle)) == inside { a = middle } else { b = middle }
                }
                let value = |t: f64| spectrum(&m, at(wi(t), Some(wo(t))), how)[0];
                largest[which] = largest[which].max((value(a) - value(b)).abs());
            }
        }
        assert!(largest[0] < 1e-5 && largest[1] > 0.1, "{largest:?}");
    }
}

#[test]
fn isotropic_values_depend_on_the_difference_of_azimuths() {
    let m = isotropic();
    for how in [Interpolation::Constant, Interpolation::Smooth] {
        let reference = spectrum(&m, at(Some(angles(40.0, 0.0)), Some(angles(50.0, 33.0))), how);
        for phi in [10.0, 123.0, 250.0] {
            let turned = spectrum(&m, at(Some(angles(40.0, phi)), Some(angles(50.0, 33.0 + phi))), how);
            assert!(reference.iter().zip(&turned).all(|(a, b)| (a - b).abs() < 1e-6));
        }
    }
    // Between 30 and 60 degrees linear, beyond 60 held.
    let wo = Some(angles(50.0, 33.0));
    let smooth = |theta| spectrum(&m, at(Some(angles(theta, 0.0)), wo), Interpolation::Smooth)[1];
    assert!((smooth(40.0) - (smooth(30.0) * 2.0 + smooth(60.0)) / 3.0).abs() < 1e-6);
    assert_eq!(smooth(85.0), smooth(60.0));
}

#[test]
fn masks_are_left_out_and_all_masked_is_masked() {
    let axes = || vec![triangles(Domain::Sphere, 1), lambda(3)];
    // The second wavelength is masked everywhere, the third in every other triangle.
    let m = material(Quantity::Edf, axes(), |i| match (i % 3, i / 3 % 2) {
        (1, _) | (2, 0) => f32::NAN,
        (2, _) => 7.0,
        _ => 2.0,
    });
    let found = spectrum(&m, at(None, Some(angles(33.0, 44.0))), Interpolation::Smooth);
    assert!((found[0] - 2.0).abs() < 1e-6 && found[1].is_nan() && (found[2] - 7.0).abs() < 1e-5);
    let constant = spectrum(&m, at(None, Some(mesh(Domain::Sphere, 1).centroid(4))), Interpolation::Constant);
    assert!(constant[0] == 2.0 && constant[1].is_nan() && constant[2].is_nan());
    let mut out = [0.0; 2];
    m.at_wavelengths(
        at(None, Some(angles(33.0, 44.0))),
        Interpolation::Smooth,
        Beyond::Masked,
        &[405.0, 400.0],
        &mut out,
    )
    .unwrap();
    assert!(out[0].is_nan() && (out[1] - 2.0).abs() < 1e-6);
}

#[test]
fn wavelengths_between_samples_are_linear_and_outside_masked() {
    let m = brdf();
    let place = at(Some(angles(20.0, 3.0)), Some(angles(40.0, 70.0)));
    for how in [Interpolation::Constant, Interpolation::Smooth] {
        let whole = spectrum(&m, place, how);
        let mut out = [0.0; 5];
        m.at_wavelengths(place, how, Beyond::Masked, &[400.0, 402.5, 410.0, 399.9, 410.1], &mut out).unwrap();
        assert!((out[0] - whole[0]).abs() < 1e-6 && (out[2] - whole[1]).abs() < 1e-6);
        assert!((out[1] - 0.75 * whole[0] - 0.25 * whole[1]).abs() < 1e-6);
        assert!(out[3].is_nan() && out[4].is_nan());
    }
}

#[test]
fn nothing_goes_outside_the_outgoing_domain() {
    let m = brdf();
    let wi = Some(angles(20.0, 3.0));
    let below = angles(100.0, 3.0);
    assert_eq!(spectrum(&m, at(wi, Some(below)), Interpolation::Smooth), [0.0, 0.0]);
    assert_eq!(m.pdf(&[], wi, below, None).unwrap(), 0.0);
    let mut out = [1.0; 2];
    m.at_wavelengths(at(wi, Some(below)), Interpolation::Smooth, Beyond::Masked, &[405.0, 1000.0], &mut out).unwrap();
    assert!(out[0] == 0.0 && out[1].is_nan());
    assert_eq!(spectrum(&btdf(), at(wi, Some(angles(20.0, 0.0))), Interpolation::Constant), [0.0; 3]);
    assert!(btdf().pdf(&[], wi, angles(160.0, 0.0), None).unwrap() > 0.0);
}

#[test]
fn opaque_axes_need_an_index() {
    let index = |count| Axis::Index { count, labels: vec![] };
    let m = material(Quantity::Edf, vec![index(2), index(3), triangles(Domain::Sphere, 0)], |i| i as f32);
    let wo = Some(mesh(Domain::Sphere, 0).centroid(5));
    let place = |index| Place { index, wi: None, wo };
    let found = spectrum(&m, place(&[1, 2]), Interpolation::Constant)[0];
    assert!((found - 45.0).abs() < 1e-4, "{found}");
    let mut out = [0.0];
    is_unfit(
        m.evaluate(place(&[1]), Interpolation::Constant, &mut out),
        "the option index: found 1 numbers, expected 2",
    );
    is_unfit(m.evaluate(place(&[1, 3]), Interpolation::Constant, &mut out), "index 3 on axis 1 of 3 entries");
    let sampled = m.sample(&[1, 2], None, [0.3, 0.4], CONSTANT).unwrap().unwrap();
    let leaf = mesh(Domain::Sphere, 0).locate(sampled.direction).unwrap();
    assert!((sampled.weight * sampled.pdf - (40 + leaf) as f64).abs() < 1e-4);
    let table = material(Quantity::Spectrum, vec![index(2), lambda(4)], |i| i as f32);
    assert_eq!(
        spectrum(&table, Place { index: &[1], ..Place::default() }, Interpolation::Smooth),
        [4.0, 5.0, 6.0, 7.0]
    );
}

#[test]
fn refusals_name_their_reason() {
    let (m, mut out) = (brdf(), [0.0; 2]);
    let (wi, wo) = (Some(angles(20.0, 3.0)), Some(angles(40.0, 70.0)));
    let how = Interpolation::Smooth;
    is_unfit(m.evaluate(at(None, wo), how, &mut out), "no wi was given, but this brdf");
    is_unfit(m.evaluate(at(wi, None), how, &mut out), "no wo was given, but this brdf");
    is_unfit(
        m.evaluate(at(wi, wo), how, &mut out[..1]),
        "found 1 elements in an array for results, scratch space or weights, expected 2: room for 1 samples, expected 2",
    );
    let below = "wi has theta = 95.000 degrees, outside the incoming domain `hemisphere`";
    is_unfit(m.evaluate(at(Some(angles(95.0, 0.0)), wo), how, &mut out), below);
    is_unfit(isotropic().evaluate(at(Some(angles(95.0, 0.0)), wo), how, &mut out), below);
    is_unfit(m.sample(&[], Some(angles(95.0, 0.0)), [0.5; 2], None), below);
    is_unfit(m.pdf(&[], None, angles(5.0, 0.0), None), "no wi was given, but this brdf");
    is_unfit(
        m.at_wavelengths(at(wi, wo), how, Beyond::Masked, &[400.0], &mut out),
        "found 2 elements in an array for results, scratch space or weights, expected 1: room for 2 samples, expected 1",
    );
    is_unfit(m.sample(&[], wi, [0.5, 1.5], None), "u = [0.5, 1.5], expected");
    is_unfit(m.sample(&[], wi, [f64::NAN, 0.5], None), "u = [NaN, 0.5], expected");
    is_unfit(edf().evaluate(at(wi, wo), how, &mut [0.0; 3]), "wi was given, but this edf");
    is_unfit(
        btdf().at_wavelengths(at(wi, wo), how, Beyond::Masked, &[400.0], &mut out[..1]),
        "wavelengths were asked for, but this btdf",
    );
    let one = material(Quantity::Reflectance, vec![triangles(Domain::Hemisphere, 0), lambda(2)], rough);
    is_unfit(
        one.sample(&[], wi, [0.5; 2], None),
        "this request needs data over outgoing directions: this reflectance has no outgoing axis to sample",
    );
    is_unfit(
        one.pdf(&[], wi, angles(0.0, 0.0), None),
        "this request needs data over outgoing directions: this reflectance has no outgoing axis to sample",
    );
    is_unfit(
        one.albedo(&[], wi, how, &mut out),
        "this request needs data over outgoing directions: this reflectance has no outgoing axis to integrate",
    );
    is_unfit(one.evaluate(at(wi, wo), how, &mut out), "wo was given, but this reflectance");
    is_unfit(
        m.albedo(&[], wi, how, &mut out[..1]),
        "found 1 elements in an array for results, scratch space or weights, expected 2: room for 1 samples, expected 2",
    );
    assert_eq!(spectrum(&one, at(wi, None), Interpolation::Constant), m_row(&one, 0));
}

/// Samples of the pair of sampled directions numbered `cell`, from spectral coefficients or from stored samples.
fn cell(m: &Material, cell: usize) -> Vec<f32> {
    match m.function().unwrap().form() {
        Form::Samples(_) => m_row(m, cell).to_vec(),
        Form::Planes { planes, .. } => {
            let mut out = vec![0.0; m.lambdas()];
            match planes.cell(cell) {
                Cell::Live => planes.spectrum(planes.row(cell), 1.0, &mut out),
                Cell::Zero => {}
                Cell::Masked => out.fill(f32::NAN),
            }
            out
        }
    }
}

fn m_row(m: &Material, row: usize) -> &[f32] {
    &samples(m)[row * m.lambdas()..][..m.lambdas()]
}

#[test]
fn an_opened_material_tells_what_it_is() {
    let m = brdf();
    assert_eq!((m.lambdas(), m.wavelengths()), (2, Some(vec![400.0, 410.0])));
    assert!(m.summary().is_none() && btdf().wavelengths().is_none());
    let samples = size_of_val(samples(&m));
    // Samples, trees of 16 cells and 13 nodes between them (4/3 × 256 sums of 4 bytes each), tables of the meshes.
    let before = m.memory();
    assert!(before > samples + 29 * 340 * 4 && before < 4 * samples + 120_000, "{before}");
    m.sample(&[], Some(angles(10.0, 10.0)), [0.5; 2], None).unwrap();
    assert_eq!(m.memory(), before, "trees are counted before they are built");
}

/// Materials for sampling tests: name, material, incoming direction, mesh of outgoing directions.
pub(super) fn sampled() -> Vec<(&'static str, Material, Option<Direction>, TriangleMesh)> {
    vec![
        ("edf", edf(), None, mesh(Domain::Sphere, 2)),
        ("brdf", brdf(), Some(angles(50.0, 200.0)), mesh(Domain::Hemisphere, 3)),
        ("isotropic", isotropic(), Some(angles(31.0, 77.0)), mesh(Domain::Hemisphere, 2)),
        ("phase", phase(), Some(angles(120.0, 20.0)), mesh(Domain::Sphere, 2)),
        ("btdf", btdf(), Some(angles(10.0, 20.0)), mesh(Domain::Lower, 2)),
        ("bsdf", bsdf(), Some(angles(10.0, 20.0)), mesh(Domain::Sphere, 1)),
    ]
}

/// Angle in radians by which a query on isotropic data is rotated: the azimuth of the incoming direction.
fn turn(name: &str) -> f64 {
    if name == "isotropic" { 77_f64.to_radians() } else { 0.0 }
}

const LEVELS: [Option<u8>; 5] = [Some(0), Some(1), Some(2), Some(8), None];

#[test]
fn densities_integrate_to_one() {
    for (name, m, wi, outgoing) in sampled() {
        let finer = mesh(outgoing.domain(), 7);
        for level in LEVELS {
            let total: f64 = (0..finer.len())
                .map(|i| {
                    let wo = finer.centroid(i).rotated_about_z(turn(name));
                    m.pdf(&[], wi, wo, level).unwrap() * finer.solid_angle(i)
                })
                .sum();
            // The rule of centroids with at least 256 pieces a leaf; the tests of the warps integrate exactly.
            assert!((total - 1.0).abs() < 1e-4, "{name} {level:?}: {total}");
        }
    }
}

/// Standard normal deviate of a χ² value with `k` degrees of freedom (Wilson & Hilferty 1931).
fn z_score(chi2: f64, k: f64) -> f64 {
    ((chi2 / k).cbrt() - (1.0 - 2.0 / (9.0 * k))) / (2.0 / (9.0 * k)).sqrt()
}

/// χ² test of drawn directions: 30 one-sided tests at z < 3.5, so that a correct sampler fails with probability 30 ×
/// 2.3e-4 = 0.7 % for fresh seeds. Random numbers are Pcg32 with state 0x5eed and the case as stream. Bins are
/// triangles one level finer than the leaves, which show the distribution within a leaf, merged until 5 samples are
/// expected in each.
#[test]
fn samples_follow_their_density() {
    const N: usize = 40_000;
    for (case, (name, m, wi, outgoing)) in sampled().into_iter().enumerate() {
        let bins = mesh(outgoing.domain(), outgoing.level() + 1);
        let finer = mesh(outgoing.domain(), outgoing.level() + 4);
        for level in LEVELS {
            let mut rng = Pcg32::new(0x5eed, case as u64);
            let mut counts = vec![0.0; bins.len()];
            for _ in 0..N {
                let u = [rng.random(), rng.random()];
                let DirectionSample { direction, pdf, weight } = m.sample(&[], wi, u, level).unwrap().unwrap();
                assert!(weight.is_finite() && weight >= 0.0);
                let again = m.pdf(&[], wi, direction, level).unwrap();
                assert!((again / pdf - 1.0).abs() < 1e-5, "{name}: {again} {pdf}");
                counts[bins.locate(direction.rotated_about_z(-turn(name))).unwrap()] += 1.0;
            }
            let (mut chi2, mut degrees, mut found, mut expected) = (0.0, -1.0, 0.0, 0.0);
            for (i, count) in counts.iter().enumerate() {
                let share: f64 = (64 * i..64 * (i + 1))
                    .map(|i| {
                        let wo = finer.centroid(i).rotated_about_z(turn(name));
                        m.pdf(&[], wi, wo, level).unwrap() * finer.solid_angle(i)
                    })
                    .sum();
                assert!(share > 0.0 || *count == 0.0, "{name}: a sample where the density is 0");
                found += count;
                expected += share * N as f64;
                if expected >= 5.0 {
                    chi2 += (found - expected) * (found - expected) / expected;
                    degrees += 1.0;
                    (found, expected) = (0.0, 0.0);
                }
            }
            assert!(degrees > 20.0);
            let z = z_score(chi2, degrees);
            assert!(z < 3.5, "{name} {level:?}: χ² = {chi2} with {degrees} degrees of freedom, z = {z}");
        }
    }
}

/// Albedo (or flux) under one incoming direction, averaged over wavelengths: sum of the samples times the exact solid
/// angles, projected if there is a cosine factor, of the outgoing triangles.
fn albedo_by_hand(m: &Material, incoming: usize, outgoing: TriangleMesh) -> f64 {
    (0..outgoing.len())
        .map(|o| {
            let row = cell(m, incoming * outgoing.len() + o);
            let mean = row.iter().map(|&s| f64::from(s)).sum::<f64>() / row.len() as f64;
            let cosine = m.quantity().has_cosine();
            mean * if cosine { outgoing.projected_solid_angle(o) } else { outgoing.solid_angle(o) }
        })
        .sum()
}

#[test]
fn weights_have_the_albedo_as_their_mean() {
    for (name, m, wi, outgoing) in sampled() {
        let incoming = match name {
            "brdf" => mesh(Domain::Hemisphere, 1).locate(wi.unwrap()).unwrap(),
            "phase" => mesh(Domain::Sphere, 1).locate(wi.unwrap()).unwrap(),
            "isotropic" => 1,
            _ => 0,
        };
        let expected = albedo_by_hand(&m, incoming, outgoing);
        let mut spectral = vec![0.0; m.lambdas()];
        m.albedo(&[], wi, Interpolation::Constant, &mut spectral).unwrap();
        let stored = spectral.iter().map(|&a| f64::from(a)).sum::<f64>() / spectral.len() as f64;
        assert!((stored - expected).abs() < 1e-6 * expected, "{name}: {stored} {expected}");
        for (level, tolerance) in [(None, 1e-3), (Some(0), 1e-2)] {
            let options = SampleOptions { level, density: Density::Uniform, defensive: 0.0 };
            // 256 × 256 strata with one jittered point each: weights of one cell vary by their cosine within a leaf
            // (relative deviation below 1, so below 1/256 even if they were independent), at level 0 also between
            // leaves.
            let n = 256_usize;
            let mut rng = Pcg32::new(4, 1);
            let mut stratum = |k: usize| (k as f64 + rng.random::<f64>()) / n as f64;
            let sum: f64 = (0..n * n)
                .map(|k| m.sample(&[], wi, [stratum(k / n), stratum(k % n)], options).unwrap().unwrap().weight)
                .sum();
            let mean = sum / (n * n) as f64;
            assert!((mean - expected).abs() < tolerance * expected, "{name} {level:?}: {mean} {expected}");
        }
    }
}

#[test]
fn stratified_points_stay_stratified() {
    let m = edf();
    let sphere = mesh(Domain::Sphere, 2);
    let n = 128_usize;
    let mut counts = vec![0.0; sphere.len()];
    for k in 0..n * n {
        let u = [(k / n) as f64 + 0.5, (k % n) as f64 + 0.5].map(|x| x / n as f64);
        counts[sphere.locate(m.sample(&[], None, u, CONSTANT).unwrap().unwrap().direction).unwrap()] += 1.0;
    }
    let chi2: f64 = (0..sphere.len())
        .filter_map(|i| {
            let wo = sphere.centroid(i);
            // Nearly: the density varies a little with the direction within a leaf.
            let expected = (n * n) as f64 * m.pdf(&[], None, wo, CONSTANT).unwrap() * sphere.solid_angle(i);
            (expected > 0.0).then(|| (counts[i] - expected) * (counts[i] - expected) / expected)
        })
        .sum();
    // Independent points would give about as much as there are leaves, ± 12 %.
    assert!(chi2 < 0.5 * sphere.len() as f64, "{chi2}");
}

#[test]
fn where_nothing_goes_nothing_is_drawn() {
    let dark = material(Quantity::Edf, vec![triangles(Domain::Sphere, 2), lambda(2)], |_| 0.0);
    assert_eq!(dark.sample(&[], None, [0.5; 2], None).unwrap(), None);
    assert_eq!(dark.pdf(&[], None, angles(5.0, 5.0), None).unwrap(), 0.0);
    // One bright triangle between masked and negative ones: every sample is in it, for any corner of the square.
    let axes = vec![triangles(Domain::Sphere, 2), lambda(2)];
    let one = material(Quantity::Edf, axes, |i| match i / 2 {
        77 => 3.0e38,
        k if k % 6 == 0 => f32::NAN,
        _ => -1.0,
    });
    let sphere = mesh(Domain::Sphere, 2);
    let by_tree = SampleOptions { defensive: 0.0, ..SampleOptions::default() };
    for u in [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0], [1.0, 0.0], [0.3, 0.9]] {
        let sample = one.sample(&[], None, u, by_tree).unwrap().unwrap();
        assert_eq!(sphere.locate(sample.direction), Some(77));
        let sample = one.sample(&[], None, u, CONSTANT).unwrap().unwrap();
        assert_eq!(sphere.locate(sample.direction), Some(77));
        assert!((sample.weight * sample.pdf / 3.0e38 - 1.0).abs() < 1e-6);
    }
    assert_eq!(one.pdf(&[], None, sphere.centroid(78), by_tree).unwrap(), 0.0);
    assert_eq!(one.pdf(&[], None, sphere.centroid(78), CONSTANT).unwrap(), 0.0);
    // With the defensive part, every unmasked triangle may be drawn and no masked one.
    let everything = SampleOptions { density: Density::Uniform, ..SampleOptions::default() };
    for (options, how) in [(SampleOptions::default(), Interpolation::Smooth), (everything, Interpolation::Constant)] {
        let mut drawn = 0;
        for k in 0..1000 {
            let u = [0.98 + 2e-5 * f64::from(k), (0.618_034 * f64::from(k)).fract()];
            let Some(sample) = one.sample(&[], None, u, options).unwrap() else { continue };
            drawn += 1;
            let value = spectrum(&one, at(None, Some(sample.direction)), how);
            assert!(sample.pdf > 0.0 && !value.iter().all(|v| v.is_nan()), "{u:?} {sample:?} {value:?}");
        }
        assert!(drawn > 400, "{drawn}");
        for i in 0..sphere.len() {
            let value = spectrum(&one, at(None, Some(sphere.centroid(i))), how);
            let pdf = one.pdf(&[], None, sphere.centroid(i), options).unwrap();
            assert_eq!(pdf > 0.0, !value.iter().all(|v| v.is_nan()), "{i} {pdf} {value:?}");
        }
    }
}

#[test]
fn albedo_leaves_masked_cells_out() {
    let axes = vec![triangles(Domain::Hemisphere, 0), triangles(Domain::Hemisphere, 1), lambda(2)];
    let m = material(Quantity::Brdf, axes, |i| if i % 2 == 1 { f32::NAN } else { std::f32::consts::FRAC_1_PI });
    let mut out = [0.0; 2];
    for how in [Interpolation::Constant, Interpolation::Smooth] {
        m.albedo(&[], Some(angles(10.0, 10.0)), how, &mut out).unwrap();
        assert!((out[0] - 1.0).abs() < 1e-6 && out[1].is_nan(), "{out:?}");
    }
}

#[test]
fn linear_weights_have_the_integral_of_the_smooth_form_as_their_mean() {
    // Smooth at a cell's own place: the pole of a single incoming elevation, so that wi does not interpolate.
    let axes = vec![Axis::Elevation(vec![0.0]), triangles(Domain::Hemisphere, 2), lambda(2)];
    let m = material(Quantity::Brdf, axes, |i| rough(i) + 0.05);
    let wi = Some(angles(0.0, 0.0));
    let finer = mesh(Domain::Hemisphere, 6);
    let expected: f64 = (0..finer.len())
        .map(|i| {
            let value = spectrum(&m, at(wi, Some(finer.centroid(i))), Interpolation::Smooth);
            f64::from(value[0] + value[1]) * 0.5 * finer.projected_solid_angle(i)
        })
        .sum();
    let mut rng = Pcg32::new(5, 1);
    for options in
        [SampleOptions::default(), SampleOptions { level: Some(1), defensive: 0.2, ..SampleOptions::default() }]
    {
        let n = 256;
        let mut stratum = |k: usize| (k as f64 + rng.random::<f64>()) / n as f64;
        let sum: f64 = (0..n * n)
            .map(|k| m.sample(&[], wi, [stratum(k / n), stratum(k % n)], options).unwrap().unwrap().weight)
            .sum();
        let mean = sum / (n * n) as f64;
        assert!((mean / expected - 1.0).abs() < 3e-3, "{options:?}: {mean} {expected}");
    }
}

#[test]
fn directions_lead_back_to_their_point_and_wavelengths_have_their_own_trees() {
    let m = isotropic();
    let wi = Some(angles(31.0, 77.0));
    let mut rng = Pcg32::new(6, 1);
    let at_405 = m.sampler_at(405.0).unwrap();
    assert!(at_405.memory() > 3 * 84 * 4);
    let mut total = [0.0; 2];
    for _ in 0..20_000 {
        let u = [rng.random(), rng.random()];
        let drawn = m.sample(&[], wi, u, None).unwrap().unwrap();
        // Two nodes and the defensive part draw the direction, each from a point of its own.
        let back = m.invert(&[], wi, drawn.direction, None).unwrap().unwrap();
        let again = m.sample(&[], wi, back, None).unwrap().unwrap();
        let cosine = dot(drawn.direction.xyz(), again.direction.xyz());
        assert!(cosine > 1.0 - 1e-9 && (again.pdf / drawn.pdf - 1.0).abs() < 1e-4, "{u:?} {back:?}");
        let drawn = at_405.sample(&[], wi, u, CONSTANT).unwrap().unwrap();
        let back = at_405.invert(&[], wi, drawn.direction, CONSTANT).unwrap().unwrap();
        assert!(u.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-5));
        assert!((at_405.pdf(&[], wi, drawn.direction, CONSTANT).unwrap() / drawn.pdf - 1.0).abs() < 1e-5);
        let mut value = [0.0];
        let place = at(wi, Some(drawn.direction));
        m.at_wavelengths(place, Interpolation::Constant, Beyond::Masked, &[405.0], &mut value).unwrap();
        let expected = f64::from(value[0]) * drawn.direction.cos_theta() / drawn.pdf;
        assert!((drawn.weight / expected - 1.0).abs() < 1e-5);
        total[0] += drawn.weight;
        total[1] += 1.0;
    }
    let mut albedo = [0.0; 2];
    m.albedo(&[], wi, Interpolation::Constant, &mut albedo).unwrap();
    let expected = f64::from(albedo[0] + albedo[1]) * 0.5;
    assert!((total[0] / total[1] / expected - 1.0).abs() < 0.02, "{total:?} {expected}");
    is_unfit(m.sampler_at(399.0).map(|_| ()), "399 nm is outside the measured wavelengths");
    is_unfit(btdf().sampler_at(500.0).map(|_| ()), "wavelengths were asked for, but this btdf has none");
    let one = material(Quantity::Reflectance, vec![triangles(Domain::Hemisphere, 0), lambda(2)], rough);
    is_unfit(
        one.sampler_at(400.0).map(|_| ()),
        "this request needs data over outgoing directions: this reflectance has no outgoing axis to sample",
    );
    is_unfit(
        one.invert(&[], wi, angles(0.0, 0.0), None),
        "this request needs data over outgoing directions: this reflectance has no outgoing axis to sample",
    );
    for defensive in [1.0, -0.1, f64::NAN] {
        let options = SampleOptions { defensive, ..SampleOptions::default() };
        is_unfit(m.sample(&[], wi, [0.5; 2], options), "the fraction of defensive samples");
    }
    // No point maps to a direction outside the domain.
    assert_eq!(m.invert(&[], wi, angles(120.0, 0.0), None).unwrap(), None);
}
