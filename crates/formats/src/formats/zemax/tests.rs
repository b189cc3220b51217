//! Zemax BSDF files: directions and values of every symmetry, channels, refusals by name, and hostile fields.

use super::*;
use crate::domain::Quantity;
use crate::formats::acquisition::{Samples, Scattered};
use crate::formats::{NoteKind, read as read_any};
use std::fmt::Write as _;

/// Parts of a test file that vary between tests.
struct Sheet<'a> {
    symmetry: &'a str,
    content: &'a str,
    scatter: &'a str,
    rotations: &'a [f64],
    incidences: &'a [f64],
    azimuths: &'a [f64],
    radials: &'a [f64],
}

const PLANE: Sheet<'_> = Sheet {
    symmetry: "PlaneSymmetrical",
    content: "Monochrome",
    scatter: "BRDF",
    rotations: &[0.0],
    incidences: &[0.0, 30.0],
    azimuths: &[0.0, 90.0, 180.0],
    radials: &[0.0, 10.0, 70.0],
};

impl Sheet<'_> {
    fn text(&self) -> String {
        let list = |angles: &[f64]| angles.iter().map(f64::to_string).collect::<Vec<_>>().join("\t");
        let mut text = format!(
            "# Model: test\n#\nSource  Measured\nSymmetry  {}\nSpectralContent  {}\nScatterType  {}\n",
            self.symmetry, self.content, self.scatter
        );
        for (key, angles) in [
            ("SampleRotation", self.rotations),
            ("AngleOfIncidence", self.incidences),
            ("ScatterAzimuth", self.azimuths),
            ("ScatterRadial", self.radials),
        ] {
            let _ = writeln!(text, "{key}  {}\n{}", angles.len(), list(angles));
        }
        let channels: &[&str] =
            if self.content == "XYZ" { &["TristimulusX", "TristimulusY", "TristimulusZ"] } else { &["Monochrome"] };
        // Numbers count on, so that each place has its own.
        let mut number = 0;
        for channel in channels {
            let _ = writeln!(text, "\n{channel}\nDataBegin");
            for _ in 0..self.rotations.len() * self.incidences.len() {
                text.push_str("TIS 0.5\n");
                for _ in self.azimuths {
                    let row: Vec<String> = self
                        .radials
                        .iter()
                        .map(|_| {
                            number += 1;
                            format!("{number}e-3")
                        })
                        .collect();
                    let _ = writeln!(text, "{}", row.join("\t"));
                }
            }
            text.push_str("DataEnd\n");
        }
        text
    }

    fn read(&self) -> Result<Acquisition, FormatError> {
        plain(&self.text())
    }
}

fn plain(text: &str) -> Result<Acquisition, FormatError> {
    read_any(text.as_bytes(), &Interpretation::default())
}

fn scattered(acquisition: &Acquisition) -> &Scattered {
    let Samples::Scattered(scattered) = &acquisition.samples else { panic!("scattered samples") };
    scattered
}

/// Returns the value at a pair of directions in degrees.
fn at(acquisition: &Acquisition, wi: [f64; 2], wo: [f64; 2]) -> Option<f64> {
    let found = scattered(acquisition);
    let close = |a: [f64; 2], b: [f64; 2]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
    let row = (0..found.values.len()).find(|&i| close(found.incoming[i], wi) && close(found.outgoing[i], wo))?;
    Some(f64::from(found.values[row]))
}

fn says(acquisition: &Acquisition, kind: NoteKind, words: &str) -> bool {
    acquisition.report.notes.iter().any(|note| note.kind == kind && note.message.contains(words))
}

#[test]
fn values_stand_at_their_directions_about_the_specular_ray() {
    let read = PLANE.read().unwrap();
    assert_eq!((read.format, read.quantity, read.unit), (NAME, Quantity::Brdf, Unit::PerSteradian));
    assert_eq!(read.dialect, "PlaneSymmetrical, Monochrome, 2 incidences × 3 azimuths × 3 radial angles");
    assert!(scattered(&read).isotropic);
    let close = |wi: [f64; 2], wo: [f64; 2], value: f64| {
        assert!((at(&read, wi, wo).unwrap() - value).abs() < 1e-6, "{wi:?} {wo:?}");
    };
    // Normal incidence: 1 to 9, and the mean of 1, 4 and 7 at the normal.
    close([0.0, 0.0], [0.0, 0.0], 4e-3);
    close([0.0, 0.0], [10.0, 0.0], 2e-3);
    close([0.0, 0.0], [70.0, 90.0], 6e-3);
    close([0.0, 0.0], [10.0, 180.0], 8e-3);
    // From 30°: the specular ray at 180°, the normal at radial angle 30°, the light beyond it.
    close([30.0, 0.0], [30.0, 180.0], 13e-3);
    close([30.0, 0.0], [20.0, 180.0], 11e-3);
    close([30.0, 0.0], [40.0, 0.0], 12e-3);
    close([30.0, 0.0], [40.0, 180.0], 17e-3);
    // 70° beyond 30° is below the surface.
    assert_eq!(scattered(&read).values.len(), 7 + 6);
    assert!(says(&read, NoteKind::Skipped, "1 of 18 values"), "{:?}", read.report.notes);
    assert!(read.report.metadata.contains(&("comment".to_owned(), "Model: test".to_owned())));
    assert!(read.report.metadata.contains(&("TIS".to_owned(), "0.5 0.5".to_owned())));
}

#[test]
fn transmission_is_about_the_ray_straight_through() {
    let read = Sheet { scatter: "BTDF", ..PLANE }.read().unwrap();
    assert_eq!(read.quantity, Quantity::Btdf);
    assert!(says(&read, NoteKind::Assumed, "at the angle of incidence"), "{:?}", read.report.notes);
    assert!((at(&read, [30.0, 0.0], [150.0, 180.0]).unwrap() - 13e-3).abs() < 1e-6);
    assert!((at(&read, [30.0, 0.0], [160.0, 180.0]).unwrap() - 11e-3).abs() < 1e-6);
    assert!((at(&read, [0.0, 0.0], [110.0, 90.0]).unwrap() - 6e-3).abs() < 1e-6);
}

#[test]
fn rotations_are_azimuths_of_the_light() {
    let whole = Sheet { symmetry: "ASymmetrical4D", rotations: &[0.0, 90.0], ..PLANE };
    let read = whole.read().unwrap();
    assert!(!scattered(&read).isotropic && says(&read, NoteKind::Assumed, "azimuths of the light"));
    assert!(read.dialect.contains("2 rotations × 2 incidences"), "{}", read.dialect);
    // The second rotation: 19 to 36; from 30° 28 to 36.
    assert!((at(&read, [30.0, 90.0], [30.0, 270.0]).unwrap() - 31e-3).abs() < 1e-6);
    assert!((at(&read, [30.0, 90.0], [20.0, 270.0]).unwrap() - 29e-3).abs() < 1e-6);
    let one = Sheet { symmetry: "asymmetrical4d", rotations: &[45.0], ..PLANE }.read().unwrap();
    assert!(scattered(&one).isotropic && says(&one, NoteKind::Assumed, "the only sample rotation, 45°"));
    let none = Sheet { symmetry: "Asymmetrical", azimuths: &[0.0, 90.0, 180.0, 270.0], ..PLANE }.read().unwrap();
    assert!(scattered(&none).isotropic && says(&none, NoteKind::Assumed, "counter-clockwise"));
    let error = Sheet { rotations: &[0.0, 90.0], ..PLANE }.read().unwrap_err();
    assert!(error.kind == FormatErrorKind::Unsupported && error.message.contains("2 sample rotations"), "{error}");
}

#[test]
fn normal_incidence_alone_is_a_grid() {
    let read = Sheet { incidences: &[0.0], ..PLANE }.read().unwrap();
    let Samples::Grid(grid) = &read.samples else { panic!("a grid") };
    assert_eq!(grid.outgoing.as_ref().unwrap().theta, [0.0, 10.0, 70.0]);
    assert_eq!(grid.values[3..], [2.0, 5.0, 8.0, 3.0, 6.0, 9.0].map(|n: f64| (n * 1e-3) as f32));
}

#[test]
fn one_channel_of_tristimulus_values_is_asked_for() {
    let text = Sheet { content: "XYZ", ..PLANE }.text();
    let error = plain(&text).unwrap_err();
    assert!(
        error.kind == FormatErrorKind::NeedsOption && error.message.contains("X, Y, Z (Y is the luminous one)"),
        "{error}"
    );
    for column in ["y", "2"] {
        let how = Interpretation { column: Some(column.to_owned()), ..Interpretation::default() };
        let read = read_any(text.as_bytes(), &how).unwrap();
        assert!((at(&read, [30.0, 0.0], [30.0, 180.0]).unwrap() - 31e-3).abs() < 1e-6);
    }
    let how = Interpretation { column: Some("W".to_owned()), ..Interpretation::default() };
    assert_eq!(read_any(text.as_bytes(), &how).unwrap_err().kind, FormatErrorKind::NeedsOption);
    // One DataBegin and DataEnd for all channels.
    let once = text
        .replace("DataEnd\n\nTristimulusY\nDataBegin\n", "TristimulusY\n")
        .replace("DataEnd\n\nTristimulusZ\nDataBegin\n", "TristimulusZ\n");
    let how = Interpretation { column: Some("Z".to_owned()), ..Interpretation::default() };
    assert!(once != text && read_any(once.as_bytes(), &how).is_ok());
}

#[test]
fn the_integral_is_compared_with_the_total_scatter() {
    let angles = |step: usize, last: usize| (0..=last).step_by(step).map(|angle| angle as f64).collect::<Vec<_>>();
    let (azimuths, radials) = (angles(15, 180), angles(5, 180));
    let sheet = Sheet { incidences: &[0.0, 40.0], azimuths: &azimuths, radials: &radials, ..PLANE };
    let text = sheet.text();
    // A Lambertian surface of albedo 0.5.
    let albedo: String = text
        .lines()
        .map(|line| if line.contains("e-3") { vec!["0.1591549"; radials.len()].join(" ") } else { line.to_owned() } + "\n")
        .collect();
    let read = plain(&albedo).unwrap();
    assert!(!says(&read, NoteKind::Warning, "total integrated scatter"), "{:?}", read.report.notes);
    let read = plain(&albedo.replace("TIS 0.5", "TIS 0.25")).unwrap();
    assert!(says(&read, NoteKind::Warning, "the values make 2"), "{:?}", read.report.notes);
}

#[test]
fn refusals_say_where_and_what() {
    use FormatErrorKind::{Malformed, NeedsOption, OverLimit, Unsupported};
    let good = PLANE.text();
    let with = |old: &str, new: &str| good.replacen(old, new, 1);
    for (text, kind, words) in [
        (with("PlaneSymmetrical", "Diagonal"), Unsupported, "found `Diagonal`, expected PlaneSymmetrical"),
        (with("Monochrome", "RGB"), Unsupported, "found `RGB`, expected Monochrome or XYZ"),
        (with("BRDF", "BSSRDF"), Unsupported, "expected BRDF or BTDF"),
        (with("Symmetry", "AOI"), Unsupported, "found `AOI`"),
        (with("ScatterType  BRDF\n", ""), Malformed, "no ScatterType"),
        (with("ScatterRadial  3", "ScatterRadial  1e9"), Malformed, "a whole number from 1"),
        (with("ScatterRadial  3", "ScatterRadial  4"), Malformed, "found `Monochrome`, expected an angle"),
        (with("0\t30\n", "0\t91\n"), Malformed, "angle 91° of AngleOfIncidence"),
        (with("1e-3", "nan"), Malformed, "found `nan`, expected a value"),
        (with("1e-3", "1e99"), Malformed, "range of float32"),
        (with("9e-3\n", "9e-3\t10e-3\n"), Malformed, "expected TIS and the next table (1 of 2 were read)"),
        (with("DataEnd", "DataEnd 7"), Malformed, "expected the end of the file"),
        (with("TIS 0.5", "TIS"), Malformed, "TIS"),
        (good[..good.len() - 20].to_owned(), Malformed, "the file ends"),
        (
            with("SampleRotation  1\n0\n", &format!("SampleRotation  900\n{}\n", "0 ".repeat(900))),
            Unsupported,
            "900 sample rotations",
        ),
    ] {
        let error = plain(&text).unwrap_err();
        assert_eq!((error.kind, error.format), (kind, NAME), "{words}: {error}");
        assert!(error.position.is_some() && error.message.contains(words), "{words}: {error}");
    }
    let many = |key: &str| format!("{key} 2000\n{}\n", "0 ".repeat(2000));
    let head = ["SampleRotation", "AngleOfIncidence", "ScatterAzimuth", "ScatterRadial"].map(many).concat();
    let text = format!(
        "Symmetry ASymmetrical4D\nSpectralContent Monochrome\nScatterType BRDF\n{head}Monochrome\nDataBegin\nTIS 1\n"
    );
    assert_eq!(plain(&text).unwrap_err().kind, OverLimit);
    for (quantity, unit) in [(Some(Quantity::Btdf), None), (None, Some(Unit::Candela))] {
        let how = Interpretation { quantity: quantity.map(Into::into), unit, ..Interpretation::default() };
        assert_eq!(read_any(good.as_bytes(), &how).unwrap_err().kind, NeedsOption);
    }
}

#[test]
fn no_length_and_no_field_makes_it_panic() {
    let text = PLANE.text();
    for cut in 0..text.len() - "ta\nDataEnd\n".len() {
        let _ = plain(&text[..cut]);
    }
    for hostile in ["NaN", "-1", "0", "1e308", "9223372036854775808", "", "#", "\u{1}"] {
        for field in ["30", "90", "180", "10", "3", "2", "TIS", "DataBegin", "5e-3", "Monochrome", "0"] {
            let _ = plain(&text.replacen(field, hostile, 1));
        }
    }
}
