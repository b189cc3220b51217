//! EULUMDAT: every symmetry against the directions it stands for, photometry, layouts of lamp sets, and hostile fields.

use super::*;
use crate::formats::acquisition::{AngleGrid, AzimuthExtent};
use crate::formats::read as read_any;
use crate::formats::{FormatErrorKind, NoteKind};

/// Parts of an EULUMDAT test file that vary between tests.
struct Sheet {
    symmetry: usize,
    planes: Vec<f64>,
    gammas: Vec<f64>,
    sets: Vec<String>,
    values: Vec<f64>,
}

const GAMMAS: [f64; 5] = [0.0, 30.0, 60.0, 90.0, 180.0];

/// Returns an intensity that differs for every direction and is 0 at the poles.
fn shape(c: f64, gamma: f64) -> f64 {
    (gamma.to_radians().sin() * (1000.0 + c) * (1.0 + gamma)).round()
}

impl Sheet {
    /// Returns a test luminaire file (EULUMDAT) with C planes every 30°. Only the planes that the symmetry code
    /// `symmetry` requires have intensities, in the order of the format.
    fn of(symmetry: usize) -> Self {
        let planes: Vec<f64> = (0..12).map(|i| 30.0 * f64::from(i)).collect();
        let stored: Vec<f64> = match symmetry {
            0 => planes.clone(),
            1 => vec![0.0],
            2 => planes[..7].to_vec(),
            3 => (0..7).map(|i| planes[(9 + i) % 12]).collect(),
            _ => planes[..4].to_vec(),
        };
        let values = stored.iter().flat_map(|&c| GAMMAS.map(|gamma| shape(c, gamma))).collect();
        Self { symmetry, planes, gammas: GAMMAS.to_vec(), sets: vec!["1\nLED\n2000\n3000\n80\n15".to_owned()], values }
    }

    fn text(&self) -> String {
        let list = |values: &[f64]| values.iter().map(f64::to_string).map(|v| v + "\n").collect::<String>();
        format!(
            "ACME\n2\n{}\n{}\n30\n{}\n0\nR1\nname\n\nf.ldt\ntoday\n1200\n80\n60\n1100\n70\n0\n0\n0\n0\n100\n100\n1\n0\n{}\n{}\n{}{}{}{}",
            self.symmetry,
            self.planes.len(),
            self.gammas.len(),
            self.sets.len(),
            self.sets.join("\n"),
            "0.5\n".repeat(10),
            list(&self.planes),
            list(&self.gammas),
            list(&self.values),
        )
    }

    fn read(&self) -> Result<Acquisition, FormatError> {
        plain(&self.text())
    }
}

fn plain(text: &str) -> Result<Acquisition, FormatError> {
    read_any(text.as_bytes(), &Interpretation::default())
}

fn asked(text: &str, unit: Unit) -> Result<Acquisition, FormatError> {
    read_any(text.as_bytes(), &Interpretation { unit: Some(unit), ..Interpretation::default() })
}

fn grid(acquisition: &Acquisition) -> &AngleGrid {
    match &acquisition.samples {
        Samples::Grid(grid) => grid,
        _ => panic!("expected a grid"),
    }
}

fn says(acquisition: &Acquisition, kind: NoteKind, words: &str) -> bool {
    acquisition.report.notes.iter().any(|note| note.kind == kind && note.message.contains(words))
}

/// Returns the intensity at a listed gamma and at any azimuth C whose plane or mirror image is in the grid.
fn intensity(grid: &AngleGrid, gamma: f64, c: f64) -> f64 {
    let angles = grid.outgoing.as_ref().unwrap();
    let row = angles.theta.iter().position(|&theta| theta == 180.0 - gamma).unwrap();
    let Some(azimuths) = &angles.phi else { return f64::from(grid.values[row]) };
    let c = if azimuths.extent == AzimuthExtent::Mirrored && c > 180.0 { 360.0 - c } else { c };
    let column = azimuths.phi.iter().position(|&phi| phi == c).unwrap_or_else(|| panic!("C{c}"));
    f64::from(grid.values[row * azimuths.phi.len() + column])
}

#[test]
fn every_symmetry_unfolds_to_the_planes_it_stands_for() {
    type Folded = (&'static str, fn(f64) -> f64);
    let symmetric: [Folded; 5] = [
        ("no symmetry", |c| c),
        ("axially symmetric", |_| 0.0),
        ("symmetric about the 0-180 plane", |c| if c > 180.0 { 360.0 - c } else { c }),
        ("symmetric about the 90-270 plane", |c| if c > 90.0 && c < 270.0 { (540.0 - c) % 360.0 } else { c }),
        ("quadrant symmetric", |c| {
            let half = if c > 180.0 { 360.0 - c } else { c };
            if half > 90.0 { 180.0 - half } else { half }
        }),
    ];
    for (symmetry, (name, stored)) in symmetric.into_iter().enumerate() {
        let lamp = Sheet::of(symmetry).read().unwrap();
        assert_eq!(lamp.dialect, format!("EULUMDAT, relative photometry, {name}"));
        assert_eq!((lamp.unit, grid(&lamp).outside), (Unit::Candela, crate::formats::Outside::Zero));
        for i in 0..12 {
            let c = 30.0 * f64::from(i);
            for gamma in [30.0, 60.0, 90.0] {
                // 2000 lm: candela are twice the value per 1000 lm.
                assert_eq!(intensity(grid(&lamp), gamma, c), 2.0 * shape(stored(c), gamma), "{name} C{c}");
            }
        }
    }
}

#[test]
fn lines_may_end_in_blanks_and_numbers_have_commas() {
    let mut sheet = Sheet::of(2);
    sheet.values[1] = 12.5;
    let expected = grid(&sheet.read().unwrap()).values.clone();
    let text = sheet.text();
    for other in [
        text.replace('.', ","),
        text.replace('\n', "  \t\r\n"),
        text.replace('\n', "\r"),
        format!("{text}\n\n  \n\u{1a}\u{1a}"),
        text.trim_end().to_owned(),
        format!("\u{feff}{text}"),
    ] {
        assert_eq!(grid(&plain(&other).unwrap()).values, expected);
    }
    let old: Vec<u8> = text.replace("ACME", "B\u{1}ro").bytes().map(|b| if b == 1 { 0x81 } else { b }).collect();
    let lamp = read_any(&old, &Interpretation::default()).unwrap();
    assert!(says(&lamp, NoteKind::Assumed, "Windows-1252"));
    let trailed = plain(&format!("{text}made with a tool\n")).unwrap();
    assert!(says(&trailed, NoteKind::Warning, "1 line after the last intensity was not read"));
}

#[test]
fn units_behind_numbers_count_and_others_are_refused() {
    let text = |lumens: &str, watts: &str| {
        Sheet { sets: vec![format!("1 pcs\nLED\n{lumens}\n3000\n80\n{watts}")], ..Sheet::of(0) }.text()
    };
    let stated = plain(&text("2000", "15")).unwrap();
    for (lumens, watts, kept) in [
        ("2'000 lm", "ca. 15 W", Some("15")),
        ("2 klm", "0,015 kW", Some("15")),
        ("2 000 Lumen", "2x18W", None),
        ("2000", "n/a", None),
    ] {
        let lamp = plain(&text(lumens, watts)).unwrap();
        assert_eq!(grid(&lamp).values, grid(&stated).values, "{lumens}");
        let found = lamp.report.metadata.iter().find(|(key, _)| key == "watts").map(|(_, text)| text.as_str());
        assert_eq!(found, kept, "{watts}");
        assert_eq!(says(&lamp, NoteKind::Skipped, "not one number of watts"), kept.is_none());
    }
    let refused = plain(&text("100 lm/W", "15")).unwrap_err().to_string();
    assert!(refused.contains("found `100 lm/W`, expected the lumens of the lamps"), "{refused}");
    let sized = Sheet::of(0).text();
    let lines: Vec<&str> = sized.lines().collect();
    for (size, kept) in [("60 cm", Some("600")), ("0.6 m", Some("600")), ("n/a", None), ("-", None)] {
        let mut lines = lines.clone();
        lines[12] = size;
        let lamp = plain(&lines.join("\n")).unwrap();
        let found = lamp.report.metadata.iter().find(|(key, _)| key == "luminaire_length_mm");
        assert_eq!(found.map(|(_, text)| text.as_str()), kept, "{size}");
    }
    let mut shifted = lines.clone();
    shifted[12] = "60 ells";
    assert!(plain(&shifted.join("\n")).unwrap_err().message.contains("found `60 ells`, expected a dimension"));
}

#[test]
fn a_negative_number_of_lamps_is_absolute_photometry() {
    let text = |lamps: &str, lumens: &str| {
        Sheet { sets: vec![format!("{lamps}\nLED\n{lumens}\n3000\n80\n15")], ..Sheet::of(0) }.text()
    };
    let lamp = plain(&text("-2", "3000")).unwrap();
    assert_eq!(lamp.dialect, "EULUMDAT, absolute photometry, no symmetry");
    assert_eq!(intensity(grid(&lamp), 30.0, 60.0), 3.0 * shape(60.0, 30.0));
    assert!(!says(&lamp, NoteKind::Assumed, "relative photometry"));
    // Without the lumens, per 1000 of them.
    for lumens in ["0", "-1"] {
        let lamp = plain(&text("1", lumens)).unwrap();
        assert_eq!((lamp.unit, intensity(grid(&lamp), 30.0, 60.0)), (Unit::CandelaPerKilolumen, shape(60.0, 30.0)));
        assert!(says(&lamp, NoteKind::Warning, "expected the lumens"));
        assert_eq!(asked(&text("1", lumens), Unit::Candela).unwrap_err().kind, FormatErrorKind::NeedsOption);
        assert_eq!(asked(&text("1", lumens), Unit::Relative).unwrap().unit, Unit::Relative);
    }
    let lamp = asked(&text("1", "2000"), Unit::CandelaPerKilolumen).unwrap();
    assert_eq!((lamp.unit, intensity(grid(&lamp), 30.0, 60.0)), (Unit::CandelaPerKilolumen, shape(60.0, 30.0)));
    let lamp = asked(&text("1", "2000"), Unit::WattPerSteradian).unwrap();
    assert_eq!((lamp.unit, intensity(grid(&lamp), 30.0, 60.0)), (Unit::WattPerSteradian, 2.0 * shape(60.0, 30.0)));
    assert_eq!(asked(&text("1", "2000"), Unit::PerSteradian).unwrap_err().kind, FormatErrorKind::NeedsOption);
    let how = Interpretation { quantity: Some(Quantity::Brdf.into()), ..Interpretation::default() };
    let error = read_any(text("1", "2000").as_bytes(), &how).unwrap_err();
    assert_eq!(error.kind, FormatErrorKind::NeedsOption);
}

#[test]
fn the_conversion_factor_multiplies() {
    let text = Sheet::of(0).text().replace("\n100\n100\n1\n0\n", "\n100\n100\n2,5\n0\n");
    assert_eq!(intensity(grid(&plain(&text).unwrap()), 60.0, 30.0), 5.0 * shape(30.0, 60.0));
    let blank = Sheet::of(0).text().replace("\n100\n100\n1\n0\n", "\n100\n100\n\n0\n");
    let lamp = plain(&blank).unwrap();
    assert!(says(&lamp, NoteKind::Assumed, "conversion factor"));
    assert_eq!(intensity(grid(&lamp), 60.0, 30.0), 2.0 * shape(30.0, 60.0));
    let zero = Sheet::of(0).text().replace("\n100\n100\n1\n0\n", "\n100\n100\n0\n0\n");
    assert!(plain(&zero).unwrap_err().message.contains("conversion factor 0"));
    let tilted = Sheet::of(0).text().replace("\n100\n100\n1\n0\n", "\n100\n100\n1\n15\n");
    assert!(says(&plain(&tilted).unwrap(), NoteKind::Warning, "tilt of 15°"));
}

#[test]
fn lamp_sets_are_alternatives_in_either_layout() {
    let sets = ["1\nT16 35W\n3650\nneutral\n1B\n39".to_owned(), "2\nT16 49W\n8600\nwarm\n1B\n110".to_owned()];
    let by_set = Sheet { sets: sets.to_vec(), ..Sheet::of(4) };
    let by_field = Sheet {
        sets: vec!["1\n2\nT16 35W\nT16 49W\n3650\n8600".to_owned(), "neutral\nwarm\n1B\n1B\n39\n110".to_owned()],
        ..Sheet::of(4)
    };
    let (a, b) = (by_set.read().unwrap(), by_field.read().unwrap());
    assert_eq!(grid(&a).values, grid(&b).values);
    assert_eq!(a.report.metadata, b.report.metadata);
    assert!(a.report.metadata.contains(&("set_2_lumens".to_owned(), "8600".to_owned())));
    assert!(says(&a, NoteKind::Assumed, "2 lamp sets") && says(&b, NoteKind::Assumed, "field by field"));
    assert_eq!(intensity(grid(&a), 60.0, 30.0), f64::from((shape(30.0, 60.0) * 3.65) as f32));
    let none = Sheet { sets: Vec::new(), ..Sheet::of(4) }.text().replace("\n0\n0\n\n", "\n0\n0\n");
    let lamp = plain(&none).unwrap();
    assert!(lamp.unit == Unit::CandelaPerKilolumen && says(&lamp, NoteKind::Warning, "no lamp set"));
}

#[test]
fn the_flux_is_that_stated_and_a_wrong_one_is_told() {
    let disk = |scale: f64| Sheet {
        gammas: (0..=36).map(|i| 2.5 * f64::from(i)).collect(),
        // A disk of Φ lumens has Φ/π cos γ.
        values: (0..=36)
            .map(|i| scale * 1000.0 / std::f64::consts::PI * (2.5 * f64::from(i)).to_radians().cos())
            .collect(),
        sets: vec!["-1\nLED\n1234\n3000\n80\n15".to_owned()],
        ..Sheet::of(1)
    };
    let lamp = disk(1.0).read().unwrap();
    assert!((flux(grid(&lamp)) / 1234.0 - 1.0).abs() < 0.005, "{}", flux(grid(&lamp)));
    assert!(lamp.report.notes.is_empty(), "{:?}", lamp.report.notes);
    assert!(says(&disk(1.2).read().unwrap(), NoteKind::Warning, "of the 1234 lm stated"));
}

#[test]
fn planes_are_as_many_as_there_are_values() {
    // All planes, though the file says quadrants; one, though it says none.
    let all = Sheet { symmetry: 4, ..Sheet::of(0) }.read().unwrap();
    assert!(all.dialect.ends_with("no symmetry") && says(&all, NoteKind::Warning, "all planes"));
    let one = Sheet { symmetry: 0, ..Sheet::of(1) }.read().unwrap();
    assert!(one.dialect.ends_with("axially symmetric") && says(&one, NoteKind::Warning, "one plane"));
    // Planes need not be even, and C360 may close the circle.
    let uneven: Vec<f64> = vec![0.0, 10.0, 90.0, 170.0, 180.0, 190.0, 270.0, 350.0];
    let values = uneven[..5].iter().flat_map(|&c| GAMMAS.map(|gamma| shape(c, gamma))).collect();
    let lamp = Sheet { planes: uneven, values, ..Sheet::of(2) }.read().unwrap();
    assert_eq!(intensity(grid(&lamp), 60.0, 350.0), 2.0 * shape(10.0, 60.0));
    let closed: Vec<f64> = vec![0.0, 90.0, 180.0, 270.0, 360.0];
    let values = closed.iter().flat_map(|&c| GAMMAS.map(|gamma| shape(c % 360.0, gamma))).collect();
    let lamp = Sheet { planes: closed, values, ..Sheet::of(0) }.read().unwrap();
    assert_eq!(grid(&lamp).outgoing.as_ref().unwrap().phi.as_ref().unwrap().phi.len(), 4);
    // Three planes without symmetry go round, whatever their angles.
    let values = [0.0, 90.0, 180.0].iter().flat_map(|&c| GAMMAS.map(|gamma| shape(c, gamma))).collect();
    let lamp = Sheet { planes: vec![0.0, 90.0, 180.0], values, ..Sheet::of(0) }.read().unwrap();
    assert_eq!(grid(&lamp).outgoing.as_ref().unwrap().phi.as_ref().unwrap().extent, AzimuthExtent::Circle);
}

#[test]
fn refusals_say_where_and_what() {
    let text = Sheet::of(0).text();
    let lines: Vec<&str> = text.lines().collect();
    let last = lines.len();
    let line = |number: usize, found: &str| {
        let mut lines = lines.clone();
        lines[number - 1] = found;
        lines.join("\n")
    };
    let without = |from: usize, to: usize| [&lines[..from], &lines[to..]].concat().join("\n");
    let odd = Sheet { planes: (0..11).map(|i| 30.0 * f64::from(i)).collect(), ..Sheet::of(4) };
    let turned = Sheet { planes: (0..12).map(|i| 15.0 + 30.0 * f64::from(i)).collect(), ..Sheet::of(2) };
    let turned_3 = Sheet { planes: (0..12).map(|i| 15.0 + 30.0 * f64::from(i)).collect(), ..Sheet::of(3) };
    for (text, word) in [
        (without(text.lines().count() - 1, text.lines().count()), "59 intensities, expected 12 planes of 5"),
        (without(60, 62), "intensities, expected"),
        // The blank line of the luminaire's number was lost.
        (without(9, 10), "is a line above it missing?"),
        (lines[..40].join("\n"), "expected"),
        (odd.text(), "C planes divisible by 4"),
        (turned.text(), "plane C15, expected C0"),
        (turned_3.text(), "plane C285, expected C270"),
        (Sheet { planes: vec![0.0; 12], ..Sheet::of(2) }.text(), "expected C180"),
        (Sheet { gammas: vec![0.0, 60.0, 30.0, 90.0, 180.0], ..Sheet::of(0) }.text(), "increasing angles"),
        (Sheet { gammas: vec![0.0, 30.0, 60.0, 90.0, 190.0], ..Sheet::of(0) }.text(), "expected 0° to 180°"),
        (text.replace("\nLED\n2000\n", "\nLED\nmany\n"), "found `many`, expected the lumens"),
        (text.replace("\n1200\n", "\n1.200,5\n"), "expected a dimension"),
        (line(2, "9"), "found `9`, expected the type of luminaire, a whole number from 0 to 3 (line 2"),
        (line(3, "5"), "found `5`, expected the symmetry, a whole number from 0 to 4 (line 3"),
        (line(4, "-8"), "found `-8`, expected the number of C planes"),
        (line(last - 7, "NaN"), "found `NaN`, expected an intensity: 52 intensities, expected 12 planes of 5"),
        // The line after exactly one plane.
        (line(last - 54, "1O0"), "found `1O0`, expected an intensity: 5 intensities, expected 12 planes of 5"),
    ] {
        let error = plain(&text).unwrap_err();
        assert_eq!((error.kind, error.format), (FormatErrorKind::Malformed, NAME), "{error}");
        assert!(error.position.is_some() && error.message.contains(word), "{error}");
    }
}

#[test]
fn no_field_makes_it_panic_and_no_length_either() {
    for symmetry in 0..5 {
        let text = Sheet::of(symmetry).text();
        let lines: Vec<&str> = text.lines().collect();
        for hostile in ["NaN", "-1", "9223372036854775808", "1e308", "", "0", "x"] {
            for i in 0..lines.len() {
                let mut changed = lines.clone();
                changed[i] = hostile;
                if let Err(error) = plain(&changed.join("\n")) {
                    assert!(error.to_string().len() < 400, "{error}");
                }
            }
        }
        for cut in 0..text.len() {
            let outcome = plain(&text[..cut]);
            // A cut after exactly one plane reads as axially symmetric, with a warning.
            let told = outcome.as_ref().is_ok_and(|lamp| says(lamp, NoteKind::Warning, "one plane"));
            assert!(told || outcome.is_err() || text[cut..].trim().len() < 6, "{symmetry} cut at {cut}");
        }
    }
    let head = Sheet::of(0).text().replacen("\n12\n", "\n721\n", 1).replacen("\n5\n", "\n721\n", 1);
    assert_eq!(plain(&head).unwrap_err().kind, FormatErrorKind::Malformed);
    let lines = format!("{}{}", Sheet::of(0).text(), "1\n".repeat(1 << 21));
    assert_eq!(plain(&lines).unwrap_err().kind, FormatErrorKind::OverLimit);
}
