//! Round trips: files read, kept on their own grid, written and read again give the same content.

use crate::root;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;
use wavelume_core::compress::Target;
use wavelume_core::domain::{Axis, AzimuthExtent, DirectionGrid, ErrorReport, Measurement, Unit};
use wavelume_formats::export::{ExportFormat, ExportOptions, Exported};
use wavelume_formats::formats::{Acquisition, Digits, Interpretation, read};
use wavelume_formats::pipeline::{Input, OnGrid, Origin, Request, export_on_grid, read as read_source, restate};
use wavelume_formats::projection::{AxesRequest, DirectionDomain, project};

const FOLDERS: [&str; 5] = [
    "data",
    "tests/fixtures/ies",
    "tests/fixtures/ies/photometric-viewer",
    "tests/fixtures/ldt",
    "tests/fixtures/mbsdf",
];

/// Returns the measurement files with an extension, and their bytes.
fn files(extension: &str) -> Vec<(PathBuf, Vec<u8>, Acquisition)> {
    let of_folder = |folder: &&str| fs::read_dir(root().join(folder)).unwrap().map(|entry| entry.unwrap().path());
    let mut paths: Vec<PathBuf> = FOLDERS.iter().flat_map(of_folder).collect();
    paths.retain(|path| path.extension().is_some_and(|found| found == extension));
    paths.sort();
    let measured = |path: PathBuf| {
        let bytes = fs::read(&path).unwrap();
        let acquisition = read(&bytes, &Interpretation::default()).ok()?;
        Some((path, bytes, acquisition))
    };
    paths.into_iter().filter_map(measured).collect()
}

fn on_grid(acquisition: &Acquisition) -> Measurement {
    let request = AxesRequest { domain: Some(DirectionDomain::Grid), ..AxesRequest::default() };
    project(acquisition, &request).unwrap().measurement
}

fn directions(measurement: &Measurement) -> &DirectionGrid {
    let Some(Axis::Grid(grid)) = measurement.tensor.axes().iter().rfind(|axis| matches!(axis, Axis::Grid(_))) else {
        panic!("a grid")
    };
    grid
}

#[test]
fn luminaires_come_back_with_their_angles_numbers_and_keywords() {
    let mut count = 0;
    for (path, bytes, acquisition) in files("ies").into_iter().chain(files("ldt")) {
        let name = path.display();
        let measurement = on_grid(&acquisition);
        let restated = restate(&measurement, &Origin::of(&acquisition), Digits::Shortest)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((restated.filled, restated.errors.max_absolute_error), (0, 0.0), "{name}");
        let text = String::from_utf8_lossy(&restated.bytes);
        assert!(10 * text.len() <= 13 * bytes.len() + 10 * text.lines().count(), "{name}: {text}");
        let again = read(&restated.bytes, &Interpretation::default()).unwrap();
        assert_eq!(again.report.metadata, acquisition.report.metadata, "{name}");
        assert_eq!((again.dialect, again.unit), (acquisition.dialect, acquisition.unit), "{name}");
        let back = on_grid(&read(&restated.bytes, &Interpretation::default()).unwrap());
        assert!(back.tensor.samples().iter().zip(measurement.tensor.samples()).all(|(a, b)| a == b), "{name}");
        assert_eq!(directions(&back), directions(&measurement), "{name}");
        count += 1;
    }
    assert!(count > 25, "{count} files");
}

/// Returns the numbers of a text after its header.
fn numbers(bytes: &[u8], behind: &str) -> Vec<f64> {
    let text = String::from_utf8_lossy(bytes);
    let (_, rest) = text.split_once(behind).unwrap();
    rest.split_whitespace().filter_map(|word| word.parse().ok()).collect()
}

#[test]
fn short_decimals_come_back_as_the_numbers_that_were_written() {
    let mut count = 0;
    for (path, bytes, acquisition) in files("ies") {
        let text = String::from_utf8_lossy(&bytes);
        let is_long = |word: &str| word.parse::<f64>().is_ok() && word.chars().filter(char::is_ascii_digit).count() > 6;
        if text.split_whitespace().any(is_long) {
            continue;
        }
        let restated = restate(&on_grid(&acquisition), &Origin::of(&acquisition), Digits::Shortest).unwrap();
        let tilt = if text.contains("TILT=INCLUDE") { "TILT=INCLUDE" } else { "TILT=NONE" };
        assert_eq!(numbers(&restated.bytes, tilt), numbers(&bytes, tilt), "{}", path.display());
        count += 1;
    }
    assert!(count > 15, "{count} files");
}

#[test]
fn measured_bsdfs_come_back_byte_for_byte() {
    let mut equal = 0;
    for (path, bytes, acquisition) in files("mbsdf") {
        // Sides of different resolution are joined on the angles of both, which no such file has.
        let restated = restate(&on_grid(&acquisition), &Origin::of(&acquisition), Digits::Shortest);
        if path.display().to_string().contains("theta_2_phi_3_transmission") {
            assert!(restated.is_err(), "{}", path.display());
            continue;
        }
        assert!(restated.unwrap().bytes == bytes, "{}", path.display());
        equal += 1;
    }
    assert_eq!(equal, 4);
}

#[test]
fn lossy_files_have_fewer_digits_and_the_same_angles() {
    let (path, _, acquisition) =
        files("ies").into_iter().find(|(path, ..)| path.ends_with("data/aerolamp.ies")).unwrap();
    let measurement = on_grid(&acquisition);
    let origin = Origin::of(&acquisition);
    let exact = restate(&measurement, &origin, Digits::Shortest).unwrap();
    let lossy = restate(&measurement, &origin, Digits::Within(1e-3)).unwrap();
    let largest = lossy.errors.max_relative_error;
    let lamp = lossy.lamp.unwrap();
    assert!(lamp.flux.abs() < 5e-4 && lamp.peak.abs() <= 1.001e-3 && lamp.er_l2_bright < 1e-3, "{lamp:?}");
    assert!(largest > 1e-4 && largest <= 1.001e-3, "{}: {largest}", path.display());
    assert!(2 * lossy.bytes.len() < exact.bytes.len() + 2000, "{} {}", lossy.bytes.len(), exact.bytes.len());
}

#[test]
fn units_that_the_user_named_are_written_where_keywords_do_not_tell_them() {
    let path = root().join("tests/fixtures/ies/example_modules.ies");
    let how = Interpretation { unit: Some(Unit::MilliwattPerSteradian), ..Interpretation::default() };
    let acquisition = read(&fs::read(path).unwrap(), &how).unwrap();
    let restated = restate(&on_grid(&acquisition), &Origin::of(&acquisition), Digits::Shortest).unwrap();
    assert!(String::from_utf8(restated.bytes).unwrap().contains("[_INTENSITYUNITS] mW/sr"));
    let path = root().join("tests/fixtures/ldt/example.ldt");
    let how = Interpretation { unit: Some(Unit::CandelaPerKilolumen), ..Interpretation::default() };
    let acquisition = read(&fs::read(path).unwrap(), &how).unwrap();
    assert!(restate(&on_grid(&acquisition), &Origin::of(&acquisition), Digits::Shortest).is_ok());
}

#[test]
fn files_without_provenance_are_written_with_the_least_that_the_format_asks_for() {
    let (_, _, acquisition) = files("ies").into_iter().find(|(path, ..)| path.ends_with("data/ushio_b1.ies")).unwrap();
    let measurement = on_grid(&acquisition);
    let origin = Origin { format: "lm-63", dialect: "", metadata: &[] };
    let restated = restate(&measurement, &origin, Digits::Shortest).unwrap();
    assert_eq!(restated.errors.max_absolute_error, 0.0);
    assert!(restated.bytes.starts_with(b"IESNA:LM-63-2002\r\n[TEST] not stated"));
    for (format, tensor) in [("rgl", &measurement), ("eulumdat", &measurement)] {
        assert!(restate(tensor, &Origin { format, dialect: "", metadata: &[] }, Digits::Shortest).is_err());
    }
}

/// Reads a text file, writes it and reads it again: grid and metadata stay the same. Returns the bytes written.
fn written_again(bytes: &[u8]) -> Vec<u8> {
    let text = String::from_utf8_lossy(bytes);
    let first = read(bytes, &Interpretation::default()).unwrap_or_else(|error| panic!("{error}: {text}"));
    let measurement = on_grid(&first);
    let restated = restate(&measurement, &Origin::of(&first), Digits::Shortest).unwrap();
    let again = read(&restated.bytes, &Interpretation::default()).unwrap();
    assert_eq!(on_grid(&again), measurement, "{text}");
    assert_eq!(again.report.metadata, first.report.metadata, "{text}");
    restated.bytes
}

#[test]
fn every_form_of_planes_comes_back() {
    let list = |angles: &[f64]| angles.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    let half = [0.0, 45.0, 90.0];
    for (kind, vertical, horizontal) in [
        (1, &half[..], &[0.0][..]),
        (1, &half, &[15.0]),
        (1, &half, &[0.0, 30.0, 90.0]),
        (1, &[90.0, 180.0], &[0.0, 30.0, 180.0]),
        (1, &[0.0, 180.0], &[90.0, 100.0, 270.0]),
        (1, &half, &[0.0, 120.0, 240.0, 360.0]),
        (1, &half, &[0.0, 120.0, 240.0]),
        (2, &[-20.0, 0.0, 20.0], &[-40.0, 40.0]),
        (2, &[-90.0, 0.0, 90.0], &[0.0, 90.0]),
        (3, &[-20.0, 0.0, 20.0], &[0.0, 90.0]),
        (3, &[-90.0, 90.0], &[-180.0, 0.0, 180.0]),
    ] {
        let numbers: Vec<f64> = (0..vertical.len() * horizontal.len()).map(|i| 0.3 + 1.7 * i as f64).collect();
        let (v, h) = (vertical.len(), horizontal.len());
        let lists = [vertical, horizontal, &numbers].map(list).join("\n");
        let text = format!(
            "IES:LM-63-2019\n[TEST] a\n[MORE] b\nTILT=INCLUDE\n1\n2\n0 90\n1 0.5\n1 500 1.1 {v} {h} {kind} 1 1 2 0 0.93 \
             1.10000 9\n{lists}\n"
        );
        written_again(text.as_bytes());
    }
    let even = [0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0];
    let uneven = [0.0, 60.83, 90.0, 119.17, 180.0, 240.83, 270.0, 299.17];
    // The last have planes every 45° without saying so, and planes that begin at C10.
    for (symmetry, stored, step, planes) in [
        (0, 8, "45", even),
        (1, 1, "45", even),
        (2, 5, "45", even),
        (3, 5, "45", even),
        (4, 3, "45", even),
        (0, 8, "0", uneven),
        (2, 5, "0", uneven),
        (3, 5, "0", uneven),
        (4, 3, "0", uneven),
        (1, 1, "0", even),
        (1, 1, "45", even.map(|c| c + 10.0)),
    ] {
        let mut lines: Vec<String> = ["a company", "3", &symmetry.to_string(), "8", step].map(str::to_owned).into();
        lines.extend(["2", "90", "r", "l", "n", "f", "d"].map(str::to_owned));
        lines.extend((0..9).map(|_| "1.5".to_owned()));
        lines.extend(["100", "80", "1.25", "0", "1", "1", "lamp", "500", "warm", "", "9"].map(str::to_owned));
        lines.extend((0..10).map(|i| format!("0.{i}")));
        lines.extend(planes.iter().map(f64::to_string).chain(["0".to_owned(), "90".to_owned()]));
        lines.extend((0..2 * stored).map(|i| format!("{:.1}", 0.3 + 1.7 * f64::from(i))));
        let text = lines.join("\n") + "\n";
        let listed = planes.iter().map(f64::to_string).collect::<Vec<_>>().join("\r\n");
        let written = written_again(text.as_bytes());
        assert!(String::from_utf8_lossy(&written).contains(&listed), "{symmetry}");
        // Texts come back in Windows-1252, whatever the encoding of the file.
        let unicode = text.replace("a company", "Büro 5 µm");
        let windows: Vec<u8> = unicode.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
        let line = windows.split(|&b| b == b'\n').next().unwrap();
        for bytes in [unicode.as_bytes(), &windows] {
            assert_eq!(written_again(bytes).split(|&b| b == b'\r').next().unwrap(), line);
        }
    }
}

/// Returns the bytes of a file after compression on its own grid.
fn compressed(bytes: &[u8], target: Target, metadata: bool) -> Vec<u8> {
    let request = Request { domain: Some(DirectionDomain::Grid), metadata, ..Request::to(target) };
    let input = Input { bytes, spectrum: None, interpretation: &Interpretation::default() };
    read_source(&input).unwrap().compress(&request).unwrap().bytes
}

fn exported(material: &[u8], format: ExportFormat) -> Exported {
    match export_on_grid(material, format, &ExportOptions::default()).unwrap() {
        OnGrid::File(file) => *file,
        OnGrid::Resample(reason) => panic!("{reason:?}"),
    }
}

#[test]
fn compressed_luminaires_come_back_within_their_promise_on_the_angles_of_their_file() {
    for (extension, format) in [("ies", ExportFormat::Lm63), ("ldt", ExportFormat::Eulumdat)] {
        for (path, bytes, acquisition) in files(extension) {
            let name = path.display();
            let stated = on_grid(&acquisition);
            let exact = exported(&compressed(&bytes, Target::Lossless, true), format);
            assert!(10 * exact.bytes.len() <= 13 * bytes.len(), "{name}: {} {}", exact.bytes.len(), bytes.len());
            let back = on_grid(&read(&exact.bytes, &Interpretation::default()).unwrap());
            assert_eq!(back, stated, "{name}");
            let lossy = exported(&compressed(&bytes, Target::ErL2(0.01), true), format);
            assert!(10 * lossy.bytes.len() <= 13 * bytes.len(), "{name}: {} {}", lossy.bytes.len(), bytes.len());
            let again = read(&lossy.bytes, &Interpretation::default()).unwrap();
            assert_eq!(again.report.metadata.len(), acquisition.report.metadata.len(), "{name}");
            let back = on_grid(&again);
            assert_eq!(back.tensor.axes(), stated.tensor.axes(), "{name}");
            let found = ErrorReport::measure(stated.tensor.samples(), back.tensor.samples(), 0.0);
            assert!(
                found.er_l2 <= 0.01
                    && found.zero_samples == back.tensor.samples().iter().filter(|s| **s == 0.0).count() as u64,
                "{name}: {found:?}"
            );
            assert!(lossy.about.error.max_relative_error <= 0.001_001, "{name}");
            assert!(lossy.about.lamp.unwrap().flux.abs() < 0.001, "{name}");
        }
    }
}

#[test]
fn compressed_bsdfs_come_back_byte_for_byte_when_lossless() {
    let mut equal = 0;
    for (path, bytes, _) in files("mbsdf") {
        let material = compressed(&bytes, Target::Lossless, true);
        match export_on_grid(&material, ExportFormat::Mbsdf, &ExportOptions::default()).unwrap() {
            OnGrid::File(file) => equal += usize::from(file.bytes == bytes),
            OnGrid::Resample(reason) => {
                assert!(reason.unwrap().contains("angles of the source"), "{}", path.display());
            }
        }
    }
    assert_eq!(equal, 4);
}

#[test]
fn luminaires_of_one_format_are_written_as_the_other() {
    let of = |name: &str| fs::read(root().join(name)).unwrap();
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    let lamp = compressed(&of("tests/fixtures/ies/examp1.ies"), Target::Lossless, true);
    let stated = on_grid(&read(&of("tests/fixtures/ies/examp1.ies"), &Interpretation::default()).unwrap());
    let file = exported(&lamp, ExportFormat::Eulumdat);
    let lines: Vec<String> = text(&file.bytes).lines().map(str::to_owned).collect();
    assert_eq!((&lines[2][..], &lines[3][..], &lines[4][..]), ("4", "16", "22.5"));
    let lumens = 2.0 * 2900.0;
    assert_eq!((&lines[26][..], lines[28].parse(), &lines[31][..]), ("2", Ok(lumens), "63.7"));
    let back = on_grid(&read(&file.bytes, &Interpretation::default()).unwrap());
    assert_eq!(back.tensor.axes(), stated.tensor.axes());
    assert!(file.about.error.max_relative_error < 2e-7, "{:?}", file.about.error);

    // A circle of planes becomes a closed one.
    let ldt = of("tests/fixtures/ldt/example.ldt");
    let stated = on_grid(&read(&ldt, &Interpretation::default()).unwrap());
    let file = exported(&compressed(&ldt, Target::Lossless, true), ExportFormat::Lm63);
    let ies = text(&file.bytes);
    assert!(ies.contains("[MANUFAC] Ingemann") && ies.contains("\r\n1 5134 1 37 21 1 2 "), "{}", &ies[..400]);
    let closed = on_grid(&read(&file.bytes, &Interpretation::default()).unwrap());
    let azimuths = directions(&closed).azimuths().unwrap();
    assert_eq!((azimuths.extent, azimuths.angles.len()), (AzimuthExtent::Closed, 21));
    let rows = closed.tensor.samples().chunks(21).flat_map(|row| &row[..20]);
    assert!(rows.eq(stated.tensor.samples()));
    // TM-33 has keywords of its own for the same things.
    let xml = of("tests/fixtures/tm33/street.xml");
    let (lamp, stated) =
        (compressed(&xml, Target::Lossless, true), on_grid(&read(&xml, &Interpretation::default()).unwrap()));
    let (ies, ldt) = (exported(&lamp, ExportFormat::Lm63).bytes, exported(&lamp, ExportFormat::Eulumdat).bytes);
    assert!(
        text(&ies).contains("[MANUFAC] Made up\r\n[LUMCAT] not stated\r\n[LUMINAIRE] Street luminaire"),
        "{}",
        text(&ies)
    );
    let lines: Vec<String> = text(&ldt).lines().map(str::to_owned).collect();
    assert_eq!([&lines[0], &lines[2], &lines[8], &lines[31]], ["Made up", "3", "Street luminaire", "28"]);
    for file in [&ies, &ldt] {
        let back = on_grid(&read(file, &Interpretation::default()).unwrap());
        assert_eq!(back.tensor.axes(), stated.tensor.axes());
        let pairs = back.tensor.samples().iter().zip(stated.tensor.samples());
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() <= 1e-3 * b), "{}", text(file));
    }
    // And the other way: C360 goes, and what it said beside C0 is named.
    let file = exported(&compressed(&of("data/ushio_b1.ies"), Target::Lossless, true), ExportFormat::Lm63);
    assert!(file.about.lost.is_empty());
}

/// Returns the bytes of a text in Windows-1252; for characters of Latin-1 alone.
fn latin(text: &str) -> Vec<u8> {
    text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect()
}

#[test]
fn names_are_written_in_windows_1252_whatever_the_encoding_of_the_source() {
    let numbers = "TILT=NONE\n1 -1 1 4 1 1 2 0.1 0.2 0\n1 1 20\n0 30 60 90\n0\n500 433 250 0\n";
    let names = ["Müller Straße Ä Ø60 m² 4000 °K", "Łódź → CO₂", "light"];
    for maker in names {
        let text = format!(
            "IESNA:LM-63-2002\n[TEST] T\n[TESTLAB] L\n[ISSUEDATE] 1\n[MANUFAC] {maker}\n[LUMINAIRE] {maker}\n{numbers}"
        );
        let mut sources = vec![text.clone().into_bytes(), [b"\xef\xbb\xbf", text.as_bytes()].concat()];
        sources.push([0xff, 0xfe].into_iter().chain(text.encode_utf16().flat_map(u16::to_le_bytes)).collect());
        if maker.starts_with('M') {
            sources.push(latin(&text));
        }
        let (written, told) = match maker {
            "Łódź → CO₂" => ("Lódz -> CO2", "characters that Windows-1252 lacks: `Ł` as `L`, `ź` as `z`"),
            other => (other, ""),
        };
        for source in sources {
            let material = compressed(&source, Target::Lossless, true);
            let ldt = exported(&material, ExportFormat::Eulumdat);
            let ies = exported(&material, ExportFormat::Lm63);
            // And from the other format.
            let again = exported(&compressed(&ldt.bytes, Target::Lossless, true), ExportFormat::Lm63);
            for (file, key) in [(&ldt, "company"), (&ies, "MANUFAC"), (&again, "MANUFAC")] {
                let bytes = latin(written);
                assert!(file.bytes.windows(bytes.len()).any(|found| found == bytes), "{maker} {key}");
                let found = read(&file.bytes, &Interpretation::default()).unwrap().report.metadata;
                assert_eq!(found.iter().find(|(name, _)| name == key).unwrap().1, written);
            }
            for file in [&ldt, &ies] {
                let lost = file.about.lost.join("; ");
                assert!(lost.contains(told) && lost.is_empty() == told.is_empty(), "{lost}");
            }
            assert_eq!(again.about.lost, Vec::<String>::new());
        }
    }
}

#[test]
fn luminaires_of_laboratory_tables_are_written_on_their_own_angles() {
    for (last, extent) in [(345, ""), (180, "# phi_o_extent: mirrored\n")] {
        let mut text = "# radiometric-csv: 1\n# quantity: edf\n# value_unit: W/sr\n# angle_unit: deg\n".to_owned();
        text += extent;
        text += "theta,phi,value\n";
        for theta in (90..=180).step_by(5) {
            for phi in (0..=last).step_by(15) {
                // One value at nadir.
                let around = f64::from(180 - theta) / 90.0 * f64::from(phi).to_radians().cos();
                let value = f64::from(theta - 85) * (2.0 + around);
                writeln!(text, "{theta},{phi},{value:.5}").unwrap();
            }
        }
        let material = compressed(text.as_bytes(), Target::ErL2(0.01), true);
        let file = exported(&material, ExportFormat::Lm63);
        assert!(10 * file.bytes.len() <= 13 * text.len(), "{} of {}", file.bytes.len(), text.len());
        let written = on_grid(&read(&file.bytes, &Interpretation::default()).unwrap());
        let source = on_grid(&read(text.as_bytes(), &Interpretation::default()).unwrap());
        let (planes, own) = (directions(&written), directions(&source));
        assert_eq!(planes.polar().len(), own.polar().len());
        let same = source.tensor.samples().iter().enumerate().map(|(entry, &value)| {
            let at = planes.nearest(own.direction(entry)).unwrap();
            (value, written.tensor.samples()[at])
        });
        let (stated, found): (Vec<f32>, Vec<f32>) = same.unzip();
        let errors = ErrorReport::measure(&stated, &found, 0.0);
        assert!(errors.er_l2 <= 0.01, "{}", errors.er_l2);
    }
}

#[test]
fn files_that_the_angles_or_the_options_do_not_fit_are_sampled_anew() {
    let lamp = compressed(&fs::read(root().join("data/aerolamp.ies")).unwrap(), Target::ErL2(0.01), false);
    // Without provenance the format of the file is that asked for, with the least of keywords.
    let file = exported(&lamp, ExportFormat::Lm63);
    assert!(file.bytes.starts_with(b"IESNA:LM-63-2002\r\n[TEST] not stated"));
    let step = ExportOptions { step: Some(5.0), ..ExportOptions::default() };
    assert_eq!(export_on_grid(&lamp, ExportFormat::Lm63, &step).unwrap(), OnGrid::Resample(None));
    assert_eq!(export_on_grid(&lamp, ExportFormat::Rgl, &ExportOptions::default()).unwrap(), OnGrid::Resample(None));
    let small = ExportOptions { most_bytes: 900, ..ExportOptions::default() };
    assert!(
        export_on_grid(&lamp, ExportFormat::Lm63, &small).unwrap_err().to_string().contains("expected at most 900")
    );
    let beam = compressed(&fs::read(root().join("tests/fixtures/ies/test.ies")).unwrap(), Target::ErL2(0.01), true);
    let OnGrid::Resample(Some(reason)) =
        export_on_grid(&beam, ExportFormat::Eulumdat, &ExportOptions::default()).unwrap()
    else {
        panic!("type B has no C planes")
    };
    assert!(reason.contains("expected type C"), "{reason}");
    // EULUMDAT finds C90 and C270 by their number, so their quarters need as many planes.
    let uneven = "IESNA:LM-63-2002\n[TEST] x\nTILT=NONE\n1 1000 1 2 4 1 2 0.1 0.1 0\n1 1 10\n0 90\n90 120 200 270\n\
                  100 50 100 60 100 70 100 80\n";
    let uneven = compressed(uneven.as_bytes(), Target::Lossless, true);
    let OnGrid::Resample(Some(reason)) =
        export_on_grid(&uneven, ExportFormat::Eulumdat, &ExportOptions::default()).unwrap()
    else {
        panic!("the planes cannot be listed")
    };
    assert!(reason.contains("not with these planes"), "{reason}");
    assert!(export_on_grid(b"no material", ExportFormat::Lm63, &ExportOptions::default()).is_err());
}

#[test]
fn lamps_joined_with_a_spectrum_go_back_to_the_files_that_they_came_from() {
    let spectrum = (0..21).fold("wavelength,power\n".to_owned(), |mut text, i| {
        let lambda = 380.0 + 20.0 * f64::from(i);
        let _ = writeln!(text, "{lambda},{}", (-0.5 * ((lambda - 560.0) / 80.0).powi(2)).exp());
        text
    });
    for name in [
        "tests/fixtures/ies/examp1.ies",
        "tests/fixtures/ies/iesna2002_example_typec.ies",
        "tests/fixtures/ies/test.ies",
        "tests/fixtures/ies/example_modules.ies",
        "data/ushio_b1.ies",
        "tests/fixtures/ldt/example.ldt",
        "tests/fixtures/ldt/symmetry_to_c90c270.ldt",
        "tests/fixtures/ldt/absolute.ldt",
    ] {
        let bytes = fs::read(root().join(name)).unwrap();
        let interpretation = Interpretation::default();
        let acquisition = read(&bytes, &interpretation).unwrap();
        let stated = on_grid(&acquisition);
        let input = Input { bytes: &bytes, spectrum: Some(spectrum.as_bytes()), interpretation: &interpretation };
        let source = read_source(&input).unwrap();
        let (own, other) = match acquisition.format {
            "eulumdat" => (ExportFormat::Eulumdat, ExportFormat::Lm63),
            _ => (ExportFormat::Lm63, ExportFormat::Eulumdat),
        };
        for (target, allowed) in [(Target::Lossless, 2e-5), (Target::ErL2(0.01), 0.011)] {
            let request = Request { domain: Some(DirectionDomain::Grid), ..Request::to(target) };
            let material = source.compress(&request).unwrap().bytes;
            let file = exported(&material, own);
            assert!(file.about.lost.iter().any(|lost| lost.starts_with("the spectrum: of 21 wavelengths")), "{name}");
            assert!(10 * file.bytes.len() <= 13 * bytes.len(), "{name}: {} {}", file.bytes.len(), bytes.len());
            let again = read(&file.bytes, &interpretation).unwrap();
            assert_eq!(again.unit, acquisition.unit, "{name}");
            // The flux that the reader notes differs in a lossy file.
            let kept = |all: &Acquisition| {
                let fields = all.report.metadata.iter().filter(|(key, _)| key != "flux_of_the_intensities_lm");
                fields.cloned().collect::<Vec<_>>()
            };
            assert_eq!(kept(&again), kept(&acquisition), "{name}");
            let back = on_grid(&again);
            assert_eq!(back.tensor.axes(), stated.tensor.axes(), "{name}");
            let found = ErrorReport::measure(stated.tensor.samples(), back.tensor.samples(), 0.0);
            assert!(found.er_l2 <= allowed, "{name}: {}", found.er_l2);
            // Type B and radiant intensities have no place in EULUMDAT.
            if other == ExportFormat::Eulumdat && (name.contains("test.ies") || name.contains("ushio")) {
                continue;
            }
            let file = exported(&material, other);
            let again = read(&file.bytes, &interpretation).unwrap();
            assert_eq!(directions(&on_grid(&again)).polar(), directions(&stated).polar(), "{name}");
            let watts = |all: &Acquisition| {
                let field = all.report.metadata.iter().find(|(key, _)| key == "watts" || key == "input_watts");
                field.and_then(|(_, watts)| watts.parse::<f64>().ok())
            };
            assert_eq!(watts(&again), watts(&acquisition), "{name}");
        }
    }
}
