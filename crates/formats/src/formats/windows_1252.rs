//! Text in Windows-1252, in which programs of the lighting trade show the names in luminaire files.

use encoding_rs::WINDOWS_1252;
use unicode_normalization::UnicodeNormalization;
use unicode_normalization::char::is_combining_mark;

/// Characters that Windows-1252 lacks and that do not decompose into ones that it has, with what is written for them.
const WRITTEN: [(char, &str); 58] = [
    ('Ł', "L"),
    ('ł', "l"),
    ('Đ', "D"),
    ('đ', "d"),
    ('Ħ', "H"),
    ('ħ', "h"),
    ('ı', "i"),
    ('ĸ', "k"),
    ('Ŋ', "N"),
    ('ŋ', "n"),
    ('ẞ', "SS"),
    ('Α', "A"),
    ('Β', "B"),
    ('Γ', "Gamma"),
    ('Δ', "Delta"),
    ('Θ', "Theta"),
    ('Λ', "Lambda"),
    ('Π', "Pi"),
    ('Σ', "Sigma"),
    ('Φ', "Phi"),
    ('Ψ', "Psi"),
    ('Ω', "Ohm"),
    ('α', "alpha"),
    ('β', "beta"),
    ('γ', "gamma"),
    ('δ', "delta"),
    ('ε', "epsilon"),
    ('η', "eta"),
    ('θ', "theta"),
    ('λ', "lambda"),
    ('μ', "µ"),
    ('π', "pi"),
    ('ρ', "rho"),
    ('σ', "sigma"),
    ('τ', "tau"),
    ('φ', "phi"),
    ('ω', "omega"),
    ('∆', "Delta"),
    ('∑', "Sigma"),
    ('−', "-"),
    ('‐', "-"),
    ('‒', "-"),
    ('―', "-"),
    ('≤', "<="),
    ('≥', ">="),
    ('≠', "!="),
    ('≈', "~"),
    ('∞', "inf"),
    ('√', "sqrt"),
    ('⌀', "Ø"),
    ('∅', "Ø"),
    ('′', "'"),
    ('→', "->"),
    ('←', "<-"),
    ('↔', "<->"),
    ('⁄', "/"),
    ('∙', "·"),
    ('⋅', "·"),
];

/// Mark that stands for a character which can be neither written nor transliterated.
const NO_CHARACTER: &str = "?";

/// Returns `text` with what Windows-1252 can hold: letters composed, other characters transliterated or replaced by
/// `?`, control characters other than line ends by blanks. `changed` is told each character that is written otherwise,
/// with what is written.
fn fitted(text: &str, mut changed: impl FnMut(char, &str)) -> String {
    let mut fitted = String::with_capacity(text.len());
    for found in text.nfc() {
        if matches!(found, '\r' | '\n') || (has(found) && !found.is_control()) {
            fitted.push(found);
        } else if found.is_control() {
            fitted.push(' ');
            if found != '\t' {
                changed(found, " ");
            }
        } else {
            let written = transliterated(found);
            changed(found, &written);
            fitted.push_str(&written);
        }
    }
    fitted
}

/// Returns true if Windows-1252 has the character.
fn has(found: char) -> bool {
    let mut buffer = [0; 4];
    found.is_ascii() || !WINDOWS_1252.encode(found.encode_utf8(&mut buffer)).2
}

fn transliterated(found: char) -> String {
    let listed = |found: char| WRITTEN.iter().find(|(listed, _)| *listed == found).map(|(_, text)| (*text).to_owned());
    if let Some(text) = listed(found) {
        return text;
    }
    let parts = std::iter::once(found).nfkd().filter(|part| !is_combining_mark(*part));
    let part = |part: char| if has(part) { Some(part.to_string()) } else { listed(part) };
    match parts.map(part).collect::<Option<String>>() {
        Some(text) if !text.is_empty() => text,
        // A mark alone.
        Some(text) if is_combining_mark(found) => text,
        _ => NO_CHARACTER.to_owned(),
    }
}

/// Encodes a text in Windows-1252; see [`fitted`].
pub(super) fn encoded(text: &str) -> Vec<u8> {
    WINDOWS_1252.encode(&fitted(text, |_, _| ())).0.into_owned()
}

/// Most characters that a sentence about changed texts names. Raising it lengthens the sentence.
const NAMED: usize = 8;

/// Describes how texts differ from what a file in Windows-1252 holds of them; empty if they do not.
pub(crate) fn changes<'a>(texts: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut pairs: Vec<(char, String)> = Vec::new();
    let mut doubtful = Vec::new();
    for text in texts {
        let mut note = |found: char, written: &str| {
            if pairs.iter().all(|(known, _)| *known != found) {
                pairs.push((found, written.to_owned()));
            }
        };
        let fitted = fitted(text, &mut note);
        // Readers tell UTF-8 by its bytes.
        if !fitted.is_ascii() && str::from_utf8(&encoded(&fitted)).is_ok() {
            doubtful.push(super::text::snippet(&fitted));
        }
    }
    let mut told = Vec::new();
    if !pairs.is_empty() {
        let more = pairs.len().saturating_sub(NAMED);
        let written = |(found, written): &(char, String)| format!("{} as {}", quoted(*found), in_quotes(written));
        let mut list: Vec<String> = pairs.iter().take(NAMED).map(written).collect();
        if more > 0 {
            list.push(format!("{more} more"));
        }
        told.push(format!("characters that Windows-1252 lacks: {}", list.join(", ")));
    }
    if let Some(first) = doubtful.first() {
        told.push(format!("the difference of {first} from UTF-8, as which programs may read it"));
    }
    told
}

fn quoted(found: char) -> String {
    if found.is_control() || is_combining_mark(found) {
        format!("U+{:04X}", u32::from(found))
    } else {
        format!("`{found}`")
    }
}

fn in_quotes(written: &str) -> String {
    match written {
        " " => "a blank".to_owned(),
        "" => "nothing".to_owned(),
        text => format!("`{text}`"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::text::unmarked;
    use super::*;

    #[test]
    fn what_the_encoding_has_comes_back() {
        let text = "Ä ü Ø m² ß é µ ° € „Œuvre“ – … ™ Š ž ÿ";
        let bytes = encoded(text);
        assert_eq!(bytes.len(), text.chars().count());
        assert_eq!(unmarked(&bytes), (text.into(), super::super::text::WINDOWS));
        // Every byte that stands for a character.
        let all: Vec<u8> = (0x20..=0x7e).chain(0xa0..=0xff).chain(0x80..=0x9f).collect();
        let gaps = [0x81, 0x8d, 0x8f, 0x90, 0x9d];
        let all: Vec<u8> = all.into_iter().filter(|byte| !gaps.contains(byte)).collect();
        assert_eq!(encoded(&unmarked(&all).0), all);
    }

    #[test]
    fn other_characters_are_transliterated_and_told() {
        for (text, written) in [
            ("Mu\u{308}ller", "Müller"),
            ("Łódź", "Lódz"),
            ("světlo", "svetlo"),
            ("İstanbul ğış", "Istanbul gis"),
            ("őű", "ou"),
            ("CO₂ ≥ 5 Ω", "CO2 >= 5 Ohm"),
            ("⌀60 → 5 μm", "Ø60 -> 5 µm"),
            ("5\u{2009}m", "5 m"),
            ("灯", "?"),
            ("a\u{81}b\u{9d}c\td", "a b c d"),
            ("光💡", "??"),
            ("\u{212b}\u{2126}", "ÅOhm"),
        ] {
            assert_eq!(unmarked(&encoded(text)).0, written, "{text}");
            let told = changes([text].into_iter());
            assert_eq!(told.is_empty(), text.nfc().eq(written.chars()), "{text}: {told:?}");
        }
        let told = changes(["Łódź →", "plain", "Ä\u{81}"].into_iter());
        let words = "characters that Windows-1252 lacks: `Ł` as `L`, `ź` as `z`, `→` as `->`, U+0081 as a blank";
        assert_eq!(told, [words]);
        let many: String = ('Α'..='Ρ').collect();
        assert!(changes([many.as_str()].into_iter())[0].ends_with(", 9 more"));
        assert!(changes(["Ã¼"].into_iter())[0].contains("UTF-8"));
        assert!(changes(["Müller"].into_iter()).is_empty());
    }
}
