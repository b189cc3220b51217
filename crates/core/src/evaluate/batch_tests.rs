//! Batches, and previously chosen wavelengths, against single calls.

use super::lookup::MeshLookup;
use super::{
    Beyond, Density, Directions, Drawings, EvaluateError, Interpolation, Material, Pairs, Place, SampleOptions,
};
use crate::domain::vector::{cross, dot};
use crate::domain::{
    Axis, Direction, Domain, Measurement, Quantity, Sampling, Tensor, TriangleMesh, Unit, WavelengthGrid,
};
use rand::RngExt;
use rand_pcg::Pcg32;

const COUNT: usize = 333;
const FORMS: [Interpolation; 2] = [Interpolation::Constant, Interpolation::Smooth];
const WAVELENGTHS: [f64; 5] = [400.0, 433.3, 350.0, f64::NAN, 560.0];

fn triangles(domain: Domain, level: u8) -> Axis {
    Axis::Triangles(TriangleMesh::new(domain, level).unwrap())
}

/// Material whose logarithmic spectra are combinations of two basis spectra, with dark and masked samples if
/// `with_holes`.
fn material(quantity: Quantity, mut axes: Vec<Axis>, with_holes: bool) -> Material {
    let lambdas = 17;
    axes.push(Axis::Wavelength(WavelengthGrid::even(400.0, 10.0, lambdas).unwrap()));
    let samples = (0..axes.iter().map(Axis::len).product()).map(|i: usize| {
        let (cell, lambda) = (i / lambdas, (i % lambdas) as f32);
        let x = (cell.wrapping_mul(2_654_435_761) >> 7) % 61;
        match x {
            0..3 if with_holes => 0.0,
            3..6 if with_holes => f32::NAN,
            _ => (x as f32 / 60.0 * (lambda / 9.0).sin() + (cell % 7) as f32 / 7.0).exp(),
        }
    });
    let tensor = Tensor::new(axes.clone(), samples.collect()).unwrap();
    Material::of(Measurement::new(quantity, Unit::Relative, Sampling::Average, tensor).unwrap()).unwrap()
}

/// Test material with samples from −1 to 1.
fn signed() -> Material {
    let axes = vec![
        triangles(Domain::Hemisphere, 1),
        triangles(Domain::Hemisphere, 2),
        Axis::Wavelength(WavelengthGrid::even(400.0, 10.0, 17).unwrap()),
    ];
    let samples = (0..axes.iter().map(Axis::len).product()).map(|i: usize| {
        let (cell, lambda) = (i / 17, (i % 17) as f32);
        (0.7 * (cell % 31) as f32).sin() * (0.1 * lambda).cos()
    });
    let tensor = Tensor::new(axes.clone(), samples.collect()).unwrap();
    Material::of(Measurement::new(Quantity::Brdf, Unit::Relative, Sampling::Average, tensor).unwrap()).unwrap()
}

fn materials() -> Vec<Material> {
    let upper = |level| triangles(Domain::Hemisphere, level);
    let elevations = Axis::Elevation(vec![0.0, 20.0, 60.0]);
    [false, true]
        .into_iter()
        .flat_map(|holes| {
            [
                material(Quantity::Brdf, vec![upper(1), upper(3)], holes),
                material(Quantity::Brdf, vec![elevations.clone(), upper(2)], holes),
                material(Quantity::Btdf, vec![upper(0), triangles(Domain::Lower, 2)], holes),
                material(Quantity::Bsdf, vec![triangles(Domain::Sphere, 0), triangles(Domain::Sphere, 2)], holes),
                material(Quantity::Edf, vec![triangles(Domain::Sphere, 3)], holes),
                material(Quantity::Phase, vec![triangles(Domain::Sphere, 1), triangles(Domain::Sphere, 1)], holes),
            ]
        })
        .collect()
}

/// Cartesian coordinates of random directions of any length; `up` restricts them to the upper hemisphere.
fn coordinates(random: &mut Pcg32, up: bool) -> [Vec<f32>; 3] {
    let mut of = |k: usize| -> Vec<f32> {
        let number = |_| {
            let x = 20.0 * random.random::<f32>() - 10.0;
            if k == 2 && up { x.abs() } else { x }
        };
        (0..COUNT).map(number).collect()
    };
    [of(0), of(1), of(2)]
}

fn directions(of: &[Vec<f32>; 3]) -> Directions<'_> {
    Directions::new(&of[0], &of[1], &of[2])
}

/// Incoming and outgoing directions of a batch; `None` for a direction that the material does not have.
struct Asked {
    wi: Option<[Vec<f32>; 3]>,
    wo: [Vec<f32>; 3],
}

impl Asked {
    fn of(m: &Material, random: &mut Pcg32) -> Self {
        let above = m.quantity() == Quantity::Brdf || m.quantity() == Quantity::Btdf;
        let wi = (m.quantity() != Quantity::Edf).then(|| coordinates(random, above));
        Self { wi, wo: coordinates(random, false) }
    }

    fn pairs(&self) -> Pairs<'_> {
        Pairs { index: &[], wi: self.wi.as_ref().map(directions), wo: Some(directions(&self.wo)) }
    }
}

fn same(a: f32, b: f32) -> bool {
    a == b || (a.is_nan() && b.is_nan()) || (a - b).abs() <= 2e-5 * a.abs().max(b.abs())
}

/// Incoming and outgoing directions as unit vectors in full f64 precision, some of them on edges of the mesh.
struct Units {
    wi: Option<Vec<Direction>>,
    wo: Vec<Direction>,
}

impl Units {
    fn of(m: &Material, random: &mut Pcg32) -> Self {
        let below = if m.quantity() == Quantity::Brdf || m.quantity() == Quantity::Btdf { 90.0 } else { 180.0 };
        let mut directions = |lowest: f64| -> Vec<Direction> {
            let direction = |i: usize| match i % 16 {
                0 => Direction::from_degrees(lowest * (i % 5) as f64 / 4.0, 45.0 * i as f64),
                _ => Direction::from_degrees(lowest * random.random::<f64>(), 360.0 * random.random::<f64>()),
            };
            (0..COUNT).map(direction).collect()
        };
        Self { wi: (m.quantity() != Quantity::Edf).then(|| directions(below)), wo: directions(180.0) }
    }

    fn pairs(&self) -> Pairs<'_> {
        Pairs { index: &[], wi: self.wi.as_deref().map(Directions::of), wo: Some(Directions::of(&self.wo)) }
    }
}

/// Calls `ask`, which evaluates a batch, for all pairs of directions at once, and for parts of 1, 7, 48 and 100 pairs.
/// Checks that the results are equal, and returns them.
fn cut<T: Clone + PartialEq + std::fmt::Debug>(
    nothing: &T,
    pairs: Pairs<'_>,
    mut ask: impl FnMut(Pairs<'_>, usize, &mut [T]),
) -> Vec<T> {
    let mut by = |most: usize| {
        let mut all = vec![nothing.clone(); COUNT];
        for (part, out) in all.chunks_mut(most).enumerate() {
            let start = part * most;
            ask(pairs.part(start, start + out.len()), start, out);
        }
        all
    };
    let whole = by(COUNT);
    for most in [1, 7, 48, 100] {
        assert_eq!(by(most), whole, "in parts of {most}");
    }
    whole
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

const EACH_DENSITY: [(Density, f64); 4] =
    [(Density::Uniform, 0.0), (Density::Uniform, 0.2), (Density::Linear, 0.0), (Density::Linear, 0.3)];

#[test]
fn blocks_of_unit_vectors_are_single_answers_however_they_are_cut() {
    let mut random = Pcg32::new(7, 2);
    let mut worst = [0.0_f64; 4];
    // Rounding of signed data is relative to the largest sample.
    let materials = materials().into_iter().map(|m| (m, 0.0_f64)).chain([(signed(), 1.0)]);
    for (m, largest) in materials {
        let far = |a: f64, b: f64| {
            let is_same = a == b || (a.is_nan() && b.is_nan());
            if is_same { 0.0 } else { (a - b).abs() / largest.max(a.abs()).max(b.abs()) }
        };
        let units = Units::of(&m, &mut random);
        let place = |i: usize| units.pairs().place(i).unwrap();
        let many: Vec<f64> = (0..19).map(|i| 390.0 + 10.7 * f64::from(i)).chain([f64::NAN]).collect();
        for how in FORMS {
            let all = cut(&Vec::new(), units.pairs(), |pairs, _, out| {
                let mut values = vec![-1.0; out.len() * m.lambdas()];
                m.spectra(pairs, how, &mut values).unwrap();
                out.iter_mut().zip(values.chunks_exact(m.lambdas())).for_each(|(out, values)| *out = bits(values));
            });
            let mut one = vec![0.0; m.lambdas()];
            for (i, all) in all.iter().enumerate() {
                m.evaluate(place(i), how, &mut one).unwrap();
                for (a, b) in one.iter().zip(all) {
                    worst[0] = worst[0].max(far(f64::from(*a), f64::from(f32::from_bits(*b))));
                }
            }
            for beyond in [Beyond::Masked, Beyond::Zero, Beyond::Nearest] {
                let all = cut(&Vec::new(), units.pairs(), |pairs, _, out| {
                    let mut values = vec![-1.0; out.len() * many.len()];
                    m.spectra_at(pairs, how, beyond, &many, &mut values).unwrap();
                    out.iter_mut().zip(values.chunks_exact(many.len())).for_each(|(out, values)| *out = bits(values));
                });
                let mut one = vec![0.0; many.len()];
                for (i, all) in all.iter().enumerate() {
                    m.at_wavelengths(place(i), how, beyond, &many, &mut one).unwrap();
                    for (a, b) in one.iter().zip(all) {
                        worst[1] = worst[1].max(far(f64::from(*a), f64::from(f32::from_bits(*b))));
                    }
                }
            }
        }
        let u: Vec<[f64; 2]> = (0..COUNT).map(|_| [random.random(), random.random()]).collect();
        for (density, defensive) in EACH_DENSITY {
            for level in [None, Some(1)] {
                let options = SampleOptions { level, density, defensive };
                let pdfs = cut(&-1.0, units.pairs(), |pairs, _, out| m.pdfs(pairs, options, out).unwrap());
                let samples = cut(&None, units.pairs(), |pairs, start, out| {
                    m.samples(&[], pairs.wi, &u[start..start + out.len()], options, out).unwrap();
                });
                for i in 0..COUNT {
                    let Place { wi, wo, .. } = place(i);
                    worst[2] = worst[2].max(far(m.pdf(&[], wi, wo.unwrap(), options).unwrap(), pdfs[i]));
                    let one = m.sample(&[], wi, u[i], options).unwrap();
                    assert_eq!(one.is_some(), samples[i].is_some());
                    if let (Some(one), Some(sample)) = (one, samples[i]) {
                        assert!(one.direction.dot(sample.direction) > 1.0 - 1e-14);
                        worst[2] = worst[2].max(far(one.pdf, sample.pdf));
                        worst[3] = worst[3].max(far(one.weight, sample.weight));
                    }
                }
            }
        }
    }
    let most = [2e-5, 2e-5, 1e-9, 2e-5];
    assert!(worst.iter().zip(most).all(|(worst, most)| *worst <= most), "{worst:?}");
}

#[test]
fn batches_of_spectra_are_single_spectra() {
    let mut random = Pcg32::new(1, 2);
    for m in materials() {
        let asked = Asked::of(&m, &mut random);
        for how in FORMS {
            let mut all = vec![-1.0; COUNT * m.lambdas()];
            m.spectra(asked.pairs(), how, &mut all).unwrap();
            let mut parallel = vec![-1.0; COUNT * m.lambdas()];
            m.par_spectra(asked.pairs(), how, &mut parallel).unwrap();
            assert!(all.iter().zip(&parallel).all(|(a, b)| a.to_bits() == b.to_bits()));
            let mut one = vec![0.0; m.lambdas()];
            for (i, all) in all.chunks_exact(m.lambdas()).enumerate() {
                m.evaluate(asked.pairs().place(i).unwrap(), how, &mut one).unwrap();
                assert!(one.iter().zip(all).all(|(a, b)| same(*a, *b)), "{} {how:?} {i}", m.quantity());
            }
        }
    }
}

#[test]
fn chosen_wavelengths_are_those_asked_for_each_time() {
    let mut random = Pcg32::new(3, 2);
    for m in materials() {
        let asked = Asked::of(&m, &mut random);
        for beyond in [Beyond::Masked, Beyond::Zero, Beyond::Nearest] {
            let chosen = m.choose(&WAVELENGTHS, beyond).unwrap();
            for how in FORMS {
                let mut all = vec![-1.0; COUNT * WAVELENGTHS.len()];
                chosen.values(asked.pairs(), how, &mut all).unwrap();
                for (i, all) in all.chunks_exact(WAVELENGTHS.len()).enumerate() {
                    let place = asked.pairs().place(i).unwrap();
                    let mut each = [0.0; WAVELENGTHS.len()];
                    m.at_wavelengths(place, how, beyond, &WAVELENGTHS, &mut each).unwrap();
                    let once = chosen.at(place, how).unwrap();
                    for ((a, b), c) in each.iter().zip(all).zip(once) {
                        assert!(same(*a, *b) && same(*a, c), "{} {how:?} {beyond:?} {i}: {a} {b} {c}", m.quantity());
                    }
                }
            }
        }
    }
}

#[test]
fn batches_of_densities_and_samples_are_single_ones() {
    let mut random = Pcg32::new(5, 2);
    for m in materials() {
        let asked = Asked::of(&m, &mut random);
        let chosen = m.choose(&WAVELENGTHS[..2], Beyond::Nearest).unwrap();
        let u: [Vec<f32>; 2] = std::array::from_fn(|_| (0..COUNT).map(|_| random.random::<f32>()).collect());
        for (density, defensive) in EACH_DENSITY {
            let options = SampleOptions { density, defensive, ..SampleOptions::default() };
            let mut pdfs = vec![-1.0; COUNT];
            m.pdfs(asked.pairs(), options, &mut pdfs).unwrap();
            let [mut x, mut y, mut z, mut pdf] = [(); 4].map(|()| vec![-1.0; COUNT]);
            let mut weights = vec![-1.0; 2 * COUNT];
            let out = Drawings { x: &mut x, y: &mut y, z: &mut z, pdf: &mut pdf, weights: &mut weights };
            chosen.samples(&[], asked.pairs().wi, [&u[0], &u[1]], options, out).unwrap();
            for i in 0..COUNT {
                let place = asked.pairs().place(i).unwrap();
                let one = m.pdf(&[], place.wi, place.wo.unwrap(), options).unwrap();
                assert!(same(one as f32, pdfs[i] as f32), "{} {options:?} {i}: {one} {}", m.quantity(), pdfs[i]);
                let point = [f64::from(u[0][i]), f64::from(u[1][i])];
                let drawn = chosen.sample(&[], place.wi, point, options).unwrap();
                let plain = m.draw(&[], place.wi, point, options).unwrap();
                assert_eq!(drawn.map(|d| (d.direction, d.pdf)), plain);
                let Some(drawn) = drawn else {
                    assert_eq!([x[i], y[i], z[i], pdf[i], weights[2 * i], weights[2 * i + 1]], [0.0; 6]);
                    continue;
                };
                let [dx, dy, dz] = drawn.direction.xyz().map(|c| c as f32);
                assert_eq!([x[i], y[i], z[i], pdf[i]], [dx, dy, dz, drawn.pdf as f32]);
                assert!(same(weights[2 * i], drawn.weights[0]) && same(weights[2 * i + 1], drawn.weights[1]));
            }
        }
    }
}

#[test]
fn weights_are_value_times_cosine_over_density() {
    let m = material(Quantity::Brdf, vec![triangles(Domain::Hemisphere, 1), triangles(Domain::Hemisphere, 3)], false);
    let chosen = m.choose(&[455.0], Beyond::Masked).unwrap();
    let wi = Some(Direction::from_degrees(40.0, 20.0));
    for (density, how) in [(Density::Uniform, FORMS[0]), (Density::Linear, FORMS[1])] {
        let options = SampleOptions { density, ..SampleOptions::default() };
        for i in 0..50 {
            let u = [(0.5 + 0.7549 * f64::from(i)).fract(), (0.5 + 0.5698 * f64::from(i)).fract()];
            let drawn = chosen.sample(&[], wi, u, options).unwrap().unwrap();
            let value = chosen.at(Place { index: &[], wi, wo: Some(drawn.direction) }, how).unwrap()[0];
            let expected = f64::from(value) * drawn.direction.cos_theta() / drawn.pdf;
            assert!((f64::from(drawn.weights[0]) / expected - 1.0).abs() < 1e-5);
        }
    }
}

#[test]
fn directions_on_edges_lie_in_the_triangle_that_is_found() {
    let steps = [-1.0, -0.5, -0.0, 0.0, 0.5, 1.0];
    for &domain in Domain::ALL {
        for level in [0, 1, 4] {
            let mesh = TriangleMesh::new(domain, level).unwrap();
            let lookup = MeshLookup::new(mesh, false);
            for i in 0..216 {
                let d = [steps[i / 36], steps[i / 6 % 6], steps[i % 6]];
                let Some(direction) = Direction::new(d[0], d[1], d[2]) else { continue };
                assert_eq!(lookup.locate(direction).is_some(), mesh.locate(direction).is_some(), "{mesh:?} {d:?}");
                let Some(found) = lookup.locate(direction) else { continue };
                let [a, b, c] = mesh.vertices(found);
                let turn = dot(a, cross(b, c)).signum();
                for plane in [cross(a, b), cross(b, c), cross(c, a)] {
                    assert!(turn * dot(plane, direction.xyz()) > -1e-12, "{mesh:?} {d:?} in {found}");
                }
            }
        }
    }
}

#[test]
fn bad_batches_are_refused() {
    let m = material(Quantity::Brdf, vec![triangles(Domain::Hemisphere, 1), triangles(Domain::Hemisphere, 2)], false);
    let good = [vec![0.1, 0.2], vec![0.0, 0.1], vec![1.0, 0.5]];
    let refusal = |wi: [Vec<f32>; 3], wo: [Vec<f32>; 3]| {
        let pairs = Pairs { index: &[], wi: Some(directions(&wi)), wo: Some(directions(&wo)) };
        let mut out = vec![0.0; 2 * m.lambdas()];
        let spectra = m.spectra(pairs, Interpolation::Constant, &mut out).unwrap_err();
        let pdfs = m.pdfs(pairs, SampleOptions::default(), &mut [0.0; 2]).unwrap_err();
        assert!(matches!((&spectra, &pdfs), (EvaluateError::Query(_), EvaluateError::Query(_))));
        spectra.to_string()
    };
    let zero = [vec![0.1, 0.0], vec![0.0, 0.0], vec![1.0, 0.0]];
    assert!(refusal(good.clone(), zero.clone()).contains("direction 1 is (0, 0, 0)"));
    assert!(refusal(zero, good.clone()).contains("direction 1 is (0, 0, 0)"));
    let nan = [vec![f32::NAN, 0.0], vec![0.0, 0.0], vec![1.0, 1.0]];
    assert!(refusal(good.clone(), nan).contains("direction 0 is (NaN, 0, 1)"));
    let below = [vec![0.1, 0.2], vec![0.0, 0.1], vec![1.0, -0.5]];
    assert!(refusal(below, good.clone()).contains("outside the incoming domain"));
    let short = [vec![0.1], vec![0.0], vec![1.0]];
    assert!(refusal(short, good.clone()).contains("expected 2 each"));
    // Lengths whose squares overflow or underflow f32 are valid all the same.
    let long = [vec![1e30, 1e-30], vec![0.0, 0.0], vec![1e30, 1e-30]];
    let pairs = Pairs { index: &[], wi: Some(directions(&good)), wo: Some(directions(&long)) };
    let mut out = vec![0.0; 2 * m.lambdas()];
    m.spectra(pairs, Interpolation::Constant, &mut out).unwrap();
    assert_eq!(out[..m.lambdas()].len(), 17);
    assert!(m.choose(&[500.0; 9], Beyond::Zero).unwrap_err().to_string().contains("9 wavelengths, expected at most 8"));
}
