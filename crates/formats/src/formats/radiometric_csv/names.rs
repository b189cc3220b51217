//! Names of columns in the words of laboratories: angles of the source and of the detector, values, wavelengths, units.

use crate::formats::spectral_table::holds::names_wavelength;
use crate::formats::spectral_table::wavelength_unit::WavelengthUnit;
use crate::formats::stated::{StatedQuantity, names_factor};
use crate::formats::text::number;

/// Content of a column as its name says it.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Meaning {
    /// Column of an angle, numbered as in [`super::columns::ANGLES`]; the unit is true for radians, false for degrees.
    Angle { k: usize, radians: Option<bool> },
    /// Column of an angle whose place among the directions is not known, such as a relative azimuth.
    OddAngle,
    /// Column of wavelengths.
    Wavelength(Option<WavelengthUnit>),
    /// Column of values.
    Value(ValueName),
    /// Column of standard uncertainties, at a wavelength if the name states one.
    Sigma(Option<Band>),
    /// Column whose name is a number alone, which may be a wavelength.
    Number(f64),
    /// Column of anything else.
    Unknown,
}

/// Wavelength in the name of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Band {
    pub(super) nanometres: f64,
    /// True if a unit follows the number, false if nm was assumed.
    pub(super) has_unit: bool,
}

/// Content of a column of values as its name says it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ValueName {
    pub(super) quantity: Option<StatedQuantity>,
    /// True for a reflectance, which over two directions is taken for a reflectance factor.
    pub(super) is_reflectance: bool,
    pub(super) band: Option<Band>,
    pub(super) unit: Option<ValueUnit>,
    /// True if the name says that the values are multiplied by the cosine of the outgoing direction.
    pub(super) has_cosine: bool,
}

/// Unit of values in the name of a column or in a line of the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ValueUnit {
    PerSteradian,
    One,
    Percent,
}

impl ValueUnit {
    /// Returns the unit that a text such as `1/sr`, `sr^-1` or `%` means.
    pub(super) fn of(text: &str) -> Option<Self> {
        match text.trim().to_lowercase().replace([' ', '^', '*', '{', '}'], "").as_str() {
            "1/sr" | "sr-1" | "sr⁻¹" | "sr−1" | "/sr" | "persr" | "1/steradian" => Some(Self::PerSteradian),
            "1" | "-" | "–" | "a.u.1" => Some(Self::One),
            "%" | "percent" | "prozent" | "pct" | "pourcent" | "per cent" => Some(Self::Percent),
            _ => None,
        }
    }
}

/// Side of a column of angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Source,
    Detector,
    Unsaid,
    /// Words of both sides, such as the angle between source and detector.
    Both,
}

/// Name of one column without regard to the others.
enum Alone {
    Angle { azimuth: bool, side: Side, radians: Option<bool> },
    Other(Meaning),
}

/// Returns what each column of a table contains, by the names of all columns together. `with_source` is true
/// if the angle of the source is stated elsewhere.
pub(super) fn meanings<T: AsRef<str>>(names: &[T], with_source: bool) -> Vec<Meaning> {
    let alone: Vec<Alone> = names.iter().map(|name| of(name.as_ref())).collect();
    let has = |of_azimuth: bool, of_side: Side| {
        alone.iter().any(
            |found| matches!(found, Alone::Angle { azimuth, side, .. } if *azimuth == of_azimuth && *side == of_side),
        )
    };
    let (source, detector, turn) =
        (with_source || has(false, Side::Source), has(false, Side::Detector), has(true, Side::Detector));
    let meaning = |found: Alone| match found {
        Alone::Other(meaning) => meaning,
        Alone::Angle { azimuth, side, radians } => {
            let k = match (azimuth, side) {
                (false, Side::Source) => Some(0),
                (true, Side::Source) => Some(1),
                (false, Side::Detector) => Some(2),
                (true, Side::Detector) => Some(3),
                // Beside an angle of the source, an angle of no side is that of the detector.
                (false, Side::Unsaid) => (source && !detector).then_some(2),
                (true, Side::Unsaid) => (!turn).then_some(3),
                (_, Side::Both) => None,
            };
            k.map_or(Meaning::OddAngle, |k| Meaning::Angle { k, radians })
        }
    };
    alone.into_iter().map(meaning).collect()
}

/// Returns the constant angle of incidence, or the wavelength, that the name of a line before the table names: its
/// meaning as that of a column.
pub(super) fn of_line(name: &str) -> Meaning {
    match of(name) {
        Alone::Angle { azimuth: false, side: Side::Source, radians } => Meaning::Angle { k: 0, radians },
        Alone::Angle { .. } => Meaning::OddAngle,
        Alone::Other(meaning) => meaning,
    }
}

/// Symbols and words of azimuths, and of angles from the normal, in lower case.
const AZIMUTH_SYMBOLS: [&str; 5] = ["phi", "φ", "ϕ", "azi", "az"];
const AZIMUTHS: [&str; 3] = ["azimut", "acimut", "azymut"];
const POLAR_SYMBOLS: [&str; 5] = ["theta", "θ", "ϑ", "thet", "th"];
const POLAR: [&str; 13] = [
    "winkel", "angle", "angolo", "ángulo", "angulo", "ângulo", "hoek", "vinkel", "kąt", "zenit", "polar", "úhel",
    "szög",
];
/// Names in lower case that are those of an angle without a further word.
const ANGLES_ALONE: [&str; 8] = ["aoi", "aor", "aos", "incidence", "reflection", "einfall", "ausfall", "incidencia"];
/// Words in lower case of an angle whose zero depends on the field of work, or that is counted from elsewhere.
const ODD: [&str; 19] = [
    "relative",
    "relativ",
    "raa",
    "vza",
    "sza",
    "vaa",
    "saa",
    "iza",
    "solar",
    "sun",
    "sonne",
    "sonnen",
    "elevation",
    "höhe",
    "höhenwinkel",
    "aspecular",
    "phase",
    "tilt",
    "rotation",
];
const ODD_BEGINS: [&str; 6] = ["relativ", "phasen", "dreh", "kipp", "neig", "rotat"];
/// Words in lower case of the side of the source, and beginnings of such words.
const SOURCE: [&str; 19] = [
    "inc",
    "src",
    "source",
    "aoi",
    "input",
    "quelle",
    "lamp",
    "lampe",
    "fuente",
    "fonte",
    "sorgente",
    "einfall",
    "licht",
    "entrada",
    "entrée",
    "ingresso",
    "lichtquelle",
    "sender",
    "light",
];
/// Subscripts in lower case of a symbol of an angle, for the side of the source and for that of the detector.
const OF_SOURCE: [&str; 3] = ["i", "in", "wi"];
const OF_DETECTOR: [&str; 9] = ["o", "r", "s", "d", "v", "e", "t", "out", "wo"];
const SOURCE_BEGINS: [&str; 8] =
    ["incid", "einfall", "illumin", "ilumin", "éclair", "eclair", "beleucht", "lichtquell"];
/// Words in lower case of the side of the detector, and beginnings of such words.
const DETECTOR: [&str; 18] = [
    "ref", "refl", "sc", "scat", "det", "obs", "exit", "output", "sensor", "camera", "kamera", "sortie", "salida",
    "uscita", "saída", "aor", "aos", "ausfall",
];
const DETECTOR_BEGINS: [&str; 26] = [
    "ausfall", "reflex", "reflec", "reflet", "réfle", "rifless", "riflett", "streu", "scatter", "detekt", "detec",
    "détec", "rivelat", "rilevat", "beobacht", "observ", "osserv", "betracht", "view", "emerg", "empf", "diffus",
    "receiv", "transm", "mess", "difus",
];
/// Words in lower case of an uncertainty.
const UNCERTAINTIES: [&str; 12] = [
    "sigma",
    "σ",
    "std",
    "stdev",
    "sd",
    "u",
    "uncertainty",
    "unsicherheit",
    "standardabweichung",
    "incertitude",
    "incertezza",
    "incertidumbre",
];
/// Names in lower case of values that say no more than that.
const VALUES: [&str; 26] = [
    "value",
    "values",
    "wert",
    "werte",
    "messwert",
    "messwerte",
    "valeur",
    "valeurs",
    "valor",
    "valore",
    "result",
    "ergebnis",
    "intensity",
    "intensität",
    "intensité",
    "intensidad",
    "intensità",
    "leuchtdichte",
    "strahldichte",
    "luminance",
    "radiance",
    "luminanz",
    "signal",
    "counts",
    "data",
    "reading",
];
/// Words in lower case of a reflectance.
const REFLECTANCES: [&str; 16] = [
    "r",
    "refl",
    "reflectance",
    "reflectivity",
    "reflexionsgrad",
    "reflektanz",
    "reflexion",
    "remission",
    "remissionsgrad",
    "réflectance",
    "réflectivité",
    "reflectancia",
    "refletância",
    "riflettanza",
    "rho",
    "ρ",
];
/// Parts in lower case of names of reflectance factors, and of the coefficients that are a BRDF.
const FACTORS: [&str; 20] = [
    "reflectance factor",
    "radiance factor",
    "luminance factor",
    "reflexionsfaktor",
    "reflektanzfaktor",
    "remissionsfaktor",
    "strahldichtefaktor",
    "leuchtdichtefaktor",
    "facteur de réflectance",
    "facteur de reflectance",
    "facteur de luminance",
    "facteur de radiance",
    "factor de reflectancia",
    "factor de radiancia",
    "factor de luminancia",
    "fator de reflet",
    "fattore di riflettanza",
    "fattore di radianza",
    "fattore di luminanza",
    "reflexionsgradfaktor",
];
const COEFFICIENTS: [&str; 8] = [
    "luminance coefficient",
    "radiance coefficient",
    "leuchtdichtekoeffizient",
    "strahldichtekoeffizient",
    "coefficient de luminance",
    "coefficient de radiance",
    "coeficiente de luminancia",
    "coefficiente di luminanza",
];

/// Unit at the end of a column's name.
enum Unit {
    Angle { radians: bool },
    Wavelength,
    Value(ValueUnit),
}

fn unit_of(text: &str) -> Option<Unit> {
    const DEGREES: [&str; 21] = [
        "°", "º", "â°", "deg", "deg.", "degs", "degree", "degrees", "grad", "degré", "degrés", "degre", "degres",
        "gradi", "grado", "grados", "grau", "graus", "graden", "grader", "stopnie",
    ];
    const RADIANS: [&str; 8] = ["rad", "rads", "radian", "radians", "radiant", "radianten", "radianti", "radianes"];
    let text = text.trim();
    if DEGREES.contains(&text) {
        return Some(Unit::Angle { radians: false });
    }
    if RADIANS.contains(&text) {
        return Some(Unit::Angle { radians: true });
    }
    if WavelengthUnit::of_name(text).is_some() {
        return Some(Unit::Wavelength);
    }
    ValueUnit::of(text).map(Unit::Value)
}

/// Splits a lower-case name into the name without its unit and the unit: in brackets, after a slash, a comma or a
/// blank, or a degree sign at its end.
fn split_unit(name: &str) -> (&str, Option<Unit>) {
    let name = name.trim();
    for (open, close) in [('[', ']'), ('(', ')'), ('{', '}'), ('<', '>')] {
        if let Some(inner) = name.strip_suffix(close)
            && let Some(at) = inner.rfind(open)
            && let Some(unit) = unit_of(&inner[at + open.len_utf8()..])
        {
            return (inner[..at].trim_end(), Some(unit));
        }
    }
    for sign in ["â°", "°", "º", "%"] {
        if let Some(base) = name.strip_suffix(sign) {
            return (base.trim_end_matches(['/', ' ', ',', '_']), unit_of(sign));
        }
    }
    if let Some(base) = name.strip_suffix("1/sr").filter(|base| !base.ends_with(char::is_alphanumeric)) {
        return (base.trim_end_matches(['/', ' ', ',', '_']), Some(Unit::Value(ValueUnit::PerSteradian)));
    }
    let separators = |c: char| matches!(c, '/' | ',' | '_') || c.is_whitespace();
    if let Some(at) = name.rfind(separators) {
        let after = name[at..].trim_start_matches(separators);
        // A number before the unit is a wavelength, which belongs to the name.
        let is_band = name[..at].trim_end().ends_with(|c: char| c.is_ascii_digit());
        if let Some(unit) = unit_of(after).filter(|_| !is_band && after != "1" && after != "-") {
            return (name[..at].trim_end_matches(separators), Some(unit));
        }
    }
    (name, None)
}

/// Returns the content of a column by its name alone.
fn of(name: &str) -> Alone {
    // The micro sign and the Greek letter are one; a name in mathematical notation has subscripts in braces.
    let lower = name.to_lowercase().replace(['µ', 'μ'], "u").replace(['{', '}', '$', '\\'], "");
    let lower = lower.trim();
    if let Some(value) = number(&lower.replace(',', ".")) {
        return Alone::Other(Meaning::Number(value));
    }
    let (base, unit) = split_unit(lower);
    let words = words(base);
    let has = |list: &[&str]| words.iter().any(|word| list.contains(&word.as_str()));
    let begins = |list: &[&str]| words.iter().any(|word| list.iter().any(|begin| word.starts_with(begin)));
    let contains = |list: &[&str]| list.iter().any(|part| base.contains(part));
    let band = band(base);
    let quantity = quantity(&words, base);
    let angle_unit = match unit {
        Some(Unit::Angle { radians }) => Some(radians),
        _ => None,
    };
    let azimuth = contains(&AZIMUTHS) || has(&AZIMUTH_SYMBOLS);
    let polar = has(&POLAR_SYMBOLS) || contains(&POLAR) || words.len() == 1 && has(&ANGLES_ALONE);
    let is_angle = angle_unit.is_some() || (azimuth || polar) && !matches!(unit, Some(Unit::Value(_)));
    if is_angle && quantity.is_none() && band.is_none() {
        if has(&ODD) || begins(&ODD_BEGINS) {
            return Alone::Other(Meaning::OddAngle);
        }
        // Other names have single letters of other meanings: `angle d'incidence`.
        let has_symbol = has(&POLAR_SYMBOLS) || has(&AZIMUTH_SYMBOLS);
        let source = has(&SOURCE) || begins(&SOURCE_BEGINS) || has_symbol && has(&OF_SOURCE);
        let detector = has(&DETECTOR) || begins(&DETECTOR_BEGINS) || has_symbol && has(&OF_DETECTOR);
        // A subscript of another meaning, such as that of a half angle.
        let is_subscript = |word: &String| {
            word.chars().count() <= 2
                && !AZIMUTH_SYMBOLS.contains(&word.as_str())
                && !POLAR_SYMBOLS.contains(&word.as_str())
        };
        if has_symbol && !source && !detector && words.iter().any(is_subscript) {
            return Alone::Other(Meaning::OddAngle);
        }
        let side = match (source, detector) {
            (true, true) => Side::Both,
            (true, false) => Side::Source,
            (false, true) => Side::Detector,
            (false, false) => Side::Unsaid,
        };
        return Alone::Angle { azimuth, side, radians: angle_unit };
    }
    if names_wavelength(lower) && band.is_none() {
        return Alone::Other(Meaning::Wavelength(WavelengthUnit::of_header(lower)));
    }
    let value_unit = match unit {
        Some(Unit::Value(unit)) => Some(unit),
        _ => None,
    };
    if has(&UNCERTAINTIES) {
        // A relative uncertainty has another unit than the values.
        let is_relative = value_unit == Some(ValueUnit::Percent) || has(&["rel", "relative"]);
        return Alone::Other(if is_relative { Meaning::Unknown } else { Meaning::Sigma(band) });
    }
    let is_reflectance = quantity.is_none() && has(&REFLECTANCES);
    let says_value = quantity.is_some() || is_reflectance || has(&VALUES) || band.is_some();
    let by_unit = matches!(value_unit, Some(ValueUnit::PerSteradian | ValueUnit::Percent));
    if !says_value && !by_unit {
        return Alone::Other(Meaning::Unknown);
    }
    let has_cosine = words.iter().any(|word| word.starts_with("cos") || word == "ccbrdf" || word == "ccbsdf");
    let unit = value_unit;
    let is_reflectance = is_reflectance && unit != Some(ValueUnit::PerSteradian);
    let band = band.or_else(|| if says_value { bare_band(base) } else { None });
    Alone::Other(Meaning::Value(ValueName { quantity, is_reflectance, band, unit, has_cosine }))
}

/// Splits a lower-case name into words; a symbol of an angle is separated from its subscript (`thetai`, `θᵢ`).
fn words(base: &str) -> Vec<String> {
    let base = base.replace('ᵢ', " i").replace('ₒ', " o").replace('ᵣ', " r").replace('ₛ', " s");
    let mut words = Vec::new();
    for word in base.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()) {
        let symbol = ["theta", "phi", "θ", "ϑ", "φ", "ϕ"].into_iter().find(|symbol| word.starts_with(symbol));
        match symbol {
            Some(symbol) if word.len() > symbol.len() => {
                words.extend([symbol.to_owned(), word[symbol.len()..].to_owned()]);
            }
            _ => words.push(word.to_owned()),
        }
    }
    words
}

fn quantity(words: &[String], base: &str) -> Option<StatedQuantity> {
    let has = |list: &[&str]| words.iter().any(|word| list.iter().any(|name| is_of(word, name)));
    if COEFFICIENTS.iter().any(|part| base.contains(part)) {
        return Some(StatedQuantity::Brdf);
    }
    if names_factor(base) || FACTORS.iter().any(|part| base.contains(part)) {
        return Some(StatedQuantity::ReflectanceFactor);
    }
    let begins = |symbol: &str| {
        base.trim().strip_prefix(symbol).is_some_and(|rest| !rest.starts_with(|c: char| c.is_alphanumeric()))
    };
    if has(&["brdf", "ccbrdf", "fr"]) || begins("f_r") {
        Some(StatedQuantity::Brdf)
    } else if has(&["btdf", "ft"]) || begins("f_t") {
        Some(StatedQuantity::Btdf)
    } else if has(&["bsdf", "ccbsdf"]) {
        Some(StatedQuantity::Bsdf)
    } else {
        None
    }
}

/// Returns true for a word alone or with a number after it, such as `brdf450`.
fn is_of(word: &str, name: &str) -> bool {
    word.strip_prefix(name).is_some_and(|rest| rest.bytes().all(|byte| byte.is_ascii_digit()))
}

/// Returns the wavelength with its unit in a lower-case name: `brdf 450 nm`, `r_550nm`, `0.55 um`.
fn band(base: &str) -> Option<Band> {
    for (unit, scale) in [("nm", 1.0), ("um", 1000.0)] {
        for (at, _) in base.match_indices(unit) {
            let ends = !base[at + unit.len()..].starts_with(|c: char| c.is_alphanumeric());
            let before = base[..at].trim_end_matches([' ', '_', '\u{a0}']);
            let length = before.chars().rev().take_while(|c| c.is_ascii_digit() || matches!(c, '.' | ',')).count();
            let digits = before[before.len() - length..].trim_start_matches(['.', ',']).replace(',', ".");
            if let (true, Some(value)) = (ends, number(&digits))
                && value > 0.0
            {
                let nanometres =
                    if unit == "um" { WavelengthUnit::Micrometre.to_nanometres(value) } else { value * scale };
                return Some(Band { nanometres, has_unit: true });
            }
        }
    }
    None
}

/// Returns the wavelength in nm that ends a name without a unit, such as `brdf_450`.
fn bare_band(base: &str) -> Option<Band> {
    const LIKELY: std::ops::RangeInclusive<f64> = 150.0..=3000.0;
    let base = base.trim_end_matches([')', ']', ' ']);
    let length = base.bytes().rev().take_while(|byte| byte.is_ascii_digit() || *byte == b'.').count();
    let nanometres = number(&base[base.len() - length..])?;
    LIKELY.contains(&nanometres).then_some(Band { nanometres, has_unit: false })
}

/// Returns the quantity that a text before a table names: the only one of BRDF, BTDF, BSDF and reflectance factor.
pub(super) fn quantity_of_text(text: &str) -> Option<StatedQuantity> {
    let lower = text.to_lowercase();
    let words: Vec<&str> = lower.split(|c: char| !c.is_alphanumeric()).collect();
    let mut found = Vec::new();
    for (word, quantity) in
        [("brdf", StatedQuantity::Brdf), ("btdf", StatedQuantity::Btdf), ("bsdf", StatedQuantity::Bsdf)]
    {
        if words.contains(&word) {
            found.push(quantity);
        }
    }
    if names_factor(&lower) || FACTORS.iter().any(|part| lower.contains(part)) {
        found.push(StatedQuantity::ReflectanceFactor);
    }
    (found.len() == 1).then(|| found[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angle(k: usize, radians: Option<bool>) -> Meaning {
        Meaning::Angle { k, radians }
    }

    #[test]
    fn angles_are_known_in_the_words_of_many_laboratories() {
        const DEG: Option<bool> = Some(false);
        for (names, expected) in [
            (
                &["Einfallswinkel [°]", "Ausfallswinkel [°]", "Azimut [°]"][..],
                &[angle(0, DEG), angle(2, DEG), angle(3, DEG)][..],
            ),
            (&["theta_i [deg]", "theta_o [deg]", "phi_o (deg)"], &[angle(0, DEG), angle(2, DEG), angle(3, DEG)]),
            (&["AOI", "Scatter angle"], &[angle(0, None), angle(2, None)]),
            (&["Quelle θ", "Detektor θ", "Detektor φ / °"], &[angle(0, None), angle(2, None), angle(3, DEG)]),
            (&["θi", "φi", "θr", "φr"], &[angle(0, None), angle(1, None), angle(2, None), angle(3, None)]),
            (&["thetaIn_rad", "thetaOut_rad"], &[angle(0, Some(true)), angle(2, Some(true))]),
            (&["Angle d'incidence (°)", "Angle de détection (°)"], &[angle(0, DEG), angle(2, DEG)]),
            (&["Angolo di incidenza [gradi]", "Angolo di riflessione [gradi]"], &[angle(0, DEG), angle(2, DEG)]),
            (
                &["Ángulo de incidencia", "Ángulo de observación", "Acimut"],
                &[angle(0, None), angle(2, None), angle(3, None)],
            ),
            (&["Beleuchtungswinkel", "Beobachtungswinkel"], &[angle(0, None), angle(2, None)]),
            (&["Incidence", "Reflection"], &[angle(0, None), angle(2, None)]),
            (&["AOI (deg)", "theta", "phi"], &[angle(0, DEG), angle(2, None), angle(3, None)]),
            // The zero of these is not known.
            (&["Solar Zenith", "Relative Azimuth"], &[Meaning::OddAngle, Meaning::OddAngle]),
            (&["Drehwinkel [°]", "Phasenwinkel"], &[Meaning::OddAngle, Meaning::OddAngle]),
            (&["theta_h", "theta_x"], &[Meaning::OddAngle, Meaning::OddAngle]),
            (&["theta", "Winkel"], &[Meaning::OddAngle, Meaning::OddAngle]),
            (&["Lampe [V]", "Detektor", "Temperatur [°C]"], &[Meaning::Unknown, Meaning::Unknown, Meaning::Unknown]),
        ] {
            assert_eq!(meanings(names, false), expected, "{names:?}");
        }
    }

    #[test]
    fn values_wavelengths_and_units_are_known() {
        use StatedQuantity::{Brdf, Btdf, ReflectanceFactor};
        let at = |nanometres, has_unit| Some(Band { nanometres, has_unit });
        let value = |quantity, band, unit| Meaning::Value(ValueName { quantity, band, unit, ..ValueName::default() });
        let per_sr = Some(ValueUnit::PerSteradian);
        for (name, expected) in [
            ("BRDF 450 nm [1/sr]", value(Some(Brdf), at(450.0, true), per_sr)),
            ("BRDF (0,55 µm) / sr^-1", value(Some(Brdf), at(550.0, true), per_sr)),
            ("f_r(632.8 nm) [sr-1]", value(Some(Brdf), at(632.8, true), per_sr)),
            ("brdf_450", value(Some(Brdf), at(450.0, false), None)),
            ("BTDF", value(Some(Btdf), None, None)),
            ("Leuchtdichtekoeffizient [1/sr]", value(Some(Brdf), None, per_sr)),
            ("Strahldichtefaktor [%]", value(Some(ReflectanceFactor), None, Some(ValueUnit::Percent))),
            ("BRF 650nm", value(Some(ReflectanceFactor), at(650.0, true), None)),
            ("Messwert", value(None, None, None)),
            ("550 nm", value(None, at(550.0, true), None)),
            ("450", Meaning::Number(450.0)),
            ("Wellenlänge [nm]", Meaning::Wavelength(Some(WavelengthUnit::Nanometre))),
            ("wavelength / nm", Meaning::Wavelength(Some(WavelengthUnit::Nanometre))),
            ("λ", Meaning::Wavelength(None)),
            ("u(BRDF)", Meaning::Sigma(None)),
            ("Unsicherheit 450 nm", Meaning::Sigma(at(450.0, true))),
            ("Unsicherheit [%]", Meaning::Unknown),
            ("Datum", Meaning::Unknown),
            ("Nr.", Meaning::Unknown),
        ] {
            assert_eq!(meanings(&[name], false), [expected], "{name}");
        }
        let percent = meanings(&["R 550 nm [%]"], false);
        assert!(matches!(&percent[0], Meaning::Value(value) if value.is_reflectance && value.band == at(550.0, true)));
        assert_eq!(quantity_of_text("Messung der BRDF, Probe 3"), Some(Brdf));
        assert_eq!(quantity_of_text("BRDF and BTDF"), None);
    }
}
