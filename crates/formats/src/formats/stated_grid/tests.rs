//! Readers hand on grids as their files state them: every form of planes, multipliers beside the numbers, gaps and
//! seams.

use super::super::{Azimuths, Interpretation, Samples, read};
use super::*;
use crate::domain::{self, Axis, DirectionGrid, Frame};
use crate::formats::acquisition::{AngleGrid, Angles, AzimuthExtent, Outside};
use std::fmt::Write;

fn grid(extent: AzimuthExtent, phi: Vec<f64>) -> AngleGrid {
    let values = (0..2 * 2 * phi.len()).map(|i| i as f32).collect();
    AngleGrid {
        index: Vec::new(),
        incoming: Some(Angles { theta: vec![0.0, 60.0], covers: (0.0, 90.0), phi: None }),
        outgoing: Some(Angles { theta: vec![0.0, 45.0], covers: (0.0, 90.0), phi: Some(Azimuths { phi, extent }) }),
        spectral: None,
        outside: Outside::Masked,
        values,
        stated: None,
        sigma: None,
    }
}

#[test]
fn angles_and_extents_stay() {
    use domain::AzimuthExtent as Stated;
    for (extent, phi, stated) in [
        (AzimuthExtent::Circle, vec![0.0, 120.0, 240.0], Stated::Circle),
        (AzimuthExtent::Mirrored, vec![0.0, 90.0, 180.0], Stated::Mirrored),
        (AzimuthExtent::Sector, vec![-20.0, 20.0], Stated::Sector),
    ] {
        let grid = grid(extent, phi.clone());
        let found = grid.as_stated().unwrap();
        assert_eq!((found.tensor.samples(), found.factor), (&grid.values[..], 1.0));
        let [Axis::Elevation(elevations), Axis::Grid(outgoing)] = found.tensor.axes() else { panic!("two axes") };
        assert_eq!((elevations, outgoing.covers()), (&vec![0.0, 60.0], (0.0, 90.0)));
        assert_eq!(outgoing.azimuths(), Some(&domain::Azimuths { angles: phi, extent: stated }));
    }
}

#[test]
fn a_seam_that_was_merged_is_stated_again() {
    let grid = grid(AzimuthExtent::Circle, vec![0.0, 120.0, 240.0]);
    let listed = [None, Some(vec![0.0, 120.0, 240.0, 360.0])];
    let found = grid.stated_as(vec![1.0; 16], &listed).unwrap();
    assert_eq!(found.tensor.shape(), [2, 8]);
    assert!(matches!(grid.stated_as(vec![1.0; 12], &listed), Err(StatedGridError::Tensor(_))));
    let wrong = [None, Some(vec![0.0, 240.0])];
    assert!(matches!(grid.stated_as(vec![1.0; 8], &wrong), Err(StatedGridError::Directions(_))));
}

#[test]
fn values_stated_twice_have_a_spread() {
    let mut repeated = Repeated::default();
    repeated.add([1.0].into_iter());
    repeated.add([0.0, 0.0].into_iter());
    assert_eq!(repeated.rms(), None);
    repeated.add([0.9, 1.1, f64::NAN].into_iter());
    assert!((repeated.rms().unwrap() - 0.1).abs() < 1e-12 && repeated.values == 2);
}

/// Returns the grid that a file lists, and the intensities after symmetries are unfolded.
fn stated(bytes: &[u8], how: &Interpretation) -> (StatedGrid, Vec<f32>) {
    let Samples::Grid(grid) = read(bytes, how).unwrap().samples else { panic!("a grid") };
    (grid.as_stated().unwrap(), grid.values.into_vec())
}

fn plain(text: &str) -> StatedGrid {
    stated(text.as_bytes(), &Interpretation::default()).0
}

fn directions(grid: &StatedGrid) -> &DirectionGrid {
    grid.tensor
        .axes()
        .iter()
        .rev()
        .find_map(|axis| if let Axis::Grid(grid) = axis { Some(grid) } else { None })
        .unwrap()
}

fn azimuths(angles: &[f64], extent: domain::AzimuthExtent) -> domain::Azimuths {
    domain::Azimuths { angles: angles.to_vec(), extent }
}

/// Returns an LM-63 file of photometric type `kind` (1 C, 2 B, 3 A) whose numbers are 1, 2, 3, …,
/// `[horizontal][vertical]`.
fn ies(kind: u8, factors: [&str; 2], vertical: &[f64], horizontal: &[f64]) -> String {
    let list = |angles: &[f64]| angles.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    let numbers: Vec<f64> = (1..=vertical.len() * horizontal.len()).map(|i| i as f64).collect();
    let [multiplier, ballast] = factors;
    let (v, h) = (vertical.len(), horizontal.len());
    let lists = [vertical, horizontal, &numbers].map(list).join("\n");
    format!("IESNA:LM-63-2002\nTILT=NONE\n1 -1 {multiplier} {v} {h} {kind} 2 0 0 0 {ballast} 1 0\n{lists}\n")
}

#[test]
fn type_c_keeps_its_planes_as_stored() {
    use domain::AzimuthExtent as E;
    for (horizontal, extent) in [
        (&[0.0, 45.0, 90.0][..], E::Quadrant),
        (&[0.0, 90.0, 180.0], E::Mirrored),
        (&[90.0, 180.0, 270.0], E::MirroredAt90),
        (&[0.0, 180.0, 360.0], E::Closed),
        (&[0.0, 120.0, 240.0], E::Circle),
        (&[30.0], E::Circle),
    ] {
        let grid = plain(&ies(1, ["1", "1"], &[0.0, 60.0, 90.0], horizontal));
        let found = directions(&grid);
        assert_eq!((found.frame(), found.polar(), found.covers()), (Frame::TypeC, &[0.0, 60.0, 90.0][..], (0.0, 90.0)));
        assert_eq!(found.azimuths(), Some(&azimuths(horizontal, extent)));
        assert_eq!(found.outside(), domain::Outside::Dark);
        // Plane after plane in the file, angle after angle in the grid; the poles keep their numbers.
        let n = horizontal.len();
        let wanted: Vec<f32> = (0..3 * n).map(|i| (i % n * 3 + i / n + 1) as f32).collect();
        assert_eq!(grid.tensor.samples(), wanted);
    }
    let axial = plain(&ies(1, ["1", "1"], &[0.0, 60.0, 90.0], &[0.0]));
    assert_eq!((directions(&axial).azimuths(), axial.tensor.samples()), (None, &[1.0, 2.0, 3.0][..]));
}

#[test]
fn types_a_and_b_keep_their_own_angles() {
    use domain::AzimuthExtent as E;
    let (vertical, half, both) = (&[-30.0, 0.0, 40.0][..], &[0.0, 20.0][..], &[-20.0, 20.0][..]);
    let b = plain(&ies(2, ["1", "1"], vertical, half));
    let found = directions(&b);
    assert_eq!((found.frame(), found.polar(), found.is_polar_mirrored()), (Frame::TypeB, half, true));
    assert_eq!(found.azimuths(), Some(&azimuths(vertical, E::Sector)));
    assert_eq!(b.tensor.samples(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    assert!(!directions(&plain(&ies(2, ["1", "1"], vertical, both))).is_polar_mirrored());
    let a = plain(&ies(3, ["1", "1"], vertical, half));
    let found = directions(&a);
    assert_eq!((found.frame(), found.polar()), (Frame::TypeA, vertical));
    assert_eq!(found.azimuths(), Some(&azimuths(half, E::Mirrored)));
    assert_eq!(a.tensor.samples(), [1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
    let round = plain(&ies(3, ["1", "1"], vertical, &[-180.0, 0.0, 180.0]));
    assert_eq!(directions(&round).azimuths(), Some(&azimuths(&[-180.0, 0.0, 180.0], E::Closed)));
    // The directions are those at which the unfolded form has the same intensities.
    for kind in [2, 3] {
        let text = ies(kind, ["1", "1"], &[-30.0, 0.0, 30.0], &[0.0, 30.0]);
        let Samples::Grid(unfolded) = read(text.as_bytes(), &Interpretation::default()).unwrap().samples else {
            panic!("a grid")
        };
        let outgoing = unfolded.outgoing.as_ref().unwrap();
        let grid = unfolded.as_stated().unwrap();
        // H 0, V 30: on a meridian that both forms list, in the middle of the step of 5°.
        let entry = if kind == 2 { 2 } else { 4 };
        let direction = directions(&grid).direction(entry);
        let (theta, phi) = (direction.theta_degrees(), direction.phi_degrees());
        let row = outgoing.theta.iter().position(|t| (t - theta).abs() < 1e-9).unwrap();
        let columns = &outgoing.phi.as_ref().unwrap().phi;
        let column = columns.iter().position(|c| (c - phi).abs() < 1e-9).unwrap();
        assert_eq!(unfolded.values[row * columns.len() + column], grid.tensor.samples()[entry], "{kind}");
    }
}

#[test]
fn multipliers_are_one_factor_beside_the_numbers() {
    let text = ies(1, ["0.1", "0.7"], &[0.0, 90.0], &[0.0, 90.0]);
    let (grid, values) = stated(text.as_bytes(), &Interpretation::default());
    assert_eq!((grid.factor, grid.tensor.samples()), (0.1 * 0.7, &[1.0, 3.0, 2.0, 4.0][..]));
    assert!(values.contains(&((4.0 * (0.1 * 0.7)) as f32)));
}

/// Returns an EULUMDAT file with four C planes and two gamma angles, whose intensities are 1, 2, 3, ….
fn ldt(symmetry: u8, stored: usize) -> String {
    let mut lines: Vec<String> = vec!["a company".into(), "3".into(), symmetry.to_string(), "4".into(), "90".into()];
    lines.extend(["2", "90", "r", "l", "n", "f", "d"].map(str::to_owned));
    lines.extend((0..9).map(|_| "0".to_owned()));
    lines.extend(["100", "100", "2", "0", "1", "1", "lamp", "500", "", "", "9"].map(str::to_owned));
    lines.extend((0..10).map(|_| "0".to_owned()));
    lines.extend(["0", "90", "180", "270", "0", "90"].map(str::to_owned));
    lines.extend((1..=2 * stored).map(|i| i.to_string()));
    lines.join("\n") + "\n"
}

#[test]
fn eulumdat_keeps_its_symmetry() {
    use domain::AzimuthExtent as E;
    for (symmetry, angles, numbers) in [
        (0, Some(azimuths(&[0.0, 90.0, 180.0, 270.0], E::Circle)), &[1.0, 3.0, 5.0, 7.0, 2.0, 4.0, 6.0, 8.0][..]),
        (1, None, &[1.0, 2.0]),
        (2, Some(azimuths(&[0.0, 90.0, 180.0], E::Mirrored)), &[1.0, 3.0, 5.0, 2.0, 4.0, 6.0]),
        // Stored from C270 over C0 to C90: mirrored, C270 is the last.
        (3, Some(azimuths(&[90.0, 180.0, 270.0], E::MirroredAt90)), &[5.0, 3.0, 1.0, 6.0, 4.0, 2.0]),
        (4, Some(azimuths(&[0.0, 90.0], E::Quadrant)), &[1.0, 3.0, 2.0, 4.0]),
    ] {
        let grid = plain(&ldt(symmetry, numbers.len() / 2));
        assert_eq!(directions(&grid).azimuths(), angles.as_ref(), "{symmetry}");
        assert_eq!((grid.factor, grid.tensor.samples()), (2.0 * 500.0 / 1000.0, numbers), "{symmetry}");
    }
    let how = Interpretation { unit: Some(crate::domain::Unit::CandelaPerKilolumen), ..Interpretation::default() };
    assert_eq!(stated(ldt(0, 4).as_bytes(), &how).0.factor, 2.0);
}

#[test]
fn tables_keep_gaps_at_poles_and_both_ends_of_a_seam() {
    let mut text =
        "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n# angle_unit: deg\n\
                    theta_i,theta_o,phi_o,value\n"
            .to_owned();
    // The pole is measured once, and 360° lies 10 % above 0°.
    for (theta, phi, value) in [(0, 0, 1.0), (40, 0, 2.0), (40, 120, 3.0), (40, 240, 4.0), (40, 360, 2.2)] {
        writeln!(text, "10,{theta},{phi},{value}\n30,{theta},{phi},{}", 2.0 * value).unwrap();
    }
    let (grid, unfolded) = stated(text.as_bytes(), &Interpretation::default());
    assert_eq!(grid.tensor.axes()[0], Axis::Elevation(vec![10.0, 30.0]));
    let closed = azimuths(&[0.0, 120.0, 240.0, 360.0], domain::AzimuthExtent::Closed);
    assert_eq!(directions(&grid).azimuths(), Some(&closed));
    let [first, second] = [0, 1].map(|i| &grid.tensor.samples()[i * 8..i * 8 + 8]);
    assert!(first[0] == 1.0 && first[1..4].iter().all(|v| v.is_nan()) && first[4..] == [2.0, 3.0, 4.0, 2.2]);
    assert!(second[0] == 2.0 && second[7] == 4.4);
    assert_eq!(unfolded[..6], [1.0, 1.0, 1.0, 2.1, 3.0, 4.0]);

    let manifest = serde_json::json!({"quantity": "brdf", "cosine_included": true, "value_unit": "1/sr", "axes": [
        {"kind": "theta_i", "values": [10]},
        {"kind": "theta_o", "values": [0, 60]}, {"kind": "phi_o", "values": [0, 180, 360]}]});
    let array = crate::formats::write_npy(&[1, 2, 3], &[1.0, 1.0, 1.0, 1.0, 2.0, 3.0]);
    let how = Interpretation { axes: Some(manifest), ..Interpretation::default() };
    let (grid, _) = stated(&array, &how);
    // The cosine of 60° is 1/2 but for its last bit.
    let close = grid.tensor.samples().iter().zip([1.0, 1.0, 1.0, 2.0, 4.0, 6.0]).all(|(a, b)| (a - b).abs() < 1e-6);
    assert!(close, "{:?}", grid.tensor.samples());
    assert_eq!(directions(&grid).azimuths().unwrap().angles, [0.0, 180.0, 360.0]);
}
