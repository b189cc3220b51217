//! The guide for labs: every block of Python in it is run, and `wavelume inspect` reads what it wrote.

use std::path::Path;
use std::process::Command;

/// The blocks of ```` ```python ```` in the guide.
fn blocks() -> Vec<String> {
    let guide = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/labs.md")).unwrap();
    let mut found = Vec::new();
    let mut rest = guide.as_str();
    while let Some((_, block)) = rest.split_once("```python\n") {
        let (block, after) = block.split_once("```").unwrap();
        found.push(block.to_owned());
        rest = after;
    }
    found
}

/// A Python that has the module, named by `WAVELUME_PYTHON` or else `python3`.
fn python_with(module: &str) -> Option<String> {
    let python = std::env::var("WAVELUME_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let found = Command::new(&python).args(["-c", &format!("import {module}")]).output().ok()?;
    found.status.success().then_some(python)
}

#[test]
fn every_script_writes_what_inspect_understands() {
    let directory = tempfile::tempdir().unwrap();
    let blocks = blocks();
    assert_eq!(blocks.len(), 10, "blocks in the guide");
    for (block, words) in blocks.iter().zip([
        &["spectral-table", "81"][..],
        &["radiometric-csv", "brdf", "a grid of directions"],
        &["radiometric-csv", "brdf, 1/sr", "a grid of directions", "divided by π"],
        &["radiometric-csv", "edf, mW/sr"],
        &["table of directions", "decimal comma", "brdf, 1/sr", "in the plane of incidence", "Windows-1252"],
        &["spectral-table", "reflectance, 1", "index (2)", "divided by 100", "2 lines of text after the data"],
        &["radiometric-csv", "1200 scattered directions", "too sparse for the lobe", "filled by reciprocity"],
        &["radiometric-arrow", "brdf", "a grid of directions"],
        &["npy", "brdf"],
        &["phase-table", "phase", "mean_cosine: 0.700"],
    ]) {
        let output = block.lines().next().unwrap().strip_prefix("# writes ").unwrap();
        let module = if block.contains("# needs pyarrow") { "pyarrow" } else { "numpy" };
        let Some(python) = python_with(module) else {
            panic!(
                "{output}: there is no {module}: python3 -m pip install numpy pyarrow, or name a Python that has them in WAVELUME_PYTHON"
            );
        };
        let ran = Command::new(python).arg("-c").arg(block).current_dir(&directory).output().unwrap();
        assert!(ran.status.success(), "{output}: {}", String::from_utf8_lossy(&ran.stderr));
        let mut inspect = Command::new(env!("CARGO_BIN_EXE_wavelume"));
        let inspected = inspect.arg("inspect").arg(output).current_dir(&directory).output().unwrap();
        let text = String::from_utf8(inspected.stdout).unwrap();
        assert!(inspected.status.success(), "{output}: {}", String::from_utf8_lossy(&inspected.stderr));
        for word in words {
            assert!(text.contains(word), "{output}: no {word} in\n{text}");
        }
    }
}
