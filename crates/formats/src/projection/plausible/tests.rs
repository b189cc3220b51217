//! Tests of the plausibility checks: physical surfaces pass, and each violation gives one line.

use super::*;
use crate::domain::Direction;
use crate::formats::{Acquisition, Interpretation, read};
use std::fmt::Write as _;

const HEAD: &str =
    "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n# angle_unit: deg\n";

fn csv(text: &str) -> Acquisition {
    read(text.as_bytes(), &Interpretation::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// Test data: an isotropic table at the given incoming polar angles, every 10° of outgoing theta and every 30° of phi.
fn grid(incidences: &[f64], f: impl Fn(f64, f64, f64) -> f64) -> Acquisition {
    let mut text = format!("{HEAD}# isotropic: true\n# theta_o_covers: 0 90\ntheta_i,theta_o,phi_o,value\n");
    for &theta_i in incidences {
        for theta_o in (0..=90).step_by(10).map(f64::from) {
            for phi_o in (0..360).step_by(30).map(f64::from) {
                let _ = writeln!(text, "{theta_i},{theta_o},{phi_o},{}", f(theta_i, theta_o, phi_o));
            }
        }
    }
    csv(&text)
}

/// Test data: a scan of the hemisphere at outgoing directions on a spiral.
fn spiral(incidences: &[f64], count: usize, f: impl Fn(f64, f64, f64) -> f64) -> Acquisition {
    let mut text = format!("{HEAD}# isotropic: true\ntheta_i,theta_o,phi_o,v500,v600\n");
    for &theta_i in incidences {
        for i in 0..count {
            let theta = (1.0 - (i as f64 + 0.5) / count as f64).acos().to_degrees();
            let phi = (137.507_764 * i as f64).rem_euclid(360.0);
            let value = f(theta_i, theta, phi);
            let _ = writeln!(text, "{theta_i},{theta},{phi},{value},{}", 0.5 * value);
        }
    }
    csv(&text)
}

const WHITE: f64 = std::f64::consts::FRAC_1_PI;

#[test]
fn a_white_diffuser_sends_out_all_light_and_no_more() {
    for acquisition in [grid(&[0.0, 30.0, 60.0], |_, _, _| WHITE), spiral(&[0.0, 45.0], 900, |_, _, _| WHITE)] {
        let albedo = plausibility(&acquisition).albedo.unwrap();
        assert!((albedo.albedo - 1.0).abs() < 0.015 && albedo.above == 0, "{albedo:?}");
        assert_eq!(albedo.remark(), None);
    }
}

#[test]
fn an_albedo_above_1_is_told_with_its_place() {
    let brighter = |theta_i: f64, _: f64, _: f64| if theta_i > 40.0 { 1.25 * WHITE } else { 0.5 * WHITE };
    let on_grid = plausibility(&grid(&[0.0, 30.0, 60.0], brighter)).remarks();
    assert!(on_grid[0].message.starts_with("albedo above 1 under 1 of 3 incoming directions: 1.25"), "{on_grid:?}");
    assert!(on_grid[0].message.contains("under theta_i 60.0°;"), "{on_grid:?}");
    let remarks = plausibility(&spiral(&[20.0, 50.0], 900, brighter)).remarks();
    assert!(
        remarks[0].message.contains("under theta_i 50.0° at 500 nm") && remarks[0].message.contains("1 of 2"),
        "{remarks:?}"
    );
}

#[test]
fn a_sample_on_the_peak_of_a_narrow_lobe_gives_no_albedo_above_1() {
    // The first sample of the spiral, 1.9° from the normal, represents light of 2.
    let peak = |base: f64| move |_: f64, theta: f64, _: f64| if theta < 2.0 { 300.0 } else { base * WHITE };
    let found = plausibility(&spiral(&[0.0, 45.0], 900, peak(0.5)));
    let albedo = found.albedo.as_ref().unwrap();
    assert!((albedo.albedo - 0.5).abs() < 0.015 && albedo.above == 0, "{albedo:?}");
    assert_eq!(albedo.remark(), None);
    // A base that is too bright by itself is told.
    assert!(plausibility(&spiral(&[0.0, 45.0], 900, peak(1.1))).albedo.unwrap().remark().is_some());
}

#[test]
fn no_albedo_is_made_up_where_values_stand_for_no_area() {
    let mut plane = format!("{HEAD}theta_i,theta_o,phi_o,value\n");
    let mut relative = HEAD.replace("1/sr", "relative") + "theta_i,theta_o,phi_o,value\n";
    for theta in (0..90).step_by(5) {
        for phi in [0, 180] {
            let _ = writeln!(plane, "30,{theta},{phi},100");
        }
        for phi in (0..360).step_by(30) {
            let _ = writeln!(relative, "30,{theta},{phi},100");
        }
    }
    for text in [plane, relative] {
        assert_eq!(plausibility(&csv(&text)).albedo, None);
    }
}

#[test]
fn cells_over_triangles_are_summed_by_their_projected_solid_angles() {
    let manifest = serde_json::json!({
        "quantity": "brdf", "value_unit": "1/sr", "cosine_included": false, "axes": ["hemi:1", "hemi:1", "rgb"],
    });
    let values: Vec<f32> = (0..16 * 16 * 3).map(|i| if i % 3 == 1 { 2.0 * WHITE as f32 } else { 0.1 }).collect();
    let mut bytes = crate::formats::npy_header(&[16, 16, 3]);
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    let how = Interpretation { axes: Some(manifest), ..Interpretation::default() };
    let found = plausibility(&read(&bytes, &how).unwrap());
    let albedo = found.albedo.unwrap();
    assert!((albedo.albedo - 2.0).abs() < 1e-3 && albedo.band == Some(Band::Channel(1)), "{albedo:?}");
    assert_eq!((albedo.above, albedo.of, albedo.all), (16, 16, 16));
    let reciprocity = found.reciprocity.unwrap();
    assert_eq!((reciprocity.difference, reciprocity.is_interpolated), (0.0, false));
}

/// Test data: a reciprocal BRDF with a lobe that follows the mirror direction.
fn glossy(theta_i: f64, theta_o: f64, phi_o: f64) -> f64 {
    let [wi, wo] = [Direction::from_degrees(theta_i, 0.0), Direction::from_degrees(theta_o, phi_o)].map(Direction::xyz);
    let h: [f64; 3] = std::array::from_fn(|k| wi[k] + wo[k]);
    let cosine = h[2] / h.iter().map(|x| x * x).sum::<f64>().sqrt();
    0.1 + 0.3 * (20.0 * (cosine - 1.0)).exp()
}

#[test]
fn reciprocity_is_told_by_exchanged_samples() {
    let all: Vec<f64> = (0..=90).step_by(10).map(f64::from).collect();
    let found = plausibility(&grid(&all, glossy)).reciprocity.unwrap();
    assert!(found.difference < 1e-5 && !found.is_interpolated && found.values > 100, "{found:?}");
    // A lobe on the side of +y for all incoming directions: exchanging reverses the azimuth.
    let odd =
        |i: f64, o: f64, phi: f64| glossy(i, o, phi) * (1.0 + 0.2 * o.to_radians().sin() * phi.to_radians().sin());
    let found = plausibility(&grid(&all, odd)).reciprocity.unwrap();
    assert!(found.difference > 0.05, "{found:?}");
    let tilted = |i: f64, o: f64, phi: f64| glossy(i, o, phi) * (1.0 + 0.004 * i);
    let found = plausibility(&grid(&all, tilted));
    let reciprocity = found.reciprocity.unwrap();
    assert!((0.05..0.2).contains(&reciprocity.difference), "{reciprocity:?}");
    assert!(
        found.remarks().iter().any(|remark| remark.message.contains("equal by reciprocity, differ by")),
        "{found:?}"
    );
}

#[test]
fn reciprocity_between_incidences_is_interpolated_and_says_so() {
    let found = plausibility(&grid(&[0.0, 15.0, 35.0, 55.0, 75.0], glossy)).reciprocity.unwrap();
    assert!(found.is_interpolated && found.difference < 0.05, "{found:?}");
    // The mirror direction is its own exchanged pair, so it shows no difference.
    assert_eq!(plausibility(&grid(&[45.0], glossy)).reciprocity, None);
}

#[test]
fn scattered_samples_are_exchanged_where_both_are_stated() {
    let mut text = format!("{HEAD}theta_i,phi_i,theta_o,phi_o,value\n");
    for i in 0..60 {
        let (a, b) = (1.3 * f64::from(i), 80.0 - 1.1 * f64::from(i));
        let (phi_a, phi_b) = (f64::from(7 * i % 360), f64::from(131 * i % 360));
        let _ = writeln!(text, "{a},{phi_a},{b},{phi_b},{}\n{b},{phi_b},{a},{phi_a},{}", 1.0, 1.1);
    }
    let found = plausibility(&csv(&text)).reciprocity.unwrap();
    assert!((found.difference - 0.1 / 1.05).abs() < 1e-6 && found.values == 120, "{found:?}");
    assert_eq!(plausibility(&spiral(&[30.0], 100, glossy)).reciprocity, None);
}

#[test]
fn negative_values_are_counted_against_the_largest() {
    let found =
        plausibility(&csv(&format!("{HEAD}theta_i,theta_o,phi_o,value\n0,10,0,-0.5\n0,20,0,2\n0,30,0,\n0,40,0,1\n")));
    assert_eq!(found.negatives, Some(Negatives { values: 1, of: 3, largest: Some(0.25) }));
    let remark = "1 of 3 values (33.33 %) are negative; the largest has 25.00 % of the magnitude of the largest value";
    assert_eq!(found.remarks().iter().map(|note| &note.message).collect::<Vec<_>>(), [remark]);
    let all = plausibility(&csv(&format!("{HEAD}theta_i,theta_o,phi_o,value\n0,10,0,-0.5\n0,20,0,-2\n")));
    assert!(all.remarks()[0].message.ends_with("are negative; no value is positive"), "{all:?}");
    assert_eq!(plausibility(&grid(&[0.0], glossy)).negatives, None);
}

#[test]
fn a_lobe_as_wide_as_the_aperture_is_told_of() {
    // A scan in the plane of incidence, 0.1° apart, through a lobe that is 0.8° wide.
    let scan = |header: &str| {
        let mut text = format!("{HEAD}{header}theta_i,theta_o,phi_o,value\n");
        for i in -60..=60 {
            let off = 0.1 * f64::from(i);
            let height = 0.1 + 5.0 * (-(off / 0.4).powi(2) * std::f64::consts::LN_2).exp();
            let _ = writeln!(text, "40,{},180,{height}", 40.0 + off);
        }
        plausibility(&csv(&text)).unresolved
    };
    assert_eq!(scan(""), None);
    assert_eq!(scan("# detector_aperture: 0.7\n"), None);
    let told = scan("# detector_aperture: 1\n# source_divergence: 0.01\n").unwrap();
    assert!(
        told.message.starts_with("the lobe of 0.8") && told.message.contains("than the detector's aperture of 1°:"),
        "{told}"
    );
    // A diffuser has no lobe, however wide the aperture.
    let mut diffuser = grid(&[0.0, 30.0], |_, _, _| WHITE);
    diffuser.instrument.detector_aperture = Some(180.0);
    assert_eq!(plausibility(&diffuser).unresolved, None);
}
