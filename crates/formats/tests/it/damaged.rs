//! Damaged and hostile bytes: every reader refuses them without a panic, without echoing them, without allocating what
//! they declare.

use proptest::prelude::*;
use std::fs;
use std::path::PathBuf;
use wavelume_core::domain::Quantity;
use wavelume_formats::formats::{
    Acquisition, FormatError, FormatErrorKind, Interpretation, Normalization, Position, read, write_npy,
};

fn plain(bytes: &[u8]) -> Result<Acquisition, FormatError> {
    read(bytes, &Interpretation::default())
}

/// Returns every file that reads, including arrays written here.
fn good_files() -> Vec<(String, Vec<u8>, Interpretation)> {
    let mut files = Vec::new();
    let mut directories: Vec<PathBuf> = ["data", "tests/fixtures"].map(|d| crate::root().join(d)).to_vec();
    while let Some(directory) = directories.pop() {
        for entry in fs::read_dir(directory).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                directories.push(path);
            } else if let Ok(bytes) = fs::read(&path)
                && plain(&bytes).is_ok()
            {
                files.push((path.display().to_string(), bytes, Interpretation::default()));
            }
        }
    }
    files.sort_by(|a, b| a.0.cmp(&b.0));
    let axes = serde_json::json!({"quantity": "edf", "axes": ["hemi:1", "lambda:400:10:3"]});
    let samples: Vec<f32> = (0..48).map(|i| i as f32).collect();
    let how = Interpretation { axes: Some(axes), ..Interpretation::default() };
    files.push(("array.npy".to_owned(), write_npy(&[16, 3], &samples), how));
    files
}

#[test]
fn cut_and_flipped_files_never_panic() {
    let files = good_files();
    assert!(files.len() > 40, "{}", files.len());
    for (name, bytes, how) in files {
        let binary = [b"\x93NUMPY".as_slice(), b"NVIDIA", b"tensor_file", b"\xff\xff\xff\xff", b"PK\x03\x04"]
            .iter()
            .any(|magic| bytes.starts_with(magic));
        for i in crate::one_in(6, 0, 0..50) {
            let cut = bytes.len() * i / 50;
            let outcome = read(&bytes[..cut], &how);
            // Between two blocks of a file, the first is a file of its own.
            let whole_block = name.contains("_transmission_") && cut == 108;
            assert!(!binary || outcome.is_err() || whole_block, "{name} cut at {cut} still reads");
            if bytes.len() > 1 << 20 && i % 10 != 0 {
                continue;
            }
            let mut flipped = bytes.clone();
            flipped[cut] ^= [0xFF, 0x01, 0x20, 0x80][i % 4];
            let _ = read(&flipped, &how);
        }
    }
}

/// Returns a small file of every text format with all kinds of numbers, and its interpretation.
fn small_texts() -> Vec<(&'static str, String, Interpretation)> {
    let plain = Interpretation::default();
    let quantity = Some(Quantity::Phase.into());
    let phase = Interpretation { quantity, normalization: Some(Normalization::Relative), ..plain.clone() };
    let csv = |keys: &str, rows: &str| format!("# radiometric-csv: 1\n# angle_unit: deg\n{keys}{rows}");
    let brdf = "# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: true\n# wavelength_unit: nm\n";
    let lamp = |tag: &str, photometry: u8| {
        format!(
            "{tag}[TEST] 1\nTILT=INCLUDE\n1\n2\n0 90\n1 0.5\n1 1000 1.5 3 2 {photometry} 1 0.1 0.2 0\n0.9 1 50\n0 45 90\n0 90\n1 2 3 4 5 6\n"
        )
    };
    let texts = [
        ("lm-63", lamp("IESNA:LM-63-2002\n", 1), &plain),
        ("lm-63", lamp("IESNA91\n", 2), &plain),
        ("lm-63", lamp("IES:LM-63-2019\n", 3), &plain),
        ("eulumdat", String::from_utf8(fixture("ldt/absolute.ldt")).unwrap(), &plain),
        (
            "radiometric-csv",
            csv(
                &format!("{brdf}# phi_o_extent: mirrored\n# theta_o_covers: 0 90\n"),
                "theta_i,phi_i,theta_o,phi_o,wavelength,value,sigma\n0,0,30,0,450,0.1,0.01\n0,0,30,180,450,0.2,0.02\n",
            ),
            &plain,
        ),
        (
            "radiometric-csv",
            csv(brdf, "theta_i,theta_o,phi_o,v400,v500,s400,s500\n0,10,0,1,2,0.1,0.2\n30,20,90,3,4,0.3,0.4\n"),
            &plain,
        ),
        ("radiometric-csv", csv("# quantity: emission\n# value_unit: cd\n", "c,gamma,value\n0,0,9\n0,90,3\n90,90,2\n"), &plain),
        ("tm-27", spdx("<SpectralData wavelength=\"400.5\">0.5</SpectralData><SpectralData wavelength=\"410\">0.6</SpectralData>"), &plain),
        ("tm-33", tm33("<AbsolutePhotometry>true</AbsolutePhotometry><Symm>Symm_Quad</Symm><Multiplier>1.5</Multiplier>"), &plain),
        ("zemax-bsdf", "Source Measured\nSymmetry ASymmetrical4D\nSpectralContent Monochrome\nScatterType BRDF\nSampleRotation 2\n0 90\nAngleOfIncidence 2\n0 30.5\nScatterAzimuth 2\n0 180\nScatterRadial 3\n0 5 80\n\nMonochrome\nDataBegin\nTIS 0.5\n1 2 3\n4 5 6\nTIS 0.5\n1 2 3\n4 5 6\nTIS 0.5\n1 2 3\n4 5 6\nTIS 0.5\n1 2 3\n4 5 6e-1\nDataEnd\n".to_owned(), &plain),
        ("bsdf-xml", window("Columns", "0.1, 0.2, 0.3,\n4e-2 0.05 0.6\n-0.007 0.8 0.9"), &plain),
        ("bsdf-xml", window("TensorTree3", "{ {0.1} {0.2} {0.3} {4e-2} {1 2 3 4 5 6 7 8} {0.6} {0.7} {-0.8} }"), &plain),
        ("svc", "/*** Spectra Vista SIG Data ***/\nunits= Radiance, Radiance\ndata= \n400.5  100.00  25.00  25.00\n401.9  100.00  -1.50  -1.50\n".to_owned(), &plain),
        ("speos", "OPTIS - Spectrum file v1.0\nx\n3\n400\t1\n410\t2.5\n420.5\t6e-1\n".to_owned(), &plain),
        ("sekonic", (0..5).map(|i| format!("Spectral Data {}[nm],0.{i}\n", 380 + i)).collect::<Vec<_>>().concat(), &plain),
        ("spectral-table", "nm,a,b\n400,1,2\n410,3.5,4\n420.5,5,6e-1\n".to_owned(), &plain),
        ("spectral-table", "400 1\n410 2\n420 3\n".to_owned(), &plain),
        ("spectral-table", "Model Name\tLI-180\nCCT\t5465\n380nm\t27.5\n381nm\t27.9\n382nm\t28.5\nCRI\t98.8\n".to_owned(), &plain),
        ("spectral-table", "sample,400,450.5,500\nleaf,0.1,0.2,0.3\nsoil,0.2,--,0.5\n".to_owned(), &plain),
        ("spectral-table", "Name: x\nX Units: Wavelength (micrometers)\nY Units: Reflectance (percent)\nNumber of X Values: 3\n\n25.1\t2.5\n14.0\t1.3\n0.4\t3.5\n".to_owned(), &plain),
        ("spectral-table", "nm,HCRF\n400,0.5\n410,NaN\n420,1.25\n".to_owned(), &plain),
        ("radiometric-csv", csv("# quantity: reflectance-factor\n# value_unit: 1\n", "theta_i,theta_o,phi_o,v400\n30,0,0,0.5\n30,60,180,1.5\n"), &plain),
        ("alta", "#DIM 3 1\n#PARAM_IN ISOTROPIC_TV_TL_DPHI\n#PARAM_OUT INV_STERADIAN\n#VS 1\n0.1 0.5 0 0.25 0.01\n1.0 0.5 0.2 0.5 0.01\n".to_owned(), &plain),
        ("alta", "#DIM 6 3\n#PARAM_IN CARTESIAN\n#PARAM_OUT RGB_COLOR\n0 0 1 0.6 0 0.8 1 2 3\n0 0.6 0.8 0 0 1 4 5 6\n".to_owned(), &plain),
        ("phase-table", "0 0.2\n60 0.1\n120 0.05\n180 0.02\n".to_owned(), &phase),
        ("phase-table", "-1, 0.1\n-0.5, 0.2\n0, 0.3\n1, 0.4\n".to_owned(), &phase),
        ("phase-table", "0.1, 0.2, 0.3, 0.4\n".to_owned(), &phase),
        ("phase-table", "1\n0.8\n0.5\n0.2\n".to_owned(), &phase),
        (
            "virtual",
            r#"{"wavelume":"virtual","quantity":"brdf","axes":["hemi:0","hemi:1","lambda:400:100:2"],"model":{"sum":[{"scale":0.8,"lobe":{"lambert":{"reflectance":0.5}}},{"lobe":{"asperity":{"albedo":0.3,"depth":2.0,"back":0.5,"g_back":0.2,"g_forward":0.1}}}]},"noise":{"relative":0.005,"seed":1}}"#.to_owned(),
            &plain,
        ),
    ];
    texts.map(|(format, text, how)| (format, text, how.clone())).into()
}

fn fixture(path: &str) -> Vec<u8> {
    fs::read(crate::root().join("tests/fixtures").join(path)).unwrap()
}

fn spdx(data: &str) -> String {
    format!(
        "<IESTM2714 xmlns=\"iestm2714\" version=\"1.0\"><Header/><SpectralDistribution><SpectralQuantity>relative\
         </SpectralQuantity><BandwidthFWHM>2</BandwidthFWHM>{data}</SpectralDistribution></IESTM2714>"
    )
}

fn tm33(head: &str) -> String {
    let datum = |h: u32, v: u32| format!("<IntData h=\"{h}\" v=\"{v}\">{}</IntData>", h + v + 1);
    let data: String = [0, 90].into_iter().flat_map(|h| [0, 45, 90].map(|v| datum(h, v))).collect();
    format!(
        "<IESTM33-22><Version>1.1</Version><Emitter><Quantity>1</Quantity><LuminousData><LuminousIntensity>{head}\
         <NumberHorz>2</NumberHorz><NumberVert>3</NumberVert>{data}</LuminousIntensity></LuminousData>\
         <SpectralData><EmitterSpectral><PwrData w=\"400\">0.5</PwrData><PwrData w=\"550.5\">1</PwrData></EmitterSpectral>\
         </SpectralData></Emitter></IESTM33-22>"
    )
}

fn window(structure: &str, data: &str) -> String {
    let ring = |low: u8, high: u8, count: u8| {
        format!(
            "<AngleBasisBlock><Theta>{low}</Theta><nPhis>{count}</nPhis><ThetaBounds><LowerTheta>{low}</LowerTheta>\
             <UpperTheta>{high}</UpperTheta></ThetaBounds></AngleBasisBlock>"
        )
    };
    format!(
        "<WindowElement><Optical><Layer><DataDefinition><IncidentDataStructure>{structure}</IncidentDataStructure><AngleBasis>\
         <AngleBasisName>own</AngleBasisName>{}{}</AngleBasis></DataDefinition><WavelengthData><Wavelength>Visible</Wavelength>\
         <WavelengthDataBlock><WavelengthDataDirection>Transmission Back</WavelengthDataDirection><AngleBasis>LBNL/Shirley-Chiu\
         </AngleBasis><ColumnAngleBasis>own</ColumnAngleBasis><RowAngleBasis>own</RowAngleBasis><ScatteringData>{data}\
         </ScatteringData></WavelengthDataBlock></WavelengthData></Layer></Optical></WindowElement>",
        ring(0, 40, 1),
        ring(40, 90, 2),
    )
}

/// Returns the byte ranges of the numbers in a text.
fn numbers(text: &str) -> Vec<std::ops::Range<usize>> {
    let bytes = text.as_bytes();
    let part = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'-' | b'+' | b'_');
    let (mut found, mut at) = (Vec::new(), 0);
    while at < bytes.len() {
        let end = bytes[at..].iter().position(|&byte| !part(byte)).map_or(bytes.len(), |length| at + length);
        if text[at..end].parse::<f64>().is_ok() {
            found.push(at..end);
        }
        at = end + 1;
    }
    found
}

/// Checks that a user can act on a refusal: it names the format, a place in the input, what was found and what was
/// expected.
fn check_refusal(error: &FormatError, what: &str) {
    let text = error.to_string();
    let said = !error.message.is_empty() && text.len() < 2000 && !text.chars().any(char::is_control);
    let named =
        !error.format.is_empty() || matches!(error.kind, FormatErrorKind::Unrecognised | FormatErrorKind::Unsupported);
    // Errors in a whole table, a key of its header or a file of an archive state a name instead of a place.
    let by_name = ["radiometric-csv", "radiometric-arrow", "zip", "phase-table", "virtual"].contains(&error.format);
    let placed = error.position.is_some() || error.kind != FormatErrorKind::Malformed || by_name;
    // Refusals of unsupported files expect nothing; those of missing options name the option.
    let explained = matches!(error.kind, FormatErrorKind::Unsupported | FormatErrorKind::NeedsOption)
        || ["expected", "limit", "more than", "twice"].iter().any(|word| text.contains(word));
    assert!(said && named && placed && explained, "{what}: {error:?}");
}

#[test]
fn every_number_of_a_text_may_be_anything() {
    for (format, text, how) in small_texts() {
        let read_as = read(text.as_bytes(), &how).unwrap_or_else(|error| panic!("{text}: {error}")).format;
        assert_eq!(read_as, format, "{text}");
        let places = numbers(&text);
        assert!(places.len() >= 4, "{text}");
        for place in places {
            for hostile in ["NaN", "inf", "-1", "9223372036854775808", "1e400", "-1e400", "1e-400", "1e30", ""] {
                let mut changed = text.clone();
                changed.replace_range(place.clone(), hostile);
                if let Err(error) = read(changed.as_bytes(), &how) {
                    check_refusal(&error, &changed);
                }
            }
        }
    }
}

#[test]
fn every_length_of_a_text_is_a_file_or_a_refusal() {
    for (_, text, how) in small_texts() {
        for cut in 0..text.len() {
            if let Err(error) = read(&text.as_bytes()[..cut], &how) {
                check_refusal(&error, &text[..cut]);
            }
        }
    }
}

/// Returns a small file of every binary format, and its interpretation.
fn small_binaries() -> Vec<(&'static str, Vec<u8>, Interpretation)> {
    let plain = Interpretation::default();
    let axes = |axes: serde_json::Value| Interpretation {
        axes: Some(serde_json::json!({"quantity": "edf", "axes": axes})),
        ..plain.clone()
    };
    let doubles = |order: &str| {
        let header = format!("{{'descr': '>f8', 'fortran_order': {order}, 'shape': (4, 3), }}\n");
        let head = [b"\x93NUMPY\x02\0".as_slice(), &(header.len() as u32).to_le_bytes(), header.as_bytes()].concat();
        [head, (0..12).flat_map(|i| f64::from(i).to_be_bytes()).collect()].concat()
    };
    let fixtures = [
        ("mbsdf", "mbsdf/test_reflection_scalar_theta_2_phi_3_transmission_scalar_theta_2_phi_4.mbsdf"),
        ("mbsdf", "mbsdf/test_rgb_theta_2_phi_3.mbsdf"),
        ("rgl", "rgl/isotropic-spectral-jacobian-1.bsdf"),
        ("rgl", "rgl/half-turn-rgb-jacobian-1.bsdf"),
        ("radiometric-arrow", "arrow/wide.arrows"),
        ("radiometric-arrow", "arrow/uncertain.arrows"),
        ("asd", "spectrometers/raw.asd"),
        ("zip", "zip/luminaire.zip"),
    ];
    let mut files: Vec<_> = fixtures.map(|(format, path)| (format, fixture(path), plain.clone())).into();
    let written = write_npy(&[16, 3], &[0.5; 48]);
    files.push(("npy", written, axes(serde_json::json!(["hemi:1", "lambda:400:10:3"]))));
    for order in ["False", "True"] {
        files.push(("npy", doubles(order), axes(serde_json::json!(["hemi:0", "rgb"]))));
    }
    files
}

#[test]
fn every_word_of_a_binary_may_be_anything() {
    for (format, bytes, how) in small_binaries() {
        let read_as = read(&bytes, &how).unwrap_or_else(|error| panic!("{format}: {error}")).format;
        assert!(read_as == format || format == "zip", "{format}: {read_as}");
        // Every byte of the head, where the sizes are, then every word.
        let places = (0..bytes.len()).filter(|at| *at < 512 || at % 4 == 0);
        for at in crate::one_in(5, 0, places) {
            let words =
                [f32::NAN.to_bits(), f32::INFINITY.to_bits(), (-1.0_f32).to_bits(), u32::MAX, 1 << 31, 1 << 28, 0];
            let longs = [f64::NAN.to_bits(), f64::NEG_INFINITY.to_bits(), 1 << 63, u64::MAX, 1 << 40];
            let words = words.iter().map(|word| word.to_le_bytes().to_vec());
            for hostile in words.chain(longs.iter().map(|long| long.to_le_bytes().to_vec())) {
                let mut changed = bytes.clone();
                let end = (at + hostile.len()).min(bytes.len());
                changed[at..end].copy_from_slice(&hostile[..end - at]);
                if let Err(error) = read(&changed, &how) {
                    check_refusal(&error, &format!("{format} byte {at} {hostile:?}"));
                }
            }
        }
    }
}

#[test]
fn every_length_of_a_binary_is_refused() {
    for (format, bytes, how) in small_binaries() {
        for cut in 0..bytes.len() {
            match read(&bytes[..cut], &how) {
                Err(error) => check_refusal(&error, &format!("{format} cut at {cut}")),
                // Between two blocks the first is a file of its own; the padding behind the last message says nothing.
                Ok(read) => {
                    let one_side = format == "mbsdf" && read.quantity == Quantity::Brdf;
                    assert!(one_side || format == "radiometric-arrow", "{format} {cut}");
                }
            }
        }
    }
}

#[test]
fn the_numbers_of_a_large_binary_may_be_anything() {
    const HEAD: usize = 12;
    let head: Vec<u8> = [90_i32, 90, 180].iter().flat_map(|n| n.to_le_bytes()).collect();
    let mut file = head.clone();
    file.resize(HEAD + 24 * 90 * 90 * 180, 0);
    assert_eq!(plain(&file).unwrap().format, "merl");
    let last = file.len() - 8;
    for at in [HEAD, HEAD + 8 * 1_000_003, last] {
        for hostile in [f64::NAN, f64::INFINITY, -1.0, 9_223_372_036_854_775_808.0, 1e300] {
            file[at..at + 8].copy_from_slice(&hostile.to_le_bytes());
            match plain(&file) {
                Ok(_) => assert!(hostile.is_finite() && hostile < 1e30, "{hostile}"),
                Err(error) => {
                    check_refusal(&error, "merl");
                    assert_eq!(error.position, Some(Position::Byte(at)), "{error}");
                }
            }
        }
        file[at..at + 8].fill(0);
    }
    for at in [0, 4, 8] {
        for hostile in [0, -1, i32::MIN, i32::MAX, 1 << 28] {
            file[at..at + 4].copy_from_slice(&hostile.to_le_bytes());
            check_refusal(&plain(&file).unwrap_err(), "merl");
        }
        file[..HEAD].copy_from_slice(&head);
    }
    for cut in [1, 11, HEAD, HEAD + 1, file.len() / 2, last, file.len() - 1] {
        check_refusal(&plain(&file[..cut]).unwrap_err(), "merl");
    }
}

#[test]
fn declared_sizes_do_not_allocate() {
    let kilobyte = |head: &[u8]| {
        let mut bytes = head.to_vec();
        bytes.resize(1024, b'0');
        bytes
    };
    let array = "{'descr': '<f4', 'fortran_order': False, 'shape': (268435456,), }";
    let mut npy = b"\x93NUMPY\x01\0".to_vec();
    npy.extend_from_slice(&(array.len() as u16).to_le_bytes());
    npy.extend_from_slice(array.as_bytes());
    let mut mbsdf = b"NVIDIA ARC MBSDF V1\nMBSDF_DATA=\n".to_vec();
    mbsdf.extend([0_u32, 8192, 4].iter().flat_map(|word| word.to_le_bytes()));
    let mut tensor = b"tensor_file\0\x01\0\x01\0\0\0\x04\0vndf\x01\0\x0a".to_vec();
    tensor.extend([40_u64, 1 << 28].iter().flat_map(|word| word.to_le_bytes()));
    for bytes in [
        kilobyte(&npy),
        kilobyte(&mbsdf),
        kilobyte(&tensor),
        b"IESNA91\nTILT=NONE\n1 -1 1 16384 16384 1 2 0 0 0 1 1 1 0 90 0".to_vec(),
        b"IESNA91\nTILT=INCLUDE\n1 1000000000 0 1\n".to_vec(),
    ] {
        assert_eq!(plain(&bytes).unwrap_err().kind, FormatErrorKind::Malformed);
    }
}

#[test]
fn messages_do_not_echo_the_file() {
    let long = "x".repeat(100_000);
    for bytes in [
        format!("IESNA91\nTILT=NONE\n{long}"),
        format!("IESNA91\nTILT={long}\n1 2"),
        format!("nm,v\n400,1\n410,{long}\n"),
        format!("<{long}>"),
        format!("NVIDIA ARC MBSDF V1\n{long}"),
    ] {
        let message = plain(bytes.as_bytes()).unwrap_err().to_string();
        assert!(message.len() < 400, "{message}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..600)) {
        let _ = plain(&bytes);
    }

    #[test]
    fn arbitrary_continuations_never_panic(
        head in prop::sample::select(vec![
            &b"\x93NUMPY\x01\0\x40\0"[..],
            b"\x93NUMPY\x01\0\x40\0{'descr': '<f4', 'fortran_order': False, 'shape': (",
            b"NVIDIA ARC MBSDF V1\n",
            b"NVIDIA ARC MBSDF V1\nMBSDF_DATA=\n",
            b"tensor_file\0\x01\0\x02\0\0\0",
            b"tensor_file\0\x01\0\x01\0\0\0\x07\0theta_i\x01\0\x0a",
            b"IESNA:LM-63-2002\nTILT=NONE\n",
            b"IESNA91\nTILT=INCLUDE\n1 2 ",
            b"nm,v\n400,1\n",
            b"<?xml ",
            b"<IESTM2714><SpectralData ",
            b"# radiometric-csv: 1\n# quantity: spectrum\n# value_unit: relative\n",
            b"# radiometric-csv: 1\n# quantity: spectrum\n# value_unit: relative\nwavelength,value\n",
        ]),
        tail in proptest::collection::vec(any::<u8>(), 0..300),
    ) {
        let bytes = [head, &tail].concat();
        let axes = Some(serde_json::json!({"quantity": "spectrum", "axes": ["index"]}));
        let _ = plain(&bytes);
        let _ = read(&bytes, &Interpretation { axes, ..Interpretation::default() });
    }

    #[test]
    fn streams_of_numbers_never_panic(
        head in prop::sample::select(vec![
            "IESNA91\nTILT=NONE\n1 -1 1 ",
            "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 3 2 1 1 0 0 0 1 1 1 ",
            "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 2 3 2 1 0 0 0 1 1 1 ",
            "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 2 2 3 1 0 0 0 1 1 1 ",
            "a\n1\n0\n4\n0\n3\n0\nr\nn\n\nf\nd\n1\n1\n1\n1\n1\n0\n0\n0\n0\n100\n100\n1\n0\n1\n",
            "# radiometric-csv: 1\n# quantity: edf\n# value_unit: cd\n# angle_unit: deg\nc,gamma,value\n",
            "",
        ]),
        numbers in proptest::collection::vec((
            prop::sample::select(vec!["0", "1", "2", "3", "45", "90", "180", "270", "360", "-1", "-90", "1e30", "0.5", "x", ""]),
            prop::sample::select(vec![" ", ",", "\n", " , ", ";", "\t"]),
        ), 0..40),
    ) {
        let body: String = numbers.iter().flat_map(|(number, separator)| [*number, *separator]).collect();
        let _ = plain(format!("{head}{body}").as_bytes());
    }
}
