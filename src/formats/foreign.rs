//! Formats that are recognised but not read: each with its signature and what the user can do instead.

use super::Sample;

/// A kind of file that is not read here.
struct Foreign {
    name: &'static str,
    advice: &'static str,
    matches: fn(&Sample<'_>) -> bool,
}

const CONVERT: &str = "convert it to a NumPy array with a manifest of its axes";
const UNPACK: &str = "decompress it, or send it with the matching Content-Encoding";

const TABLE: &[Foreign] = &[
    Foreign { name: "gzip compressed data", advice: UNPACK, matches: |s| s.bytes.starts_with(b"\x1f\x8b") },
    Foreign { name: "zstd compressed data", advice: UNPACK, matches: |s| s.bytes.starts_with(b"\x28\xb5\x2f\xfd") },
    Foreign {
        name: "a material, compressed already",
        advice: "inspect, decode, evaluate or sample it",
        matches: |s| s.bytes.starts_with(b"\x89WLM"),
    },
    Foreign {
        name: "an X-Rite AxF appearance (HDF5 inside)",
        advice: "its layout is not public: export the measurement from the vendor's software as text",
        matches: |s| is_hdf5(s) && contains(s.bytes, b"axf"),
    },
    Foreign { name: "HDF5 or NetCDF-4", advice: CONVERT, matches: is_hdf5 },
    Foreign {
        name: "a MATLAB file (.mat)",
        advice: "write a table or an array instead: `wavelume formats --template radiometric-csv-wide`",
        matches: |s| s.bytes.starts_with(b"MATLAB 5.0 MAT-file") || s.bytes.starts_with(b"MATLAB 7.3 MAT-file"),
    },
    Foreign {
        name: "a spreadsheet of old Excel (.xls)",
        advice: "save it as CSV",
        matches: |s| s.bytes.starts_with(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"),
    },
    Foreign {
        name: "a tar archive",
        advice: "send the files one by one, or in a zip archive",
        matches: |s| s.bytes.get(257..262) == Some(b"ustar"),
    },
    Foreign {
        name: "a 7-Zip archive",
        advice: "send the files one by one, or in a zip archive",
        matches: |s| s.bytes.starts_with(b"7z\xbc\xaf\x27\x1c"),
    },
    Foreign {
        name: "a RAR archive",
        advice: "send the files one by one, or in a zip archive",
        matches: |s| s.bytes.starts_with(b"Rar!\x1a\x07"),
    },
    Foreign { name: "NetCDF-3", advice: CONVERT, matches: |s| matches!(s.bytes, [b'C', b'D', b'F', 1 | 2 | 5, ..]) },
    Foreign { name: "Parquet", advice: CONVERT, matches: |s| s.bytes.starts_with(b"PAR1") },
    Foreign {
        name: "a PNG image",
        advice: "pictures are no measurements",
        matches: |s| s.bytes.starts_with(b"\x89PNG"),
    },
    Foreign {
        name: "a JPEG image",
        advice: "pictures are no measurements",
        matches: |s| s.bytes.starts_with(b"\xff\xd8\xff"),
    },
    Foreign { name: "an OpenEXR image", advice: CONVERT, matches: |s| s.bytes.starts_with(b"\x76\x2f\x31\x01") },
    Foreign { name: "a PDF document", advice: "send the data themselves", matches: |s| s.bytes.starts_with(b"%PDF-") },
    Foreign { name: "ASD FieldSpec", advice: "export it as text", matches: is_asd },
    Foreign {
        name: "a UTIA BRDF (.bin)",
        advice: CONVERT,
        matches: |s| s.bytes.len() == 3 * 288 * 288 * 8 && s.head.contains('\0'),
    },
    Foreign {
        name: "ASTM E1392 scatter data",
        advice: CONVERT,
        matches: |s| s.head.lines().take(100).any(|line| line.trim_start().starts_with("VARS theta_i")),
    },
    Foreign {
        name: "SSDD scatter data",
        advice: CONVERT,
        matches: |s| s.head.starts_with("VERSION 0.") && s.head.contains("DATA_TYPE"),
    },
    Foreign {
        name: "a Zemax or LightTools BSDF",
        advice: CONVERT,
        matches: |s| s.head.contains("Symmetry") && s.head.contains("SpectralContent"),
    },
    Foreign {
        name: "a gonioscatterometer's table (pab mountain text)",
        advice: CONVERT,
        matches: |s| s.head.lines().take(100).any(|line| line.starts_with("#format: theta phi")),
    },
    Foreign { name: "a Speos BRDF", advice: CONVERT, matches: |s| s.head.starts_with("OPTIS - ") },
    Foreign {
        name: "CGATS spectral data",
        advice: "export the spectra as CSV",
        matches: |s| s.head.contains("BEGIN_DATA_FORMAT"),
    },
    Foreign { name: "JCAMP-DX", advice: "export the spectrum as CSV", matches: |s| s.head.starts_with("##TITLE=") },
    Foreign {
        name: "an ENVI header",
        advice: "export the spectra as CSV",
        matches: |s| s.head.starts_with("ENVI\n") || s.head.starts_with("ENVI\r"),
    },
    Foreign {
        name: "the manifest of an array",
        advice: "send the .npy file and name the manifest as its axes",
        matches: |s| s.head.trim_start().starts_with('{') && s.head.contains("\"axes\""),
    },
];

/// What the file is and what to do about it, if it is known but not read.
pub(super) fn recognise(sample: &Sample<'_>) -> Option<String> {
    if let Some(root) = xml_root(&sample.head) {
        return Some(xml(root, &sample.head));
    }
    let foreign = TABLE.iter().find(|foreign| (foreign.matches)(sample))?;
    Some(format!("this is {}, which is not read: {}", foreign.name, foreign.advice))
}

fn is_hdf5(sample: &Sample<'_>) -> bool {
    sample.bytes.starts_with(b"\x89HDF\r\n\x1a\n")
}

/// Whether the first 64 KiB contain `needle`, in whatever case.
fn contains(bytes: &[u8], needle: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(super::HEAD_BYTES)];
    head.windows(needle.len()).any(|window| window.eq_ignore_ascii_case(needle))
}

fn is_asd(sample: &Sample<'_>) -> bool {
    let mark = sample.bytes.get(..3);
    sample.head.contains('\0') && (mark == Some(b"ASD") || matches!(mark, Some([b'a', b's', b'2'..=b'8'])))
}

/// The local name of the root element, if the text is XML.
pub(super) fn xml_root(head: &str) -> Option<&str> {
    let mut rest = head.trim_start();
    if !rest.starts_with('<') {
        return None;
    }
    loop {
        let (open, close) = match rest {
            _ if rest.starts_with("<?") => ("<?", "?>"),
            _ if rest.starts_with("<!--") => ("<!--", "-->"),
            _ if rest.starts_with("<!") => ("<!", ">"),
            _ => break,
        };
        let end = rest[open.len()..].find(close)? + open.len() + close.len();
        rest = rest[end..].trim_start();
    }
    let name = rest.strip_prefix('<')?;
    let name = name.split(|c: char| c.is_whitespace() || matches!(c, '>' | '/')).next()?;
    let local = name.rsplit(':').next()?;
    (!local.is_empty()).then_some(local)
}

fn xml(root: &str, head: &str) -> String {
    let (name, advice) = match root {
        "IESTM33-22" | "LuminaireOpticalData" => ("an IES TM-33 luminaire (XML)", "send the luminaire as LM-63 (.ies)"),
        "WindowElement" => ("a WINDOW BSDF (Klems or tensor tree XML)", CONVERT),
        "CxF" => ("CxF3 colour data (XML)", "export the spectra as CSV"),
        "Root" if head.contains("gldf.io") => {
            ("the description of a GLDF luminaire (XML)", "send the .gldf archive, or its .ies and .ldt files")
        }
        "html" | "HTML" => ("a web page", "send the file itself"),
        other => {
            let root = super::text::snippet(other);
            return format!("this is XML with the root {root}, which is no measurement known here");
        }
    };
    format!("this is {name}, which is not read: {advice}")
}

#[cfg(test)]
mod tests {
    use super::super::{FormatErrorKind, Interpretation, read};

    #[test]
    fn every_known_stranger_is_named() {
        let mut tar = vec![0; 512];
        tar[257..262].copy_from_slice(b"ustar");
        for (bytes, word) in [
            (b"\x1f\x8b\x08\0\0\0\0\0".to_vec(), "gzip"),
            (b"\x28\xb5\x2f\xfd\0\0".to_vec(), "zstd"),
            (tar, "tar archive"),
            (b"7z\xbc\xaf\x27\x1c\0\x04".to_vec(), "7-Zip"),
            (b"Rar!\x1a\x07\x01\0".to_vec(), "RAR"),
            (b"MATLAB 5.0 MAT-file, Platform: GLNXA64".to_vec(), "MATLAB"),
            (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1\0\0".to_vec(), "Excel"),
            (b"\x89HDF\r\n\x1a\n\0\0com.xrite.AxF\0".to_vec(), "AxF"),
            (b"#sample_name \"x\"\n#format: theta phi DSF\n10 20 0.1\n".to_vec(), "mountain"),
            (b"\x89WLM\x01H".to_vec(), "material"),
            (b"\x89HDF\r\n\x1a\n\0\0".to_vec(), "HDF5"),
            (b"CDF\x01\0\0".to_vec(), "NetCDF-3"),
            (b"PAR1\x15\x04".to_vec(), "Parquet"),
            (b"\x89PNG\r\n\x1a\n".to_vec(), "PNG"),
            (b"\xff\xd8\xff\xe0".to_vec(), "JPEG"),
            (b"%PDF-1.7".to_vec(), "PDF"),
            (b"as7\0\0\0\0".to_vec(), "ASD"),
            (vec![0; 1_990_656], "UTIA"),
            (b"##TITLE=x\n".to_vec(), "JCAMP"),
            (b"ENVI\nsamples = 3\n".to_vec(), "ENVI"),
            (b"CTI3\nBEGIN_DATA_FORMAT\n".to_vec(), "CGATS"),
            (b"OPTIS - Anisotropic BSDF\n".to_vec(), "Speos"),
            (b"\xef\xbb\xbf<?xml version=\"1.0\"?>\n<!-- x -->\n<cc:CxF xmlns:cc=\"u\">".to_vec(), "CxF3"),
            (b"<!DOCTYPE html><html>".to_vec(), "web page"),
            (b"<WindowElement>".to_vec(), "WINDOW"),
            (b"<IESTM33-22/>".to_vec(), "TM-33"),
            (b"<item></item>".to_vec(), "`item`"),
            (b"{\"quantity\": \"brdf\", \"axes\": []}".to_vec(), "manifest"),
        ] {
            let error = read(&bytes, &Interpretation::default()).unwrap_err();
            assert_eq!(error.kind, FormatErrorKind::Unsupported, "{word}: {error}");
            assert!(error.message.contains(word), "{word}: {error}");
        }
    }

    #[test]
    fn anything_else_is_unrecognised() {
        for bytes in [&b""[..], b" ", b"<", b"<!--", b"Lorem ipsum", b"\0\0\0\0", b"\xff\xfe\xff"] {
            let error = read(bytes, &Interpretation::default()).unwrap_err();
            assert_eq!(error.kind, FormatErrorKind::Unrecognised, "{error}");
        }
        assert!(read(b"", &Interpretation::default()).unwrap_err().message.contains("empty"));
    }
}
