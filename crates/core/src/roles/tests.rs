//! Views return the values of the material, and are refused for materials of another role before any query.

use super::RoleError;
use crate::domain::{Axis, Direction, Domain, Measurement, Quantity, Sampling, Tensor, TriangleMesh, WavelengthGrid};
use crate::evaluate::{Beyond, Interpolation, Material, Place, SampleOptions};

fn triangles(domain: Domain, level: u8) -> Axis {
    Axis::Triangles(TriangleMesh::new(domain, level).unwrap())
}

fn wavelengths() -> Axis {
    Axis::Wavelength(WavelengthGrid::even(400.0, 100.0, 4).unwrap())
}

fn material(quantity: Quantity, axes: Vec<Axis>) -> Material {
    let count: usize = axes.iter().map(Axis::len).product();
    let samples = (0..count).map(|i| 0.1 + 0.05 * ((i * 7) % 11) as f32).collect();
    let tensor = Tensor::new(axes, samples).unwrap();
    let measurement = Measurement::new(quantity, quantity.default_unit(), Sampling::Average, tensor).unwrap();
    Material::of(measurement).unwrap()
}

fn brdf() -> Material {
    let axes = vec![triangles(Domain::Hemisphere, 1), triangles(Domain::Hemisphere, 2), wavelengths()];
    material(Quantity::Brdf, axes)
}

#[test]
fn a_surface_answers_as_its_material_does() {
    let material = brdf();
    let (bsdf, at) = (material.bsdf().unwrap(), material.bsdf().unwrap().at([450.0, 650.0, 900.0]).unwrap());
    let chosen = material.choose(&[450.0, 650.0, 900.0], Beyond::Nearest).unwrap();
    let wo = Direction::from_degrees(50.0, 200.0);
    for theta in [0.0, 35.0, 80.0] {
        let wi = Direction::from_degrees(theta, 20.0);
        let place = Place { index: &[], wi: Some(wi), wo: Some(wo) };
        let mut expected = vec![0.0; 4];
        material.evaluate(place, Interpolation::Smooth, &mut expected).unwrap();
        assert_eq!(bsdf.eval(wi, wo), expected);
        assert_eq!(at.eval(wi, wo), chosen.at(place, Interpolation::Smooth).unwrap()[..3]);
        for u in [[0.0, 0.0], [0.3, 0.9], [1.0, 1.0]] {
            let expected = material.sample(&[], Some(wi), u, SampleOptions::default()).unwrap();
            let drawn = bsdf.sample(wi, u);
            assert_eq!(
                drawn.map(|d| (d.wo, d.weight, d.pdf)),
                expected.map(|d| (d.direction, d.weight, d.pdf)),
                "{theta} {u:?}"
            );
            let Some(drawn) = drawn else { continue };
            assert!((bsdf.pdf(wi, drawn.wo) / drawn.pdf - 1.0).abs() < 1e-6);
            assert_eq!(at.pdf(wi, drawn.wo), bsdf.pdf(wi, drawn.wo));
            let of_path = at.sample(wi, u).unwrap();
            let f = at.eval(wi, of_path.wo);
            for (weight, f) in of_path.weight.into_iter().zip(f) {
                let expected = f64::from(f) * of_path.wo.cos_theta() / of_path.pdf;
                assert!((f64::from(weight) / expected - 1.0).abs() < 1e-4, "{weight} {expected}");
            }
        }
    }
    // Values are constant beyond the last wavelength.
    let f = bsdf.eval(wo, wo);
    assert!((at.eval(wo, wo)[2] / f[3] - 1.0).abs() < 1e-5);
}

#[test]
fn outside_their_domains_surfaces_are_dark_and_points_are_held_in_the_square() {
    let material = brdf();
    let bsdf = material.bsdf().unwrap();
    let (up, down) = (Direction::from_degrees(10.0, 0.0), Direction::from_degrees(170.0, 0.0));
    assert_eq!(bsdf.eval(down, up), [0.0; 4]);
    assert_eq!(bsdf.eval(up, down), [0.0; 4]);
    assert_eq!((bsdf.pdf(down, up), bsdf.pdf(up, down)), (0.0, 0.0));
    assert_eq!(bsdf.albedo(down), [0.0; 4]);
    assert!(bsdf.sample(down, [0.5, 0.5]).is_none());
    let at = bsdf.at([500.0]).unwrap();
    assert_eq!(at.eval(down, up), [0.0]);
    assert!(at.sample(down, [0.5, 0.5]).is_none());
    assert_eq!(bsdf.sample(up, [-1.0, f64::NAN]), bsdf.sample(up, [0.0, 0.0]));
}

#[test]
fn a_role_is_refused_once_and_says_why() {
    let refused = |error: RoleError| error.to_string();
    let surface = brdf();
    assert_eq!(
        refused(surface.emitter().unwrap_err()),
        "this material is of quantity brdf, expected an edf (a luminaire)"
    );
    assert_eq!(refused(surface.phase().unwrap_err()), "this material is of quantity brdf, expected a phase function");
    assert_eq!(
        refused(surface.spectrum().unwrap_err()),
        "kinds of directions (incoming, outgoing) of this brdf: found incoming and outgoing directions, expected no directions"
    );
    let lamp = material(Quantity::Edf, vec![triangles(Domain::Sphere, 1), wavelengths()]);
    assert_eq!(refused(lamp.bsdf().unwrap_err()), "this material is of quantity edf, expected a brdf, btdf or bsdf");
    let table = material(Quantity::Reflectance, vec![triangles(Domain::Hemisphere, 1), wavelengths()]);
    assert_eq!(
        refused(table.spectrum().unwrap_err()),
        "kinds of directions (incoming, outgoing) of this reflectance: found incoming directions alone, expected no directions"
    );
    let several = material(
        Quantity::Edf,
        vec![Axis::Index { count: 3, labels: Vec::new() }, triangles(Domain::Sphere, 1), Axis::Rgb],
    );
    assert_eq!(
        refused(several.emitter().unwrap_err()),
        "the option index: found 0 numbers, expected 1, one for each axis of numbered entries (columns of a \
         table, scan positions)"
    );
    let numbers = vec![1];
    let second = several.emitter_at(&numbers).unwrap();
    drop(numbers);
    assert_eq!(second.lambdas(), 3);
    assert!(refused(several.emitter_at(&[3]).unwrap_err()).contains("expected 0 to 2"));
    let last = several.emitter_at(&[2]).unwrap();
    assert!(last.sample([0.2, 0.7]).unwrap().weight > 0.0);
    assert_eq!(last.flux().len(), 3);
    assert!(refused(last.at([500.0]).unwrap_err()).contains("this edf has none"));
}

#[test]
fn a_spectrum_is_its_samples_and_lines_between() {
    let table = material(Quantity::Spectrum, vec![wavelengths()]);
    let spectrum = table.spectrum().unwrap();
    let samples = spectrum.samples();
    assert_eq!(spectrum.wavelengths().unwrap(), [400.0, 500.0, 600.0, 700.0]);
    let [first, between, outside] = spectrum.values_at([400.0, 550.0, 701.0]).unwrap();
    assert_eq!(first, samples[0]);
    assert!((between - 0.5 * (samples[1] + samples[2])).abs() < 1e-6 && outside.is_nan());
}
