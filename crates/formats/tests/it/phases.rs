//! Phase functions keep the scattering angles of their files, and are written back on them.

use crate::root;
use std::fs;
use wavelume_core::Material;
use wavelume_core::compress::Target;
use wavelume_core::domain::{Axis, Silent};
use wavelume_formats::export::{ExportFormat, ExportOptions, export};
use wavelume_formats::formats::Interpretation;
use wavelume_formats::pipeline::{Input, Request, compress, read};

fn material(name: &str, target: Target) -> (Material, usize) {
    let bytes = fs::read(root().join("tests/fixtures/phase").join(name)).unwrap();
    let interpretation = Interpretation::default();
    let source = read(&Input { bytes: &bytes, spectrum: None, interpretation: &interpretation }).unwrap();
    let made = compress(&source, &Request { metadata: false, ..Request::to(target) }, &Silent).unwrap();
    (Material::open(&made.bytes).unwrap(), made.bytes.len())
}

#[test]
fn a_list_over_the_cosine_takes_few_bytes_and_is_exported_as_long_as_it_was() {
    let (material, bytes) = material("henyey_greenstein_tabphase.txt", Target::ErL2(0.01));
    assert!(bytes < 100, "{bytes} bytes");
    let Axis::Grid(grid) = &material.axes()[1] else { panic!("{:?}", material.axes()) };
    assert_eq!((grid.polar().len(), grid.polar()[60]), (121, 90.0));
    let exported = export(&material, ExportFormat::Tabphase, &ExportOptions::default()).unwrap();
    let numbers = |text: &str| text.trim().split(',').map(|cell| cell.trim().parse().unwrap()).collect::<Vec<f64>>();
    let made = numbers(std::str::from_utf8(&exported.bytes).unwrap());
    let stated = fs::read_to_string(root().join("tests/fixtures/phase/henyey_greenstein_tabphase.txt")).unwrap();
    let stated = numbers(stated.lines().filter(|line| !line.starts_with('#')).collect::<Vec<_>>().join(" ").as_str());
    assert_eq!(made.len(), stated.len());
    // The file states 4 pi times the function.
    let scale = made.iter().sum::<f64>() / stated.iter().sum::<f64>();
    let squares: f64 = made.iter().zip(&stated).map(|(made, stated)| (made / (scale * stated) - 1.0).powi(2)).sum();
    assert!((squares / stated.len() as f64).sqrt() <= 0.011, "{squares}");
}

#[test]
fn other_lists_keep_their_angles() {
    let (material, bytes) = material("ocean_vsf.csv", Target::ErL2(0.01));
    assert!(bytes < 200, "{bytes} bytes");
    let Axis::Grid(grid) = &material.axes()[1] else { panic!("{:?}", material.axes()) };
    assert_eq!((grid.polar().len(), grid.polar()[30]), (31, 179.9));
}
