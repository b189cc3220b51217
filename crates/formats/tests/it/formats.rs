//! Every fixture through the public reader: exact facts, and the traps of each format.

mod goniometers;
mod instruments;
mod spectral_tables;
mod spectrometers;

use std::fs;
use wavelume_core::domain::{Axis, Quantity, Unit};
use wavelume_formats::formats::{
    Acquisition, AngleGrid, AzimuthExtent, FormatError, FormatErrorKind, Interpretation, NoteKind, Outside, Position,
    Samples, attach_spectrum, formats, read,
};

fn file(path: &str) -> Vec<u8> {
    fs::read(crate::root().join(path)).unwrap()
}

fn plain(bytes: &[u8]) -> Result<Acquisition, FormatError> {
    read(bytes, &Interpretation::default())
}

fn fixture(path: &str) -> Acquisition {
    plain(&file(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

fn grid(acquisition: &Acquisition) -> &AngleGrid {
    match &acquisition.samples {
        Samples::Grid(grid) => grid,
        _ => panic!("expected a grid"),
    }
}

fn tensor(acquisition: &Acquisition) -> (&[Axis], &[f32]) {
    match &acquisition.samples {
        Samples::OnAxes { tensor, .. } => (tensor.axes(), tensor.samples()),
        _ => panic!("expected a tensor"),
    }
}

/// Returns the columns of a table; NaN for a missing value.
fn columns_of(table: &Acquisition) -> Vec<Vec<f32>> {
    let (axes, samples) = tensor(table);
    samples.chunks_exact(axes.last().unwrap().len()).map(<[f32]>::to_vec).collect()
}

fn wavelengths(acquisition: &Acquisition) -> Vec<f64> {
    match tensor(acquisition).0.last() {
        Some(Axis::Wavelength(grid)) => grid.values(),
        _ => panic!("expected wavelengths"),
    }
}

fn notes(acquisition: &Acquisition, kind: NoteKind) -> Vec<&str> {
    acquisition.report.notes.iter().filter(|note| note.kind == kind).map(|note| note.message.as_str()).collect()
}

fn has_note(acquisition: &Acquisition, kind: NoteKind, words: &str) -> bool {
    notes(acquisition, kind).iter().any(|message| message.contains(words))
}

fn metadata<'a>(acquisition: &'a Acquisition, key: &str) -> &'a str {
    acquisition.report.metadata.iter().find(|(found, _)| found == key).map_or("", |(_, value)| value)
}

/// Returns the intensity at listed angles: gamma from nadir and C.
fn intensity(grid: &AngleGrid, gamma: f64, c: f64) -> f32 {
    let angles = grid.outgoing.as_ref().unwrap();
    let row = angles.theta.iter().position(|&theta| theta == 180.0 - gamma).unwrap();
    let (columns, column) = match &angles.phi {
        None => (1, 0),
        Some(azimuths) => (azimuths.phi.len(), azimuths.phi.iter().position(|&phi| phi == c).unwrap()),
    };
    grid.values[row * columns + column]
}

/// A small LM-63 file: `numbers` are the ten of the first line, `tail` everything after the second.
fn ies(tag: &str, numbers: &str, ballast: &str, tail: &str) -> Vec<u8> {
    format!("{tag}[TEST] 1\nTILT=NONE\n{numbers}\n{ballast}\n{tail}\n").into_bytes()
}

const V2002: &str = "IESNA:LM-63-2002\n";

/// Two planes' worth of type C, 2 × `h` intensities `1 2 3 …`.
fn type_c(horizontal: &str) -> Vec<u8> {
    let h = horizontal.split_whitespace().count();
    let values: Vec<String> = (1..=2 * h).map(|i| i.to_string()).collect();
    ies(V2002, &format!("1 -1 1 2 {h} 1 2 0 0 0"), "1 1 10", &format!("0.5 90\n{horizontal}\n{}", values.join(" ")))
}

#[test]
fn the_table_names_every_format_once() {
    let names: Vec<&str> = formats().iter().map(|format| format.name).collect();
    let unique: std::collections::BTreeSet<&&str> = names.iter().collect();
    assert_eq!(unique.len(), names.len());
    let known = [
        "zip",
        "npy",
        "mbsdf",
        "rgl",
        "merl",
        "asd",
        "lm-63",
        "eulumdat",
        "radiometric-csv",
        "radiometric-arrow",
        "tm-27",
        "tm-33",
        "zemax-bsdf",
        "bsdf-xml",
        "svc",
        "speos",
        "sekonic",
        "alta",
        "virtual",
        "phase-table",
        "spectral-table",
        "tabphase",
    ];
    let found: Vec<&str> = names.into_iter().filter(|name| known.contains(name)).collect();
    assert_eq!(found, known, "the order of probing");
}

#[test]
fn decimal_commas_in_lm63_are_told_by_the_count_of_numbers() {
    let points = ies(V2002, "1 -1 1.5 3 1 1 2 0.1 0.2 0", "1.0 1 10", "0 45.5 90\n0\n500.25 43,7 2.5");
    let text = String::from_utf8(points).unwrap().replace("43,7", "43.7");
    let commas = text.replace("LM-63", "LM_63").replace('.', ",").replace("LM_63", "LM-63");
    let [stated, found] = [text, commas].map(|text| read(text.as_bytes(), &Interpretation::default()).unwrap());
    assert_eq!(grid(&found).values.as_slice(), grid(&stated).values.as_slice());
    assert_eq!(metadata(&found, "luminous_width"), metadata(&stated, "luminous_width"));
    assert!(has_note(&found, NoteKind::Assumed, "decimal marks") && !has_note(&stated, NoteKind::Assumed, "decimal"));
    // As separators they stay what they are.
    let list = ies(V2002, "1,-1,1,3,1,1,2,0,0,0", "1,1,10", "0,45,90\n0\n500,43 , 2");
    assert!(!has_note(&read(&list, &Interpretation::default()).unwrap(), NoteKind::Assumed, "decimal"));
    for program in ["import math\n\ndef turned(x):\n    tilt=0.5\n    return x * tilt\n", "tilt=NONE\nx = 1\n"] {
        let refused = read(program.as_bytes(), &Interpretation::default()).unwrap_err();
        assert_eq!(refused.kind, FormatErrorKind::Unrecognised, "{refused}");
    }
    let equal = ies(V2002, "1 -1 1 3 1 1 2 0 0 0", "1 1 10", "5 5 5\n0\n500 43 2");
    let refused = read(&equal, &Interpretation::default()).unwrap_err().to_string();
    assert!(refused.contains("all 3 vertical angles are 5°, expected different ones"), "{refused}");
}

#[test]
fn a_radiometric_luminaire_is_not_called_candela() {
    let lamp = fixture("data/aerolamp.ies");
    assert_eq!((lamp.format, lamp.dialect.as_str()), ("lm-63", "LM-63-2002, type C, no symmetry"));
    assert_eq!((lamp.quantity, lamp.unit), (Quantity::Edf, Unit::MilliwattPerSteradian));
    let grid = grid(&lamp);
    assert_eq!(grid.outside, Outside::Zero);
    assert!(grid.incoming.is_none() && grid.spectral.is_none() && grid.index.is_empty());
    let angles = grid.outgoing.as_ref().unwrap();
    assert_eq!(
        (angles.theta.len(), angles.theta[0], angles.theta[36], angles.covers),
        (37, 90.0, 180.0, (90.0, 180.0))
    );
    let azimuths = angles.phi.as_ref().unwrap();
    assert_eq!((azimuths.phi.len(), azimuths.phi[31], azimuths.extent), (32, 348.75, AzimuthExtent::Circle));
    assert_eq!(intensity(grid, 2.5, 0.0), 94.348_346_088_880_09_f64 as f32);
    assert_eq!(intensity(grid, 90.0, 0.0), 0.0);
    // The planes' values at nadir differ by less than 1 %.
    assert!((intensity(grid, 0.0, 11.25) - 94.5).abs() < 0.1);
    assert!(has_note(&lamp, NoteKind::Filled, "nadir") && has_note(&lamp, NoteKind::Warning, "near-field"));
    assert_eq!(metadata(&lamp, "LUMCAT"), "Aerolamp V1.0 Dev Kit");
    assert_eq!(metadata(&lamp, "luminous_opening"), "rectangle");
    assert_eq!(metadata(&lamp, "tilt"), "NONE");

    let lantern = fixture("tests/fixtures/ies/nukit_lantern.ies");
    assert_eq!(lantern.unit, Unit::MilliwattPerSteradian);
    assert!(has_note(&lantern, NoteKind::Assumed, "[OTHER] says so"));
    assert_eq!(metadata(&lantern, "LUMINAIRE").lines().count(), 2);
    let how = Interpretation { unit: Some(Unit::WattPerSteradian), ..Interpretation::default() };
    let renamed = read(&file("tests/fixtures/ies/nukit_lantern.ies"), &how).unwrap();
    assert_eq!((renamed.unit, &grid_values(&renamed)[..]), (Unit::WattPerSteradian, &grid_values(&lantern)[..]));
    assert_eq!(fixture("tests/fixtures/ies/ushio_b1.ies").unit, Unit::MilliwattPerSteradian);
}

fn grid_values(acquisition: &Acquisition) -> Vec<f32> {
    grid(acquisition).values.to_vec()
}

#[test]
fn quadrants_unfold_and_tilt_factors_stay_out() {
    let office = fixture("tests/fixtures/ies/examp1.ies");
    assert_eq!((office.dialect.as_str(), office.unit), ("LM-63-1995, type C, quadrant symmetric", Unit::Candela));
    let grid_1 = grid(&office);
    let azimuths = grid_1.outgoing.as_ref().unwrap().phi.as_ref().unwrap();
    assert_eq!(azimuths.phi, [0.0, 22.5, 45.0, 67.5, 90.0, 112.5, 135.0, 157.5, 180.0]);
    assert_eq!(azimuths.extent, AzimuthExtent::Mirrored);
    assert_eq!(intensity(grid_1, 2.5, 0.0), 777.6);
    assert_eq!(intensity(grid_1, 40.0, 157.5), intensity(grid_1, 40.0, 22.5));
    assert!(has_note(&office, NoteKind::Assumed, "2 lamps of 2900 lm"));
    assert!(notes(&office, NoteKind::Warning).is_empty(), "its flux fits its lamps");

    let flood = fixture("tests/fixtures/ies/iesna2002_example_typec.ies");
    assert_eq!(metadata(&flood, "tilt_geometry"), "1");
    assert!(metadata(&flood, "tilt_factors").starts_with("1 0.95 0.94"));
    assert!(has_note(&flood, NoteKind::Skipped, "tilt factors"));
    assert_eq!(intensity(grid(&flood), 45.0, 135.0), 16000.0);
    assert_eq!(intensity(grid(&flood), 0.0, 90.0), 100_000.0);
    assert!(metadata(&flood, "OTHER").contains("reduce light pollution"));
}

#[test]
fn type_b_is_resampled_in_its_own_angles() {
    let lamp = fixture("tests/fixtures/ies/test.ies");
    assert_eq!(lamp.dialect, "LM-63-1991, type B, no symmetry");
    let grid = grid(&lamp);
    let angles = grid.outgoing.as_ref().unwrap();
    assert_eq!((angles.theta.len(), angles.covers), (19, (90.0, 180.0)));
    assert_eq!(angles.phi.as_ref().unwrap().phi.len(), 72);
    for (gamma, c, expected) in
        [(0.0, 0.0, 0.55), (90.0, 0.0, 0.6), (90.0, 180.0, 0.5), (90.0, 90.0, 0.15), (45.0, 270.0, 0.75)]
    {
        // In this frame H grows clockwise: C90 is H = −90°.
        assert!((intensity(grid, gamma, c) - expected).abs() < 1e-6, "{gamma} {c}: {}", intensity(grid, gamma, c));
    }
    assert_eq!(metadata(&lamp, "native_horizontal_angles"), "-90 -45 0 45 90");
    assert!(has_note(&lamp, NoteKind::Filled, "type B: 2 × 5 intensities"));
}

#[test]
fn type_a_aims_along_x_and_halves_are_mirrored() {
    // V −90..90, H 0..90: lateral symmetry, value 10·(plane) + row.
    let bytes = ies("IESNA91\n", "1 -1 1 3 3 3 2 0 0 0", "1 1 10", "-90 0 90\n0 45 90\n0 1 2 10 11 12 20 21 22");
    let lamp = plain(&bytes).unwrap();
    assert_eq!(lamp.dialect, "LM-63-1991, type A, laterally symmetric");
    let g = grid(&lamp);
    for (gamma, c, expected) in
        [(90.0, 0.0, 1.0), (90.0, 45.0, 11.0), (90.0, 315.0, 11.0), (90.0, 90.0, 21.0), (90.0, 180.0, 0.0)]
    {
        assert!((intensity(g, gamma, c) - expected).abs() < 1e-5, "{gamma} {c}: {}", intensity(g, gamma, c));
    }
    // A 1986 file of type 1 with angles below the horizon is type A.
    let old = ies("", "1 -1 1 3 2 1 2 0 0 0", "1 1 10", "-90 0 90\n0 90\n0 1 2 0 1 2");
    assert!(plain(&old).unwrap().dialect.starts_with("LM-63-1986, type A"));
}

#[test]
fn every_small_sample_reads_axially_symmetric() {
    let directory = crate::root().join("tests/fixtures/ies/photometric-viewer");
    let mut count = 0;
    for entry in fs::read_dir(directory).unwrap() {
        let bytes = fs::read(entry.unwrap().path()).unwrap();
        let lamp = plain(&bytes).unwrap();
        assert_eq!(lamp.dialect, "LM-63-1995, type C, axially symmetric");
        assert_eq!((lamp.unit, grid(&lamp).values.len()), (Unit::Candela, 37));
        assert!(grid(&lamp).outgoing.as_ref().unwrap().phi.is_none());
        count += 1;
    }
    assert_eq!(count, 20);
    let at = |name: &str| fixture(&format!("tests/fixtures/ies/photometric-viewer/{name}.ies"));
    assert_eq!(intensity(grid(&at("absolute_photometry")), 2.5, 0.0), 2000.2);
    assert_eq!(intensity(grid(&at("absolute_photometry_with_multiplier")), 2.5, 0.0), 3000.3);
    assert!(has_note(&at("relative_photometry"), NoteKind::Warning, "% of the 500 lm"));
    for (name, shape) in [
        ("point_opening", "point"),
        ("rectangular_opening", "rectangle"),
        ("rectangular_opening_with_height", "box"),
        ("round_opening", "disk"),
        ("round_opening_with_height", "vertical cylinder"),
        ("sphere_opening", "sphere"),
        ("horizontal_cylinder_opening_along_length", "horizontal cylinder along X"),
        ("horizontal_cylinder_opening_along_width", "horizontal cylinder along Y"),
        ("ellipsoid_opening_along_width", "ellipsoid"),
    ] {
        assert_eq!(metadata(&at(name), "luminous_opening"), shape, "{name}");
    }
    assert_eq!(metadata(&at("imperial_units"), "luminous_width"), "0.12 ft");
    let modules = fixture("tests/fixtures/ies/example_modules.ies");
    assert_eq!(
        (modules.dialect.as_str(), intensity(grid(&modules), 90.0, 0.0)),
        ("LM-63-1991, type C, axially symmetric", 10.0)
    );
}

#[test]
fn planes_stand_for_their_symmetry() {
    let c = |horizontal: &str| plain(&type_c(horizontal));
    let phi = |lamp: &Acquisition| grid(lamp).outgoing.as_ref().unwrap().phi.clone().unwrap();
    let half = c("0 90 180").unwrap();
    assert_eq!((phi(&half).phi, phi(&half).extent), (vec![0.0, 90.0, 180.0], AzimuthExtent::Mirrored));
    let sideways = c("90 135 180 225 270").unwrap();
    assert!(sideways.dialect.ends_with("symmetric about the 90-270 plane"));
    let expected = vec![0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0];
    assert_eq!((phi(&sideways).phi, phi(&sideways).extent), (expected, AzimuthExtent::Circle));
    let g = grid(&sideways);
    for (a, b) in [(0.0, 180.0), (45.0, 135.0), (315.0, 225.0)] {
        assert_eq!(intensity(g, 90.0, a), intensity(g, 90.0, b), "C{a} is C{b}");
    }
    let open = c("0 90 180 270").unwrap();
    assert_eq!(phi(&open).extent, AzimuthExtent::Circle);
    assert!(has_note(&open, NoteKind::Assumed, "C270"));
    assert!(has_note(&c("0 175 350").unwrap(), NoteKind::Assumed, "C350"));
    let closed = c("0 120 240 360").unwrap();
    assert_eq!(phi(&closed).phi, [0.0, 120.0, 240.0]);
    assert!(has_note(&closed, NoteKind::Warning, "C0 and C360"));
    assert_eq!(intensity(grid(&closed), 0.5, 0.0), 4.0, "the mean of 1 and 7");
    let one = c("45").unwrap();
    assert!(grid(&one).outgoing.as_ref().unwrap().phi.is_none() && has_note(&one, NoteKind::Assumed, "C45"));
    for bad in ["0 45", "0 60 120", "180 270 360", "10 100"] {
        let error = c(bad).unwrap_err();
        assert_eq!((error.kind, error.position.is_some()), (FormatErrorKind::Malformed, true), "{bad}: {error}");
    }
    let turned = c("180 90 0").unwrap();
    assert!(has_note(&turned, NoteKind::Warning, "decrease"));
    assert_eq!(intensity(grid(&turned), 0.5, 180.0), 1.0);
    let twice = c("0 90 90 180").unwrap();
    assert!(has_note(&twice, NoteKind::Warning, "more than once"));
    assert_eq!(intensity(grid(&twice), 0.5, 90.0), 4.0, "the mean of 3 and 5");
    assert_eq!(c("0 100 90 180").unwrap_err().kind, FormatErrorKind::Malformed);
    assert_eq!(c("-90 0 90").unwrap_err().kind, FormatErrorKind::Malformed);
}

#[test]
fn multipliers_depend_on_the_revision() {
    let tail = "0 90\n0\n100 50";
    let value = |tag: &str, numbers: &str, ballast: &str| {
        let lamp = plain(&ies(tag, numbers, ballast, tail)).unwrap();
        intensity(grid(&lamp), 90.0, 0.0)
    };
    let plain_numbers = "1 -1 2 2 1 1 2 0 0 0";
    assert_eq!(value("IESNA91\n", plain_numbers, "0.9 0.8 10"), 72.0);
    assert_eq!(value("", plain_numbers, "0.9 0.8 10"), 72.0);
    assert_eq!(value(V2002, plain_numbers, "0.9 0.8 10"), 90.0);
    assert_eq!(value("IES:LM-63-2019\n", plain_numbers, "0.9 1.10000 10"), 90.0);
    assert_eq!(value(V2002, "1,-1 , 2,2\n,1,1,2,0,0,0", "0.9,1,10"), 90.0);
    assert_eq!(value("iesna: lm-63-2002 \r", "1.0 -1 2 2.0 1.0 1.0 2.0 0 0 0", "1 1 1"), 100.0);
    let coded = plain(&ies("IES:LM-63-2019\n", plain_numbers, "1 1.10000 10", tail)).unwrap();
    assert_eq!(metadata(&coded, "file_generation_type"), "1.10000");
    assert!(has_note(&plain(&ies("", plain_numbers, "1 1 1", tail)).unwrap(), NoteKind::Assumed, "no version tag"));
    assert!(has_note(&plain(&ies(V2002, plain_numbers, "1 0.5 1", tail)).unwrap(), NoteKind::Warning, "field 12"));
    assert!(has_note(
        &plain(&ies("IESNA:LM-63-2042\n", plain_numbers, "1 1 1", tail)).unwrap(),
        NoteKind::Warning,
        "unknown revision"
    ));
}

#[test]
fn odd_heads_are_read_and_named_files_never_opened() {
    let body = "1 -1 1 2 1 1 2 0 0 0\n1 1 1\n0 90\n0\n100 50\n";
    let tilted =
        format!("{V2002}[MORE] of nothing\nfree text\n[other] MEASURED IN µW/sr\nTILT=../../etc/passwd\n{body}");
    let lamp = plain(tilted.as_bytes()).unwrap();
    assert!(has_note(&lamp, NoteKind::Skipped, "never opened") && has_note(&lamp, NoteKind::Warning, "[MORE]"));
    assert_eq!((lamp.unit, metadata(&lamp, "LABEL")), (Unit::MicrowattPerSteradian, "free text"));
    // Equal content in Windows-1252 and UTF-16, with CR line ends and a DOS end mark.
    let windows: Vec<u8> = tilted.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    let utf16: Vec<u8> = std::iter::once(0xFEFF).chain(tilted.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    for bytes in [windows, utf16, tilted.replace('\n', "\r").into_bytes(), format!("{tilted}\u{1a}").into_bytes()] {
        let same = plain(&bytes).unwrap();
        assert_eq!((same.unit, grid_values(&same)), (lamp.unit, grid_values(&lamp)));
    }
    let horticulture = format!("{V2002}[OTHER] PPF 1200 umol/s\nTILT=NONE\n{body}");
    let lamp = plain(horticulture.as_bytes()).unwrap();
    assert_eq!(lamp.unit, Unit::Relative);
    assert!(has_note(&lamp, NoteKind::Warning, "umol"));
    let trailing = format!("{V2002}TILT=NONE\n{body} 7 8 end");
    assert!(has_note(&plain(trailing.as_bytes()).unwrap(), NoteKind::Warning, "3 further tokens"));
    let negative = format!("{V2002}TILT=NONE\n1 -1 1 2 1 1 2 0 0 0 1 1 1 0 90 0 100 -0.5");
    let lamp = plain(negative.as_bytes()).unwrap();
    assert!(has_note(&lamp, NoteKind::Warning, "1 intensity is negative, down to -0.5"));
    assert_eq!(intensity(grid(&lamp), 90.0, 0.0), -0.5);
}

#[test]
fn broken_luminaires_are_refused_at_their_place() {
    let error = plain(&file("tests/fixtures/ies/test_file_format_error.ies")).unwrap_err();
    assert_eq!(error.kind, FormatErrorKind::Malformed);
    assert_eq!(error.position, Some(Position::Text { line: 3, column: 1 }));
    assert_eq!(error.to_string(), "lm-63: line 3, column 1: found `file`, expected the number of lamps");
    let ok = "1 -1 1 2 1 1 2 0 0 0";
    for (numbers, ballast, tail, line, column, word) in [
        (ok, "1 1 1", "0 90\n0\n100 5O", 8, 5, "`5O`"),
        (ok, "1 1 1", "0 90\n0\n100 NaN", 8, 5, "`NaN`"),
        (ok, "1 1 1", "0 90\n0\ninf 50", 8, 1, "`inf`"),
        (ok, "1 1 1", "0 90\n0\n1e999 50", 8, 1, "`1e999`"),
        (ok, "1 1 1", "0 90\n0\n1e39 50", 8, 1, "too large"),
        (ok, "1 1 1", "0 90\n0\n100,,50", 8, 5, "nothing"),
        (ok, "1 1 1", "0 200\n0\n100 50", 6, 3, "vertical angle 200"),
        (ok, "1 1 1", "0 90\n0\n100", 9, 1, "expected 5"),
        ("1 -1 1 1e30 1 1 2 0 0 0", "1 1 1", "0 90\n0\n100 50", 4, 8, "`1e30`"),
        ("1 -1 1 -3 1 1 2 0 0 0", "1 1 1", "0 90\n0\n100 50", 4, 8, "`-3`"),
        ("1 -1 1 2.5 1 1 2 0 0 0", "1 1 1", "0 90\n0\n100 50", 4, 8, "`2.5`"),
        ("1 -1 1 2 1 4 2 0 0 0", "1 1 1", "0 90\n0\n100 50", 4, 12, "photometric type"),
        ("1 -1 1 2 1 1 3 0 0 0", "1 1 1", "0 90\n0\n100 50", 4, 14, "units type"),
        ("1 -1 1 4 4 1 2 0 0 0", "1 1 1", "0 90\n0\n100 50", 9, 1, "4 × 4"),
        ("1 -1 1 1 1 1 2 0 0 0", "1 1 1", "0\n0\n100", 9, 1, "at least two"),
        ("1 -1", "", "", 7, 1, "candela multiplier"),
    ] {
        let error = plain(&ies(V2002, numbers, ballast, tail)).unwrap_err();
        assert_eq!(error.kind, FormatErrorKind::Malformed, "{error}");
        assert_eq!(error.position, Some(Position::Text { line, column }), "{error}");
        assert!(error.message.contains(word), "{error}");
    }
    assert!(plain(b"IESNA91\n[TEST] no tilt\n1 2 3\n").unwrap_err().message.contains("TILT"));
    let lamp = type_c("0");
    for how in [
        Interpretation { quantity: Some(Quantity::Brdf.into()), ..Interpretation::default() },
        Interpretation { unit: Some(Unit::PerSteradian), ..Interpretation::default() },
        Interpretation { column: Some("1".to_owned()), ..Interpretation::default() },
        Interpretation { axes: Some(serde_json::json!([])), ..Interpretation::default() },
    ] {
        assert_eq!(read(&lamp, &how).unwrap_err().kind, FormatErrorKind::NeedsOption);
    }
}

#[test]
fn measured_spectra_read_as_written() {
    let lamp = fixture("data/aerolamp.csv");
    assert_eq!((lamp.quantity, lamp.unit, wavelengths(&lamp).len()), (Quantity::Spectrum, Unit::Relative, 1644));
    assert_eq!((wavelengths(&lamp)[0], tensor(&lamp).1[0]), (199.997_970_581_054_7, 0.248_356_68));
    assert!(has_note(&lamp, NoteKind::Assumed, "percent; relative values are kept"));
    let ushio = fixture("tests/fixtures/ies/ushio_b1.csv");
    assert!(has_note(&ushio, NoteKind::Warning, "1 value is negative, down to -0.002"));

    let d65 = fixture("data/illuminant_D65.csv");
    assert_eq!((wavelengths(&d65).len(), tensor(&d65).1[52]), (97, 100.0));
    let chart = fixture("data/colorchecker_n_ohta.csv");
    let [Axis::Index { count: 24, labels }, Axis::Wavelength(grid)] = tensor(&chart).0 else { panic!("axes") };
    assert_eq!((labels[0].as_str(), labels[18].as_str(), grid.len()), ("dark skin", "white 9.5 (.05 D)", 81));
    assert_eq!(tensor(&chart).1[0], 0.048);
    for column in ["cyan", "CYAN", " cyan ", "18"] {
        let how = Interpretation {
            column: Some(column.to_owned()),
            quantity: Some(Quantity::Reflectance.into()),
            ..Interpretation::default()
        };
        let cyan = read(&file("data/colorchecker_n_ohta.csv"), &how).unwrap();
        assert_eq!((cyan.quantity, cyan.unit), (Quantity::Reflectance, Unit::One));
        assert_eq!(tensor(&cyan).1, &tensor(&chart).1[17 * 81..18 * 81]);
    }
    let how = Interpretation { column: Some("25".to_owned()), ..Interpretation::default() };
    let error = read(&file("data/colorchecker_n_ohta.csv"), &how).unwrap_err();
    assert_eq!(error.kind, FormatErrorKind::NeedsOption);
    assert!(error.message.contains("`dark skin`"), "{error}");
    assert_eq!(tensor(&fixture("tests/fixtures/spectra/illuminants_FL.csv")).0[0].len(), 27);
    assert_eq!(wavelengths(&fixture("tests/fixtures/spectra/illuminant_B.csv")).len(), 93);
}

#[test]
fn spectralon_reads_in_all_its_dialects() {
    let panel = fixture("tests/fixtures/spectra/spectralon/Spectralon-panel-4-diffuse-reflectance_2023Jan18.txt");
    assert_eq!((panel.quantity, panel.unit, wavelengths(&panel).len()), (Quantity::Reflectance, Unit::One, 2151));
    assert_eq!(tensor(&panel).1[0], 0.964_450_95);
    let calibration = fixture("tests/fixtures/spectra/spectralon/Spectralon_Num4.txt");
    assert_eq!(tensor(&calibration).0[0], Axis::Index { count: 2, labels: vec!["1".to_owned(), "2".to_owned()] });
    assert!(has_note(&calibration, NoteKind::Assumed, "taken as nm"));
    let error = plain(&file("tests/fixtures/spectra/spectralon/BRF_i10_e0.txt")).unwrap_err();
    assert_eq!(error.kind, FormatErrorKind::Malformed);
    assert!(error.message.contains("one column of numbers without wavelengths"), "{error}");
    assert_eq!(
        plain(&file("tests/fixtures/spectra/spectralon/LICENSE")).unwrap_err().kind,
        FormatErrorKind::Unrecognised
    );
}

#[test]
fn tables_are_read_whatever_separates_their_cells() {
    let expected = (vec![400.0, 410.5], vec![0.25_f32, 0.5]);
    for text in [
        "400,0.25\n410.5,0.5\n",
        "400\t0.25\r\n410.5\t0.5",
        "400;0.25\n410.5;0.5\n",
        "400 0.25\n410.5   0.5\n",
        "400,0;0,25\n410,5;0,5\n",
        "400\t0,25\n410,5\t0,5\n",
        "400 0,25\n410,5 0,5\n",
        "400.0, 0.25,\n410.5, 0.5,\n",
        "\u{feff}lambda [nm];value\n400;.25\n410.5;5e-1\n",
        "# a comment\nIntegration time: 100 ms\n>>>>>Begin Spectral Data<<<<<\n400\t0.25 # here\n410.5\t0.5\n>>>>>End Spectral Data<<<<<\nend\n",
        "\"wavelength (nm)\",\"r\"\r400,0.25\r410.5,0.5\r",
        "410.5 0.5\n400 0.25\n",
        "lambda_um,r\n0.4,0.25\n0.4105,0.5\n",
        "angstrom r\n4000 0.25\n4105 0.5\n",
    ] {
        let table = plain(text.as_bytes()).unwrap_or_else(|error| panic!("{text:?}: {error}"));
        assert_eq!((wavelengths(&table), tensor(&table).1.to_vec()), expected, "{text:?}");
    }
    let blank = plain(b"nm,a,b\n400,,2\n410,3,\n").unwrap();
    assert!(tensor(&blank).1[0].is_nan() && tensor(&blank).1[3].is_nan());
    assert!(has_note(&blank, NoteKind::Warning, "2 missing values"));
    let lines = plain(b"403.1 5\n405.5 80\n435.8 100\n").unwrap();
    assert_eq!(wavelengths(&lines), [403.1, 405.5, 435.8]);
}

#[test]
fn wavelength_units_and_percent_follow_the_rules() {
    let wavenumbers = plain(b"wavenumber (cm-1),transmittance (%)\n25000,98\n20000,50\n12500,1.5\n").unwrap();
    assert_eq!((wavelengths(&wavenumbers), wavenumbers.quantity), (vec![400.0, 500.0, 800.0], Quantity::Reflectance));
    assert_eq!(tensor(&wavenumbers).1, [0.98, 0.5, 0.015]);
    assert!(has_note(&wavenumbers, NoteKind::Warning, "divided by 100"));
    let rising = plain(b"wavenumber (cm-1),x\n12500,1\n25000,2\n").unwrap();
    assert_eq!((wavelengths(&rising), tensor(&rising).1), (vec![400.0, 800.0], &[2.0, 1.0][..]));
    assert!(has_note(&rising, NoteKind::Assumed, "turned round"));
    let micrometres = plain(b"0.35 1\n0.55 2\n2.5 3\n").unwrap();
    assert_eq!(wavelengths(&micrometres), [350.0, 550.0, 2500.0]);
    assert!(has_note(&micrometres, NoteKind::Assumed, "taken as um"));
    let with = |text: &str, unit: &str| {
        let how = Interpretation { wavelength_unit: Some(unit.to_owned()), ..Interpretation::default() };
        read(text.as_bytes(), &how)
    };
    assert_eq!(wavelengths(&with("1 1\n1000 2\n", "nm").unwrap()), [1.0, 1000.0]);
    assert_eq!(wavelengths(&with("4000 1\n7000 2\n", "angstrom").unwrap()), [400.0, 700.0]);
    assert_eq!(with("400 1\n", "ft").unwrap_err().kind, FormatErrorKind::NeedsOption);
    assert_eq!(plain(b"1 1\n1000 2\n").unwrap_err().kind, FormatErrorKind::NeedsOption);
    // Percent by its size; fluorescent samples above 1 stay.
    let percent = plain(b"nm,reflectance\n400,99\n410,80\n").unwrap();
    assert_eq!(tensor(&percent).1, [0.99, 0.8]);
    let fluorescent = plain(b"nm,reflectance\n400,1.4\n410,0.8\n").unwrap();
    assert_eq!(tensor(&fluorescent).1, [1.4, 0.8]);
}

#[test]
fn broken_tables_are_refused_at_their_place() {
    for (text, line, column, word) in [
        ("400 1\n410 2\n410 3\n", 3, 1, "wavelength 410 twice"),
        ("400 1\n410 2\n405 3\n", 3, 1, "405 after 410"),
        ("410 1\n400 2\n405 3\n", 3, 1, "decreasing"),
        ("nm,v\n400,1\n410,x\n", 3, 5, "`x`"),
        ("nm,v\n400,1\n410,inf\n", 3, 5, "`inf`"),
        ("nm,v\n400,1\n410,1e39\n", 3, 5, "float32"),
        ("nm,v\n400,1\n,2\n", 3, 1, "expected a wavelength"),
        ("nm,v\n-400,1\n-300,2\n", 2, 1, "positive"),
        ("nm,v\n400,\n410,\n", 1, 1, "every value is missing"),
    ] {
        let error = plain(text.as_bytes()).unwrap_err();
        assert_eq!(error.kind, FormatErrorKind::Malformed, "{text:?}: {error}");
        assert_eq!(error.position, Some(Position::Text { line, column }), "{text:?}: {error}");
        assert!(error.message.contains(word), "{text:?}: {error}");
    }
    let ragged: String = (0..30).map(|i| format!("{},1\n", 400 + i)).chain(["430,1,2\n".to_owned()]).collect();
    let error = plain(ragged.as_bytes()).unwrap_err();
    assert_eq!(error.position, Some(Position::Text { line: 31, column: 1 }));
    assert!(error.message.contains("3 cells, expected 2"), "{error}");
    let how = Interpretation { quantity: Some(Quantity::Brdf.into()), ..Interpretation::default() };
    assert_eq!(read(b"400 1\n410 2\n", &how).unwrap_err().kind, FormatErrorKind::NeedsOption);
}

#[test]
fn the_mirror_direction_of_a_car_paint_is_at_180_degrees() {
    let paint = fixture("data/carpaint_blue.mbsdf");
    assert_eq!((paint.quantity, paint.unit), (Quantity::Brdf, Unit::PerSteradian));
    let grid = grid(&paint);
    assert_eq!((grid.spectral.as_ref(), grid.outside), (Some(&Axis::Rgb), Outside::Masked));
    let (incoming, outgoing) = (grid.incoming.as_ref().unwrap(), grid.outgoing.as_ref().unwrap());
    assert_eq!((incoming.theta.len(), incoming.theta[44], incoming.covers), (45, 88.0, (0.0, 90.0)));
    assert!(incoming.phi.is_none());
    let azimuths = outgoing.phi.as_ref().unwrap();
    assert_eq!((azimuths.phi.len(), azimuths.phi[89], azimuths.extent), (90, 180.0, AzimuthExtent::Mirrored));
    assert!(has_note(&paint, NoteKind::Warning, "75159 of 546750 values are negative, down to -0.011285"));
    let green = |theta_i: usize, theta_o: usize, phi: usize| grid.values[((theta_i * 45 + theta_o) * 90 + phi) * 3 + 1];
    for theta in [15, 20, 30] {
        let brightest = (0..90).max_by(|&a, &b| green(theta, theta, a).total_cmp(&green(theta, theta, b))).unwrap();
        assert_eq!(brightest, 89, "theta {}°", 2 * theta);
    }
}

#[test]
fn small_measured_bsdfs_read_exactly() {
    let at = |name: &str| file(&format!("tests/fixtures/mbsdf/{name}.mbsdf"));
    let scalar = plain(&at("test_reflection_scalar_theta_2_phi_3")).unwrap();
    assert_eq!(grid_values(&scalar), (0..12).map(|i| i as f32).collect::<Vec<_>>());
    assert_eq!(grid(&scalar).outgoing.as_ref().unwrap().phi.as_ref().unwrap().phi, [0.0, 90.0, 180.0]);
    let rgb = plain(&at("test_rgb_theta_2_phi_3")).unwrap();
    assert_eq!((grid(&rgb).values.len(), rgb.quantity), (36, Quantity::Brdf));
    let through = plain(&at("test_transmission_scalar_theta_2_phi_4")).unwrap();
    assert_eq!(through.quantity, Quantity::Btdf);
    let outgoing = grid(&through).outgoing.as_ref().unwrap();
    assert_eq!((outgoing.theta.as_slice(), outgoing.covers), (&[135.0, 180.0][..], (90.0, 180.0)));
    // theta_out 45° of the file (its second row) is theta_o 135°.
    assert_eq!(grid(&through).values[..8], [4.0, 5.0, 6.0, 7.0, 0.0, 1.0, 2.0, 3.0]);
    let both = at("test_reflection_scalar_theta_2_phi_3_transmission_scalar_theta_2_phi_4");
    let bsdf = plain(&both).unwrap();
    assert_eq!(
        (bsdf.quantity, bsdf.dialect.as_str()),
        (Quantity::Bsdf, "V1, reflection and transmission, scalar 2 × 2 × 3 and scalar 2 × 2 × 4")
    );
    assert_eq!(grid(&bsdf).outgoing.as_ref().unwrap().phi.as_ref().unwrap().phi, [0.0, 60.0, 90.0, 120.0, 180.0]);
    let how = Interpretation { quantity: Some(Quantity::Btdf.into()), ..Interpretation::default() };
    assert_eq!(read(&both, &how).unwrap().quantity, Quantity::Btdf);
    for (name, word) in [("test_none", "no measurement data"), ("test_file_format_error", "`file format error")] {
        let error = plain(&at(name)).unwrap_err();
        assert_eq!(error.kind, FormatErrorKind::Malformed);
        assert!(error.message.contains(word), "{error}");
    }
}

#[test]
fn eulumdat_luminaires_are_candela() {
    let lamp = fixture("tests/fixtures/ldt/example.ldt");
    assert_eq!((lamp.format, lamp.dialect.as_str()), ("eulumdat", "EULUMDAT, relative photometry, no symmetry"));
    assert_eq!((lamp.quantity, lamp.unit), (Quantity::Edf, Unit::Candela));
    let lit = grid(&lamp);
    assert_eq!(lit.outside, Outside::Zero);
    let azimuths = lit.outgoing.as_ref().unwrap().phi.as_ref().unwrap();
    assert_eq!((azimuths.phi.len(), azimuths.phi[19], azimuths.extent), (20, 342.0, AzimuthExtent::Circle));
    // 5134 lm, cd per 1000 lm in the file; the luminaire gives all of them.
    assert_eq!(intensity(lit, 5.0, 18.0), (272.86569 * 5.134) as f32);
    let flux: f64 = metadata(&lamp, "flux_of_the_intensities_lm").parse().unwrap();
    assert!((flux / 5134.0 - 1.0).abs() < 0.005, "{flux}");
    assert!(notes(&lamp, NoteKind::Warning).is_empty(), "{:?}", lamp.report.notes);
    assert_eq!((metadata(&lamp, "company"), metadata(&lamp, "colour")), ("Ingemann", "3008"));
    let dummy = fixture("tests/fixtures/ldt/absolute.ldt");
    assert_eq!(dummy.dialect, "EULUMDAT, absolute photometry, axially symmetric");
    assert_eq!(intensity(grid(&dummy), 2.5, 0.0), 2000.2_f32 * 0.5);
    assert!(has_note(&dummy, NoteKind::Warning, "of the 500 lm stated"), "made-up numbers");
    // Equal numbers under every symmetry.
    let at = |name: &str| fixture(&format!("tests/fixtures/ldt/{name}.ldt"));
    let (half, side) = (at("symmetry_to_c0c180"), at("symmetry_to_c90c270"));
    assert_eq!(intensity(grid(&half), 2.5, 10.0), 2038.2);
    // The second plane stored is C10 of one and C280 of the other, whose mirror image is C260.
    assert_eq!(intensity(grid(&side), 2.5, 280.0), 2038.2);
    assert_eq!(intensity(grid(&side), 2.5, 260.0), 2038.2);
    assert_eq!(intensity(grid(&at("multiple_lamp_sets")), 2.5, 0.0), 2000.2_f32 * 0.5);
}

#[test]
fn spectra_of_lamps_are_read_from_xml() {
    let lamp = fixture("tests/fixtures/spectra/TM27_Sample_Spectral_Data.spdx");
    assert_eq!((lamp.format, lamp.quantity, lamp.unit), ("tm-27", Quantity::Spectrum, Unit::Relative));
    assert_eq!((wavelengths(&lamp)[..2].to_vec(), &tensor(&lamp).1[..2]), (vec![400.0, 410.0], &[0.47, 0.51][..]));
    assert_eq!(metadata(&lamp, "Manufacturer"), "Academy Lighting");
    assert!(lamp.report.notes.is_empty());
    let mut luminaire = fixture("tests/fixtures/ldt/example.ldt");
    attach_spectrum(&mut luminaire, &lamp).unwrap();
    assert_eq!(luminaire.unit, Unit::WattPerSteradianNanometre);
}

#[test]
fn files_of_other_trades_get_a_clear_answer() {
    let error = plain(&file("tests/fixtures/spectra/Invalid.spdx")).unwrap_err();
    assert_eq!(error.kind, FormatErrorKind::Unsupported, "{error}");
    assert!(error.message.contains("root `item`"), "{error}");
}

#[test]
fn spectra_join_luminaires_in_their_units() {
    let spectrum = fixture("data/aerolamp.csv");
    let mut lamp = fixture("data/aerolamp.ies");
    attach_spectrum(&mut lamp, &spectrum).unwrap();
    assert_eq!(lamp.unit, Unit::MilliwattPerSteradianNanometre);
    let factor = lamp.spectral_factor.clone().unwrap();
    assert_eq!(factor.factors.len(), 1644);
    let integral: f64 = factor.grid.weights().iter().zip(&factor.factors).map(|(w, f)| w * f).sum();
    assert!((integral - 1.0).abs() < 1e-12, "{integral}");
    assert!(has_note(&lamp, NoteKind::Assumed, "spectrum: the header says percent"));
    assert_eq!(attach_spectrum(&mut lamp, &spectrum).unwrap_err().kind, FormatErrorKind::NeedsOption);

    // Candela traced back: 683.002 · ∫ factor · V dλ = 1.
    let mut office = fixture("tests/fixtures/ies/examp1.ies");
    attach_spectrum(&mut office, &fixture("data/illuminant_D65.csv")).unwrap();
    assert_eq!(office.unit, Unit::WattPerSteradianNanometre);
    let factor = office.spectral_factor.unwrap();
    let v = fixture("data/cmfs_CIE_1931_2_Degree_Standard_Observer.csv");
    let ybar = &tensor(&v).1[471..942];
    let luminous: f64 = (0..factor.grid.len())
        .filter(|&i| factor.grid.at(i) >= 360.0)
        .map(|i| factor.factors[i] * f64::from(ybar[factor.grid.at(i) as usize - 360]) * 5.0)
        .sum();
    assert!((683.002 * luminous - 1.0).abs() < 1e-3, "{luminous}");

    let mut relative = plain(&ies(V2002, "1 -1 1 2 1 1 2 0 0 0", "1 1 1", "0 90\n0\n100 50")).unwrap();
    relative.unit = Unit::Relative;
    attach_spectrum(&mut relative, &plain(b"nm,v\n400,-0.5\n500,\n600,3\n").unwrap()).unwrap();
    assert_eq!(relative.unit, Unit::RelativePerNanometre);
    let factor = relative.spectral_factor.as_ref().unwrap();
    assert_eq!(factor.factors, [-0.5 / 250.0, 3.0 / 250.0], "∫ = 200 · (−0.5 + 3) / 2");
    assert!(has_note(&relative, NoteKind::Warning, "1 negative") && has_note(&relative, NoteKind::Filled, "1 masked"));
}

#[test]
fn unfit_spectra_are_refused() {
    let refusal = |lamp: &str, spectrum: &[u8]| {
        let mut lamp = fixture(lamp);
        let error = attach_spectrum(&mut lamp, &plain(spectrum).unwrap()).unwrap_err();
        assert!(lamp.spectral_factor.is_none(), "nothing is half joined");
        assert_eq!(error.kind, FormatErrorKind::NeedsOption);
        error.message
    };
    let candela = "tests/fixtures/ies/examp1.ies";
    assert!(refusal(candela, &file("data/colorchecker_n_ohta.csv")).contains("`dark skin`"));
    assert!(refusal(candela, b"nm,v\n200,1\n300,2\n").contains("V(lambda)"));
    assert!(refusal("data/aerolamp.ies", b"nm,v\n200,-1\n300,-2\n").contains("integrates to -150"));
    assert!(refusal(candela, b"nm,v\n400,1\n").contains("at least two"));
    assert!(
        refusal(candela, b"nm,reflectance\n400,1\n500,1\n").contains("quantity reflectance, expected the spectrum")
    );
    assert!(
        refusal("data/carpaint_blue.mbsdf", b"nm,v\n400,1\n500,1\n").contains("quantity brdf, expected an emission")
    );
    let mut lamp = fixture(candela);
    lamp.unit = Unit::CandelaPerKilolumen;
    assert!(attach_spectrum(&mut lamp, &fixture("data/illuminant_D65.csv")).is_err());
}
