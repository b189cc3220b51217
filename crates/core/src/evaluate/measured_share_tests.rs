//! Tests of the measured share: scans in planes, caps, gaps, filled cells and lights.

use super::{Beyond, Directions, Interpolation, Material, MeasuredExtent, Pairs, Place, Side, measured_share};
use crate::domain::{
    Axis, AzimuthExtent, Azimuths, Direction, DirectionGrid, Domain, Frame, Measurement, Outside, Quantity, Sampling,
    Tensor, TriangleMesh, Unit, WavelengthGrid,
};

const BOTH_WAYS: [Interpolation; 2] = [Interpolation::Smooth, Interpolation::Constant];

fn every(step: f64, last: f64) -> Vec<f64> {
    (0..=360).map(|i| step * f64::from(i)).take_while(|angle| *angle <= last).collect()
}

fn grid(polar: Vec<f64>, azimuths: Option<(Vec<f64>, AzimuthExtent)>) -> DirectionGrid {
    let azimuths = azimuths.map(|(angles, extent)| Azimuths { angles, extent });
    DirectionGrid::new(Frame::Surface, polar, azimuths).unwrap()
}

/// A surface at two wavelengths under three elevations, with the values `value(incidence, outgoing)`.
fn surface(outgoing: Axis, value: impl Fn(usize, usize) -> f32) -> Material {
    let count = outgoing.len();
    let lambdas = Axis::Wavelength(WavelengthGrid::even(500.0, 100.0, 2).unwrap());
    let axes = vec![Axis::Elevation(vec![0.0, 30.0, 60.0]), outgoing, lambdas];
    let samples = (0..6 * count).map(|i| value(i / (2 * count), i / 2 % count)).collect();
    let tensor = Tensor::new(axes, samples).unwrap();
    let unit = Quantity::Brdf.default_unit();
    Material::of(Measurement::new(Quantity::Brdf, unit, Sampling::Point, tensor).unwrap()).unwrap()
}

fn at(material: &Material, [theta_i, phi_i]: [f64; 2], [theta_o, phi_o]: [f64; 2], how: Interpolation) -> f32 {
    let directions = [(theta_i, phi_i), (theta_o, phi_o)].map(|(theta, phi)| Direction::from_degrees(theta, phi));
    let mut one = [0.0; 2];
    let place = Place { index: &[], wi: Some(directions[0]), wo: Some(directions[1]) };
    material.evaluate(place, how, &mut one).unwrap();
    let mut single = [0.0; 1];
    material.at_wavelengths(place, how, Beyond::Masked, &[600.0], &mut single).unwrap();
    let mut batch = [0.0; 2];
    let [wi, wo] = [&directions[..1], &directions[1..]].map(|one| Some(Directions::of(one)));
    material.spectra(Pairs { index: &[], wi, wo }, how, &mut batch).unwrap();
    for other in [single[0], batch[0], material.weighted(place, how, &[1.0, 0.0]).unwrap()] {
        let is_same = if one[0].is_nan() { other.is_nan() } else { (other - one[0]).abs() <= 1e-5 };
        assert!(is_same, "{other} {one:?}");
    }
    one[0]
}

fn assert_refused(material: &Material, words: &str) {
    let up = Some(Direction::from_degrees(10.0, 0.0));
    let mut out = [0.0; 2];
    let refusals = [
        ("albedo", material.albedo(&[], up, Interpolation::Smooth, &mut out).err()),
        ("albedo", material.integrated(Side::Both, &[], up, Interpolation::Smooth, 0, &mut out).err()),
        ("reflectance", material.reflectance(Side::Both).err()),
        ("sample and no density (pdf)", material.sample(&[], up, [0.5; 2], None::<u8>).err()),
        ("sample and no density (pdf)", material.pdf(&[], up, Direction::from_degrees(0.0, 0.0), None::<u8>).err()),
        ("sample and no density (pdf)", material.prepare_sampling().err()),
        ("sample and no density (pdf)", material.sampler_at(550.0).err()),
    ];
    for (asked, refusal) in refusals {
        let refusal = refusal.unwrap().to_string();
        let expected =
            format!("no {asked}: {words}, expected 80 % or more in solid angle times cos θ, at the worst incidence");
        assert_eq!(refusal, expected);
    }
    let energy = material.energy().unwrap();
    assert!(energy.albedo.is_none() && energy.reason.unwrap().starts_with("no albedo: "));
    assert!(material.bsdf().is_err());
}

#[test]
fn scans_in_planes_have_values_in_them_alone() {
    let polar = every(10.0, 80.0);
    for (azimuths, words, source) in [
        (
            Some((vec![0.0, 180.0], AzimuthExtent::Mirrored)),
            "measured in the plane of incidence only: 0 % of the hemisphere",
            true,
        ),
        (
            Some((vec![0.0, 180.0], AzimuthExtent::Circle)),
            "measured in the plane of incidence only: 0 % of the hemisphere",
            true,
        ),
        (
            Some((vec![180.0], AzimuthExtent::Sector)),
            "measured in half of the plane of incidence only: 0 % of the hemisphere",
            false,
        ),
        (None, "measured in half of the plane of incidence only: 0 % of the hemisphere", false),
        (
            Some((vec![0.0, 120.0, 240.0], AzimuthExtent::Circle)),
            "measured in separate planes only: 0 % of the hemisphere",
            true,
        ),
    ] {
        let is_three = azimuths.as_ref().is_some_and(|(angles, _)| angles.len() == 3);
        let scan = surface(Axis::Grid(grid(polar.clone(), azimuths)), |_, _| 0.3);
        assert_refused(&scan, words);
        for how in BOTH_WAYS {
            for wi in [[30.0, 0.0], [45.0, 0.0], [41.0, 77.0]] {
                let value = |theta: f64, phi: f64| at(&scan, wi, [theta, wi[1] + phi], how);
                for theta in [20.0, 33.0, 79.0] {
                    let mirror = value(theta, if is_three { 120.0 } else { 180.0 });
                    assert!((mirror - 0.3).abs() < 1e-6, "{words} {mirror}");
                    assert_eq!(value(theta, 0.0).is_nan(), !source, "{words} {wi:?} {theta}");
                    for phi in [30.0, 90.0, 179.0, 200.0, 270.0, 359.0] {
                        assert!(value(theta, phi).is_nan(), "{words} {wi:?} {theta} {phi}");
                    }
                }
                assert!((value(0.0, 55.0) - 0.3).abs() < 1e-6, "the normal lies in every plane");
                assert_eq!(value(100.0, 90.0), 0.0, "light does not go through");
            }
        }
    }
}

#[test]
fn a_gap_between_azimuths_is_not_crossed() {
    let azimuths: Vec<f64> = every(10.0, 180.0).into_iter().filter(|phi| *phi <= 40.0 || *phi >= 140.0).collect();
    let outgoing = Axis::Grid(grid(every(5.0, 90.0), Some((azimuths, AzimuthExtent::Mirrored))));
    let scan = surface(outgoing, |_, _| 0.3);
    let share = scan.measured_share().unwrap();
    assert!((share.share - 80.0 / 180.0).abs() < 1e-3, "{share:?}");
    assert_refused(&scan, "measured in 44 % of the hemisphere");
    for (phi, is_known) in [(35.0, true), (40.0, true), (41.0, false), (139.0, false), (155.0, true), (250.0, false)] {
        let value = at(&scan, [30.0, 0.0], [50.0, phi], Interpolation::Smooth);
        assert_eq!(value.is_nan(), !is_known, "{phi}");
    }
    // A narrower gap is interpolated.
    let azimuths = vec![0.0, 45.0, 135.0, 180.0];
    let whole = surface(Axis::Grid(grid(every(5.0, 90.0), Some((azimuths, AzimuthExtent::Mirrored)))), |_, _| 0.3);
    assert!((whole.measured_share().unwrap().share - 1.0).abs() < 1e-3 && whole.bsdf().is_ok());
}

#[test]
fn a_cap_is_whole_up_to_where_its_light_is() {
    let around = || Some((every(30.0, 330.0), AzimuthExtent::Circle));
    for last in [50.0, 60.0, 65.0, 80.0, 85.0] {
        let cap = surface(Axis::Grid(grid(every(5.0, last), around())), |_, _| 0.3);
        let (share, expected) = (cap.measured_share().unwrap().share, f64::to_radians(last).sin().powi(2));
        assert!((share - expected).abs() < 2e-3, "{last}: {share}");
        assert_eq!(cap.energy().unwrap().albedo.is_some(), last > 64.0, "{last}");
    }
    // The incidence with the fewest measured directions counts; one without any was not measured.
    let polar = every(5.0, 85.0);
    let masked = |incidence: usize, outgoing: usize| match incidence {
        0 => f32::NAN,
        1 if outgoing < 12 * 12 => f32::NAN,
        _ => 0.3,
    };
    assert!(!surface(Axis::Grid(grid(polar.clone(), around())), masked).measured_share().unwrap().is_whole());
    let masked = |incidence: usize, _| if incidence == 0 { f32::NAN } else { 0.3 };
    assert!(surface(Axis::Grid(grid(polar, around())), masked).measured_share().unwrap().is_whole());
}

#[test]
fn triangles_count_where_they_are_neither_masked_nor_filled() {
    let mesh = TriangleMesh::new(Domain::Hemisphere, 4).unwrap();
    let is_near = |cell: usize| mesh.vertices(cell).iter().any(|[_, y, _]| y.abs() < 1e-9);
    let value = |_: usize, cell: usize| if is_near(cell) { 0.3 } else { f32::NAN };
    let scan = surface(Axis::Triangles(mesh), value);
    assert_eq!(scan.measured_share().unwrap().extent, MeasuredExtent::Plane);
    assert_refused(&scan, "measured in the plane of incidence only: 13 % of the hemisphere");
    assert!(surface(Axis::Triangles(mesh), |_, _| 0.3).measured_share().unwrap().is_whole());
    let filled = |runs: &[usize]| {
        let filled = format!(r#"{{"filled":{{"cells":1,"of":3072,"runs":{runs:?}}}}}"#);
        let whole = surface(Axis::Triangles(mesh), |_, _| 0.3).measurement().unwrap();
        measured_share(&whole, Some(&filled)).unwrap()
    };
    assert!(!filled(&[0, 900]).is_whole() && filled(&[3000, 72]).is_whole() && filled(&[0, 1024]).is_whole());
    assert!(measured_share(&scan.measurement().unwrap(), Some("not JSON")).is_some());
}

#[test]
fn a_light_is_whole_in_a_hemisphere_or_if_its_format_says_that_it_is_dark_elsewhere() {
    let lamp = |polar: Vec<f64>, outside: Outside| {
        let grid = grid(polar, None).with_outside(outside);
        let tensor = Tensor::new(vec![Axis::Grid(grid.clone())], vec![1.0; grid.len()]).unwrap();
        Material::of(Measurement::new(Quantity::Edf, Unit::Candela, Sampling::Point, tensor).unwrap()).unwrap()
    };
    for (last, outside, is_whole) in [
        (90.0, Outside::Masked, true),
        (80.0, Outside::Masked, true),
        (60.0, Outside::Masked, false),
        (60.0, Outside::Dark, true),
        (120.0, Outside::Masked, false),
        (180.0, Outside::Masked, true),
    ] {
        let lamp = lamp(every(5.0, last), outside);
        let energy = lamp.energy().unwrap();
        assert_eq!((energy.flux.is_some(), energy.reason.is_none()), (is_whole, is_whole), "{last} {outside}");
        let figures = lamp.luminaire().remove(0);
        let zones: Vec<bool> = figures.zones.iter().map(|zone| zone.flux.is_some()).collect();
        assert_eq!((figures.flux.is_some(), zones), (is_whole, vec![is_whole; 6]), "{last} {outside}");
        assert_eq!(figures.peak.map(|peak| peak.value), Some(1.0), "{last} {outside}");
    }
    let energy = lamp(every(5.0, 60.0), Outside::Masked).energy().unwrap();
    let reason = "no flux: measured in 50 % of the hemisphere, expected 80 % or more in solid angle";
    assert_eq!(energy.reason.as_deref(), Some(reason));
}
