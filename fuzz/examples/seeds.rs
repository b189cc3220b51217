//! Writes the seeds of every target into the given directory: small materials of every policy, promise and kind of
//! axis, and small files of every format.
//!
//! `cargo run --release --example seeds -- corpus`

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use wavelume_core::compress::{Between, Divisor, Policy, Settings, Target, compress};
use wavelume_core::domain::{
    Axis, AzimuthExtent, Azimuths, CENTRES, DirectionGrid, Domain, Frame, Lobe, LobeParameters, Measurement, Quantity,
    Sampling, Silent, Tensor, TriangleMesh, WavelengthGrid,
};
use wavelume_formats::formats::{Interpretation, manifest_of, write_npy};
use wavelume_formats::pipeline::{self, Input, Request};
use wavelume_fuzz::SEPARATOR;

/// Largest size of a seed in bytes; larger files of a format are cut to it.
const MOST_BYTES: usize = 1 << 13;

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> Outcome<()> {
    let corpus = PathBuf::from(std::env::args().nth(1).ok_or("the directory of the corpora is missing")?);
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let golden = golden(&root)?;
    let materials = [materials(&root)?, golden.clone()].concat();
    for target in ["decode", "decode_sealed", "decode_prefix", "decode_block", "material"] {
        save(&corpus.join(target), &materials)?;
    }
    save(&corpus.join("grids"), &[grids()?, golden].concat())?;
    save(&corpus.join("formats"), &files(&root)?)?;
    Ok(())
}

/// The container's golden files, among which each kind of chunk is.
fn golden(root: &Path) -> Outcome<Vec<Vec<u8>>> {
    let mut files: Vec<PathBuf> =
        fs::read_dir(root.join("tests/container/golden"))?.map(|entry| Ok(entry?.path())).collect::<Outcome<_>>()?;
    files.retain(|file| file.extension().is_some_and(|extension| extension == "wlm"));
    files.sort();
    files.iter().map(|file| Ok(fs::read(file)?)).collect()
}

fn save(directory: &Path, seeds: &[Vec<u8>]) -> Outcome<()> {
    fs::create_dir_all(directory)?;
    for seed in seeds {
        fs::write(directory.join(&blake3::hash(seed).to_hex()[..16]), seed)?;
    }
    println!("{}: {} seeds, {} bytes", directory.display(), seeds.len(), seeds.iter().map(Vec::len).sum::<usize>());
    Ok(())
}

fn mesh(domain: Domain, level: u8) -> Axis {
    Axis::Triangles(TriangleMesh::new(domain, level).expect("a level within the limit"))
}

fn wavelengths(count: usize) -> Axis {
    Axis::Wavelength(WavelengthGrid::even(380.0, 400.0 / count as f64, count).expect("a valid grid"))
}

fn uneven(count: usize) -> Axis {
    let values = (0..count).map(|i| f64::from((380.0 + 7.3 * i as f64 + 0.01 * (i * i) as f64) as f32)).collect();
    Axis::Wavelength(WavelengthGrid::listed(values).expect("a valid grid"))
}

fn index(count: usize) -> Axis {
    Axis::Index { count, labels: (0..count).map(|i| format!("patch {i}")).collect() }
}

/// Smooth positive function of the axes; if `hurt`, with noise and negative, zero and masked samples.
fn measurement(quantity: Quantity, axes: Vec<Axis>, hurt: bool) -> Outcome<Measurement> {
    let shape: Vec<usize> = axes.iter().map(Axis::len).collect();
    let mut state = 1_u32;
    let sample = |flat: usize| {
        let mut rest = flat;
        let mut value = 0.3;
        for (axis, n) in axes.iter().zip(&shape).rev() {
            let i = rest % n;
            rest /= n;
            value *= match axis {
                Axis::Triangles(mesh) => 1.2 + mesh.centroid(i).xyz()[2] * 0.7,
                Axis::Grid(grid) => 1.2 + grid.direction(i).xyz()[2] * 0.7,
                _ => 1.0 + 0.5 * (i as f64 / *n as f64 * 3.0).sin(),
            };
        }
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        match (hurt, flat % 17) {
            (false, _) => value as f32,
            (true, 3) => (-0.1 * value) as f32,
            (true, 5 | 6) => 0.0,
            (true, 11) => f32::NAN,
            (true, _) => (value * (1.0 + 0.02 * f64::from(state >> 16) / 65_536.0)) as f32,
        }
    };
    let samples = (0..shape.iter().product()).map(sample).collect();
    let tensor = Tensor::new(axes, samples)?;
    Ok(Measurement::new(quantity, quantity.default_unit(), Sampling::Average, tensor)?)
}

fn measurements() -> Outcome<Vec<Measurement>> {
    let elevations = || Axis::Elevation((0..6).map(|i| f64::from(i) * 15.0).collect());
    let kinds = [
        (Quantity::Spectrum, vec![wavelengths(1)]),
        (Quantity::Spectrum, vec![wavelengths(40)]),
        (Quantity::Spectrum, vec![uneven(23)]),
        (Quantity::Reflectance, vec![index(5), wavelengths(16)]),
        (Quantity::Edf, vec![mesh(Domain::Sphere, 2)]),
        (Quantity::Edf, vec![mesh(Domain::Sphere, 1), wavelengths(9)]),
        (Quantity::Brdf, vec![mesh(Domain::Hemisphere, 0), mesh(Domain::Hemisphere, 1), wavelengths(7)]),
        (Quantity::Brdf, vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 2)]),
        (Quantity::Brdf, vec![elevations(), mesh(Domain::Hemisphere, 2), Axis::Rgb]),
        (Quantity::Btdf, vec![mesh(Domain::Hemisphere, 0), mesh(Domain::Lower, 2)]),
        (Quantity::Bsdf, vec![mesh(Domain::Hemisphere, 0), mesh(Domain::Sphere, 1), uneven(5)]),
        (Quantity::Phase, vec![mesh(Domain::Sphere, 1), mesh(Domain::Sphere, 1)]),
        (Quantity::Brdf, vec![index(3), index(4), wavelengths(6)]),
        (Quantity::Brdf, vec![index(2), mesh(Domain::Hemisphere, 0), mesh(Domain::Hemisphere, 1), Axis::Rgb]),
    ];
    let mut all = Vec::new();
    for (quantity, axes) in kinds {
        for hurt in [false, true] {
            all.push(measurement(quantity, axes.clone(), hurt)?);
        }
    }
    Ok(all)
}

/// Microfacet lobe of roughness 0.2 over a constant, for incoming and outgoing directions on the first two axes.
fn glossy(axes: Vec<Axis>) -> Outcome<Measurement> {
    let (incoming, outgoing) = (axes[0].clone(), axes[1].clone());
    let rest: usize = axes[2..].iter().map(Axis::len).product();
    let places = (0..incoming.len()).flat_map(|i| (0..outgoing.len()).map(move |o| (i, o)));
    let mut samples = Vec::new();
    for (i, o) in places {
        let (Some(wi), Some(wo)) = (incoming.direction(i), outgoing.direction(o)) else {
            return Err("the first two axes hold no directions".into());
        };
        let (wi, wo) = (wi.xyz(), wo.xyz());
        let half = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
        let cosine2 = half[2] * half[2] / half.iter().map(|x| x * x).sum::<f64>();
        let slopes = 1.0 - cosine2 * (1.0 - 0.2 * 0.2);
        let value = 0.1 + 0.01 / (slopes * slopes) / (0.1 + wi[2].max(0.0) + wo[2].max(0.0));
        samples.extend((0..rest).map(|band| (value * (1.0 + 0.1 * band as f64)) as f32));
    }
    let tensor = Tensor::new(axes, samples)?;
    Ok(Measurement::new(Quantity::Brdf, Quantity::Brdf.default_unit(), Sampling::Average, tensor)?)
}

/// Materials on grids of angles, with every extent of azimuths. They have one stream or one for each incoming entry, a
/// basis or channels, light, corrections, levels, straight lines, samples divided by a function, and lossless coding.
fn grids() -> Outcome<Vec<Vec<u8>>> {
    let every = |step: f64, count: usize| -> Vec<f64> { (0..count).map(|i| f64::from(i as u32) * step).collect() };
    let grid = |frame, polar, angles: Vec<f64>, extent| -> Outcome<Axis> {
        Ok(Axis::Grid(DirectionGrid::new(frame, polar, Some(Azimuths { angles, extent }))?))
    };
    let elevations = Axis::Elevation(vec![0.0, 20.0, 50.0, 80.0]);
    let half = grid(Frame::Surface, vec![0.0, 8.0, 30.0, 31.0, 70.0], every(30.0, 7), AzimuthExtent::Mirrored)?;
    let kinds = [
        (Quantity::Edf, vec![grid(Frame::TypeC, every(10.0, 19), every(30.0, 13), AzimuthExtent::Closed)?]),
        (Quantity::Edf, vec![grid(Frame::TypeC, every(2.5, 37), every(15.0, 24), AzimuthExtent::Circle)?]),
        (
            Quantity::Edf,
            vec![grid(Frame::TypeB, every(10.0, 10), every(22.5, 5), AzimuthExtent::Quadrant)?, wavelengths(9)],
        ),
        (Quantity::Edf, vec![Axis::Grid(DirectionGrid::new(Frame::TypeC, every(5.0, 19), None)?)]),
        (Quantity::Edf, vec![grid(Frame::TypeA, every(10.0, 9), every(10.0, 6), AzimuthExtent::Sector)?]),
        (Quantity::Brdf, vec![elevations.clone(), half.clone(), Axis::Rgb]),
        (Quantity::Brdf, vec![elevations.clone(), half.clone()]),
        (Quantity::Brdf, vec![half.clone(), half.clone()]),
    ];
    let plain = |target| Settings { target, metadata: None, ..Settings::default() };
    let wanted = [
        plain(Target::ErL2(0.03)),
        plain(Target::ErL2(0.002)),
        plain(Target::Lossless),
        plain(Target::MaxRelativeError(0.03)),
        Settings { straight_lines: 100, albedo_error: Some(1e-3), ..plain(Target::ErL2(0.1)) },
        Settings { random_access: true, albedo_error: Some(1e-3), ..plain(Target::ErL2(0.1)) },
        Settings { floor: Some(0.1), ..plain(Target::ErL2(0.05)) },
        Settings { basis: "klt".to_owned(), ..plain(Target::ErL2(0.02)) },
        Settings {
            between: Between { divisor: Divisor::Masking { roughness: 0.2 }, cubic: false, retro: true },
            ..plain(Target::ErL2(0.2))
        },
        Settings {
            between: Between { divisor: Divisor::Cosines, cubic: true, retro: false },
            ..plain(Target::Lossless)
        },
    ];
    let mut files = Vec::new();
    for (quantity, axes) in kinds {
        for hurt in [false, true] {
            let measurement = measurement(quantity, axes.clone(), hurt)?;
            for settings in &wanted {
                // Combinations that cannot keep the promise give no seed.
                files.extend(compress(&measurement, settings, &Silent).map(|compressed| compressed.bytes));
            }
        }
    }
    let divisors = [
        Divisor::Cosines,
        Divisor::ProjectedAreas { roughness: 0.2 },
        Divisor::Masking { roughness: 0.2 },
        Divisor::Model { roughness: 0.2, reflectance: 0.04, base: 0.3 },
        Divisor::Model { roughness: 0.2, reflectance: 0.9, base: 0.0 },
    ];
    for axes in [vec![elevations.clone(), half.clone()], vec![elevations, half, wavelengths(9)]] {
        let measurement = glossy(axes)?;
        for divisor in divisors {
            let between = Between { divisor, cubic: true, retro: false };
            for settings in [plain(Target::ErL2(0.01)), plain(Target::ErL2(0.1))] {
                for random_access in [false, true] {
                    let settings = Settings { between, random_access, ..settings.clone() };
                    files.push(compress(&measurement, &settings, &Silent)?.bytes);
                }
            }
        }
    }
    Ok(files)
}

fn materials(root: &Path) -> Outcome<Vec<Vec<u8>>> {
    let settings = |target, policy, basis: &str, metadata: bool| Settings {
        target,
        policy,
        basis: basis.to_owned(),
        floor: None,
        albedo_error: None,
        straight_lines: 0,
        between: Between::default(),
        lobe: None,
        random_access: false,
        metadata: metadata.then(|| r#"{"generator":"seeds"}"#.to_owned()),
    };
    let floored = Settings { floor: Some(0.2), ..settings(Target::ErL2(0.03), Policy::Rd, "haar", false) };
    let lit = Settings { albedo_error: Some(1e-4), ..settings(Target::ErL2(0.05), Policy::Rd, "klt", false) };
    let model = Divisor::Model { roughness: 0.2, reflectance: 0.04, base: 0.3 };
    let between = |cubic| Settings {
        between: Between { divisor: model, cubic, retro: false },
        ..settings(Target::ErL2(0.05), Policy::Rd, "auto", false)
    };
    let random = |target| Settings { random_access: true, ..settings(target, Policy::Rd, "auto", false) };
    let wanted = [
        lit,
        between(false),
        between(true),
        random(Target::ErL2(0.02)),
        random(Target::RelativeRmse(0.02)),
        settings(Target::MaxAbsoluteError(0.01), Policy::Rd, "auto", false),
        settings(Target::RelativeRmse(0.02), Policy::Rd, "auto", false),
        settings(Target::ErL2(0.03), Policy::Rd, "auto", true),
        settings(Target::ErL2(0.002), Policy::Rd, "klt", false),
        settings(Target::ErL2(0.02), Policy::Rd, "bior4.4", false),
        settings(Target::MaxRelativeError(0.02), Policy::Rd, "auto", false),
        settings(Target::MaxRelativeError(0.1), Policy::Rd, "identity", false),
        settings(Target::Ratio(8.0), Policy::Rd, "db4", false),
        floored,
        settings(Target::ErL2(0.05), Policy::Conventional, "coif2", false),
        settings(Target::ErL2(0.05), Policy::Generic, "sym5", false),
        settings(Target::ErL2(0.05), Policy::Adaptive, "haar", true),
        settings(Target::Lossless, Policy::Rd, "auto", false),
    ];
    let mut files = Vec::new();
    for measurement in measurements()? {
        for lobe in lobes(&measurement)? {
            let settings = Settings { lobe: Some(lobe), ..settings(Target::ErL2(0.05), Policy::Rd, "auto", false) };
            files.extend(compress(&measurement, &settings, &Silent).map(|compressed| compressed.bytes));
        }
        for settings in &wanted {
            // Combinations that cannot keep the promise give no seed.
            files.extend(compress(&measurement, settings, &Silent).map(|compressed| compressed.bytes));
        }
    }
    for path in in_order(&root.join("data/virtual"))? {
        let bytes = fs::read(path)?;
        let interpretation = Interpretation::default();
        let mut source = pipeline::read(&Input { bytes: &bytes, spectrum: None, interpretation: &interpretation })?;
        source.acquisition.report.metadata.clear();
        let levels = [(Some(0), Some(2)), (None, Some(2)), (None, Some(1))];
        for (incoming_level, outgoing_level) in levels {
            let wavelengths = Some("400:700:50".to_owned());
            let request = Request { incoming_level, outgoing_level, wavelengths, ..Request::to(Target::ErL2(0.01)) };
            for request in [request.clone(), Request { wavelengths: None, ..request }] {
                if let Ok(outcome) = pipeline::compress(&source, &request, &Silent)
                    && outcome.bytes.len() <= MOST_BYTES
                {
                    files.push(outcome.bytes);
                }
            }
        }
    }
    Ok(files)
}

/// Lobes to add beside the cells of a measurement.
fn lobes(measurement: &Measurement) -> Outcome<Vec<Lobe>> {
    let Ok(layout) = measurement.layout() else { return Ok(Vec::new()) };
    let length = layout.spectral.map_or(1, |axis| measurement.tensor.axes()[axis].len());
    let mut lobes = Vec::new();
    for (centre, widths) in CENTRES.into_iter().zip([[0.02, 0.02], [0.01, 0.03], [0.5, 0.5]]) {
        lobes.push(Lobe::new(LobeParameters {
            centre,
            peak: [4.0, 0.5, -0.25],
            range: [0.0, 1.0],
            widths,
            angle: 0.5,
            tail: 0.25,
            colours: vec![0.75; length],
        })?);
    }
    Ok(lobes)
}

fn files(root: &Path) -> Outcome<Vec<Vec<u8>>> {
    let mut files = Vec::new();
    for directory in ["data", "tests/fixtures"] {
        for path in in_order(&root.join(directory))? {
            let mut bytes = fs::read(&path)?;
            bytes.truncate(MOST_BYTES);
            // Virtual documents get fewer cells, so that they are evaluated.
            if path.extension().is_some_and(|extension| extension == "json") {
                let mut document: serde_json::Value = serde_json::from_slice(&bytes)?;
                let axes = document["axes"].as_array_mut().ok_or("a document without axes")?;
                for axis in axes.iter_mut() {
                    let text = axis.as_str().ok_or("an axis in a long form")?;
                    let kind = text.split(':').next().unwrap_or_default();
                    *axis = if kind == "lambda" { "lambda:400:60:6".into() } else { format!("{kind}:1").into() };
                }
                bytes = document.to_string().into_bytes();
            }
            files.push(bytes);
        }
    }
    for measurement in measurements()? {
        let mut file = write_npy(&measurement.tensor.shape(), measurement.tensor.samples());
        file.push(SEPARATOR);
        file.extend(manifest_of(&measurement).to_string().bytes());
        if file.len() <= MOST_BYTES {
            files.push(file);
        }
    }
    let angles = serde_json::json!({"quantity": "brdf", "axes": [
        {"kind": "theta_i", "values": [0, 30, 60]}, {"kind": "theta_o", "values": [0, 45, 90]},
        {"kind": "phi_o", "values": [0, 90, 180, 270]}, "rgb"]});
    let samples: Vec<f32> = (0..108).map(|i| i as f32).collect();
    let array = write_npy(&[3, 3, 4, 3], &samples);
    files.push([&array, [SEPARATOR].as_slice(), angles.to_string().as_bytes()].concat());
    Ok(files)
}

/// All data files below a directory, in the order of their paths.
fn in_order(directory: &Path) -> Outcome<Vec<PathBuf>> {
    let (mut found, mut directories) = (Vec::new(), vec![directory.to_owned()]);
    while let Some(directory) = directories.pop() {
        for entry in fs::read_dir(directory)? {
            let path = entry?.path();
            let texts = path.extension().is_some_and(|extension| extension == "md");
            if path.is_dir() {
                directories.push(path);
            } else if !texts && !path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("LICENSE")) {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}
