//! Colours against identities and colour-science; pictures that decode, have their size, and are the same every time.

use super::*;
use crate::domain::colour::{ColourError, Illuminant, StandardObserver, linear_to_bytes};
use crate::domain::{Direction, Domain, Measurement, Sampling, Tensor, TriangleMesh, Unit, WavelengthGrid};
use crate::evaluate::{EvaluateError, QueryError};
use std::f32::consts::{FRAC_1_PI, PI};

fn triangles(domain: Domain, level: u8) -> Axis {
    Axis::Triangles(TriangleMesh::new(domain, level).unwrap())
}

fn visible() -> Axis {
    Axis::Wavelength(WavelengthGrid::even(380.0, 10.0, 41).unwrap())
}

fn index(count: usize) -> Axis {
    Axis::Index { count, labels: (0..count).map(|i| format!("column {i}")).collect() }
}

fn material(quantity: Quantity, unit: Unit, axes: Vec<Axis>, sample: impl Fn(usize) -> f32) -> Material {
    let count: usize = axes.iter().map(Axis::len).product();
    let tensor = Tensor::new(axes, (0..count).map(sample).collect()).unwrap();
    Material::of(Measurement::new(quantity, unit, Sampling::Point, tensor).unwrap()).unwrap()
}

fn diffuser(quantity: Quantity, outgoing: Domain) -> Material {
    let axes = vec![triangles(Domain::Hemisphere, 1), triangles(outgoing, 2), visible()];
    material(quantity, Unit::PerSteradian, axes, |_| FRAC_1_PI)
}

fn sized(size: usize) -> Look<'static> {
    Look { size, ..Look::default() }
}

fn red(i: usize) -> f32 {
    if i % 41 > 22 { 0.8 } else { 0.05 }
}

fn up(theta: f64) -> Option<Direction> {
    (theta >= 0.0).then(|| Direction::from_degrees(theta, 20.0))
}

fn viewings() -> impl Iterator<Item = Viewing> {
    let all = Illuminant::ALL.iter();
    all.flat_map(|&light| StandardObserver::ALL.iter().map(move |&eye| Viewing::standard(light, eye)))
}

fn only(material: &Material, question: &Question<'_>, viewing: &Viewing) -> Colour {
    let found = colours(material, question, viewing).unwrap();
    assert_eq!(found.colours.len(), 1);
    found.colours[0].clone().unwrap()
}

#[test]
fn the_perfect_diffuser_is_white_in_any_light_to_any_eye() {
    let white = diffuser(Quantity::Brdf, Domain::Hemisphere);
    for viewing in viewings() {
        for wo in [None, up(50.0)] {
            let question = Question { index: None, wi: up(30.0), wo };
            let found = only(&white, &question, &viewing);
            assert!((found.lab[0] - 100.0).abs() < 1e-2 && found.lab[1].abs() < 1e-2, "{found:?}");
            assert_eq!((found.srgb.as_str(), found.in_gamut), ("#ffffff", true), "{found:?}");
        }
    }
    let albedo = colours(&white, &Question::default(), &Viewing::default()).unwrap();
    assert_eq!(
        (albedo.of, albedo.illuminant.as_str(), albedo.observer.as_str()),
        ("directional albedo", "D65", "1931")
    );
    let phase = diffuser(Quantity::Phase, Domain::Sphere);
    let question = Question { index: None, wi: up(10.0), wo: up(99.0) };
    assert!((only(&phase, &question, &Viewing::default()).xyz[1] - 400.0).abs() < 1e-3, "4π/π");
}

#[test]
fn patches_have_the_colours_of_colour_science_and_their_names() {
    let golden: serde_json::Value =
        serde_json::from_str(include_str!("../../../../tests/golden/colour_science.json")).unwrap();
    let text = include_str!("../../../../data/colorchecker_n_ohta.csv");
    let rows: Vec<Vec<f32>> =
        text.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    let grid = Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, 81).unwrap());
    let checker = material(Quantity::Reflectance, Unit::One, vec![index(24), grid], |i| rows[i % 81][1 + i / 81]);
    for (viewing, wanted) in [
        (Viewing::default(), &golden["patches"]["D65"]),
        (Viewing::standard(Illuminant::F11, StandardObserver::Cie1931), &golden["patches"]["F11"]),
    ] {
        let found = colours(&checker, &Question::default(), &viewing).unwrap();
        assert_eq!((found.of, found.colours.len()), ("reflectance", 24));
        for (k, colour) in found.colours.iter().enumerate() {
            let colour = colour.as_ref().unwrap();
            assert_eq!((colour.index.as_slice(), colour.label.clone()), (&[k][..], Some(format!("column {k}"))));
            for i in 0..3 {
                let (xyz, lab) = (wanted[k]["xyz"][i].as_f64().unwrap(), wanted[k]["lab"][i].as_f64().unwrap());
                assert!((colour.xyz[i] - xyz).abs() < 1e-6 * xyz && (colour.lab[i] - lab).abs() < 1e-5, "patch {k}");
            }
            assert!((colour.cct, colour.luminous) == (None, None));
        }
    }
    // Cyan of the chart is the one that sRGB does not hold.
    let found = colours(&checker, &Question::default(), &Viewing::default()).unwrap();
    let outside: Vec<usize> = (0..24).filter(|&k| !found.colours[k].as_ref().unwrap().in_gamut).collect();
    assert_eq!(outside, [17]);
    let one = only(&checker, &Question { index: Some(&[14]), ..Question::default() }, &Viewing::default());
    let [r, g, b] = linear_to_bytes(one.mapped_srgb);
    assert_eq!(one.srgb, format!("#{r:02x}{g:02x}{b:02x}"));
    assert!(r > 150 && g < 80 && b < 80, "red is red: {}", one.srgb);
}

#[test]
fn lights_have_temperatures_and_lumens() {
    let power = Illuminant::A.power();
    let lambda = |i: usize| 380.0 + 10.0 * (i % 41) as f64;
    let axes = || vec![triangles(Domain::Sphere, 1), visible()];
    let lamp = |unit| material(Quantity::Edf, unit, axes(), |i| 1e-3 * power.at(lambda(i)) as f32);
    let flux = only(&lamp(Unit::WattPerSteradianNanometre), &Question::default(), &Viewing::default());
    assert!((flux.cct.unwrap() - 2855.7).abs() < 3.0 && flux.duv.unwrap().abs() < 1e-4, "{flux:?}");
    assert!((flux.xyz[1] - 100.0).abs() < 1e-9);
    let toward = Question { wo: up(120.0), ..Question::default() };
    let intensity = only(&lamp(Unit::WattPerSteradianNanometre), &toward, &Viewing::default());
    let round = f64::from(4.0 * PI);
    assert!((flux.luminous.unwrap() / intensity.luminous.unwrap() - round).abs() < 1e-3);
    let milli = only(&lamp(Unit::MilliwattPerSteradianNanometre), &toward, &Viewing::default());
    assert!((milli.luminous.unwrap() * 1000.0 / intensity.luminous.unwrap() - 1.0).abs() < 1e-9);
    assert_eq!(only(&lamp(Unit::RelativePerNanometre), &toward, &Viewing::default()).luminous, None);
    // Photons of the same light are the same light.
    let photons = material(Quantity::Edf, Unit::MicromolePerSecondSteradianNanometre, axes(), |i| {
        (1e-3 * power.at(lambda(i)) * lambda(i) / 119.626_565_8) as f32
    });
    let photons = only(&photons, &toward, &Viewing::default());
    assert!((photons.luminous.unwrap() / intensity.luminous.unwrap() - 1.0).abs() < 1e-6);
    assert!((photons.cct.unwrap() - intensity.cct.unwrap()).abs() < 0.1);
    // Beside its own white it is white, beside daylight it is orange.
    let a = Viewing::standard(Illuminant::A, StandardObserver::Cie1931);
    let [r, _, b] = only(&lamp(Unit::RelativePerNanometre), &toward, &a).linear_srgb;
    assert!(
        (r - b).abs() < 1e-2
            && (intensity.linear_srgb[0] - 1.0).abs() < 1e-6
            && intensity.linear_srgb[0] > 2.0 * intensity.linear_srgb[2]
    );
}

#[test]
fn any_table_is_a_light_or_an_eye() {
    let power = Illuminant::F11.power();
    let fine = Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, 81).unwrap());
    let table = |columns: Vec<Axis>, sample: &dyn Fn(usize, f64) -> f64| {
        let count: usize = columns.iter().map(Axis::len).product();
        let samples = (0..count * 81).map(|i| sample(i / 81, 380.0 + 5.0 * (i % 81) as f64) as f32).collect();
        Tensor::new([columns, vec![fine.clone()]].concat(), samples).unwrap()
    };
    let tubes = table(vec![index(2)], &|column, lambda| if column == 1 { power.at(lambda) } else { 1.0 });
    let patch = material(Quantity::Reflectance, Unit::One, vec![visible()], red);
    let known = Viewing::standard(Illuminant::F11, StandardObserver::Cie1931);
    let wanted = only(&patch, &Question::default(), &known).xyz;
    for column in ["2", "column 1"] {
        let own = Viewing::default().under("tubes.csv", &tubes, Some(column)).unwrap();
        assert_eq!(own.illuminant(), format!("tubes.csv, {column}"));
        let found = only(&patch, &Question::default(), &own).xyz;
        assert!(found.iter().zip(wanted).all(|(f, w)| (f - w).abs() < 1e-4 * w), "{found:?} {wanted:?}");
    }
    for (column, says) in
        [(None, "2 columns, expected one"), (Some("3"), "no column `3`, expected a number from 1 to 2")]
    {
        assert!(Viewing::default().under("t", &tubes, column).unwrap_err().to_string().contains(says));
    }
    let dark = table(Vec::new(), &|_, _| 0.0);
    let refused = Viewing::default().under("dark", &dark, None).unwrap_err();
    assert_eq!(refused, crate::domain::colour::TableError::Wavelengths(ColourError::Dark));

    let eye = crate::domain::colour::Observer::cie_1964();
    let functions = [&eye.x, &eye.y, &eye.z];
    let observer = table(vec![index(3)], &|column, lambda| functions[column].at(lambda));
    let own = Viewing::default().seen_by("eye.csv", &observer).unwrap();
    assert_eq!(own.observer(), "eye.csv");
    let found = only(&patch, &Question::default(), &own).lab;
    let known = Viewing::standard(Illuminant::D65, StandardObserver::Cie1964);
    let wanted = only(&patch, &Question::default(), &known).lab;
    assert!(found.iter().zip(wanted).all(|(f, w)| (f - w).abs() < 0.05), "5 nm for 1 nm: {found:?} {wanted:?}");
}

#[test]
fn rgb_is_its_own_colour_and_relative_data_have_a_brightest() {
    let axes = vec![triangles(Domain::Hemisphere, 0), triangles(Domain::Hemisphere, 1), Axis::Rgb];
    let paint = material(Quantity::Brdf, Unit::PerSteradian, axes, |i| [0.3, 0.2, 0.1][i % 3] * FRAC_1_PI);
    let found = only(&paint, &Question { wi: up(5.0), wo: up(40.0), index: None }, &Viewing::default());
    assert!(found.linear_srgb.iter().zip([0.3, 0.2, 0.1]).all(|(f, w)| (f - w).abs() < 1e-6), "{found:?}");
    let spectra = vec![index(2), visible()];
    let two = material(Quantity::Spectrum, Unit::Relative, spectra, |i| if i < 41 { 3.0 } else { 6.0 });
    let found = colours(&two, &Question::default(), &Viewing::default()).unwrap();
    let y: Vec<f64> = found.colours.iter().map(|c| c.as_ref().unwrap().xyz[1]).collect();
    assert!((y[0] - 50.0).abs() < 1e-9 && (y[1] - 100.0).abs() < 1e-9, "{y:?}");
    let holes =
        material(
            Quantity::Spectrum,
            Unit::Relative,
            vec![index(2), visible()],
            |i| {
                if i < 41 { f32::NAN } else { 6.0 }
            },
        );
    let found = colours(&holes, &Question::default(), &Viewing::default()).unwrap();
    assert!(found.colours[0].is_none() && found.colours[1].is_some());
}

#[test]
fn questions_without_an_answer_are_refused() {
    let brdf = diffuser(Quantity::Brdf, Domain::Hemisphere);
    let ask = |m: &Material, q: Question<'_>| colours(m, &q, &Viewing::default()).unwrap_err();
    let lone = ask(&brdf, Question { wo: up(0.0), ..Question::default() });
    assert!(matches!(&lone, PreviewError::Question(QuestionError::LoneWo { .. })), "{lone}");
    let below = ask(&brdf, Question { wi: up(120.0), ..Question::default() });
    assert!(matches!(below, PreviewError::Evaluate(EvaluateError::Query(QueryError::Outside { .. }))));
    let lamp = material(Quantity::Edf, Unit::Candela, vec![triangles(Domain::Sphere, 0)], |_| 1.0);
    assert_eq!(ask(&lamp, Question::default()), PreviewError::Colour(ColourError::NoWavelengths));
    let ultraviolet = Axis::Wavelength(WavelengthGrid::even(200.0, 10.0, 20).unwrap());
    let lamp = material(Quantity::Spectrum, Unit::Relative, vec![ultraviolet], |_| 1.0);
    assert!(matches!(ask(&lamp, Question::default()), PreviewError::Colour(ColourError::Uncovered { .. })));
    let dark = material(Quantity::Spectrum, Unit::Relative, vec![visible()], |_| 0.0);
    assert_eq!(ask(&dark, Question::default()), PreviewError::Colour(ColourError::Dark));
    let masked = material(Quantity::Reflectance, Unit::One, vec![visible()], |_| f32::NAN);
    assert_eq!(ask(&masked, Question::default()), PreviewError::Colour(ColourError::Masked));
    let many = material(Quantity::Spectrum, Unit::Relative, vec![index(5000), Axis::Rgb], |_| 1.0);
    assert!(matches!(
        ask(&many, Question::default()),
        PreviewError::Question(QuestionError::TooMany { found: 5000, .. })
    ));
    let several = vec![index(2), triangles(Domain::Hemisphere, 0), triangles(Domain::Hemisphere, 0), visible()];
    let several = material(Quantity::Brdf, Unit::PerSteradian, several, |_| 0.1);
    assert_eq!(ask(&several, Question::default()), QuestionError::MissingIndex { expected: 1 }.into());
    assert!(only(&several, &Question { index: Some(&[1]), ..Question::default() }, &Viewing::default()).in_gamut);
    let rgb = material(Quantity::Reflectance, Unit::One, vec![Axis::Rgb], |_| 0.5);
    let under_a = Viewing::standard(Illuminant::A, StandardObserver::Cie1931);
    let refused = colours(&rgb, &Question::default(), &under_a).unwrap_err();
    assert_eq!(refused, QuestionError::RgbIlluminant { illuminant: "A".to_owned() }.into());
}

/// Returns the number of pixels along a side of a PNG, and its pixels.
fn decoded(bytes: &[u8]) -> (usize, Vec<[u8; 3]>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.color_type, info.bit_depth, info.width), (png::ColorType::Rgb, png::BitDepth::Eight, info.height));
    (info.width as usize, pixels.as_chunks::<3>().0.to_vec())
}

fn drawn(material: &Material, size: usize) -> Vec<[u8; 3]> {
    let (side, pixels) = decoded(&picture(material, None, &Viewing::default(), sized(size)).unwrap());
    assert_eq!((side, pixels.len()), (size, size * size));
    pixels
}

/// Returns one material of each kind that previews draw differently, with its name.
fn all() -> Vec<(&'static str, Material)> {
    let hemisphere = |level| triangles(Domain::Hemisphere, level);
    let sphere = |level| triangles(Domain::Sphere, level);
    let waves = |i: usize| 0.2 + 0.1 * ((i % 97) as f32 * 0.1).sin();
    let sr = Unit::PerSteradian;
    let elevations = Axis::Elevation(vec![5.0, 35.0, 60.0]);
    let lower = vec![triangles(Domain::Lower, 1), triangles(Domain::Lower, 2), visible()];
    let far = Axis::Wavelength(WavelengthGrid::listed(vec![210.0, 220.0, 300.0]).unwrap());
    let coarse = Axis::Wavelength(WavelengthGrid::even(400.0, 50.0, 7).unwrap());
    let one = |quantity, unit, axes| material(quantity, unit, axes, waves);
    vec![
        ("diffuser", diffuser(Quantity::Brdf, Domain::Hemisphere)),
        ("btdf", diffuser(Quantity::Btdf, Domain::Lower)),
        ("bsdf", diffuser(Quantity::Bsdf, Domain::Sphere)),
        ("isotropic", one(Quantity::Brdf, sr, vec![elevations, hemisphere(2), Axis::Rgb])),
        ("from below", one(Quantity::Brdf, sr, lower)),
        ("monochromatic", one(Quantity::Brdf, sr, vec![hemisphere(1), hemisphere(2)])),
        ("ultraviolet", one(Quantity::Brdf, sr, vec![hemisphere(1), hemisphere(2), far.clone()])),
        ("coarse", one(Quantity::Brdf, sr, vec![hemisphere(1), hemisphere(2), coarse])),
        (
            "holes",
            material(Quantity::Brdf, sr, vec![hemisphere(1), hemisphere(2), visible()], |i| {
                if i / 41 % 16 == 0 || i % 41 == 7 { f32::NAN } else { waves(i) }
            }),
        ),
        ("scans", one(Quantity::Brdf, sr, vec![index(3), hemisphere(1), hemisphere(2), visible()])),
        ("leaf", one(Quantity::Brdf, sr, vec![index(3), index(4), visible()])),
        ("reflectance by direction", one(Quantity::Reflectance, Unit::One, vec![hemisphere(1)])),
        ("spectra by direction", one(Quantity::Reflectance, Unit::One, vec![hemisphere(1), visible()])),
        ("lamp", one(Quantity::Edf, Unit::WattPerSteradianNanometre, vec![sphere(2), visible()])),
        ("downlight", material(Quantity::Edf, Unit::Candela, vec![sphere(3)], |i| if i < 256 { 0.0 } else { 9e4 })),
        ("far lamp", one(Quantity::Edf, Unit::MilliwattPerSteradianNanometre, vec![sphere(2), far])),
        ("phase", one(Quantity::Phase, sr, vec![sphere(1), sphere(2), visible()])),
        ("forward", material(Quantity::Phase, sr, vec![sphere(1), sphere(2)], |i| 10_f32.powi(-((i % 7) as i32)))),
        ("spectrum", material(Quantity::Spectrum, Unit::Relative, vec![visible()], |i| i as f32 - 3.0)),
        ("table", material(Quantity::Reflectance, Unit::One, vec![index(60), visible()], red)),
        (
            "gaps",
            material(Quantity::Spectrum, Unit::Relative, vec![visible()], |i| if i % 9 < 2 { f32::NAN } else { 1.0 }),
        ),
        ("colours", one(Quantity::Reflectance, Unit::One, vec![index(5), Axis::Rgb])),
        ("values", one(Quantity::Spectrum, Unit::Relative, vec![index(5)])),
    ]
}

#[test]
fn every_kind_has_a_picture_of_the_size_asked_for() {
    for (name, material) in all() {
        for size in [64, 200] {
            let pixels = drawn(&material, size);
            let first = pixels[0];
            let others = pixels.iter().filter(|p| **p != first).count();
            assert!(others > size * size / 50, "{name}: an empty picture");
        }
    }
}

#[test]
fn pictures_do_not_depend_on_the_threads() {
    for (name, material) in all() {
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| picture(&material, None, &Viewing::default(), sized(96)).unwrap())
        };
        assert!(on(1) == on(3), "{name}");
    }
}

#[test]
fn a_white_ball_is_white_where_it_is_lit_in_any_light() {
    let white = diffuser(Quantity::Brdf, Domain::Hemisphere);
    let daylight = drawn(&white, 128);
    let at = |x: usize, y: usize| daylight[y * 128 + x];
    let lit = at(46, 46);
    assert!(lit[0] > 215 && lit[0].abs_diff(lit[1]) < 2 && lit[1].abs_diff(lit[2]) < 2, "{lit:?}");
    assert!(at(100, 90)[0] < 200 && at(2, 2)[0] < 80, "{:?} {:?}", at(100, 90), at(2, 2));
    for viewing in viewings() {
        let (_, pixels) = decoded(&picture(&white, None, &viewing, sized(128)).unwrap());
        let off = pixels.iter().flatten().zip(daylight.iter().flatten()).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(off <= Some(1), "{}: {off:?}", viewing.illuminant());
    }
}

#[test]
fn what_lets_light_through_is_lit_from_inside() {
    let sheet = drawn(&diffuser(Quantity::Btdf, Domain::Lower), 128);
    let [r, g, b] = sheet[70 * 128 + 64];
    assert!(r > 60 && g > 60 && b > 60, "{:?}", [r, g, b]);
}

#[test]
fn red_is_drawn_red() {
    let axes = vec![triangles(Domain::Hemisphere, 1), triangles(Domain::Hemisphere, 2), visible()];
    let ball = material(Quantity::Brdf, Unit::PerSteradian, axes, |i| red(i) * FRAC_1_PI);
    let pixels = drawn(&ball, 128);
    let [r, g, b] = pixels[50 * 128 + 50];
    assert!(r > 150 && g < 130 && b < 110 && r > 2 * b, "{:?}", [r, g, b]);
}

#[test]
fn impossible_pictures_are_refused() {
    let brdf = diffuser(Quantity::Brdf, Domain::Hemisphere);
    for size in [0, 63, 2049, usize::MAX] {
        let refused = picture(&brdf, None, &Viewing::default(), sized(size)).unwrap_err();
        assert_eq!(refused, QuestionError::Size { found: size, low: 64, high: 2048 }.into());
    }
    let refused = picture(&brdf, Some(&[0]), &Viewing::default(), sized(64)).unwrap_err();
    assert_eq!(refused, QuestionError::Index { found: vec![0], shape: Vec::new() }.into());
    for (quantity, axes) in [
        (Quantity::Edf, vec![triangles(Domain::Sphere, 1)]),
        (Quantity::Phase, vec![triangles(Domain::Sphere, 0), triangles(Domain::Sphere, 0)]),
        (Quantity::Spectrum, vec![visible()]),
    ] {
        let dark = material(quantity, quantity.default_unit(), axes, |_| 0.0);
        let refused = picture(&dark, None, &Viewing::default(), sized(64)).unwrap_err();
        assert_eq!(refused, PreviewError::Colour(ColourError::Dark), "{quantity}");
    }
}

#[test]
fn pictures_without_exact_colours_say_so() {
    let remark = |bands: &[f64]| {
        let bands = Axis::Wavelength(WavelengthGrid::listed(bands.to_vec()).unwrap());
        let axes = vec![triangles(Domain::Hemisphere, 1), triangles(Domain::Hemisphere, 2), bands];
        let paint = material(Quantity::Brdf, Unit::PerSteradian, axes, |i| 0.1 + 0.01 * (i % 3) as f32);
        colour_remark(&paint, &Viewing::default()).unwrap().unwrap()
    };
    assert_eq!(
        remark(&[450.0, 550.0, 650.0]),
        "colours are estimated from the 3 wavelengths from 450 to 650 nm; exact ones need 400 to 700 nm in steps of at most \
         20 nm"
    );
    assert!(
        remark(&[550.0, 670.0, 870.000_000_1]).starts_with("grey instead of colours, which the 3 wavelengths from 550")
    );
    let paint = diffuser(Quantity::Brdf, Domain::Hemisphere);
    assert_eq!(colour_remark(&paint, &Viewing::default()).unwrap(), None);
}

#[test]
fn diagrams_have_a_light_style_a_title_and_svg() {
    let labels = ["first", "a < b"].map(str::to_owned).to_vec();
    let axes = vec![Axis::Index { count: 2, labels }, visible()];
    let spectra = material(Quantity::Reflectance, Unit::One, axes, |i| 0.2 + 0.5 * (i % 41) as f32 / 41.0);
    let draw = |look| picture(&spectra, None, &Viewing::default(), look).unwrap();
    let look = Look { size: 512, style: Style::Light, title: Some("Two papers"), is_svg: true };
    let svg = String::from_utf8(draw(look)).unwrap();
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n") && svg.contains("fill=\"#ffffff\""), "{svg}");
    for text in [">Two papers<", ">first<", ">a &lt; b<", ">max 0.688 at 780 nm<", ">nm<"] {
        assert!(svg.contains(text), "{text} in {svg}");
    }
    let (side, light) = decoded(&draw(Look { is_svg: false, ..look }));
    let (_, dark) = decoded(&draw(Look { is_svg: false, style: Style::Dark, ..look }));
    let mean =
        |pixels: &[[u8; 3]]| pixels.iter().flatten().map(|&c| f64::from(c)).sum::<f64>() / (3 * pixels.len()) as f64;
    assert!(side == 512 && mean(&light) > 200.0 && mean(&dark) < 80.0, "{} {}", mean(&light), mean(&dark));
    assert_eq!(decoded(&draw(sized(1024))).0, 1024);
    let lamp = material(Quantity::Edf, Unit::Candela, vec![triangles(Domain::Sphere, 2)], |i| 1.0 + (i % 5) as f32);
    let svg = picture(&lamp, None, &Viewing::default(), Look { is_svg: true, ..look }).unwrap();
    assert!(String::from_utf8(svg).unwrap().contains("stroke-dasharray"));
    let ball = diffuser(Quantity::Brdf, Domain::Hemisphere);
    let refused = picture(&ball, None, &Viewing::default(), look).unwrap_err();
    assert_eq!(refused, PreviewError::Question(QuestionError::Ball));
}
