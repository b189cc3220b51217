//! Colours against colour-science (`tests/golden/colour_science.py`), against published tables, and against identities.

use super::tables::Curve;
use super::*;
use crate::domain::WavelengthGrid;
use serde_json::Value;

/// Test colours of CIEDE2000 by G. Sharma, W. Wu, E. N. Dalal (2005), table 1: L*, a*, b* of two colours and their
/// difference.
#[rustfmt::skip]
const SHARMA: [[f64; 7]; 34] = [
    [50.0, 2.6772, -79.7751, 50.0, 0.0, -82.7485, 2.0425],
    [50.0, 3.1571, -77.2803, 50.0, 0.0, -82.7485, 2.8615],
    [50.0, 2.8361, -74.02, 50.0, 0.0, -82.7485, 3.4412],
    [50.0, -1.3802, -84.2814, 50.0, 0.0, -82.7485, 1.0],
    [50.0, -1.1848, -84.8006, 50.0, 0.0, -82.7485, 1.0],
    [50.0, -0.9009, -85.5211, 50.0, 0.0, -82.7485, 1.0],
    [50.0, 0.0, 0.0, 50.0, -1.0, 2.0, 2.3669],
    [50.0, -1.0, 2.0, 50.0, 0.0, 0.0, 2.3669],
    [50.0, 2.49, -0.001, 50.0, -2.49, 0.0009, 7.1792],
    [50.0, 2.49, -0.001, 50.0, -2.49, 0.001, 7.1792],
    [50.0, 2.49, -0.001, 50.0, -2.49, 0.0011, 7.2195],
    [50.0, 2.49, -0.001, 50.0, -2.49, 0.0012, 7.2195],
    [50.0, -0.001, 2.49, 50.0, 0.0009, -2.49, 4.8045],
    [50.0, -0.001, 2.49, 50.0, 0.001, -2.49, 4.8045],
    [50.0, -0.001, 2.49, 50.0, 0.0011, -2.49, 4.7461],
    [50.0, 2.5, 0.0, 50.0, 0.0, -2.5, 4.3065],
    [50.0, 2.5, 0.0, 73.0, 25.0, -18.0, 27.1492],
    [50.0, 2.5, 0.0, 61.0, -5.0, 29.0, 22.8977],
    [50.0, 2.5, 0.0, 56.0, -27.0, -3.0, 31.903],
    [50.0, 2.5, 0.0, 58.0, 24.0, 15.0, 19.4535],
    [50.0, 2.5, 0.0, 50.0, 3.1736, 0.5854, 1.0],
    [50.0, 2.5, 0.0, 50.0, 3.2972, 0.0, 1.0],
    [50.0, 2.5, 0.0, 50.0, 1.8634, 0.5757, 1.0],
    [50.0, 2.5, 0.0, 50.0, 3.2592, 0.335, 1.0],
    [60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644],
    [63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.263],
    [61.2901, 3.7196, -5.3901, 61.4292, 2.248, -4.962, 1.8731],
    [35.0831, -44.1164, 3.7933, 35.0232, -40.0716, 1.5901, 1.8645],
    [22.7233, 20.0904, -46.694, 23.0331, 14.973, -42.5619, 2.0373],
    [36.4612, 47.858, 18.3852, 36.2715, 50.5065, 21.2231, 1.4146],
    [90.8027, -2.0831, 1.441, 91.1528, -1.6435, 0.0447, 1.4441],
    [90.9257, -0.5406, -0.9208, 88.6381, -0.8985, -0.7239, 1.5381],
    [6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377],
    [2.0776, 0.0795, -1.135, 0.9033, -0.0636, -0.5514, 0.9082],
];

const PATCHES: &str = include_str!("../../../../../data/colorchecker_n_ohta.csv");

pub(super) fn golden() -> Value {
    serde_json::from_str(include_str!("../../../../../tests/golden/colour_science.json")).unwrap()
}

pub(super) fn grid(start: f64, step: f64, count: usize) -> WavelengthGrid {
    WavelengthGrid::even(start, step, count).unwrap()
}

pub(super) fn patch(k: usize) -> Vec<f32> {
    Curve::of_table(PATCHES, k + 1).values().iter().map(|&v| v as f32).collect()
}

pub(super) fn array(xyz: Xyz) -> [f64; 3] {
    [xyz.x, xyz.y, xyz.z]
}

pub(super) fn triple(value: &Value) -> [f64; 3] {
    [0, 1, 2].map(|k| value[k].as_f64().unwrap())
}

pub(super) fn relative(found: [f64; 3], wanted: [f64; 3]) -> f64 {
    found.iter().zip(wanted).map(|(f, w)| (f - w).abs() / w.abs()).fold(0.0, f64::max)
}

#[test]
pub(super) fn patches_have_the_colours_of_colour_science() {
    let golden = golden();
    let patches = grid(380.0, 5.0, 81);
    for &illuminant in Illuminant::ALL {
        let weights = Tristimulus::reflectance(&patches, illuminant).unwrap();
        let white = weights.white();
        let wanted = golden["patches"][illuminant.name()].as_array().unwrap();
        assert_eq!(wanted.len(), 24);
        let labs: Vec<Lab> = (0..24)
            .map(|k| {
                // The methods agree up to the rounding of reflectances to f32.
                let xyz = weights.xyz(&patch(k));
                let off = relative(array(xyz), triple(&wanted[k]["xyz"]));
                assert!(off < 1e-7, "{illuminant}, patch {k}: {off}");
                let lab = Lab::of(xyz, white);
                let [l, a, b] = triple(&wanted[k]["lab"]);
                let off = (lab.l - l).abs().max((lab.a - a).abs()).max((lab.b - b).abs());
                assert!(off < 1e-5, "{illuminant}, patch {k}: {off}");
                lab
            })
            .collect();
        let wanted = golden["differences"][illuminant.name()].as_array().unwrap();
        for (pair, wanted) in labs.windows(2).zip(wanted) {
            let (found, wanted) = (ciede2000(pair[0], pair[1]), wanted.as_f64().unwrap());
            assert!((found - wanted).abs() < 1e-6 * wanted, "{illuminant}: {found} for {wanted}");
        }
    }
}

#[test]
fn other_methods_are_near() {
    let golden = golden();
    let weights = Tristimulus::reflectance(&grid(380.0, 5.0, 81), Illuminant::D65).unwrap();
    for (method, most) in [("at_5_nm", 5e-3), ("astm_e308", 5e-3)] {
        for k in 0..24 {
            let off = relative(array(weights.xyz(&patch(k))), triple(&golden[method][k]));
            assert!(off < most, "{method}, patch {k}: {off}");
        }
    }
}

#[test]
fn emission_is_in_lumens() {
    let golden = golden();
    for &illuminant in Illuminant::ALL {
        let lambdas = grid(380.0, 5.0, 81);
        let power: Vec<f32> = lambdas.values().iter().map(|&l| illuminant.power().at(l) as f32).collect();
        let found = Tristimulus::emission(&lambdas).unwrap().xyz(&power);
        assert!(relative(array(found), triple(&golden["lights"][illuminant.name()])) < 1e-7, "{illuminant}");
    }
    // A line of 1 W/sr at 555 nm is 683 cd.
    let mut lambdas: Vec<f64> = (0..41).map(|i| 380.0 + 10.0 * f64::from(i)).chain([554.9, 555.0, 555.1]).collect();
    lambdas.sort_by(f64::total_cmp);
    let line = WavelengthGrid::listed(lambdas).unwrap();
    let samples: Vec<f32> = line.values().iter().map(|&l| if l == 555.0 { 10.0 } else { 0.0 }).collect();
    let xyz = Tristimulus::emission(&line).unwrap().xyz(&samples);
    assert!((xyz.y - 683.0).abs() < 0.1, "{}", xyz.y);
}

#[test]
fn the_perfect_reflector_is_white_on_every_grid() {
    let uneven: Vec<f64> = (0..300).map(|i| 390.0 + f64::from(i) * 1.1 + 0.3 * f64::from(i % 3)).collect();
    for lambdas in [
        grid(380.0, 5.0, 81),
        grid(400.0, 10.0, 31),
        grid(395.0, 20.0, 17),
        grid(300.0, 0.3, 2000),
        grid(360.0, 1.0, 471),
        WavelengthGrid::listed(uneven).unwrap(),
    ] {
        for &illuminant in Illuminant::ALL {
            let weights = Tristimulus::reflectance(&lambdas, illuminant).unwrap();
            let white = weights.xyz(&vec![1.0; lambdas.len()]);
            assert!((white.y - 100.0).abs() < 1e-9);
            let fine = Tristimulus::reflectance(&grid(380.0, 1.0, 401), illuminant).unwrap().white();
            assert!(relative(array(white), array(fine)) < 2e-3, "{illuminant}: {white:?} {fine:?}");
            let lab = Lab::of(white, weights.white());
            assert!((lab.l - 100.0).abs() < 1e-9 && lab.a.abs() < 1e-9 && lab.b.abs() < 1e-9);
        }
    }
}

#[test]
fn a_straight_spectrum_has_one_colour_on_every_grid() {
    let straight = |lambdas: &WavelengthGrid| -> Vec<f32> {
        lambdas.values().iter().map(|l| (0.1 + (l - 380.0) / 500.0) as f32).collect()
    };
    let reference = grid(380.0, 1.0, 401);
    let wanted = Tristimulus::reflectance(&reference, Illuminant::D65).unwrap().xyz(&straight(&reference));
    for lambdas in [grid(380.0, 20.0, 21), grid(360.0, 10.0, 43), grid(379.5, 3.7, 110)] {
        let found = Tristimulus::reflectance(&lambdas, Illuminant::D65).unwrap().xyz(&straight(&lambdas));
        assert!(relative(array(found), array(wanted)) < 2e-4, "{lambdas:?}: {found:?} {wanted:?}");
    }
}

#[test]
fn ends_are_held_where_the_standard_allows_it() {
    let short = grid(400.0, 10.0, 31);
    let long = grid(380.0, 10.0, 41);
    let samples: Vec<f32> = (0..31).map(|i| 0.2 + 0.02 * i as f32).collect();
    let held = [&[samples[0]; 2][..], &samples, &[samples[30]; 8]].concat();
    let of = |lambdas: &WavelengthGrid, s: &[f32]| Tristimulus::reflectance(lambdas, Illuminant::A).unwrap().xyz(s);
    assert!(relative(array(of(&short, &samples)), array(of(&long, &held))) < 1e-12);
}

#[test]
fn wavelengths_that_are_not_enough_are_refused() {
    for bad in [grid(200.0, 1.0, 231), grid(410.0, 5.0, 80), grid(380.0, 5.0, 60), grid(550.0, 1.0, 1)] {
        let found = Tristimulus::emission(&bad).unwrap_err();
        assert!(matches!(found, ColourError::Uncovered { .. }), "{found}");
    }
    let wide = Tristimulus::reflectance(&grid(380.0, 25.0, 17), Illuminant::D65).unwrap_err();
    assert_eq!(wide, ColourError::Gap { below: 380.0, above: 405.0 });
    let lambdas = [300.0].into_iter().chain((0..41).map(|i| 380.0 + f64::from(i) * 10.0)).collect();
    let elsewhere = WavelengthGrid::listed(lambdas).unwrap();
    assert!(Tristimulus::emission(&elsewhere).is_ok(), "gaps outside 380 to 780 nm do not count");
}

#[test]
fn lab_is_undone_by_its_inverse() {
    let white = Tristimulus::reflectance(&grid(380.0, 5.0, 81), Illuminant::D65).unwrap().white();
    for x in [-5.0, 0.0, 0.3, 0.8857, 20.0, 95.0, 400.0] {
        for y in [0.0, 0.5, 30.0, 150.0] {
            for z in [0.0, 0.9, 60.0] {
                let xyz = Xyz { x, y, z };
                let back = Lab::of(xyz, white).xyz(white);
                for (found, wanted) in array(back).into_iter().zip(array(xyz)) {
                    assert!((found - wanted).abs() < 1e-12 * wanted.abs().max(1.0) * 10.0, "{back:?} {xyz:?}");
                }
            }
        }
    }
}

#[test]
fn differences_are_those_of_sharmas_table() {
    for (row, [l1, a1, b1, l2, a2, b2, wanted]) in SHARMA.into_iter().enumerate() {
        let (one, two) = (Lab { l: l1, a: a1, b: b1 }, Lab { l: l2, a: a2, b: b2 });
        for found in [ciede2000(one, two), ciede2000(two, one)] {
            assert!((found - wanted).abs() < 1e-4, "pair {}: {found}, expected {wanted}", row + 1);
        }
        assert_eq!(ciede2000(one, one), 0.0);
    }
}

#[test]
fn differences_are_finite_far_outside_the_solid() {
    let far = [Lab { l: 5000.0, a: 1e4, b: -1e4 }, Lab { l: -50.0, a: -1e6, b: 0.0 }, Lab::default()];
    for one in far {
        for two in far {
            let difference = ciede2000(one, two);
            assert!(difference.is_finite() && (difference == 0.0) == (one == two), "{one:?} {two:?}: {difference}");
        }
    }
}

#[test]
fn srgb_is_that_of_the_standard() {
    let golden = golden();
    for (k, row) in srgb::FROM_XYZ.into_iter().enumerate() {
        assert!(relative(row, triple(&golden["matrix"][k])) < 1e-12);
    }
    // Amendment 1 (2003) prints the inverse with seven decimals.
    let printed = [
        [3.240_625_5, -1.537_208_0, -0.498_628_6],
        [-0.968_930_7, 1.875_756_1, 0.041_517_5],
        [0.055_710_1, -0.204_021_1, 1.056_995_9],
    ];
    for (found, wanted) in srgb::FROM_XYZ.into_iter().flatten().zip(printed.into_iter().flatten()) {
        assert!((found - wanted).abs() <= 5.1e-8, "{found} {wanted}");
    }
    for pair in golden["srgb"].as_array().unwrap() {
        let (linear, encoded) = (pair[0].as_f64().unwrap(), pair[1].as_f64().unwrap());
        assert!((linear_to_srgb(linear) - encoded).abs() < 1e-12, "{linear}");
        assert!((srgb_to_linear(linear_to_srgb(linear)) - linear).abs() < 1e-7, "{linear}");
    }
    for rgb in [[1.0, 1.0, 1.0], [0.2, -0.1, 3.0]] {
        let back = xyz_to_linear(linear_to_xyz(rgb));
        assert!(back.iter().zip(rgb).all(|(b, c)| (b - c).abs() < 1e-14), "{back:?}");
    }
    let white = Tristimulus::reflectance(&grid(380.0, 5.0, 81), Illuminant::D65).unwrap().white();
    assert!(xyz_to_linear(white).iter().all(|c| (c - 1.0).abs() < 1e-3));
}
