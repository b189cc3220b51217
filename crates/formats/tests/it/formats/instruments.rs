//! Text exports of instruments and libraries, compared value by value with numbers written out here, and files that
//! look like spectra but are not.

use super::{columns_of as columns, file, fixture, has_note, metadata, plain, tensor, wavelengths};
use std::f64::consts::PI;
use wavelume_core::domain::{Axis, Quantity, Unit};
use wavelume_formats::formats::{
    Acquisition, FormatErrorKind, Interpretation, NoteKind, Samples, StatedQuantity, read,
};

fn instrument(name: &str) -> Acquisition {
    fixture(&format!("tests/fixtures/instruments/{name}"))
}

fn labels(table: &Acquisition) -> Vec<&str> {
    match tensor(table).0 {
        [Axis::Index { labels, .. }, _] => labels.iter().map(String::as_str).collect(),
        _ => panic!("expected several columns"),
    }
}

/// Checks that values are equal, with NaN where NaN is expected.
fn check(found: &[Vec<f32>], expected: &[&[f32]], what: &str) {
    let same = |a: &f32, b: &f32| a == b || (a.is_nan() && b.is_nan());
    let rows = |a: &Vec<f32>, b: &&[f32]| a.len() == b.len() && a.iter().zip(*b).all(|(a, b)| same(a, b));
    assert!(found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| rows(a, b)), "{what}: {found:?}");
}

const NAN: f32 = f32::NAN;

#[test]
fn padding_and_byte_order_marks_are_no_data() {
    let asd = instrument("asd_nul_padded.txt");
    assert_eq!(
        (asd.format, asd.quantity, wavelengths(&asd)),
        ("spectral-table", Quantity::Reflectance, vec![350.0, 351.0, 352.0, 353.0])
    );
    check(&columns(&asd), &[&[0.0425, 0.0441, 0.04625, 0.05]], "ASD");
    for name in ["utf16le", "utf16be", "utf16_unmarked", "utf8", "windows1252"] {
        let avantes = instrument(&format!("avantes_{name}.txt"));
        assert_eq!(wavelengths(&avantes), [180.0, 185.25, 190.5], "{name}");
        assert_eq!(labels(&avantes)[3], "Absolute Irradiance [µWatt/cm²/nm]", "{name}");
        let expected: [&[f32]; 4] =
            [&[4.25, 3.975, 1612.081], &[2.5, -3.125, -15.875], &[0.0, 0.0, 0.0], &[0.0, 0.5, 3.55311]];
        check(&columns(&avantes), &expected, name);
    }
}

#[test]
fn missing_values_are_masked_and_counted() {
    let table = instrument("missing.csv");
    check(&columns(&table), &[&[1.0, NAN, NAN, NAN, 5.0, 6.0], &[NAN, 2.0, 3.0, 4.0, NAN, NAN]], "missing.csv");
    assert!(has_note(&table, NoteKind::Warning, "6 missing values (blank, NaN or --) are masked"));
    // A first row without a value is a row, whatever separates its cells.
    for text in [
        "nm,v\n400,nan\n410,1\n",
        "nm\tv\n400\t--\n410\t1\n",
        "nm v\n400 NaN\n410 1\n",
        "400 NAN\n410 1\n",
        "nm;v\n400;\n410;1,0\n",
    ] {
        check(&columns(&plain(text.as_bytes()).unwrap()), &[&[NAN, 1.0]], text);
    }
    // A cell that is not there is no missing value.
    let rows: String = (0..30).map(|i| format!("{} 1 2\n", 400 + i)).chain(["430 1 \n".to_owned()]).collect();
    assert!(plain(rows.as_bytes()).unwrap_err().message.contains("2 cells, expected 3"));
}

#[test]
fn spectral_libraries_state_their_units() {
    let aster = instrument("aster.txt");
    assert_eq!(
        (aster.dialect.as_str(), aster.quantity, aster.unit),
        ("spectral library, 1 column", Quantity::Reflectance, Unit::One)
    );
    assert_eq!(wavelengths(&aster), [400.0, 550.0, 2500.0, 15_385.0]);
    // All below 1.5 %: by their size alone they would be fractions.
    check(&columns(&aster), &[&[0.005, 0.0075, 0.0125, 0.01375]], "aster.txt");
    assert_eq!(metadata(&aster, "Sample No."), "none");
    assert!(
        metadata(&aster, "Description").contains("0.5 mm begins with a number. A colon"),
        "{}",
        metadata(&aster, "Description")
    );
    let ecostress = instrument("ecostress.txt");
    assert_eq!(wavelengths(&ecostress), [2080.0, 2500.0, 10_000.0, 14_011.0, 25_060.0]);
    check(&columns(&ecostress), &[&[0.3125, 0.22, 0.035, 0.0125, 0.025]], "ecostress.txt");
    assert!(has_note(&ecostress, NoteKind::Assumed, "bidirectional reflectance"));
    let notes =
        |table: &Acquisition| table.report.notes.iter().map(|note| note.message.clone()).collect::<Vec<_>>().join("; ");
    assert!(!notes(&aster).contains("rows, but") && !notes(&aster).contains("no wavelength unit"), "{}", notes(&aster));
    // 100 µm and a count that is wrong.
    let text = String::from_utf8(file("tests/fixtures/instruments/ecostress.txt")).unwrap();
    let far = plain(text.replace("25.0600", "100.0000").replace("Values: 5", "Values: 6").as_bytes()).unwrap();
    assert_eq!(wavelengths(&far)[4], 100_000.0);
    assert!(has_note(&far, NoteKind::Warning, "5 rows, but `Number of X Values` says 6"));
    let emissivity = plain(text.replace("Reflectance (percentage)", "Emissivity").as_bytes()).unwrap();
    assert_eq!((emissivity.quantity, tensor(&emissivity).1[0]), (Quantity::Spectrum, 31.25));
}

#[test]
fn wavelengths_may_have_their_unit_behind_them() {
    let lamp = instrument("li180.txt");
    assert_eq!((lamp.quantity, wavelengths(&lamp)), (Quantity::Spectrum, vec![380.0, 381.0, 382.0, 383.0, 384.0]));
    check(&columns(&lamp), &[&[27.5, 27.875, 28.25, -0.125, 30.0]], "li180.txt");
    assert_eq!(
        (metadata(&lamp, "Model Name"), metadata(&lamp, "CCT"), metadata(&lamp, "R2")),
        ("LI-180", "5465.000000", "99.470703")
    );
    let two = plain(b"CCT\t5000\t6000\nname\tfirst\tsecond\n380 nm\t1\t2,5\n381 nm\t--\t3\n382 nm\t4\t5\n\n").unwrap();
    assert_eq!(labels(&two), ["first", "second"]);
    check(&columns(&two), &[&[1.0, NAN, 4.0], &[2.5, 3.0, 5.0]], "two columns");
    for (text, line, column, word) in [
        ("380nm\t1\n381nm\t2\n382nm\t3\n383nm\tx\n", 4, 7, "`x`, expected a number"),
        ("380nm\t1\n381nm\t2\n382nm\t3\n383nm\t1\t2\n", 4, 1, "3 cells, expected 2"),
        ("380nm\t1\n381nm\t2\n382nm\t3\nCCT\t5\n380nm\t1\n", 5, 1, "a second list"),
        ("380nm\t1\n381nm\t2\n381nm\t3\n", 3, 1, "381 twice"),
    ] {
        let error = plain(text.as_bytes()).unwrap_err();
        let position = Some(wavelume_formats::formats::Position::Text { line, column });
        assert!(error.position == position && error.message.contains(word), "{text:?}: {error}");
    }
}

#[test]
fn a_row_of_numbers_may_be_wavelengths() {
    let leaves = instrument("wide_numbers.csv");
    assert_eq!(
        (leaves.quantity, labels(&leaves), wavelengths(&leaves)),
        (Quantity::Reflectance, vec!["leaf", "soil"], vec![400.0, 450.5, 500.0, 550.0])
    );
    check(&columns(&leaves), &[&[0.1, 0.2, 0.3, 0.4], &[0.2, NAN, NAN, 0.5]], "wide_numbers.csv");
    let numbered = instrument("wide_identifiers.tsv");
    assert_eq!((labels(&numbered), wavelengths(&numbered)), (vec!["1", "2"], vec![350.0, 351.0, 352.0]));
    check(&columns(&numbered), &[&[0.25, 0.5, 0.75], &[0.125, NAN, 0.375]], "wide_identifiers.tsv");
    let only = instrument("wide_only_numbers.txt");
    assert_eq!(wavelengths(&only), [400.0, 500.0, 600.0, 700.0]);
    check(&columns(&only), &[&[0.1, 0.2, 0.3, 0.4], &[0.5, 0.6, 0.7, 0.8]], "wide_only_numbers.txt");
    // Micrometres, falling wavenumbers, a unit in the first name, delimiters at the end of all rows.
    for (text, expected) in [
        ("id,0.35,0.5,0.75,1.0,2.5\na,1,2,3,4,5\n", vec![350.0, 500.0, 750.0, 1000.0, 2500.0]),
        ("id;4000;2000;1000;\na;1;2;3;\n", vec![2500.0, 5000.0, 10_000.0]),
        ("Wavelength (um),1,2,3,4\nleaf,1,2,3,4\n", vec![1000.0, 2000.0, 3000.0, 4000.0]),
        ("wavelength 400 500 600\nleaf 1 2 3\n", vec![400.0, 500.0, 600.0]),
    ] {
        let found = plain(text.as_bytes()).unwrap_or_else(|error| panic!("{text}{error}"));
        assert!(
            wavelengths(&found) == expected && found.dialect.starts_with("one spectrum a row"),
            "{text}{}",
            found.dialect
        );
    }
    // Excitations of a fluorescent sample, columns that are numbered, rows whose first column goes on.
    for text in [
        ",380,390,400\n500,1,2,3\n510,2,3,4\n",
        "nm,400,500,600\n380,1,2,3\n390,2,3,4\n",
        "wavelength,1,2,3\n500,1,2,3\n510,2,3,4\n",
        "400 500 600 700\n410 510 610 710\n420 520 620 720\n",
    ] {
        let found = plain(text.as_bytes()).unwrap_or_else(|error| panic!("{text}{error}"));
        assert!(found.dialect.contains("separated"), "{text}{}", found.dialect);
    }
}

#[test]
fn reflectance_factors_are_pi_times_a_brdf() {
    let over_pi = |value: f64| (value / PI) as f32;
    let table = instrument("hcrf.csv");
    assert_eq!(
        (table.quantity, table.unit, labels(&table)),
        (Quantity::Brdf, Unit::PerSteradian, vec!["grass HCRF", "soil HCRF"])
    );
    let expected: [&[f32]; 2] = [&[over_pi(0.5), over_pi(0.25), over_pi(1.25)], &[over_pi(1.0), NAN, over_pi(2.0)]];
    check(&columns(&table), &expected, "hcrf.csv");
    assert!(
        has_note(&table, NoteKind::Assumed, "divided by π") && has_note(&table, NoteKind::Warning, "up to 2, expected")
    );
    let asked = |quantity: StatedQuantity| Interpretation { quantity: Some(quantity), ..Interpretation::default() };
    let bytes = file("tests/fixtures/instruments/hcrf.csv");
    let kept = read(&bytes, &asked(StatedQuantity::Reflectance)).unwrap();
    assert_eq!((kept.quantity, columns(&kept)[0].as_slice()), (Quantity::Reflectance, &[0.5, 0.25, 1.25][..]));
    let said = read(b"nm,r (%)\n400,50\n410,100\n", &asked(StatedQuantity::ReflectanceFactor)).unwrap();
    assert_eq!((said.quantity, said.unit), (Quantity::Brdf, Unit::PerSteradian));
    check(&columns(&said), &[&[over_pi(0.5), over_pi(1.0)]], "percent");
    let header = plain(b"# Bidirectional Reflectance Factor, 45:0\nnm,r\n400,0.5\n410,1\n").unwrap();
    check(&columns(&header), &[&[over_pi(0.5), over_pi(1.0)]], "a comment");
    // Columns of two kinds are told apart by a name; a file that holds no such values refuses the word.
    let mixed = b"nm,albedo,BRF\n400,0.5,1\n410,0.25,2\n";
    assert_eq!(plain(mixed).unwrap_err().kind, FormatErrorKind::NeedsOption);
    for (column, expected) in [("BRF", [over_pi(1.0), over_pi(2.0)]), ("albedo", [0.5, 0.25])] {
        let how = Interpretation { column: Some(column.to_owned()), ..Interpretation::default() };
        check(&columns(&read(mixed, &how).unwrap()), &[&expected], column);
    }
    let error = read(&file("data/aerolamp.ies"), &asked(StatedQuantity::ReflectanceFactor)).unwrap_err();
    assert!(
        error.kind == FormatErrorKind::NeedsOption && error.message.contains("quantity reflectance-factor"),
        "{error}"
    );

    let directions = instrument("brf_directions.csv");
    assert_eq!((directions.quantity, directions.unit), (Quantity::Brdf, Unit::PerSteradian));
    let Samples::Grid(grid) = &directions.samples else { panic!("a grid") };
    // [theta_o 0 and 60, phi_o 0 and 180, 550 and 650 nm]
    let expected = [0.5, 1.0, 0.5, 1.0, 0.25, f64::NAN, 1.25, 2.0].map(over_pi);
    check(std::slice::from_ref(&grid.values), &[&expected], "brf_directions.csv");
    let text = String::from_utf8(file("tests/fixtures/instruments/brf_directions.csv")).unwrap();
    let wrong = text.replace("# value_unit: 1\n", "# value_unit: 1\n# cosine_included: true\n");
    assert!(plain(wrong.as_bytes()).unwrap_err().message.contains("holds no cosine"));
    for name in ["BRF", "hcrf", "reflectance_factor", "bidirectional reflectance factor"] {
        let named = plain(text.replace("reflectance-factor", name).as_bytes()).unwrap();
        assert_eq!((named.quantity, named.unit), (Quantity::Brdf, Unit::PerSteradian), "{name}");
    }
    // As an option, over what the file says; as a manifest.
    let stated = text.replace("# quantity: reflectance-factor\n", "# quantity: reflectance\n");
    let renamed = read(stated.as_bytes(), &asked(StatedQuantity::ReflectanceFactor)).unwrap();
    assert!(has_note(&renamed, NoteKind::Warning, "taken as reflectance-factor as asked"));
    let axes = serde_json::json!({"quantity": "brf", "value_unit": "1", "axes": ["hemi:0", "hemi:0"]});
    let how = Interpretation { axes: Some(axes), ..Interpretation::default() };
    let array = read(&wavelume_formats::formats::write_npy(&[4, 4], &[0.5; 16]), &how).unwrap();
    assert_eq!((array.quantity, array.unit, tensor(&array).1[15]), (Quantity::Brdf, Unit::PerSteradian, over_pi(0.5)));
}

#[test]
fn alta_files_are_pairs_of_directions() {
    let isotropic = instrument("isotropic.alta");
    assert_eq!((isotropic.format, isotropic.quantity, isotropic.unit), ("alta", Quantity::Brdf, Unit::PerSteradian));
    let Samples::Grid(grid) = &isotropic.samples else { panic!("a grid") };
    let (incoming, outgoing) = (grid.incoming.as_ref().unwrap(), grid.outgoing.as_ref().unwrap());
    assert_eq!((incoming.theta.as_slice(), incoming.phi.is_none()), (&[30.0][..], true));
    assert_eq!(
        (outgoing.theta.as_slice(), outgoing.phi.as_ref().unwrap().phi.as_slice()),
        (&[0.0, 60.0][..], &[0.0, 180.0][..])
    );
    assert_eq!(grid.values, [0.25, 0.25, 0.5, 0.75]);
    let half = instrument("half_angles.alta");
    let Samples::Scattered(scattered) = &half.samples else { panic!("scattered: {}", half.dialect) };
    // theta_h 0, theta_d 30°: view at 30°, light opposite; then theta_h 20° towards y, theta_d 30°: view 50°, light
    // -10°.
    assert_eq!(scattered.incoming, [[30.0, 180.0], [10.0, 270.0]]);
    assert_eq!(scattered.outgoing, [[30.0, 0.0], [50.0, 90.0]]);
    assert_eq!(
        (&scattered.spectral, scattered.values.as_slice()),
        (&Some(Axis::Rgb), &[0.25, 0.5, 0.75, 1.0, 2.0, 3.0][..])
    );
    assert!(has_note(&half, NoteKind::Skipped, "1 row with a direction below the horizon"));
}

#[test]
fn what_only_looks_like_a_spectrum_is_named() {
    for (name, format, word) in [
        ("cosine_half.alta", "alta", "coordinates `COS_TH`, which do not fix two directions"),
        ("tracepro.txt", "", "a TracePro surface property"),
        ("directions_in_words.csv", "", "theta_o (viewing zenith)"),
        ("directions_and_wavelengths.csv", "", "a table of directions"),
        ("summary.csv", "", "a summary of a lamp"),
        ("summary_rows.csv", "", "export the spectrum"),
    ] {
        let error = plain(&file(&format!("tests/fixtures/instruments/{name}"))).unwrap_err();
        assert_eq!((error.kind, error.format), (FormatErrorKind::Unsupported, format), "{name}: {error}");
        assert!(error.message.contains(word), "{name}: {error}");
    }
    // Named figures that no list knows, in one row.
    let error = plain(b"width,height,gain\n450,3,2\n").unwrap_err();
    assert!(
        error.kind == FormatErrorKind::Unsupported && error.message.contains("one row of named figures"),
        "{error}"
    );
    let how = Interpretation { wavelength_unit: Some("nm".to_owned()), ..Interpretation::default() };
    assert_eq!(wavelengths(&read(b"width,height,gain\n450,3,2\n", &how).unwrap()), [450.0]);
}

#[test]
fn tables_as_instruments_write_them_are_read_or_refused_with_one_reason() {
    let wide = "name;380nm;390nm;400nm;\r\na;1,5;2,5;--;\r\n;;;;\r\n";
    for (text, nm, values) in [
        ("wavelength;refl\n[nm];[%]\n400;1,5\n410;2,5\n420;3,5\n;\n\n", vec![400.0, 410.0, 420.0], vec![1.5, 2.5, 3.5]),
        ("Wavelength [nm];a\r\n400,5;1,5E-03\r\n401,5;-2,5E+00\r\n\r\n\r\n", vec![400.5, 401.5], vec![0.0015, -2.5]),
        ("range\n380 - 780\n400 1\n410 2\n", vec![400.0, 410.0], vec![1.0, 2.0]),
        ("lambda (nm),a,\r\n400,1.5,\r\n410,NaN,\r\n420,2.5,\r\n", vec![400.0, 410.0, 420.0], vec![1.5, NAN, 2.5]),
        ("  400\t 1 \n  410 \t2\n  420\t \t3\n", vec![400.0, 410.0, 420.0], vec![1.0, 2.0, 3.0]),
        ("# a\n\n\n400  1\n\n410  nan\n420  3\n\n\n", vec![400.0, 410.0, 420.0], vec![1.0, NAN, 3.0]),
        (
            "date: 1.2.2020\ntemperature: 21,5 °C\nnm\tW\n400\t1\n410\t-nan(ind)\n420\t#N/A\n430\t4",
            vec![400.0, 410.0, 420.0, 430.0],
            vec![1.0, NAN, NAN, 4.0],
        ),
        (wide, vec![380.0, 390.0, 400.0], vec![1.5, 2.5, NAN]),
        ("um,a\n0.35,1\n0.4,--\n100,3\n", vec![350.0, 400.0, 100_000.0], vec![1.0, NAN, 3.0]),
        ("Wellenlänge [µm]\tr\n2,5\t1\n1,5\t2\n", vec![1500.0, 2500.0], vec![2.0, 1.0]),
    ] {
        for bytes in [text.as_bytes().to_vec(), encoded(text)] {
            let found = plain(&bytes).unwrap_or_else(|error| panic!("{text:?}: {error}"));
            assert_eq!(wavelengths(&found), nm, "{text:?}");
            check(&columns(&found), &[&values], text);
        }
    }
    for (text, word) in [
        ("nm;v\n400;1\n410;inf\n", "`inf`"),
        ("nm;v\n400;1\n410;1,2,3\n", "`1,2,3`"),
        ("nm;v\n400;1\n;2\n", "expected a wavelength"),
        ("nm;v\n400;1\nNaN;2\n", "`NaN`, expected a wavelength"),
        ("nm;v\n400;--\n410;--\n", "every value is missing"),
        ("sample,400,500,600\na,1,2\nb,1,2,3\n", "3 cells, expected 4"),
        ("sample,400,500,600\na,1,x,3\n", "`x`, expected a number"),
        ("Wavelength,Reflectance\n400,0,1\n401,0,2\n402,0,3\n", "where commas are decimal marks"),
        ("Wavelength (furlongs),R\n0.4,1\n0.5,2\n", "wavelengths in `furlongs`"),
        ("Name: x\nX Units: Wavelength (micrometers)\nY Units: Reflectance (percent)\n\n", "no rows of numbers"),
        ("sample,400,500,600\nb,1,2,3\na,1,2\n", "3 cells, expected 4"),
        ("sample,400,500,600\nb,1,2,3\na,1,x,2\n", "`x`"),
        ("sample,400,600,500\nb,1,2,3\n", "of no format known"),
    ] {
        let error = plain(text.as_bytes()).unwrap_err().to_string();
        assert!(error.contains(word) && error.len() < 400, "{text:?}: {error}");
    }
}

/// Encodes text in Windows-1252; other characters are not supported.
fn encoded(text: &str) -> Vec<u8> {
    text.chars().map(|c| u8::try_from(u32::from(c)).unwrap_or(b'?')).collect()
}
