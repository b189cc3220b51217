//! Files of few numbers, and matter whose functions are known.

use crate::domain::Quantity;
use crate::formats::{
    Acquisition, AngleGrid, FormatError, FormatErrorKind, Interpretation, LitSide, Position, Samples, read,
};

/// File with one function for each of the given `(band, direction, values)`, under a definition.
fn file(definition: &str, bases: &str, functions: &[(&str, &str, String)]) -> String {
    let functions: Vec<String> = functions
        .iter()
        .map(|(band, direction, values)| {
            format!(
                "<WavelengthData><LayerNumber>System</LayerNumber><Wavelength unit=\"Integral\">{band}</Wavelength>\
                 <WavelengthDataBlock><WavelengthDataDirection>{direction}</WavelengthDataDirection>{bases}\
                 <ScatteringDataType>BTDF</ScatteringDataType><ScatteringData>{values}</ScatteringData>\
                 </WavelengthDataBlock></WavelengthData>\n"
            )
        })
        .collect();
    format!(
        "<?xml version=\"1.0\"?>\n<WindowElement xmlns=\"http://windows.lbl.gov\"><Optical><Layer><Material>\
         <Name>A &amp; B</Name><Thickness unit=\"mm\">1</Thickness></Material><DataDefinition>{definition}</DataDefinition>\
         {}</Layer></Optical></WindowElement>\n",
        functions.concat()
    )
}

const QUARTER: &str =
    "<ColumnAngleBasis>LBNL/Klems Quarter</ColumnAngleBasis><RowAngleBasis>LBNL/Klems Quarter</RowAngleBasis>";
const COLUMNS: &str = "<IncidentDataStructure>Columns</IncidentDataStructure>";
const ROWS: &str = "<IncidentDataStructure>Rows</IncidentDataStructure>";
/// Rings of the quarter basis: bounds in degrees, and numbers of patches.
const RINGS: [(f64, f64, usize); 5] =
    [(0.0, 9.0, 1), (9.0, 27.0, 8), (27.0, 45.0, 12), (45.0, 63.0, 12), (63.0, 90.0, 8)];

/// Values of a made-up quarter matrix: outgoing patch o under incident patch i.
fn value(i: usize, o: usize) -> f64 {
    0.01 + 0.001 * i as f64 + 0.000_1 * (o * o % 37) as f64
}

fn quarter() -> String {
    (0..41 * 41).map(|at| format!("{},", value(at % 41, at / 41))).collect::<Vec<_>>().concat()
}

fn with(text: &str, how: &Interpretation) -> Result<Acquisition, FormatError> {
    read(text.as_bytes(), how)
}

fn plain(text: &str) -> Result<Acquisition, FormatError> {
    with(text, &Interpretation::default())
}

fn grid(acquisition: &Acquisition) -> &AngleGrid {
    match &acquisition.samples {
        Samples::Grid(grid) => grid,
        other => panic!("{other:?}"),
    }
}

/// Sample nearest to a pair of directions, each `[theta, phi]` in degrees.
fn at(grid: &AngleGrid, wi: [f64; 2], wo: [f64; 2]) -> f32 {
    let (incoming, outgoing) = (grid.incoming.as_ref().unwrap(), grid.outgoing.as_ref().unwrap());
    let nearest = |list: &[f64], x: f64, around: f64| {
        let distance = |y: f64| (y - x).abs().min(around - (y - x).abs());
        (0..list.len()).min_by(|&a, &b| distance(list[a]).total_cmp(&distance(list[b]))).unwrap()
    };
    let index = |angles: &crate::formats::Angles, [theta, phi]: [f64; 2]| {
        let azimuths = &angles.phi.as_ref().unwrap().phi;
        nearest(&angles.theta, theta, 1e9) * azimuths.len() + nearest(azimuths, phi, 360.0)
    };
    let directions = outgoing.theta.len() * outgoing.phi.as_ref().unwrap().phi.len();
    grid.values[index(incoming, wi) * directions + index(outgoing, wo)]
}

/// Centres of the patches of the quarter basis.
fn patches() -> Vec<[f64; 2]> {
    let ring = |&(low, high, count): &(f64, f64, usize)| {
        let theta = if count == 1 { 0.0 } else { 0.5 * (low + high) };
        (0..count).map(move |k| [theta, 360.0 * k as f64 / count as f64])
    };
    RINGS.iter().flat_map(ring).collect()
}

#[test]
fn patches_keep_their_values() {
    let text = file(COLUMNS, QUARTER, &[("Visible", "Reflection Front", quarter())]);
    let acquisition = plain(&text).unwrap();
    assert_eq!((acquisition.format, acquisition.quantity), ("bsdf-xml", Quantity::Brdf));
    assert!(
        acquisition.dialect.contains("41 × 41 patches (LBNL/Klems Quarter), Visible, reflection, light from front")
    );
    assert_eq!(acquisition.report.metadata[0], ("Name".to_owned(), "A & B".to_owned()));
    assert_eq!(acquisition.report.metadata[1], ("Thickness".to_owned(), "1 mm".to_owned()));
    let grid = grid(&acquisition);
    for (i, &[theta_i, phi_i]) in patches().iter().enumerate() {
        for (o, &[theta_o, phi_o]) in patches().iter().enumerate() {
            // Near the centre of the outgoing patch there is no node: the corners of the patch have its value.
            let (low, high, count) =
                RINGS[RINGS.iter().position(|ring| theta_o >= ring.0 && theta_o < ring.1).unwrap()];
            for theta in [low, high] {
                let inside = theta + (theta_o - theta).signum() * 1e-5;
                for phi in [phi_o - 180.0 / count as f64 + 1e-5, phi_o + 180.0 / count as f64 - 1e-5] {
                    // WINDOW's azimuths, as seen from the other side; light comes from where it does not go.
                    let found = at(grid, [theta_i, (360.0 - phi_i) % 360.0], [inside, (540.0 - phi) % 360.0]);
                    assert!((f64::from(found) - value(i, o)).abs() < 1e-7, "{i} {o} {theta} {phi}: {found}");
                }
            }
        }
    }
}

#[test]
fn rows_are_columns_turned() {
    let text = |definition, values| file(definition, QUARTER, &[("Visible", "Transmission Back", values)]);
    let turned = (0..41 * 41).map(|at| format!("{} ", value(at / 41, at % 41))).collect::<Vec<_>>().concat();
    let (columns, rows) = (plain(&text(COLUMNS, quarter())).unwrap(), plain(&text(ROWS, turned)).unwrap());
    assert_eq!(grid(&columns).values[..], grid(&rows).values[..]);
    assert_eq!(columns.quantity, Quantity::Btdf);
    let outgoing = grid(&columns).outgoing.as_ref().unwrap();
    assert_eq!((outgoing.covers, outgoing.theta[0], outgoing.theta[9]), ((90.0, 180.0), 90.0, 180.0));
    // Straight through: patch 5 of the second ring, in propagation from azimuth 180 to 0.
    let found = at(grid(&columns), [18.0, 180.0], [180.0 - 18.0, 10.0]);
    assert!((f64::from(found) - value(1, 1)).abs() < 1e-7, "{found}");
}

/// Value of a sample of glass or metal for light from one direction to another, both unit vectors away from it in the
/// axes of WINDOW: +z indoors, +y up, +x to the right as seen from indoors.
type Sample = fn([f64; 3], [f64; 3]) -> f64;

/// Samples whose functions are known: a mirror and clear glass, a retroreflector, a diffuser, and slats that send light
/// upwards and to the left.
const SAMPLES: [Sample; 4] = [
    |[x, y, z], [a, b, c]| f64::from((x + a).abs() + (y + b).abs() + (z.abs() - c.abs()).abs() < 1e-6),
    |[x, y, z], [a, b, c]| f64::from((x - a).abs() + (y - b).abs() + (z.abs() - c.abs()).abs() < 1e-6),
    |_, _| 0.5 / std::f64::consts::PI,
    |[x, y, _], [a, b, _]| 0.2 + 0.05 * b - 0.03 * a + 0.02 * y * a + 0.01 * x * b,
];

/// Combinations of the side of the light and of transmission with their names in a file.
const FUNCTIONS: [(&str, LitSide, bool); 4] = [
    ("Transmission Front", LitSide::Front, true),
    ("Transmission Back", LitSide::Back, true),
    ("Reflection Front", LitSide::Front, false),
    ("Reflection Back", LitSide::Back, false),
];

/// Angles in degrees of a direction in WINDOW's axes, where +z points to the light, +y up and +x to the right.
fn seen_from([x, y, z]: [f64; 3], side: LitSide) -> [f64; 2] {
    let [x, z] = if side == LitSide::Front { [-x, -z] } else { [x, z] };
    [z.clamp(-1.0, 1.0).acos().to_degrees(), y.atan2(x).to_degrees().rem_euclid(360.0)]
}

/// Directions from which light comes and to which it leaves that have the polar angles and azimuths of WINDOW's
/// patches.
fn pair([theta_i, phi_i]: [f64; 2], [theta_o, phi_o]: [f64; 2], side: LitSide, transmits: bool) -> [[f64; 3]; 2] {
    let of = |theta: f64, phi: f64, turn: f64| {
        let [theta, phi] = [theta, phi].map(f64::to_radians);
        [turn * theta.sin() * phi.cos(), turn * theta.sin() * phi.sin(), theta.cos()]
    };
    let lit = if side == LitSide::Front { -1.0 } else { 1.0 };
    let [[x, y, z], [a, b, c]] = [of(theta_i, phi_i, -1.0), of(theta_o, phi_o, 1.0)];
    [[x, y, lit * z], [a, b, if transmits { -lit * c } else { lit * c }]]
}

#[test]
fn samples_of_known_matter_are_what_they_are() {
    let patches = patches();
    for (number, sample) in SAMPLES.iter().enumerate() {
        for (direction, side, transmits) in FUNCTIONS {
            let of = |i: usize, o: usize| {
                let [from, to] = pair(patches[i], patches[o], side, transmits);
                sample(from, to)
            };
            let values = (0..41 * 41).map(|at| format!("{:.7} ", of(at % 41, at / 41))).collect::<Vec<_>>().concat();
            let acquisition = plain(&file(COLUMNS, QUARTER, &[("Visible", direction, values)])).unwrap();
            let grid = grid(&acquisition);
            for (i, o) in (0..41 * 41).map(|at| (at % 41, at / 41)) {
                let [wi, wo] = pair(patches[i], patches[o], side, transmits).map(|vector| seen_from(vector, side));
                let found = f64::from(at(grid, wi, wo));
                assert!((found - of(i, o)).abs() < 1e-6, "{number} {direction} {wi:?} {wo:?}: {found}");
                // A mirror and clear glass keep the polar angle and turn the azimuth by 180 degrees, a retroreflector
                // sends light back.
                let turned = (wo[1] - wi[1]).rem_euclid(360.0);
                let is_at = |azimuth: f64| wi[0] < 1e-6 || (turned - azimuth).abs() < 1e-6;
                let same = (wi[0] - wo[0].min(180.0 - wo[0])).abs() < 1e-6;
                match number {
                    0 => assert_eq!(found == 1.0, same && is_at(180.0), "{wi:?} {wo:?}"),
                    1 => assert_eq!(found == 1.0, same && (is_at(0.0) || is_at(360.0)), "{wi:?} {wo:?}"),
                    _ => {}
                }
            }
        }
    }
}

#[test]
fn trees_of_known_matter_are_what_they_are() {
    // The middle of the disk's cell that a cell of the unit square stands for (Shirley and Chiu), with 8 cells a side.
    let disk = |column: usize, row: usize| {
        let [a, b] = [column, row].map(|cell| (2 * cell + 1) as f64 / 8.0 - 1.0);
        let (radius, angle) = if a.abs() > b.abs() {
            (a, std::f64::consts::FRAC_PI_4 * b / a)
        } else {
            (b, std::f64::consts::FRAC_PI_2 - std::f64::consts::FRAC_PI_4 * a / b)
        };
        [radius.abs().asin().to_degrees(), (radius * angle.sin()).atan2(radius * angle.cos()).to_degrees()]
    };
    let slats = SAMPLES[3];
    for (direction, side, transmits) in FUNCTIONS {
        let cells = (0..4096).map(|cell| [cell >> 9, cell >> 6 & 7, cell >> 3 & 7, cell & 7]);
        let pairs: Vec<[[f64; 3]; 2]> =
            cells.map(|[a, b, c, d]| pair(disk(a, b), disk(c, d), side, transmits)).collect();
        let values = pairs.iter().map(|[from, to]| format!("{:.7} ", slats(*from, *to))).collect::<Vec<_>>().concat();
        let acquisition = tree("TensorTree4", direction, &format!("{{{values}}}"));
        for [from, to] in pairs {
            let found = evaluated(&acquisition, seen_from(from, side), seen_from(to, side));
            assert!((found - slats(from, to)).abs() < 1e-6, "{direction} {from:?} {to:?}: {found}");
        }
    }
}

#[test]
fn functions_are_chosen_and_never_guessed() {
    let q = quarter();
    let text = file(
        COLUMNS,
        QUARTER,
        &[
            ("Visible", "Transmission Front", q.clone()),
            ("Visible", "Reflection Front", q.clone()),
            ("Visible", "Reflection Back", q.clone()),
            ("Solar", "Reflection Front", q),
        ],
    );
    let error = plain(&text).unwrap_err();
    assert_eq!(error.kind, FormatErrorKind::NeedsOption);
    for word in ["band (Visible or Solar)", "option side, that of the light (front or back)", "Solar reflection front"]
    {
        assert!(error.message.contains(word), "{error}");
    }
    let how = |quantity: Option<Quantity>, side, band: Option<&str>| Interpretation {
        quantity: quantity.map(Into::into),
        side,
        band: band.map(str::to_owned),
        ..Interpretation::default()
    };
    let (front, back) = (Some(LitSide::Front), Some(LitSide::Back));
    let both = with(&text, &how(None, front, Some("visible"))).unwrap();
    assert_eq!(both.quantity, Quantity::Bsdf);
    let outgoing = grid(&both).outgoing.as_ref().unwrap();
    assert_eq!((outgoing.theta.len(), outgoing.covers), (20, (0.0, 180.0)));
    for (quantity, side, band, found) in [
        (Some(Quantity::Btdf), None, None, Quantity::Btdf),
        (Some(Quantity::Bsdf), front, Some("Visible"), Quantity::Bsdf),
        (None, back, None, Quantity::Brdf),
        (None, None, Some("Solar"), Quantity::Brdf),
    ] {
        assert_eq!(with(&text, &how(quantity, side, band)).unwrap().quantity, found);
    }
    for (quantity, side, band, words) in [
        (Some(Quantity::Btdf), back, None, "no function of quantity btdf, side back"),
        (None, None, Some("NIR"), "no function of band NIR"),
        (Some(Quantity::Bsdf), back, None, "expected reflection and transmission"),
        (Some(Quantity::Edf), None, None, "expected brdf, btdf or bsdf"),
        (Some(Quantity::Brdf), None, Some("Visible"), "give the option side, that of the light (front or back)"),
    ] {
        let error = with(&text, &how(quantity, side, band)).unwrap_err();
        assert!(error.kind == FormatErrorKind::NeedsOption && error.message.contains(words), "{error}");
    }
}

#[test]
fn a_note_of_the_tool_before_the_declaration_is_skipped() {
    let text = file(COLUMNS, QUARTER, &[("Visible", "Reflection Front", quarter())]);
    let acquisition = plain(&format!("Recover using: genBSDF -recover /tmp/x\n{text}")).unwrap();
    assert!(acquisition.report.notes.iter().any(|note| note.message.contains("1 line of text before")));
    let bare = text.replace(QUARTER, "");
    let error = plain(&format!("Recover using: genBSDF -recover /tmp/x\n{bare}")).unwrap_err();
    assert!(error.format == "bsdf-xml" && error.message.contains("ColumnAngleBasis"), "{error}");
    assert!(matches!(error.position, Some(Position::Text { line: 3, .. })), "{error}");
}

#[test]
fn bases_of_the_file_come_before_those_of_their_names() {
    let block = |low: f64, high: f64, count: usize, theta: f64| {
        format!(
            "<AngleBasisBlock><Theta>{theta}</Theta><nPhis>{count}</nPhis><ThetaBounds><LowerTheta>{low}</LowerTheta>\
             <UpperTheta>{high}</UpperTheta></ThetaBounds></AngleBasisBlock>"
        )
    };
    let definition = |name: &str, blocks: &[String]| {
        format!("{COLUMNS}<AngleBasis><AngleBasisName>{name}</AngleBasisName>{}</AngleBasis>", blocks.concat())
    };
    let named = |name: &str| QUARTER.replace("LBNL/Klems Quarter", name);
    let values = |count: usize| "0.1 ".repeat(count);
    let own = definition("mine", &[block(0.0, 30.0, 1, 0.0), block(30.0, 90.0, 4, 50.0)]);
    let text = |definition: &str, name: &str, count: usize| {
        file(definition, &named(name), &[("Visible", "Reflection Front", values(count))])
    };
    let found = plain(&text(&own, "mine", 25)).unwrap();
    assert_eq!(grid(&found).incoming.as_ref().unwrap().theta, [0.0, 50.0]);
    assert_eq!(grid(&found).outgoing.as_ref().unwrap().phi.as_ref().unwrap().phi.len(), 8);
    let unlike = definition("LBNL/Klems Quarter", &[block(0.0, 30.0, 1, 0.0), block(30.0, 90.0, 4, 50.0)]);
    let found = plain(&text(&unlike, "LBNL/Klems Quarter", 25)).unwrap();
    assert!(found.report.notes.iter().any(|note| note.message.contains("other rings of `LBNL/Klems Quarter`")));
    // Two half bases have one name: the number of values tells them apart.
    for count in [77, 73] {
        let found = plain(&text(COLUMNS, "LBNL/Klems Half", count * count)).unwrap();
        assert!(found.dialect.contains(&format!("{count} × {count} patches")), "{}", found.dialect);
    }
    assert!(plain(&text(COLUMNS, "LBNL/Klems Full", 145 * 145)).is_ok());
    let named_alone = definition("LBNL/Klems Full", &[]);
    assert!(plain(&text(&named_alone, "LBNL/Klems Full", 145 * 145)).unwrap().dialect.contains("145 × 145 patches"));
    for (definition, name, count, words) in [
        (COLUMNS.to_owned(), "LBNL/Klems Half", 145 * 145, "expected 77 × 77 or 73 × 73"),
        (COLUMNS.to_owned(), "LBNL/Klems Full", 145 * 145 - 1, "21024 numbers, expected 145 × 145"),
        (COLUMNS.to_owned(), "mine", 25, "which the file does not define"),
        (definition("mine", &[block(0.0, 30.0, 1, 0.0)]), "mine", 1, "ends at 30 degrees, expected 90"),
        (definition("mine", &[block(0.0, 30.0, 1, 0.0), block(40.0, 90.0, 4, 50.0)]), "mine", 25, "starts at 30"),
        (definition("mine", &[block(0.0, 90.0, 0, 0.0)]), "mine", 1, "expected 1 to 360"),
        (definition("mine", &[]), "mine", 1, "no AngleBasisBlock"),
    ] {
        let error = plain(&text(&definition, name, count)).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
    }
}

#[test]
fn refusals_name_what_is_wrong() {
    let one = |structure: &str, values: &str| {
        file(
            &format!("<IncidentDataStructure>{structure}</IncidentDataStructure>"),
            QUARTER,
            &[("Visible", "Reflection Front", values.to_owned())],
        )
    };
    let tree = |values: &str| {
        let text = one("TensorTree3", values);
        text.replace(QUARTER, "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>")
    };
    let twice = [("Visible", "Reflection Front", quarter()), ("visible", "Reflection Front", quarter())];
    for (text, words) in [
        (one("Columns", "1 2 x"), "found `x`, expected a value in 1/sr"),
        (one("Columns", "1 <!-- 2 --> 3"), "found `<!--`"),
        (one("Columns", "1 1e39"), "within the range of float32"),
        (one("Diagonal", "1"), "IncidentDataStructure `Diagonal`"),
        (one("TensorTree4", "{1}"), "AngleBasis nothing of a tensor tree"),
        (tree("{ {1} }"), "expected `{`"),
        (tree("{1 2}"), "2 values in one node of a tensor tree, expected 1, 8, 64 …"),
        (tree("{1} 2"), "found `2` after the tree"),
        (tree("{1 2 3 4 5 6 7 8"), "expected `}`"),
        (tree("{x}"), "found `x`, expected a value"),
        (tree("{1e39}"), "within the range of float32"),
        (tree(""), "expected `{`"),
        (tree(&"{".repeat(10_000)), "inside 12 others"),
        (file(COLUMNS, QUARTER, &twice), "visible reflection front a second time"),
        (
            file(COLUMNS, QUARTER, &[("Visible", "Sideways", String::new())]),
            "no function of a known direction (`Sideways`)",
        ),
        ("<WindowElement><Optical/></WindowElement>".to_owned(), "no element Optical/Layer with WavelengthData"),
        ("<WindowElement><Optical>".to_owned(), "ends inside the element `Optical`"),
        ("<!DOCTYPE x><WindowElement/>".to_owned(), "a document type"),
        ("<WindowElement>&x;</WindowElement>".to_owned(), "entity `x`"),
        ("<WindowElement/><b/>".to_owned(), "the element `b`, expected one WindowElement"),
        (format!("<WindowElement>{}", "<a>".repeat(100)), "inside 16 others"),
    ] {
        let error = plain(&text).unwrap_err();
        assert!(error.format == "bsdf-xml" && error.to_string().contains(words), "{words}: {error}");
    }
    let how = Interpretation { unit: Some(crate::domain::Unit::Candela), ..Interpretation::default() };
    assert!(with(&one("Columns", "1"), &how).unwrap_err().message.contains("expected 1/sr"));
}

/// Value of a tree's function at a pair of directions in degrees.
fn evaluated(acquisition: &Acquisition, wi: [f64; 2], wo: [f64; 2]) -> f64 {
    let Samples::Function(modelled) = &acquisition.samples else { panic!("a function") };
    let direction = |[theta, phi]: [f64; 2]| crate::domain::Direction::from_degrees(theta, phi);
    let mut found = [0.0];
    modelled.function.evaluate(direction(wi), direction(wo), &mut found);
    found[0]
}

fn tree(structure: &str, direction: &str, values: &str) -> Acquisition {
    let definition = format!("<IncidentDataStructure>{structure}</IncidentDataStructure>");
    let basis = "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>";
    plain(&file(&definition, basis, &[("Visible", direction, values.to_owned())])).unwrap()
}

#[test]
fn trees_count_children_and_cells_in_opposite_orders() {
    // Rank 4, one halving: quadrants of the direction opposite to the light, then of the outgoing direction. In a grid
    // of cells the last dimension varies fastest.
    let cells = (0..16).map(|i| format!("{i} ")).collect::<Vec<_>>().concat();
    let grid = tree("TensorTree4", "Reflection Back", &format!("{{{cells}}}"));
    // Light from azimuth 225 travels towards 45: halves 1, 1; outgoing at 135: x below, y above the middle.
    assert_eq!(evaluated(&grid, [45.0, 225.0], [45.0, 135.0]), f64::from(8 + 4 + 1));
    let branches = (0..16).map(|i| format!("{{{i}}} ")).collect::<Vec<_>>().concat();
    let branched = tree("TensorTree4", "Reflection Back", &format!("{{{branches}}}"));
    assert_eq!(evaluated(&branched, [45.0, 225.0], [45.0, 135.0]), f64::from(1 + 2 + 8));
    for (found, expected) in [(&grid, 3), (&branched, 12)] {
        assert_eq!(evaluated(found, [45.0, 45.0], [45.0, 45.0]), f64::from(expected));
    }
}

#[test]
fn isotropic_trees_turn_with_the_light() {
    // Rank 3, one halving: half of 0.5 - 0.5 sin theta, then the quadrants of the outgoing direction.
    let found = tree("TensorTree3", "Transmission Front", "{0 1 2 3 4 5 6 7}");
    for phi in [0.0, 70.0, 200.0] {
        // Opposite to the light and 45 degrees further as seen from indoors: both coordinates above the middle.
        assert_eq!(evaluated(&found, [30.0, phi], [150.0, phi + 135.0]), 3.0, "{phi}");
        assert_eq!(evaluated(&found, [30.0, phi], [150.0, phi + 225.0]), 2.0);
        assert!(evaluated(&found, [30.0, phi], [30.0, phi]).is_nan());
        assert!(evaluated(&found, [0.0, phi], [150.0, phi]) < 4.0);
    }
    assert_eq!(found.quantity, Quantity::Btdf);
}
