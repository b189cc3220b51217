//! Damaged and hostile bytes: every reader refuses them without a panic, without echoing them, without allocating what
//! they declare.

#![allow(clippy::unwrap_used, reason = "helpers of tests stop at the first surprise")]

use proptest::prelude::*;
use std::fs;
use std::path::{Path, PathBuf};
use wavelume::formats::{Acquisition, FormatError, FormatErrorKind, Interpretation, read, write_npy};

fn plain(bytes: &[u8]) -> Result<Acquisition, FormatError> {
    read(bytes, &Interpretation::default())
}

/// Every file that reads, arrays written here included.
fn good_files() -> Vec<(String, Vec<u8>, Interpretation)> {
    let mut files = Vec::new();
    let mut directories: Vec<PathBuf> =
        ["data", "tests/fixtures"].map(|d| Path::new(env!("CARGO_MANIFEST_DIR")).join(d)).to_vec();
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
        for i in 0..50 {
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
