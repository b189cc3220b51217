//! Regression tests of exact results: digests of compressed files, of every export, and of batches evaluated and drawn,
//! compared with `tests/golden/recorded.txt`.
//!
//! A change that intentionally alters them rewrites the list, and its commit states which lines changed and why:
//! `WAVELUME_RECORD=1 cargo test -p wavelume-formats --test it recorded`.

use crate::{one_in, root};
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use wavelume_core::compress::Target;
use wavelume_core::domain::Silent;
use wavelume_core::evaluate::{
    Beyond, Chosen, Density, Directions, Drawings, EvaluateError, Interpolation, Material, Pairs, SampleOptions,
};
use wavelume_formats::export::{ExportFormat, ExportOptions, export, fitting};
use wavelume_formats::formats::Interpretation;
use wavelume_formats::pipeline::{Input, Request, compress, digest, read};
use wavelume_formats::projection::DirectionDomain;

/// Folders of files that are read, compressed and opened; what is not a measurement is left out.
const FOLDERS: [&str; 10] = [
    "data",
    "tests/fixtures/arrow",
    "tests/fixtures/ies",
    "tests/fixtures/instruments",
    "tests/fixtures/ldt",
    "tests/fixtures/mbsdf",
    "tests/fixtures/phase",
    "tests/fixtures/rgl",
    "tests/fixtures/spectra",
    "tests/fixtures/spectra/spectralon",
];
/// Files that are slow at their own resolution; they are projected onto the triangles of `LEVEL`.
const LARGE: [&str; 7] = [
    "data/carpaint_blue.mbsdf",
    "henyey_greenstein_angles",
    "henyey_greenstein_moments",
    "nukit",
    "tabphase",
    "ushio",
    "vsf",
];
const LEVEL: u8 = 3;
/// A file whose own grid takes too long in a build without optimisation.
const SLOW: &str = "data/carpaint_blue.mbsdf";
/// Files whose materials are exported in every format that holds them.
const EXPORTED: [&str; 5] =
    ["scattered scan", "examp1.ies", "henyey_greenstein_moments", "data/illuminant_B", "test_rgb_theta_2_phi_3"];
/// Number of direction pairs evaluated per material: three full blocks and a partial one.
const PAIRS: usize = 151;

/// Digests by name.
type List = BTreeMap<String, String>;

/// Points of a sequence that fills the unit square evenly (R2, Roberts 2018).
fn point(i: usize) -> [f64; 2] {
    [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (0.5 + i as f64 * step).fract())
}

/// Returns a narrow lobe over a base, as measured by a goniometer without a grid: three elevations of the lamp, three
/// wavelengths.
fn scattered_scan() -> Vec<u8> {
    let mut text =
        "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n# angle_unit: deg\n\
                    # isotropic: true\ntheta_i,theta_o,phi_o,lambda,value\n"
            .to_owned();
    for theta_i in [8.0_f64, 30.0, 55.0] {
        let (lamp_sin, lamp_cos) = libm::sincos(theta_i.to_radians());
        for i in 0..700 {
            let [u, v] = point(i);
            let (z, phi) = (1.0 - 0.97 * u, TAU * v);
            let radius = (1.0 - z * z).sqrt();
            let half = [radius * libm::cos(phi) + lamp_sin, radius * libm::sin(phi), z + lamp_cos];
            let length = half.iter().map(|x| x * x).sum::<f64>().sqrt();
            let lobe = libm::exp(-40.0 * (1.0 - half[2] / length)) / (4.0 * z.max(0.2));
            for (k, lambda) in [450, 550, 650].into_iter().enumerate() {
                let value = (0.1 + 0.05 * k as f64) / PI + lobe;
                let (theta, phi) = (libm::acos(z).to_degrees(), phi.to_degrees());
                writeln!(text, "{theta_i},{theta:.4},{phi:.4},{lambda},{value:.6}").unwrap();
            }
        }
    }
    text.into_bytes()
}

/// Returns true for a fixture of which `data` has a copy.
fn in_data(path: &Path) -> bool {
    path.starts_with(root().join("tests"))
        && path.file_name().is_some_and(|name| root().join("data").join(name).exists())
}

/// Returns the names and bytes of the files.
fn inputs() -> Vec<(String, Vec<u8>)> {
    let mut paths: Vec<PathBuf> = FOLDERS
        .iter()
        .flat_map(|folder| fs::read_dir(root().join(folder)).unwrap())
        .map(|entry| entry.unwrap().path())
        // Luminaires that are also in `data` are left out.
        .filter(|path| path.is_file() && !in_data(path))
        .collect();
    paths.sort();
    let named = |path: PathBuf| {
        let name = path.strip_prefix(root()).unwrap().display().to_string();
        (name, fs::read(&path).unwrap())
    };
    let files = paths.into_iter().map(named);
    files.chain([("scattered scan".to_owned(), scattered_scan())]).collect()
}

fn bits(numbers: &[f32]) -> String {
    let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
    digest(&bytes)
}

/// Unit vectors over the upper hemisphere, or over the whole sphere, as arrays of coordinates.
fn directions(offset: usize, over_sphere: bool) -> [Vec<f32>; 3] {
    let mut to = [(); 3].map(|()| Vec::with_capacity(PAIRS));
    for i in 0..PAIRS {
        let [u, v] = point(i + offset);
        let z = if over_sphere { 2.0 * u - 1.0 } else { u };
        let radius = (1.0 - z * z).sqrt();
        for (to, x) in to.iter_mut().zip([radius * libm::cos(TAU * v), radius * libm::sin(TAU * v), z]) {
            to.push(x as f32);
        }
    }
    to
}

/// Runs everything that a renderer needs of a material, in batches.
fn ask(name: &str, material: &Material, list: &mut List) -> Result<(), EvaluateError> {
    let index = vec![0; material.layout().indices];
    let [wi, wo] = [directions(7, false), directions(1_000, true)];
    let wi = material.layout().incoming.map(|_| Directions::new(&wi[0], &wi[1], &wi[2]));
    let wo = material.layout().outgoing.map(|_| Directions::new(&wo[0], &wo[1], &wo[2]));
    let pairs = Pairs { index: &index, wi, wo };
    let count = if wi.is_none() && wo.is_none() { 1 } else { PAIRS };
    for how in [Interpolation::Constant, Interpolation::Smooth] {
        let mut out = vec![0.0; count * material.lambdas()];
        material.spectra(pairs, how, &mut out)?;
        list.insert(format!("{name}: spectra {how:?}"), bits(&out));
    }
    if wo.is_none() {
        return Ok(());
    }
    let lambdas = material.wavelengths().map(|all| [all[0], all[all.len() / 2], all[all.len() - 1]]);
    let chosen = lambdas.map(|lambdas| material.choose(&lambdas, Beyond::Nearest)).transpose()?;
    for density in [Density::Uniform, Density::Linear] {
        let options = SampleOptions { density, ..SampleOptions::default() };
        let mut out = vec![0.0; PAIRS];
        material.pdfs(pairs, options, &mut out)?;
        let rounded: Vec<f32> = out.iter().map(|&pdf| pdf as f32).collect();
        list.insert(format!("{name}: pdf {density:?}"), bits(&rounded));
        if let Some(chosen) = &chosen {
            list.insert(format!("{name}: samples {density:?}"), drawn(chosen, &pairs, options)?);
        }
    }
    Ok(())
}

fn drawn(chosen: &Chosen<'_>, pairs: &Pairs<'_>, options: SampleOptions) -> Result<String, EvaluateError> {
    let [u, v] = [0, 1].map(|k| (0..PAIRS).map(|i| point(i + 77)[k] as f32).collect::<Vec<f32>>());
    let [mut x, mut y, mut z, mut pdf] = [(); 4].map(|()| vec![0.0; PAIRS]);
    let mut weights = vec![0.0; PAIRS * chosen.wavelengths().len()];
    let out = Drawings { x: &mut x, y: &mut y, z: &mut z, pdf: &mut pdf, weights: &mut weights };
    chosen.samples(pairs.index, pairs.wi, [&u, &v], options, out)?;
    Ok(bits(&[x, y, z, pdf, weights].concat()))
}

/// Opens a file and asks its material.
fn opened(name: &str, bytes: &[u8], list: &mut List) -> Material {
    list.insert(format!("{name}: compressed to 1 %"), digest(bytes));
    let material = Material::open(bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
    if let Err(error) = ask(name, &material, list) {
        panic!("{name}: {error}");
    }
    material
}

/// Returns the digests of everything computed from one file.
fn made_of(name: &str, bytes: &[u8]) -> List {
    let mut list = List::new();
    let interpretation = Interpretation::default();
    let Ok(source) = read(&Input { bytes, spectrum: None, interpretation: &interpretation }) else { return list };
    let outgoing_level = LARGE.iter().any(|large| name.contains(large)).then_some(LEVEL);
    let request = Request { metadata: false, outgoing_level, ..Request::to(Target::ErL2(0.01)) };
    let triangles = Request { domain: Some(DirectionDomain::Triangles), ..request.clone() };
    let Ok(outcome) = compress(&source, &triangles, &Silent) else { return list };
    let material = opened(name, &outcome.bytes, &mut list);
    let as_stated = Request { outgoing_level: None, ..request };
    if !name.contains(SLOW)
        && let Ok(on_grid) = compress(&source, &as_stated, &Silent)
        && on_grid.bytes != outcome.bytes
    {
        opened(&format!("{name}, on its grid"), &on_grid.bytes, &mut list);
    }
    let is_exported = EXPORTED.iter().any(|exported| name.contains(exported));
    for format in fitting(&material).into_iter().filter(|_| is_exported) {
        // A MERL table is large and always the same grid: one is enough.
        if format == ExportFormat::Merl && !name.contains("rgb") {
            continue;
        }
        let index = vec![0; material.layout().indices];
        let options = ExportOptions {
            index: (!index.is_empty()).then_some(index),
            most_bytes: 1 << 26,
            ..ExportOptions::default()
        };
        if let Ok(exported) = export(&material, format, &options) {
            list.insert(format!("{name}: export {}", format.name()), digest(&exported.bytes));
        }
    }
    list
}

#[test]
fn files_exports_and_batches_are_those_that_were_recorded() {
    let golden = root().join("tests/golden/recorded.txt");
    let rewrites = std::env::var_os("WAVELUME_RECORD").is_some();
    let all = inputs();
    let some: Vec<_> = one_in(if rewrites { 1 } else { 5 }, 0, &all).collect();
    let found: List = some.iter().flat_map(|(name, bytes)| made_of(name, bytes)).collect();
    let text = found.iter().fold(String::new(), |text, (name, digest)| text + digest + " " + name + "\n");
    if rewrites {
        fs::write(&golden, &text).unwrap();
    }
    let recorded = fs::read_to_string(&golden).unwrap_or_default();
    let recorded: List = recorded
        .lines()
        .filter_map(|line| line.split_once(' '))
        .filter(|(_, what)| some.iter().any(|(name, _)| what.starts_with(name.as_str())))
        .map(|(d, name)| (name.to_owned(), d.to_owned()))
        .collect();
    let differing: Vec<&String> =
        recorded.keys().chain(found.keys()).filter(|name| recorded.get(*name) != found.get(*name)).collect();
    assert!(
        differing.is_empty(),
        "{} of {} differ from {}: {differing:#?}",
        differing.len(),
        found.len(),
        golden.display()
    );
    let things = found.len() * all.len() / some.len();
    assert!(things > 250, "only {} things were made of {} files", found.len(), some.len());
}
