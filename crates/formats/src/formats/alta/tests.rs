//! Directions of ALTA's coordinates against angles worked out by hand, and the refusals.

use super::super::{FormatErrorKind, Interpretation, NoteKind, Samples, StatedQuantity, read};
use super::coordinates::Coordinates;

fn angles(name: &str, x: &[f64]) -> [f64; 4] {
    let pair = Coordinates::of_name(name).unwrap().directions(x).unwrap();
    super::above(&pair).unwrap()
}

#[test]
fn coordinates_become_directions() {
    let degrees = |degrees: f64| degrees.to_radians();
    // Light at 30°, view at 50°, 120° apart.
    let spherical = angles("SPHERICAL_TL_PL_TV_PV", &[degrees(30.0), degrees(10.0), degrees(50.0), degrees(130.0)]);
    assert_eq!(spherical, [30.0, 10.0, 50.0, 130.0]);
    assert_eq!(
        angles("ISOTROPIC_TV_TL_DPHI", &[degrees(50.0), degrees(30.0), degrees(120.0)]),
        [30.0, 120.0, 50.0, 0.0]
    );
    // A negative elevation is on the other side.
    assert_eq!(angles("ISOTROPIC_TV_TL_DPHI", &[degrees(-50.0), degrees(30.0), 0.0]), [30.0, 0.0, 50.0, 180.0]);
    let (x, y) = (degrees(50.0) * 0.5, degrees(50.0) * 0.75_f64.sqrt());
    assert_eq!(angles("ISOTROPIC_TL_TV_PROJ_DPHI", &[degrees(30.0), x, y]), [30.0, 0.0, 50.0, 60.0]);
    let half = 0.5_f64.sqrt();
    assert_eq!(angles("CARTESIAN", &[half, 0.0, half, 0.0, 0.6, 0.8]), [36.8699, 90.0, 45.0, 0.0]);
    // The half vector at 20°, directions 30° from it in the plane of incidence (phi_d = 0): view at 50°, light at -10°.
    assert_eq!(angles("RUSIN_TH_TD_PD", &[degrees(20.0), degrees(30.0), 0.0]), [10.0, 180.0, 50.0, 0.0]);
    assert_eq!(
        angles("RUSIN_TH_PH_TD_PD", &[degrees(20.0), degrees(90.0), degrees(30.0), 0.0]),
        [10.0, 270.0, 50.0, 90.0]
    );
    // Across it (phi_d = 90°): the cosine of either angle is cos 20° cos 30°, and tan phi = tan 30° / sin 20°.
    let [theta_l, phi_l, theta_v, phi_v] = angles("RUSIN_TH_TD_PD", &[degrees(20.0), degrees(30.0), degrees(90.0)]);
    assert_eq!((theta_l, theta_v), (35.5313, 35.5313));
    assert_eq!((phi_l, phi_v), (300.6423, 59.3577));
    let below =
        Coordinates::of_name("RUSIN_TH_TD_PD").unwrap().directions(&[degrees(80.0), degrees(30.0), 0.0]).unwrap();
    assert!(super::above(&below).is_none());
}

#[test]
fn refusals_name_what_the_header_lacks() {
    for (text, kind, word) in [
        (
            "#DIM 2 1\n#PARAM_IN RUSIN_TH_TD\n#PARAM_OUT INV_STERADIAN\n0.1 0.2 0.3\n",
            FormatErrorKind::Unsupported,
            "do not fix two directions",
        ),
        (
            "#DIM 1 1\n#PARAM_IN COS_TH\n#PARAM_OUT INV_STERADIAN\n0.5 0.3\n0.6 0.2\n0.7 0.1\n",
            FormatErrorKind::Unsupported,
            "`COS_TH`",
        ),
        ("#DIM 2 1\n0.1 0.2 0.3\n0.2 0.2 0.3\n", FormatErrorKind::Unsupported, "no line `#PARAM_IN`"),
        ("#DIM 3 1\n#PARAM_IN RUSIN_TH_TD_PD\n0.1 0.2 0 0.3\n", FormatErrorKind::NeedsOption, "no line `#PARAM_OUT`"),
        (
            "#DIM 3 1\n#PARAM_IN RUSIN_TH_TD_PD\n#PARAM_OUT ENERGY\n0.1 0.2 0 0.3\n",
            FormatErrorKind::Unsupported,
            "values `ENERGY`",
        ),
        (
            "#DIM 3 7\n#PARAM_IN RUSIN_TH_TD_PD\n#PARAM_OUT INV_STERADIAN\n0 0 0 1 1 1 1 1 1 1\n",
            FormatErrorKind::Unsupported,
            "7 values a row",
        ),
        ("#DIM 3 1\n#PARAM_IN CARTESIAN\n#PARAM_OUT INV_STERADIAN\n0 0 0 1\n", FormatErrorKind::Malformed, "has 6"),
        ("#PARAM_IN CARTESIAN\n#PARAM_OUT INV_STERADIAN\n0 0 0 1\n", FormatErrorKind::Malformed, "no line `#DIM`"),
        (
            "#DIM 3 1\n#PARAM_IN RUSIN_TH_TD_PD\n#PARAM_OUT INV_STERADIAN\n0.1 0.2 0\n",
            FormatErrorKind::Malformed,
            "line 4, column 1: a row of 3 numbers, expected 4",
        ),
        (
            "#DIM 3 1\n#PARAM_IN RUSIN_TH_TD_PD\n#PARAM_OUT INV_STERADIAN\n0.1 0.2 0 1 2 3 4\n",
            FormatErrorKind::Malformed,
            "more than",
        ),
        (
            "#DIM 3 1\n#PARAM_IN RUSIN_TH_TD_PD\n#PARAM_OUT INV_STERADIAN\n30 0.2 0 1\n",
            FormatErrorKind::Malformed,
            "expected angles in radians",
        ),
        (
            "#DIM 6 1\n#PARAM_IN CARTESIAN\n#PARAM_OUT INV_STERADIAN\n0 0 2 0 0 1 1\n",
            FormatErrorKind::Malformed,
            "two unit vectors",
        ),
        (
            "#DIM 3 1\n#PARAM_IN RUSIN_TH_TD_PD\n#PARAM_OUT INV_STERADIAN\n1.5 0.5 0 1\n",
            FormatErrorKind::Malformed,
            "no row with both",
        ),
        (
            "#DIM 3 1\n#PARAM_IN RUSIN_TH_TD_PD\n#PARAM_OUT INV_STERADIAN\n#FORMAT binary\n#BEGIN_STREAM\n",
            FormatErrorKind::Unsupported,
            "format `binary`",
        ),
        (
            "#ALTA FUNC HEADER\n#CMD\n#DIM 1 1\n#PARAM_IN COS_TH\n#FUNC nonlinear_function_blinn\n",
            FormatErrorKind::Unsupported,
            "a function that ALTA fitted",
        ),
    ] {
        let error = read(text.as_bytes(), &Interpretation::default()).unwrap_err();
        assert!(error.kind == kind && error.format == "alta" && error.to_string().contains(word), "{text}{error:?}");
    }
}

#[test]
fn values_are_brdfs_where_the_user_says_so() {
    let text = "#DIM 3 1\n#PARAM_IN ISOTROPIC_TV_TL_DPHI\n0.1 0.2 0 0.3\n0.2 0.2 0 nan\n0.3 0.2 0 0.5 0.1 0.2\n";
    let quantity = Some(StatedQuantity::Brdf);
    let found = read(text.as_bytes(), &Interpretation { quantity, ..Interpretation::default() }).unwrap();
    let Samples::Grid(grid) = found.samples else { panic!("a grid") };
    assert!(grid.values[0] == 0.3 && grid.values[1].is_nan() && grid.values[2] == 0.5, "{:?}", grid.values);
    let has =
        |kind, words: &str| found.report.notes.iter().any(|note| note.kind == kind && note.message.contains(words));
    assert!(has(NoteKind::Skipped, "confidence limits of 1 row") && has(NoteKind::Assumed, "as asked"));
}
