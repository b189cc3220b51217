//! Formats that are recognised but not read: signatures and advice for the user.

mod words;

use super::radiometric_csv::unmarked;
use super::reader::{HEAD_BYTES, Sample};

/// File format that is recognised but cannot be read, with advice for the user.
struct Foreign {
    name: &'static str,
    advice: &'static str,
    matches: fn(&Sample<'_>) -> bool,
}

const CONVERT: &str = "write its directions and values as a table (`wavelume formats --template radiometric-csv-wide`), or \
                       values on a grid as a NumPy array with a manifest of its axes; docs/labs.md has scripts";
const UNPACK: &str = "decompress it, or send it with the matching Content-Encoding";
const LUMINAIRE: &str = "send the luminaire as LM-63 (.ies)";
const DIRECTIONS: &str = "write it as radiometric-csv with the columns theta_i (zenith angle of the source), theta_o (viewing \
                          zenith) and phi_o (azimuth of the viewer from that of the source: 0 on its side, 180 opposite), and \
                          `# quantity: reflectance-factor` where values are BRF or HCRF; docs/labs.md has an example";
const UNZIP: &str = "send the files one by one, or in a zip archive";

/// Files in the place of another file, whose name they have. Some contain the words of that format.
const IN_PLACE: &[Foreign] = &[
    Foreign {
        name: "a pointer of Git LFS to the file itself",
        advice: "fetch the file (`git lfs pull`) and send it",
        matches: |s| {
            let begins = |mark: &&str| s.head.trim_start().starts_with(mark);
            ["version https://git-lfs.github.com/spec/", "version https://hawser.github.com/spec/"].iter().any(begins)
        },
    },
    Foreign {
        name: "a pointer of git-annex to the file itself",
        advice: "fetch the file (`git annex get`) and send it",
        matches: |s| s.head.lines().next().is_some_and(|line| line.contains("/annex/objects/")),
    },
    Foreign {
        name: "rich text (RTF) of a word processor",
        advice: "save the file as plain text",
        matches: |s| s.head.trim_start().starts_with("{\\rtf"),
    },
];

const TABLE: &[Foreign] = &[
    Foreign { name: "gzip compressed data", advice: UNPACK, matches: |s| s.bytes.starts_with(b"\x1f\x8b") },
    Foreign { name: "zstd compressed data", advice: UNPACK, matches: |s| s.bytes.starts_with(b"\x28\xb5\x2f\xfd") },
    Foreign {
        name: "bzip2 compressed data",
        advice: "decompress it",
        matches: |s| matches!(s.bytes, [b'B', b'Z', b'h', b'1'..=b'9', rest @ ..] if rest.starts_with(b"1AY&SY")),
    },
    Foreign { name: "xz compressed data", advice: "decompress it", matches: |s| s.bytes.starts_with(b"\xfd7zXZ\0") },
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
    Foreign { name: "a spreadsheet (.xlsx)", advice: "save it as CSV", matches: |s| is_workbook(s.bytes) },
    Foreign { name: "a tar archive", advice: UNZIP, matches: |s| s.bytes.get(257..262) == Some(b"ustar") },
    Foreign { name: "a 7-Zip archive", advice: UNZIP, matches: |s| s.bytes.starts_with(b"7z\xbc\xaf\x27\x1c") },
    Foreign { name: "a RAR archive", advice: UNZIP, matches: |s| s.bytes.starts_with(b"Rar!\x1a\x07") },
    Foreign { name: "NetCDF-3", advice: CONVERT, matches: |s| matches!(s.bytes, [b'C', b'D', b'F', 1 | 2 | 5, ..]) },
    Foreign { name: "Parquet", advice: CONVERT, matches: |s| s.bytes.starts_with(b"PAR1") },
    Foreign {
        name: "a PNG image",
        advice: "a picture holds no measured values: export the measurement as numbers",
        matches: |s| s.bytes.starts_with(b"\x89PNG"),
    },
    Foreign {
        name: "a JPEG image",
        advice: "a picture holds no measured values: export the measurement as numbers",
        matches: |s| s.bytes.starts_with(b"\xff\xd8\xff"),
    },
    Foreign { name: "an OpenEXR image", advice: CONVERT, matches: |s| s.bytes.starts_with(b"\x76\x2f\x31\x01") },
    Foreign { name: "a PDF document", advice: "send the data themselves", matches: |s| s.bytes.starts_with(b"%PDF-") },
    Foreign {
        name: "a UTIA BRDF (.bin)",
        advice: CONVERT,
        matches: |s| s.bytes.len() == 3 * 288 * 288 * 8 && s.head.contains('\0'),
    },
    Foreign { name: "ASTM E1392 scatter data", advice: CONVERT, matches: |s| says(s, "vars theta_i") },
    Foreign {
        name: "SSDD scatter data",
        advice: CONVERT,
        matches: |s| s.head.starts_with("VERSION 0.") && s.head.contains("DATA_TYPE"),
    },
    Foreign {
        name: "a LightTools BSDF",
        advice: CONVERT,
        matches: |s| says(s, "symmetry") && says(s, "spectralcontent") && (says(s, "aoi") || says(s, "side")),
    },
    Foreign {
        name: "a Zemax or LightTools BSDF without its list of angles of incidence",
        advice: CONVERT,
        matches: |s| says(s, "symmetry") && says(s, "spectralcontent"),
    },
    Foreign {
        name: "an Integra BSDF (.ddr, .ddt)",
        advice: CONVERT,
        matches: |s| says(s, "typesym") && says(s, "typecolormodel"),
    },
    Foreign {
        name: "a gonioscatterometer's table (pab mountain text)",
        advice: CONVERT,
        matches: |s| ["#format: theta phi", "#intheta", "#incident_angle"].into_iter().any(|key| says(s, key)),
    },
    Foreign { name: "a BRDF of pbrt-v2 (.brdf)", advice: CONVERT, matches: is_pbrt },
    Foreign { name: "a Speos BRDF", advice: CONVERT, matches: |s| s.head.starts_with("OPTIS - ") },
    Foreign {
        name: "CGATS spectral data",
        advice: "export the spectra as CSV",
        matches: |s| {
            let first = s.head.lines().next().unwrap_or_default().trim();
            s.head.contains("BEGIN_DATA_FORMAT") || ["CTI3", "SPECT", "CGATS.17", "ISO28178"].contains(&first)
        },
    },
    Foreign { name: "JCAMP-DX", advice: "export the spectrum as CSV", matches: |s| s.head.starts_with("##TITLE=") },
    Foreign {
        name: "an ENVI header",
        advice: "export the spectra as CSV",
        matches: |s| s.head.starts_with("ENVI\n") || s.head.starts_with("ENVI\r"),
    },
    Foreign {
        name: "an IES TM-33 luminaire (JSON)",
        advice: LUMINAIRE,
        matches: |s| {
            let marks = ["ATLA_S001", "IESTM33", "\"IntDataSymm\""];
            s.head.trim_start().starts_with('{') && marks.iter().any(|mark| s.head.contains(mark))
        },
    },
    Foreign {
        name: "refractive indices (refractiveindex.info, YAML)",
        advice: "they are no measurement of light: send reflectances or transmittances",
        matches: |s| {
            says(s, "DATA:") && ["tabulated n", "tabulated k", "type: formula"].iter().any(|word| s.head.contains(word))
        },
    },
    Foreign {
        name: "a coating file of Zemax: layers, and refractive indices of their materials",
        advice: "it holds no measurement: send reflectances or transmittances",
        matches: |s| says(s, "MATE ") || (says(s, "COAT ") && !s.head.contains(';')),
    },
    Foreign {
        name: "a glass catalogue (.agf): coefficients of refractive indices",
        advice: "it holds no measurement: send reflectances or transmittances",
        matches: |s| says(s, "NM ") && says(s, "CD "),
    },
    Foreign { name: "a TracePro surface property", advice: CONVERT, matches: words::is_tracepro },
    Foreign {
        name: "a table of directions under names in words",
        advice: DIRECTIONS,
        matches: |s| words::is_directions(s) && !is_claimed(s),
    },
    Foreign {
        name: "a summary of a lamp (CCT, CRI, illuminance), no spectrum",
        advice: "export the spectrum: wavelengths and values in columns",
        matches: words::is_summary,
    },
    Foreign {
        name: "radiometric-csv without the line that says so",
        advice: "write `# radiometric-csv: 1` as its first line",
        matches: |s| {
            let names = s.head.lines().map(str::trim).find(|line| !line.is_empty() && !line.starts_with('#'));
            says(s, "# quantity:") && names.is_some_and(|names| names.to_lowercase().contains("theta_"))
        },
    },
    Foreign {
        name: "a table of directions without the lines of radiometric-csv",
        advice: "write `# radiometric-csv: 1`, `# quantity: brdf`, `# angle_unit: deg` and the other lines of `wavelume formats \
                 --template radiometric-csv-wide` before it, and name its columns theta_i, phi_i, theta_o, phi_o, lambda, value",
        matches: |s| words::is_under_symbols(s) && !is_claimed(s),
    },
    Foreign {
        name: "the manifest of an array",
        advice: "send the .npy file and name the manifest as its axes",
        matches: |s| s.head.trim_start().starts_with('{') && s.head.contains("\"axes\""),
    },
    Foreign {
        name: "JSON",
        advice: "write its numbers as a table: CSV for spectra, radiometric-csv for directions",
        matches: is_json,
    },
];

/// Returns a description of a file that stands in the place of another one, and advice for the user.
pub(super) fn in_place(sample: &Sample<'_>) -> Option<String> {
    IN_PLACE.iter().find(|foreign| (foreign.matches)(sample)).map(Foreign::told)
}

/// Returns a description of the file and advice for the user, if its format is known but cannot be read.
pub(super) fn recognise(sample: &Sample<'_>) -> Option<String> {
    if let Some(root) = xml_root(&sample.head) {
        return Some(xml(root, &sample.head));
    }
    TABLE.iter().find(|foreign| (foreign.matches)(sample)).map(Foreign::told)
}

impl Foreign {
    fn told(&self) -> String {
        format!("this is {}, which is not read: {}", self.name, self.advice)
    }
}

/// Returns true for a table of directions that is read as it is.
fn is_claimed(sample: &Sample<'_>) -> bool {
    unmarked::claims(&sample.head, sample.quantity)
}

/// Returns true for JSON: an object with or without a key, or a list. Comments and keys in single quotes, which some
/// programs write, count as JSON, too.
fn is_json(sample: &Sample<'_>) -> bool {
    let mut text = sample.head.trim_start();
    while let Some(comment) = text.strip_prefix("//") {
        text = comment.split_once('\n').map_or("", |(_, rest)| rest).trim_start();
    }
    let after = |open: char| text.strip_prefix(open).map(str::trim_start);
    let begins_item = |rest: &str| {
        let words = ["]", "true", "false", "null", "NaN", "Infinity"];
        rest.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '"' | '[' | '{' | '-'))
            || words.iter().any(|word| rest.starts_with(word))
    };
    after('{').is_some_and(|rest| rest.starts_with(['"', '\'', '}'])) || after('[').is_some_and(begins_item)
}

fn is_hdf5(sample: &Sample<'_>) -> bool {
    sample.bytes.starts_with(b"\x89HDF\r\n\x1a\n")
}

/// Returns true if the first 64 KiB of a file contain `needle`, ignoring ASCII case.
fn contains(bytes: &[u8], needle: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(HEAD_BYTES)];
    head.windows(needle.len()).any(|window| window.eq_ignore_ascii_case(needle))
}

/// Returns true if one of the first 100 lines of a file begins with `key`, ignoring ASCII case.
fn says(sample: &Sample<'_>, key: &str) -> bool {
    let begins = |line: &str| line.get(..key.len()).is_some_and(|start| start.eq_ignore_ascii_case(key));
    sample.head.lines().take(100).any(|line| begins(line.trim_start()))
}

/// Returns true if a zip archive is a spreadsheet workbook: the name of its first file is one that only workbooks have.
pub(super) fn is_workbook(bytes: &[u8]) -> bool {
    const FIRST: [&[u8]; 4] = [b"[Content_Types].xml", b"_rels/", b"docProps/", b"xl/"];
    let first = bytes.strip_prefix(b"PK\x03\x04").and_then(|rest| rest.get(26..)).unwrap_or_default();
    let list = &bytes[bytes.len().saturating_sub(HEAD_BYTES)..];
    FIRST.iter().any(|name| first.starts_with(name)) && contains(list, b"xl/workbook.xml")
}

/// Returns true for pbrt's measured BRDF: the number of wavelengths and the wavelengths, then rows of four angles in
/// radians with a value for each wavelength. All numbers are separated by blanks.
fn is_pbrt(sample: &Sample<'_>) -> bool {
    let lines = sample.head.lines().map(|line| line.split('#').next().unwrap_or_default());
    let mut numbers = lines.flat_map(str::split_whitespace).map(super::text::number);
    let count = match numbers.next() {
        Some(Some(count)) if count.fract() == 0.0 && (2.0..=1000.0).contains(&count) => count as usize,
        _ => return false,
    };
    let mut last = 150.0;
    let mut grows = |number: Option<f64>| {
        number.is_some_and(|lambda| {
            let grows = lambda > last && lambda <= 3000.0;
            last = lambda;
            grows
        })
    };
    let wavelengths: Vec<Option<f64>> = numbers.by_ref().take(count).collect();
    let angles: Vec<Option<f64>> = numbers.take(4).collect();
    wavelengths.len() == count
        && wavelengths.into_iter().all(&mut grows)
        && angles.len() == 4
        && angles.into_iter().all(|angle| angle.is_some_and(|angle| angle.abs() <= 7.0))
}

/// Number of lines in which a tool may write a note before an XML document. Raising it finds longer notes.
const NOTE_LINES: usize = 16;

/// Returns the number of bytes of the lines before the XML document in a text, in which a tool has written a note; 0 if
/// there are none, or no document begins in the first lines.
pub(super) fn before_xml(text: &str) -> usize {
    let begins = |line: &str| {
        let tag = line.trim_start().strip_prefix('<');
        tag.is_some_and(|tag| tag.starts_with(|c: char| c.is_ascii_alphabetic() || matches!(c, '?' | '!')))
    };
    let mut start = 0;
    for line in text.split_inclusive(['\n', '\r']).take(NOTE_LINES) {
        if begins(line) {
            return start;
        }
        start += line.len();
    }
    0
}

/// Returns the name of the root element without its prefix, if the text is XML.
pub(super) fn xml_root(head: &str) -> Option<&str> {
    let mut rest = head[before_xml(head)..].trim_start();
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
        "CxF" => ("CxF3 colour data (XML)", "export the spectra as CSV"),
        "Root" if head.contains("gldf.io") => {
            ("the description of a GLDF luminaire (XML)", "send the .gldf archive, or the luminaires in it")
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

    fn workbook() -> Vec<u8> {
        let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        for name in ["[Content_Types].xml", "_rels/.rels", "xl/workbook.xml"] {
            zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        }
        zip.finish().unwrap().into_inner()
    }

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
            (vec![0; 1_990_656], "UTIA"),
            (b"##TITLE=x\n".to_vec(), "JCAMP"),
            (b"ENVI\nsamples = 3\n".to_vec(), "ENVI"),
            (b"CTI3\nBEGIN_DATA_FORMAT\n".to_vec(), "CGATS"),
            (b"OPTIS - Anisotropic BSDF\n".to_vec(), "Speos"),
            (b"\xef\xbb\xbf<?xml version=\"1.0\"?>\n<!-- x -->\n<cc:CxF xmlns:cc=\"u\">".to_vec(), "CxF3"),
            (b"<!DOCTYPE html><html>".to_vec(), "web page"),
            (b"<item></item>".to_vec(), "`item`"),
            (b"{\"quantity\": \"brdf\", \"axes\": []}".to_vec(), "manifest"),
            (b"BZh91AY&SY\0".to_vec(), "bzip2"),
            (b"\xfd7zXZ\0\0\x04".to_vec(), "xz"),
            (workbook(), "spreadsheet (.xlsx), which is not read: save it as CSV"),
            (b"MATLAB 7.3 MAT-file, Platform: GLNXA64".to_vec(), "MATLAB"),
            (b"\x76\x2f\x31\x01\x02\0\0\0".to_vec(), "OpenEXR"),
            (b"KEY x\nVARS theta_i,phi_i,theta_s,phi_s,400nm\n0.1,0,0.2,0,1\n".to_vec(), "ASTM"),
            (b"VARS THETA_I,PHI_I,THETA_S,PHI_S,400nm\n0.1,0,0.2,0,1\n".to_vec(), "ASTM"),
            (b"VERSION 0.3\nDATA_TYPE brdf\n".to_vec(), "SSDD"),
            (
                b"Source Measured\nSymmetry PlaneSymmetrical\nSpectralContent Monochrome\n".to_vec(),
                "Zemax or LightTools BSDF without its list",
            ),
            (
                b"Symmetry Asymmetric\nSpectralContent RGB\nScatterAzimuth 1\n0\nScatterRadial 1\n0\nDataBegin\nAOI 0\nPOI 0\n"
                    .to_vec(),
                "a LightTools BSDF",
            ),
            (b"Source Measured\nTypeSym AxiSymmetrical\nTypeColorModel rgb\nsigma 2\n0 30\n".to_vec(), "Integra"),
            (b"#sample_name \"x\"\n#intheta 30\n10 20 0.1\n20 20 0.1\n".to_vec(), "mountain"),
            (b"#incident_angle 30 0\n10 20 0.1\n20 20 0.1\n".to_vec(), "mountain"),
            (b"# felt\n2 400 500\n0.1 0 0.2 3.1 0.5 0.6\n0.1 0 0.4 3.1 0.5 0.6\n".to_vec(), "pbrt-v2"),
            (b"CTI3   \n\nDESCRIPTOR \"x\"\n1 2\n3 4\n".to_vec(), "CGATS"),
            (b"<Root xmlns:x=\"https://gldf.io/xsd\">".to_vec(), "GLDF"),
            (b"{\"FileType\": \"ATLA_S001_A\", \"h\": [0]}".to_vec(), "TM-33 luminaire (JSON)"),
            (
                b"# radiometic-csv: 1\n# quantity: brdf\ntheta_i,theta_o,value\n1,2,3\n".to_vec(),
                "write `# radiometric-csv: 1`",
            ),
            (b"# quantity: brdf\ntheta_i,theta_o,v400\n1,2,3\n".to_vec(), "write `# radiometric-csv: 1`"),
            (b"theta,phi,400,500,600\n0,10,.1,.2,.3\n0,20,.1,.2,.3\n0,30,.2,.2,.2\n".to_vec(), "radiometric-csv"),
            (b"Theta_r (deg)\tBRDF\n0\t0.1\n10\t0.2\n".to_vec(), "`# radiometric-csv: 1`"),
            (b"PAR1\x15\x04".to_vec(), "docs/labs.md"),
            (b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n".to_vec(), "pointer of Git LFS"),
            (b"\nversion https://hawser.github.com/spec/v1\noid sha256:00\nsize 9\n".to_vec(), "pointer of Git LFS"),
            (b"/annex/objects/SHA256E-s9--00.ies\n".to_vec(), "git-annex"),
            (b"{\\rtf1\\ansi IESNA:LM-63-2002\\\nTILT=NONE\\\n}".to_vec(), "rich text (RTF)"),
            (b"{\"brdf\": [[0.1, 0.2]]}".to_vec(), "JSON"),
            (b"// made by x\n{'wavelength': [400, 410]}".to_vec(), "JSON"),
            (b" [ null, 1.0]".to_vec(), "JSON"),
            (b"{ }".to_vec(), "JSON"),
            (b"[]".to_vec(), "JSON"),
            (b"made by <x>\nx\n<?xml version=\"1.0\"?>\n<CxF>\n0.1,0.2\n".to_vec(), "CxF3"),
            (b"note\n<CxF>\n0.1,0.2\n0.2,0.1\n".to_vec(), "CxF3"),
            (b"DATA:\n  - type: tabulated nk\n    data: |\n        0.4 1.47 0\n        0.5 1.46 0\n".to_vec(), "refractive"),
            (b"! x\nMATE AL2O3\n.600 1.59 0\n1.60 1.56 0\n".to_vec(), "coating file"),
            (b"CC x\nNM N-BK7 2 517642 1.5 64 0 1\nED 7 8 2 0 0\nCD 1 0.1\n".to_vec(), "glass catalogue"),
            (b"Theta,Intensity (cd)\n0,9\n5,8\n10,7\n".to_vec(), "a table over directions (`Theta`)"),
            (
                b"TracePro Surface Property Data\nFile Name\tx.txt\nTracePro Release: 7 0 0\n\nTable_BSDF_Data\nTemperature\tWavelength\tIncAngle\n300\t0.55\t0\n".to_vec(),
                "a TracePro surface property",
            ),
            (b"Temperature\tScatterBeta\tScatterAzimuth\tBRDF\n300\t0.1\t0\t1\n".to_vec(), "TracePro"),
            (b"Viewing Zenith,Relative Azimuth,Solar Zenith,BRF\n0,0,30,0.2\n10,0,30,0.3\n".to_vec(), "reflectance-factor"),
            (b"# VZA; RAA; 550\n150;0;0,2\n160;0;0,3\n".to_vec(), "theta_o (viewing zenith)"),
            (b"sample\tView Zenith\tHCRF\n\t[deg]\t[-]\nsoil\t150\t0.2\nsoil\t160\t0.3\n".to_vec(), "directions"),
            (b"x,y,CCT,CRI\n0.33,0.35,5465,98\n".to_vec(), "a summary of a lamp"),
            (b"Lux (lx);CCT (K);CRI\n500;3000;80\n510;3001;80\n".to_vec(), "a summary of a lamp"),
            (b"Model\tMK350\nCCT\t5465\nCRI\t98\nLUX\t300\n".to_vec(), "a summary of a lamp"),
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
