//! Materials with a lobe added to their cells: values, integrals, samples, and the contents of a file.

use super::{Beyond, Directions, Interpolation, Material, Pairs, Place, SampleOptions, Side};
use crate::compress::{self, Policy, Settings, Target, compress};
use crate::domain::{
    Axis, CENTRES, Direction, Domain, Lobe, LobeCentre, LobeParameters, Measurement, Quantity, Sampling, Silent,
    Tensor, TriangleMesh, Unit, WavelengthGrid,
};

const LAMBDAS: usize = 3;

fn mesh(level: u8) -> TriangleMesh {
    TriangleMesh::new(Domain::Hemisphere, level).unwrap()
}

fn lobe(centre: LobeCentre, width: f64) -> Lobe {
    let half = width.to_radians() * if centre == LobeCentre::HalfVector { 0.25 } else { 0.5 };
    Lobe::new(LobeParameters {
        centre,
        peak: [3.5, 0.5, 0.0],
        range: [0.0, 0.7],
        widths: [half, half],
        angle: 0.0,
        tail: 0.3,
        colours: vec![0.5, 1.0, 1.5],
    })
    .unwrap()
}

/// Test BRDF without a lobe: nearly diffuse, and darker towards grazing outgoing directions.
fn cells(incoming: Axis) -> Measurement {
    let mesh = mesh(3);
    let axes =
        vec![incoming, Axis::Triangles(mesh), Axis::Wavelength(WavelengthGrid::even(500.0, 50.0, LAMBDAS).unwrap())];
    let samples = (0..axes[0].len() * mesh.len())
        .flat_map(|i| {
            let z = mesh.centroid(i % mesh.len()).cos_theta();
            [0.05 + 0.02 * z, 0.04 + 0.03 * z, 0.06].map(|value| value as f32)
        })
        .collect();
    let tensor = Tensor::new(axes, samples).unwrap();
    Measurement::new(Quantity::Brdf, Unit::PerSteradian, Sampling::Average, tensor).unwrap()
}

fn elevations() -> Axis {
    Axis::Elevation(vec![0.0, 20.0, 40.0, 60.0])
}

fn file(measurement: &Measurement, lobe: Option<Lobe>) -> Vec<u8> {
    let settings = Settings { target: Target::ErL2(0.001), lobe, ..Settings::default() };
    compress(measurement, &settings, &Silent).unwrap().bytes
}

/// Compressed files with an analytic lobe, each with a file of the data without the lobe.
fn all() -> Vec<([Vec<u8>; 2], Lobe)> {
    let mut all = Vec::new();
    for centre in CENTRES {
        for width in [1.0, 6.0] {
            let (cells, lobe) = (cells(elevations()), lobe(centre, width));
            all.push(([file(&cells, Some(lobe.clone())), file(&cells, None)], lobe));
        }
    }
    let parameters =
        LobeParameters { widths: [0.01, 0.03], angle: 0.5, ..lobe(LobeCentre::HalfVector, 2.0).parameters() };
    let (cells, lobe) = (cells(Axis::Triangles(mesh(1))), Lobe::new(parameters).unwrap());
    all.push(([file(&cells, Some(lobe.clone())), file(&cells, None)], lobe));
    all
}

fn points(count: usize) -> impl Iterator<Item = [f64; 2]> {
    (0..count).map(|i| {
        let i = i as f64 + 0.5;
        [(i * 0.754_877_666_246_692_8).fract(), (i * 0.569_840_290_998_053_3).fract()]
    })
}

/// Pairs of directions at which the tests evaluate: in two of three the outgoing direction is drawn from `lobe`, in the
/// third it lies anywhere up to 89° from the normal.
fn pairs(lobe: &Lobe) -> Vec<(Direction, Direction)> {
    let mut pairs = Vec::new();
    for (i, u) in points(60).enumerate() {
        let wi = Direction::from_degrees(70.0 * u[0], 360.0 * u[1]);
        let near = lobe.under(wi).unwrap().draw(u);
        pairs.push((wi, if i % 3 == 0 { Direction::from_degrees(89.0 * u[1], 360.0 * u[0]) } else { near }));
    }
    pairs
}

#[test]
fn values_are_those_of_the_cells_plus_those_of_the_lobe() {
    for ([bytes, alone], lobe) in all() {
        let (whole, cells) = (Material::open(&bytes).unwrap(), Material::open(&alone).unwrap());
        assert_eq!(whole.summary().unwrap().lobe.as_ref(), Some(&lobe));
        let pairs = pairs(&lobe);
        let (mut found, mut expected) = ([0.0; LAMBDAS], [0.0; LAMBDAS]);
        for how in [Interpolation::Smooth, Interpolation::Constant] {
            let mut each = Vec::new();
            for &(wi, wo) in &pairs {
                let place = Place { index: &[], wi: Some(wi), wo: Some(wo) };
                whole.evaluate(place, how, &mut found).unwrap();
                cells.evaluate(place, how, &mut expected).unwrap();
                let shape = lobe.shape(wi, wo) as f32;
                for (found, (cells, colour)) in found.iter().zip(expected.iter().zip(lobe.colours())) {
                    assert!((found - (cells + shape * colour)).abs() <= 1e-6 * found.abs(), "{found}");
                }
                let mut at = [0.0; 2];
                whole.at_wavelengths(place, how, Beyond::Nearest, &[525.0, 900.0], &mut at).unwrap();
                let middle = 0.5 * (found[0] + found[1]);
                assert!(
                    (at[0] - middle).abs() < 2e-6 * middle && (at[1] - found[2]).abs() < 2e-6 * found[2],
                    "{at:?} {found:?}"
                );
                let chosen = whole.choose(&[525.0, 900.0], Beyond::Nearest).unwrap().at(place, how).unwrap();
                assert_eq!(chosen[..2], at);
                let sum = whole.weighted(place, how, &[1.0, 0.0, 2.0]).unwrap();
                let expected = found[0] + 2.0 * found[2];
                assert!((sum - expected).abs() < 2e-6 * expected);
                each.push(found);
            }
            let (wi, wo): (Vec<Direction>, Vec<Direction>) = pairs.iter().copied().unzip();
            let places = Pairs { index: &[], wi: Some(Directions::of(&wi)), wo: Some(Directions::of(&wo)) };
            let mut batch = vec![0.0; each.len() * LAMBDAS];
            whole.spectra(places, how, &mut batch).unwrap();
            let mut parallel = batch.clone();
            whole.par_spectra(places, how, &mut parallel).unwrap();
            assert_eq!(batch, parallel);
            for (a, b) in batch.iter().zip(each.iter().flatten()) {
                assert!((a - b).abs() <= 2e-5 * b, "{a} {b}");
            }
            let mut at = vec![0.0; each.len()];
            whole.spectra_at(places, how, Beyond::Nearest, &[550.0], &mut at).unwrap();
            for (a, b) in at.iter().zip(&each) {
                assert!((a - b[1]).abs() <= 2e-5 * b[1], "{a} {b:?}");
            }
        }
    }
}

#[test]
fn what_is_drawn_has_its_density_and_its_weights_have_the_albedo_as_their_mean() {
    for ([bytes, _], lobe) in all() {
        let whole = Material::open(&bytes).unwrap();
        for theta in [3.0, 35.0, 57.0] {
            let wi = Direction::from_degrees(theta, 33.0);
            let options = SampleOptions::default();
            let (mut sum, count) = (0.0, 40_000);
            for u in points(count) {
                let Some(sample) = whole.sample(&[], Some(wi), u, options).unwrap() else { continue };
                sum += sample.weight;
                assert!(!sum.is_nan(), "{sample:?}");
            }
            for u in points(200) {
                let Some(sample) = whole.sample(&[], Some(wi), u, options).unwrap() else { continue };
                let pdf = whole.pdf(&[], Some(wi), sample.direction, options).unwrap();
                assert!((pdf / sample.pdf - 1.0).abs() < 1e-9, "{pdf} {}", sample.pdf);
                let place = Place { index: &[], wi: Some(wi), wo: Some(sample.direction) };
                let mean = whole.weighted(place, Interpolation::Smooth, &[1.0 / 3.0; 3]).unwrap();
                let weight = f64::from(mean) * sample.direction.cos_theta() / pdf;
                assert!((weight / sample.weight - 1.0).abs() < 1e-5);
                // An inverted point lies where the direction was drawn, by the lobe or by the cells.
                let point = whole.invert(&[], Some(wi), sample.direction, options).unwrap().unwrap();
                let again = whole.sample(&[], Some(wi), point, options).unwrap().unwrap();
                assert!(
                    again.direction.dot(sample.direction) > 1.0 - 1e-7,
                    "{:?} {:?}",
                    again.direction,
                    sample.direction
                );
            }
            let mut albedo = [0.0; LAMBDAS];
            whole.integrated(Side::Both, &[], Some(wi), Interpolation::Smooth, 0, &mut albedo).unwrap();
            // The quadrature of the cells misses a narrow lobe, so the lobe is subtracted and added exactly.
            let mut cells = 0.0;
            let mesh = mesh(3);
            for i in 0..mesh.len() {
                cells -= lobe.shape(wi, mesh.centroid(i)) * mesh.projected_solid_angle(i);
            }
            let isotropic = whole.axes()[0].len() == 4;
            let expected = f64::from(albedo.iter().sum::<f32>()) / 3.0 + lobe.under(wi).unwrap().light();
            let expected = if isotropic {
                // The quadrature rotates its triangles with the azimuth of wi.
                let turned = |i: usize| mesh.centroid(i).rotated_about_z(33_f64.to_radians());
                expected
                    - (0..mesh.len()).map(|i| lobe.shape(wi, turned(i)) * mesh.projected_solid_angle(i)).sum::<f64>()
            } else {
                expected + cells
            };
            let mean = sum / count as f64;
            assert!((mean / expected - 1.0).abs() < 0.02, "{lobe} {theta}: {mean} {expected}");
        }
    }
}

#[test]
fn densities_add_up_to_1_and_each_cell_gets_its_share() {
    let ([bytes, _], _) = all().remove(1);
    let whole = Material::open(&bytes).unwrap();
    let (wi, options) = (Direction::from_degrees(30.0, 0.0), SampleOptions::default());
    let (coarse, fine) = (mesh(2), mesh(7));
    let mut expected = vec![0.0; coarse.len()];
    for i in 0..fine.len() {
        let wo = fine.centroid(i);
        let density = whole.pdf(&[], Some(wi), wo, options).unwrap();
        expected[coarse.locate(wo).unwrap()] += density * fine.solid_angle(i);
    }
    assert!((expected.iter().sum::<f64>() - 1.0).abs() < 2e-3, "{}", expected.iter().sum::<f64>());
    let count = 100_000;
    let mut found = vec![0.0; coarse.len()];
    for u in points(count) {
        let sample = whole.sample(&[], Some(wi), u, options).unwrap().unwrap();
        found[coarse.locate(sample.direction).unwrap()] += 1.0 / count as f64;
    }
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found - expected).abs() < 3e-3 + 0.02 * expected, "{found} {expected}");
    }
}

#[test]
fn weights_leave_out_bands_that_are_masked() {
    let mut measurement = cells(elevations());
    let mut samples = measurement.tensor.samples().to_vec();
    samples.iter_mut().step_by(LAMBDAS).for_each(|sample| *sample = f32::NAN);
    measurement.tensor = Tensor::new(measurement.tensor.axes().to_vec(), samples).unwrap();
    let material = Material::open(&file(&measurement, Some(lobe(LobeCentre::Mirror, 3.0)))).unwrap();
    let wi = Direction::from_degrees(30.0, 0.0);
    for u in points(100) {
        let sample = material.sample(&[], Some(wi), u, SampleOptions::default()).unwrap().unwrap();
        let mut spectrum = [0.0; LAMBDAS];
        let place = Place { index: &[], wi: Some(wi), wo: Some(sample.direction) };
        material.evaluate(place, Interpolation::Smooth, &mut spectrum).unwrap();
        assert!(spectrum[0].is_nan());
        let mean = 0.5 * f64::from(spectrum[1] + spectrum[2]);
        let expected = mean * sample.direction.cos_theta() / sample.pdf;
        assert!((sample.weight / expected - 1.0).abs() < 1e-4, "{} {expected}", sample.weight);
    }
}

#[test]
fn one_wavelength_is_drawn_by_its_own_colour() {
    let ([bytes, _], lobe) = all().remove(0);
    let whole = Material::open(&bytes).unwrap();
    let wi = Direction::from_degrees(20.0, 80.0);
    let centre = lobe.under(wi).unwrap().draw([0.0, 0.0]);
    let density = |lambda: f64| {
        let sampler = whole.sampler_at(lambda).unwrap();
        for u in points(50) {
            let sample = sampler.sample(&[], Some(wi), u, SampleOptions::default()).unwrap().unwrap();
            let pdf = sampler.pdf(&[], Some(wi), sample.direction, SampleOptions::default()).unwrap();
            assert!((pdf / sample.pdf - 1.0).abs() < 1e-9);
        }
        sampler.pdf(&[], Some(wi), centre, SampleOptions::default()).unwrap()
    };
    assert!(density(500.0) < density(550.0) && density(550.0) < density(600.0));
}

#[test]
fn albedos_have_the_light_of_the_lobe() {
    for ([bytes, alone], lobe) in all() {
        let (whole, cells) = (Material::open(&bytes).unwrap(), Material::open(&alone).unwrap());
        let wi = match &whole.axes()[0] {
            Axis::Elevation(values) => Direction::from_degrees(values[2], 0.0),
            Axis::Triangles(mesh) => mesh.centroid(3),
            _ => panic!("incoming directions"),
        };
        let (mut found, mut expected) = ([0.0; LAMBDAS], [0.0; LAMBDAS]);
        whole.albedo(&[], Some(wi), Interpolation::Constant, &mut found).unwrap();
        cells.albedo(&[], Some(wi), Interpolation::Constant, &mut expected).unwrap();
        let light = lobe.under(wi).unwrap().light() as f32;
        for ((found, cells), colour) in found.iter().zip(expected).zip(lobe.colours()) {
            assert!((found - (cells + light * colour)).abs() < 1e-5 * found, "{found} {cells}");
        }
        let reflectance = whole.reflectance(Side::Reflected).unwrap();
        assert_eq!(reflectance.tensor.samples().len(), whole.axes()[0].len() * LAMBDAS);
    }
}

#[test]
fn decoded_samples_have_the_means_of_the_lobe() {
    for ([bytes, alone], lobe) in all() {
        let (decoded, cells) = (compress::decode(&bytes).unwrap(), compress::decode(&alone).unwrap());
        assert_eq!(decoded.measurement.tensor, cells.measurement.tensor);
        assert_eq!(decoded.summary.errors, cells.summary.errors);
        let whole = decoded.whole().unwrap();
        let material = Material::open(&bytes).unwrap();
        let opened = material.measurement().unwrap();
        for (a, b) in opened.tensor.samples().iter().zip(whole.tensor.samples()) {
            assert!((a - b).abs() <= 1e-4 * b.abs(), "{a} {b}");
        }
        let length = whole.tensor.len() / whole.tensor.axes()[0].len();
        for block in [0, 3] {
            let slice = compress::decode_block(&bytes, block).unwrap().whole(block).unwrap();
            assert_eq!(slice.samples(), &whole.tensor.samples()[block * length..][..length]);
        }
        // The sum of the means is the integral of the lobe, however narrow it is.
        let wi = match &whole.tensor.axes()[0] {
            Axis::Elevation(values) => Direction::from_degrees(values[1], 0.0),
            Axis::Triangles(mesh) => mesh.centroid(1),
            _ => panic!("incoming directions"),
        };
        let mesh = mesh(3);
        let sum = |samples: &[f32]| -> f64 {
            (0..mesh.len()).map(|i| f64::from(samples[length + i * LAMBDAS + 1]) * mesh.projected_solid_angle(i)).sum()
        };
        let light = sum(whole.tensor.samples()) - sum(cells.measurement.tensor.samples());
        let expected = lobe.under(wi).unwrap().light();
        assert!((light / expected - 1.0).abs() < 0.03, "{lobe}: {light} {expected}");
    }
}

#[test]
fn lobes_that_do_not_fit_are_refused() {
    let wrong = Lobe::new(LobeParameters { colours: vec![1.0], ..lobe(LobeCentre::Mirror, 1.0).parameters() }).unwrap();
    let settings = |policy, target| Settings { lobe: Some(wrong.clone()), policy, target, ..Settings::default() };
    let cells = cells(elevations());
    let error = compress(&cells, &settings(Policy::Rd, Target::ErL2(0.01)), &Silent).unwrap_err();
    assert!(error.to_string().contains("lobe beside the cells"), "{error}");
    // Every policy keeps a lobe that fits.
    for (policy, target) in [(Policy::Lossless, Target::Lossless), (Policy::Conventional, Target::ErL2(0.05))] {
        let settings = Settings { lobe: Some(lobe(LobeCentre::Mirror, 1.0)), ..settings(policy, target) };
        let bytes = compress(&cells, &settings, &Silent).unwrap().bytes;
        assert_eq!(compress::inspect(&bytes).unwrap().lobe, settings.lobe);
    }
}
