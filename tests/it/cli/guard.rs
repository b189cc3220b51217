//! Guard of the command line: no command replaces a file that it reads, under whatever name, and none writes a file
//! under the name of another kind.

use super::{data, done, workshop};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

/// Command lines without their output, and the inputs that each of them reads.
const LINES: [(&str, &[&str]); 14] = [
    ("compress brdf.npy --axes other.json", &["brdf.npy", "other.json"]),
    ("compress brdf.npy", &["brdf.npy", "brdf.axes.json"]),
    ("compress lamp.ies --spectrum lamp.csv", &["lamp.ies", "lamp.csv"]),
    ("compress lamps.zip --member lamp.ies", &["lamps.zip"]),
    ("project brdf.npy", &["brdf.npy", "brdf.axes.json"]),
    ("project lamp.ies --spectrum lamp.csv", &["lamp.ies", "lamp.csv"]),
    ("decode brdf.wlm", &["brdf.wlm"]),
    ("preview brdf.wlm --illuminant light.csv --observer eye.csv", &["brdf.wlm", "light.csv", "eye.csv"]),
    ("reflectance brdf.wlm", &["brdf.wlm"]),
    ("export brdf.wlm --format rgl", &["brdf.wlm"]),
    ("export brdf.wlm --format npy", &["brdf.wlm"]),
    ("combine brdf.wlm second.wlm", &["brdf.wlm", "second.wlm"]),
    ("evaluate brdf.wlm --directions directions.csv", &["brdf.wlm", "directions.csv"]),
    ("sample brdf.wlm --directions points.csv", &["brdf.wlm", "points.csv"]),
];

/// Directory with a file for each input of [`LINES`]. They are refused before they are read, so most have no content of
/// their kind.
fn inputs() -> TempDir {
    let dir = workshop();
    for name in LINES.iter().flat_map(|(_, inputs)| *inputs) {
        if !dir.path().join(name).exists() {
            fs::write(dir.path().join(name), format!("bytes of {name}")).unwrap();
        }
    }
    dir
}

fn content(dir: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let entries = fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().path());
    entries.map(|path| (path.clone(), fs::read(path).unwrap_or_default())).collect()
}

fn run(dir: &Path, line: &str, stdin: Stdio) -> Output {
    let program =
        Command::new(env!("CARGO_BIN_EXE_wavelume")).args(line.split(' ')).current_dir(dir).stdin(stdin).output();
    program.unwrap()
}

/// Returns the message of a run that must be refused as wrong usage, and must not write anything.
fn refused(dir: &Path, line: &str, stdin: Stdio) -> String {
    let before = content(dir);
    let output = run(dir, line, stdin);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{line}: {stderr}");
    assert!(stderr.starts_with("wavelume: ") && stderr.lines().count() == 1, "{line}: {stderr}");
    assert_eq!(content(dir), before, "{line}: {stderr}");
    stderr
}

#[test]
fn the_table_has_every_command_that_writes_a_file() {
    let help = done(&["--help"]);
    let listed =
        help.lines().filter(|line| line.starts_with("  ") && !line.starts_with("   ") && !line.starts_with("  -"));
    let names: Vec<&str> = listed.filter_map(|line| line.split_whitespace().next()).collect();
    assert!(names.contains(&"compress") && names.contains(&"gc"), "{names:?}");
    // The pages of the manual and their directory are made by the command itself.
    let writes = |name: &&str| *name != "man" && done(&["help", name]).contains("--output <");
    for name in names.into_iter().filter(writes) {
        assert!(LINES.iter().any(|(line, _)| line.split(' ').next() == Some(name)), "{name}");
    }
}

#[test]
fn no_command_replaces_a_file_that_it_reads() {
    let dir = inputs();
    let at = |name: &str| dir.path().join(name);
    for (line, inputs) in LINES {
        for input in inputs {
            let other_case = input.to_uppercase();
            symlink(input, at("link")).unwrap();
            symlink("link", at("further")).unwrap();
            fs::hard_link(at(input), at("hard")).unwrap();
            // A file system that folds case gives one file under both names.
            fs::hard_link(at(input), at(&other_case)).unwrap();
            let roundabout = format!("../{}/{input}", dir.path().file_name().unwrap().to_str().unwrap());
            for output in [input, "link", "further", "hard", &other_case, &roundabout] {
                let message = refused(dir.path(), &format!("{line} -o {output}"), Stdio::null());
                let found = [format!("wavelume: {output}: is input and output at once"), format!("the input {input}")];
                assert!(found.iter().any(|part| message.contains(part)), "{line} {output}: {message}");
                assert!(message.contains("choose another --output"), "{message}");
            }
            for link in ["link", "further", "hard", &other_case] {
                fs::remove_file(at(link)).unwrap();
            }
        }
    }
}

#[test]
fn files_beside_an_output_and_standard_input_are_kept() {
    let dir = inputs();
    let at = |name: &str| dir.path().join(name);
    let message = refused(dir.path(), "project brdf.npy -o brdf.array", Stdio::null());
    assert!(message.contains("brdf.axes.json: is input and output at once"), "{message}");
    for (line, beside) in [
        ("decode brdf.wlm -o t.npy", "t.axes.json"),
        ("export brdf.wlm --format npy -o t.npy", "t.axes.json"),
        ("reflectance brdf.wlm -o t.npy", "t.axes.json"),
        ("project lamp.ies -o t.npy", "t.axes.json"),
        ("project lamp.ies -o t.npy", "t.filled.npy"),
    ] {
        fs::hard_link(at(line.split(' ').nth(1).unwrap()), at(beside)).unwrap();
        let message = refused(dir.path(), line, Stdio::null());
        assert!(message.contains(&format!("{beside}: would be written, and is the same file as")), "{message}");
        fs::remove_file(at(beside)).unwrap();
    }
    for line in ["evaluate brdf.wlm --directions - -o directions.csv", "sample brdf.wlm --directions - -o points.csv"] {
        let file = File::open(at(line.rsplit(' ').next().unwrap())).unwrap();
        let message = refused(dir.path(), line, file.into());
        assert!(message.contains("the same file as the input on stdin"), "{message}");
    }
}

#[test]
fn outputs_that_are_no_inputs_are_written() {
    let dir = workshop();
    let at = |name: &str| dir.path().join(name);
    fs::copy(data("aerolamp.ies"), at("lamp.ies")).unwrap();
    for line in [
        "compress brdf.npy -o brdf.wlm",
        // Again: an old output is no input.
        "compress brdf.npy -o brdf.wlm",
        "decode brdf.wlm -o t.npy",
        "decode brdf.wlm -o t.npy",
        "export brdf.wlm --format npy -o t.npy",
        "project t.npy -o again.npy",
        "compress lamp.ies -o /dev/null",
        "compress /dev/stdin -o lamp.wlm",
        "preview brdf.wlm -o picture.PNG",
        "evaluate brdf.wlm --directions - -o answers",
    ] {
        fs::write(at("directions.csv"), "theta_i,phi_i,theta_o,phi_o\n0,0,0,0\n").unwrap();
        let stdin = if line.contains("/dev/stdin") { "lamp.ies" } else { "directions.csv" };
        let stdin = File::open(at(stdin)).unwrap();
        let output = run(dir.path(), line, stdin.into());
        assert_eq!(output.status.code(), Some(0), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    }
    assert_eq!(fs::read_to_string(at("answers")).unwrap().lines().count(), 2);
}

#[test]
fn an_output_named_like_another_kind_of_file_is_refused() {
    let dir = inputs();
    for (line, other, wanted) in [
        ("compress lamp.ies", "x.ldt", "a material is written, but .ldt is another kind of file: name it .wlm"),
        ("compress lamp.ies", "x.PNG", "a material is written, but .png is another kind of file: name it .wlm"),
        ("combine brdf.wlm second.wlm", "x.csv", "name it .wlm"),
        ("project lamp.ies", "x.wlm", "a NumPy array is written, but .wlm is another kind of file: name it .npy"),
        ("decode brdf.wlm", "x.csv", "a NumPy array is written, but .csv is another kind of file: name it .npy"),
        (
            "preview brdf.wlm",
            "x.jpg",
            "a PNG or SVG picture is written, but .jpg is another kind of file: name it .png",
        ),
        ("preview brdf.wlm", "x.pdf", "name it .png"),
        ("reflectance brdf.wlm", "x.csv", "name it .wlm"),
        ("export brdf.wlm --format rgl", "x.mbsdf", "name it .bsdf"),
        ("export brdf.wlm --format merl", "x.wlm", "name it .binary"),
        ("export brdf.wlm --format npy", "x.csv", "name it .npy"),
        ("export brdf.wlm --format ies", "x.ldt", "lm63 is written, but .ldt is another kind of file: name it .ies"),
        ("evaluate brdf.wlm --directions directions.csv", "x.wlm", "name it .csv"),
        ("evaluate brdf.wlm --directions directions.csv --format csv", "x.npy", "name it .csv"),
        ("sample brdf.wlm --directions points.csv --format f32", "x.csv", "name it .f32"),
    ] {
        let message = refused(dir.path(), &format!("{line} -o {other}"), Stdio::null());
        assert!(message.starts_with(&format!("wavelume: {other}: ")), "{message}");
        assert!(message.contains(wanted), "{line}: {message}");
    }
}
