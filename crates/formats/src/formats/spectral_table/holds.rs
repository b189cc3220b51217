//! Words by which the name of a column, or the text around a table, says what it holds.

use super::wavelength_unit::WavelengthUnit;
use crate::formats::stated::names_factor;

/// Content of a column, as its name states it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Holds {
    /// Wavelengths or wavenumbers.
    Wavelengths,
    /// Reflectance or transmittance.
    Ratio,
    /// Reflectance factors of one direction of view (BRF, HCRF).
    Factor,
    /// Radiance, irradiance, power, or another quantity of light.
    Light,
    /// Logarithm of a reflectance or transmittance: absorbance, optical density.
    Logarithm,
    /// Raw signal of a detector: counts, digital numbers, dark and reference scans.
    Signal,
    /// Uncertainty or scatter of another column.
    Uncertainty,
    /// Running numbers: channels, pixels, scans.
    Numbers,
    /// Another quantity than light or wavelength: time, thickness, temperature, angle.
    Other,
    /// Refractive index or extinction coefficient.
    Index,
    /// The name does not say it.
    Unstated,
}

/// Names of wavelengths and wavenumbers in lower case, of which one is part of a column's name.
const WAVELENGTHS: [&str; 26] = [
    "wavelength",
    "wave length",
    "wavelen",
    "wavenumber",
    "wave number",
    "wellenl",
    "wellenzahl",
    "longueur d'onde",
    "longueur d’onde",
    "longueurs d'onde",
    "longueur_d_onde",
    "nombre d'onde",
    "longitud de onda",
    "lunghezza d'onda",
    "lunghezza d’onda",
    "comprimento de onda",
    "golflengte",
    "våglängd",
    "bølgelængde",
    "bølgelengde",
    "aallonpituus",
    "vlnová délka",
    "długość fali",
    "длина волны",
    "波長",
    "波长",
];
/// Names of wavelengths in lower case, of which one is the whole name of a column without its unit.
const WAVELENGTH_NAMES: [&str; 8] = ["wl", "wvl", "wave", "waves", "wlen", "wvlgth", "w.l.", "lam"];
/// Words beside "wavelength" in the name of a figure that is no axis.
const NO_AXIS: [&str; 15] = [
    "peak",
    "dominant",
    "centroid",
    "resolution",
    "bandwidth",
    "fwhm",
    "width",
    "error",
    "accuracy",
    "shift",
    "uncertainty",
    "step",
    "increment",
    "complementary",
    "excitation",
];
/// Stems of the words for reflectance and transmittance in lower case.
const RATIOS: [&str; 26] = [
    "refl.",
    "transm.",
    "albedo",
    "reflect",
    "reflekt",
    "reflex",
    "réflect",
    "réflex",
    "remission",
    "transmiss",
    "transmit",
    "transmis",
    "reflet",
    "riflett",
    "rifless",
    "trasm",
    "durchlässig",
    "odbic",
    "odraz",
    "heijast",
    "läpäis",
    "отраж",
    "пропуск",
    "反射",
    "透過",
    "透射",
];
/// Abbreviations of reflectance and transmittance: whole words of a name.
const RATIO_WORDS: [&str; 7] = ["reflect", "trans", "transm", "sci", "sce", "rsci", "rsce"];
/// Single letters for reflectance and transmittance, which count beside a percent sign only.
const LETTERS: [&str; 13] = ["rho", "tau", "ρ", "τ", "r", "t", "rf", "rb", "tvis", "rt", "rd", "td", "tt"];
/// Names of logarithms of reflectance or transmittance in lower case.
const LOGARITHMS: [&str; 14] = [
    "absorbance",
    "absorbanz",
    "absorbancia",
    "absorbância",
    "assorbanza",
    "extinktion",
    "optical density",
    "optische dichte",
    "densité optique",
    "log(1/r",
    "log 1/r",
    "log(1/t",
    "log 1/t",
    "吸光度",
];
const LOGARITHM_WORDS: [&str; 2] = ["abs", "od"];
/// Quantities of light in lower case.
const LIGHT: [&str; 28] = [
    "radiance",
    "irradiance",
    "radiant",
    "exitance",
    "spectral power",
    "power",
    "spd",
    "flux",
    "strahldichte",
    "bestrahlungsst",
    "strahlungsfluss",
    "leistung",
    "luminance",
    "éclairement",
    "irradiancia",
    "radiancia",
    "irradianza",
    "photon",
    "ppfd",
    "w/m",
    "w m-2",
    "w·m",
    "mw/",
    "µw/",
    "uw/",
    "w/nm",
    "w/sr",
    "umol",
];
/// Raw signals of a detector: whole words of a name.
const SIGNALS: [&str; 29] = [
    "dunkelspektrum",
    "dunkelsignal",
    "dunkelstrom",
    "referenzspektrum",
    "weißspektrum",
    "hintergrund",
    "counts",
    "count",
    "cts",
    "dn",
    "adu",
    "dark",
    "dunkel",
    "reference",
    "referenz",
    "ref",
    "raw",
    "rohdaten",
    "signal",
    "background",
    "white",
    "weiss",
    "weiß",
    "scope",
    "volts",
    "volt",
    "sample counts",
    "digital",
    "saturation",
];
/// Uncertainty and scatter: whole words of a name.
const UNCERTAINTIES: [&str; 20] = [
    "±",
    "sd",
    "std",
    "stdev",
    "stddev",
    "stdv",
    "sigma",
    "σ",
    "sem",
    "se",
    "error",
    "err",
    "uncertainty",
    "unc",
    "stderr",
    "stabw",
    "standardabweichung",
    "unsicherheit",
    "cv",
    "variance",
];
/// Running numbers: whole name of a column.
const NUMBERS: [&str; 34] = [
    "obs", "scan", "record", "seq", "sequence", "lfd", "lfd.", "lfd. nr.", "numéro", "numero", "no", "no.", "nr",
    "nr.", "n°", "num", "number", "#", "index", "idx", "id", "channel", "chan", "chan.", "ch", "kanal", "pixel", "pix",
    "row", "rownames", "zeile", "point", "band", "line",
];
/// Quantities that are neither light nor wavelength, in lower case.
const OTHERS: [&str; 44] = [
    "fwhm",
    "bandwidth",
    "bandpass",
    "resolution",
    "thickness",
    "dicke",
    "épaisseur",
    "espesor",
    "spessore",
    "depth",
    "tiefe",
    "height",
    "distance",
    "abstand",
    "position",
    "roughness",
    "diameter",
    "radius",
    "displacement",
    "film",
    "time",
    "zeit",
    "temps",
    "tiempo",
    "temperature",
    "temperatur",
    "température",
    "concentration",
    "konzentration",
    "pressure",
    "druck",
    "current",
    "strom",
    "voltage",
    "spannung",
    "humidity",
    "angle",
    "winkel",
    "theta",
    "date",
    "datum",
    "latitude",
    "longitude",
    "weight",
];

/// Quantities that are neither light nor wavelength: whole words of a name.
const OTHER_WORDS: [&str; 16] = [
    "year",
    "jahr",
    "année",
    "doy",
    "day",
    "tag",
    "month",
    "monat",
    "hour",
    "minute",
    "size",
    "grain",
    "particle",
    "frequency",
    "energy",
    "ph",
];

/// Returns true if one of `words` is part of `text`, both in lower case.
fn has_part(text: &str, words: &[&str]) -> bool {
    // Most words have a letter that the text has not: that is found faster than the word is missed.
    let mut seen = [false; 256];
    text.bytes().for_each(|byte| seen[usize::from(byte)] = true);
    words.iter().any(|word| word.bytes().all(|byte| seen[usize::from(byte)]) && text.contains(word))
}

/// Returns true if one of `words` is a word of `text`, both in lower case.
fn has_word(text: &str, words: &[&str]) -> bool {
    let separates =
        |c: char| c.is_whitespace() || matches!(c, '_' | '-' | '.' | '(' | ')' | '[' | ']' | ',' | ':' | '/' | '%');
    text.split(separates).any(|word| words.contains(&word))
}

/// Returns the name of a column in lower case without a unit in brackets.
fn without_unit(lower: &str) -> String {
    let mut depth = 0_usize;
    let mut kept = String::new();
    for c in lower.chars() {
        match c {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth = depth.saturating_sub(1),
            _ if depth == 0 => kept.push(c),
            _ => {}
        }
    }
    kept.trim().to_owned()
}

/// Returns true if a text in lower case says percent.
pub(super) fn says_percent(lower: &str) -> bool {
    lower.contains('%')
        || lower.contains("percent")
        || lower.contains("prozent")
        || has_word(lower, &["pct", "pourcent"])
}

/// Returns true for a name that is a letter and says percent, such as `%R`, `T (%)` or `R in %`, or ends so.
fn is_letter_in_percent(lower: &str) -> bool {
    let joined = lower.replace("(%)", "%").replace("[%]", "%");
    let words = || joined.split(|c: char| !c.is_alphanumeric() && c != '%').filter(|word| !word.is_empty());
    let is_sign = |word: &str| matches!(word, "%" | "percent" | "prozent" | "pct" | "in" | "λ" | "lambda");
    let mut letters = words().filter(|word| !is_sign(word)).map(|word| word.trim_matches('%'));
    let is_one = letters.next().is_some_and(|word| LETTERS.contains(&word)) && letters.next().is_none();
    let is_marked = |word: &str| word.contains('%') && LETTERS.contains(&word.trim_matches('%'));
    says_percent(lower) && is_one || words().any(is_marked)
}

/// Returns what the name of a column says that it holds; `in_percent` is true if its numbers have the sign.
pub(super) fn of_column(name: &str, in_percent: bool) -> Holds {
    match (names_wavelength(name), in_percent) {
        (true, _) => Holds::Wavelengths,
        (false, true) => beside_wavelengths(&format!("{name} %")),
        (false, false) => beside_wavelengths(name),
    }
}

/// Returns what the name of a column that holds no wavelengths says that it holds.
fn beside_wavelengths(name: &str) -> Holds {
    let lower = name.to_lowercase().replace('_', " ");
    let bare = without_unit(&lower);
    // pandas names a column without a name so.
    if NUMBERS.contains(&bare.as_str()) || lower.starts_with("unnamed: ") {
        return Holds::Numbers;
    }
    if names_factor(name) {
        return Holds::Factor;
    }
    let is_absorbance = bare == "a" && has_word(&lower, &["au", "abs"]);
    if is_absorbance || has_part(&lower, &LOGARITHMS) || has_word(&lower, &LOGARITHM_WORDS) {
        return Holds::Logarithm;
    }
    if has_word(&lower, &UNCERTAINTIES) {
        return Holds::Uncertainty;
    }
    if has_word(&lower, &["counts", "dn", "adu", "cts"]) {
        return Holds::Signal;
    }
    // Light that was reflected has a unit of its own.
    let is_ratio = has_part(&lower, &RATIOS) && !has_part(&lower, &["reflected", "transmitted", "w/", "w m", "w·m"]);
    if is_ratio || is_letter_in_percent(&lower) || has_word(&lower, &RATIO_WORDS) {
        return Holds::Ratio;
    }
    if lower.contains("refractive") || lower.contains("brechungsindex") || lower.contains("extinction coeff") {
        return Holds::Index;
    }
    if has_part(&lower, &LIGHT) {
        return Holds::Light;
    }
    if has_word(&lower, &SIGNALS) {
        return Holds::Signal;
    }
    if has_part(&lower, &OTHERS) || has_word(&lower, &OTHER_WORDS) {
        return Holds::Other;
    }
    Holds::Unstated
}

/// Words for ratios that are seldom part of prose on other subjects; `reflexion` is: "no reflexion".
const RATIOS_IN_PROSE: [&str; 8] = [
    "reflectance",
    "reflectivity",
    "transmittance",
    "transmissivity",
    "reflexionsgrad",
    "transmissionsgrad",
    "réflectance",
    "reflectancia",
];

/// Returns true for the name of a scan of the sample itself, beside those of a reference.
pub(super) fn names_sample(name: &str) -> bool {
    has_word(&name.to_lowercase(), &["sample", "target", "probe", "messung"])
}

/// Beginnings, in lower case, of lines that say what all values of a table are: `YUNITS  %T`.
const LABELS: [&str; 9] =
    ["yunits", "y units", "y unit", "y axis", "y-axis", "y label", "ylabel", "y-einheit", "measurement type"];
/// Number of words up to which a line is taken for a name of the values instead of prose.
const FEW_WORDS: usize = 2;

/// Returns what the lines of text around a table, in lower case, say that all of its values are, and true if they are
/// in percent.
pub(super) fn of_prose<'a>(lines: &(impl Iterator<Item = &'a str> + Clone)) -> (Holds, bool) {
    let named = lines.clone().map(str::trim).find_map(|line| {
        let label = LABELS.iter().find_map(|label| line.strip_prefix(label));
        let value = label.map(|rest| rest.trim_start_matches(|c: char| !c.is_alphanumeric() && c != '%'));
        let value = value.or_else(|| Some(line).filter(|line| line.split_whitespace().count() <= FEW_WORDS))?;
        let holds = of_column(value, false);
        let is_of_values = matches!(holds, Holds::Ratio | Holds::Factor | Holds::Logarithm);
        is_of_values.then(|| (holds, says_percent(value)))
    });
    named.unwrap_or_else(|| {
        let says = |said: &dyn Fn(&str) -> bool| lines.clone().find(|line| said(line));
        if says(&names_factor).is_some() {
            return (Holds::Factor, false);
        }
        let ratio = |line: &str| has_part(line, &RATIOS_IN_PROSE);
        // A number before the sign is an accuracy, or the reflectance of a standard.
        let in_percent = |line: &str| {
            ratio(line)
                && says_percent(line)
                && !line.split(['%']).any(|before| before.trim_end().ends_with(|c: char| c.is_ascii_digit()))
        };
        if says(&ratio).is_some() { (Holds::Ratio, says(&in_percent).is_some()) } else { (Holds::Unstated, false) }
    })
}

/// Returns true if the name of a column means wavelengths or wavenumbers, by its words or by its unit.
pub(in crate::formats) fn names_wavelength(name: &str) -> bool {
    let lower = name.to_lowercase();
    let bare = without_unit(&lower).replace('_', " ");
    if has_part(&lower, &NO_AXIS) {
        return false;
    }
    let words = || bare.split(|c: char| !c.is_alphanumeric()).any(|word| WAVELENGTH_NAMES.contains(&word));
    // As in `V(λ)` and `E_λ`, the letter elsewhere is what another quantity is a function of.
    let is_lambda = bare.starts_with(['λ']) || bare.starts_with("lambda");
    if is_lambda || has_part(&lower, &WAVELENGTHS) || WAVELENGTH_NAMES.contains(&bare.as_str()) {
        return true;
    }
    if WavelengthUnit::of_name(bare.trim_matches(|c: char| !c.is_alphanumeric())).is_some() {
        return true;
    }
    // A unit beside a word that names nothing else.
    let has_digit = bare.contains(|c: char| c.is_ascii_digit());
    WavelengthUnit::of_header(name).is_some() && !has_digit && (words() || beside_wavelengths(name) == Holds::Unstated)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_say_what_they_hold() {
        for (names, holds) in [
            (
                &[
                    "Wavelength (nm)",
                    "wl",
                    "Wvl",
                    "Wave [nm]",
                    "λ",
                    "Wellenlänge [nm]",
                    "lambda_um",
                    "nm",
                    "X (nm)",
                    "Longueur d'onde (nm)",
                    "wavenumber [cm-1]",
                    "Wave",
                    "WAVELENGTH",
                ][..],
                Holds::Wavelengths,
            ),
            (
                &[
                    "Reflectance",
                    "%T",
                    "R%",
                    "%R",
                    "Transmission [%]",
                    "Reflexionsgrad [%]",
                    "R [%] SCI",
                    "Reflect. %",
                    "Transmissionsgrad in %",
                    "T (%)",
                    "albedo",
                    "SCE",
                ],
                Holds::Ratio,
            ),
            (&["HCRF", "BRF_i10_e0"], Holds::Factor),
            (&["Absorbance", "Abs", "OD", "log(1/R)", "Extinktion"], Holds::Logarithm),
            (
                &["Sample [counts]", "Dark [counts]", "Norm. DN (Ref.)", "Reference", "raw", "Counts", "dark_current"],
                Holds::Signal,
            ),
            (&["Spectral irradiance (W/m2/nm)", "Radiance (W/m2/sr/nm)", "Power [mW/nm]", "photon flux"], Holds::Light),
            (&["sd", "std_dev", "Uncertainty (k=2)", "sigma"], Holds::Uncertainty),
            (&["No", "#", "Channel", "Chan.", "Pixel", "id", "Index"], Holds::Numbers),
            (&["Thickness (nm)", "Time (s)", "Temperature [°C]", "Film thickness [um]", "Depth (nm)"], Holds::Other),
            (&["A", "specglo", "value", "R", "550 nm", "leaf_1", "Peak wavelength (nm)", ""], Holds::Unstated),
        ] {
            for name in names {
                assert_eq!(of_column(name, false), holds, "{name}");
            }
        }
    }
}
