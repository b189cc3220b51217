//! Byte form of provenance: digests as raw bytes, the rest as text whose models are primed with typical provenance.
//!
//! ```text
//! provenance   varint number of digests, 32 bytes each, then a text (see `text`) in which byte 1 marks the place of
//!              the next digest: "b3-" and 64 hexadecimal digits
//! ```

use super::bytes::{Reader, Writer};
use super::error::CodecError;
use super::text::{read_text, write_text};

/// Typical metadata with which the text model is trained before coding. It is part of the format: any change changes
/// the coded bytes. A byte of value 1 marks the place of a hash digest.
const TYPICAL: &str = concat!(
    r#"{"generator":"wavelume 0.1.0","request":{"basis":"auto","metadata":true,"policy":"rd","target":{"er_"#,
    "l2\":0.01}},\"source\":{\"content_digest\":\"\x01\",\"dialect\":\"reflection scalar 2 x 3, transmission rgb 4 x 4",
    r#"","format":"mbsdf","metadata":[["theta","90"],["phi","91"]],"notes":[],"spectrum_digest":null}}{"gen"#,
    r#"erator":"wavelume 0.1.0","request":{"albedo_error":0.01,"basis":"auto","domain":"triangles","floor":"#,
    r#"0.001,"metadata":true,"outgoing_level":5,"policy":"rd","random_access":true,"target":"lossless"},"so"#,
    "urce\":{\"content_digest\":\"\x01\",\"dialect\":\"long, isotropic, wide\",\"format\":\"radiometric-csv\",\"metadata\":",
    r#"[["instrument",""],["operator",""],["date","2026-01-01"],["sample",""],["description",""],["licence""#,
    r#","CC0-1.0"]],"notes":[{"kind":"assumed","message":"no unit stated, taken as 1/sr"},{"kind":"assumed""#,
    r#","message":"the header names no quantity, taken as spectrum in relative values"}],"spectrum_digest":"#,
    "\"\x01\"}}{\"generator\":\"wavelume 0.1.0\",\"request\":{\"basis\":\"auto\",\"metadata\":true,\"policy\":\"rd\",\"target\":",
    "{\"er_l2\":0.01}},\"source\":{\"content_digest\":\"\x01\",\"dialect\":\"EULUMDAT, symmetric about C0-C180\",\"format",
    r#"":"eulumdat","metadata":[["company","GmbH"],["luminaire_type","1"],["symmetry","1"],["c_planes","1"]"#,
    r#",["c_step","0"],["gamma_angles","37"],["gamma_step","2.5"],["report",""],["luminaire","LED"],["lumin"#,
    r#"aire_number","000"],["file_name",".ldt"],["date",""],["luminaire_length_mm","600"],["luminaire_width"#,
    r#"_mm","0"],["luminaire_height_mm","0"],["luminous_length_mm","0"],["luminous_width_mm","0"],["luminou"#,
    r#"s_height_c0_mm","0"],["luminous_height_c90_mm","0"],["luminous_height_c180_mm","0"],["luminous_heigh"#,
    r#"t_c270_mm","0"],["downward_flux_percent","100"],["light_output_ratio_percent","100"],["conversion_fa"#,
    r#"ctor","1"],["tilt_degrees","0"],["lamps","1"],["lamp","LED"],["lumens","1000"],["colour","3000K"],[""#,
    r#"colour_rendering","80"],["watts","10"],["direct_ratio_k0.6","0.5"],["direct_ratio_k0.8","0.6"],["dir"#,
    r#"ect_ratio_k1","0.7"],["direct_ratio_k1.25","0.75"],["direct_ratio_k1.5","0.8"],["direct_ratio_k2","0"#,
    r#".85"],["direct_ratio_k2.5","0.9"],["direct_ratio_k3","0.92"],["direct_ratio_k4","0.95"],["direct_rat"#,
    r#"io_k5","0.97"],["flux_of_the_intensities_lm","100"]],"notes":[{"kind":"warning","message":"the inten"#,
    r#"sities make 100 lm, 90 % of the 1000 lm stated; kept as they are"},{"kind":"skipped","message":"lamp"#,
    r#" sets after the first are kept as keywords"}],"spectrum_digest":null}}{"generator":"wavelume 0.1.0","#,
    r#""request":{"basis":"auto","metadata":true,"policy":"rd","target":{"er_l2":0.01}},"source":{"content_"#,
    "digest\":\"\x01\",\"dialect\":\"LM-63-2002, type C, quadrants\",\"format\":\"lm-63\",\"metadata\":[[\"TEST\",\"\"],[\"TES",
    r#"TLAB",""],["ISSUEDATE","January 1, 2020"],["TESTDATE",""],["NEARFIELD",""],["MANUFAC",""],["LUMCAT","#,
    r#"""],["LUMINAIRE",""],["LAMPCAT",""],["LAMP","LED"],["BALLASTCAT",""],["BALLAST",""],["DISTRIBUTION","#,
    r#"""],["FLASHAREA",""],["COLORCONSTANT",""],["LAMPPOSITION","0,0"],["OTHER",""],["SEARCH",""],["MORE","#,
    r#"""],["FILEGENINFO",""],["_ABSOLUTE",""],["tilt","NONE"],["lamps","1"],["lumens_per_lamp","-1"],["can"#,
    r#"dela_multiplier","1"],["photometric_type","C"],["luminous_opening","rectangle"],["luminous_width","0"#,
    r#".1 m"],["luminous_length","0.1 m"],["luminous_height","0 m"],["luminous_diameter","0 m"],["ballast_f"#,
    r#"actor","1"],["ballast_lamp_factor","1"],["field_12","1"],["input_watts","10"]],"notes":[{"kind":"war"#,
    r#"ning","message":"near-field photometry: intensities hold at the distances of [NEARFIELD] only"},{"ki"#,
    r#"nd":"warning","message":"relative photometry: the intensities are for the stated 1000 lumens"}],"spe"#,
    r#"ctrum_digest":null}}"#,
);
/// Marker before the hexadecimal digits of a hash digest in metadata.
const PREFIX: &str = "b3-";
/// Length of a hash digest in bytes.
const DIGEST: usize = 32;
/// Largest number of hash digests in one metadata text that are stored as raw bytes.
const MOST_DIGESTS: usize = 64;
/// Placeholder of a hash digest in metadata. JSON text never contains this character unescaped.
const MARK: char = '\u{1}';

/// Returns the hash digest at the start of `text` and the length of its textual form in bytes.
fn digest_at(text: &str) -> Option<([u8; DIGEST], usize)> {
    let digits = text.strip_prefix(PREFIX)?.as_bytes().get(..2 * DIGEST)?;
    let nibble = |digit: u8| match digit {
        b'0'..=b'9' => Some(digit - b'0'),
        b'a'..=b'f' => Some(digit - b'a' + 10),
        _ => None,
    };
    let mut digest = [0; DIGEST];
    for (byte, pair) in digest.iter_mut().zip(digits.chunks_exact(2)) {
        *byte = nibble(pair[0])? << 4 | nibble(pair[1])?;
    }
    Some((digest, PREFIX.len() + 2 * DIGEST))
}

/// Encodes a metadata text, such as JSON, that does not contain the placeholder [`MARK`].
pub(crate) fn write_provenance(text: &str) -> Vec<u8> {
    let mut digests = Vec::new();
    let mut short = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find(PREFIX) {
        short.push_str(&rest[..at]);
        rest = &rest[at..];
        if let Some((digest, length)) = digest_at(rest).filter(|_| digests.len() < MOST_DIGESTS) {
            digests.push(digest);
            short.push(MARK);
            rest = &rest[length..];
        } else {
            short.push_str(PREFIX);
            rest = &rest[PREFIX.len()..];
        }
    }
    short.push_str(rest);
    let mut w = Writer::default();
    w.varint(digests.len() as u64);
    for digest in &digests {
        w.raw(digest);
    }
    w.raw(&write_text(TYPICAL, &short));
    w.into_bytes()
}

/// Decodes a metadata text from the remaining bytes of `r`. At most `limit` bytes are accepted, in which each hash
/// digest counts as one.
pub(crate) fn read_provenance(r: &mut Reader<'_>, limit: usize) -> Result<String, CodecError> {
    let count = r.size(MOST_DIGESTS, "number of digests")?;
    let digests = r.take(count * DIGEST, "digests")?;
    let short = read_text(TYPICAL, r, limit)?;
    let marks = short.matches(MARK).count();
    if marks != count {
        return Err(r.malformed(format!("the metadata have {count} hash digests for {marks} places in their text")));
    }
    let mut text = String::with_capacity(short.len() + count * (PREFIX.len() + 2 * DIGEST));
    let mut parts = short.split(MARK);
    text.push_str(parts.next().unwrap_or_default());
    for (digest, part) in digests.chunks_exact(DIGEST).zip(parts) {
        text.push_str(PREFIX);
        for byte in digest {
            for nibble in [byte >> 4, byte & 15] {
                text.push(char::from(b"0123456789abcdef"[usize::from(nibble)]));
            }
        }
        text.push_str(part);
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::drawn::{any_list, list, text};
    use arbtest::arbtest;

    const LIMIT: usize = 1 << 16;

    fn read(bytes: &[u8]) -> Result<String, CodecError> {
        read_provenance(&mut Reader::new(bytes, 0), LIMIT)
    }

    fn name(digit: char) -> String {
        PREFIX.to_owned() + &String::from(digit).repeat(2 * DIGEST)
    }

    #[test]
    fn digests_take_their_32_bytes_and_come_back() {
        let text = format!(r#"{{"source":{{"content_digest":"{}","spectrum_digest":"{}"}}}}"#, name('7'), name('c'));
        let bytes = write_provenance(&text);
        assert_eq!(read(&bytes).unwrap(), text);
        assert!(bytes.len() < 2 * DIGEST + 24, "{}", bytes.len());
        for other in ["b3-", "b3-b3-12", &name('g'), &name('7')[..60], "", &name('a').to_uppercase()] {
            assert_eq!(read(&write_provenance(other)).unwrap(), other);
        }
        let many = name('0').repeat(MOST_DIGESTS + 3);
        assert_eq!(read(&write_provenance(&many)).unwrap(), many);
    }

    #[test]
    fn digests_without_a_place_and_places_without_a_digest_are_refused() {
        let mut w = Writer::default();
        w.varint(1);
        w.raw(&[7; DIGEST]);
        w.raw(&write_text(TYPICAL, "{}"));
        assert!(matches!(read(&w.into_bytes()), Err(CodecError::Malformed { .. })));
        let mut w = Writer::default();
        w.varint(0);
        w.raw(&write_text(TYPICAL, "\u{1}"));
        assert!(matches!(read(&w.into_bytes()), Err(CodecError::Malformed { .. })));
        let mut w = Writer::default();
        w.varint(65);
        assert!(matches!(read(&w.into_bytes()), Err(CodecError::Malformed { .. })));
    }

    #[test]
    fn any_text_round_trips() {
        arbtest(|u| {
            let any = text(u, 80)?;
            let like_digests: String =
                list(u, 0..=200, |u| u.choose(b"b3acdef012456789 -").map(|&c| char::from(c)))?.into_iter().collect();
            for text in [any, like_digests] {
                assert_eq!(read(&write_provenance(&text)).unwrap(), text);
            }
            Ok(())
        });
    }

    #[test]
    fn any_bytes_are_provenance_or_an_error() {
        arbtest(|u| {
            let bytes: Vec<u8> = any_list(u, 0..=199)?;
            let _ = read(&bytes);
            Ok(())
        });
    }
}
