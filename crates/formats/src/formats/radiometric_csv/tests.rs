//! radiometric-csv: long and wide forms against each other, grids and scattered directions, and every problem at once.

use super::*;
use crate::domain::{Axis, Direction, Quantity, Unit};
use crate::formats::NoteKind;
use crate::formats::acquisition::{AngleGrid, AzimuthExtent, Samples, Scattered};
use crate::formats::error::Position;
use crate::formats::instrument::Instrument;
use crate::formats::read as read_any;
use std::fmt::Write as _;

const BRDF: &str = "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n\
                    # angle_unit: deg\n# wavelength_unit: nm\n# direction_convention: outward\n";

fn plain(text: &str) -> Result<Acquisition, FormatError> {
    read_any(text.as_bytes(), &Interpretation::default())
}

fn good(text: &str) -> Acquisition {
    plain(text).unwrap_or_else(|error| panic!("{error}"))
}

fn grid(acquisition: &Acquisition) -> &AngleGrid {
    match &acquisition.samples {
        Samples::Grid(grid) => grid,
        other => panic!("expected a grid, found {other:?}"),
    }
}

fn scattered(acquisition: &Acquisition) -> &Scattered {
    match &acquisition.samples {
        Samples::Scattered(scattered) => scattered,
        other => panic!("expected scattered directions, found {other:?}"),
    }
}

fn lambdas(axis: Option<&Axis>) -> Vec<f64> {
    match axis {
        Some(Axis::Wavelength(grid)) => grid.values(),
        other => panic!("{other:?}"),
    }
}

fn says(acquisition: &Acquisition, kind: NoteKind, words: &str) -> bool {
    acquisition.report.notes.iter().any(|note| note.kind == kind && note.message.contains(words))
}

const THETA_I: [f64; 2] = [0.0, 30.0];
const PHI_I: [f64; 2] = [0.0, 90.0];
const THETA_O: [f64; 3] = [10.0, 40.0, 70.0];
const PHI_O: [f64; 4] = [0.0, 90.0, 180.0, 270.0];
const LAMBDA: [f64; 3] = [400.0, 450.0, 550.5];

/// Returns a test value that differs for every pair of directions (one index per angle) and every wavelength of the
/// test grid.
fn value(place: [usize; 4], lambda: usize) -> f64 {
    place.iter().fold(0.0, |sum, &i| sum * 10.0 + i as f64 + 1.0) / 1000.0 + lambda as f64 * 100.0
}

fn places() -> impl Iterator<Item = [usize; 4]> {
    (0..2 * 2 * 3 * 4).map(|i| [i / 24, i / 12 % 2, i / 4 % 3, i % 4])
}

fn angles([a, b, c, d]: [usize; 4]) -> String {
    format!("{},{},{},{}", THETA_I[a], PHI_I[b], THETA_O[c], PHI_O[d])
}

fn wide_rows() -> Vec<String> {
    places().map(|p| format!("{},{},{},{}", angles(p), value(p, 0), value(p, 1), value(p, 2))).collect()
}

fn long_rows() -> Vec<String> {
    let row = |p, l: usize| format!("{},{},{}", angles(p), LAMBDA[l], value(p, l));
    places().flat_map(|p| (0..3).map(move |l| row(p, l))).collect()
}

const WIDE: &str = "theta_i,phi_i,theta_o,phi_o,v400,v450,v550.5\n";
const LONG: &str = "theta_i,phi_i,theta_o,phi_o,wavelength,value\n";

#[test]
fn both_forms_and_any_order_of_rows_are_the_same_grid() {
    let wide = good(&format!("{BRDF}{WIDE}{}\n", wide_rows().join("\n")));
    assert_eq!((wide.format, wide.dialect.as_str()), (NAME, "version 1, wide form, 48 rows, a grid of directions"));
    assert_eq!((wide.quantity, wide.unit), (Quantity::Brdf, Unit::PerSteradian));
    let first = grid(&wide);
    let (incoming, outgoing) = (first.incoming.as_ref().unwrap(), first.outgoing.as_ref().unwrap());
    assert_eq!((incoming.theta.as_slice(), incoming.covers), (&THETA_I[..], (0.0, 30.0)));
    assert_eq!((outgoing.theta.as_slice(), outgoing.covers), (&THETA_O[..], (10.0, 70.0)));
    assert_eq!(incoming.phi.as_ref().unwrap().extent, AzimuthExtent::Sector);
    assert_eq!(outgoing.phi.as_ref().unwrap().extent, AzimuthExtent::Circle);
    assert_eq!(lambdas(first.spectral.as_ref()), LAMBDA);
    let expected: Vec<f32> = places().flat_map(|p| (0..3).map(move |l| value(p, l) as f32)).collect();
    assert_eq!(first.values, expected);

    let mut backwards = wide_rows();
    backwards.reverse();
    let mut by_wavelength = long_rows();
    by_wavelength.sort_by_key(|row| row.split(',').nth(4).map(str::to_owned));
    let swapped: Vec<String> = long_rows()
        .iter()
        .map(|row| {
            let cells: Vec<&str> = row.split(',').collect();
            format!("{};x;{},{},{},{},{},{}", cells[0], cells[5], cells[3], cells[4], cells[1], cells[0], cells[2])
                .replace(&format!("{};x;", cells[0]), "")
        })
        .collect();
    for text in [
        format!("{BRDF}{WIDE}{}", backwards.join("\n")),
        format!("{BRDF}{LONG}{}\n", long_rows().join("\n")),
        format!("{BRDF}{LONG}{}\n", by_wavelength.join("\n")),
        format!("{BRDF}value,phi_o,Wavelength,PHI_I,theta_i,theta_o\n{}\n", swapped.join("\n")),
        format!("{BRDF}{LONG}{}\n", long_rows().join(" \n# a remark\n\n").replace(',', " , ")),
        format!("\u{feff}{BRDF}{WIDE}{}\n\u{1a}", wide_rows().join("\n")).replace('\n', "\r\n"),
        format!("{BRDF}{WIDE}{}\n", wide_rows().join("\n")).replace('\n', "\r"),
    ] {
        let other = good(&text);
        assert_eq!(grid(&other).values, expected, "{}", &text[..text.len().min(400)]);
        assert_eq!((&grid(&other).incoming, &grid(&other).outgoing), (&first.incoming, &first.outgoing));
    }
    let utf16: Vec<u8> =
        format!("\u{feff}{BRDF}{WIDE}{}\n", wide_rows().join("\n")).encode_utf16().flat_map(u16::to_le_bytes).collect();
    assert_eq!(grid(&read_any(&utf16, &Interpretation::default()).unwrap()).values, expected);
}

#[test]
fn pieces_make_one_table_whatever_their_borders() {
    // More bytes than three pieces; the direction changes inside them and on their borders.
    let mut text = format!("{BRDF}{LONG}");
    let (directions, n) = (1000, 400);
    for d in 0..directions {
        for l in 0..n {
            let _ = writeln!(text, "{},0,{},0,{},{}", d / 25, d % 25, 400 + l, d * n + l);
        }
    }
    assert!(text.len() > 3 << 21);
    let acquisition = good(&text);
    let grid = grid(&acquisition);
    assert_eq!(grid.values.len(), directions * n);
    assert!(grid.values.iter().enumerate().all(|(i, &v)| v == i as f32));
    let broken = text.replacen("399999\n", "39999x\n", 1);
    let error = plain(&broken).unwrap_err();
    assert_eq!(error.position, Some(Position::Text { line: 400_008, column: 15 }), "{error}");
}

#[test]
fn isotropic_azimuths_are_relative_and_mirrored() {
    let text = |header: &str, rows: &str| format!("{BRDF}{header}theta_i,phi_i,theta_o,phi_o,value\n{rows}");
    let rows = "30,40,20,40,1\n30,40,20,130,2\n30,40,20,220,3\n60,350,20,350,4\n60,350,20,80,5\n60,350,20,170,6\n";
    let acquisition = good(&text("# isotropic: true\n", rows));
    let angles = grid(&acquisition).outgoing.as_ref().unwrap();
    let azimuths = angles.phi.as_ref().unwrap();
    assert_eq!((azimuths.phi.as_slice(), azimuths.extent), (&[0.0, 90.0, 180.0][..], AzimuthExtent::Mirrored));
    assert_eq!(grid(&acquisition).values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    assert!(grid(&acquisition).incoming.as_ref().unwrap().phi.is_none());
    let stated = good(&text("# isotropic: true\n# phi_o_extent: sector\n# theta_o_covers: 0 90\n", rows));
    let angles = grid(&stated).outgoing.as_ref().unwrap();
    assert_eq!((angles.phi.as_ref().unwrap().extent, angles.covers), (AzimuthExtent::Sector, (0.0, 90.0)));
    let without = good(&format!("{BRDF}theta_i,theta_o,phi_o,value\n30,20,0,1\n30,20,180,2\n"));
    assert!(says(&without, NoteKind::Assumed, "no column phi_i"));
    let narrow = plain(&text("# theta_o_covers: 30 40\n", rows)).unwrap_err();
    assert!(narrow.message.contains("theta_o_covers"), "{narrow}");
}

#[test]
fn azimuths_of_isotropic_data_count_only_against_one_another() {
    let rows = "theta_i,phi_i,theta_o,value\n0,11,20,1\n30,1,20,2\n30,5,20,4\n30,1,50,nan\n";
    let acquired = good(&format!("{BRDF}# isotropic: true\n{rows}"));
    let read = grid(&acquired);
    assert!(read.incoming.as_ref().unwrap().phi.is_none() && read.outgoing.as_ref().unwrap().phi.is_none());
    assert_eq!(read.values.iter().filter(|v| !v.is_nan()).copied().collect::<Vec<_>>(), [1.0, 3.0]);
    assert!(says(&acquired, NoteKind::Warning, "measured more than once"), "{:?}", acquired.report.notes);
}

#[test]
fn poles_are_one_direction_and_holes_are_masked() {
    let rows = "0,0,5\n30,0,1\n30,120,2\n30,240,3\n60,0,4\n60,120,\n60,240,nan\n";
    let acquisition = good(&format!("{BRDF}theta_o,phi_o,value,theta_i\n{}", rows.replace('\n', ",10\n")));
    let values = &grid(&acquisition).values;
    assert_eq!(values[..7], [5.0, 5.0, 5.0, 1.0, 2.0, 3.0, 4.0]);
    assert!(values[7].is_nan() && values[8].is_nan());
    assert!(says(&acquisition, NoteKind::Filled, "2 missing samples at a pole"));
    assert!(says(&acquisition, NoteKind::Warning, "4 of 9 places of the grid have no sample"));
    let twice = good(&format!("{BRDF}theta_i,theta_o,phi_o,value\n10,20,0,1\n10,20,0,2\n10,20,0,6\n10,30,0,-1\n"));
    assert_eq!(grid(&twice).values, [3.0, -1.0]);
    assert!(says(&twice, NoteKind::Warning, "1 sample was measured more than once"));
    assert!(says(&twice, NoteKind::Warning, "1 value is negative, down to -1; kept as it is"));
}

#[test]
fn units_that_are_hardly_meant_are_doubted() {
    let said = |theta: f64, lambda: f64, words: &str| {
        let text = format!("{BRDF}{LONG}0,0,{theta},0,{lambda},1\n0,0,{theta},180,{lambda},2\n");
        says(&good(&text), NoteKind::Warning, words)
    };
    assert!(said(1.5, 550.0, "theta up to 1.5 degrees only") && !said(15.0, 550.0, "degrees only"));
    assert!(said(15.0, 0.55, "wavelengths up to 0.55 nm only") && !said(15.0, 100.0, "nm only"));
}

#[test]
fn directions_without_a_grid_stay_scattered() {
    let mut wide = format!("{BRDF}theta_i,phi_i,theta_o,phi_o,v400,v500\n");
    let mut long = format!("{BRDF}{LONG}");
    for i in 0..50 {
        let angles = format!("{},{},{},{}", 1.5 * f64::from(i % 7), i * 5 % 360, i, i * 17 % 360);
        let _ = writeln!(wide, "{angles},{i},{}", i + 100);
        let _ = write!(long, "{angles},400,{i}\n{angles},500,{}\n", i + 100);
    }
    let acquisition = good(&wide);
    let found = scattered(&acquisition);
    assert_eq!((found.directions(), found.values.len(), found.isotropic), (50, 100, false));
    assert_eq!((found.incoming[8], found.outgoing[8]), ([1.5, 40.0], [8.0, 136.0]));
    assert_eq!(found.values[16..18], [8.0, 108.0]);
    assert_eq!(scattered(&good(&long)), found);
    // Each direction at a wavelength of its own would make a table of holes.
    let mut sparse = format!("{BRDF}{LONG}");
    for i in 0..50 {
        let _ = writeln!(sparse, "{i},{},{},{},{},1", i * 2, i + 3, i * 3, 400 + i);
    }
    assert_eq!(plain(&sparse).unwrap_err().kind, FormatErrorKind::OverLimit);
}

#[test]
fn uncertainties_follow_their_values() {
    let mut wide = format!("{BRDF}theta_i,phi_i,theta_o,phi_o,s500,v400,v500,s400\n");
    let mut long = format!("{BRDF}{}", LONG.replace("value", "value,sigma"));
    for i in 0..50 {
        let angles = format!("{},{},{},{}", 1.5 * f64::from(i % 7), i * 5 % 360, i, i * 17 % 360);
        let _ = writeln!(wide, "{angles},0.{i},{i},{},", i + 100);
        let _ = write!(long, "{angles},400,{i},\n{angles},500,{},0.{i}\n", i + 100);
    }
    let found = good(&wide);
    let sigma = scattered(&found).sigma.as_ref().unwrap();
    assert!(sigma.len() == 100 && sigma[14].is_nan() && sigma[15] == 0.7 && sigma[25] == 0.12, "{sigma:?}");
    let from_long = good(&long);
    let bits = |sigma: &[f32]| sigma.iter().map(|s| s.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(scattered(&from_long).sigma.as_ref().unwrap()), bits(sigma));
    let divided = good(&wide.replace("included: false", "included: true"));
    let cosine = f64::cos(7_f64.to_radians()) as f32;
    assert!((scattered(&divided).sigma.as_ref().unwrap()[15] - 0.7 / cosine).abs() < 1e-6);
    for (text, word) in [
        (wide.replace("s400", "s410"), "an uncertainty at 410 nm"),
        (wide.replace("s400", "s500"), "two columns of the uncertainty at 500 nm"),
        (wide.replace("s400", "sigma"), "expected one `s550` for each"),
        (long.replace("value,sigma", "sigma,sigma"), "a second column `sigma`"),
        (long.replace(",0.7\n", ",-0.7\n"), "found `-0.7`, expected an uncertainty"),
    ] {
        let error = plain(&text).unwrap_err();
        assert!(error.kind == FormatErrorKind::Malformed && error.message.contains(word), "{error}");
    }
}

#[test]
fn uncertainties_stay_beside_their_values_on_a_grid() {
    // The last azimuth closes the circle, and the order of the rows is not that of the grid.
    let mut text = format!("{BRDF}theta_i,phi_i,theta_o,phi_o,v400,v500,s400,s500\n");
    for (row, phi_o) in [360, 0, 120, 240].into_iter().enumerate() {
        for theta_o in [40, 20] {
            let _ = writeln!(text, "30,0,{theta_o},{phi_o},{row}.5,1,0.{row}{theta_o},");
        }
    }
    let found = good(&text.replace(".340", "."));
    let values = grid(&found);
    let sigma = values.sigma.as_ref().unwrap();
    assert_eq!((sigma.values.len(), &sigma.outgoing), (values.values.len(), &values.outgoing));
    // Theta 20, azimuth 0: the mean of what is stated at 0 and 360; the last of theta 20 at 500 nm is not stated.
    assert!((sigma.values[0] - 0.07).abs() < 1e-6 && sigma.values[1].is_nan(), "{:?}", sigma.values);
    let (stated, own) = (sigma.as_stated().unwrap(), values.as_stated().unwrap());
    assert_eq!(stated.tensor.axes(), own.tensor.axes());
    assert_eq!(own.tensor.samples()[6], 0.5);
    assert_eq!(stated.tensor.samples()[6], 0.02);
    assert!(good(&text.replace(",s400,s500", ",x,y")).report.notes.len() > 1);
}

#[test]
fn the_header_may_state_angles_of_the_instrument() {
    let rows = "theta_i,theta_o,phi_o,value\n10,20,0,1\n";
    let with = |lines: &str| plain(&format!("{BRDF}{lines}{rows}"));
    let found = with("# detector_aperture: 1.5\n# Source_Divergence: 0\n").unwrap();
    assert_eq!(found.instrument, Instrument { detector_aperture: Some(1.5), source_divergence: Some(0.0) });
    assert!(found.report.metadata.is_empty());
    assert!(with("").unwrap().instrument.is_unknown());
    for bad in ["", "1.5 deg", "-1", "181", "nan", "1e999", "0x1", "1,5", "\u{fffd}", "1 2"] {
        for key in ["detector_aperture", "source_divergence"] {
            let error = with(&format!("# {key}: {bad}\n")).unwrap_err();
            assert_eq!(error.position, Some(Position::Text { line: 8, column: 1 }), "{error}");
            let expected = "expected a full angle in degrees, from 0 to 180";
            assert!(error.message.contains(key) && error.message.contains(expected), "{error}");
            assert!(!error.message.contains(';'), "one problem: {error}");
        }
    }
    let twice = with("# detector_aperture: 1\n# detector_aperture: 2\n").unwrap_err();
    assert!(twice.message.contains("`detector_aperture` twice"), "{twice}");
}

#[test]
fn cosines_are_divided_out() {
    let text = BRDF.replace("included: false", "included: true");
    let acquisition = good(&format!("{text}theta_i,theta_o,phi_o,value\n10,0,0,2\n10,60,0,2\n10,90,0,2\n"));
    let values = &grid(&acquisition).values;
    assert!(values[0] == 2.0 && (values[1] - 4.0).abs() < 1e-6 && values[2].is_nan(), "{values:?}");
    assert!(says(&acquisition, NoteKind::Warning, "1 value at theta_o of 90"));
    let missing = BRDF.replace("# cosine_included: false\n", "");
    let error = plain(&format!("{missing}theta_i,theta_o,phi_o,value\n10,0,0,2\n")).unwrap_err();
    assert!(error.message.contains("cosine_included"), "{error}");
}

#[test]
fn emission_is_in_either_frame_and_angles_in_either_unit() {
    let header = "# radiometric-csv: 1\n# quantity: emission\n# value_unit: cd\n# angle_unit: deg\n";
    let lamp = good(&format!("{header}# frame: luminaire\nc,gamma,value\n0,0,9\n0,30,1\n120,30,2\n240,30,3\n"));
    assert_eq!((lamp.quantity, lamp.unit), (Quantity::Edf, Unit::Candela));
    let angles = grid(&lamp).outgoing.as_ref().unwrap();
    assert_eq!((angles.theta.as_slice(), angles.covers), (&[150.0, 180.0][..], (150.0, 180.0)));
    assert_eq!(grid(&lamp).values, [1.0, 2.0, 3.0, 9.0, 9.0, 9.0]);
    let surface = good(&format!("{header}theta,phi,value\n180,0,9\n150,0,1\n150,120,2\n150,240,3\n"));
    assert_eq!((&grid(&surface).outgoing, &grid(&surface).values), (&grid(&lamp).outgoing, &grid(&lamp).values));
    let error = plain(&format!("{header}# frame: surface\nc,gamma,value\n0,0,9\n")).unwrap_err();
    assert!(error.message.contains("header states the other"), "{error}");
    let radians = header.replace("deg", "rad");
    let lamp =
        good(&format!("{radians}theta,phi,value\n3.141593,0,9\n1.5708,0,1\n1.5708,2.094395,2\n1.5708,4.18879,3\n"));
    let angles = grid(&lamp).outgoing.as_ref().unwrap();
    assert_eq!(angles.theta, [90.0002, 180.0]);
    assert_eq!(angles.phi.as_ref().unwrap().phi, [0.0, 120.0, 240.0]);
    let brdf = BRDF.replace("deg", "rad");
    let steep = good(&format!("{brdf}theta_i,theta_o,phi_o,value\n0.5,1.5708,0,1\n"));
    assert_eq!(grid(&steep).outgoing.as_ref().unwrap().theta, [90.0]);
}

const PHASE: &str = "# radiometric-csv: 1\n# quantity: phase\n# angle_unit: deg\n# wavelength_unit: nm\n";

/// Returns Henyey and Greenstein's phase function in sr⁻¹ with the asymmetry parameter `g`, at the scattering angle
/// `angle` in degrees.
fn haze(g: f64, angle: f64) -> f64 {
    (1.0 - g * g) / (4.0 * std::f64::consts::PI * (1.0 + g * g - 2.0 * g * angle.to_radians().cos()).powf(1.5))
}

/// Evaluates the phase function of a parsed file at a scattering angle in degrees; returns one value for each
/// wavelength.
fn scattered_by(acquisition: &Acquisition, angle: f64, wavelengths: usize) -> Vec<f64> {
    let Samples::Function(modelled) = &acquisition.samples else { panic!("{:?}", acquisition.samples) };
    let (wi, wo) = (Direction::from_degrees(180.0, 0.0), Direction::from_degrees(angle, 40.0));
    let mut values = vec![0.0; wavelengths];
    modelled.function.evaluate(wi, wo, &mut values);
    values
}

#[test]
fn a_phase_function_may_have_the_scattering_angle_alone() {
    let long = (0..=180).rev().fold(format!("{PHASE}# value_unit: 1/sr\ntheta,value\n"), |text, i| {
        format!("{text}{i},{}\n", haze(0.5, f64::from(i)))
    });
    let acquired = good(&long);
    assert_eq!((acquired.quantity, acquired.unit), (Quantity::Phase, Unit::PerSteradian));
    for angle in [0.0, 20.5, 90.0, 180.0] {
        let found = scattered_by(&acquired, angle, 1)[0];
        assert!((found / haze(0.5, angle) - 1.0).abs() < 1e-3, "{angle}: {found}");
    }
    let mean = acquired.report.metadata.iter().find(|(key, _)| key == "mean_cosine").unwrap().1.parse::<f64>().unwrap();
    assert!((mean - 0.5).abs() < 1e-4, "{mean}");

    // Each wavelength by itself, whatever its scale.
    let wide = (0..=180).fold(format!("{PHASE}# value_unit: relative\ntheta,v450,v650\n"), |text, i| {
        format!("{text}{i},{},{}\n", 3.0 * haze(0.5, f64::from(i)), 70.0 * haze(-0.2, f64::from(i)))
    });
    let acquired = good(&wide);
    assert_eq!(acquired.unit, Unit::PerSteradian);
    assert!(says(&acquired, NoteKind::Assumed, "each of 2 wavelengths"), "{:?}", acquired.report.notes);
    let found = scattered_by(&acquired, 60.0, 2);
    for (found, g) in found.into_iter().zip([0.5, -0.2]) {
        assert!((found / haze(g, 60.0) - 1.0).abs() < 1e-3, "{g}: {found}");
    }
}

#[test]
fn a_volume_scattering_function_is_named_by_its_unit() {
    let mut text =
        "# radiometric-csv: 1\n# quantity: phase\n# value_unit: 1/m/sr\n# angle_unit: deg\ntheta,value\n".to_owned();
    for i in 0..=180 {
        let _ = writeln!(text, "{i},{}", 0.37 * haze(0.3, f64::from(i)));
    }
    let read = good(&text);
    assert_eq!(read.unit, Unit::PerSteradian);
    let b = &read.report.metadata.iter().find(|(key, _)| key == "scattering_coefficient").unwrap().1;
    assert!((b.parse::<f64>().unwrap() - 0.37).abs() < 1e-3, "{b}");
    let directions = text.replace("theta,value", "theta_i,theta_o,phi_o,value");
    assert!(plain(&directions).unwrap_err().message.contains("expected it over theta"));
    let emission = text.replace("phase", "emission").replace("1/m/sr", "W/m2/sr/nm");
    assert!(plain(&emission).unwrap_err().message.contains("a radiance times area and cosine"));
}

#[test]
fn phase_functions_that_are_none_are_refused() {
    for (rows, kind, words) in [
        ("theta,value\n0,1\n", FormatErrorKind::Malformed, "one scattering angle, expected"),
        ("theta,value\n0,5\n180,5\n", FormatErrorKind::NeedsOption, "neither 1 nor 4 pi"),
        ("theta,value\n0,1\n90,1\n", FormatErrorKind::NeedsOption, "does not cover 0 to 180"),
        ("theta,phi_o,value\n0,0,1\n180,0,1\n", FormatErrorKind::Malformed, "theta (the scattering angle) alone"),
        ("theta,value\n0,1\n181,1\n", FormatErrorKind::Malformed, "181"),
    ] {
        let error = plain(&format!("{PHASE}# value_unit: 1/sr\n{rows}")).unwrap_err();
        assert!(error.kind == kind && error.message.contains(words), "{rows}: {error}");
    }
}

#[test]
fn spectra_need_no_directions() {
    let header = "# radiometric-csv: 1\n# quantity: transmittance\n# value_unit: 1\n# wavelength_unit: um\n";
    let long = good(&format!("{header}value,wavelength\n0.5,0.7\n0.25,0.4\n"));
    let Samples::OnAxes { tensor, .. } = &long.samples else { panic!() };
    assert_eq!((long.quantity, lambdas(tensor.axes().first())), (Quantity::Reflectance, vec![400.0, 700.0]));
    assert_eq!(tensor.samples(), [0.25, 0.5]);
    let wide = good(&format!("{header}v0.7,v0.4\n1,2\n3,4\n"));
    let Samples::OnAxes { tensor, .. } = &wide.samples else { panic!() };
    assert_eq!((tensor.axes()[0].len(), tensor.samples()), (2, &[2.0, 1.0, 4.0, 3.0][..]));
    let angular = good(&format!("{header}# angle_unit: deg\ntheta_i,v0.4\n0,1\n30,2\n"));
    assert!(grid(&angular).outgoing.is_none());
    assert_eq!(grid(&angular).values, [1.0, 2.0]);
    let how = Interpretation { wavelength_unit: Some("nm".to_owned()), ..Interpretation::default() };
    let renamed = read_any(format!("{header}wavelength,value\n400,1\n").as_bytes(), &how).unwrap();
    assert!(says(&renamed, NoteKind::Warning, "taken in nm as asked"));
}

#[test]
fn the_users_word_goes_before_the_files() {
    let text = format!("{BRDF}theta_i,theta_o,phi_o,value\n10,20,0,1\n");
    let how = |quantity: Option<Quantity>, unit| Interpretation {
        quantity: quantity.map(Into::into),
        unit,
        ..Interpretation::default()
    };
    let asked = read_any(text.as_bytes(), &how(Some(Quantity::Bsdf), Some(Unit::Relative))).unwrap();
    assert_eq!((asked.quantity, asked.unit), (Quantity::Bsdf, Unit::Relative));
    assert!(says(&asked, NoteKind::Warning, "taken as bsdf as asked"));
    for (missing, quantity, unit) in
        [("# quantity: brdf\n", Some(Quantity::Brdf), None), ("# value_unit: 1/sr\n", None, Some(Unit::PerSteradian))]
    {
        let text = text.replace(missing, "");
        assert_eq!(plain(&text).unwrap_err().kind, FormatErrorKind::NeedsOption);
        assert!(read_any(text.as_bytes(), &how(quantity, unit)).is_ok());
    }
}

#[test]
fn headers_of_spreadsheets_and_of_old_computers_are_read() {
    let body = "theta_i,theta_o,phi_o,value\n10,20,0,1\n10,30,0,2\n";
    let padded = BRDF.replace('\n', ",,,\n") + body;
    assert_eq!(grid(&good(&padded)).values, grid(&good(&format!("{BRDF}{body}"))).values);
    let latin = [BRDF.as_bytes(), b"# sample: Stra\xdfe 5 \xb5m\n", body.as_bytes()].concat();
    let read = read_any(&latin, &Interpretation::default()).unwrap();
    assert!(read.report.metadata.contains(&("sample".to_owned(), "Straße 5 µm".to_owned())));
    assert!(says(&read, NoteKind::Assumed, "Windows-1252"));
}

#[test]
fn metadata_and_skipped_columns_are_told() {
    let text = format!(
        "# made by hand\n{BRDF}# sample: velvet-03\n# uncertainty: k=1\ntheta_i,theta_o,phi_o,value,sigma,note\n"
    );
    let acquisition = good(&format!("{text}10,20,0,1,0.1,fine\n"));
    for pair in [("comment", "made by hand"), ("sample", "velvet-03"), ("uncertainty", "k=1")] {
        assert!(acquisition.report.metadata.contains(&(pair.0.to_owned(), pair.1.to_owned())));
    }
    assert!(says(&acquisition, NoteKind::Skipped, "`note`") && !says(&acquisition, NoteKind::Skipped, "sigma"));
}

#[test]
fn the_first_twenty_problems_are_listed_and_all_are_counted() {
    let mut text =
        format!("{BRDF}theta_i,theta_o,phi_o,value\n10,x,0,1\n10,20,0\n10,20,0,1,2\n10,95,1000,1e39\n10,20,0,1 2\n");
    let error = plain(&text).unwrap_err();
    assert_eq!((error.kind, error.position), (FormatErrorKind::Malformed, Some(Position::Text { line: 9, column: 4 })));
    for part in [
        "radiometric-csv: line 9, column 4: found `x`, expected an angle from 0 to 90 degrees (theta_o)",
        "line 10, column 8: a row of 3 cells, expected 4",
        "line 11, column 10: more cells than the 4 columns, expected one for each (a decimal comma",
        "line 12, column 7: found `1000`, expected an angle from -360 to 720 degrees (phi_o)",
        "line 12, column 12: found `1e39`, expected a number within the range of float32 (value)",
        "line 13, column 9: found `1 2`, expected one number (value)",
    ] {
        assert!(error.to_string().contains(part), "{part}\n{error}");
    }
    // Problems of one kind are listed once, with the line of the last one.
    text.push_str(&"10,20,0,bad\n".repeat(100));
    let error = plain(&text).unwrap_err();
    let once = "line 14, column 9: found `bad`, expected a number, or nothing where it is missing (value) (100 times, the last \
                in line 113)";
    assert!(error.message.ends_with(once), "{error}");
    let twice =
        "line 9, column 4: found `x`, expected an angle from 0 to 90 degrees (theta_o) (2 times, the last in line 12)";
    assert!(error.to_string().contains(twice), "{error}");
    let names: Vec<String> = (400..425).map(|wavelength| format!("v{wavelength}")).collect();
    let text = format!("{BRDF}theta_i,theta_o,phi_o,{}\n10,20,0{}\n", names.join(","), ",x".repeat(25));
    let error = plain(&text).unwrap_err();
    assert_eq!(error.message.matches("line ").count(), 19, "{error}");
    assert!(error.message.ends_with("; and 5 more problems, 25 in all"), "{error}");
}

#[test]
fn headers_and_columns_are_checked() {
    let body = "theta_i,theta_o,phi_o,value\n10,20,0,1\n";
    for (text, word) in [
        (format!("{}{body}", BRDF.replace("csv: 1", "csv: 2")), "radiometric-csv `2`, expected 1"),
        (format!("{}{body}", BRDF.replace("brdf", "brd")), "quantity `brd`, expected spectrum"),
        (format!("{}{body}", BRDF.replace("1/sr", "cd")), "value_unit `cd`, expected a unit of a brdf: relative, 1/sr"),
        (format!("{}{body}", BRDF.replace("deg", "grad")), "angle_unit `grad`"),
        (format!("{}{body}", BRDF.replace("# angle_unit: deg\n", "")), "`angle_unit` is not stated"),
        (format!("{}{body}", BRDF.replace("outward", "inward")), "direction_convention `inward`"),
        (format!("{BRDF}# angle_unit: rad\n{body}"), "`angle_unit` twice"),
        (format!("{BRDF}# isotropic: perhaps\n{body}"), "isotropic `perhaps`"),
        (format!("{BRDF}theta_i,theta_o,phi_o\n10,20,0\n"), "no column `value`"),
        (format!("{BRDF}theta_i;theta_o;phi_o;value\n10;20;0\n"), "found 3 cells between `;`, expected 4"),
        (format!("{BRDF}theta_i\ttheta_o\tphi_o\tvalue\n"), "no rows of numbers"),
        (format!("{BRDF}theta_i theta_o phi_o value\n"), "no rows of numbers"),
        (format!("{BRDF}theta_i,theta_o,phi_o,value,value\n"), "a second column `value`"),
        (format!("{BRDF}theta_i,theta_o,phi_o,value,v400\n"), "both `value` and columns"),
        (format!("{BRDF}theta_i,theta_o,phi_o,wavelength,v400\n"), "beside columns such as"),
        (format!("{BRDF}theta_i,theta_o,phi_o,v400,v400.0\n"), "two columns of 400 nm"),
        (format!("{BRDF}theta_i,theta_o,phi_o,v0\n"), "expected a positive number"),
        (format!("{BRDF}theta_i,theta_i,theta_o,phi_o,value\n"), "second column of theta_i"),
        (format!("{BRDF}theta_i,value\n"), "the columns of angles of quantity brdf"),
        (format!("{BRDF}phi_i,theta_o,value\n"), "the columns of angles of quantity brdf"),
        (format!("{BRDF}{}", "theta_i,theta_o,phi_o,value\n"), "no rows of numbers"),
        (format!("{BRDF}{}", "theta_i,theta_o,phi_o,value\n10,20,0,\n"), "every value is missing"),
        (BRDF.to_owned(), "the file ends in its header"),
        (format!("{BRDF}{LONG}10,20,30,40,-5,1\n"), "expected a positive wavelength"),
        ("# radiometric-csv: 1\n# quantity: spectrum\n# value_unit: relative\nvalue\n1\n".to_owned(), "a function of"),
    ] {
        let error = plain(&text).unwrap_err();
        assert_eq!((error.kind, error.format), (FormatErrorKind::Malformed, NAME), "{error}");
        assert!(error.message.contains(word), "{word}\n{error}");
    }
    let long = format!("# radiometric-csv: 1\n{}", "# x\n".repeat(2000));
    assert_eq!(plain(&long).unwrap_err().kind, FormatErrorKind::OverLimit);
}

#[test]
fn no_cell_and_no_length_makes_it_panic() {
    for text in [
        format!("{BRDF}{WIDE}{}\n", wide_rows()[..6].join("\n")),
        format!("{BRDF}{LONG}{}\n", long_rows()[..9].join("\n")),
    ] {
        for cut in 0..text.len() {
            let _ = plain(&text[..cut]);
        }
        let lines: Vec<&str> = text.lines().collect();
        for hostile in ["NaN", "-1", "9223372036854775808", "1e308", "", "inf", ":", "\"", "\u{0}"] {
            for (i, line) in lines.iter().enumerate() {
                let separator = if i < 7 { ": " } else { "," };
                let cells: Vec<&str> = line.split(separator).collect();
                for k in 0..cells.len() {
                    let mut cells = cells.clone();
                    cells[k] = hostile;
                    let mut changed: Vec<String> = lines.iter().map(|&line| line.to_owned()).collect();
                    changed[i] = cells.join(separator);
                    let _ = plain(&changed.join("\n"));
                }
            }
        }
    }
}
