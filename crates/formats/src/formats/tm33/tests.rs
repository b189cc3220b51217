//! TM-33: both layouts, symmetries, units, emitters and spectra, refusals by name, and hostile fields.

use super::*;
use crate::domain::Unit;
use crate::formats::acquisition::AngleGrid;
use crate::formats::{NoteKind, read as read_any};

/// Intensity that differs for every direction.
fn shape(c: f64, gamma: f64) -> f64 {
    100.0 + gamma * (1.0 + c / 450.0)
}

const GAMMAS: [f64; 3] = [0.0, 45.0, 90.0];

/// Returns intensities as elements with the attributes `h` and `v`, or `horz` and `vert`.
fn data(planes: &[f64], names: [&str; 3]) -> String {
    let [element, horizontal, vertical] = names;
    let datum = |c: f64, gamma: f64| {
        format!("<{element} {horizontal}=\"{c}\" {vertical}=\"{gamma}\">{}</{element}>\n", shape(c, gamma))
    };
    planes.iter().flat_map(|&c| GAMMAS.map(|gamma| datum(c, gamma))).collect()
}

fn standard(planes: &[f64]) -> String {
    data(planes, ["IntData", "h", "v"])
}

const SPECTRUM: &str = "<SpectralData><EmitterSpectral><NumberWavelength>3</NumberWavelength>\
    <PwrData w=\"400\">0</PwrData><PwrData w=\"550\">2</PwrData><PwrData w=\"700\">0</PwrData></EmitterSpectral></SpectralData>";

fn luminous(head: &str, data: &str) -> String {
    format!("<LuminousData><LuminousIntensity>{head}{data}</LuminousIntensity></LuminousData>")
}

fn emitter(content: &str) -> String {
    format!(
        "<Emitter><Quantity>1</Quantity><Description>LED</Description><InputWattage>10</InputWattage>{content}</Emitter>"
    )
}

fn file(emitters: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?>\n<IESTM33-22><Version>1.1</Version><Header><Manufacturer>A &amp; B</Manufacturer>\
         <Description>Lamp</Description></Header><Equipment><Gonioradiometer><Type>IES _ C</Type></Gonioradiometer></Equipment>\n\
         {emitters}</IESTM33-22>"
    )
}

fn plain(text: &str) -> Result<Acquisition, FormatError> {
    read_any(text.as_bytes(), &Interpretation::default())
}

fn asked(text: &str, unit: Option<Unit>, column: Option<&str>) -> Result<Acquisition, FormatError> {
    let how = Interpretation { unit, column: column.map(str::to_owned), ..Interpretation::default() };
    read_any(text.as_bytes(), &how)
}

fn grid(acquisition: &Acquisition) -> &AngleGrid {
    let Samples::Grid(grid) = &acquisition.samples else { panic!("a grid") };
    grid
}

/// Returns the intensities on planes around the vertical axis, `[theta, phi]`, theta from the zenith.
fn at(acquisition: &Acquisition, gamma: f64, c: f64) -> f64 {
    let grid = grid(acquisition);
    let outgoing = grid.outgoing.as_ref().unwrap();
    let planes = outgoing.phi.as_ref().map_or(&[0.0][..], |azimuths| &azimuths.phi);
    let row = outgoing.theta.iter().position(|&theta| theta == 180.0 - gamma).unwrap();
    let column = planes.iter().position(|&phi| phi == c).unwrap();
    f64::from(grid.values[row * planes.len() + column])
}

fn says(acquisition: &Acquisition, kind: NoteKind, words: &str) -> bool {
    acquisition.report.notes.iter().any(|note| note.kind == kind && note.message.contains(words))
}

#[test]
fn both_layouts_give_the_same_luminaire() {
    let planes = [0.0, 45.0, 90.0];
    let new =
        plain(&file(&emitter(&luminous("<AbsolutePhotometry>true</AbsolutePhotometry>", &standard(&planes))))).unwrap();
    assert_eq!((new.format, new.dialect.as_str()), (NAME, "TM-33-23, LuminousData, type C, quadrant symmetric"));
    assert_eq!((new.quantity, new.unit), (Quantity::Edf, Unit::Candela));
    assert_eq!((at(&new, 45.0, 45.0), at(&new, 45.0, 135.0)), (149.5, 149.5));
    assert!(new.report.notes.is_empty(), "{:?}", new.report.notes);
    let keywords: Vec<_> = new.report.metadata.iter().map(|(key, text)| (key.as_str(), text.as_str())).collect();
    for wanted in [
        ("Manufacturer", "A & B"),
        ("Equipment/Gonioradiometer/Type", "IES _ C"),
        ("Emitter/Description", "LED"),
        ("Emitter/InputWattage", "10"),
    ] {
        assert!(keywords.contains(&wanted), "{wanted:?} {keywords:?}");
    }
    // Other roots, a byte order mark, a line of a tool before the declaration, UTF-16, empty elements, and numbers of
    // angles that were not counted.
    let whole = file(&emitter(&luminous(
        "<AbsolutePhotometry>true</AbsolutePhotometry><Symm/><Multiplier></Multiplier><NumberHorz>0</NumberHorz>",
        &standard(&planes),
    )));
    for root in ["IESTM33", "IESTM33-22", "ATLA_S001_A", "UNI11733"] {
        let other = plain(&format!("\u{feff}{}", whole.replace("IESTM33-22", root))).unwrap();
        assert_eq!(grid(&other).values, grid(&new).values, "{root}");
    }
    let noted = plain(&format!("Written by a tool: <x>\n{whole}")).unwrap();
    assert!(grid(&noted).values == grid(&new).values && says(&noted, NoteKind::Skipped, "1 line of text before"));
    let utf16: Vec<u8> = "\u{feff}".encode_utf16().chain(whole.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let wide = read_any(&utf16, &Interpretation::default()).unwrap();
    assert_eq!(grid(&wide).values, grid(&new).values);
    // The older layout, with another order of the intensities and a namespace.
    let mut lines: Vec<String> = data(&planes, ["IntensityData", "horz", "vert"]).lines().map(str::to_owned).collect();
    lines.reverse();
    let old = format!(
        "<t:LuminaireOpticalData version=\"1.0\" xmlns:t=\"http://www.ies.org/tm-33\"><Emitter><IntensityDistribution>\
         <PhotometryType>C</PhotometryType><Metric>Luminous</Metric>{}</IntensityDistribution></Emitter></t:LuminaireOpticalData>",
        lines.concat()
    );
    let old = plain(&old).unwrap();
    assert_eq!(grid(&old).values, grid(&new).values);
    assert_eq!(old.dialect, "TM-33-18, LuminousData, type C, quadrant symmetric");
    assert!(says(&old, NoteKind::Assumed, "absolute or relative"), "{:?}", old.report.notes);
}

#[test]
fn symmetries_are_checked_against_the_planes() {
    let read = |symmetry: &str, planes: &[f64]| {
        plain(&file(&emitter(&luminous(&format!("<Symm>{symmetry}</Symm>"), &standard(planes)))))
    };
    for (symmetry, planes, words) in [
        ("Symm_Full", &[0.0][..], "axially symmetric"),
        ("Symm _ Quad", &[0.0, 90.0], "quadrant symmetric"),
        ("Symm_Bi_0", &[0.0, 90.0, 180.0], "symmetric about the 0-180 plane"),
        ("Symm _ Bi _90", &[90.0, 180.0, 270.0], "symmetric about the 90-270 plane"),
        ("Symm_None", &[0.0, 90.0, 180.0, 270.0, 360.0], "no symmetry"),
        ("Symm_Arbitrary", &[0.0, 90.0, 180.0, 270.0], "no symmetry"),
    ] {
        let lamp = read(symmetry, planes).unwrap();
        assert!(lamp.dialect.ends_with(words), "{}", lamp.dialect);
        assert!(!says(&lamp, NoteKind::Warning, "the file says"), "{:?}", lamp.report.notes);
    }
    // Planes that list more than the symmetry needs, and a single plane.
    for planes in [&[0.0][..], &[0.0, 90.0, 180.0], &[90.0, 180.0, 270.0], &[0.0, 90.0, 180.0, 270.0]] {
        assert!(says(&read("Symm_Quad", planes).unwrap(), NoteKind::Warning, "the file says `Symm_Quad`"));
    }
    assert!(says(&read("Symm_Full", &[0.0, 90.0]).unwrap(), NoteKind::Warning, "planes say quadrant symmetric"));
    for (symmetry, planes, kind, words) in [
        ("Symm_None", &[0.0, 90.0][..], FormatErrorKind::Malformed, "expected quadrant symmetric"),
        ("Symm_Bi_90", &[0.0, 90.0, 180.0], FormatErrorKind::Malformed, "expected symmetric about the 0-180 plane"),
        ("Symm_Arbitrary", &[0.0, 90.0], FormatErrorKind::Malformed, "expected quadrant symmetric"),
        ("Symm_Odd", &[0.0], FormatErrorKind::Unsupported, "symmetry `Symm_Odd`"),
    ] {
        let error = read(symmetry, planes).unwrap_err();
        assert!(error.kind == kind && error.message.contains(words) && error.position.is_some(), "{error}");
    }
}

#[test]
fn units_multipliers_and_photometry_are_those_of_the_file() {
    let radiant = format!(
        "<RadiantData><MinWavelength>380</MinWavelength><MaxWavelength>780</MaxWavelength><RadiantIntensity>\
         <Absolute>true</Absolute><Multiplier>0.5</Multiplier>{}</RadiantIntensity></RadiantData>",
        standard(&[0.0])
    );
    let lamp = plain(&file(&emitter(&radiant))).unwrap();
    assert_eq!((lamp.unit, at(&lamp, 45.0, 0.0)), (Unit::WattPerSteradian, 72.5));
    let both = file(&emitter(&format!("{}{radiant}", luminous("", &standard(&[0.0])))));
    let lamp = plain(&both).unwrap();
    assert!(lamp.unit == Unit::Candela && says(&lamp, NoteKind::Assumed, "the emitter has those in cd, W/sr"));
    assert_eq!(asked(&both, Some(Unit::WattPerSteradian), None).unwrap().unit, Unit::WattPerSteradian);
    for unit in [Unit::MicromolePerSecondSteradian, Unit::One] {
        let error = asked(&both, Some(unit), None).unwrap_err();
        assert!(error.kind == FormatErrorKind::NeedsOption && error.message.contains("cd, W/sr"), "{error}");
    }
    let photons = "<PhotonData><PhotonIntensity>".to_owned() + &standard(&[0.0]) + "</PhotonIntensity></PhotonData>";
    assert_eq!(plain(&file(&emitter(&photons))).unwrap().unit, Unit::MicromolePerSecondSteradian);
    let relative = "<AbsolutePhotometry>false</AbsolutePhotometry>";
    let lamp =
        plain(&file(&emitter(&format!("<RatedLumens>900</RatedLumens>{}", luminous(relative, &standard(&[0.0]))))))
            .unwrap();
    assert!(says(&lamp, NoteKind::Assumed, "900 rated lm") && at(&lamp, 45.0, 0.0) == 145.0);
    // Values for 1000 lm, if the user says so and the file does not deny it.
    let per =
        |head: &str| asked(&file(&emitter(&luminous(head, &standard(&[0.0])))), Some(Unit::CandelaPerKilolumen), None);
    for head in ["", relative] {
        let lamp = per(head).unwrap();
        assert_eq!((lamp.unit, at(&lamp, 45.0, 0.0)), (Unit::CandelaPerKilolumen, 145.0));
        assert!(lamp.report.notes.is_empty(), "{:?}", lamp.report.notes);
    }
    let error = per("<AbsolutePhotometry>1</AbsolutePhotometry>").unwrap_err();
    assert!(error.kind == FormatErrorKind::NeedsOption && error.message.contains("absolute"), "{error}");
    // The flux that a file states is compared in every unit.
    let measured = file(&emitter(&format!("<MeasuredLumens>5</MeasuredLumens>{}", luminous("", &standard(&[0.0])))));
    assert!(says(&plain(&measured).unwrap(), NoteKind::Warning, "of the 5 lm stated"));
    let watts = radiant.replace("</RadiantData>", "<RadiantFlux>3</RadiantFlux></RadiantData>");
    assert!(says(&plain(&file(&emitter(&watts))).unwrap(), NoteKind::Warning, "of the 3 W stated"));
    let stated =
        luminous("", &standard(&[0.0])).replace("</LuminousData>", "<LuminousFlux>100</LuminousFlux></LuminousData>");
    assert!(says(&plain(&file(&emitter(&stated))).unwrap(), NoteKind::Warning, "of the 100 lm stated"));
}

#[test]
fn one_emitter_of_several_is_asked_for() {
    let other = |name: &str, planes: &[f64]| {
        format!("<Emitter><Description>{name}</Description>{}</Emitter>", luminous("", &standard(planes)))
    };
    let two = file(&(other("Up", &[0.0]) + &other("Down", &[0.0, 180.0])));
    let error = plain(&two).unwrap_err();
    assert_eq!(error.kind, FormatErrorKind::NeedsOption);
    assert!(error.message.ends_with("the number or name of one: 1 (`Up`), 2 (`Down`)"), "{error}");
    for column in ["2", "down"] {
        let lamp = asked(&two, None, Some(column)).unwrap();
        assert!(lamp.dialect.ends_with("0-180 plane"), "{}", lamp.dialect);
        assert!(lamp.report.metadata.contains(&("emitter".to_owned(), "2 of 2".to_owned())));
    }
    for column in ["0", "3", "Side"] {
        assert_eq!(asked(&two, None, Some(column)).unwrap_err().kind, FormatErrorKind::NeedsOption);
    }
    let lamp = plain(&file(&(emitter("") + &other("Down", &[0.0])))).unwrap();
    assert!(says(&lamp, NoteKind::Assumed, "emitter 2 of 2"), "{:?}", lamp.report.notes);
}

#[test]
fn the_spectrum_of_the_file_joins_its_intensities() {
    let text = file(&emitter(&(luminous("", &standard(&[0.0])) + SPECTRUM)));
    let lamp = plain(&text).unwrap();
    assert_eq!(lamp.unit, Unit::WattPerSteradianNanometre);
    let factor = lamp.spectral_factor.as_ref().unwrap();
    assert_eq!((factor.grid.values(), factor.factors[0]), (vec![400.0, 550.0, 700.0], 0.0));
    assert!(says(&lamp, NoteKind::Assumed, "ask for the unit cd"), "{:?}", lamp.report.notes);
    let candela = asked(&text, Some(Unit::Candela), None).unwrap();
    assert!(candela.spectral_factor.is_none() && says(&candela, NoteKind::Skipped, "a unit of the intensities"));
    // Two lists, and a list with a first wavelength and a step, hold the same spectrum.
    let luminaire = luminous("", &standard(&[0.0]));
    for head in [
        "<Wavelengths>400 550 700</Wavelengths>",
        "<StartWavelength>400</StartWavelength><WavelengthInterval>150</WavelengthInterval>",
    ] {
        let listed =
            format!("<SpectralDistribution>{head}<Values>0 2 0</Values><Units>Relative</Units></SpectralDistribution>");
        let other = plain(&file(&emitter(&(luminaire.clone() + &listed)))).unwrap();
        assert_eq!(other.spectral_factor, lamp.spectral_factor);
    }
    for (old, new, reason) in [
        ("</EmitterSpectral>", "<Quantum>1</Quantum></EmitterSpectral>", "may count photons"),
        ("</SpectralData>", &SPECTRUM.replace("<SpectralData>", ""), "2 spectra"),
    ] {
        let other = plain(&text.replacen(old, new, 1)).unwrap();
        assert!(other.unit == Unit::Candela && says(&other, NoteKind::Skipped, reason), "{:?}", other.report.notes);
    }
    // Photons of a range: the spectrum is cut to it, and its energy becomes a number of photons.
    let photons = format!(
        "<PhotonData><MinWavelength>475</MinWavelength><MaxWavelength>625</MaxWavelength><PhotonIntensity>{}</PhotonIntensity></PhotonData>",
        standard(&[0.0])
    );
    let beyond = photons.replace(">475<", ">800<").replace(">625<", ">900<");
    let lamp = plain(&file(&emitter(&(beyond + SPECTRUM)))).unwrap();
    assert!(says(&lamp, NoteKind::Skipped, "outside the range"), "{:?}", lamp.report.notes);
    let lamp = plain(&file(&emitter(&(photons + SPECTRUM)))).unwrap();
    let factor = lamp.spectral_factor.as_ref().unwrap();
    assert_eq!(factor.grid.values(), [475.0, 550.0, 625.0]);
    let total = 75.0 * (475.0 + 2.0 * 2.0 * 550.0 + 625.0) / 2.0;
    assert!((factor.factors[1] - 2.0 * 550.0 / total).abs() < 1e-9, "{} {total}", factor.factors[1]);
    assert!(says(&lamp, NoteKind::Assumed, "cut to 475 to 625 nm"), "{:?}", lamp.report.notes);
}

#[test]
fn refusals_say_where_and_what() {
    use FormatErrorKind::{Malformed, NeedsOption, OverLimit, Unsupported};
    let good =
        file(&emitter(&luminous("<NumberHorz>2</NumberHorz><NumberVert>3</NumberVert>", &standard(&[0.0, 90.0]))));
    assert!(plain(&good).is_ok());
    let with = |old: &str, new: &str| good.replacen(old, new, 1);
    let only = |name: &str| file(&emitter(&format!("<{name}><IntData h=\"0\" v=\"0\" w=\"5\">1</IntData></{name}>")));
    for (text, kind, words) in [
        (with("IES _ C", "IES _ B"), Unsupported, "a goniometer of type `IES _ B`, expected type C"),
        (with("IES _ C", "CUSTOM"), Unsupported, "`CUSTOM`"),
        (with("h=\"90\"", "h=\"9O\""), Malformed, "`9O` in IntData, expected a number as the attribute h"),
        (with("h=\"90\" ", ""), Malformed, "no attribute in IntData"),
        (with(">145<", ">1.4.5<"), Malformed, "found `1.4.5`, expected a number as an intensity"),
        (with(">145<", ">1e39<"), Malformed, "too large for float32"),
        (with("h=\"90\" v=\"45\"", "h=\"91\" v=\"45\""), Malformed, "NumberHorz 2, expected 3"),
        (with("h=\"90\" v=\"45\"", "h=\"90\" v=\"0\""), Malformed, "a second intensity at horizontal 90°, vertical 0°"),
        (with("<NumberVert>3</NumberVert>", "<NumberVert>4</NumberVert>"), Malformed, "NumberVert 4, expected 3"),
        (
            with("<NumberVert>", "<AbsolutePhotometry>maybe</AbsolutePhotometry><NumberVert>"),
            Malformed,
            "true or false",
        ),
        (with("<NumberVert>", "<Units>lm</Units><NumberVert>"), Unsupported, "Units `lm`"),
        (with("<NumberVert>", "<Metric>Spectral</Metric><NumberVert>"), Unsupported, "Metric `Spectral`"),
        (only("AngularSpectral"), Unsupported, "no intensities by direction but AngularSpectral"),
        (only("IllumData"), Unsupported, "but IllumData"),
        (file(""), Malformed, "no element Emitter"),
        (file(&emitter(&luminous("", &standard(&[0.0])).repeat(2))), Unsupported, "a second LuminousData"),
        (with("?>", "?><!DOCTYPE x SYSTEM \"x.dtd\">"), Unsupported, "document type"),
        (with("</Emitter>", "</Emitters>"), Malformed, "not well formed"),
        (with("<Emitter>", &format!("<Emitter>{}", "<a>".repeat(20))), OverLimit, "nested elements"),
    ] {
        let error = plain(&text).unwrap_err();
        assert_eq!((error.kind, error.format), (kind, NAME), "{words}: {error}");
        assert!(error.position.is_some() && error.message.contains(words), "{words}: {error}");
    }
    let missing = with("NumberHorz>2<", "NumberHorz>3<").replacen("h=\"90\" v=\"45\"", "h=\"91\" v=\"45\"", 1);
    assert!(plain(&missing).unwrap_err().message.contains("6 intensities at 3 horizontal and 3 vertical angles"));
    let how = Interpretation { quantity: Some(Quantity::Brdf.into()), ..Interpretation::default() };
    assert_eq!(read_any(good.as_bytes(), &how).unwrap_err().kind, NeedsOption);
}

#[test]
fn no_length_and_no_field_makes_it_panic() {
    let text = file(&emitter(&(luminous("<Multiplier>2</Multiplier>", &standard(&[0.0, 90.0])) + SPECTRUM)));
    for cut in 0..text.len() {
        assert!(plain(&text[..cut]).is_err(), "cut at {cut}");
    }
    for hostile in ["NaN", "-1", "1e308", "9223372036854775808", "&#0;", "<", "\"", "]]>", ""] {
        for field in ["\"90\"", "\"45\"", ">145<", ">2<", "550", "IES _ C", "IntData", "Emitter", "1.0", "700"] {
            let _ = plain(&text.replacen(field, hostile, 1));
        }
    }
}
