//! Tables of directions as goniometers write them, in many languages and layouts, against the formula of the surface;
//! and what is refused, with what to do.

use super::{file, fixture, grid, has_note, metadata};
use std::fmt::Write as _;
use wavelume_core::domain::{Axis, Direction, Quantity, Unit};
use wavelume_core::evaluate::{Interpolation, Material, Place};
use wavelume_formats::Request;
use wavelume_formats::formats::{
    Acquisition, FormatErrorKind, InPlaneSign, Interpretation, NoteKind, Position, StatedQuantity, read,
};
use wavelume_formats::pipeline::{Input, read as read_source};

const THETA_I: [f64; 4] = [5.0, 20.0, 35.0, 50.0];
const BANDS: [f64; 3] = [450.0, 550.0, 650.0];

/// BRDF of a lobe about the mirror direction over a diffuse base; the source is at azimuth 0.
fn f([theta_i, theta_o, phi_o]: [f64; 3], band: usize) -> f64 {
    let x = theta_o.to_radians().sin() * phi_o.to_radians().cos() + theta_i.to_radians().sin();
    let y = theta_o.to_radians().sin() * phi_o.to_radians().sin();
    0.03 * (band + 1) as f64 + 1.7 * (-6.0 * (x * x + y * y)).exp()
}

/// Directions of a hemisphere.
fn hemisphere() -> Vec<[f64; 3]> {
    let at = |i: usize| [THETA_I[i / 108], f64::from(i as u32 % 108 / 12 * 10), f64::from(i as u32 % 12 * 30)];
    (0..4 * 108).map(at).collect()
}

/// Signed angles in the plane of incidence: positive ones on the side of the mirror direction.
fn plane() -> Vec<[f64; 2]> {
    (0..4 * 17).map(|i| [THETA_I[i / 17], f64::from(i as u32 % 17 * 10) - 80.0]).collect()
}

fn of_plane([theta_i, theta_o]: [f64; 2]) -> [f64; 3] {
    [theta_i, theta_o.abs(), if theta_o < 0.0 { 0.0 } else { 180.0 }]
}

/// Notation of numbers.
#[derive(Clone, Copy)]
struct Style {
    separator: &'static str,
    comma: bool,
    /// Factor of the values, and the text after each of them.
    scale: f64,
    after: &'static str,
}

const GERMAN: Style = Style { separator: ";", comma: true, scale: 1.0, after: "" };
const ENGLISH: Style = Style { separator: ",", comma: false, scale: 1.0, after: "" };

/// Rows of angles with the values of all bands; `written` returns the angles of a row as they are written.
fn rows(style: Style, written: impl Fn(&[f64; 3]) -> Vec<f64>) -> String {
    table(style, hemisphere().into_iter().map(|at| (written(&at), at)))
}

fn table(style: Style, rows: impl Iterator<Item = (Vec<f64>, [f64; 3])>) -> String {
    let mut text = String::new();
    for (angles, at) in rows {
        let values = (0..3).map(|band| format!("{:.7}{}", style.scale * f(at, band), style.after));
        let cells: Vec<String> = angles.iter().map(f64::to_string).chain(values).collect();
        let line = cells.join(style.separator);
        let _ = writeln!(text, "{}", if style.comma { line.replace('.', ",") } else { line });
    }
    text
}

fn in_plane(style: Style, sign: f64) -> String {
    table(
        style,
        plane().into_iter().map(|[theta_i, theta_o]| (vec![theta_i, sign * theta_o], of_plane([theta_i, theta_o]))),
    )
}

/// Value of a grid at angles that it has.
fn at(acquisition: &Acquisition, [theta_i, theta_o, phi_o]: [f64; 3], band: usize) -> f64 {
    let grid = grid(acquisition);
    let (incoming, outgoing) = (grid.incoming.as_ref().unwrap(), grid.outgoing.as_ref().unwrap());
    let phi = &outgoing.phi.as_ref().unwrap().phi;
    let find = |list: &[f64], angle: f64| list.iter().position(|known| (known - angle).abs() < 1e-3).unwrap();
    let bands = grid.spectral.as_ref().map_or(1, Axis::len);
    let place = find(&incoming.theta, theta_i) * outgoing.theta.len() + find(&outgoing.theta, theta_o);
    f64::from(grid.values[(place * phi.len() + find(phi, phi_o)) * bands + band])
}

fn check(acquisition: &Acquisition, directions: impl IntoIterator<Item = [f64; 3]>, what: &str) {
    assert_eq!((acquisition.format, acquisition.unit), ("radiometric-csv", Unit::PerSteradian), "{what}");
    let bands = grid(acquisition).spectral.as_ref().map(|axis| match axis {
        Axis::Wavelength(grid) => grid.values(),
        other => panic!("{what}: {other:?}"),
    });
    assert_eq!(bands.as_deref(), Some(&BANDS[..]), "{what}");
    for direction in directions {
        for band in 0..3 {
            let (found, expected) = (at(acquisition, direction, band), f(direction, band));
            assert!((found / expected - 1.0).abs() < 1e-5, "{what}: {direction:?} {band}: {found}, not {expected}");
        }
    }
}

fn good(bytes: &[u8], how: &Interpretation, what: &str) -> Acquisition {
    read(bytes, how).unwrap_or_else(|error| panic!("{what}: {error}"))
}

fn quantity(quantity: StatedQuantity) -> Interpretation {
    Interpretation { quantity: Some(quantity), ..Interpretation::default() }
}

const WORDS: &str = "Einfallswinkel [°];Ausfallswinkel [°];Azimut [°]";
const MARKED: &str = "# radiometric-csv: 1\n# quantity: brdf\n# unit: 1/sr\n# cosine_included: false\n# angle_unit: deg\n\
                      # wavelength_unit: nm\n";

/// Names of columns: those of angles, and one of values for each band, with a text before and after the wavelength.
fn names(angles: &str, before: &str, after: &str) -> String {
    let separator = if angles.contains(';') { ';' } else { ',' };
    BANDS.iter().fold(angles.to_owned(), |names, band| format!("{names}{separator}{before}{band}{after}"))
}

fn as_measured(at: &[f64; 3]) -> Vec<f64> {
    at.to_vec()
}

/// A table in German under its usual names.
fn german() -> String {
    format!("{}\n{}", names(WORDS, "BRDF ", " nm [1/sr]"), rows(GERMAN, as_measured))
}

/// Tables of the hemisphere, each with a description and words that a note has.
fn tables() -> Vec<(&'static str, String, &'static str)> {
    let (semicolons, commas) = (rows(GERMAN, as_measured), rows(ENGLISH, as_measured));
    let radians = rows(GERMAN, |at| at.iter().map(|angle| angle.to_radians()).collect());
    let factors = Style { scale: std::f64::consts::PI, ..GERMAN };
    let percent = Style { scale: 100.0 * factors.scale, ..GERMAN };
    let brdf = |angles: &str| names(angles, "BRDF ", " nm");
    let reflectance = |after: &str| names("AOI;theta;phi", "R ", after);
    let numbered =
        semicolons.lines().enumerate().fold(String::new(), |all, (i, row)| format!("{all}{i};12:00;{row};gut\n"));
    vec![
        (
            "preamble",
            format!("Goniometer;Probe: Lack\nDatum;12.03.2026\n\n{}", german()),
            "theta_i `Einfallswinkel [°]`",
        ),
        (
            "French",
            format!("{}\n{semicolons}", brdf("Angle d'incidence (°);Angle de détection (°);Azimut (°)")),
            "no unit stated, taken as 1/sr",
        ),
        (
            "Portuguese",
            format!("{}\n{semicolons}", brdf("Ângulo de incidência;Ângulo de detecção;Azimute")),
            "no unit of the angles is stated",
        ),
        (
            "Italian, tabs",
            format!("{}\n{semicolons}", names("Angolo di incidenza;Angolo di osservazione;Azimut", "BRDF_", ""))
                .replace(';', "\t"),
            "`wavelength_unit` is not stated",
        ),
        ("symbols", format!("{}\n{commas}", brdf("Quelle θ,Detektor θ,Detektor φ")), "phi_o `Detektor φ`"),
        ("micrometres", format!("θi,θr,φr,fr(0.45 µm),fr(0.55 µm),fr(0.65 µm)\n{commas}"), "450 nm `fr(0.45 µm)`"),
        (
            "row of units",
            format!("{}\n°;°;°;1/sr;1/sr;1/sr\n{semicolons}", brdf("Einfall;Ausfall;Azimut")),
            "450 nm `BRDF 450 nm [1/sr]`",
        ),
        (
            "quotes",
            format!("\"Einfallswinkel, Quelle [°]\",\"theta_o\",{}\n{commas}", brdf("\"phi_o\"")),
            "theta_i `Einfallswinkel, Quelle [°]`",
        ),
        ("text below", format!("{}\nEnde;der Messung\nMeier\n", german()), "2 lines of text after the data"),
        (
            "names of numpy",
            format!("# {}\n{commas}", names("theta_i,theta_o,phi_o", "brdf_", "")).replace(',', " "),
            "450 nm `brdf_450`",
        ),
        ("radians", format!("{}\n{radians}", brdf("theta_i [rad];theta_o [rad];phi_o [rad]")), "angles in radians"),
        (
            "factors",
            format!("{}\n{}", names(WORDS, "Strahldichtefaktor ", " nm"), rows(factors, as_measured)),
            "reflectance factors, divided by π",
        ),
        (
            "percent",
            format!("{}\n{}", reflectance(" nm [%]"), rows(percent, as_measured)),
            "taken for a reflectance factor",
        ),
        (
            "percent signs",
            format!("{}\n{}", reflectance(" nm"), rows(Style { after: " %", ..percent }, as_measured)),
            "values in percent: divided by 100",
        ),
        (
            "unit in a line",
            format!(
                "# quantity: BRF\n# unit: %\n{}\n{}",
                names("AOI;theta;phi", "", " nm"),
                rows(percent, as_measured)
            ),
            "`unit` is taken for `value_unit`",
        ),
        (
            "other columns",
            format!("Nr;Zeit;{};Bemerkung\n{numbered}", names(WORDS, "BRDF ", " nm [1/sr]")),
            "`Bemerkung`",
        ),
        ("names again", format!("{0}{0}", german()), "measured more than once"),
        (
            "marked",
            format!("{MARKED}{}\n{semicolons}", names("theta_i;theta_o;phi_o", "v", "")),
            "`unit` is taken for `value_unit`",
        ),
        ("marked, in words", format!("{MARKED}{}\n{commas}", brdf(&WORDS.replace(';', ","))), "phi_o `Azimut [°]`"),
    ]
}

#[test]
fn tables_of_many_laboratories_are_the_same_hemisphere() {
    for (what, text, words) in tables() {
        let found = good(text.as_bytes(), &Interpretation::default(), what);
        check(&found, hemisphere(), what);
        let kinds = [NoteKind::Assumed, NoteKind::Skipped, NoteKind::Warning];
        assert!(kinds.iter().any(|&kind| has_note(&found, kind, words)), "{what}: {:?}", found.report.notes);
    }
    let bare = format!("{}\n{}", names("theta_i;theta_o;phi_o", "", ""), rows(GERMAN, as_measured));
    check(&good(bare.as_bytes(), &quantity(StatedQuantity::Brdf), "bare"), hemisphere(), "bare wavelengths");
    // Characters of Latin 1 have the same bytes in Windows-1252.
    let text = format!("Prüfling;Kunststoff\n{}", german());
    let latin: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    let found = good(&latin, &Interpretation::default(), "Windows-1252");
    check(&found, hemisphere(), "Windows-1252");
    assert_eq!(metadata(&found, "Prüfling"), "Kunststoff");
    let long = hemisphere().into_iter().flat_map(|at| (0..3).map(move |band| (at, band)));
    let long = long.fold("Wellenlänge / µm;AOI;Streuwinkel;Azimut;BRDF\n".to_owned(), |text, (at, band)| {
        format!("{text}{};{};{};{};{}\n", BANDS[band] / 1000.0, at[0], at[1], at[2], f(at, band))
    });
    check(&good(long.replace('.', ",").as_bytes(), &Interpretation::default(), "long"), hemisphere(), "long");
}

#[test]
fn angles_with_a_sign_lie_in_the_plane_of_incidence() {
    let directions = || plane().into_iter().map(of_plane);
    let side = |side| Interpretation { in_plane_sign: Some(side), ..Interpretation::default() };
    let table = |sign: f64| format!("{}\n{}", names("AOI;Detektor [°]", "BRDF ", " nm"), in_plane(GERMAN, sign));
    let found = good(table(1.0).as_bytes(), &Interpretation::default(), "signed");
    check(&found, directions(), "signed");
    assert!(has_note(&found, NoteKind::Assumed, "positive angles are on the mirror's side"));
    assert!(!has_note(&found, NoteKind::Warning, "source's side"));
    let turned = good(table(-1.0).as_bytes(), &side(InPlaneSign::Source), "turned");
    check(&turned, directions(), "turned");
    // A lobe on the side of the source is doubted.
    let doubted = good(table(-1.0).as_bytes(), &Interpretation::default(), "doubted");
    assert!(has_note(&doubted, NoteKind::Warning, "at 3 of 3 incidences"), "{:?}", doubted.report.notes);
    assert_eq!(at(&doubted, [20.0, 30.0, 0.0], 1), at(&found, [20.0, 30.0, 180.0], 1));
    let marked = format!("{MARKED}{}\n{}", names("theta_i,theta_o", "v", ""), in_plane(ENGLISH, 1.0));
    check(&good(marked.as_bytes(), &Interpretation::default(), "marked"), directions(), "marked");

    // Beside other azimuths the side of a sign is asked for.
    let mut planes = "AOI;theta;phi;BRDF 450 nm;BRDF 550 nm;BRDF 650 nm\n".to_owned();
    planes += &table_of_planes();
    let error = read(planes.as_bytes(), &Interpretation::default()).unwrap_err();
    assert!(error.kind == FormatErrorKind::NeedsOption && error.message.contains("in_plane_sign"), "{error}");
    let of_planes = hemisphere().into_iter().filter(|at| at[1] > 0.0);
    check(&good(planes.as_bytes(), &side(InPlaneSign::Mirror), "planes"), of_planes, "planes");
}

/// Rows of signed angles in planes that are turned by 0 to 150 degrees; positive angles at azimuth 0 lie on the
/// mirror's side.
fn table_of_planes() -> String {
    let at = |[theta_i, theta_o, phi_o]: [f64; 3]| {
        let (sign, phi) = if phi_o >= 180.0 { (1.0, phi_o - 180.0) } else { (-1.0, phi_o) };
        (vec![theta_i, sign * theta_o, phi], [theta_i, theta_o, phi_o])
    };
    table(GERMAN, hemisphere().into_iter().map(at))
}

#[test]
fn lines_before_a_table_may_state_the_incidence_and_the_wavelength() {
    let values: String = (0..108)
        .map(|i| hemisphere()[2 * 108 + i])
        .map(|at| format!("{};{};{}\n", at[1], at[2], f(at, 1)).replace('.', ","))
        .collect();
    let text = format!("Einfallswinkel: 35°\nWellenlänge: 550 nm\nWinkel [°];Azimut [°];BRDF [1/sr]\n{values}");
    let found = good(text.as_bytes(), &Interpretation::default(), "constants");
    assert!(has_note(&found, NoteKind::Assumed, "theta_i is 35 degrees in all rows"));
    assert!(has_note(&found, NoteKind::Assumed, "the wavelength is 550 nm"));
    for direction in hemisphere().into_iter().filter(|at| at[0] == 35.0) {
        assert!((at(&found, direction, 0) / f(direction, 1) - 1.0).abs() < 1e-5, "{direction:?}");
    }
    let text = text.replace("Wellenlänge: 550 nm\n", "");
    let found = good(text.as_bytes(), &Interpretation::default(), "no band");
    assert!(grid(&found).spectral.is_none() && has_note(&found, NoteKind::Assumed, "no wavelength is stated"));
}

#[test]
fn what_names_do_not_say_is_asked_for() {
    use FormatErrorKind::{Malformed, NeedsOption, Unsupported};
    let text = german();
    let plane = in_plane(GERMAN, 1.0);
    refused(&[
        (
            "no quantity",
            text.replace("BRDF ", ""),
            NeedsOption,
            line(1, 1),
            "whose values `450 nm [1/sr]`, `550 nm [1/sr]`, `650 nm [1/sr]` have no stated quantity, expected the option quantity",
        ),
        ("luminance", format!("AOI;Detektor [°];Leuchtdichte;x;y\n{plane}"), NeedsOption, line(1, 1), "`Leuchtdichte`"),
        (
            "two quantities",
            text.replacen("BRDF 650", "BTDF 650", 1),
            Unsupported,
            line(1, 1),
            "`BRDF 450 nm [1/sr]` (brdf), `BTDF 650 nm [1/sr]` (btdf)",
        ),
        (
            "replicates",
            format!("AOI;Detektor [°];BRDF_1;BRDF_2;BRDF_3\n{plane}"),
            Malformed,
            line(1, 1),
            "3 columns of values, `BRDF_1`, `BRDF_2`, `BRDF_3`, without their wavelengths",
        ),
        (
            "angles along the header",
            format!("Detektorwinkel;AOI 10°;AOI 20°\n{plane}"),
            Unsupported,
            line(1, 24),
            "2 columns of theta_i, `AOI 10°`, `AOI 20°`, expected one",
        ),
        (
            "relative azimuth",
            text.replace("Azimut [°]", "Relativer Azimut [°]"),
            Malformed,
            line(1, 1),
            "`Relativer Azimut [°]` is an angle whose zero or side is not known",
        ),
        (
            "radians unsaid",
            format!(
                "{}\n{}",
                names("theta_i;theta_o;phi_o", "BRDF ", " nm"),
                rows(GERMAN, |at| { at.iter().map(|angle| angle.to_radians()).collect() })
            ),
            NeedsOption,
            None,
            "which may be degrees or radians",
        ),
    ]);
}

#[test]
fn faults_of_rows_are_told_once_with_their_number() {
    use FormatErrorKind::Malformed;
    let text = german();
    let names_line = names(WORDS, "BRDF ", " nm [1/sr]");
    let row = |text: &str, row: &str| {
        let lines: Vec<&str> = text.lines().collect();
        [&lines[..30], &[row; 25][..], &lines[30..]].concat().join("\n")
    };
    refused(&[
        (
            "transmission",
            row(&text, "5;120;0;1;1;1"),
            Malformed,
            line(31, 3),
            "found `120`, expected an angle from 0 to 90 degrees (Ausfallswinkel [°]) (25 times, the last in line 55)",
        ),
        (
            "letter",
            row(&text, "5;1O;0;0,1;0,1;0,1"),
            Malformed,
            line(31, 3),
            "found `1O`, expected an angle from 0 to 90 degrees (Ausfallswinkel [°]) (25 times, the last in line 55)",
        ),
        (
            "text for a value",
            row(&text, "5;10;0;0,1;<0,1;0,1"),
            Malformed,
            line(31, 12),
            "found `<0,1`, expected a number, or nothing where it is missing (BRDF 550 nm [1/sr]) (25 times",
        ),
        (
            "short row",
            row(&text, "5;10;0;0,1"),
            Malformed,
            line(31, 1),
            "found 4 cells between `;`, expected 6, one for each column name (25 times, the last in line 55)",
        ),
        (
            "other decimal mark",
            row(&text, "5;10;0;0.1;0,1;0,1"),
            Malformed,
            line(31, 8),
            "found `0.1`, expected a decimal comma, as other numbers of the table have",
        ),
        (
            "decimal commas between commas",
            text.replace(';', ","),
            Malformed,
            line(2, 1),
            "found 9 cells between `,`, expected 6, one for each column name (a decimal comma separates cells",
        ),
        (
            "two tables",
            format!("{text}Probe 2\n{text}"),
            Malformed,
            line(434, 1),
            "found `Probe 2`, expected a row of numbers: rows go on below",
        ),
        (
            "negative uncertainty",
            format!("AOI;theta;phi;BRDF;u(BRDF);x\n{}", row(&text, "5;10;0;1;-1;1").replacen(&names_line, "# x", 1)),
            Malformed,
            line(32, 10),
            "found `-1`, expected an uncertainty, which is not negative (u(BRDF)) (25 times",
        ),
        (
            "percent of a BRDF",
            text.replace("[1/sr]", "[%]"),
            Malformed,
            line(1, 1),
            "value_unit `%`, expected a unit of a brdf",
        ),
    ]);
}

/// Name of a case, its text, and kind, place and words of the error with which it is refused.
type Refused = (&'static str, String, FormatErrorKind, Option<Position>, &'static str);

#[allow(clippy::unnecessary_wraps, reason = "a place as errors have it")]
fn line(line: usize, column: usize) -> Option<Position> {
    Some(Position::Text { line, column })
}

fn refused(cases: &[Refused]) {
    for (what, text, kind, position, words) in cases {
        let read = read(text.as_bytes(), &Interpretation::default());
        let error = read.map(|_| what).unwrap_err();
        assert_eq!(
            (error.kind, error.format, error.position),
            (*kind, "radiometric-csv", *position),
            "{what}: {error}"
        );
        assert!(error.message.contains(words) && !error.message.contains("wavelength_unit"), "{what}: {error}");
    }
}

#[test]
fn numbers_have_groups_signs_and_gaps() {
    let rows = [
        ("5", "−30", "1.234,5"),
        ("5", "30°", "2.000,25"),
        ("35", "-30", "---"),
        ("35", "30", "0,5"),
        ("35", "0", "n/a"),
    ];
    let text = rows.iter().fold("AOI [°];Detektor [°];BRDF [1/sr]\n".to_owned(), |text, (i, o, value)| {
        format!("{text}{i};{o};{value}\n")
    });
    let found = good(text.as_bytes(), &Interpretation::default(), "groups");
    assert_eq!(at(&found, [5.0, 30.0, 0.0], 0), 1234.5);
    assert_eq!(at(&found, [5.0, 30.0, 180.0], 0), 2000.25);
    assert!(at(&found, [35.0, 30.0, 0.0], 0).is_nan());
    let english = "\"AOI\",\"theta\",\"BRDF\"\n5,-30,\"1,234.5\"\n5,30,\"2,000.25\"\n35,30,0.5\n35,-30,NaN\n";
    let found = good(english.as_bytes(), &Interpretation::default(), "quoted groups");
    assert_eq!((at(&found, [5.0, 30.0, 0.0], 0), at(&found, [5.0, 30.0, 180.0], 0)), (1234.5, 2000.25));
}

#[test]
fn transmission_and_cosines_are_those_of_the_names() {
    let behind = |at: [f64; 3]| [at[0], 180.0 - at[1], at[2]];
    let text = rows(GERMAN, |at| behind(*at).to_vec());
    let text = format!("{}\n{text}", names("AOI;theta_t;phi_t", "BTDF ", " nm"));
    let found = good(text.as_bytes(), &Interpretation::default(), "BTDF");
    assert_eq!(found.quantity, Quantity::Btdf);
    for direction in hemisphere() {
        assert!((at(&found, behind(direction), 2) / f(direction, 2) - 1.0).abs() < 1e-5, "{direction:?}");
    }
    let cosine = "AOI;theta;phi;BRDF*cos 550 nm\n30;0;0;2\n30;60;0;2\n30;60;180;1\n";
    let found = good(cosine.as_bytes(), &Interpretation::default(), "cosine");
    assert!((at(&found, [30.0, 60.0, 0.0], 0) - 4.0).abs() < 1e-6 && has_note(&found, NoteKind::Assumed, "cosine"));
}

#[test]
fn the_material_of_a_german_table_keeps_the_promise_at_the_measured_directions() {
    let bytes = file("tests/fixtures/goniometers/hemisphere_de.csv");
    let input = Input { bytes: &bytes, spectrum: None, interpretation: &Interpretation::default() };
    let source = read_source(&input).unwrap();
    check(&source.acquisition, hemisphere(), "hemisphere_de.csv");
    let outcome = source.compress(&Request::er_l2(0.01)).unwrap();
    let material = Material::open(&outcome.bytes).unwrap();
    let mut error = 0.0;
    for direction in hemisphere() {
        let [theta_i, theta_o, phi_o] = direction;
        let (wi, wo) = (Direction::from_degrees(theta_i, 0.0), Direction::from_degrees(theta_o, phi_o));
        let mut values = [0.0; 3];
        material
            .evaluate(Place { index: &[], wi: Some(wi), wo: Some(wo) }, Interpolation::default(), &mut values)
            .unwrap();
        for (band, value) in values.iter().enumerate() {
            error += (f64::from(*value) / f(direction, band) - 1.0).powi(2);
        }
    }
    let error = (error / (3 * hemisphere().len()) as f64).sqrt();
    assert!(error <= 0.01 && (error / outcome.report.errors.er_l2 - 1.0).abs() < 0.01, "{error}");
    let plane = fixture("tests/fixtures/goniometers/plane_de.csv");
    check(&plane, self::plane().into_iter().map(of_plane), "plane_de.csv");
}
